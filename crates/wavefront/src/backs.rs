//! Backs of two-sided surfaces: most face the inside of closed objects, where no light gets. Those that see a lit side, or
//! that light of a lamp or of the sky falls on, take part.

use crate::geometry::{Element, Geometry};
use crate::lamps::reach;
use crate::rays::point_of;
use isolux_core::sampling::{Stream, mix};
use rayon::prelude::*;

/// Rays that look out from a back. One that sees a share s of lit surroundings is overlooked with probability
/// (1 - s)^64: below 4 % for s = 5 %.
const RAYS: u64 = 64;

/// Which sides take part, by polygon: all fronts, and the backs that see a side that does, a lamp or the sky.
pub(crate) fn lit_sides(geometry: &Geometry, roots: &[Element]) -> Vec<bool> {
    let fronts = geometry.scene.fronts;
    let mut active: Vec<bool> = (0..roots.len()).map(|polygon| polygon < fronts).collect();
    let lamps = geometry.scene.has_remote_light();
    let by_lamps: Vec<usize> =
        (fronts..roots.len()).into_par_iter().filter(|&back| lamps && reach(&roots[back], geometry)).collect();
    by_lamps.into_iter().for_each(|back| active[back] = true);
    let seen: Vec<Vec<u32>> =
        (fronts as u32..roots.len() as u32).into_par_iter().map(|back| seen_from(back, geometry, roots)).collect();
    loop {
        let woken: Vec<usize> = (fronts..roots.len())
            .filter(|&back| !active[back] && seen[back - fronts].iter().any(|&other| active[other as usize]))
            .collect();
        if woken.is_empty() {
            return active;
        }
        woken.into_iter().for_each(|back| active[back] = true);
    }
}

/// The sides that rays from a back end on, without repetition.
fn seen_from(back: u32, geometry: &Geometry, roots: &[Element]) -> Vec<u32> {
    let normal = geometry.surfaces[back as usize].normal;
    let mut stream = Stream::new(mix(u64::from(back)));
    let mut seen: Vec<u32> = (0..RAYS)
        .filter_map(|_| {
            let jitter = [stream.next_unit() as f32, stream.next_unit() as f32];
            let (point, _) = point_of(&roots[back as usize], 0, 0, jitter);
            let direction = stream.cosine_direction(normal.as_dvec3()).as_vec3();
            geometry.look(point, normal, direction, &mut stream).map(|(side, _)| side)
        })
        .collect();
    seen.sort_unstable();
    seen.dedup();
    seen
}
