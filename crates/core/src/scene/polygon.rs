//! One input surface after validation: corners, plane, and how it reflects, emits and lets light pass.

use super::Corners;
use crate::units::Rgb;
use glam::{DVec2, DVec3};

/// An oriented plane `{x : normal . x = offset}`; `normal` is of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal, pointing to the front.
    pub normal: DVec3,
    /// Signed distance of the origin's foot point along the normal, metres.
    pub offset: f64,
}

impl Plane {
    /// Signed distance of a point, metres; positive in front.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// The same plane seen from the other side.
    #[must_use]
    pub fn reversed(&self) -> Plane {
        Plane { normal: -self.normal, offset: -self.offset }
    }
}

/// Which side of a surface a polygon stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The geometry itself; its back is black unless it has a twin.
    Front,
    /// The back of a two-sided surface; gets elements only once light reaches it.
    Back,
}

/// An input surface, triangle or planar convex quadrilateral, one-sided.
#[derive(Clone, Debug)]
pub struct Polygon {
    /// Three or four corners, counter-clockwise seen from the lit side, metres.
    pub corners: Corners,
    /// Supporting plane, normal on the lit side.
    pub plane: Plane,
    /// Area, m².
    pub area: f64,
    /// Diffuse reflectance per band, opacity included (a surface that is half open reflects half), in `[0, 1)`.
    pub reflectance: Rgb,
    /// Emitted radiosity per band, W/m² or lm/m² (pi times the radiance of a glTF file).
    pub emission: Rgb,
    /// Share of arriving light that does not pass through, in `(0, 1]`; the mean over a cut-out mask.
    pub opacity: f64,
    /// Cut-out mask that rays look up instead of `opacity`: index into [`super::Scene::masks`].
    pub mask: Option<u32>,
    /// Index into [`super::Scene::objects`].
    pub object: u32,
    /// Index into [`super::Scene::materials`].
    pub material: u32,
    /// Front or back.
    pub side: Side,
    /// The other side of a two-sided surface.
    pub twin: Option<u32>,
    /// Input triangles that make up this polygon: the second is [`super::Scene::NO_POLYGON`] for a triangle.
    pub faces: [u32; 2],
    /// Texture coordinates of the corners, where the object has any. They are an affine function of position.
    pub uv: Option<[DVec2; 4]>,
}

impl Polygon {
    /// Share of arriving light that this surface turns to heat, per band: `opacity - reflectance`.
    #[must_use]
    pub fn absorptance(&self) -> Rgb {
        Rgb::splat(self.opacity) - self.reflectance
    }

    /// Texture coordinates at a point of the polygon: the affine map fixed by corners 0, 1, 2.
    #[must_use]
    pub fn texture_coordinates(&self, position: DVec3) -> Option<DVec2> {
        let uv = self.uv?;
        let origin = self.corners[0];
        let (e1, e2) = (self.corners[1] - origin, self.corners[2] - origin);
        let offset = position - origin;
        let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
        let (p1, p2) = (offset.dot(e1), offset.dot(e2));
        let determinant = d11 * d22 - d12 * d12;
        let (s, t) = ((d22 * p1 - d12 * p2) / determinant, (d11 * p2 - d12 * p1) / determinant);
        Some(uv[0] + (uv[1] - uv[0]) * s + (uv[2] - uv[0]) * t)
    }
}
