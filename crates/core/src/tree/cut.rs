//! How an element is cut into its four parts: a compact one into quarters, a long one into strips.

use crate::scene::Corners;
use glam::DVec3;

/// A way to cut an element into four parts: quarters, or strips that stand one after the other along two opposite sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cut {
    /// Part k < n touches corner k; the fourth of a triangle is its middle.
    #[default]
    Quarters,
    /// Of a quadrilateral: strips from the side between its last and first corner to that between the second and third.
    Along,
    /// Of a quadrilateral: strips from the side between its first two corners to that between the last two.
    Across,
}

/// How many times as long as wide an element is that is cut into strips. Strips would be closer to squares from 2 on; but on a
/// wall light changes most towards floor and ceiling, across its length, and quarters keep what is long. Measured for the
/// wavefront engine, errors times roots of elements, beside quarters alone: with 2, walls of two to three times their height
/// take 0.8 (gallery at 2 %) to 1.5 times (two rooms at 1 %); from 4 to 12 these are alike, and the furnished room takes 0.76
/// to 0.88.
const LONG: f64 = 8.0;

impl Cut {
    /// The cut that makes long elements shorter: strips of what is more than eight times as long as wide. `along` and `across`:
    /// squares of the lengths of what joins the middles of opposite sides, in the direction of the first side and of the second.
    #[must_use]
    pub fn of_sides(along: f64, across: f64) -> Cut {
        if along > LONG * LONG * across {
            Cut::Along
        } else if across > LONG * LONG * along {
            Cut::Across
        } else {
            Cut::Quarters
        }
    }

    /// The four parts of a patch. Ends of cuts are means of means of the corners beside them, so that neighbours agree on
    /// them bit for bit.
    #[must_use]
    pub fn parts(self, corners: &Corners) -> [Corners; 4] {
        let (&[a, b, c, d], true) = (&**corners, self != Cut::Quarters) else { return quarter(corners) };
        match self {
            Cut::Along => {
                let (near, far) = (quartered(a, b), quartered(d, c));
                std::array::from_fn(|k| Corners::quad(near[k], near[k + 1], far[k + 1], far[k]))
            }
            _ => {
                let (near, far) = (quartered(a, d), quartered(b, c));
                std::array::from_fn(|k| Corners::quad(near[k], far[k], far[k + 1], near[k + 1]))
            }
        }
    }

    /// Which of [`Cut::parts`] holds a point of the patch's plane.
    #[must_use]
    pub fn part_at(self, corners: &Corners, normal: DVec3, point: DVec3) -> u32 {
        let (&[a, b, c, d], true) = (&**corners, self != Cut::Quarters) else {
            return quadrant_of(corners, normal, point);
        };
        let (near, far) =
            if self == Cut::Along { (quartered(a, b), quartered(d, c)) } else { (quartered(b, c), quartered(a, d)) };
        // Seen from the front, what comes before a cut lies on its left.
        let is_beyond = |k: &usize| normal.dot((far[*k] - near[*k]).cross(point - near[*k])) <= 0.0;
        (1..4).take_while(is_beyond).count() as u32
    }
}

fn middle(a: DVec3, b: DVec3) -> DVec3 {
    (a + b) * 0.5
}

/// The ends of a line, and what quarters it.
fn quartered(from: DVec3, to: DVec3) -> [DVec3; 5] {
    let half = middle(from, to);
    [from, middle(from, half), half, middle(half, to), to]
}

/// The quarters of a patch: quadrant k < n touches corner k; the fourth of a triangle is its middle. Edge midpoints
/// are exact means of their ends, so that neighbours agree on them bit for bit.
#[must_use]
pub fn quarter(corners: &Corners) -> [Corners; 4] {
    match **corners {
        [a, b, c] => {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [
                Corners::triangle(a, ab, ca),
                Corners::triangle(ab, b, bc),
                Corners::triangle(ca, bc, c),
                Corners::triangle(bc, ca, ab),
            ]
        }
        [a, b, c, d] => {
            let (ab, bc, cd, da) = (middle(a, b), middle(b, c), middle(c, d), middle(d, a));
            let centre = middle(middle(a, c), middle(b, d));
            [
                Corners::quad(a, ab, centre, da),
                Corners::quad(ab, b, bc, centre),
                Corners::quad(centre, bc, c, cd),
                Corners::quad(da, centre, cd, d),
            ]
        }
        _ => unreachable!("corners are three or four"),
    }
}

/// Which quarter of `corners` holds `point`, numbered as by [`quarter`].
#[must_use]
pub fn quadrant_of(corners: &Corners, normal: DVec3, point: DVec3) -> u32 {
    // Positive on the left of the line from `from` to `to`, seen from the front.
    let left = |from: DVec3, to: DVec3| normal.dot((to - from).cross(point - from)) > 0.0;
    match **corners {
        [a, b, c] => {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            // Each corner lies on the left of the cut that runs clockwise around the middle triangle.
            if left(ab, ca) {
                0
            } else if left(bc, ab) {
                1
            } else if left(ca, bc) {
                2
            } else {
                3
            }
        }
        [a, b, c, d] => {
            let (ab, bc, cd, da) = (middle(a, b), middle(b, c), middle(c, d), middle(d, a));
            // Line ab -> cd: a and d on its left. Line da -> bc: d and c on its left.
            match (left(ab, cd), left(da, bc)) {
                (true, false) => 0,
                (false, false) => 1,
                (false, true) => 2,
                (true, true) => 3,
            }
        }
        _ => unreachable!("corners are three or four"),
    }
}
