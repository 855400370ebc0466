//! Convex outlines of up to five corners: a patch and a plane go in, the part of the patch in front of the plane comes
//! out.

use crate::scene::Plane;
use glam::DVec3;

/// Most corners an outline can have: a quadrilateral cut once by a plane.
pub(super) const MOST_CORNERS: usize = 5;

/// A planar convex polygon of three to five corners, in place. Fewer than three corners mean "nothing".
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    points: [DVec3; MOST_CORNERS],
    count: usize,
}

impl Outline {
    /// The corners as they are.
    ///
    /// # Panics
    /// On more than [`MOST_CORNERS`] corners.
    pub(super) fn new(corners: &[DVec3]) -> Outline {
        let mut points = [DVec3::ZERO; MOST_CORNERS];
        points[..corners.len()].copy_from_slice(corners);
        Outline { points, count: corners.len() }
    }

    /// The corners as a slice.
    pub(super) fn corners(&self) -> &[DVec3] {
        &self.points[..self.count]
    }

    /// The corners in place; those from [`Outline::corners`]' length on mean nothing.
    pub(super) fn points(&self) -> &[DVec3; MOST_CORNERS] {
        &self.points
    }

    /// True when nothing is left.
    pub(super) fn is_empty(&self) -> bool {
        self.count < 3
    }

    /// The part of a triangle or quadrilateral where `height` (an affine function, one value a corner) is positive.
    ///
    /// Sutherland and Hodgman 1974, against one plane. A height of exactly zero keeps its corner and makes no
    /// crossing, so that a polygon that merely touches the plane from the front comes out unchanged, and one that
    /// touches it from behind comes out empty.
    ///
    /// # Panics
    /// On more than four corners, or fewer heights than corners.
    pub(super) fn in_front(corners: &[DVec3], heights: &[f64]) -> Outline {
        let mut out = Outline { points: [DVec3::ZERO; MOST_CORNERS], count: 0 };
        if corners.iter().zip(heights).all(|(_, &height)| height <= 0.0) {
            return out;
        }
        for i in 0..corners.len() {
            let j = if i + 1 == corners.len() { 0 } else { i + 1 };
            let (h0, h1) = (heights[i], heights[j]);
            if h0 >= 0.0 {
                out.push(corners[i]);
            }
            if (h0 > 0.0 && h1 < 0.0) || (h0 < 0.0 && h1 > 0.0) {
                // From the positive end, so that both walking directions cut an edge at the same point.
                let (front, back, hf, hb) =
                    if h0 > 0.0 { (corners[i], corners[j], h0, h1) } else { (corners[j], corners[i], h1, h0) };
                out.push(front + (back - front) * (hf / (hf - hb)));
            }
        }
        out
    }

    fn push(&mut self, point: DVec3) {
        // A convex quadrilateral crosses a plane at most twice; rounding of a non-convex sliver may not add a sixth.
        if self.count < MOST_CORNERS {
            self.points[self.count] = point;
            self.count += 1;
        }
    }
}

/// Heights of up to four corners above a plane, metres, with those that rounding cannot tell from zero set to zero.
///
/// The bound is that of the evaluation itself: three products and three sums of magnitudes `m = sum |n_k p_k| + |d|`
/// err by at most 4 units of rounding of `m` (Higham 2002, his gamma_4); twice that allows for corners that
/// are themselves rounded.
pub(super) fn heights(corners: &[DVec3], plane: &Plane) -> [f64; 4] {
    let mut heights = [0.0; 4];
    for (height, &corner) in heights.iter_mut().zip(corners) {
        *height = snapped_distance(corner, plane);
    }
    heights
}

/// Signed distance of a point from a plane, metres; zero where rounding cannot tell it from zero.
pub(super) fn snapped_distance(point: DVec3, plane: &Plane) -> f64 {
    let magnitude = plane.normal.abs().dot(point.abs()) + plane.offset.abs();
    let distance = plane.distance(point);
    if distance.abs() <= ROUNDING_UNITS * f64::EPSILON * magnitude { distance * 0.0 } else { distance }
}

/// Units of rounding within which a point counts as on a plane: see [`heights`].
const ROUNDING_UNITS: f64 = 8.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> [DVec3; 4] {
        [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]
    }

    fn area(outline: &Outline) -> f64 {
        let c = outline.corners();
        (1..c.len().max(1) - 1).map(|i| (c[i] - c[0]).cross(c[i + 1] - c[0])).sum::<DVec3>().length() / 2.0
    }

    /// Would catch a lost or doubled corner: every number of corners from none to five, with its exact area.
    #[test]
    fn clipping_keeps_exactly_the_front() {
        let cases = [
            (DVec3::new(-1.0, 0.0, 0.0), 0.5, 0, 0.0),
            (DVec3::new(1.0, 0.0, 0.0), 0.0, 4, 1.0),
            (DVec3::new(-1.0, 0.0, 0.0), 0.0, 0, 0.0),
            (DVec3::new(1.0, 0.0, 0.0), 0.25, 4, 0.75),
            (DVec3::new(1.0, 1.0, 0.0), 1.0, 3, 0.5),
            (DVec3::new(1.0, 1.0, 0.0), 1.5, 3, 0.125),
            (DVec3::new(1.0, 1.0, 0.0), 0.5, 5, 0.875),
        ];
        for (normal, offset, count, expected) in cases {
            // Distances only need the right sign and proportion, so the plane may stay unnormalised here.
            let plane = Plane { normal, offset };
            let cut = Outline::in_front(&square(), &heights(&square(), &plane));
            assert_eq!(cut.is_empty(), count == 0, "{normal} {offset}");
            if count > 0 {
                assert_eq!(cut.corners().len(), count, "{normal} {offset}");
                assert_eq!(area(&cut), expected, "{normal} {offset}");
            }
        }
    }

    /// Would catch a missing snap: a plane through two corners whose heights are rounding noise must not cut.
    #[test]
    fn rounding_noise_makes_no_crossing() {
        let turn = |p: DVec3| DVec3::new(0.6 * p.x - 0.8 * p.y, 0.8 * p.x + 0.6 * p.y, p.z) + DVec3::splat(0.1);
        let corners = square().map(turn);
        let normal = turn(DVec3::X) - turn(DVec3::ZERO);
        let plane = Plane { normal, offset: normal.dot(corners[0]) };
        let heights = heights(&corners, &plane);
        assert_eq!((heights[0].abs(), heights[3].abs()), (0.0, 0.0));
        assert_eq!(Outline::in_front(&corners, &heights).corners(), corners);
    }
}
