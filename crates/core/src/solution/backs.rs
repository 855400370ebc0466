//! Backs of two-sided surfaces sleep until light can reach them (D4): most of them face the inside of closed objects.

use super::trace::trace;
use super::{Flow, Watch};
use crate::kernels::NoProbe;
use crate::sampling::{Stream, mix};
use crate::scene::Scene;
use crate::tree::Bsp;
use std::collections::BTreeSet;

/// Rays that look out from a back. One that sees a share s of lit surroundings is overlooked with probability
/// (1 - s)^64: below 4 % for s = 5 %, and what falls on it then is reported as lost to backs.
const RAYS: u64 = 64;

/// Backs that have no elements in play yet, with the polygons that they see.
#[derive(Debug, Default)]
pub(super) struct LazyBacks {
    sleeping: Vec<(u32, Vec<u32>)>,
}

impl LazyBacks {
    /// Looks out from every polygon that is not `active`; `None` when the watch says stop.
    pub(super) fn new(
        scene: &Scene,
        bsp: &Bsp,
        active: &[bool],
        seed: u64,
        watch: &mut Watch<'_>,
    ) -> Option<LazyBacks> {
        let asleep = (scene.fronts..scene.polygons.len()).filter(|&index| !active[index]);
        let look = |index| {
            let seen = seen_from(scene, bsp, index as u32, seed);
            (watch.step(RAYS as f64, 0.0) == Flow::Continue).then_some((index as u32, seen))
        };
        Some(LazyBacks { sleeping: asleep.map(look).collect::<Option<_>>()? })
    }

    /// Removes and returns the backs that see a polygon for which `is_lit` holds, in order.
    pub(super) fn wake(&mut self, is_lit: impl Fn(u32) -> bool) -> Vec<u32> {
        let (woken, sleeping) = std::mem::take(&mut self.sleeping)
            .into_iter()
            .partition(|(_, seen)| seen.iter().any(|&other| is_lit(other)));
        self.sleeping = sleeping;
        let woken: Vec<(u32, Vec<u32>)> = woken;
        woken.into_iter().map(|(back, _)| back).collect()
    }
}

fn seen_from(scene: &Scene, bsp: &Bsp, back: u32, seed: u64) -> Vec<u32> {
    let polygon = &scene.polygons[back as usize];
    let mut stream = Stream::new(mix(seed) ^ u64::from(back));
    let mut seen = BTreeSet::new();
    for _ in 0..RAYS {
        let origin = stream.point(&polygon.corners, &polygon.plane);
        let direction = stream.cosine_direction(polygon.plane.normal);
        seen.extend(
            trace(scene, bsp, &polygon.plane, origin, direction, &mut stream, &mut NoProbe).map(|hit| hit.side),
        );
    }
    seen.into_iter().flatten().collect()
}
