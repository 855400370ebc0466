//! What a form factor costs: one point to a quadrilateral, and pairs far apart, close, nearly touching, and by disks.
//!
//! The report is per evaluation: each iteration walks a ring of prepared inputs, so that branch predictors see more than
//! one case.

use criterion::{Criterion, criterion_group, criterion_main};
use isolux_core::DVec3;
use isolux_core::kernels::form_factor::{FormFactor, exchange_area, point_factor};
use isolux_core::kernels::{NoProbe, Patch};
use isolux_core::scene::{Corners, Plane};
use std::hint::black_box;

const RING: usize = 256;

struct Owned(Corners, Plane, f64);

impl Owned {
    fn square(centre: DVec3, normal: DVec3, size: f64) -> Owned {
        let u = normal.any_orthonormal_vector() * (0.5 * size);
        let v = normal.cross(u);
        let corners = Corners::quad(centre - u - v, centre + u - v, centre + u + v, centre - u + v);
        Owned(corners, Plane { normal, offset: normal.dot(centre) }, corners.area())
    }

    fn patch(&self) -> Patch<'_> {
        Patch { corners: &self.0, plane: &self.1, area: self.2 }
    }
}

/// Pairs of squares, `distance` apart in a ring of directions, turned up to 40 degrees out of facing each other.
fn ring(distance: f64) -> Vec<(Owned, Owned)> {
    (0..RING)
        .map(|k| {
            let turn = 2.4 * k as f64;
            let direction = DVec3::new(turn.cos(), turn.sin(), 0.5 + (0.7 * turn).sin()).normalize();
            let tilt = DVec3::new((1.3 * turn).sin(), (1.7 * turn).cos(), (1.1 * turn).sin()) * 0.4;
            let a = Owned::square(DVec3::ZERO, (direction + tilt).normalize(), 1.0);
            let b = Owned::square(direction * distance, (tilt.yzx() - direction).normalize(), 0.9);
            (a, b)
        })
        .collect()
}

trait Shuffle {
    fn yzx(self) -> DVec3;
}

impl Shuffle for DVec3 {
    fn yzx(self) -> DVec3 {
        DVec3::new(self.y, self.z, self.x)
    }
}

fn form_factors(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("form_factor");
    let mut next = 0;
    let mut step = move || {
        next = (next + 1) % RING;
        next
    };
    let pairs = ring(3.0);
    group.bench_function("point to quad", |bencher| {
        bencher.iter(|| {
            let (a, b) = &pairs[step()];
            black_box(point_factor(black_box(DVec3::ZERO), a.1.normal, &b.patch()))
        });
    });
    for (name, distance, method) in [
        ("pair, 10 sizes apart", 10.0, FormFactor::Lambert),
        ("pair, 3 sizes apart", 3.0, FormFactor::Lambert),
        ("pair, 1.5 sizes apart", 1.5, FormFactor::Lambert),
        ("pair, half a size apart", 0.5, FormFactor::Lambert),
        ("pair, 10 sizes apart, disks", 10.0, FormFactor::Disks),
    ] {
        let pairs = ring(distance);
        let mut step = step;
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let (a, b) = &pairs[step()];
                black_box(exchange_area(&a.patch(), &b.patch(), black_box(method), &mut NoProbe))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, form_factors);
criterion_main!(benches);
