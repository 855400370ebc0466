//! How much parallel work to do before the observer is asked again: what the last portion took comes in, the size of the
//! next goes out.

use std::time::{Duration, Instant};

/// What a portion is to take. With a tenth of a second in all from Ctrl-C to the answer in mind; starting threads costs
/// some tens of microseconds a portion, below 1 %.
const PORTION: Duration = Duration::from_millis(10);

/// Sizes of portions, so that each takes about [`PORTION`]. They never change a result.
#[derive(Debug)]
pub(crate) struct Pace {
    size: usize,
    least: usize,
    since: Instant,
}

impl Pace {
    /// Starts with `least` entries, one per thread or a few, and never takes fewer.
    pub(crate) fn starting(least: usize) -> Pace {
        let least = least.max(1);
        Pace { size: least, least, since: Instant::now() }
    }

    /// Entries of the next portion.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// A portion begins.
    pub(crate) fn begin(&mut self) {
        self.since = Instant::now();
    }

    /// The portion has ended: the next one may be up to twice as large.
    pub(crate) fn end(&mut self) {
        self.adapt(self.since.elapsed());
    }

    fn adapt(&mut self, took: Duration) {
        let fit = self.size as f64 * (PORTION.as_secs_f64() / took.as_secs_f64().max(1e-9));
        self.size = (fit as usize).clamp(self.least, 2 * self.size);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches portions that do not shrink when entries turn out to be slow, that grow without bound on one fast
    /// portion, and that vanish.
    #[test]
    fn portions_follow_what_they_take() {
        let mut pace = Pace::starting(4);
        pace.adapt(Duration::ZERO);
        assert_eq!(pace.size(), 8);
        pace.adapt(PORTION / 2);
        assert_eq!(pace.size(), 16);
        pace.adapt(PORTION);
        assert_eq!(pace.size(), 16);
        pace.adapt(2 * PORTION);
        assert_eq!(pace.size(), 8);
        pace.adapt(Duration::from_secs(5));
        assert_eq!(pace.size(), 4);
    }
}
