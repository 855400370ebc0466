//! Sample points: a patch and a random sequence go in, one jittered point in each of its 16 sub-elements comes out (D9).

use crate::sampling::{GOLDEN, mix};
use crate::scene::Corners;
use glam::DVec3;

/// A random sequence that is the same on every machine: SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom
/// number generators", OOPSLA 2014, with its published constants).
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplitMix64 {
    state: u64,
}

impl SplitMix64 {
    pub(crate) fn new(seed: u64) -> SplitMix64 {
        SplitMix64 { state: seed }
    }

    /// The next 64 bits.
    #[inline]
    pub(crate) fn next(&mut self) -> u64 {
        let bits = mix(self.state);
        self.state = self.state.wrapping_add(GOLDEN);
        bits
    }

    /// A permutation (Fisher, Yates), every one equally likely up to `count / 2^32`.
    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            let other = ((self.next() >> 32) * (last as u64 + 1)) >> 32;
            items.swap(last, other as usize);
        }
    }

    /// Two numbers strictly between 0 and 1, multiples of 2^-33.
    #[inline]
    fn pair(&mut self) -> [f64; 2] {
        let bits = self.next();
        [bits >> 32, bits & 0xffff_ffff].map(|half| (half as f64 + 0.5) * (1.0 / 4_294_967_296.0))
    }
}

/// Sub-elements of a patch: 4 x 4, after Podehl, Rauber, Rünger 1996.
pub(super) const SUB_ELEMENTS: usize = 16;

/// One point in each of the 16 sub-elements.
///
/// A quadrilateral is cut in 4 x 4 by its bilinear map `x(s, t)`, `s, t` in [0, 1]; the point is uniform in `s` and `t`
/// (for a parallelogram: in area). A triangle is cut in 16 congruent ones, four rows parallel to its first edge; the
/// point is uniform in area.
pub(super) fn points(corners: &Corners, random: &mut SplitMix64) -> [DVec3; SUB_ELEMENTS] {
    match **corners {
        [a, b, c, d] => {
            let (along, across, twist) = (b - a, d - a, (c - d) - (b - a));
            std::array::from_fn(|k| {
                let [p, q] = random.pair();
                let (s, t) = (0.25 * ((k % 4) as f64 + p), 0.25 * ((k / 4) as f64 + q));
                a + along * s + across * t + twist * (s * t)
            })
        }
        [a, b, c] => {
            let (along, across) = ((b - a) * 0.25, (c - a) * 0.25);
            std::array::from_fn(|k| {
                let [p, q] = random.pair();
                let (p, q) = if p + q > 1.0 { (1.0 - p, 1.0 - q) } else { (p, q) };
                let (column, row, upright) = TRIANGLES[k];
                let (s, t) = if upright { (column + p, row + q) } else { (column + 1.0 - p, row + 1.0 - q) };
                a + along * s + across * t
            })
        }
        _ => unreachable!("corners are three or four"),
    }
}

/// Column and row of the 16 sub-triangles, and whether they stand upright like their parent.
const TRIANGLES: [(f64, f64, bool); SUB_ELEMENTS] = {
    let mut table = [(0.0, 0.0, true); SUB_ELEMENTS];
    let (mut k, mut row) = (0, 0);
    while row < 4 {
        let mut column = 0;
        while column < 4 - row {
            table[k] = (column as f64, row as f64, true);
            k += 1;
            if column < 3 - row {
                table[k] = (column as f64, row as f64, false);
                k += 1;
            }
            column += 1;
        }
        row += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches a wrong constant or shift: the published first outputs for seed 1234567 (Vigna's splitmix64.c, as quoted
    /// by Rosetta Code, "Pseudo-random numbers/Splitmix64").
    #[test]
    fn sequence_is_the_published_one() {
        let mut random = SplitMix64::new(1_234_567);
        let outputs: Vec<u64> = (0..5).map(|_| random.next()).collect();
        let published = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        assert_eq!(outputs, published);
    }

    /// Catches sub-elements that overlap, stick out or are missed: 16,000 points in each half of the patch and each
    /// quarter of it, by their shares of the area.
    #[test]
    fn points_cover_triangles_and_quads_evenly() {
        let triangle = Corners::triangle(DVec3::ZERO, DVec3::X, DVec3::Y);
        let quad = Corners::quad(DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y);
        let mut random = SplitMix64::new(5);
        for (corners, low) in [(triangle, 1.0 / 4.0), (quad, 1.0 / 4.0)] {
            let (mut count, mut near_corner, mut mean) = (0, 0, DVec3::ZERO);
            for _ in 0..1000 {
                for p in points(&corners, &mut random) {
                    assert!(p.x > 0.0 && p.y > 0.0 && p.z == 0.0);
                    assert!(if corners.len() == 3 { p.x + p.y < 1.0 } else { p.x < 1.0 && p.y < 1.0 });
                    count += 1;
                    let share = if corners.len() == 3 { p.x + p.y < 0.5 } else { p.x < 0.5 && p.y < 0.5 };
                    near_corner += u32::from(share);
                    mean += p;
                }
            }
            // Exactly a quarter of the sub-elements lies in that quarter of the patch: no scatter at all.
            assert_eq!(f64::from(near_corner) / f64::from(count), low);
            // Scatter of the mean: 1/4 sub-element / sqrt(12 * 16000) = 6e-4; five times that.
            assert!((mean / f64::from(count) - corners.mean()).length() < 3e-3);
        }
    }
}
