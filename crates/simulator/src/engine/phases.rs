//! Which of many watchers looks at a cell at a time: watchers go in by the phase of their turns, those that look come
//! out, without a pass over all.
//!
//! With `n` cells in the ring, `P` polls to a turn and `c` units to a poll, a watcher that began at `b` with cell `o`
//! looks at cell `q` at these times, modulo `P c` (see `Sequence::turn`), where `f = (q - o) mod n`:
//!
//! - forwards, `1 <= f <= n/2`: `b + c (2 f - 1)`, hence at `(b - 2 c o) + c (2 q - 1)`, plus `2 c n` if `q < o`;
//! - backwards, else: `b + 2 c (n - f)`, or `b` where `f = 0`, hence at `(b + 2 c o) - 2 c q`, plus `2 c n` if `q > o`;
//! - the one that stands apart: `b + c n`.
//!
//! So watchers are kept by each of the three terms that are their own, and the terms that fit a time and a cell are
//! looked up.

use rustc_hash::FxHashMap;

use super::time::Time;
use super::watch::{Kind, Watcher};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Term {
    Forwards(u64),
    Backwards(u64),
    Apart(u64),
}

/// The watchers of a group by phase.
#[derive(Debug, Default)]
pub(super) struct Phases {
    watchers: FxHashMap<Term, Vec<Watcher>>,
}

/// A turn in units, and a turn's part in the ring.
fn turn(kind: &Kind) -> (u64, u64) {
    (kind.cells.period() as u64 * kind.poll, kind.cells.ring() as u64 * kind.poll)
}

fn terms(kind: &Kind, watcher: &Watcher) -> [Term; 3] {
    let (turn, _) = turn(kind);
    let begin = watcher.begin.0 % turn;
    let own = 2 * kind.poll * u64::from(watcher.own);
    [Term::Forwards((begin + 2 * turn - own) % turn), Term::Backwards((begin + own) % turn), Term::Apart(begin)]
}

impl Phases {
    pub(super) fn add(&mut self, kind: &Kind, watcher: Watcher) {
        for term in terms(kind, &watcher) {
            self.watchers.entry(term).or_default().push(watcher);
        }
    }

    pub(super) fn remove(&mut self, kind: &Kind, watcher: &Watcher) {
        for term in terms(kind, watcher) {
            if let Some(same) = self.watchers.get_mut(&term) {
                same.retain(|w| w.processor != watcher.processor);
                if same.is_empty() {
                    self.watchers.remove(&term);
                }
            }
        }
    }

    /// Puts the sights of `cell` at `time` behind `sights`, in no order, some perhaps twice.
    pub(super) fn sights_at(&self, kind: &Kind, cell: u32, time: Time, sights: &mut Vec<(Time, u32)>) {
        let (turn, ring) = turn(kind);
        let (now, poll) = (time.0 % turn, kind.poll);
        let there = 2 * poll * u64::from(cell);
        let ring_terms = || {
            [
                Term::Forwards((now + poll + 4 * turn - there) % turn),
                Term::Forwards((now + poll + 4 * turn - there - 2 * ring) % turn),
                Term::Backwards((now + there) % turn),
                Term::Backwards((now + there + 2 * turn - 2 * ring) % turn),
            ]
        };
        let apart = [Term::Apart((now + turn - ring) % turn)];
        let (terms, apart) =
            if (cell as usize) < kind.cells.ring() { (Some(ring_terms()), None) } else { (None, Some(apart)) };
        for term in terms.into_iter().flatten().chain(apart.into_iter().flatten()) {
            let same = self.watchers.get(&term).into_iter().flatten();
            sights.extend(same.filter(|w| w.next(kind, cell, time) == time).map(|w| (time, w.processor)));
        }
    }
}

#[cfg(test)]
mod tests {
    use isolux_machine::{Condition, Home, Layout, Sequence};

    use super::super::watch::Until;
    use super::*;

    /// Catches a watcher that is overlooked or made up: all cells, starts and times of small rings, against the
    /// sequence itself.
    #[test]
    fn phases_find_who_looks() {
        let region = Layout::default().allocate("cells", 64, Home::RoundRobin, 1).expect("fits");
        let until = Until { condition: Condition::Positive, holds: true };
        for (count, poll, apart) in (1..=9).flat_map(|n| [(n, 1, false), (n, 1, true), (n, 3, false), (n, 3, true)]) {
            let ring = Sequence::around(region.at(1), 2, count, 0);
            let cells = if apart { ring.and(region.at(0)) } else { ring };
            let kind = Kind { cells, until, poll };
            let turn = kind.cells.period() as u64 * poll;
            let starts = (0..count as u32).flat_map(|own| (0..turn + 2).map(move |begin| (own, begin)));
            let mut watchers: Vec<_> = (0..)
                .zip(starts)
                .map(|(processor, (own, begin))| Watcher { processor, own, begin: Time(begin) })
                .collect();
            let mut phases = Phases::default();
            watchers.iter().for_each(|&w| phases.add(&kind, w));
            for _ in 0..2 {
                for (position, time) in (0..cells.period()).flat_map(|k| (turn + 2..3 * turn + 2).map(move |t| (k, t)))
                {
                    let at = cells.at(position);
                    let cell = cells.cell_at(at).expect("is a cell") as u32;
                    let looks = |w: &&Watcher| {
                        let since = time - w.begin.0;
                        let k = (since / poll) as usize % cells.period();
                        since.is_multiple_of(poll) && cells.turned(w.own as usize).at(k) == at
                    };
                    let expected: Vec<_> = watchers.iter().filter(looks).map(|w| (Time(time), w.processor)).collect();
                    let mut found = vec![];
                    phases.sights_at(&kind, cell, Time(time), &mut found);
                    found.sort_unstable();
                    found.dedup();
                    assert_eq!(found, expected, "{cells:?}, {poll} to a poll, cell {cell} at {time}");
                }
                // Again with every other one gone.
                watchers.retain(|w| {
                    let stays = w.processor % 2 == 0;
                    if !stays {
                        phases.remove(&kind, w);
                    }
                    stays
                });
            }
        }
    }
}
