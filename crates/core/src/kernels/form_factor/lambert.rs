//! The closed form from a point to a polygon: a differential receiver and a convex outline go in, the form factor
//! comes out; where to put the receivers is left to `pair`.

use super::outline::{MOST_CORNERS, Outline, heights, snapped_distance};
use crate::kernels::Patch;
use crate::scene::Plane;
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, PI};

/// Form factor from a differential receiver to a one-sided patch, unoccluded.
///
/// **Formula.** `F = 1/(2 pi) sum_i gamma_i (R_(i+1) x R_i)/|R_(i+1) x R_i| . n`, the sum over the edges of the part of
/// the source above the receiver's horizon.
///
/// **Symbols.** `R_i = v_i - p`: from the receiver at `p` to corner `v_i`, metres; `n`: unit normal of the receiver;
/// `gamma_i`: angle between `R_i` and `R_(i+1)`, radians; `F`: share of what leaves the receiver that reaches the
/// source, 0 to 1.
///
/// **Source.** J. H. Lambert, *Photometria* (1760); in this form D. R. Baum, H. E. Rushmeier, J. M. Winget, *Improving
/// radiosity solutions through the use of analytically determined form-factors* (SIGGRAPH 1989).
///
/// **Preconditions.** `normal` of unit length; the source planar, convex, and counter-clockwise about its plane's
/// normal. A receiver behind the source's plane, or on it as far as rounding can tell, has `F = 0`.
///
/// **How it is evaluated.** `gamma/sin gamma` is one rational function of `sin^2(gamma/2) = (1 - cos gamma)/2`, so no
/// angle is ever taken; `(R_i x R_(i+1)) . n = R_i . (e_i x n)` with the edge `e_i`, which keeps the rounding of a far
/// source's terms in proportion to the edge. What is left of the cancellation between edges is a relative error of
/// about `r/s` units of rounding for a source of size `s` at distance `r`; beyond `r/s = 4096` a three-point rule
/// on the triangles of a fan takes over, whose own error falls as `(s/r)^3`.
///
/// **Error bound.** Absolute `1e-13` (test `closed_form_agrees_with_libm`); relative `2e-12` for unclipped
/// sources at any distance from 10 to 10^8 sizes, at most 60 degrees off either normal
/// (test `far_sources_keep_relative_accuracy`). About 90 ns a quadrilateral (bench `form_factor`, `point to quad`).
#[must_use]
pub fn point_factor(point: DVec3, normal: DVec3, source: &Patch) -> f64 {
    if snapped_distance(point, source.plane) <= 0.0 {
        return 0.0;
    }
    let corners: &[DVec3] = source.corners;
    let mut above = true;
    for &corner in corners {
        above &= normal.dot(corner - point) > 0.0;
    }
    let visible = if above {
        Outline::new(corners)
    } else {
        let horizon = Plane { normal, offset: normal.dot(point) };
        Outline::in_front(corners, &heights(corners, &horizon))
    };
    if visible.is_empty() {
        return 0.0;
    }
    Source::new(&visible, normal, source.plane.normal).factor(point)
}

/// Distance in sizes (longest edges) of the source beyond which the fan of three-point rules replaces the closed form.
///
/// Measured on a tilted quadrilateral (worst of 200 directions, relative error, closed form / fan rule, in the test
/// `far_switch_is_bracketed`): at half of it 6.5e-13 / 9.6e-12, at it 8.9e-13 / 1.2e-12, at twice 1.7e-12 / 1.5e-13.
pub(super) const FAR: f64 = 4096.0;

/// A source outline prepared for receivers that share one normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    outline: Outline,
    /// `e_i x n` for each edge, metres.
    moments: [DVec3; MOST_CORNERS],
    receiver_normal: DVec3,
    normal: DVec3,
    /// Square of the longest edge, m².
    size_squared: f64,
}

impl Source {
    /// Prepares `outline`, all of it above the horizon of every receiver asked for later.
    pub(super) fn new(outline: &Outline, receiver_normal: DVec3, normal: DVec3) -> Source {
        let corners = outline.corners();
        let mut moments = [DVec3::ZERO; MOST_CORNERS];
        let mut size_squared = 0.0_f64;
        for i in 0..corners.len() {
            let edge = corners[if i + 1 == corners.len() { 0 } else { i + 1 }] - corners[i];
            size_squared = size_squared.max(edge.length_squared());
            moments[i] = edge.cross(receiver_normal);
        }
        Source { outline: *outline, moments, receiver_normal, normal, size_squared }
    }

    /// Corners of the prepared outline.
    pub(super) fn corners(&self) -> &[DVec3] {
        self.outline.corners()
    }

    /// Form factor from `point` to the whole outline.
    ///
    /// Preconditions: the outline above the receiver's horizon, the point in front of the source's plane.
    pub(super) fn factor(&self, point: DVec3) -> f64 {
        let far = (self.outline.points()[0] - point).length_squared() > FAR * FAR * self.size_squared;
        let sum = if far { self.fan(point) } else { self.closed(point) };
        // A NaN (a receiver on a corner, a source without extent) counts as nothing.
        if sum > 0.0 { sum.min(1.0) } else { 0.0 }
    }

    fn closed(&self, point: DVec3) -> f64 {
        match self.outline.corners().len() {
            3 => self.edges::<3>(point),
            4 => self.edges::<4>(point),
            _ => self.edges::<MOST_CORNERS>(point),
        }
    }

    #[inline]
    fn edges<const N: usize>(&self, point: DVec3) -> f64 {
        let corners = self.outline.points();
        let mut rays = [DVec3::ZERO; N];
        let mut lengths = [0.0; N];
        for i in 0..N {
            rays[i] = corners[i] - point;
            lengths[i] = rays[i].length();
        }
        let mut sum = 0.0;
        for i in 0..N {
            let j = (i + 1) % N;
            let scale = 1.0 / (lengths[i] * lengths[j]);
            let half = 0.5 - 0.5 * rays[i].dot(rays[j]) * scale;
            let moment = rays[i].dot(self.moments[i]);
            let ratio = if half <= 0.5 {
                angle_over_sine(half) * scale
            } else {
                // Beyond a right angle: gamma/sin gamma = pi/sin gamma - (pi - gamma)/sin gamma, the sine from the
                // cross product with the edge, which stays accurate as the receiver nears the edge itself.
                let sine = rays[i].cross(corners[j] - corners[i]).length();
                if sine > 0.0 { PI / sine - angle_over_sine(1.0 - half) * scale } else { 0.0 }
            };
            sum += ratio * moment;
        }
        -0.5 * FRAC_1_PI * sum
    }

    /// Three points at the middle of the edges of each triangle of a fan (exact for quadratics; Strang and Fix 1973,
    /// page 184), each with the kernel `cos cos' / (pi r^2)`.
    fn fan(&self, point: DVec3) -> f64 {
        let corners = self.outline.corners();
        let mut sum = 0.0;
        for i in 1..corners.len() - 1 {
            let (a, b, c) = (corners[0], corners[i], corners[i + 1]);
            let twice_area = (b - a).cross(c - a).dot(self.normal);
            let mut kernel = 0.0;
            for middle in [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)] {
                kernel += point_kernel(point, self.receiver_normal, middle, self.normal);
            }
            sum += twice_area * kernel;
        }
        // 1/3 of the area at each of three points: 1/6 of twice the area.
        sum / 6.0
    }
}

/// `cos cos' / (pi r^2)` between two points, 1/m²; not clipped.
#[inline]
pub(super) fn point_kernel(p: DVec3, p_normal: DVec3, q: DVec3, q_normal: DVec3) -> f64 {
    let ray = q - p;
    let square = ray.length_squared();
    -FRAC_1_PI * ray.dot(p_normal) * ray.dot(q_normal) / (square * square)
}

/// `gamma / sin gamma` as a function of `h = sin^2(gamma/2)`, for angles up to a right angle (`h` in 0 to 1/2).
///
/// **Formula.** `gamma / sin gamma = 2F1(1, 1; 3/2; h)`, by a rational function of degrees 5 and 5 that is exactly 1 at
/// `h = 0`.
///
/// **Source.** Abramowitz and Stegun 1964, chapter 15, with `z^2 = h`; coefficients by rational interpolation at the ten
/// Chebyshev nodes of [0, 1/2], solved with 60 digits. Degrees (4, 4) would leave 2.8e-11, (6, 5) 4.5e-15.
///
/// **Error bound.** Relative `7.5e-14` (test `angle_over_sine_meets_its_bound`); no multiply-add is fused, so that
/// every platform gives the same bits.
#[inline]
fn angle_over_sine(h: f64) -> f64 {
    let numerator = 1.0
        + h * (-2.3844714492484913
            + h * (1.9789268862373504
                + h * (-0.6604934063807356 + h * (0.07277321569879833 + h * -0.0005944585967252565))));
    let denominator = 1.0
        + h * (-3.0511381159151547
            + h * (3.479685630179473
                + h * (-1.8101530217390083 + h * (0.4121663483208679 + h * -0.03025130588199171))));
    numerator / denominator
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Corners;

    /// The textbook form with angles by libm, for sources wholly above the horizon.
    fn textbook(point: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
        let mut sum = 0.0;
        for i in 0..corners.len() {
            let (a, b) = (corners[i] - point, corners[(i + 1) % corners.len()] - point);
            let cross = b.cross(a);
            sum += libm::atan2(cross.length(), a.dot(b)) * cross.normalize().dot(normal);
        }
        sum / (2.0 * PI)
    }

    fn kite() -> (Corners, Plane) {
        let corners = Corners::quad(
            DVec3::new(-0.5, -0.4, 0.0),
            DVec3::new(-0.3, 0.5, 0.0),
            DVec3::new(0.45, 0.6, 0.0),
            DVec3::new(0.5, -0.5, 0.0),
        );
        (corners, Plane { normal: -DVec3::Z, offset: 0.0 })
    }

    /// Would catch a mistyped coefficient: `gamma / sin gamma` against libm's arc sine over the whole range, and 1 at 0.
    #[test]
    fn angle_over_sine_meets_its_bound() {
        assert_eq!(angle_over_sine(0.0), 1.0);
        for step in 1..=5000 {
            let h = f64::from(step) / 10_000.0;
            let exact = libm::asin(h.sqrt()) / (h * (1.0 - h)).sqrt();
            let error = angle_over_sine(h) / exact - 1.0;
            assert!(error.abs() < 7.5e-14, "{h}: {error:e}");
        }
    }

    /// Would catch a wrong sign, a wrong branch beyond a right angle, or noise near planes, edges' lines and corners:
    /// the textbook form with libm at the distances where that is itself good to 1e-13.
    #[test]
    fn closed_form_agrees_with_libm() {
        let (corners, plane) = kite();
        let source = Patch { corners: &corners, plane: &plane, area: corners.area() };
        let mut over_a_right_angle = 0;
        for height in [1e-9, 1e-6, 1e-3, 0.1, 1.0, 5.0] {
            for x in [-2.0, -0.5, -0.3, 0.0, 0.45, 0.5, 1.5] {
                for y in [-1.0, -0.5, -0.4, 0.0, 0.3, 0.6, 2.0] {
                    let point = DVec3::new(x, y, -height);
                    let exact = textbook(point, DVec3::Z, &corners);
                    let value = point_factor(point, DVec3::Z, &source);
                    over_a_right_angle += i32::from(value > 0.5);
                    assert!((value - exact).abs() < 1e-13, "{point}: {value:e} {exact:e}");
                }
            }
        }
        assert!(over_a_right_angle > 0);
    }

    /// The fan rule on many small pieces: no cancellation, and as exact as the pieces are small.
    fn reference(point: DVec3, normal: DVec3, corners: &Corners, source_normal: DVec3) -> f64 {
        // The fan's error falls as (piece / distance)^4: at ten sizes 32 cells leave 8e-11, 128 a 256th of it.
        let cells = if (corners[0] - point).length() < 50.0 { 128 } else { 32 };
        let at = |u: f64, v: f64| {
            corners[0] * ((1.0 - u) * (1.0 - v))
                + corners[1] * (u * (1.0 - v))
                + corners[2] * (u * v)
                + corners[3] * ((1.0 - u) * v)
        };
        let mut sum = 0.0;
        for row in 0..cells {
            for column in 0..cells {
                let edge = |k: i32| f64::from(k) / f64::from(cells);
                let piece = Outline::new(&[
                    at(edge(column), edge(row)),
                    at(edge(column + 1), edge(row)),
                    at(edge(column + 1), edge(row + 1)),
                    at(edge(column), edge(row + 1)),
                ]);
                sum += Source::new(&piece, normal, source_normal).fan(point);
            }
        }
        sum
    }

    fn worst_of(distance: f64, evaluate: impl Fn(&Source, DVec3) -> f64) -> f64 {
        let (corners, plane) = kite();
        let mut worst = 0.0_f64;
        for k in 0..200 {
            // A spiral of directions up to 60 degrees off the source's normal, the receiver turned as far again.
            let (tilt, turn) = (f64::from(k) / 200.0 * PI / 3.0, 2.4 * f64::from(k));
            let direction =
                DVec3::new(libm::sin(tilt) * libm::cos(turn), libm::sin(tilt) * libm::sin(turn), libm::cos(tilt));
            let point = -direction * distance;
            let normal = (direction + 0.5 * DVec3::new(direction.y, direction.z, -direction.x)).normalize();
            let exact = reference(point, normal, &corners, plane.normal);
            let source = Source::new(&Outline::new(&corners), normal, plane.normal);
            worst = worst.max((evaluate(&source, point) / exact - 1.0).abs());
        }
        worst
    }

    /// Would catch cancellation between the edges of a far source, and a wrong switch to the fan rule.
    #[test]
    fn far_sources_keep_relative_accuracy() {
        for distance in [10.0, 1e2, 1e3, 3e3, 5e3, 1e4, 1e6, 1e8] {
            let worst = worst_of(distance, Source::factor);
            assert!(worst < 2e-12, "{distance}: {worst:e}");
        }
    }

    /// Would catch a switch in the wrong place.
    #[test]
    fn far_switch_is_bracketed() {
        assert!(worst_of(FAR / 2.0, Source::closed) < worst_of(FAR / 2.0, Source::fan));
        assert!(worst_of(FAR * 2.0, Source::closed) > worst_of(FAR * 2.0, Source::fan));
    }

    /// Would catch a source seen from behind or from within its plane, and a receiver that faces away.
    #[test]
    fn hidden_sides_give_exactly_zero() {
        let (corners, plane) = kite();
        let source = Patch { corners: &corners, plane: &plane, area: corners.area() };
        assert_eq!(point_factor(DVec3::Z, -DVec3::Z, &source), 0.0);
        assert_eq!(point_factor(DVec3::ZERO, DVec3::Z, &source), 0.0);
        assert_eq!(point_factor(DVec3::X * 3.0, DVec3::Z, &source), 0.0);
        assert_eq!(point_factor(-DVec3::Z, -DVec3::Z, &source), 0.0);
        assert!(point_factor(-DVec3::Z, DVec3::Z, &source) > 0.1);
    }
}
