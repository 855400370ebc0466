//! Radiosity and irradiance of every node, and how they travel: gathered over links, pushed down, pulled up.
//!
//! Light travels in channels, side by side: a factor is found once and multiplied with the values of all of them. The first
//! three are the bands of all light. A solve has no more; light by groups of emitters has three for each group, too. Over
//! links that stay, light is linear in what is emitted, save for choices that ask the light itself: slopes that are
//! flattened, values below nothing that are dropped, near sources that are looked at part by part. All channels of a band
//! follow the choice that its first one makes ([`cut`], [`limited`]), so that groups add up to all light, pass by pass.

use crate::clusters::Clusters;
use crate::evaluate::Evaluator;
use crate::field::to_corners;
use crate::geometry::{Element, Geometry, NONE};
use crate::link::{CLUSTER, Link, MIDDLE, State};
use crate::order::{Columns, Order, View, arranged};
use crate::sky::Known;
use glam::Vec3;
use isolux_core::tree::Cut;
use isolux_simd::sphere::{clamped_cosine, evaluate};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Receivers whose links are gathered by one task.
const ROWS: usize = 256;

/// One number per band.
pub(crate) type Bands = [f32; 3];

/// Values at an element's corners and middle, per channel.
pub(crate) type Field<const C: usize = 3> = [[f32; C]; 5];

/// A function of direction, per channel.
pub(crate) type Directional<const C: usize = 3> = [[f32; C]; 9];

/// Share of its mean that a linear source has in its darkest corner at least.
const LEAST_LEFT: f32 = 0.1;

const fn dark<const C: usize>() -> Field<C> {
    [[0.0; C]; 5]
}

/// The bands of all light (0), or of a group, counted from 1.
#[inline(always)]
pub(crate) fn bands<const C: usize>(channels: &[f32; C], group: usize) -> Bands {
    std::array::from_fn(|band| channels[3 * group + band])
}

/// Values where all light of their band is above nothing.
#[inline(always)]
pub(crate) fn cut<const C: usize>(channels: [f32; C]) -> [f32; C] {
    std::array::from_fn(|c| if channels[c % 3] > 0.0 { channels[c] } else { 0.0 })
}

/// Adds `factor` times some values to others.
#[inline(always)]
pub(crate) fn add_times<const C: usize>(sum: &mut [f32; C], factor: f32, channels: &[f32; C]) {
    for c in 0..C {
        sum[c] += factor * channels[c];
    }
}

/// Root mean square over bands.
pub(crate) fn rms(bands: Bands) -> f32 {
    ((bands[0] * bands[0] + bands[1] * bands[1] + bands[2] * bands[2]) / 3.0).sqrt()
}

/// Mean of a field over an element: exact for quadratics on parallelograms and triangles.
pub(crate) fn mean<const C: usize>(field: &Field<C>, count: u8) -> [f32; C] {
    let corner = 1.0 / 12.0;
    let middle = if count == 4 { 2.0 / 3.0 } else { 0.75 };
    std::array::from_fn(|c| {
        let sum: f32 = field[..count as usize].iter().map(|value| value[c]).sum();
        sum * corner + field[MIDDLE][c] * middle
    })
}

/// The same over an element, exact for what is linear on other quadrilaterals, too.
pub(crate) fn mean_over<const C: usize>(field: &Field<C>, element: &Element) -> [f32; C] {
    leaned(field, element.count, element.lean())
}

/// Mean of a field over an element of so many corners and of a [`crate::geometry::lean`].
pub(crate) fn leaned<const C: usize>(field: &Field<C>, count: u8, [along, across]: [f32; 2]) -> [f32; C] {
    let mean = mean(field, count);
    if along == 0.0 && across == 0.0 {
        return mean;
    }
    let [a, b, c, d, _] = field;
    std::array::from_fn(|k| {
        mean[k] + 0.25 * ((b[k] + c[k] - a[k] - d[k]) * along + (c[k] + d[k] - a[k] - b[k]) * across)
    })
}

/// A field at the corners and middle of a part: what is linear along the sides, and the bulge as the quadratic function
/// that is 1 at the middle and 0 at the corners, the same in all directions. In quarters, quadratic functions of that kind stay
/// what they are, and in strips their values at the five places and their mean do: a mean is kept on the way down.
pub(crate) fn part<const C: usize>(field: &Field<C>, count: u8, cut: Cut, part: usize) -> Field<C> {
    let mut own = dark();
    for c in 0..C {
        let values = part_of(&std::array::from_fn(|k| field[k][c]), count, cut, part);
        (0..5).for_each(|k| own[k][c] = values[k]);
    }
    own
}

/// [`part`] of one channel.
#[inline(always)]
pub(crate) fn part_of(values: &[f32; 5], count: u8, cut: Cut, part: usize) -> [f32; 5] {
    let [a, b, c, d, m] = *values;
    if cut != Cut::Quarters {
        let bulge = m - 0.25 * (a + b + c + d);
        // From -1 to 1: both ends of the strip, and its middle.
        let (from, to) = (0.5 * part as f32 - 1.0, 0.5 * part as f32 - 0.5);
        let middle = 0.5 * (from + to);
        let between = |p: f32, q: f32, at: f32| p + (q - p) * (0.5 + 0.5 * at) + 0.5 * bulge * (1.0 - at * at);
        let [sides, strip] = match cut {
            Cut::Along => [[a, b], [d, c]],
            _ => [[a, d], [b, c]],
        };
        let [[p, q], [r, s]] = [sides, strip].map(|[p, q]| [between(p, q, from), between(p, q, to)]);
        let m = 0.5 * (between(sides[0], sides[1], middle) + between(strip[0], strip[1], middle) + bulge);
        return if cut == Cut::Along { [p, q, s, r, m] } else { [p, r, s, q, m] };
    }
    let quadrant = part;
    if count == 4 {
        let bulge = m - 0.25 * (a + b + c + d);
        let half = |p: f32, q: f32| 0.5 * (p + q + bulge);
        let (ab, bc, cd, da) = (half(a, b), half(b, c), half(c, d), half(d, a));
        let [p, q, r, s] = match quadrant {
            0 => [a, ab, m, da],
            1 => [ab, b, bc, m],
            2 => [m, bc, c, cd],
            _ => [da, m, cd, d],
        };
        // A quarter of the bulge within a part.
        [p, q, r, s, 0.25 * (p + q + r + s + bulge)]
    } else {
        let bulge = m - (a + b + c) / 3.0;
        let half = |p: f32, q: f32| 0.5 * (p + q) + 0.75 * bulge;
        let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
        let [p, q, r] = match quadrant {
            0 => [a, ab, ca],
            1 => [ab, b, bc],
            2 => [ca, bc, c],
            _ => [bc, ca, ab],
        };
        [p, q, r, r, (p + q + r) / 3.0 + 0.25 * bulge]
    }
}

/// Corners of a field that was gathered in samples.
pub(crate) fn corners_of<const C: usize>(samples: &[[f32; C]], count: u8) -> Field<C> {
    let mut field = dark();
    for c in 0..C {
        let corners = to_corners(&std::array::from_fn(|k| samples[k][c]), count);
        (0..5).for_each(|k| field[k][c] = corners[k]);
    }
    field
}

/// Gives a field its mean everywhere.
pub(crate) fn level<const C: usize>(field: &mut Field<C>, count: u8) {
    *field = [mean(field, count); 5];
}

/// Light of all nodes.
pub(crate) struct Light<const C: usize = 3> {
    /// What polygons emit, W/m² or lm/m².
    pub(crate) emission: Vec<[f32; C]>,
    /// Radiosity of elements, W/m² or lm/m².
    pub(crate) radiosity: Vec<[f32; C]>,
    /// Change of the radiosity over an element, along both coordinates of [`State::centre`].
    pub(crate) slope: Vec<[[f32; C]; 2]>,
    /// Are there slopes? Without, all that radiosity varies is deviation.
    pub(crate) sloped: bool,
    /// RMS deviation of the radiosity within an element, over bands and places: what is linear, and the rest.
    pub(crate) deviation: Vec<[f32; 2]>,
    /// Irradiance of elements: of leaves all there is, of others what came at their level and above.
    pub(crate) field: Vec<Field<C>>,
    /// Share of elements that nothing covers.
    pub(crate) open: Vec<f32>,
    /// Sum of the receiver's errors over the links of an element, when last asked.
    pub(crate) coherent: Vec<f32>,
    /// What the last gather at the leaves' own points found beyond what was pushed to them.
    pub(crate) correction: Vec<Field<C>>,
    /// What lamps and the sky throw on leaves, part of `field`; empty where there are none.
    pub(crate) lit: Vec<Field<C>>,
    /// Mean square over places and bands of what it misses of lamps' light; not a number where it is not known yet.
    pub(crate) lit_error: Vec<f32>,
    /// What the sky and the ground throw on leaves, by both parts, part of `lit`; empty where there is no sky.
    pub(crate) sky: Vec<Field<2>>,
    /// What leaves know of it.
    pub(crate) sky_known: Vec<Known>,
    /// Mean irradiance of elements, pulled.
    pub(crate) irradiance: Vec<Bands>,
    /// Intensity of clusters by direction, W/sr or lm/sr.
    pub(crate) intensity: Vec<Directional<C>>,
    /// Mean radiosity of clusters.
    pub(crate) cluster_radiosity: Vec<f32>,
    /// Mean irradiance of clusters, RMS over bands.
    pub(crate) cluster_irradiance: Vec<f32>,
    /// Irradiance below which errors count as if it were this much.
    pub(crate) floor: f32,
    /// Mean irradiance that weights refer to.
    pub(crate) scale: f32,
    /// Mean square of what is permitted over all surfaces, (W/m²)² or (lm/m²)²: the asked error of the mean irradiance.
    pub(crate) permitted: f32,
}

impl Light {
    /// Every surface receives `irradiance`.
    pub(crate) fn even(irradiance: Bands, geometry: &Geometry, clusters: &Clusters, elements: &[Element]) -> Light {
        let field = vec![[irradiance; 5]; elements.len()];
        let emission = geometry.surfaces.iter().map(|surface| surface.emission).collect();
        let correction = vec![dark(); elements.len()];
        let mut light = Light::of(emission, field, correction, clusters, elements);
        light.scale = rms(irradiance);
        light.pull(geometry, clusters, elements, &Order::new(elements, geometry.surfaces.len()));
        light
    }

    /// New elements start with what their parents have.
    pub(crate) fn adopt(&mut self, elements: &[Element]) {
        for index in self.radiosity.len()..elements.len() {
            let element = &elements[index];
            let parent = element.parent as usize;
            let (cut, part) = (elements[parent].cut, index - elements[parent].first_child as usize);
            self.radiosity.push(self.radiosity[parent]);
            self.deviation.push(self.deviation[parent].map(|part| 0.5 * part));
            self.slope.push([[0.0; 3]; 2]);
            self.coherent.push(0.7 * self.coherent[parent]);
            self.open.push(element.open_share());
            self.irradiance.push(self.irradiance[parent]);
            self.field.push(self::part(&self.field[parent], element.count, cut, part));
            self.correction.push(self::part(&self.correction[parent], element.count, cut, part));
            self.adopt_lit(parent, element.count, cut, part);
        }
    }

    /// Puts the elements' light in a new order.
    pub(crate) fn arrange(&mut self, places: &[u32]) {
        self.radiosity = arranged(&self.radiosity, places);
        self.slope = arranged(&self.slope, places);
        self.deviation = arranged(&self.deviation, places);
        self.coherent = arranged(&self.coherent, places);
        self.open = arranged(&self.open, places);
        self.irradiance = arranged(&self.irradiance, places);
        self.field = arranged(&self.field, places);
        self.correction = arranged(&self.correction, places);
        if !self.lit.is_empty() {
            self.lit = arranged(&self.lit, places);
            self.lit_error = arranged(&self.lit_error, places);
        }
        if !self.sky.is_empty() {
            self.sky = arranged(&self.sky, places);
            self.sky_known = arranged(&self.sky_known, places);
        }
    }

    /// Area of a node times the weight of errors there, m².
    pub(crate) fn weighted_area(&self, node: u32, evaluator: &Evaluator<'_>) -> f32 {
        let (area, irradiance) = if node & CLUSTER != 0 {
            let index = (node & !CLUSTER) as usize;
            (evaluator.clusters.nodes[index].area, self.cluster_irradiance[index])
        } else {
            (evaluator.elements[node as usize].area, rms(self.irradiance[node as usize]))
        };
        area * self.weight(irradiance)
    }

    pub(crate) fn coherent(&self, node: u32) -> f32 {
        if node & CLUSTER == 0 { self.coherent[node as usize] } else { 0.0 }
    }

    fn weight(&self, irradiance: f32) -> f32 {
        if self.floor == f32::INFINITY {
            return 1.0;
        }
        (self.scale * self.scale + self.floor * self.floor) / (irradiance * irradiance + self.floor * self.floor)
    }

    /// RMS over bands of [`Light::value`].
    pub(crate) fn strength(&self, link: &Link, evaluator: &Evaluator<'_>) -> f32 {
        if link.state.is(State::BROAD) && link.source & CLUSTER != 0 {
            // Any direction may be the one that counts.
            let index = (link.source & !CLUSTER) as usize;
            return self.cluster_radiosity[index] * evaluator.clusters.nodes[index].area * FRAC_1_PI * 0.5;
        }
        let value = rms(self.value(link, evaluator));
        // Where a slope says that nothing comes from the place that counts, its surroundings may still.
        if link.source & CLUSTER == 0 { value.max(rms(self.radiosity[link.source as usize])) } else { value }
    }
}

impl<const C: usize> Light<C> {
    /// With these emissions of polygons and fields of leaves; what follows from them is not there yet.
    pub(crate) fn of(
        emission: Vec<[f32; C]>,
        field: Vec<Field<C>>,
        correction: Vec<Field<C>>,
        clusters: &Clusters,
        elements: &[Element],
    ) -> Light<C> {
        let count = clusters.nodes.len();
        Light {
            emission,
            radiosity: vec![[0.0; C]; elements.len()],
            slope: vec![[[0.0; C]; 2]; elements.len()],
            sloped: true,
            deviation: vec![[0.0; 2]; elements.len()],
            irradiance: vec![[0.0; 3]; elements.len()],
            field,
            open: elements.iter().map(Element::open_share).collect(),
            coherent: vec![0.0; elements.len()],
            correction,
            lit: Vec::new(),
            lit_error: Vec::new(),
            sky: Vec::new(),
            sky_known: Vec::new(),
            intensity: vec![[[0.0; C]; 9]; count],
            cluster_radiosity: vec![0.0; count],
            cluster_irradiance: vec![0.0; count],
            floor: f32::INFINITY,
            scale: 0.0,
            permitted: f32::INFINITY,
        }
    }

    /// What a link's factors are multiplied with.
    #[inline(always)]
    pub(crate) fn value(&self, link: &Link, evaluator: &Evaluator<'_>) -> [f32; C] {
        if link.source & CLUSTER == 0 {
            let source = link.source as usize;
            let mut middle = [0.5; 2];
            if evaluator.elements[source].count == 3 {
                middle = [1.0 / 3.0; 2];
            }
            let [s, t] = link.state.centre();
            let (s, t) = (s - middle[0], t - middle[1]);
            let (radiosity, slope) = (&self.radiosity[source], &self.slope[source]);
            return cut(std::array::from_fn(|c| radiosity[c] + s * slope[0][c] + t * slope[1][c]));
        }
        let (from, _) = evaluator.ball(link.source);
        let towards = evaluator.ball(link.receiver).0 - from;
        let harmonics = evaluate(towards.normalize_or(Vec3::X).to_array());
        let intensity = &self.intensity[(link.source & !CLUSTER) as usize];
        let mut sum = [0.0; C];
        (0..9).for_each(|k| add_times(&mut sum, harmonics[k], &intensity[k]));
        cut(sum)
    }

    /// One pass: gather over `links`, sorted by receiver, push, pull.
    pub(crate) fn pass(&mut self, links: &[Link], evaluator: &Evaluator<'_>) {
        self.push(links, evaluator);
        let fields = self.field.par_iter_mut().zip(&self.correction).zip(evaluator.elements).with_min_len(1024);
        fields.filter(|(_, element)| element.first_child == NONE).for_each(|((field, correction), _)| {
            add(field, correction);
        });
        self.add_lamps(evaluator.elements);
        self.pull(evaluator.geometry, evaluator.clusters, evaluator.elements, evaluator.order);
    }

    /// Gathers once more, at the points of the leaves, and remembers what that finds beyond a pass.
    pub(crate) fn settle(&mut self, links: &[Link], limit: f32, evaluator: &Evaluator<'_>) {
        let (to_clusters, _) = by_kind(links);
        let mut base = vec![dark(); evaluator.geometry.surfaces.len()];
        self.send_to_members(to_clusters, &mut base, evaluator);
        let leaves = crate::leaves::gather(self, &base, links, limit, evaluator);
        self.correct(leaves, links, evaluator);
    }

    /// Adds what lamps throw to the leaves' fields.
    fn add_lamps(&mut self, elements: &[Element]) {
        let fields = self.field.par_iter_mut().zip(&self.lit).zip(elements).with_min_len(1024);
        fields.filter(|(_, element)| element.first_child == NONE).for_each(|((field, lit), _)| add(field, lit));
    }

    /// Gives leaves these fields, to which lamps' light is added, and remembers what they have beyond what a pass with today's
    /// radiosities pushes to them.
    pub(crate) fn correct(&mut self, leaves: Vec<(u32, Field<C>)>, links: &[Link], evaluator: &Evaluator<'_>) {
        self.push(links, evaluator);
        self.correction.par_iter_mut().with_min_len(4096).for_each(|correction| *correction = dark());
        for (leaf, field) in leaves {
            let leaf = leaf as usize;
            for k in 0..5 {
                for c in 0..C {
                    self.correction[leaf][k][c] = field[k][c] - self.field[leaf][k][c];
                }
            }
            self.field[leaf] = field;
        }
        self.add_lamps(evaluator.elements);
        self.pull(evaluator.geometry, evaluator.clusters, evaluator.elements, evaluator.order);
    }

    /// What arrives over the links of one receiver: at an element's points, or at a cluster by direction.
    #[inline(always)]
    fn gather(&self, row: &[Link], evaluator: &Evaluator<'_>) -> Directional<C> {
        let mut sum = [[0.0; C]; 9];
        for link in row {
            let value = self.value(link, evaluator);
            if link.receiver & CLUSTER == 0 {
                (0..5).for_each(|k| add_times(&mut sum[k], link.factors[k], &value));
            } else {
                let towards = evaluator.ball(link.source).0 - evaluator.ball(link.receiver).0;
                let harmonics = evaluate(towards.normalize_or(Vec3::X).to_array());
                (0..9).for_each(|k| add_times(&mut sum[k], link.factors[0] * harmonics[k], &value));
            }
        }
        sum
    }

    /// Fields from what links bring: from clusters to their members, from elements to their quarters.
    fn push(&mut self, links: &[Link], evaluator: &Evaluator<'_>) {
        let Evaluator { geometry, elements, order, .. } = *evaluator;
        let (to_clusters, to_elements) = by_kind(links);
        let mut fields = std::mem::take(&mut self.field);
        let rows: Vec<&[Link]> = to_elements.chunk_by(|a, b| a.receiver == b.receiver).collect();
        // Those who write side by side have elements of their own: from the first receiver of some rows to that of the next.
        let mut shares = Vec::with_capacity(rows.len() / ROWS + 1);
        let (mut rest, mut from) = (&mut fields[..], 0);
        for (index, rows_here) in rows.chunks(ROWS).enumerate() {
            let to = rows.get((index + 1) * ROWS).map_or(elements.len(), |row| row[0].receiver as usize);
            let (own, later) = rest.split_at_mut(to - from);
            shares.push((from, own, rows_here));
            (rest, from) = (later, to);
        }
        rest.fill(dark());
        shares.into_par_iter().for_each(|(from, fields, rows)| {
            fields.fill(dark());
            for row in rows {
                let receiver = row[0].receiver as usize;
                let count = elements[receiver].count;
                let field = &mut fields[receiver - from];
                *field = corners_of(&self.gather(row, evaluator)[..5], count);
                if !evaluator.ideas.linear_receivers {
                    level(field, count);
                }
            }
        });
        self.send_to_members(to_clusters, &mut fields[..geometry.surfaces.len()], evaluator);
        let hand_down = |view: &mut View<&mut [Field<C>]>, index: usize| {
            let element = &elements[index];
            let (values, own) = view.of(index);
            let field = values[own];
            let (values, first) = view.of(element.first_child as usize);
            for k in 0..4 {
                add(&mut values[first + k], &part(&field, element.count, element.cut, k));
            }
        };
        let (mut view, above) = order.above(&mut fields[..]);
        above.for_each(|index| hand_down(&mut view, index));
        order.down(elements, &mut fields[..], hand_down);
        self.field = fields;
    }

    /// Adds what arrives at clusters, and at those above them, to the fields of their polygons.
    fn send_to_members(&self, links: &[Link], fields: &mut [Field<C>], evaluator: &Evaluator<'_>) {
        let Evaluator { geometry, clusters, .. } = *evaluator;
        let rows: Vec<&[Link]> = links.chunk_by(|a, b| a.receiver == b.receiver).collect();
        let gathered: Vec<(u32, Directional<C>)> =
            rows.par_iter().with_min_len(64).map(|row| (row[0].receiver, self.gather(row, evaluator))).collect();
        let mut arriving: Vec<Directional<C>> = vec![[[0.0; C]; 9]; clusters.nodes.len()];
        for (receiver, values) in gathered {
            arriving[(receiver & !CLUSTER) as usize] = values;
        }
        clusters.pass_down(&mut arriving);
        let polygons = fields.par_iter_mut().zip(&clusters.home).zip(&geometry.surfaces).with_min_len(1024);
        polygons.filter(|((_, home), _)| **home != NONE).for_each(|((field, &home), surface)| {
            let cosine = clamped_cosine(surface.normal.to_array());
            let mut here = [0.0; C];
            (0..9).for_each(|k| add_times(&mut here, cosine[k], &arriving[home as usize][k]));
            let here = cut(here);
            field.iter_mut().for_each(|value| add_times(value, 1.0, &here));
        });
    }

    /// Radiosity and irradiance of leaves from their fields, of all above from their parts.
    pub(crate) fn pull(&mut self, geometry: &Geometry, clusters: &Clusters, elements: &[Element], order: &Order) {
        self.read_leaves(geometry, elements);
        let sloped = self.sloped;
        order.up(elements, Shapes::of(self), |view, index| pull_parent(view, index, elements, sloped));
        let (mut view, above) = order.above(Shapes::of(self));
        above.rev().for_each(|index| pull_parent(&mut view, index, elements, sloped));
        let roots: Vec<Root<C>> = (0..geometry.surfaces.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|polygon| {
                let cosine = clamped_cosine(geometry.surfaces[polygon].normal.to_array());
                (geometry.counted_area(&elements[polygon]), self.radiosity[polygon], self.irradiance[polygon], cosine)
            })
            .collect();
        let sums = ClusterSums {
            intensity: &mut self.intensity,
            radiosity: &mut self.cluster_radiosity,
            irradiance: &mut self.cluster_irradiance,
        };
        sums.pull(0, clusters, &roots);
    }

    /// Radiosity, irradiance, slope and deviation of leaves from their fields.
    fn read_leaves(&mut self, geometry: &Geometry, elements: &[Element]) {
        let (sloped, emission) = (self.sloped, &self.emission);
        let means = self.radiosity.par_iter_mut().zip(self.irradiance.par_iter_mut());
        let shapes = self.slope.par_iter_mut().zip(self.deviation.par_iter_mut());
        let leaves = elements.par_iter().zip(self.field.par_iter_mut()).zip(means).zip(shapes).with_min_len(1024);
        leaves.filter(|(((element, _), _), _)| element.first_child == NONE).for_each(
            |(((element, field), (radiosity, irradiance)), (slope, deviation))| {
                let surface = &geometry.surfaces[element.polygon as usize];
                if element.open == 0 {
                    // Nothing gets under what covers it.
                    *field = dark();
                }
                let rho = surface.reflectance;
                let arriving = cut(mean_over(field, element));
                *irradiance = bands(&arriving, 0);
                let own = &emission[element.polygon as usize];
                *radiosity = std::array::from_fn(|c| own[c] + rho[c % 3] * arriving[c]);
                let count = element.count as usize;
                let (mut square, mut change) = (0.0, [[0.0; C]; 2]);
                for band in 0..3 {
                    for k in 0..count {
                        let apart = rho[band] * field[k][band] - rho[band] * irradiance[band];
                        // Of a linear function corners deviate by three times the mean square.
                        square += apart * apart / (9 * count) as f32;
                    }
                }
                for c in (0..C).filter(|_| sloped) {
                    let at = |k: usize| rho[c % 3] * field[k][c];
                    (change[0][c], change[1][c]) = if count == 4 {
                        (0.5 * (at(1) + at(2) - at(0) - at(3)), 0.5 * (at(2) + at(3) - at(0) - at(1)))
                    } else {
                        (at(1) - at(0), at(2) - at(0))
                    };
                }
                *slope = limited(change, radiosity, element.count);
                *deviation = parted(square, &change, element.count);
            },
        );
    }
}

/// What elements with quarters have from these.
struct Shapes<'a, const C: usize> {
    radiosity: &'a mut [[f32; C]],
    irradiance: &'a mut [Bands],
    slope: &'a mut [[[f32; C]; 2]],
    deviation: &'a mut [[f32; 2]],
    open: &'a mut [f32],
}

impl<const C: usize> Shapes<'_, C> {
    fn of(light: &mut Light<C>) -> Shapes<'_, C> {
        Shapes {
            radiosity: &mut light.radiosity,
            irradiance: &mut light.irradiance,
            slope: &mut light.slope,
            deviation: &mut light.deviation,
            open: &mut light.open,
        }
    }
}

impl<const C: usize> Columns for Shapes<'_, C> {
    fn divide(self, index: usize) -> (Self, Self) {
        let (radiosity, other_radiosity) = self.radiosity.split_at_mut(index);
        let (irradiance, other_irradiance) = self.irradiance.split_at_mut(index);
        let (slope, other_slope) = self.slope.split_at_mut(index);
        let (deviation, other_deviation) = self.deviation.split_at_mut(index);
        let (open, other_open) = self.open.split_at_mut(index);
        (
            Shapes { radiosity, irradiance, slope, deviation, open },
            Shapes {
                radiosity: other_radiosity,
                irradiance: other_irradiance,
                slope: other_slope,
                deviation: other_deviation,
                open: other_open,
            },
        )
    }
}

/// Radiosity, irradiance, slope and deviation of an element with quarters, from these.
fn pull_parent<const C: usize>(view: &mut View<Shapes<'_, C>>, index: usize, elements: &[Element], sloped: bool) {
    let element = &elements[index];
    let quarters = &elements[element.first_child as usize..element.first_child as usize + 4];
    let (of, first) = view.of(element.first_child as usize);
    // Means over what is open. Of what is covered all of it, so that there is something to divide by.
    let whole: f32 = quarters.iter().map(|quarter| quarter.area).sum();
    let open: f32 = (0..4).map(|k| quarters[k].area * of.open[first + k]).sum();
    let shares: [f32; 4] = std::array::from_fn(|k| {
        let area = quarters[k].area;
        if open > 0.0 { area * of.open[first + k] / open } else { area / whole }
    });
    let (mut radiosity, mut irradiance) = ([0.0; C], [0.0; 3]);
    for (child, share) in (first..).zip(shares) {
        add_times(&mut radiosity, share, &of.radiosity[child]);
        add_times(&mut irradiance, share, &of.irradiance[child]);
    }
    let mut square = 0.0;
    for (child, share) in (first..).zip(shares) {
        let [linear, rest] = of.deviation[child];
        let apart = rms(std::array::from_fn(|k| of.radiosity[child][k] - radiosity[k]));
        square += share * (linear * linear + rest * rest + apart * apart);
    }
    // What is covered throws nothing: there is no slope towards it.
    let at = |k: usize, c: usize| if shares[k] > 0.0 { of.radiosity[first + k][c] } else { radiosity[c] };
    let slope = if !sloped {
        [[0.0; C]; 2]
    } else if element.cut != Cut::Quarters {
        // The line through four values side by side; along the strips, what they change themselves.
        let (own, other) = if element.cut == Cut::Along { (0, 1) } else { (1, 0) };
        let mut slope = [[0.0; C]; 2];
        slope[own] = std::array::from_fn(|c| 1.2 * (at(3, c) - at(0, c)) + 0.4 * (at(2, c) - at(1, c)));
        for (child, share) in (first..).zip(shares) {
            add_times(&mut slope[other], share, &of.slope[child][other]);
        }
        slope
    } else if element.count == 4 {
        [
            std::array::from_fn(|k| at(1, k) + at(2, k) - at(0, k) - at(3, k)),
            std::array::from_fn(|k| at(2, k) + at(3, k) - at(0, k) - at(1, k)),
        ]
    } else {
        [std::array::from_fn(|k| 2.0 * (at(1, k) - at(0, k))), std::array::from_fn(|k| 2.0 * (at(2, k) - at(0, k)))]
    };
    let (of, own) = view.of(index);
    of.open[own] = open / whole;
    of.slope[own] = limited(slope, &radiosity, element.count);
    of.deviation[own] = parted(square, &slope, element.count);
    of.radiosity[own] = radiosity;
    of.irradiance[own] = irradiance;
}

/// Area, radiosity, irradiance and clamped cosine of a polygon.
pub(crate) type Root<const C: usize = 3> = (f32, [f32; C], Bands, [f32; 9]);

/// Clusters' sums over the part of the hierarchy below one of them, which comes first.
pub(crate) struct ClusterSums<'a, const C: usize = 3> {
    pub(crate) intensity: &'a mut [Directional<C>],
    pub(crate) radiosity: &'a mut [f32],
    pub(crate) irradiance: &'a mut [f32],
}

/// Clusters from which both halves are summed side by side.
const PARALLEL: usize = 4096;

impl<const C: usize> ClusterSums<'_, C> {
    /// Sums up the cluster numbered `first` and all below it. `roots`: by polygon.
    pub(crate) fn pull(self, first: usize, clusters: &Clusters, roots: &[Root<C>]) {
        let ClusterSums { intensity, radiosity, irradiance } = self;
        let node = &clusters.nodes[first];
        let (mut sum, mut out, mut arriving) = ([[0.0; C]; 9], 0.0, 0.0);
        if node.second == 0 {
            for &polygon in clusters.members(first as u32) {
                let (area, value, received, cosine) = &roots[polygon as usize];
                for k in 0..9 {
                    for c in 0..C {
                        sum[k][c] += cosine[k] * area * value[c] * FRAC_1_PI;
                    }
                }
                out += area * rms(bands(value, 0));
                arriving += area * rms(*received);
            }
        } else {
            let middle = node.second as usize - first;
            {
                let (intensity, other_intensity) = intensity[1..].split_at_mut(middle - 1);
                let (radiosity, other_radiosity) = radiosity[1..].split_at_mut(middle - 1);
                let (irradiance, other_irradiance) = irradiance[1..].split_at_mut(middle - 1);
                let one = ClusterSums { intensity, radiosity, irradiance };
                let other = ClusterSums {
                    intensity: other_intensity,
                    radiosity: other_radiosity,
                    irradiance: other_irradiance,
                };
                let second = node.second as usize;
                if one.radiosity.len() + other.radiosity.len() >= PARALLEL {
                    rayon::join(|| one.pull(first + 1, clusters, roots), || other.pull(second, clusters, roots));
                } else {
                    one.pull(first + 1, clusters, roots);
                    other.pull(second, clusters, roots);
                }
            }
            for child in [1, middle] {
                (0..9).for_each(|k| add_times(&mut sum[k], 1.0, &intensity[child][k]));
                let area = clusters.nodes[first + child].area;
                out += area * radiosity[child];
                arriving += area * irradiance[child];
            }
        }
        intensity[0] = sum;
        radiosity[0] = out / node.area;
        irradiance[0] = arriving / node.area;
    }
}

/// Links to clusters, and those to elements.
fn by_kind(links: &[Link]) -> (&[Link], &[Link]) {
    links.split_at(links.partition_point(|link| link.receiver & CLUSTER != 0))
}

/// Adds a field to another.
pub(crate) fn add<const C: usize>(field: &mut Field<C>, more: &Field<C>) {
    (0..5).for_each(|k| add_times(&mut field[k], 1.0, &more[k]));
}

/// A slope that leaves a share of the mean in every corner: light that falls off towards a side steeper than a line is still
/// light there.
pub(crate) fn limited<const C: usize>(slope: [[f32; C]; 2], radiosity: &[f32; C], count: u8) -> [[f32; C]; 2] {
    let left: Bands = std::array::from_fn(|band| {
        let (s, t) = (slope[0][band], slope[1][band]);
        let deepest = if count == 4 {
            0.5 * (s.abs() + t.abs())
        } else {
            ((s + t) / 3.0).max(((s + t) / 3.0 - s.min(t)).max(0.0))
        };
        let most = (1.0 - LEAST_LEFT) * radiosity[band].max(0.0);
        if deepest > most { most / deepest } else { 1.0 }
    });
    slope.map(|along| std::array::from_fn(|c| along[c] * left[c % 3]))
}

/// Splits a variance (mean over bands) into what a slope makes of it, and the rest; as deviations.
fn parted<const C: usize>(square: f32, slope: &[[f32; C]; 2], count: u8) -> [f32; 2] {
    let mut linear = 0.0;
    for band in 0..3 {
        let (s, t) = (slope[0][band], slope[1][band]);
        linear += if count == 4 { (s * s + t * t) / 12.0 } else { (s * s + t * t - s * t) / 18.0 };
    }
    linear /= 3.0;
    [linear.sqrt(), (square - linear).max(0.0).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::painted;

    /// Catches strips and quarters that do not have the values of the field that they are parts of: on a square, the quadratic
    /// function that a field stands for, at the places where parts keep values, and its mean.
    #[test]
    fn parts_keep_values_and_mean() {
        let values = [1.0, 3.0, 2.5, 0.5, 2.9];
        let bulge = values[4] - 0.25 * (values[0] + values[1] + values[2] + values[3]);
        let of = |[u, v]: [f32; 2]| {
            let (s, t) = (0.5 + 0.5 * u, 0.5 + 0.5 * v);
            let along = |near: f32, far: f32| near + (far - near) * s;
            let plain = along(values[0], values[1]) * (1.0 - t) + along(values[3], values[2]) * t;
            plain + bulge * (1.0 - 0.5 * (u * u + v * v))
        };
        let square = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        for cut in [Cut::Quarters, Cut::Along, Cut::Across] {
            let element = Element { cut, ..Element::new(square, 4, 0, NONE, isolux_core::tree::Path::root(0)) };
            let mut sum = 0.0;
            for (k, piece) in element.parts(0).iter().enumerate() {
                let own = part_of(&values, 4, cut, k);
                let places = [piece.corners[0], piece.corners[1], piece.corners[2], piece.corners[3], piece.centre()];
                for (value, place) in own.iter().zip(places) {
                    let wanted = of([2.0 * place.x - 1.0, 2.0 * place.y - 1.0]);
                    // A few roundings of values up to 3.
                    assert!((value - wanted).abs() < 1e-5, "{cut:?} {k} {place}: {value} {wanted}");
                }
                sum += 0.25 * mean(&own.map(|value| [value]), 4)[0];
            }
            let whole = mean(&values.map(|value| [value]), 4)[0];
            assert!((sum - whole).abs() < 1e-5, "{cut:?}: {sum} {whole}");
        }
    }

    /// Catches slopes of elements in strips that are not those of the light on them: light that is linear along both sides.
    #[test]
    fn strips_have_the_slopes_of_their_light() {
        let plank = [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let turned = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 20.0, 0.0], [0.0, 20.0, 0.0]];
        for (shape, cut) in [(plank, Cut::Along), (turned, Cut::Across)] {
            let geometry = Geometry::new(painted(&[&shape], 0.5, 0.0));
            let mut elements = geometry.bare_roots();
            elements[0].cut = elements[0].compact_cut();
            assert_eq!(elements[0].cut, cut);
            let clusters = Clusters::new(&elements, &[true, false]);
            let mut light = Light::even([1.0; 3], &geometry, &clusters, &elements);
            // 1 to 2 along the first side, 1 to 1.5 along the second.
            light.field[0] = [1.0, 2.0, 2.5, 1.5, 1.75].map(|value| [value; 3]);
            crate::contacts::split(&mut elements, [0], &geometry);
            light.adopt(&elements);
            light.pull(&geometry, &clusters, &elements, &Order::new(&elements, geometry.surfaces.len()));
            let [along, across] = light.slope[0].map(|slope| slope[0]);
            let rho = geometry.surfaces[0].reflectance[0];
            assert!((along - rho).abs() < 1e-5 && (across - 0.5 * rho).abs() < 1e-5, "{along} {across}");
        }
    }

    /// Catches slopes towards what is covered: of a square one quarter of which lies under something, the other three are alike,
    /// so that it is as bright wherever it is read. Links of sources that things stand on read up to twice their light before,
    /// and fine solves made 0.5 % of light.
    #[test]
    fn there_is_no_slope_towards_what_is_covered() {
        let square: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let far: &[[f64; 3]] = &[[0.0, 0.0, 9.0], [0.0, 1.0, 9.0], [1.0, 1.0, 9.0], [1.0, 0.0, 9.0]];
        let geometry = Geometry::new(painted(&[square, far], 0.5, 1.0));
        let mut elements = geometry.bare_roots();
        let clusters = Clusters::new(&elements, &[true, true]);
        let quarters = elements[0].quarters(0);
        elements[0].first_child = elements.len() as u32;
        elements.extend(quarters);
        elements[2].open = 0;
        let light = Light::even([4.0; 3], &geometry, &clusters, &elements);
        assert_eq!(light.radiosity[2], [1.0; 3], "{:?}", light.radiosity);
        assert!((light.radiosity[0][0] - 3.0).abs() < 1e-5, "{:?}", light.radiosity[0]);
        assert!(light.slope[0].iter().flatten().all(|slope| slope.abs() < 1e-5), "{:?}", light.slope[0]);
    }
}
