//! Values at points: a field and a place go in, the light there comes out.

use crate::geometry::{Element, Geometry, NONE};
use crate::light::{Bands, Field, Light};
use crate::link::MIDDLE;
use glam::{DVec3, Vec3};
use isolux_core::solution::bilinear_coordinates;

/// Irradiance at a point of a polygon, in the middle's coordinates.
pub(crate) fn field_at(geometry: &Geometry, elements: &[Element], light: &Light, polygon: u32, point: Vec3) -> Bands {
    let normal = geometry.surfaces[polygon as usize].normal;
    let mut index = polygon as usize;
    while elements[index].first_child != NONE {
        index = elements[index].first_child as usize + quadrant(&elements[index], normal, point);
    }
    let element = &elements[index];
    let corners = element.corners.map(|corner| corner.as_dvec3());
    within(&corners[..element.count as usize], normal.as_dvec3(), point.as_dvec3(), &light.field[index])
}

/// A leaf's field at one of its points: linear along the sides, and the bulge in between. A point that rounding puts
/// outside takes the value on the border.
pub(crate) fn within(corners: &[DVec3], normal: DVec3, point: DVec3, field: &Field) -> Bands {
    let (weights, bulge) = if let &[a, b, c, d] = corners {
        let (s, t) = bilinear_coordinates([a, b, c, d], normal, point);
        let (u, v) = (2.0 * s - 1.0, 2.0 * t - 1.0);
        ([(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t], 1.0 - 0.5 * (u * u + v * v))
    } else {
        let (a, b, c) = (corners[0], corners[1], corners[2]);
        let whole = normal.dot((b - a).cross(c - a));
        let first = (normal.dot((b - point).cross(c - point)) / whole).clamp(0.0, 1.0);
        let second = (normal.dot((c - point).cross(a - point)) / whole).clamp(0.0, 1.0);
        let third = (1.0 - first - second).max(0.0);
        ([first, second, third, 0.0], 3.0 * (first * second + second * third + third * first))
    };
    let count = corners.len();
    std::array::from_fn(|band| {
        let at = |k: usize| f64::from(field[k][band]);
        let plain: f64 = (0..count).map(|k| weights[k] * at(k)).sum();
        let mean = (0..count).map(at).sum::<f64>() / count as f64;
        (plain + bulge * (at(MIDDLE) - mean)).max(0.0) as f32
    })
}

/// Which quarter holds a point: [`isolux_core::tree::quadrant_of`] in single precision, since rays ask it by the million.
pub(crate) fn quadrant(element: &Element, normal: Vec3, point: Vec3) -> usize {
    let left = |from: Vec3, to: Vec3| normal.dot((to - from).cross(point - from)) > 0.0;
    let middle = |a: Vec3, b: Vec3| (a + b) * 0.5;
    let [a, b, c, d] = element.corners;
    let (ab, bc) = (middle(a, b), middle(b, c));
    if element.count == 4 {
        let (cd, da) = (middle(c, d), middle(d, a));
        match (left(ab, cd), left(da, bc)) {
            (true, false) => 0,
            (false, false) => 1,
            (false, true) => 2,
            (true, true) => 3,
        }
    } else {
        let ca = middle(c, a);
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
}
