//! What a reader hands over: named objects with indexed faces, materials, images, cameras; nothing is trusted yet.

use super::{AlphaMask, Camera, Lamp, Sky};
use crate::units::{Rgb, Unit};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A scene as read, before validation. World coordinates, in the file's length unit.
#[derive(Clone, Debug, Default)]
pub struct SceneInput {
    /// Name of the scene, for messages and reports.
    pub name: String,
    /// Metres per length unit of the coordinates (1 for glTF).
    pub metres_per_unit: f64,
    /// What emission is counted in.
    pub unit: Unit,
    /// Named objects (a glTF node with a mesh; an OBJ object).
    pub objects: Vec<Object>,
    /// Faces of all objects in file order: the order that face indices count.
    pub faces: Vec<Face>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Images that outputs carry along.
    pub images: Vec<Image>,
    /// Cut-out masks.
    pub masks: Vec<AlphaMask>,
    /// Cameras, world coordinates in the file's unit.
    pub cameras: Vec<Camera>,
    /// Lamps without a surface, world coordinates in the file's unit; their intensities are in cd, lux or W alike whatever
    /// that unit is.
    pub lamps: Vec<Lamp>,
    /// The sky. No file of a scene has one.
    pub sky: Option<Sky>,
    /// What the reader noticed already (ignored features, assumed values), each naming its object.
    pub issues: Vec<super::Issue>,
}

/// A named object: what reports, warnings and outputs speak of.
#[derive(Clone, Debug, Default)]
pub struct Object {
    /// Unique name (readers append `#2`, `#3` to repeated ones).
    pub name: String,
}

/// A face as read: three or four corners of one object.
#[derive(Clone, Debug)]
pub struct Face {
    /// Index into [`SceneInput::objects`].
    pub object: u32,
    /// Index into [`SceneInput::materials`].
    pub material: u32,
    /// Corner positions, three or four, counter-clockwise seen from the front (mirrored transforms already undone).
    pub corners: Vec<DVec3>,
    /// Texture coordinates of the corners (those of the base-colour texture), as many as corners.
    pub uv: Option<Vec<DVec2>>,
    /// What textures and vertex colours average to over this face; `None`: the material's own values.
    pub surface: Option<Surface>,
}

/// How a face reflects, emits and lets light pass, averaged over its area in linear space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Diffuse reflectance of the opaque part, per band.
    pub reflectance: Rgb,
    /// Emitted radiosity, W/m² or lm/m².
    pub emission: Rgb,
    /// Share of light that does not pass through: 1 for opaque.
    pub opacity: f64,
}

/// How alpha is meant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Alpha {
    /// Alpha is ignored.
    Opaque,
    /// Rays look the mask up at the point that they hit: index into [`SceneInput::masks`].
    Mask(u32),
    /// Light is attenuated by the face's `opacity` (BLEND and transmission).
    Attenuate,
}

/// A material as read.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Material {
    /// Name, unique.
    pub name: String,
    /// Values where a face has no [`Surface`] of its own.
    pub surface: Surface,
    /// Both sides are lit and reflect.
    pub two_sided: bool,
    /// How alpha is meant.
    pub alpha: Alpha,
    /// Base-colour texture that lit outputs keep, with the factor it is multiplied by.
    pub texture: Option<Texture>,
}

/// Use of an image as base-colour texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// Index into [`SceneInput::images`].
    pub image: u32,
    /// Linear factor on the texture, per band.
    pub factor: Rgb,
    /// Repetition along u and v.
    pub wrap: [Wrap; 2],
}

/// What happens to texture coordinates outside `[0, 1]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wrap {
    /// Repeat.
    #[default]
    Repeat,
    /// Clamp to the edge.
    Clamp,
    /// Repeat, mirrored each second time.
    Mirror,
}

/// An encoded image, kept as it was.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Name, for messages.
    pub name: String,
    /// `image/png` or `image/jpeg`.
    pub mime: String,
    /// The encoded bytes.
    pub bytes: Vec<u8>,
}
