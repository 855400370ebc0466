//! Cameras of a scene file, as data; rendering is the facade's.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How a camera projects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Projection {
    /// Vertical opening angle, radians.
    Perspective {
        /// Vertical field of view, radians.
        vertical_angle: f64,
    },
    /// Parallel projection.
    Orthographic {
        /// Full height of the picture, metres.
        height: f64,
    },
}

/// A named camera in world coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Name in the file.
    pub name: String,
    /// Eye point, metres.
    pub eye: DVec3,
    /// Unit vector the camera looks along.
    pub forward: DVec3,
    /// Unit vector that is up in the picture, orthogonal to `forward`.
    pub up: DVec3,
    /// Projection.
    pub projection: Projection,
}
