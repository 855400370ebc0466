//! Scene files in: a path goes in, a [`SceneInput`] comes out, with an [`Issue`] for all that was ignored, assumed
//! or not found; what the numbers amount to is left to `Scene::build`.
//!
//! Files are taken for hostile: nothing is allocated by a length that the file only claims, every index and offset
//! is checked, and what cannot be read is a [`ReadError`] of one line.

mod error;
mod files;
mod gltf;
mod look;
pub mod luminaire;
mod names;
mod obj;
mod texture;

pub use error::ReadError;

use error::{brief, clean, display};
use isolux_core::DVec3;
use isolux_core::scene::{Camera, Issue, IssueKind, Lamp, SceneInput, Severity};
use isolux_core::units::Unit;
use std::path::Path;

/// How a file is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Metres per length unit of the file; `None`: 1, which glTF prescribes and OBJ leaves open (an issue says so).
    pub metres_per_unit: Option<f64>,
    /// Factor on the emission of every surface: 1 where the file's values are radiances, cd/m² or W/(m² sr).
    pub emission_scale: f64,
    /// What the intensities of lamps without a surface mean (`KHR_lights_punctual`).
    pub light_units: LightUnits,
    /// What the file counts power in; both formats mean lumens, where they mean anything.
    pub unit: Unit,
    /// Which of the file's axes points up.
    pub up: UpAxis,
}

impl Default for ReadOptions {
    fn default() -> ReadOptions {
        ReadOptions {
            metres_per_unit: None,
            emission_scale: 1.0,
            light_units: LightUnits::Spec,
            unit: Unit::default(),
            up: UpAxis::Y,
        }
    }
}

/// Which of a file's axes points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +Y, as in glTF, and as here.
    #[default]
    Y,
    /// +Z, as CAD and robotics have it: everything is turned about X, so that +Z becomes +Y and +Y becomes -Z.
    Z,
}

impl UpAxis {
    /// The axis of that name: `y`, `z`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<UpAxis> {
        match name {
            "y" => Some(UpAxis::Y),
            "z" => Some(UpAxis::Z),
            _ => None,
        }
    }
}

/// Turns what has +Z up, so that +Y is.
fn turn_up(scene: &mut SceneInput) {
    let turned = |vector: DVec3| DVec3::new(vector.x, vector.z, -vector.y);
    for corner in scene.faces.iter_mut().flat_map(|face| &mut face.corners) {
        *corner = turned(*corner);
    }
    for Camera { eye, forward, up, .. } in &mut scene.cameras {
        (*eye, *forward, *up) = (turned(*eye), turned(*forward), turned(*up));
    }
    for Lamp { position, forward, side, .. } in &mut scene.lamps {
        (*position, *forward, *side) = (turned(*position), turned(*forward), turned(*side));
    }
}

/// What the intensities of lamps without a surface mean. Blender's exporter of glTF offers these three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// As glTF prescribes: cd for points and spots, lux for parallel light.
    #[default]
    Spec,
    /// Without a unit, about 1 where a viewer's picture is well exposed: radiant intensity, W/sr, and W/m² for parallel light, of
    /// light of 555 nm. Times [`LUMENS_PER_WATT`].
    Unitless,
    /// Blender's own numbers: W for points and spots, W/m² for parallel light. Of a spot they are those of a point that it is cut
    /// from. Times [`LUMENS_PER_WATT`], by 4π sr.
    Blender,
}

/// Luminous efficacy of light of 540 THz, by which Blender's exporter converts: lm/W.
pub const LUMENS_PER_WATT: f64 = 683.0;

impl LightUnits {
    /// The units of that name: `spec`, `unitless`, `blender`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<LightUnits> {
        match name {
            "spec" => Some(LightUnits::Spec),
            "unitless" => Some(LightUnits::Unitless),
            "blender" => Some(LightUnits::Blender),
            _ => None,
        }
    }

    /// Factor that makes the file's numbers candela, or lux for parallel light.
    fn factor(self, parallel: bool) -> f64 {
        match self {
            LightUnits::Spec => 1.0,
            LightUnits::Blender if !parallel => LUMENS_PER_WATT / (4.0 * std::f64::consts::PI),
            LightUnits::Unitless | LightUnits::Blender => LUMENS_PER_WATT,
        }
    }
}

/// Most faces that one file may make: some 4 GB of [`SceneInput`], a hundred times the largest scene in the
/// benchmarks. A few kilobytes of nodes that all show one mesh can ask for any number.
pub const MAX_FACES: usize = 1 << 24;

/// Reads a scene file: glTF by its content (GLB magic, or JSON), OBJ by its extension.
///
/// # Errors
/// [`ReadError`] where the file is of no known format, broken, or needs what is not read here.
pub fn read(path: &Path, options: &ReadOptions) -> Result<SceneInput, ReadError> {
    let bytes = files::read(path).map_err(|reason| ReadError::Io { file: display(path), reason })?;
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    let mut scene = match extension.as_deref() {
        _ if bytes.starts_with(gltf::MAGIC) => gltf::read(path, &bytes, options)?,
        Some("obj") => obj::read(path, &bytes, options)?,
        Some("glb" | "gltf") => gltf::read(path, &bytes, options)?,
        _ if gltf::looks_like_json(&bytes) => gltf::read(path, &bytes, options)?,
        Some(other) => {
            return Err(ReadError::UnknownFormat { file: display(path), found: brief(&format!(".{other}")) });
        }
        None => return Err(ReadError::UnknownFormat { file: display(path), found: "no extension".to_owned() }),
    };
    if options.up == UpAxis::Z {
        turn_up(&mut scene);
    }
    scene.unit = options.unit;
    scene.name = path.file_stem().map_or_else(|| "scene".to_owned(), |stem| clean(&stem.to_string_lossy()));
    Ok(scene)
}

/// An issue that a reader found.
fn issue(severity: Severity, kind: IssueKind, object: &str, message: impl Into<String>) -> Issue {
    Issue { severity, kind, object: clean(object), message: clean(&message.into()) }
}
