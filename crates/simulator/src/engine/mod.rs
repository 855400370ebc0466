//! The discrete-event executor: futures of processors go in, are resumed as their operations take effect in simulated
//! time, and leave a clock, accounts and a trace.

mod blocks;
mod event;
mod memory;
mod phases;
mod processor;
mod queue;
mod simulator;
mod spans;
mod state;
mod time;
mod trace;
mod watch;

pub use memory::{Memory, Uniform};
pub use processor::ProcessorOf;
pub use simulator::{Polling, SimulatorOf};
pub use trace::{Interval, Trace};
