//! Coplanar overlaps: a scene goes in, polygons that cover another one in its plane come out.
//!
//! Two polygons **overlap** where they lie in one plane, face the same way, and have more than a given share of the
//! smaller one in common. Both claim to be what is seen there: viewers flicker, and a solver has to choose. `wavefront` takes
//! the later one in the scene's order to lie on top; `sequential` lights both.
//!
//! Polygons of one plane that face opposite ways are left alone: the bottom of a box in the plane of the floor that it
//! stands on, and the second sheet of a wall that was modelled with a polygon for each side.

use crate::boxes::{Box3, Boxes};
use crate::scene::{Polygon, Scene};
use glam::{DVec2, DVec3};
use std::ops::ControlFlow;

/// Share of the smaller polygon that counts as overlap. No two polygons of the shipped scenes have any in common; what
/// people notice (a rug in the plane of the floor, a face that is there twice) has most of the smaller.
const SHARE: f64 = 0.01;

/// Tolerances across the part in common, at least: neighbours whose common edge is off by up to two tolerances (one for
/// each) are no overlap, however thin they are.
const THICKNESS: f64 = 4.0;

/// A polygon that covers another one in its plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overlap {
    /// The smaller one; among equals the later.
    pub(super) polygon: u32,
    /// The other.
    pub(super) other: u32,
}

/// Every front that overlaps a larger one (or an equal one before it), with the first such that is found.
pub(super) fn find(scene: &Scene) -> Vec<Overlap> {
    let tolerance = scene.tolerance();
    let fronts = &scene.polygons[..scene.fronts];
    let around = |polygon: &Polygon| Box3::around(polygon.corners.iter().copied(), tolerance);
    let boxes = Boxes::new(fronts.iter().map(around).collect());
    let mut overlaps = Vec::new();
    for (polygon, small) in (0..).zip(fronts) {
        let near = around(small);
        let mut partner = None;
        boxes.search(
            |around| {
                let (low, high) = around.extent_along(small.plane.normal);
                around.meets(&near) && low <= small.plane.offset + tolerance && high >= small.plane.offset - tolerance
            },
            |other| {
                let large = &fronts[other as usize];
                let is_larger = (large.area, std::cmp::Reverse(other)) > (small.area, std::cmp::Reverse(polygon));
                if is_larger && overlap(small, large, tolerance) {
                    partner = Some(other);
                    return ControlFlow::Break(());
                }
                ControlFlow::Continue(())
            },
        );
        overlaps.extend(partner.map(|other| Overlap { polygon, other }));
    }
    overlaps
}

fn overlap(small: &Polygon, large: &Polygon, tolerance: f64) -> bool {
    let normal = large.plane.normal;
    if small.plane.normal.dot(normal) <= 0.0
        || small.corners.iter().any(|&corner| large.plane.distance(corner).abs() > tolerance)
    {
        return false;
    }
    let (u, v) = normal.any_orthonormal_pair();
    let origin = large.corners[0];
    let flat = |&point: &DVec3| DVec2::new(u.dot(point - origin), v.dot(point - origin));
    let mut part: Vec<DVec2> = small.corners.iter().map(flat).collect();
    let edges = large.corners.len();
    for k in 0..edges {
        let (a, b) = (flat(&large.corners[k]), flat(&large.corners[(k + 1) % edges]));
        part = clip(&part, a, b - a);
    }
    let Some(&first) = part.first() else { return false };
    let area = 0.5 * part.windows(2).map(|pair| (pair[0] - first).perp_dot(pair[1] - first)).sum::<f64>();
    let longest = part.iter().flat_map(|p| part.iter().map(|q| p.distance(*q))).fold(0.0, f64::max);
    // A convex figure is at least as thick as its area over its diameter.
    area > SHARE * small.area && area > THICKNESS * tolerance * longest
}

/// The part of a convex polygon on the left of a line (Sutherland and Hodgman 1974).
fn clip(part: &[DVec2], start: DVec2, along: DVec2) -> Vec<DVec2> {
    let side = |point: DVec2| along.perp_dot(point - start);
    let mut kept = Vec::with_capacity(part.len() + 1);
    for (k, &point) in part.iter().enumerate() {
        let before = part[(k + part.len() - 1) % part.len()];
        let (from, to) = (side(before), side(point));
        if (from < 0.0) != (to < 0.0) {
            kept.push(before.lerp(point, from / (from - to)));
        }
        if to >= 0.0 {
            kept.push(point);
        }
    }
    kept
}
