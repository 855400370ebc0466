//! The tree: polygons in a BSP tree for rays ([`Bsp`]), and under each root a quadtree of [`Elements`] that grows by
//! need.

mod elements;
mod path;

pub use elements::{Element, ElementId, Elements, TreeViolation};
pub use path::Path;

use serde::{Deserialize, Serialize};

/// In which order polygons are inserted in the BSP tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InsertionOrder {
    /// As in the file.
    #[default]
    AsGiven,
    /// By area, largest first.
    LargestFirst,
    /// Shuffled with a seed.
    Random(u64),
}
