//! Time of one visibility in a furnished room of 348 polygons, over pairs such as a radiosity run draws: mostly small
//! elements far apart; rays count the same (`Weighting::Equal`).

#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

#[path = "../tests/bsp_scenes/mod.rs"]
mod bsp_scenes;

use bsp_scenes::*;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use isolux_core::kernels::visibility::{Blocker, Rays, sight, visibility, visibility_ray_by_ray};
use isolux_core::kernels::{Counts, NoProbe};
use isolux_core::scene::{Polygon, Scene};
use isolux_core::tree::{Bsp, InsertionOrder};
use std::hint::black_box;
use std::time::{Duration, Instant};

const PAIRS: usize = 4096;

/// Pairs of elements: polygons drawn with a chance in proportion to their areas and cut until their sides are below
/// 1 m (one pair in 8), 0.5 m (2 in 8), 0.25 m (5 in 8); pairs with one behind the other are left out.
fn pairs(scene: &Scene) -> Vec<(Polygon, Polygon)> {
    let mut random = Random(7);
    let total = scene.area();
    let mut pairs = Vec::new();
    while pairs.len() < PAIRS {
        let side = [1.0, 0.5, 0.5, 0.25, 0.25, 0.25, 0.25, 0.25][pairs.len() % 8];
        let mut element = || {
            let mut rest = random.unit() * total;
            let whole = scene
                .polygons
                .iter()
                .find(|polygon| {
                    rest -= polygon.area;
                    rest <= 0.0
                })
                .unwrap();
            let mut part = whole.clone();
            while part.area > side * side {
                part = quartered(&part, 1).swap_remove(random.below(4));
            }
            part
        };
        let (a, b) = (element(), element());
        let apart = |p: &Polygon, q: &Polygon| q.corners.iter().any(|&c| p.plane.distance(c) > scene.tolerance());
        if apart(&a, &b) && apart(&b, &a) {
            pairs.push((a, b));
        }
    }
    pairs
}

type Kernel = fn(&Bsp, &Scene, &Polygon, &Polygon, Rays, u64, &mut Blocker) -> f64;

fn beam(bsp: &Bsp, scene: &Scene, a: &Polygon, b: &Polygon, rays: Rays, seed: u64, _: &mut Blocker) -> f64 {
    visibility(bsp, scene, &patch(a), &patch(b), rays, seed, &mut NoProbe)
}

fn one_by_one(bsp: &Bsp, scene: &Scene, a: &Polygon, b: &Polygon, rays: Rays, seed: u64, _: &mut Blocker) -> f64 {
    visibility_ray_by_ray(bsp, scene, &patch(a), &patch(b), rays, seed, &mut NoProbe)
}

fn hinted(bsp: &Bsp, scene: &Scene, a: &Polygon, b: &Polygon, rays: Rays, seed: u64, hint: &mut Blocker) -> f64 {
    sight(bsp, scene, &patch(a), &patch(b), rays, seed, hint, &mut NoProbe).share
}

fn count(
    name: &str,
    pairs: &[(Polygon, Polygon)],
    mut evaluate: impl FnMut(&Polygon, &Polygon, u64, &mut Counts) -> f64,
) {
    let mut counts = Counts::default();
    let (mut clear, mut blocked) = (0, 0);
    for (k, (a, b)) in pairs.iter().enumerate() {
        let share = evaluate(a, b, k as u64, &mut counts);
        clear += usize::from(share == 1.0);
        blocked += usize::from(share == 0.0);
    }
    let n = pairs.len() as f64;
    println!(
        "{name}: {:.0} % clear, {:.0} % blocked; per visibility: {:.1} rays, {:.1} node visits, {:.1} fragment tests",
        100.0 * clear as f64 / n,
        100.0 * blocked as f64 / n,
        counts.rays as f64 / n,
        counts.node_visits as f64 / n,
        counts.fragment_tests as f64 / n,
    );
}

fn bench(criterion: &mut Criterion) {
    let scene = furnished_room();
    let pairs = pairs(&scene);
    for order in [InsertionOrder::AsGiven, InsertionOrder::LargestFirst, InsertionOrder::Random(1)] {
        let bsp = Bsp::build(&scene, order);
        println!("{order:?}: {} fragments, {} nodes", bsp.fragments().len(), bsp.nodes().len());
        count("beam", &pairs, |a, b, seed, counts| {
            visibility(&bsp, &scene, &patch(a), &patch(b), Rays::Sixteen, seed, counts)
        });
        count("one by one", &pairs, |a, b, seed, counts| {
            visibility_ray_by_ray(&bsp, &scene, &patch(a), &patch(b), Rays::Sixteen, seed, counts)
        });
        let n = pairs.len() as f64;
        let kernels: [(&str, Kernel, Rays); 4] = [
            ("beam, 16 rays", beam, Rays::Sixteen),
            ("beam with hint, 16 rays", hinted, Rays::Sixteen),
            ("one by one, 16 rays", one_by_one, Rays::Sixteen),
            ("beam, 256 rays", beam, Rays::TwoHundredFiftySix),
        ];
        for (name, kernel, rays) in kernels {
            let fastest = (0..40)
                .map(|_| {
                    let start = Instant::now();
                    let mut hint = Blocker::default();
                    for (seed, (a, b)) in pairs.iter().enumerate() {
                        black_box(kernel(&bsp, &scene, a, b, rays, seed as u64, &mut hint));
                    }
                    start.elapsed()
                })
                .min()
                .unwrap();
            println!("{order:?}/{name}: fastest of 40: {:.0} ns per visibility", fastest.as_nanos() as f64 / n);
            // One turn is all pairs: the throughput is in visibilities.
            let mut group = criterion.benchmark_group(format!("{order:?}"));
            group.throughput(Throughput::Elements(PAIRS as u64));
            group.bench_function(name, |bencher| {
                bencher.iter(|| {
                    let mut hint = Blocker::default();
                    let mut sum = 0.0;
                    for (seed, (a, b)) in pairs.iter().enumerate() {
                        sum += kernel(&bsp, &scene, a, b, rays, seed as u64, &mut hint);
                    }
                    black_box(sum)
                });
            });
            group.finish();
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    targets = bench
}
criterion_main!(benches);
