//! Visibility of one patch from another: two patches and a tree go in, the unblocked share of rays between their
//! sub-elements comes out; how it weighs with a form factor is left to links.
//!
//! Two ways of walking were tried, in a room of 348 polygons: rays one by one (9.8 to 15.7 microseconds for 16 rays) and
//! all rays of the pair as one beam (1.8); `docs/theory/visibility.md` has the rules and the table. The beam is
//! [`visibility`]; the other is kept as [`visibility_ray_by_ray`].

mod flow;
mod open_share;
mod point;
mod sample;

pub use open_share::{is_open, open_share};
pub use point::point_visibility;
pub(crate) use sample::SplitMix64;

use crate::kernels::{NoProbe, Patch, Probe};
use crate::scene::Scene;
use crate::tree::bsp::{Beam, Bsp, Packet, Segment, Surface, Verdict};
use glam::DVec3;
use sample::SUB_ELEMENTS;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use thiserror::Error;

/// How many rays join two patches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub enum Rays {
    /// The 16 sub-elements of one patch are joined with those of the other one to one.
    #[default]
    Sixteen,
    /// Each of the 16 sub-elements is joined with each of the other's.
    TwoHundredFiftySix,
}

/// What a ray counts for (D11).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    /// Every ray the same, as in the paper.
    Equal,
    /// What it would carry: between neighbours, rays are drawn as their light flows and count the same; between others,
    /// each has the weight `w = cos cos' / (pi r² + a)`, with the angles at both ends, its length r and the area a of a
    /// sub-element of the smaller patch, which bounds w. Equal rays misjudge `F V` where the near parts of two patches
    /// see each other and the far parts do not.
    #[default]
    Carried,
}

/// What becomes of parts of elements that something covers (D22).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Covered {
    /// They count as any other part, as in the paper: the element is as bright as all of it is on average, hidden parts
    /// included.
    Counted,
    /// They are [measured](open_share) and left out: the element is as bright as its open part.
    #[default]
    LeftOut,
}

/// How rays are drawn and counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampling {
    /// Number of rays.
    pub rays: Rays,
    /// What each counts for.
    pub weighting: Weighting,
}

/// Rays that count the same.
impl From<Rays> for Sampling {
    fn from(rays: Rays) -> Sampling {
        Sampling { rays, weighting: Weighting::Equal }
    }
}

/// A number of rays that is neither 16 nor 256.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{0} rays between two patches: expected 16 or 256")]
pub struct RaysError(pub u32);

impl TryFrom<u32> for Rays {
    type Error = RaysError;
    fn try_from(count: u32) -> Result<Rays, RaysError> {
        match count {
            16 => Ok(Rays::Sixteen),
            256 => Ok(Rays::TwoHundredFiftySix),
            other => Err(RaysError(other)),
        }
    }
}

impl From<Rays> for u32 {
    fn from(rays: Rays) -> u32 {
        match rays {
            Rays::Sixteen => 16,
            Rays::TwoHundredFiftySix => 256,
        }
    }
}

/// Visibility `V` of patches `a` and `b`.
///
/// `V = sum_k v_k / n`, over those `n` of the rays that leave both fronts: ray `k` joins a point of `a` with a point of
/// `b`, and counts when each end lies above the other's plane by more than `tau`; `v_k` is the product of
/// `1 - opacity` (D12) over the polygons that it meets, hits within `tau` of either plane left out. Rays behind a plane carry
/// nothing and are not counted (D10): the form factor has clipped them already.
///
/// - `bsp`, `scene`: the tree and the scene that it was built from; `tau` is [`Scene::tolerance`], metres.
/// - `a`, `b`: the patches, in the pair's canonical order (`visibility(b, a)` with the same seed draws other points).
/// - `sampling`: 16 rays, joining the 16 sub-elements of both by a random permutation, or all 256 pairs. Where none of the 16
///   counts, the 256 are tried; where none of those does, `V` is 0.
///   [`Weighting`] says what each counts for, and which rays neighbours get instead: at least 12 and at most 16 (192
///   and 256).
/// - `seed`: chooses the points in the sub-elements and the permutation; the caller mixes the pair's names into it.
///
/// Source: Podehl, Rauber, Rünger (1996), section 2 ("rays from 16 sub-elements to 16 sub-elements"), jittered here, so
/// that the mean over seeds is the share of all point pairs (points uniform in the patches' own coordinates) that see
/// each other.
///
/// Preconditions: patches planar and convex, corners counter-clockwise seen from the front, corners within `tau` of the
/// plane. The result lies in [0, 1] and does not depend on the tree's order of insertion.
///
/// Error: an estimate, with the standard deviation of a share `V` at most `1 / (2 sqrt(n))`: 0.125 by 16 rays (checked,
/// with its mean, by `partial_visibility_is_unbiased`), 0.145 between neighbours
/// (`visibility_of_neighbours_is_the_share_of_their_exchange`). Every ray is exact but for the tolerance
/// (`beams_agree_with_single_rays`, `rays_agree_with_a_search_over_all_polygons`).
pub fn visibility<P: Probe>(
    bsp: &Bsp,
    scene: &Scene,
    a: &Patch,
    b: &Patch,
    sampling: impl Into<Sampling>,
    seed: u64,
    probe: &mut P,
) -> f64 {
    sight(bsp, scene, a, b, sampling, seed, &mut Blocker::default(), probe).share
}

/// A visibility, and how it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// V, in `[0, 1]`.
    pub share: f64,
    /// True where no ray was needed: nothing stands between the patches, or one polygon hides all of one from all of
    /// the other. Else V is an estimate by rays, 0 and 1 included.
    pub proven: bool,
}

impl Sight {
    /// One polygon hides all of one patch from all of the other.
    pub const BLOCKED: Sight = Sight { share: 0.0, proven: true };
}

/// The fragment that blocked last; tried first on the next pair. It saves time where pairs come in an order of
/// neighbourhood, and never changes a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Blocker(Option<u32>);

/// As [`visibility`], with how it is known, and trying the polygon first that blocked the last pair.
#[expect(clippy::too_many_arguments, reason = "the arguments of `visibility` and the hint")]
pub fn sight<P: Probe>(
    bsp: &Bsp,
    scene: &Scene,
    a: &Patch,
    b: &Patch,
    sampling: impl Into<Sampling>,
    seed: u64,
    hint: &mut Blocker,
    probe: &mut P,
) -> Sight {
    probe.visibility();
    let Some(beam) = Beam::between((a.corners, a.plane), (b.corners, b.plane), bsp.tolerance()) else {
        return Sight::BLOCKED;
    };
    if let Some(fragment) = hint.0
        && bsp.blocks(&beam, fragment, probe)
    {
        return Sight::BLOCKED;
    }
    let sampling = sampling.into();
    let pair = Pair { bsp, scene, a, b, beam: &beam, sampling };
    match sampling.rays {
        Rays::Sixteen => {
            let shot = pair.shoot::<1>(seed, hint, probe, |sample| [sample.joined()]);
            shot.unwrap_or_else(|| {
                pair.shoot::<16>(seed, hint, probe, |sample| sample.crossed()).unwrap_or(Sight::BLOCKED)
            })
        }
        Rays::TwoHundredFiftySix => {
            pair.shoot::<16>(seed, hint, probe, |sample| sample.crossed()).unwrap_or(Sight::BLOCKED)
        }
    }
}

/// Two patches in a scene and the beam between them.
struct Pair<'a> {
    bsp: &'a Bsp,
    scene: &'a Scene,
    a: &'a Patch<'a>,
    b: &'a Patch<'a>,
    beam: &'a Beam,
    sampling: Sampling,
}

impl Pair<'_> {
    /// Share of light that passes in `N` packets of rays; `None` where no ray counts.
    ///
    /// Rays are made when the first polygon comes up that some of them may meet and others not: a pair that sees each
    /// other freely, or that one polygon blocks, needs none.
    fn shoot<const N: usize>(
        &self,
        seed: u64,
        hint: &mut Blocker,
        probe: &mut impl Probe,
        arrange: impl Fn(&Sample) -> [flow::Lanes; N],
    ) -> Option<Sight> {
        let prepare = |probe: &mut _| Shot::<N>::new(self.draw(seed, &arrange), probe);
        let mut shot: Option<Shot<N>> = None;
        if !self.beam.is_whole() {
            let prepared = prepare(probe);
            if prepared.count == 0 {
                return None;
            }
            shot = Some(prepared);
        }
        let walked = self.bsp.walk_beam(self.beam, probe, |probe, fragment, surface, verdict| {
            if verdict == Verdict::All && surface.opaque {
                hint.0 = Some(fragment);
                return ControlFlow::Break(Sight::BLOCKED);
            }
            let shot = shot.get_or_insert_with(|| prepare(probe));
            if shot.meet(surface) {
                hint.0 = Some(fragment);
                return ControlFlow::Break(Sight { share: 0.0, proven: false });
            }
            ControlFlow::Continue(())
        });
        match (walked, shot) {
            (ControlFlow::Break(blocked), _) => Some(blocked),
            (_, None) => Some(Sight { share: 1.0, proven: true }),
            (_, Some(shot)) => Some(Sight { share: shot.passed(self, probe), proven: false }),
        }
    }
}

/// Rays of a pair, and whether they count the same.
struct Drawn<const N: usize> {
    rays: [flow::Lanes; N],
    equal: bool,
}

impl Pair<'_> {
    /// Rays as light flows where the pair is near and rays count for what they carry, else between sample points.
    fn draw<const N: usize>(&self, seed: u64, arrange: impl Fn(&Sample) -> [flow::Lanes; N]) -> Drawn<N> {
        let equal = self.sampling.weighting == Weighting::Equal;
        let mut random = SplitMix64::new(seed);
        if !equal && let Some(rays) = flow::draw([self.a, self.b], self.bsp.tolerance(), &mut random) {
            return Drawn { rays, equal: true };
        }
        Drawn { rays: arrange(&Sample::new(self, seed)), equal }
    }

    /// What a ray between sample points would carry.
    fn weight(&self, segment: &Segment) -> f64 {
        let (heights, square) = segment.heights(self.bsp.tolerance());
        let area = self.a.area.min(self.b.area) / SUB_ELEMENTS as f64;
        heights[0] * heights[1] / (square * (std::f64::consts::PI * square + area))
    }
}

/// Sample points of a pair and the permutation that joins them.
struct Sample<'a> {
    pair: &'a Pair<'a>,
    from: [DVec3; SUB_ELEMENTS],
    to: [DVec3; SUB_ELEMENTS],
    partner: [u8; SUB_ELEMENTS],
}

impl<'a> Sample<'a> {
    fn new(pair: &'a Pair<'a>, seed: u64) -> Sample<'a> {
        let mut random = SplitMix64::new(seed);
        let from = sample::points(pair.a.corners, &mut random);
        let to = sample::points(pair.b.corners, &mut random);
        let mut partner: [u8; SUB_ELEMENTS] = std::array::from_fn(|k| k as u8);
        random.shuffle(&mut partner);
        Sample { pair, from, to, partner }
    }

    fn segment(&self, i: usize, j: usize) -> Option<Segment> {
        let planes = [self.pair.a.plane, self.pair.b.plane];
        Segment::between(self.from[i], self.to[j], planes, self.pair.bsp.tolerance())
    }

    /// Each point with its partner.
    fn joined(&self) -> flow::Lanes {
        std::array::from_fn(|k| self.segment(k, self.partner[k] as usize))
    }

    /// Each point with each of the other patch.
    fn crossed(&self) -> [flow::Lanes; SUB_ELEMENTS] {
        std::array::from_fn(|i| std::array::from_fn(|j| self.segment(i, j)))
    }
}

/// Rays on their way: which are still unblocked, and which met something that lets light pass.
struct Shot<const N: usize> {
    packets: [Packet; N],
    present: [u16; N],
    open: [u16; N],
    dimmed: [u16; N],
    count: u32,
    equal: bool,
}

impl<const N: usize> Shot<N> {
    fn new(drawn: Drawn<N>, probe: &mut impl Probe) -> Shot<N> {
        let packets: [_; N] = std::array::from_fn(|k| Packet::new(|lane| drawn.rays[k][lane]));
        let present: [u16; N] = std::array::from_fn(|k| packets[k].1);
        let count = present.iter().map(|present| present.count_ones()).sum();
        for _ in 0..count {
            probe.ray();
        }
        Shot {
            packets: packets.map(|(packet, _)| packet),
            present,
            open: present,
            dimmed: [0; N],
            count,
            equal: drawn.equal,
        }
    }

    /// Tests a polygon against the rays that are still open; true when it blocked the last of them.
    fn meet(&mut self, surface: &Surface) -> bool {
        let mut open = 0;
        for k in 0..N {
            if self.open[k] != 0 {
                let met = self.packets[k].meet(surface);
                if surface.opaque {
                    self.open[k] &= !met;
                } else {
                    self.dimmed[k] |= met;
                }
                open |= self.open[k];
            }
        }
        open == 0
    }

    /// Weighted mean over all rays of what passes: a dimmed ray is followed on its own.
    fn passed(&self, pair: &Pair<'_>, probe: &mut impl Probe) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for k in 0..N {
            for lane in (0..SUB_ELEMENTS).filter(|&lane| self.present[k] >> lane & 1 == 1) {
                let weight = if self.equal { 1.0 } else { pair.weight(&self.packets[k].segment(lane)) };
                total += weight;
                if self.open[k] >> lane & 1 == 1 {
                    let dimmed = self.dimmed[k] >> lane & 1 == 1;
                    let passing = if dimmed {
                        pair.bsp.lane_transmittance(pair.scene, &self.packets[k], lane, probe)
                    } else {
                        1.0
                    };
                    sum += weight * passing;
                }
            }
        }
        sum / total
    }
}

/// The same number as [`visibility`], bit for bit, by rays that walk the tree one by one: what the paper's program does,
/// and what the counts of its study are made of.
pub fn visibility_ray_by_ray<P: Probe>(
    bsp: &Bsp,
    scene: &Scene,
    a: &Patch,
    b: &Patch,
    sampling: impl Into<Sampling>,
    seed: u64,
    probe: &mut P,
) -> f64 {
    probe.visibility();
    let Some(beam) = Beam::between((a.corners, a.plane), (b.corners, b.plane), bsp.tolerance()) else { return 0.0 };
    let sampling = sampling.into();
    let pair = Pair { bsp, scene, a, b, beam: &beam, sampling };
    let mut passed = |drawn: &[flow::Lanes], equal: bool| {
        let (mut count, mut sum, mut total) = (0_u32, 0.0, 0.0);
        for segment in drawn.iter().flatten().flatten() {
            probe.ray();
            count += 1;
            let weight = if equal { 1.0 } else { pair.weight(segment) };
            total += weight;
            sum += weight * bsp.segment_transmittance(scene, *segment, probe);
        }
        (count > 0).then(|| sum / total)
    };
    let sixteen = (sampling.rays == Rays::Sixteen)
        .then(|| pair.draw(seed, |sample| [sample.joined()]))
        .and_then(|drawn| passed(&drawn.rays, drawn.equal));
    sixteen.unwrap_or_else(|| {
        let drawn = pair.draw(seed, |sample| sample.crossed());
        passed(&drawn.rays, drawn.equal).unwrap_or(0.0)
    })
}

/// As [`sight`] without a hint, bit for bit, told to `probe` as rays that walk the tree one by one: proven or not,
/// every ray walks until something opaque stops it, as in [`visibility_ray_by_ray`].
pub fn sight_ray_by_ray<P: Probe>(
    bsp: &Bsp,
    scene: &Scene,
    a: &Patch,
    b: &Patch,
    sampling: impl Into<Sampling>,
    seed: u64,
    probe: &mut P,
) -> Sight {
    let sampling = sampling.into();
    let share = visibility_ray_by_ray(bsp, scene, a, b, sampling, seed, probe);
    let sight = sight(bsp, scene, a, b, sampling, seed, &mut Blocker::default(), &mut NoProbe);
    debug_assert_eq!(sight.share.to_bits(), share.to_bits());
    sight
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches a number of rays that is written as a name, or one that is not 16 or 256 and is taken.
    #[test]
    fn rays_are_numbers() {
        assert_eq!([Rays::Sixteen, Rays::TwoHundredFiftySix].map(u32::from), [16, 256]);
        assert_eq!([16, 256].map(Rays::try_from), [Ok(Rays::Sixteen), Ok(Rays::TwoHundredFiftySix)]);
        assert_eq!(Rays::try_from(17), Err(RaysError(17)));
    }
}
