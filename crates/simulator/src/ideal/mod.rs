//! The ideal machine: every operation takes one unit, whatever the others do.

use crate::spec::Spec;

impl Spec {
    /// The ideal machine's figures.
    pub fn ideal() -> Self {
        Self::built_in(include_str!("spec.toml"), "ideal/spec.toml")
    }
}
