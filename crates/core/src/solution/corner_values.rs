//! Which leaves meet at a corner of a leaf: points just beside the corner go out, one in each leaf that may be there. What the
//! leaves' values are is left to the caller.

use crate::scene::Corners;
use crate::units::Rgb;
use glam::DVec3;

/// How far beside a corner leaves are looked for, in lengths of the edges there. A leaf that differs from this one by k levels
/// has edges 2^k times shorter: 2^-10 reaches leaves that are 10 levels deeper, and lies 10^7 times above rounding.
const BESIDE: f64 = 1.0 / 1024.0;

/// Points just beside a corner of a leaf, its own first, one in the middle of each sector that the lines along the leaf's edges
/// cut there: four around a corner of a quadrilateral, six around one of a triangle. Those outside of `root`, the polygon (or
/// fragment) that the leaf is a part of, are left out. `normal`: of the leaf's plane.
pub fn around_corner(
    leaf: &Corners,
    corner: usize,
    root: &Corners,
    normal: DVec3,
) -> impl Iterator<Item = DVec3> + use<> {
    let count = leaf.len();
    let here = leaf[corner];
    let u = (leaf[(corner + 1) % count] - here) * BESIDE;
    let v = (leaf[(corner + count - 1) % count] - here) * BESIDE;
    let steps: [DVec3; 6] = if count == 4 {
        [u + v, v - u, -u - v, u - v, DVec3::NAN, DVec3::NAN]
    } else {
        [u + v, v * 2.0 - u, v - u * 2.0, -u - v, u - v * 2.0, u * 2.0 - v]
    };
    let root = *root;
    let sectors = if count == 4 { 4 } else { 6 };
    steps.into_iter().take(sectors).map(move |step| here + step).filter(move |&point| {
        let n = root.len();
        (0..n).all(|k| normal.dot((root[(k + 1) % n] - root[k]).cross(point - root[k])) >= 0.0)
    })
}

/// The value at a corner: the mean over the leaves that meet there.
#[must_use]
pub fn corner_mean(values: &[Rgb]) -> Rgb {
    values.iter().copied().sum::<Rgb>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches sectors that overlap or are missed, and neighbours that are looked for outside of the root.
    #[test]
    fn each_sector_has_a_point_and_none_lies_outside() {
        let square = Corners::quad(DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y);
        let leaf = Corners::quad(DVec3::ZERO, DVec3::X * 0.5, (DVec3::X + DVec3::Y) * 0.5, DVec3::Y * 0.5);
        let counts = [0, 1, 2, 3].map(|k| around_corner(&leaf, k, &square, DVec3::Z).count());
        assert_eq!(counts, [1, 2, 4, 2]);
        let sides: std::collections::BTreeSet<_> =
            around_corner(&leaf, 2, &square, DVec3::Z).map(|point| (point.x > 0.5, point.y > 0.5)).collect();
        assert_eq!(sides.len(), 4);
        let triangle = Corners::triangle(DVec3::ZERO, DVec3::X, DVec3::Y);
        let middle = Corners::triangle(DVec3::X * 0.25, DVec3::X * 0.5, DVec3::new(0.25, 0.25, 0.0));
        assert_eq!(around_corner(&middle, 2, &triangle, DVec3::Z).count(), 6);
    }
}
