//! Cutting: a convex piece and a plane go in, the parts in front and behind come out, as triangles and quadrilaterals.

use crate::scene::{Corners, Plane};
use glam::DVec3;

/// How a piece lies to a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "lives on the stack for one step of an insertion")]
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

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Corners {
        Corners::quad(DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y)
    }

    fn plane(normal: DVec3, offset: f64) -> Plane {
        Plane { normal: normal.normalize(), offset: offset / normal.length() }
    }

    /// Catches lost or doubled area, parts on the wrong side and flipped windings, for planes at many angles (cuts into
    /// 3 + 5, 4 + 4 and, through corners, 3 + 3 corners).
    #[test]
    fn parts_add_up_and_lie_on_their_sides() {
        for step in 0..360 {
            let angle = f64::from(step).to_radians();
            for offset in [-0.3, 0.0, 0.1, 0.5] {
                let direction = DVec3::new(libm::cos(angle), libm::sin(angle), 0.3);
                let plane = plane(direction, direction.dot(DVec3::new(0.5, 0.5, 0.0)) + offset);
                let Cut::Both { front, back } = cut(&square(), &plane, 1e-6) else { continue };
                let area: f64 = front.iter().chain(back.iter()).map(|part| part.area_vector().z).sum();
                // Twice the area of a unit square; rounding of a dozen operations.
                assert!((area - 2.0).abs() < 1e-14, "{area}");
                assert!(front.iter().all(|part| part.iter().all(|&corner| plane.distance(corner) > -1e-6)));
                assert!(back.iter().all(|part| part.iter().all(|&corner| plane.distance(corner) < 1e-6)));
            }
        }
    }

    /// Catches slivers: a part that would be thinner than the tolerance is left with the rest, a thicker one is made.
    #[test]
    fn slivers_are_not_made() {
        let at = |x: f64| cut(&square(), &plane(DVec3::X, x), 1e-6);
        assert_eq!(at(0.9e-6), Cut::Front);
        assert_eq!(at(1.0 - 0.9e-6), Cut::Back);
        assert!(matches!(at(1.1e-6), Cut::Both { .. }));
        assert_eq!(cut(&square(), &plane(DVec3::Z, 0.9e-6), 1e-6), Cut::Coplanar);
    }

    /// Catches a new corner that depends on the direction of its edge: neighbours would part.
    #[test]
    fn neighbours_get_the_same_corner() {
        let (a, b, c) = (DVec3::new(0.1, 0.2, 0.3), DVec3::new(1.7, 0.9, 0.4), DVec3::new(0.3, 1.9, 0.7));
        let across = plane(DVec3::new(1.0, 0.3, 0.2), 0.8);
        let corner = |corners: Corners| match cut(&corners, &across, 1e-6) {
            Cut::Both { front, .. } => {
                let new = |p: &&DVec3| across.distance(**p).abs() < 1e-9 && (**p - a).cross(b - a).length() < 1e-9;
                front.iter().flat_map(|part| part.to_vec()).find(|p| new(&p)).unwrap()
            }
            other => panic!("{other:?}"),
        };
        assert_eq!(corner(Corners::triangle(a, b, c)), corner(Corners::triangle(b, a, DVec3::new(1.0, -1.0, 0.0))));
    }
}
