//! Caches of all processors in flat arrays: a line and a processor come in, its slot or the slot to replace goes out;
//! what a slot means to others is left to the system.

use crate::spec::CacheSpec;

/// No line: the address space ends before it.
pub(crate) const EMPTY: u32 = u32::MAX;

/// A slot of a cache. `data` is, in the coherent cache, the words written since the line was obtained (0: the line is
/// shared); in the filter before it, the slot of the coherent cache that has the same line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) used: u64,
    pub(crate) line: u32,
    pub(crate) data: u32,
}

const VACANT: Slot = Slot { used: 0, line: EMPTY, data: 0 };

/// One level of cache of every processor: slots by processor, then set, then way.
#[derive(Clone, Debug)]
pub(crate) struct Caches {
    pub(crate) slots: Vec<Slot>,
    pub(crate) ways: usize,
    set_mask: usize,
    set_bits: u32,
}

impl Caches {
    pub(crate) fn new(spec: &CacheSpec, line_bytes: u64, processors: usize) -> Caches {
        let sets = (spec.bytes / (line_bytes * spec.ways)) as usize;
        let ways = spec.ways as usize;
        let slots = vec![VACANT; processors * sets * ways];
        Caches { slots, ways, set_mask: sets - 1, set_bits: sets.trailing_zeros() }
    }

    /// The first slot of the set that this line belongs to.
    #[inline]
    pub(crate) fn set(&self, processor: usize, line: u32) -> usize {
        ((processor << self.set_bits) + (line as usize & self.set_mask)) * self.ways
    }

    #[inline]
    pub(crate) fn find(&self, processor: usize, line: u32) -> Option<usize> {
        let set = self.set(processor, line);
        if self.ways == 1 {
            return (self.slots[set].line == line).then_some(set);
        }
        // Without a way out of the loop: which way has the line cannot be predicted.
        let mut found = usize::MAX;
        for (way, slot) in self.slots[set..set + self.ways].iter().enumerate() {
            found = if slot.line == line { way } else { found };
        }
        (found != usize::MAX).then(|| set + found)
    }

    /// The slot for a new line: a vacant one, else the one used longest ago.
    #[inline]
    pub(crate) fn victim(&self, processor: usize, line: u32) -> usize {
        let set = self.set(processor, line);
        let mut victim = set;
        for slot in set + 1..set + self.ways {
            // A vacant slot was last used at time 0, before all others.
            if self.slots[slot].used < self.slots[victim].used {
                victim = slot;
            }
        }
        victim
    }

    pub(crate) fn vacate(&mut self, slot: usize) {
        self.slots[slot] = VACANT;
    }

    /// Each slot with a line, with its number and its processor.
    pub(crate) fn occupied(&self) -> impl Iterator<Item = (usize, usize, Slot)> {
        let of_one = (self.set_mask + 1) * self.ways;
        self.slots
            .iter()
            .enumerate()
            .filter(|(_, slot)| slot.line != EMPTY)
            .map(move |(number, &slot)| (number, number / of_one, slot))
    }
}
