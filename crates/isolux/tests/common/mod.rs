//! Scenes and measures that the tests of the facade share.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test binary uses a part of it")]

#[path = "../../../core/tests/inputs/mod.rs"]
pub mod inputs;

use inputs::{Make, empty, grey, v};
use isolux::core::DVec3;
use isolux::core::sampling::Stream;
use isolux::core::scene::{BuildOptions, Scene, SceneInput};
use isolux::core::solution::Unobserved;
use isolux::{Schedule, Settings, Solution, Tracer, solve};
use std::sync::Arc;

/// A shipped scene as read.
pub fn shipped_input(name: &str) -> SceneInput {
    let path = format!("{}/../../scenes/{name}.glb", env!("CARGO_MANIFEST_DIR"));
    isolux::formats::read::read(path.as_ref(), &Default::default()).unwrap()
}

pub fn scene(input: SceneInput) -> Arc<Scene> {
    let scene = Scene::build(input, &BuildOptions::default()).unwrap();
    scene.check().unwrap();
    Arc::new(scene)
}

pub fn shipped(name: &str) -> Arc<Scene> {
    scene(shipped_input(name))
}

/// Settings for quick tests.
pub fn draft() -> Settings {
    Settings { schedule: Schedule::Wavefront, error: 0.2, threads: 1, ..Settings::default() }
}

/// The same with the paper's method.
pub fn paper() -> Settings {
    Settings { schedule: Schedule::Sequential, ..draft() }
}

/// Quick settings of every schedule, by name.
pub fn schedules() -> [(&'static str, Settings); 2] {
    [draft(), paper()].map(|settings| (settings.schedule.name(), settings))
}

/// Solves and checks.
pub fn solved(scene: &Arc<Scene>, settings: &Settings) -> Solution {
    let solution = solve(scene.clone(), settings, &mut Unobserved).unwrap();
    solution.check().unwrap();
    solution
}

/// Points on all faces that polygons hold, uniform by area: face and barycentric coordinates.
pub fn points(scene: &Scene, count: usize, seed: u64) -> Vec<(u32, [f64; 3])> {
    let areas: Vec<f64> = scene.triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length()).collect();
    let total: f64 = areas.iter().sum();
    let mut stream = Stream::new(seed);
    let mut points = Vec::with_capacity(count);
    while points.len() < count {
        let mut at = stream.next_unit() * total;
        let face = areas.iter().position(|area| {
            at -= area;
            at < 0.0
        });
        let (mut s, mut t) = (stream.next_unit(), stream.next_unit());
        if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        if let Some(face) = face.filter(|&face| scene.face_polygon[face] != Scene::NO_POLYGON) {
            points.push((face as u32, [1.0 - s - t, s, t]));
        }
    }
    points
}

/// Irradiances (mean over bands) at points.
pub fn irradiances(solution: &Solution, points: &[(u32, [f64; 3])]) -> Vec<f64> {
    points.iter().map(|&(face, at)| solution.irradiance_at(face, at).unwrap().mean()).collect()
}

/// RMS of the difference, relative to the mean of `one`.
pub fn difference(one: &[f64], two: &[f64]) -> f64 {
    assert_eq!(one.len(), two.len());
    let mean = one.iter().sum::<f64>() / one.len() as f64;
    let square: f64 = one.iter().zip(two).map(|(a, b)| (a - b) * (a - b)).sum();
    (square / one.len() as f64).sqrt() / mean
}

/// A box of 2 x 1 x 1.5 with a lamp of 0.5 x 0.5 just below its ceiling and walls that reflect `reflectance`.
pub fn lit_box(reflectance: f64) -> SceneInput {
    let mut input = empty();
    let (walls, lamp) = (input.object("walls"), input.object("lamp"));
    let paint = input.material("paint", grey(reflectance, 0.0));
    let glow = input.material("glow", grey(0.0, 10.0));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(2.0, 1.0, 1.5));
    let (low, high, y) = (0.5, 1.0, 0.9);
    input.face(lamp, glow, &[v(low, y, low), v(high, y, low), v(high, y, high), v(low, y, high)]);
    input
}

/// Where so many paths of green light from the one lamp of a scene end: where they are absorbed, or nowhere, outside. Paths
/// know neither elements nor links.
pub fn path_ends(scene: &Arc<Scene>, paths: usize) -> Vec<Option<DVec3>> {
    let tracer = Tracer::new(scene.clone());
    let mut lamps = scene.polygons.iter().filter(|polygon| polygon.emission[1] > 0.0);
    let lamp = lamps.next().unwrap();
    assert!(lamps.next().is_none(), "one lamp");
    let mut stream = Stream::new(7);
    let mut path = || {
        let mut at = stream.point(&lamp.corners, &lamp.plane);
        let mut direction = stream.cosine_direction(lamp.plane.normal);
        loop {
            let meeting = tracer.closest(at, direction, f64::INFINITY)?;
            let polygon = &scene.polygons[meeting.polygon as usize];
            at += direction * meeting.distance;
            if !meeting.front_facing || stream.next_unit() >= polygon.reflectance[1] {
                return Some(at);
            }
            direction = stream.cosine_direction(polygon.plane.normal);
        }
    };
    (0..paths).map(|_| path()).collect()
}
