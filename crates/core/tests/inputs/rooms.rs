//! Closed rooms by number: boxes of random sizes and paints under random lamps. The same number gives the same room.

use super::{Make, empty, grey, v};
use isolux_core::DVec3;
use isolux_core::sampling::{Stream, mix};
use isolux_core::scene::{Face, Scene, SceneInput, Surface};
use isolux_core::units::Rgb;

/// Numbers in a range, one after the other.
struct Dice(Stream);

impl Dice {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.next_unit()
    }

    fn up_to(&mut self, most: u32) -> u32 {
        1 + (self.0.next_unit() * f64::from(most)) as u32
    }

    fn paint(&mut self) -> Surface {
        let reflectance = Rgb([0; 3].map(|_| self.between(0.1, 0.8)));
        Surface { reflectance, emission: Rgb::ZERO, opacity: 1.0 }
    }
}

/// A closed room of 2 to 5 m, with one to three lamps below its ceiling and one to six boxes, about half of them on the
/// floor. Nothing touches or cuts anything else but boxes the floor.
pub fn room(seed: u64) -> SceneInput {
    let mut dice = Dice(Stream::new(mix(seed)));
    let mut input = empty();
    let walls = input.object("walls");
    let size = v(dice.between(2.0, 5.0), dice.between(2.2, 3.0), dice.between(2.0, 5.0));
    let paint = dice.paint();
    let paint = input.material("paint", paint);
    input.inside_of_box(walls, paint, DVec3::ZERO, size);
    let (lamps, black) = (dice.up_to(3), input.material("body", grey(0.0, 0.0)));
    for lamp in 0..lamps {
        let object = input.object(&format!("lamp {lamp}"));
        let emission = Rgb([0; 3].map(|_| dice.between(500.0, 5000.0)));
        let glow = input.material(&format!("glow {lamp}"), Surface { emission, ..grey(0.0, 0.0) });
        // Each in a strip of its own.
        let strip = size.x / f64::from(lamps);
        let (half, deep) = (dice.between(0.1, 0.4) * strip, dice.between(0.05, 0.3));
        let middle = v(strip * (f64::from(lamp) + 0.5), size.y - 0.1, dice.between(0.3, 0.7) * size.z);
        let first = input.faces.len();
        input.outside_of_box(object, black, middle - v(half, 0.02, deep), middle + v(half, 0.02, deep));
        // The third side looks down.
        input.faces[first + 2].material = glow;
    }
    let mut boxes: Vec<(DVec3, DVec3)> = Vec::new();
    let wanted = dice.up_to(6);
    for thing in 0..wanted {
        let extent = v(dice.between(0.1, 0.9), dice.between(0.1, 1.2), dice.between(0.1, 0.9));
        let free = size - extent - v(0.1, 0.3, 0.1);
        let mut low = v(dice.between(0.1, free.x), dice.between(0.05, free.y), dice.between(0.1, free.z));
        if dice.between(0.0, 1.0) < 0.5 {
            low.y = 0.0;
        }
        let high = low + extent;
        let gap = DVec3::splat(0.05);
        if boxes.iter().any(|&(l, h)| (low - gap).cmple(h).all() && (high + gap).cmpge(l).all()) {
            continue;
        }
        boxes.push((low, high));
        let object = input.object(&format!("box {thing}"));
        let paint = dice.paint();
        let paint = input.material(&format!("paint {thing}"), paint);
        input.outside_of_box(object, paint, low, high);
    }
    input
}

/// The same with every quadrilateral in n by n of them, or in twice as many triangles.
pub fn tessellated(input: &SceneInput, n: usize, triangles: bool) -> SceneInput {
    let mut fine = input.clone();
    fine.faces.clear();
    for face in &input.faces {
        let [a, b, c, d] = face.corners[..] else { panic!("a face of {} corners", face.corners.len()) };
        let at = |column: usize, row: usize| {
            let (s, t) = (column as f64 / n as f64, row as f64 / n as f64);
            a.lerp(b, s).lerp(d.lerp(c, s), t)
        };
        for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
            let (p, q, r, s) = (at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1));
            let parts = if triangles { vec![vec![p, q, r], vec![p, r, s]] } else { vec![vec![p, q, r, s]] };
            fine.faces.extend(parts.into_iter().map(|corners| Face { corners, ..face.clone() }));
        }
    }
    fine
}

/// Points spread evenly over all fronts, with their polygons.
pub fn places(scene: &Scene, count: usize, seed: u64) -> Vec<(u32, DVec3)> {
    let mut stream = Stream::new(mix(seed));
    let fronts = &scene.polygons[..scene.fronts];
    let mut before = Vec::with_capacity(fronts.len());
    let mut area = 0.0;
    for front in fronts {
        before.push(area);
        area += front.area;
    }
    (0..count)
        .map(|_| {
            let wanted = stream.next_unit() * area;
            let polygon = before.partition_point(|&before| before <= wanted) - 1;
            (polygon as u32, stream.point(&fronts[polygon].corners, &fronts[polygon].plane))
        })
        .collect()
}

/// The front at a point that faces as `normal` does.
pub fn front_at(scene: &Scene, point: DVec3, normal: DVec3) -> Option<u32> {
    let holds = |polygon: &isolux_core::scene::Polygon| {
        let corners = &polygon.corners[..];
        let is_left = |k: usize| {
            let side = corners[(k + 1) % corners.len()] - corners[k];
            polygon.plane.normal.dot(side.cross(point - corners[k])) >= -scene.tolerance() * side.length()
        };
        polygon.plane.normal.dot(normal) > 0.999
            && polygon.plane.distance(point).abs() <= scene.tolerance()
            && (0..corners.len()).all(is_left)
    };
    scene.polygons[..scene.fronts].iter().position(holds).map(|index| index as u32)
}
