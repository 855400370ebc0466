//! What can be wrong with a scene: issues that are reported and survived, errors that are not.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How bad an issue is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Something was assumed that the user may want to know.
    Note,
    /// The answer may not be what the user expects.
    Warning,
}

/// What kind of issue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IssueKind {
    /// Faces without area were dropped.
    DegenerateFace,
    /// Faces that turn a black back to the light and get none in front: probably flipped winding.
    FlippedFace,
    /// Reflectance of 1 or more was clamped.
    ReflectanceClamped,
    /// An opacity outside `[0, 1]` was clamped.
    OpacityClamped,
    /// Negative emission or reflectance was set to zero.
    NegativeValue,
    /// Nothing emits.
    NoLight,
    /// A quadrilateral is not planar or not convex and was cut into two triangles.
    NonPlanarQuad,
    /// A corner of one polygon lies inside another's edge.
    TJoint,
    /// Two polygons of one plane that face the same way overlap.
    CoplanarOverlap,
    /// A feature of the file was ignored.
    Ignored,
    /// A value was assumed where the file is silent (metallicFactor, units).
    Assumed,
    /// A file that the scene names is missing (an image, a material library).
    MissingFile,
}

/// One finding, naming its object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Issue {
    /// How bad.
    pub severity: Severity,
    /// What kind.
    pub kind: IssueKind,
    /// Name of the object, material or file concerned.
    pub object: String,
    /// One sentence for people, with counts and values.
    pub message: String,
}

/// Why no scene could be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SceneError {
    /// No face with area and opacity is left.
    #[error(
        "the scene has no surfaces ({dropped} faces without area and {invisible} without opacity or emission were dropped)"
    )]
    Empty {
        /// Degenerate faces that were dropped.
        dropped: usize,
        /// Faces that were dropped because they neither stop nor emit light.
        invisible: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("object '{object}': face {face} has a coordinate that is not a finite number")]
    NotFinite {
        /// Name of the object.
        object: String,
        /// Face index in file order.
        face: usize,
    },
    /// A face has neither three nor four corners.
    #[error("object '{object}': face {face} has {corners} corners, expected 3 or 4")]
    CornerCount {
        /// Name of the object.
        object: String,
        /// Face index in file order.
        face: usize,
        /// Corners found.
        corners: usize,
    },
    /// A face, material or texture names something that is not there.
    #[error("{what} {index} of '{object}' is out of range (there are {count})")]
    OutOfRange {
        /// Kind of index.
        what: &'static str,
        /// Who holds the index.
        object: String,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A cut-out mask does not have the texels that it claims.
    #[error("material '{material}': mask {mask} has {texels} texels, expected {width} x {height}, at least 1")]
    MaskSize {
        /// Name of the first material that uses it.
        material: String,
        /// Its index.
        mask: usize,
        /// Texels per row.
        width: u32,
        /// Rows.
        height: u32,
        /// Texels found.
        texels: usize,
    },
    /// A material value is NaN or infinite.
    #[error("material '{material}': {what} is not a finite number")]
    MaterialNotFinite {
        /// Name of the material.
        material: String,
        /// Which value.
        what: &'static str,
    },
    /// A lamp makes no sense.
    #[error("lamp '{lamp}': {what}")]
    Lamp {
        /// Its name.
        lamp: String,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A sky makes no sense.
    #[error("the sky: {what}")]
    Sky {
        /// What is wrong with it.
        what: String,
    },
    /// The unit scale is not positive and finite.
    #[error("{metres_per_unit} metres per unit is not a positive length")]
    Unit {
        /// The value given.
        metres_per_unit: f64,
    },
    /// More polygons than element paths can name.
    #[error("{count} polygons are more than the {limit} that element paths can name")]
    TooLarge {
        /// Polygons found.
        count: usize,
        /// Polygons supported.
        limit: usize,
    },
}
