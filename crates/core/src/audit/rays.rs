//! Rays for the audit: fronts go into a tree of boxes, what a ray meets comes out.
//!
//! The solver's rays walk a BSP tree, whose depth or whose nodes grow with the number of polygons where these bulge or
//! lie in one plane: a flat floor of 100,000 triangles costs each ray as many tests. The audit has to take whatever comes
//! and needs few rays, so it asks the boxes that it has anyway. Cut-outs count by their mean opacity.

use crate::boxes::{Box3, Boxes};
use crate::sampling::Stream;
use crate::scene::{Plane, Polygon, Scene};
use glam::DVec3;
use std::cell::Cell;
use std::ops::ControlFlow;

pub(super) struct Rays<'a> {
    scene: &'a Scene,
    boxes: Boxes,
}

impl<'a> Rays<'a> {
    pub(super) fn new(scene: &'a Scene) -> Rays<'a> {
        let tolerance = scene.tolerance();
        let around = |polygon: &Polygon| Box3::around(polygon.corners.iter().copied(), 2.0 * tolerance);
        Rays { scene, boxes: Boxes::new(scene.polygons[..scene.fronts].iter().map(around).collect()) }
    }

    /// Where light from `origin` on `plane` ends: the lit side that it meets, if the side is lit, and where. `None` when
    /// it leaves the scene. A surface of opacity a lets it pass with probability 1 - a.
    pub(super) fn follow(
        &self,
        plane: &Plane,
        origin: DVec3,
        direction: DVec3,
        stream: &mut Stream,
    ) -> Option<(Option<u32>, DVec3)> {
        let step = self.scene.tolerance();
        let mut start = origin + plane.normal * step;
        loop {
            let (distance, front) = self.closest(start, direction, 2.0 * self.scene.diameter)?;
            let position = start + direction * distance;
            let polygon = &self.scene.polygons[front as usize];
            if polygon.opacity >= 1.0 || stream.next_unit() < polygon.opacity {
                let is_in_front = polygon.plane.normal.dot(direction) < 0.0;
                return Some((if is_in_front { Some(front) } else { polygon.twin }, position));
            }
            start = position + direction * step;
        }
    }

    /// Does light pass from a point on one plane to a point on another? What lies within the tolerance of either plane
    /// does not count, and an end below the other's plane gets nothing.
    pub(super) fn is_open(&self, from: DVec3, to: DVec3, planes: [&Plane; 2], stream: &mut Stream) -> bool {
        let step = self.scene.tolerance();
        let (rise, fall) = (planes[0].distance(to), planes[1].distance(from));
        if rise <= step || fall <= step {
            return false;
        }
        let way = to - from;
        let length = way.length();
        let direction = way / length;
        let mut start = length * step / rise;
        let end = length * (1.0 - step / fall);
        while start < end {
            let Some((distance, front)) = self.closest(from + direction * start, direction, end - start) else {
                return true;
            };
            let opacity = self.scene.polygons[front as usize].opacity;
            if opacity >= 1.0 || stream.next_unit() < opacity {
                return false;
            }
            start += distance + step;
        }
        true
    }

    /// The nearest front on the way, no nearer than the tolerance, from either side; the first of equally near ones.
    fn closest(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<(f64, u32)> {
        let best: Cell<Option<(f64, u32)>> = Cell::new(None);
        let end = || origin + direction * best.get().map_or(reach, |(distance, _)| distance);
        self.boxes.search_along(
            direction,
            |around| around.meets_segment(origin, end()),
            |front| {
                let polygon = &self.scene.polygons[front as usize];
                if let Some(distance) = meet(polygon, origin, direction, self.scene.tolerance())
                    && distance <= reach
                    && best.get().is_none_or(|best| (distance, front) < best)
                {
                    best.set(Some((distance, front)));
                }
                ControlFlow::Continue(())
            },
        );
        best.get()
    }
}

/// Distance at which a ray meets a polygon, which is as much larger than its corners as things count as touching.
fn meet(polygon: &Polygon, origin: DVec3, direction: DVec3, tolerance: f64) -> Option<f64> {
    let normal = polygon.plane.normal;
    let distance = -polygon.plane.distance(origin) / normal.dot(direction);
    // Written so that a NaN, of a ray in the plane, is no hit.
    if !(distance >= tolerance && distance.is_finite()) {
        return None;
    }
    let point = origin + direction * distance;
    let corners = &polygon.corners;
    let count = corners.len();
    let is_inside = (0..count).all(|k| {
        let along = corners[(k + 1) % count] - corners[k];
        normal.dot(along.cross(point - corners[k])) >= -tolerance * along.length()
    });
    is_inside.then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::NoProbe;
    use crate::scene::{Alpha, BuildOptions, Face, Material, Object, SceneInput, Surface};
    use crate::tree::{Bsp, InsertionOrder};
    use crate::units::Rgb;

    /// Random triangles, a third of them two-sided.
    fn scene() -> Scene {
        let mut stream = Stream::new(3);
        let mut input = SceneInput { metres_per_unit: 1.0, ..SceneInput::default() };
        let surface = Surface { reflectance: Rgb::splat(0.5), emission: Rgb::ZERO, opacity: 1.0 };
        for two_sided in [false, true] {
            let material = Material { name: String::new(), surface, two_sided, alpha: Alpha::Opaque, texture: None };
            input.materials.push(material);
        }
        input.objects.push(Object { name: "leaves".into() });
        for k in 0..60 {
            let mut point = || DVec3::new(stream.next_unit(), stream.next_unit(), stream.next_unit());
            let at = point() * 3.0;
            let corners = (0..3).map(|_| at + point()).collect();
            input.faces.push(Face { object: 0, material: u32::from(k % 3 == 0), corners, uv: None, surface: None });
        }
        Scene::build(input, &BuildOptions::default()).unwrap()
    }

    /// Catches a ray that passes what the solver's rays hit, or tells another polygon, place or side; and a shadow that
    /// one casts and the other does not.
    #[test]
    fn rays_meet_what_the_rays_of_the_solver_meet() {
        let scene = scene();
        let (bsp, rays) = (Bsp::build(&scene, InsertionOrder::AsGiven), Rays::new(&scene));
        let mut stream = Stream::new(4);
        let (mut met, mut backs, mut blocked) = (0, 0, 0);
        for k in 0..2000 {
            let [one, two] = [k % 60, (k * 7 + 1) % 60].map(|index| &scene.polygons[index]);
            let [from, to] = [one, two].map(|polygon| stream.point(&polygon.corners, &polygon.plane));
            let direction = stream.cosine_direction(one.plane.normal);
            let start = from + one.plane.normal * scene.tolerance();
            let expected = bsp.closest_hit(&scene, start, direction, f64::INFINITY, &mut NoProbe);
            let found = rays.follow(&one.plane, from, direction, &mut stream);
            assert_eq!(found.is_some(), expected.is_some());
            if let (Some((side, position)), Some(hit)) = (found, expected) {
                let lit = if hit.front_facing { Some(hit.polygon) } else { scene.polygons[hit.polygon as usize].twin };
                assert_eq!(side, lit);
                // A hundredth of what counts as one place.
                assert!(position.distance(start + direction * hit.distance) < 0.01 * scene.tolerance());
                met += 1;
                backs += usize::from(side.is_none());
            }
            let planes = [&one.plane, &two.plane];
            let passes = bsp.transmittance(&scene, from, to, planes[0], planes[1], scene.tolerance(), &mut NoProbe);
            let open = rays.is_open(from, to, planes, &mut stream);
            assert_eq!(open, passes > 0.0);
            blocked += usize::from(!open);
        }
        assert!(met > 200 && backs > 80 && (100..1900).contains(&blocked), "{met} {backs} {blocked}: too one-sided");
    }
}
