//! Nanoseconds for the visibility of one pair by sixteen rays, for first hits, and seconds to build.

mod scenes;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use isolux_simd::bvh::{Bvh8, NoFilter, Primitive};
use isolux_simd::lanes::Backend;
use scenes::{Random, dense, packets, pairs, refined, room, triangle};
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
                        let mut last = u32::MAX;
                        bvh.blocked_batch(backend, &packets, &mut answers, &mut last);
                        black_box(&answers);
                    });
                });
            }
            let backend = Backend::best();
            group.bench_function(format!("{order}/transmittance"), |b| {
                b.iter(|| {
                    let mut last = u32::MAX;
                    for rays in &packets {
                        black_box(bvh.transmittance(backend, rays, 0xffff, &mut last, &NoFilter));
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

criterion_group!(benches, visibility, build);
criterion_main!(benches);
