//! Decides for one link: keep it, split its receiver, split its source.

use super::Probe;

/// What becomes of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// It carries little enough, or cannot be refined further.
    Keep,
    /// The receiver's children take it over.
    SplitReceiver,
    /// It is replaced by links to the source's children.
    SplitSource,
}

/// Thresholds of BF refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// `BF_eps`: irradiance that one link may carry, W/m² or lm/m².
    pub bf: f64,
    /// `A_eps`: area above which an element may be split, m².
    pub area: f64,
}

/// BF refinement: `V_ij F_ij B_j > BF_eps` asks for a split of the larger of the two elements, which is granted if
/// its area is above `A_eps`.
///
/// - `visibility` V_ij, share of rays that pass, in `[0, 1]`
/// - `form_factor` F_ij, share of what leaves the receiver that reaches the source, in `[0, 1]`
/// - `radiosity` B_j of the source, mean over bands, W/m² or lm/m²
/// - `areas` of receiver and source, m²; of two equal ones the receiver is split
///
/// Source: Hanrahan, Salzman, Aupperle 1991, "A rapid hierarchical radiosity algorithm", section 3 (BF refinement);
/// Podehl, Rauber, Rünger 1996, section 2.
///
/// Preconditions: all values finite and not negative. The decision is exact: there is no error to bound.
#[must_use]
pub fn bf_refinement<P: Probe>(
    visibility: f64,
    form_factor: f64,
    radiosity: f64,
    areas: [f64; 2],
    thresholds: &Thresholds,
    probe: &mut P,
) -> Decision {
    probe.oracle();
    let [receiver, source] = areas;
    if visibility * form_factor * radiosity <= thresholds.bf || receiver.max(source) <= thresholds.area {
        Decision::Keep
    } else if receiver >= source {
        Decision::SplitReceiver
    } else {
        Decision::SplitSource
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::NoProbe;

    const THRESHOLDS: Thresholds = Thresholds { bf: 0.1, area: 1.0 };

    fn decide(v: f64, f: f64, b: f64, areas: [f64; 2]) -> Decision {
        bf_refinement(v, f, b, areas, &THRESHOLDS, &mut NoProbe)
    }

    /// Catches a test that forgets one of the three factors or compares the wrong way round.
    #[test]
    fn keeps_links_that_carry_at_most_bf_eps() {
        assert_eq!(decide(1.0, 0.1, 1.0, [4.0, 2.0]), Decision::Keep);
        assert_eq!(decide(0.5, 0.3, 0.5, [4.0, 2.0]), Decision::Keep);
        assert_eq!(decide(0.0, 1.0, 1e9, [4.0, 2.0]), Decision::Keep);
        assert_ne!(decide(1.0, 0.2, 1.0, [4.0, 2.0]), Decision::Keep);
    }

    /// Catches splitting the smaller, or splitting below the area floor.
    #[test]
    fn splits_the_larger_above_the_floor() {
        assert_eq!(decide(1.0, 0.5, 1.0, [4.0, 2.0]), Decision::SplitReceiver);
        assert_eq!(decide(1.0, 0.5, 1.0, [2.0, 4.0]), Decision::SplitSource);
        assert_eq!(decide(1.0, 0.5, 1.0, [2.0, 2.0]), Decision::SplitReceiver);
        assert_eq!(decide(1.0, 0.5, 1.0, [1.0, 0.5]), Decision::Keep);
        assert_eq!(decide(1.0, 0.5, 1.0, [0.5, 1.5]), Decision::SplitSource);
    }
}
