//! Arithmetic of single elements: what arrives, or what the children have, goes in; radiosity, irradiance and open
//! share come out. Pure functions, so that whoever orders the work computes the same bits.

use crate::units::Rgb;
use std::ops::{Add, Mul, Sub};

/// Light on an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// B, W/m² or lm/m², mean over the open part.
    pub radiosity: Rgb,
    /// H, W/m² or lm/m², mean over the whole element.
    pub irradiance: Rgb,
    /// Share s of the element that nothing covers, in `[0, 1]`; 1 where covered parts are counted as any other.
    pub open_share: f64,
}

/// `B = E + rho H` of a leaf of which nothing counts as covered.
#[must_use]
pub fn reflected(emission: Rgb, reflectance: Rgb, irradiance: Rgb) -> Rgb {
    emission + reflectance * irradiance
}

/// Light on a leaf whose open part receives `open` on average, W/m² or lm/m²: `B = E + rho open` and `H = s open` with
/// the open share s. Where nothing is open, nothing arrives; for `s = 1` this is [`reflected`], bit for bit.
#[must_use]
pub fn settled(emission: Rgb, reflectance: Rgb, open: Rgb, open_share: f64) -> Values {
    let open = if open_share > 0.0 { open } else { Rgb::ZERO };
    Values { radiosity: reflected(emission, reflectance, open), irradiance: open * open_share, open_share }
}

/// Weights of four children by area, `A_k / A`: those of [`mean_of_children`] where nothing counts as covered.
#[must_use]
pub fn area_weights(areas: [f64; 4], parent: f64) -> [f64; 4] {
    areas.map(|child| child / parent)
}

/// `x_0 + sum_k (x_k - x_0) w_k` over four children, k = 0 included: their mean by weights that add up to 1, and
/// exactly their value where they are equal.
#[must_use]
pub fn mean_of_children<T>(values: [T; 4], weights: [f64; 4]) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let base = values[0];
    values.into_iter().zip(weights).fold(base, |sum, (value, weight)| sum + (value - base) * weight)
}

/// Light on an element from its four children's, of `areas` in m², and its own area `parent`: irradiance and open share
/// by area (D17), radiosity by open area. Where all open shares are 1, radiosity and irradiance are the
/// [`mean_of_children`] by [`area_weights`], bit for bit.
#[must_use]
pub fn pulled(children: [Values; 4], areas: [f64; 4], parent: f64) -> Values {
    let by_area = area_weights(areas, parent);
    let open_shares = children.map(|child| child.open_share);
    let open_share = mean_of_children(open_shares, by_area);
    let open = [0, 1, 2, 3].map(|k| areas[k] * open_shares[k]);
    let open_area: f64 = open.iter().sum();
    let weights = if open_share < 1.0 && open_area > 0.0 { open.map(|child| child / open_area) } else { by_area };
    Values {
        radiosity: mean_of_children(children.map(|child| child.radiosity), weights),
        irradiance: mean_of_children(children.map(|child| child.irradiance), by_area),
        open_share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn child(k: usize, open_share: f64) -> Values {
        let of = |x: f64| Rgb([x, 2.0 * x, 1.0 / (1.0 + x)]);
        Values { radiosity: of(0.1 + k as f64), irradiance: of(0.7 / (1.0 + k as f64)), open_share }
    }

    /// Catches a short form for uncovered scenes that differs from the general one in a bit.
    #[test]
    fn uncovered_elements_have_a_short_form() {
        let (areas, parent) = ([0.3, 0.2, 0.15, 0.31], 0.96);
        let children = [0, 1, 2, 3].map(|k| child(k, 1.0));
        let weights = area_weights(areas, parent);
        let whole = pulled(children, areas, parent);
        assert_eq!(whole.radiosity, mean_of_children(children.map(|c| c.radiosity), weights));
        assert_eq!(whole.irradiance, mean_of_children(children.map(|c| c.irradiance), weights));
        assert_eq!(whole.open_share, 1.0);
        let (emission, reflectance, arriving) = (Rgb([0.1, 0.0, 3.0]), Rgb([0.3, 0.7, 0.9]), children[1].radiosity);
        let leaf = settled(emission, reflectance, arriving, 1.0);
        assert_eq!((leaf.radiosity, leaf.irradiance), (reflected(emission, reflectance, arriving), arriving));
    }

    /// Catches means weighted by the wrong area, equal children whose parent differs from them, and light where nothing
    /// is open.
    #[test]
    fn covered_parts_weigh_nothing_in_radiosity() {
        let areas = [0.25; 4];
        let dark = Values { radiosity: Rgb::splat(5.0), irradiance: Rgb::ZERO, open_share: 0.0 };
        // Binary fractions: no sum is rounded.
        let open = Values { radiosity: Rgb([1.5, 0.25, 3.0]), irradiance: Rgb([0.5, 2.0, 4.0]), open_share: 1.0 };
        let pulled_up = pulled([dark, open, open, dark], areas, 1.0);
        assert_eq!((pulled_up.radiosity, pulled_up.open_share), (open.radiosity, 0.5));
        assert_eq!(pulled_up.irradiance, open.irradiance * 0.5);
        let thirds = [0.1, 0.2, 0.3, 0.4];
        let half = child(2, 0.3);
        assert_eq!(pulled([half; 4], thirds, 1.0), half);
        let covered = settled(Rgb::splat(0.5), Rgb::splat(0.5), Rgb::splat(9.0), 0.0);
        assert_eq!((covered.radiosity, covered.irradiance), (Rgb::splat(0.5), Rgb::ZERO));
    }
}
