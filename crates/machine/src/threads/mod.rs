//! The machine of real threads: operations are done as they are polled. README.md, beside this file, says who may write
//! what and why the orderings suffice.

use std::cell::{Cell, RefCell};
use std::future::{Future, pending};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::pin::pin;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::SeqCst};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Instant;

use crate::machine::{ClassError, Fault, Machine, RunError, Wait, check_request};
use crate::memory::{Address, Home, Layout, MemoryError, Region};
use crate::operation::{BarrierId, Condition, LockId, Prefix, Sequence, Work};
use crate::processor::{Cause, Mark, Processor};
use crate::run::{ByCause, ClockUnit, Counts, Run};

/// The most threads that one may ask for: what common systems let a process have without ado.
const THREADS_MAX: usize = 1024;
/// Words to a chunk: 32 KB, so that the table of a full memory stays below 64 MB.
const CHUNK_WORDS: usize = 1 << 12;
/// Looks at a word before the core is given away. A look costs some nanoseconds, giving away a microsecond.
const LOOKS: u32 = 64;

#[derive(Debug, Default)]
struct Lock {
    holder: Mutex<Option<usize>>,
    freed: Condvar,
}

#[derive(Debug, Default)]
struct Barrier {
    state: Mutex<Arrivals>,
    passed: Condvar,
}

#[derive(Debug, Default)]
struct Arrivals {
    here: usize,
    first: usize,
    generation: u64,
}

#[derive(Debug, Default)]
struct Shared {
    count: usize,
    classes: usize,
    limit: u64,
    chunks: Vec<OnceLock<Box<[AtomicU64]>>>,
    locks: Vec<Lock>,
    barriers: Vec<Barrier>,
    ended: AtomicUsize,
    stopped: AtomicBool,
    error: Mutex<Option<RunError>>,
}

/// Real threads, one per processor. The clock counts nanoseconds.
#[derive(Debug)]
pub struct Threads {
    layout: Layout,
    shared: Arc<Shared>,
}

impl Threads {
    /// A machine of so many threads, which are started anew for each run, with these classes of work.
    ///
    /// # Errors
    ///
    /// Names what is wrong with the number or the classes.
    pub fn new(processors: usize, classes: &[&str]) -> Result<Self, ClassError> {
        check_request(processors, THREADS_MAX, classes)?;
        let shared = Shared { count: processors, classes: classes.len(), ..Shared::default() };
        Ok(Self { layout: Layout::default(), shared: Arc::new(shared) })
    }

    /// What the processors share. While nothing runs nobody else holds it, unless a program kept its processor.
    fn shared(&mut self) -> &mut Shared {
        Arc::get_mut(&mut self.shared).expect("a processor is kept beyond its run")
    }
}

fn hold<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn sleep<'a, T>(condition: &Condvar, guard: MutexGuard<'a, T>) -> MutexGuard<'a, T> {
    condition.wait(guard).unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    fn cell(&self, at: Address) -> Result<&AtomicU64, Fault> {
        let word = at.word() as usize;
        let chunk = self.chunks.get(word / CHUNK_WORDS).filter(|_| at.word() < self.limit);
        let chunk = chunk.ok_or(Fault::Address(at))?;
        let words = chunk.get_or_init(|| (0..CHUNK_WORDS).map(|_| AtomicU64::new(0)).collect());
        Ok(&words[word % CHUNK_WORDS])
    }

    fn stop(&self, error: Option<RunError>) {
        {
            let mut first = hold(&self.error);
            if let (None, Some(error)) = (*first, error) {
                *first = Some(error);
            }
        }
        self.stopped.store(true, SeqCst);
        for lock in &self.locks {
            let _guard = hold(&lock.holder);
            lock.freed.notify_all();
        }
        for barrier in &self.barriers {
            let _guard = hold(&barrier.state);
            barrier.passed.notify_all();
        }
    }

    fn stopped(&self) -> bool {
        self.stopped.load(SeqCst)
    }

    /// Called once by each processor whose program has ended. A barrier with arrivals can no longer fill.
    fn end(&self) {
        self.ended.fetch_add(1, SeqCst);
        for (id, barrier) in self.barriers.iter().enumerate() {
            let first = {
                let arrivals = hold(&barrier.state);
                (arrivals.here > 0).then_some(arrivals.first)
            };
            if let Some(processor) = first {
                let wait = Wait::Barrier(BarrierId(id as u32));
                self.stop(Some(RunError::Deadlock { processor, wait }));
            }
        }
    }
}

impl Machine for Threads {
    type Processor = Thread;
    const ORDERED: bool = false;

    fn count(&self) -> usize {
        self.shared.count
    }

    fn allocate(&mut self, name: &str, words: u64, home: Home) -> Result<Region, MemoryError> {
        let region = self.layout.allocate(name, words, home, self.shared.count)?;
        let limit = self.layout.limit();
        let shared = self.shared();
        shared.limit = limit;
        shared.chunks.resize_with(limit.div_ceil(CHUNK_WORDS as u64) as usize, OnceLock::new);
        Ok(region)
    }

    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn allocate_locks(&mut self, count: u32) -> LockId {
        let locks = &mut self.shared().locks;
        let first = locks.len();
        locks.resize_with(first + count as usize, Lock::default);
        LockId(first as u32)
    }

    fn allocate_barriers(&mut self, count: u32) -> BarrierId {
        let barriers = &mut self.shared().barriers;
        let first = barriers.len();
        barriers.resize_with(first + count as usize, Barrier::default);
        BarrierId(first as u32)
    }

    fn peek(&self, at: Address) -> u64 {
        self.shared.cell(at).map_or(0, |c| c.load(SeqCst))
    }

    fn poke(&mut self, at: Address, value: u64) {
        match self.shared.cell(at) {
            Ok(cell) => cell.store(value, SeqCst),
            Err(fault) => panic!("{fault}"),
        }
    }

    fn run<T, F, R>(&mut self, program: F) -> Result<Run<T>, RunError>
    where
        F: Fn(Self::Processor) -> R + Sync,
        R: Future<Output = T>,
        T: Send,
    {
        let shared = self.shared();
        shared.locks.iter_mut().for_each(|l| *l = Lock::default());
        shared.barriers.iter_mut().for_each(|b| *b = Barrier::default());
        shared.ended = AtomicUsize::new(0);
        shared.stopped = AtomicBool::new(false);
        shared.error = Mutex::new(None);

        let (shared, program, begin) = (&self.shared, &program, Instant::now());
        let outcomes: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> =
                (0..shared.count).map(|id| scope.spawn(move || one(shared, program, id, begin))).collect();
            threads.into_iter().map(|thread| thread.join()).collect()
        });
        let (time, counts) = (vec![], vec![]);
        let mut run = Run { values: vec![], clock: 0, unit: ClockUnit::Nanoseconds, time, counts, span: 0 };
        for outcome in outcomes {
            match outcome {
                Err(panic) => resume_unwind(panic),
                // Stopped, by an error or by another's panic.
                Ok(None) => {}
                Ok(Some((value, time, counts))) => {
                    run.values.push(value);
                    run.clock = run.clock.max(time.total());
                    run.time.push(time);
                    run.counts.push(counts);
                }
            }
        }
        if let Some(error) = *hold(&self.shared.error) {
            return Err(error);
        }
        run.time.iter_mut().for_each(|t| t.add(Cause::Idle, run.clock - t.total()));
        run.check()
    }
}

/// Runs the program of one processor; nothing comes out when the run was stopped.
fn one<T, F, R>(shared: &Arc<Shared>, program: &F, id: usize, begin: Instant) -> Option<(T, ByCause, Counts)>
where
    F: Fn(Thread) -> R,
    R: Future<Output = T>,
{
    let account = Arc::new(Mutex::new((ByCause::default(), Counts::default())));
    let thread = Thread {
        id,
        shared: Arc::clone(shared),
        account: Arc::clone(&account),
        mark: Cell::new(Mark::new(Cause::Work, "start")),
        begin,
        since: Cell::new(0),
        time: Cell::new(ByCause::default()),
        counts: RefCell::new(Counts::default()),
    };
    let polled = catch_unwind(AssertUnwindSafe(|| {
        let future = pin!(program(thread));
        future.poll(&mut Context::from_waker(Waker::noop()))
    }));
    match polled {
        Err(panic) => {
            shared.stop(None);
            resume_unwind(panic)
        }
        Ok(Poll::Pending) => {
            if !shared.stopped() {
                shared.stop(Some(RunError::Fault { processor: id, fault: Fault::Foreign }));
            }
            None
        }
        Ok(Poll::Ready(value)) => {
            shared.end();
            let account = hold(&account);
            Some((value, account.0, account.1))
        }
    }
}

/// A processor of [`Threads`].
#[derive(Debug)]
pub struct Thread {
    id: usize,
    shared: Arc<Shared>,
    account: Arc<Mutex<(ByCause, Counts)>>,
    mark: Cell<Mark>,
    begin: Instant,
    since: Cell<u64>,
    time: Cell<ByCause>,
    counts: RefCell<Counts>,
}

impl Drop for Thread {
    /// The program has ended: hands the accounts over.
    fn drop(&mut self) {
        self.spend(self.mark.get().cause);
        *hold(&self.account) = (self.time.get(), *self.counts.borrow());
    }
}

impl Thread {
    /// What has passed since the last call went to `cause`.
    fn spend(&self, cause: Cause) {
        let now = u64::try_from(self.begin.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let mut time = self.time.get();
        time.add(cause, now - self.since.replace(now));
        self.time.set(time);
    }

    /// The word, or an end to the run.
    async fn cell(&self, at: Address) -> &AtomicU64 {
        match self.shared.cell(at) {
            Ok(cell) => cell,
            Err(fault) => self.fail(fault).await,
        }
    }

    async fn fail<T>(&self, fault: Fault) -> T {
        self.shared.stop(Some(RunError::Fault { processor: self.id, fault }));
        pending().await
    }

    /// Looks until there is an outcome; looks are told apart by their number.
    async fn poll<T>(&self, look: impl Fn(u64) -> Option<T>) -> T {
        self.spend(self.mark.get().cause);
        let mut looks = 0;
        let found = loop {
            let found = look(looks);
            looks += 1;
            if found.is_some() || self.shared.stopped() {
                break found;
            }
            if looks % u64::from(LOOKS) == 0 {
                std::thread::yield_now();
            } else {
                std::hint::spin_loop();
            }
        };
        self.counts.borrow_mut().polls += looks;
        self.spend(Cause::Idle);
        match found {
            Some(found) => found,
            None => pending().await,
        }
    }
}

impl Processor for Thread {
    fn id(&self) -> usize {
        self.id
    }

    fn count(&self) -> usize {
        self.shared.count
    }

    async fn load(&self, at: Address) -> u64 {
        self.counts.borrow_mut().loads += 1;
        self.cell(at).await.load(SeqCst)
    }

    async fn store(&self, at: Address, value: u64) {
        self.counts.borrow_mut().stores += 1;
        self.cell(at).await.store(value, SeqCst);
    }

    async fn prefix(&self, op: Prefix, at: Address, value: u64) -> u64 {
        self.counts.borrow_mut().prefixes += 1;
        let cell = self.cell(at).await;
        match op {
            Prefix::Add => cell.fetch_add(value, SeqCst),
            Prefix::Max => cell.fetch_max(value, SeqCst),
            Prefix::And => cell.fetch_and(value, SeqCst),
            Prefix::Or => cell.fetch_or(value, SeqCst),
        }
    }

    async fn lock(&self, lock: LockId) {
        let Some(it) = self.shared.locks.get(lock.0 as usize) else {
            return self.fail(Fault::NoLock(lock)).await;
        };
        self.spend(self.mark.get().cause);
        let taken = {
            let mut holder = hold(&it.holder);
            if *holder == Some(self.id) {
                Err(Fault::HeldAlready(lock))
            } else {
                while holder.is_some() && !self.shared.stopped() {
                    holder = sleep(&it.freed, holder);
                }
                let free = holder.is_none();
                if free {
                    *holder = Some(self.id);
                }
                Ok(free)
            }
        };
        self.spend(Cause::LockWait);
        match taken {
            Ok(true) => self.counts.borrow_mut().locks += 1,
            Ok(false) => pending().await,
            Err(fault) => self.fail(fault).await,
        }
    }

    async fn unlock(&self, lock: LockId) {
        let Some(it) = self.shared.locks.get(lock.0 as usize) else {
            return self.fail(Fault::NoLock(lock)).await;
        };
        let held = {
            let mut holder = hold(&it.holder);
            let held = *holder == Some(self.id);
            if held {
                *holder = None;
            }
            held
        };
        if !held {
            return self.fail(Fault::NotHeld(lock)).await;
        }
        it.freed.notify_one();
    }

    async fn barrier(&self, barrier: BarrierId) {
        let Some(it) = self.shared.barriers.get(barrier.0 as usize) else {
            return self.fail(Fault::NoBarrier(barrier)).await;
        };
        self.spend(self.mark.get().cause);
        let passed = {
            let mut arrivals = hold(&it.state);
            let generation = arrivals.generation;
            if arrivals.here == 0 {
                arrivals.first = self.id;
            }
            arrivals.here += 1;
            if arrivals.here == self.shared.count {
                arrivals.here = 0;
                arrivals.generation += 1;
                it.passed.notify_all();
                Ok(())
            } else if self.shared.ended.load(SeqCst) > 0 {
                Err(Some(RunError::Deadlock { processor: arrivals.first, wait: Wait::Barrier(barrier) }))
            } else {
                while arrivals.generation == generation && !self.shared.stopped() {
                    arrivals = sleep(&it.passed, arrivals);
                }
                if arrivals.generation == generation { Err(None) } else { Ok(()) }
            }
        };
        self.spend(Cause::BarrierWait);
        match passed {
            Ok(()) => self.counts.borrow_mut().barriers += 1,
            Err(error) => {
                if error.is_some() {
                    self.shared.stop(error);
                }
                pending().await
            }
        }
    }

    async fn charge(&self, work: &Work) {
        if let Some(class) = work.beyond(self.shared.classes) {
            return self.fail(Fault::NoWorkClass(class)).await;
        }
        self.counts.borrow_mut().work.add(work);
    }

    async fn wait_while(&self, at: Address, condition: Condition) -> u64 {
        let cell = self.cell(at).await;
        self.poll(|_| Some(cell.load(SeqCst)).filter(|&word| !condition.holds(word))).await
    }

    async fn scan(&self, cells: Sequence, until: Condition) -> usize {
        if !cells.is_valid() {
            return self.fail(Fault::Sequence).await;
        }
        for k in 0..cells.period() {
            self.cell(cells.at(k)).await;
        }
        let period = cells.period() as u64;
        self.poll(|look| {
            let k = (look % period) as usize;
            let word = self.shared.cell(cells.at(k)).map(|c| c.load(SeqCst));
            word.is_ok_and(|w| until.holds(w)).then_some(k)
        })
        .await
    }

    fn enter(&self, mark: Mark) -> Mark {
        let before = self.mark.replace(mark);
        if before.cause != mark.cause {
            self.spend(before.cause);
        }
        before
    }
}
