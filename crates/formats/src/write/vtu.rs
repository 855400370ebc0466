//! A scene and its lit mesh come in, a VTK XML unstructured grid goes out for ParaView: 64-bit values, appended raw
//! after the XML text (VTK file formats, "XML formats", appended data with `UInt64` headers).

use super::surfaces::Surfaces;
use super::{Provenance, WriteError};
use isolux_core::DVec3;
use isolux_core::scene::{Polygon, Scene};
use isolux_core::solution::SurfaceMesh;
use isolux_core::units::Rgb;
use std::fmt::Write as _;

/// Code of a triangle among VTK's cell types.
const VTK_TRIANGLE: u8 = 5;

/// The scene's surfaces with their light as a VTU file: point arrays `Irradiance`, `Radiosity`, `Normals`; cell arrays
/// `polygon`, `object`, `material`, `face` (the input face under the triangle's centroid, -1 where there is none); field
/// data with the provenance, the exposure, and the names of objects and materials.
///
/// # Errors
/// [`WriteError`] where the mesh is empty or not one of this scene, and where a number is not finite.
pub fn vtu(scene: &Scene, mesh: &SurfaceMesh, exposure: f64, provenance: &Provenance) -> Result<Vec<u8>, WriteError> {
    let surfaces = Surfaces::check(scene, mesh)?;
    let mut arrays = Arrays::default();

    let mut fields = String::new();
    for (key, value) in provenance.entries(Some(exposure)) {
        string_array(&mut fields, key, [value.as_str()]);
    }
    string_array(&mut fields, "objects", scene.objects.iter().map(|object| object.name.as_str()));
    string_array(&mut fields, "materials", scene.materials.iter().map(|material| material.name.as_str()));

    let positions: Vec<f64> = mesh.positions.iter().flat_map(|position| position.to_array()).collect();
    let mut normals = vec![0.0; positions.len()];
    for (index, polygon) in (0..).zip(&scene.polygons) {
        for vertex in surfaces.vertices_of(index) {
            normals[3 * vertex..3 * vertex + 3].copy_from_slice(&polygon.plane.normal.to_array());
        }
    }
    let points = arrays.floats("Points", &positions);
    let mut point_data = arrays.floats("Irradiance", &bands(&mesh.irradiance));
    point_data += &arrays.floats("Radiosity", &bands(&mesh.radiosity));
    point_data += &arrays.floats("Normals", &normals);

    // Triangles of polygons are contiguous and in the order of polygons.
    let mut cells: [Vec<i64>; 4] = Default::default();
    for (index, polygon) in surfaces.polygons() {
        for triangle in &mesh.triangles[mesh.triangles_of(index)] {
            let centroid = triangle.iter().map(|&vertex| mesh.positions[vertex as usize]).sum::<DVec3>() / 3.0;
            let face = face_at(scene, polygon, centroid).map_or(-1, i64::from);
            let row = [i64::from(index), i64::from(polygon.object), i64::from(polygon.material), face];
            for (column, value) in cells.iter_mut().zip(row) {
                column.push(value);
            }
        }
    }
    let mut cell_data = String::new();
    for (name, column) in ["polygon", "object", "material", "face"].into_iter().zip(&cells) {
        cell_data += &arrays.integers(name, column);
    }
    let connectivity: Vec<i64> = mesh.triangles.iter().flatten().map(|&vertex| i64::from(vertex)).collect();
    let offsets: Vec<i64> = (1..=mesh.triangles.len() as i64).map(|triangle| 3 * triangle).collect();
    let mut topology = arrays.integers("connectivity", &connectivity);
    topology += &arrays.integers("offsets", &offsets);
    topology += &arrays.bytes("types", &vec![VTK_TRIANGLE; mesh.triangles.len()]);

    let (point_count, cell_count) = (mesh.positions.len(), mesh.triangles.len());
    let mut file = format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid>\n\
         <FieldData>\n{fields}</FieldData>\n\
         <Piece NumberOfPoints=\"{point_count}\" NumberOfCells=\"{cell_count}\">\n\
         <PointData Vectors=\"Radiosity\" Normals=\"Normals\">\n{point_data}</PointData>\n\
         <CellData Scalars=\"object\">\n{cell_data}</CellData>\n\
         <Points>\n{points}</Points>\n\
         <Cells>\n{topology}</Cells>\n\
         </Piece>\n\
         </UnstructuredGrid>\n\
         <AppendedData encoding=\"raw\">\n_"
    )
    .into_bytes();
    file.extend_from_slice(&arrays.data);
    file.extend_from_slice(b"\n</AppendedData>\n</VTKFile>\n");
    Ok(file)
}

/// The appended block: each array is its length in bytes, then its bytes.
#[derive(Default)]
struct Arrays {
    data: Vec<u8>,
}

impl Arrays {
    /// Appends an array; the element that points to it comes back.
    fn push(&mut self, kind: &str, name: &str, components: usize, bytes: impl ExactSizeIterator<Item = u8>) -> String {
        let offset = self.data.len();
        self.data.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
        self.data.extend(bytes);
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" \
             offset=\"{offset}\"/>\n"
        )
    }

    /// Three components a tuple.
    fn floats(&mut self, name: &str, values: &[f64]) -> String {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.push("Float64", name, 3, bytes.into_iter())
    }

    fn integers(&mut self, name: &str, values: &[i64]) -> String {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.push("Int64", name, 1, bytes.into_iter())
    }

    fn bytes(&mut self, name: &str, values: &[u8]) -> String {
        self.push("UInt8", name, 1, values.iter().copied())
    }
}

/// Colours one after the other.
fn bands(values: &[Rgb]) -> Vec<f64> {
    values.iter().flat_map(|value| value.0).collect()
}

/// Appends a string array: the codes of its bytes in decimal, each string ended by 0.
fn string_array<'a>(fields: &mut String, name: &str, values: impl IntoIterator<Item = &'a str>) {
    let mut codes = String::new();
    let mut count = 0;
    for value in values {
        count += 1;
        for byte in value.bytes().filter(|&byte| byte != 0).chain([0]) {
            // Writing to a string cannot fail.
            let _ = write!(codes, "{byte} ");
        }
    }
    let _ = writeln!(
        fields,
        "<Array type=\"String\" Name=\"{name}\" NumberOfTuples=\"{count}\" format=\"ascii\">{}</Array>",
        codes.trim_end()
    );
}

/// The input face of a polygon that holds a point of it: the second of two only where the point is outside the first.
fn face_at(scene: &Scene, polygon: &Polygon, point: DVec3) -> Option<u32> {
    let [first, second] = polygon.faces;
    let known = |face: u32| (face != Scene::NO_POLYGON).then_some(face);
    let Some(&[a, b, c]) = known(first).and_then(|face| scene.triangles.get(face as usize)) else {
        return known(first).or(known(second));
    };
    let normal = (b - a).cross(c - a);
    // On the first face's side of the line through each of its edges.
    let inside = [(a, b), (b, c), (c, a)].iter().all(|&(p, q)| (q - p).cross(point - p).dot(normal) >= 0.0);
    if inside { known(first) } else { known(second).or(known(first)) }
}
