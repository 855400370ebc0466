//! Processors that wait for words: watchers and writes go in, the polls that find a cell fulfilled come out, as events.
//! The polls that find nothing are computed, not simulated.
//!
//! A watcher that began at time `b` looks at cell number `k mod n` of its sequence at time `b + k c`, where `c` is the
//! cost of a poll. Watchers of the same cells with the same condition form a group. A cell that fulfils the condition
//! is *lit*. For each lit cell the next sights of it are in the event queue; if it goes dark first, they find nothing.

use std::collections::BTreeMap;

use isolux_machine::{Address, Condition, Sequence, Words};
use rustc_hash::FxHashMap;

use super::event::{Event, Rank, What};
use super::phases::Phases;
use super::queue::Queue;
use super::time::Time;

/// What ends a wait: that the condition holds, or that it does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Until {
    pub(super) condition: Condition,
    pub(super) holds: bool,
}

impl Until {
    pub(super) fn ends(self, word: u64) -> bool {
        self.condition.holds(word) == self.holds
    }
}

/// What a group has in common; the sequence as seen from cell 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Kind {
    pub(super) cells: Sequence,
    pub(super) until: Until,
    pub(super) poll: u64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Watcher {
    pub(super) processor: u32,
    pub(super) own: u32,
    pub(super) begin: Time,
}

/// How far the sights of a lit cell are in the event queue.
#[derive(Clone, Copy, Debug)]
struct Lit {
    /// The last of them; none if nobody watches.
    last: Option<(Time, u32)>,
    /// How many to compute next. Doubles, so that a cell that one watcher takes costs one event, and one that wakes all
    /// costs one pass over the watchers for each doubling.
    batch: usize,
}

/// Rings of so many cells have their watchers kept by phase. In a smaller one many watchers share a phase.
const RING_WITH_PHASES: usize = 4;

const FIRST_BATCH: Lit = Lit { last: None, batch: 1 };

#[derive(Debug)]
struct Group {
    kind: Kind,
    watchers: Vec<Watcher>,
    /// The same by phase, where there are several cells.
    phases: Option<Phases>,
    lit: BTreeMap<u32, Lit>,
}

/// A poll that ends a wait.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// Its number in its turn.
    pub(super) position: usize,
    /// Polls after the first.
    pub(super) polls: u64,
    /// Where it looked.
    pub(super) at: Address,
}

/// All groups of a run.
#[derive(Debug, Default)]
pub(super) struct Watches {
    groups: Vec<Group>,
    unused: Vec<u32>,
    kinds: FxHashMap<Kind, u32>,
    /// Groups of one cell, by its address; they go with their last watcher.
    single: FxHashMap<Address, Vec<u32>>,
    /// Groups of several cells; they stay, since which of their cells are lit took a pass to find out.
    several: Vec<u32>,
    /// Where a processor watches: its group, and its place there.
    places: Vec<Option<(u32, usize)>>,
    candidates: Vec<(Time, u32)>,
}

impl Watcher {
    /// The first poll of `cell` at `from` or later, but not the watcher's first poll of all.
    pub(super) fn next(&self, kind: &Kind, cell: u32, from: Time) -> Time {
        let period = kind.cells.period() as u64;
        let ahead = kind.cells.turned(self.own as usize).turn(cell as usize) as u64;
        let least = from.0.saturating_sub(self.begin.0).div_ceil(kind.poll).max(1);
        let here = least % period;
        let k = least + if ahead >= here { ahead - here } else { ahead + period - here };
        Time(k.saturating_mul(kind.poll).saturating_add(self.begin.0))
    }
}

impl Group {
    /// Puts the next sights of a lit cell into the queue: those after `last`, or from `from` on.
    fn light(&mut self, id: u32, cell: u32, from: Time, candidates: &mut Vec<(Time, u32)>, queue: &mut Queue) {
        let Some(lit) = self.lit.get_mut(&cell) else { return };
        let after = lit.last.take();
        let kind = self.kind;
        candidates.clear();
        if let Some(phases) = &self.phases {
            // Watchers of many cells look at one at times spread over a turn: the next sights are soon, and asking time
            // after time finds them before a pass over all does. A time costs about as much as 8 watchers.
            let mut time = from;
            for _ in 0..=self.watchers.len() / 8 {
                phases.sights_at(&kind, cell, time, candidates);
                candidates.retain(|&sight| Some(sight) > after);
                if candidates.len() >= lit.batch {
                    candidates.sort_unstable();
                    candidates.dedup();
                    lit.batch = lit.batch.saturating_mul(2);
                    lit.last = candidates.last().copied();
                    queue.extend(candidates.iter().map(|&(time, processor)| sight(time, processor, id, cell)));
                    return;
                }
                time = Time(time.0.saturating_add(1));
            }
            candidates.clear();
        }
        candidates.extend(self.watchers.iter().filter_map(|w| {
            let sight = (w.next(&kind, cell, from), w.processor);
            (Some(sight) > after).then_some(sight)
        }));
        if candidates.len() > lit.batch {
            candidates.select_nth_unstable(lit.batch);
            candidates.truncate(lit.batch);
            lit.batch = lit.batch.saturating_mul(2);
        }
        lit.last = candidates.iter().copied().max();
        queue.extend(candidates.iter().map(|&(time, processor)| sight(time, processor, id, cell)));
    }
}

fn sight(time: Time, processor: u32, group: u32, cell: u32) -> Event {
    Event { time, rank: Rank::LOAD, processor, what: What::Sight { group, cell } }
}

impl Watches {
    /// Bytes of a processor that waits at words that nobody else waits for: a group, which is found by its kind and by
    /// its cell, with room for four watchers and one number; tables are up to twice as large as what is in them.
    pub(super) const GROUP_BYTES: usize = size_of::<Group>()
        + 4 * size_of::<Watcher>()
        + 2 * (size_of::<(Kind, u32)>() + size_of::<(Address, Vec<u32>)>())
        + 16;

    /// For a run of so many processors.
    pub(super) fn new(processors: usize) -> Self {
        Self { places: vec![None; processors], ..Self::default() }
    }

    /// `processor` begins to watch; its first poll, at `begin`, found nothing.
    #[expect(clippy::too_many_arguments, reason = "a wait in full, and where its sights go")]
    pub(super) fn watch(
        &mut self,
        processor: u32,
        cells: Sequence,
        until: Until,
        poll: u64,
        begin: Time,
        words: &Words,
        queue: &mut Queue,
    ) {
        let kind = Kind { cells: cells.turned(0), until, poll };
        let id = match self.kinds.get(&kind) {
            Some(&id) => id,
            None => self.add_group(kind, words),
        };
        let group = &mut self.groups[id as usize];
        let watcher = Watcher { processor, own: cells.own() as u32, begin };
        self.places[processor as usize] = Some((id, group.watchers.len()));
        group.watchers.push(watcher);
        if let Some(phases) = &mut group.phases {
            phases.add(&kind, watcher);
        }
        for (&cell, lit) in &mut group.lit {
            let time = watcher.next(&kind, cell, begin);
            if lit.last.is_none_or(|last| (time, processor) < last) {
                lit.last = lit.last.or(Some((time, processor)));
                queue.push(sight(time, processor, id, cell));
            }
        }
    }

    fn add_group(&mut self, kind: Kind, words: &Words) -> u32 {
        let fulfilled = |k: usize| words.get(kind.cells.at(k)).is_some_and(|w| kind.until.ends(w));
        let cells = 0..kind.cells.period();
        let lit = cells.filter(|&cell| fulfilled(kind.cells.turn(cell))).map(|cell| (cell as u32, FIRST_BATCH));
        let phases = (kind.cells.ring() >= RING_WITH_PHASES).then(Phases::default);
        let group = Group { kind, watchers: vec![], phases, lit: lit.collect() };
        let id = match self.unused.pop() {
            Some(id) => {
                self.groups[id as usize] = group;
                id
            }
            None => {
                self.groups.push(group);
                self.groups.len() as u32 - 1
            }
        };
        self.kinds.insert(kind, id);
        if kind.cells.period() == 1 {
            self.single.entry(kind.cells.at(0)).or_default().push(id);
        } else {
            self.several.push(id);
        }
        id
    }

    /// A word was written at `now`; polls of later times see it.
    pub(super) fn written(&mut self, at: Address, word: u64, now: Time, queue: &mut Queue) {
        let single = self.single.get(&at).into_iter().flatten();
        for &id in single.chain(&self.several) {
            let group = &mut self.groups[id as usize];
            let Some(cell) = group.kind.cells.cell_at(at).map(|cell| cell as u32) else { continue };
            if !group.kind.until.ends(word) {
                group.lit.remove(&cell);
            } else if let std::collections::btree_map::Entry::Vacant(dark) = group.lit.entry(cell) {
                dark.insert(FIRST_BATCH);
                group.light(id, cell, Time(now.0.saturating_add(1)), &mut self.candidates, queue);
            }
        }
    }

    /// An announced sight comes up: whether it ends the processor's wait.
    pub(super) fn sight(&mut self, event: Event, queue: &mut Queue) -> Option<Sight> {
        let What::Sight { group: id, cell } = event.what else { return None };
        let seen = self.look(event);
        if seen.is_some() {
            self.leave(event.processor);
        }
        let group = &mut self.groups[id as usize];
        if group.lit.get(&cell).is_some_and(|lit| lit.last == Some((event.time, event.processor))) {
            group.light(id, cell, event.time, &mut self.candidates, queue);
        }
        self.drop_if_empty(id);
        seen
    }

    /// What the processor sees if it polls at the event's time. That the event was announced for an earlier state of
    /// things does not matter.
    fn look(&self, event: Event) -> Option<Sight> {
        let (id, place) = self.places[event.processor as usize]?;
        let group = &self.groups[id as usize];
        let watcher = group.watchers[place];
        if event.time <= watcher.begin || !event.time.since(watcher.begin).is_multiple_of(group.kind.poll) {
            return None;
        }
        let polls = event.time.since(watcher.begin) / group.kind.poll;
        let position = (polls % group.kind.cells.period() as u64) as usize;
        let at = group.kind.cells.turned(watcher.own as usize).at(position);
        let cell = group.kind.cells.cell_at(at)? as u32;
        group.lit.contains_key(&cell).then_some(Sight { position, polls, at })
    }

    fn leave(&mut self, processor: u32) {
        if let Some((id, place)) = self.places[processor as usize].take() {
            let group = &mut self.groups[id as usize];
            let watcher = group.watchers.swap_remove(place);
            if let Some(phases) = &mut group.phases {
                phases.remove(&group.kind, &watcher);
            }
            if let Some(moved) = group.watchers.get(place) {
                self.places[moved.processor as usize] = Some((id, place));
            }
        }
    }

    fn drop_if_empty(&mut self, id: u32) {
        let group = &self.groups[id as usize];
        let kind = group.kind;
        if kind.cells.period() > 1 || !group.watchers.is_empty() || self.kinds.get(&kind) != Some(&id) {
            return;
        }
        self.kinds.remove(&kind);
        let at = kind.cells.at(0);
        if let Some(groups) = self.single.get_mut(&at) {
            groups.retain(|&g| g != id);
            if groups.is_empty() {
                self.single.remove(&at);
            }
        }
        self.unused.push(id);
    }
}
