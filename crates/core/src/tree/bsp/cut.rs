//! Cutting: a convex piece and a plane go in, the parts in front and behind come out, as triangles and quadrilaterals.

use crate::scene::{Corners, Plane};
use glam::DVec3;

/// How a piece lies to a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// In it: every corner within the tolerance.
    Coplanar,
    /// In front, or sticking out behind by no more than the tolerance.
    Front,
    /// Behind, or sticking out in front by no more than the tolerance.
    Back,
    /// On both sides by more than the tolerance.
    Both {
        /// The part in front.
        front: Pieces,
        /// The part behind.
        back: Pieces,
    },
}

/// At most two pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pieces {
    pieces: [Option<Corners>; 2],
}

impl Pieces {
    /// None.
    pub(super) const NONE: Pieces = Pieces { pieces: [None; 2] };

    /// One.
    pub(super) fn one(piece: Corners) -> Pieces {
        Pieces { pieces: [Some(piece), None] }
    }

    /// The pieces.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Corners> {
        self.pieces.iter().flatten()
    }
}

/// Cuts a convex piece by a plane. Parts that would be no thicker than `tolerance` (seen along the plane's normal) are
/// not made: the piece then counts as lying on the other side. Corners within the tolerance of the plane go to both
/// parts as they are, so that neighbours of the piece, cut by the same plane, keep common corners; a new corner depends
/// on its edge's ends only, not on the edge's direction.
#[must_use]
pub fn cut(corners: &Corners, plane: &Plane, tolerance: f64) -> Cut {
    let count = corners.len();
    let mut distance = [0.0; 4];
    for (distance, &corner) in distance.iter_mut().zip(corners.iter()) {
        *distance = plane.distance(corner);
    }
    let distance = &distance[..count];
    let in_front = distance.iter().any(|&d| d > tolerance);
    let behind = distance.iter().any(|&d| d < -tolerance);
    match (in_front, behind) {
        (false, false) => return Cut::Coplanar,
        (true, false) => return Cut::Front,
        (false, true) => return Cut::Back,
        (true, true) => {}
    }
    let (mut front, mut back) = (Ring::new(), Ring::new());
    for i in 0..count {
        let j = (i + 1) % count;
        let (p, q, dp, dq) = (corners[i], corners[j], distance[i], distance[j]);
        if dp >= -tolerance {
            front.push(p);
        }
        if dp <= tolerance {
            back.push(p);
        }
        let crossing = if dp > tolerance && dq < -tolerance {
            Some(p + (q - p) * (dp / (dp - dq)))
        } else if dp < -tolerance && dq > tolerance {
            Some(q + (p - q) * (dq / (dq - dp)))
        } else {
            None
        };
        if let Some(point) = crossing {
            front.push(point);
            back.push(point);
        }
    }
    Cut::Both { front: front.pieces(), back: back.pieces() }
}

/// Corners of one part: at most the 4 of a quadrilateral with 4 crossings (which a convex one cannot reach).
struct Ring {
    points: [DVec3; 8],
    count: usize,
}

impl Ring {
    fn new() -> Ring {
        Ring { points: [DVec3::ZERO; 8], count: 0 }
    }

    fn push(&mut self, point: DVec3) {
        self.points[self.count] = point;
        self.count += 1;
    }

    /// As triangles and quadrilaterals. Five corners are cut into a triangle and a quadrilateral where the thinner of
    /// the two is thickest.
    fn pieces(&self) -> Pieces {
        let points = &self.points[..self.count];
        match *points {
            [a, b, c] => Pieces::one(Corners::triangle(a, b, c)),
            [a, b, c, d] => Pieces::one(Corners::quad(a, b, c, d)),
            [_, _, _, _, _] => {
                let mut best = (f64::NEG_INFINITY, Pieces::NONE);
                for start in 0..5 {
                    let at = |k: usize| points[(start + k) % 5];
                    let ear = Corners::triangle(at(0), at(1), at(2));
                    let rest = Corners::quad(at(0), at(2), at(3), at(4));
                    let thickness = thickness(&ear).min(thickness(&rest));
                    if thickness > best.0 {
                        best = (thickness, Pieces { pieces: [Some(ear), Some(rest)] });
                    }
                }
                best.1
            }
            // Six corners: only where rounding makes a quadrilateral cross the plane four times.
            [a, b, c, d, e, f] => Pieces { pieces: [Some(Corners::quad(a, b, c, d)), Some(Corners::quad(a, d, e, f))] },
            _ => Pieces::NONE,
        }
    }
}

/// Area over longest edge: about the smallest width of a piece.
fn thickness(corners: &Corners) -> f64 {
    let count = corners.len();
    let longest = (0..count).map(|i| corners[i].distance(corners[(i + 1) % count])).fold(0.0, f64::max);
    corners.area() / longest
}
