//! What a machine is: words, locks and barriers to be had from it, and programs to be run on it; and what may go wrong.

use std::future::Future;

use thiserror::Error;

use crate::memory::{Address, Home, Layout, MemoryError, Region};
use crate::operation::{BarrierId, LockId, Work, WorkClass};
use crate::processor::Processor;
use crate::run::Run;

/// A wrong operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Fault {
    /// An address that the machine did not give out.
    #[error("word {} is in no region", .0.word())]
    Address(Address),
    /// A lock that the machine did not give out.
    #[error("there is no lock {}", .0.0)]
    NoLock(LockId),
    /// A barrier that the machine did not give out.
    #[error("there is no barrier {}", .0.0)]
    NoBarrier(BarrierId),
    /// A lock given up by one who does not hold it.
    #[error("lock {} is given up by a processor that does not hold it", .0.0)]
    NotHeld(LockId),
    /// A lock taken by one who holds it.
    #[error("lock {} is taken by a processor that holds it already", .0.0)]
    HeldAlready(LockId),
    /// Work of a class that the machine has no name for.
    #[error("there is no class {} of work", .0.0)]
    NoWorkClass(WorkClass),
    /// A scan over no cells, or over some twice.
    #[error("a scan over a senseless sequence of cells")]
    Sequence,
    /// The program waits for what is no operation of the machine, or for two at a time.
    #[error("the program awaits something else than one operation of its processor")]
    Foreign,
    /// The clock went beyond its range.
    #[error("the clock overflows")]
    Clock,
}

/// What a processor may wait for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// A lock.
    Lock(LockId),
    /// The others, at a barrier.
    Barrier(BarrierId),
    /// A word to change, the first one it polls.
    Word(Address),
}

/// Why a program did not run to its end. A panic of the program is none of these: it goes on in the caller of
/// [`Machine::run`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RunError {
    /// A wrong operation.
    #[error("processor {processor}: {fault}")]
    Fault {
        /// Who did it.
        processor: usize,
        /// What was wrong.
        fault: Fault,
    },
    /// All that have not ended wait, and nobody is left to end it.
    #[error("deadlock: processor {processor} waits for ever for {wait:?}")]
    Deadlock {
        /// The first one that waits.
        processor: usize,
        /// For what.
        wait: Wait,
    },
    /// The caller stopped it.
    #[error("stopped")]
    Stopped,
    /// A machine's own error: a processor's time does not add up.
    #[error("processor {processor}: its time adds up to {sum}, the clock says {clock}")]
    Accounting {
        /// Whose.
        processor: usize,
        /// The sum over all causes.
        sum: u64,
        /// What it should be.
        clock: u64,
    },
    /// A chain of work that is longer than the run: the program's notes say that work depends on what came after it.
    #[error("a chain of work takes {span}, the clock says {clock}: the program's notes contradict its course")]
    Span {
        /// How long the chain is.
        span: u64,
        /// When the run ended.
        clock: u64,
    },
}

/// Why a machine of such a size or with such classes of work cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ClassError {
    /// No processors, or more than the machine can have.
    #[error("{asked} processors; the machine has 1 to {max}")]
    Processors {
        /// What was asked for.
        asked: usize,
        /// The most there can be.
        max: usize,
    },
    /// More classes of work than [`Work`] counts.
    #[error("{asked} classes of work; there are at most {}", Work::CLASSES_MAX)]
    TooMany {
        /// How many there were.
        asked: usize,
    },
    /// A name that stands for two classes.
    #[error("two classes of work are named {name:?}")]
    Duplicate {
        /// The name.
        name: String,
    },
}

/// Checks the size and the classes of work that a machine is asked for.
///
/// # Errors
///
/// Names what is wrong.
pub fn check_request(processors: usize, max: usize, classes: &[&str]) -> Result<(), ClassError> {
    if processors == 0 || processors > max {
        return Err(ClassError::Processors { asked: processors, max });
    }
    if classes.len() > Work::CLASSES_MAX {
        return Err(ClassError::TooMany { asked: classes.len() });
    }
    match classes.iter().enumerate().find(|(i, name)| classes[..*i].contains(name)) {
        Some((_, name)) => Err(ClassError::Duplicate { name: (*name).to_owned() }),
        None => Ok(()),
    }
}

/// What runs programs: some processors that share words, locks and barriers. The words keep their values from one run
/// to the next; they are zero at first.
pub trait Machine {
    /// Its processors.
    type Processor: Processor;

    /// Whether operations have times that are the same for all processors, and those of one time take effect in the
    /// order of the processors' numbers. Where caches decide what an operation takes, times differ.
    const ORDERED: bool;

    /// How many processors it has.
    fn count(&self) -> usize;

    /// New words, all zero.
    ///
    /// # Errors
    ///
    /// Says why there is no such region.
    fn allocate(&mut self, name: &str, words: u64, home: Home) -> Result<Region, MemoryError>;

    /// Where the words are.
    fn layout(&self) -> &Layout;

    /// New locks with consecutive numbers, the first of which is given. Nobody holds them.
    fn allocate_locks(&mut self, count: u32) -> LockId;

    /// New barriers with consecutive numbers, the first of which is given.
    fn allocate_barriers(&mut self, count: u32) -> BarrierId;

    /// A word's value while nothing runs; zero outside all regions.
    fn peek(&self, at: Address) -> u64;

    /// Sets a word while nothing runs.
    ///
    /// # Panics
    ///
    /// When the address is in no region of this machine.
    fn poke(&mut self, at: Address, value: u64);

    /// Runs a program on all processors until all have ended. Locks are free and barriers empty at the start.
    ///
    /// # Errors
    ///
    /// Says which processor did something wrong or waits for ever. Real threads notice only some of the waits that
    /// never end: barriers that another will not reach.
    fn run<T, F, R>(&mut self, program: F) -> Result<Run<T>, RunError>
    where
        F: Fn(Self::Processor) -> R + Sync,
        R: Future<Output = T>,
        T: Send;
}
