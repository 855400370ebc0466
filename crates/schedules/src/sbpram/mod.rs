//! The organisation for the SB-PRAM, Figure 4 of the paper: what it does in its own way. Loops where work is regular, fine
//! tasks where it is not, one queue.

mod build;
mod interpolate;
mod pairs;
mod visibility;

pub(crate) use pairs::pair;
