//! Direct light of lamps that have no surface: a leaf goes in, what they throw on it comes out as a field, by shadow rays
//! from places spread over the leaf, with what that field misses.
//!
//! Nothing of it goes over links: it is found at the leaves alone, before links are refined, and kept beside what links
//! bring ([`Light::lit`]). Leaves are split until what their fields miss is little ([`Transport::light_up`]).

use crate::contacts::split;
use crate::control::{Bound, Budget};
use crate::geometry::{Element, Geometry, NONE};
use crate::light::{Bands, Field, Light, add, mean, mean_over, part};
use crate::rays::{Packet, RAYS, own_point};
use crate::receiver::Receiver;
use crate::rounds::{Limit, Transport};
use glam::Vec3;
use isolux_core::scene::Lamp;
use isolux_core::tree::Cut;
use rayon::prelude::*;
use std::array::from_fn;
use std::sync::LazyLock;

/// Places of a leaf that is larger than this share of the scene are [`MANY`], of others [`RAYS`]: a small patch of sun on a
/// large floor is to be found.
pub(crate) const LARGE: f32 = 1.0 / 4096.0;
const MANY: usize = 256;

/// A leaf that looks far better than its parent, of which more was missing than may be, is asked at more places, at most at
/// 1,024: the edge of a shadow that runs through the parent may run past 16 places beside the leaf's border. At so many that
/// a part of it between places is too small to matter, if it is lit and the rest is not: a step has this many times the
/// variance that fields leave of it.
const FAR_BETTER: f32 = 0.25;
const STEP: f32 = 16.0;

/// Height over a place's plane at which rays of lamps begin to meet things at the latest, in tolerances: twelve times what
/// rounding takes.
pub(crate) const NEAR: f32 = 0.1;

/// Share of the values' range by which a field that fits them well may go beyond it: half of it where it tells all of
/// their variance (of a linear function places of one diagonal tell 0.56 of the range), nothing below a share told of 0.8.
/// A line through a step tells 0.75, and would be wrong by a quarter of the step beside it.
const BEYOND: f64 = 0.5;
const WELL: f64 = 0.8;

/// What keeps coefficients small that no place tells: share of the sum of squares over all places.
const RIDGE: f64 = 1e-6;

/// Channel of a lamp whose light counts in that of all lamps only.
pub(crate) const ALL_ONLY: usize = usize::MAX;

/// Places in the unit square, no two of which have the same column or row of N: bits of a number, and the same in reverse
/// (J. M. Hammersley 1960). A shadow's edge along a leaf's sides is then known to an Nth of it.
fn net(places: usize) -> Vec<[f32; 2]> {
    let bits = places.trailing_zeros();
    let half = 0.5 / places as f32;
    let column = |index: usize| index as f32 / places as f32 + half;
    (0..places).map(|index| [column(index), column(index.reverse_bits() >> (usize::BITS - bits))]).collect()
}

/// Nets of 16, 64, 256 and 1,024 places.
static NETS: LazyLock<[Vec<[f32; 2]>; 4]> = LazyLock::new(|| from_fn(|power| net(RAYS << (2 * power))));

/// The least of the nets that has so many places, or the largest one.
pub(crate) fn net_of(places: f32) -> &'static [[f32; 2]] {
    NETS.iter().find(|net| net.len() as f32 >= places).unwrap_or(&NETS[NETS.len() - 1])
}

/// A place of a unit square on an element, areas in proportion on parallelograms and triangles; and its coordinates as in
/// [`crate::link::State::centre`].
pub(crate) fn spread_out(element: &Element, [x, y]: [f32; 2]) -> (Vec3, [f32; 2]) {
    let [a, b, c, d] = element.corners;
    if element.count == 4 {
        return (a + (b - a) * x + (d - a) * y + (a - b + c - d) * (x * y), [x, y]);
    }
    let root = x.sqrt();
    let (beta, gamma) = (1.0 - root, root * y);
    (a + (b - a) * beta + (c - a) * gamma, [beta, gamma])
}

/// Functions that make up a field, at a place: constant, two slopes, twist (of quadrilaterals), bulge.
pub(crate) fn basis(count: u8, [s, t]: [f32; 2]) -> [f64; 5] {
    let (s, t) = (f64::from(s), f64::from(t));
    if count == 4 {
        let (u, v) = (2.0 * s - 1.0, 2.0 * t - 1.0);
        [1.0, u, v, u * v, 1.0 - 0.5 * (u * u + v * v)]
    } else {
        let first = 1.0 - s - t;
        [1.0, s - 1.0 / 3.0, t - 1.0 / 3.0, 0.0, 3.0 * (first * s + s * t + t * first)]
    }
}

/// Sets ray `k` of a packet from a place towards a lamp; what comes along it if nothing is in the way.
fn aim(packet: &mut Packet, k: usize, place: Vec3, receiver: &Receiver, lamp: &Lamp, geometry: &Geometry) -> Bands {
    let Some(thrown) = lamp.thrown_on(place.as_dvec3() + geometry.middle) else { return [0.0; 3] };
    let counts = receiver.weight(thrown.towards);
    if counts <= 0.0 {
        return [0.0; 3];
    }
    // What is in the way is no farther than the scene is large, and the place outside of it.
    let reach = 2.0 * geometry.scene.diameter.max(f64::from(place.length()));
    let length = thrown.distance.min(reach);
    let direction = (thrown.towards * length).as_vec3();
    for axis in 0..3 {
        packet.rays.origin[axis][k] = place[axis];
        packet.rays.direction[axis][k] = direction[axis];
    }
    // Within this distance what the place lies on is not met; farther along flat rays, but not so far that they pass walls.
    let rise = match receiver {
        Receiver::Plane(normal) => normal.as_vec3().dot(direction),
        Receiver::Cylinder(_) | Receiver::SemiCylinder { .. } => length as f32,
    };
    let own = NEAR * length as f32 / rise.max(f32::MIN_POSITIVE);
    packet.rays.near[k] = geometry.tolerance * own.max(1.0) / length as f32;
    packet.rays.far[k] = if thrown.distance < reach { 1.0 - geometry.tolerance / length as f32 } else { 1.0 };
    packet.weights[k] = if packet.rays.near[k] < packet.rays.far[k] { 1.0 } else { 0.0 };
    thrown.facing.0.map(|facing| (facing * counts) as f32 * packet.weights[k])
}

/// What the lamps that count, by number, throw on a place of a side, W/m² or lm/m².
pub(crate) fn at_place(place: Vec3, side: u32, geometry: &Geometry, counts: impl Fn(usize) -> bool) -> Bands {
    let receiver = Receiver::Plane(geometry.surfaces[side as usize].normal.as_dvec3());
    at_receiver(place, &receiver, geometry, counts)
}

/// What the lamps that count throw on a receiver, W/m² or lm/m².
pub(crate) fn at_receiver(
    place: Vec3,
    receiver: &Receiver,
    geometry: &Geometry,
    counts: impl Fn(usize) -> bool,
) -> Bands {
    let mut sum = [0.0; 3];
    for (chunk, lamps) in geometry.scene.lamps.chunks(RAYS).enumerate() {
        let mut packet = Packet::new();
        let mut carried = [[0.0; 3]; RAYS];
        for (k, lamp) in lamps.iter().enumerate().filter(|(k, _)| counts(chunk * RAYS + k)) {
            carried[k] = aim(&mut packet, k, place, receiver, lamp, geometry);
        }
        for (carried, through) in carried.iter().zip(packet.through(geometry)) {
            (0..3).for_each(|band| sum[band] += through * carried[band]);
        }
    }
    sum
}

/// What lamps and the sky would throw on an element if nothing were in the way, on average.
fn unhindered(element: &Element, geometry: &Geometry) -> Bands {
    let normal = geometry.surfaces[element.polygon as usize].normal.as_dvec3();
    let mut sum = [0.0; 3];
    for &place in net_of(0.0) {
        let place = spread_out(element, place).0.as_dvec3() + geometry.middle;
        for thrown in geometry.scene.lamps.iter().filter_map(|lamp| lamp.thrown_on(place)) {
            let cosine = thrown.towards.dot(normal).max(0.0);
            (0..3).for_each(|band| sum[band] += (thrown.facing[band] * cosine) as f32 / RAYS as f32);
        }
    }
    let sky = crate::sky::unhindered(normal, geometry);
    (0..3).for_each(|band| sum[band] += sky[band]);
    sum
}

/// Does light of a lamp or of the sky get to a side, as far as places of it tell?
pub(crate) fn reach(root: &Element, geometry: &Geometry) -> bool {
    net_of(MANY as f32)
        .iter()
        .any(|&place| at_place(spread_out(root, place).0, root.polygon, geometry, |_| true) != [0.0; 3])
        || crate::sky::reach(root, geometry)
}

/// Places of a leaf, and what arrives there.
pub(crate) struct Places<const C: usize> {
    pub(crate) count: u8,
    pub(crate) basis: Vec<[f64; 5]>,
    pub(crate) values: Vec<[f32; C]>,
}

/// What lamps throw on an element, and the mean square over places and bands of what the field misses, (W/m²)² or (lm/m²)².
/// `channels`: by lamp, the first channel of its group beside those of all lamps, or [`ALL_ONLY`]. `places`: at so many at least.
fn lit<const C: usize>(element: &Element, geometry: &Geometry, channels: &[usize], places: f32) -> (Field<C>, f32) {
    let large = LARGE * geometry.scene.area() as f32;
    let mut found = Places { count: element.count, basis: Vec::new(), values: Vec::new() };
    if element.crossed && places <= RAYS as f32 && element.area <= large {
        // Of these places it is known whether something stands on them.
        let open = (0..RAYS).filter(|part| element.open >> part & 1 == 1);
        let places: Vec<(Vec3, [f32; 2])> = open.map(|part| own_point(element, part)).collect();
        found.ask(&places, element.polygon, geometry, channels);
    } else {
        let net = net_of(if element.area > large { places.max(MANY as f32) } else { places });
        for places in net.chunks(RAYS) {
            let places: [_; RAYS] = from_fn(|k| spread_out(element, places[k]));
            found.ask(&places, element.polygon, geometry, channels);
        }
    }
    found.fit()
}

impl<const C: usize> Places<C> {
    /// Adds at most [`RAYS`] places.
    fn ask(&mut self, places: &[(Vec3, [f32; 2])], side: u32, geometry: &Geometry, channels: &[usize]) {
        let receiver = Receiver::Plane(geometry.surfaces[side as usize].normal.as_dvec3());
        let first = self.values.len();
        self.values.resize(first + places.len(), [0.0; C]);
        self.basis.extend(places.iter().map(|&(_, coordinates)| basis(self.count, coordinates)));
        for (lamp, &own) in geometry.scene.lamps.iter().zip(channels) {
            let mut packet = Packet::new();
            let mut carried = [[0.0; 3]; RAYS];
            for (k, &(place, _)) in places.iter().enumerate() {
                carried[k] = aim(&mut packet, k, place, &receiver, lamp, geometry);
            }
            if packet.active() == 0 {
                continue;
            }
            let through = packet.through(geometry);
            for (k, values) in self.values[first..].iter_mut().enumerate() {
                for band in 0..3 {
                    let value = through[k] * carried[k][band];
                    values[band] += value;
                    if own != ALL_ONLY {
                        values[own + band] += value;
                    }
                }
            }
        }
    }

    /// The field with the least squares, drawn in where it goes beyond what was found; and what it misses.
    fn fit(&self) -> (Field<C>, f32) {
        let places = self.values.len();
        if self.values.iter().all(|values| values[..3] == [0.0; 3]) {
            return ([[0.0; C]; 5], 0.0);
        }
        let coefficients = self.least_squares();
        let at = |basis: &[f64; 5], c: usize| -> f64 { (0..5).map(|row| basis[row] * coefficients[row][c]).sum() };
        let corners: [[f64; 5]; 5] = if self.count == 4 {
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]].map(|place| basis(4, place))
        } else {
            let third = 1.0 / 3.0;
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [third, third]].map(|place| basis(3, place))
        };
        let free: [[f64; C]; 5] = from_fn(|k| from_fn(|c| at(&corners[k], c)));
        let field: Field<C> = free.map(|values| values.map(|value| value as f32));
        let means: [f64; C] = mean(&field, self.count).map(f64::from);
        let kept: [f64; 3] = from_fn(|band| {
            let values = || self.values.iter().map(|values| f64::from(values[band]));
            let (low, high) = values().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
            let average = values().sum::<f64>() / places as f64;
            let all: f64 = values().map(|value| (value - average) * (value - average)).sum();
            let left: f64 =
                self.basis.iter().zip(values()).map(|(basis, value)| (at(basis, band) - value).powi(2)).sum();
            let told = if all > 0.0 { 1.0 - left / all } else { 1.0 };
            let beyond = BEYOND * (high - low) * ((told - WELL) / (1.0 - WELL)).clamp(0.0, 1.0);
            let (low, high) = ((low - beyond).max(0.0), high + beyond);
            let middle = means[band];
            free.iter().fold(1.0_f64, |kept, values| {
                let apart = values[band] - middle;
                let room = if apart > 0.0 { high - middle } else { middle - low };
                if apart.abs() > room { kept.min((room / apart.abs()).max(0.0)) } else { kept }
            })
        });
        let drawn = |value: f64, c: usize| means[c] + kept[c % 3] * (value - means[c]);
        let field = free.map(|values| from_fn(|c| drawn(values[c], c) as f32));
        let missed: f64 = (self.basis.iter().zip(&self.values))
            .flat_map(|(basis, values)| (0..3).map(move |band| drawn(at(basis, band), band) - f64::from(values[band])))
            .map(|apart| apart * apart)
            .sum();
        // Five numbers were chosen to make it small.
        let free_places = places.saturating_sub(5).max(1);
        (field, (missed / (3 * free_places) as f64) as f32)
    }

    /// Coefficients of the functions of [`basis`], by channel.
    pub(crate) fn least_squares(&self) -> [[f64; C]; 5] {
        let (mut matrix, mut sums) = ([[0.0; 5]; 5], [[0.0; C]; 5]);
        for (basis, values) in self.basis.iter().zip(&self.values) {
            for row in 0..5 {
                (0..5).for_each(|column| matrix[row][column] += basis[row] * basis[column]);
                (0..C).for_each(|c| sums[row][c] += basis[row] * f64::from(values[c]));
            }
        }
        (1..5).for_each(|row| matrix[row][row] += RIDGE * self.values.len() as f64);
        // The matrix is positive definite: elimination without pivots.
        for row in 0..5 {
            for below in row + 1..5 {
                let factor = matrix[below][row] / matrix[row][row];
                (row..5).for_each(|column| matrix[below][column] -= factor * matrix[row][column]);
                (0..C).for_each(|c| sums[below][c] -= factor * sums[row][c]);
            }
        }
        for row in (0..5).rev() {
            for c in 0..C {
                let known: f64 = (row + 1..5).map(|column| matrix[row][column] * sums[column][c]).sum();
                sums[row][c] = (sums[row][c] - known) / matrix[row][row];
            }
        }
        sums
    }
}

/// What lamps throw on all leaves, in channels, by element; empty where there are no lamps. `channels` as in [`lit`].
pub(crate) fn lit_leaves<const C: usize>(transport: &Transport, channels: &[usize]) -> Vec<Field<C>> {
    let geometry = &*transport.geometry;
    if geometry.scene.lamps.is_empty() {
        return Vec::new();
    }
    let of = |element: &Element| {
        if takes_light(element, transport) { lit(element, geometry, channels, 0.0).0 } else { [[0.0; C]; 5] }
    };
    transport.elements.par_iter().with_min_len(8).map(of).collect()
}

/// Is an element a leaf that light of lamps may fall on?
pub(crate) fn takes_light(element: &Element, transport: &Transport) -> bool {
    let takes_part = transport.clusters.home[element.polygon as usize] != NONE;
    element.first_child == NONE && element.open != 0 && takes_part
}

impl Transport {
    /// Places at which a leaf should be asked that misses so much as far as 16 places tell.
    fn places(&self, element: &Element, missed: f32, light: &Light, error: f32) -> f32 {
        let of_parent = light.lit_error.get(element.parent as usize).copied().unwrap_or(0.0);
        let is_suspect = 4.0 * element.area * of_parent > error && missed < FAR_BETTER * of_parent;
        if is_suspect { (STEP * element.area * of_parent / error).max(4.0 * RAYS as f32) } else { 0.0 }
    }

    /// Finds the direct light of lamps at leaves where it is not known yet, and gives it to their fields. `error`: area times
    /// squared error that a leaf may miss.
    pub(crate) fn shine(&self, light: &mut Light, error: f32) {
        if self.geometry.scene.lamps.is_empty() {
            light.lit_error.fill(0.0);
            return;
        }
        let channels = vec![ALL_ONLY; self.geometry.scene.lamps.len()];
        let asked = |leaf: &u32| -> (Field, f32) {
            let element = &self.elements[*leaf as usize];
            if !takes_light(element, self) {
                return ([[0.0; 3]; 5], 0.0);
            }
            let (field, missed) = lit(element, &self.geometry, &channels, 0.0);
            let places = self.places(element, missed, light, error);
            if places > RAYS as f32 { lit(element, &self.geometry, &channels, places) } else { (field, missed) }
        };
        let unknown: Vec<u32> =
            (0..light.lit.len() as u32).filter(|&leaf| light.lit_error[leaf as usize].is_nan()).collect();
        let found: Vec<(Field, f32)> = unknown.par_iter().with_min_len(8).map(asked).collect();
        for (leaf, (now, missed)) in unknown.into_iter().zip(found) {
            let leaf = leaf as usize;
            let now = match (&self.geometry.dome, light.sky.get(leaf)) {
                (Some(dome), Some(sky)) => {
                    let mut all = dome.field(sky);
                    add(&mut all, &now);
                    all
                }
                _ => now,
            };
            let change = from_fn(|k| from_fn(|band| now[k][band] - light.lit[leaf][k][band]));
            add(&mut light.field[leaf], &change);
            (light.lit[leaf], light.lit_error[leaf]) = (now, missed);
        }
    }

    /// Splits leaves until lamps' direct light on none of them misses more than `limit`, or a bound of `budget` is broken.
    /// Elements are put in order then, and the light is pulled, so that links see it.
    pub(crate) fn light_up(&mut self, light: &mut Light, limit: Limit, budget: &Budget<'_>) -> Option<Bound> {
        if light.lit.is_empty() {
            return None;
        }
        // With a lower limit, leaves that were better than their parents by few places are asked at more.
        let again = |(leaf, element): (usize, &Element)| {
            let missed = light.lit_error[leaf];
            let more = self.places(element, missed, light, limit.error) > 4.0 * RAYS as f32;
            if element.first_child == NONE && more { f32::NAN } else { missed }
        };
        light.lit_error = self.elements.par_iter().enumerate().with_min_len(1024).map(|(l, e)| again((l, e))).collect();
        let bound = loop {
            self.shine(light, limit.error);
            self.shine_sky(light, limit.error);
            let bound = budget.broken(self.elements.len(), self.links.len() + self.dark.len());
            if bound == Some(Bound::Stop) {
                return bound;
            }
            let coarse = if bound.is_some() { Vec::new() } else { self.coarse(light, limit) };
            if coarse.is_empty() {
                break bound;
            }
            split(&mut self.elements, coarse, &self.geometry);
            light.adopt(&self.elements);
        };
        self.arrange(light);
        light.pull(&self.geometry, &self.clusters, &self.elements, &self.order);
        bound
    }

    /// Leaves on which lamps' direct light misses more than `limit`.
    fn coarse(&self, light: &Light, limit: Limit) -> Vec<u32> {
        let evaluator = self.evaluator();
        let is_missed = |leaf: usize, weighted: f32| {
            weighted * light.lit_error[leaf] > limit.error || self.misses_sky(leaf, weighted, light, limit)
        };
        let is_coarse = |leaf: &u32| {
            let element = &self.elements[*leaf as usize];
            element.first_child == NONE
                && element.area > limit.area
                && element.path.depth() < isolux_core::tree::Path::MAX_DEPTH
                && is_missed(*leaf as usize, light.weighted_area(*leaf, &evaluator))
        };
        (0..self.elements.len() as u32).into_par_iter().with_min_len(1024).filter(is_coarse).collect()
    }

    /// Sum over leaves of area times the square of what the fields of lamps' direct light miss, m² (W/m²)².
    pub(crate) fn missed_of_lamps(&self, light: &Light) -> f64 {
        let leaves = self.elements.iter().zip(&light.lit_error).filter(|(element, _)| element.first_child == NONE);
        leaves.map(|(element, &missed)| f64::from(element.area * element.open_share() * missed.max(0.0))).sum()
    }

    /// Power of lamps that arrives on surfaces, and what would if nothing were in the way, W or lm. Of roots.
    pub(crate) fn arriving_of_lamps(&self, light: &Light) -> [[f64; 3]; 2] {
        let mut sums = [[0.0; 3]; 2];
        if light.lit.is_empty() {
            return sums;
        }
        let roots = &self.elements[..self.geometry.surfaces.len()];
        let open: Vec<Bands> = roots.par_iter().map(|root| unhindered(root, &self.geometry)).collect();
        for ((root, lit), open) in roots.iter().zip(&light.lit).zip(open) {
            let arrives = mean_over(lit, root);
            for band in 0..3 {
                sums[0][band] += f64::from(root.area * arrives[band]);
                sums[1][band] += f64::from(root.area * open[band]);
            }
        }
        sums
    }
}

impl Light {
    /// Nothing is known of lamps' light yet, nor of the sky's if there is one.
    pub(crate) fn expect_lamps(&mut self, has_sky: bool) {
        if has_sky {
            self.sky = vec![[[0.0; 2]; 5]; self.field.len()];
            self.sky_known = vec![crate::sky::UNKNOWN; self.field.len()];
        }
        self.lit = vec![[[0.0; 3]; 5]; self.field.len()];
        self.lit_error = vec![f32::NAN; self.field.len()];
    }

    /// What a part has of lamps' light until it is asked itself.
    pub(crate) fn adopt_lit(&mut self, parent: usize, count: u8, cut: Cut, part: usize) {
        if !self.lit.is_empty() {
            self.lit.push(self::part(&self.lit[parent], count, cut, part));
            self.lit_error.push(f32::NAN);
        }
        self.adopt_sky(parent, count, cut, part);
    }
}

impl Light {
    /// What lamps throw on a leaf, without the sky.
    pub(crate) fn lit_by_lamps(&self, leaf: usize, geometry: &Geometry) -> Field {
        let (Some(dome), Some(sky)) = (&geometry.dome, self.sky.get(leaf)) else { return self.lit[leaf] };
        let of_sky = dome.field(sky);
        from_fn(|k| from_fn(|band| self.lit[leaf][k][band] - of_sky[k][band]))
    }
}

impl<const C: usize> Light<C> {
    /// A leaf's field without what lamps and the sky throw on it.
    pub(crate) fn without_lamps(&self, leaf: usize) -> Field<C> {
        let field = &self.field[leaf];
        match self.lit.get(leaf) {
            Some(lit) => from_fn(|k| from_fn(|c| field[k][c] - lit[k][c])),
            None => *field,
        }
    }
}
