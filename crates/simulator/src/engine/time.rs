//! Simulated time, in units of the machine's spec.

/// A moment of a run; it began at 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Time(pub(super) u64);

impl Time {
    /// So many units later; `None` beyond the range.
    pub(super) fn after(self, units: u64) -> Option<Self> {
        self.0.checked_add(units).map(Self)
    }

    /// Units since an earlier moment.
    pub(super) fn since(self, earlier: Self) -> u64 {
        self.0 - earlier.0
    }
}
