//! Parallel machines as schedules see them: processors that await operations on shared words, protocols built from
//! these operations alone, two machines that need no simulator, and the contract that every machine fulfils. What is
//! computed in parallel is left to others; nothing here knows what a word means.
//!
//! A program is an async function of a [`Processor`]. Every processor of a [`Machine`] runs it:
//!
//! ```
//! use isolux_machine::{Home, Machine, Prefix, Processor, Region, Threads};
//!
//! async fn draw<P: Processor>(p: P, counter: Region) -> u64 {
//!     p.prefix(Prefix::Add, counter.at(0), 1).await
//! }
//!
//! let mut machine = Threads::new(4, &[])?;
//! let counter = machine.allocate("counter", 1, Home::RoundRobin)?;
//! let run = machine.run(|p| draw(p, counter))?;
//! let mut drawn = run.values;
//! drawn.sort_unstable();
//! assert_eq!(drawn, [0, 1, 2, 3]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod contract;
mod machine;
mod memory;
mod operation;
mod processor;
pub mod protocols;
mod run;
mod sequential;
mod threads;

pub use machine::{ClassError, Fault, Machine, RunError, Wait, check_request};
pub use memory::{Address, Home, Layout, MemoryError, PAGE_WORDS, Region, Words};
pub use operation::{BarrierId, Condition, LockId, Prefix, Sequence, Work, WorkClass};
pub use processor::{BLOCK_WORDS, Cause, Mark, Note, Processor};
pub use run::{ByCause, ClockUnit, Counts, Run};
pub use sequential::{Sequential, SequentialProcessor};
pub use threads::{Thread, Threads};
