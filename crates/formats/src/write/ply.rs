//! A scene and its lit mesh come in, a binary little-endian PLY file (G. Turk, *The PLY polygon file format*, 1994)
//! goes out, with raw irradiance and radiosity at the vertices.

use super::surfaces::Surfaces;
use super::{Provenance, WriteError};
use isolux_core::scene::Scene;
use isolux_core::solution::SurfaceMesh;

/// Floats of a vertex: position, normal, irradiance, radiosity.
const VERTEX: [&str; 12] = [
    "x",
    "y",
    "z",
    "nx",
    "ny",
    "nz",
    "irradiance_r",
    "irradiance_g",
    "irradiance_b",
    "radiosity_r",
    "radiosity_g",
    "radiosity_b",
];

/// The scene's surfaces with their light as a PLY file; the provenance, the exposure and the object names are comments
/// `isolux KEY VALUE` and `object NUMBER NAME`.
///
/// # Errors
/// [`WriteError`] where the mesh is empty or not one of this scene, where a number is not finite, and where there are
/// more vertices than signed 32-bit indices.
pub fn ply(scene: &Scene, mesh: &SurfaceMesh, exposure: f64, provenance: &Provenance) -> Result<Vec<u8>, WriteError> {
    let surfaces = Surfaces::check(scene, mesh)?;
    let limit = i32::MAX as usize;
    for (what, found) in [("vertices", mesh.positions.len()), ("polygons", scene.polygons.len())] {
        if found > limit {
            return Err(WriteError::TooLarge { what, found, limit, format: "PLY" });
        }
    }
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {}\n", provenance.generator());
    let mut line = |text: &str| {
        // A comment ends with its line.
        header.extend(text.chars().map(|c| if c.is_control() { ' ' } else { c }));
        header.push('\n');
    };
    for (key, value) in provenance.entries(Some(exposure)) {
        comment(&mut line, &format!("isolux {key} {value}"));
    }
    for (index, object) in scene.objects.iter().enumerate() {
        comment(&mut line, &format!("object {index} {}", object.name));
    }
    line(&format!("element vertex {}", mesh.positions.len()));
    for name in VERTEX {
        line(&format!("property float {name}"));
    }
    line(&format!("element face {}", mesh.triangles.len()));
    line("property list uchar int vertex_indices");
    line("property int polygon");
    line("property int object");
    line("end_header");

    let mut file = header.into_bytes();
    file.reserve(mesh.positions.len() * 4 * VERTEX.len() + mesh.triangles.len() * (1 + 5 * 4));
    for (index, polygon) in (0..).zip(&scene.polygons) {
        for vertex in surfaces.vertices_of(index) {
            let (position, normal) = (mesh.positions[vertex].to_array(), polygon.plane.normal.to_array());
            for value in [position, normal, mesh.irradiance[vertex].0, mesh.radiosity[vertex].0].as_flattened() {
                file.extend_from_slice(&(*value as f32).to_le_bytes());
            }
        }
    }
    for (index, polygon) in surfaces.polygons() {
        for triangle in &mesh.triangles[mesh.triangles_of(index)] {
            file.push(3);
            for value in triangle.iter().chain(&[index, polygon.object]) {
                file.extend_from_slice(&value.to_le_bytes());
            }
        }
    }
    Ok(file)
}

/// A comment line. Readers that look for the header's last word anywhere in a line (trimesh 5 does) do not find it.
fn comment(line: &mut impl FnMut(&str), text: &str) {
    line(&format!("comment {}", text.replace("end_header", "end-header")));
}
