//! The figures of a machine's memory system, from a spec file; each is checked here, and an error names the file and
//! the key. Figures of the same machine that others read (the tables `wait`, `lock`, `barrier` and `work`) are left to
//! them.

use crate::Level;
use crate::reader::{Section, SpecError, read};
use std::path::Path;

/// The figures of a machine. Only [`Spec::parse`] makes one, so that its figures make sense together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spec {
    name: String,
    clock_mhz: u32,
    clusters: usize,
    processors_per_cluster: usize,
    line_bytes: u64,
    word_bytes: u64,
    first_level: CacheSpec,
    second_level: Option<CacheSpec>,
    latency: Latency,
}

/// A cache: its size and the ways of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheSpec {
    /// Bytes of all lines together, a power of two.
    pub bytes: u64,
    /// Lines of a set.
    pub ways: u64,
}

/// Clocks for an access by the level that serves it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latency([u32; Level::ALL.len()]);

impl Latency {
    /// Clocks of an access that this level serves; 0 for levels that the machine does not have.
    pub fn clocks(&self, level: Level) -> u32 {
        self.0[level as usize]
    }
}

/// The text of DASH's spec file, `crates/memory/specs/dash.toml`.
pub const DASH: &str = include_str!("../specs/dash.toml");
/// The text of the two sockets' spec file, `crates/memory/specs/two-socket.toml`.
pub const TWO_SOCKET: &str = include_str!("../specs/two-socket.toml");

/// Tables of a spec file that say nothing of memory.
const OTHERS: [&str; 4] = ["wait", "lock", "barrier", "work"];

/// Sharers are the bits of one word of the directory.
const MOST_CLUSTERS: i64 = 64;
/// Bounds the snooping of one bus; sockets of today have up to 64 cores that share one.
const MOST_PER_CLUSTER: i64 = 64;
/// Written words of a line are the bits of a `u32`.
const MOST_WORDS: i64 = 32;
/// 1 GB: beyond it, a figure in kilobytes was most likely given in bytes.
const MOST_CACHE_BYTES: i64 = 1 << 30;
/// Lines of all caches of a level together: slots have numbers of 32 bits, and this many take 4 GB of the host's
/// memory.
const MOST_LINES: i64 = 1 << 28;
/// No machine's memory is a million clocks away; keeps sums in 64 bits.
const MOST_CLOCKS: i64 = 1_000_000;
const MOST_MHZ: i64 = 100_000;

impl Spec {
    /// The Stanford DASH prototype, from `crates/memory/specs/dash.toml`: one level of caches (D23), and a remote cache
    /// as far as a home cluster (D24).
    ///
    /// # Errors
    /// None that a test would not have met: the file is part of the program.
    pub fn dash() -> Result<Spec, SpecError> {
        Spec::parse("dash.toml", DASH)
    }

    /// A server with two Cascade Lake sockets, from `crates/memory/specs/two-socket.toml`.
    ///
    /// # Errors
    /// None that a test would not have met: the file is part of the program.
    pub fn two_socket() -> Result<Spec, SpecError> {
        Spec::parse("two-socket.toml", TWO_SOCKET)
    }

    /// Reads a spec file.
    ///
    /// # Errors
    /// The first thing wrong with the file.
    pub fn read(path: &Path) -> Result<Spec, SpecError> {
        let (file, text) = read(path)?;
        Spec::parse(&file, &text)
    }

    /// Reads the text of a spec file; `file` is what errors call it.
    ///
    /// # Errors
    /// The first thing wrong with the text.
    pub fn parse(file: &str, text: &str) -> Result<Spec, SpecError> {
        let mut top = Section::parse(file, text)?;
        for others in OTHERS {
            top.section(others)?;
        }
        let it = Spec::take(&mut top)?;
        top.done()?;
        Ok(it)
    }

    /// Takes the figures of the memory system out of a spec file that may have others.
    ///
    /// # Errors
    /// The first thing wrong with them.
    pub fn take(top: &mut Section<'_>) -> Result<Spec, SpecError> {
        let name = top.text("name")?;
        let clock_mhz = top.integer("clock_mhz", 1, MOST_MHZ)?;
        let clusters = top.integer("clusters", 1, MOST_CLUSTERS)?;
        let processors_per_cluster = top.integer("processors_per_cluster", 1, MOST_PER_CLUSTER)?;
        let word_bytes = top.power_of_two("word_bytes", 1, 64)?;
        let line_bytes = top.power_of_two("line_bytes", word_bytes, MOST_WORDS * word_bytes)?;
        let first = cache(top.required("first_level")?, line_bytes, line_bytes)?;
        let second = match top.section("second_level")? {
            Some(section) => Some(cache(section, line_bytes, first.bytes as i64)?),
            None => None,
        };
        let processors = clusters * processors_per_cluster;
        for (key, cache) in [("first_level.bytes", Some(first)), ("second_level.bytes", second)] {
            if let Some(CacheSpec { bytes, .. }) = cache
                && bytes as i64 / line_bytes > MOST_LINES / processors
            {
                let reason = format!("{processors} of these have more than {MOST_LINES} lines");
                return Err(top.absurd(key, bytes as i64, reason));
            }
        }
        let latency = latency(top.required("latency")?, second.is_some(), clusters)?;
        Ok(Spec {
            name,
            clock_mhz: clock_mhz as u32,
            clusters: clusters as usize,
            processors_per_cluster: processors_per_cluster as usize,
            line_bytes: line_bytes as u64,
            word_bytes: word_bytes as u64,
            first_level: first,
            second_level: second,
            latency,
        })
    }

    /// What the machine is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Clocks per microsecond.
    pub fn clock_mhz(&self) -> u32 {
        self.clock_mhz
    }

    /// Clusters of the whole machine, at most 64.
    pub fn clusters(&self) -> usize {
        self.clusters
    }

    /// Processors of a cluster, at most 64.
    pub fn processors_per_cluster(&self) -> usize {
        self.processors_per_cluster
    }

    /// Bytes of a line, the same at both levels.
    pub fn line_bytes(&self) -> u64 {
        self.line_bytes
    }

    /// Bytes of the words by which sharing is judged true or false.
    pub fn word_bytes(&self) -> u64 {
        self.word_bytes
    }

    /// The cache next to the processor.
    pub fn first_level(&self) -> CacheSpec {
        self.first_level
    }

    /// The cache behind it, which contains it.
    pub fn second_level(&self) -> Option<CacheSpec> {
        self.second_level
    }

    /// What each level costs.
    pub fn latency(&self) -> Latency {
        self.latency
    }

    /// Processors of the whole machine.
    pub fn processors(&self) -> usize {
        self.clusters * self.processors_per_cluster
    }
}

fn cache(mut section: Section<'_>, line: i64, least: i64) -> Result<CacheSpec, SpecError> {
    let bytes = section.power_of_two("bytes", least, MOST_CACHE_BYTES)?;
    let ways = section.integer("ways", 1, MOST_CACHE_BYTES)?;
    if bytes % (line * ways) != 0 {
        return Err(section.absurd(
            "ways",
            ways,
            format!("{bytes} bytes are not a whole number of sets of {ways} lines"),
        ));
    }
    section.done()?;
    Ok(CacheSpec { bytes: bytes as u64, ways: ways as u64 })
}

fn latency(mut section: Section<'_>, second: bool, clusters: i64) -> Result<Latency, SpecError> {
    // Keys that the machine has a use for, each after those that it must not undercut.
    let mut clocks = [0; Level::ALL.len()];
    for (level, key, exists, nearer) in [
        (Level::First, "first_level", true, &[][..]),
        (Level::Second, "second_level", second, &[Level::First]),
        (Level::Neighbour, "neighbour", true, &[Level::First, Level::Second]),
        (Level::LocalMemory, "local_memory", true, &[Level::Neighbour]),
        (Level::RemoteMemory, "remote_memory", clusters > 1, &[Level::LocalMemory]),
        (Level::RemoteCache, "remote_cache", clusters > 1, &[Level::LocalMemory]),
        (Level::ThirdCluster, "third_cluster", clusters > 2, &[Level::RemoteMemory, Level::RemoteCache]),
    ] {
        if !exists {
            if section.has(key) {
                let value = section.integer(key, i64::MIN, i64::MAX)?;
                return Err(section.absurd(key, value, "this machine has no such level"));
            }
            continue;
        }
        let value = section.integer(key, 1, MOST_CLOCKS)?;
        let bound = nearer.iter().map(|&l: &Level| clocks[l as usize]).max().unwrap_or(0);
        if value < i64::from(bound) {
            return Err(section.absurd(key, value, format!("a nearer level takes {bound} clocks")));
        }
        clocks[level as usize] = value as u32;
    }
    section.done()?;
    Ok(Latency(clocks))
}
