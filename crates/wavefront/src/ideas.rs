//! The ideas that the engine is made of, each with a switch, so that what one of them buys can be measured.

/// Which ideas a solve uses: all, unless one is to be measured by leaving it out.
///
/// Nothing becomes faster or better by turning one off, save by accident.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ideas {
    /// Groups of polygons exchange light as one. Without, every pair of polygons is evaluated by itself. Where a bound ends
    /// refinement before all pairs are reached, those that are left stay between clusters even so.
    pub clusters: bool,
}

impl Default for Ideas {
    fn default() -> Self {
        Ideas { clusters: true }
    }
}
