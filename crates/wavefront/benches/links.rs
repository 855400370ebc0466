//! What a link costs in the furnished room on one thread, everything included: closed-form factors, 16 rays or more, the
//! oracle, lists.
//!
//! Time is that of refinement alone, the throughput in pairs that are evaluated; what is kept of them is in the name. A kept
//! link takes 32 bytes, and as many in the copy that a stopped stage returns to.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use isolux_core::scene::{BuildOptions, Scene};
use isolux_formats::read::read;
use isolux_wavefront::{Control, Prepared, Request, Stage};
use std::sync::Arc;
use std::time::Duration;

fn refinement(criterion: &mut Criterion) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/room.glb");
    let input = read(path.as_ref(), &Default::default()).unwrap();
    let prepared = Prepared::new(Arc::new(Scene::build(input, &BuildOptions::default()).unwrap()));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let stages = |error: f64| -> Vec<Stage> {
        let request = Request::new(error);
        one.install(|| prepared.solve(&request, &Control::default()).stages)
    };
    let mut group = criterion.benchmark_group("room");
    group.sample_size(10);
    for error in [0.1, 0.05] {
        let Stage { links, dark_links, evaluated: [pairs, packets], .. } = stages(error).pop().unwrap();
        group.throughput(Throughput::Elements(pairs));
        let name = format!("{pairs} pairs and {packets} packets, {links} links and {dark_links} dark ones");
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|solves| {
                let seconds =
                    (0..solves).map(|_| stages(error).iter().map(|stage| stage.seconds[0]).sum::<f64>()).sum();
                Duration::from_secs_f64(seconds)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, refinement);
criterion_main!(benches);
