//! Development: solves a scene and writes irradiances at points.
use isolux_wavefront::{Control, Prepared, Request};
use std::io::Write;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let start = std::time::Instant::now();
    let scene = isolux_core::scene::Scene::build(
        isolux_formats::read::read(std::path::Path::new(&args[1]), &Default::default()).unwrap(),
        &Default::default(),
    )
    .unwrap();
    eprintln!("load {:.3}", start.elapsed().as_secs_f64());
    let start = std::time::Instant::now();
    let scene = std::sync::Arc::new(scene);
    let prepared = Prepared::new(scene.clone());
    eprintln!("trees {:.3}", start.elapsed().as_secs_f64());
    for error in &args[3..] {
        let start = std::time::Instant::now();
        let solved = prepared.solve(
            &Request {
                error: error.parse().unwrap(),
                dark: std::env::var("DARK").ok().map(|d| d.parse().unwrap()),
                least_area: 1e-8,
                seed: 0,
                max_elements: None,
                memory: None,
                time: Some(std::env::var("TIME").map_or(25.0, |t| t.parse().unwrap())),
            },
            &Control::default(),
        );
        let seconds = start.elapsed().as_secs_f64();
        for s in &solved.stages {
            eprintln!(
                "  el {:7} links {:8} dark {:7} passes {:?} est {:.4} parts {:.4?} eval {:?} sec {:.3?} check {:.4?}",
                s.elements,
                s.links,
                s.dark_links,
                s.passes,
                s.by_links,
                s.parts,
                s.evaluated,
                s.seconds,
                s.check.map(|c| (c.rms, c.dark, c.bias))
            );
        }
        println!("asked {error} seconds {seconds:.3} estimate {:.4?} {:?}", solved.estimate, solved.bound);
        let raw = std::fs::read(&args[2]).unwrap();
        let mut out = std::fs::File::create(format!("{}.{}.out", args[2], error)).unwrap();
        let mut bytes = Vec::new();
        let outcome = solved.outcome(&scene);
        for record in raw.chunks_exact(28) {
            let face = u32::from_le_bytes(record[..4].try_into().unwrap());
            let b: Vec<f64> = record[4..].chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect();
            let polygon = scene.face_polygon[face as usize];
            let n = scene.polygons[polygon as usize].plane.normal;
            let h = isolux_wavefront::irradiance_at(
                &outcome.elements,
                &outcome.fields,
                polygon,
                n,
                scene.position(face, [b[0], b[1], b[2]]),
            );
            for v in h.0 {
                bytes.extend((v as f32).to_le_bytes());
            }
        }
        out.write_all(&bytes).unwrap();
    }
}
