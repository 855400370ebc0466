//! Simulated machines: a program of [`isolux_machine`] goes in and really runs, its operations taking effect in
//! simulated time; a clock, accounts and a trace come out. What the program computes is left to it. README.md of this
//! crate says what costs what, and what is not modelled.
//!
//! ```
//! use isolux_machine::{Home, Machine, Prefix, Processor};
//! use isolux_simulator::{MachineSpec, Simulator};
//!
//! let mut machine = Simulator::new(&MachineSpec::named("sb-pram")?, 1000, &[])?;
//! let counter = machine.allocate("counter", 1, Home::RoundRobin)?.at(0);
//! let run = machine.run(async |p: isolux_simulator::SimulatedProcessor| p.prefix(Prefix::Add, counter, 1).await)?;
//! assert_eq!(run.clock, 2, "a multiprefix takes two units, whatever the number of participants");
//! assert!(run.values.into_iter().eq(0..1000), "in the order of the processors");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod caches;
mod engine;
mod spec;

pub use caches::Caches;
pub use engine::{Interval, Memory, Polling, ProcessorOf, SimulatorOf, Trace, Uniform};
pub use spec::{MachineSpec, SpecError};

/// A simulated machine with uniform access to its words.
pub type Simulator = SimulatorOf<Uniform>;
/// A processor of a [`Simulator`].
pub type SimulatedProcessor = ProcessorOf<Uniform>;
/// A simulated machine with caches and a directory.
pub type CacheSimulator = SimulatorOf<Caches>;
/// A processor of a [`CacheSimulator`].
pub type CacheProcessor = ProcessorOf<Caches>;
