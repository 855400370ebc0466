//! The fast engine: hierarchical radiosity in flat rounds on all cores. A scene and an asked error go in; quadtrees, links
//! and light come out, with how wrong they may be.
//!
//! 1. [`Prepared`]: single precision about the scene's middle, a tree of eight children a node for rays, clusters above
//!    polygons, and the lines along which surfaces touch.
//! 2. Stages ([`Prepared::solve`]). Each refines links in rounds (evaluate all, keep or split each, go on with the parts),
//!    gathers over them until light settles, gathers once more at the leaves' own points, and asks independent rays how
//!    wrong that is. The first stage is coarse; each later one lets links leave less, until the asked error is reached.
//! 3. [`Solved::outcome`]: everything by number, from which [`Solved::reopened`] goes on, without a ray for any link, to
//!    the same light by groups of emitters ([`Solved::columns`]), and to other light when surfaces change ([`Solved::regathered`]).
//!    [`Solved::check_columns`]: how wrong the light of each group is, by rays again. [`Solved::balance`],
//!    [`Solved::row_sums`]: where the light went, and what the links account for.
//!
//! Every parallel loop writes its results in the order of its inputs and every sum has a fixed order, so that results are
//! the same bits with any number of threads. Random choices are drawn from names of places, never from a clock or an order
//! of work.

#![allow(clippy::needless_range_loop, reason = "bands and points of a field run through several arrays at once")]
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod backs;
mod balance;
mod check;
mod clusters;
mod contacts;
mod control;
mod evaluate;
mod field;
mod final_gather;
mod geometry;
mod groups;
mod ideas;
mod lamps;
mod leaves;
mod light;
mod link;
mod oracle;
mod order;
mod outcome;
mod outlook;
mod overlaps;
mod packed;
mod rays;
mod read;
mod receiver;
mod reopen;
mod rounds;
mod rows;
#[cfg(test)]
mod samples;
mod sight;
mod sky;
mod solve;
mod spread;
mod tracer;

pub use check::{Check, Found, PointErrors};
pub use control::{Bound, Control};
pub use final_gather::FinalGather;
pub use groups::{Columns, NO_GROUP};
pub use ideas::Ideas;
pub use outcome::{
    ClusterColumns, LinkColumns, Outcome, Standing, irradiance_at, irradiance_in, light_of, mean_factor,
    mean_irradiance_in, signed_irradiance_in,
};
pub use outlook::Outlook;
pub use receiver::Receiver;
pub use reopen::Remains;
pub use solve::{Estimate, MEMORY, Prepared, Request, Solved, Stage};
pub use tracer::{Meeting, Tracer};
