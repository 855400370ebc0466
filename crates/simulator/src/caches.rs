//! Caches and a directory behind the engine: accesses go to the memory system of `isolux-memory`, what they take beyond
//! a hit comes back; counts of misses are read here, by region.

use isolux_machine::{Address, ClockUnit, Home, MemoryError, PAGE_WORDS, Region};
use isolux_memory::{Counts, Kind, Level, System};

use crate::engine::{Memory, SimulatorOf};
use crate::spec::{MachineSpec, SpecError};

/// A machine's word: 8 bytes.
const WORD_BYTES: u64 = 8;

/// The memory of a cache-coherent machine. What waits accesses it at its first poll and at the one that ends the wait (D27);
/// barriers do not access it: their cost is a formula (D28).
#[derive(Debug)]
pub struct Caches {
    system: System,
    /// Clocks of a hit in the first level.
    hit: u64,
    line_bytes: u64,
    per_cluster: usize,
}

impl Memory for Caches {
    const CACHES: bool = true;
    const UNIT: ClockUnit = ClockUnit::Clocks;

    fn new(spec: &MachineSpec, processors: usize) -> Result<Self, SpecError> {
        let absent = || SpecError::Memory { file: spec.file.clone(), caches: false };
        let memory = spec.caches().ok_or_else(absent)?;
        let system = System::new(memory, processors).expect("the number of processors is checked before");
        let hit = u64::from(memory.latency().clocks(Level::First));
        let per_cluster = memory.processors_per_cluster();
        Ok(Self { system, hit, line_bytes: memory.line_bytes(), per_cluster })
    }

    fn allocate(&mut self, name: &str, region: Region, home: Home) -> Result<(), MemoryError> {
        let home = match home {
            Home::RoundRobin => isolux_memory::Home::RoundRobin,
            Home::FirstTouch => isolux_memory::Home::FirstTouch,
            Home::At(processor) => isolux_memory::Home::Cluster(processor / self.per_cluster),
        };
        let too_large = |_| MemoryError::TooLarge { name: name.to_owned(), words: region.words() };
        // Both layouts hand out whole pages of 4 KB in ascending order, so a word's number tells its address.
        let bytes = region.words().next_multiple_of(PAGE_WORDS) * WORD_BYTES;
        let it = self.system.region(name, home).map_err(too_large)?;
        let at = self.system.allocate(it, bytes, isolux_memory::PAGE_BYTES).map_err(too_large)?;
        assert_eq!(at, region.at(0).word() * WORD_BYTES, "two layouts of one address space");
        Ok(())
    }

    fn lock_words(&self) -> Option<u64> {
        Some((self.line_bytes / WORD_BYTES).max(1))
    }

    #[inline]
    fn access(&mut self, processor: u32, at: Address, kind: Kind) -> u64 {
        match self.system.access(processor as usize, at.word() * WORD_BYTES, kind) {
            Ok(access) => u64::from(access.clocks) - self.hit,
            Err(error) => unreachable!("the word was found before: {error}"),
        }
    }

    fn touch(&mut self, processor: u32, at: Address, words: u64) -> u64 {
        let first = at.word() * WORD_BYTES;
        let lines = (first & !(self.line_bytes - 1)..first + words * WORD_BYTES).step_by(self.line_bytes as usize);
        let mut beyond = 0;
        for line in lines {
            match self.system.access(processor as usize, line, Kind::Read) {
                Ok(access) => beyond += u64::from(access.clocks) - self.hit,
                Err(error) => unreachable!("the words were found before: {error}"),
            }
        }
        beyond
    }
}

impl SimulatorOf<Caches> {
    /// What happened in each region since the counts were last reset, all processors together, in the order in which
    /// the regions were allocated. Locks have regions of their own, `locks 0`, `locks 17`, ..., by the number of their
    /// first one.
    pub fn region_counts(&self) -> Vec<(String, Counts)> {
        let counts = |memory: &Caches| {
            let system = &memory.system;
            system.regions().map(|(region, name)| (name.to_owned(), system.region_counts(region))).collect()
        };
        self.memory(counts)
    }

    /// The same of one region; `None` if no region is called so.
    pub fn counts_of(&self, name: &str) -> Option<Counts> {
        self.memory(|memory| {
            let (region, _) = memory.system.regions().find(|(_, n)| *n == name)?;
            Some(memory.system.region_counts(region))
        })
    }

    /// What each processor did, in all regions together.
    pub fn processor_counts(&self) -> Vec<Counts> {
        self.memory(|m| (0..m.system.processors()).map(|p| m.system.processor_counts(p)).collect())
    }

    /// Sets all counts to zero. Caches, directory and homes stay as they are, from run to run, too.
    pub fn reset_counts(&mut self) {
        self.memory_mut(|memory| memory.system.reset_counts());
    }
}
