//! The one check of a system: it lists what must hold between any two accesses, and names the first thing that does
//! not.

use crate::System;
use crate::cache::Caches;
use crate::counts::{Counts, Level};
use crate::directory::has;

/// An invariant that does not hold, with the line (its number) and the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Broken {
    /// A line outside its set, or twice in it, or used in the future, or two lines of a set used at once.
    #[error("processor {processor}: line {line} is out of place")]
    Place {
        /// The processor.
        processor: usize,
        /// The line.
        line: u32,
    },
    /// A line in the first level that the second does not have where the first believes it.
    #[error("processor {processor}: line {line} is in the first level alone")]
    Inclusion {
        /// The processor.
        processor: usize,
        /// The line.
        line: u32,
    },
    /// A dirty line that is not its only copy, or a dirty cache that the directory does not name, or the other way
    /// round.
    #[error("processor {processor}: line {line} has not this one writer")]
    Writer {
        /// The processor.
        processor: usize,
        /// The line.
        line: u32,
    },
    /// A copy in a cluster that the directory does not know of, or a dirty line with more clusters than its owner's.
    #[error("line {line}: the directory's sharers {sharers:#x} are not those of the caches")]
    Sharers {
        /// The line.
        line: u32,
        /// The clusters that the directory names.
        sharers: u64,
    },
    /// The index of holders, or the history of losses, contradicts the caches or itself.
    #[error("processor {processor}: the history of line {line} contradicts itself")]
    History {
        /// The processor.
        processor: usize,
        /// The line.
        line: u32,
    },
    /// A cached line whose page nobody touched.
    #[error("processor {processor}: line {line} is cached, its page has no home")]
    Homeless {
        /// The processor.
        processor: usize,
        /// The line.
        line: u32,
    },
    /// Misses and upgrades are not as many as the accesses served beyond the own caches.
    #[error("processor {processor}: the counts of region {region} do not add up")]
    Counts {
        /// The processor.
        processor: usize,
        /// The region's number.
        region: usize,
    },
}

impl System {
    /// Checks, for every line of every cache and of the directory:
    ///
    /// 1. **Place**: a line is in the set of its number, once, in both levels; no two slots of a set were used at the same
    ///    time, and none in the future.
    /// 2. **Inclusion**: what the first level has, the same processor's second level has, in the slot that the first names.
    /// 3. **Single writer**: if a processor has a line dirty, it is the directory's owner and nobody else has a copy; the
    ///    directory's owner has the line dirty.
    /// 4. **Directory**: the clusters with a copy are among its sharers; the sharers of a dirty line are its owner's cluster.
    /// 5. **History**: the holders on record are those whose cache has the line; they once obtained it and have not lost it;
    ///    words are stale only to processors that lost the line.
    /// 6. **Homes**: the page of a cached line has a home.
    /// 7. **Counts**: accesses served beyond the own caches are misses and upgrades.
    ///
    /// Takes time in proportion to caches and memory: for tests.
    ///
    /// # Errors
    /// The first invariant that does not hold.
    pub fn check(&self) -> Result<(), Broken> {
        self.check_places(&self.coherent)?;
        if let Some(filter) = &self.filter {
            self.check_places(filter)?;
            for (_, processor, slot) in filter.occupied() {
                if self.coherent.find(processor, slot.line) != Some(slot.data as usize) {
                    return Err(Broken::Inclusion { processor, line: slot.line });
                }
            }
        }
        for (_, processor, slot) in self.coherent.occupied() {
            let line = slot.line;
            let view = self.directory.view(line);
            let copies: u32 = view.holds().iter().map(|bits| bits.count_ones()).sum();
            if (slot.data != 0) != (view.owner() == Some(processor)) || (slot.data != 0 && copies != 1) {
                return Err(Broken::Writer { processor, line });
            }
            if !has(view.holds(), processor) {
                return Err(Broken::History { processor, line });
            }
            let page = line as usize / (self.directory.lines() as usize / self.layout.pages.len());
            if self.layout.pages[page].home().is_none() {
                return Err(Broken::Homeless { processor, line });
            }
        }
        for line in 0..self.directory.lines() {
            self.check_line(line)?;
        }
        for (number, counts) in self.counts.iter().enumerate() {
            if beyond(counts) != counts.misses() + counts.upgrades {
                return Err(Broken::Counts { processor: number % self.processors, region: number / self.processors });
            }
        }
        Ok(())
    }

    fn check_places(&self, caches: &Caches) -> Result<(), Broken> {
        for (number, processor, slot) in caches.occupied() {
            let set = caches.set(processor, slot.line);
            let mates = || (set..set + caches.ways).filter(|&mate| mate != number).map(|mate| caches.slots[mate]);
            if !(set..set + caches.ways).contains(&number)
                || slot.used > self.now
                || mates().any(|mate| mate.line == slot.line || mate.used == slot.used)
            {
                return Err(Broken::Place { processor, line: slot.line });
            }
        }
        Ok(())
    }

    fn check_line(&self, line: u32) -> Result<(), Broken> {
        let view = self.directory.view(line);
        let mut clusters = 0_u64;
        for processor in 0..self.processors {
            let holds = has(view.holds(), processor);
            let gone = has(view.gone(), processor);
            if holds != self.coherent.find(processor, line).is_some()
                || (holds && gone)
                || ((holds || gone) && !has(view.had(), processor))
                || (!gone && view.stale().any(|word| has(word, processor)))
            {
                return Err(Broken::History { processor, line });
            }
            if holds {
                clusters |= 1 << self.cluster[processor];
            }
            if view.owner() == Some(processor) && !holds {
                return Err(Broken::Writer { processor, line });
            }
        }
        let sharers = view.clusters();
        let exact = view.owner().is_some();
        if clusters & !sharers != 0 || (exact && clusters != sharers) {
            return Err(Broken::Sharers { line, sharers });
        }
        Ok(())
    }
}

/// Accesses that were served beyond the own caches.
fn beyond(counts: &Counts) -> u64 {
    Level::ALL.iter().filter(|&&level| level > Level::Second).map(|&level| counts.at(level)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Home, Kind, Spec};

    /// Two levels, processors 0 and 1 in cluster 0, 2 in cluster 1: 0 and 2 share line 0, 1 has line 1 dirty.
    fn system() -> System {
        let text = "name = 'x'\nclock_mhz = 1\nclusters = 2\nprocessors_per_cluster = 2\nline_bytes = 16\nword_bytes = 4\n\
                    [first_level]\nbytes = 64\nways = 2\n[second_level]\nbytes = 128\nways = 2\n\
                    [latency]\nfirst_level = 1\nsecond_level = 2\nneighbour = 3\nlocal_memory = 4\nremote_memory = 5\n\
                    remote_cache = 6\n";
        let mut system = System::new(&Spec::parse("x.toml", text).unwrap(), 3).unwrap();
        let region = system.region("all", Home::FirstTouch).unwrap();
        system.allocate(region, 4096, 4096).unwrap();
        for (processor, address, kind) in [(0, 0, Kind::Read), (2, 0, Kind::Read), (1, 16, Kind::Write)] {
            system.access(processor, address, kind).unwrap();
        }
        system.check().unwrap();
        system
    }

    /// Would catch a check that overlooks what it promises: each row breaks one thing in a sound system.
    #[test]
    fn whatever_breaks_is_found() {
        type Break = fn(&mut System);
        let rows: [(Break, Broken); 12] = [
            (
                |s| {
                    let at = s.coherent.find(0, 0).unwrap();
                    s.coherent.slots[at].line = 1;
                },
                Broken::Place { processor: 0, line: 1 },
            ),
            (
                |s| {
                    let at = s.coherent.find(0, 0).unwrap();
                    s.coherent.slots[at ^ 1] = s.coherent.slots[at];
                },
                Broken::Place { processor: 0, line: 0 },
            ),
            (
                |s| {
                    let at = s.coherent.find(2, 0).unwrap();
                    s.coherent.slots[at].used = 99;
                },
                Broken::Place { processor: 2, line: 0 },
            ),
            (
                |s| {
                    let at = s.coherent.find(2, 0).unwrap();
                    s.coherent.vacate(at);
                },
                Broken::Inclusion { processor: 2, line: 0 },
            ),
            (
                |s| {
                    let filter = s.filter.as_mut().unwrap();
                    let at = filter.find(2, 0).unwrap();
                    filter.slots[at].data += 1;
                },
                Broken::Inclusion { processor: 2, line: 0 },
            ),
            (
                |s| {
                    let at = s.coherent.find(2, 0).unwrap();
                    s.coherent.slots[at].data = 1;
                },
                Broken::Writer { processor: 2, line: 0 },
            ),
            (|s| s.directory.entry(1).set_owner(None), Broken::Writer { processor: 1, line: 1 }),
            (|s| s.directory.entry(1).obtain(0), Broken::Writer { processor: 1, line: 1 }),
            (|s| s.directory.entry(0).set_clusters(0b01), Broken::Sharers { line: 0, sharers: 0b01 }),
            (|s| s.directory.entry(1).set_clusters(0b11), Broken::Sharers { line: 1, sharers: 0b11 }),
            (|s| s.directory.entry(0).replace(2), Broken::History { processor: 2, line: 0 }),
            (|s| s.counts[0].upgrades += 1, Broken::Counts { processor: 0, region: 0 }),
        ];
        for (number, (change, broken)) in rows.into_iter().enumerate() {
            let mut system = system();
            change(&mut system);
            assert_eq!(system.check(), Err(broken), "row {number}");
        }
    }
}
