//! Light by groups of emitters: a settled solve goes in, with the group that each emitting polygon belongs to; one column
//! of irradiance fields per group comes out. What columns are called, and how they are mixed, is left to others.
//!
//! Over links that stay, light is linear in what is emitted, save for choices that ask the light itself: slopes that are
//! flattened, means and intensities below nothing that are dropped, near sources that are looked at part by part. Here
//! every such choice is the one that the light of all groups together makes. So columns add up to that light, and any mix
//! of them is what the same links would give if the groups emitted that much.
//!
//! Columns travel side by side: a factor is found once and multiplied with the values of all groups. A channel is a band
//! of a group, `3 group + band`.

use crate::control::{Control, ELEMENT, LINK};
use crate::evaluate::Evaluator;
use crate::field::{to_corners, to_samples};
use crate::geometry::{Element, NONE};
use crate::leaves::{DEEPEST, is_smooth};
use crate::light::{Bands, Field, Light, limited, mean, quarter, quarter_of, rms};
use crate::link::{CLUSTER, Link, State};
use crate::rounds::Transport;
use crate::solve::{MOST_PASSES, MOST_SETTLES, PASS_SHARE, SETTLE_SHARE, Solved};
use glam::Vec3;
use isolux_simd::sphere::{clamped_cosine, evaluate};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;
use std::time::Instant;

/// Marks a polygon that emits nothing.
pub const NO_GROUP: u32 = u32::MAX;

/// What makes an end of a solve's columns before they are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Given {
    /// [`Control::stop`].
    Stop,
    /// They would take more memory than there may be.
    Memory,
    /// The time is over.
    Time,
}

/// Irradiance by group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Fields of the leaves, in ascending order of the leaves' numbers, by group: W/m² or lm/m² at the corners and the
    /// middle. Each group's values come from its own emission alone.
    pub fields: Vec<Vec<Field>>,
    /// Gathers over the links, and at the leaves' own points.
    pub passes: [u32; 2],
}

/// What columns may take.
#[derive(Clone, Copy, Debug, Default)]
pub struct Room {
    /// Bytes of memory, those of the solve included.
    pub memory: Option<u64>,
    /// When they have to be there.
    pub deadline: Option<Instant>,
}

/// How much more may be left before the first gather at the leaves, which changes more than that.
const ROUGH: f64 = 10.0;

/// What a field at the leaves' own points is, at most, of one gathered over links, when columns begin: only a first guess.
const MOST_RATIO: f32 = 4.0;

impl Solved {
    /// Bytes that elements, links and what stands beside them take.
    fn memory(&self) -> usize {
        self.transport.elements.len() * ELEMENT + (self.transport.links.len() + self.transport.dark.len()) * LINK
    }

    /// Columns of `groups` groups; `group_of`: by polygon, [`NO_GROUP`] where nothing is emitted.
    ///
    /// # Errors
    /// [`Given`]: why there are none.
    pub fn columns(
        &self,
        group_of: &[u32],
        groups: usize,
        error: f64,
        room: Room,
        control: &Control,
    ) -> Result<Columns, Given> {
        let leaves = self.transport.elements.iter().filter(|element| element.first_child == NONE).count();
        let elements = self.transport.elements.len();
        let wide = groups.min(BATCH) * 3;
        // Fields, corrections, radiosities and slopes by element and channel, twice where they are gathered anew; what
        // clusters send and receive; and the columns.
        let per_cluster = self.transport.clusters.nodes.len() * 2 * 9;
        let needed = 4 * (wide * (elements * 18 + per_cluster) + groups * leaves * 15);
        if room.memory.is_some_and(|most| (self.memory() + needed) as u64 > most) {
            return Err(Given::Memory);
        }
        let frame = Frame::new(&self.transport, &self.light, self.limit);
        let watch = Watch { control, deadline: room.deadline };
        let mut columns = Columns::default();
        let all: Vec<usize> = (0..groups).collect();
        for batch in all.chunks(BATCH) {
            let range = batch[0]..batch[0] + batch.len();
            let part = match batch.len() {
                0..=2 => frame.solve::<6>(group_of, range, error, &watch),
                3 => frame.solve::<9>(group_of, range, error, &watch),
                4..=5 => frame.solve::<15>(group_of, range, error, &watch),
                6..=8 => frame.solve::<24>(group_of, range, error, &watch),
                _ => frame.solve::<48>(group_of, range, error, &watch),
            }?;
            columns.fields.extend(part.fields);
            columns.passes = [0, 1].map(|kind| columns.passes[kind] + part.passes[kind]);
        }
        Ok(columns)
    }
}

/// Groups that travel side by side at most.
const BATCH: usize = 16;

struct Watch<'a> {
    control: &'a Control,
    deadline: Option<Instant>,
}

impl Watch<'_> {
    fn look(&self) -> Result<(), Given> {
        if self.control.is_stopped() {
            Err(Given::Stop)
        } else if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            Err(Given::Time)
        } else {
            Ok(())
        }
    }
}

/// A linear map of five values to five.
type Map = [[f32; 5]; 5];

/// One value per channel.
type Lane<const C: usize> = [f32; C];

/// A field by channel.
type Wide<const C: usize> = [[f32; C]; 5];

fn map_of(of: impl Fn(&[f32; 5]) -> [f32; 5]) -> Map {
    let columns: [[f32; 5]; 5] = std::array::from_fn(|j| of(&std::array::from_fn(|k| if k == j { 1.0 } else { 0.0 })));
    std::array::from_fn(|k| std::array::from_fn(|j| columns[j][k]))
}

#[inline(always)]
fn mapped<const C: usize>(map: &Map, field: &Wide<C>) -> Wide<C> {
    let mut result = [[0.0; C]; 5];
    for k in 0..5 {
        for j in 0..5 {
            add(&mut result[k], map[k][j], &field[j]);
        }
    }
    result
}

/// Adds `factor` times `lane` to a sum.
#[inline(always)]
fn add<const C: usize>(sum: &mut Lane<C>, factor: f32, lane: &Lane<C>) {
    for c in 0..C {
        sum[c] += factor * lane[c];
    }
}

/// One value per band for all groups.
#[inline(always)]
fn spread<const C: usize>(bands: Bands) -> Lane<C> {
    std::array::from_fn(|c| bands[c % 3])
}

/// 1 where a band is wanted, 0 where it is dropped.
fn kept(is_kept: impl Fn(usize) -> bool) -> Bands {
    std::array::from_fn(|band| if is_kept(band) { 1.0 } else { 0.0 })
}

/// The maps of fields on elements of so many corners.
struct Maps {
    corners: Map,
    samples: Map,
    quarters: [Map; 4],
    mean: [f32; 5],
}

impl Maps {
    fn of(count: u8) -> Maps {
        let unit = |k: usize| -> Field { std::array::from_fn(|j| [if j == k { 1.0 } else { 0.0 }; 3]) };
        Maps {
            corners: map_of(|values| to_corners(values, count)),
            samples: map_of(|values| to_samples(values, count)),
            quarters: std::array::from_fn(|quadrant| map_of(|values| quarter_of(values, count, quadrant))),
            mean: std::array::from_fn(|k| mean(&unit(k), count)[0]),
        }
    }
}

/// What all columns share: the links, and the choices of the light of all groups.
///
/// Values are kept by slot: elements by level, those of a level in ascending order of their numbers. Roots keep their
/// numbers; quarters of one element stay side by side, a level below it.
struct Frame<'a> {
    evaluator: Evaluator<'a>,
    links: &'a [Link],
    light: &'a Light,
    limit: f32,
    element_of: Vec<u32>,
    slot_of: Vec<u32>,
    levels: Vec<Range<usize>>,
    /// Links that an element receives by, by slot; then those of clusters.
    rows: Vec<Range<u32>>,
    cluster_rows: Vec<Range<u32>>,
    /// The cluster of no clusters that holds a polygon.
    cluster_of: Vec<u32>,
    triangle: Maps,
    quadrilateral: Maps,
    /// By slot: what is left of a slope.
    flattened: Vec<Bands>,
    /// By slot: does a leaf's mean count?
    lit: Vec<Bands>,
    /// By polygon: does what clusters send it count?
    taken: Vec<Bands>,
}

/// Values of some columns, by slot, and by cluster.
struct Values<const C: usize> {
    emission: Vec<Lane<C>>,
    radiosity: Vec<Lane<C>>,
    slope: Vec<[Lane<C>; 2]>,
    field: Vec<Wide<C>>,
    intensity: Vec<[Lane<C>; 9]>,
}

/// What leaves have beyond what is gathered over links.
enum Beyond<const C: usize> {
    /// A share of it, the same for all groups.
    Ratio(Vec<Field>),
    /// By channel.
    Found(Vec<Wide<C>>),
}

impl<'a> Frame<'a> {
    fn new(transport: &'a Transport, light: &'a Light, limit: f32) -> Frame<'a> {
        let evaluator = transport.evaluator();
        let (elements, clusters) = (evaluator.elements, evaluator.clusters);
        let mut element_of: Vec<u32> = (0..elements.len() as u32).collect();
        element_of.sort_by_key(|&index| elements[index as usize].path.depth());
        let mut slot_of = vec![0; elements.len()];
        element_of.iter().enumerate().for_each(|(slot, &index)| slot_of[index as usize] = slot as u32);
        let mut levels: Vec<Range<usize>> = Vec::new();
        for level in
            element_of.chunk_by(|&a, &b| elements[a as usize].path.depth() == elements[b as usize].path.depth())
        {
            let start = levels.last().map_or(0, |level| level.end);
            levels.push(start..start + level.len());
        }
        let mut rows = vec![0..0; elements.len()];
        let mut cluster_rows = vec![0..0; clusters.nodes.len()];
        let mut start = 0;
        for row in transport.links.chunk_by(|a, b| a.receiver == b.receiver) {
            let receiver = row[0].receiver;
            let range = start..start + row.len() as u32;
            start = range.end;
            if receiver & CLUSTER != 0 {
                cluster_rows[(receiver & !CLUSTER) as usize] = range;
            } else {
                rows[slot_of[receiver as usize] as usize] = range;
            }
        }
        let cluster_of = clusters.home.clone();
        let polygons = cluster_of.len();
        let mut frame = Frame {
            evaluator,
            links: &transport.links,
            light,
            limit,
            levels,
            rows,
            cluster_rows,
            cluster_of,
            triangle: Maps::of(3),
            quadrilateral: Maps::of(4),
            flattened: vec![[1.0; 3]; slot_of.len()],
            lit: vec![[1.0; 3]; slot_of.len()],
            taken: vec![[1.0; 3]; polygons],
            element_of,
            slot_of,
        };
        frame.choose();
        frame
    }

    /// Takes the choices from the light of all groups.
    fn choose(&mut self) {
        for slot in 0..self.lit.len() {
            let index = self.element_of[slot] as usize;
            let element = &self.evaluator.elements[index];
            if element.first_child == NONE {
                let mean = mean(&self.light.field[index], element.count);
                self.lit[slot] = kept(|band| mean[band] >= 0.0);
            }
        }
        let emission: Vec<Bands> = self.evaluator.geometry.surfaces.iter().map(|surface| surface.emission).collect();
        let mut all = self.values::<3>(emission);
        all.field = self.element_of.iter().map(|&index| self.light.field[index as usize]).collect();
        // Of the light itself, with slopes as they are.
        self.pull(&mut all);
        self.flattened = (0..self.slot_of.len())
            .map(|slot| {
                let count = self.evaluator.elements[self.element_of[slot] as usize].count;
                let slope = all.slope[slot];
                let left = limited(slope, all.radiosity[slot], count);
                std::array::from_fn(|band| {
                    let along = if slope[0][band].abs() >= slope[1][band].abs() { 0 } else { 1 };
                    if slope[along][band] == 0.0 { 1.0 } else { left[along][band] / slope[along][band] }
                })
            })
            .collect();
        self.pull(&mut all);
        let mut sent = vec![[[0.0; 3]; 5]; self.taken.len()];
        self.send(&all, &mut sent);
        self.taken = sent.iter().map(|field| kept(|band| field[0][band] >= 0.0)).collect();
    }

    fn values<const C: usize>(&self, emission: Vec<Lane<C>>) -> Values<C> {
        let count = self.slot_of.len();
        Values {
            emission,
            radiosity: vec![[0.0; C]; count],
            slope: vec![[[0.0; C]; 2]; count],
            field: vec![[[0.0; C]; 5]; count],
            intensity: vec![[[0.0; C]; 9]; self.cluster_rows.len()],
        }
    }

    fn maps(&self, element: &Element) -> &Maps {
        if element.count == 4 { &self.quadrilateral } else { &self.triangle }
    }

    fn at(&self, slot: usize) -> &Element {
        &self.evaluator.elements[self.element_of[slot] as usize]
    }

    /// Columns of a range of groups, as many as `C` has room for.
    fn solve<const C: usize>(
        &self,
        group_of: &[u32],
        groups: Range<usize>,
        error: f64,
        watch: &Watch<'_>,
    ) -> Result<Columns, Given> {
        let surfaces = &self.evaluator.geometry.surfaces;
        let is_own = |polygon: usize, group: usize| group_of[polygon] as usize == group;
        let own = |polygon: usize, c: usize| {
            if is_own(polygon, groups.start + c / 3) { surfaces[polygon].emission[c % 3] } else { 0.0 }
        };
        let emission: Vec<Lane<C>> =
            (0..surfaces.len()).map(|polygon| std::array::from_fn(|c| own(polygon, c))).collect();
        let mut values = self.values(emission);
        self.guess(&mut values);
        let mut beyond = Beyond::Ratio(self.ratios());
        let (mut passes, mut last, mut precise) = ([0; 2], f64::INFINITY, ROUGH * PASS_SHARE * error);
        loop {
            passes[0] += self.converge(&mut values, &beyond, groups.len(), precise, watch)?;
            precise = PASS_SHARE * error;
            let before = values.radiosity.clone();
            let leaves = self.gather_leaves(&values);
            watch.look()?;
            let mut found = vec![[[0.0; C]; 5]; self.slot_of.len()];
            let mut field = self.pass(&values);
            for (slot, leaf) in leaves {
                let slot = slot as usize;
                for k in 0..5 {
                    for c in 0..C {
                        found[slot][k][c] = leaf[k][c] - field[slot][k][c];
                    }
                }
                field[slot] = leaf;
            }
            values.field = field;
            beyond = Beyond::Found(found);
            self.pull(&mut values);
            passes[1] += 1;
            let change = self.change(&values, &before, groups.len());
            let ratio = if last.is_finite() { (change / last).min(0.9) } else { 0.5 };
            if passes[1] >= MOST_SETTLES || change * ratio / (1.0 - ratio) < SETTLE_SHARE * error {
                break;
            }
            last = change;
            watch.look()?;
        }
        let leaves: Vec<u32> = (0..self.slot_of.len())
            .filter(|&index| self.evaluator.elements[index].first_child == NONE)
            .map(|index| self.slot_of[index])
            .collect();
        let fields = (0..groups.len()).map(|group| {
            let part = |lane: &Lane<C>| -> Bands { std::array::from_fn(|band| lane[3 * group + band]) };
            leaves.iter().map(|&slot| values.field[slot as usize].each_ref().map(part)).collect()
        });
        Ok(Columns { fields: fields.collect(), passes })
    }

    /// Begins with each group's share of the light, by its share of what is emitted: that adds up to what the columns will
    /// add up to.
    fn guess<const C: usize>(&self, values: &mut Values<C>) {
        let surfaces = &self.evaluator.geometry.surfaces;
        let (mut power, mut all) = ([0.0_f64; C], [0.0_f64; 3]);
        for (polygon, own) in values.emission.iter().enumerate() {
            let area = f64::from(self.evaluator.elements[polygon].area);
            (0..C).for_each(|c| power[c] += area * f64::from(own[c]));
            (0..3).for_each(|band| all[band] += area * f64::from(surfaces[polygon].emission[band]));
        }
        let share: Lane<C> =
            std::array::from_fn(|c| if all[c % 3] > 0.0 { (power[c] / all[c % 3]) as f32 } else { 0.0 });
        for slot in 0..values.field.len() {
            let field = &self.light.field[self.element_of[slot] as usize];
            values.field[slot] = field.map(|at| std::array::from_fn(|c| share[c] * at[c % 3]));
        }
        self.pull(values);
    }

    /// What leaves have of what is gathered over links, of the light of all groups.
    fn ratios(&self) -> Vec<Field> {
        let ratio = |all: f32, beyond: f32| {
            let gathered = all - beyond;
            if gathered > 0.0 { (all / gathered).clamp(0.0, MOST_RATIO) } else { 1.0 }
        };
        let of = |&index: &u32| -> Field {
            let (field, beyond) = (&self.light.field[index as usize], &self.light.correction[index as usize]);
            std::array::from_fn(|k| std::array::from_fn(|band| ratio(field[k][band], beyond[k][band])))
        };
        self.element_of.iter().map(of).collect()
    }

    /// Gathers over links until what further passes would change is below `error` of what each group's light is reflected;
    /// returns their number.
    fn converge<const C: usize>(
        &self,
        values: &mut Values<C>,
        beyond: &Beyond<C>,
        groups: usize,
        error: f64,
        watch: &Watch<'_>,
    ) -> Result<u32, Given> {
        let mut before = self.reflected(values, groups);
        let mut last = vec![f64::INFINITY; groups];
        for pass in 1..=MOST_PASSES {
            watch.look()?;
            let mut field = self.pass(values);
            field.par_iter_mut().enumerate().with_min_len(256).for_each(|(slot, field)| {
                if self.at(slot).first_child != NONE {
                    return;
                }
                for k in 0..5 {
                    match beyond {
                        Beyond::Ratio(ratios) => (0..C).for_each(|c| field[k][c] *= ratios[slot][k][c % 3]),
                        Beyond::Found(found) => add(&mut field[k], 1.0, &found[slot][k]),
                    }
                }
            });
            values.field = field;
            self.pull(values);
            let now = self.reflected(values, groups);
            let is_done = (0..groups).all(|group| {
                let change = (now[group] - before[group]).abs();
                let is_known = last[group].is_finite() && last[group] > 0.0;
                let ratio = if is_known { (change / last[group]).min(0.99) } else { 0.9 };
                change == 0.0 || change * ratio / (1.0 - ratio) <= error * now[group].abs()
            });
            if is_done && pass > 2 {
                return Ok(pass);
            }
            for group in 0..groups {
                last[group] = (now[group] - before[group]).abs();
            }
            before = now;
        }
        Ok(MOST_PASSES)
    }

    /// What all polygons reflect of each group's light, summed over bands.
    fn reflected<const C: usize>(&self, values: &Values<C>, groups: usize) -> Vec<f64> {
        let mut sums = vec![0.0; groups];
        for (polygon, own) in values.emission.iter().enumerate() {
            let area = f64::from(self.evaluator.elements[polygon].area);
            for c in 0..3 * groups {
                sums[c / 3] += area * f64::from(values.radiosity[polygon][c] - own[c]);
            }
        }
        sums
    }

    /// The largest change of a group's radiosity on leaves, RMS over places and bands, relative to the mean that the group's
    /// light is reflected with.
    fn change<const C: usize>(&self, values: &Values<C>, before: &[Lane<C>], groups: usize) -> f64 {
        let (mut squares, mut sums, mut whole) = (vec![0.0; groups], vec![0.0; groups], 0.0);
        for slot in 0..before.len() {
            let element = self.at(slot);
            if element.first_child != NONE {
                continue;
            }
            let area = f64::from(element.area);
            whole += area;
            for group in 0..groups {
                let apart = |lane: &Lane<C>, other: &Lane<C>| -> Bands {
                    std::array::from_fn(|band| lane[3 * group + band] - other[3 * group + band])
                };
                let change = f64::from(rms(apart(&values.radiosity[slot], &before[slot])));
                squares[group] += area * change * change;
                let own = &values.emission[element.polygon as usize];
                sums[group] += area * f64::from(rms(apart(&values.radiosity[slot], own)));
            }
        }
        let relative = |group: usize| {
            if sums[group] > 0.0 { (squares[group] / whole).sqrt() / (sums[group] / whole) } else { 0.0 }
        };
        (0..groups).map(relative).fold(0.0, f64::max)
    }

    /// What a link's factors are multiplied with; see [`Light::value`].
    #[inline(always)]
    fn value<const C: usize>(&self, values: &Values<C>, link: &Link) -> Lane<C> {
        if link.source & CLUSTER == 0 {
            let triangle = self.evaluator.elements[link.source as usize].count == 3;
            let middle = if triangle { 1.0 / 3.0 } else { 0.5 };
            let slot = self.slot_of[link.source as usize] as usize;
            let [s, t] = link.state.centre();
            let mut value = values.radiosity[slot];
            add(&mut value, s - middle, &values.slope[slot][0]);
            add(&mut value, t - middle, &values.slope[slot][1]);
            return value;
        }
        let index = (link.source & !CLUSTER) as usize;
        let (from, _) = self.evaluator.ball(link.source);
        let towards = self.evaluator.ball(link.receiver).0 - from;
        let harmonics = evaluate(towards.normalize_or(Vec3::X).to_array());
        let all = &self.light.intensity[index];
        let taken: Lane<C> = spread(kept(|band| (0..9).map(|k| harmonics[k] * all[k][band]).sum::<f32>() > 0.0));
        let mut value = [0.0; C];
        (0..9).for_each(|k| add(&mut value, harmonics[k], &values.intensity[index][k]));
        std::array::from_fn(|c| value[c] * taken[c])
    }

    fn row(&self, range: &Range<u32>) -> &[Link] {
        &self.links[range.start as usize..range.end as usize]
    }

    /// What is gathered over links, pushed to the leaves; by slot.
    fn pass<const C: usize>(&self, values: &Values<C>) -> Vec<Wide<C>> {
        let mut field: Vec<Wide<C>> = self
            .rows
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .map(|(slot, row)| {
                if row.is_empty() {
                    return [[0.0; C]; 5];
                }
                let mut sum = [[0.0; C]; 5];
                for link in self.row(row) {
                    let value = self.value(values, link);
                    (0..5).for_each(|k| add(&mut sum[k], link.factors[k], &value));
                }
                mapped(&self.maps(self.at(slot)).corners, &sum)
            })
            .collect();
        self.send(values, &mut field);
        for level in self.levels.iter().skip(1) {
            let (above, below) = field.split_at_mut(level.start);
            let own = &mut below[..level.len()];
            own.par_chunks_mut(4).enumerate().with_min_len(64).for_each(|(index, quarters)| {
                let first = self.at(level.start + 4 * index);
                let parent = &above[self.slot_of[first.parent as usize] as usize];
                for (quadrant, child) in quarters.iter_mut().enumerate() {
                    let part = mapped(&self.maps(first).quarters[quadrant], parent);
                    (0..5).for_each(|k| add(&mut child[k], 1.0, &part[k]));
                }
            });
        }
        field
    }

    /// Adds what clusters receive to the fields of their polygons, which come first in `field`.
    fn send<const C: usize>(&self, values: &Values<C>, field: &mut [Wide<C>]) {
        let clusters = self.evaluator.clusters;
        let mut arriving: Vec<[Lane<C>; 9]> = self
            .cluster_rows
            .par_iter()
            .with_min_len(64)
            .map(|row| {
                let mut sum = [[0.0; C]; 9];
                for link in self.row(row) {
                    let value = self.value(values, link);
                    let towards = self.evaluator.ball(link.source).0 - self.evaluator.ball(link.receiver).0;
                    let harmonics = evaluate(towards.normalize_or(Vec3::X).to_array());
                    (0..9).for_each(|k| add(&mut sum[k], link.factors[0] * harmonics[k], &value));
                }
                sum
            })
            .collect();
        for index in 1..arriving.len() {
            let (above, own) = arriving.split_at_mut(index);
            let parent = &above[clusters.nodes[index].parent as usize];
            (0..9).for_each(|k| add(&mut own[0][k], 1.0, &parent[k]));
        }
        let polygons = self.cluster_of.len();
        field[..polygons].par_iter_mut().enumerate().with_min_len(256).for_each(|(polygon, field)| {
            let cluster = self.cluster_of[polygon];
            if cluster == NONE {
                return;
            }
            let cosine = clamped_cosine(self.evaluator.geometry.surfaces[polygon].normal.to_array());
            let taken: Lane<C> = spread(self.taken[polygon]);
            let mut here = [0.0; C];
            (0..9).for_each(|k| add(&mut here, cosine[k], &arriving[cluster as usize][k]));
            (0..C).for_each(|c| here[c] *= taken[c]);
            field.iter_mut().for_each(|value| add(value, 1.0, &here));
        });
    }

    /// Radiosity of leaves from their fields, of all above from their parts; see [`Light::pull`].
    fn pull<const C: usize>(&self, values: &mut Values<C>) {
        let surfaces = &self.evaluator.geometry.surfaces;
        let Values { emission, radiosity, slope, field, intensity } = values;
        for level in self.levels.iter().rev() {
            let (own, below) = radiosity[level.start..].split_at_mut(level.len());
            let below: &[Lane<C>] = below;
            own.par_iter_mut()
                .zip(&mut slope[level.clone()])
                .zip(&mut field[level.clone()])
                .enumerate()
                .with_min_len(256)
                .for_each(|(index, ((radiosity, slope), field))| {
                    let slot = level.start + index;
                    let element = self.at(slot);
                    let is_quadrilateral = element.count == 4;
                    if element.first_child == NONE {
                        if element.open == 0 {
                            *field = [[0.0; C]; 5];
                        }
                        let rho: Lane<C> = spread(surfaces[element.polygon as usize].reflectance);
                        let lit: Lane<C> = spread(self.lit[slot]);
                        let mut mean = [0.0; C];
                        (0..5).for_each(|k| add(&mut mean, self.maps(element).mean[k], &field[k]));
                        let own = &emission[element.polygon as usize];
                        for c in 0..C {
                            radiosity[c] = own[c] + rho[c] * (mean[c] * lit[c]);
                            let at = |k: usize| rho[c] * field[k][c];
                            (slope[0][c], slope[1][c]) = if is_quadrilateral {
                                (0.5 * (at(1) + at(2) - at(0) - at(3)), 0.5 * (at(2) + at(3) - at(0) - at(1)))
                            } else {
                                (at(1) - at(0), at(2) - at(0))
                            };
                        }
                    } else {
                        let first = element.first_child as usize;
                        let from = self.slot_of[first] as usize - level.end;
                        let quarters = &below[from..from + 4];
                        let elements = &self.evaluator.elements[first..first + 4];
                        let shares = self.shares(first, elements);
                        *radiosity = [0.0; C];
                        (0..4).for_each(|k| add(radiosity, shares[k], &quarters[k]));
                        for c in 0..C {
                            let at = |k: usize| quarters[k][c];
                            (slope[0][c], slope[1][c]) = if is_quadrilateral {
                                (at(1) + at(2) - at(0) - at(3), at(2) + at(3) - at(0) - at(1))
                            } else {
                                (2.0 * (at(1) - at(0)), 2.0 * (at(2) - at(0)))
                            };
                        }
                    }
                    let left: Lane<C> = spread(self.flattened[slot]);
                    slope.iter_mut().for_each(|slope| (0..C).for_each(|c| slope[c] *= left[c]));
                });
        }
        let clusters = self.evaluator.clusters;
        let radiosity: &[Lane<C>] = radiosity;
        intensity.par_iter_mut().enumerate().with_min_len(64).for_each(|(index, sum)| {
            *sum = [[0.0; C]; 9];
            if clusters.nodes[index].second != 0 {
                return;
            }
            for &polygon in clusters.members(index as u32) {
                let polygon = polygon as usize;
                let area = self.evaluator.geometry.counted_area(&self.evaluator.elements[polygon]);
                let cosine = clamped_cosine(surfaces[polygon].normal.to_array());
                (0..9).for_each(|k| add(&mut sum[k], cosine[k] * area * FRAC_1_PI, &radiosity[polygon]));
            }
        });
        for index in (0..intensity.len()).rev().filter(|&index| clusters.nodes[index].second != 0) {
            let (own, below) = intensity.split_at_mut(index + 1);
            for child in [0, clusters.nodes[index].second as usize - index - 1] {
                (0..9).for_each(|k| add(&mut own[index][k], 1.0, &below[child][k]));
            }
        }
    }

    /// Shares of the quarters in the mean of what is open; of what is covered all of it.
    fn shares(&self, first: usize, quarters: &[Element]) -> [f32; 4] {
        let whole: f32 = quarters.iter().map(|quarter| quarter.area).sum();
        let of = |k: usize| quarters[k].area * self.light.open[first + k];
        let open: f32 = (0..4).map(of).sum();
        std::array::from_fn(|k| if open > 0.0 { of(k) / open } else { quarters[k].area / whole })
    }

    /// What leaves receive at their own points, by slot; see [`crate::leaves`].
    fn gather_leaves<const C: usize>(&self, values: &Values<C>) -> Vec<(u32, Wide<C>)> {
        let polygons = self.cluster_of.len();
        let mut base = vec![[[0.0; C]; 5]; polygons];
        self.send(values, &mut base);
        let mut receives = vec![false; polygons];
        for (slot, _) in self.rows.iter().enumerate().filter(|(_, row)| !row.is_empty()) {
            receives[self.at(slot).polygon as usize] = true;
        }
        let receivers: Vec<u32> = (0..polygons as u32).filter(|&polygon| receives[polygon as usize]).collect();
        let parts: Vec<Vec<(u32, Wide<C>)>> = receivers
            .par_iter()
            .map(|&polygon| {
                let mut descent =
                    Descent { frame: self, values, seen: Vec::new(), lanes: Vec::new(), leaves: Vec::new() };
                descent.descend(polygon, base[polygon as usize]);
                descent.leaves
            })
            .collect();
        parts.concat()
    }
}

/// An element as the source of a leaf, with the visibility at the points of the node at hand.
#[derive(Clone, Copy)]
struct Seen {
    source: u32,
    at: [f32; 5],
    whole: bool,
}

/// The way from a polygon to its leaves.
struct Descent<'a, const C: usize> {
    frame: &'a Frame<'a>,
    values: &'a Values<C>,
    seen: Vec<Seen>,
    /// What the factors of each source are multiplied with.
    lanes: Vec<Lane<C>>,
    leaves: Vec<(u32, Wide<C>)>,
}

impl<const C: usize> Descent<'_, C> {
    fn descend(&mut self, node: u32, mut field: Wide<C>) {
        let frame = self.frame;
        let evaluator = &frame.evaluator;
        let element = &evaluator.elements[node as usize];
        let before = self.seen.len();
        let slot = frame.slot_of[node as usize];
        for link in frame.row(&frame.rows[slot as usize]) {
            let value = frame.value(self.values, link);
            if link.source & CLUSTER != 0 || is_smooth(link, element, frame.limit, frame.light, evaluator) {
                let factors = to_corners(&link.factors, element.count);
                (0..5).for_each(|k| add(&mut field[k], factors[k], &value));
                continue;
            }
            let whole = is_whole(link.state);
            let mut at = [1.0; 5];
            if !whole {
                let (open, _) = evaluator.exchange(element, &evaluator.elements[link.source as usize]);
                let mean = f32::from(link.state.visibility) / 255.0;
                at = std::array::from_fn(|k| if open[k] > 0.0 { (link.factors[k] / open[k]).min(1.0) } else { mean });
            }
            self.seen.push(Seen { source: link.source, at, whole });
            self.lanes.push(value);
        }
        if element.first_child == NONE {
            let mut samples = [[0.0; C]; 5];
            for (entry, value) in self.seen.iter().zip(&self.lanes) {
                self.add(&mut samples, element, entry, value);
            }
            let own = mapped(&frame.maps(element).corners, &samples);
            (0..5).for_each(|k| add(&mut field[k], 1.0, &own[k]));
            self.leaves.push((slot, field));
        } else {
            let here = self.seen.clone();
            for quadrant in 0..4 {
                for (entry, above) in self.seen.iter_mut().zip(&here).filter(|(_, above)| !above.whole) {
                    entry.at = quarter_of(&above.at, element.count, quadrant).map(|at| at.clamp(0.0, 1.0));
                }
                let part = mapped(&frame.maps(element).quarters[quadrant], &field);
                self.descend(element.first_child + quadrant as u32, part);
                self.seen.copy_from_slice(&here);
            }
        }
        self.seen.truncate(before);
        self.lanes.truncate(before);
    }

    /// Adds what a source throws on a leaf, part by part where all groups' light makes it uneven.
    fn add(&self, field: &mut Wide<C>, leaf: &Element, entry: &Seen, value: &Lane<C>) {
        let frame = self.frame;
        let source = &frame.evaluator.elements[entry.source as usize];
        let factors = frame.evaluator.factors(leaf, source);
        let deviation = frame.light.deviation[entry.source as usize];
        if entry.whole && self.is_uneven(leaf, source, &factors, deviation) {
            if source.first_child == NONE {
                let surface = &frame.evaluator.geometry.surfaces[source.polygon as usize];
                let (emission, rho) = (surface.emission, surface.reflectance);
                let all = frame.light.field[entry.source as usize]
                    .map(|at| std::array::from_fn(|band| emission[band] + rho[band] * at[band]));
                let rho: Lane<C> = spread(rho);
                let own = &self.values.emission[source.polygon as usize];
                let parts = self.values.field[frame.slot_of[entry.source as usize] as usize]
                    .each_ref()
                    .map(|at| std::array::from_fn(|c| own[c] + rho[c] * at[c]));
                self.add_parts(field, leaf, source, &all, &parts, DEEPEST);
            } else {
                for child in source.first_child..source.first_child + 4 {
                    let value = &self.values.radiosity[frame.slot_of[child as usize] as usize];
                    self.add(field, leaf, &Seen { source: child, ..*entry }, value);
                }
            }
            return;
        }
        let at = if entry.whole { entry.at } else { self.samples(leaf, &entry.at) };
        (0..5).for_each(|k| add(&mut field[k], factors[k] * at[k], value));
    }

    fn samples(&self, leaf: &Element, at: &[f32; 5]) -> [f32; 5] {
        let map = &self.frame.maps(leaf).samples;
        std::array::from_fn(|k| (0..5).map(|j| map[k][j] * at[j]).sum())
    }

    /// Do the leaf's points see a difference within the source, in all groups' light?
    fn is_uneven(&self, leaf: &Element, source: &Element, factors: &[f32; 5], deviation: [f32; 2]) -> bool {
        let most = factors.iter().fold(0.0_f32, |most, &factor| most.max(factor)) * (deviation[0] + deviation[1]);
        let reach = 2.0 * (leaf.radius() + source.radius());
        leaf.area * most * most > self.frame.limit && leaf.centre().distance_squared(source.centre()) < reach * reach
    }

    /// Adds the quarters of a source that has none, with what its field says of them. `all`: radiosity of all groups.
    fn add_parts(
        &self,
        field: &mut Wide<C>,
        leaf: &Element,
        source: &Element,
        all: &Field,
        radiosity: &Wide<C>,
        depth: u32,
    ) {
        let maps = self.frame.maps(source);
        for (quadrant, part) in source.quarters(0).iter().enumerate() {
            let whole = quarter(all, source.count, quadrant);
            let middle = mean(&whole, source.count);
            let own = mapped(&maps.quarters[quadrant], radiosity);
            let factors = self.frame.evaluator.factors(leaf, part);
            let square = (0..part.count as usize)
                .map(|k| rms(std::array::from_fn(|band| whole[k][band] - middle[band])))
                .map(|apart| apart * apart)
                .sum::<f32>();
            let deviation = [(square / (3 * part.count) as f32).sqrt(), 0.0];
            if depth > 1 && self.is_uneven(leaf, part, &factors, deviation) {
                self.add_parts(field, leaf, part, &whole, &own, depth - 1);
                continue;
            }
            let taken: Lane<C> = spread(kept(|band| middle[band] > 0.0));
            let mut value = [0.0; C];
            (0..5).for_each(|k| add(&mut value, maps.mean[k], &own[k]));
            (0..C).for_each(|c| value[c] *= taken[c]);
            (0..5).for_each(|k| add(&mut field[k], factors[k], &value));
        }
    }
}

/// Is all of the source seen, by all of the receiver's points?
pub(crate) fn is_whole(state: State) -> bool {
    state.is(State::CLEAR) || state.visibility == 255 && state.spread == 0
}
