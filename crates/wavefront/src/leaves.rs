//! The last step of every gather: what leaves receive from the links of their own and of all above them, with form
//! factors taken anew at the leaves' own points.
//!
//! A link's factors, known at five points of a large receiver, are interpolated on the way down; beside a small source
//! they vary faster than that. All sources of a leaf together cover what it sees exactly once, so with factors at its own
//! points nothing is lost between them: in a closed room they add up to one at every point.

use crate::evaluate::Evaluator;
use crate::field::{to_corners, to_samples};
use crate::geometry::{Element, NONE};
use crate::light::{Field, Light, add, add_times, bands, corners_of, cut, level, mean_over, part, part_of, rms};
use crate::link::{CLUSTER, Link, State};
use crate::rows::{Row, Samples, Share};
use glam::Vec3;
use isolux_simd::sphere::evaluate;
use rayon::prelude::*;

/// An element as the source of a leaf, with the visibility over the node at hand.
#[derive(Clone, Copy)]
struct Seen {
    source: u32,
    /// In corners, see [`crate::field`]; not cut off at 0 and 1, so that slopes stay what they are on the way down.
    at: [f32; 5],
    whole: bool,
    /// The largest factor that its link knows, and what factors are multiplied with, RMS over bands.
    most: f32,
    value: f32,
    /// What its link leaves to chance.
    share: Share,
    /// Middle and radius of the source.
    ball: (Vec3, f32),
}

/// Fields of all leaves of the polygons, by leaf; `base`: what clusters send to the polygons' roots.
pub(crate) fn gather<const C: usize>(
    light: &Light<C>,
    base: &[Field<C>],
    links: &[Link],
    limit: f32,
    evaluator: &Evaluator<'_>,
) -> Vec<(u32, Field<C>)> {
    let mut rows: Vec<(u32, u32, &[Link])> = links
        .chunk_by(|a, b| a.receiver == b.receiver)
        .filter(|row| row[0].receiver & CLUSTER == 0)
        .map(|row| (evaluator.elements[row[0].receiver as usize].polygon, row[0].receiver, row))
        .collect();
    rows.sort_by_key(|&(polygon, receiver, _)| (polygon, receiver));
    let polygons: Vec<&[(u32, u32, &[Link])]> = rows.chunk_by(|a, b| a.0 == b.0).collect();
    let parts: Vec<Vec<(u32, Field<C>)>> = polygons
        .par_iter()
        .map(|rows| {
            let polygon = rows[0].0;
            let mut leaves = Vec::new();
            let descent = Descent { rows, limit, light, evaluator };
            let field = base[polygon as usize];
            let row = evaluator.row_of_groups(polygon, &field[0], light);
            let arrives = Arriving { field, row };
            descent.descend(polygon, arrives, &mut Sources::default(), &mut leaves);
            leaves
        })
        .collect();
    parts.concat()
}

/// Most levels below a leaf's source that are looked at where a leaf touches it.
const DEEPEST: u32 = 4;

/// What arrives at an element: its field, and what the sources of that add up to where leaves in closed surroundings ask.
#[derive(Clone, Copy)]
struct Arriving<const C: usize> {
    field: Field<C>,
    row: Row<C>,
}

/// What one source throws on five points, and the factors by which it does.
struct Thrown<const C: usize> {
    field: Field<C>,
    factors: [f32; 5],
}

impl<const C: usize> Thrown<C> {
    const NOTHING: Thrown<C> = Thrown { field: [[0.0; C]; 5], factors: [0.0; 5] };

    fn add(&mut self, k: usize, factor: f32, value: &[f32; C]) {
        add_times(&mut self.field[k], factor, value);
        self.factors[k] += factor;
    }
}

/// A leaf that looks at what is close to it.
#[derive(Clone, Copy)]
struct Near<'a, const C: usize> {
    leaf: &'a Element,
    limit: f32,
    light: &'a Light<C>,
    evaluator: &'a Evaluator<'a>,
}

impl<const C: usize> Near<'_, C> {
    /// What a source throws on the leaf.
    fn thrown(&self, entry: &Seen, value: &[f32; C]) -> Thrown<C> {
        let mut thrown = Thrown::NOTHING;
        self.add(&mut thrown, entry, value);
        thrown
    }

    /// Adds what a source throws on the leaf: all of it at once where the source is even or far, part by part where a point
    /// at one end of the leaf sees other parts of it than a point at the other.
    fn add(&self, thrown: &mut Thrown<C>, entry: &Seen, value: &[f32; C]) {
        let Near { leaf, light, evaluator, .. } = *self;
        let source = &evaluator.elements[entry.source as usize];
        let factors = evaluator.factors(leaf, source);
        if entry.whole && self.is_uneven(source, &factors, light.deviation[entry.source as usize]) {
            if source.first_child == NONE {
                let own = &light.emission[source.polygon as usize];
                let rho = evaluator.geometry.surfaces[source.polygon as usize].reflectance;
                let radiosity = light.field[entry.source as usize]
                    .each_ref()
                    .map(|value| std::array::from_fn(|c| own[c] + rho[c % 3] * value[c]));
                self.add_parts(thrown, source, &radiosity, DEEPEST);
            } else {
                for child in source.first_child..source.first_child + 4 {
                    self.add(thrown, &Seen { source: child, ..*entry }, &light.radiosity[child as usize]);
                }
            }
            return;
        }
        let at = if entry.whole { entry.at } else { to_samples(&entry.at, leaf.count).map(|at| at.clamp(0.0, 1.0)) };
        (0..5).for_each(|k| thrown.add(k, factors[k] * at[k], value));
    }

    /// Do the leaf's points see a difference within the source?
    fn is_uneven(&self, source: &Element, factors: &[f32; 5], deviation: [f32; 2]) -> bool {
        let most = factors.iter().fold(0.0_f32, |most, &factor| most.max(factor)) * (deviation[0] + deviation[1]);
        if self.leaf.area * most * most <= self.limit || !self.evaluator.ideas.parts_nearby {
            return false;
        }
        let reach = 2.0 * (self.leaf.radius() + source.radius());
        self.leaf.centre().distance_squared(source.centre()) < reach * reach
    }

    /// Adds the parts that a source without any would have, with what its field says of them.
    fn add_parts(&self, thrown: &mut Thrown<C>, source: &Element, radiosity: &Field<C>, depth: u32) {
        for (index, part) in source.parts(0).iter().enumerate() {
            let own = self::part(radiosity, source.count, source.cut, index);
            let value = mean_over(&own, part);
            let factors = self.evaluator.factors(self.leaf, part);
            let square = (0..part.count as usize)
                .map(|k| rms(std::array::from_fn(|band| own[k][band] - value[band])))
                .map(|apart| apart * apart)
                .sum::<f32>();
            let deviation = [(square / (3 * part.count) as f32).sqrt(), 0.0];
            if depth > 1 && self.is_uneven(part, &factors, deviation) {
                self.add_parts(thrown, part, &own, depth - 1);
                continue;
            }
            let value = cut(value);
            (0..5).for_each(|k| thrown.add(k, factors[k], &value));
        }
    }
}

/// Share of the limit that may be lost by interpolating the factors of one link over its receiver: many are. And over a part
/// of it: what is lost there each of the parts that divide it loses. Measured in the room at 3 %: with a twentieth gathers at
/// the leaves take two thirds of the time for the same error, with a half the error grows by a seventh.
const SMOOTH: f32 = 0.5;
const SMOOTH_BELOW: f32 = 0.05;

/// An element over which factors may be interpolated.
struct Span<'a> {
    centre: Vec3,
    radius: f32,
    area: f32,
    limit: f32,
    evaluator: &'a Evaluator<'a>,
}

impl Span<'_> {
    fn new<'a>(element: &Element, limit: f32, evaluator: &'a Evaluator<'a>) -> Span<'a> {
        Span { centre: element.centre(), radius: element.radius(), area: element.area, limit, evaluator }
    }

    /// Is it enough to interpolate factors? A factor bends by the square of what the receiver's size is to the distance, and a
    /// half is left of that between five points. `share`: of the limit, that may be lost; `most`: the largest factor; `value`:
    /// what factors are multiplied with; the last: the source's middle and radius.
    fn is_smooth(&self, share: f32, most: f32, value: f32, source: u32, (to, other): (Vec3, f32)) -> bool {
        let Span { centre, radius: own, area, limit, evaluator } = *self;
        let clear = (centre.distance(to) - other).max(own);
        let bend = 0.5 * (own / clear) * (own / clear);
        let lost = most * value * bend;
        // Between five points of a long receiver there is room for a source that they do not see, a part of the wall that a
        // strip runs along: beside it there may be a factor of 1/2, over about as much as it is large.
        let between = if own < clear || own * own < area {
            0.0
        } else {
            let area = area.min(evaluator.elements[source as usize].area);
            area * (0.5 * bend * value) * (0.5 * bend * value)
        };
        evaluator.ideas.smooth_factors && area * lost * lost + between < share * limit
    }
}

/// Is all of the source seen, by all of the receiver's points?
pub(crate) fn is_whole(state: State) -> bool {
    state.is(State::CLEAR) || state.visibility == 255 && state.spread == 0
}

/// Levels of a polygon whose quarters are visited side by side, and rows from which on that is worth it.
const SIDE_BY_SIDE: u32 = 4;
const LONG: usize = 128;

/// What a node and those above it see, and what the factors of each are multiplied with, by entry.
#[derive(Clone)]
struct Sources<const C: usize> {
    seen: Vec<Seen>,
    values: Vec<[f32; C]>,
}

impl<const C: usize> Default for Sources<C> {
    fn default() -> Self {
        Sources { seen: Vec::new(), values: Vec::new() }
    }
}

/// The way down a polygon's quadtree.
#[derive(Clone, Copy)]
struct Descent<'a, const C: usize> {
    /// Links by receiver, all of this polygon.
    rows: &'a [(u32, u32, &'a [Link])],
    limit: f32,
    light: &'a Light<C>,
    evaluator: &'a Evaluator<'a>,
}

impl<const C: usize> Descent<'_, C> {
    /// Appends the fields of the leaves below a node. `arrives`: what the nodes above it bring; `sources`: what they see, as
    /// it was after the call.
    fn descend(
        &self,
        node: u32,
        mut arrives: Arriving<C>,
        sources: &mut Sources<C>,
        leaves: &mut Vec<(u32, Field<C>)>,
    ) {
        let Descent { rows, limit, light, evaluator } = *self;
        let element = &evaluator.elements[node as usize];
        let before = sources.seen.len();
        let span = Span::new(element, limit, evaluator);
        if let Ok(row) = rows.binary_search_by_key(&node, |row| row.1) {
            for link in rows[row].2 {
                let value = light.value(link, evaluator);
                let (strength, ball) = (rms(bands(&value, 0)), evaluator.ball(link.source));
                let share = if evaluator.has_closed() { evaluator.share(link, light) } else { Share::default() };
                let most = link.factors.iter().fold(0.0_f32, |most, &factor| most.max(factor));
                if link.source & CLUSTER != 0 || span.is_smooth(SMOOTH, most, strength, link.source, ball) {
                    let factors = to_corners(&link.factors, element.count);
                    (0..5).for_each(|k| add_times(&mut arrives.field[k], factors[k], &value));
                    if evaluator.has_closed() {
                        let even = self.even(link);
                        let brings = link.factors.map(|factor| value.map(|value| factor * value));
                        arrives.row.count(share, &link.factors.map(|factor| factor * even), &brings, element.count);
                    }
                    continue;
                }
                let whole = is_whole(link.state);
                let mut at = [1.0; 5];
                if !whole {
                    let (open, _) = evaluator.exchange(element, &evaluator.elements[link.source as usize]);
                    let mean = f32::from(link.state.visibility) / 255.0;
                    let is_known = |k: usize| open[k] > 0.0 && evaluator.ideas.linear_receivers;
                    at = std::array::from_fn(|k| if is_known(k) { (link.factors[k] / open[k]).min(1.0) } else { mean });
                    at = to_corners(&at, element.count);
                }
                sources.seen.push(Seen { source: link.source, at, whole, most, value: strength, share, ball });
                sources.values.push(value);
            }
        }
        if !evaluator.ideas.linear_receivers {
            level(&mut arrives.field, element.count);
        }
        if element.first_child == NONE {
            let (mut samples, mut own_row) = ([[0.0; C]; 5], Samples::NONE);
            let near = Near { leaf: element, limit, light, evaluator };
            let is_closed = evaluator.is_closed(node);
            for (entry, value) in sources.seen.iter().zip(&sources.values) {
                let thrown = near.thrown(entry, value);
                add(&mut samples, &thrown.field);
                if is_closed {
                    own_row.count(entry.share, &thrown.factors, &thrown.field);
                }
            }
            let mut own = corners_of(&samples, element.count);
            if !evaluator.ideas.linear_receivers {
                level(&mut own, element.count);
            }
            add(&mut arrives.field, &own);
            if is_closed {
                add(&mut arrives.field, &arrives.row.missing(&own_row, element.count));
            }
            leaves.push((node, arrives.field));
        } else {
            let (count, cut) = (element.count, element.cut);
            let here = self.left_below(element, &span, before, sources, &mut arrives);
            let below = |index: usize, sources: &mut Sources<C>, leaves: &mut Vec<(u32, Field<C>)>| {
                for (entry, above) in sources.seen.iter_mut().zip(&here.seen).filter(|(_, above)| !above.whole) {
                    entry.at = part_of(&above.at, count, cut, index);
                }
                let field = part(&arrives.field, count, cut, index);
                let row = if evaluator.has_closed() { arrives.row.part(count, cut, index) } else { Row::NONE };
                let part = Arriving { field, row };
                self.descend(element.first_child + index as u32, part, sources, leaves);
            };
            if element.path.depth() < SIDE_BY_SIDE && rows.len() >= LONG {
                let parts = (0..4).into_par_iter().map(|index| {
                    let mut leaves = Vec::new();
                    below(index, &mut here.clone(), &mut leaves);
                    leaves
                });
                leaves.extend(parts.collect::<Vec<_>>().concat());
            } else {
                let mut own = here.clone();
                (0..4).for_each(|index| below(index, &mut own, leaves));
            }
        }
        sources.seen.truncate(before);
        sources.values.truncate(before);
    }

    /// What a node's parts have to ask themselves of what it and those above it see. Of the first `above`, whose links are of
    /// nodes above it, it adds to the field what may be interpolated over it.
    fn left_below(
        &self,
        element: &Element,
        span: &Span<'_>,
        above: usize,
        sources: &Sources<C>,
        arrives: &mut Arriving<C>,
    ) -> Sources<C> {
        let Descent { limit, light, evaluator, .. } = *self;
        let mut left = Sources::default();
        let mut samples = [[0.0; C]; 5];
        let near = Near { leaf: element, limit, light, evaluator };
        for (index, (entry, value)) in sources.seen.iter().zip(&sources.values).enumerate() {
            if index < above && span.is_smooth(SMOOTH_BELOW, entry.most, entry.value, entry.source, entry.ball) {
                let thrown = near.thrown(entry, value);
                add(&mut samples, &thrown.field);
                if evaluator.has_closed() {
                    arrives.row.count(entry.share, &thrown.factors, &thrown.field, element.count);
                }
            } else {
                left.seen.push(*entry);
                left.values.push(*value);
            }
        }
        add(&mut arrives.field, &corners_of(&samples, element.count));
        left
    }

    /// What the source of a link would throw along it if everything threw 1, in units of its factors.
    fn even(&self, link: &Link) -> f32 {
        if link.source & CLUSTER == 0 {
            return 1.0;
        }
        let towards = self.evaluator.ball(link.receiver).0 - self.evaluator.ball(link.source).0;
        self.evaluator.even(link.source, &evaluate(towards.normalize_or(Vec3::X).to_array()))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::ideas::Ideas;
    use crate::solve::{Prepared, Request};
    use isolux_core::scene::{BuildOptions, Scene};
    use isolux_formats::read::read;
    use std::sync::Arc;

    /// Catches light that is lost between the places at which a long receiver is asked: what a part of a wall throws on the
    /// ledge of a skirting board is next to nothing at five places over metres, and half of what it shines with right below it.
    #[test]
    fn factors_that_five_places_of_a_ledge_do_not_tell_are_taken_anew() {
        let path = format!("{}/../../scenes/room.glb", env!("CARGO_MANIFEST_DIR"));
        let input = read(path.as_ref(), &Default::default()).unwrap();
        let scene = Arc::new(Scene::build(input, &BuildOptions::default()).unwrap());
        // In strips there is no ledge that is long; triangles may be.
        let request = Request { ideas: Ideas { strips: false, ..Ideas::default() }, ..Request::new(0.1) };
        let solved = Prepared::new(scene).solve(&request, &Control::default());
        let evaluator = solved.transport.evaluator();
        let mut missed = 0;
        for link in solved.transport.links.iter().filter(|link| (link.receiver | link.source) & CLUSTER == 0) {
            let [ledge, wall] = [link.receiver, link.source].map(|node| &evaluator.elements[node as usize]);
            if ledge.radius() * ledge.radius() < 50.0 * ledge.area {
                continue;
            }
            let largest = |factors: &[f32; 5]| factors.iter().fold(0.0_f32, |most, &factor| most.max(factor));
            // The quarters' places beside the place of the ledge that is closest to the wall's part.
            let side = ledge.corners[1] - ledge.corners[0];
            let along = if side.length() > ledge.radius() { side } else { ledge.corners[3] - ledge.corners[0] };
            let share = (wall.centre() - ledge.centre()).dot(along) / along.length_squared();
            let shift = along * share.clamp(-0.5, 0.5);
            let close = Element { corners: ledge.corners.map(|corner| corner + shift), ..*ledge };
            let there = evaluator.factors(&close, wall)[crate::link::MIDDLE];
            if there < 0.2 || largest(&link.factors) > 0.01 * there {
                continue;
            }
            missed += 1;
            // A twentieth of the brightness over what the two have of each other counts.
            let limit = ledge.area.min(wall.area) * 0.05 * 0.05;
            let span = Span::new(ledge, limit, &evaluator);
            let ball = evaluator.ball(link.source);
            assert!(!span.is_smooth(SMOOTH, largest(&link.factors), 1.0, link.source, ball), "{link:?}: {there}");
        }
        // Measured 5.
        assert!(missed > 2, "{missed}");
    }
}
