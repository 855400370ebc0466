//! One solve with all ideas or all but one: a scene, an error and points go in, irradiance there and one line of JSON about
//! the solve come out. `benches/ablation.py` runs it.
//!
//!     cargo run --release -p isolux-wavefront --example ablation -- --ideas
//!     cargo run --release -p isolux-wavefront --example ablation -- SCENE.glb ERROR POINTS OUT [IDEA]
//!
//! `POINTS` and `OUT` are rows of little-endian doubles: face and three barycentric coordinates, red, green and blue. Faces
//! without a polygon have NaN. Threads are as many as `RAYON_NUM_THREADS` says.

#![allow(clippy::print_stdout, reason = "what it prints is its result")]

use isolux_core::scene::{BuildOptions, Scene};
use isolux_formats::read::{ReadOptions, read};
use isolux_wavefront::{Control, Ideas, Outcome, Prepared, Request, irradiance_at};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

/// Least area of elements, share of the scene's, as `isolux solve` has it.
const LEAST_AREA: f64 = 1e-8;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["--ideas"] => {
            let names = Ideas::each_left_out().into_iter().map(|(name, _)| name);
            println!("{:?}", names.collect::<Vec<_>>());
            Ok(())
        }
        [scene, error, points, out] => solve(scene, error.parse()?, points, out, Ideas::default()),
        [scene, error, points, out, idea] => solve(scene, error.parse()?, points, out, all_but(idea)?),
        _ => Err("wanted: --ideas, or SCENE ERROR POINTS OUT [IDEA]".into()),
    }
}

fn all_but(idea: &str) -> Result<Ideas, String> {
    let found = Ideas::each_left_out().into_iter().find(|(name, _)| *name == idea);
    found.map(|(_, ideas)| ideas).ok_or_else(|| format!("no idea has the name {idea:?}"))
}

fn solve(scene: &str, error: f64, points: &str, out: &str, ideas: Ideas) -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(Scene::build(read(scene.as_ref(), &ReadOptions::default())?, &BuildOptions::default())?);
    let points = read_points(points, &scene)?;
    let request = Request { least_area: LEAST_AREA, ideas, ..Request::new(error) };
    let start = Instant::now();
    let prepared = Prepared::new(scene.clone());
    let solved = prepared.solve(&request, &Control::default());
    let seconds = start.elapsed().as_secs_f64();
    let last = solved.stages.last().ok_or("nothing was refined")?;
    println!(
        "{{\"seconds\": {seconds}, \"refinement\": {}, \"elements\": {}, \"links\": {}, \
         \"dark_links\": {}, \"pairs\": {}, \"packets\": {}, \"claimed\": {}, \"bound\": \"{}\"}}",
        solved.stages.iter().map(|stage| stage.seconds[0]).sum::<f64>(),
        last.elements,
        last.links,
        last.dark_links,
        last.evaluated[0],
        last.evaluated[1],
        solved.estimate.map_or("null".to_owned(), |estimate| estimate.total.to_string()),
        solved.bound.map_or(String::new(), |bound| format!("{bound:?}").to_lowercase()),
    );
    std::fs::write(out, irradiances(&points, &scene, &solved.outcome(&scene)))?;
    Ok(())
}

/// A face, and barycentric coordinates there.
type Point = (u32, [f64; 3]);

/// Reads rows of points on faces of a scene.
fn read_points(path: &str, scene: &Scene) -> Result<Vec<Point>, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("{path}: {error}"))?;
    let (numbers, rest) = bytes.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let (rows, more) = numbers.as_chunks::<4>();
    if !rest.is_empty() || !more.is_empty() {
        return Err(format!("{path}: {} bytes are not rows of four doubles", bytes.len()));
    }
    let faces = scene.face_polygon.len();
    let point = |(row, &[face, a, b, c]): (usize, &[f64; 4])| {
        if face.fract() != 0.0 || !(0.0..faces as f64).contains(&face) {
            return Err(format!("{path}, row {row}: no face has the number {face}; there are {faces}"));
        }
        if ![a, b, c].iter().all(|at| at.is_finite()) {
            return Err(format!("{path}, row {row}: [{a}, {b}, {c}] is no place on a face"));
        }
        Ok((face as u32, [a, b, c]))
    };
    rows.iter().enumerate().map(point).collect()
}

/// Rows of irradiance for points.
fn irradiances(points: &[Point], scene: &Scene, outcome: &Outcome) -> Vec<u8> {
    let irradiance = |&(face, at): &Point| {
        let polygon = scene.face_polygon[face as usize];
        if polygon == Scene::NO_POLYGON {
            return [f64::NAN; 3];
        }
        let normal = scene.polygons[polygon as usize].plane.normal;
        irradiance_at(&outcome.elements, &outcome.fields, polygon, normal, scene.position(face, at)).0
    };
    points.iter().flat_map(irradiance).flat_map(f64::to_le_bytes).collect()
}
