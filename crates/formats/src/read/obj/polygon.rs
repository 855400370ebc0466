//! Polygons of more than four corners, cut into triangles: fans where convex, ears elsewhere.

use glam::{DVec2, DVec3};

/// Most corners of a polygon that is not convex: cutting ears takes the cube of that in the worst case, here about
/// a second.
pub(super) const MAX_CONCAVE: usize = 1024;

/// How a polygon was cut.
pub(super) enum Cut {
    /// Into these triangles of corner numbers.
    Triangles(Vec<[usize; 3]>),
    /// Into a fan for want of better: it crosses itself, or is degenerate.
    Fan(Vec<[usize; 3]>),
    /// Not at all: concave, with more than [`MAX_CONCAVE`] corners.
    TooManyCorners,
}

/// Cuts a polygon; each triangle turns the way the polygon does.
pub(super) fn triangulate(corners: &[DVec3]) -> Cut {
    let flat = flatten(corners);
    let count = flat.len();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let fan = || (1..count - 1).map(|i| [0, i, i + 1]).collect();
    // Convex: no corner turns right, and the fan's triangles neither (a pentagram's corners all turn left).
    let convex = (0..count).all(|i| turn(i, (i + 1) % count, (i + 2) % count) >= 0.0)
        && (1..count - 1).all(|i| turn(0, i, i + 1) >= 0.0);
    if convex {
        return Cut::Triangles(fan());
    }
    if count > MAX_CONCAVE {
        return Cut::TooManyCorners;
    }
    let mut left: Vec<usize> = (0..count).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    while left.len() > 3 {
        let n = left.len();
        let is_ear = |&place: &usize| {
            let (a, b, c) = (left[(place + n - 1) % n], left[place], left[(place + 1) % n]);
            let inside = |p: usize| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            // A corner at the very place of a, b or c (a bridge to a hole) does not count as inside.
            let apart = |p: usize| flat[p] != flat[a] && flat[p] != flat[b] && flat[p] != flat[c];
            turn(a, b, c) > 0.0 && !left.iter().any(|&p| p != a && p != b && p != c && apart(p) && inside(p))
        };
        let Some(place) = (0..n).find(is_ear) else { return Cut::Fan(fan()) };
        triangles.push([left[(place + n - 1) % n], left[place], left[(place + 1) % n]]);
        left.remove(place);
    }
    triangles.push([left[0], left[1], left[2]]);
    Cut::Triangles(triangles)
}

/// The corners in the plane of the polygon, counter-clockwise.
fn flatten(corners: &[DVec3]) -> Vec<DVec2> {
    let origin = corners.first().copied().unwrap_or(DVec3::ZERO);
    // Newell's sum over the closed outline.
    let next = |i: usize| corners[(i + 1) % corners.len()] - origin;
    let normal: DVec3 = corners.iter().enumerate().map(|(i, &corner)| (corner - origin).cross(next(i))).sum();
    let (x, y) = normal.try_normalize().unwrap_or(DVec3::Z).any_orthonormal_pair();
    corners.iter().map(|&corner| DVec2::new((corner - origin).dot(x), (corner - origin).dot(y))).collect()
}

#[cfg(test)]
mod tests {
    use super::{Cut, triangulate};
    use glam::DVec3;

    fn area(triangles: &[[usize; 3]], corners: &[DVec3]) -> f64 {
        triangles
            .iter()
            .map(|&[a, b, c]| 0.5 * (corners[b] - corners[a]).cross(corners[c] - corners[a]).z)
            .inspect(|&area| assert!(area > 0.0, "a triangle is turned over"))
            .sum()
    }

    /// Catches a fan over a notch: an L-shaped floor would cover the corner that is not there.
    #[test]
    fn a_concave_polygon_keeps_its_area() {
        let outline = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)];
        let corners = outline.map(|(x, y)| DVec3::new(x as f64, y as f64, 5.0));
        let Cut::Triangles(triangles) = triangulate(&corners) else { panic!("it has ears") };
        assert_eq!(triangles.len(), 4);
        assert!((area(&triangles, &corners) - 6.0).abs() < 1e-12);
    }

    /// Catches a convex polygon that loses faces, or is turned over.
    #[test]
    fn a_hexagon_becomes_a_fan() {
        let corners: Vec<DVec3> = (0..6)
            .map(|i| f64::from(i) * std::f64::consts::FRAC_PI_3)
            .map(|a| DVec3::new(a.cos(), a.sin(), 0.0))
            .collect();
        let Cut::Triangles(triangles) = triangulate(&corners) else { panic!("it is convex") };
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]);
        // 3 sqrt(3) / 2
        assert!((area(&triangles, &corners) - 2.598_076_211).abs() < 1e-8);
    }

    /// Catches a loop without end, or a panic, on outlines without ears.
    #[test]
    fn hopeless_outlines_become_fans() {
        for corners in [vec![DVec3::ZERO; 7], vec![DVec3::splat(f64::NAN); 5]] {
            let (Cut::Triangles(triangles) | Cut::Fan(triangles)) = triangulate(&corners) else { panic!() };
            assert_eq!(triangles.len(), corners.len() - 2);
        }
    }
}
