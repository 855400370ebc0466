//! Decides what becomes of a link: the error that it leaves against the error that is permitted.

use crate::evaluate::Evaluator;
use crate::field::{mean, to_corners};
use crate::geometry::Element;
use crate::light::Light;
use crate::link::{CLUSTER, Link, State};
use crate::sight::chance;

/// What becomes of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Keep,
    SplitReceiver,
    SplitSource,
    MoreRays,
}

/// Parts of a link's error, as irradiance over its receiver (root mean square over bands and places).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Errors {
    /// What the receiver's five points do not tell of its inside.
    pub(crate) receiver: f32,
    /// What one value for the source does not tell of its parts.
    pub(crate) source: f32,
    /// What the rays leave open.
    pub(crate) noise: f32,
    /// What places of the receiver that no ray was sent from leave open.
    pub(crate) hidden: f32,
}

impl Errors {
    pub(crate) fn square(&self) -> f32 {
        self.receiver * self.receiver + self.source * self.source + self.noise * self.noise + self.hidden * self.hidden
    }
}

/// RMS over an element of what a field with values at corners and middle leaves of a quadratic, in units of the bulge
/// (middle less mean of the corners): 0.33 for x², 0.25 for x² + y².
pub(crate) const BULGE: f32 = 0.3;

/// RMS over an element of a linear function, in units of that over its corners: sqrt(1/3), on a triangle 1/2.
const SLOPE: f32 = 0.58;

/// RMS of what linear interpolation between three points leaves of a step of 1 anywhere: sqrt(1/12).
pub(crate) const STEP: f32 = 0.29;

/// What linear interpolation leaves of a penumbra, over what it leaves of a step as high.
pub(crate) const SMOOTH: f32 = 0.1;

/// How many times what it carries a link counts that cannot tell how much that is: many such links err together.
pub(crate) const ROUGH: f32 = 2.0;

/// Visibility of one ray of 16: with less, what would be seen without what blocks is not told.
const ONE_RAY: f32 = 1.0 / 16.0;

/// Least visibility by which what would be seen without what blocks is told from what is.
const LEAST_SEEN: f32 = 0.5;

/// Visibility that 16 blocked rays leave possible, as root mean square: 1/18.
const UNSEEN: f32 = 1.0 / 324.0;

/// Parts of a receiver that are open where they were asked, of 16, from which on they speak for the rest of what is open there.
/// Measured: with 16, ground among houses is split twice as finely for a fortieth less error; without any, a floor that is
/// under a rug but for its edge takes the shadow at one place of it for that at all.
const ENOUGH: f32 = 6.0;

/// What rays leave open of a visibility's slopes, over what they leave open of its mean, as variances. Between quarters of a
/// receiver 16 rays tell no difference below chance; what chance makes in spite of that is about as large as the mean's. With
/// rays from five regions, a fit to five values that are each known so well varies twice as much as one of them.
const SLOPES: f32 = 2.0;

/// How many times what rays leave open counts against what splits would bring, as variances: rays cost less than parts, which
/// are asked, split and gathered at. Measured for the product with [`SLOPES`], room at 5 % and gallery at 2 %: at 2.25 a third
/// and a seventh of the time at 1, at 4 a third and a quarter; at 9 shadows are missed.
const CHEAP: f32 = 2.0;

/// Most rays from a point: 4^(3+1).
pub(crate) const MOST_RAYS: u8 = 3;

/// Depth of elements at which refinement ends: what a path can name.
const DEEPEST: u32 = isolux_core::tree::Path::MAX_DEPTH;

/// Variance of a visibility that is known by rays. `evenness`: rays of equal weight that say as much as one.
fn noise(state: State, evenness: impl FnOnce() -> f32) -> f32 {
    if state.is(State::CLEAR) {
        return 0.0;
    }
    let v = f32::from(state.visibility) / 255.0;
    let rays = state.rays_of_points() as f32;
    if state.is(State::DARK) && rays > 0.0 {
        // Five places are blocked, however many rays each sent.
        1.0 / (5.0 + 2.0) / (5.0 + 2.0)
    } else if rays == 0.0 {
        // None or all leaves the posterior of a proportion.
        let rays = state.rays_between();
        v * (1.0 - v) / (rays + 1.0) + 1.0 / (rays + 2.0) / (rays + 2.0)
    } else {
        chance(v, rays * evenness()) + 1.0 / (5.0 * rays + 2.0) / (5.0 * rays + 2.0)
    }
}

/// RMS of what no number of rays tells of a visibility, where something stands on the receiver: rays start in those of its
/// parts that are open where they were asked, and others may have open places, too. With [`ENOUGH`] that is no matter.
fn hidden(receiver: &Element, state: State) -> f32 {
    if !receiver.crossed || receiver.open == u16::MAX || state.is(State::CLEAR) {
        return 0.0;
    }
    // All places or none leave the posterior of a proportion.
    let variance = |places: f32| 1.0 / (places + 2.0) / (places + 2.0);
    (variance(receiver.open.count_ones() as f32) - variance(ENOUGH)).max(0.0).sqrt()
}

/// Errors of a link in today's light.
pub(crate) fn errors(link: &Link, evaluator: &Evaluator<'_>, light: &Light) -> Errors {
    let value = light.strength(link, evaluator);
    if value <= 0.0 {
        return Errors::default();
    }
    let state = link.state;
    if state.is(State::GRAZING) && (link.receiver | link.source) & CLUSTER == 0 {
        // Its corners may receive as much, its points nothing.
        return Errors { receiver: STEP * value * f32::from(state.spread) / 255.0, ..Errors::default() };
    }
    let spread = f32::from(state.spread) / 255.0;
    let visibility = f32::from(state.visibility) / 255.0;
    let (from, own) = evaluator.ball(link.receiver);
    let (to, other) = evaluator.ball(link.source);
    let distance = from.distance(to).max(1e-3 * (own + other));
    let is_cluster = |node: u32| node & CLUSTER != 0;
    // Unoccluded, as far as it is known; and what is left of it.
    let dark = state.is(State::DARK);
    let (open, most) = if is_cluster(link.receiver) {
        (link.factors[1] * value, if dark { 0.0 } else { link.factors[0] * value })
    } else {
        let largest = link.factors.iter().fold(0.0_f32, |most, &factor| most.max(factor)) * value;
        if dark {
            (largest, 0.0)
        } else if visibility < LEAST_SEEN && !is_cluster(link.source) {
            // Too little is left to tell what there would be without what blocks.
            let [receiver, source] = [link.receiver, link.source].map(|node| &evaluator.elements[node as usize]);
            (evaluator.factors(receiver, source).into_iter().fold(0.0, f32::max) * value, largest)
        } else {
            (largest / visibility.max(ONE_RAY), largest)
        }
    };
    let step = if state.is(State::SATURATED) { STEP } else { SMOOTH * STEP };
    let mut errors = Errors::default();
    let partial = (visibility * (1.0 - visibility)).sqrt();
    if is_cluster(link.receiver) {
        errors.receiver = most * (1.5 * own / distance).min(1.0) + open * partial;
    } else {
        // On either side of what stands on the receiver one may see what the other does not.
        let divided = evaluator.elements[link.receiver as usize].divided && !state.is(State::CLEAR);
        errors.receiver = if divided { STEP * open } else { step * spread * open };
        errors.hidden = hidden(&evaluator.elements[link.receiver as usize], state) * open;
        // What factors vary over the receiver is no error where leaves take them anew.
        let ideas = evaluator.ideas;
        if !(ideas.linear_receivers && ideas.leaves_anew || dark) {
            errors.receiver += varying(link, evaluator) * value;
        }
    }
    if is_cluster(link.source) {
        errors.source =
            most * (other / distance).min(1.0) + open * partial * if is_cluster(link.receiver) { 0.0 } else { 1.0 };
    } else {
        // The mean place of what arrives is known to a step of 1/15, and to what few rays tell of it; a receiver that
        // spans an angle of its own sees different places from its ends.
        let [linear, rest] = light.deviation[link.source as usize].map(|part| part / value.max(f32::MIN_POSITIVE));
        let near = (1.5 * other / distance).min(1.0) + partial;
        let shift = (own / other).min(1.0) * (other / distance).min(1.0) * (other / distance).min(1.0);
        errors.source = most * (0.15 * linear + rest) * near;
        let shifted = most * 0.8 * shift * linear * near;
        if own < other {
            errors.receiver += shifted;
        } else {
            errors.source += shifted;
        }
    }
    if state.is(State::BROAD) || state.is(State::GRAZING) {
        // All of it may be wrong, and always in the same direction.
        let rough = ROUGH * open * visibility.max(UNSEEN).sqrt();
        if own >= other {
            errors.receiver = errors.receiver.max(rough);
        } else {
            errors.source = errors.source.max(rough);
        }
    }
    // Clusters know no slopes.
    let slopes = if (link.receiver | link.source) & CLUSTER == 0 { SLOPES } else { 1.0 };
    errors.noise = open * (slopes * noise(state, || evaluator.evenness(link.receiver, link.source))).sqrt();
    errors
}

/// RMS over a link's receiver of what its factors vary as neither links nor leaves follow, in units of what links carry:
/// what the corners have beyond what is interpolated there, or beyond the mean.
fn varying(link: &Link, evaluator: &Evaluator<'_>) -> f32 {
    let receiver = &evaluator.elements[link.receiver as usize];
    let interpolated = to_corners(&link.factors, receiver.count);
    let there = if link.source & CLUSTER == 0 {
        let visibility = f32::from(link.state.visibility) / 255.0;
        let source = &evaluator.elements[link.source as usize];
        evaluator.factors_in_corners(receiver, source).map(|factor| visibility * factor)
    } else {
        interpolated
    };
    let (taken, share) = if evaluator.ideas.linear_receivers {
        (interpolated, BULGE)
    } else {
        ([mean(&link.factors, receiver.count); 5], SLOPE)
    };
    let count = receiver.count as usize;
    share * ((0..count).map(|k| (there[k] - taken[k]) * (there[k] - taken[k])).sum::<f32>() / count as f32).sqrt()
}

/// May a node be split?
pub(crate) fn is_splittable(node: u32, evaluator: &Evaluator<'_>, least_area: f32) -> bool {
    node & CLUSTER != 0 || {
        let element = &evaluator.elements[node as usize];
        element.area > least_area && element.path.depth() < DEEPEST
    }
}

/// Decides. `limit`: what area times weight times squared error may be.
pub(crate) fn verdict(link: &Link, evaluator: &Evaluator<'_>, light: &Light, limit: f32, least_area: f32) -> Verdict {
    let mut errors = errors(link, evaluator, light);
    let weight = light.weighted_area(link.receiver, evaluator);
    let clusters = (link.receiver | link.source) & CLUSTER != 0;
    if !clusters && evaluator.ideas.more_rays {
        errors.noise *= CHEAP.sqrt();
    }
    // Where something stands on the receiver, all its links miss the same step: such errors add up as they are, and each
    // counts by what it adds to the square of the sum.
    let together = light.coherent(link.receiver).max(errors.receiver);
    // What lies hidden on a receiver its parts tell.
    errors.receiver = (errors.receiver * together).sqrt().hypot(errors.hidden);
    errors.hidden = 0.0;
    if weight * errors.square() <= limit {
        return Verdict::Keep;
    }
    if link.source & CLUSTER == 0 && evaluator.may_be_hidden(link.source) {
        // Of its parts it is known which of them another face lies on; rays would tell that as a share alone.
        errors.source = errors.source.hypot(errors.noise);
        errors.noise = 0.0;
    }
    let splittable = |node: u32| is_splittable(node, evaluator, least_area);
    let (receiver, source) = (splittable(link.receiver), splittable(link.source));
    if clusters {
        // Noise is worth no more rays here: parts tell more.
        let (own, other) = (evaluator.ball(link.receiver).1, evaluator.ball(link.source).1);
        let by_receiver = if errors.receiver == errors.source { own >= other } else { errors.receiver > errors.source };
        return match (by_receiver, receiver, source) {
            (true, true, _) | (false, true, false) => Verdict::SplitReceiver,
            (_, _, true) => Verdict::SplitSource,
            _ => Verdict::Keep,
        };
    }
    // Rays that missed what there is to see, since the plane of one cuts through the other, miss it again.
    // What covers all places that were asked may leave others free.
    // Where few rays count since much of the receiver is covered, more of them tell.
    let partly = evaluator.elements[link.receiver as usize].open != u16::MAX;
    let missed = link.state.rays() >= 5 && !partly || link.state.is(State::DARK) || !evaluator.ideas.more_rays;
    if missed && errors.noise >= errors.receiver.max(errors.source) {
        let (own, other) = (evaluator.ball(link.receiver).1, evaluator.ball(link.source).1);
        return match (own >= other, receiver, source) {
            (true, true, _) | (false, true, false) => Verdict::SplitReceiver,
            (_, _, true) => Verdict::SplitSource,
            _ => Verdict::Keep,
        };
    }
    let more = link.state.rays() != MOST_RAYS && !link.state.is(State::CLEAR) && evaluator.ideas.more_rays;
    if more && errors.noise >= errors.receiver.max(errors.source) {
        return Verdict::MoreRays;
    }
    if errors.source > errors.receiver && source {
        return Verdict::SplitSource;
    }
    if receiver && errors.receiver >= errors.noise {
        return Verdict::SplitReceiver;
    }
    if weight * errors.noise * errors.noise <= limit {
        return Verdict::Keep;
    }
    match (more, source, receiver) {
        (true, _, _) => Verdict::MoreRays,
        // As many rays to each part say more of the whole.
        (_, true, _) => Verdict::SplitSource,
        (_, _, true) => Verdict::SplitReceiver,
        _ => Verdict::Keep,
    }
}
