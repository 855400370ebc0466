//! What a processor can do: the trait that programs are written against.

use std::future::Future;

use crate::memory::{Address, Region};
use crate::operation::{BarrierId, Condition, LockId, Prefix, Sequence, Work};

/// What a processor's time goes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Cause {
    /// The computation itself.
    Work,
    /// Waiting for memory, beyond what a hit in the nearest cache takes.
    Stall,
    /// Putting tasks into queues and taking them out of its own.
    Queue,
    /// Taking tasks out of others' queues.
    Steal,
    /// Waiting for a lock that another holds.
    LockWait,
    /// Waiting at a barrier for the others.
    BarrierWait,
    /// Waiting for a word to change, and for the run to end.
    Idle,
}

impl Cause {
    /// All of them, in order.
    pub const ALL: [Self; 7] =
        [Self::Work, Self::Stall, Self::Queue, Self::Steal, Self::LockWait, Self::BarrierWait, Self::Idle];

    /// Its name in tables and traces.
    pub fn name(self) -> &'static str {
        match self {
            Self::Work => "work",
            Self::Stall => "stall",
            Self::Queue => "queue",
            Self::Steal => "steal",
            Self::LockWait => "lock wait",
            Self::BarrierWait => "barrier wait",
            Self::Idle => "idle",
        }
    }
}

/// The most words that are read or written together.
pub const BLOCK_WORDS: usize = 16;

/// How tasks hang together. Work after a note depends on the work that the note names; a chain of such work takes its
/// time on any number of processors. Keys are the program's: two that are in use at a time must differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Note {
    /// The task of this key can start after the work that this processor has done so far.
    Spawn([u64; 4]),
    /// This processor begins with the task of this key: what it does now depends on what came before the task's
    /// [`Note::Spawn`], no longer on what this processor did before.
    Start([u64; 4]),
    /// What waits at this key depends on the work that this processor has done so far.
    Join([u64; 4]),
    /// This processor goes on with what waited at this key: it depends on all that joined there, and on what it did
    /// before.
    Resume([u64; 4]),
    /// A loop of independent indices begins: each depends on what this processor has done so far.
    LoopBegin,
    /// The next index of the loop begins.
    LoopIndex,
    /// The loop has ended: what comes now depends on all indices that this processor ran.
    LoopEnd,
}

/// What a processor is at: a cause for its time, and a name for traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// What its time goes to, unless it waits.
    pub cause: Cause,
    /// The phase, or the kind of task.
    pub label: &'static str,
}

impl Mark {
    /// A mark of this cause and name.
    pub const fn new(cause: Cause, label: &'static str) -> Self {
        Self { cause, label }
    }
}

/// One of a machine's processors, as the program that it runs sees it.
///
/// Between two awaits a program touches only what nobody writes, and what is its own. Whatever another processor may
/// write meanwhile lies in shared words, and is reached by awaited operations alone. Each operation takes effect at one
/// moment between its call's first poll and its end, and all processors agree on the order of all effects. A processor
/// awaits one operation at a time.
///
/// A wrong operation (an address outside all regions, the unlocking of a lock that it does not hold) ends the run with
/// a [`crate::Fault`]; its future never becomes ready.
pub trait Processor {
    /// Its number, from 0.
    fn id(&self) -> usize;

    /// How many processors the machine has.
    fn count(&self) -> usize;

    /// The value of a word.
    fn load(&self, at: Address) -> impl Future<Output = u64>;

    /// Sets a word.
    fn store(&self, at: Address, value: u64) -> impl Future<Output = ()>;

    /// Combines a word with `value` and gives the word from before. Where several processors do the same to one word at
    /// the same time, simulated machines serve them in the order of their numbers.
    fn prefix(&self, op: Prefix, at: Address, value: u64) -> impl Future<Output = u64>;

    /// Waits until nobody holds the lock, then holds it.
    fn lock(&self, lock: LockId) -> impl Future<Output = ()>;

    /// Gives the lock up.
    fn unlock(&self, lock: LockId) -> impl Future<Output = ()>;

    /// Waits until all processors of the machine are at this barrier.
    fn barrier(&self, barrier: BarrierId) -> impl Future<Output = ()>;

    /// Tells that work was done. On simulated machines it takes its time; no work takes none.
    fn charge(&self, work: &Work) -> impl Future<Output = ()>;

    /// Polls a word while the condition holds; gives the value that ended it.
    fn wait_while(&self, at: Address, condition: Condition) -> impl Future<Output = u64>;

    /// Polls the cells of a sequence in turn until one fulfils the condition; gives the number of that poll in its turn
    /// (see [`Sequence::cell`]).
    fn scan(&self, cells: Sequence, until: Condition) -> impl Future<Output = usize>;

    /// The values of `N` consecutive words, at most [`BLOCK_WORDS`] of them, as `N` loads cost. Simulated machines read
    /// all of them at the moment of the first; on real threads each is read by itself.
    fn load_block<const N: usize>(&self, at: Address) -> impl Future<Output = [u64; N]> {
        async move {
            let mut values = [0; N];
            for (i, value) in values.iter_mut().enumerate() {
                *value = self.load(at.plus(i as u64)).await;
            }
            values
        }
    }

    /// Sets `N` consecutive words, at most [`BLOCK_WORDS`] of them, as `N` stores cost; otherwise like
    /// [`Processor::load_block`].
    fn store_block<const N: usize>(&self, at: Address, values: [u64; N]) -> impl Future<Output = ()> {
        async move {
            for (i, value) in values.into_iter().enumerate() {
                self.store(at.plus(i as u64), value).await;
            }
        }
    }

    /// Whether it matters what [`Processor::touch`] is told: only on machines with caches.
    fn has_caches(&self) -> bool {
        false
    }

    /// Tells that records of a region were read whole, in this order: data that nobody writes any more, whose values
    /// the program has by other means. Record `i` is the words from `i * words` on. What a hit costs is part of the
    /// work that is charged; machines with caches add what goes beyond.
    fn touch(&self, _region: Region, _words: u64, _records: &[u32]) -> impl Future<Output = ()> {
        std::future::ready(())
    }

    /// Tells how the program's tasks hang together, for the length of the longest chain of work. Costs nothing.
    fn note(&self, _note: Note) {}

    /// From here on time goes to this mark; gives the one before. Costs nothing. While it waits for a lock, a barrier
    /// or a word, a processor's time goes to the wait.
    fn enter(&self, mark: Mark) -> Mark;
}
