//! The furnished room at two sizes of SPLASH-2's runs, and what one evaluation of a pair costs in it.
//!
//! Links are made as the paper makes them: its rules of refinement, rays that count the same, covered
//! parts counted, values averaged over leaves. SPLASH-2's radiosity (Splash-3,
//! its own room, one thread) makes 168,919 links in 1.3 s and 1.27 million in 12.4 s on a common 2-core server.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use isolux::core::kernels::NoProbe;
use isolux::core::kernels::visibility::{Covered, Sampling, Weighting};
use isolux::core::links::Evaluator;
use isolux::core::scene::{BuildOptions, Scene};
use isolux::core::solution::Unobserved;
use isolux::core::tree::{Bsp, ElementId};
use isolux::{Interpolation, Schedule, Settings, solve};
use std::hint::black_box;
use std::sync::Arc;

/// `bf_epsilon` and `area_epsilon`: see `benches/room`.
const SIZES: [(f64, f64); 2] = [(0.0335, 1e-4), (0.0089, 5e-5)];

fn room() -> Arc<Scene> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/room.glb");
    let input = isolux::formats::read::read(path.as_ref(), &Default::default()).unwrap();
    Arc::new(Scene::build(input, &BuildOptions::default()).unwrap())
}

fn settings(bf_epsilon: f64, area_epsilon: f64) -> Settings {
    Settings {
        schedule: Schedule::Sequential,
        bf_epsilon: Some(bf_epsilon),
        area_epsilon: Some(area_epsilon),
        partial_visibility: 0.0,
        partial_form_factor: 1.0,
        emission_weight: 1.0,
        weighting: Weighting::Equal,
        covered: Covered::Counted,
        interpolation: Interpolation::Averaged,
        threads: 1,
        ..Settings::default()
    }
}

fn solves(criterion: &mut Criterion) {
    let scene = room();
    let mut group = criterion.benchmark_group("room");
    group.sample_size(10);
    for (bf, area) in SIZES {
        let settings = settings(bf, area);
        // The throughput is in links that come out; the smooth values and the balance are part of the time.
        let links = solve(scene.clone(), &settings, &mut Unobserved).unwrap().report().links.total;
        group.throughput(Throughput::Elements(links));
        group.bench_function(format!("{links} links"), |bencher| {
            bencher.iter(|| solve(scene.clone(), &settings, &mut Unobserved).unwrap());
        });
    }
    group.finish();
}

/// Form factor and visibility of pairs that a solve really links, in the order of its links.
fn kernels(criterion: &mut Criterion) {
    let scene = room();
    let (bf, area) = SIZES[0];
    let settings = settings(bf, area);
    let solution = solve(scene.clone(), &settings, &mut Unobserved).unwrap();
    let bsp: &Bsp = solution.bsp();
    let evaluator = Evaluator {
        scene: &scene,
        bsp,
        form_factor: settings.form_factor,
        sampling: Sampling { rays: settings.rays, weighting: settings.weighting },
        covered: settings.covered,
        seed: 0,
    };
    let elements = &solution.hierarchy().elements;
    let pairs: Vec<(ElementId, ElementId)> =
        solution.hierarchy().links.iter().step_by(17).map(|(receiver, link)| (receiver, link.source)).collect();
    let mut group = criterion.benchmark_group("pairs of the room");
    group.throughput(Throughput::Elements(pairs.len() as u64));
    group.sample_size(20);
    group.bench_function("form factor", |bencher| {
        bencher.iter_batched(
            || &pairs,
            |pairs| {
                let factors = pairs.iter().map(|&(a, b)| evaluator.form_factor(elements, a, b, &mut NoProbe));
                black_box(factors.sum::<f64>())
            },
            BatchSize::SmallInput,
        );
    });
    group.bench_function("visibility", |bencher| {
        bencher.iter_batched(
            || &pairs,
            |pairs| {
                let shares = pairs.iter().map(|&(a, b)| evaluator.sight(elements, a, b, &mut NoProbe).share);
                black_box(shares.sum::<f64>())
            },
            BatchSize::SmallInput,
        );
    });
    group.finish();
}

criterion_group!(benches, solves, kernels);
criterion_main!(benches);
