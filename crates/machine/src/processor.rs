//! What a processor can do: the trait that programs are written against.

use std::future::Future;

use crate::memory::Address;
use crate::operation::{BarrierId, Condition, LockId, Prefix, Sequence, Work};

/// What a processor's time goes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Cause {
    /// The computation itself.
    Work,
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
    pub const ALL: [Self; 6] = [Self::Work, Self::Queue, Self::Steal, Self::LockWait, Self::BarrierWait, Self::Idle];

    /// Its name in tables and traces.
    pub fn name(self) -> &'static str {
        match self {
            Self::Work => "work",
            Self::Queue => "queue",
            Self::Steal => "steal",
            Self::LockWait => "lock wait",
            Self::BarrierWait => "barrier wait",
            Self::Idle => "idle",
        }
    }
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
/// Between two awaits a program touches only what nobody writes, and what is its own. Whatever another processor may write
/// meanwhile lies in shared words, and is reached by awaited operations alone. Each operation takes effect at one moment
/// between its call's first poll and its end, and all processors agree on the order of all effects. A processor awaits one
/// operation at a time.
///
/// A wrong operation (an address outside all regions, the unlocking of a lock that it does not hold) ends the run with a
/// [`crate::Fault`]; its future never becomes ready.
pub trait Processor {
    /// Its number, from 0.
    fn id(&self) -> usize;

    /// How many processors the machine has.
    fn count(&self) -> usize;

    /// The value of a word.
    fn load(&self, at: Address) -> impl Future<Output = u64>;

    /// Sets a word.
    fn store(&self, at: Address, value: u64) -> impl Future<Output = ()>;

    /// Combines a word with `value` and gives the word from before. Where several processors do the same to one word at the
    /// same time, simulated machines serve them in the order of their numbers.
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

    /// Polls the cells of a sequence in turn until one fulfils the condition; gives the number of that poll in its turn (see
    /// [`Sequence::cell`]).
    fn scan(&self, cells: Sequence, until: Condition) -> impl Future<Output = usize>;

    /// From here on time goes to this mark; gives the one before. Costs nothing. While it waits for a lock, a barrier or a
    /// word, a processor's time goes to the wait.
    fn enter(&self, mark: Mark) -> Mark;
}
