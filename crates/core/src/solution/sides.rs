//! Walls between leaves: what stands on a scene's surfaces goes in, which of the leaves around a vertex have one light there
//! comes out.

use super::Obstacles;
use crate::boxes::{Box3, Boxes};
use crate::scene::{Corners, Plane, Scene};
use glam::DVec3;
use std::ops::ControlFlow;

/// How close to a vertex, and how high over the plane, as a share of the way to the middle of a leaf, its surroundings are
/// looked at. What is lower than that, or stands so much above the floor, is too small for the leaf.
const NEARBY: f64 = 0.01;

/// The same for leaves so small that the lowest height decides, at most: still in the leaf's quarter at the vertex.
const FARTHEST: f64 = 0.25;

/// How far from a vertex the far end of a leaf is looked at, as a share of all the way: not on its very border, where the
/// next wall may stand.
const FAR: f64 = 0.98;

/// How far ways begin and end beside a leaf's diagonal, as a share of its sides, on either side of it: a wall may stand
/// along it.
const ASIDE: f64 = 0.1;

/// Lowest height of ways over a plane, in tolerances: what lies closer to their ends counts as touched and is not met.
const LOWEST: f64 = 8.0;

/// The scene's surfaces, to find those that stand on others.
pub(super) struct Standing<'a> {
    scene: &'a Scene,
    boxes: Boxes,
}

impl<'a> Standing<'a> {
    pub(super) fn new(scene: &'a Scene) -> Standing<'a> {
        let around =
            scene.polygons[..scene.fronts].iter().map(|polygon| Box3::around(polygon.corners.iter().copied(), 0.0));
        Standing { scene, boxes: Boxes::new(around.collect()) }
    }

    /// May a surface stand in a way over a leaf of a plane?
    pub(super) fn on(&self, corners: &Corners, plane: &Plane) -> bool {
        let lowest = LOWEST * self.scene.tolerance();
        let middle = corners.mean();
        let highest = corners.iter().map(|corner| NEARBY * corner.distance(middle)).fold(lowest, f64::max);
        let ends = [lowest, highest].map(|height| plane.normal * height);
        let ways = Box3::around(corners.iter().flat_map(|&corner| ends.map(|end| corner + end)), 0.0);
        let mut found = false;
        self.boxes.search(
            |around| around.meets(&ways),
            |index| {
                let heights = self.scene.polygons[index as usize].corners.iter().map(|&corner| plane.distance(corner));
                let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), height| {
                    (low.min(height), high.max(height))
                });
                found = low < highest && high > lowest;
                if found { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            },
        );
        found
    }
}

/// A leaf at a vertex.
pub(super) struct Wedge {
    /// Ways to the vertices before and after on the leaf's outline, metres.
    pub(super) before: DVec3,
    pub(super) after: DVec3,
    /// Way to the leaf's middle.
    pub(super) middle: DVec3,
    /// Ways to the leaf's corners.
    pub(super) corners: Vec<DVec3>,
    /// Way to the corner across, where the vertex is a corner of a quadrilateral.
    pub(super) across: Option<DVec3>,
    /// Is any of it open?
    pub(super) is_open: bool,
}

impl Wedge {
    /// A place in the leaf beside the vertex, relative to it, no closer than `lowest`.
    fn near(&self, lowest: f64) -> DVec3 {
        let share = NEARBY.max(lowest / self.middle.length());
        (self.middle + (self.after - self.before) * (0.5 * ASIDE)) * share
    }

    /// A place at the other end of the leaf.
    fn far(&self) -> DVec3 {
        // Half as far again as to the middle: the end of a triangle, and within a leaf on whose side the vertex hangs.
        self.across.unwrap_or(self.middle * 1.5) * FAR + (self.before - self.after) * (ASIDE * (1.0 - FAR))
    }

    /// Places in the leaf beside its corners, relative to the vertex.
    fn ends(&self) -> impl Iterator<Item = DVec3> {
        self.corners.iter().map(|&corner| self.middle + (corner - self.middle) * FAR)
    }
}

/// How leaves share a vertex.
pub(super) struct Sides {
    /// Which value each leaf has there: 0 for the first leaf's, then on.
    pub(super) of: Vec<u32>,
    /// Does the leaf's own light count for its value? Where none of a side's leaves would, all do.
    pub(super) counts: Vec<bool>,
}

/// Leaves that a surface parts have values of their own at a vertex, and one that a wall runs through has no say where
/// there are others. `None`: all have one value, and a say. `normal`: of their plane.
pub(super) fn sides(
    position: DVec3,
    normal: DVec3,
    wedges: &[Wedge],
    scene: &Scene,
    obstacles: &impl Obstacles,
) -> Option<Sides> {
    let lowest = LOWEST * scene.tolerance();
    let least = wedges.iter().map(|wedge| wedge.middle.length()).fold(f64::INFINITY, f64::min);
    // A touch farther away than what counts as touched.
    let beside = 2.0 * lowest;
    if FARTHEST * least < beside {
        // Leaves are too small to be told apart.
        return None;
    }
    let start = position + normal * lowest.max(NEARBY * least);
    let is_free = |from: DVec3, to: DVec3| {
        let way = to - from;
        let length = way.length();
        length == 0.0 || !obstacles.is_blocked(start + from, way / length, length)
    };
    let sees: Vec<bool> = wedges.iter().map(|wedge| is_free(wedge.near(beside), wedge.far())).collect();
    // Without an open leaf that sees it the vertex is inside something: a thick wall has its sides beyond.
    let is_inside = !wedges.iter().zip(&sees).any(|(wedge, sees)| wedge.is_open && *sees);
    let place = |wedge: &Wedge| if is_inside { wedge.far() } else { wedge.near(beside) };
    let mut of: Vec<u32> = (0..wedges.len() as u32).collect();
    for one in 0..wedges.len() {
        for two in 0..one {
            if of[one] != of[two] && is_free(place(&wedges[two]), place(&wedges[one])) {
                let (keep, drop) = (of[one].min(of[two]), of[one].max(of[two]));
                of.iter_mut().filter(|side| **side == drop).for_each(|side| *side = keep);
            }
        }
    }
    let mut names: Vec<u32> = of.clone();
    names.sort_unstable();
    names.dedup();
    let of: Vec<u32> = of.iter().map(|side| names.partition_point(|name| name < side) as u32).collect();
    let is_whole = |wedge: &Wedge| wedge.ends().all(|end| is_free(wedge.near(beside), end));
    let whole: Vec<bool> = wedges.iter().zip(&sees).map(|(wedge, sees)| *sees && is_whole(wedge)).collect();
    let has_say = |side: u32| of.iter().zip(&whole).any(|(other, whole)| *other == side && *whole);
    let counts: Vec<bool> = of.iter().zip(&whole).map(|(&side, &whole)| whole || !has_say(side)).collect();
    (names.len() > 1 || counts.contains(&false)).then_some(Sides { of, counts })
}
