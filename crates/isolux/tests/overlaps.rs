//! Faces that lie in one place: of those that face the same way the later one counts, as if the part of the others that it
//! covers were cut away.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{difference, draft, lit_box, points, scene, shipped, shipped_input, solved};
use isolux::core::DVec3;
use isolux::core::scene::{Scene, SceneInput};
use isolux::{Settings, Solution, Status, Tracer};
use std::sync::Arc;

fn asked(error: f64) -> Settings {
    Settings { error, ..draft() }
}

/// Places on the fronts of a scene that nothing covers, with the normals there.
fn open_places(scene: &Arc<Scene>, count: usize) -> Vec<(DVec3, DVec3)> {
    let tracer = Tracer::new(scene.clone());
    let place = |&(face, at): &(u32, [f64; 3])| {
        let (polygon, position) = (scene.face_polygon[face as usize], scene.position(face, at));
        let normal = scene.polygons[polygon as usize].plane.normal;
        (!tracer.is_covered(position, polygon)).then_some((position, normal))
    };
    points(scene, count, 5).iter().filter_map(place).collect()
}

/// Mean over bands of the irradiance at places: of the last face that holds each, and faces the same way.
fn values(solution: &Solution, places: &[(DVec3, DVec3)]) -> Vec<f64> {
    let scene = solution.scene();
    let at = |&(point, up): &(DVec3, DVec3)| {
        let holds = |(face, &[a, b, c]): (usize, &[DVec3; 3])| {
            let normal = (b - a).cross(c - a);
            let (area, unit) = (normal.length(), normal.normalize());
            let of = |p: DVec3, q: DVec3| unit.dot((p - point).cross(q - point)) / area;
            let weights = [of(b, c), of(c, a), of(a, b)];
            let inside = weights.iter().all(|&weight| weight >= -1e-9) && unit.dot(point - a).abs() < 1e-6;
            (inside && unit.dot(up) > 0.9).then_some((face as u32, weights))
        };
        let (face, at) = scene.triangles.iter().enumerate().rev().find_map(holds).unwrap();
        solution.irradiance_at(face, at).unwrap().mean()
    };
    places.iter().map(at).collect()
}

/// RMS difference of two solutions at the open places of the first, relative to its mean.
fn apart(one: &Solution, other: &Solution) -> f64 {
    let places = open_places(one.scene(), 2000);
    difference(&values(one, &places), &values(other, &places))
}

fn imbalance(solution: &Solution) -> f64 {
    solution.report().energy.as_ref().unwrap().imbalance.abs()
}

/// `leaks/coplanar` without what lies twice in one place: no rug, and a wall of one piece.
fn once() -> Arc<Scene> {
    let mut input = shipped_input("leaks/coplanar");
    let number = |name: &str| input.objects.iter().position(|object| object.name == name).unwrap() as u32;
    let (rug, north, south) = (number("rug"), number("north piece"), number("south piece"));
    let end = input.faces.iter().filter(|face| face.object == south).flat_map(|face| &face.corners);
    let end = end.map(|corner| corner.z).fold(0.0, f64::max);
    for face in input.faces.iter_mut().filter(|face| face.object == north) {
        face.corners.iter_mut().filter(|corner| corner.z > 1.0).for_each(|corner| corner.z = end);
    }
    input.faces.retain(|face| face.object != rug && face.object != south);
    scene(input)
}

/// Catches light that is there twice, rays that meet now the one and now the other, and claims that say so.
#[test]
fn faces_in_one_place_count_once() {
    let exact = solved(&once(), &asked(0.01));
    let twice = shipped("leaks/coplanar");
    for error in [0.05, 0.02] {
        let solution = solved(&twice, &asked(error));
        assert_eq!(solution.report().status, Status::Converged);
        let (off, claimed) = (apart(&solution, &exact), solution.report().error_estimate.unwrap().total);
        assert!(off < error, "{error}: {off}");
        assert!((0.5..2.0).contains(&(claimed / off)), "{error}: off by {off}, claimed {claimed}");
        assert!(imbalance(&solution) < 0.01, "{error}: {:?}", solution.report().energy);
    }
}

/// Catches a second copy that receives or throws anything, in whatever form it comes.
#[test]
fn a_wall_that_is_there_twice_changes_nothing() {
    let single = solved(&scene(lit_box(0.7)), &asked(0.03));
    for copies in [1, 2] {
        let mut input = lit_box(0.7);
        // All walls, the floor in triangles and the lamp.
        for _ in 0..copies {
            for index in 0..7 {
                let face = input.faces[index].clone();
                let [a, b, c, d] = face.corners[..] else { unreachable!() };
                if index == 2 {
                    input.face(face.object, face.material, &[b, c, d]);
                    input.face(face.object, face.material, &[b, d, a]);
                } else {
                    input.face(face.object, face.material, &[c, d, a, b]);
                }
            }
        }
        let solution = solved(&scene(input), &asked(0.03));
        let off = apart(&solution, &single);
        assert!(off < 0.03 * std::f64::consts::SQRT_2, "{copies}: {off}");
        assert!(imbalance(&solution) < 0.01, "{copies}: {:?}", solution.report().energy);
    }
}

/// A rug of 0.8 x 0.6 on the floor of a lit box, as bright as that is dark; the floor runs on below it, or is cut around it.
fn furnished(cut: bool) -> SceneInput {
    let mut input = lit_box(0.5);
    let paint = input.material("dark", grey(0.1, 0.0));
    let (floor, rug) = (input.faces.remove(2).object, input.object("rug"));
    let wool = input.material("wool", grey(0.8, 0.0));
    let mut tile = |object: u32, material: u32, low: [f64; 2], high: [f64; 2]| {
        let corner = |x: f64, z: f64| v(x, 0.0, z);
        let corners =
            [corner(low[0], low[1]), corner(low[0], high[1]), corner(high[0], high[1]), corner(high[0], low[1])];
        input.face(object, material, &corners);
    };
    if cut {
        for (low, high) in
            [([0.0, 0.0], [2.0, 0.4]), ([0.0, 0.4], [0.3, 1.0]), ([1.1, 0.4], [2.0, 1.0]), ([0.0, 1.0], [2.0, 1.5])]
        {
            tile(floor, paint, low, high);
        }
    } else {
        tile(floor, paint, [0.0, 0.0], [2.0, 1.5]);
    }
    tile(rug, wool, [0.3, 0.4], [1.1, 1.0]);
    input
}

/// Catches a floor that shows through the rug that lies on it, or throws light from under it.
#[test]
fn a_rug_is_as_good_as_a_hole_of_its_shape() {
    for error in [0.1, 0.03] {
        let cut = solved(&scene(furnished(true)), &asked(0.01));
        let solution = solved(&scene(furnished(false)), &asked(error));
        assert_eq!(solution.report().status, Status::Converged);
        let off = apart(&solution, &cut);
        assert!(off < error, "{error}: {off}");
        assert!(imbalance(&solution) < 0.01, "{:?}", solution.report().energy);
    }
}

/// Catches an order that is not the scene's: what comes before the floor lies under it.
#[test]
fn the_later_face_lies_on_top() {
    let mut input = furnished(false);
    let rug = input.faces.pop().unwrap();
    input.faces.insert(0, rug);
    let under = solved(&scene(input.clone()), &asked(0.03));
    input.faces.remove(0);
    let without = solved(&scene(input), &asked(0.03));
    let off = apart(&under, &without);
    assert!(off < 0.03 * std::f64::consts::SQRT_2, "{off}");
    let report = under.report();
    assert!(report.energy.as_ref().unwrap().imbalance.abs() < 0.01);
}

/// Catches an answer that depends on who meets a place, when, and from how many threads.
#[test]
fn threads_change_no_bit_where_faces_overlap() {
    let scene = scene(furnished(false));
    let fields = |threads: usize| {
        let solution = solved(&scene, &Settings { threads, ..asked(0.05) });
        (solution.transport().unwrap().fields.clone(), solution.report().error_estimate)
    };
    let one = fields(1);
    for threads in [2, 3] {
        assert!(one == fields(threads), "{threads}");
    }
}

/// Three squares in one place, and two beside them that overlap; fronts up, unless `turned`.
fn stack(turned: bool, two_sided: bool) -> Arc<Scene> {
    let mut input = empty();
    let (object, paint) = (input.object("sheets"), input.material("paint", grey(0.5, 1.0)));
    input.materials[paint as usize].two_sided = two_sided;
    let mut sheet = |low: f64, high: f64| {
        let mut corners = [v(low, 0.3, 0.0), v(low, 0.3, 1.0), v(high, 0.3, 1.0), v(high, 0.3, 0.0)];
        if turned {
            corners.reverse();
        }
        input.face(object, paint, &corners);
    };
    (0..3).for_each(|_| sheet(0.0, 1.0));
    sheet(2.0, 3.0);
    sheet(2.5, 3.5);
    scene(input)
}

/// Catches rays that meet one of several faces by chance.
#[test]
fn rays_meet_the_last_of_several_faces() {
    for (turned, two_sided) in [(false, false), (true, false), (false, true), (true, true)] {
        let tracer = Tracer::new(stack(turned, two_sided));
        for step in 0..200 {
            let x = f64::from(step % 35) * 0.1 + 0.013;
            let towards = v(x, 0.3, 0.1 + 0.004 * f64::from(step));
            let expected = match x {
                ..1.0 => Some(2),
                2.0..2.5 => Some(3),
                2.5.. => Some(4),
                _ => None,
            };
            for eye in [v(0.7, 2.0, 0.4), v(1.3, -2.0, 0.2)] {
                let met = tracer.closest(eye, (towards - eye).normalize(), f64::INFINITY);
                let is_front = (eye.y > 0.0) != turned;
                assert!(met.is_none_or(|met| met.front_facing == is_front));
                // Black backs are as good as each other.
                if is_front || two_sided {
                    assert_eq!(met.map(|met| met.polygon), expected, "{turned} {two_sided} {x}");
                } else {
                    assert_eq!(met.is_some(), expected.is_some());
                }
            }
        }
    }
}

/// Catches a lamp that shines through what lies on it, and a lid that is lit from below.
#[test]
fn a_lamp_under_a_later_face_is_dark() {
    let solution = |part: Option<f64>| {
        let mut input = lit_box(0.5);
        let [a, b, c, d] = input.faces[6].corners[..] else { unreachable!() };
        let lid = input.material("lid", grey(0.5, 0.0));
        match part {
            None => {}
            Some(share) => {
                input.face(1, lid, &[a, a.lerp(b, share), d.lerp(c, share), d]);
            }
        }
        solved(&scene(input), &asked(0.03))
    };
    let absorbed = |solution: &Solution| solution.report().energy.as_ref().unwrap().absorbed.mean();
    let (open, half) = (solution(None), solution(Some(0.5)));
    // A black lamp, and half of it one that reflects half: there is a little more than half.
    let share = absorbed(&half) / absorbed(&open);
    assert!((share - 0.5).abs() < 0.01, "{share}");
    assert!(imbalance(&half) < 0.01, "{:?}", half.report().energy);
    // What was guessed to begin with has died away.
    assert!(absorbed(&solution(Some(1.0))) < 1e-9 * absorbed(&open));
}

/// Catches black faces in lit files, where a viewer may draw either of two that lie in one place.
#[test]
fn a_covered_face_shows_the_light_of_what_covers_it() {
    let mut input = lit_box(0.7);
    let floor = input.faces[2].clone();
    input.face(floor.object, floor.material, &floor.corners);
    let solution = solved(&scene(input), &asked(0.05));
    let mesh = solution.mesh();
    // The floor, of one leaf as nothing arrives there, and the copy that lies on it.
    let corners = mesh.vertices_of(2).filter(|&vertex| floor.corners.contains(&mesh.positions[vertex]));
    for vertex in corners {
        let shown = mesh.irradiance[vertex].mean();
        let on_top = values(&solution, &[(mesh.positions[vertex], DVec3::Y)])[0];
        assert!((shown / on_top - 1.0).abs() < 0.02, "{}: {shown}, {on_top}", mesh.positions[vertex]);
    }
}
