//! Names of elements that do not depend on allocation order: root, quadrant, quadrant, ...

/// Root index, then two bits per level, then the depth, packed so that numeric order is depth-first order: a parent
/// comes directly before its children, children in quadrant order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Path(u64);

const DEPTH_BITS: u32 = 5;
const QUADRANT_BITS: u32 = 2 * Path::MAX_DEPTH;

impl Path {
    /// Deepest level that a path can name: edges 2^17 = 131,072 times shorter than the root's.
    pub const MAX_DEPTH: u32 = 17;
    /// Number of roots that paths can name.
    pub const MAX_ROOTS: usize = 1 << (64 - DEPTH_BITS - QUADRANT_BITS);

    /// Path of a root.
    #[must_use]
    pub fn root(index: u32) -> Path {
        debug_assert!((index as usize) < Path::MAX_ROOTS);
        Path(u64::from(index) << (DEPTH_BITS + QUADRANT_BITS))
    }

    /// Path of a child; `quadrant` in 0..4.
    #[must_use]
    pub fn child(self, quadrant: u32) -> Path {
        debug_assert!(quadrant < 4 && self.depth() < Path::MAX_DEPTH);
        let shift = DEPTH_BITS + QUADRANT_BITS - 2 * (self.depth() + 1);
        Path((self.0 | u64::from(quadrant) << shift) + 1)
    }

    /// Levels below the root.
    #[must_use]
    pub fn depth(self) -> u32 {
        (self.0 & ((1 << DEPTH_BITS) - 1)) as u32
    }

    /// Index of the root.
    #[must_use]
    pub fn root_index(self) -> u32 {
        (self.0 >> (DEPTH_BITS + QUADRANT_BITS)) as u32
    }

    /// The quadrants on the way down from the root.
    pub fn quadrants(self) -> impl Iterator<Item = usize> {
        (1..=self.depth()).map(move |level| (self.0 >> (DEPTH_BITS + QUADRANT_BITS - 2 * level) & 3) as usize)
    }

    /// The packed number, for files and hashes.
    #[must_use]
    pub fn to_bits(self) -> u64 {
        self.0
    }

    /// From the packed number.
    #[must_use]
    pub fn from_bits(bits: u64) -> Path {
        Path(bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches a packing in which an element sorts before its parent or between the children of another.
    #[test]
    fn paths_sort_depth_first() {
        let root = Path::root(7);
        let mut sorted = vec![root];
        for a in 0..4 {
            sorted.push(root.child(a));
            sorted.extend((0..4).map(|b| root.child(a).child(b)));
        }
        sorted.push(Path::root(8));
        assert!(sorted.is_sorted_by(|x, y| x < y));
        assert_eq!(root.child(3).child(2).depth(), 2);
        assert_eq!(root.child(3).child(2).root_index(), 7);
        assert_eq!(root.child(3).child(0).child(2).quadrants().collect::<Vec<_>>(), [3, 0, 2]);
    }

    /// Catches overflow at the deepest level of the last root.
    #[test]
    fn deepest_path_fits() {
        let mut path = Path::root((Path::MAX_ROOTS - 1) as u32);
        for _ in 0..Path::MAX_DEPTH {
            path = path.child(3);
        }
        assert_eq!(path.depth(), Path::MAX_DEPTH);
        assert_eq!(path.root_index() as usize, Path::MAX_ROOTS - 1);
    }
}
