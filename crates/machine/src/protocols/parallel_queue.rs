//! One queue for all processors, without a lock: a circular array whose slots are given out by multiprefix.

use super::{Full, Termination};
use crate::machine::Machine;
use crate::memory::{Address, Home, MemoryError, Region};
use crate::operation::{Condition, Prefix, Sequence};
use crate::processor::{Cause, Mark, Processor};

const TAIL: u64 = 0;
const HEAD: u64 = 1;
const ITEMS: u64 = 2;
const SPACE: u64 = 3;
const SLOTS: u64 = 4;

const ENQUEUE: Mark = Mark::new(Cause::Queue, "enqueue");
const DEQUEUE: Mark = Mark::new(Cause::Queue, "dequeue");

/// The queue. A task is a record of `W` words. First in, first out, as the tickets are drawn.
#[derive(Clone, Copy, Debug)]
pub struct ParallelQueue<const W: usize> {
    region: Region,
    slots: u64,
}

impl<const W: usize> ParallelQueue<W> {
    /// An empty queue for at most `slots` tasks; 0 counts as 1.
    ///
    /// # Errors
    ///
    /// When there is no room for it.
    pub fn new<M: Machine>(machine: &mut M, name: &str, slots: u64) -> Result<Self, MemoryError> {
        let slots = slots.max(1);
        let words = slots.saturating_mul(1 + W as u64).saturating_add(SLOTS);
        let it = Self { region: machine.allocate(name, words, Home::RoundRobin)?, slots };
        machine.poke(it.region.at(SPACE), slots);
        Ok(it)
    }

    /// Puts a task in.
    ///
    /// # Errors
    ///
    /// Gives the task back when there is no slot for it, or seems to be none for a moment: the caller runs it itself.
    pub async fn enqueue<P: Processor>(&self, p: &P, task: [u64; W]) -> Result<(), Full<[u64; W]>> {
        let before = p.enter(ENQUEUE);
        let space = self.reserve(p, SPACE).await;
        if space {
            let ticket = p.prefix(Prefix::Add, self.region.at(TAIL), 1).await;
            let (slot, round) = self.place(ticket);
            p.wait_while(slot, Condition::Differs(2 * round)).await;
            for (i, word) in task.into_iter().enumerate() {
                p.store(self.word(ticket, i), word).await;
            }
            p.store(slot, 2 * round + 1).await;
            p.prefix(Prefix::Add, self.region.at(ITEMS), 1).await;
        }
        p.enter(before);
        if space { Ok(()) } else { Err(Full(task)) }
    }

    /// Takes a task out. `None` when there is none, or seems to be none for a moment.
    pub async fn dequeue<P: Processor>(&self, p: &P) -> Option<[u64; W]> {
        let before = p.enter(DEQUEUE);
        let mut task = None;
        if self.reserve(p, ITEMS).await {
            let ticket = p.prefix(Prefix::Add, self.region.at(HEAD), 1).await;
            let (slot, round) = self.place(ticket);
            p.wait_while(slot, Condition::Differs(2 * round + 1)).await;
            let mut words = [0; W];
            for (i, word) in words.iter_mut().enumerate() {
                *word = p.load(self.word(ticket, i)).await;
            }
            p.store(slot, 2 * round + 2).await;
            p.prefix(Prefix::Add, self.region.at(SPACE), 1).await;
            task = Some(words);
        }
        p.enter(before);
        task
    }

    /// The next task. Waits while there is none; `None` when all tasks are finished.
    pub async fn next<P: Processor>(&self, p: &P, open: &Termination) -> Option<[u64; W]> {
        let cells = Sequence::one(self.region.at(ITEMS)).and(open.done());
        let mut task = self.dequeue(p).await;
        while task.is_none() {
            cells.cell(p.scan(cells, Condition::Positive).await)?;
            task = self.dequeue(p).await;
        }
        task
    }

    /// Test, decrement, retest: whether one of what the word counts is now the caller's.
    async fn reserve<P: Processor>(&self, p: &P, word: u64) -> bool {
        let counter = self.region.at(word);
        if !Condition::Positive.holds(p.load(counter).await) {
            return false;
        }
        let had = Condition::Positive.holds(p.prefix(Prefix::Add, counter, u64::MAX).await);
        if !had {
            p.prefix(Prefix::Add, counter, 1).await;
        }
        had
    }

    fn place(&self, ticket: u64) -> (Address, u64) {
        (self.region.at(SLOTS + (ticket % self.slots) * (1 + W as u64)), ticket / self.slots)
    }

    fn word(&self, ticket: u64, word: usize) -> Address {
        self.region.at(SLOTS + (ticket % self.slots) * (1 + W as u64) + 1 + word as u64)
    }
}
