//! Flipped faces: a one-sided polygon goes in; whether it turns its black back to the light comes out.
//!
//! A polygon without a lit back is **flipped** when its front gets no light and its back would get some. Whether a side
//! gets light is asked of random walks: from a point of that side through the lit sides of other surfaces, until a point
//! sees a light (or the walk meets one, leaves the scene, or ends on a black back). Reflectances play no part. So
//!
//! - the flipped walls of a lit room are found, however many they are; and an object that is inside out in a lit room,
//!   whose fronts see only each other;
//! - a black back that nobody sees (of a solid, of a picture on a wall, of a rug without underside) is none;
//! - neither is a thin sheet with light on both sides: it is wrong on one side whichever way it is turned;
//! - a box that is inside out with nothing around it is a room, and is none.
//!
//! Where nothing emits, and for lights themselves, the walks cannot tell; there a polygon is flipped when most of what its
//! front sees is black backs or nothing, and most of what its back sees are lit sides.

use super::rays::Rays;
use crate::sampling::{Stream, mix};
use crate::scene::{Plane, Polygon, Scene};
use crate::units::Rgb;
use glam::DVec3;

/// Walks, or rays, from each side of a polygon: enough for the thresholds below to stand apart.
const RAYS: u32 = 16;

/// Walks from the back that find light, at least. Where the front finds none: 0 in the shipped scenes and in the sound
/// ones of the tests; 4 to 16 in the flipped ones, apart from polygons a millimetre behind another one (0 or 1).
const LIT: u32 = 2;

/// Rays that must agree on each side where no light helps: 60 %. Lights of the shipped scenes see lit sides by 7 to 16
/// rays in front and, but for three, by at most 1 behind; these three (a lampshade's and the corridor's) by 16 in front
/// and 10 or 11 behind. A flipped wall of a closed room: 0 in front, 16 behind.
const MOST: u32 = 10;

/// Points of a walk, at most. Of the corridor's 51 polygons, into most of which no lamp shines, walks of 1, 2, 4, 8
/// points leave 42, 19, 6, 1 without light in front.
const POINTS: u32 = 8;

/// Lights that one is chosen from at a point of a walk; of more, so many evenly spaced ones. It bounds the work; the
/// shipped scenes have at most 22.
const CANDIDATES: usize = 256;

/// Chance, relative to the full one, of a light whose middle is behind a plane: it may show its rim. Any small share will
/// do, since walks only ask whether there is light.
const RIM: f64 = 0.1;

/// A scene made ready to ask which of its fronts are flipped.
pub(super) struct Flipped<'a> {
    scene: &'a Scene,
    rays: Rays<'a>,
    /// Polygons that emit, sides apart.
    lights: Vec<u32>,
}

impl<'a> Flipped<'a> {
    pub(super) fn new(scene: &'a Scene) -> Flipped<'a> {
        let emits = |&polygon: &u32| scene.polygons[polygon as usize].emission != Rgb::ZERO;
        Flipped { scene, rays: Rays::new(scene), lights: (0..scene.polygons.len() as u32).filter(emits).collect() }
    }

    pub(super) fn is_flipped(&self, index: u32) -> bool {
        let polygon = &self.scene.polygons[index as usize];
        if polygon.twin.is_some() {
            return false;
        }
        let [front, back] = [polygon.plane, polygon.plane.reversed()];
        if self.lights.is_empty() || polygon.emission != Rgb::ZERO {
            let lit = |plane| (0..RAYS).filter(|&ray| self.sees_lit_side(index, polygon, plane, ray)).count() as u32;
            return lit(&back) >= MOST && RAYS - lit(&front) >= MOST;
        }
        let find = |plane, ray: &u32| self.finds_light(index, polygon, plane, *ray);
        !(0..RAYS).any(|ray| find(&front, &ray))
            && (0..RAYS).filter(|ray| find(&back, ray)).take(LIT as usize).count() as u32 == LIT
    }

    /// The pseudo-random numbers of a ray, and where it starts: named by the polygon, so that no other one matters.
    fn start(&self, index: u32, polygon: &Polygon, ray: u32) -> (Stream, DVec3) {
        let mut stream = Stream::new(mix(u64::from(index) << 32 | u64::from(ray)));
        let point = stream.point(&polygon.corners, &polygon.plane);
        (stream, point)
    }

    fn sees_lit_side(&self, index: u32, polygon: &Polygon, plane: &Plane, ray: u32) -> bool {
        let (mut stream, point) = self.start(index, polygon, ray);
        let direction = stream.cosine_direction(plane.normal);
        matches!(self.rays.follow(plane, point, direction, &mut stream), Some((Some(_), _)))
    }

    fn finds_light(&self, index: u32, polygon: &Polygon, plane: &Plane, ray: u32) -> bool {
        let (mut stream, mut point) = self.start(index, polygon, ray);
        let mut plane = *plane;
        for _ in 0..POINTS {
            if self.sees_a_light(point, &plane, &mut stream) {
                return true;
            }
            let direction = stream.cosine_direction(plane.normal);
            let Some((Some(side), position)) = self.rays.follow(&plane, point, direction, &mut stream) else {
                return false;
            };
            let met = &self.scene.polygons[side as usize];
            if met.emission != Rgb::ZERO {
                return true;
            }
            (point, plane) = (position, met.plane);
        }
        false
    }

    /// Does a point see a point of a light? The light is drawn by what it would throw on the point.
    fn sees_a_light(&self, point: DVec3, plane: &Plane, stream: &mut Stream) -> bool {
        let count = self.lights.len();
        let tried = count.min(CANDIDATES);
        let first = if count > tried { (stream.next_unit() * count as f64) as usize } else { 0 };
        let candidate = |k: usize| &self.scene.polygons[self.lights[(first + k * count / tried) % count] as usize];
        let share = |light: &Polygon| {
            let way = light.corners.mean() - point;
            let square = way.length_squared();
            let slant = |height: f64| (height / square.sqrt()).max(RIM);
            let slants = slant(way.dot(plane.normal)) * slant(-way.dot(light.plane.normal));
            light.emission.mean() * light.area * slants / (square + light.area)
        };
        let whole: f64 = (0..tried).map(|k| share(candidate(k))).sum();
        let mut left = stream.next_unit() * whole;
        let chosen = (0..tried).find(|&k| {
            left -= share(candidate(k));
            left < 0.0
        });
        let light = candidate(chosen.unwrap_or(tried - 1));
        let target = stream.point(&light.corners, &light.plane);
        self.rays.is_open(point, target, [plane, &light.plane], stream)
    }
}
