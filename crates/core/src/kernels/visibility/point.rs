//! Visibility of a patch from a point: a point and a patch go in, the unblocked share of rays to the patch's
//! sub-elements comes out.

use super::sample::{self, SplitMix64};
use crate::kernels::{Patch, Probe};
use crate::scene::{Plane, Scene};
use crate::tree::bsp::{Bsp, Segment};
use glam::DVec3;

/// Visibility of patch `to` from a point on a surface, by one ray to each of its 16 sub-elements: `V = sum_k v_k / n`
/// over the n rays that leave the fronts of both.
///
/// - `point`, in metres, on `plane`, the supporting plane of the surface that it lies on
/// - `seed` chooses the points in the sub-elements
///
/// Source: as [`super::visibility`], with one end of all rays at the point.
///
/// Preconditions: those of [`super::visibility`]. The result lies in [0, 1]; it is 0 where no ray counts.
///
/// Error: an estimate, with a standard deviation of at most 1/8 (checked by `point_visibility_is_unbiased`).
pub fn point_visibility<P: Probe>(
    bsp: &Bsp,
    scene: &Scene,
    point: DVec3,
    plane: &Plane,
    to: &Patch,
    seed: u64,
    probe: &mut P,
) -> f64 {
    probe.visibility();
    let mut random = SplitMix64::new(seed);
    let (mut count, mut sum) = (0u32, 0.0);
    for target in sample::points(to.corners, &mut random) {
        if let Some(segment) = Segment::between(point, target, [plane, to.plane], bsp.tolerance()) {
            probe.ray();
            count += 1;
            sum += bsp.segment_transmittance(scene, segment, probe);
        }
    }
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}
