//! Pseudo-random points and directions, the same on every platform: no call of a platform's maths library.

use crate::scene::{Corners, Plane};
use glam::DVec3;

/// Increment of the sequence: 2^64 over the golden ratio, made odd.
pub(crate) const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A bijection that scatters 64 bits (SplitMix64: Steele, Lea, Flood 2014, "Fast splittable pseudorandom number
/// generators", with Stafford's variant 13 of the finaliser).
#[must_use]
pub fn mix(state: u64) -> u64 {
    let state = state.wrapping_add(GOLDEN);
    let state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    state ^ (state >> 31)
}

/// A stream of numbers in `[0, 1)` from a seed.
#[derive(Clone, Debug)]
pub struct Stream(u64);

impl Stream {
    /// A stream; different seeds give unrelated streams.
    #[must_use]
    pub fn new(seed: u64) -> Stream {
        Stream(mix(seed))
    }

    /// The next 64 bits.
    pub fn next_bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// The next number in `[0, 1)`, of 53 bits.
    pub fn next_unit(&mut self) -> f64 {
        (self.next_bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A direction about a unit normal with density `cos / pi` (Malley's method: a uniform point of the disk, by
    /// rejection, lifted to the hemisphere).
    pub fn cosine_direction(&mut self, normal: DVec3) -> DVec3 {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        loop {
            let (x, y) = (2.0 * self.next_unit() - 1.0, 2.0 * self.next_unit() - 1.0);
            let square = x * x + y * y;
            if square < 1.0 {
                return tangent * x + bitangent * y + normal * (1.0 - square).sqrt();
            }
        }
    }

    /// A point of a convex patch, uniform by area.
    pub fn point(&mut self, corners: &Corners, plane: &Plane) -> DVec3 {
        let (a, b, c) = (corners[0], corners[1], corners[2]);
        let half = |p: DVec3, q: DVec3, r: DVec3| plane.normal.dot((q - p).cross(r - p));
        let first = half(a, b, c);
        let second = if corners.len() == 4 { half(a, c, corners[3]) } else { 0.0 };
        let (b, c) = if self.next_unit() * (first + second) < first { (b, c) } else { (c, corners[corners.len() - 1]) };
        let (mut u, mut v) = (self.next_unit(), self.next_unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        a + (b - a) * u + (c - a) * v
    }
}
