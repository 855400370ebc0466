//! What a solve and whoever waits for it tell each other: stop, how far it is, and the bounds that it must keep.

use crate::link::Link;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Shared by a solve and whoever watches it. Every entry is a hint by itself: nothing else is read after it, so all
/// accesses are relaxed.
#[derive(Debug, Default)]
pub struct Control {
    stop: AtomicBool,
    stage: AtomicU32,
    elements: AtomicUsize,
    links: AtomicUsize,
}

impl Control {
    /// Asks the solve to end soon. It then ends with what its last whole stage had.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Was it asked to?
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Stages begun, elements and links so far.
    #[must_use]
    pub fn state(&self) -> (u32, usize, usize) {
        let load = |value: &AtomicUsize| value.load(Ordering::Relaxed);
        (self.stage.load(Ordering::Relaxed), load(&self.elements), load(&self.links))
    }

    pub(crate) fn begin_stage(&self) {
        self.stage.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn tell(&self, elements: usize, links: usize) {
        self.elements.store(elements, Ordering::Relaxed);
        self.links.store(links, Ordering::Relaxed);
    }
}

/// What ended a solve before its error was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// The number of elements.
    Elements,
    /// The memory.
    Memory,
    /// The time.
    Time,
    /// [`Control::stop`].
    Stop,
    /// Refinement that no longer brings anything: single precision, or the least area of elements.
    Resolution,
}

/// Bytes that an element takes while it is solved: geometry, and light as fields, means and slopes.
pub(crate) const ELEMENT: usize = size_of::<crate::geometry::Element>() + 260;

/// Bytes that lamps' light takes by element, and the sky's beyond it.
pub(crate) const LIT: usize = size_of::<crate::light::Field>() + size_of::<f32>();
pub(crate) const SKY: usize = size_of::<crate::light::Field<2>>() + size_of::<crate::sky::Known>();

/// Bytes of a link: in its list, and in the copy that a stopped stage returns to.
pub(crate) const LINK: usize = 2 * size_of::<Link>();

/// The bounds of a solve.
pub(crate) struct Budget<'a> {
    pub(crate) elements: usize,
    pub(crate) bytes: usize,
    /// What the scene and its trees take already.
    pub(crate) fixed: usize,
    /// What each element takes.
    pub(crate) element: usize,
    pub(crate) deadline: Option<Instant>,
    /// Seconds that each element takes between refinement and the deadline, foreseen.
    pub(crate) rest: f64,
    pub(crate) control: &'a Control,
}

impl Budget<'_> {
    /// The first bound that so many elements and links break, if any.
    pub(crate) fn broken(&self, elements: usize, links: usize) -> Option<Bound> {
        self.control.tell(elements, links);
        if self.control.is_stopped() {
            Some(Bound::Stop)
        } else if elements >= self.elements {
            Some(Bound::Elements)
        } else if self.fixed + elements * self.element + links * LINK >= self.bytes {
            Some(Bound::Memory)
        } else if self.is_late(elements) {
            Some(Bound::Time)
        } else {
            None
        }
    }

    /// Would what follows the refinement to so many elements end after the deadline?
    pub(crate) fn is_late(&self, elements: usize) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() + self.rest_of(elements) >= deadline)
    }

    fn rest_of(&self, elements: usize) -> Duration {
        Duration::from_secs_f64(self.rest * elements as f64)
    }
}
