//! The machine: accesses come in, levels and clocks go out, by the protocol of `crates/memory/README.md`; the order of
//! accesses and what happens between them are left to the caller. A dirty line that a neighbour reads is written back
//! at once (D26).

use crate::cache::{Caches, EMPTY};
use crate::counts::{Cause, Counts, Kind, Level};
use crate::directory::{self, Directory};
use crate::layout::{Address, Home, Layout, LayoutError, PAGE_BITS, PAGE_BYTES, Region};
use crate::spec::{Latency, Spec};

/// What became of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Access {
    /// Who served it.
    pub level: Level,
    /// What it cost.
    pub clocks: u32,
    /// Why neither own cache had the line; `None` if one had it.
    pub cause: Option<Cause>,
}

/// An access that no machine can serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AccessError {
    /// A processor that is not in use.
    #[error("processor {processor} accesses memory; {processors} are in use")]
    NoSuchProcessor {
        /// The processor.
        processor: usize,
        /// Processors in use.
        processors: usize,
    },
    /// An address beyond the pages of all regions.
    #[error("address {address:#x} is not allocated, addresses end at {end:#x}")]
    NotAllocated {
        /// The address.
        address: Address,
        /// The end of the last page.
        end: Address,
    },
}

/// A number of processors that the machine does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MachineError {
    /// None, or more than there are.
    #[error("{machine} has 1 to {most} processors, not {processors}")]
    Processors {
        /// The machine's name.
        machine: String,
        /// Processors asked for.
        processors: usize,
        /// Processors that it has.
        most: usize,
    },
}

/// The memory system of a machine and all that its caches hold.
#[derive(Clone, Debug)]
pub struct System {
    pub(crate) layout: Layout,
    /// The cache before the coherent one, if there are two levels.
    pub(crate) filter: Option<Caches>,
    /// The last level: the one that the directory knows of.
    pub(crate) coherent: Caches,
    pub(crate) directory: Directory,
    /// By region, then processor.
    pub(crate) counts: Vec<Counts>,
    pub(crate) processors: usize,
    pub(crate) per_cluster: usize,
    /// Cluster of each processor.
    pub(crate) cluster: Vec<u8>,
    latency: Latency,
    /// Accesses so far, the clock of replacement.
    pub(crate) now: u64,
    line_bits: u32,
    word_bits: u32,
    word_mask: u64,
    /// The level of a hit in the coherent cache.
    last_own: Level,
}

/// A line that a processor asks the machine for.
#[derive(Clone, Copy)]
struct Request {
    processor: usize,
    line: u32,
    word: u32,
    kind: Kind,
    page: usize,
    counter: usize,
}

impl System {
    /// The machine with this many processors in use, clusters filled in order; all caches and the address space are
    /// empty.
    ///
    /// # Errors
    /// If the machine does not have as many.
    pub fn new(spec: &Spec, processors: usize) -> Result<System, MachineError> {
        if processors == 0 || processors > spec.processors() {
            let machine = spec.name().to_owned();
            return Err(MachineError::Processors { machine, processors, most: spec.processors() });
        }
        let caches = |cache| Caches::new(cache, spec.line_bytes(), processors);
        let (filter, coherent, last_own) = match spec.second_level() {
            Some(second) => (Some(caches(&spec.first_level())), caches(&second), Level::Second),
            None => (None, caches(&spec.first_level()), Level::First),
        };
        let words = spec.line_bytes() / spec.word_bytes();
        let clusters = processors.div_ceil(spec.processors_per_cluster());
        let line_bits = spec.line_bytes().trailing_zeros();
        Ok(System {
            // Line u32::MAX stands for none: the page that has it is not handed out.
            layout: Layout::new(clusters, (u64::from(EMPTY) << line_bits) / PAGE_BYTES * PAGE_BYTES),
            filter,
            coherent,
            directory: Directory::new(processors, words as usize),
            counts: Vec::new(),
            processors,
            per_cluster: spec.processors_per_cluster(),
            cluster: (0..processors).map(|processor| (processor / spec.processors_per_cluster()) as u8).collect(),
            latency: spec.latency(),
            now: 0,
            line_bits,
            word_bits: spec.word_bytes().trailing_zeros(),
            word_mask: words - 1,
            last_own,
        })
    }

    /// Adds a named region without pages.
    ///
    /// # Errors
    /// If the name is taken or the home is not in use.
    pub fn region(&mut self, name: &str, home: Home) -> Result<Region, LayoutError> {
        let region = self.layout.region(name, home)?;
        self.counts.resize(self.counts.len() + self.processors, Counts::default());
        Ok(region)
    }

    /// Allocates bytes in a region: the address of the first, a multiple of `align`.
    ///
    /// # Errors
    /// If nothing is asked for, the alignment is no power of two up to a page, or the address space is full.
    pub fn allocate(&mut self, region: Region, bytes: u64, align: u64) -> Result<Address, LayoutError> {
        let address = self.layout.allocate(region, bytes, align)?;
        self.directory.grow(self.layout.pages.len() << (PAGE_BITS - self.line_bits));
        Ok(address)
    }

    /// One access to the word at this address.
    ///
    /// # Errors
    /// If the processor is not in use or the address is not allocated; nothing changes then.
    #[inline]
    pub fn access(&mut self, processor: usize, address: Address, kind: Kind) -> Result<Access, AccessError> {
        if processor >= self.processors {
            return Err(AccessError::NoSuchProcessor { processor, processors: self.processors });
        }
        let page = (address >> PAGE_BITS) as usize;
        let Some(region) = self.layout.pages.get(page).map(|page| page.region) else {
            return Err(AccessError::NotAllocated { address, end: self.layout.pages.len() as u64 * PAGE_BYTES });
        };
        let line = (address >> self.line_bits) as u32;
        let word = ((address >> self.word_bits) & self.word_mask) as u32;
        let counter = region as usize * self.processors + processor;
        self.now += 1;

        // A hit in the nearest level needs nobody else, unless it writes to a shared line.
        let filtered = self.filter.as_mut().and_then(|filter| {
            let found = filter.find(processor, line)?;
            let slot = &mut filter.slots[found];
            slot.used = self.now;
            Some(slot.data as usize)
        });
        let (own, level) = match filtered {
            Some(below) => (Some(below), Level::First),
            None => (self.coherent.find(processor, line), self.last_own),
        };
        let request = Request { processor, line, word, kind, page, counter };
        let Some(own) = own else {
            return Ok(self.miss(request));
        };
        let slot = &mut self.coherent.slots[own];
        if kind != Kind::Read {
            if slot.data == 0 {
                slot.used = self.now;
                return Ok(self.upgrade(request, own, filtered.is_none()));
            }
            slot.data |= 1 << word;
        }
        if filtered.is_none() {
            slot.used = self.now;
            self.fill_filter(processor, line, own);
        }
        self.counts[counter].serve(kind, level);
        Ok(Access { level, clocks: self.latency.clocks(level), cause: None })
    }

    /// The processor has the line shared and writes: it becomes the only one that has it.
    #[inline(never)]
    fn upgrade(&mut self, request: Request, own: usize, fill: bool) -> Access {
        let Request { processor, line, word, kind, page, counter } = request;
        let cluster = self.cluster[processor] as usize;
        let home = self.layout.pages[page].home_or(cluster);
        let level = ownership(self.directory.view(line).clusters(), cluster, home, true);
        self.invalidate_others(request);
        self.coherent.slots[own].data = 1 << word;
        if fill {
            self.fill_filter(processor, line, own);
        }
        let counts = &mut self.counts[counter];
        counts.upgrades += 1;
        counts.serve(kind, level);
        Access { level, clocks: self.latency.clocks(level), cause: None }
    }

    /// Neither own cache has the line.
    #[inline(never)]
    fn miss(&mut self, request: Request) -> Access {
        let Request { processor, line, word, kind, page, counter } = request;
        let cluster = self.cluster[processor] as usize;
        let home = self.layout.pages[page].home_or(cluster);

        // What the owner wrote becomes known; a read leaves it a shared copy, and home an up-to-date line.
        let mut entry = self.directory.entry(line);
        let owner = entry.view().owner();
        if let Some(owner) = owner
            && let Some(slot) = self.coherent.find(owner, line)
        {
            entry.write(self.coherent.slots[slot].data);
            if kind == Kind::Read {
                self.coherent.slots[slot].data = 0;
                entry.set_owner(None);
                self.counts[counter - processor + owner].writebacks += 1;
            }
        }

        let cause = if !directory::has(entry.view().had(), processor) {
            Cause::Cold
        } else if !directory::has(entry.view().gone(), processor) {
            Cause::Replacement
        } else if entry.is_stale(word as usize, processor) {
            Cause::TrueSharing
        } else {
            Cause::FalseSharing
        };

        let clusters = entry.view().clusters();
        let near = directory::any(entry.view().holds(), cluster * self.per_cluster, self.per_cluster);
        let level = match owner.map(|owner| self.cluster[owner] as usize) {
            Some(at) if at == cluster => Level::Neighbour,
            Some(at) if at == home || cluster == home => Level::RemoteCache,
            Some(_) => Level::ThirdCluster,
            None if kind != Kind::Read => ownership(clusters, cluster, home, near),
            None if near => Level::Neighbour,
            None if cluster == home => Level::LocalMemory,
            None => Level::RemoteMemory,
        };

        if kind == Kind::Read {
            entry.set_clusters(clusters | 1 << cluster);
            entry.obtain(processor);
        } else {
            self.invalidate_others(request);
            self.directory.entry(line).obtain(processor);
        }
        let own = self.make_room(processor, line);
        let slot = &mut self.coherent.slots[own];
        slot.line = line;
        slot.used = self.now;
        slot.data = if kind == Kind::Read { 0 } else { 1 << word };
        self.fill_filter(processor, line, own);

        let counts = &mut self.counts[counter];
        counts.miss(cause);
        counts.serve(kind, level);
        Access { level, clocks: self.latency.clocks(level), cause: Some(cause) }
    }

    /// Takes the line from all caches but the writer's, and gives it the ownership.
    fn invalidate_others(&mut self, request: Request) {
        let Request { processor, line, counter, .. } = request;
        for number in 0..self.processors.div_ceil(64) {
            let mut holders = self.directory.view(line).holds()[number];
            while holders != 0 {
                let other = number * 64 + holders.trailing_zeros() as usize;
                holders &= holders - 1;
                if other == processor {
                    continue;
                }
                if let Some(slot) = self.coherent.find(other, line) {
                    self.coherent.vacate(slot);
                }
                self.empty_filter(other, line);
                self.directory.entry(line).lose(other);
                self.counts[counter].invalidations += 1;
            }
        }
        let mut entry = self.directory.entry(line);
        entry.set_clusters(1 << self.cluster[processor]);
        entry.set_owner(Some(processor));
    }

    /// A vacant slot of the processor's coherent cache for this line; whatever was there leaves.
    fn make_room(&mut self, processor: usize, line: u32) -> usize {
        let own = self.coherent.victim(processor, line);
        let slot = self.coherent.slots[own];
        if slot.line != EMPTY {
            let mut entry = self.directory.entry(slot.line);
            entry.replace(processor);
            if slot.data != 0 {
                entry.write(slot.data);
                entry.set_owner(None);
                entry.set_clusters(0);
                let page = (slot.line >> (PAGE_BITS - self.line_bits)) as usize;
                let region = self.layout.pages[page].region as usize;
                self.counts[region * self.processors + processor].writebacks += 1;
            }
            self.empty_filter(processor, slot.line);
            self.coherent.vacate(own);
        }
        own
    }

    #[inline]
    fn fill_filter(&mut self, processor: usize, line: u32, own: usize) {
        if let Some(filter) = &mut self.filter {
            let victim = filter.victim(processor, line);
            let slot = &mut filter.slots[victim];
            slot.line = line;
            slot.used = self.now;
            slot.data = own as u32;
        }
    }

    fn empty_filter(&mut self, processor: usize, line: u32) {
        if let Some(filter) = &mut self.filter
            && let Some(slot) = filter.find(processor, line)
        {
            filter.vacate(slot);
        }
    }
}

/// What a write waits for (D25: sequential consistency) when no cache has the line dirty; `near`: a cache of the
/// cluster has it shared.
fn ownership(sharers: u64, cluster: usize, home: usize, near: bool) -> Level {
    let others = sharers & !(1 << cluster);
    if cluster != home {
        if others & !(1 << home) != 0 { Level::ThirdCluster } else { Level::RemoteMemory }
    } else if others != 0 {
        Level::RemoteCache
    } else if near {
        Level::Neighbour
    } else {
        Level::LocalMemory
    }
}

/// What a processor's caches have of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// Nothing.
    Nothing,
    /// A clean copy.
    Shared,
    /// The only copy, written since it was obtained.
    Dirty,
}

/// What the directory says of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listed {
    /// No cluster has it.
    Uncached,
    /// The clusters whose bits are set may have it.
    Shared(u64),
    /// This cluster has the only copy.
    Dirty(usize),
}

/// What can be asked of a system without changing what it answers to accesses.
impl System {
    /// Processors in use.
    pub fn processors(&self) -> usize {
        self.processors
    }

    /// Clusters in use.
    pub fn clusters(&self) -> usize {
        self.processors.div_ceil(self.per_cluster)
    }

    /// The cluster of a processor, if it is in use.
    pub fn cluster(&self, processor: usize) -> Option<usize> {
        self.cluster.get(processor).map(|&cluster| cluster as usize)
    }

    /// The home cluster of the page at this address; `None` if it has no page, or nobody touched it yet.
    pub fn home(&self, address: Address) -> Option<usize> {
        self.layout.pages.get((address >> PAGE_BITS) as usize)?.home()
    }

    /// The region of the page at this address.
    pub fn region_at(&self, address: Address) -> Option<Region> {
        self.layout.pages.get((address >> PAGE_BITS) as usize).map(|page| Region(page.region))
    }

    /// All regions with their names, in the order they were made.
    pub fn regions(&self) -> impl Iterator<Item = (Region, &str)> {
        self.layout.regions()
    }

    /// The name of a region.
    pub fn name(&self, region: Region) -> Option<&str> {
        self.layout.name(region)
    }

    /// What this processor's caches have of the line at this address.
    pub fn held(&self, processor: usize, address: Address) -> Held {
        if processor >= self.processors {
            return Held::Nothing;
        }
        match u32::try_from(address >> self.line_bits).ok().and_then(|line| self.coherent.find(processor, line)) {
            None => Held::Nothing,
            Some(slot) if self.coherent.slots[slot].data == 0 => Held::Shared,
            Some(_) => Held::Dirty,
        }
    }

    /// What the directory says of the line at this address; `Uncached` if it is not allocated.
    pub fn listed(&self, address: Address) -> Listed {
        match u32::try_from(address >> self.line_bits) {
            Ok(line) if line < self.directory.lines() => {
                let view = self.directory.view(line);
                match (view.owner(), view.clusters()) {
                    (Some(owner), _) => Listed::Dirty(self.cluster[owner] as usize),
                    (None, 0) => Listed::Uncached,
                    (None, clusters) => Listed::Shared(clusters),
                }
            }
            _ => Listed::Uncached,
        }
    }

    /// Counts of one processor in one region; zeros where there is none.
    pub fn counts(&self, region: Region, processor: usize) -> Counts {
        if processor >= self.processors {
            return Counts::default();
        }
        self.counts.get(region.0 as usize * self.processors + processor).copied().unwrap_or_default()
    }

    /// Counts of all processors in one region.
    pub fn region_counts(&self, region: Region) -> Counts {
        sum((0..self.processors).map(|processor| self.counts(region, processor)))
    }

    /// Counts of one processor in all regions.
    pub fn processor_counts(&self, processor: usize) -> Counts {
        sum(self.regions().map(|(region, _)| self.counts(region, processor)))
    }

    /// Counts of everything.
    pub fn total(&self) -> Counts {
        sum(self.counts.iter().copied())
    }

    /// Clocks of all accesses counted.
    pub fn clocks(&self, counts: &Counts) -> u64 {
        Level::ALL.iter().map(|&level| counts.at(level) * u64::from(self.latency.clocks(level))).sum()
    }

    /// Sets all counts to zero; caches, directory and homes stay as they are.
    pub fn reset_counts(&mut self) {
        self.counts = self.layout.counters(self.processors);
    }
}

fn sum(counts: impl Iterator<Item = Counts>) -> Counts {
    counts.fold(Counts::default(), |mut sum, more| {
        sum.add(&more);
        sum
    })
}
