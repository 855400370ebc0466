//! What an access to a word costs beyond its operation's figure: the processor, the word and the kind of access come
//! in, in the order of effects, and the units come out. The values of words are kept elsewhere.

use std::fmt::Debug;

use isolux_machine::{Address, ClockUnit, Home, MemoryError, Region};
use isolux_memory::Kind;

use crate::spec::{MachineSpec, SpecError};

/// A memory, as the engine drives it.
pub trait Memory: Debug + Sized {
    /// Whether it has caches, so that it matters what was accessed before.
    const CACHES: bool;
    /// What the clock of a machine with it counts.
    const UNIT: ClockUnit;

    /// The memory of a machine of so many processors, without words.
    ///
    /// # Errors
    ///
    /// When the figures are those of another kind of memory.
    fn new(spec: &MachineSpec, processors: usize) -> Result<Self, SpecError>;

    /// A region has been allocated behind all others.
    ///
    /// # Errors
    ///
    /// When there is no room for it.
    fn allocate(&mut self, name: &str, region: Region, home: Home) -> Result<(), MemoryError>;

    /// Words from a lock to the next; `None` where locks are not in memory.
    fn lock_words(&self) -> Option<u64>;

    /// One access to a word of a region: units beyond the figure of the operation.
    fn access(&mut self, processor: u32, at: Address, kind: Kind) -> u64;

    /// Reads of all these words, each line once: units beyond hits.
    fn touch(&mut self, processor: u32, at: Address, words: u64) -> u64;
}

/// Uniform access: every access costs what the figure of its operation says.
#[derive(Debug)]
pub struct Uniform;

impl Memory for Uniform {
    const CACHES: bool = false;
    const UNIT: ClockUnit = ClockUnit::Instructions;

    fn new(spec: &MachineSpec, _: usize) -> Result<Self, SpecError> {
        match spec.caches() {
            None => Ok(Self),
            Some(_) => Err(SpecError::Memory { file: spec.file.clone(), caches: true }),
        }
    }

    fn allocate(&mut self, _: &str, _: Region, _: Home) -> Result<(), MemoryError> {
        Ok(())
    }

    fn lock_words(&self) -> Option<u64> {
        None
    }

    #[inline]
    fn access(&mut self, _: u32, _: Address, _: Kind) -> u64 {
        0
    }

    fn touch(&mut self, _: u32, _: Address, _: u64) -> u64 {
        0
    }
}
