//! Smooth values beside walls that stand on a floor: each side of a wall has its own light, in meshes, pictures, at points and in
//! what a viewer draws.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{draft, paper, scene, solved};
use isolux::core::DVec3;
use isolux::core::scene::Scene;
use isolux::core::solution::{SurfaceMesh, Unobserved};
use isolux::core::tree::ElementId;
use isolux::{RenderSettings, Settings, Solution, View, render};
use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::Arc;

/// The polygon of the floor.
const FLOOR: u32 = 2;

const ROOM: DVec3 = DVec3::new(4.0, 2.5, 3.0);

/// A closed room with a lamp at its west end and a wall from floor to ceiling, from side to side: its foot runs from `north`
/// to `south` (x), its back as far to the east as it is thick.
fn divided(north: f64, south: f64, thickness: f64) -> Arc<Scene> {
    let mut input = empty();
    let (walls, lamp, wall) = (input.object("walls"), input.object("lamp"), input.object("wall"));
    let (paint, glow) = (input.material("paint", grey(0.7, 0.0)), input.material("glow", grey(0.0, 5000.0)));
    input.inside_of_box(walls, paint, DVec3::ZERO, ROOM);
    let y = 2.4;
    input.face(lamp, glow, &[v(0.8, y, 1.2), v(1.3, y, 1.2), v(1.3, y, 1.7), v(0.8, y, 1.7)]);
    let foot = |x: f64, z: f64| [v(x, 0.0, z), v(x, ROOM.y, z)];
    let [a, b] = foot(north, 0.0);
    let [d, c] = foot(south, ROOM.z);
    input.face(wall, paint, &[a, d, c, b]);
    let east = |corner: DVec3| corner + v(thickness, 0.0, 0.0);
    input.face(wall, paint, &[a, b, c, d].map(east));
    scene(input)
}

/// What walls there are: by name, where the foot of the lit side begins and ends, and the thickness. 2 m is where elements end.
const WALLS: [(&str, f64, f64, f64); 4] = [
    ("on a line", 2.0, 2.0, 0.0),
    ("between lines", 1.83, 1.83, 0.0),
    ("oblique", 1.7, 2.3, 0.0),
    ("thick", 1.95, 1.95, 0.1),
];

fn side(point: DVec3, north: f64, south: f64) -> f64 {
    point.x - (north + (south - north) * point.z / ROOM.z)
}

/// What a picture from above shows of the floor at a place: irradiance.
fn seen(solution: &Solution, at: DVec3) -> f64 {
    let view = View::LookAt { eye: at + v(0.0, 1.0, 0.0), at, vertical_angle: 1e-3 };
    let settings = RenderSettings { width: 1, height: 1, samples_per_side: 1, gather: None, threads: 1 };
    render(solution, &view, &settings, &mut Unobserved).unwrap()[0].mean() * PI / 0.7
}

/// Means over bands at the corners of a triangle of a mesh.
fn values(mesh: &SurfaceMesh, triangle: [u32; 3]) -> [f64; 3] {
    triangle.map(|vertex| mesh.irradiance[vertex as usize].mean())
}

/// Leaves of floor, ceiling and walls around that lie on one side of a wall, and how many.
fn leaves_beside(solution: &Solution, is_beside: impl Fn(DVec3) -> bool) -> Vec<bool> {
    let elements = &solution.hierarchy().elements;
    let mut beside = vec![false; elements.len()];
    for leaf in elements.leaves() {
        let element = elements.get(leaf);
        beside[leaf.index()] = element.polygon < 6 && element.corners.iter().all(|&corner| is_beside(corner));
    }
    beside
}

/// Catches vertices that mix the light of the two sides of a wall, whether it stands where elements end, runs through elements or
/// is as thick as them, in meshes, pictures and at points. Elements that a wall runs through blur it, others do not.
#[test]
fn each_side_of_a_wall_has_its_own_light() {
    for (name, north, south, thickness) in WALLS {
        let scene = divided(north, south, thickness);
        for (schedule, settings) in [("wavefront", draft()), ("sequential", paper())] {
            let name = format!("{name}, {schedule}");
            let solution = solved(&scene, &Settings { error: 0.1, ..settings });
            let (mesh, elements) = (solution.mesh(), &solution.hierarchy().elements);
            let dark = leaves_beside(&solution, |corner| side(corner, north, south) > thickness - 1e-6);
            let lit = leaves_beside(&solution, |corner| side(corner, north, south) < 1e-6);
            let (mut sum, mut count, mut worst) = (0.0, 0.0, 0.0_f64);
            for polygon in 0..6 {
                for &triangle in &mesh.triangles[mesh.triangles_of(polygon)] {
                    let middle =
                        triangle.map(|vertex| mesh.positions[vertex as usize]).into_iter().sum::<DVec3>() / 3.0;
                    let leaf = elements.locate(ElementId(polygon), middle).index();
                    if dark[leaf] {
                        worst = values(mesh, triangle).into_iter().fold(worst, f64::max);
                    } else if lit[leaf] {
                        sum += values(mesh, triangle).into_iter().sum::<f64>() / 3.0;
                        count += 1.0;
                    }
                }
            }
            let mean = sum / count;
            if let Some(transport) = solution.transport() {
                // No more than some leaf has on that side.
                let mut most = 0.0_f64;
                for leaf in elements.leaves().filter(|leaf| dark[leaf.index()]) {
                    let (corners, fields) = (&elements.get(leaf).corners, &transport.fields[leaf.index()]);
                    let normal = scene.polygons[elements.get(leaf).polygon as usize].plane.normal;
                    let at = |&corner: &DVec3| isolux_wavefront::irradiance_in(corners, normal, corner, fields).mean();
                    most = corners.iter().map(at).fold(most, f64::max);
                }
                assert!(worst <= most * (1.0 + 1e-9), "{name}: {} {}", worst / mean, most / mean);
            }
            let place = |off: f64| v(0.5 * (north + south) + off, 0.0, 1.5);
            let beside = [0.02, 0.1].map(|off| seen(&solution, place(-off)));
            // Measured 0.90 to 0.98, 0.72 to 0.79 where vertices on the wall's foot have both sides' light.
            assert!(beside[0] > 0.85 * beside[1], "{name}: {beside:?}");
            for off in [0.02, 0.1] {
                let behind = place(thickness + off);
                let (seen, solved) = (seen(&solution, behind) / mean, at_point(&solution, behind) / mean);
                // Where elements are as large as that one which the wall runs through shows its light on both sides.
                let blurred = off < 0.05 && name == "between lines, sequential";
                // Measured 0.161 at most over five seeds, and up to 0.69 beside walls where elements end.
                assert!(seen.max(solved) < 0.17 || blurred, "{name}: {off} {seen} {solved}");
            }
            if !name.starts_with("between") && !name.starts_with("oblique") {
                // Measured 0.092 and 0.009, and 0.24 to 0.82.
                assert!(worst < 0.12 * mean, "{name}: {}", worst / mean);
            }
        }
    }
}

/// Catches cracks and T-junctions along a wall's foot: but for its border each side of a triangle is one of another one, by
/// where its ends are, and the vertices of the two sides are in one place.
#[test]
fn meshes_hold_together_below_a_wall() {
    let scene = divided(2.0, 2.0, 0.0);
    for settings in [draft(), paper()] {
        let solution = solved(&scene, &Settings { error: 0.1, ..settings });
        let mesh = solution.mesh();
        let bits = |vertex: u32| mesh.positions[vertex as usize].to_array().map(|x| (x + 0.0).to_bits());
        let is_border = |p: DVec3, q: DVec3| {
            [p.x, q.x] == [0.0; 2] || [p.x, q.x] == [ROOM.x; 2] || [p.z, q.z] == [0.0; 2] || [p.z, q.z] == [ROOM.z; 2]
        };
        let mut sides: HashMap<[[u64; 3]; 2], u32> = HashMap::new();
        for &triangle in &mesh.triangles[mesh.triangles_of(FLOOR)] {
            for k in 0..3 {
                let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
                *sides.entry([bits(from), bits(to)]).or_default() += 1;
                let [p, q] = [from, to].map(|vertex| mesh.positions[vertex as usize]);
                if is_border(p, q) {
                    *sides.entry([bits(to), bits(from)]).or_default() += 1;
                }
            }
        }
        for ([from, to], count) in &sides {
            assert_eq!((*count, sides.get(&[*to, *from])), (1, Some(&1)));
        }
        let mut places: HashMap<[u64; 3], Vec<f64>> = HashMap::new();
        for vertex in mesh.vertices_of(FLOOR) {
            places.entry(bits(vertex as u32)).or_default().push(mesh.irradiance[vertex].mean());
        }
        // Each vertex at the foot, and no other, is there twice: lit and dark.
        for (place, values) in places {
            let is_foot = f64::from_bits(place[0]) == 2.0;
            assert_eq!(values.len(), if is_foot { 2 } else { 1 });
            assert!(!is_foot || values[0].min(values[1]) < 0.2 * values[0].max(values[1]), "{values:?}");
        }
    }
}

/// Irradiance at a point of the floor, as the solution tells it.
fn at_point(solution: &Solution, point: DVec3) -> f64 {
    let scene = solution.scene();
    let found = scene.triangles.iter().enumerate().find_map(|(face, &[a, b, c])| {
        let normal = (b - a).cross(c - a);
        let (area, unit) = (normal.length(), normal.normalize());
        let of = |p: DVec3, q: DVec3| unit.dot((p - point).cross(q - point)) / area;
        let weights = [of(b, c), of(c, a), of(a, b)];
        (unit.y > 0.9 && weights.iter().all(|&weight| weight >= 0.0)).then_some((face as u32, weights))
    });
    let (face, at) = found.unwrap();
    solution.irradiance_at(face, at).unwrap().mean()
}
