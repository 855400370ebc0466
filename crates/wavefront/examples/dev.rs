use isolux_wavefront::{Prepared, Request};
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
    if std::env::var("PROBE").is_ok() {
        prepared.probe();
    }
    for error in &args[3..] {
        let start = std::time::Instant::now();
        let solved = prepared.solve(&Request { error: error.parse().unwrap(), least_area: 1e-8, seed: 0 });
        let seconds = start.elapsed().as_secs_f64();
        if std::env::var("DUMP").is_ok() {
            solved.dump();
        }
        for s in &solved.stages {
            eprintln!(
                "  el {:7} links {:8} dark {:7} passes {:3} est {:.4} parts {:.4?} eval {} packets {} sec {:.3?}",
                s.elements, s.links, s.dark, s.passes, s.estimate, s.parts, s.evaluated, s.packets, s.seconds
            );
        }
        println!("asked {error} seconds {seconds:.3}");
        // points: face u32, barycentric 3 x f64
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
