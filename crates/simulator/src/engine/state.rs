//! What a simulated machine is at a moment: words, locks, barriers, what each processor is at; operations go in as they
//! are issued, and take effect in order.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use isolux_machine::{
    Address, BLOCK_WORDS, BarrierId, ByCause, Cause, Counts, Fault, LockId, Mark, Prefix, Region, RunError, Sequence,
    Wait, Words, Work,
};

use isolux_memory::Kind;

use super::blocks::Blocks;
use super::event::{Event, Rank, What};
use super::memory::Memory;
use super::queue::Queue;
use super::spans::Spans;
use super::time::Time;
use super::trace::Trace;
use super::watch::{Sight, Until, Watches};

/// What operations cost, in units, for the machine's number of processors.
#[derive(Clone, Debug, Default)]
pub(super) struct Costs {
    pub(super) load: u64,
    pub(super) store: u64,
    pub(super) prefix: u64,
    pub(super) spin: u64,
    pub(super) scan: u64,
    pub(super) take: u64,
    pub(super) give: u64,
    pub(super) barrier: u64,
    /// Thousandths of a unit by class of work.
    pub(super) work: Vec<u64>,
}

/// An operation that has a place in the order of effects.
#[derive(Clone, Copy, Debug)]
pub(super) enum Op {
    Load(Address),
    Store(Address, u64),
    /// So many words from there on, into a block.
    LoadBlock(Address, u8),
    /// The same out of this block.
    StoreBlock(Address, u8, u32),
    /// Nothing yet: the processor goes on when its turn has come.
    Turn,
    Prefix(Prefix, Address, u64),
    Unlock(LockId),
    Lock(LockId),
    Barrier(BarrierId),
    /// Polls until a word ends it: the one word of a spin, which is its outcome, or one of a scan, whose number is. What it
    /// waits for is in [`Waiting`].
    Wait {
        spins: bool,
    },
}

impl Op {
    fn rank(&self) -> Rank {
        match *self {
            Self::Load(_) | Self::LoadBlock(..) | Self::Turn | Self::Wait { .. } => Rank::LOAD,
            Self::Store(..) | Self::StoreBlock(..) => Rank::STORE,
            Self::Prefix(op, at, _) => Rank::prefix(op, at),
            Self::Unlock(_) => Rank::UNLOCK,
            Self::Lock(_) => Rank::LOCK,
            Self::Barrier(_) => Rank::BARRIER,
        }
    }
}

/// What a processor is at.
#[derive(Clone, Copy, Debug)]
enum Status {
    /// Its program goes on, or is about to.
    Runs,
    /// It has issued an operation that has not taken effect, or not ended.
    Issued(Op),
    /// Its operation has ended with this outcome, which its program has not got yet.
    Has(u64),
    /// Its program has ended.
    Ended,
}

/// What is looked at with each of a processor's operations: small, since there may be thousands.
#[derive(Clone, Copy, Debug)]
struct Slot {
    now: Time,
    status: Status,
    mark: Mark,
}

#[derive(Clone, Copy, Debug, Default)]
struct Account {
    time: ByCause,
    counts: Counts,
}

/// What a processor waits for, or waited for last.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    cells: Sequence,
    until: Until,
    /// Polls after the first, where each is simulated.
    polls: u64,
}

#[derive(Clone, Debug, Default)]
struct Lock {
    holder: Option<u32>,
    queue: VecDeque<u32>,
}

/// All of it.
#[derive(Debug)]
pub(super) struct State<M> {
    costs: Costs,
    pub(super) memory: M,
    /// The words of locks, where these are in memory.
    pub(super) lock_words: Vec<Address>,
    pub(super) words: Words,
    pub(super) blocks: Blocks,
    pub(super) spans: Spans,
    pub(super) every_poll: bool,
    /// Ends the run with an error when it is set.
    pub(super) stop: Option<Arc<AtomicBool>>,
    pub(super) trace: Option<Trace>,
    error: Option<RunError>,
    /// Processors whose programs can go on.
    ready: VecDeque<u32>,
    /// Effects and polls simulated.
    pub(super) happened: u64,
    slots: Vec<Slot>,
    accounts: Vec<Account>,
    waits: Vec<Option<Waiting>>,
    locks: Vec<Lock>,
    barriers: Vec<Vec<u32>>,
    queue: Queue,
    watches: Watches,
    /// Processors that poll again and again, where each poll is simulated.
    polling: usize,
}

/// Either a group of its own, or four entries in lists of a group, once by place and three times by phase (less than 96
/// bytes each).
const AMONG_WATCHERS: usize = if Watches::GROUP_BYTES > 4 * 96 { Watches::GROUP_BYTES } else { 4 * 96 };

/// Effects between two looks at whether to stop: some milliseconds.
const ASKED_EVERY: u64 = 1 << 14;

const START: Mark = Mark::new(Cause::Work, "start");
const ENDED: Mark = Mark::new(Cause::Idle, "ended");

impl<M: Memory> State<M> {
    /// Bytes that a processor takes here while it waits, its program's own state not included: its slot, two events,
    /// its place among the watchers, its chain.
    pub(super) const PARKED_BYTES: usize = size_of::<Slot>()
        + size_of::<Account>()
        + size_of::<Option<Waiting>>()
        + 2 * Queue::EVENT_BYTES
        + AMONG_WATCHERS
        + Spans::BYTES;

    /// Without words, with these costs.
    pub(super) fn new(costs: Costs, memory: M) -> Self {
        Self {
            costs,
            memory,
            lock_words: vec![],
            words: Words::default(),
            blocks: Blocks::default(),
            spans: Spans::default(),
            every_poll: false,
            stop: None,
            trace: None,
            error: None,
            ready: VecDeque::new(),
            happened: 0,
            slots: vec![],
            accounts: vec![],
            waits: vec![],
            locks: vec![],
            barriers: vec![],
            queue: Queue::default(),
            watches: Watches::default(),
            polling: 0,
        }
    }

    /// Before a run: all processors at the start; words as they are.
    pub(super) fn begin(&mut self, processors: usize, locks: u32, barriers: u32, trace: bool) {
        self.slots = vec![Slot { now: Time(0), status: Status::Runs, mark: START }; processors];
        self.accounts = vec![Account::default(); processors];
        self.waits = vec![None; processors];
        self.locks = vec![Lock::default(); locks as usize];
        self.barriers = vec![vec![]; barriers as usize];
        self.watches = Watches::new(processors);
        self.spans = Spans::new(processors);
        self.blocks.clear();
        self.trace = trace.then(|| Trace::new(processors));
        self.ready = (0..processors as u32).collect();
        self.queue = Queue::default();
        (self.error, self.happened, self.polling) = (None, 0, 0);
    }

    pub(super) fn processors(&self) -> usize {
        self.slots.len()
    }

    pub(super) fn enter(&mut self, processor: u32, mark: Mark) -> Mark {
        std::mem::replace(&mut self.slots[processor as usize].mark, mark)
    }

    /// A processor issues an operation at its present time. Gives the outcome at once where nothing can come before it.
    pub(super) fn issue(&mut self, processor: u32, op: Op) -> Option<u64> {
        let slot = &mut self.slots[processor as usize];
        if !matches!(slot.status, Status::Runs) {
            return self.fail(processor, Fault::Foreign);
        }
        slot.status = Status::Issued(op);
        let event = Event { time: slot.now, rank: op.rank(), processor, what: What::Operation };
        let first = self.ready.is_empty() && self.error.is_none() && self.queue.announce(&event);
        if !first {
            self.queue.push(event);
            return None;
        }
        let outcome = self.take_effect(event.time, processor, op)?;
        self.slots[processor as usize].status = Status::Runs;
        Some(outcome)
    }

    /// A processor begins to wait.
    pub(super) fn issue_wait(&mut self, processor: u32, cells: Sequence, until: Until, spins: bool) -> Option<u64> {
        self.waits[processor as usize] = Some(Waiting { cells, until, polls: 0 });
        self.issue(processor, Op::Wait { spins })
    }

    /// The outcome of the operation that a processor issued, once it has ended.
    pub(super) fn outcome(&mut self, processor: u32) -> Option<u64> {
        let slot = &mut self.slots[processor as usize];
        match slot.status {
            Status::Has(outcome) => {
                slot.status = Status::Runs;
                Some(outcome)
            }
            _ => None,
        }
    }

    /// Work takes its time and touches nothing shared, so it needs no place in the order of effects.
    pub(super) fn charge(&mut self, processor: u32, work: &Work) -> bool {
        if let Some(class) = work.beyond(self.costs.work.len()) {
            self.fail(processor, Fault::NoWorkClass(class));
            return false;
        }
        let parts: u128 = work.charged().map(|(class, n)| u128::from(n) * u128::from(self.costs.work[class.0])).sum();
        self.counts(processor).work.add(work);
        let cause = self.slots[processor as usize].mark.cause;
        match u64::try_from(parts.div_ceil(1000)) {
            Ok(units) => self.spend(processor, cause, units),
            Err(_) => {
                self.fail(processor, Fault::Clock);
            }
        }
        self.error.is_none()
    }

    /// The next processor whose program can go on, after as many events as it takes; `None` when nothing is left to happen.
    pub(super) fn next_ready(&mut self) -> Result<Option<u32>, RunError> {
        loop {
            if let Some(error) = self.error {
                return Err(error);
            }
            if let Some(id) = self.ready.pop_front() {
                return Ok(Some(id));
            }
            if !self.step() {
                return Ok(None);
            }
        }
    }

    /// The next event happens. Nothing is left to happen when it gives `false`.
    fn step(&mut self) -> bool {
        let Some(event) = self.queue.pop() else { return false };
        let processor = event.processor;
        match event.what {
            What::Operation => {
                if let Status::Issued(op) = self.slots[processor as usize].status
                    && let Some(outcome) = self.take_effect(event.time, processor, op)
                {
                    self.resume(processor, outcome);
                }
            }
            What::Sight { .. } => {
                if let Some(sight) = self.watches.sight(event, &mut self.queue) {
                    self.happened += 1;
                    self.see(event.time, processor, sight);
                }
            }
        }
        true
    }

    /// A processor's program has ended.
    pub(super) fn end(&mut self, processor: u32) {
        self.slots[processor as usize].status = Status::Ended;
    }

    /// A processor's program does not go on: it must wait for an operation of its own, or be about to be told its outcome.
    pub(super) fn pause(&mut self, processor: u32) {
        let waits = matches!(self.slots[processor as usize].status, Status::Issued(_) | Status::Has(_));
        if self.error.is_none() && !waits {
            self.fail(processor, Fault::Foreign);
        }
    }

    /// When nothing is left to happen: the first processor that has not ended, and what for.
    pub(super) fn stuck(&self) -> Option<RunError> {
        self.slots.iter().zip(&self.waits).enumerate().find_map(|(processor, (slot, waiting))| {
            let wait = match (slot.status, waiting) {
                (Status::Issued(Op::Lock(lock)), _) => Wait::Lock(lock),
                (Status::Issued(Op::Barrier(barrier)), _) => Wait::Barrier(barrier),
                (Status::Issued(Op::Wait { .. }), Some(waiting)) => Wait::Word(waiting.cells.at(0)),
                (Status::Ended, _) => return None,
                // It gave up its operation for something else.
                _ => return Some(RunError::Fault { processor, fault: Fault::Foreign }),
            };
            Some(RunError::Deadlock { processor, wait })
        })
    }

    /// After a run: the clock; each processor's accounts, with the time from its end to that of the run; the longest
    /// chain.
    pub(super) fn accounts(&mut self) -> (u64, Vec<ByCause>, Vec<Counts>, u64) {
        let clock = self.slots.iter().map(|s| s.now).max().unwrap_or_default();
        for (processor, (slot, account)) in self.slots.iter().zip(&mut self.accounts).enumerate() {
            account.time.add(Cause::Idle, clock.since(slot.now));
            if let Some(trace) = &mut self.trace {
                trace.add(processor, slot.now.0, clock.0, ENDED);
            }
        }
        let time = self.accounts.iter().map(|a| a.time).collect();
        (clock.0, time, self.accounts.iter().map(|a| a.counts).collect(), self.spans.longest())
    }

    fn fail(&mut self, processor: u32, fault: Fault) -> Option<u64> {
        self.error.get_or_insert(RunError::Fault { processor: processor as usize, fault });
        None
    }

    /// Time passes for one processor.
    fn spend(&mut self, processor: u32, cause: Cause, units: u64) {
        let slot = &mut self.slots[processor as usize];
        let Some(until) = slot.now.after(units) else {
            self.fail(processor, Fault::Clock);
            return;
        };
        if let Some(trace) = &mut self.trace {
            trace.add(processor as usize, slot.now.0, until.0, Mark::new(cause, slot.mark.label));
        }
        slot.now = until;
        self.accounts[processor as usize].time.add(cause, units);
        if cause == Cause::Work {
            self.spans.work(processor, units);
        }
    }

    /// An operation accesses a word that there is, and costs its units; what the access takes beyond is a stall.
    fn access(&mut self, processor: u32, at: Address, kind: Kind, units: u64) {
        self.cost(processor, units);
        self.stall(processor, at, kind);
    }

    fn stall(&mut self, processor: u32, at: Address, kind: Kind) {
        let beyond = self.memory.access(processor, at, kind);
        if beyond > 0 {
            self.spend(processor, Cause::Stall, beyond);
        }
    }

    fn stalls(&mut self, processor: u32, at: Address, words: u64, kind: Kind) {
        if M::CACHES {
            (0..words).for_each(|i| self.stall(processor, at.plus(i), kind));
        }
    }

    /// A processor takes or gives up a lock, whose word it writes.
    fn access_lock(&mut self, processor: u32, lock: LockId, kind: Kind, units: u64) {
        self.cost(processor, units);
        if let Some(&at) = self.lock_words.get(lock.0 as usize) {
            self.stall(processor, at, kind);
        }
    }

    /// A processor, whose turn it is, reads records whole; `false` if there are none of the kind.
    pub(super) fn touch(&mut self, processor: u32, region: Region, words: u64, records: &[u32]) -> bool {
        let mut beyond = 0;
        for &record in records {
            let first = u64::from(record).saturating_mul(words);
            if first.saturating_add(words) > region.words() {
                self.fail(processor, Fault::Address(region.at(0).plus(first)));
                return false;
            }
            beyond += self.memory.touch(processor, region.at(first), words);
        }
        if beyond > 0 {
            self.spend(processor, Cause::Stall, beyond);
        }
        self.error.is_none()
    }

    /// An operation costs its units, which go to what the processor is at.
    fn cost(&mut self, processor: u32, units: u64) {
        let cause = self.slots[processor as usize].mark.cause;
        self.spend(processor, cause, units);
    }

    fn resume(&mut self, processor: u32, outcome: u64) {
        self.slots[processor as usize].status = Status::Has(outcome);
        self.ready.push_back(processor);
    }

    fn counts(&mut self, processor: u32) -> &mut Counts {
        &mut self.accounts[processor as usize].counts
    }

    /// An operation takes effect; gives its outcome unless it has to wait.
    fn take_effect(&mut self, now: Time, processor: u32, op: Op) -> Option<u64> {
        self.happened += 1;
        if self.happened.is_multiple_of(ASKED_EVERY) && self.stop.as_ref().is_some_and(|stop| stop.load(Relaxed)) {
            self.error = Some(RunError::Stopped);
            return None;
        }
        match op {
            Op::Load(at) => {
                let Some(word) = self.words.get(at) else { return self.fail(processor, Fault::Address(at)) };
                self.counts(processor).loads += 1;
                self.access(processor, at, Kind::Read, self.costs.load);
                Some(word)
            }
            Op::Store(at, value) => {
                self.write(now, processor, at, |_| value)?;
                self.counts(processor).stores += 1;
                self.access(processor, at, Kind::Write, self.costs.store);
                Some(0)
            }
            Op::LoadBlock(at, words) => {
                let (number, block) = self.blocks.unused();
                let read = self.words.read(at, &mut block[..usize::from(words)]);
                let words = u64::from(words);
                if read.is_none()
                    && let Some(outside) = self.outside(at, words)
                {
                    return self.fail(processor, outside);
                }
                self.counts(processor).loads += words;
                self.cost(processor, words * self.costs.load);
                self.stalls(processor, at, words, Kind::Read);
                Some(u64::from(number))
            }
            Op::StoreBlock(at, words, block) => {
                let values: [u64; BLOCK_WORDS] = self.blocks.take(block);
                if let Some(outside) = self.outside(at, u64::from(words)) {
                    return self.fail(processor, outside);
                }
                for (i, &value) in (0..u64::from(words)).zip(&values) {
                    self.write(now, processor, at.plus(i), |_| value)?;
                }
                self.counts(processor).stores += u64::from(words);
                self.cost(processor, u64::from(words) * self.costs.store);
                self.stalls(processor, at, u64::from(words), Kind::Write);
                Some(0)
            }
            Op::Prefix(op, at, value) => {
                let before = self.write(now, processor, at, |word| op.apply(word, value))?;
                self.counts(processor).prefixes += 1;
                self.access(processor, at, Kind::ReadModifyWrite, self.costs.prefix);
                Some(before)
            }
            Op::Lock(lock) => {
                let Some(it) = self.locks.get_mut(lock.0 as usize) else {
                    return self.fail(processor, Fault::NoLock(lock));
                };
                match it.holder {
                    Some(holder) if holder == processor => self.fail(processor, Fault::HeldAlready(lock)),
                    Some(_) => {
                        it.queue.push_back(processor);
                        None
                    }
                    None => {
                        it.holder = Some(processor);
                        self.counts(processor).locks += 1;
                        self.access_lock(processor, lock, Kind::ReadModifyWrite, self.costs.take);
                        Some(0)
                    }
                }
            }
            Op::Unlock(lock) => {
                let Some(it) = self.locks.get_mut(lock.0 as usize) else {
                    return self.fail(processor, Fault::NoLock(lock));
                };
                if it.holder != Some(processor) {
                    return self.fail(processor, Fault::NotHeld(lock));
                }
                let next = it.queue.pop_front();
                it.holder = next;
                if let Some(next) = next {
                    self.spend_until(next, Cause::LockWait, now);
                    self.counts(next).locks += 1;
                }
                self.access_lock(processor, lock, Kind::Write, self.costs.give);
                if let Some(next) = next {
                    self.access_lock(next, lock, Kind::ReadModifyWrite, self.costs.take);
                    self.resume(next, 0);
                }
                Some(0)
            }
            Op::Barrier(barrier) => {
                let count = self.processors();
                let Some(here) = self.barriers.get_mut(barrier.0 as usize) else {
                    return self.fail(processor, Fault::NoBarrier(barrier));
                };
                here.push(processor);
                if here.len() == count {
                    self.spans.barrier();
                    for waiting in std::mem::take(here) {
                        self.spend_until(waiting, Cause::BarrierWait, now);
                        self.counts(waiting).barriers += 1;
                        self.spend(waiting, Cause::BarrierWait, self.costs.barrier);
                        self.resume(waiting, 0);
                    }
                }
                None
            }
            Op::Turn => Some(0),
            Op::Wait { spins } => self.poll(now, processor, spins),
        }
    }

    /// Whether one of these words lies outside all regions.
    fn outside(&self, at: Address, words: u64) -> Option<Fault> {
        let last = at.plus(words - 1);
        [at, last].into_iter().find(|&at| self.words.get(at).is_none()).map(Fault::Address)
    }

    /// Time passes until `now`.
    fn spend_until(&mut self, processor: u32, cause: Cause, now: Time) {
        let since = now.since(self.slots[processor as usize].now);
        self.spend(processor, cause, since);
    }

    fn write(&mut self, now: Time, processor: u32, at: Address, f: impl FnOnce(u64) -> u64) -> Option<u64> {
        let Some(word) = self.words.get_mut(at) else { return self.fail(processor, Fault::Address(at)) };
        let before = *word;
        *word = f(before);
        let after = *word;
        if before != after {
            self.watches.written(at, after, now, &mut self.queue);
        }
        Some(before)
    }

    /// The first poll of a wait, or any where each is simulated.
    fn poll(&mut self, now: Time, processor: u32, spins: bool) -> Option<u64> {
        let cost = if spins { self.costs.spin } else { self.costs.scan };
        let waiting = self.waits[processor as usize].as_mut()?;
        let Waiting { cells, until, polls } = *waiting;
        waiting.polls += 1;
        if polls == 0
            && let Some(fault) = self.senseless(&cells)
        {
            return self.fail(processor, fault);
        }
        let position = (polls % cells.period() as u64) as usize;
        let at = cells.at(position);
        let word = self.words.get(at).unwrap_or(0);
        if until.ends(word) {
            self.polling -= usize::from(polls > 0);
            return Some(self.end_wait(now, processor, Sight { position, polls, at }, spins));
        }
        let mut now = now;
        if polls == 0 {
            // The first poll brings a copy into the cache; the later ones, but for the last, look at that (D27).
            self.stall(processor, at, Kind::Read);
            now = self.slots[processor as usize].now;
        }
        if !self.every_poll {
            self.watches.watch(processor, cells, until, cost, now, &self.words, &mut self.queue);
            return None;
        }
        self.polling += usize::from(polls == 0);
        match now.after(cost) {
            Some(time) => self.queue.push(Event { time, rank: Rank::LOAD, processor, what: What::Operation }),
            None => return self.fail(processor, Fault::Clock),
        }
        if self.ready.is_empty() && self.queue.len() == self.polling && !self.anything_to_see() {
            self.error = self.stuck();
        }
        None
    }

    /// What is wrong with a sequence to be scanned.
    fn senseless(&self, cells: &Sequence) -> Option<Fault> {
        if !cells.is_valid() {
            return Some(Fault::Sequence);
        }
        // The cell of the ring with the highest address, and the one that stands apart.
        let ends = [cells.turned(0).period() - 1, cells.turn(cells.ring() - 1)];
        let outside = ends.into_iter().map(|k| cells.at(k)).find(|&at| self.words.get(at).is_none());
        outside.map(Fault::Address)
    }

    /// Whether some processor's wait would end if nothing were written any more.
    fn anything_to_see(&self) -> bool {
        self.slots.iter().zip(&self.waits).any(|(slot, waiting)| match (slot.status, waiting) {
            (Status::Issued(Op::Wait { .. }), Some(Waiting { cells, until, .. })) => {
                (0..cells.period()).any(|k| self.words.get(cells.at(k)).is_some_and(|w| until.ends(w)))
            }
            _ => false,
        })
    }

    /// A watcher sees what it waits for.
    fn see(&mut self, now: Time, processor: u32, sight: Sight) {
        if let Status::Issued(Op::Wait { spins }) = self.slots[processor as usize].status {
            let outcome = self.end_wait(now, processor, sight, spins);
            self.resume(processor, outcome);
        }
    }

    /// The poll at `now` ends a wait.
    fn end_wait(&mut self, now: Time, processor: u32, sight: Sight, spins: bool) -> u64 {
        let cost = if spins { self.costs.spin } else { self.costs.scan };
        self.spend_until(processor, Cause::Idle, now);
        self.spend(processor, Cause::Idle, cost);
        self.stall(processor, sight.at, Kind::Read);
        self.counts(processor).polls += sight.polls + 1;
        if spins { self.words.get(sight.at).unwrap_or(0) } else { sight.position as u64 }
    }
}
