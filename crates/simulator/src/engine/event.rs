//! The order of effects: operations go in, a key that sorts them comes out.

use isolux_machine::{Address, Prefix};

use super::time::Time;

/// What an operation is, as far as the order of effects goes. Among those of one time the smaller goes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Rank(u64);

impl Rank {
    /// Loads and polls.
    pub(super) const LOAD: Self = Self(0);
    /// Stores.
    pub(super) const STORE: Self = Self(2 << 61);
    /// Locks given up: before locks taken, so that one given up is free for those who come at that time.
    pub(super) const UNLOCK: Self = Self(3 << 61);
    /// Locks asked for.
    pub(super) const LOCK: Self = Self(4 << 61);
    /// Arrivals at barriers.
    pub(super) const BARRIER: Self = Self(5 << 61);

    /// Multiprefixes: by opcode, then by cell, so that those of one group stand together. A machine's addresses have 34
    /// bits.
    pub(super) fn prefix(op: Prefix, at: Address) -> Self {
        Self(1 << 61 | (op as u64) << 59 | at.word())
    }
}

/// When, and as the how-manieth, something takes effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Event {
    pub(super) time: Time,
    pub(super) rank: Rank,
    pub(super) processor: u32,
    /// What it is: a processor's operation, or a poll of one that waits.
    pub(super) what: What,
}

impl Event {
    /// Its rank and processor as one number.
    pub(super) fn order(&self) -> u128 {
        u128::from(self.rank.0) << 32 | u128::from(self.processor)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum What {
    /// The operation that the processor has issued.
    Operation,
    /// A poll that may find a cell of a group of watchers fulfilled.
    Sight { group: u32, cell: u32 },
}

#[cfg(test)]
mod tests {
    use isolux_machine::{Home, Layout};

    use super::*;

    /// Catches another order of effects than time; load, multiprefix by opcode and cell, store; processor.
    #[test]
    fn effects_are_in_the_order_of_the_contract() {
        let cells = Layout::default().allocate("cells", 1 << 33, Home::RoundRobin, 1).expect("fits");
        let (low, high) = (cells.at(3), cells.at((1 << 33) - 1));
        let event = |time, rank, processor| Event { time: Time(time), rank, processor, what: What::Operation };
        let sorted = [
            event(1, Rank::BARRIER, 9),
            event(2, Rank::LOAD, 1),
            event(2, Rank::LOAD, 2),
            event(2, Rank::prefix(Prefix::Add, low), 0),
            event(2, Rank::prefix(Prefix::Add, low), 7),
            event(2, Rank::prefix(Prefix::Add, high), 3),
            event(2, Rank::prefix(Prefix::Max, low), 1),
            event(2, Rank::prefix(Prefix::And, low), 1),
            event(2, Rank::prefix(Prefix::Or, high), 1),
            event(2, Rank::STORE, 0),
            event(2, Rank::UNLOCK, 0),
            event(2, Rank::LOCK, 0),
            event(2, Rank::BARRIER, 0),
        ];
        assert!(sorted.is_sorted_by(|a, b| a < b));
    }
}
