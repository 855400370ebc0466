//! Visibility of one patch from another: two patches and a tree go in, the unblocked share of rays between their
//! sub-elements comes out; how it weighs with a form factor is left to links.

mod sample;

pub(crate) use sample::SplitMix64;

use crate::kernels::{Patch, Probe};
use crate::scene::Scene;
use crate::tree::bsp::{Bsp, Segment};
use sample::SUB_ELEMENTS;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How many rays join two patches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub enum Rays {
    /// The 16 sub-elements of one patch are joined with those of the other one to one.
    #[default]
    Sixteen,
    /// Each of the 16 sub-elements is joined with each of the other's.
    TwoHundredFiftySix,
}

/// A number of rays that is neither 16 nor 256.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{0} rays between two patches: expected 16 or 256")]
pub struct RaysError(pub u32);

impl TryFrom<u32> for Rays {
    type Error = RaysError;
    fn try_from(count: u32) -> Result<Rays, RaysError> {
        match count {
            16 => Ok(Rays::Sixteen),
            256 => Ok(Rays::TwoHundredFiftySix),
            other => Err(RaysError(other)),
        }
    }
}

impl From<Rays> for u32 {
    fn from(rays: Rays) -> u32 {
        match rays {
            Rays::Sixteen => 16,
            Rays::TwoHundredFiftySix => 256,
        }
    }
}

/// Visibility `V` of patches `a` and `b`, ray by ray.
pub fn visibility<P: Probe>(
    bsp: &Bsp,
    scene: &Scene,
    a: &Patch,
    b: &Patch,
    rays: Rays,
    seed: u64,
    probe: &mut P,
) -> f64 {
    probe.visibility();
    let tolerance = bsp.tolerance();
    let apart = |a: &Patch, b: &Patch| b.corners.iter().any(|&corner| a.plane.distance(corner) > tolerance);
    if !apart(a, b) || !apart(b, a) {
        return 0.0;
    }
    let mut random = SplitMix64::new(seed);
    let from = sample::points(a.corners, &mut random);
    let to = sample::points(b.corners, &mut random);
    let mut partner: [usize; SUB_ELEMENTS] = std::array::from_fn(|k| k);
    random.shuffle(&mut partner);
    let (mut count, mut sum) = (0_u32, 0.0);
    let mut shoot = |i: usize, j: usize, probe: &mut P| {
        if let Some(segment) = Segment::between(from[i], to[j], [a.plane, b.plane], tolerance) {
            probe.ray();
            count += 1;
            sum += bsp.segment_transmittance(scene, segment, probe);
        }
        count
    };
    let mut tried = 0;
    if rays == Rays::Sixteen {
        for (i, &j) in partner.iter().enumerate() {
            tried = shoot(i, j, probe);
        }
    }
    if tried == 0 {
        for i in 0..SUB_ELEMENTS {
            for j in 0..SUB_ELEMENTS {
                shoot(i, j, probe);
            }
        }
    }
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}
