//! One queue for all processors, without a lock: a circular array whose slots are given out by multiprefix, to those
//! who put tasks in and to those who wait for them.

use super::{Full, Termination, key};
use crate::machine::Machine;
use crate::memory::{Address, Home, MemoryError, Region};
use crate::operation::{Condition, Prefix};
use crate::processor::{Cause, Mark, Note, Processor};

const TAIL: u64 = 0;
const HEAD: u64 = 1;
const SPACE: u64 = 2;
const END: u64 = 3;
const SLOTS: u64 = 4;

/// Turns of a slot in one round: empty, with a task, with the end.
const TURNS: u64 = 3;

const ENQUEUE: Mark = Mark::new(Cause::Queue, "enqueue");
const DEQUEUE: Mark = Mark::new(Cause::Queue, "dequeue");
const ENDING: Mark = Mark::new(Cause::Queue, "end");

/// The queue. A task is a record of `W` words, at most four. First in, first out, as the tickets are drawn.
///
/// A phase runs from one barrier to the next: tasks are put in, every processor calls [`ParallelQueue::next`] until it
/// gives `None`, and every task is finished by [`ParallelQueue::finish`]. Nothing has to be reset between two phases
/// but the count of open tasks.
#[derive(Clone, Copy, Debug)]
pub struct ParallelQueue<const W: usize> {
    region: Region,
    slots: u64,
}

/// What a ticket stands for.
#[derive(Clone, Copy)]
struct Place {
    turn: Address,
    /// The turn of the slot while it is empty for this ticket.
    empty: u64,
}

impl<const W: usize> ParallelQueue<W> {
    /// An empty queue for at most `slots` tasks; 0 counts as 1. With at least as many slots as processors the end of a
    /// phase takes a number of steps that grows with the logarithm of the processors.
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
        let space = self.reserve(p).await;
        if space {
            let place = self.place(p.prefix(Prefix::Add, self.region.at(TAIL), 1).await);
            p.wait_while(place.turn, Condition::Below(place.empty)).await;
            p.store_block(place.turn.plus(1), task).await;
            p.note(Note::Spawn(key(task)));
            p.store(place.turn, place.empty + 1).await;
        }
        p.enter(before);
        if space { Ok(()) } else { Err(Full(task)) }
    }

    /// The next task. Waits for it at a slot of its own; `None`, once in a phase, when all tasks are finished, or when
    /// there were none to begin with.
    pub async fn next<P: Processor>(&self, p: &P, open: &Termination) -> Option<[u64; W]> {
        let before = p.enter(DEQUEUE);
        // Set by nobody in a phase of this queue: the phase began with it or without.
        if p.load(open.done()).await != 0 {
            p.enter(before);
            return None;
        }
        let ticket = p.prefix(Prefix::Add, self.region.at(HEAD), 1).await;
        let place = self.place(ticket);
        let full = p.wait_while(place.turn, Condition::Below(place.empty + 1)).await == place.empty + 1;
        let task = if full {
            let task = p.load_block(place.turn.plus(1)).await;
            p.store(place.turn, place.empty + TURNS).await;
            p.prefix(Prefix::Add, self.region.at(SPACE), 1).await;
            p.note(Note::Start(key(task)));
            Some(task)
        } else {
            p.enter(ENDING);
            p.store(place.turn, place.empty + TURNS).await;
            let first = p.load(self.region.at(END)).await;
            let mine = ticket - first;
            let count = p.count() as u64;
            for next in (2 * mine + 1..2 * mine + 3).filter(|&n| n < count) {
                self.put_end(p, first + next).await;
            }
            None
        };
        p.enter(before);
        task
    }

    /// One task is finished, and has made what it makes. Whoever finishes the last one of a phase lets it end.
    pub async fn finish<P: Processor>(&self, p: &P, open: &Termination) {
        if open.take(p).await {
            let before = p.enter(ENDING);
            let first = p.prefix(Prefix::Add, self.region.at(TAIL), p.count() as u64).await;
            p.store(self.region.at(END), first).await;
            self.put_end(p, first).await;
            p.enter(before);
        }
    }

    /// Tells the holder of a ticket that no task comes.
    async fn put_end<P: Processor>(&self, p: &P, ticket: u64) {
        let place = self.place(ticket);
        p.wait_while(place.turn, Condition::Below(place.empty)).await;
        p.store(place.turn, place.empty + 2).await;
    }

    /// Test, decrement, retest: whether a slot is now the caller's.
    async fn reserve<P: Processor>(&self, p: &P) -> bool {
        let space = self.region.at(SPACE);
        if !Condition::Positive.holds(p.load(space).await) {
            return false;
        }
        let had = Condition::Positive.holds(p.prefix(Prefix::Add, space, u64::MAX).await);
        if !had {
            p.prefix(Prefix::Add, space, 1).await;
        }
        had
    }

    fn place(&self, ticket: u64) -> Place {
        let turn = self.region.at(SLOTS + (ticket % self.slots) * (1 + W as u64));
        Place { turn, empty: TURNS * (ticket / self.slots) }
    }
}
