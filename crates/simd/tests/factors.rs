//! Form factors in lanes against the scalar closed form in double precision, over the distances, sizes and contacts that
//! scenes have.

#![allow(clippy::unwrap_used)]

use isolux_core::DVec3;
use isolux_core::kernels::Patch;
use isolux_core::kernels::form_factor::point_factor;
use isolux_core::scene::{Corners, Plane};
use isolux_simd::factor::{Points, Polygon, kernel_weights, point_factors, point_factors_batch, vector_factor};
use isolux_simd::lanes::Backend;
use proptest::prelude::*;
use std::f64::consts::PI;

type Vector = [f32; 3];

fn wide(v: Vector) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

fn narrow(v: DVec3) -> Vector {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Numbers evenly spread over 0 to 1, always the same.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }

    fn direction(&mut self) -> DVec3 {
        let (z, turn) = (2.0 * self.next() - 1.0, 2.0 * PI * self.next());
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * turn.cos(), radius * turn.sin(), z)
    }

    /// Evenly spread logarithms.
    fn between(&mut self, range: (f64, f64)) -> f64 {
        range.0 * (range.1 / range.0).powf(self.next())
    }
}

fn corners(polygon: &Polygon) -> Corners {
    let all: Vec<DVec3> = polygon.corners.iter().map(|&c| wide(c)).collect();
    Corners::from_slice(&all[..polygon.count as usize]).unwrap()
}

/// The polygon of these corners, counter-clockwise about its normal.
fn polygon(points: &[DVec3]) -> Polygon {
    let mut all = [[0.0; 3]; 4];
    for (corner, &point) in all.iter_mut().zip(points) {
        *corner = narrow(point);
    }
    let mut made = Polygon { corners: all, count: points.len() as u32, normal: [0.0; 3] };
    made.normal = narrow(corners(&made).area_vector().normalize());
    made
}

fn exact(point: DVec3, normal: DVec3, corners: &Corners) -> f64 {
    let source_normal = corners.area_vector().normalize();
    let plane = Plane { normal: source_normal, offset: source_normal.dot(corners.mean()) };
    point_factor(point, normal, &Patch { corners, plane: &plane, area: corners.area() })
}

fn first_lane(point: Vector, normal: Vector, source: &Polygon) -> f64 {
    point_factors(Backend::best(), &point.map(|x| [x; 8]), &normal.map(|x| [x; 8]), source)[0].into()
}

/// A quadrilateral or triangle up to ten times as long as wide, `size` long, and a direction in front of it.
fn any_polygon(numbers: &mut Numbers, size: f64, offset: f64) -> (Polygon, DVec3) {
    let width = numbers.between((0.1, 1.0));
    polygon_as_wide_as(width, numbers, size, offset)
}

fn polygon_as_wide_as(width: f64, numbers: &mut Numbers, size: f64, offset: f64) -> (Polygon, DVec3) {
    let normal = numbers.direction();
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u) * width;
    let centre = numbers.direction() * offset;
    let mut at = |a: f64, b: f64| {
        let (a, b) = (a * (0.6 + 0.4 * numbers.next()), b * (0.6 + 0.4 * numbers.next()));
        centre + (u * a + v * b) * (0.5 * size)
    };
    let points = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
    let count = if numbers.next() < 0.3 { 3 } else { 4 };
    let mut direction = numbers.direction();
    if direction.dot(normal) < 0.0 {
        direction = -direction;
    }
    (polygon(&points[..count]), direction)
}

/// Would catch a wrong sign, a lost edge, a clip at the wrong place or end, a mistyped coefficient, a wrong switch: the
/// closed form in double precision at distances from 0.01 to 100 000 sizes, whole and clipped, at scales from a millimetre
/// to a kilometre, with and without an offset from the origin.
///
/// Measured (worst of 300 000 a row, in the order below): 3.8e-5, 2.3e-6, 1.0e-7, 7.2e-9, 4.7e-10.
#[test]
fn the_closed_form_is_met_at_all_distances() {
    let mut numbers = Numbers(7);
    let rows = [((0.01, 0.1), 1e-4), ((0.1, 1.0), 6e-6), ((1.0, 8.0), 2e-7), ((8.0, 64.0), 2e-8), ((64.0, 1e5), 1e-9)];
    for (band, bound) in rows {
        for offset in [0.0, 1.0, 10.0] {
            let (mut clipped, mut whole) = (0, 0);
            for _ in 0..20_000 {
                let size = numbers.between((1e-3, 1e3));
                let (source, direction) = any_polygon(&mut numbers, size, offset * size);
                let outline = corners(&source);
                let foot = if numbers.next() < 0.3 { outline[1] } else { outline.mean() };
                let distance = size * numbers.between(band);
                let point = narrow(foot + direction * distance);
                // Closer to the plane, the single precision of the corners is what decides.
                if wide(source.normal).dot(wide(point) - outline.mean()) < 1e-4 * (distance + offset * size) {
                    continue;
                }
                let normal = narrow(numbers.direction());
                let heights = outline.iter().map(|&c| wide(normal).dot(c - wide(point)) > 0.0);
                let above = heights.filter(|&above| above).count();
                whole += usize::from(above == outline.len());
                clipped += usize::from(0 < above && above < outline.len());
                let expected = exact(wide(point), wide(normal).normalize(), &outline);
                let value = first_lane(point, normal, &source);
                assert!((value - expected).abs() < bound, "{source:?} {point:?} {normal:?}: {value:e} {expected:e}");
            }
            // A polygon far away is rarely cut.
            assert!(whole > 500 && (clipped > 50 || band.0 > 10.0), "{whole} {clipped}");
        }
    }
}

/// Would catch cancellation between the edges of a far source: relative errors, both normals at most 60 degrees off.
///
/// Measured: 5.8e-5 up to the switch at 16 sizes, 1.5e-5 beyond.
#[test]
fn far_sources_keep_relative_accuracy() {
    let mut numbers = Numbers(11);
    for (band, bound) in [((1.0, 16.0), 1e-4), ((16.0, 1e5), 3e-5)] {
        let mut worst = 0.0_f64;
        for _ in 0..50_000 {
            let size = numbers.between((1e-3, 1e3));
            let (source, direction) = any_polygon(&mut numbers, size, 0.0);
            let normal = numbers.direction();
            if direction.dot(wide(source.normal)) < 0.5 || -direction.dot(normal) < 0.5 {
                continue;
            }
            let point = narrow(direction * (size * numbers.between(band)));
            let normal = narrow(normal);
            let expected = exact(wide(point), wide(normal).normalize(), &corners(&source));
            worst = worst.max((first_lane(point, normal, &source) / expected - 1.0).abs());
        }
        assert!(worst < bound, "{band:?}: {worst:e}");
    }
}

/// Would catch a contact that gives nothing, everything or something that is not a number: patches that share an edge at
/// angles from 30 to 150 degrees, turned, moved and scaled, the receiver exactly on the edge or its end, against the exact
/// factor a millionth inside the receiver's plane, in geometry that is not rounded.
///
/// Measured: 2.0e-3 at a shared corner at 30 degrees, where the corner's rounding decides.
#[test]
fn a_receiver_on_the_sources_edge_sees_what_its_neighbour_inside_sees() {
    for k in 0..1500_u32 {
        let t = f64::from(k) * 0.618_03;
        let axis = DVec3::new((3.1 * t).sin(), (1.7 * t).cos(), (2.3 * t).sin() + 0.1).normalize();
        let turned = |v: DVec3| {
            let a = t * 1.3;
            v * a.cos() + axis.cross(v) * a.sin() + axis * (axis.dot(v) * (1.0 - a.cos()))
        };
        let size = 10_f64.powf((t * 0.77).sin() * 3.0);
        let offset =
            DVec3::new((t * 5.0).sin(), (t * 4.0).cos(), (t * 9.0).sin()) * [0.0, 0.5, 1.0, 10.0][k as usize % 4];
        let dihedral = [90.0, 60.0, 120.0, 30.0, 150.0][k as usize % 5] / 180.0 * PI;
        // The receiver lies where y > 0 in the plane z = 0; the source rises from the x axis.
        let rise = DVec3::new(0.0, dihedral.cos(), dihedral.sin()) * [1.0, 0.3, 3.0][k as usize % 3];
        let (left, right) = (DVec3::new(-0.5, 0.0, 0.0), DVec3::new(0.5, 0.0, 0.0));
        let outline = [left, left + rise, right + rise, right];
        let unrounded = Corners::from_slice(&outline).unwrap();
        assert!(unrounded.area_vector().y > 0.0);
        let source = polygon(&outline.map(|v| (turned(v) + offset) * size));
        for x in [-0.5, -0.6, -0.2, 0.0, 0.37, 0.5, 0.9] {
            let point = DVec3::new(x, 0.0, 0.0);
            let value = first_lane(narrow((turned(point) + offset) * size), narrow(turned(DVec3::Z)), &source);
            let expected = exact(point + DVec3::Y * 1e-6, DVec3::Z, &unrounded);
            assert!((value - expected).abs() < 4e-3, "{k} {x}: {value} {expected}");
        }
    }
}

/// Would catch a sliver that loses its sign or its ends: the absolute bounds hold for sources of a tenth to a ten thousandth
/// of their length, around their corners, along and across them.
///
/// Measured: 3.0e-5, 3.9e-6, 4.6e-8, 4.7e-9.
#[test]
fn slivers_keep_the_absolute_bounds() {
    let mut numbers = Numbers(17);
    for (band, bound) in [((0.01, 0.1), 1e-4), ((0.1, 1.0), 1e-5), ((1.0, 8.0), 2e-7), ((8.0, 1e3), 2e-8)] {
        for width in [0.1, 1e-2, 1e-3, 1e-4] {
            let mut lit = 0;
            for _ in 0..10_000 {
                let size = numbers.between((1e-3, 1e3));
                let (source, direction) = polygon_as_wide_as(width, &mut numbers, size, 0.0);
                let outline = corners(&source);
                let foot = outline[0] + (outline[1] - outline[0]) * numbers.next();
                let point = narrow(foot + direction * (size * numbers.between(band)));
                let height = wide(source.normal).dot(wide(point) - outline.mean());
                // Below a few millionths of the size, which side the receiver is on is a matter of rounding.
                if height < 1e-3 * (wide(point) - foot).length() + 3e-6 * size {
                    continue;
                }
                let normal = narrow(numbers.direction());
                let expected = exact(wide(point), wide(normal).normalize(), &outline);
                let value = first_lane(point, normal, &source);
                lit += usize::from(value > 0.0);
                assert!((value - expected).abs() < bound, "{source:?} {point:?} {normal:?}: {value:e} {expected:e}");
            }
            assert!(lit > 2000, "{lit}");
        }
    }
}

/// Would catch a jump between a receiver on the shared edge and one near it: gaps of a ten millionth to a hundredth of a
/// size, turned and moved, against geometry that is not rounded.
///
/// Measured: 9.2e-4 at a gap of 3e-6.
#[test]
fn a_receiver_near_a_shared_edge_is_met_at_every_gap() {
    let outline = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Z, DVec3::Z];
    let unrounded = Corners::from_slice(&outline).unwrap();
    let normal = unrounded.area_vector();
    for shift in [0.0, 3.0] {
        for turn in [0.0_f64, 0.7] {
            let turned =
                |v: DVec3| DVec3::new(v.x * turn.cos() - v.y * turn.sin(), v.x * turn.sin() + v.y * turn.cos(), v.z);
            let mut source = polygon(&outline.map(|v| turned(v) + DVec3::splat(shift)));
            source.normal = narrow(turned(normal));
            for gap in [1e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 1e-3, 1e-2] {
                for k in 0..=20 {
                    let point = DVec3::X * (f64::from(k) / 20.0) + normal * gap;
                    let value = first_lane(narrow(turned(point) + DVec3::splat(shift)), [0.0, 0.0, 1.0], &source);
                    let expected = exact(point, DVec3::Z, &unrounded);
                    assert!((value - expected).abs() < 2e-3, "{shift} {turn} {gap} {k}: {value} {expected}");
                }
            }
        }
    }
}

/// Would catch light through the back, from the source's plane, or below the horizon.
#[test]
fn hidden_sides_give_exactly_zero() {
    let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
    let source = polygon(&square);
    let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
    assert_eq!(first_lane([0.5, 0.5, -1.0], up, &source), 0.0);
    assert_eq!(first_lane([0.5, 0.5, 1.0], up, &source), 0.0);
    assert_eq!(first_lane([3.0, 0.5, 0.0], [-1.0, 0.0, 0.0], &source), 0.0);
    assert_eq!(first_lane([3.0, 0.5, 0.0], down, &source), 0.0);
    assert_eq!(first_lane([0.5, 0.5, -1e-6], down, &source), 0.0);
    assert_eq!(first_lane([1.0, 0.5, 0.0], up, &source), 0.0);
    assert!(first_lane([0.5, 0.5, 1.0], down, &source) > 0.2);
    assert!(first_lane([1.0, 0.5, 0.0], [-1.0, 0.0, 0.0], &source) > 0.49);
}

/// Would catch a batch that mixes up its pairs.
#[test]
fn a_batch_gives_what_its_pairs_give() {
    let mut numbers = Numbers(3);
    let (mut points, mut sources) = (Vec::new(), Vec::new());
    for _ in 0..100 {
        let (source, direction) = any_polygon(&mut numbers, 1.0, 0.5);
        let mut receivers = Points::default();
        for lane in 0..8 {
            let at = narrow(direction * numbers.between((0.01, 100.0)) + numbers.direction() * 0.3);
            let normal = narrow(numbers.direction());
            for axis in 0..3 {
                receivers.points[axis][lane] = at[axis];
                receivers.normals[axis][lane] = normal[axis];
            }
        }
        points.push(receivers);
        sources.push(source);
    }
    for backend in Backend::available() {
        let mut out = vec![[-1.0; 8]; 100];
        point_factors_batch(backend, 99, &points, &sources, &mut out);
        assert_eq!(out[99], [-1.0; 8]);
        for k in 0..99 {
            assert_eq!(out[k], point_factors(backend, &points[k].points, &points[k].normals, &sources[k]));
        }
    }
}

/// Would catch a vector turned the wrong way or of the wrong length: the form factor of eight normals from one vector, at
/// all distances, and nothing from behind or aside.
#[test]
fn the_vector_holds_the_factor_of_every_normal() {
    let mut numbers = Numbers(5);
    let rows = [((0.01, 0.1), 1e-4), ((0.1, 1.0), 2e-5), ((1.0, 8.0), 2e-7), ((8.0, 64.0), 2e-8), ((64.0, 1e5), 1e-9)];
    for (band, bound) in rows {
        let mut compared = 0;
        for _ in 0..20_000 {
            let size = numbers.between((1e-3, 1e3));
            let (source, direction) = any_polygon(&mut numbers, size, 0.0);
            let outline = corners(&source);
            let point = narrow(outline.mean() + direction * (size * numbers.between(band)));
            let distance = wide(source.normal).dot(wide(point) - outline.mean());
            if distance < 1e-3 * (wide(point) - outline.mean()).length() {
                continue;
            }
            let vector = vector_factor(Backend::best(), &point.map(|x| [x; 8]), &source).map(|x| f64::from(x[0]));
            let vector = DVec3::new(vector[0], vector[1], vector[2]);
            for _ in 0..8 {
                // The closer, the less a normal may lean.
                let lean = (distance / size).min(1.0);
                let normal = (numbers.direction() * lean - wide(source.normal)).normalize();
                if outline.iter().any(|&c| normal.dot(c - wide(point)) <= 0.0) {
                    continue;
                }
                compared += 1;
                let expected = exact(wide(point), normal, &outline);
                let value = normal.dot(vector);
                assert!((value - expected).abs() < bound, "{source:?} {point:?} {normal:?}: {value:e} {expected:e}");
            }
        }
        assert!(compared > 1000);
    }
    let source = polygon(&[DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]);
    let vector = |point: Vector| vector_factor(Backend::best(), &point.map(|x| [x; 8]), &source).map(|x| x[0]);
    assert_eq!(vector([0.5, 0.5, -1.0]), [0.0; 3]);
    assert_eq!(vector([2.0, 0.5, 0.0]), [0.0; 3]);
    // On the source itself: all of a hemisphere.
    assert!((vector([0.5, 0.5, 0.0])[2] + 1.0).abs() < 1e-4);
}

/// Would catch a wrong power, a lost clip, a division by nothing.
#[test]
fn weights_are_the_clipped_kernel() {
    let mut numbers = Numbers(13);
    let (mut clipped, mut open) = (0, 0);
    for _ in 0..2000 {
        let size = numbers.between((1e-3, 1e3));
        let mut points = || narrow(numbers.direction() * size * numbers.next());
        let origins: [Vector; 16] = std::array::from_fn(|_| points());
        let targets: [Vector; 16] = std::array::from_fn(|k| if k == 5 { origins[k] } else { points() });
        let (n, m) = (narrow(numbers.direction()), narrow(numbers.direction()));
        let by_axis = |v: &[Vector; 16]| std::array::from_fn(|axis| v.map(|p| p[axis]));
        let weights = kernel_weights(Backend::best(), &by_axis(&origins), &by_axis(&targets), n, m);
        assert_eq!(weights[5], 0.0);
        for k in (0..16).filter(|&k| k != 5) {
            let ray = wide(targets[k]) - wide(origins[k]);
            let (rise, fall) = (ray.normalize().dot(wide(n)).max(0.0), -ray.normalize().dot(wide(m)).min(0.0));
            let expected = rise * fall / ray.length_squared();
            let bound = 4e-7 * expected + 2e-7 * (rise + fall) / ray.length_squared();
            assert!((f64::from(weights[k]) - expected).abs() <= bound, "{k} {} {expected}", weights[k]);
            clipped += usize::from(expected == 0.0);
            open += usize::from(expected > 0.0);
        }
    }
    assert!(clipped > 5000 && open > 5000);
}

fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![-2.0_f32..2.0, Just(0.0), Just(1.0), -1e3_f32..1e3]
}

fn vector() -> impl Strategy<Value = Vector> {
    prop::array::uniform3(coordinate())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, rng_seed: proptest::test_runner::RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

    /// Catches a backend, or a neighbour in another lane, that changes a result; a factor that is no share; whatever the
    /// corners are, planar or not.
    #[test]
    fn lanes_are_shares_and_alone(
        points in prop::array::uniform3(prop::array::uniform8(coordinate())),
        directions in prop::array::uniform8(vector()),
        corners in prop::array::uniform4(vector()),
        count in 3_u32..5,
    ) {
        let unit = |v: Vector| {
            let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
            if length > 0.0 { v.map(|x| x / length) } else { [0.0, 0.0, 1.0] }
        };
        let (a, b, c) = (wide(corners[0]), wide(corners[1]), wide(corners[2]));
        let normal = unit(narrow((b - a).cross(c - a)));
        let source = Polygon { corners, count, normal };
        let directions = directions.map(unit);
        let normals = std::array::from_fn(|axis| directions.map(|v| v[axis]));
        let plain = point_factors(Backend::Scalar, &points, &normals, &source);
        for backend in Backend::available() {
            let same = point_factors(backend, &points, &normals, &source);
            prop_assert_eq!(same.map(f32::to_bits), plain.map(f32::to_bits), "{}", backend.name());
        }
        for lane in 0..8 {
            prop_assert!((0.0..=1.0).contains(&plain[lane]), "{}", plain[lane]);
            let alone = point_factors(Backend::best(), &points.map(|x| [x[lane]; 8]), &normals.map(|x| [x[lane]; 8]), &source);
            prop_assert_eq!(alone[7].to_bits(), plain[lane].to_bits());
        }
    }

    /// Catches a backend, or a neighbour in another lane, that changes a vector or a weight, and one that is no number.
    #[test]
    fn vectors_and_weights_are_alone(
        points in prop::array::uniform3(prop::array::uniform16(coordinate())),
        targets in prop::array::uniform3(prop::array::uniform16(coordinate())),
        corners in prop::array::uniform4(vector()),
        count in 3_u32..5,
    ) {
        let (a, b, c) = (wide(corners[0]), wide(corners[1]), wide(corners[2]));
        let normal = (b - a).cross(c - a);
        let normal = narrow(if normal.length() > 0.0 { normal.normalize() } else { DVec3::Z });
        let source = Polygon { corners, count, normal };
        let some = points.map(|x| std::array::from_fn(|lane| x[lane]));
        let plain = vector_factor(Backend::Scalar, &some, &source);
        let weights = kernel_weights(Backend::Scalar, &points, &targets, [0.0, 0.0, 1.0], normal);
        prop_assert!(weights.iter().all(|w| (0.0..f32::INFINITY).contains(w)));
        for backend in Backend::available() {
            let same = vector_factor(backend, &some, &source);
            prop_assert_eq!(same.map(|x| x.map(f32::to_bits)), plain.map(|x| x.map(f32::to_bits)), "{}", backend.name());
            let same = kernel_weights(backend, &points, &targets, [0.0, 0.0, 1.0], normal);
            prop_assert_eq!(same.map(f32::to_bits), weights.map(f32::to_bits), "{}", backend.name());
        }
        for lane in 0..8 {
            let alone = vector_factor(Backend::best(), &some.map(|x| [x[lane]; 8]), &source);
            for axis in 0..3 {
                prop_assert!(plain[axis][lane].abs() <= 4.0);
                prop_assert_eq!(alone[axis][7].to_bits(), plain[axis][lane].to_bits());
            }
        }
    }
}
