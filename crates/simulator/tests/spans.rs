//! The longest chain of work: known by hand for small programs, by recursion for random trees of tasks.

#![allow(clippy::unwrap_used)]

use isolux_machine::protocols::{
    DistributedQueues, ParallelLoop, ParallelQueue, StealCounts, Termination, parallel_for,
};
use isolux_machine::{Cause, Condition, Home, Machine, Mark, Note, Prefix, Processor, Run, RunError, Work, WorkClass};
use isolux_simulator::{MachineSpec, Polling, SimulatedProcessor, Simulator};
use proptest::prelude::*;

const OTHER: Mark = Mark::new(Cause::Queue, "other");
const WORK: Mark = Mark::new(Cause::Work, "work");

fn machine(mut spec: MachineSpec, processors: usize) -> Simulator {
    spec.add_work("[work]\nstep = 1", "test").unwrap();
    Simulator::new(&spec, processors, &["step"]).unwrap()
}

async fn steps(p: &SimulatedProcessor, count: u64) {
    let before = p.enter(WORK);
    p.charge(&Work::of(WorkClass(0), count)).await;
    p.enter(before);
}

/// A key of no words but the first.
fn key(name: u64) -> [u64; 4] {
    [name, 0, 0, 0]
}

/// Catches waiting, overhead or others' work that is taken for part of a chain, and a chain that a barrier cuts.
#[test]
fn chains_go_through_barriers_and_not_through_waits() {
    let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), 3);
    let barrier = machine.allocate_barriers(1);
    let run = machine
        .run(async |p: SimulatedProcessor| {
            p.enter(OTHER);
            steps(&p, [10, 20, 5][p.id()]).await;
            p.barrier(barrier).await;
            steps(&p, [7, 1, 3][p.id()]).await;
        })
        .unwrap();
    assert_eq!((run.span, run.work()), (20 + 7, 10 + 20 + 5 + 7 + 1 + 3));
}

/// Catches a fork that depends on what its parent did later, a join that forgets a branch, and a chain that is left for
/// another task and forgotten.
#[test]
fn forks_and_joins_hang_together_as_noted() {
    let mut machine = machine(MachineSpec::named("ideal").unwrap(), 2);
    let flag = machine.allocate("flag", 3, Home::RoundRobin).unwrap();
    let run = machine
        .run(async |p: SimulatedProcessor| {
            p.enter(OTHER);
            if p.id() == 0 {
                steps(&p, 10).await;
                p.note(Note::Spawn(key(1)));
                p.store(flag.at(0), 1).await;
                steps(&p, 4).await;
                p.note(Note::Join(key(9)));
                p.store(flag.at(1), 1).await;
                // Another task, of which nothing is known: it depends on nothing. The chain of 14 is left.
                p.note(Note::Start(key(5)));
                steps(&p, 2).await;
            } else {
                steps(&p, 3).await;
                p.wait_while(flag.at(0), Condition::Equal(0)).await;
                p.note(Note::Start(key(1)));
                steps(&p, 1).await;
                p.note(Note::Join(key(9)));
                p.wait_while(flag.at(1), Condition::Equal(0)).await;
                p.note(Note::Resume(key(9)));
                steps(&p, 100).await;
            }
        })
        .unwrap();
    assert_eq!(run.span, 10 + 4 + 100);
    // Nothing is left of one run in the next.
    let again = machine.run(async |p: SimulatedProcessor| p.note(Note::Resume(key(9)))).unwrap();
    assert_eq!(again.span, 0);
}

/// Catches indices of a loop that are taken for a chain, a loop within a loop that loses the outer one, and what comes
/// behind a loop without it.
#[test]
fn loops_are_as_long_as_their_longest_index() {
    for processors in [1, 2, 5] {
        let mut machine = machine(MachineSpec::named("ideal").unwrap(), processors);
        let indices = ParallelLoop::new(&mut machine, "indices").unwrap();
        let barrier = machine.allocate_barriers(1);
        let run = machine
            .run(async |p: SimulatedProcessor| {
                p.enter(OTHER);
                steps(&p, 3).await;
                parallel_for(&p, &indices, 40, 3, async |i| {
                    steps(&p, i % 7).await;
                    p.note(Note::LoopBegin);
                    for inner in 0..3 {
                        p.note(Note::LoopIndex);
                        steps(&p, inner).await;
                    }
                    p.note(Note::LoopEnd);
                    steps(&p, 1).await;
                })
                .await;
                p.barrier(barrier).await;
                steps(&p, 20).await;
            })
            .unwrap();
        assert_eq!(run.span, 3 + (6 + 2 + 1) + 20, "{processors} processors");
    }
}

/// Catches notes against the course of time that pass as a longest chain.
#[test]
fn impossible_chains_are_told() {
    let mut machine = machine(MachineSpec::named("ideal").unwrap(), 2);
    let run = machine.run(async |p: SimulatedProcessor| {
        if p.id() == 0 {
            // Its clock runs ahead; the others start at 0 with what has not been done yet.
            steps(&p, 10).await;
            p.note(Note::Spawn(key(1)));
        } else {
            p.note(Note::Start(key(1)));
            steps(&p, 10).await;
        }
    });
    assert_eq!(run.err(), Some(RunError::Span { span: 20, clock: 10 }));
}

/// A tree of tasks: the parent of each but the first, and the work of each before it makes its children.
#[derive(Clone, Debug)]
struct Tree {
    parents: Vec<usize>,
    work: Vec<u64>,
}

impl Tree {
    fn span(&self) -> u64 {
        let mut ends = self.work.clone();
        for task in 1..ends.len() {
            ends[task] += ends[self.parents[task]];
        }
        ends.into_iter().max().unwrap_or(0)
    }

    fn children(&self, task: u64) -> impl Iterator<Item = u64> {
        let mine = move |&t: &usize| self.parents[t] as u64 == task;
        (1..self.parents.len()).filter(mine).map(|t| t as u64)
    }
}

fn trees() -> impl Strategy<Value = Tree> {
    prop::collection::vec((any::<prop::sample::Index>(), 0..50u64), 1..40).prop_map(|tasks| Tree {
        parents: tasks.iter().enumerate().map(|(task, (parent, _))| parent.index(task.max(1))).collect(),
        work: tasks.iter().map(|t| t.1).collect(),
    })
}

/// Runs a tree through the parallel queue, or through distributed ones.
fn run(tree: &Tree, processors: usize, polling: Polling, parallel: bool) -> Run<()> {
    let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), processors).polling(polling);
    let queue = ParallelQueue::<2>::new(&mut machine, "queue", 64).unwrap();
    let queues = DistributedQueues::<2>::new(&mut machine, "queues", 64).unwrap();
    let open = Termination::new(&mut machine, "open", 1).unwrap();
    machine
        .run(async |p: SimulatedProcessor| {
            p.enter(OTHER);
            let put = async |task: u64| match (parallel, task % 2) {
                (true, _) => queue.enqueue(&p, [task, 1]).await.is_ok(),
                (false, 0) => queues.append(&p, p.id(), [task, 1]).await.is_ok(),
                (false, _) => queues.push(&p, p.id(), [task, 1]).await.is_ok(),
            };
            if p.id() == 0 {
                assert!(put(0).await);
            }
            let mut counts = StealCounts::default();
            loop {
                let next =
                    if parallel { queue.next(&p, &open).await } else { queues.next(&p, &open, &mut counts).await };
                let Some([task, _]) = next else { break };
                steps(&p, tree.work[task as usize]).await;
                for child in tree.children(task) {
                    open.add(&p, 1).await;
                    assert!(put(child).await);
                }
                if parallel {
                    queue.finish(&p, &open).await
                } else {
                    open.finish(&p).await
                };
            }
        })
        .unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Catches a span that depends on the number of processors, on the queue or on how waiting is simulated, and a run
    /// that is faster than its span or its work allow.
    #[test]
    fn trees_of_tasks_have_the_span_of_their_longest_branch(tree in trees()) {
        for (processors, parallel) in [(1, true), (1, false), (3, true), (3, false), (16, true), (16, false)] {
            let run_with = |polling| run(&tree, processors, polling, parallel);
            let it = run_with(Polling::ClosedForm);
            prop_assert_eq!((it.span, it.work()), (tree.span(), tree.work.iter().sum::<u64>()));
            prop_assert!(it.clock >= it.span.max(it.work().div_ceil(processors as u64)));
            prop_assert_eq!(it, run_with(Polling::EveryPoll));
        }
    }
}

/// Catches an end of a phase that goes from processor to processor in a chain, or wakes more than it needs: time and
/// events after the only task, and in a phase without any.
#[test]
fn the_parallel_queue_ends_in_a_logarithm_of_steps() {
    for (processors, log) in [(16, 4), (1024, 10), (16_384, 14)] {
        let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), processors);
        let queue = ParallelQueue::<1>::new(&mut machine, "queue", processors as u64).unwrap();
        let open = Termination::new(&mut machine, "open", 1).unwrap();
        let barrier = machine.allocate_barriers(1);
        let phase = async |p: SimulatedProcessor| {
            if p.id() == 1 {
                steps(&p, 1000).await;
                queue.enqueue(&p, [0]).await.unwrap();
            }
            while queue.next(&p, &open).await.is_some() {
                queue.finish(&p, &open).await;
            }
            p.barrier(barrier).await;
        };
        let run = machine.run(phase).unwrap();
        // A level of the tree: a poll of 3 that sees, two more stores, a load, a poll and a store for each of two
        // children.
        assert!(run.clock <= 1000 + 50 + 15 * log, "{processors} processors: {}", run.clock);
        assert!(machine.events() <= 20 * processors as u64 + 50, "{processors} processors: {}", machine.events());
        // One more without a task: the same machine, the same queue.
        machine
            .run(async |p: SimulatedProcessor| {
                if p.id() == 0 {
                    open.reset(&p, 0).await
                }
            })
            .unwrap();
        let empty = machine.run(async |p: SimulatedProcessor| queue.next(&p, &open).await).unwrap();
        assert!(empty.values.iter().all(Option::is_none) && empty.clock == 1);
    }
}

/// Catches blocks that are read or written in more than one moment, cost other than their words, or reach outside.
#[test]
fn blocks_take_effect_at_once_and_cost_their_words() {
    for polling in [Polling::ClosedForm, Polling::EveryPoll] {
        let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), 3).polling(polling);
        let words = machine.allocate("words", 512, Home::RoundRobin).unwrap();
        let run = machine
            .run(async |p: SimulatedProcessor| match p.id() {
                0 => {
                    for round in 1..=50 {
                        p.store_block(words.at(10), [round; 16]).await;
                    }
                    Default::default()
                }
                1 => {
                    p.wait_while(words.at(25), Condition::Below(20)).await;
                    p.prefix(Prefix::Add, words.at(100), 0).await;
                    p.load_block::<16>(words.at(10)).await
                }
                _ => {
                    let _: [u64; 0] = p.load_block(words.at(0)).await;
                    p.store_block(words.at(0), []).await;
                    Default::default()
                }
            })
            .unwrap();
        assert!(run.values[1][0] >= 20 && run.values[1].iter().all(|&w| w == run.values[1][0]));
        assert_eq!((run.counts[0].stores, run.counts[1].loads, run.clock), (800, 16, 800));
        assert_eq!((run.counts[2], run.values[2]), Default::default());
        let outside = machine.run(async |p: SimulatedProcessor| {
            if p.id() == 1 {
                p.load_block::<16>(words.at(500)).await;
            }
        });
        assert!(matches!(outside, Err(RunError::Fault { processor: 1, .. })), "{outside:?}");
    }
}
