//! What is known of a program after it ran: the clock, where every processor's time went, and how often it did what.

use crate::machine::RunError;
use crate::operation::Work;
use crate::processor::Cause;

/// What a machine's clock counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockUnit {
    /// Units of a simulated machine's time: one instruction.
    Instructions,
    /// Clocks of a simulated machine's processors.
    Clocks,
    /// Nanoseconds of real time.
    Nanoseconds,
    /// Operations, charged work not included.
    Operations,
}

/// Time by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByCause([u64; Cause::ALL.len()]);

impl ByCause {
    /// Time that went to a cause.
    pub fn get(&self, cause: Cause) -> u64 {
        self.0[cause as usize]
    }

    /// Adds time to a cause.
    pub fn add(&mut self, cause: Cause, time: u64) {
        self.0[cause as usize] += time;
    }

    /// Time in all.
    pub fn total(&self) -> u64 {
        self.0.iter().sum()
    }
}

/// How often a processor did what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Words loaded, polls not included.
    pub loads: u64,
    /// Words stored.
    pub stores: u64,
    /// Multiprefix operations taken part in.
    pub prefixes: u64,
    /// Looks at words while waiting; on real threads they depend on the moment.
    pub polls: u64,
    /// Locks taken.
    pub locks: u64,
    /// Barriers passed.
    pub barriers: u64,
    /// Work charged, by class.
    pub work: Work,
}

impl Counts {
    /// Adds another's counts.
    pub fn add(&mut self, other: &Self) {
        self.loads += other.loads;
        self.stores += other.stores;
        self.prefixes += other.prefixes;
        self.polls += other.polls;
        self.locks += other.locks;
        self.barriers += other.barriers;
        self.work.add(&other.work);
    }
}

/// A program that ran to its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Run<T> {
    /// What each processor's program returned.
    pub values: Vec<T>,
    /// The time at which the last processor ended; the run began at 0.
    pub clock: u64,
    /// What the clock counts.
    pub unit: ClockUnit,
    /// Where each processor's time went; each adds up to the clock.
    pub time: Vec<ByCause>,
    /// What each processor did.
    pub counts: Vec<Counts>,
    /// The time of the longest chain of work, each piece of which depends on the one before, as the program's notes
    /// have it ([`crate::Note`]). Of all time only that with [`Cause::Work`] is part of it. 0 on machines that do not
    /// measure it.
    pub span: u64,
}

impl<T> Run<T> {
    /// Checks that every processor's time adds up to the clock, hence all of it to processors times clock, so that the
    /// clock is no less than work divided by processors; and that it is no less than the span.
    ///
    /// # Errors
    ///
    /// Names the first processor whose time does not, or the span.
    pub fn check(self) -> Result<Self, RunError> {
        if self.span > self.clock {
            return Err(RunError::Span { span: self.span, clock: self.clock });
        }
        match self.time.iter().position(|t| t.total() != self.clock) {
            Some(processor) => {
                Err(RunError::Accounting { processor, sum: self.time[processor].total(), clock: self.clock })
            }
            None => Ok(self),
        }
    }

    /// All processors' time by cause.
    pub fn total_time(&self) -> ByCause {
        let mut total = ByCause::default();
        for cause in Cause::ALL {
            total.add(cause, self.time.iter().map(|t| t.get(cause)).sum());
        }
        total
    }

    /// All processors' time with [`Cause::Work`].
    pub fn work(&self) -> u64 {
        self.time.iter().map(|t| t.get(Cause::Work)).sum()
    }

    /// What all processors did together.
    pub fn total_counts(&self) -> Counts {
        let mut total = Counts::default();
        self.counts.iter().for_each(|c| total.add(c));
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches accounts that lose time and pass, and chains of work longer than the run.
    #[test]
    fn lost_time_is_found() {
        let mut time = vec![ByCause::default(); 2];
        time[0].add(Cause::Work, 3);
        time[0].add(Cause::Idle, 4);
        time[1].add(Cause::Steal, 6);
        let run = Run { values: vec![(); 2], clock: 7, unit: ClockUnit::Operations, time, counts: vec![], span: 3 };
        assert_eq!((run.total_time().total(), run.work()), (13, 3));
        assert_eq!(run.clone().check(), Err(RunError::Accounting { processor: 1, sum: 6, clock: 7 }));
        assert_eq!(Run { span: 8, ..run }.check(), Err(RunError::Span { span: 8, clock: 7 }));
    }
}
