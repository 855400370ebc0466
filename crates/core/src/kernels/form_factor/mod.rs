//! Form factors between patches, unoccluded: a pair of patches goes in, their exchange area `A_i F_ij = A_j F_ji`
//! comes out; visibility is another kernel's.

use serde::{Deserialize, Serialize};

/// Which kernel evaluates form factors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FormFactor {
    /// Four points to four disks (Wallace et al. 1989), as in the paper.
    Disks,
    /// Closed-form point to polygon (Lambert 1760).
    #[default]
    Lambert,
}
