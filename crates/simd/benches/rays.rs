//! Nanoseconds for the visibility of one pair by sixteen rays, for each first hit, for proofs, and seconds to build.

#[allow(unreachable_pub, dead_code)]
mod scenes;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use isolux_simd::bvh::{Bvh8, NoFilter, Primitive, SKIN};
use isolux_simd::lanes::Backend;
use scenes::{Patch, Point, Random, cross, dense, dot, hemispheres, packets, pairs, refined, room, triangle};
use std::hint::black_box;

const PAIRS: usize = 4096;

fn visibility(c: &mut Criterion) {
    for (name, primitives) in [("room", room()), ("dense", dense())] {
        let bvh = Bvh8::build(&primitives);
        let some = pairs(&primitives, PAIRS, 1);
        let fine = refined(&some[..PAIRS / 16]);
        for (order, pairs) in [("random", some), ("refined", fine)] {
            let packets = packets(&pairs, 2);
            let mut group = c.benchmark_group(format!("visibility/{name}"));
            group.throughput(Throughput::Elements(packets.len() as u64));
            for backend in Backend::available() {
                group.bench_function(format!("{order}/{}", backend.name()), |b| {
                    let mut answers = vec![0; packets.len()];
                    b.iter(|| {
                        bvh.blocked_batch(backend, &packets, &mut answers);
                        black_box(&answers);
                    });
                });
            }
            let backend = Backend::best();
            group.bench_function(format!("{order}/transmittance"), |b| {
                b.iter(|| {
                    for rays in &packets {
                        black_box(bvh.transmittance(backend, rays, 0xffff, &NoFilter));
                    }
                });
            });
            group.bench_function(format!("{order}/closest16"), |b| {
                b.iter(|| {
                    for rays in &packets {
                        black_box(bvh.closest16(backend, rays, 0xffff));
                    }
                });
            });
        }
    }
}

/// First hits of rays over hemispheres: packets, and their rays one by one.
fn first_hits(c: &mut Criterion) {
    let backend = Backend::best();
    for (name, primitives) in [("room", room()), ("dense", dense())] {
        let bvh = Bvh8::build(&primitives);
        for side in [8, 32] {
            let packets = hemispheres(&primitives, 65_536 / (side * side), side, 5);
            let mut group = c.benchmark_group(format!("first_hits/{name}/{side}x{side}"));
            group.throughput(Throughput::Elements(16 * packets.len() as u64));
            group.bench_function("closest16", |b| {
                b.iter(|| {
                    for rays in &packets {
                        black_box(bvh.closest16(backend, rays, 0xffff));
                    }
                });
            });
            group.bench_function("closest", |b| {
                b.iter(|| {
                    for rays in &packets {
                        for k in 0..16 {
                            let [origin, direction] = [rays.origin, rays.direction].map(|v| v.map(|v| v[k]));
                            black_box(bvh.closest(backend, origin, direction, rays.near[k], rays.far[k]));
                        }
                    }
                });
            });
        }
    }
}

/// A patch's corners and its plane.
fn shape(patch: &Patch) -> (Vec<Point>, [f32; 4]) {
    let n = cross(patch.u, patch.v);
    let n = n.map(|x| x / dot(n, n).sqrt());
    (patch.corners(), [n[0], n[1], n[2], dot(n, patch.origin)])
}

fn proofs(c: &mut Criterion) {
    let backend = Backend::best();
    for (name, primitives) in [("room", room()), ("dense", dense())] {
        let bvh = Bvh8::build(&primitives);
        let shapes: Vec<_> = pairs(&primitives, PAIRS, 1).iter().map(|(a, b)| (shape(a), shape(b))).collect();
        let tolerance = 2.0 * SKIN * bvh.bounds().1[0];
        let mut group = c.benchmark_group(format!("clear_between/{name}"));
        group.throughput(Throughput::Elements(PAIRS as u64));
        for budget in [16, 64] {
            group.bench_function(format!("{budget}"), |bench| {
                bench.iter(|| {
                    for ((a, plane_a), (b, plane_b)) in &shapes {
                        black_box(bvh.clear_between(backend, a, b, *plane_a, *plane_b, tolerance, budget));
                    }
                });
            });
        }
    }
}

fn soup(count: usize) -> Vec<Primitive> {
    let mut random = Random(3);
    let size = 4.0 / (count as f32).cbrt();
    (0..count)
        .map(|_| {
            let a: [f32; 3] = std::array::from_fn(|_| random.number() * 10.0);
            let mut near = || std::array::from_fn(|axis| a[axis] + size * (random.number() - 0.5));
            triangle(a, near(), near())
        })
        .collect()
}

fn build(c: &mut Criterion) {
    let mut group = c.benchmark_group("build");
    group.sample_size(10);
    for count in [100_000, 1_000_000] {
        let primitives = soup(count);
        group.bench_function(format!("{count}"), |b| {
            b.iter_batched(|| (), |()| Bvh8::build(&primitives), BatchSize::PerIteration);
        });
    }
}

criterion_group!(benches, visibility, first_hits, proofs, build);
criterion_main!(benches);
