//! Sequential mathematics of hierarchical radiosity: scenes come in through one validated door, kernels evaluate
//! form factors and visibility, links are refined, radiosities iterate; no thread, clock, file or Python in here.
//!
//! The flow is `scene -> tree -> links <-> solution`; see `ARCHITECTURE.md` at the root of the repository.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr))]

pub mod audit;
mod boxes;
pub mod kernels;
pub mod links;
pub mod sampling;
pub mod scene;
pub mod solution;
pub mod tree;
pub mod units;

pub use glam::{DVec2, DVec3};
