//! What form factors in lanes cost, a pair being five receivers (corners and middle of a patch) and a source; and what
//! vectors, weights of rays, and irradiance from harmonics cost.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use isolux_simd::factor::{Points, Polygon, kernel_weights, point_factors_batch, vector_factor};
use isolux_simd::lanes::Backend;
use isolux_simd::sphere::{evaluate, irradiance_batch};
use std::hint::black_box;

const PAIRS: usize = 256;

type Vector = [f32; 3];

fn unit(v: Vector) -> Vector {
    let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
    v.map(|x| x / length)
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn square(centre: Vector, normal: Vector, size: f32) -> Polygon {
    let helper = if normal[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = unit(cross(normal, helper)).map(|x| 0.5 * size * x);
    let v = cross(normal, u);
    let at = |a: f32, b: f32| std::array::from_fn(|k| centre[k] + a * u[k] + b * v[k]);
    Polygon { corners: [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)], count: 4, normal }
}

/// Corners and middle of a patch, the middle in the three spare lanes as well.
fn receivers(patch: &Polygon) -> Points {
    let middle: Vector = std::array::from_fn(|k| patch.corners.iter().map(|c| c[k]).sum::<f32>() / 4.0);
    let at = |lane: usize| if lane < 4 { patch.corners[lane] } else { middle };
    Points {
        points: std::array::from_fn(|k| std::array::from_fn(|lane| at(lane)[k])),
        normals: std::array::from_fn(|k| [patch.normal[k]; 8]),
    }
}

/// Pairs of squares, `distance` apart in a ring of directions, turned by up to `turn` of a radian out of facing each other.
fn pairs(distance: f32, turn: f32) -> (Vec<Points>, Vec<Polygon>) {
    (0..PAIRS)
        .map(|k| {
            let t = 2.4 * k as f32;
            let direction = unit([t.cos(), t.sin(), 0.5 + (0.7 * t).sin()]);
            let tilt = [(1.3 * t).sin(), (1.7 * t).cos(), (1.1 * t).sin()].map(|x| turn * x);
            let receiver = unit(std::array::from_fn(|k| direction[k] + tilt[k]));
            let source = unit(std::array::from_fn(|k| tilt[(k + 1) % 3] - direction[k]));
            let patch = square([0.0; 3], receiver, 1.0);
            (receivers(&patch), square(direction.map(|x| x * distance), source, 0.9))
        })
        .unzip()
}

fn form_factors(c: &mut Criterion) {
    let mut group = c.benchmark_group("five points to a quad");
    group.throughput(Throughput::Elements(PAIRS as u64));
    for (name, distance, turn) in [("far", 100.0, 0.4), ("near", 3.0, 0.4), ("across the horizon", 1.5, 1.2)] {
        let (points, sources) = pairs(distance, turn);
        let mut out = vec![[0.0; 8]; PAIRS];
        for backend in Backend::available() {
            group.bench_function(BenchmarkId::new(name, backend.name()), |b| {
                b.iter(|| point_factors_batch(backend, PAIRS, black_box(&points), black_box(&sources), &mut out));
            });
        }
    }
    group.finish();
}

fn vectors_and_weights(c: &mut Criterion) {
    let mut group = c.benchmark_group("eight points and a quad");
    let (points, sources) = pairs(3.0, 0.4);
    for backend in Backend::available() {
        let mut k = 0;
        group.bench_function(BenchmarkId::new("vector", backend.name()), |b| {
            b.iter(|| {
                k = (k + 1) % PAIRS;
                vector_factor(backend, black_box(&points[k].points), black_box(&sources[k]))
            });
        });
        let rays: [[f32; 16]; 3] = std::array::from_fn(|axis| std::array::from_fn(|k| points[k].points[axis][k % 5]));
        let ends: [[f32; 16]; 3] = std::array::from_fn(|axis| std::array::from_fn(|k| sources[k].corners[k % 4][axis]));
        group.bench_function(BenchmarkId::new("weights of 16 rays", backend.name()), |b| {
            b.iter(|| kernel_weights(backend, black_box(&rays), black_box(&ends), [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]));
        });
    }
    group.finish();
}

fn harmonics(c: &mut Criterion) {
    let mut group = c.benchmark_group("eight normals in one light");
    group.throughput(Throughput::Elements(PAIRS as u64));
    let (points, _) = pairs(3.0, 0.4);
    let normals: Vec<[[f32; 8]; 3]> = points.iter().map(|p| p.normals).collect();
    let light = [evaluate([0.6, 0.0, 0.8]), evaluate([0.0, 1.0, 0.0]), evaluate([-0.8, 0.6, 0.0])];
    let mut out = vec![[[0.0; 8]; 3]; PAIRS];
    for backend in Backend::available() {
        group.bench_function(BenchmarkId::new("irradiance", backend.name()), |b| {
            b.iter(|| irradiance_batch(backend, black_box(&normals), black_box(&light), &mut out));
        });
    }
    group.finish();
}

criterion_group!(benches, form_factors, vectors_and_weights, harmonics);
criterion_main!(benches);
