//! A check by rays that know nothing of links: points of the surfaces and a solution's light go in, how far the solution is
//! from fulfilling its own equation comes out.

use crate::geometry::{Element, Geometry};
use crate::light::{Bands, Light};
use crate::rays::point_of;
use glam::Vec3;
use isolux_core::sampling::{Stream, mix};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Points. The error of the estimate falls with their square root only, with the rays of each in proportion.
const POINTS: usize = 1024;

/// Directions of a batch: strata of 8 by 8.
const SIDE: usize = 8;

/// Rays to emitters of a batch.
const TO_LIGHTS: usize = 32;

/// What rays found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Check {
    /// RMS over surfaces and bands of what the solution's irradiance lacks against what its own radiosities throw there,
    /// relative to the mean irradiance.
    pub rms: f64,
    /// Standard error of the square of `rms`.
    pub square_error: f64,
    /// Mean of what it lacks, relative to the mean irradiance.
    pub bias: f64,
    /// RMS over the darker half of the points, relative to their mean irradiance.
    pub dark: f64,
    /// Standard error of the square of `dark`.
    pub dark_square_error: f64,
    /// Rays.
    pub rays: u64,
}

struct Point {
    found: [Bands; 2],
    solved: Bands,
}

/// Elements that emit, by power.
struct Emitters {
    polygons: Vec<u32>,
    /// Share of the power before each, and 1.
    before: Vec<f64>,
}

impl Emitters {
    fn new(geometry: &Geometry, roots: &[Element]) -> Emitters {
        let power = |&polygon: &u32| {
            let emission = geometry.surfaces[polygon as usize].emission;
            f64::from(emission.iter().sum::<f32>() * roots[polygon as usize].area)
        };
        let polygons: Vec<u32> = (0..geometry.surfaces.len() as u32).filter(|polygon| power(polygon) > 0.0).collect();
        let whole: f64 = polygons.iter().map(power).sum();
        let mut before = vec![0.0];
        for polygon in &polygons {
            before.push(before[before.len() - 1] + power(polygon) / whole);
        }
        Emitters { polygons, before }
    }

    /// The emitter that holds a share in [0, 1) of the power, its share, and what is left over of the number.
    fn pick(&self, share: f64) -> (u32, f64) {
        let index = self.before.partition_point(|&before| before <= share).clamp(1, self.polygons.len()) - 1;
        (self.polygons[index], self.before[index + 1] - self.before[index])
    }
}

/// Compares irradiances with what rays bring, at points spread over all fronts.
pub(crate) fn check(geometry: &Geometry, elements: &[Element], light: &Light, seed: u64) -> Check {
    let fronts = geometry.scene.fronts;
    let emitters = Emitters::new(geometry, elements);
    let mut before = Vec::with_capacity(fronts + 1);
    let mut area = 0.0_f64;
    for root in &elements[..fronts] {
        before.push(area);
        area += f64::from(root.area);
    }
    let points: Vec<Point> = (0..POINTS)
        .into_par_iter()
        .filter_map(|index| {
            let mut stream = Stream::new(mix(seed ^ 0x636865636b) ^ index as u64);
            let wanted = area * (index as f64 + stream.next_unit()) / POINTS as f64;
            let polygon = before.partition_point(|&before| before <= wanted).max(1) - 1;
            let jitter = [stream.next_unit() as f32, stream.next_unit() as f32];
            let (point, _) = point_of(&elements[polygon], 0, 0, jitter);
            if crate::contacts::is_covered(point, polygon as u32, geometry) {
                return None;
            }
            let gather =
                |stream: &mut Stream| gather(point, polygon as u32, geometry, elements, light, &emitters, stream);
            let found = [gather(&mut stream), gather(&mut stream)];
            Some(Point { found, solved: crate::read::field_at(geometry, elements, light, polygon as u32, point) })
        })
        .collect();
    let brightness = |point: &Point| point.solved.iter().sum::<f32>() / 3.0;
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| brightness(&points[a]).total_cmp(&brightness(&points[b])));
    let measure = |indices: &[usize]| {
        let count = indices.len().max(1) as f64;
        let mean = indices.iter().map(|&index| f64::from(brightness(&points[index]))).sum::<f64>() / count;
        let lacks = |index: usize, batch: usize, band: usize| {
            f64::from(points[index].found[batch][band] - points[index].solved[band]) / mean
        };
        let squares: Vec<f64> = indices
            .iter()
            .map(|&index| (0..3).map(|band| lacks(index, 0, band) * lacks(index, 1, band)).sum::<f64>() / 3.0)
            .collect();
        let bias =
            indices.iter().map(|&index| (0..6).map(|k| lacks(index, k / 3, k % 3)).sum::<f64>() / 6.0).sum::<f64>();
        let square = squares.iter().sum::<f64>() / count;
        let spread = squares.iter().map(|value| (value - square) * (value - square)).sum::<f64>() / count;
        (square, (spread / count).sqrt(), bias / count)
    };
    let (square, square_error, bias) = measure(&order);
    let (dark, dark_square_error, _) = measure(&order[..order.len() / 2]);
    Check {
        rms: square.max(0.0).sqrt(),
        square_error,
        bias,
        dark: dark.max(0.0).sqrt(),
        dark_square_error,
        rays: (points.len() * 2 * (SIDE * SIDE + TO_LIGHTS)) as u64,
    }
}

/// Irradiance at a point by one batch: reflected light over the hemisphere, emitted light from places on the emitters.
fn gather(
    point: Vec3,
    polygon: u32,
    geometry: &Geometry,
    elements: &[Element],
    light: &Light,
    emitters: &Emitters,
    stream: &mut Stream,
) -> Bands {
    let normal = geometry.surfaces[polygon as usize].normal;
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let mut sum = [0.0_f32; 3];
    for stratum in 0..SIDE * SIDE {
        let u = ((stratum / SIDE) as f64 + stream.next_unit()) / SIDE as f64;
        let v = ((stratum % SIDE) as f64 + stream.next_unit()) / SIDE as f64;
        let (radius, (sine, cosine)) = (u.sqrt() as f32, ((2.0 * std::f64::consts::PI * v) as f32).sin_cos());
        let height = (1.0 - radius * radius).max(0.0).sqrt();
        let direction = tangent * (radius * cosine) + bitangent * (radius * sine) + normal * height;
        let (seen, share) = geometry.look(point, normal, direction, f32::INFINITY, stream);
        if let Some((other, place)) = seen {
            let field = crate::read::field_at(geometry, elements, light, other, place);
            let reflectance = geometry.surfaces[other as usize].reflectance;
            for band in 0..3 {
                sum[band] += share * reflectance[band] * field[band] / (SIDE * SIDE) as f32;
            }
        }
    }
    for sample in 0..TO_LIGHTS {
        let (emitter, share) = emitters.pick((sample as f64 + stream.next_unit()) / TO_LIGHTS as f64);
        let element = &elements[emitter as usize];
        let jitter = [stream.next_unit() as f32, stream.next_unit() as f32];
        let (place, _) = point_of(element, 0, 0, jitter);
        let towards = place - point;
        let square = towards.length_squared();
        let surface = &geometry.surfaces[emitter as usize];
        let (rise, fall) = (normal.dot(towards), -surface.normal.dot(towards));
        if rise <= geometry.tolerance || fall <= geometry.tolerance {
            continue;
        }
        let passes = geometry.passes_between(point, normal, place, surface.normal, stream);
        let factor = passes * rise * fall / (PI * square * square) * element.area / share as f32 / TO_LIGHTS as f32;
        for band in 0..3 {
            sum[band] += factor * surface.emission[band];
        }
    }
    sum
}
