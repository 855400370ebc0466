//! The machine of one processor: operations are done as they are polled, and a wait that does not end at once never
//! ends.

use std::cell::{Cell, RefCell};
use std::future::{Future, pending};
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use crate::machine::{ClassError, Fault, Machine, RunError, Wait, check_request};
use crate::memory::{Address, Home, Layout, MemoryError, Region, Words};
use crate::operation::{BarrierId, Condition, LockId, Prefix, Sequence, Work};
use crate::processor::{Cause, Mark, Processor};
use crate::run::{ByCause, ClockUnit, Counts, Run};

#[derive(Debug, Default)]
struct State {
    classes: usize,
    words: Words,
    held: Vec<bool>,
    barriers: u32,
    time: ByCause,
    counts: Counts,
    error: Option<RunError>,
}

/// One processor. Its clock counts operations.
#[derive(Debug)]
pub struct Sequential {
    state: Rc<RefCell<State>>,
    layout: Layout,
}

impl Sequential {
    /// A machine with these classes of work.
    ///
    /// # Errors
    ///
    /// Names what is wrong with the classes.
    pub fn new(classes: &[&str]) -> Result<Self, ClassError> {
        check_request(1, 1, classes)?;
        let state = State { classes: classes.len(), ..State::default() };
        Ok(Self { state: Rc::new(RefCell::new(state)), layout: Layout::default() })
    }
}

impl Machine for Sequential {
    type Processor = SequentialProcessor;
    const ORDERED: bool = true;

    fn count(&self) -> usize {
        1
    }

    fn allocate(&mut self, name: &str, words: u64, home: Home) -> Result<Region, MemoryError> {
        let region = self.layout.allocate(name, words, home, 1)?;
        self.state.borrow_mut().words.cover(&self.layout);
        Ok(region)
    }

    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn allocate_locks(&mut self, count: u32) -> LockId {
        let held = &mut self.state.borrow_mut().held;
        let first = held.len() as u32;
        held.resize(held.len() + count as usize, false);
        LockId(first)
    }

    fn allocate_barriers(&mut self, count: u32) -> BarrierId {
        let mut state = self.state.borrow_mut();
        let first = state.barriers;
        state.barriers += count;
        BarrierId(first)
    }

    fn peek(&self, at: Address) -> u64 {
        self.state.borrow().words.get(at).unwrap_or(0)
    }

    fn poke(&mut self, at: Address, value: u64) {
        self.state.borrow_mut().words.poke(at, value);
    }

    fn run<T, F, R>(&mut self, program: F) -> Result<Run<T>, RunError>
    where
        F: Fn(Self::Processor) -> R + Sync,
        R: Future<Output = T>,
        T: Send,
    {
        {
            let mut state = self.state.borrow_mut();
            state.held.fill(false);
            (state.time, state.counts, state.error) = Default::default();
        }
        let mark = Cell::new(Mark::new(Cause::Work, "start"));
        let future = pin!(program(SequentialProcessor { state: Rc::clone(&self.state), mark }));
        let polled = future.poll(&mut Context::from_waker(Waker::noop()));
        let state = self.state.borrow();
        match (polled, state.error) {
            (_, Some(error)) => Err(error),
            (Poll::Pending, None) => Err(RunError::Fault { processor: 0, fault: Fault::Foreign }),
            (Poll::Ready(value), None) => Run {
                values: vec![value],
                clock: state.time.total(),
                unit: ClockUnit::Operations,
                time: vec![state.time],
                counts: vec![state.counts],
                span: 0,
            }
            .check(),
        }
    }
}

impl State {
    fn checked(&mut self, at: Address) -> Result<&mut u64, RunError> {
        self.words.get_mut(at).ok_or(fault(Fault::Address(at)))
    }
}

fn fault(fault: Fault) -> RunError {
    RunError::Fault { processor: 0, fault }
}

/// The processor of [`Sequential`].
#[derive(Debug)]
pub struct SequentialProcessor {
    state: Rc<RefCell<State>>,
    mark: Cell<Mark>,
}

impl SequentialProcessor {
    async fn act<T>(&self, act: impl FnOnce(&mut State) -> Result<T, RunError>) -> T {
        let done = {
            let mut state = self.state.borrow_mut();
            let cause = self.mark.get().cause;
            state.time.add(cause, 1);
            let done = act(&mut state);
            if let Err(error) = &done {
                state.error.get_or_insert(*error);
            }
            done
        };
        match done {
            Ok(value) => value,
            Err(_) => pending().await,
        }
    }
}

impl Processor for SequentialProcessor {
    fn id(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        1
    }

    async fn load(&self, at: Address) -> u64 {
        self.act(|s| {
            s.counts.loads += 1;
            s.checked(at).copied()
        })
        .await
    }

    async fn store(&self, at: Address, value: u64) {
        self.act(|s| {
            s.counts.stores += 1;
            s.checked(at).map(|word| *word = value)
        })
        .await
    }

    async fn prefix(&self, op: Prefix, at: Address, value: u64) -> u64 {
        self.act(|s| {
            s.counts.prefixes += 1;
            s.checked(at).map(|word| std::mem::replace(word, op.apply(*word, value)))
        })
        .await
    }

    async fn lock(&self, lock: LockId) {
        self.act(|s| match s.held.get_mut(lock.0 as usize) {
            None => Err(fault(Fault::NoLock(lock))),
            Some(true) => Err(fault(Fault::HeldAlready(lock))),
            Some(held) => {
                *held = true;
                s.counts.locks += 1;
                Ok(())
            }
        })
        .await
    }

    async fn unlock(&self, lock: LockId) {
        self.act(|s| match s.held.get_mut(lock.0 as usize) {
            None => Err(fault(Fault::NoLock(lock))),
            Some(false) => Err(fault(Fault::NotHeld(lock))),
            Some(held) => {
                *held = false;
                Ok(())
            }
        })
        .await
    }

    async fn barrier(&self, barrier: BarrierId) {
        self.act(|s| {
            if barrier.0 >= s.barriers {
                return Err(fault(Fault::NoBarrier(barrier)));
            }
            s.counts.barriers += 1;
            Ok(())
        })
        .await
    }

    async fn charge(&self, work: &Work) {
        if *work != Work::default() {
            self.act(|s| match work.beyond(s.classes) {
                Some(class) => Err(fault(Fault::NoWorkClass(class))),
                None => {
                    s.counts.work.add(work);
                    Ok(())
                }
            })
            .await
        }
    }

    async fn wait_while(&self, at: Address, condition: Condition) -> u64 {
        self.act(|s| {
            s.counts.polls += 1;
            let word = *s.checked(at)?;
            if condition.holds(word) {
                Err(RunError::Deadlock { processor: 0, wait: Wait::Word(at) })
            } else {
                Ok(word)
            }
        })
        .await
    }

    async fn scan(&self, cells: Sequence, until: Condition) -> usize {
        self.act(|s| {
            if !cells.is_valid() {
                return Err(fault(Fault::Sequence));
            }
            for k in 0..cells.period() {
                s.counts.polls += 1;
                if until.holds(*s.checked(cells.at(k))?) {
                    return Ok(k);
                }
            }
            Err(RunError::Deadlock { processor: 0, wait: Wait::Word(cells.at(0)) })
        })
        .await
    }

    fn enter(&self, mark: Mark) -> Mark {
        self.mark.replace(mark)
    }
}
