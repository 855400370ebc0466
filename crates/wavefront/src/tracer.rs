//! Rays for whoever comes after a solve: a scene goes in once, then starts and directions; what is met first comes out.

use crate::geometry::Geometry;
use glam::{DVec3, Vec3};
use isolux_core::scene::Scene;
use isolux_core::solution::Obstacles;
use std::sync::Arc;

/// Transparent texels that one ray passes, at most.
const MOST_HOLES: u32 = 1024;

/// Where a ray meets a polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Distance from the start, metres.
    pub distance: f64,
    /// The front polygon that is met, from either side.
    pub polygon: u32,
    /// Does the ray arrive at the polygon's front?
    pub front_facing: bool,
}

/// A scene that rays ask what they meet, in time that grows with the logarithm of its size. It is built in near-linear time.
pub struct Tracer {
    pub(crate) geometry: Geometry,
    /// Half the scene's extent along each axis, and what rounding asks for beyond it, metres.
    half: DVec3,
}

impl std::fmt::Debug for Tracer {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("Tracer").field("polygons", &self.geometry.surfaces.len()).finish_non_exhaustive()
    }
}

impl Tracer {
    /// Builds the tree that rays walk.
    #[must_use]
    pub fn new(scene: Arc<Scene>) -> Tracer {
        let geometry = Geometry::new(scene);
        let (low, high) = geometry.bvh.bounds();
        let reach = |axis: usize| f64::from(low[axis].abs().max(high[axis].abs()));
        let half = DVec3::new(reach(0), reach(1), reach(2)) + 4.0 * f64::from(geometry.tolerance);
        Tracer { geometry, half }
    }

    /// The first polygon that a ray meets, from either side, no farther than `most` metres (which may be infinite).
    /// `direction` is of unit length. Transparent texels of masks are passed; a polygon of opacity below 1 is met. What
    /// the start lies on, to a millionth of the scene's size, is not met. Of opaque faces in one plane the last one
    /// that faces the ray is met, where there is one, whichever lies before the other.
    ///
    /// Rays are followed in single precision; where they meet a polygon is then computed in double.
    #[must_use]
    pub fn closest(&self, start: DVec3, direction: DVec3, most: f64) -> Option<Meeting> {
        let geometry = &self.geometry;
        let from = start - geometry.middle;
        // Far outside, single precision is too coarse: rays start where they enter the scene's box.
        let entry = self.entry(from, direction)?;
        let (origin, along) = ((from + direction * entry).as_vec3(), direction.as_vec3());
        let far = (most - entry) as f32;
        let mut near = 0.0;
        for _ in 0..MOST_HOLES {
            let hit = geometry.bvh.closest(geometry.backend, origin.to_array(), along.to_array(), near, far)?;
            let own = geometry.polygon_of[hit.primitive as usize];
            let polygon = self.lying_on(own, origin + along * hit.t, along).unwrap_or(own);
            let front = &geometry.scene.polygons[polygon as usize];
            if front.mask.is_none() || geometry.is_solid(hit.primitive, hit.u, hit.v) {
                let slope = front.plane.normal.dot(direction);
                let (exact, rough) = (-front.plane.distance(start) / slope, entry + f64::from(hit.t));
                // Along a plane rounding moves the place by more than the ray was followed wrongly.
                let is_sound = (exact - rough).abs() <= ROUGHNESS * geometry.scene.diameter;
                let distance = if is_sound { exact } else { rough };
                return Some(Meeting { distance, polygon, front_facing: slope < 0.0 });
            }
            near = hit.t + 2.0 * geometry.tolerance;
        }
        None
    }

    /// The front of the face that a ray meets in place of the one that it hits at a place, in the middle's coordinates.
    fn lying_on(&self, front: u32, place: Vec3, along: Vec3) -> Option<u32> {
        let scene = &self.geometry.scene;
        let (side, lies_there) = self.geometry.met(front, place, along);
        let side = side.filter(|_| lies_there)?;
        if (side as usize) < scene.fronts { Some(side) } else { scene.polygons[side as usize].twin }
    }

    /// The side that lies on a side at a point, in its plane: of opaque faces in one plane that face the same way the last
    /// in the scene's order. Mostly the side itself.
    #[must_use]
    pub fn on_top(&self, side: u32, point: DVec3) -> u32 {
        self.geometry.overlaps.on_top(side, self.place(point)).unwrap_or(side)
    }

    /// Where a ray enters the scene's box, 0 where it starts inside; `None` where it passes by. `from` is relative to the
    /// middle.
    fn entry(&self, from: DVec3, direction: DVec3) -> Option<f64> {
        let (mut enters, mut leaves) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (at, step) = (from[axis], direction[axis]);
            if step == 0.0 {
                if at.abs() > self.half[axis] {
                    return None;
                }
                continue;
            }
            let (one, two) = ((-self.half[axis] - at) / step, (self.half[axis] - at) / step);
            enters = enters.max(one.min(two));
            leaves = leaves.min(one.max(two));
        }
        (enters <= leaves).then_some(enters)
    }

    /// Does another face lie on a point on the lit side of a polygon, in its plane, or is it inside something solid, so that it
    /// sees nothing but backs of surfaces without a lit back, whichever way it looks?
    #[must_use]
    pub fn is_covered(&self, point: DVec3, polygon: u32) -> bool {
        crate::contacts::is_covered(self.place(point), polygon, &self.geometry)
    }

    /// A point in the middle's coordinates.
    pub(crate) fn place(&self, point: DVec3) -> Vec3 {
        (point - self.geometry.middle).as_vec3()
    }
}

/// How far single precision may be from where a ray meets a plane, in the scene's diameters: twice the tolerance, 60 times
/// the rounding of a coordinate, which a slope of 1/60 takes.
const ROUGHNESS: f64 = 8e-6;

impl Obstacles for Tracer {
    fn is_blocked(&self, start: DVec3, direction: DVec3, length: f64) -> bool {
        self.closest(start, direction, length).is_some()
    }
}
