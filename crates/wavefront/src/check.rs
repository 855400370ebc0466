//! A check by rays that know nothing of links: points of the surfaces and a solution's light go in, how far the solution is
//! from fulfilling its own equation comes out; of light by groups, point by point, what tells the same of every mix.

use crate::contacts::{is_covered, is_on_border, is_on_line};
use crate::control::Control;
use crate::geometry::{Element, Geometry, NONE};
use crate::lamps::at_place;
use crate::light::{Bands, Field, Light, bands, mean_over, rms};
use crate::rays::{Packet, RAYS, even_point_of};
use crate::read::{Reader, part_at};
use crate::receiver::Receiver;
use crate::rounds::Transport;
use crate::sky::{Care, Parts, at_point};
use crate::solve::{Estimate, claim};
use crate::spread::spread;
use glam::Vec3;
use isolux_core::sampling::{Stream, mix};
use isolux_simd::factor::{Polygon, point_factors};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::Range;

/// Least and most points, and elements for each in between. The error of the estimate falls with their square root only, so
/// that a coarse solution is checked in less time than it takes to make; where few places hold most of the error, as in a
/// fine one, many points find them.
pub(crate) const POINTS: (usize, usize) = (2048, 8192);
const ELEMENTS_PER_POINT: usize = 16;

/// Directions of a batch are strata of s by s, for an asked error e: s = `SIDE_PER_ERROR` / e, within bounds. What is
/// measured is a square, and what chance adds to it falls by the number of directions: measured on a Cornell box, 3e-4 for
/// 8 by 8, an eighth of 0.05².
const SIDE_PER_ERROR: f64 = 0.25;
const SIDES: (f64, f64) = (8.0, 32.0);

/// Most times as many rays where it is bright.
const MOST_RAYS: f32 = 64.0;

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
    /// Share of its square that more rays from each point would take away: the rest is that points are a sample.
    pub by_rays: f64,
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
    place: Place,
    found: [Bands; 2],
    /// Rays that told it.
    rays: u64,
    solved: Bands,
    /// Square of what its leaf knows to miss of lamps' direct light.
    known: f64,
}

/// A point of a polygon.
#[derive(Clone, Copy)]
struct Place {
    polygon: u32,
    point: Vec3,
    /// Surface that it speaks for, m².
    area: f32,
}

/// What rays found of light by groups, at points spread evenly over all fronts but for what is covered: enough to tell the
/// error of any mix as [`Check`] tells that of a solve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointErrors {
    /// Irradiance by group and point as the columns have it, W/m² or lm/m². Below nothing where the column is.
    pub irradiance: Vec<Vec<Bands>>,
    /// Error of it by group and point, by either of two batches of rays that know nothing of each other, W/m² or lm/m².
    pub errors: Vec<Vec<[Bands; 2]>>,
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
    /// Those that `is_one` takes of all that emit.
    fn new(geometry: &Geometry, roots: &[Element], is_one: impl Fn(u32) -> bool) -> Emitters {
        let power = |&polygon: &u32| {
            let emission = geometry.surfaces[polygon as usize].emission;
            f64::from(emission.iter().sum::<f32>() * roots[polygon as usize].area)
        };
        let polygons = 0..geometry.surfaces.len() as u32;
        let polygons: Vec<u32> = polygons.filter(|polygon| power(polygon) > 0.0 && is_one(*polygon)).collect();
        let whole: f64 = polygons.iter().map(power).sum();
        let shares = polygons.iter().map(|polygon| power(polygon) / whole).collect();
        Emitters { polygons, shares }
    }

    /// Chooses by what each emitter would throw on a point if nothing were in between. `ratio`: rays to emitters of a batch
    /// over those over the hemisphere.
    fn seen_from(&self, from: Place, ratio: f32, geometry: &Geometry, roots: &[Element]) -> Choice<'_> {
        let Place { polygon, point, .. } = from;
        let normal = geometry.surfaces[polygon as usize].normal;
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
            let even = ratio * (chance(index) / f64::from(roots[polygon as usize].area)) as f32;
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

/// Rays of a batch from a point.
#[derive(Clone, Copy)]
struct Rays {
    /// Directions are so many strata squared.
    side: usize,
    /// To emitters.
    to_lights: usize,
}

impl Rays {
    fn new(error: f64) -> Rays {
        let side = (SIDE_PER_ERROR / error).clamp(SIDES.0, SIDES.1) as usize;
        Rays { side, to_lights: (TO_LIGHTS * (side * side) as f64) as usize }
    }

    /// Where there is so many times the mean irradiance, up to so many times as many rays: noise is a share of what arrives, its
    /// square goes into a mean over all points, and one place within a lamp's shade would hold all of that mean's own error.
    fn where_bright(self, times: f32, sides: f32) -> Rays {
        // Where there is no light there is no mean.
        self.times(if times > 1.0 { times.min(MOST_RAYS).sqrt() } else { 1.0 }.max(sides))
    }

    /// So many times as many strata a side.
    fn times(self, factor: f32) -> Rays {
        let side = (self.side as f32 * factor).round() as usize;
        Rays { side, to_lights: (TO_LIGHTS * (side * side) as f64) as usize }
    }

    /// Rays to emitters over those over the hemisphere.
    fn ratio(self) -> f32 {
        self.to_lights as f32 / (self.side * self.side) as f32
    }

    /// Of both batches.
    fn of_point(self) -> u64 {
        2 * (self.side * self.side + self.to_lights) as u64
    }
}

/// Points on all fronts by area, as many as the elements ask for.
fn points_of(elements: usize) -> usize {
    (elements / ELEMENTS_PER_POINT).clamp(POINTS.0, POINTS.1)
}

/// Share of the points that go to leaves, where there are as many: see [`Spots`].
const TO_LEAVES: f64 = 0.5;

/// Where points lie: evenly by area; and evenly over the leaves that refinement has made, each of which holds about as much of the
/// squared error, however small it is. Beside things, on a hundredth of all surfaces, lies half of that in a furnished room: of
/// points by area few would find it. What a point counts is the surface that it and its likes of both kinds speak for (balance
/// heuristic).
struct Spots<'a> {
    elements: &'a [Element],
    /// Area of the fronts before each, and of all, m².
    before: Vec<f64>,
    area: f64,
    /// Leaves that are parts of fronts, unless they are covered.
    leaves: Vec<u32>,
    by_area: usize,
    by_leaf: usize,
}

impl Spots<'_> {
    fn new(transport: &Transport, count: usize, to_leaves: f64) -> Spots<'_> {
        let (geometry, elements) = (&*transport.geometry, &transport.elements[..]);
        let fronts = geometry.scene.fronts;
        let mut before = Vec::with_capacity(fronts + 1);
        let mut area = 0.0_f64;
        for root in &elements[..fronts] {
            before.push(area);
            area += f64::from(root.area);
        }
        let is_part = |element: &Element| element.parent != NONE && (element.polygon as usize) < fronts;
        let leaves = elements.iter().enumerate().filter(|(_, element)| element.first_child == NONE && is_part(element));
        let leaves: Vec<u32> = leaves.filter(|(_, leaf)| leaf.open != 0).map(|(index, _)| index as u32).collect();
        // Along edges of lamps' shadows, for which leaves are small as well, these are believed: see `of_lamps`.
        let to_leaves = if geometry.scene.has_remote_light() { 0.0 } else { to_leaves };
        let by_leaf = ((to_leaves * count as f64) as usize).min(leaves.len());
        Spots { elements, before, area, leaves, by_area: count - by_leaf, by_leaf }
    }

    /// The place of point `index`.
    fn place(&self, index: usize, transport: &Transport, stream: &mut Stream) -> Place {
        let at = |stream: &mut Stream, first: usize, count: usize| {
            ((index - first) as f64 + stream.next_unit()) / count as f64
        };
        let element = if index < self.by_area {
            let wanted = self.area * at(stream, 0, self.by_area);
            self.before.partition_point(|&before| before <= wanted).max(1) - 1
        } else {
            let place = at(stream, self.by_area, self.by_leaf) * self.leaves.len() as f64;
            self.leaves[(place as usize).min(self.leaves.len() - 1)] as usize
        };
        let jitter = [stream.next_unit() as f32, stream.next_unit() as f32];
        let (polygon, point) = (self.elements[element].polygon, even_point_of(&self.elements[element], jitter));
        let place = Place { polygon, point, area: 0.0 };
        let leaf = &self.elements[place.node(0.0, transport) as usize];
        let by_leaf = if leaf.parent == NONE || leaf.open == 0 {
            0.0
        } else {
            self.by_leaf as f64 / (self.leaves.len() as f64 * f64::from(leaf.area))
        };
        Place { area: (1.0 / (self.by_area as f64 / self.area + by_leaf)) as f32, ..place }
    }
}

/// What `look` makes of `count` points on all fronts, see [`Spots`]; those that are covered, or so close to a line of contact that
/// rounding decides on which side they are, are left out.
fn at_points<T: Send>(
    transport: &Transport,
    seed: u64,
    count: usize,
    to_leaves: f64,
    look: impl Fn(Place, &mut Stream) -> Option<T> + Sync,
) -> Vec<T> {
    let (geometry, elements) = (&*transport.geometry, &transport.elements[..]);
    let spots = Spots::new(transport, count, to_leaves);
    (0..count)
        .into_par_iter()
        .filter_map(|index| {
            let mut stream = Stream::new(mix(seed) ^ index as u64);
            let place = spots.place(index, transport, &mut stream);
            let on_line = || is_on_line(place.point, &elements[place.node(0.0, transport) as usize], geometry);
            let on_border = || is_on_border(place.point, &elements[place.polygon as usize], geometry);
            if on_border() || on_line() || is_covered(place.point, place.polygon, geometry) {
                return None;
            }
            look(place, &mut stream)
        })
        .collect()
}

/// How much a check looks at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// So many points, or as many as the elements ask for.
    pub(crate) points: Option<usize>,
    /// How many times as many strata a side as the asked error calls for at least.
    pub(crate) sides: f32,
}

impl Effort {
    /// Rays of a check of so many points, where it is no brighter than on average.
    pub(crate) fn rays(self, error: f64) -> u64 {
        self.points.unwrap_or(POINTS.1) as u64 * Rays::new(error).times(self.sides).of_point()
    }

    /// About four times as many rays, where they tell most: from each point, where what they leave to chance holds most of the
    /// standard error, whose part in it falls with their number, or from more points, with whose number's root all of it falls.
    pub(crate) fn more(self, found: &Check, by_rays: f64) -> Effort {
        if by_rays > BY_RAYS && self.sides < MOST_RAYS.sqrt() {
            return Effort { sides: 2.0 * self.sides, ..self };
        }
        Effort { points: Some(4 * found.points), ..self }
    }
}

/// Share of chance in rays from which on more rays from each point lower a standard error more than as many from others.
const BY_RAYS: f64 = 0.5;

/// Compares irradiances with what rays bring, at points spread over all fronts.
pub(crate) fn check(transport: &Transport, light: &Light, error: f64, seed: u64, effort: Effort) -> Check {
    let (geometry, elements) = (&*transport.geometry, &transport.elements[..]);
    let rays = Rays::new(error);
    let emitters = Emitters::new(geometry, elements, |_| true);
    let count = effort.points.unwrap_or_else(|| points_of(elements.len()));
    let enough = enough_of_sky(error, light.scale, count);
    let reader = Reader::new(geometry, elements);
    let points: Vec<Point> = at_points(transport, seed ^ 0x636865636b, count, TO_LEAVES, |place, stream| {
        let Place { polygon, point, .. } = place;
        let solved = reader.field_at(light, polygon, point);
        let rays = rays.where_bright(solved.iter().sum::<f32>() / 3.0 / light.scale, effort.sides);
        let emitters = emitters.seen_from(place, rays.ratio(), geometry, elements);
        let (lit, known) = of_lamps(place, transport, light);
        let sky = of_sky(place, enough, geometry, stream);
        let reflected = over_hemisphere(place, rays.side, geometry, &reader, light, &emitters, stream);
        let found = [0, 1].map(|batch: usize| {
            let direct = emitted(place, rays.to_lights, geometry, elements, &emitters, stream);
            let sky = geometry.dome.as_ref().map_or([0.0; 3], |dome| dome.light(sky[batch]));
            std::array::from_fn(|band| reflected[batch][band] + direct[band] + lit[band] + sky[band])
        });
        Some(Point { place, found, rays: rays.of_point(), solved, known })
    });
    let places: Vec<Place> = points.iter().map(|point| point.place).collect();
    let errors = errors(&places, |point, batch| points[point].lacks()[batch], transport, light);
    let solved: Vec<Bands> = points.iter().map(|point| point.solved).collect();
    let areas: Vec<f64> = places.iter().map(|place| f64::from(place.area)).collect();
    let returns = returns(&places, transport, light);
    let lacks = |index: usize| points[index].lacks();
    Check {
        points: count,
        rays: points.iter().map(|point| point.rays).sum(),
        ..measured(&solved, &areas, lacks, |index| errors[index], |index| points[index].known, |index| returns[index])
    }
}

/// Squares of what is lacking and of errors at points, over all of them and over the darker half; by both batches, so that
/// their noise is in no mean. `areas`: what each point speaks for. `known`: further squares at points, which count in the darker half; over all of them leaves
/// tell them better. `returns`: what comes back to points of a lack of 1 all over.
fn measured(
    solved: &[Bands],
    areas: &[f64],
    lacks: impl Fn(usize) -> [Bands; 2],
    errors: impl Fn(usize) -> [Bands; 2],
    known: impl Fn(usize) -> f64,
    returns: impl Fn(usize) -> Bands,
) -> Check {
    let brightness: Vec<f32> = solved.iter().map(|solved| solved.iter().sum::<f32>() / 3.0).collect();
    let mut order: Vec<usize> = (0..solved.len()).collect();
    order.sort_by(|&a, &b| brightness[a].total_cmp(&brightness[b]));
    let measure = |indices: &[usize], with_known: bool| {
        let sum: f64 = indices.iter().map(|&index| areas[index]).sum();
        // What a point counts in a mean.
        let share = |index: usize| if sum > 0.0 { areas[index] / sum } else { 0.0 };
        let mean = indices.iter().map(|&index| share(index) * f64::from(brightness[index])).sum::<f64>();
        // Where nothing arrives, nothing can lack a share of it.
        let scale = if mean > 0.0 { mean } else { 1.0 };
        let squares = |values: &dyn Fn(usize) -> [Bands; 2]| -> (f64, f64, f64) {
            let square = |&index: &usize| {
                let [one, other] = values(index);
                let known = if with_known { known(index) } else { 0.0 };
                let sum: f64 = (0..3).map(|band| f64::from(one[band]) * f64::from(other[band])).sum();
                (sum / 3.0 + known) / (scale * scale)
            };
            let squares: Vec<[f64; 2]> = indices.iter().map(|index| [share(*index), square(index)]).collect();
            let mean: f64 = squares.iter().map(|[share, value]| share * value).sum();
            let total = |of: &dyn Fn(f64) -> f64| -> f64 {
                squares.iter().map(|&[share, value]| (share * of(value)).powi(2)).sum()
            };
            (mean.max(0.0).sqrt(), total(&|value| value - mean).sqrt(), total(&|value| value))
        };
        // Of two batches that find nothing but noise, normal and of variance v, the product has v² in the mean square, the half of
        // the squared difference 3 v².
        let apart = |&index: &usize| {
            let [one, other] = errors(index);
            let sum: f64 = (0..3).map(|band| f64::from(one[band] - other[band]).powi(2)).sum();
            (share(index) * sum / 6.0 / (scale * scale)).powi(2)
        };
        let (lack, ..) = squares(&lacks);
        let (error, square_error, fourth) = squares(&errors);
        let noise = indices.iter().map(apart).sum::<f64>() / 3.0;
        let by_rays = if fourth > 0.0 { (noise / fourth).min(1.0) } else { 0.0 };
        // All points have what the others lack on average, as it comes back there: it is no less uncertain for being at many. What
        // the brighter half lacks is left out of the darker one's, as there may be a wall between them.
        let mean_of = |value: &dyn Fn(usize) -> f32| {
            indices.iter().map(|&index| share(index) * f64::from(value(index))).sum::<f64>() / scale
        };
        let shared = |band: usize| {
            let [one, other] = [0, 1].map(|batch: usize| mean_of(&|index| errors(index)[batch][band]));
            let returns = mean_of(&|index| returns(index)[band]);
            let pairs = indices.iter().map(|&index| (share(index), lacks(index).map(|lacks| f64::from(lacks[band]))));
            let [[a, c], [_, b]] = covariance_of_means(pairs).map(|row| row.map(|value| value * returns * returns));
            // Variance of the product of two means that are off by these.
            (other * other * a + one * one * b + 2.0 * one * other * c + a * b + c * c).sqrt()
        };
        let square_error = square_error.hypot((0..3).map(shared).sum::<f64>() / 3.0);
        (Found { lack, error, square_error, by_rays }, mean)
    };
    let (all, mean) = measure(&order, false);
    let whole: f64 = areas.iter().sum();
    let mut darker = 0.0;
    let half = order.iter().take_while(|&&index| {
        darker += areas[index];
        darker <= 0.5 * whole
    });
    let (dark, dark_mean) = measure(&order[..half.count()], true);
    Check { all, dark, dark_mean: if mean > 0.0 { dark_mean / mean } else { 0.0 }, points: solved.len(), rays: 0 }
}

/// Covariances of the means of pairs of values, each pair drawn for itself and counted by its share.
fn covariance_of_means(pairs: impl Iterator<Item = (f64, [f64; 2])> + Clone) -> [[f64; 2]; 2] {
    let mean = pairs.clone().fold([0.0; 2], |sum, (share, pair)| [0, 1].map(|k: usize| sum[k] + share * pair[k]));
    let mut sums = [[0.0; 2]; 2];
    for (share, pair) in pairs {
        for (row, sums) in sums.iter_mut().enumerate() {
            for (column, sum) in sums.iter_mut().enumerate() {
                *sum += share * share * (pair[row] - mean[row]) * (pair[column] - mean[column]);
            }
        }
    }
    sums
}

impl PointErrors {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.errors.first().map_or(0, Vec::len)
    }

    /// True where there are no points, or no groups.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How wrong the mix of all groups by these weights, per band, may be: what is claimed of a solve, where rays cannot tell
    /// an error from their own noise with two standard errors. `None` without points. A mix below nothing counts as nothing.
    #[must_use]
    pub fn estimate(&self, weights: &[[f64; 3]]) -> Option<Estimate> {
        if self.is_empty() {
            return None;
        }
        let groups = || self.irradiance.iter().zip(&self.errors).zip(weights);
        let mixed = |point: usize| -> (Bands, [Bands; 2]) {
            let (mut solved, mut errors) = ([0.0_f64; 3], [[0.0_f64; 3]; 2]);
            for ((irradiance, by_batch), weight) in groups() {
                for band in 0..3 {
                    solved[band] += weight[band] * f64::from(irradiance[point][band]);
                    (0..2).for_each(|k| errors[k][band] += weight[band] * f64::from(by_batch[point][k][band]));
                }
            }
            // What is read there is not below nothing.
            let raised = solved.map(|value| value.min(0.0));
            let errors = errors.map(|error| std::array::from_fn(|band| (error[band] + raised[band]) as f32));
            (solved.map(|value| value.max(0.0) as f32), errors)
        };
        let mixed: Vec<(Bands, [Bands; 2])> = (0..self.len()).into_par_iter().with_min_len(256).map(mixed).collect();
        let (solved, errors): (Vec<Bands>, Vec<[Bands; 2]>) = mixed.into_iter().unzip();
        Some(claim(
            &measured(&solved, &vec![1.0; self.len()], |_| [[0.0; 3]; 2], |point| errors[point], |_| 0.0, |_| [0.0; 3]),
            f64::INFINITY,
            0.0,
        ))
    }
}

/// A place where a ray over the hemisphere ended.
struct Hit {
    leaf: usize,
    /// What the irradiance there has of the field's values.
    shares: [f32; 5],
    /// What it counts at the ray's start, per band; nothing where all light is below nothing.
    counts: Bands,
    met: Met,
}

/// What is lacking at a point to each group's column.
struct GroupPoint {
    place: Place,
    solved: Vec<Bands>,
    lacks: [Vec<Bands>; 2],
}

/// Groups whose errors are sent around side by side at most.
const SIDE_BY_SIDE: usize = 4;

/// Irradiance at a point, in means of its group, from which on more rays are asked there, and most strata a side as against
/// other points. Noise is a share of what arrives: measured in a shade around a bulb, 4 % of 150 means, which hid an error of
/// 0.1 of the mean.
const BRIGHT: f32 = 2.0;
const MOST_TIMES: f32 = 4.0;

/// Compares columns, by group and leaf, with what rays bring of each group's light; `light`: all of it. Every group has rays
/// of its own to its emitters, as many as a solve with that group alone would, and more where it is bright. None where
/// `control` says stop.
pub(crate) fn check_groups(
    transport: &Transport,
    light: &Light,
    columns: &[Vec<Field>],
    group_of: &[u32],
    error: f64,
    seed: u64,
    control: &Control,
) -> Option<PointErrors> {
    let (geometry, elements) = (&*transport.geometry, &transport.elements[..]);
    let rays = Rays::new(error);
    let emitters =
        |group: usize| Emitters::new(geometry, elements, |polygon| group_of[polygon as usize] as usize == group);
    let emitters: Vec<Emitters> = (0..columns.len()).map(emitters).collect();
    let reader = Reader::new(geometry, elements);
    let mut row_of = vec![NONE; elements.len()];
    let leaves = (0..elements.len()).filter(|&index| elements[index].first_child == NONE);
    leaves.zip(0..).for_each(|(leaf, row)| row_of[leaf] = row);
    let value = |column: &[Field], leaf: usize, shares: &[f32; 5]| -> Bands {
        let field = &column[row_of[leaf] as usize];
        std::array::from_fn(|band| (0..5).map(|k| shares[k] * field[k][band]).sum())
    };
    let means: Vec<f32> = columns.iter().map(|column| mean_of(column, elements)).collect();
    let count = points_of(elements.len());
    // What is left where all else is dimmed. The sky comes after all lamps.
    let own = group_of.last().and_then(|&group| means.get(group as usize)).copied().unwrap_or(0.0);
    let enough = enough_of_sky(error, if own > 0.0 { own } else { means.iter().sum() }, count);
    let look = |place: Place, stream: &mut Stream| {
        if control.is_stopped() {
            return None;
        }
        let (leaf, shares) = reader.shares_at(place.polygon, place.point);
        let solved: Vec<Bands> = columns.iter().map(|column| value(column, leaf, &shares)).collect();
        let brightness = solved.iter().map(|solved| solved.iter().sum::<f32>() / 3.0);
        let times = |(value, mean): (f32, &f32)| (value / (BRIGHT * mean)).clamp(1.0, MOST_TIMES);
        // Where there is no light there is no mean.
        let times = brightness.zip(&means).map(|at| if *at.1 > 0.0 { times(at) } else { 1.0 });
        let own: Vec<Rays> = times.map(|times| rays.times(times)).collect();
        let side = own.iter().map(|rays| rays.side).max().unwrap_or(0);
        let choices: Vec<Choice<'_>> = (emitters.iter().zip(&own))
            .map(|(emitters, rays)| emitters.seen_from(place, Rays { side, ..*rays }.ratio(), geometry, elements))
            .collect();
        let of_lamps = group_of.get(geometry.surfaces.len()..).unwrap_or_default();
        let lit = |group: usize| {
            at_place(place.point, place.polygon, geometry, |lamp| of_lamps.get(lamp) == Some(&(group as u32)))
        };
        let lit: Vec<Bands> = (0..columns.len()).map(lit).collect();
        let sky = of_sky(place, enough, geometry, stream);
        let by_sky = |group: usize, batch: usize| -> Bands {
            let Some(dome) = &geometry.dome else { return [0.0; 3] };
            let own = of_lamps.iter().enumerate().filter(|(_, of)| **of as usize == group);
            own.fold([0.0; 3], |mut sum: Bands, (emitter, _)| {
                let due = dome.light_of(emitter, sky[batch]);
                (0..3).for_each(|band| sum[band] += due[band]);
                sum
            })
        };
        let share = 1.0 / (side * side) as f32;
        let mut hits = [const { Vec::new() }; 2];
        each_direction(place, side, geometry, stream, |batch, met| {
            let (leaf, shares) = reader.shares_at(met.polygon, met.place);
            let field = &light.field[leaf];
            let counts = std::array::from_fn(|band| {
                let all: f32 = (0..5).map(|k| shares[k] * field[k][band]).sum();
                let reflectance = geometry.surfaces[met.polygon as usize].reflectance[band];
                if all > 0.0 { share * met.solid(geometry) * reflectance } else { 0.0 }
            });
            hits[batch].push(Hit { leaf, shares, counts, met });
        });
        let mut gather = |batch: usize| -> Vec<Bands> {
            let lack = |group: usize| -> Bands {
                let mut sum = emitted(place, own[group].to_lights, geometry, elements, &choices[group], stream);
                let sky = by_sky(group, batch);
                (0..3).for_each(|band| sum[band] += lit[group][band] + sky[band]);
                for hit in &hits[batch] {
                    let reflected = value(&columns[group], hit.leaf, &hit.shares);
                    (0..3).for_each(|band| sum[band] += hit.counts[band] * reflected[band]);
                    let polygon = hit.met.polygon as usize;
                    if group_of[polygon] as usize == group {
                        let counts = share * hit.met.by_direction(&choices[group]);
                        let emission = geometry.surfaces[polygon].emission;
                        (0..3).for_each(|band| sum[band] += counts * emission[band]);
                    }
                }
                std::array::from_fn(|band| sum[band] - solved[group][band])
            };
            (0..columns.len()).map(lack).collect()
        };
        let lacks = [gather(0), gather(1)];
        Some(GroupPoint { place, solved, lacks })
    };
    let points = at_points(transport, seed ^ 0x67726f757073, count, 0.0, look);
    let places: Vec<Place> = points.iter().map(|point| point.place).collect();
    let mut found = PointErrors::default();
    for first in (0..columns.len()).step_by(SIDE_BY_SIDE) {
        if control.is_stopped() {
            return None;
        }
        let groups = first..(first + SIDE_BY_SIDE).min(columns.len());
        found.errors.extend(match groups.len() {
            1 => errors_of::<3>(&places, &points, groups, transport, light),
            2 => errors_of::<6>(&places, &points, groups, transport, light),
            _ => errors_of::<12>(&places, &points, groups, transport, light),
        });
    }
    found.irradiance = (0..columns.len()).map(|g| points.iter().map(|point| point.solved[g]).collect()).collect();
    (!control.is_stopped()).then_some(found)
}

/// Mean of a column over what is open, by area, over bands.
fn mean_of(column: &[Field], elements: &[Element]) -> f32 {
    let (mut sum, mut area) = (0.0_f64, 0.0_f64);
    let leaves = elements.iter().filter(|element| element.first_child == NONE);
    for (field, element) in column.iter().zip(leaves) {
        let open = f64::from(element.area * element.open_share());
        sum += open * f64::from(mean_over(field, element).iter().sum::<f32>() / 3.0);
        area += open;
    }
    if area > 0.0 { (sum / area) as f32 } else { 0.0 }
}

/// Errors of a range of groups, as many as `C` has room for, at every point.
fn errors_of<const C: usize>(
    places: &[Place],
    points: &[GroupPoint],
    groups: Range<usize>,
    transport: &Transport,
    light: &Light,
) -> Vec<Vec<[Bands; 2]>> {
    let lacks = |point: usize, batch: usize| -> [f32; C] {
        let own = &points[point].lacks[batch][groups.clone()];
        std::array::from_fn(|c| own.get(c / 3).map_or(0.0, |lacks| lacks[c % 3]))
    };
    let errors = errors::<C>(places, lacks, transport, light);
    let of = |group: usize| errors.iter().map(|both| both.each_ref().map(|error| bands(error, group))).collect();
    (0..groups.len()).map(of).collect()
}

/// Standard error of the square of the error that chance in what batches find of the sky may bring, as a share of the
/// square of the asked one. The mean of a product of two batches of variance v over n points is off by v / sqrt n, and
/// by nothing else: a single point may be known far worse than what is asked.
const OF_SKY: f64 = 0.05;

/// Variance that chance may leave in what both batches together find of the sky at each of so many points, (W/m²)² or
/// (lm/m²)². `scale`: irradiance that the error refers to.
fn enough_of_sky(error: f64, scale: f32, points: usize) -> f32 {
    let scale = f64::from(scale);
    // Either batch has half of the rays.
    (0.5 * OF_SKY * error * error * scale * scale * (points as f64).sqrt()) as f32
}

/// Both parts of the sky at a point, by either batch of rays. `enough`: variance that chance may leave in both
/// together.
fn of_sky(place: Place, enough: f32, geometry: &Geometry, stream: &mut Stream) -> [Parts; 2] {
    if geometry.dome.is_none() {
        return [[0.0; 2]; 2];
    }
    let receiver = Receiver::Plane(geometry.surfaces[place.polygon as usize].normal.as_dvec3());
    at_point(place.point, &receiver, geometry, stream.next_bits(), Care::until(enough))
}

/// What lamps throw on a point, by shadow rays, and the square of what its leaf knows to miss of it. Where that explains what
/// is lacking there, the leaf's own value stands for the rays': few points fall on edges of shadows, and would weigh much.
fn of_lamps(place: Place, transport: &Transport, light: &Light) -> (Bands, f64) {
    let Place { polygon, point, .. } = place;
    if light.lit.is_empty() {
        return ([0.0; 3], 0.0);
    }
    let geometry = &*transport.geometry;
    let leaf = place.node(0.0, transport) as usize;
    let (found, missed) = (at_place(point, polygon, geometry, |_| true), light.lit_error[leaf]);
    let corners =
        &transport.elements[leaf].corners.map(|corner| corner.as_dvec3())[..transport.elements[leaf].count.into()];
    let normal = geometry.surfaces[polygon as usize].normal.as_dvec3();
    let own = crate::read::within(corners, normal, point.as_dvec3(), &light.lit_by_lamps(leaf, geometry));
    let lacks = rms(std::array::from_fn(|band| found[band] - own[band]));
    (if lacks * lacks <= KNOWN * KNOWN * missed { own } else { found }, f64::from(missed))
}

impl Point {
    /// What the solution lacks here, by each batch.
    fn lacks(&self) -> [Bands; 2] {
        self.found.map(|found| std::array::from_fn(|band| found[band] - self.solved[band]))
    }
}

impl Place {
    /// The smallest node of its polygon that holds it and is at least `area` large, m²: of 0, the leaf.
    fn node(&self, area: f32, transport: &Transport) -> u32 {
        let normal = transport.geometry.surfaces[self.polygon as usize].normal;
        let mut node = self.polygon;
        loop {
            let element = &transport.elements[node as usize];
            if element.first_child == NONE {
                return node;
            }
            let child = element.first_child + part_at(element, normal, self.point) as u32;
            if transport.elements[child as usize].area < area {
                return node;
            }
            node = child;
        }
    }
}

/// The solution's error at every point by each batch: what it lacks there, and what regions lack on average as it is
/// reflected to there. Batches know nothing of each other, so that the mean of their product is that of the square. `lacks`:
/// by point and batch.
fn errors<const C: usize>(
    places: &[Place],
    lacks: impl Fn(usize, usize) -> [f32; C],
    transport: &Transport,
    light: &Light,
) -> Vec<[[f32; C]; 2]> {
    let fronts = &transport.elements[..transport.geometry.scene.fronts];
    let area: f64 = fronts.iter().map(|root| f64::from(root.area)).sum();
    let least = (area * REGION / places.len().max(1) as f64) as f32;
    let regions: Vec<u32> = places.iter().map(|place| place.node(least, transport)).collect();
    let mut counted = vec![0.0_f32; transport.elements.len()];
    regions.iter().zip(places).for_each(|(&region, place)| counted[region as usize] += place.area);
    let [one, other] = [0, 1].map(|batch: usize| {
        let mut lacking = vec![[0.0; C]; transport.elements.len()];
        for (point, &region) in regions.iter().enumerate() {
            let (lacks, mean) = (lacks(point, batch), &mut lacking[region as usize]);
            let share = places[point].area / counted[region as usize];
            (0..C).for_each(|c| mean[c] += share * lacks[c]);
        }
        let error = spread(&lacking, light, transport);
        (lacking, error)
    });
    let whole = |point: usize, region: u32| {
        let leaf = places[point].node(0.0, transport) as usize;
        let of = |batch: usize, (lacking, error): &(Vec<[f32; C]>, Vec<[f32; C]>)| -> [f32; C] {
            let lacks = lacks(point, batch);
            std::array::from_fn(|c| lacks[c] - lacking[region as usize][c] + error[leaf][c])
        };
        [of(0, &one), of(1, &other)]
    };
    regions.iter().enumerate().map(|(point, &region)| whole(point, region)).collect()
}

/// What comes back to every point if irradiance lacks 1 all over, by band.
fn returns(places: &[Place], transport: &Transport, light: &Light) -> Vec<Bands> {
    let mut lacking = vec![[0.0; 3]; transport.elements.len()];
    lacking[..transport.geometry.surfaces.len()].fill([1.0; 3]);
    let errors = spread(&lacking, light, transport);
    let at = |place: &Place| errors[place.node(0.0, transport) as usize].map(|error| error - 1.0);
    places.iter().map(at).collect()
}

/// Where a ray over the hemisphere ends.
#[derive(Clone, Copy)]
struct Met {
    polygon: u32,
    place: Vec3,
    /// Cosines at the start and at the end.
    rise: f32,
    fall: f32,
    /// Squared length, m².
    square: f32,
}

impl Met {
    /// Reflectance is that of the whole surface; the ray has met what does not let it pass.
    fn solid(&self, geometry: &Geometry) -> f32 {
        1.0 / geometry.scene.polygons[self.polygon as usize].opacity.min(1.0) as f32
    }

    fn by_direction(&self, emitters: &Choice<'_>) -> f32 {
        emitters.by_direction(self.polygon, self.rise, self.fall, self.square)
    }
}

/// Strata of both batches that one packet holds.
const STRATA: usize = RAYS / 2;

/// Stratum `index` of side², as row and column: two columns at a time, down the one pair and up the next, so that strata
/// that follow each other are neighbours.
fn stratum(index: usize, side: usize) -> [usize; 2] {
    let pair = index / (2 * side);
    let wide = (side - 2 * pair).min(2);
    let within = index - 2 * side * pair;
    let row = within / wide;
    [if pair.is_multiple_of(2) { row } else { side - 1 - row }, 2 * pair + within % wide]
}

/// Tells, batch by batch and ray by ray, where rays over the hemisphere end that do not leave the scene: side² of either
/// batch. Rays of both through neighbouring strata go in one packet.
fn each_direction(
    from: Place,
    side: usize,
    geometry: &Geometry,
    stream: &mut Stream,
    mut tell: impl FnMut(usize, Met),
) {
    let Place { polygon, point, .. } = from;
    let normal = geometry.surfaces[polygon as usize].normal;
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    for first in (0..side * side).step_by(STRATA) {
        let count = 2 * (side * side - first).min(STRATA);
        let (mut directions, mut rises) = ([Vec3::ZERO; RAYS], [0.0; RAYS]);
        for ray in 0..count {
            let [row, column] = stratum(first + ray / 2, side);
            let u = (row as f64 + stream.next_unit()) / side as f64;
            let v = (column as f64 + stream.next_unit()) / side as f64;
            let (radius, (sine, cosine)) = (u.sqrt() as f32, libm::sincosf((2.0 * std::f64::consts::PI * v) as f32));
            rises[ray] = (1.0 - radius * radius).max(0.0).sqrt();
            directions[ray] = tangent * (radius * cosine) + bitangent * (radius * sine) + normal * rises[ray];
        }
        let seen = geometry.look_along(point, normal, &directions[..count], stream);
        for (ray, seen) in seen.into_iter().enumerate() {
            let Some((polygon, place)) = seen else { continue };
            let fall = -geometry.surfaces[polygon as usize].normal.dot(directions[ray]);
            let square = place.distance_squared(point);
            tell(ray % 2, Met { polygon, place, rise: rises[ray], fall, square });
        }
    }
}

/// Irradiance at a point by either batch of side² directions over the hemisphere: what is reflected from there, and the part
/// of what is emitted that directions tell.
fn over_hemisphere(
    from: Place,
    side: usize,
    geometry: &Geometry,
    reader: &Reader,
    light: &Light,
    emitters: &Choice<'_>,
    stream: &mut Stream,
) -> [Bands; 2] {
    let mut sums = [[0.0_f32; 3]; 2];
    each_direction(from, side, geometry, stream, |batch, met| {
        let field = reader.field_at(light, met.polygon, met.place);
        let surface = &geometry.surfaces[met.polygon as usize];
        let (counts, solid) = (met.by_direction(emitters), met.solid(geometry));
        for band in 0..3 {
            let seen = solid * surface.reflectance[band] * field[band] + counts * surface.emission[band];
            sums[batch][band] += seen / (side * side) as f32;
        }
    });
    sums
}

/// Steps of places along both sides of emitters, from ray to ray: powers of the plastic number's inverse, by which places fill
/// a square evenly however many there are (M. Roberts, *The unreasonable effectiveness of quasirandom sequences*, 2018).
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// Irradiance at a point by one batch of rays to places on the emitters: what they emit.
fn emitted(
    from: Place,
    rays: usize,
    geometry: &Geometry,
    elements: &[Element],
    emitters: &Choice<'_>,
    stream: &mut Stream,
) -> Bands {
    let Place { polygon, point, .. } = from;
    let normal = geometry.surfaces[polygon as usize].normal;
    let start = [stream.next_unit(), stream.next_unit()];
    let mut sum = [0.0; 3];
    // Lamps without a surface are asked by themselves.
    let rays = if emitters.polygons.is_empty() { 0 } else { rays };
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    /// Catches a share of rays in what is not known that is none: points where both batches see the same, but each point something
    /// else, ask for more points; points where they see nothing but noise ask for more rays.
    #[test]
    fn what_both_batches_see_is_no_matter_of_rays() {
        let mut stream = Stream::new(3);
        // Nearly normal: variance 1.
        let mut draw = || (0..12).map(|_| stream.next_unit()).sum::<f64>() as f32 - 6.0;
        let errors: Vec<[[f32; 2]; 2]> = (0..4000).map(|_| [[draw(), draw()], [draw(), draw()]]).collect();
        let by_rays = |noise: f32| {
            let error = |point: usize| {
                let [[own, _], [one, other]] = errors[point];
                [[own + noise * one; 3], [own + noise * other; 3]]
            };
            measured(&vec![[1.0; 3]; errors.len()], &vec![1.0; errors.len()], error, error, |_| 0.0, |_| [0.0; 3])
                .all
                .by_rays
        };
        // Without an error of its own a point has the product of both batches' noise alone.
        let nothing = |point: usize| errors[point].map(|[one, _]| [one; 3]);
        let noise_alone =
            measured(&vec![[1.0; 3]; errors.len()], &vec![1.0; errors.len()], nothing, nothing, |_| 0.0, |_| [0.0; 3])
                .all
                .by_rays;
        assert!(noise_alone > 0.9, "{noise_alone}");
        assert!(by_rays(0.1) < 0.01, "{}", by_rays(0.1));
        assert!((0.1..0.5).contains(&by_rays(1.0)), "{}", by_rays(1.0));
    }

    /// Catches a standard error that leaves out what all points share: where a lack returns ninefold, the mean of few points is most of
    /// what chance does to the error. Told beside how far errors scatter from one set of points to the next.
    #[test]
    fn a_standard_error_has_what_all_points_share() {
        let mut stream = Stream::new(5);
        let mut draw = || (0..12).map(|_| stream.next_unit()).sum::<f64>() as f32 - 6.0;
        let (sets, count, returned) = (400, 100, 9.0);
        let (mut told, mut without, mut squares) = (0.0, 0.0, Vec::new());
        for _ in 0..sets {
            // Both batches share what points lack, each has noise of its own.
            let lacks: Vec<[f32; 2]> = (0..count)
                .map(|_| {
                    let own = 0.05 + 0.05 * draw();
                    [own + 0.05 * draw(), own + 0.05 * draw()]
                })
                .collect();
            let mean = [0, 1].map(|batch| lacks.iter().map(|lacks| lacks[batch]).sum::<f32>() / count as f32);
            let lack = |point: usize| lacks[point].map(|lack| [lack; 3]);
            let error = |point: usize| [0, 1].map(|batch: usize| [lacks[point][batch] + returned * mean[batch]; 3]);
            let found =
                |returned: f32| measured(&[[1.0; 3]; 100], &[1.0; 100], lack, error, |_| 0.0, |_| [returned; 3]).all;
            told += found(returned).square_error / f64::from(sets);
            without += found(0.0).square_error / f64::from(sets);
            squares.push(found(returned).error.powi(2));
        }
        let mean = squares.iter().sum::<f64>() / f64::from(sets);
        let scatter = (squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>() / f64::from(sets)).sqrt();
        assert!((0.85..1.15).contains(&(told / scatter)), "{told} of {scatter}");
        assert!(without < 0.2 * scatter, "{without} of {scatter}");
    }

    /// Catches points that speak for more or less than there is: those by leaf and those by area together stand for all surfaces
    /// once, for large leaves as for small ones.
    #[test]
    fn points_speak_for_all_surfaces_once() {
        let path = format!("{}/../../scenes/gallery.glb", env!("CARGO_MANIFEST_DIR"));
        let input = isolux_formats::read::read(path.as_ref(), &Default::default()).unwrap();
        let scene = isolux_core::scene::Scene::build(input, &isolux_core::scene::BuildOptions::default()).unwrap();
        let prepared = crate::solve::Prepared::new(std::sync::Arc::new(scene));
        let solved = prepared.solve(&crate::solve::Request::new(0.1), &Control::default());
        let transport = &solved.transport;
        let count = 20_000;
        let spots = Spots::new(transport, count, TO_LEAVES);
        assert!(spots.by_leaf > 1000 && spots.by_area > count / 2 - 1, "{} {}", spots.by_leaf, spots.by_area);
        let leaf = |place: &Place| &transport.elements[place.node(0.0, transport) as usize];
        let places: Vec<Place> =
            (0..count).map(|index| spots.place(index, transport, &mut Stream::new(index as u64))).collect();
        let fronts = transport.geometry.scene.fronts as u32;
        let leaves = || transport.elements.iter().filter(|leaf| leaf.first_child == NONE && leaf.polygon < fronts);
        for least in [0.0, 0.01, 0.1] {
            let told: f32 = places.iter().filter(|place| leaf(place).area > least).map(|place| place.area).sum();
            let there: f32 = leaves().filter(|leaf| leaf.area > least).map(|leaf| leaf.area).sum();
            // Measured 0.8 % at most.
            assert!((told / there - 1.0).abs() < 0.015, "{least}: {told} of {there}");
        }
        // What is small is asked more than its area calls for.
        let small = |place: &&Place| leaf(place).area < 0.01;
        let asked = places.iter().filter(small).count() as f32 / count as f32;
        let area: f32 = places.iter().filter(small).map(|place| place.area).sum::<f32>() / spots.area as f32;
        assert!(asked > 3.0 * area, "{asked} {area}");
    }

    /// Catches a stratum that is left out or taken twice where a side is no multiple of two, and packets whose strata are
    /// no neighbours.
    #[test]
    fn every_stratum_is_met_once_and_next_to_the_one_before() {
        for side in 1..40_usize {
            let all: Vec<[usize; 2]> = (0..side * side).map(|index| stratum(index, side)).collect();
            let mut sorted = all.clone();
            sorted.sort_unstable();
            let each: Vec<[usize; 2]> = (0..side * side).map(|index| [index / side, index % side]).collect();
            assert_eq!(sorted, each, "{side}");
            for pair in all.windows(2) {
                let apart = [0, 1].map(|axis: usize| pair[0][axis].abs_diff(pair[1][axis]));
                assert!(apart[0] <= 1 && apart[1] <= 1, "{side}: {pair:?}");
            }
        }
    }
}
