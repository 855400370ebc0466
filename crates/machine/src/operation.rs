//! The vocabulary of machine operations: what a multiprefix does, what a wait waits for, which cells a scan polls, and
//! how much work is charged.

use crate::memory::Address;

/// What a multiprefix does to its word. Each processor of a group gets the value from before its own turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Prefix {
    /// Sum modulo two to the power 64, so that adding `u64::MAX` takes one away.
    Add,
    /// Larger of the two.
    Max,
    /// Bits that both have.
    And,
    /// Bits that either has.
    Or,
}

impl Prefix {
    /// The new value of a word.
    pub fn apply(self, word: u64, value: u64) -> u64 {
        match self {
            Self::Add => word.wrapping_add(value),
            Self::Max => word.max(value),
            Self::And => word & value,
            Self::Or => word | value,
        }
    }
}

/// What may hold of one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Condition {
    /// The word is this.
    Equal(u64),
    /// The word is anything but this.
    Differs(u64),
    /// The word is at least this.
    AtLeast(u64),
    /// The word is below this.
    Below(u64),
    /// The word, read as a signed number, is above zero.
    Positive,
}

impl Condition {
    /// Whether it holds of `word`.
    pub fn holds(self, word: u64) -> bool {
        match self {
            Self::Equal(v) => word == v,
            Self::Differs(v) => word != v,
            Self::AtLeast(v) => word >= v,
            Self::Below(v) => word < v,
            Self::Positive => word.cast_signed() > 0,
        }
    }
}

/// A lock of a machine, from [`crate::Machine::allocate_locks`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LockId(pub u32);

/// A barrier of a machine, from [`crate::Machine::allocate_barriers`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BarrierId(pub u32);

/// A class of work, by its place in the list of names that the machine was made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorkClass(pub usize);

/// Counts by class of work. What one of a class costs is the machine's affair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    counts: [u64; Work::CLASSES_MAX],
    /// A bit for each class that has a count: few have, and only these are gone through.
    some: u16,
}

impl Work {
    /// How many classes there can be.
    pub const CLASSES_MAX: usize = 16;

    /// `count` of one class.
    ///
    /// # Panics
    ///
    /// When `class` is not below [`Work::CLASSES_MAX`].
    pub fn of(class: WorkClass, count: u64) -> Self {
        let mut work = Self::default();
        work.add_of(class, count);
        work
    }

    /// Adds `count` of one class.
    ///
    /// # Panics
    ///
    /// When `class` is not below [`Work::CLASSES_MAX`].
    pub fn add_of(&mut self, class: WorkClass, count: u64) {
        self.counts[class.0] = self.counts[class.0].saturating_add(count);
        self.some |= u16::from(count != 0) << class.0;
    }

    /// Adds all counts of another.
    pub fn add(&mut self, other: &Self) {
        for (class, count) in other.charged() {
            self.add_of(class, count);
        }
    }

    /// The classes that have a count, in order, and their counts.
    pub fn charged(&self) -> impl Iterator<Item = (WorkClass, u64)> + use<'_> {
        let mut left = self.some;
        std::iter::from_fn(move || {
            let class = left.trailing_zeros() as usize;
            left &= left.wrapping_sub(1);
            self.counts.get(class).map(|&count| (WorkClass(class), count))
        })
    }

    /// The counts in the order of the classes; those of classes that the machine does not have are zero.
    pub fn counts(&self) -> &[u64; Work::CLASSES_MAX] {
        &self.counts
    }

    /// The first class from `classes` on that has a count.
    pub fn beyond(&self, classes: usize) -> Option<WorkClass> {
        let beyond = self.some & u16::MAX.checked_shl(classes as u32).unwrap_or(0);
        (beyond != 0).then(|| WorkClass(beyond.trailing_zeros() as usize))
    }
}

/// The cells that a scan polls in turn: those of a ring in the order own, +1, -1, +2, -2, ..., then perhaps one more,
/// then from the start again. Small whatever the number of cells, so that thousands of idle processors cost little.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sequence {
    first: Address,
    stride: u64,
    count: usize,
    own: usize,
    also: Option<Address>,
}

impl Sequence {
    /// A ring of `count` cells, `stride` words from one to the next, polled from cell `own` outwards. A sequence
    /// without cells, without a stride, or with a cell `own` that is none is refused by the scan.
    pub fn around(first: Address, stride: u64, count: usize, own: usize) -> Self {
        Self { first, stride, count, own, also: None }
    }

    /// One cell.
    pub fn one(cell: Address) -> Self {
        Self::around(cell, 1, 1, 0)
    }

    /// Polls `cell`, too, once at the end of every turn. It must be none of the ring.
    #[must_use]
    pub fn and(self, cell: Address) -> Self {
        Self { also: Some(cell), ..self }
    }

    /// Whether a scan over it makes sense.
    pub fn is_valid(&self) -> bool {
        let ring = Self { also: None, ..*self };
        let last = u64::try_from(self.count).ok().and_then(|n| n.checked_sub(1)?.checked_mul(self.stride));
        self.stride > 0
            && self.own < self.count
            && last.is_some_and(|w| self.first.word().checked_add(w).is_some())
            && self.also.is_none_or(|a| ring.position(a).is_none())
    }

    /// Cells of the ring.
    pub fn ring(&self) -> usize {
        self.count
    }

    /// Polls to a turn.
    pub fn period(&self) -> usize {
        self.count + usize::from(self.also.is_some())
    }

    /// The cell of the ring that poll `k` of a turn looks at; `None` for the one that stands apart.
    pub fn cell(&self, k: usize) -> Option<usize> {
        if k >= self.count {
            return None;
        }
        let away = k.div_ceil(2);
        let forward = if k % 2 == 1 { away } else { self.count - away };
        Some((self.own + forward) % self.count)
    }

    /// The address that poll `k` of a turn looks at.
    pub fn at(&self, k: usize) -> Address {
        match (self.cell(k), self.also) {
            (None, Some(also)) => also,
            (cell, _) => self.first.plus(self.stride * cell.unwrap_or(self.own) as u64),
        }
    }

    /// The cell of the ring at `address`, or the number of cells for the one that stands apart.
    pub fn cell_at(&self, address: Address) -> Option<usize> {
        if self.also == Some(address) {
            return Some(self.count);
        }
        let words = address.word().checked_sub(self.first.word())?;
        let cell = usize::try_from(words / self.stride).ok()?;
        (words % self.stride == 0 && cell < self.count).then_some(cell)
    }

    /// Which poll of a turn looks at a cell, numbered as by [`Sequence::cell_at`].
    pub fn turn(&self, cell: usize) -> usize {
        if cell >= self.count {
            return self.count;
        }
        let forward = if cell >= self.own { cell - self.own } else { cell + self.count - self.own };
        match forward {
            0 => 0,
            f if f <= self.count / 2 => 2 * f - 1,
            f => 2 * (self.count - f),
        }
    }

    /// Which poll of a turn looks at `address`, the inverse of [`Sequence::at`].
    pub fn position(&self, address: Address) -> Option<usize> {
        self.cell_at(address).map(|cell| self.turn(cell))
    }

    /// The same cells, polled from another one outwards.
    #[must_use]
    pub fn turned(&self, own: usize) -> Self {
        Self { own, ..*self }
    }

    /// The cell that polling starts with.
    pub fn own(&self) -> usize {
        self.own
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::{Home, Layout};

    fn addresses(words: u64) -> crate::Region {
        Layout::default().allocate("cells", words, Home::RoundRobin, 1).expect("fits")
    }

    /// Catches an order of polls other than own, +1, -1, +2, -2, ..., a cell left out, and an inverse that is none.
    #[test]
    fn a_sequence_goes_outwards_and_its_inverse_comes_back() {
        let region = addresses(100);
        let five = Sequence::around(region.at(10), 3, 5, 3).and(region.at(0));
        assert_eq!(
            (0..6).map(|k| five.cell(k)).collect::<Vec<_>>(),
            [Some(3), Some(4), Some(2), Some(0), Some(1), None]
        );
        assert_eq!(five.at(2), region.at(16));
        assert_eq!(five.at(5), region.at(0));
        for count in 1..=9 {
            for own in 0..count {
                let sequence = Sequence::around(region.at(10), 2, count, own).and(region.at(9));
                assert!(sequence.is_valid());
                let mut seen: Vec<_> = (0..count).filter_map(|k| sequence.cell(k)).collect();
                for k in 0..=count {
                    assert_eq!(sequence.position(sequence.at(k)), Some(k), "{count} cells, own {own}, poll {k}");
                }
                seen.sort_unstable();
                assert!(seen.into_iter().eq(0..count), "{count} cells, own {own}");
                assert_eq!(sequence.position(region.at(11)), None, "between two cells");
            }
        }
    }

    /// Catches a scan that would never end or look outside.
    #[test]
    fn senseless_sequences_are_told() {
        let region = addresses(100);
        let at = region.at(10);
        for wrong in [
            Sequence::around(at, 1, 0, 0),
            Sequence::around(at, 0, 3, 0),
            Sequence::around(at, 1, 3, 3),
            Sequence::around(at, u64::MAX, 3, 0),
            Sequence::around(at, 2, 3, 0).and(region.at(12)),
        ] {
            assert!(!wrong.is_valid(), "{wrong:?}");
        }
    }

    /// Catches a condition that reads numbers wrongly at the ends of their range.
    #[test]
    fn conditions_hold_where_they_say() {
        let words = [0, 1, 2, u64::MAX];
        let table = [
            (Condition::Equal(1), [false, true, false, false]),
            (Condition::Differs(1), [true, false, true, true]),
            (Condition::AtLeast(1), [false, true, true, true]),
            (Condition::Below(2), [true, true, false, false]),
            (Condition::Positive, [false, true, true, false]),
        ];
        for (condition, expected) in table {
            assert_eq!(words.map(|w| condition.holds(w)), expected, "{condition:?}");
        }
    }

    /// Catches work that is lost, or charged to a class that nobody named without anyone noticing.
    #[test]
    fn work_adds_up_by_class() {
        let mut work = Work::of(WorkClass(2), 5);
        work.add(&Work::of(WorkClass(2), 1));
        work.add(&Work::of(WorkClass(0), u64::MAX));
        work.add(&Work::of(WorkClass(0), 1));
        assert_eq!(work.counts()[..3], [u64::MAX, 0, 6]);
        work.add(&Work::of(WorkClass(15), 1));
        work.add_of(WorkClass(1), 0);
        let charged: Vec<_> = work.charged().collect();
        assert_eq!(charged, [(WorkClass(0), u64::MAX), (WorkClass(2), 6), (WorkClass(15), 1)]);
        assert_eq!((work.beyond(15), work.beyond(16), work.beyond(17)), (Some(WorkClass(15)), None, None));
        work = Work::of(WorkClass(2), 6);
        assert_eq!(Work::of(WorkClass(1), 0), Work::default());
        assert_eq!(work.beyond(2), Some(WorkClass(2)));
        assert_eq!(work.beyond(3), None);
    }
}
