//! Triangles of a mesh: primitives come in, corner indices in file order go out, each known to be in range.

use super::accessor::{Accessor, Lookup};
use super::container::Document;
use super::extensions::unsupported;
use crate::read::error::{ReadError, brief};
use crate::read::{MAX_FACES, issue};
use glam::{DVec2, DVec3};
use gltf::accessor::Dimensions;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use isolux_core::scene::{Issue, IssueKind, Severity, Surface};

/// The triangles of one primitive, and what their material makes of them.
pub(super) struct Piece<'a> {
    /// Number of the material; `None`: glTF's default.
    pub(super) material: Option<usize>,
    /// The object that showed the mesh first, for messages.
    pub(super) object: String,
    pub(super) triangles: Vec<[u32; 3]>,
    positions: Lookup<'a, 3>,
    colours: Option<Lookup<'a, 4>>,
    /// Sets of texture coordinates, by number.
    coordinates: Vec<(u32, Lookup<'a, 2>)>,
    /// How many nodes show it.
    pub(super) shown: usize,
    /// Into how many steps along each side its triangles are cut; 1: they are whole.
    pub(super) steps: usize,
    /// Base-colour coordinates of each triangle, or of each part of each, if the material has such a texture.
    pub(super) uv: Option<Vec<[DVec2; 3]>>,
    /// Surfaces of the triangles or their parts: one for each, or none where the material's own stands for all.
    pub(super) surfaces: Option<Vec<Surface>>,
}

/// Opens all primitives of a mesh. `object` is the first to show it; `faces` counts what the file has made so far.
pub(super) fn open<'a>(
    document: &'a Document<'a>,
    mesh: usize,
    object: &str,
    faces: usize,
    issues: &mut Vec<Issue>,
) -> Result<Vec<Piece<'a>>, ReadError> {
    let mut pieces = Vec::new();
    let mut count = 0;
    for primitive in &document.root().meshes[mesh].primitives {
        if let Some(piece) = open_primitive(document, primitive, object, (faces, count), issues)? {
            count += piece.triangles.len();
            pieces.push(piece);
        }
    }
    Ok(pieces)
}

fn open_primitive<'a>(
    document: &'a Document<'a>,
    primitive: &Primitive,
    object: &str,
    (faces, faces_of_object): (usize, usize),
    issues: &mut Vec<Issue>,
) -> Result<Option<Piece<'a>>, ReadError> {
    let ignored = match primitive.mode {
        Checked::Valid(Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) => None,
        Checked::Valid(Mode::Points) => Some("points are ignored: only triangles are surfaces"),
        Checked::Valid(_) => Some("lines are ignored: only triangles are surfaces"),
        Checked::Invalid => Some("a primitive of unknown mode is ignored: only triangles are surfaces"),
    };
    let position = primitive.attributes.get(&Checked::Valid(Semantic::Positions)).copied();
    let (Checked::Valid(mode), None, Some(position)) = (primitive.mode, ignored, position) else {
        let message = ignored.unwrap_or("a primitive without POSITION is ignored");
        issues.push(issue(Severity::Warning, IssueKind::Ignored, object, message));
        return Ok(None);
    };
    let is_there = |json: &json::Accessor| json.buffer_view.is_some() || json.sparse.is_some();
    let compressed =
        primitive.extensions.as_ref().is_some_and(|known| known.others.contains_key("KHR_draco_mesh_compression"));
    if compressed && !document.root().get(position).is_some_and(is_there) {
        return Err(unsupported(&document.file, "KHR_draco_mesh_compression"));
    }

    let at_fault = |name: &str, index: Index<json::Accessor>, reason: String| ReadError::Accessor {
        file: document.file.clone(),
        object: brief(object),
        what: format!("{name} (accessor {index})"),
        reason: brief(&reason),
    };
    let open = |name: &str, index, expected: &[Dimensions]| {
        Accessor::open(document, index, expected).map_err(|reason| at_fault(name, index, reason))
    };
    let positions = open("POSITION", position, &[Dimensions::Vec3])?;
    let vertices = positions.count;
    // Attributes of a primitive have one count (glTF 2.0, 3.7.2.1): a shorter one could not be looked up.
    let attribute = |name: &str, index, expected: &[Dimensions]| {
        let accessor = open(name, index, expected)?;
        if accessor.count == vertices {
            return Ok(accessor);
        }
        Err(at_fault(name, index, format!("{} elements for {vertices} vertices", accessor.count)))
    };
    let mut colours: Option<Lookup<'a, 4>> = None;
    let mut coordinates = Vec::new();
    for (semantic, &index) in &primitive.attributes {
        match semantic {
            Checked::Valid(Semantic::Colors(0)) => {
                let accessor = attribute("COLOR_0", index, &[Dimensions::Vec3, Dimensions::Vec4])?;
                colours = Some(if accessor.dimensions == Dimensions::Vec4 {
                    accessor.vectors()
                } else {
                    let colour = accessor.vectors::<3>();
                    Box::new(move |vertex| {
                        let [r, g, b] = colour(vertex);
                        [r, g, b, 1.0]
                    })
                });
            }
            Checked::Valid(Semantic::TexCoords(set)) => {
                let accessor = attribute(&format!("TEXCOORD_{set}"), index, &[Dimensions::Vec2])?;
                coordinates.push((*set, accessor.vectors()));
            }
            _ => {}
        }
    }

    let indices = match primitive.indices {
        None => None,
        Some(index) => Some((index, open("indices", index, &[Dimensions::Scalar])?)),
    };
    let corners = indices.as_ref().map_or(vertices, |(_, indices)| indices.count);
    let count = if mode == Mode::Triangles { corners / 3 } else { corners.saturating_sub(2) };
    if faces + faces_of_object + count > MAX_FACES {
        return Err(too_many(document, object, faces + faces_of_object + count));
    }
    let indices = match indices {
        None => None,
        Some((index, indices)) => Some(indices.indices().map_err(|reason| at_fault("indices", index, reason))?),
    };
    let mut triangles = Vec::with_capacity(count);
    for triangle in 0..count {
        let mut vertex = [0_u32; 3];
        for (place, corner) in corners_of(mode, triangle).into_iter().enumerate() {
            let index = indices.as_ref().map_or(corner as u32, |indices| indices[corner]);
            if index as usize >= vertices {
                return Err(ReadError::Index {
                    file: document.file.clone(),
                    object: brief(object),
                    face: faces_of_object + triangle,
                    what: "vertex",
                    index: i64::from(index),
                    count: vertices,
                });
            }
            vertex[place] = index;
        }
        triangles.push(vertex);
    }
    Ok(Some(Piece {
        material: primitive.material.map(|material| material.value()),
        object: object.to_owned(),
        triangles,
        positions: positions.vectors(),
        colours,
        coordinates,
        shown: 0,
        steps: 1,
        uv: None,
        surfaces: None,
    }))
}

/// The error past [`MAX_FACES`].
pub(super) fn too_many(document: &Document<'_>, object: &str, count: usize) -> ReadError {
    ReadError::TooLarge { file: document.file.clone(), object: brief(object), what: "faces", count, limit: MAX_FACES }
}

impl Piece<'_> {
    /// Position of a vertex in the mesh.
    pub(super) fn position(&self, vertex: u32) -> DVec3 {
        DVec3::from_array((self.positions)(vertex as usize))
    }

    /// Corners of a triangle in a set of texture coordinates.
    pub(super) fn coordinates(&self, set: u32, triangle: [u32; 3]) -> Option<[DVec2; 3]> {
        let (_, lookup) = self.coordinates.iter().find(|(number, _)| *number == set)?;
        Some(triangle.map(|vertex| DVec2::from_array(lookup(vertex as usize))))
    }

    /// Has the primitive this set of texture coordinates?
    pub(super) fn has_coordinates(&self, set: u32) -> bool {
        self.coordinates.iter().any(|(number, _)| *number == set)
    }

    /// Has the primitive vertex colours?
    pub(super) fn has_colours(&self) -> bool {
        self.colours.is_some()
    }

    /// Mean vertex colour and alpha of a triangle or a part of it, clamped to [0, 1] corner by corner.
    pub(super) fn colour(&self, triangle: [u32; 3], part: Option<&[DVec3; 3]>) -> Option<[f64; 4]> {
        let colours = self.colours.as_ref()?;
        let centre = part.map(|part| (part[0] + part[1] + part[2]) / 3.0);
        let mut mean = [0.0; 4];
        for (corner, vertex) in triangle.into_iter().enumerate() {
            let colour = colours(vertex as usize);
            for band in 0..4 {
                let value = colour[band].clamp(0.0, 1.0);
                mean[band] += centre.map_or(value / 3.0, |centre| value * centre[corner]);
            }
        }
        Some(mean)
    }
}

/// The corners of a triangle, in the order of glTF 2.0, 3.7.2.1.
fn corners_of(mode: Mode, i: usize) -> [usize; 3] {
    match mode {
        Mode::TriangleStrip => [i, i + 1 + i % 2, i + 2 - i % 2],
        Mode::TriangleFan => [i + 1, i + 2, 0],
        _ => [3 * i, 3 * i + 1, 3 * i + 2],
    }
}
