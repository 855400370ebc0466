//! The queues that tasks wait in: one for each processor, or one for all.

use crate::cost;
use crate::task::{TASK_WORDS, Task, Words};
use crate::variant::{Grain, Switches};
use isolux_machine::protocols::{DistributedQueues, Full, ParallelQueue, StealCounts, Termination};
use isolux_machine::{Cause, Machine, Mark, MemoryError, Processor, Work};

const QUEUE: Mark = Mark::new(Cause::Queue, "queue");

#[derive(Clone, Copy, Debug)]
enum Kind {
    Distributed(DistributedQueues<TASK_WORDS>),
    Parallel(ParallelQueue<TASK_WORDS>),
}

/// Queues, and the count of tasks that are not finished.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Queues {
    kind: Kind,
    open: Termination,
}

impl Queues {
    pub(crate) fn new<M: Machine>(
        machine: &mut M,
        switches: Switches,
        grain: Grain,
        tasks: u64,
    ) -> Result<Queues, MemoryError> {
        let kind = if switches.parallel_queue {
            Kind::Parallel(ParallelQueue::new(machine, "parallel queue", tasks)?)
        } else {
            Kind::Distributed(DistributedQueues::new(machine, "task queues", grain.queue.into())?)
        };
        Ok(Queues { kind, open: Termination::new(machine, "open tasks", 0)? })
    }

    /// Before a phase that begins with so many tasks: one processor, between two barriers.
    pub(crate) async fn begin<P: Processor>(&self, p: &P, tasks: u64) {
        self.open.reset(p, tasks).await;
    }

    /// Counts tasks before they are put.
    pub(crate) async fn announce<P: Processor>(&self, p: &P, tasks: u64) {
        let before = p.enter(QUEUE);
        self.open.add(p, tasks).await;
        p.enter(before);
    }

    /// Puts a task where it is found: on top of the processor's own queue, or into the one for all.
    pub(crate) async fn put<P: Processor>(&self, p: &P, task: Task) -> Result<(), Full<Words>> {
        self.charge(p).await;
        match &self.kind {
            Kind::Distributed(queues) => queues.push(p, p.id(), task.words()).await,
            Kind::Parallel(queue) => queue.enqueue(p, task.words()).await,
        }
    }

    /// Puts one of a phase's first tasks into a queue of the caller's choice, behind those that are there.
    pub(crate) async fn deal<P: Processor>(&self, p: &P, to: usize, task: Task) -> Result<(), Full<Words>> {
        self.charge(p).await;
        match &self.kind {
            Kind::Distributed(queues) => queues.append(p, to % p.count(), task.words()).await,
            Kind::Parallel(queue) => queue.enqueue(p, task.words()).await,
        }
    }

    /// The next task; `None` when all are finished.
    pub(crate) async fn next<P: Processor>(&self, p: &P, steals: &mut StealCounts) -> Option<Task> {
        let words = match &self.kind {
            Kind::Distributed(queues) => queues.next(p, &self.open, steals).await,
            Kind::Parallel(queue) => queue.next(p, &self.open).await,
        };
        if words.is_some() {
            self.charge(p).await;
        }
        words.map(Task::from_words)
    }

    /// A task is finished.
    pub(crate) async fn finish<P: Processor>(&self, p: &P) {
        let before = p.enter(QUEUE);
        match &self.kind {
            Kind::Distributed(_) => self.open.finish(p).await,
            Kind::Parallel(queue) => queue.finish(p, &self.open).await,
        }
        p.enter(before);
    }

    async fn charge<P: Processor>(&self, p: &P) {
        let before = p.enter(QUEUE);
        p.charge(&Work::of(cost::QUEUE, 1)).await;
        p.enter(before);
    }
}
