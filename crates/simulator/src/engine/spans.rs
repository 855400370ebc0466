//! The longest chain of work: notes of how tasks hang together go in, and work as it is done; how long the chain is
//! that ends in what each processor does now comes out.
//!
//! A processor's *depth* is that length. Work adds to it; a note sets it to that of what the work after the note
//! depends on.

use isolux_machine::Note;
use rustc_hash::FxHashMap;

type Key = [u64; 4];

/// What one processor is at.
#[derive(Clone, Debug, Default)]
struct Chain {
    depth: u64,
    /// The longest chain that it has left since the last barrier.
    left: u64,
    /// Of each loop that it is in: the depth at the beginning, and the longest of the indices so far.
    loops: Vec<(u64, u64)>,
}

/// All processors' chains, and what waits for a processor.
#[derive(Debug, Default)]
pub(super) struct Spans {
    chains: Vec<Chain>,
    spawned: FxHashMap<Key, u64>,
    joined: FxHashMap<Key, u64>,
}

impl Spans {
    /// Bytes of a processor that is in no loop.
    pub(super) const BYTES: usize = size_of::<Chain>();

    pub(super) fn new(processors: usize) -> Self {
        Self { chains: vec![Chain::default(); processors], ..Self::default() }
    }

    /// A processor does work.
    pub(super) fn work(&mut self, processor: u32, units: u64) {
        self.chains[processor as usize].depth += units;
    }

    pub(super) fn note(&mut self, processor: u32, note: Note) {
        let chain = &mut self.chains[processor as usize];
        let depth = chain.depth;
        match note {
            Note::Spawn(key) => raise(&mut self.spawned, key, depth),
            Note::Start(key) => {
                chain.left = chain.left.max(depth);
                chain.depth = self.spawned.remove(&key).unwrap_or(0);
            }
            Note::Join(key) => raise(&mut self.joined, key, depth),
            Note::Resume(key) => chain.depth = depth.max(self.joined.remove(&key).unwrap_or(0)),
            Note::LoopBegin => chain.loops.push((depth, depth)),
            Note::LoopIndex => {
                if let Some((begin, longest)) = chain.loops.last_mut() {
                    *longest = depth.max(*longest);
                    chain.depth = *begin;
                }
            }
            Note::LoopEnd => {
                if let Some((_, longest)) = chain.loops.pop() {
                    chain.depth = depth.max(longest);
                }
            }
        }
    }

    /// All processors have come to a barrier: what comes now depends on all that was.
    pub(super) fn barrier(&mut self) {
        let longest = self.longest();
        for chain in &mut self.chains {
            (chain.depth, chain.left) = (longest, 0);
        }
    }

    /// The longest chain so far.
    pub(super) fn longest(&self) -> u64 {
        let of = |c: &Chain| c.loops.iter().fold(c.depth.max(c.left), |longest, l| longest.max(l.1));
        self.chains.iter().map(of).max().unwrap_or(0)
    }
}

fn raise(depths: &mut FxHashMap<Key, u64>, key: Key, depth: u64) {
    let there = depths.entry(key).or_insert(depth);
    *there = depth.max(*there);
}
