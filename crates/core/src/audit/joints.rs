//! T-joints: a scene goes in, corners that lie inside a neighbour's edge come out.
//!
//! Light is smoothed, and the lit mesh is closed, across edges that two polygons share. Where one polygon's edge meets
//! several shorter ones, nothing is shared: light steps there, and hairline cracks may show. A **T-joint** is a corner
//! that lies strictly inside an edge, where
//!
//! - both belong to one object: things that stand on or against each other are no fault;
//! - the edge is open: no other polygon of the object has both its ends. A box that touches another part of its object
//!   has every edge twice, and is left alone;
//! - another open edge runs from the corner along the edge: it is a seam, and no mere touch.
//!
//! "The same place" is [`Scene::tolerance`], as everywhere.

use crate::boxes::{Box3, Boxes};
use crate::scene::Scene;
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::ops::ControlFlow;

/// Normals that differ by less than this sine are one plane's, for light that runs on over the edge: as in joining
/// triangles, what single-precision files can tell (1 mm in 1 m).
const FLAT: f64 = 1e-3;

/// A corner inside an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    /// The polygon whose edge it is.
    pub(super) edge_of: u32,
    /// A polygon that has the corner and runs along the edge.
    pub(super) corner_of: u32,
    /// Where, metres.
    pub(super) position: DVec3,
    /// Do polygons of the same plane meet the edge in all its length, so that it divides a surface?
    pub(super) flat: bool,
}

/// An edge that one polygon alone has.
struct OpenEdge {
    polygon: u32,
    ends: [u32; 2],
}

/// All T-joints, by polygon and edge, from the edge's start to its end. A corner that several polygons have counts once
/// for an edge.
pub(super) fn find(scene: &Scene) -> Vec<Joint> {
    let tolerance = scene.tolerance();
    let places = Places::new(scene);
    let edges = places.open_edges(scene);
    // Open edges by their ends.
    let mut at: Vec<(u32, u32)> = Vec::with_capacity(2 * edges.len());
    for (index, edge) in (0..).zip(&edges) {
        at.extend(edge.ends.map(|end| (end, index)));
    }
    at.sort_unstable();
    let mut ends: Vec<u32> = at.iter().map(|&(end, _)| end).collect();
    ends.dedup();
    let point = |place: u32| places.points[place as usize];
    let boxes = Boxes::new(ends.iter().map(|&end| Box3::around([point(end)], tolerance)).collect());
    let mut joints = Vec::new();
    for edge in &edges {
        let [a, b] = edge.ends.map(point);
        let length = a.distance(b);
        let along = (b - a) / length;
        let mut inside: Vec<(f64, u32)> = Vec::new();
        boxes.search(
            |around| around.meets_segment(a, b),
            |index| {
                let end = ends[index as usize];
                let t = along.dot(point(end) - a);
                let is_inside = t > tolerance && t < length - tolerance && off_line(point(end), a, along) <= tolerance;
                if is_inside && places.object[end as usize] == scene.polygons[edge.polygon as usize].object {
                    inside.push((t, end));
                }
                ControlFlow::Continue(())
            },
        );
        inside.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        let first = joints.len();
        let mut covered: Vec<(f64, f64)> = Vec::new();
        for (t, corner) in inside {
            let meeting = &at[at.partition_point(|&(end, _)| end < corner)..];
            let meeting =
                meeting.iter().take_while(|&&(end, _)| end == corner).map(|&(_, index)| &edges[index as usize]);
            let mut best: Option<Joint> = None;
            for other in meeting.filter(|other| other.polygon != edge.polygon) {
                let far = point(if other.ends[0] == corner { other.ends[1] } else { other.ends[0] });
                // Beyond the edge's ends, its line is as uncertain as it is long.
                let reach = point(corner).distance(far) / length;
                if off_line(far, a, along) > 2.0 * tolerance * reach.max(1.0) {
                    continue;
                }
                let normal = |polygon: u32| scene.polygons[polygon as usize].plane.normal;
                let flat = normal(other.polygon).cross(normal(edge.polygon)).length() < FLAT;
                if flat {
                    let end = along.dot(far - a);
                    covered.push((t.min(end), t.max(end)));
                }
                if best.is_none_or(|best| flat && !best.flat) {
                    let position = point(corner);
                    best = Some(Joint { edge_of: edge.polygon, corner_of: other.polygon, position, flat });
                }
            }
            joints.extend(best);
        }
        // An edge that is free in part is an outline, whatever meets the rest of it.
        if !covers(covered, length, 2.0 * tolerance) {
            joints[first..].iter_mut().for_each(|joint| joint.flat = false);
        }
    }
    joints
}

/// Do intervals leave no gap of more than `slack` in `[0, length]`?
fn covers(mut intervals: Vec<(f64, f64)>, length: f64, slack: f64) -> bool {
    intervals.sort_by(|p, q| p.0.total_cmp(&q.0));
    let reached = intervals.iter().fold(
        0.0,
        |reached, &(from, to)| {
            if from <= reached + slack { f64::max(reached, to) } else { reached }
        },
    );
    reached + slack >= length
}

/// Distance of a point from the line through `start` along a unit vector.
fn off_line(point: DVec3, start: DVec3, along: DVec3) -> f64 {
    along.cross(point - start).length()
}

/// Corners by place: those of one object within the tolerance are one.
struct Places {
    points: Vec<DVec3>,
    object: Vec<u32>,
    /// Places of the corners of each front, in their order.
    corners: Vec<[u32; 4]>,
}

impl Places {
    fn new(scene: &Scene) -> Places {
        let mut places = Places { points: Vec::new(), object: Vec::new(), corners: Vec::new() };
        let mut known: FxHashMap<(u32, [u64; 3]), u32> = FxHashMap::default();
        for polygon in &scene.polygons[..scene.fronts] {
            let mut corners = [u32::MAX; 4];
            for (place, &corner) in corners.iter_mut().zip(polygon.corners.iter()) {
                // Adding zero makes -0 and 0 one.
                let bits = (corner + DVec3::ZERO).to_array().map(f64::to_bits);
                *place = *known.entry((polygon.object, bits)).or_insert_with(|| {
                    places.points.push(corner);
                    places.object.push(polygon.object);
                    places.points.len() as u32 - 1
                });
            }
            places.corners.push(corners);
        }
        places.weld(scene.tolerance());
        places
    }

    /// Gives every corner the first place within the tolerance.
    fn weld(&mut self, tolerance: f64) {
        let single = |&point: &DVec3| Box3 { low: point, high: point };
        let boxes = Boxes::new(self.points.iter().map(single).collect());
        let mut first: Vec<u32> = (0..self.points.len() as u32).collect();
        for (place, &point) in self.points.iter().enumerate() {
            let near = Box3::around([point], tolerance);
            let mut least = place as u32;
            boxes.search(
                |around| around.meets(&near),
                |other| {
                    let is_same = self.object[other as usize] == self.object[place]
                        && self.points[other as usize].distance(point) <= tolerance;
                    if is_same {
                        least = least.min(other);
                    }
                    ControlFlow::Continue(())
                },
            );
            // Lower places are settled by now.
            first[place] = first[least as usize];
        }
        for corner in self.corners.iter_mut().flatten().filter(|corner| **corner != u32::MAX) {
            *corner = first[*corner as usize];
        }
    }

    /// Edges that one polygon alone has, by polygon and edge.
    fn open_edges(&self, scene: &Scene) -> Vec<OpenEdge> {
        let mut all: Vec<([u32; 2], u32, usize)> = Vec::new();
        for (polygon, corners) in (0..).zip(&self.corners) {
            let count = scene.polygons[polygon as usize].corners.len();
            for k in 0..count {
                let (a, b) = (corners[k], corners[(k + 1) % count]);
                if a != b {
                    all.push(([a.min(b), a.max(b)], polygon, k));
                }
            }
        }
        all.sort_unstable();
        let alone = all.chunk_by(|p, q| p.0 == q.0).filter(|group| group.len() == 1).map(|group| group[0]);
        let mut open: Vec<_> = alone.map(|(_, polygon, k)| (polygon, k)).collect();
        open.sort_unstable();
        let edge = |(polygon, k): (u32, usize)| {
            let corners = &self.corners[polygon as usize];
            let next = (k + 1) % scene.polygons[polygon as usize].corners.len();
            OpenEdge { polygon, ends: [corners[k], corners[next]] }
        };
        open.into_iter().map(edge).collect()
    }
}
