//! Vector routines: plain numbers go in and come out, eight lanes at a time; what they mean is left to the caller.
//!
//! Every routine is written once over a trait `Lanes` and compiled for each backend; [`lanes::Backend::best`] picks one
//! at run time. No operation is fused, estimated or reordered, so all backends give the same bits.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod bvh;
pub mod lanes;
