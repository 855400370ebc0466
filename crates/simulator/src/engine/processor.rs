//! A processor as its program sees it: operations become futures that are ready once their effects have their place in time.

use std::cell::RefCell;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll};

use isolux_machine::{Address, BarrierId, Condition, LockId, Mark, Prefix, Processor, Sequence, Work};

use super::state::{Op, State};
use super::watch::Until;

/// A processor of a [`crate::Simulator`].
#[derive(Clone, Debug)]
pub struct SimulatedProcessor {
    id: u32,
    state: Rc<RefCell<State>>,
}

impl SimulatedProcessor {
    pub(super) fn new(id: u32, state: Rc<RefCell<State>>) -> Self {
        Self { id, state }
    }

    fn operation<T>(&self, op: Op, outcome: fn(u64) -> T) -> Operation<'_, T> {
        Operation { processor: self, op: Some(op), outcome }
    }
}

/// An operation on its way: issued when first polled, ready when its processor is resumed.
struct Operation<'a, T> {
    processor: &'a SimulatedProcessor,
    op: Option<Op>,
    outcome: fn(u64) -> T,
}

impl<T> Future for Operation<'_, T> {
    type Output = T;

    fn poll(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<T> {
        let (id, op) = (self.processor.id, self.op.take());
        let mut state = self.processor.state.borrow_mut();
        let outcome = match op {
            Some(op) => state.issue(id, op),
            None => state.outcome(id),
        };
        outcome.map_or(Poll::Pending, |o| Poll::Ready((self.outcome)(o)))
    }
}

impl Processor for SimulatedProcessor {
    fn id(&self) -> usize {
        self.id as usize
    }

    fn count(&self) -> usize {
        self.state.borrow().processors()
    }

    fn load(&self, at: Address) -> impl Future<Output = u64> {
        self.operation(Op::Load(at), |word| word)
    }

    fn store(&self, at: Address, value: u64) -> impl Future<Output = ()> {
        self.operation(Op::Store(at, value), |_| ())
    }

    fn prefix(&self, op: Prefix, at: Address, value: u64) -> impl Future<Output = u64> {
        self.operation(Op::Prefix(op, at, value), |before| before)
    }

    fn lock(&self, lock: LockId) -> impl Future<Output = ()> {
        self.operation(Op::Lock(lock), |_| ())
    }

    fn unlock(&self, lock: LockId) -> impl Future<Output = ()> {
        self.operation(Op::Unlock(lock), |_| ())
    }

    fn barrier(&self, barrier: BarrierId) -> impl Future<Output = ()> {
        self.operation(Op::Barrier(barrier), |_| ())
    }

    async fn charge(&self, work: &Work) {
        let charged = self.state.borrow_mut().charge(self.id, work);
        if !charged {
            std::future::pending().await
        }
    }

    fn wait_while(&self, at: Address, condition: Condition) -> impl Future<Output = u64> {
        let until = Until { condition, holds: false };
        self.operation(Op::Wait { cells: Sequence::one(at), until, spins: true }, |word| word)
    }

    fn scan(&self, cells: Sequence, until: Condition) -> impl Future<Output = usize> {
        let until = Until { condition: until, holds: true };
        self.operation(Op::Wait { cells, until, spins: false }, |position| position as usize)
    }

    fn enter(&self, mark: Mark) -> Mark {
        self.state.borrow_mut().enter(self.id, mark)
    }
}
