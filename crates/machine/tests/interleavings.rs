//! The protocols under a model checker that chooses who goes next before every operation. It tries many orders of
//! effects, not all; a pass says that none of those tried breaks a promise. All effects have one order, as every
//! machine promises.

#![allow(clippy::unwrap_used)]

use std::cell::Cell;
use std::future::Future;
use std::pin::pin;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};

use isolux_machine::protocols::{
    DistributedQueues, ParallelLoop, ParallelQueue, StealCounts, Termination, parallel_for,
};
use isolux_machine::{
    Address, BarrierId, Cause, ClockUnit, Condition, Home, Layout, LockId, Machine, Mark, MemoryError, Prefix,
    Processor, Region, Run, RunError, Sequence, Work,
};
use shuttle::sync::atomic::{AtomicU64, Ordering::SeqCst};
use shuttle::thread;

/// Words for what the tests below allocate: a handful of pages.
const WORDS: usize = 10 * 512;

struct Shared {
    words: Vec<AtomicU64>,
    locks: Vec<AtomicU64>,
}

/// A machine whose words and locks belong to the model checker.
struct Checked {
    count: usize,
    layout: Layout,
    locks: u32,
    shared: Arc<Shared>,
}

impl Checked {
    fn new(count: usize) -> Self {
        let zero = |n| (0..n).map(|_| AtomicU64::new(0)).collect();
        let shared = Arc::new(Shared { words: zero(WORDS), locks: zero(8) });
        Self { count, layout: Layout::default(), locks: 0, shared }
    }
}

struct CheckedProcessor {
    id: usize,
    count: usize,
    shared: Arc<Shared>,
    mark: Cell<Mark>,
}

impl CheckedProcessor {
    fn cell(&self, at: Address) -> &AtomicU64 {
        &self.shared.words[at.word() as usize]
    }
}

impl Processor for CheckedProcessor {
    fn id(&self) -> usize {
        self.id
    }

    fn count(&self) -> usize {
        self.count
    }

    async fn load(&self, at: Address) -> u64 {
        self.cell(at).load(SeqCst)
    }

    async fn store(&self, at: Address, value: u64) {
        self.cell(at).store(value, SeqCst);
    }

    async fn prefix(&self, op: Prefix, at: Address, value: u64) -> u64 {
        self.cell(at).fetch_update(SeqCst, SeqCst, |word| Some(op.apply(word, value))).unwrap()
    }

    async fn lock(&self, lock: LockId) {
        while self.shared.locks[lock.0 as usize].swap(1, SeqCst) == 1 {
            thread::yield_now();
        }
    }

    async fn unlock(&self, lock: LockId) {
        self.shared.locks[lock.0 as usize].store(0, SeqCst);
    }

    async fn barrier(&self, barrier: BarrierId) {
        panic!("no protocol uses {barrier:?}");
    }

    async fn charge(&self, _: &Work) {}

    async fn wait_while(&self, at: Address, condition: Condition) -> u64 {
        loop {
            let word = self.cell(at).load(SeqCst);
            if !condition.holds(word) {
                return word;
            }
            thread::yield_now();
        }
    }

    async fn scan(&self, cells: Sequence, until: Condition) -> usize {
        loop {
            for k in 0..cells.period() {
                if until.holds(self.cell(cells.at(k)).load(SeqCst)) {
                    return k;
                }
            }
            thread::yield_now();
        }
    }

    fn enter(&self, mark: Mark) -> Mark {
        self.mark.replace(mark)
    }
}

impl Machine for Checked {
    type Processor = CheckedProcessor;
    const ORDERED: bool = false;

    fn count(&self) -> usize {
        self.count
    }

    fn allocate(&mut self, name: &str, words: u64, home: Home) -> Result<Region, MemoryError> {
        self.layout.allocate(name, words, home, self.count)
    }

    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn allocate_locks(&mut self, count: u32) -> LockId {
        self.locks += count;
        LockId(self.locks - count)
    }

    fn allocate_barriers(&mut self, _: u32) -> BarrierId {
        panic!("no protocol uses barriers");
    }

    fn peek(&self, at: Address) -> u64 {
        self.shared.words[at.word() as usize].load(SeqCst)
    }

    fn poke(&mut self, at: Address, value: u64) {
        self.shared.words[at.word() as usize].store(value, SeqCst);
    }

    fn run<T, F, R>(&mut self, program: F) -> Result<Run<T>, RunError>
    where
        F: Fn(Self::Processor) -> R + Sync,
        R: Future<Output = T>,
        T: Send,
    {
        let (count, shared, program) = (self.count, &self.shared, &program);
        let values = thread::scope(|scope| {
            let threads: Vec<_> = (0..count)
                .map(|id| {
                    scope.spawn(move || {
                        let mark = Cell::new(Mark::new(Cause::Work, "start"));
                        let p = CheckedProcessor { id, count, shared: Arc::clone(shared), mark };
                        match pin!(program(p)).poll(&mut Context::from_waker(Waker::noop())) {
                            Poll::Ready(value) => value,
                            Poll::Pending => panic!("all operations are ready at once"),
                        }
                    })
                })
                .collect();
            threads.into_iter().map(|t| t.join().unwrap()).collect()
        });
        Ok(Run { values, clock: 0, unit: ClockUnit::Operations, time: vec![], counts: vec![], span: 0 })
    }
}

/// Tries orders: at random, and such as need few changes of processor at the wrong moment (priorities that change at so
/// many places).
fn in_many_orders(body: fn()) {
    shuttle::check_random(body, 1500);
    shuttle::check_pct(body, 1500, 3);
}

/// A chain of tasks and its side branches, run with a queue; each task must run once.
macro_rules! delivers {
    ($processors:expr, $tasks:expr, $make:expr, $put:expr, $next:expr, $finish:expr) => {
        in_many_orders(|| {
            let mut machine = Checked::new($processors);
            let open = Termination::new(&mut machine, "open", 1).unwrap();
            let ran = machine.allocate("ran", $tasks, Home::RoundRobin).unwrap();
            let queue = $make(&mut machine);
            machine
                .run(async |p: CheckedProcessor| {
                    if p.id() == 0 {
                        assert!($put(&queue, &p, 0).await);
                    }
                    while let Some([task]) = $next(&queue, &p, &open).await {
                        let mut mine = vec![task];
                        while let Some(task) = mine.pop() {
                            assert_eq!(p.prefix(Prefix::Add, ran.at(task), 1).await, 0, "task {task} runs twice");
                            let children = 2 * task + 1..(2 * task + 3).min($tasks);
                            open.add(&p, children.end.saturating_sub(children.start)).await;
                            for child in children {
                                if !$put(&queue, &p, child).await {
                                    mine.push(child);
                                }
                            }
                            $finish(&queue, &p, &open).await;
                        }
                    }
                })
                .unwrap();
            for task in 0..$tasks {
                assert_eq!(machine.peek(ran.at(task)), 1, "task {task}");
            }
        });
    };
}

/// Catches a task lost or run twice between an owner and thieves, a list broken under its lock, and a wait for ever.
#[test]
fn distributed_queues_deliver_each_task_once() {
    delivers!(
        3,
        5,
        |m: &mut Checked| DistributedQueues::<1>::new(m, "queues", 2).unwrap(),
        async |q: &DistributedQueues<1>, p: &CheckedProcessor, task| match task % 2 {
            0 => q.push(p, p.id(), [task]).await.is_ok(),
            _ => q.append(p, p.id(), [task]).await.is_ok(),
        },
        async |q: &DistributedQueues<1>, p: &CheckedProcessor, open: &Termination| {
            q.next(p, open, &mut StealCounts::default()).await
        },
        async |_: &DistributedQueues<1>, p: &CheckedProcessor, open: &Termination| open.finish(p).await
    );
}

/// Catches slots used by two tasks at a time, tickets without a task or an end, and a wait for ever; two slots make
/// every wait occur.
#[test]
fn the_parallel_queue_delivers_each_task_once() {
    macro_rules! with_slots {
        ($processors:expr, $slots:expr) => {
            delivers!(
                $processors,
                5,
                |m: &mut Checked| ParallelQueue::<1>::new(m, "queue", $slots).unwrap(),
                async |q: &ParallelQueue<1>, p: &CheckedProcessor, task| q.enqueue(p, [task]).await.is_ok(),
                async |q: &ParallelQueue<1>, p: &CheckedProcessor, open: &Termination| q.next(p, open).await,
                async |q: &ParallelQueue<1>, p: &CheckedProcessor, open: &Termination| q.finish(p, open).await
            );
        };
    }
    with_slots!(3, 1);
    with_slots!(3, 2);
    with_slots!(4, 8);
}

/// Catches an end that is told twice or to nobody, and tickets of one phase that are left to the next: phases of no
/// task, one and three, on fewer slots than there are processors.
#[test]
fn phases_of_the_parallel_queue_end_and_leave_it_empty() {
    in_many_orders(|| {
        let mut machine = Checked::new(4);
        let open = Termination::new(&mut machine, "open", 0).unwrap();
        let ran = machine.allocate("ran", 1, Home::RoundRobin).unwrap().at(0);
        let queue = ParallelQueue::<1>::new(&mut machine, "queue", 3).unwrap();
        for (phase, tasks) in [0, 1, 0, 3].into_iter().enumerate() {
            // Runs stand for what lies between two barriers.
            machine
                .run(async |p: CheckedProcessor| {
                    if p.id() == 0 {
                        open.reset(&p, tasks).await;
                    }
                })
                .unwrap();
            let run = machine
                .run(async |p: CheckedProcessor| {
                    let mut mine = 0;
                    let made = tasks * u64::from(p.id() == 0);
                    for task in 0..made {
                        assert!(queue.enqueue(&p, [task]).await.is_ok());
                    }
                    while queue.next(&p, &open).await.is_some() {
                        mine += 1;
                        p.prefix(Prefix::Add, ran, 1).await;
                        queue.finish(&p, &open).await;
                    }
                    mine
                })
                .unwrap();
            assert_eq!(run.values.iter().sum::<u64>(), tasks, "phase {phase}");
        }
        assert_eq!(machine.peek(ran), 4);
    });
}

/// Catches an index claimed twice or by nobody.
#[test]
fn loops_run_each_index_once() {
    in_many_orders(|| {
        let mut machine = Checked::new(3);
        let indices = ParallelLoop::new(&mut machine, "indices").unwrap();
        let ran = machine.allocate("ran", 5, Home::RoundRobin).unwrap();
        machine
            .run(async |p: CheckedProcessor| {
                parallel_for(&p, &indices, 5, 2, async |i| {
                    p.prefix(Prefix::Add, ran.at(i), 1).await;
                })
                .await;
            })
            .unwrap();
        assert!((0..5).all(|i| machine.peek(ran.at(i)) == 1));
    });
}

/// Catches a model checker that would not notice: a counter without a multiprefix must be seen to lose additions.
#[test]
fn the_checker_notices_a_race() {
    let race = || {
        let mut machine = Checked::new(2);
        let cell = machine.allocate("cell", 1, Home::RoundRobin).unwrap().at(0);
        machine
            .run(async |p: CheckedProcessor| {
                let word = p.load(cell).await;
                p.store(cell, word + 1).await;
            })
            .unwrap();
        assert_eq!(machine.peek(cell), 2, "an addition is lost");
    };
    assert!(std::panic::catch_unwind(|| shuttle::check_random(race, 1000)).is_err());
}
