//! Visibility of one patch from another: the unblocked share of rays between their sub-elements.

use serde::{Deserialize, Serialize};

/// How many rays join two patches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub enum Rays {
    /// Sub-elements joined in pairs.
    #[default]
    Sixteen,
    /// Every sub-element with every other.
    TwoHundredFiftySix,
}

impl From<Rays> for u32 {
    fn from(rays: Rays) -> u32 {
        match rays {
            Rays::Sixteen => 16,
            Rays::TwoHundredFiftySix => 256,
        }
    }
}

impl TryFrom<u32> for Rays {
    type Error = String;
    fn try_from(count: u32) -> Result<Rays, String> {
        match count {
            16 => Ok(Rays::Sixteen),
            256 => Ok(Rays::TwoHundredFiftySix),
            _ => Err(format!("{count} rays: expected 16 or 256")),
        }
    }
}
