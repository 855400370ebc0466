//! The last step of every gather: what leaves receive from the links of their own and of all above them, with form
//! factors taken anew at the leaves' own points.
//!
//! A link's factors, known at five points of a large receiver, are interpolated on the way down; beside a small source
//! they vary faster than that. All sources of a leaf together cover what it sees exactly once, so with factors at its own
//! points nothing is lost between them: in a closed room they add up to one at every point.

use crate::evaluate::Evaluator;
use crate::field::{to_corners, to_samples};
use crate::geometry::{Element, NONE};
use crate::light::{Bands, Field, Light, corners_of, level, quarter_of};
use crate::link::{CLUSTER, Link, State};
use rayon::prelude::*;

/// An element as the source of a leaf, with the visibility at the points of the node at hand.
#[derive(Clone, Copy)]
struct Seen {
    source: u32,
    value: Bands,
    at: [f32; 5],
    whole: bool,
}

/// Fields of all leaves of the polygons, by leaf; `base`: what clusters send to the polygons' roots.
pub(crate) fn gather(
    light: &Light,
    base: &[Field],
    links: &[Link],
    limit: f32,
    evaluator: &Evaluator<'_>,
) -> Vec<(u32, Field)> {
    let mut rows: Vec<(u32, u32, &[Link])> = links
        .chunk_by(|a, b| a.receiver == b.receiver)
        .filter(|row| row[0].receiver & CLUSTER == 0)
        .map(|row| (evaluator.elements[row[0].receiver as usize].polygon, row[0].receiver, row))
        .collect();
    rows.sort_by_key(|&(polygon, receiver, _)| (polygon, receiver));
    let polygons: Vec<&[(u32, u32, &[Link])]> = rows.chunk_by(|a, b| a.0 == b.0).collect();
    let parts: Vec<Vec<(u32, Field)>> = polygons
        .par_iter()
        .map(|rows| {
            let polygon = rows[0].0;
            let mut leaves = Vec::new();
            let descent = Descent { rows, limit, light, evaluator };
            descent.descend(polygon, base[polygon as usize], &mut Vec::new(), &mut leaves);
            leaves
        })
        .collect();
    parts.concat()
}

/// Most levels below a leaf's source that are looked at where a leaf touches it.
pub(crate) const DEEPEST: u32 = 4;

/// Adds what a source throws on a leaf: all of it at once where the source is even or far, part by part where a point at
/// one end of the leaf sees other parts of it than a point at the other.
fn add(field: &mut Field, entry: &Seen, near: &Near<'_>) {
    let Near { leaf, light, evaluator, .. } = *near;
    let source = &evaluator.elements[entry.source as usize];
    let factors = evaluator.factors(leaf, source);
    if entry.whole && near.is_uneven(source, &factors, light.deviation[entry.source as usize]) {
        if source.first_child == NONE {
            let surface = &evaluator.geometry.surfaces[source.polygon as usize];
            let radiosity = light.field[entry.source as usize]
                .map(|value| std::array::from_fn(|k| surface.emission[k] + surface.reflectance[k] * value[k]));
            near.add_parts(field, source, &radiosity, DEEPEST);
        } else {
            for child in source.first_child..source.first_child + 4 {
                let value = light.radiosity[child as usize];
                add(field, &Seen { source: child, value, ..*entry }, near);
            }
        }
        return;
    }
    let at = if entry.whole { entry.at } else { to_samples(&entry.at, leaf.count) };
    for k in 0..5 {
        let factor = factors[k] * at[k];
        for band in 0..3 {
            field[k][band] += factor * entry.value[band];
        }
    }
}

/// A leaf that looks at what is close to it.
#[derive(Clone, Copy)]
struct Near<'a> {
    leaf: &'a Element,
    limit: f32,
    light: &'a Light,
    evaluator: &'a Evaluator<'a>,
}

impl Near<'_> {
    /// Do the leaf's points see a difference within the source?
    fn is_uneven(&self, source: &Element, factors: &[f32; 5], deviation: [f32; 2]) -> bool {
        let most = factors.iter().fold(0.0_f32, |most, &factor| most.max(factor)) * (deviation[0] + deviation[1]);
        if self.leaf.area * most * most <= self.limit || !self.evaluator.ideas.parts_nearby {
            return false;
        }
        let reach = 2.0 * (self.leaf.radius() + source.radius());
        self.leaf.centre().distance_squared(source.centre()) < reach * reach
    }

    /// Adds the quarters of a source that has none, with what its field says of them.
    fn add_parts(&self, field: &mut Field, source: &Element, radiosity: &Field, depth: u32) {
        for (quadrant, part) in source.quarters(0).iter().enumerate() {
            let own = crate::light::quarter(radiosity, source.count, quadrant);
            let value = crate::light::mean(&own, source.count);
            let factors = self.evaluator.factors(self.leaf, part);
            let square = (0..part.count as usize)
                .map(|k| crate::light::rms(std::array::from_fn(|band| own[k][band] - value[band])))
                .map(|apart| apart * apart)
                .sum::<f32>();
            let deviation = [(square / (3 * part.count) as f32).sqrt(), 0.0];
            if depth > 1 && self.is_uneven(part, &factors, deviation) {
                self.add_parts(field, part, &own, depth - 1);
                continue;
            }
            for k in 0..5 {
                for band in 0..3 {
                    field[k][band] += factors[k] * value[band].max(0.0);
                }
            }
        }
    }
}

/// Share of the limit that may be lost by interpolating the factors of one link: many are.
const SMOOTH: f32 = 0.5;

/// Is it enough to interpolate a link's factors over its receiver? A factor bends by the square of what the receiver's size
/// is to the distance, and a half is left of that between five points.
pub(crate) fn is_smooth(link: &Link, element: &Element, limit: f32, light: &Light, evaluator: &Evaluator<'_>) -> bool {
    let (to, other) = evaluator.ball(link.source);
    let own = element.radius();
    let clear = (element.centre().distance(to) - other).max(own);
    let bend = 0.5 * (own / clear) * (own / clear);
    let most = link.factors.iter().fold(0.0_f32, |most, &factor| most.max(factor));
    let lost = most * crate::light::rms(light.value(link, evaluator)) * bend;
    evaluator.ideas.smooth_factors && element.area * lost * lost < SMOOTH * limit
}

/// Levels of a polygon whose quarters are visited side by side, and rows from which on that is worth it.
const SIDE_BY_SIDE: u32 = 4;
const LONG: usize = 128;

/// The way down a polygon's quadtree.
#[derive(Clone, Copy)]
struct Descent<'a> {
    /// Links by receiver, all of this polygon.
    rows: &'a [(u32, u32, &'a [Link])],
    limit: f32,
    light: &'a Light,
    evaluator: &'a Evaluator<'a>,
}

impl Descent<'_> {
    /// Appends the fields of the leaves below a node. `field`: what the nodes above it bring; `seen`: sources that they see, as
    /// they were after the call.
    fn descend(&self, node: u32, mut field: Field, seen: &mut Vec<Seen>, leaves: &mut Vec<(u32, Field)>) {
        let Descent { rows, limit, light, evaluator } = *self;
        let element = &evaluator.elements[node as usize];
        let before = seen.len();
        if let Ok(row) = rows.binary_search_by_key(&node, |row| row.1) {
            for link in rows[row].2 {
                if link.source & CLUSTER != 0 || is_smooth(link, element, limit, light, evaluator) {
                    let value = light.value(link, evaluator);
                    let factors = to_corners(&link.factors, element.count);
                    for k in 0..5 {
                        for band in 0..3 {
                            field[k][band] += factors[k] * value[band];
                        }
                    }
                } else if link.state.is(State::CLEAR) || link.state.visibility == 255 && link.state.spread == 0 {
                    seen.push(Seen {
                        source: link.source,
                        value: light.value(link, evaluator),
                        at: [1.0; 5],
                        whole: true,
                    });
                } else {
                    let (open, _) = evaluator.exchange(element, &evaluator.elements[link.source as usize]);
                    let mean = f32::from(link.state.visibility) / 255.0;
                    let is_known = |k: usize| open[k] > 0.0 && evaluator.ideas.linear_receivers;
                    let at =
                        std::array::from_fn(|k| if is_known(k) { (link.factors[k] / open[k]).min(1.0) } else { mean });
                    seen.push(Seen { source: link.source, value: light.value(link, evaluator), at, whole: false });
                }
            }
        }
        if !evaluator.ideas.linear_receivers {
            level(&mut field, element.count);
        }
        if element.first_child == NONE {
            let mut samples = [[0.0; 3]; 5];
            for entry in seen.iter() {
                add(&mut samples, entry, &Near { leaf: element, limit, light, evaluator });
            }
            let mut own = corners_of(&samples, element.count);
            if !evaluator.ideas.linear_receivers {
                level(&mut own, element.count);
            }
            for k in 0..5 {
                for band in 0..3 {
                    field[k][band] += own[k][band];
                }
            }
            leaves.push((node, field));
        } else {
            let count = element.count;
            let here = seen.clone();
            let below = |quadrant: usize, seen: &mut Vec<Seen>, leaves: &mut Vec<(u32, Field)>| {
                for (entry, above) in seen.iter_mut().zip(&here).filter(|(_, above)| !above.whole) {
                    entry.at = quarter_of(&above.at, count, quadrant).map(|at| at.clamp(0.0, 1.0));
                }
                let part = crate::light::quarter(&field, count, quadrant);
                self.descend(element.first_child + quadrant as u32, part, seen, leaves);
                seen.copy_from_slice(&here);
            };
            if element.path.depth() < SIDE_BY_SIDE && rows.len() >= LONG {
                let parts = (0..4).into_par_iter().map(|quadrant| {
                    let mut leaves = Vec::new();
                    below(quadrant, &mut here.clone(), &mut leaves);
                    leaves
                });
                leaves.extend(parts.collect::<Vec<_>>().concat());
            } else {
                (0..4).for_each(|quadrant| below(quadrant, seen, leaves));
            }
        }
        seen.truncate(before);
    }
}
