//! Smooth values at the vertices of a mesh without cracks: what pictures and files are made from.

use crate::units::Rgb;
use glam::DVec3;
use std::ops::Range;

/// The surfaces of a solution as triangles with values at their vertices.
///
/// Vertices and triangles of a polygon are contiguous; no vertex is shared between polygons (coplanar neighbours with
/// a common edge have equal irradiance along it). There are no T-junctions inside a polygon nor along edges that
/// polygons share (D20).
#[derive(Clone, Debug, Default)]
pub struct SurfaceMesh {
    /// Vertex positions, metres.
    pub positions: Vec<DVec3>,
    /// Irradiance H at the vertices, W/m² or lm/m².
    pub irradiance: Vec<Rgb>,
    /// Radiosity `E + rho H` at the vertices, W/m² or lm/m².
    pub radiosity: Vec<Rgb>,
    /// Triangles, counter-clockwise seen from the front, as indices into the vertex arrays.
    pub triangles: Vec<[u32; 3]>,
    /// First vertex of each polygon of the scene, and the number of vertices at the end.
    pub vertex_start: Vec<u32>,
    /// First triangle of each polygon of the scene, and the number of triangles at the end.
    pub triangle_start: Vec<u32>,
}

impl SurfaceMesh {
    /// Vertices of a polygon.
    #[must_use]
    pub fn vertices_of(&self, polygon: u32) -> Range<usize> {
        self.vertex_start[polygon as usize] as usize..self.vertex_start[polygon as usize + 1] as usize
    }

    /// Triangles of a polygon.
    #[must_use]
    pub fn triangles_of(&self, polygon: u32) -> Range<usize> {
        self.triangle_start[polygon as usize] as usize..self.triangle_start[polygon as usize + 1] as usize
    }
}
