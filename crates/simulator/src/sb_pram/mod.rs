//! The SB-PRAM: uniform access to shared memory in one unit, multiprefix in two.

use crate::spec::Spec;

impl Spec {
    /// The SB-PRAM's figures.
    pub fn sb_pram() -> Self {
        Self::built_in(include_str!("spec.toml"), "sb_pram/spec.toml")
    }
}
