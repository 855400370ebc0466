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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::{CLASSES, COST_MODEL};
    use isolux_simulator::{MachineSpec, Simulator};

    /// What callgrind counted for a queue's twin: ways, words moved and instructions, from the shortest burst of tasks
    /// to the longest.
    fn counted(twin: &str) -> Vec<[u64; 3]> {
        let lines = include_str!("../../calibration/counts.csv").lines();
        let rows = lines.filter_map(|line| line.strip_prefix(&format!("room,queue:{twin},queue="))).map(|row| {
            let mut numbers = row.split([',', ' ']).map(|field| field.trim_start_matches("moved=").parse::<u64>());
            [(); 3].map(|()| numbers.next().expect("three numbers").expect("a number"))
        });
        rows.collect()
    }

    /// Puts tasks in and takes them out on the SB-PRAM with one processor, in 20 rounds as the twins do: words moved,
    /// and units without those of locks.
    fn simulated(parallel_queue: bool, ways: u64) -> [u64; 2] {
        let mut spec = MachineSpec::named("sb-pram").expect("comes along");
        spec.add_work(COST_MODEL, "cost_model.toml").expect("sound figures");
        let mut machine = Simulator::new(&spec, 1, &CLASSES).expect("a machine");
        let switches = Switches { parallel_queue, ..Switches::SB_PRAM };
        let queues = Queues::new(&mut machine, switches, Grain::DEFAULT, 200).expect("has room");
        machine.run(|p| async move { queues.begin(&p, 1).await }).expect("runs");
        let run = machine.run(|p| async move {
            for _ in 0..20 {
                for b in 0..(ways / 40) as u32 {
                    queues.put(&p, Task::Factor { a: 1, b }).await.expect("has room");
                }
                for _ in 0..ways / 40 {
                    queues.next(&p, &mut StealCounts::default()).await.expect("was put");
                }
            }
        });
        let run = run.expect("runs");
        let counts = run.total_counts();
        // Of the machine's file: to take a lock and to give it up is 7.
        let locks = 7 * counts.locks;
        // A multiprefix loads and stores.
        [counts.loads + counts.stores + counts.polls + 2 * counts.prefixes, run.clock - locks]
    }

    /// Catches protocols that move other words than the twins that callgrind counted, a figure that has left what it
    /// was fitted to, and a way that is charged twice or not at all: operations and charges together lie within 15 % of
    /// what callgrind counts, for both kinds of queue.
    #[test]
    fn a_queue_costs_what_callgrind_counts() {
        for (twin, parallel_queue) in [("list", false), ("ring", true)] {
            let rows = counted(twin);
            assert_eq!(rows.len(), 8, "{twin}");
            for [ways, moved, instructions] in rows {
                let [own_moved, units] = simulated(parallel_queue, ways);
                let off = units as f64 / instructions as f64 - 1.0;
                assert_eq!(own_moved, moved, "{twin}, {ways} ways: words");
                assert!(off.abs() < 0.15, "{twin}, {ways} ways: {units} units, {instructions} counted, {off:+.3}");
            }
        }
    }
}
