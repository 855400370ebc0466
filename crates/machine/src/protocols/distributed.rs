//! One lock-protected double-ended list of tasks per processor: the owner takes what came last, thieves take what came
//! first.

use super::{Full, Termination, key};
use crate::machine::Machine;
use crate::memory::{Address, Home, MemoryError, Region};
use crate::operation::{Condition, LockId, Sequence};
use crate::processor::{Cause, Mark, Note, Processor};

const LENGTH: u64 = 0;
const TOP: u64 = 1;
const TAIL: u64 = 2;
const FREE: u64 = 3;
const ENTRIES: u64 = 4;

const PUSH: Mark = Mark::new(Cause::Queue, "push");
const POP: Mark = Mark::new(Cause::Queue, "pop");
const STEAL: Mark = Mark::new(Cause::Steal, "steal");

/// The queues of all processors. A task is a record of `W` words, at most four.
#[derive(Clone, Copy, Debug)]
pub struct DistributedQueues<const W: usize> {
    region: Region,
    queues: usize,
    capacity: u64,
    locks: LockId,
}

/// How often a processor tried to take a task out of another's queue. The looks at lengths that led there are among the
/// [`crate::Counts::polls`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StealCounts {
    /// It got one.
    pub successes: u64,
    /// The queue was empty when it came, before the lock or under it.
    pub failures: u64,
}

impl StealCounts {
    /// How often it tried.
    pub fn tries(&self) -> u64 {
        self.successes + self.failures
    }

    /// Adds another's counts.
    pub fn add(&mut self, other: &Self) {
        self.successes += other.successes;
        self.failures += other.failures;
    }
}

impl<const W: usize> DistributedQueues<W> {
    /// Empty queues for at most `capacity` tasks each.
    ///
    /// # Errors
    ///
    /// When there is no room for them.
    pub fn new<M: Machine>(machine: &mut M, name: &str, capacity: u64) -> Result<Self, MemoryError> {
        let queues = machine.count();
        let words = capacity.saturating_mul(1 + W as u64).saturating_add(ENTRIES).saturating_mul(queues as u64);
        let region = machine.allocate(name, words, Home::FirstTouch)?;
        let locks = machine.allocate_locks(u32::try_from(queues).unwrap_or(u32::MAX));
        let it = Self { region, queues, capacity, locks };
        for queue in 0..queues {
            machine.poke(it.word(queue, FREE), u64::from(capacity > 0));
            for entry in 1..=capacity {
                machine.poke(it.chain(queue, entry), if entry < capacity { entry + 1 } else { 0 });
            }
        }
        Ok(it)
    }

    /// How many queues there are.
    pub fn queues(&self) -> usize {
        self.queues
    }

    /// Puts a task on top of a queue: its owner takes it first.
    ///
    /// # Errors
    ///
    /// Gives the task back when the queue is full: the caller runs it itself.
    pub async fn push<P: Processor>(&self, p: &P, queue: usize, task: [u64; W]) -> Result<(), Full<[u64; W]>> {
        self.put(p, queue, task, false).await
    }

    /// Puts a task at the tail of a queue: its owner takes it last, a thief first.
    ///
    /// # Errors
    ///
    /// Gives the task back when the queue is full: the caller runs it itself.
    pub async fn append<P: Processor>(&self, p: &P, queue: usize, task: [u64; W]) -> Result<(), Full<[u64; W]>> {
        self.put(p, queue, task, true).await
    }

    async fn put<P: Processor>(
        &self,
        p: &P,
        queue: usize,
        task: [u64; W],
        at_tail: bool,
    ) -> Result<(), Full<[u64; W]>> {
        let before = p.enter(PUSH);
        p.lock(self.lock(queue)).await;
        let length = p.load(self.word(queue, LENGTH)).await;
        let full = length >= self.capacity;
        if !full {
            let entry = p.load(self.word(queue, FREE)).await;
            let unused = p.load(self.chain(queue, entry)).await;
            p.store(self.word(queue, FREE), unused).await;
            p.store_block(self.chain(queue, entry).plus(1), task).await;
            if at_tail && length > 0 {
                let above = p.load(self.word(queue, TAIL)).await;
                p.store(self.chain(queue, entry), 0).await;
                p.store(self.chain(queue, above), entry).await;
            } else {
                let below = p.load(self.word(queue, TOP)).await;
                p.store(self.chain(queue, entry), below).await;
                p.store(self.word(queue, TOP), entry).await;
            }
            if at_tail || length == 0 {
                p.store(self.word(queue, TAIL), entry).await;
            }
            p.note(Note::Spawn(key(task)));
            p.store(self.word(queue, LENGTH), length + 1).await;
        }
        p.unlock(self.lock(queue)).await;
        p.enter(before);
        if full { Err(Full(task)) } else { Ok(()) }
    }

    /// Takes the task on top of this processor's own queue.
    pub async fn pop<P: Processor>(&self, p: &P) -> Option<[u64; W]> {
        let queue = p.id();
        let before = p.enter(POP);
        let mut task = None;
        if p.load(self.word(queue, LENGTH)).await > 0 {
            p.lock(self.lock(queue)).await;
            let entry = p.load(self.word(queue, TOP)).await;
            if entry != 0 {
                let below = p.load(self.chain(queue, entry)).await;
                p.store(self.word(queue, TOP), below).await;
                task = Some(self.take(p, queue, entry).await);
            }
            p.unlock(self.lock(queue)).await;
        }
        p.enter(before);
        task
    }

    /// Takes the task at the tail of another's queue, walking there from the top; `counts` tells whether it got one.
    pub async fn steal<P: Processor>(&self, p: &P, queue: usize, counts: &mut StealCounts) -> Option<[u64; W]> {
        let before = p.enter(STEAL);
        let mut task = None;
        if p.load(self.word(queue, LENGTH)).await > 0 {
            p.lock(self.lock(queue)).await;
            let (mut above, mut entry) = (0, p.load(self.word(queue, TOP)).await);
            if entry != 0 {
                loop {
                    let below = p.load(self.chain(queue, entry)).await;
                    if below == 0 {
                        break;
                    }
                    (above, entry) = (entry, below);
                }
                if above == 0 {
                    p.store(self.word(queue, TOP), 0).await;
                } else {
                    p.store(self.chain(queue, above), 0).await;
                    p.store(self.word(queue, TAIL), above).await;
                }
                task = Some(self.take(p, queue, entry).await);
            }
            p.unlock(self.lock(queue)).await;
        }
        *(if task.is_some() { &mut counts.successes } else { &mut counts.failures }) += 1;
        p.enter(before);
        task
    }

    /// The next task: of the own queue, else of the nearest one that has any. Waits while there is none; `None` when
    /// all tasks are finished. The time of the search goes to `Cause::Idle`.
    pub async fn next<P: Processor>(&self, p: &P, open: &Termination, counts: &mut StealCounts) -> Option<[u64; W]> {
        let own = p.id();
        let stride = self.capacity * (1 + W as u64) + ENTRIES;
        let lengths = Sequence::around(self.word(0, LENGTH), stride, self.queues, own).and(open.done());
        let mut task = self.pop(p).await;
        while task.is_none() {
            let found = p.scan(lengths, Condition::Positive).await;
            task = match lengths.cell(found)? {
                queue if queue == own => self.pop(p).await,
                queue => self.steal(p, queue, counts).await,
            };
        }
        task
    }

    /// Reads an entry that has left the chain of tasks and puts it into that of unused ones. The lock is held.
    async fn take<P: Processor>(&self, p: &P, queue: usize, entry: u64) -> [u64; W] {
        let task = p.load_block(self.chain(queue, entry).plus(1)).await;
        let unused = p.load(self.word(queue, FREE)).await;
        p.store(self.chain(queue, entry), unused).await;
        p.store(self.word(queue, FREE), entry).await;
        let length = p.load(self.word(queue, LENGTH)).await;
        p.store(self.word(queue, LENGTH), length - 1).await;
        p.note(Note::Start(key(task)));
        task
    }

    fn lock(&self, queue: usize) -> LockId {
        LockId(self.locks.0 + queue as u32)
    }

    fn word(&self, queue: usize, word: u64) -> Address {
        let stride = self.capacity * (1 + W as u64) + ENTRIES;
        self.region.at(queue as u64 * stride + word)
    }

    fn chain(&self, queue: usize, entry: u64) -> Address {
        self.word(queue, ENTRIES + (entry - 1) * (1 + W as u64))
    }
}
