//! Triangles of a mesh: primitives come in, corner indices in file order go out, each known to be in range.

use super::accessor::Accessor;
use super::container::Document;
use super::extensions::unsupported;
use super::schema::Primitive;
use crate::read::error::{ReadError, brief};
use crate::read::{MAX_FACES, issue};
use glam::{DVec2, DVec3};
use isolux_core::scene::{Issue, IssueKind, Severity, Surface};

/// The triangles of one primitive, and what their material makes of them.
pub(super) struct Piece<'a> {
    /// Number of the material; `None`: glTF's default.
    pub(super) material: Option<usize>,
    /// The object that showed the mesh first, for messages.
    pub(super) object: String,
    pub(super) triangles: Vec<[u32; 3]>,
    positions: Accessor<'a>,
    colours: Option<Accessor<'a>>,
    /// Sets of texture coordinates, by number.
    coordinates: Vec<(usize, Accessor<'a>)>,
    /// Base-colour coordinates of each triangle, if the material has such a texture.
    pub(super) uv: Option<Vec<[DVec2; 3]>>,
    /// Surfaces of the triangles: one for each, or none where the material's own stands for all.
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
    for primitive in &document.root.meshes[mesh].primitives {
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
    let mode = match primitive.mode.unwrap_or(4) {
        4 => Mode::Triangles,
        5 => Mode::Strip,
        6 => Mode::Fan,
        other => {
            let what = match other {
                0 => "points are".to_owned(),
                1..=3 => "lines are".to_owned(),
                _ => format!("a primitive of unknown mode {other} is"),
            };
            issues.push(issue(
                Severity::Warning,
                IssueKind::Ignored,
                object,
                format!("{what} ignored: only triangles are surfaces"),
            ));
            return Ok(None);
        }
    };
    let Some(&position) = primitive.attributes.get("POSITION") else {
        let message = "a primitive without POSITION is ignored";
        issues.push(issue(Severity::Warning, IssueKind::Ignored, object, message));
        return Ok(None);
    };
    let has_data =
        document.root.accessors.get(position).is_some_and(|json| json.buffer_view.is_some() || json.sparse.is_some());
    if primitive.extensions.draco.is_some() && !has_data {
        return Err(unsupported(&document.file, "KHR_draco_mesh_compression"));
    }

    let attribute = |name: &str, accessor: usize, widths: &[usize]| {
        Accessor::open(document, accessor, widths).map_err(|reason| ReadError::Accessor {
            file: document.file.clone(),
            object: brief(object),
            what: format!("{name} (accessor {accessor})"),
            reason: brief(&reason),
        })
    };
    let positions = attribute("POSITION", position, &[3])?;
    let vertices = positions.count;
    // Attributes of a primitive have one count (glTF 2.0, 3.7.2.1): a shorter one could not be looked up.
    let same_count = |name: &str, accessor: Accessor<'a>| {
        if accessor.count == vertices {
            return Ok(accessor);
        }
        Err(ReadError::Accessor {
            file: document.file.clone(),
            object: brief(object),
            what: name.to_owned(),
            reason: format!("{} elements for {vertices} vertices", accessor.count),
        })
    };
    let colours = match primitive.attributes.get("COLOR_0") {
        Some(&accessor) => Some(same_count("COLOR_0", attribute("COLOR_0", accessor, &[3, 4])?)?),
        None => None,
    };
    let mut coordinates = Vec::new();
    for (name, &accessor) in &primitive.attributes {
        if let Some(set) = name.strip_prefix("TEXCOORD_").and_then(|set| set.parse().ok()) {
            let name = brief(name);
            coordinates.push((set, same_count(&name, attribute(&name, accessor, &[2])?)?));
        }
    }

    let indices = match primitive.indices {
        None => None,
        Some(accessor) => {
            let indices = attribute("indices", accessor, &[1])?;
            if !indices.is_unsigned() {
                return Err(ReadError::Accessor {
                    file: document.file.clone(),
                    object: brief(object),
                    what: format!("indices (accessor {accessor})"),
                    reason: "indices must be unsigned".to_owned(),
                });
            }
            Some(indices)
        }
    };
    let corners = indices.as_ref().map_or(vertices, |indices| indices.count);
    let count = mode.triangles(corners);
    if faces + faces_of_object + count > MAX_FACES {
        return Err(too_many(document, object, faces + faces_of_object + count));
    }
    let mut triangles = Vec::with_capacity(count);
    for triangle in 0..count {
        let mut vertex = [0_u32; 3];
        for (place, corner) in mode.corners(triangle).into_iter().enumerate() {
            let index = indices.as_ref().map_or(corner as u32, |indices| indices.index(corner));
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
        material: primitive.material,
        object: object.to_owned(),
        triangles,
        positions,
        colours,
        coordinates,
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
        DVec3::from_array(self.positions.vector(vertex as usize, 0.0))
    }

    /// Corners of a triangle in a set of texture coordinates.
    pub(super) fn coordinates(&self, set: usize, triangle: [u32; 3]) -> Option<[DVec2; 3]> {
        let (_, accessor) = self.coordinates.iter().find(|(number, _)| *number == set)?;
        Some(triangle.map(|vertex| DVec2::from_array(accessor.vector(vertex as usize, 0.0))))
    }

    /// Has the primitive this set of texture coordinates?
    pub(super) fn has_coordinates(&self, set: usize) -> bool {
        self.coordinates.iter().any(|(number, _)| *number == set)
    }

    /// Has the primitive vertex colours?
    pub(super) fn has_colours(&self) -> bool {
        self.colours.is_some()
    }

    /// Mean vertex colour and alpha of a triangle, clamped to [0, 1] corner by corner.
    pub(super) fn colour(&self, triangle: [u32; 3]) -> Option<[f64; 4]> {
        let colours = self.colours.as_ref()?;
        let mut mean = [0.0; 4];
        for vertex in triangle {
            let colour: [f64; 4] = colours.vector(vertex as usize, 1.0);
            (0..4).for_each(|band| mean[band] += colour[band].clamp(0.0, 1.0) / 3.0);
        }
        Some(mean)
    }
}

/// How corners make triangles.
#[derive(Clone, Copy)]
enum Mode {
    Triangles,
    Strip,
    Fan,
}

impl Mode {
    fn triangles(self, corners: usize) -> usize {
        match self {
            Mode::Triangles => corners / 3,
            Mode::Strip | Mode::Fan => corners.saturating_sub(2),
        }
    }

    /// The corners of a triangle, in the order of glTF 2.0, 3.7.2.1.
    fn corners(self, i: usize) -> [usize; 3] {
        match self {
            Mode::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
            Mode::Strip => [i, i + 1 + i % 2, i + 2 - i % 2],
            Mode::Fan => [i + 1, i + 2, 0],
        }
    }
}
