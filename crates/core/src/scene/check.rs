//! The invariants of a scene, listed and checked.

use super::{Scene, Side};
use thiserror::Error;

/// A broken invariant of a scene.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("polygon {polygon}: violated: {what}")]
pub struct SceneViolation {
    /// Where.
    pub polygon: u32,
    /// Which invariant.
    pub what: &'static str,
}

impl Scene {
    /// Checks the invariants: fronts come before backs and twins know each other; normals are of unit length and
    /// corners lie in their plane; areas are positive, and those of fronts add up to the scene's;
    /// reflectance is in `[0, 1)` and at most opacity; emission is finite and not negative; faces and polygons name
    /// each other, and triangles have corners of their polygon.
    ///
    /// # Errors
    /// The first violation.
    pub fn check(&self) -> Result<(), SceneViolation> {
        for (index, polygon) in self.polygons.iter().enumerate() {
            let fail = |what| Err(SceneViolation { polygon: index as u32, what });
            if (index < self.fronts) != (polygon.side == Side::Front) {
                return fail("fronts come before backs");
            }
            let twin = polygon.twin.map(|twin| self.polygons.get(twin as usize).and_then(|twin| twin.twin));
            if twin.is_some_and(|back| back != Some(index as u32)) || (polygon.side == Side::Back && twin.is_none()) {
                return fail("twins know each other");
            }
            // Normalising in f64 leaves a few units in the last place (2^-52).
            if (polygon.plane.normal.length() - 1.0).abs() > 1e-14 {
                return fail("normals are of unit length");
            }
            let magnitude = polygon.corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
            // Twice what joining lets in, see `build::is_planar_convex`.
            if polygon.corners.iter().any(|&corner| polygon.plane.distance(corner).abs() > 1e-6 * magnitude) {
                return fail("corners lie in the plane");
            }
            if !(polygon.area.is_finite() && polygon.area > 0.0) {
                return fail("areas are positive");
            }
            let values = [polygon.reflectance.min_component(), polygon.emission.min_component(), polygon.opacity];
            if values.iter().any(|value| !(value.is_finite() && *value >= 0.0)) || !polygon.emission.is_finite() {
                return fail("reflectance, emission and opacity are finite and not negative");
            }
            if polygon.reflectance.max_component() >= 1.0 || polygon.absorptance().min_component() < 0.0 {
                return fail("reflectance is below 1 and at most opacity");
            }
            for &face in polygon.faces.iter().filter(|&&face| face != Scene::NO_POLYGON) {
                let owner = self.face_polygon.get(face as usize).copied();
                if owner != Some(if polygon.side == Side::Front { index as u32 } else { polygon.twin.unwrap_or(0) }) {
                    return fail("faces and polygons name each other");
                }
            }
        }
        if self.fronts > self.polygons.len() || self.front_area != Scene::area_of(&self.polygons[..self.fronts]) {
            return Err(SceneViolation { polygon: 0, what: "areas of fronts add up to the scene's" });
        }
        for (face, &polygon) in self.face_polygon.iter().enumerate().filter(|&(_, &owner)| owner != Scene::NO_POLYGON) {
            let fail = |what| Err(SceneViolation { polygon, what });
            let Some(owner) = self.polygons.get(polygon as usize).filter(|owner| owner.faces.contains(&(face as u32)))
            else {
                return fail("faces and polygons name each other");
            };
            let triangle = self.triangles.get(face);
            if !triangle.is_some_and(|triangle| triangle.iter().all(|corner| owner.corners.contains(corner))) {
                return fail("triangles have corners of their polygon");
            }
        }
        Ok(())
    }
}
