//! Where rays between two nodes start and end: strata of both, paired by a hash of their names.

use crate::clusters::Clusters;
use crate::geometry::{Element, Geometry};
use crate::link::CLUSTER;
use glam::Vec3;
use isolux_core::sampling::mix;
use isolux_simd::bvh::Rays;
use std::sync::LazyLock;

/// Rays of a packet.
pub(crate) const RAYS: usize = 16;

/// A stream of numbers from a name.
#[derive(Clone, Debug)]
pub(crate) struct Jitter(u64);

impl Jitter {
    pub(crate) fn new(a: u64, b: u64, seed: u64) -> Jitter {
        Jitter(mix(a ^ mix(b ^ mix(seed))))
    }

    /// Four numbers in [0, 1), of 16 bits each.
    #[inline(always)]
    pub(crate) fn four(&mut self) -> [f32; 4] {
        let bits = self.bits();
        std::array::from_fn(|k| ((bits >> (16 * k)) & 0xffff) as f32 * (1.0 / 65536.0))
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }
}

/// Barycentric corners `(b, c)` of the 4^depth parts of a triangle, in the order of its quadtree.
fn parts(depth: u32) -> Vec<[[f32; 2]; 3]> {
    let mut all = vec![[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]];
    for _ in 0..depth {
        let middle = |p: [f32; 2], q: [f32; 2]| [(p[0] + q[0]) * 0.5, (p[1] + q[1]) * 0.5];
        all = all
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
            })
            .collect();
    }
    all
}

static PARTS: LazyLock<[Vec<[[f32; 2]; 3]>; 5]> = LazyLock::new(|| std::array::from_fn(|depth| parts(depth as u32)));

/// Least `(s, t)` of the 4^depth parts of a square, in the order of its quadtree.
static SQUARES: LazyLock<[Vec<[f32; 2]>; 5]> = LazyLock::new(|| {
    std::array::from_fn(|depth| {
        let side = 1.0 / (1 << depth) as f32;
        (0..1_usize << (2 * depth))
            .map(|index| {
                let (mut s, mut t) = (0.0, 0.0);
                for level in 1..=depth {
                    let quadrant = index >> (2 * (depth - level)) & 3;
                    let step = side * (1 << (depth - level)) as f32;
                    s += if quadrant == 1 || quadrant == 2 { step } else { 0.0 };
                    t += if quadrant >= 2 { step } else { 0.0 };
                }
                [s, t]
            })
            .collect()
    })
});

/// Coordinates, as in [`crate::link::State::centre`], of a place in part `index` of the 4^depth parts of an element, at `jitter`
/// in [0, 1)² within it.
#[inline(always)]
pub(crate) fn place_of(count: u8, depth: usize, index: usize, jitter: [f32; 2]) -> [f32; 2] {
    if count == 4 {
        let [s, t] = SQUARES[depth][index];
        let side = 1.0 / (1 << depth) as f32;
        [s + side * jitter[0], t + side * jitter[1]]
    } else {
        let [[ab, ac], [bb, bc], [cb, cc]] = PARTS[depth][index];
        let [mut s, mut t] = jitter;
        if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        [ab + (bb - ab) * s + (cb - ab) * t, ac + (bc - ac) * s + (cc - ac) * t]
    }
}

/// What makes the point of an element at a place: corner, two sides, and what a quadrilateral is more than a parallelogram.
#[inline(always)]
fn frame(element: &Element) -> [Vec3; 4] {
    let [a, b, c, d] = element.corners;
    if element.count == 4 { [a, b - a, d - a, a - b + c - d] } else { [a, b - a, c - a, Vec3::ZERO] }
}

/// The points of an element at places, per axis.
#[inline(always)]
pub(crate) fn points_at(element: &Element, places: &[[f32; 2]; RAYS]) -> [[f32; RAYS]; 3] {
    let [corner, along, across, twist] = frame(element);
    let mut points = [[0.0; RAYS]; 3];
    for (axis, points) in points.iter_mut().enumerate() {
        let (corner, along, across, twist) = (corner[axis], along[axis], across[axis], twist[axis]);
        for (point, [s, t]) in points.iter_mut().zip(places) {
            *point = corner + along * s + across * t + twist * (s * t);
        }
    }
    points
}

/// A point of part `index` of the 4^depth parts of an element, at `jitter` in [0, 1)² within it, and its coordinates as in
/// [`crate::link::State::centre`].
#[inline(always)]
pub(crate) fn point_of(element: &Element, depth: usize, index: usize, jitter: [f32; 2]) -> (Vec3, [f32; 2]) {
    let [s, t] = place_of(element.count, depth, index, jitter);
    let [corner, along, across, twist] = frame(element);
    (corner + along * s + across * t + twist * (s * t), [s, t])
}

/// The point of part `index` of 16 at which an element that something stands on is asked, as [`point_of`]: always the same
/// one, so that it is known whether it is covered.
pub(crate) fn own_point(element: &Element, index: usize) -> (Vec3, [f32; 2]) {
    let [s, t, _, _] = Jitter::new(element.path.to_bits(), index as u64, 0).four();
    point_of(element, 2, index, [s, t])
}

/// A point of part `index` of 16 of an element that something stands on, as [`point_of`]: covered if the part's own point is,
/// as no line of contact lies between the two. Where one would, the own point.
#[inline(always)]
pub(crate) fn beside_own_point(
    element: &Element,
    index: usize,
    jitter: [f32; 2],
    geometry: &Geometry,
) -> (Vec3, [f32; 2]) {
    let place = point_of(element, 2, index, jitter);
    if element.lined >> index & 1 == 0 {
        return place;
    }
    let own = own_point(element, index);
    if geometry.contacts.between(own.0, place.0, element.polygon, geometry) { own } else { place }
}

/// A point of an element, spread evenly over its area whatever its shape, for `jitter` in [0, 1)².
pub(crate) fn even_point_of(element: &Element, jitter: [f32; 2]) -> Vec3 {
    let [a, b, c, d] = element.corners;
    let [mut s, mut t] = jitter;
    let fold = |s: &mut f32, t: &mut f32| {
        if *s + *t > 1.0 {
            (*s, *t) = (1.0 - *s, 1.0 - *t);
        }
    };
    let mut last = b;
    if element.count == 4 {
        let first = 0.5 * (b - a).cross(c - a).length() / element.area;
        if s < first {
            s /= first;
        } else {
            s = (s - first) / (1.0 - first);
            last = d;
        }
    }
    fold(&mut s, &mut t);
    a + (last - a) * s + (c - a) * t
}

/// How many rays of equal weight say as much as one of those that go from a point to evenly spread places of a source: 1 where
/// the source is far away, less where some of it is much closer than the rest. `normal`, `other`: of the point and the source.
pub(crate) fn evenness(point: Vec3, normal: Vec3, source: &Element, other: Vec3) -> f32 {
    let middles = std::array::from_fn(|part| place_of(source.count, 2, part, [0.5; 2]));
    let points = points_at(source, &middles);
    let weights: [f32; RAYS] = std::array::from_fn(|k| {
        let towards = Vec3::new(points[0][k], points[1][k], points[2][k]) - point;
        let square = towards.length_squared();
        normal.dot(towards).max(0.0) * (-other.dot(towards)).max(0.0) / (square * square)
    });
    let sum: f32 = weights.iter().sum();
    let squares: f32 = weights.iter().map(|weight| weight * weight).sum();
    if squares > 0.0 { sum * sum / (RAYS as f32 * squares) } else { 1.0 }
}

/// A packet of rays with what each would carry.
pub(crate) struct Packet {
    pub(crate) rays: Rays<RAYS>,
    /// Clipped cosines over squared length: 0 for rays that carry nothing.
    pub(crate) weights: [f32; RAYS],
}

impl Packet {
    pub(crate) fn new() -> Packet {
        let zero = [0.0; RAYS];
        Packet { rays: Rays { origin: [zero; 3], direction: [zero; 3], near: zero, far: zero }, weights: zero }
    }

    /// Sets a ray from a point with a normal to another; it neither starts nor hits closer than `tolerance` to either
    /// plane.
    #[inline(always)]
    pub(crate) fn set(&mut self, k: usize, from: Vec3, normal: Vec3, to: Vec3, other: Vec3, tolerance: f32) {
        let direction = to - from;
        let (rise, fall) = (normal.dot(direction), -other.dot(direction));
        let square = direction.length_squared();
        for axis in 0..3 {
            self.rays.origin[axis][k] = from[axis];
            self.rays.direction[axis][k] = direction[axis];
        }
        self.rays.near[k] = tolerance / rise;
        self.rays.far[k] = 1.0 - tolerance / fall;
        let carries = rise > tolerance && fall > tolerance;
        self.weights[k] = if carries { rise * fall / (square * square) } else { 0.0 };
    }

    /// Rays from points of a plane with a normal to points of another, both per axis, as [`Packet::set`] sets one.
    #[inline(always)]
    pub(crate) fn between(
        from: [[f32; RAYS]; 3],
        normal: Vec3,
        to: &[[f32; RAYS]; 3],
        other: Vec3,
        tolerance: f32,
    ) -> Packet {
        let mut packet = Packet::new();
        packet.rays.origin = from;
        for k in 0..RAYS {
            let [x, y, z] = [to[0][k] - from[0][k], to[1][k] - from[1][k], to[2][k] - from[2][k]];
            let rise = normal.x * x + normal.y * y + normal.z * z;
            let fall = -(other.x * x + other.y * y + other.z * z);
            let square = x * x + y * y + z * z;
            packet.rays.direction[0][k] = x;
            packet.rays.direction[1][k] = y;
            packet.rays.direction[2][k] = z;
            packet.rays.near[k] = tolerance / rise;
            packet.rays.far[k] = 1.0 - tolerance / fall;
            let weight = rise * fall / (square * square);
            packet.weights[k] = if (rise > tolerance) & (fall > tolerance) { weight } else { 0.0 };
        }
        packet
    }

    /// Gives all rays that carry something the same weight.
    pub(crate) fn count_alike(&mut self) {
        self.weights = self.weights.map(|weight| if weight > 0.0 { 1.0 } else { 0.0 });
    }

    /// Bits of the rays that carry something.
    pub(crate) fn active(&self) -> u32 {
        self.weights.iter().enumerate().fold(0, |bits, (k, &weight)| bits | u32::from(weight > 0.0) << k)
    }

    /// Share of light that gets through, ray by ray.
    #[inline(always)]
    pub(crate) fn through(&self, geometry: &Geometry) -> [f32; RAYS] {
        let active = self.active();
        if geometry.opaque {
            let blocked = geometry.bvh.blocked(geometry.backend, &self.rays, active);
            std::array::from_fn(|k| if blocked >> k & 1 == 1 { 0.0 } else { 1.0 })
        } else {
            geometry.bvh.transmittance(geometry.backend, &self.rays, active, geometry)
        }
    }
}

/// A random point of a node in part `index` of 16, and the polygon that it lies on.
#[inline(always)]
pub(crate) fn sample(
    node: u32,
    index: usize,
    jitter: [f32; 2],
    extra: f32,
    clusters: &Clusters,
    elements: &[Element],
    geometry: &Geometry,
) -> (Vec3, u32, [f32; 2]) {
    let (element, (point, place)) = if node & CLUSTER != 0 {
        let share = (index as f32 + extra) / RAYS as f32;
        let element = &elements[clusters.member_at(node & !CLUSTER, share) as usize];
        (element, point_of(element, 0, 0, jitter))
    } else {
        let element = &elements[node as usize];
        let own = element.crossed.then(|| beside_own_point(element, index, jitter, geometry));
        (element, own.unwrap_or_else(|| point_of(element, 2, index, jitter)))
    };
    (point, element.polygon, place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isolux_core::tree::Path;

    /// Catches noise that is taken for less than it is where near parts of a source outweigh all others: a wall that begins a
    /// tenth of its length away counts by a quarter of its strata, one that is far away by three quarters.
    #[test]
    fn a_source_that_is_near_at_one_end_is_uneven() {
        let wall = |from: f32| {
            let corners = [[from, -0.5, 0.0], [from, 0.5, 0.0], [from, 0.5, 1.0], [from, -0.5, 1.0]].map(Vec3::from);
            Element::new(corners, 4, 0, u32::MAX, Path::root(0))
        };
        let seen = |from: f32| evenness(Vec3::ZERO, Vec3::Z, &wall(from), Vec3::NEG_X);
        // Measured 0.24 and 0.76: of a wall on the receiver's plane the lowest strata lie flat from afar, too.
        assert!(seen(0.1) < 0.26, "{}", seen(0.1));
        assert!(seen(10.0) > 0.7, "{}", seen(10.0));
    }
}
