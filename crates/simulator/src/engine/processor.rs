//! A processor as its program sees it: operations become futures that are ready once their effects have their place in
//! time.

use std::cell::RefCell;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll};

use isolux_machine::{
    Address, BLOCK_WORDS, BarrierId, Condition, LockId, Mark, Note, Prefix, Processor, Region, Sequence, Work,
};

use super::memory::Memory;
use super::state::{Op, State};
use super::watch::Until;

/// A processor of a [`SimulatorOf`](crate::SimulatorOf).
#[derive(Debug)]
pub struct ProcessorOf<M> {
    id: u32,
    state: Rc<RefCell<State<M>>>,
}

impl<M> Clone for ProcessorOf<M> {
    fn clone(&self) -> Self {
        Self { id: self.id, state: Rc::clone(&self.state) }
    }
}

impl<M: Memory> ProcessorOf<M> {
    pub(super) fn new(id: u32, state: Rc<RefCell<State<M>>>) -> Self {
        Self { id, state }
    }

    fn operation<T, F: Fn(u64) -> T>(&self, op: Op, outcome: F) -> Operation<'_, M, F> {
        Operation { processor: self, op: Some(op), outcome }
    }
}

/// An operation on its way: issued when first polled, ready when its processor is resumed.
struct Operation<'a, M, F> {
    processor: &'a ProcessorOf<M>,
    op: Option<Op>,
    outcome: F,
}

impl<M: Memory, T, F: Fn(u64) -> T + Unpin> Future for Operation<'_, M, F> {
    type Output = T;

    #[inline]
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

/// A wait on its way: what it waits for is kept with the machine's state from the first poll on.
struct Waiting<'a, M, F> {
    processor: &'a ProcessorOf<M>,
    wait: Option<(Sequence, Until)>,
    spins: bool,
    outcome: F,
}

impl<M: Memory, T, F: Fn(u64) -> T + Unpin> Future for Waiting<'_, M, F> {
    type Output = T;

    fn poll(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<T> {
        let (id, wait) = (self.processor.id, self.wait.take());
        let mut state = self.processor.state.borrow_mut();
        let outcome = match wait {
            Some((cells, until)) => state.issue_wait(id, cells, until, self.spins),
            None => state.outcome(id),
        };
        outcome.map_or(Poll::Pending, |o| Poll::Ready((self.outcome)(o)))
    }
}

/// The store of a block on its way: its words are kept with the machine's state from the first poll on.
struct BlockStore<'a, M, const N: usize> {
    processor: &'a ProcessorOf<M>,
    at: Address,
    values: Option<[u64; N]>,
}

impl<M: Memory, const N: usize> Future for BlockStore<'_, M, N> {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<()> {
        let (id, at) = (self.processor.id, self.at);
        let mut state = self.processor.state.borrow_mut();
        let outcome = match self.values.take() {
            Some(_) if N == 0 => Some(0),
            Some(values) => {
                let block = state.blocks.keep(&values);
                state.issue(id, Op::StoreBlock(at, N as u8, block))
            }
            None => state.outcome(id),
        };
        outcome.map_or(Poll::Pending, |_| Poll::Ready(()))
    }
}

impl<M: Memory> Processor for ProcessorOf<M> {
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
        Waiting { processor: self, wait: Some((Sequence::one(at), until)), spins: true, outcome: |word| word }
    }

    fn scan(&self, cells: Sequence, until: Condition) -> impl Future<Output = usize> {
        let until = Until { condition: until, holds: true };
        Waiting { processor: self, wait: Some((cells, until)), spins: false, outcome: |position| position as usize }
    }

    async fn load_block<const N: usize>(&self, at: Address) -> [u64; N] {
        const { assert!(N <= BLOCK_WORDS, "a block has at most BLOCK_WORDS words") };
        if N == 0 {
            return [0; N];
        }
        let block = self.operation(Op::LoadBlock(at, N as u8), |block| block).await;
        self.state.borrow_mut().blocks.take(block as u32)
    }

    fn store_block<const N: usize>(&self, at: Address, values: [u64; N]) -> impl Future<Output = ()> {
        const { assert!(N <= BLOCK_WORDS, "a block has at most BLOCK_WORDS words") };
        BlockStore { processor: self, at, values: Some(values) }
    }

    fn has_caches(&self) -> bool {
        M::CACHES
    }

    async fn touch(&self, region: Region, words: u64, records: &[u32]) {
        if !M::CACHES || words == 0 || records.is_empty() {
            return;
        }
        // Nothing else happens between this processor's turn and its going on.
        self.operation(Op::Turn, |_| ()).await;
        let touched = self.state.borrow_mut().touch(self.id, region, words, records);
        if !touched {
            std::future::pending().await
        }
    }

    fn note(&self, note: Note) {
        self.state.borrow_mut().spans.note(self.id, note);
    }

    fn enter(&self, mark: Mark) -> Mark {
        self.state.borrow_mut().enter(self.id, mark)
    }
}
