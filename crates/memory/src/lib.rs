//! The memory system of a cache-coherent NUMA machine: accesses come in one after the other, the level that served each
//! and its cost in clocks go out; time, contention and what the data mean are left to the caller.
//!
//! The protocol, its costs and what it leaves out are in `crates/memory/README.md`. A simulation that fits in cache
//! here says nothing of how a machine behaves when everyone asks at once: nothing queues in this model.
//!
//! ```
//! use isolux_memory::{Home, Kind, Level, Spec, System};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut system = System::new(&Spec::dash()?, 8)?;
//! let elements = system.region("elements", Home::FirstTouch)?;
//! let address = system.allocate(elements, 64, 16)?;
//! assert_eq!(system.access(0, address, Kind::Write)?.level, Level::LocalMemory);
//! assert_eq!(system.access(5, address, Kind::Read)?.clocks, 100);
//! # Ok(())
//! # }
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod cache;
mod check;
mod counts;
mod directory;
mod layout;
mod reader;
mod spec;
mod system;

pub use check::Broken;
pub use counts::{Cause, Counts, Kind, Level};
pub use layout::{Address, Home, LayoutError, PAGE_BYTES, Region};
pub use reader::{Section, SpecError, read};
pub use spec::{CacheSpec, DASH, Latency, Spec, TWO_SOCKET};
pub use system::{Access, AccessError, Held, Listed, MachineError, System};
