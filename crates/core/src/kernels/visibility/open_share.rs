//! Open share of a patch: a patch and a tree go in, the share of it that nothing covers comes out.

use super::sample::{self, SUB_ELEMENTS, SplitMix64};
use crate::kernels::{Patch, Probe};
use crate::sampling::Stream;
use crate::scene::Scene;
use crate::tree::bsp::Bsp;
use glam::DVec3;

/// Directions that a point is given to find a way out: a point that light reaches through a hundredth of its hemisphere
/// passes for covered with a probability of 0.92, through a tenth with 0.43, through a half with 0.4 %.
const ATTEMPTS: usize = 8;

/// Share of a patch that nothing covers: `k / 16` for the k of 16 points that are [open](is_open).
///
/// - `patch`: planar and convex, corners counter-clockwise seen from the front
/// - `seed` chooses the points, one in each of the 16 sub-elements, and the directions
///
/// Source: none; ours. An element that a cabinet stands on is dark where it is covered, but from there it sends no light
/// either: what others see of it is as bright as its open part.
///
/// Error: an estimate, with a standard deviation of at most 1/8 (`the_open_share_is_what_nothing_covers`). Exactly 1 where
/// nothing is near.
pub fn open_share<P: Probe>(bsp: &Bsp, scene: &Scene, patch: &Patch, seed: u64, probe: &mut P) -> f64 {
    let mut random = SplitMix64::new(seed);
    let points = sample::points(patch.corners, &mut random);
    let mut stream = Stream::new(random.next());
    let open = points.iter().filter(|&&point| is_open(bsp, scene, point, patch.plane.normal, &mut stream, probe));
    open.count() as f64 / SUB_ELEMENTS as f64
}

/// Does a point of a surface see anything but black backs: one of 8 rays, distributed by the cosine, leaves the scene or
/// ends on something that can be lit? Points inside or beneath a closed object do not.
pub fn is_open<P: Probe>(
    bsp: &Bsp,
    scene: &Scene,
    point: DVec3,
    normal: DVec3,
    stream: &mut Stream,
    probe: &mut P,
) -> bool {
    let start = point + normal * scene.tolerance();
    (0..ATTEMPTS).any(|_| {
        let direction = stream.cosine_direction(normal);
        bsp.closest_hit(scene, start, direction, f64::INFINITY, probe).is_none_or(|hit| {
            let polygon = &scene.polygons[hit.polygon as usize];
            hit.front_facing || polygon.twin.is_some() || polygon.opacity < 1.0
        })
    })
}
