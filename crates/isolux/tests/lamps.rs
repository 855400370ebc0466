//! Lamps without a surface in the schedule `wavefront`: light against formulas, shadows, energy, groups, and what is refused.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{difference, draft, irradiances, points, scene, solved};
use isolux::core::DVec3;
use isolux::core::scene::{Lamp, LampShape, Scene, SceneInput};
use isolux::core::units::Rgb;
use isolux::{Settings, Solution, Status};
use std::sync::Arc;

fn asked(error: f64) -> Settings {
    Settings { error, ..draft() }
}

fn lamp(name: &str, position: DVec3, forward: DVec3, intensity: f64, shape: LampShape) -> Lamp {
    let side = forward.any_orthonormal_vector();
    Lamp { name: name.into(), position, forward, side, intensity: Rgb::splat(intensity), shape }
}

fn point(name: &str, position: DVec3, intensity: f64) -> Lamp {
    lamp(name, position, DVec3::NEG_Y, intensity, LampShape::Point)
}

fn sun(forward: DVec3, irradiance: f64) -> Lamp {
    lamp("sun", DVec3::ZERO, forward, irradiance, LampShape::Parallel)
}

/// A floor of 4 x 4 that reflects a half.
fn floor() -> SceneInput {
    let mut input = empty();
    let (object, paint) = (input.object("floor"), input.material("paint", grey(0.5, 0.0)));
    input.face(object, paint, &[v(-2.0, 0.0, -2.0), v(-2.0, 0.0, 2.0), v(2.0, 0.0, 2.0), v(2.0, 0.0, -2.0)]);
    input
}

/// Where points of faces are, and which way they look.
fn places(scene: &Scene, points: &[(u32, [f64; 3])]) -> Vec<(DVec3, DVec3)> {
    let place = |&(face, [a, b, c]): &(u32, [f64; 3])| {
        let [p, q, r] = scene.triangles[face as usize];
        (p * a + q * b + r * c, (q - p).cross(r - p).normalize())
    };
    points.iter().map(place).collect()
}

/// What the lamps of a scene throw on a place that nothing hides.
fn formula(scene: &Scene, (place, normal): (DVec3, DVec3)) -> f64 {
    let thrown = scene.lamps.iter().filter_map(|lamp| lamp.thrown_on(place));
    thrown.map(|thrown| thrown.facing.mean() * thrown.towards.dot(normal).max(0.0)).sum()
}

fn claimed(solution: &Solution) -> f64 {
    solution.report().error_estimate.unwrap().total
}

fn told(what: &str, solution: &Solution, off: f64) {
    let report = solution.report();
    println!(
        "{what}: off {off:.5}, claims {:.5}, {:?}, {} leaves, {:.2} s {:?}",
        claimed(solution),
        report.status,
        report.leaves,
        report.phases.iter().map(|phase| phase.seconds).sum::<f64>(),
        report.energy.map(|energy| energy.imbalance)
    );
}

#[test]
fn a_floor_gets_what_the_formula_says() {
    let lamps = [
        point("bulb", v(0.3, 1.0, 0.2), 100.0),
        lamp(
            "spot",
            v(0.3, 1.5, 0.2),
            v(0.2, -1.0, 0.1).normalize(),
            100.0,
            LampShape::Spot { inner: 0.3, outer: 0.6 },
        ),
        lamp(
            "hard",
            v(0.3, 1.5, 0.2),
            v(0.2, -1.0, 0.1).normalize(),
            100.0,
            LampShape::Spot { inner: 0.5999, outer: 0.6 },
        ),
        sun(v(0.3, -1.0, 0.4).normalize(), 100.0),
    ];
    for lamp in lamps {
        let name = lamp.name.clone();
        let scene = scene(SceneInput { lamps: vec![lamp], ..floor() });
        for error in [0.05, 0.01] {
            let solution = solved(&scene, &asked(error));
            let at = points(&scene, 400_000, 3);
            let exact: Vec<f64> = places(&scene, &at).into_iter().map(|place| formula(&scene, place)).collect();
            let off = difference(&exact, &irradiances(&solution, &at));
            told(&name, &solution, off);
        }
    }
}

#[test]
fn a_plate_throws_a_shadow() {
    for (lamp, is_sun) in [(point("bulb", v(0.0, 1.0, 0.0), 100.0), false), (sun(DVec3::NEG_Y, 100.0), true)] {
        let mut input = floor();
        let plate = input.object("plate");
        let black = input.material("black", grey(0.0, 0.0));
        let y = 0.5;
        input.face(plate, black, &[v(-0.33, y, -0.33), v(-0.33, y, 0.33), v(0.33, y, 0.33), v(0.33, y, -0.33)]);
        input.lamps.push(lamp);
        let scene = scene(input);
        let half = if is_sun { 0.33 } else { 0.66 };
        for error in [0.05, 0.01] {
            let solution = solved(&scene, &asked(error));
            let at = points(&scene, 400_000, 3);
            let at_places = places(&scene, &at);
            let exact: Vec<f64> = at_places
                .iter()
                .map(|&(place, normal)| {
                    let hidden = place.y == 0.0 && place.x.abs().max(place.z.abs()) < half;
                    if hidden { 0.0 } else { formula(&scene, (place, normal)) }
                })
                .collect();
            let found = irradiances(&solution, &at);
            let off = difference(&exact, &found);
            told(&format!("plate {is_sun}"), &solution, off);
            let leak = at_places
                .iter()
                .zip(&found)
                .filter(|((place, _), _)| place.y == 0.0 && place.x.abs().max(place.z.abs()) < half - 0.05)
                .map(|(_, &value)| value)
                .fold(0.0, f64::max);
            println!("leak {leak}");
        }
    }
}

#[test]
fn a_closed_box_holds_its_light() {
    for (rho, error) in [(0.5, 0.05), (0.8, 0.05), (0.8, 0.02), (0.8, 0.01)] {
        let mut input = empty();
        let (walls, paint) = (input.object("walls"), input.material("paint", grey(rho, 0.0)));
        input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(2.0, 1.0, 1.5));
        input.lamps.push(point("bulb", v(1.0, 0.5, 0.75), 100.0));
        let scene = scene(input);
        let solution = solved(&scene, &asked(error));
        let wanted = 400.0 * std::f64::consts::PI / (scene.area() * (1.0 - rho));
        let mean = solution.report().mean_irradiance.mean();
        told("box", &solution, mean / wanted - 1.0);
        println!("{:?}", solution.report().energy);
    }
}

fn room(lamps: Vec<Lamp>) -> SceneInput {
    let mut input = empty();
    let (walls, paint) = (input.object("walls"), input.material("paint", grey(0.7, 0.0)));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(2.0, 1.0, 1.5));
    let block = input.object("block");
    input.outside_of_box(block, paint, v(1.2, 0.0, 0.5), v(1.6, 0.4, 1.0));
    input.lamps = lamps;
    input
}

/// A ball of radius 1 as triangles: an octahedron whose faces are quartered so many times.
fn ball(times: u32) -> Vec<[DVec3; 3]> {
    let mut faces: Vec<[DVec3; 3]> = Vec::new();
    for (x, y, z) in
        [(1, 1, 1), (1, 1, -1), (1, -1, 1), (1, -1, -1), (-1, 1, 1), (-1, 1, -1), (-1, -1, 1), (-1, -1, -1)]
    {
        let [a, b, c] = [DVec3::X * f64::from(x), DVec3::Y * f64::from(y), DVec3::Z * f64::from(z)];
        faces.push(if x * y * z > 0 { [a, b, c] } else { [a, c, b] });
    }
    for _ in 0..times {
        let quarters = |&[a, b, c]: &[DVec3; 3]| {
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
        };
        faces = faces.iter().flat_map(quarters).collect();
    }
    faces
}

#[test]
fn a_point_is_a_tiny_bulb() {
    let of_point = scene(room(vec![point("bulb", v(0.7, 0.6, 0.75), 100.0)]));
    let mut input = room(vec![]);
    let bulb = input.object("bulb");
    let (faces, radius, middle) = (ball(3), 0.002, v(0.7, 0.6, 0.75));
    let area: f64 = faces.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length() * radius * radius).sum();
    let glow = input.material("glow", grey(0.0, 400.0 * std::f64::consts::PI / area));
    for face in faces {
        input.face(bulb, glow, &face.map(|corner| middle + corner * radius));
    }
    let of_cube = scene(input);
    let (one, two) = (solved(&of_point, &asked(0.02)), solved(&of_cube, &asked(0.02)));
    told("point", &one, 0.0);
    told("cube", &two, 0.0);
    println!("{:?} {:?}", one.report().mean_irradiance, two.report().mean_irradiance);
    let at = points(&of_point, 20_000, 3);
    println!("{}", difference(&irradiances(&one, &at), &irradiances(&two, &at)));
}
