//! In which order polygons are inserted: a scene goes in, a permutation of its fronts comes out.

use crate::kernels::visibility::SplitMix64;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

/// The order in which the fronts of a scene are inserted in its BSP tree; the number of fragments depends on it, what
/// rays hit does not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InsertionOrder {
    /// File order.
    #[default]
    AsGiven,
    /// By area, the largest first; equal areas in file order.
    LargestFirst,
    /// A random order with this seed.
    Random(u64),
}

impl InsertionOrder {
    /// The fronts of `scene`, each once, in this order.
    #[must_use]
    pub fn sequence(self, scene: &Scene) -> Vec<u32> {
        let mut sequence: Vec<u32> = (0..scene.fronts as u32).collect();
        match self {
            InsertionOrder::AsGiven => {}
            InsertionOrder::LargestFirst => {
                let area = |&polygon: &u32| scene.polygons[polygon as usize].area;
                sequence.sort_by(|p, q| area(q).total_cmp(&area(p)));
            }
            InsertionOrder::Random(seed) => SplitMix64::new(seed).shuffle(&mut sequence),
        }
        sequence
    }
}
