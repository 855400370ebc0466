//! The invariants of a scene, listed and checked.

use thiserror::Error;

/// A broken invariant of a scene.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("polygon {polygon}: violated: {what}")]
pub struct SceneViolation {
    /// Where.
    pub polygon: u32,
    /// Which invariant.
    pub what: &'static str,
}
