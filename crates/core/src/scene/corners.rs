//! Corners of a triangle or convex quadrilateral, stored in place.

use glam::DVec3;
use std::cmp::Ordering;
use std::ops::Deref;

/// Three or four corners, counter-clockwise seen from the front; reads as a slice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    points: [DVec3; 4],
    count: u8,
}

impl Corners {
    /// A triangle.
    #[must_use]
    pub fn triangle(a: DVec3, b: DVec3, c: DVec3) -> Corners {
        Corners { points: [a, b, c, c], count: 3 }
    }

    /// A planar convex quadrilateral (the caller vouches for planar and convex).
    #[must_use]
    pub fn quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Corners {
        Corners { points: [a, b, c, d], count: 4 }
    }

    /// From a slice of three or four points.
    #[must_use]
    pub fn from_slice(points: &[DVec3]) -> Option<Corners> {
        match *points {
            [a, b, c] => Some(Corners::triangle(a, b, c)),
            [a, b, c, d] => Some(Corners::quad(a, b, c, d)),
            _ => None,
        }
    }

    /// The same corners seen from the other side: corner 0 stays first.
    #[must_use]
    pub fn reversed(&self) -> Corners {
        let p = &self.points;
        if self.count == 3 { Corners::triangle(p[0], p[2], p[1]) } else { Corners::quad(p[0], p[3], p[2], p[1]) }
    }

    /// Twice the area, along the normal (Newell's sum).
    #[must_use]
    pub fn area_vector(&self) -> DVec3 {
        let p = &self.points;
        if self.count == 3 { (p[1] - p[0]).cross(p[2] - p[0]) } else { (p[2] - p[0]).cross(p[3] - p[1]) }
    }

    /// Area in the square of the length unit.
    #[must_use]
    pub fn area(&self) -> f64 {
        0.5 * self.area_vector().length()
    }

    /// An order of outlines that rests on coordinates alone: by x, y and z of the corners in turn, then by their
    /// number.
    #[must_use]
    pub fn total_cmp(&self, other: &Corners) -> Ordering {
        let by_corner = |(p, q): (&DVec3, &DVec3)| {
            p.x.total_cmp(&q.x).then_with(|| p.y.total_cmp(&q.y)).then_with(|| p.z.total_cmp(&q.z))
        };
        let corners = self.iter().zip(other.iter()).map(by_corner);
        corners.fold(Ordering::Equal, Ordering::then).then_with(|| self.len().cmp(&other.len()))
    }

    /// Mean of the corners (for a triangle: its centroid).
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        self.iter().copied().sum::<DVec3>() / f64::from(self.count)
    }
}

impl Deref for Corners {
    type Target = [DVec3];
    fn deref(&self) -> &[DVec3] {
        &self.points[..self.count as usize]
    }
}
