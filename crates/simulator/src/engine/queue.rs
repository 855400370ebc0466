//! Events still to come: pushed in any order, none before what was popped last, they come out in theirs.
//!
//! Most events lie a few units ahead, so those within a window have a list for each unit, and a bit that says whether there
//! is any. A heap has those beyond. When the window comes to where these lie they stay: whatever is next, in a list or in
//! the heap, is found by its time, and all events of that time are sorted together.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::event::Event;
use super::time::Time;

/// Units of the window: a bit for each in 64 words, and a bit for each word in one.
const WINDOW: usize = 64 * 64;

/// The end of a list.
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Node {
    event: Event,
    next: u32,
}

/// The events.
#[derive(Debug)]
pub(super) struct Queue {
    /// Those of the time `opened` that are still to come, the first of them last.
    batch: Vec<Event>,
    /// The time whose events have left lists and heap.
    opened: Option<Time>,
    /// The window's first unit. No event is before it, but for those of the batch.
    base: Time,
    /// The first node of each unit's list, by time modulo [`WINDOW`].
    lists: Box<[u32]>,
    /// The units, and the words of units, that have any.
    units: [u64; 64],
    words: u64,
    nodes: Vec<Node>,
    unused: u32,
    far: BinaryHeap<Reverse<Event>>,
    /// The first time in lists and heap, or the last time there is.
    next: Time,
    len: usize,
}

impl Default for Queue {
    fn default() -> Self {
        Self {
            batch: vec![],
            opened: None,
            base: Time(0),
            lists: vec![NONE; WINDOW].into_boxed_slice(),
            units: [0; 64],
            words: 0,
            nodes: vec![],
            unused: NONE,
            far: BinaryHeap::new(),
            next: Time(u64::MAX),
            len: 0,
        }
    }
}

impl Queue {
    /// Bytes of an event.
    pub(super) const EVENT_BYTES: usize = size_of::<Node>();

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Adds one that is not before the last one popped or announced.
    pub(super) fn push(&mut self, event: Event) {
        self.len += 1;
        if self.opened.is_some_and(|opened| event.time <= opened) {
            let at = self.batch.partition_point(|other| *other > event);
            self.batch.insert(at, event);
            return;
        }
        self.next = self.next.min(event.time);
        if event.time.0.wrapping_sub(self.base.0) >= WINDOW as u64 {
            self.far.push(Reverse(event));
            return;
        }
        let unit = unit(event.time);
        let node = Node { event, next: self.lists[unit] };
        if self.unused == NONE {
            self.lists[unit] = self.nodes.len() as u32;
            self.nodes.push(node);
        } else {
            self.lists[unit] = self.unused;
            let free = &mut self.nodes[self.unused as usize];
            self.unused = free.next;
            *free = node;
        }
        self.units[unit / 64] |= 1 << (unit % 64);
        self.words |= 1 << (unit / 64);
    }

    /// The first one.
    pub(super) fn pop(&mut self) -> Option<Event> {
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        if self.batch.is_empty() {
            self.open();
        }
        self.batch.pop()
    }

    /// Whether an event that is not before the last one popped would come first, as far as a glance tells: of those at the
    /// time of others, some are only found out when they are pushed. If so, it happens now: nothing that is pushed from
    /// here on is before it.
    pub(super) fn announce(&mut self, event: &Event) -> bool {
        match self.batch.last() {
            Some(first) => event < first,
            None if event.time < self.next => {
                self.base = self.base.max(event.time);
                true
            }
            None => false,
        }
    }

    /// All events of the next time become the batch. There are some.
    fn open(&mut self) {
        let now = self.next;
        (self.base, self.opened) = (now, Some(now));
        let unit = unit(now);
        let mut at = std::mem::replace(&mut self.lists[unit], NONE);
        while at != NONE {
            let node = &mut self.nodes[at as usize];
            self.batch.push(node.event);
            let next = std::mem::replace(&mut node.next, self.unused);
            self.unused = at;
            at = next;
        }
        self.units[unit / 64] &= !(1 << (unit % 64));
        if self.units[unit / 64] == 0 {
            self.words &= !(1 << (unit / 64));
        }
        while let Some(Reverse(event)) = self.far.peek()
            && event.time == now
        {
            self.batch.push(*event);
            self.far.pop();
        }
        if self.batch.len() > 1 {
            // Of one time; hardly ever do two differ in nothing but what they are.
            self.batch.sort_unstable_by(|a, b| b.order().cmp(&a.order()).then_with(|| b.what.cmp(&a.what)));
        }
        let far = self.far.peek().map_or(Time(u64::MAX), |Reverse(event)| event.time);
        self.next = far.min(self.next_unit(unit));
    }

    /// The time of the first unit of the window that has events, the window beginning at this unit; or the last time.
    fn next_unit(&self, begin: usize) -> Time {
        if self.words == 0 {
            return Time(u64::MAX);
        }
        let (word, bit) = (begin / 64, begin % 64);
        let here = self.units[word] & (u64::MAX << bit);
        let unit = if here != 0 {
            word * 64 + here.trailing_zeros() as usize
        } else {
            // The words behind, from the first again, and at last the rest of the first one.
            let behind = self.words.rotate_right(word as u32) & !1;
            let word = if behind != 0 { (word + behind.trailing_zeros() as usize) % 64 } else { word };
            word * 64 + self.units[word].trailing_zeros() as usize
        };
        Time(self.base.0.saturating_add(((unit + WINDOW - begin) % WINDOW) as u64))
    }
}

impl Extend<Event> for Queue {
    fn extend<T: IntoIterator<Item = Event>>(&mut self, events: T) {
        events.into_iter().for_each(|event| self.push(event));
    }
}

fn unit(time: Time) -> usize {
    (time.0 % WINDOW as u64) as usize
}

#[cfg(test)]
mod tests {
    use super::super::event::{Rank, What};
    use super::*;

    /// Catches an event that comes out of turn, is lost or comes twice: against a heap, with events at the present, near
    /// and far, at both sides of the window's end, and long stretches without any.
    #[test]
    fn events_come_in_order() {
        let mut random = 1_u64;
        let mut below = |n: u64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) % n
        };
        for round in 0..200 {
            let (mut queue, mut heap) = (Queue::default(), BinaryHeap::new());
            let mut now = Event { time: Time(below(9000)), rank: Rank::LOAD, processor: 0, what: What::Operation };
            for step in 0..3000_u32 {
                // Fills at first, then keeps its size, then empties.
                let pushes = if step < 200 { 1 + below(3) } else { u64::from(step < 2000) * below(3) };
                for _ in 0..pushes {
                    let ahead = match below(8) {
                        0 => 0,
                        1..5 => below(5),
                        5 => WINDOW as u64 - 2 + below(4),
                        6 => below(3 * WINDOW as u64),
                        _ => below(1 << 20) * below(2),
                    };
                    let ranks = [Rank::LOAD, Rank::STORE, Rank::UNLOCK];
                    let event = Event {
                        time: Time(now.time.0 + ahead),
                        rank: ranks[below(3) as usize],
                        processor: below(4) as u32,
                        what: What::Operation,
                    };
                    if event >= now {
                        if queue.announce(&event) {
                            assert!(heap.peek().is_none_or(|Reverse(first)| event < *first), "round {round}");
                            now = event;
                        } else {
                            queue.push(event);
                            heap.push(Reverse(event));
                        }
                    }
                }
                assert_eq!(queue.len(), heap.len());
                let popped = queue.pop();
                assert_eq!(popped, heap.pop().map(|Reverse(event)| event), "round {round}, step {step}");
                now = popped.unwrap_or(now);
            }
        }
    }
}
