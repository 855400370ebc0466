//! Light by groups of emitters: a settled solve goes in, with the group that each emitting polygon belongs to; one column
//! of irradiance fields per group comes out. What columns are called, and how they are mixed, is left to others.
//!
//! Groups are channels beside those of all light, gathered as that is ([`crate::light`]), by the same rules of when it is
//! enough. All light goes along, since every choice is its own: so any mix of columns is what the same links would give if
//! the groups emitted that much.

use crate::check::{PointErrors, check_groups};
use crate::control::Control;
use crate::geometry::NONE;
use crate::lamps::{ALL_ONLY, lit_leaves};
use crate::light::{Field, Light, bands, mean_over};
use crate::solve::{Before, Solved, settle};
use rayon::prelude::*;
use std::ops::Range;

/// Marks a polygon that emits nothing.
pub const NO_GROUP: u32 = u32::MAX;

/// Irradiance by group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Fields of the leaves, in ascending order of the leaves' numbers, by group: W/m² or lm/m² at the corners and the
    /// middle. Each group's values come from its own emission alone, but for what gathers leave over: see
    /// [`Solved::columns`].
    pub fields: Vec<Vec<Field>>,
    /// RMS of what was missing to the light before it was added, over leaves by area, relative to its mean.
    pub apart: f64,
}

/// Groups that travel side by side at most.
const SIDE_BY_SIDE: usize = 15;

impl Solved {
    /// Columns of `groups` groups; `group_of`: by polygon, then by lamp, then the sky's if there is one, [`NO_GROUP`] where nothing is emitted. They add up to the light
    /// that is there, to rounding: what the last gathers leave between both, a share of `error`, goes at each place to
    /// the group that gives most there. None where `control` says stop.
    #[must_use]
    pub fn columns(&self, group_of: &[u32], groups: usize, error: f64, control: &Control) -> Option<Columns> {
        let mut columns = Columns::default();
        let all: Vec<usize> = (0..groups).collect();
        for batch in all.chunks(SIDE_BY_SIDE) {
            if control.is_stopped() {
                return None;
            }
            let range = batch[0]..batch[0] + batch.len();
            // Three channels for all light, three for each group.
            columns.fields.extend(match batch.len() {
                0..=3 => self.gathered::<12>(group_of, range, error, control),
                4..=5 => self.gathered::<18>(group_of, range, error, control),
                6..=8 => self.gathered::<27>(group_of, range, error, control),
                _ => self.gathered::<48>(group_of, range, error, control),
            });
        }
        if control.is_stopped() {
            return None;
        }
        columns.apart = self.add_rest(&mut columns.fields);
        (!control.is_stopped()).then_some(columns)
    }

    /// How wrong columns that add up to the light are, by rays that know nothing of links, as many as ask for an `error`. None
    /// where `control` says stop. The same rays, whoever made the columns and on however many threads.
    #[must_use]
    pub fn check_columns(
        &self,
        columns: &[Vec<Field>],
        group_of: &[u32],
        error: f64,
        seed: u64,
        control: &Control,
    ) -> Option<PointErrors> {
        check_groups(&self.transport, &self.light, columns, group_of, error, seed, control)
    }

    /// Columns of a range of groups, as many as `C` has room for, and the numbers of gathers.
    fn gathered<const C: usize>(
        &self,
        group_of: &[u32],
        groups: Range<usize>,
        error: f64,
        control: &Control,
    ) -> Vec<Vec<Field>> {
        let Solved { transport, geometry, .. } = self;
        // By channel, what of each polygon's emission is its own.
        let own = |polygon: usize, c: usize| -> f32 {
            let is_own = c < 3 || group_of[polygon] as usize == groups.start + c / 3 - 1;
            if is_own { geometry.surfaces[polygon].emission[c % 3] } else { 0.0 }
        };
        let emission: Vec<[f32; C]> =
            (0..geometry.surfaces.len()).map(|polygon| std::array::from_fn(|c| own(polygon, c))).collect();
        let mut power = [0.0_f64; C];
        for (own, element) in emission.iter().zip(&transport.elements) {
            (0..C).for_each(|c| power[c] += f64::from(element.area * own[c]));
        }
        let lit = self.lit_by_groups::<C>(group_of, groups.clone());
        for (own, element) in lit.iter().zip(&transport.elements).filter(|(_, element)| element.first_child == NONE) {
            let arrives = mean_over(own, element);
            (0..C).for_each(|c| power[c] += f64::from(element.area * arrives[c]));
        }
        // Each begins with its share of all light, which adds up to that.
        let share: [f32; C] =
            std::array::from_fn(|c| if power[c % 3] > 0.0 { (power[c] / power[c % 3]) as f32 } else { 0.0 });
        let wide = |fields: &[Field]| -> Vec<Field<C>> {
            let of = |field: &Field| field.map(|at| std::array::from_fn(|c| share[c] * at[c % 3]));
            fields.par_iter().with_min_len(1024).map(of).collect()
        };
        let (field, correction) = (wide(&self.light.field), wide(&self.light.correction));
        let mut light = Light::of(emission, field, correction, &transport.clusters, &transport.elements);
        light.lit = lit;
        light.sloped = self.light.sloped;
        light.pull(geometry, &transport.clusters, &transport.elements, &transport.order);
        light.settle(&transport.links, self.limit, &transport.evaluator());
        // What each lamp throws is found at the leaves before shares of what is reflected go around.
        light.settle(&transport.links, self.limit, &transport.evaluator());
        settle(&mut light, transport, self.limit, geometry.scene.area(), error, Before::Unknown, control);
        let column = |group| {
            let leaves = light.field.iter().zip(&transport.elements).filter(|(_, element)| element.first_child == NONE);
            leaves.map(|(field, _)| field.each_ref().map(|at| bands(at, group))).collect()
        };
        (1..=groups.len()).map(column).collect()
    }

    /// What lamps and the sky throw on leaves, as channels of a range of groups; empty where there are none.
    fn lit_by_groups<const C: usize>(&self, group_of: &[u32], groups: Range<usize>) -> Vec<Field<C>> {
        let of_lamps = group_of.get(self.geometry.surfaces.len()..).unwrap_or_default();
        let channel = |&group: &u32| {
            let group = group as usize;
            if groups.contains(&group) { 3 * (group - groups.start + 1) } else { ALL_ONLY }
        };
        let channels: Vec<usize> = of_lamps.iter().map(channel).collect();
        let lamps = channels.len().min(self.geometry.scene.lamps.len());
        let mut lit = lit_leaves(&self.transport, &channels[..lamps]);
        let Some(dome) = &self.geometry.dome else { return lit };
        lit.resize(self.transport.elements.len(), [[0.0; C]; 5]);
        let leaves = lit.par_iter_mut().zip(&self.light.sky).zip(&self.transport.elements).with_min_len(1024);
        leaves.filter(|(_, element)| element.first_child == NONE).for_each(|((lit, sky), _)| {
            for (lit, &parts) in lit.iter_mut().zip(sky) {
                let all = dome.light(parts);
                (0..3).for_each(|band| lit[band] += all[band]);
                for (emitter, &own) in channels.iter().enumerate().filter(|(_, own)| **own != ALL_ONLY) {
                    let due = dome.light_of(emitter, parts);
                    (0..3).for_each(|band| lit[own + band] += due[band]);
                }
            }
        });
        lit
    }

    /// Adds what columns lack of the light, at each place to the one that has most there; RMS of it over leaves by area,
    /// relative to the light's mean.
    fn add_rest(&self, columns: &mut [Vec<Field>]) -> f64 {
        let leaves = self.light.field.iter().zip(&self.transport.elements);
        let leaves = leaves.filter(|(_, element)| element.first_child == NONE).enumerate();
        let mut order: Vec<usize> = (0..columns.len()).collect();
        let (mut square, mut whole, mut area_of_all) = (0.0, 0.0, 0.0);
        for (leaf, (all, element)) in leaves {
            let area = f64::from(element.area);
            for (k, band) in (0..15).map(|at| (at / 3, at % 3)) {
                let rest = |columns: &[Vec<Field>]| {
                    let sum: f64 = columns.iter().map(|column| f64::from(column[leaf][k][band])).sum();
                    // As long as the sum rounds to it, nothing is missing.
                    if sum as f32 == all[k][band] { 0.0 } else { f64::from(all[k][band]) - sum }
                };
                let first = rest(columns);
                square += area * first * first;
                whole += area * f64::from(all[k][band]);
                area_of_all += area;
                // What rounding leaves of it goes to the next.
                order.sort_by(|&one, &two| columns[two][leaf][k][band].total_cmp(&columns[one][leaf][k][band]));
                for &group in &order {
                    let rest = rest(columns);
                    if rest == 0.0 {
                        break;
                    }
                    let own = &mut columns[group][leaf][k][band];
                    *own = (f64::from(*own) + rest) as f32;
                }
            }
        }
        if whole > 0.0 { (square * area_of_all).sqrt() / whole } else { 0.0 }
    }
}
