//! Faces that lie in one place: faces that lie in one plane and overlap go in; which of them light meets at a place comes
//! out.
//!
//! **The rule.** Of opaque faces that lie in one plane and face the same way, the later one in the scene's order lies
//! on top: where it is, the earlier one is covered. Faces with a mask, or that let light pass, cover nothing. Faces
//! back to back do not cover each other: a ray meets the one that faces it. A black back is met only where nothing
//! opaque and lit lies that faces as it does, be it the front of a polygon behind it or the back of a two-sided one.
//!
//! A **face** here is a side that surfaces have, by its number, or the black back of a front without a lit one. In most
//! scenes nothing lies on a side, and there is nothing to ask but by rays that meet black backs.

use crate::geometry::Geometry;
use crate::packed::{Extent, Packed};
use glam::Vec3;
use rayon::prelude::*;

/// How far two polygons reach into each other at least where they overlap, in tolerances: neighbours whose common edge is
/// off by a tolerance each do not.
const DEPTH: f32 = 4.0;

/// Cosine between the normals of two polygons that lie in one plane, at least. A polygon of [`DEPTH`] with its corners
/// within a tolerance of a plane leans by 1/2 against it at most.
const LEAST_COSINE: f32 = 0.85;

/// Fronts that are looked at one after the other.
const CHUNK: usize = 256;

/// A side that lies on another face.
#[derive(Clone, Copy, Debug)]
struct Cover {
    corners: [Vec3; 4],
    normal: Vec3,
    side: u32,
    /// Its place in the scene's order: the number of its front.
    rank: u32,
    /// 3 or 4.
    count: u8,
}

impl Extent for Cover {
    fn extent(&self) -> (Vec3, Vec3) {
        bounds(&self.corners)
    }
}

/// What lies on each face, in its plane.
#[derive(Clone, Default)]
pub(crate) struct Overlaps {
    covers: Packed<Cover>,
    /// Does any of it lie on a side, not only in the place of a black back?
    on_sides: bool,
    /// Number of sides; the back of front f without a lit one is face `sides + f`.
    sides: u32,
    tolerance: f32,
}

/// A front that overlaps an earlier one in its plane.
#[derive(Clone, Copy, Debug)]
struct Later {
    front: u32,
    /// Does it face the same way?
    alike: bool,
}

impl Overlaps {
    pub(crate) fn new(geometry: &Geometry) -> Overlaps {
        let scene = &*geometry.scene;
        let (sides, fronts) = (scene.polygons.len() as u32, scene.fronts as u32);
        let corners: Vec<[Vec3; 4]> = (0..fronts).map(|front| geometry.root(front).corners).collect();
        let found: Vec<Vec<Later>> = (0..fronts)
            .into_par_iter()
            .with_min_len(CHUNK)
            .map(|front| later_ones(front, geometry, &corners))
            .collect();
        if found.iter().all(Vec::is_empty) {
            return Overlaps::default();
        }
        let mut lists: Vec<Vec<Cover>> = vec![Vec::new(); (sides + fronts) as usize];
        let mut put = |face: u32, rank: u32, side: u32| {
            let front = &scene.polygons[rank as usize];
            if front.mask.is_none() && front.opacity >= 1.0 {
                let normal = geometry.surfaces[side as usize].normal;
                let root = geometry.root(side);
                lists[face as usize].push(Cover { corners: root.corners, normal, side, rank, count: root.count });
            }
        };
        for (earlier, found) in (0..fronts).zip(&found) {
            for &Later { front: later, alike } in found {
                // Sides by the way they face: as the earlier one's front does, and the other way.
                let own = [Some(earlier), scene.polygons[earlier as usize].twin];
                let mut others = [Some(later), scene.polygons[later as usize].twin];
                if !alike {
                    others.reverse();
                }
                for (own, other) in own.into_iter().zip(others) {
                    match (own, other) {
                        (Some(own), Some(other)) => put(own, later, other),
                        // Here one of them is a black back, in place of which rays meet the lit side of the other.
                        (None, Some(other)) => put(sides + earlier, later, other),
                        (Some(own), None) => put(sides + later, earlier, own),
                        (None, None) => {}
                    }
                }
            }
        }
        let on_sides = lists[..sides as usize].iter().any(|list| !list.is_empty());
        Overlaps { covers: Packed::new(lists), on_sides, sides, tolerance: geometry.tolerance }
    }

    /// Does nothing lie on any side? In the place of black backs there may be something still.
    pub(crate) fn is_empty(&self) -> bool {
        !self.on_sides
    }

    /// Does anything lie on a side, in its plane?
    pub(crate) fn any(&self, side: u32) -> bool {
        self.covers.any(side)
    }

    /// The side that lies on top of a side at a place in its plane; nothing where that is the side itself.
    pub(crate) fn on_top(&self, side: u32, place: Vec3) -> Option<u32> {
        self.last(side, place)
    }

    /// The lit side that a ray meets which comes to a place on the black back of a front; nothing where that is all there is.
    pub(crate) fn before_back(&self, front: u32, place: Vec3) -> Option<u32> {
        self.last(self.sides + front, place)
    }

    /// Does a side lie on another one, anywhere?
    pub(crate) fn lies_on(&self, side: u32, other: u32, corners: &[Vec3; 4]) -> bool {
        let (low, high) = bounds(corners);
        self.any(other) && self.covers.near(other, low, high).any(|cover| cover.side == side)
    }

    fn last(&self, face: u32, place: Vec3) -> Option<u32> {
        if !self.any(face) {
            return None;
        }
        let near = self.covers.near(face, place - self.tolerance, place + self.tolerance);
        let here = near.filter(|cover| {
            let corners = &cover.corners[..cover.count as usize];
            inward(corners, cover.normal).all(|(corner, inward)| inward.dot(place - corner) >= -self.tolerance)
        });
        here.max_by_key(|cover| cover.rank).map(|cover| cover.side)
    }
}

fn bounds(corners: &[Vec3; 4]) -> (Vec3, Vec3) {
    let [a, b, c, d] = *corners;
    (a.min(b).min(c).min(d), a.max(b).max(c).max(d))
}

/// A corner on each side of a convex polygon, and the unit vector in its plane from that side to its inside.
fn inward(corners: &[Vec3], normal: Vec3) -> impl Iterator<Item = (Vec3, Vec3)> {
    (0..corners.len()).map(move |k| {
        let side = corners[(k + 1) % corners.len()] - corners[k];
        (corners[k], normal.cross(side).normalize_or_zero())
    })
}

/// The fronts after `front` that overlap it in its plane.
fn later_ones(front: u32, geometry: &Geometry, corners: &[[Vec3; 4]]) -> Vec<Later> {
    let (surface, tolerance) = (&geometry.surfaces[front as usize], geometry.tolerance);
    let (low, high) = bounds(&corners[front as usize]);
    let (low, high) = ((low - tolerance).to_array(), (high + tolerance).to_array());
    let [x, y, z] = surface.normal.to_array();
    let mut found: Vec<Later> = Vec::new();
    geometry.bvh.near_plane(low, high, [x, y, z, surface.offset], tolerance, &mut |primitive| {
        let other = geometry.polygon_of[primitive as usize];
        let cosine = surface.normal.dot(geometry.surfaces[other as usize].normal);
        if other > front && cosine.abs() >= LEAST_COSINE && overlap(front, other, geometry, corners) {
            found.push(Later { front: other, alike: cosine > 0.0 });
        }
    });
    found.sort_unstable_by_key(|later| later.front);
    // Of a polygon of two primitives both may be near.
    found.dedup_by_key(|later| later.front);
    found
}

/// Do two fronts lie in one plane, and reach into each other?
fn overlap(one: u32, other: u32, geometry: &Geometry, corners: &[[Vec3; 4]]) -> bool {
    let of = |front: u32| {
        let count = geometry.scene.polygons[front as usize].corners.len();
        (&corners[front as usize][..count], &geometry.surfaces[front as usize])
    };
    let ((p, one), (q, other)) = (of(one), of(other));
    // The smaller one's own plane may be off by much where the larger one ends.
    let within = |corners: &[Vec3], normal: Vec3, offset: f32| {
        corners.iter().all(|&corner| (normal.dot(corner) - offset).abs() <= geometry.tolerance)
    };
    if !within(q, one.normal, one.offset) && !within(p, other.normal, other.offset) {
        return false;
    }
    // Convex polygons are apart if all of one lies beyond a side of the other.
    let reaches = |p: &[Vec3], normal: Vec3, q: &[Vec3]| {
        inward(p, normal)
            .all(|(corner, inward)| q.iter().any(|&place| inward.dot(place - corner) > DEPTH * geometry.tolerance))
    };
    reaches(p, one.normal, q) && reaches(q, other.normal, p)
}
