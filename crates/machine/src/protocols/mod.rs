//! How processors share work: protocols made of machine operations alone, the same code on every machine. README.md,
//! beside this file, says who may write what, and why each protocol delivers and ends.

mod distributed;
mod parallel_loop;
mod parallel_queue;
mod termination;

pub use distributed::{DistributedQueues, StealCounts};
pub use parallel_loop::{ParallelLoop, parallel_for};
pub use parallel_queue::ParallelQueue;
pub use termination::Termination;

/// A queue that had no room for a task: the caller gets it back and runs it itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full<Task>(pub Task);

/// A task's words as the key of its notes.
fn key<const W: usize>(task: [u64; W]) -> [u64; 4] {
    const { assert!(W <= 4, "a task has at most four words") };
    std::array::from_fn(|i| task.get(i).copied().unwrap_or(0))
}
