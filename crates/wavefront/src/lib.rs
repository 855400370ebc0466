//! The fast engine.

mod check;
mod clusters;
mod contacts;
mod evaluate;
mod field;
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

pub use check::Check;
pub use outcome::{ClusterColumns, LinkColumns, Outcome, irradiance_at};
pub use solve::{Prepared, Request, Solved, Stage};
