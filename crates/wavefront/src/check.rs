//! A check by rays that know nothing of links: points of the surfaces and a solution's light go in, how far the solution is
//! from fulfilling its own equation comes out.

use crate::contacts::{is_covered, is_on_line};
use crate::geometry::{Element, Geometry, NONE};
use crate::lamps::at_place;
use crate::light::{Bands, Light, rms};
use crate::rays::{Packet, RAYS, even_point_of};
use crate::read::quadrant;
use crate::rounds::Transport;
use crate::spread::spread;
use glam::Vec3;
use isolux_core::sampling::{Stream, mix};
use isolux_simd::factor::{Polygon, point_factors};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI};

/// Least and most points, and elements for each in between. The error of the estimate falls with their square root only, so
/// that a coarse solution is checked in less time than it takes to make; where few places hold most of the error, as in a
/// fine one, many points find them.
const POINTS: (usize, usize) = (2048, 8192);
const ELEMENTS_PER_POINT: usize = 16;

/// Directions of a batch are strata of s by s, for an asked error e: s = `SIDE_PER_ERROR` / e, within bounds. What is
/// measured is a square, and what chance adds to it falls by the number of directions: measured on a Cornell box, 3e-4 for
/// 8 by 8, an eighth of 0.05².
const SIDE_PER_ERROR: f64 = 0.25;
const SIDES: (f64, f64) = (8.0, 32.0);

/// Rays to emitters of a batch, per direction.
const TO_LIGHTS: f64 = 0.5;

/// What rays found, over all surfaces or over their darker half; relative to the mean irradiance there. What leaves know of
/// themselves that their fields of lamps' light miss is not in it over all surfaces, as all leaves together tell it better.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// RMS over surfaces and bands of what the solution's irradiance lacks against what its own radiosities throw there.
    pub lack: f64,
    /// RMS over surfaces and bands of its error: that, and what is lacking elsewhere as it is reflected to there.
    pub error: f64,
    /// Standard error of the square of `error`.
    pub square_error: f64,
}

/// What rays found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Check {
    /// Over all surfaces.
    pub all: Found,
    /// Over the half of the points with the least irradiance.
    pub dark: Found,
    /// Mean irradiance of that half, relative to the mean of all.
    pub dark_mean: f64,
    /// Points, those that turned out to be covered included.
    pub points: usize,
    /// Rays.
    pub rays: u64,
}

struct Point {
    polygon: u32,
    place: Vec3,
    found: [Bands; 2],
    solved: Bands,
    /// Square of what its leaf knows to miss of lamps' direct light.
    known: f64,
}

/// Times that a point's lack of lamps' direct light may be what its leaf misses, RMS, as the leaf knows: a shadow's edge that one
/// of 64 places tells of is eight times that off there. Beyond, the leaf is wrong about itself.
const KNOWN: f32 = 8.0;

/// Points of a region: that many tell what it lacks on average.
const REGION: f64 = 16.0;

/// Emitters from which each point chooses by what they throw on it; of more, all points choose by power.
const MOST_WEIGHED: usize = 4096;

/// Share of the choice that is left to power: what a factor in single precision loses is then still found.
const BY_POWER: f64 = 0.05;

/// Polygons that emit.
struct Emitters {
    polygons: Vec<u32>,
    /// Their shares of the power.
    shares: Vec<f64>,
    /// Rays to emitters of a batch, over those over the hemisphere.
    ratio: f32,
}

/// Emitters as one point chooses among them.
struct Choice<'a> {
    polygons: &'a [u32],
    /// Probability of all before each, and 1.
    before: Vec<f64>,
    /// Density of rays to places on emitters, per square metre, over that of rays over the hemisphere, by emitter;
    /// infinite where they alone count.
    density: Vec<f32>,
}

impl Emitters {
    fn new(geometry: &Geometry, roots: &[Element], ratio: f32) -> Emitters {
        let power = |&polygon: &u32| {
            let emission = geometry.surfaces[polygon as usize].emission;
            f64::from(emission.iter().sum::<f32>() * roots[polygon as usize].area)
        };
        let polygons: Vec<u32> = (0..geometry.surfaces.len() as u32).filter(|polygon| power(polygon) > 0.0).collect();
        let whole: f64 = polygons.iter().map(power).sum();
        let shares = polygons.iter().map(|polygon| power(polygon) / whole).collect();
        Emitters { polygons, shares, ratio }
    }

    /// Chooses by what each emitter would throw on a point if nothing were in between.
    fn seen_from(&self, point: Vec3, normal: Vec3, geometry: &Geometry, roots: &[Element]) -> Choice<'_> {
        let weigh = self.polygons.len() <= MOST_WEIGHED;
        let thrown = |&polygon: &u32| -> f64 {
            let (surface, root) = (&geometry.surfaces[polygon as usize], &roots[polygon as usize]);
            let source = Polygon {
                corners: root.corners.map(|corner| corner.to_array()),
                count: root.count.into(),
                normal: surface.normal.to_array(),
            };
            let (points, normals) =
                (point.to_array().map(|value| [value; 8]), normal.to_array().map(|value| [value; 8]));
            let factor = point_factors(geometry.backend, &points, &normals, &source)[0];
            f64::from(factor * surface.emission.iter().sum::<f32>())
        };
        let weights: Vec<f64> = if weigh { self.polygons.iter().map(thrown).collect() } else { Vec::new() };
        let whole: f64 = weights.iter().sum();
        let chance = |index: usize| {
            if whole > 0.0 {
                BY_POWER * self.shares[index] + (1.0 - BY_POWER) * weights[index] / whole
            } else {
                self.shares[index]
            }
        };
        let mut before = vec![0.0];
        let mut density = Vec::with_capacity(self.polygons.len());
        for (index, &polygon) in self.polygons.iter().enumerate() {
            before.push(before[index] + chance(index));
            let even = self.ratio * (chance(index) / f64::from(roots[polygon as usize].area)) as f32;
            let opacity = geometry.scene.polygons[polygon as usize].opacity;
            density.push(if opacity < 1.0 { f32::INFINITY } else { even });
        }
        Choice { polygons: &self.polygons, before, density }
    }
}

impl Choice<'_> {
    /// What a ray over the hemisphere that ends on a surface counts for the emission there, so that it and the rays to
    /// places on emitters tell it once together (balance heuristic: E. Veach, L. Guibas 1995). `rise`, `fall`: cosines at
    /// both ends; `square`: squared length of the ray, m². Where a surface lets light pass, few rays or none end on it, but
    /// all of it shines: the others tell that.
    fn by_direction(&self, polygon: u32, rise: f32, fall: f32, square: f32) -> f32 {
        let Ok(index) = self.polygons.binary_search(&polygon) else { return 1.0 };
        let direction = rise / PI;
        let place = self.density[index] * square / fall.max(f32::MIN_POSITIVE);
        direction / (direction + place)
    }

    /// The emitter that holds a place in [0, 1), and its probability.
    fn pick(&self, place: f64) -> (u32, f64) {
        let index = self.before.partition_point(|&before| before <= place).clamp(1, self.polygons.len()) - 1;
        (self.polygons[index], self.before[index + 1] - self.before[index])
    }
}

/// Compares irradiances with what rays bring, at points spread over all fronts; so many as the elements ask for, unless
/// their number is given.
pub(crate) fn check(transport: &Transport, light: &Light, error: f64, seed: u64, points: Option<usize>) -> Check {
    let (geometry, elements) = (&*transport.geometry, &transport.elements[..]);
    let side = (SIDE_PER_ERROR / error).clamp(SIDES.0, SIDES.1) as usize;
    let emits = geometry.surfaces.iter().any(|surface| surface.emission != [0.0; 3]);
    let to_lights = if emits { (TO_LIGHTS * (side * side) as f64) as usize } else { 0 };
    let fronts = geometry.scene.fronts;
    let emitters = Emitters::new(geometry, elements, to_lights as f32 / (side * side) as f32);
    let mut before = Vec::with_capacity(fronts + 1);
    let mut area = 0.0_f64;
    for root in &elements[..fronts] {
        before.push(area);
        area += f64::from(root.area);
    }
    let count = points.unwrap_or_else(|| (elements.len() / ELEMENTS_PER_POINT).clamp(POINTS.0, POINTS.1));
    let points: Vec<Point> = (0..count)
        .into_par_iter()
        .filter_map(|index| {
            let mut stream = Stream::new(mix(seed ^ 0x636865636b) ^ index as u64);
            let wanted = area * (index as f64 + stream.next_unit()) / count as f64;
            let polygon = before.partition_point(|&before| before <= wanted).max(1) - 1;
            let jitter = [stream.next_unit() as f32, stream.next_unit() as f32];
            let point = even_point_of(&elements[polygon], jitter);
            let on_line = || {
                let leaf = node_at(polygon as u32, point, 0.0, transport);
                is_on_line(point, &elements[leaf as usize], geometry)
            };
            if is_covered(point, polygon as u32, geometry) || on_line() {
                return None;
            }
            let emitters = emitters.seen_from(point, geometry.surfaces[polygon].normal, geometry, elements);
            let gather = |stream: &mut Stream| {
                let mut sum =
                    over_hemisphere(point, polygon as u32, side, geometry, elements, light, &emitters, stream);
                let direct = emitted(point, polygon as u32, to_lights, geometry, elements, &emitters, stream);
                (0..3).for_each(|band| sum[band] += direct[band]);
                sum
            };
            let (lit, known) = of_lamps(point, polygon as u32, transport, light);
            let found = [gather(&mut stream), gather(&mut stream)];
            let found = found.map(|found| std::array::from_fn(|band| found[band] + lit[band]));
            let solved = crate::read::field_at(geometry, elements, light, polygon as u32, point);
            Some(Point { polygon: polygon as u32, place: point, found, solved, known })
        })
        .collect();
    let errors = errors(&points, area, transport, light);
    let brightness = |point: &Point| point.solved.iter().sum::<f32>() / 3.0;
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| brightness(&points[a]).total_cmp(&brightness(&points[b])));
    let measure = |indices: &[usize], with_known: bool| {
        let count = indices.len().max(1) as f64;
        let mean = indices.iter().map(|&index| f64::from(brightness(&points[index]))).sum::<f64>() / count;
        // Where nothing arrives, nothing can lack a share of it.
        let scale = if mean > 0.0 { mean } else { 1.0 };
        let squares = |values: &dyn Fn(usize) -> [Bands; 2]| -> (f64, f64) {
            let square = |&index: &usize| {
                let [one, other] = values(index);
                let known = if with_known { points[index].known } else { 0.0 };
                let sum: f64 = (0..3).map(|band| f64::from(one[band]) * f64::from(other[band])).sum();
                (sum / 3.0 + known) / (scale * scale)
            };
            let squares: Vec<f64> = indices.iter().map(square).collect();
            let mean = squares.iter().sum::<f64>() / count;
            let spread = squares.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count;
            (mean.max(0.0).sqrt(), (spread / count).sqrt())
        };
        let (lack, _) = squares(&|index| points[index].lacks());
        let (error, square_error) = squares(&|index| errors[index]);
        (Found { lack, error, square_error }, mean)
    };
    let (all, mean) = measure(&order, false);
    let (dark, dark_mean) = measure(&order[..order.len() / 2], true);
    Check {
        all,
        dark,
        dark_mean: if mean > 0.0 { dark_mean / mean } else { 0.0 },
        points: count,
        rays: (points.len() * 2 * (side * side + to_lights)) as u64,
    }
}

/// What lamps throw on a point, by shadow rays, and the square of what its leaf knows to miss of it. Where that explains what
/// is lacking there, the leaf's own value stands for the rays': few points fall on edges of shadows, and would weigh much.
fn of_lamps(point: Vec3, polygon: u32, transport: &Transport, light: &Light) -> (Bands, f64) {
    if light.lit.is_empty() {
        return ([0.0; 3], 0.0);
    }
    let geometry = &*transport.geometry;
    let leaf = node_at(polygon, point, 0.0, transport) as usize;
    let (found, missed) = (at_place(point, polygon, geometry), light.lit_error[leaf]);
    let corners =
        &transport.elements[leaf].corners.map(|corner| corner.as_dvec3())[..transport.elements[leaf].count.into()];
    let normal = geometry.surfaces[polygon as usize].normal.as_dvec3();
    let own = crate::read::within(corners, normal, point.as_dvec3(), &light.lit[leaf]);
    let lacks = rms(std::array::from_fn(|band| found[band] - own[band]));
    (if lacks * lacks <= KNOWN * KNOWN * missed { own } else { found }, f64::from(missed))
}

impl Point {
    /// What the solution lacks here, by each batch.
    fn lacks(&self) -> [Bands; 2] {
        self.found.map(|found| std::array::from_fn(|band| found[band] - self.solved[band]))
    }

    /// The smallest node of its polygon that holds it and is at least `area` large, m²: of 0, the leaf.
    fn node(&self, area: f32, transport: &Transport) -> u32 {
        node_at(self.polygon, self.place, area, transport)
    }
}

/// The smallest node of a polygon that holds a place and is at least `area` large, m²: of 0, the leaf.
fn node_at(polygon: u32, place: Vec3, area: f32, transport: &Transport) -> u32 {
    let normal = transport.geometry.surfaces[polygon as usize].normal;
    let mut node = polygon;
    loop {
        let element = &transport.elements[node as usize];
        if element.first_child == NONE {
            return node;
        }
        let child = element.first_child + quadrant(element, normal, place) as u32;
        if transport.elements[child as usize].area < area {
            return node;
        }
        node = child;
    }
}

/// The solution's error at every point by each batch: what it lacks there, and what regions lack on average as it is
/// reflected to there. Batches know nothing of each other, so that the mean of their product is that of the square.
fn errors(points: &[Point], area: f64, transport: &Transport, light: &Light) -> Vec<[Bands; 2]> {
    let least = (area * REGION / points.len().max(1) as f64) as f32;
    let regions: Vec<u32> = points.iter().map(|point| point.node(least, transport)).collect();
    let mut count = vec![0.0_f32; transport.elements.len()];
    regions.iter().for_each(|&region| count[region as usize] += 1.0);
    let [one, other] = [0, 1].map(|batch: usize| {
        let mut lacking = vec![[0.0; 3]; transport.elements.len()];
        for (point, &region) in points.iter().zip(&regions) {
            let (lacks, mean) = (point.lacks()[batch], &mut lacking[region as usize]);
            (0..3).for_each(|band| mean[band] += lacks[band] / count[region as usize]);
        }
        let error = spread(&lacking, light, transport);
        (lacking, error)
    });
    let whole = |point: &Point, region: u32| {
        let leaf = point.node(0.0, transport) as usize;
        let lacks = point.lacks();
        let of = |batch: usize, (lacking, error): &(Vec<Bands>, Vec<Bands>)| -> Bands {
            std::array::from_fn(|band| lacks[batch][band] - lacking[region as usize][band] + error[leaf][band])
        };
        [of(0, &one), of(1, &other)]
    };
    points.iter().zip(&regions).map(|(point, &region)| whole(point, region)).collect()
}

/// Irradiance at a point by one batch of side² directions over the hemisphere: what is reflected from there, and the part of
/// what is emitted that directions tell.
#[allow(clippy::too_many_arguments, reason = "one call site")]
fn over_hemisphere(
    point: Vec3,
    polygon: u32,
    side: usize,
    geometry: &Geometry,
    elements: &[Element],
    light: &Light,
    emitters: &Choice<'_>,
    stream: &mut Stream,
) -> Bands {
    let mut sum = [0.0_f32; 3];
    let normal = geometry.surfaces[polygon as usize].normal;
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    for stratum in 0..side * side {
        let u = ((stratum / side) as f64 + stream.next_unit()) / side as f64;
        let v = ((stratum % side) as f64 + stream.next_unit()) / side as f64;
        let (radius, (sine, cosine)) = (u.sqrt() as f32, libm::sincosf((2.0 * std::f64::consts::PI * v) as f32));
        let height = (1.0 - radius * radius).max(0.0).sqrt();
        let direction = tangent * (radius * cosine) + bitangent * (radius * sine) + normal * height;
        if let Some((other, place)) = geometry.look(point, normal, direction, stream) {
            let field = crate::read::field_at(geometry, elements, light, other, place);
            let surface = &geometry.surfaces[other as usize];
            let fall = -surface.normal.dot(direction);
            let counts = emitters.by_direction(other, height, fall, place.distance_squared(point));
            // Reflectance is that of the whole surface; the ray has met what does not let it pass.
            let solid = 1.0 / geometry.scene.polygons[other as usize].opacity.min(1.0) as f32;
            for band in 0..3 {
                let seen = solid * surface.reflectance[band] * field[band] + counts * surface.emission[band];
                sum[band] += seen / (side * side) as f32;
            }
        }
    }
    sum
}

/// Steps of places along both sides of emitters, from ray to ray: powers of the plastic number's inverse, by which places fill
/// a square evenly however many there are (M. Roberts, *The unreasonable effectiveness of quasirandom sequences*, 2018).
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// Irradiance at a point by one batch of rays to places on the emitters: what they emit.
fn emitted(
    point: Vec3,
    polygon: u32,
    rays: usize,
    geometry: &Geometry,
    elements: &[Element],
    emitters: &Choice<'_>,
    stream: &mut Stream,
) -> Bands {
    let normal = geometry.surfaces[polygon as usize].normal;
    let start = [stream.next_unit(), stream.next_unit()];
    let mut sum = [0.0; 3];
    for first in (0..rays).step_by(RAYS) {
        let mut packet = Packet::new();
        let mut carried = [[0.0; 3]; RAYS];
        for (ray, carried) in carried.iter_mut().enumerate().take(rays - first) {
            let index = (first + ray) as f64;
            let (emitter, share) = emitters.pick((index + stream.next_unit()) / rays as f64);
            let (element, surface) = (&elements[emitter as usize], &geometry.surfaces[emitter as usize]);
            let place = even_point_of(element, [0, 1].map(|side| (start[side] + index * STEPS[side]).fract() as f32));
            packet.set(ray, point, normal, place, surface.normal, geometry.tolerance);
            let weight = packet.weights[ray];
            if weight <= 0.0 || geometry.overlaps.on_top(emitter, place).is_some() {
                continue;
            }
            let towards = place - point;
            let (square, length) = (towards.length_squared(), towards.length());
            let (rise, fall) = (normal.dot(towards) / length, -surface.normal.dot(towards) / length);
            let counts = 1.0 - emitters.by_direction(emitter, rise, fall, square);
            let factor = counts * weight * FRAC_1_PI * element.area / share as f32 / rays as f32;
            *carried = surface.emission.map(|emission| factor * emission);
        }
        let through = packet.through(geometry);
        for (carried, through) in carried.iter().zip(through) {
            (0..3).for_each(|band| sum[band] += through * carried[band]);
        }
    }
    sum
}
