//! The fast engine.

mod clusters;
mod evaluate;
mod geometry;
mod leaves;
mod light;
mod link;
mod oracle;
mod outcome;
mod rays;
mod read;
mod rounds;
mod solve;

pub use outcome::{ClusterColumns, LinkColumns, Outcome, irradiance_at};
pub use solve::{Prepared, Request, Solved, Stage};
