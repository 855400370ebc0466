//! One polygon, prepared for rays: its plane, and its edges as bands in the coordinate plane that it is projected to.

use super::ROUNDING;
use crate::scene::{Plane, Polygon};
use glam::DVec3;

/// A polygon as rays see it.
///
/// With `w` the axis along which the normal is largest and `u`, `v` the other two, a point of the plane is inside when
/// `|x_u - middle_u| <= half_u`, `|x_v - middle_v| <= half_v` and `|a x_u + b x_v + c| <= h` for each band `(a, b, c, h)`.
/// A band is the strip between an edge and its opposite corner; `a x_u + b x_v` changes by 1 per metre inside the
/// polygon's plane. All is `tau` wider than the corners say. A rectangle along the axes has no bands, a parallelogram
/// two, another polygon one for each edge.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub(super) normal: [f64; 3],
    pub(super) offset: f64,
    pub(super) axis_u: u8,
    pub(super) axis_v: u8,
    band_count: u8,
    /// Stops light altogether: no mask, opacity 1.
    pub(crate) opaque: bool,
    pub(super) middle: [f64; 2],
    pub(super) half: [f64; 2],
    bands: [[f64; 4]; 4],
}

/// Share of the tolerance by which corners may miss a rectangle or parallelogram and still count as one: small against
/// the margin `tau` that is added, large against rounding (1e-9 of the tolerance).
const SHAPE: f64 = 0.125;

/// Axes `u`, `v` that a plane is projected to, and `w` that it is projected along: that of the normal's largest
/// coordinate.
#[inline]
pub(super) fn projection(normal: DVec3) -> [usize; 3] {
    let size = normal.abs();
    let w = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    [(w + 1) % 3, (w + 2) % 3, w]
}

impl Surface {
    pub(super) fn new(polygon: &Polygon, tolerance: f64) -> Surface {
        let normal = polygon.plane.normal.to_array();
        let [axis_u, axis_v, axis_w] = projection(polygon.plane.normal);
        let count = polygon.corners.len();
        let flat = |corner: &DVec3| [corner[axis_u], corner[axis_v]];
        let corners = &polygon.corners;
        let mut lower = flat(&corners[0]);
        let mut upper = lower;
        for corner in corners.iter().map(flat) {
            for k in 0..2 {
                lower[k] = lower[k].min(corner[k]);
                upper[k] = upper[k].max(corner[k]);
            }
        }
        let middle = [0, 1].map(|k| 0.5 * (lower[k] + upper[k]));
        let half = [0, 1].map(|k| 0.5 * (upper[k] - lower[k]) + tolerance);
        let mut surface = Surface {
            normal,
            offset: polygon.plane.offset,
            axis_u: axis_u as u8,
            axis_v: axis_v as u8,
            band_count: 0,
            opaque: polygon.mask.is_none() && polygon.opacity >= 1.0,
            middle,
            half,
            bands: [[0.0; 4]; 4],
        };
        let slack = SHAPE * tolerance;
        let at_corner_of_box = |corner: [f64; 2]| {
            (0..2).all(|k| (corner[k] - lower[k]).abs() <= slack || (corner[k] - upper[k]).abs() <= slack)
        };
        if count == 4 && corners.iter().map(flat).all(at_corner_of_box) {
            return surface;
        }
        let parallelogram =
            count == 4 && (corners[0] - corners[1] + corners[2] - corners[3]).abs().max_element() <= slack;
        for i in 0..if parallelogram { 2 } else { count } {
            let (p, q) = (corners[i], corners[(i + 1) % count]);
            let inward = polygon.plane.normal.cross(q - p);
            let length = inward.length();
            if length <= slack {
                continue;
            }
            let inward = inward / length;
            let slope = inward[axis_w] / normal[axis_w];
            let (a, b) = (inward[axis_u] - slope * normal[axis_u], inward[axis_v] - slope * normal[axis_v]);
            let c = -(a * p[axis_u] + b * p[axis_v]);
            let height = corners.iter().map(flat).map(|x| a * x[0] + b * x[1] + c).fold(0.0, f64::max);
            surface.bands[surface.band_count as usize] = [a, b, c - 0.5 * height, 0.5 * height + tolerance];
            surface.band_count += 1;
        }
        surface
    }

    pub(super) fn plane(&self) -> Plane {
        Plane { normal: DVec3::from_array(self.normal), offset: self.offset }
    }

    /// Is the polygon's plane, near `point` and within `reach` of it, that plane or its reverse up to half of the slack
    /// for rounding, and projected to the same axes?
    pub(super) fn lies_in(&self, plane: &Plane, point: DVec3, reach: f64, tolerance: f64) -> bool {
        let own = self.plane();
        let own = if own.normal.dot(plane.normal) < 0.0 { own.reversed() } else { own };
        let apart = (own.distance(point) - plane.distance(point)).abs() + (own.normal - plane.normal).length() * reach;
        let [u, v, _] = projection(plane.normal);
        apart <= 0.5 * ROUNDING * tolerance && (self.axis_u as usize, self.axis_v as usize) == (u, v)
    }

    #[inline]
    pub(super) fn bands(&self) -> &[[f64; 4]] {
        &self.bands[..self.band_count as usize]
    }

    /// Parameter `t` at which `origin + t delta` meets the polygon; NaN or infinite where it does not meet the plane,
    /// NaN where it meets it outside. A line in the plane does not meet it.
    #[inline]
    pub(super) fn meet(&self, origin: &[f64; 3], delta: &[f64; 3]) -> f64 {
        let n = &self.normal;
        let distance = n[0] * origin[0] + n[1] * origin[1] + n[2] * origin[2] - self.offset;
        let slope = n[0] * delta[0] + n[1] * delta[1] + n[2] * delta[2];
        let t = -distance / slope;
        let (u, v) = (self.axis_u as usize, self.axis_v as usize);
        let x = [origin[u] + t * delta[u], origin[v] + t * delta[v]];
        let inside = (x[0] - self.middle[0]).abs() <= self.half[0] && (x[1] - self.middle[1]).abs() <= self.half[1];
        let inside =
            self.bands().iter().fold(inside, |inside, &[a, b, c, h]| inside & ((a * x[0] + b * x[1] + c).abs() <= h));
        if inside { t } else { f64::NAN }
    }

    /// Does a ray along `delta` come from the front?
    #[inline]
    pub(super) fn faces(&self, delta: &[f64; 3]) -> bool {
        let n = &self.normal;
        n[0] * delta[0] + n[1] * delta[1] + n[2] * delta[2] < 0.0
    }
}
