//! Pure functions of their arguments: form factor, visibility, oracle. None names a lock, thread, clock, schedule or
//! machine; what a kernel did is told to a [`Probe`].

pub mod form_factor;
pub mod oracle;
pub mod visibility;

mod patch;
mod probe;

pub use patch::Patch;
pub use probe::{Counts, NoProbe, Probe};
