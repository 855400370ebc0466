//! The names of levels, causes and kinds of access, and the counters kept by them; the system does the counting.

/// What a processor asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A load.
    Read,
    /// A store.
    Write,
    /// An atomic read and write of one word.
    ReadModifyWrite,
}

impl Kind {
    /// All kinds, in the order of the counters.
    pub const ALL: [Kind; 3] = [Kind::Read, Kind::Write, Kind::ReadModifyWrite];
}

/// Who served an access, from near to far.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// The processor's own cache, first level.
    First,
    /// The processor's own cache, second level.
    Second,
    /// A cache of the same cluster, or ownership over the cluster's bus.
    Neighbour,
    /// Memory of the own cluster.
    LocalMemory,
    /// Memory of another cluster, two hops.
    RemoteMemory,
    /// A cache of another cluster, two hops.
    RemoteCache,
    /// A cache of a cluster that is neither the asking one nor home, three hops.
    ThirdCluster,
}

impl Level {
    /// All levels, in the order of the counters.
    pub const ALL: [Level; 7] = [
        Level::First,
        Level::Second,
        Level::Neighbour,
        Level::LocalMemory,
        Level::RemoteMemory,
        Level::RemoteCache,
        Level::ThirdCluster,
    ];
}

/// Why an access found nothing in the processor's own caches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Cause {
    /// The processor never had the line.
    Cold,
    /// The processor replaced the line by another (capacity or conflict).
    Replacement,
    /// Another processor's write took the line, and the word asked for was written since.
    TrueSharing,
    /// Another processor's write took the line, but other words were written.
    FalseSharing,
}

impl Cause {
    /// All causes, in the order of the counters.
    pub const ALL: [Cause; 4] = [Cause::Cold, Cause::Replacement, Cause::TrueSharing, Cause::FalseSharing];
}

/// What happened, counted; of one processor in one region, or a sum of such.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    served: [[u64; Level::ALL.len()]; Kind::ALL.len()],
    missed: [u64; Cause::ALL.len()],
    /// Writes to lines that the processor held shared: no miss, but ownership had to be obtained.
    pub upgrades: u64,
    /// Copies in other processors' caches that this processor's writes made invalid.
    pub invalidations: u64,
    /// Dirty lines that this processor's cache gave back to memory: replaced, or read by another.
    pub writebacks: u64,
}

impl Counts {
    #[inline]
    pub(crate) fn serve(&mut self, kind: Kind, level: Level) {
        self.served[kind as usize][level as usize] += 1;
    }

    pub(crate) fn miss(&mut self, cause: Cause) {
        self.missed[cause as usize] += 1;
    }

    /// Accesses of this kind that this level served.
    pub fn served(&self, kind: Kind, level: Level) -> u64 {
        self.served[kind as usize][level as usize]
    }

    /// Misses of this cause.
    pub fn missed(&self, cause: Cause) -> u64 {
        self.missed[cause as usize]
    }

    /// All accesses.
    pub fn accesses(&self) -> u64 {
        self.served.iter().flatten().sum()
    }

    /// All misses: accesses for which neither own cache had the line.
    pub fn misses(&self) -> u64 {
        self.missed.iter().sum()
    }

    /// Accesses that this level served, of every kind.
    pub fn at(&self, level: Level) -> u64 {
        self.served.iter().map(|levels| levels[level as usize]).sum()
    }

    pub(crate) fn add(&mut self, other: &Counts) {
        for (sum, more) in self.served.iter_mut().flatten().zip(other.served.iter().flatten()) {
            *sum += more;
        }
        for (sum, more) in self.missed.iter_mut().zip(&other.missed) {
            *sum += more;
        }
        self.upgrades += other.upgrades;
        self.invalidations += other.invalidations;
        self.writebacks += other.writebacks;
    }
}
