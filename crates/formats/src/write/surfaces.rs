//! One look over scene and mesh before anything is written: that they belong together, that all indices exist, that
//! all numbers fit the formats; the writers rely on it and check nothing again.

use super::WriteError;
use isolux_core::DVec3;
use isolux_core::scene::{Alpha, Polygon, Scene};
use isolux_core::solution::SurfaceMesh;
use isolux_core::units::Rgb;
use std::ops::Range;

/// A scene and a mesh that fit each other, checked.
pub(super) struct Surfaces<'a> {
    /// The scene.
    pub(super) scene: &'a Scene,
    /// Its mesh.
    pub(super) mesh: &'a SurfaceMesh,
}

impl<'a> Surfaces<'a> {
    /// Invariants that hold afterwards: there is a triangle; ranges of polygons ascend and end at the array lengths;
    /// triangles use vertices of their own polygon; objects, materials, masks, images that are named exist; positions,
    /// normals, irradiance and radiosity are finite as 32-bit floats.
    pub(super) fn check(scene: &'a Scene, mesh: &'a SurfaceMesh) -> Result<Surfaces<'a>, WriteError> {
        let mismatch = |what, found, expected| {
            if found == expected {
                Ok(())
            } else {
                Err(WriteError::Mismatch { scene: scene.name.clone(), what, found, expected })
            }
        };
        let polygons = scene.polygons.len();
        let vertices = mesh.positions.len();
        if mesh.triangles.is_empty() {
            return Err(WriteError::Empty { scene: scene.name.clone() });
        }
        mismatch("the number of irradiance values", mesh.irradiance.len(), vertices)?;
        mismatch("the number of radiosity values", mesh.radiosity.len(), vertices)?;
        for (what, starts, end) in [
            ("the number of vertex ranges", &mesh.vertex_start, vertices),
            ("the number of triangle ranges", &mesh.triangle_start, mesh.triangles.len()),
        ] {
            mismatch(what, starts.len(), polygons + 1)?;
            mismatch("the start of the first range", starts[0] as usize, 0)?;
            mismatch("the end of the last range", starts[polygons] as usize, end)?;
            for pair in starts.windows(2) {
                mismatch("the end of a range before its start", pair[0].min(pair[1]) as usize, pair[0] as usize)?;
            }
        }
        for index in 0..polygons as u32 {
            check_polygon(scene, mesh, index)?;
        }
        Ok(Surfaces { scene, mesh })
    }

    /// Polygons that have triangles, with their numbers.
    pub(super) fn polygons(&self) -> impl Iterator<Item = (u32, &'a Polygon)> {
        let (scene, mesh) = (self.scene, self.mesh);
        (0..).zip(&scene.polygons).filter(move |&(index, _)| !mesh.triangles_of(index).is_empty())
    }

    /// Vertices of a polygon.
    pub(super) fn vertices_of(&self, polygon: u32) -> Range<usize> {
        self.mesh.vertices_of(polygon)
    }
}

/// The share of [`Surfaces::check`] that concerns one polygon.
fn check_polygon(scene: &Scene, mesh: &SurfaceMesh, index: u32) -> Result<(), WriteError> {
    let polygon = &scene.polygons[index as usize];
    let in_range = |what, name: &str, index: u32, count: usize| {
        if (index as usize) < count {
            Ok(())
        } else {
            Err(WriteError::OutOfRange { what, name: name.to_owned(), index: index as usize, count })
        }
    };
    in_range("object", &format!("polygon {index}"), polygon.object, scene.objects.len())?;
    let name = &scene.objects[polygon.object as usize].name;
    in_range("material", name, polygon.material, scene.materials.len())?;
    let material = &scene.materials[polygon.material as usize];
    if let Some(texture) = &material.texture {
        in_range("image", &material.name, texture.image, scene.images.len())?;
        finite_rgb("texture factor", &material.name, texture.factor)?;
    }
    if let Alpha::Mask(mask) = material.alpha {
        in_range("mask", &material.name, mask, scene.masks.len())?;
    }
    finite_vector("normal", name, polygon.plane.normal)?;
    finite("opacity", name, polygon.opacity)?;
    let range = mesh.vertices_of(index);
    for &corner in mesh.triangles[mesh.triangles_of(index)].iter().flatten() {
        if !range.contains(&(corner as usize)) {
            let (what, count) = ("vertex (not one of its polygon)", range.end);
            return Err(WriteError::OutOfRange { what, name: name.clone(), index: corner as usize, count });
        }
    }
    for vertex in range {
        finite_vector("vertex position", name, mesh.positions[vertex])?;
        finite_rgb("irradiance", name, mesh.irradiance[vertex])?;
        finite_rgb("radiosity", name, mesh.radiosity[vertex])?;
    }
    Ok(())
}

/// `value`, if a 32-bit float can hold it.
pub(super) fn finite(what: &'static str, name: &str, value: f64) -> Result<(), WriteError> {
    if (value as f32).is_finite() { Ok(()) } else { Err(WriteError::NotFinite { what, name: name.to_owned(), value }) }
}

/// [`finite`] for three bands.
pub(super) fn finite_rgb(what: &'static str, name: &str, value: Rgb) -> Result<(), WriteError> {
    value.0.into_iter().try_for_each(|band| finite(what, name, band))
}

/// [`finite`] for three coordinates.
pub(super) fn finite_vector(what: &'static str, name: &str, value: DVec3) -> Result<(), WriteError> {
    value.to_array().into_iter().try_for_each(|coordinate| finite(what, name, coordinate))
}
