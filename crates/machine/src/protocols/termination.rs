//! When all tasks are finished, those that tasks made included: a count of open tasks, and a word that says so.

use crate::machine::Machine;
use crate::memory::{Address, Home, MemoryError};
use crate::operation::Prefix;
use crate::processor::Processor;

/// The count of open tasks.
#[derive(Clone, Copy, Debug)]
pub struct Termination {
    open: Address,
    done: Address,
}

impl Termination {
    /// With so many tasks to begin with. With none, all are finished at once.
    ///
    /// # Errors
    ///
    /// When there is no room for its words.
    pub fn new<M: Machine>(machine: &mut M, name: &str, open: u64) -> Result<Self, MemoryError> {
        let region = machine.allocate(name, 2, Home::At(0))?;
        let it = Self { open: region.at(0), done: region.at(1) };
        machine.poke(it.open, open);
        machine.poke(it.done, u64::from(open == 0));
        Ok(it)
    }

    /// Counts tasks that are about to be made. Before anyone can find them.
    pub async fn add<P: Processor>(&self, p: &P, tasks: u64) {
        if tasks > 0 {
            p.prefix(Prefix::Add, self.open, tasks).await;
        }
    }

    /// One task is finished, and has made what it makes.
    pub async fn finish<P: Processor>(&self, p: &P) {
        if self.take(p).await {
            p.store(self.done, 1).await;
        }
    }

    /// Takes a finished task from the count: whether it was the last one.
    pub(super) async fn take<P: Processor>(&self, p: &P) -> bool {
        p.prefix(Prefix::Add, self.open, u64::MAX).await == 1
    }

    /// Begins anew with so many tasks. One processor calls it, between two barriers.
    pub async fn reset<P: Processor>(&self, p: &P, open: u64) {
        p.store(self.open, open).await;
        p.store(self.done, u64::from(open == 0)).await;
    }

    /// The word that becomes positive when all tasks are finished, for scans.
    pub fn done(&self) -> Address {
        self.done
    }
}
