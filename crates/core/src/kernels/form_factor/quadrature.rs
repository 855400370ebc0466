//! Points on a patch: an outline goes in, points with the areas they stand for come out.

use glam::DVec3;

/// A triangle or convex quadrilateral as a bilinear map of the square [-1, 1]^2; a triangle is the square with its last
/// edge collapsed to corner 2.
///
/// `x(u, v) = centre + u along + v across + u v twist`; the area element is
/// `|(along + v twist) x (across + u twist)|`, which is affine in `u` and `v` because the patch is planar.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    corners: [DVec3; 4],
    triangle: bool,
}

/// A point and the area it stands for, m².
pub(super) type Weighted = (DVec3, f64);

/// Abscissa of the two-point Gauss-Legendre rule (Abramowitz and Stegun 1964, table 25.4): 1/sqrt 3.
const GAUSS_2: f64 = 0.577_350_269_189_625_8;
/// Three-point Gauss-Legendre rule (the same table): sqrt(3/5) with weight 5/9, and 0 with weight 8/9.
const GAUSS_3: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

impl Piece {
    /// A piece with three or four corners.
    pub(super) fn new(corners: &[DVec3]) -> Piece {
        match *corners {
            [a, b, c, d] => Piece { corners: [a, b, c, d], triangle: false },
            [a, b, c, ..] => Piece { corners: [a, b, c, c], triangle: true },
            _ => Piece { corners: [DVec3::ZERO; 4], triangle: true },
        }
    }

    /// Three points on a triangle, four on a quadrilateral; the count comes second.
    ///
    /// Triangle: the interior three-point rule, exact for quadratics (Strang and Fix 1973, page 184). Quadrilateral:
    /// 2 x 2 Gauss on the bilinear map, weighted by its area element, exact for bicubics of a parallelogram.
    pub(super) fn few(&self, normal: DVec3) -> ([Weighted; 4], usize) {
        let [a, b, c, d] = self.corners;
        if self.triangle {
            let area = 0.5 * (b - a).cross(c - a).dot(normal);
            let sum = a + b + c;
            let weight = area / 3.0;
            // Barycentric (2/3, 1/6, 1/6) and its turns.
            let at = |corner: DVec3| (sum / 6.0 + 0.5 * corner, weight);
            ([at(a), at(b), at(c), (a, 0.0)], 3)
        } else {
            let map = Bilinear::new([a, b, c, d], normal);
            let (lo, hi) = (-GAUSS_2, GAUSS_2);
            ([map.at(lo, lo, 1.0), map.at(hi, lo, 1.0), map.at(hi, hi, 1.0), map.at(lo, hi, 1.0)], 4)
        }
    }

    /// Nine points: 3 x 3 Gauss on the bilinear map (for a triangle: on the collapsed square).
    pub(super) fn nine(&self, normal: DVec3) -> [Weighted; 9] {
        let map = Bilinear::new(self.corners, normal);
        let mut points = [(DVec3::ZERO, 0.0); 9];
        for (row, &(v, wv)) in GAUSS_3.iter().enumerate() {
            for (column, &(u, wu)) in GAUSS_3.iter().enumerate() {
                points[3 * row + column] = map.at(u, v, wu * wv);
            }
        }
        points
    }

    /// Middle and area, m², of each of the four quarters by the middles of the edges.
    pub(super) fn quarters(&self) -> [Weighted; 4] {
        let [a, b, c, d] = self.corners;
        let (ab, bc, cd, da) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d), 0.5 * (d + a));
        if self.triangle {
            let ca = 0.5 * (c + a);
            let area = 0.25 * 0.5 * (b - a).cross(c - a).length();
            return [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)].map(|(p, q, r)| ((p + q + r) / 3.0, area));
        }
        let m = 0.5 * (ab + cd);
        [[a, ab, m, da], [ab, b, bc, m], [m, bc, c, cd], [da, m, cd, d]]
            .map(|[p, q, r, s]| (0.25 * ((p + q) + (r + s)), 0.5 * (r - p).cross(s - q).length()))
    }

    /// Middle of the piece and the radius of a ball about it that holds the piece, metres.
    pub(super) fn ball(&self) -> (DVec3, f64) {
        ball(if self.triangle { &self.corners[..3] } else { &self.corners })
    }

    /// The pieces to go on with: quarters by the middles of the edges, or the two halves of a quadrilateral along `u` or
    /// `v`. The count comes second.
    pub(super) fn split(&self, cut: Cut) -> ([Piece; 4], usize) {
        let [a, b, c, d] = self.corners;
        let (ab, bc, cd, da) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d), 0.5 * (d + a));
        let quad = |p: [DVec3; 4]| Piece { corners: p, triangle: false };
        if self.triangle {
            let triangle = |p: DVec3, q: DVec3, r: DVec3| Piece { corners: [p, q, r, r], triangle: true };
            let ca = 0.5 * (c + a);
            return ([triangle(a, ab, ca), triangle(ab, b, bc), triangle(ca, bc, c), triangle(ab, bc, ca)], 4);
        }
        match cut {
            Cut::U => ([quad([a, ab, cd, d]), quad([ab, b, c, cd]), *self, *self], 2),
            Cut::V => ([quad([a, b, bc, da]), quad([da, bc, c, d]), *self, *self], 2),
            Cut::Both => {
                let m = 0.5 * (ab + cd);
                ([quad([a, ab, m, da]), quad([ab, b, bc, m]), quad([m, bc, c, cd]), quad([da, m, cd, d])], 4)
            }
        }
    }

    /// Where to cut for a function with these values at the points of [`Piece::nine`]: across the direction in which it
    /// varies, if it varies there more than `ratio` times as much as in the other; else both.
    pub(super) fn cut(&self, values: &[f64; 9], ratio: f64) -> Cut {
        let (mut along_u, mut along_v) = (0.0, 0.0);
        for k in 0..3 {
            let (row, column) = (3 * k, k);
            along_u += (values[row + 2] - values[row + 1]).abs() + (values[row + 1] - values[row]).abs();
            along_v += (values[column + 6] - values[column + 3]).abs() + (values[column + 3] - values[column]).abs();
        }
        let [a, b, c, d] = self.corners;
        let (u, v) = (
            (b - a).length_squared().max((c - d).length_squared()),
            (c - b).length_squared().max((d - a).length_squared()),
        );
        let slender = SLENDER * SLENDER;
        let (long_u, long_v) = (u > slender * v, v > slender * u);
        if long_u || (!long_v && along_u > ratio * along_v) {
            Cut::U
        } else if long_v || along_v > ratio * along_u {
            Cut::V
        } else {
            Cut::Both
        }
    }
}

/// Length over width beyond which a piece is cut across its length whatever its values say: three points along it see
/// too little of what happens near its ends. Measured on a 10 x 1 floor and wall that share their long edge: error 4e-3
/// without, 6e-5 with 8, 2e-5 with 4. No power of two, which halving would meet exactly and rounding would decide.
const SLENDER: f64 = 6.0;

/// How a quadrilateral is split. A triangle is always quartered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// In halves of smaller extent in `u` (from corner 0 to corner 1).
    U,
    /// In halves of smaller extent in `v` (from corner 1 to corner 2).
    V,
    /// In quarters.
    Both,
}

/// Mean of some corners and the largest distance of one from it, metres.
pub(super) fn ball(corners: &[DVec3]) -> (DVec3, f64) {
    let mut sum = DVec3::ZERO;
    for &corner in corners {
        sum += corner;
    }
    let centre = sum / corners.len() as f64;
    let mut square = 0.0_f64;
    for &corner in corners {
        square = square.max((corner - centre).length_squared());
    }
    (centre, square.sqrt())
}

struct Bilinear {
    centre: DVec3,
    along: DVec3,
    across: DVec3,
    twist: DVec3,
    /// Area element at the centre and its slopes along `u` and `v`, m².
    element: [f64; 3],
}

impl Bilinear {
    fn new([a, b, c, d]: [DVec3; 4], normal: DVec3) -> Bilinear {
        // A quarter of the sums and differences of corners: the map's coefficients on [-1, 1]^2.
        let centre = 0.25 * ((a + b) + (c + d));
        let along = 0.25 * ((b - a) + (c - d));
        let across = 0.25 * ((d - a) + (c - b));
        let twist = 0.25 * ((c - d) - (b - a));
        let element =
            [along.cross(across).dot(normal), along.cross(twist).dot(normal), twist.cross(across).dot(normal)];
        Bilinear { centre, along, across, twist, element }
    }

    #[inline]
    fn at(&self, u: f64, v: f64, weight: f64) -> Weighted {
        let position = self.centre + self.along * u + self.across * v + self.twist * (u * v);
        (position, weight * (self.element[0] + u * self.element[1] + v * self.element[2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlines() -> [Vec<DVec3>; 3] {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        [
            vec![p(0.1, 0.2), p(2.0, 0.0), p(1.7, 1.5), p(0.0, 0.9)],
            vec![p(0.0, 0.0), p(5.0, 0.5), p(5.0, 1.0), p(0.2, 0.4)],
            vec![p(0.3, 0.1), p(1.4, 0.4), p(0.2, 2.0)],
        ]
    }

    /// Integral of `x^2` over a polygon by Green's theorem: `1/12 sum (x_i^2 + x_i x_j + x_j^2)(x_i y_j - x_j y_i)`.
    fn second_moment(corners: &[DVec3]) -> f64 {
        (0..corners.len())
            .map(|i| (corners[i], corners[(i + 1) % corners.len()]))
            .map(|(p, q)| (p.x * p.x + p.x * q.x + q.x * q.x) * (p.x * q.y - q.x * p.y) / 12.0)
            .sum()
    }

    /// Would catch a wrong weight, abscissa or area element: both rules integrate 1 and `x^2` as exactly as they claim
    /// (2 x 2 Gauss meets degree 3 in each variable: `x^2` times an affine area element).
    #[test]
    fn rules_integrate_quadratics() {
        for corners in outlines() {
            let piece = Piece::new(&corners);
            let exact = second_moment(&corners);
            let (few, count) = piece.few(DVec3::Z);
            let few: f64 = few[..count].iter().map(|(p, w)| w * p.x * p.x).sum();
            let nine: f64 = piece.nine(DVec3::Z).iter().map(|(p, w)| w * p.x * p.x).sum();
            // 1e-14: some tens of roundings.
            assert!((few / exact - 1.0).abs() < 1e-14, "{few} {exact}");
            assert!((nine / exact - 1.0).abs() < 1e-14, "{nine} {exact}");
        }
    }

    /// Would catch a hole or an overlap: the pieces' areas add up, twice in a row.
    #[test]
    fn pieces_partition() {
        for (corners, cut) in outlines().iter().flat_map(|c| [(c, Cut::U), (c, Cut::V), (c, Cut::Both)]) {
            let area = |piece: &Piece| piece.few(DVec3::Z).0.iter().map(|(_, w)| w).sum::<f64>();
            let whole = Piece::new(corners);
            let (pieces, count) = whole.split(cut);
            let mut total = 0.0;
            for piece in &pieces[..count] {
                let (inner, inner_count) = piece.split(cut);
                assert!(inner[..inner_count].iter().all(|p| area(p) > 0.0));
                total += inner[..inner_count].iter().map(area).sum::<f64>();
            }
            assert!((total / area(&whole) - 1.0).abs() < 1e-14);
        }
    }
}
