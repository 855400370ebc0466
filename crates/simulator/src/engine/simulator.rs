//! The machine: programs are started, resumed as events happen, and their accounts closed.

use std::cell::RefCell;
use std::future::Future;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::task::{Context, Poll, Waker};

use isolux_machine::{
    Address, BarrierId, Home, Layout, LockId, Machine, MemoryError, Region, Run, RunError, check_request,
};

use super::memory::Memory;
use super::processor::ProcessorOf;
use super::state::{Costs, State};
use super::trace::Trace;
use crate::spec::{MachineSpec, SpecError};

/// How waiting is simulated. Both give the same run, to the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polling {
    /// Polls that find nothing are computed: a processor that waits costs no events.
    ClosedForm,
    /// Every poll is an event. Slow; there to check the other.
    EveryPoll,
}

/// A simulated machine with a memory of this kind.
#[derive(Debug)]
pub struct SimulatorOf<M> {
    layout: Layout,
    count: usize,
    locks: u32,
    barriers: u32,
    traced: bool,
    state: Rc<RefCell<State<M>>>,
}

impl<M: Memory> SimulatorOf<M> {
    /// Bytes that a waiting processor takes, the state of its program (its future) not included.
    pub const PARKED_BYTES: usize = State::<M>::PARKED_BYTES;

    /// A machine of these figures with so many processors and these classes of work, each of which needs a figure.
    ///
    /// # Errors
    ///
    /// Names the file and the figure that is missing, or what is wrong with number or classes.
    pub fn new(spec: &MachineSpec, processors: usize, classes: &[&str]) -> Result<Self, SpecError> {
        check_request(processors, spec.processors_max(), classes)
            .map_err(|source| SpecError::Machine { file: spec.file.clone(), source })?;
        let costs = Costs {
            load: spec.load,
            store: spec.store,
            prefix: spec.prefix,
            spin: spec.spin,
            scan: spec.scan,
            take: spec.take,
            give: spec.give,
            barrier: spec.barrier(processors),
            work: classes.iter().map(|class| spec.work(class)).collect::<Result<_, _>>()?,
        };
        let state = Rc::new(RefCell::new(State::new(costs, M::new(spec, processors)?)));
        Ok(Self { layout: Layout::default(), count: processors, locks: 0, barriers: 0, traced: false, state })
    }

    /// Whether runs are traced from here on. A trace takes 56 bytes for each stretch of time.
    #[must_use]
    pub fn traced(mut self, traced: bool) -> Self {
        self.traced = traced;
        self
    }

    /// How waiting is simulated from here on.
    #[must_use]
    pub fn polling(self, polling: Polling) -> Self {
        self.state.borrow_mut().every_poll = polling == Polling::EveryPoll;
        self
    }

    /// Runs end with [`RunError::Stopped`] soon after this is set.
    #[must_use]
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        self.state.borrow_mut().stop = Some(stop);
        self
    }

    /// The trace of the last run, if it was traced.
    pub fn take_trace(&mut self) -> Option<Trace> {
        self.state.borrow_mut().trace.take()
    }

    /// Asks the memory.
    pub(crate) fn memory<T>(&self, ask: impl FnOnce(&M) -> T) -> T {
        ask(&self.state.borrow().memory)
    }

    /// Changes the memory, between runs.
    pub(crate) fn memory_mut<T>(&mut self, change: impl FnOnce(&mut M) -> T) -> T {
        change(&mut self.state.borrow_mut().memory)
    }

    /// How many effects and polls the last run simulated.
    pub fn events(&self) -> u64 {
        self.state.borrow().happened
    }
}

impl<M: Memory> Machine for SimulatorOf<M> {
    type Processor = ProcessorOf<M>;
    const ORDERED: bool = !M::CACHES;

    fn count(&self) -> usize {
        self.count
    }

    fn allocate(&mut self, name: &str, words: u64, home: Home) -> Result<Region, MemoryError> {
        let mut layout = self.layout.clone();
        let region = layout.allocate(name, words, home, self.count)?;
        let mut state = self.state.borrow_mut();
        state.memory.allocate(name, region, home)?;
        state.words.cover(&layout);
        self.layout = layout;
        Ok(region)
    }

    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn allocate_locks(&mut self, count: u32) -> LockId {
        let first = self.locks;
        self.locks += count;
        let words = self.state.borrow().memory.lock_words();
        if let Some(words) = words.filter(|_| count > 0) {
            let region = self
                .allocate(&format!("locks {first}"), u64::from(count) * words, Home::RoundRobin)
                .unwrap_or_else(|e| panic!("locks need memory: {e}"));
            self.state.borrow_mut().lock_words.extend((0..u64::from(count)).map(|lock| region.at(lock * words)));
        }
        LockId(first)
    }

    fn allocate_barriers(&mut self, count: u32) -> BarrierId {
        self.barriers += count;
        BarrierId(self.barriers - count)
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
        self.state.borrow_mut().begin(self.count, self.locks, self.barriers, self.traced);
        let start = |id| Some(Box::pin(program(ProcessorOf::new(id as u32, Rc::clone(&self.state)))));
        let mut futures: Vec<_> = (0..self.count).map(start).collect();
        let mut values: Vec<Option<T>> = (0..self.count).map(|_| None).collect();
        let mut context = Context::from_waker(Waker::noop());
        let mut next = self.state.borrow_mut().next_ready()?;
        while let Some(id) = next {
            let future = &mut futures[id as usize];
            let polled = future.as_mut().map(|f| f.as_mut().poll(&mut context));
            if let Some(Poll::Ready(value)) = polled {
                values[id as usize] = Some(value);
                *future = None;
                self.state.borrow_mut().end(id);
            }
            let mut state = self.state.borrow_mut();
            if future.is_some() {
                state.pause(id);
            }
            next = state.next_ready()?;
        }
        let mut state = self.state.borrow_mut();
        if let Some(error) = state.stuck() {
            return Err(error);
        }
        let (clock, time, counts, span) = state.accounts();
        let values = values.into_iter().flatten().collect();
        Run { values, clock, unit: M::UNIT, time, counts, span }.check()
    }
}
