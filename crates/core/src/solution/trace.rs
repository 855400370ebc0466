//! One ray of light through the scene: where a photon that leaves a surface ends.

use crate::kernels::Probe;
use crate::sampling::Stream;
use crate::scene::{Plane, Scene};
use crate::tree::Bsp;
use glam::DVec3;

/// Where a photon ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ending {
    /// The polygon (front or back of the surface) whose lit side was met; `None`: a black back.
    pub(super) side: Option<u32>,
    /// Where.
    pub(super) position: DVec3,
}

/// Follows a photon from `origin` on `plane` until a surface stops it; `None` when it leaves the scene. A surface of
/// opacity a lets it pass with probability 1 - a.
pub(super) fn trace<P: Probe>(
    scene: &Scene,
    bsp: &Bsp,
    plane: &Plane,
    origin: DVec3,
    direction: DVec3,
    stream: &mut Stream,
    probe: &mut P,
) -> Option<Ending> {
    let step = scene.tolerance();
    let mut start = origin + plane.normal * step;
    loop {
        let hit = bsp.closest_hit(scene, start, direction, f64::INFINITY, probe)?;
        let position = start + direction * hit.distance;
        let polygon = &scene.polygons[hit.polygon as usize];
        if polygon.mask.is_some() || polygon.opacity >= 1.0 || stream.next_unit() < polygon.opacity {
            // In place of a black back light meets the front of the wall that stands back to back with it.
            let behind = || bsp.front_at(scene, start, direction, hit.distance);
            let side = if hit.front_facing { Some(hit.polygon) } else { polygon.twin.or_else(behind) };
            return Some(Ending { side, position });
        }
        start = position + direction * step;
    }
}
