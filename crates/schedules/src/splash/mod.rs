//! SPLASH-2's organisation, Figure 3 of the paper: what it does in its own way. Tasks make tasks; each processor has a queue.

mod build;
mod interpolate;
mod visibility;
