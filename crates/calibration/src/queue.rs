//! The scalar twins of the queues that tasks wait in (`crates/machine/src/protocols`): the same words and the same
//! steps, without locks, waiting and other processors.

use std::cell::Cell;

/// Words of a task, as many as schedules have.
pub(crate) const TASK: usize = 3;

/// A queue's words, in shared memory.
pub(crate) trait Words {
    fn load(&self, at: usize) -> u64;
    fn store(&mut self, at: usize, word: u64);
    fn load_task(&self, at: usize) -> [u64; TASK];
    fn store_task(&mut self, at: usize, task: &[u64; TASK]);

    /// Adds to a word; gives what it was.
    fn prefix(&mut self, at: usize, add: u64) -> u64 {
        let before = self.load(at);
        self.store(at, before.wrapping_add(add));
        before
    }
}

impl Words for Box<[u64]> {
    fn load(&self, at: usize) -> u64 {
        self[at]
    }

    fn store(&mut self, at: usize, word: u64) {
        self[at] = word;
    }

    fn load_task(&self, at: usize) -> [u64; TASK] {
        let mut task = [0; TASK];
        task.copy_from_slice(&self[at..at + TASK]);
        task
    }

    fn store_task(&mut self, at: usize, task: &[u64; TASK]) {
        self[at..at + TASK].copy_from_slice(task);
    }
}

/// Words that count how often they are loaded and stored.
pub(crate) struct Told {
    words: Box<[u64]>,
    moved: Cell<u64>,
}

impl Told {
    pub(crate) fn new(words: Box<[u64]>) -> Told {
        Told { words, moved: Cell::new(0) }
    }

    pub(crate) fn moved(&self) -> u64 {
        self.moved.get()
    }

    fn tell(&self, moved: usize) {
        self.moved.set(self.moved.get() + moved as u64);
    }
}

impl Words for Told {
    fn load(&self, at: usize) -> u64 {
        self.tell(1);
        self.words.load(at)
    }

    fn store(&mut self, at: usize, word: u64) {
        self.tell(1);
        self.words.store(at, word);
    }

    fn load_task(&self, at: usize) -> [u64; TASK] {
        self.tell(TASK);
        self.words.load_task(at)
    }

    fn store_task(&mut self, at: usize, task: &[u64; TASK]) {
        self.tell(TASK);
        self.words.store_task(at, task);
    }
}

/// A queue, either kind.
pub(crate) trait Queue {
    type Words: Words;

    /// False where it is full.
    fn put(&mut self, task: &[u64; TASK]) -> bool;
    fn take(&mut self) -> Option<[u64; TASK]>;
    fn words(&self) -> &Self::Words;
}

const LENGTH: usize = 0;
const TOP: usize = 1;
const LAST: usize = 2;
const FREE: usize = 3;
const ENTRIES: usize = 4;

/// A list of tasks and a list of free entries, last in, first out: `DistributedQueues`, one of them.
pub(crate) struct List<W> {
    words: W,
    capacity: u64,
}

impl<W: Words> List<W> {
    pub(crate) fn new(capacity: usize, words: fn(Box<[u64]>) -> W) -> List<W> {
        let mut all = vec![0; ENTRIES + capacity * (1 + TASK)];
        all[FREE] = u64::from(capacity > 0);
        for entry in 1..capacity {
            all[chain(entry as u64)] = entry as u64 + 1;
        }
        List { words: words(all.into_boxed_slice()), capacity: capacity as u64 }
    }
}

/// Where an entry says which one is next; its task follows. Entries count from 1.
fn chain(entry: u64) -> usize {
    ENTRIES + (entry as usize - 1) * (1 + TASK)
}

impl<W: Words> Queue for List<W> {
    type Words = W;

    #[inline(never)]
    fn put(&mut self, task: &[u64; TASK]) -> bool {
        let words = &mut self.words;
        let length = words.load(LENGTH);
        if length >= self.capacity {
            return false;
        }
        let entry = words.load(FREE);
        let unused = words.load(chain(entry));
        words.store(FREE, unused);
        words.store_task(chain(entry) + 1, task);
        let below = words.load(TOP);
        words.store(chain(entry), below);
        words.store(TOP, entry);
        if length == 0 {
            words.store(LAST, entry);
        }
        words.store(LENGTH, length + 1);
        true
    }

    #[inline(never)]
    fn take(&mut self) -> Option<[u64; TASK]> {
        let words = &mut self.words;
        if words.load(LENGTH) == 0 {
            return None;
        }
        let entry = words.load(TOP);
        if entry == 0 {
            return None;
        }
        let below = words.load(chain(entry));
        words.store(TOP, below);
        let task = words.load_task(chain(entry) + 1);
        let unused = words.load(FREE);
        words.store(chain(entry), unused);
        words.store(FREE, entry);
        let length = words.load(LENGTH);
        words.store(LENGTH, length - 1);
        Some(task)
    }

    fn words(&self) -> &W {
        &self.words
    }
}

const TAIL: usize = 0;
const HEAD: usize = 1;
const SPACE: usize = 2;
const DONE: usize = 3;
const SLOTS: usize = 4;
/// Turns of a slot in one round.
const TURNS: u64 = 3;

/// Slots in a circle, each with its turn, first in, first out: `ParallelQueue`.
pub(crate) struct Ring<W> {
    words: W,
    slots: u64,
}

impl<W: Words> Ring<W> {
    pub(crate) fn new(slots: usize, words: fn(Box<[u64]>) -> W) -> Ring<W> {
        let mut all = vec![0; SLOTS + slots * (1 + TASK)];
        all[SPACE] = slots as u64;
        Ring { words: words(all.into_boxed_slice()), slots: slots as u64 }
    }

    /// The slot of a ticket, and its turn while it is empty for it.
    fn place(&self, ticket: u64) -> (usize, u64) {
        (SLOTS + (ticket % self.slots) as usize * (1 + TASK), TURNS * (ticket / self.slots))
    }
}

impl<W: Words> Queue for Ring<W> {
    type Words = W;

    #[inline(never)]
    fn put(&mut self, task: &[u64; TASK]) -> bool {
        if self.words.load(SPACE).cast_signed() <= 0 {
            return false;
        }
        if self.words.prefix(SPACE, u64::MAX).cast_signed() <= 0 {
            self.words.prefix(SPACE, 1);
            return false;
        }
        let ticket = self.words.prefix(TAIL, 1);
        let (turn, empty) = self.place(ticket);
        if self.words.load(turn) < empty {
            // Others would be waited for.
            return false;
        }
        self.words.store_task(turn + 1, task);
        self.words.store(turn, empty + 1);
        true
    }

    #[inline(never)]
    fn take(&mut self) -> Option<[u64; TASK]> {
        if self.words.load(DONE) != 0 {
            return None;
        }
        let ticket = self.words.prefix(HEAD, 1);
        let (turn, empty) = self.place(ticket);
        // Others would be waited for, or the end is there.
        if self.words.load(turn) != empty + 1 {
            return None;
        }
        let task = self.words.load_task(turn + 1);
        self.words.store(turn, empty + TURNS);
        self.words.prefix(SPACE, 1);
        Some(task)
    }

    fn words(&self) -> &W {
        &self.words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tasks_come_back(mut queue: impl Queue, last_first: bool) {
        for round in 0..5 {
            let mut tasks = [1, 2, 3].map(|k| [round, k, 7]);
            assert!(tasks.iter().all(|task| queue.put(task)));
            assert!(!queue.put(&tasks[0]));
            if last_first {
                tasks.reverse();
            }
            assert!(tasks.iter().all(|task| queue.take() == Some(*task)));
        }
        assert_eq!(queue.take(), None);
    }

    /// Catches twins that are no queues: tasks come back in order, a full one says so, and slots are used again.
    #[test]
    fn twins_are_queues() {
        tasks_come_back(List::new(3, |words| words), true);
        tasks_come_back(List::new(3, Told::new), true);
        tasks_come_back(Ring::new(3, |words| words), false);
        tasks_come_back(Ring::new(3, Told::new), false);
    }
}
