//! The hierarchical radiosity method as parallel programs: a problem and a machine go in; light, and where the machine's time
//! went, come out. What kernels compute is left to `isolux-core`, what operations cost to the machine.
//!
//! Two organisations make tasks, after Podehl, Rauber and Rünger (1996): `splash`, SPLASH-2's, with a queue for each processor
//! and stealing; and `sbpram`, with one queue and loops. [`Switches`] lead from the one to the other. The third, `wavefront`, has
//! loops alone. Everything that tasks
//! share lies in words of the machine (`store.rs`), so each organisation is one program for real threads and for simulated
//! machines alike.

mod cost;
mod pairs;
mod phases;
mod problem;
mod queues;
mod run;
mod sbpram;
mod splash;
mod store;
mod task;
mod variant;
mod wavefront;
mod worker;

pub use cost::{CLASSES, COST_MODEL, corner_steps, sorting_depth};
pub use pairs::{Direct, Memory, Pairs, Remembered, Touched};
pub use problem::{Place, Problem};
pub use run::{Hear, IterationOutcome, Outcome, PhaseName, ScheduleError, TreeDiffers, run};
pub use store::Sizes;
pub use variant::{Grain, Schedule, Switches};
pub use worker::Tally;
