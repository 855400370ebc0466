//! Indices from a shared counter: each goes to one processor, chunk by chunk, first come, first served.

use crate::machine::Machine;
use crate::memory::{Address, Home, MemoryError};
use crate::operation::Prefix;
use crate::processor::{Note, Processor};

/// A loop over the indices below `end`, claimed in chunks.
#[derive(Clone, Copy, Debug)]
pub struct ParallelLoop {
    counter: Address,
}

impl ParallelLoop {
    /// A counter of its own, at zero.
    ///
    /// # Errors
    ///
    /// When there is no room for its word.
    pub fn new<M: Machine>(machine: &mut M, name: &str) -> Result<Self, MemoryError> {
        Ok(Self { counter: machine.allocate(name, 1, Home::At(0))?.at(0) })
    }

    /// The next chunk below `end`; `None` when all are claimed. A chunk of 0 counts as 1.
    pub async fn claim<P: Processor>(&self, p: &P, end: u64, chunk: u64) -> Option<std::ops::Range<u64>> {
        let chunk = chunk.max(1);
        let first = p.prefix(Prefix::Add, self.counter, chunk).await;
        (first < end).then(|| first..first.saturating_add(chunk).min(end))
    }

    /// Lets the loop begin anew. One processor calls it, between two barriers.
    pub async fn reset<P: Processor>(&self, p: &P) {
        p.store(self.counter, 0).await;
    }
}

/// Runs `body` for the indices that fall to this processor; all processors together run each index below `end` once.
pub async fn parallel_for<P: Processor>(
    p: &P,
    indices: &ParallelLoop,
    end: u64,
    chunk: u64,
    mut body: impl AsyncFnMut(u64),
) {
    p.note(Note::LoopBegin);
    while let Some(claimed) = indices.claim(p, end, chunk).await {
        for index in claimed {
            p.note(Note::LoopIndex);
            body(index).await;
        }
    }
    p.note(Note::LoopEnd);
}
