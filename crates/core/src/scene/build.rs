//! Validation of a scene's input: everything that a file may get wrong is found or mended here, and said.

use super::{Scene, SceneError, SceneInput};

/// How [`Scene::build`] treats its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildOptions {
    /// Join coplanar triangle pairs that form a convex quadrilateral into one polygon.
    pub join: bool,
}

impl Default for BuildOptions {
    fn default() -> BuildOptions {
        BuildOptions { join: true }
    }
}

pub(super) fn build(_input: SceneInput, _options: &BuildOptions) -> Result<Scene, SceneError> {
    Err(SceneError::Empty { dropped: 0 })
}
