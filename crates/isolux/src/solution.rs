//! A solved scene: asks and answers.

use crate::{Record, RecordError, Report, Settings, SolveError};
use isolux_core::scene::Scene;
use isolux_core::solution::{Observer, SurfaceMesh};
use isolux_core::units::Rgb;
use std::sync::Arc;

/// A solved scene.
#[derive(Debug)]
pub struct Solution {
    scene: Arc<Scene>,
    mesh: SurfaceMesh,
    report: Report,
}

/// Solves `scene`. A solution whose status is `cancelled` is what stood when the observer said stop.
///
/// # Errors
/// [`SolveError`] for settings out of range and scenes without light.
pub fn solve(_scene: Arc<Scene>, _settings: &Settings, _observer: &mut dyn Observer) -> Result<Solution, SolveError> {
    Err(SolveError::Internal("not built yet".into()))
}

impl Solution {
    /// The scene that was solved.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// What the solve told of itself.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Smooth values at the vertices of a restricted mesh.
    #[must_use]
    pub fn mesh(&self) -> &SurfaceMesh {
        &self.mesh
    }

    /// Irradiance of the front at a point of an input face; `None` where no such face exists.
    #[must_use]
    pub fn irradiance_at(&self, _face: u32, _barycentric: [f64; 3]) -> Option<Rgb> {
        None
    }

    /// Radiosity of the front at a point of an input face; `None` where no such face exists.
    #[must_use]
    pub fn radiosity_at(&self, _face: u32, _barycentric: [f64; 3]) -> Option<Rgb> {
        None
    }

    /// Everything as named arrays. `elements/*` (corners, area, polygon, parent, first_child, path, radiosity,
    /// irradiance) and `links/*` (receiver, source, form_factor, visibility) are what Python shows as views.
    #[must_use]
    pub fn to_record(&self) -> Record {
        Record { attributes: String::new(), arrays: Vec::new() }
    }

    /// A solution back from its arrays.
    ///
    /// # Errors
    /// [`RecordError`] naming the array that is missing or wrong.
    pub fn from_record(_record: Record) -> Result<Solution, RecordError> {
        Err(RecordError::Missing { name: "attributes".into() })
    }
}
