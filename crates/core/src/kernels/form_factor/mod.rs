//! Form factors between patches, unoccluded: a pair of patches goes in, their exchange area `A_i F_ij = A_j F_ji`
//! comes out; visibility is another kernel's.
//!
//! [`exchange_area`] is what links use. Below it, `lambert` is the closed form from a point to a polygon
//! ([`point_factor`]), `disk` the 4 x 4 disks of the paper, `quadrature` places points on a patch, `outline` clips
//! one polygon at the plane of another. The formulas, with their sources, are collected in
//! `docs/theory/form-factors.md`.

mod disk;
mod lambert;
mod outline;
mod pair;
mod quadrature;

pub use lambert::point_factor;
pub use pair::{FormFactor, exchange_area};
