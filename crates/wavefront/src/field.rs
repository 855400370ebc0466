//! Fields over an element: what five places say of it, as a quadratic function with one bulge.
//!
//! Two forms, each five numbers. *Samples*: values at the places where a receiver is asked, [`INNER`] of the way to its
//! corners, and at its middle. *Corners*: values of the same function at the corners and at the middle, from which quarters
//! are got exactly. The function is bilinear (linear on a triangle) plus a bulge, which is 1 at the middle and 0 at the
//! corners, the same in all directions: `1 - (u² + v²)/2` with `u, v` from -1 to 1; on a triangle
//! `3 (l1 l2 + l2 l3 + l3 l1)` in its barycentric coordinates.

use crate::link::MIDDLE;

/// Places of samples, from the middle towards the corners.
///
/// Light changes fastest along borders, where walls meet: samples at the corners would take that thin layer for the whole
/// element. At the points of Gauss's rule with two points, 0.577, a linear fit has no mean error for quadratics.
pub(crate) const INNER: f32 = 0.6;

/// Weight of the middle's excess over the mean of the samples in the mean of the field.
pub(crate) fn share(count: u8) -> f32 {
    // Mean of the bulge (2/3 on a quadrilateral, 3/4 on a triangle) over the element, less its value at the samples.
    let bulge = if count == 4 { 2.0 / 3.0 } else { 0.75 };
    (bulge - (1.0 - INNER * INNER)) / (INNER * INNER)
}

/// Mean over the element of a field in samples.
pub(crate) fn mean(samples: &[f32; 5], count: u8) -> f32 {
    let around = samples[..count as usize].iter().sum::<f32>() / f32::from(count);
    around + share(count) * (samples[MIDDLE] - around)
}

/// The same over a quadrilateral whose ends differ in size by `lean`, see [`crate::geometry::Element::lean`].
pub(crate) fn mean_over(samples: &[f32; 5], count: u8, [along, across]: [f32; 2]) -> f32 {
    let [a, b, c, d, _] = *samples;
    let slopes = if count == 4 { (b + c - a - d) * along + (c + d - a - b) * across } else { 0.0 };
    mean(samples, count) + 0.25 / INNER * slopes
}

/// Samples to corners.
#[inline(always)]
pub(crate) fn to_corners(samples: &[f32; 5], count: u8) -> [f32; 5] {
    let [a, b, c, d, m] = *samples;
    if count == 4 {
        let around = 0.25 * (a + b + c + d);
        let bulge = (m - around) / (INNER * INNER);
        let base = m - bulge;
        let (u, v) = (0.25 * (b + c - a - d) / INNER, 0.25 * (c + d - a - b) / INNER);
        let twist = 0.25 * (a + c - b - d) / (INNER * INNER);
        [base - u - v + twist, base + u - v - twist, base + u + v + twist, base - u + v - twist, m]
    } else {
        let around = (a + b + c) / 3.0;
        let base = m - (m - around) / (INNER * INNER);
        let corner = |value: f32| base + (value - around) / INNER;
        [corner(a), corner(b), corner(c), corner(c), m]
    }
}

/// Corners to samples.
#[inline(always)]
pub(crate) fn to_samples(corners: &[f32; 5], count: u8) -> [f32; 5] {
    let [a, b, c, d, m] = *corners;
    if count == 4 {
        let base = 0.25 * (a + b + c + d);
        let bulge = (m - base) * (1.0 - INNER * INNER);
        let (u, v) = (0.25 * (b + c - a - d) * INNER, 0.25 * (c + d - a - b) * INNER);
        let twist = 0.25 * (a + c - b - d) * INNER * INNER;
        let level = base + bulge;
        [level - u - v + twist, level + u - v - twist, level + u + v + twist, level - u + v - twist, m]
    } else {
        let base = (a + b + c) / 3.0;
        let level = base + (m - base) * (1.0 - INNER * INNER);
        let sample = |value: f32| level + (value - base) * INNER;
        [sample(a), sample(b), sample(c), sample(c), m]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isolux_core::tree::Cut;
    use proptest::prelude::*;

    proptest! {
        /// Catches forms that do not say the same: to corners and back nothing changes.
        #[test]
        fn both_forms_are_one_function(samples in prop::array::uniform5(-1.0_f32..1.0), quadrilateral: bool) {
            let count = if quadrilateral { 4 } else { 3 };
            let back = to_samples(&to_corners(&samples, count), count);
            for k in (0..5).filter(|&k| k != 3 || count == 4) {
                // Six operations on numbers up to 10.
                prop_assert!((back[k] - samples[k]).abs() < 1e-5, "{samples:?} {back:?}");
            }
        }

        /// Catches a mean that is not that of the function: by quarters it is the same, three levels down.
        #[test]
        fn means_are_kept_on_the_way_down(samples in prop::array::uniform5(-1.0_f32..1.0), quadrilateral: bool) {
            let count = if quadrilateral { 4 } else { 3 };
            let corners = to_corners(&samples, count);
            let mut sum = 0.0;
            for path in 0..64_usize {
                let part = [path & 3, path >> 2 & 3, path >> 4]
                    .iter()
                    .fold(corners, |part, &quadrant| crate::light::part_of(&part, count, Cut::Quarters, quadrant));
                sum += part[..count as usize].iter().sum::<f32>() / f32::from(count);
            }
            // At the third level the mean of the corners is off the mean by a 64th of the bulge's.
            let bulge = corners[MIDDLE] - corners[..count as usize].iter().sum::<f32>() / f32::from(count);
            let own = if count == 4 { 2.0 / 3.0 } else { 0.75 } * bulge / 64.0;
            prop_assert!((sum / 64.0 + own - mean(&samples, count)).abs() < 1e-5, "{} {}", sum / 64.0, mean(&samples, count));
        }
    }

    /// Catches a mean that takes both ends of a trapezium for alike: of x over one that is 1 wide at x = 0 and 3 at x = 1, its
    /// centroid's.
    #[test]
    fn the_wide_end_of_a_quadrilateral_counts_more() {
        let corners = [[0.0, -0.5], [1.0, -1.5], [1.0, 1.5], [0.0, 0.5]].map(|[x, y]| glam::Vec3::new(x, y, 0.0));
        let path = isolux_core::tree::Path::root(0);
        for turn in 0..4 {
            let turned = std::array::from_fn(|k| corners[(k + turn) % 4]);
            let element = crate::geometry::Element::new(turned, 4, 0, u32::MAX, path);
            let centre = element.centre();
            let at = |k: usize| if k == MIDDLE { centre.x } else { centre.x + (turned[k].x - centre.x) * INNER };
            let mean = mean_over(&std::array::from_fn(at), 4, element.lean());
            assert!((mean - 7.0 / 12.0).abs() < 1e-6, "{turn}: {mean}");
        }
    }

    /// Catches a bulge that is not the quadratic it stands for: of u² + v² on a square, sampled, corners are 2.
    #[test]
    fn a_quadratic_function_is_met_exactly() {
        let at = 2.0 * INNER * INNER;
        let corners = to_corners(&[at, at, at, at, 0.0], 4);
        assert!(corners[..4].iter().all(|corner| (corner - 2.0).abs() < 1e-5), "{corners:?}");
        assert!((mean(&[at, at, at, at, 0.0], 4) - 2.0 / 3.0).abs() < 1e-6);
    }
}
