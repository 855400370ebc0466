//! The contract that every machine fulfils, as checks that take a machine and panic where it breaks a promise.
//! [`crate::contract_suite!`] makes a test of each.
//!
//! A pass says that the promise held in the runs made. On machines whose order of effects varies it does not say that
//! it holds in all.

use crate::machine::{Fault, Machine, RunError, Wait};
use crate::memory::{Home, Region};
use crate::operation::{BarrierId, Condition, LockId, Prefix, Sequence, Work, WorkClass};
use crate::processor::{BLOCK_WORDS, Cause, Mark, Note, Processor};
use crate::protocols::{DistributedQueues, ParallelLoop, ParallelQueue, StealCounts, Termination, parallel_for};
use crate::run::Run;

/// Makes a module `$name` of tests, one for each promise, on machines of each size of `$sizes`. `$make` takes a size
/// and gives a machine with one class of work.
///
/// ```
/// # use isolux_machine::{Threads, contract_suite};
/// contract_suite!(threads, |processors| Threads::new(processors, &["step"]).unwrap(), [1, 4]);
/// ```
#[macro_export]
macro_rules! contract_suite {
    ($name:ident, $make:expr, $sizes:expr) => {
        $crate::contract_suite!(@ $name, $make, $sizes,
            words blocks mutual_exclusion barriers multiprefix no_lost_wake_up scans parallel_loops termination
            distributed_queues ends_of_queues parallel_queue accounts faults abandoned_barriers panics);
    };
    (@ $name:ident, $make:expr, $sizes:expr, $($check:ident)*) => {
        mod $name {
            #[allow(unused_imports)]
            use super::*;
            $(#[test]
            fn $check() {
                for processors in $sizes {
                    $crate::contract::$check(($make)(processors));
                }
            })*
        }
    };
}

fn region<M: Machine>(machine: &mut M, name: &str, words: u64) -> Region {
    machine.allocate(name, words, Home::RoundRobin).expect("a small region fits")
}

fn good<T>(run: Result<Run<T>, RunError>) -> Run<T> {
    run.unwrap_or_else(|e| panic!("the program is sound, the machine says: {e}"))
}

/// Words are zero at first, keep what was stored, also from run to run, and combine as told.
pub fn words<M: Machine>(mut machine: M) {
    let count = machine.count() as u64;
    let own = region(&mut machine, "own", 5 * count);
    let run = machine.run(async |p: M::Processor| {
        let at = |i| own.at(5 * p.id() as u64 + i);
        let first = p.load(at(0)).await;
        p.store(at(0), 6).await;
        let before = [
            p.prefix(Prefix::Add, at(0), 7).await,
            p.prefix(Prefix::And, at(0), 12).await,
            p.prefix(Prefix::Or, at(0), 3).await,
            p.prefix(Prefix::Max, at(0), 14).await,
            p.prefix(Prefix::Max, at(0), 20).await,
            p.prefix(Prefix::Add, at(0), u64::MAX).await,
        ];
        (first, before, p.load(at(0)).await)
    });
    for value in good(run).values {
        assert_eq!(value, (0, [6, 13, 12, 15, 15, 20], 19));
    }
    let again = machine.run(async |p: M::Processor| p.load(own.at(5 * p.id() as u64)).await);
    assert!(good(again).values.iter().all(|&v| v == 19), "words are kept between runs");
    machine.poke(own.at(1), 5);
    assert_eq!((machine.peek(own.at(0)), machine.peek(own.at(1))), (19, 5));
}

/// Blocks reach the words that they name and no others, and count as so many words; what is touched or noted changes nothing.
pub fn blocks<M: Machine>(mut machine: M) {
    let count = machine.count() as u64;
    let own = region(&mut machine, "own", 20 * count);
    let run = machine.run(async |p: M::Processor| {
        let first = 20 * p.id() as u64;
        let words: [u64; BLOCK_WORDS] = std::array::from_fn(|i| first + i as u64 + 1);
        p.store_block(own.at(first + 2), words).await;
        p.touch(own, 20, &[p.id() as u32, 0]).await;
        p.note(Note::Start([first; 4]));
        let all: [u64; BLOCK_WORDS] = p.load_block(own.at(first + 2)).await;
        let some: [u64; 3] = p.load_block(own.at(first + 1)).await;
        let _: [u64; 0] = p.load_block(own.at(first)).await;
        (all == words, some == [0, first + 1, first + 2])
    });
    let run = good(run);
    assert!(run.values.iter().all(|&v| v == (true, true)), "{:?}", run.values);
    let counts = run.total_counts();
    assert_eq!((counts.loads, counts.stores), (19 * count, 16 * count));
    for p in 0..count {
        let words: u64 = [0, 1, 18, 19].map(|i| machine.peek(own.at(20 * p + i))).iter().sum();
        assert_eq!(words, 0, "words beside a block");
    }
}

/// One processor at a time holds a lock, and sees what the last one stored.
pub fn mutual_exclusion<M: Machine>(mut machine: M) {
    const TURNS: u64 = 50;
    let cells = region(&mut machine, "cells", 2);
    let lock = machine.allocate_locks(1);
    let run = machine.run(async |p: M::Processor| {
        let mut alone = true;
        for _ in 0..TURNS {
            p.lock(lock).await;
            alone &= p.prefix(Prefix::Add, cells.at(1), 1).await == 0;
            let sum = p.load(cells.at(0)).await;
            p.store(cells.at(0), sum + 1).await;
            p.prefix(Prefix::Add, cells.at(1), u64::MAX).await;
            p.unlock(lock).await;
        }
        alone
    });
    let run = good(run);
    assert!(run.values.iter().all(|&alone| alone), "two hold one lock");
    assert_eq!(machine.peek(cells.at(0)), TURNS * machine.count() as u64, "an addition under the lock is lost");
    assert_eq!(run.total_counts().locks, TURNS * machine.count() as u64);
}

/// Nobody passes a barrier before all are there, round after round.
pub fn barriers<M: Machine>(mut machine: M) {
    const ROUNDS: u64 = 20;
    let count = machine.count() as u64;
    let round = region(&mut machine, "round", count);
    let barrier = machine.allocate_barriers(1);
    let run = machine.run(async |p: M::Processor| {
        let mut early = 0;
        for r in 1..=ROUNDS {
            p.store(round.at(p.id() as u64), r).await;
            p.barrier(barrier).await;
            for other in 0..count {
                early += u64::from(p.load(round.at(other)).await != r);
            }
            p.barrier(barrier).await;
        }
        early
    });
    let run = good(run);
    assert!(run.values.iter().all(|&early| early == 0), "a barrier lets some through before all are there");
    assert_eq!(run.total_counts().barriers, 2 * ROUNDS * count);
}

/// A group's prefixes are distinct and consecutive; each processor's grow; where time orders them, those of one moment
/// are in the order of the processors.
pub fn multiprefix<M: Machine>(mut machine: M) {
    const TURNS: u64 = 40;
    let count = machine.count() as u64;
    let cell = region(&mut machine, "cell", 1).at(0);
    let run = machine.run(async |p: M::Processor| {
        let mut drawn = vec![];
        for _ in 0..TURNS {
            drawn.push(p.prefix(Prefix::Add, cell, 1).await);
        }
        drawn
    });
    let drawn = good(run).values;
    for (id, mine) in drawn.iter().enumerate() {
        assert!(mine.is_sorted_by(|a, b| a < b), "a later prefix is smaller");
        if M::ORDERED {
            let expected = (0..TURNS).map(|turn| turn * count + id as u64);
            assert!(mine.iter().copied().eq(expected), "processor {id} draws {mine:?}");
        }
    }
    let mut all: Vec<u64> = drawn.concat();
    all.sort_unstable();
    assert!(all.into_iter().eq(0..TURNS * count), "prefixes are missing or there twice");
}

/// A token goes around; everyone waits for it in its word, and nobody sleeps through it.
pub fn no_lost_wake_up<M: Machine>(mut machine: M) {
    const ROUNDS: u64 = 10;
    let count = machine.count() as u64;
    let token = region(&mut machine, "token", 1).at(0);
    let run = machine.run(async |p: M::Processor| {
        for round in 0..ROUNDS {
            let mine = round * count + p.id() as u64;
            let seen = p.wait_while(token, Condition::Differs(mine)).await;
            assert_eq!(seen, mine, "the wait ended while its condition held");
            p.store(token, mine + 1).await;
        }
    });
    let polls = good(run).total_counts().polls;
    assert_eq!(machine.peek(token), ROUNDS * count);
    assert!(polls >= ROUNDS * count, "{polls} polls are counted for {} waits", ROUNDS * count);
}

/// A scan finds what is put into any cell of its ring, and the cell that stands apart.
pub fn scans<M: Machine>(mut machine: M) {
    const ROUNDS: u64 = 5;
    let count = machine.count();
    let ring = region(&mut machine, "ring", 3 * count as u64);
    let taken = region(&mut machine, "taken", 1).at(0);
    let end = region(&mut machine, "end", 1).at(0);
    let total = ROUNDS * count as u64;
    let run = machine.run(async |p: M::Processor| {
        let own = p.id();
        let sequence = Sequence::around(ring.at(0), 3, count, own).and(end);
        // Everyone gives to a neighbour, then all take what there is, until everything is taken.
        p.prefix(Prefix::Add, ring.at(3 * ((own + 1) % count) as u64), ROUNDS).await;
        let mut mine = 0;
        while let Some(cell) = sequence.cell(p.scan(sequence, Condition::Positive).await) {
            let at = ring.at(3 * cell as u64);
            if Condition::Positive.holds(p.prefix(Prefix::Add, at, u64::MAX).await) {
                mine += 1;
                if p.prefix(Prefix::Add, taken, 1).await + 1 == total {
                    p.store(end, 1).await;
                }
            } else {
                p.prefix(Prefix::Add, at, 1).await;
            }
        }
        mine
    });
    assert_eq!(good(run).values.iter().sum::<u64>(), total);
}

/// A parallel loop runs each index once, and again after a reset.
pub fn parallel_loops<M: Machine>(mut machine: M) {
    const END: u64 = 203;
    let ran = region(&mut machine, "ran", END);
    let indices = ParallelLoop::new(&mut machine, "indices").expect("fits");
    let barrier = machine.allocate_barriers(1);
    let run = machine.run(async |p: M::Processor| {
        for chunk in [1, 7, END + 1] {
            parallel_for(&p, &indices, END, chunk, async |index| {
                p.prefix(Prefix::Add, ran.at(index), 1).await;
            })
            .await;
            p.barrier(barrier).await;
            if p.id() == 0 {
                indices.reset(&p).await;
            }
            p.barrier(barrier).await;
        }
    });
    good(run);
    for index in 0..END {
        assert_eq!(machine.peek(ran.at(index)), 3, "runs of index {index}");
    }
}

/// `done` is set once all tasks are finished, those made meanwhile included, and not before.
pub fn termination<M: Machine>(mut machine: M) {
    const DEPTH: u64 = 6;
    let count = machine.count() as u64;
    let finished = region(&mut machine, "finished", 1).at(0);
    let open = Termination::new(&mut machine, "open", count).expect("fits");
    let none = Termination::new(&mut machine, "none", 0).expect("fits");
    let run = machine.run(async |p: M::Processor| {
        // Each processor's task makes one more, which makes one more, ...
        for depth in 0..DEPTH {
            if depth + 1 < DEPTH {
                open.add(&p, 1).await;
            }
            p.prefix(Prefix::Add, finished, 1).await;
            open.finish(&p).await;
        }
        p.wait_while(open.done(), Condition::Equal(0)).await;
        p.wait_while(none.done(), Condition::Equal(0)).await;
        p.load(finished).await
    });
    for seen in good(run).values {
        assert_eq!(seen, DEPTH * count, "done before all tasks are finished");
    }
}

/// A binary tree of tasks: each of `tasks` makes two more.
struct Tree {
    tasks: u64,
    ran: Region,
    open: Termination,
}

impl Tree {
    fn new<M: Machine>(machine: &mut M, tasks: u64) -> Self {
        let ran = region(machine, "ran", tasks);
        Self { tasks, ran, open: Termination::new(machine, "open", 1).expect("fits") }
    }

    /// Runs a task; what no queue takes is run here, too.
    async fn run<P: Processor>(
        &self,
        p: &P,
        task: u64,
        mut put: impl AsyncFnMut(u64) -> bool,
        mut finish: impl AsyncFnMut(),
    ) {
        let mut mine = vec![task];
        while let Some(task) = mine.pop() {
            p.prefix(Prefix::Add, self.ran.at(task), 1).await;
            let children = 2 * task + 1..(2 * task + 3).min(self.tasks);
            self.open.add(p, children.end.saturating_sub(children.start)).await;
            for child in children {
                if !put(child).await {
                    mine.push(child);
                }
            }
            finish().await;
        }
    }

    fn check<M: Machine>(&self, machine: &M, rounds: u64) {
        for task in 0..self.tasks {
            assert_eq!(machine.peek(self.ran.at(task)), rounds, "runs of task {task}");
        }
    }
}

/// Distributed queues deliver each task once, full ones included, and end when all tasks are finished.
pub fn distributed_queues<M: Machine>(mut machine: M) {
    let tree = Tree::new(&mut machine, 300);
    let queues = DistributedQueues::<2>::new(&mut machine, "queues", 3).expect("fits");
    let run = machine.run(async |p: M::Processor| {
        let mut counts = StealCounts::default();
        if p.id() == 0 {
            assert!(queues.append(&p, 0, [0, 7]).await.is_ok());
        }
        while let Some([task, seven]) = queues.next(&p, &tree.open, &mut counts).await {
            assert_eq!(seven, 7, "a task's second word");
            let put = async |child| match child % 3 {
                0 => queues.append(&p, p.id(), [child, 7]).await.is_ok(),
                _ => queues.push(&p, p.id(), [child, 7]).await.is_ok(),
            };
            tree.run(&p, task, put, async || tree.open.finish(&p).await).await;
        }
        (queues.pop(&p).await, counts)
    });
    let run = good(run);
    assert!(run.values.iter().all(|(task, _)| task.is_none()), "a task is left over");
    assert!(machine.count() > 1 || run.values[0].1 == StealCounts::default(), "one processor steals from nobody");
    tree.check(&machine, 1);
}

/// An owner takes from the top, a thief from the tail; what is appended goes to the tail, what is pushed to the top.
pub fn ends_of_queues<M: Machine>(mut machine: M) {
    let queues = DistributedQueues::<1>::new(&mut machine, "queues", 5).expect("fits");
    let barrier = machine.allocate_barriers(1);
    let last = machine.count() - 1;
    let run = machine.run(async |p: M::Processor| {
        let mut counts = StealCounts::default();
        let mut got = vec![];
        if p.id() == 0 {
            for round in 0..2 {
                // From the top: 3, 1, 2, 4; the second time entries are used again.
                let mut full = queues.append(&p, 0, [1]).await.is_err();
                full |= queues.append(&p, 0, [2]).await.is_err();
                full |= queues.push(&p, 0, [3]).await.is_err();
                full |= queues.append(&p, 0, [4]).await.is_err();
                assert!(!full, "four tasks fit into a queue of five");
                while round == 0
                    && let Some([task]) = queues.pop(&p).await
                {
                    got.push(task);
                }
            }
            assert!(queues.push(&p, 0, [5]).await.is_ok());
            assert!(queues.append(&p, 0, [6]).await.is_err() && queues.push(&p, 0, [6]).await.is_err());
        }
        p.barrier(barrier).await;
        if p.id() == last {
            while let Some([task]) = queues.steal(&p, 0, &mut counts).await {
                got.push(task);
            }
        }
        (got, counts)
    });
    let values = good(run).values;
    let (owner, thief) = ([3, 1, 2, 4], [4, 2, 1, 3, 5]);
    assert_eq!(values[0].0[..4], owner, "what the owner takes");
    assert_eq!(values[last].0[values[last].0.len() - 5..], thief, "what the thief takes");
    assert_eq!(values[last].1, StealCounts { successes: 5, failures: 1 });
}

/// The parallel queue delivers each task once, a full one included; each processor is told the end of each phase once,
/// those without any task included.
pub fn parallel_queue<M: Machine>(mut machine: M) {
    let tree = Tree::new(&mut machine, 300);
    let queue = ParallelQueue::<2>::new(&mut machine, "queue", 5).expect("fits");
    let barrier = machine.allocate_barriers(1);
    let run = machine.run(async |p: M::Processor| {
        for roots in [1, 0, 0, 1, 1] {
            if p.id() == 0 {
                tree.open.reset(&p, roots).await;
            }
            p.barrier(barrier).await;
            if p.id() == 0 && roots == 1 {
                assert!(queue.enqueue(&p, [0, 7]).await.is_ok());
            }
            while let Some([task, seven]) = queue.next(&p, &tree.open).await {
                assert_eq!(seven, 7, "a task's second word");
                let put = async |child| queue.enqueue(&p, [child, 7]).await.is_ok();
                tree.run(&p, task, put, async || queue.finish(&p, &tree.open).await).await;
            }
            p.barrier(barrier).await;
        }
    });
    good(run);
    tree.check(&machine, 3);
}

/// Every processor's time adds up to the clock; what it does is counted.
pub fn accounts<M: Machine>(mut machine: M) {
    let count = machine.count() as u64;
    let cell = region(&mut machine, "cell", 1).at(0);
    let lock = machine.allocate_locks(1);
    let run = machine.run(async |p: M::Processor| {
        let start = p.enter(Mark::new(Cause::Queue, "here"));
        for _ in 0..=p.id() {
            p.load(cell).await;
        }
        assert_eq!(p.enter(start), Mark::new(Cause::Queue, "here"));
        p.lock(lock).await;
        p.store(cell, 1).await;
        p.unlock(lock).await;
        p.charge(&Work::of(WorkClass(0), 10)).await;
        p.prefix(Prefix::Or, cell, 2).await;
    });
    let run = good(run);
    for (processor, time) in run.time.iter().enumerate() {
        assert_eq!(time.total(), run.clock, "time of processor {processor}");
        assert!(time.get(Cause::Queue) > 0 && time.get(Cause::Work) > 0, "processor {processor}: {time:?}");
        assert_eq!(time.get(Cause::Steal), 0);
    }
    let counts = run.total_counts();
    assert_eq!((counts.loads, counts.stores, counts.prefixes), (count * (count + 1) / 2, count, count));
    assert_eq!((counts.locks, counts.barriers, counts.polls), (count, 0, 0));
    assert_eq!(counts.work, Work::of(WorkClass(0), 10 * count));
}

/// Wrong operations end the run, and are told by processor and kind; the machine can be used afterwards.
pub fn faults<M: Machine>(mut machine: M) {
    let last = machine.count() - 1;
    let cell = region(&mut machine, "cell", 1).at(0);
    let lock = machine.allocate_locks(1);
    let mut elsewhere = crate::Layout::default();
    let outside = elsewhere.allocate("far", 1 << 20, Home::RoundRobin, 1).expect("fits").at((1 << 20) - 1);
    let mut check = |case: usize, expected: Fault| {
        let run = machine.run(async |p: M::Processor| {
            if p.id() < p.count() - 1 {
                // The others wait in every possible way, for what does not come.
                match p.id() % 3 {
                    0 => drop(p.wait_while(cell, Condition::Equal(0)).await),
                    1 => drop(p.scan(Sequence::one(cell), Condition::Positive).await),
                    _ => p.load(cell).await.checked_sub(1).map_or((), drop),
                }
                return;
            }
            match case {
                0 => drop(p.load(outside).await),
                1 => p.store(outside, 1).await,
                2 => drop(p.prefix(Prefix::Max, outside, 1).await),
                3 => drop(p.wait_while(outside, Condition::Equal(1)).await),
                4 => drop(p.scan(Sequence::one(cell).and(outside), Condition::Positive).await),
                5 => drop(p.scan(Sequence::around(cell, 0, 1, 0), Condition::Positive).await),
                6 => p.unlock(lock).await,
                7 => {
                    p.lock(lock).await;
                    p.lock(lock).await;
                }
                8 => p.lock(LockId(9)).await,
                9 => p.barrier(BarrierId(9)).await,
                10 => p.charge(&Work::of(WorkClass(1), 1)).await,
                _ => std::future::pending().await,
            }
        });
        assert_eq!(run.err(), Some(RunError::Fault { processor: last, fault: expected }), "case {case}");
    };
    for case in 0..5 {
        check(case, Fault::Address(outside));
    }
    check(5, Fault::Sequence);
    check(6, Fault::NotHeld(lock));
    check(7, Fault::HeldAlready(lock));
    check(8, Fault::NoLock(LockId(9)));
    check(9, Fault::NoBarrier(BarrierId(9)));
    check(10, Fault::NoWorkClass(WorkClass(1)));
    check(11, Fault::Foreign);
    mutual_exclusion_after(machine, lock);
}

/// A lock that was held when a run broke off is free in the next.
fn mutual_exclusion_after<M: Machine>(mut machine: M, lock: LockId) {
    good(machine.run(async |p: M::Processor| {
        p.lock(lock).await;
        p.unlock(lock).await;
    }));
}

/// Waiting at a barrier that one will not reach is a deadlock, and told as one.
pub fn abandoned_barriers<M: Machine>(mut machine: M) {
    if machine.count() == 1 {
        return;
    }
    let barrier = machine.allocate_barriers(2);
    let run = machine.run(async |p: M::Processor| {
        p.barrier(barrier).await;
        if p.id() == 1 {
            p.barrier(BarrierId(barrier.0 + 1)).await;
        }
    });
    let wait = Wait::Barrier(BarrierId(barrier.0 + 1));
    assert_eq!(run.err(), Some(RunError::Deadlock { processor: 1, wait }));
}

/// A program's panic goes on in the caller, whoever waits for the one that panics.
pub fn panics<M: Machine>(mut machine: M) {
    let last = machine.count() - 1;
    let barrier = machine.allocate_barriers(1);
    let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        machine.run(async |p: M::Processor| {
            assert!(p.id() != last, "the last one gives up");
            p.barrier(barrier).await;
        })
    }));
    let panic = caught.expect_err("the panic comes out of the run");
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    assert_eq!(text, Some("the last one gives up"));
    good(machine.run(async |p: M::Processor| p.barrier(barrier).await));
}
