//! Rays as the light flows: two patches close to each other go in, rays that all carry the same come out.
//!
//! Between patches that touch, most of the exchange runs along the common edge, and of 16 rays that join random points,
//! one or none runs there: weights do not help a ray that was not drawn. So directions are drawn as a diffuse surface
//! sends light, and what meets the other patch is a sample of the exchange itself.

use super::sample::{self, SUB_ELEMENTS, SplitMix64};
use crate::kernels::Patch;
use crate::tree::bsp::Segment;
use glam::{DVec2, DVec3};

/// Rays of one packet, `None` where a lane is free.
pub(super) type Lanes = [Option<Segment>; SUB_ELEMENTS];

/// Squared distance of the middles, in areas of the larger patch, up to which rays are drawn so: beyond it, fewer than
/// [`LEAST`] of all directions meet the other (`A / (pi r²)` is 1/64 where both look at each other, less elsewhere).
const NEAR: f64 = 64.0 / std::f64::consts::PI;

/// Least rays of a packet. With 4 in place of 12, all of them blocked or open by chance, the Cornell box at an asked
/// error of 0.1 is off by 7.8 % in place of 5.9 %.
const LEAST: usize = 12;

/// Rounds for a packet, until enough rays are found.
const ROUNDS: usize = 4;

/// Directions of a round, tried in four passes, of which each covers the hemisphere evenly.
const DIRECTIONS: usize = 256;
const PASSES: usize = 4;

/// Rays between two patches, distributed as the light that they exchange unhindered: `N` packets at most, fewer where
/// fewer directions meet the other patch; `None` where the patches are too far apart or turned away for this.
///
/// Points `x` in the 16 sub-elements of the smaller patch, directions with density `cos / pi` about its normal (points
/// of the disk, lifted: Malley's method), kept where they meet the larger one: the pairs `(x, y)` have the density
/// `cos cos' / (pi r² A F)` of the exchange, so that `V` is the share of them that passes.
///
/// The disk's points are those of a sunflower (Vogel 1979, "A better way to construct the sunflower head", equation of
/// the golden angle), turned at random for each x.
pub(super) fn draw<const N: usize>([a, b]: [&Patch; 2], tolerance: f64, random: &mut SplitMix64) -> Option<[Lanes; N]> {
    let larger = a.area.max(b.area);
    if (b.corners.mean() - a.corners.mean()).length_squared() > NEAR * larger {
        return None;
    }
    let from_a = a.area <= b.area;
    let (from, to) = if from_a { (a, b) } else { (b, a) };
    let target = Target::new(from, to);
    let mut found: Vec<Segment> = Vec::with_capacity(2 * N * SUB_ELEMENTS);
    for pass in 0..PASSES * ROUNDS * N {
        let points = sample::points(from.corners, random);
        let mut turn_of: [u8; SUB_ELEMENTS] = std::array::from_fn(|k| k as u8);
        random.shuffle(&mut turn_of);
        for (k, &x) in points.iter().enumerate() {
            let seen = target.from(x);
            let turn = UNIT[(random.next() >> 56) as usize];
            for quarter in 0..DIRECTIONS / (SUB_ELEMENTS * PASSES) {
                let at = quarter * SUB_ELEMENTS * PASSES + turn_of[k] as usize * PASSES + pass % PASSES;
                if let Some(y) = seen.meet(SUNFLOWER[at], turn) {
                    let ends = if from_a { [x, y] } else { [y, x] };
                    found.extend(Segment::between(ends[0], ends[1], [a.plane, b.plane], tolerance));
                }
            }
        }
        if found.len() >= N * SUB_ELEMENTS {
            break;
        }
    }
    (found.len() >= LEAST * N).then(|| spread(&found, random))
}

/// At most `16 N` of the segments, evenly chosen from a random start: each with the same chance.
fn spread<const N: usize>(found: &[Segment], random: &mut SplitMix64) -> [Lanes; N] {
    let wanted = found.len().min(N * SUB_ELEMENTS);
    // Positions in units of 2^-32.
    let (start, count) = (random.next() >> 32, found.len() as u64);
    std::array::from_fn(|packet| {
        std::array::from_fn(|lane| {
            let k = packet * SUB_ELEMENTS + lane;
            (k < wanted).then(|| found[(((((k as u64) << 32) + start) / wanted as u64 * count) >> 32) as usize])
        })
    })
}

/// The larger patch in the axes of the smaller one.
struct Target {
    axes: [DVec3; 3],
    plane: (DVec3, f64),
    normal: DVec3,
    /// Inward normals of the edges, in the axes and in the world, and their offsets.
    edges: [(DVec3, DVec3, f64); 4],
}

impl Target {
    fn new(from: &Patch, to: &Patch) -> Target {
        let (tangent, bitangent) = from.plane.normal.any_orthonormal_pair();
        let axes = [tangent, bitangent, from.plane.normal];
        let local = |v: DVec3| DVec3::from_array(axes.map(|axis| axis.dot(v)));
        let corners = to.corners;
        let edges = std::array::from_fn(|k| {
            // A triangle has its last edge twice.
            let k = k.min(corners.len() - 1);
            let (start, end) = (corners[k], corners[(k + 1) % corners.len()]);
            let inward = to.plane.normal.cross(end - start);
            (local(inward), inward, inward.dot(start))
        });
        Target { axes, plane: (to.plane.normal, to.plane.offset), normal: local(to.plane.normal), edges }
    }

    fn from(&self, x: DVec3) -> Seen<'_> {
        let heights = self.edges.map(|(_, inward, offset)| inward.dot(x) - offset);
        Seen { target: self, x, height: self.plane.0.dot(x) - self.plane.1, heights }
    }
}

/// The larger patch as seen from a point.
struct Seen<'a> {
    target: &'a Target,
    x: DVec3,
    height: f64,
    heights: [f64; 4],
}

impl Seen<'_> {
    /// Where a direction of the disk, turned, meets the patch.
    #[inline]
    fn meet(&self, disk: DVec3, turn: DVec2) -> Option<DVec3> {
        let turned = turn.rotate(DVec2::new(disk.x, disk.y));
        let direction = DVec3::new(turned.x, turned.y, disk.z);
        let fall = -self.target.normal.dot(direction);
        if !(fall > 0.0 && self.height > 0.0) {
            return None;
        }
        // The edges' heights at the point of meeting, times `fall`.
        let inside = self
            .target
            .edges
            .iter()
            .zip(self.heights)
            .all(|(&(inward, ..), height)| height * fall + self.height * inward.dot(direction) >= 0.0);
        inside.then(|| {
            let [tangent, bitangent, normal] = self.target.axes;
            let world = tangent * direction.x + bitangent * direction.y + normal * direction.z;
            self.x + world * (self.height / fall)
        })
    }
}

/// `exp(i k phi)` with the golden angle phi, for k from 0 to 255.
const UNIT: [DVec2; DIRECTIONS] = {
    // cos and sin of the golden angle, pi (3 - sqrt 5).
    let (cosine, sine) = (-0.737_368_878_078_319_7_f64, 0.675_490_294_261_523_8_f64);
    let mut table = [DVec2::X; DIRECTIONS];
    let mut k = 1;
    while k < DIRECTIONS {
        let last = table[k - 1];
        table[k] = DVec2::new(last.x * cosine - last.y * sine, last.x * sine + last.y * cosine);
        k += 1;
    }
    table
};

/// Points of the unit disk, evenly spread, each with the height of the hemisphere above it.
const SUNFLOWER: [DVec3; DIRECTIONS] = {
    let mut table = [DVec3::Z; DIRECTIONS];
    let mut k = 0;
    while k < DIRECTIONS {
        let square = (k as f64 + 0.5) / DIRECTIONS as f64;
        let radius = root(square);
        table[k] = DVec3::new(UNIT[k].x * radius, UNIT[k].y * radius, root(1.0 - square));
        k += 1;
    }
    table
};

/// Square root of a number between 0 and 1, at compile time (Newton's iteration from above).
const fn root(square: f64) -> f64 {
    let mut guess = 1.0;
    let mut round = 0;
    // From 1 down to 1/16 (the table's least) takes four halvings, then digits double.
    while round < 12 {
        guess = 0.5 * (guess + square / guess);
        round += 1;
    }
    guess
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches a wrong constant or a root that has not settled: all on the unit sphere, evenly spread over the disk.
    #[test]
    fn directions_are_evenly_spread() {
        for direction in SUNFLOWER {
            // Rounding of 256 turns: measured 3e-14.
            assert!((direction.length() - 1.0).abs() < 1e-13, "{direction}");
        }
        // Mean cosine of a cosine distribution: 2/3. Midpoints in the square of the radius give it to 1e-4.
        let mean = SUNFLOWER.iter().map(|direction| direction.z).sum::<f64>() / DIRECTIONS as f64;
        assert!((mean - 2.0 / 3.0).abs() < 1e-4, "{mean}");
        // Sectors of 22.5 degrees hold 16 points each, give or take two.
        for sector in 0..16 {
            let inside = SUNFLOWER
                .iter()
                .filter(|d| {
                    (d.y.atan2(d.x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU * 16.0) as usize == sector
                })
                .count();
            assert!(inside.abs_diff(16) <= 2, "{sector}: {inside}");
        }
    }
}
