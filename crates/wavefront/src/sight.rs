//! What rays say of the visibility of a source over a receiver: samples of a field, and the state of a link.

use crate::field::INNER;
use crate::link::{MIDDLE, State};
use crate::rays::RAYS;

/// Visibility over a receiver.
#[derive(Clone, Copy)]
pub(crate) struct Sight {
    /// At the corners and the middle.
    pub(crate) at: [f32; 5],
    pub(crate) state: State,
}

/// A share of 1 in steps of 1/255.
pub(crate) fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// How much visibility varies within the regions of a receiver, by quarters of each.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Steps {
    /// Sums over regions: of the variance within, and of what chance makes of it.
    variance: f32,
    chance: f32,
    regions: f32,
}

impl Steps {
    /// A region's mean visibility, and its quarters': what was seen of what there was, and the sum of the squared weights.
    pub(crate) fn add(&mut self, mean: f32, parts: &[[f32; 3]; 4]) {
        for [seen, all, squares] in parts.iter().filter(|part| part[1] > 0.0) {
            self.variance += 0.25 * (seen / all - mean) * (seen / all - mean);
            // So many rays of equal weight would say as much.
            let rays = all * all / squares;
            self.chance += 0.25 * 0.75 * mean * (1.0 - mean) / rays;
        }
        self.regions += 1.0;
    }

    /// Root mean square over the receiver of what a linear function misses, less what chance may make of it. `at`: mean
    /// visibilities of the regions.
    pub(crate) fn missed(&self, at: &[f32; 5], count: u8) -> f32 {
        if self.regions == 0.0 {
            return 0.0;
        }
        // Regions are half as large as the receiver: a linear function varies a quarter as much in them as between them.
        let quarters = [at[0], at[1], at[2], if count == 4 { at[3] } else { at[MIDDLE] }];
        let mean = quarters.iter().sum::<f32>() / 4.0;
        let linear = quarters.iter().map(|value| (value - mean) * (value - mean)).sum::<f32>() / 16.0;
        let doubt = (2.0 / (3.0 * self.regions)).sqrt();
        let (variance, chance) = (self.variance / self.regions, self.chance / self.regions);
        (variance - linear - chance * (1.0 + 2.0 * doubt)).max(0.0).sqrt()
    }
}

/// Visibilities of a receiver's regions (its quarters, and its middle as large as one), each known to a variance of `chance`:
/// samples of the field that they tell of, see [`crate::field`].
///
/// Differences between regions are taken apart into slopes and what bends them, and each part is shrunk by what chance is
/// likely to have made of it: an element that is small beside a penumbra sees the same all over.
pub(crate) fn fit(regions: &[f32; 5], count: u8, chance: f32) -> [f32; 5] {
    let corners = &regions[..count as usize];
    let around = corners.iter().sum::<f32>() / f32::from(count);
    let signal = |square: f32| if square > chance { 1.0 - chance / square } else { 0.0 };
    // Of a triangle nothing but slopes is left of its corners.
    let twist = if count == 4 { 0.25 * (regions[0] - regions[1] + regions[2] - regions[3]) } else { 0.0 };
    let turned = |k: usize| if k.is_multiple_of(2) { twist } else { -twist };
    let slope = |k: usize| regions[k] - around - turned(k);
    let linear = signal(0.5 * (0..corners.len()).map(|k| slope(k) * slope(k)).sum::<f32>());
    let bulge = regions[MIDDLE] - around;
    let share = f32::from(count) / f32::from(count + 1);
    let curved = if count == 4 {
        signal(0.5 * (4.0 * twist * twist + share * bulge * bulge))
    } else {
        signal(share * bulge * bulge)
    };
    let bulge = curved * bulge;
    let mean = (corners.iter().sum::<f32>() + regions[MIDDLE]) / f32::from(count + 1);
    let around = mean - bulge / f32::from(count + 1);
    // Means of a bulge of 1 over a corner's quarter; over the middle it is 1/4 more.
    let of_quarter = if count == 4 { 2.0 / 3.0 } else { 11.0 / 16.0 };
    let level = |at: f32| around + 4.0 * bulge * (at - of_quarter);
    // Middles of quarters lie half way to the corners.
    let reach = 2.0 * INNER;
    let mut samples = [level(1.0).clamp(0.0, 1.0); 5];
    for k in 0..corners.len() {
        let apart = reach * linear * slope(k) + reach * reach * curved * turned(k);
        samples[k] = (level(1.0 - INNER * INNER) + apart).clamp(0.0, 1.0);
    }
    samples
}

/// Variance of the mean of a visibility over stratified rays: strata in the plane of the source that lie on the border of a
/// shadow count alone, about 2 n of n².
pub(crate) fn chance(visibility: f32, rays: f32) -> f32 {
    0.8 * visibility * (1.0 - visibility) / (rays * rays.sqrt())
}

/// Visibility over a receiver from rays whose quarter of it `quarter` tells; `unasked` where none of them carries anything.
pub(crate) fn sight(
    weights: &[f32; RAYS],
    through: &[f32; RAYS],
    quarter: impl Fn(usize) -> usize,
    triangle: bool,
    centre: [f32; 2],
    clear: bool,
    unasked: f32,
) -> Sight {
    let (mut seen, mut all) = ([0.0_f32; 4], [0.0_f32; 4]);
    for k in 0..RAYS {
        seen[quarter(k)] += weights[k] * through[k];
        all[quarter(k)] += weights[k];
    }
    let whole: f32 = all.iter().sum();
    let mean = if whole > 0.0 { seen.iter().sum::<f32>() / whole } else { unasked };
    let quarters: [f32; 4] = std::array::from_fn(|k| if all[k] > 0.0 { seen[k] / all[k] } else { mean });
    let variance = quarters.iter().map(|value| (value - mean) * (value - mean)).sum::<f32>() / 4.0;
    // Four rays each say so much even where all quarters see the same.
    let chance = mean * (1.0 - mean) / 4.0;
    let signal = (variance - chance).max(0.0);
    let spread = 2.0 * signal.sqrt();
    let saturated = quarters.iter().any(|&value| value <= 0.0 || value >= 1.0);
    // A linear function differs twice as much between corners as between quarters, less where it is asked; what chance does
    // is taken off.
    let stretch = if variance > 0.0 { 2.0 * INNER * signal / variance } else { 0.0 };
    let corner = |k: usize| {
        let k = if triangle { k.min(2) } else { k };
        (mean + stretch * (quarters[k] - mean)).clamp(0.0, 1.0)
    };
    let at = [corner(0), corner(1), corner(2), corner(3), mean];
    if clear {
        return Sight { at: [1.0; 5], state: State::new(255, 0, 0, State::CLEAR, centre) };
    }
    let flags = if saturated { State::SATURATED } else { 0 };
    // So many rays of equal weight would say as much.
    let squares: f32 = weights.iter().map(|weight| weight * weight).sum();
    let rays = if whole > 0.0 { whole * whole / squares } else { 0.0 };
    let (at, state) = shaded(at, State::new(byte(mean), byte(spread), State::few(rays), flags, centre));
    Sight { at, state }
}

/// Mean place of what gets through.
pub(crate) fn centre(weights: &[f32; RAYS], through: &[f32; RAYS], places: &[[f32; 2]; RAYS]) -> [f32; 2] {
    let (mut sum, mut whole) = ([0.0; 2], 0.0);
    for k in 0..RAYS {
        let weight = weights[k] * through[k];
        sum = [sum[0] + weight * places[k][0], sum[1] + weight * places[k][1]];
        whole += weight;
    }
    if whole > 0.0 { sum.map(|value| value / whole) } else { [0.5; 2] }
}

/// A source that something may lie on is not seen alike all over, though all rays say so.
pub(crate) fn not_whole(mut state: State) -> State {
    state.spread = state.spread.max(1);
    state
}

/// Where every ray was blocked, all is kept but what it counts for.
pub(crate) fn shaded(at: [f32; 5], state: State) -> ([f32; 5], State) {
    if at.iter().any(|&at| at > 0.0) {
        return (at, state.seen(state.visibility.max(1)));
    }
    ([1.0; 5], state.seen(0).with(State::DARK))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is missed of a visibility over (u, v) in [-1, 1]², by 64 rays from each quarter of five regions.
    fn missed(visible: impl Fn(f32, f32) -> f32) -> f32 {
        let mut steps = Steps::default();
        let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [0.0, 0.0]];
        let at = corners.map(|[u, v]: [f32; 2]| {
            let parts = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[s, t]: [f32; 2]| {
                let places = (0..64).map(|k| [(k % 8) as f32, (k / 8) as f32].map(|k| (k - 3.5) / 16.0));
                let seen = places.map(|[x, y]| visible(u + 0.25 * s + x, v + 0.25 * t + y)).sum();
                [seen, 64.0, 64.0]
            });
            let mean = parts.iter().map(|part| part[0]).sum::<f32>() / 256.0;
            steps.add(mean, &parts);
            mean
        });
        steps.missed(&at, 4)
    }

    /// Means of a function of (u, v) in [-1, 1]² over the four quarters and the middle of a square.
    fn regions(of: impl Fn(f32, f32) -> f32) -> [f32; 5] {
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [0.0, 0.0]].map(|[u, v]: [f32; 2]| {
            let places = (0..400).map(|k| [(k % 20) as f32, (k / 20) as f32].map(|k| (k - 9.5) / 20.0));
            places.map(|[x, y]| of(u + x, v + y)).sum::<f32>() / 400.0
        })
    }

    /// Catches samples that are not those of the function whose means regions have: slopes, twist and bulge on a square.
    #[test]
    fn a_quadratic_visibility_is_met_where_nothing_is_left_to_chance() {
        let of = |u: f32, v: f32| 0.4 + 0.1 * u - 0.05 * v + 0.08 * u * v + 0.12 * (1.0 - 0.5 * (u * u + v * v));
        let samples = fit(&regions(of), 4, 0.0);
        for (k, [u, v]) in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, 0.0]].into_iter().enumerate() {
            // 20 strata a side leave 1/400 of a square's mean.
            assert!(
                (samples[k] - of(INNER * u, INNER * v)).abs() < 1e-3,
                "{k}: {} {}",
                samples[k],
                of(INNER * u, INNER * v)
            );
        }
    }

    /// The same on a triangle, whose regions are its four parts: barycentric coordinates of their corners.
    #[test]
    fn a_linear_visibility_is_met_on_a_triangle() {
        // Means of l1, l2, l3 with weights .2, .5 and .8: corners' parts have 2/3 of their own and 1/6 of the others.
        let of = |l: [f32; 3]| 0.2 * l[0] + 0.5 * l[1] + 0.8 * l[2];
        let part = |own: usize| of(std::array::from_fn(|k| if k == own { 2.0 / 3.0 } else { 1.0 / 6.0 }));
        let samples = fit(&[part(0), part(1), part(2), 0.0, 0.5], 3, 0.0);
        for k in 0..3 {
            let at = of(std::array::from_fn(|l| (1.0 - INNER) / 3.0 + if l == k { INNER } else { 0.0 }));
            assert!((samples[k] - at).abs() < 1e-6, "{k}: {} {at}", samples[k]);
        }
        assert!((samples[MIDDLE] - 0.5).abs() < 1e-6);
    }

    /// Catches noise that is taken for slopes: over many draws of five values that differ by chance alone, the samples' mean
    /// square about the truth is less than that of the values, and a slope of ten times the noise keeps nine tenths.
    #[test]
    fn what_chance_makes_is_no_slope() {
        const NOISE: f32 = 0.02;
        let mut stream = isolux_core::sampling::Stream::new(1);
        // Even in [-sqrt(3), sqrt(3)]: variance 1.
        let mut draw = || NOISE * 12.0_f32.sqrt() * (stream.next_unit() as f32 - 0.5);
        let (mut before, mut after) = (0.0, 0.0);
        for _ in 0..1000 {
            let regions: [f32; 5] = std::array::from_fn(|_| 0.5 + draw());
            let samples = fit(&regions, 4, NOISE * NOISE);
            let square = |values: &[f32; 5]| values.iter().map(|value| (value - 0.5) * (value - 0.5)).sum::<f32>();
            before += square(&regions);
            after += square(&samples);
        }
        // Unshrunk, samples have 1.3 times as much as regions. Measured 0.43 of it.
        assert!(after < 0.7 * before, "{after} {before}");
        let steep = fit(&regions(|u, _| 0.5 + 10.0 * NOISE * u), 4, NOISE * NOISE);
        assert!(steep[1] - steep[0] > 0.9 * 20.0 * NOISE * INNER, "{steep:?}");
    }

    /// Catches a strip of shadow that crosses all regions and is in no difference between them, and penumbras that are taken
    /// for one.
    #[test]
    fn strips_within_regions_are_missed_and_slopes_are_not() {
        // Half of each quarter of the receiver is dark: 1/2 above and below the mean; the middle's two halves differ alike.
        let strips = missed(|u, _| if u.rem_euclid(1.0) < 0.5 { 0.0 } else { 1.0 });
        assert!((strips - 0.5).abs() < 0.02, "{strips}");
        for slope in [0.0, 0.1, 0.4] {
            let penumbra = missed(|u, v| 0.5 + slope * (u + 0.2 * v));
            assert!(penumbra == 0.0, "{slope}: {penumbra}");
        }
    }
}
