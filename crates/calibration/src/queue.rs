//! The scalar twin of a task queue: a list in an array of words, as a program for parallel machines keeps it in shared
//! memory, without the waiting.

/// Words of a task, as many as name a kind, two elements and a position.
pub(crate) const TASK: usize = 4;

const FREE: usize = 0;
const HEAD: usize = 1;
const TAIL: usize = 2;
const LENGTH: usize = 3;
const SLOTS: usize = 4;
/// A slot: the index of the next one (0: none), then the task.
const SLOT: usize = 1 + TASK;

/// A list of tasks and a list of free slots; last in, first out.
pub(crate) struct Queue {
    words: Vec<u64>,
}

impl Queue {
    pub(crate) fn new(slots: usize) -> Queue {
        let mut words = vec![0; SLOTS + slots * SLOT];
        for slot in (0..slots).rev().map(|slot| SLOTS + slot * SLOT) {
            words[slot] = words[FREE];
            words[FREE] = slot as u64;
        }
        Queue { words }
    }

    /// False where it is full.
    #[inline(never)]
    pub(crate) fn push(&mut self, task: &[u64; TASK]) -> bool {
        let words = &mut self.words[..];
        let slot = words[FREE];
        if slot == 0 {
            return false;
        }
        let at = slot as usize;
        words[FREE] = words[at];
        words[at] = words[HEAD];
        words[at + 1..at + SLOT].copy_from_slice(task);
        if words[HEAD] == 0 {
            words[TAIL] = slot;
        }
        words[HEAD] = slot;
        words[LENGTH] += 1;
        true
    }

    #[inline(never)]
    pub(crate) fn pop(&mut self) -> Option<[u64; TASK]> {
        let words = &mut self.words[..];
        let slot = words[HEAD];
        if slot == 0 {
            return None;
        }
        let at = slot as usize;
        words[HEAD] = words[at];
        if words[at] == 0 {
            words[TAIL] = 0;
        }
        let mut task = [0; TASK];
        task.copy_from_slice(&words[at + 1..at + SLOT]);
        words[at] = words[FREE];
        words[FREE] = slot;
        words[LENGTH] -= 1;
        Some(task)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches a twin that is no queue: tasks come back last in, first out, a full one says so, and slots are used
    /// again.
    #[test]
    fn tasks_come_back() {
        let mut queue = Queue::new(3);
        for round in 0..5 {
            let tasks = [1, 2, 3].map(|k| [round, k, 0, 7]);
            assert!(tasks.iter().all(|task| queue.push(task)));
            assert!(!queue.push(&tasks[0]));
            assert!(tasks.iter().rev().all(|task| queue.pop() == Some(*task)));
            assert_eq!(queue.pop(), None);
        }
    }
}
