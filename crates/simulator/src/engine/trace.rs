//! What each processor did when, as intervals.

use std::fmt::Write;

use isolux_machine::{Cause, Mark};

/// A stretch of one processor's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interval {
    /// Whose.
    pub processor: usize,
    /// From when.
    pub start: u64,
    /// Until when.
    pub end: u64,
    /// What the time went to.
    pub cause: Cause,
    /// The label that the processor had entered.
    pub label: &'static str,
}

/// All intervals of a run: processor after processor, each from start to end without a gap.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trace {
    processors: Vec<Vec<Interval>>,
}

impl Trace {
    pub(super) fn new(processors: usize) -> Self {
        Self { processors: vec![vec![]; processors] }
    }

    /// Adds a stretch, to the last one if it is like it.
    pub(super) fn add(&mut self, processor: usize, start: u64, end: u64, mark: Mark) {
        let (cause, label) = (mark.cause, mark.label);
        match self.processors[processor].last_mut() {
            _ if start == end => {}
            Some(last) if (last.cause, last.label) == (cause, label) => last.end = end,
            _ => self.processors[processor].push(Interval { processor, start, end, cause, label }),
        }
    }

    /// The intervals, by processor, then by time.
    pub fn intervals(&self) -> impl Iterator<Item = &Interval> {
        self.processors.iter().flatten()
    }

    /// One line for each interval: processor, start, end, cause, label, with tabs between.
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        for i in self.intervals() {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{}\t{}\t{}\t{}\t{}", i.processor, i.start, i.end, i.cause.name(), i.label);
        }
        text
    }
}
