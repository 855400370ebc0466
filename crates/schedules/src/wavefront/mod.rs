//! The third organisation: no tasks. Links lie in flat arrays, and everything is a loop over an array: rounds evaluate the
//! links that are open, ask the oracle, and append what splits; rows of links are sorted, gathered and added up in chunks.
//! Jacobi's update by nature.
//!
//! | record | words |
//! |---|---|
//! | row, of an element | begin; length; how many of these live; fresh links; begin while unsorted; changed?; to be split?; end while unsorted, later chunks not done; own light, three bands |
//! | entry of a row | source; its name; form factor; visibility; receiver |
//! | fresh link | receiver; source; their names; form factor (of a pair of roots: exchange area); visibility; join counter, later its place among the receiver's fresh links; the same for the source, if it is a pair |
//! | split | receiver; source; their names; which of the two is split |
//!
//! Slots of arrays are given out by multiprefix, so the order in arrays depends on time. Nothing else does: rows are sorted by
//! the names of sources before anything is summed.

mod gather;
mod rounds;
mod rows;
mod tree;

use crate::pairs::Pairs;
use crate::store::Sizes;
use crate::worker::{LOOPS, Worker};
use isolux_machine::protocols::parallel_for;
use isolux_machine::{Address, Home, Machine, MemoryError, Processor, Region};

/// The first loop of those that go in turn.
const FIRST_TURN: usize = 4;

const ROW_WORDS: u64 = 12;
const BEGIN: u64 = 0;
const LIVE: u64 = 2;
const FRESH: u64 = 3;
const UNSORTED: u64 = 4;
const CHANGED: u64 = 5;
const CLAIMED: u64 = 6;
const END: u64 = 7;
const JOIN: u64 = 7;
const OWN: u64 = 8;

const ENTRY_WORDS: u64 = 5;
/// Entries that are read together.
const TOGETHER: u64 = 3;
const ENTRY_VISIBILITY: u64 = 3;

const FRESH_WORDS: u64 = 8;
const FRESH_VISIBILITY: u64 = 5;
const FRESH_JOIN: u64 = 6;

const SPLIT_WORDS: u64 = 5;

/// Arrays, in words of the machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flat {
    sizes: Sizes,
    by_element: Region,
    rows: Region,
    unsorted: Region,
    fresh: Region,
    splits: Region,
    claims: Region,
    changed: Region,
    sorting: Region,
    gathering: Region,
    sums: Region,
    founders: Region,
}

impl Flat {
    pub(crate) fn new<M: Machine>(machine: &mut M, sizes: Sizes) -> Result<Flat, MemoryError> {
        let Sizes { elements, links, nodes, .. } = sizes;
        Ok(Flat {
            sizes,
            by_element: machine.allocate("rows by element", elements * ROW_WORDS, Home::RoundRobin)?,
            rows: machine.allocate("rows", links * ENTRY_WORDS, Home::RoundRobin)?,
            unsorted: machine.allocate("unsorted rows", links * ENTRY_WORDS, Home::RoundRobin)?,
            fresh: machine.allocate("fresh links", links * FRESH_WORDS, Home::RoundRobin)?,
            splits: machine.allocate("splits", links * SPLIT_WORDS, Home::RoundRobin)?,
            claims: machine.allocate("elements to split", elements, Home::RoundRobin)?,
            changed: machine.allocate("changed rows", elements, Home::RoundRobin)?,
            sorting: machine.allocate("chunks to sort", links, Home::RoundRobin)?,
            gathering: machine.allocate("chunks to gather", links, Home::RoundRobin)?,
            sums: machine.allocate("chunk sums", links * 3, Home::RoundRobin)?,
            founders: machine.allocate("founders", nodes.max(1), Home::RoundRobin)?,
        })
    }

    fn row(&self, element: u32, word: u64) -> Address {
        self.by_element.at(u64::from(element) * ROW_WORDS + word)
    }

    fn entry(&self, at: u64, word: u64) -> Address {
        self.rows.at(at * ENTRY_WORDS + word)
    }

    fn unsorted(&self, at: u64, word: u64) -> Address {
        self.unsorted.at(at * ENTRY_WORDS + word)
    }

    fn fresh(&self, at: u64, word: u64) -> Address {
        self.fresh.at(at * FRESH_WORDS + word)
    }

    fn split(&self, at: u64) -> Address {
        self.splits.at(at * SPLIT_WORDS)
    }

    fn sum(&self, at: u64) -> Address {
        self.sums.at(at * 3)
    }
}

/// A link in a row.
type Entry = [u64; ENTRY_WORDS as usize];

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// The entries `from..to` of an array whose entry `i` begins at `word(i)`.
    async fn entries(&self, word: impl Fn(u64) -> Address, from: u64, to: u64) -> Vec<Entry> {
        let mut entries = Vec::with_capacity((to - from) as usize);
        let mut at = from;
        while at + TOGETHER <= to {
            let words: [u64; (ENTRY_WORDS * TOGETHER) as usize] = self.p.load_block(word(at)).await;
            entries.extend_from_slice(words.as_chunks().0);
            at += TOGETHER;
        }
        while at < to {
            entries.push(self.p.load_block(word(at)).await);
            at += 1;
        }
        entries
    }

    /// A loop in a row of loops, without waiting at its end. The counter of the one after the next begins anew meanwhile:
    /// everyone has left it, at the barrier before last.
    async fn each_and_go_on(&self, end: u64, chunk: u64, body: impl AsyncFnMut(u64)) {
        let turns = LOOPS - FIRST_TURN;
        let turn = self.turn.get();
        self.turn.set(turn + 1);
        if self.is_first() {
            self.cx.loops[FIRST_TURN + (turn + 2) % turns].reset(&self.p).await;
        }
        let indices = &self.cx.loops[FIRST_TURN + turn % turns];
        // On the heap, and gone before the barrier: processors that wait there are small.
        Box::pin(parallel_for(&self.p, indices, end, chunk, body)).await;
    }

    /// The same, and everyone waits for everyone.
    async fn each(&self, end: u64, chunk: u64, body: impl AsyncFnMut(u64)) {
        self.each_and_go_on(end, chunk, body).await;
        self.barrier().await;
    }
}
