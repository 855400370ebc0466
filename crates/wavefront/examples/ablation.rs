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
    let points = std::fs::read(points)?;
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

/// Rows of irradiance for rows of points.
fn irradiances(points: &[u8], scene: &Scene, outcome: &Outcome) -> Vec<u8> {
    let (numbers, _) = points.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let (rows, _) = numbers.as_chunks::<4>();
    let irradiance = |&[face, a, b, c]: &[f64; 4]| {
        let face = face as u32;
        let polygon = scene.face_polygon[face as usize];
        if polygon == Scene::NO_POLYGON {
            return [f64::NAN; 3];
        }
        let normal = scene.polygons[polygon as usize].plane.normal;
        let point = scene.position(face, [a, b, c]);
        irradiance_at(&outcome.elements, &outcome.fields, polygon, normal, point).0
    };
    rows.iter().flat_map(irradiance).flat_map(f64::to_le_bytes).collect()
}
