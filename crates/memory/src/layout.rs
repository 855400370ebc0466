//! The simulated address space: regions ask for bytes, addresses come out; pages know their region and home, and what
//! is stored at an address is left to the caller.
//!
//! Layout: addresses start at 0. Pages are handed out in ascending order, each to one region. An allocation goes behind
//! the region's last one where its last page has room for all of it, and else onto new pages of its own, which follow
//! each other.

use crate::counts::Counts;

/// A simulated address: bytes from the start of the address space.
pub type Address = u64;

/// Bytes of a page: 4 KB, as the MIPS R3000 of DASH maps them (Kane, "MIPS RISC Architecture", 1988), and Intel 64 by
/// default.
pub const PAGE_BYTES: u64 = 4096;
pub(crate) const PAGE_BITS: u32 = PAGE_BYTES.trailing_zeros();

/// Where the pages of a region have their home.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Home {
    /// The page's number in the whole address space, modulo the clusters in use.
    RoundRobin,
    /// The cluster of the processor that accesses the page first.
    FirstTouch,
    /// This cluster.
    Cluster(usize),
}

/// A named part of the address space, of one system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Region(pub(crate) u16);

/// Why the address space does not grow.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// Two regions of one name could not be told apart in a report.
    #[error("there is a region {name} already")]
    Twice {
        /// The name.
        name: String,
    },
    /// A home cluster that is not in use.
    #[error("region {name} asks for home cluster {cluster}; {clusters} are in use")]
    NoSuchCluster {
        /// The region.
        name: String,
        /// The cluster it asks for.
        cluster: usize,
        /// Clusters in use.
        clusters: usize,
    },
    /// More regions than there are numbers for.
    #[error("region {name} is one too many: there can be {most}")]
    TooManyRegions {
        /// The region.
        name: String,
        /// How many there can be.
        most: usize,
    },
    /// A region of another system.
    #[error("there is no region {number}")]
    NoSuchRegion {
        /// Its number.
        number: u16,
    },
    /// An allocation of no bytes has no address of its own.
    #[error("region {name}: no bytes asked for")]
    Empty {
        /// The region.
        name: String,
    },
    /// Alignment is no power of two, or beyond a page.
    #[error("region {name}: alignment {align} is no power of two up to {PAGE_BYTES}")]
    Alignment {
        /// The region.
        name: String,
        /// The alignment asked for.
        align: u64,
    },
    /// Lines have no numbers left.
    #[error("region {name}: {bytes} more bytes do not fit, the address space ends at {end}")]
    Full {
        /// The region.
        name: String,
        /// Bytes asked for.
        bytes: u64,
        /// Where addresses end.
        end: u64,
    },
}

const MOST_REGIONS: usize = u16::MAX as usize;
/// A page nobody touched yet; clusters are below 64.
const NOWHERE: u8 = u8::MAX;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Page {
    pub(crate) region: u16,
    home: u8,
}

impl Page {
    pub(crate) fn home(self) -> Option<usize> {
        (self.home != NOWHERE).then_some(self.home as usize)
    }

    /// The home; the first to ask with its cluster decides where there is none yet.
    pub(crate) fn home_or(&mut self, cluster: usize) -> usize {
        if self.home == NOWHERE {
            self.home = cluster as u8;
        }
        self.home as usize
    }
}

#[derive(Clone, Debug)]
struct Part {
    name: String,
    home: Home,
    next: Address,
    end: Address,
}

#[derive(Clone, Debug)]
pub(crate) struct Layout {
    parts: Vec<Part>,
    pub(crate) pages: Vec<Page>,
    clusters: usize,
    end: Address,
}

impl Layout {
    /// An empty address space of `clusters` homes that ends at `end`, a multiple of the page.
    pub(crate) fn new(clusters: usize, end: Address) -> Layout {
        Layout { parts: Vec::new(), pages: Vec::new(), clusters, end }
    }

    pub(crate) fn region(&mut self, name: &str, home: Home) -> Result<Region, LayoutError> {
        let name = name.to_owned();
        if self.parts.iter().any(|part| part.name == name) {
            return Err(LayoutError::Twice { name });
        }
        if self.parts.len() == MOST_REGIONS {
            return Err(LayoutError::TooManyRegions { name, most: MOST_REGIONS });
        }
        if let Home::Cluster(cluster) = home
            && cluster >= self.clusters
        {
            return Err(LayoutError::NoSuchCluster { name, cluster, clusters: self.clusters });
        }
        self.parts.push(Part { name, home, next: 0, end: 0 });
        Ok(Region((self.parts.len() - 1) as u16))
    }

    pub(crate) fn allocate(&mut self, region: Region, bytes: u64, align: u64) -> Result<Address, LayoutError> {
        let part = self.parts.get_mut(region.0 as usize).ok_or(LayoutError::NoSuchRegion { number: region.0 })?;
        if bytes == 0 {
            return Err(LayoutError::Empty { name: part.name.clone() });
        }
        if !align.is_power_of_two() || align > PAGE_BYTES {
            return Err(LayoutError::Alignment { name: part.name.clone(), align });
        }
        let next = part.next.next_multiple_of(align);
        if next.checked_add(bytes).is_some_and(|behind| behind <= part.end) {
            part.next = next + bytes;
            return Ok(next);
        }
        let first = self.pages.len() as u64;
        let start = first * PAGE_BYTES;
        if bytes > self.end - start {
            return Err(LayoutError::Full { name: part.name.clone(), bytes, end: self.end });
        }
        for number in first..first + bytes.div_ceil(PAGE_BYTES) {
            let home = match part.home {
                Home::RoundRobin => (number % self.clusters as u64) as u8,
                Home::FirstTouch => NOWHERE,
                Home::Cluster(cluster) => cluster as u8,
            };
            self.pages.push(Page { region: region.0, home });
        }
        part.next = start + bytes;
        part.end = self.pages.len() as u64 * PAGE_BYTES;
        Ok(start)
    }

    pub(crate) fn name(&self, region: Region) -> Option<&str> {
        self.parts.get(region.0 as usize).map(|part| part.name.as_str())
    }

    pub(crate) fn regions(&self) -> impl Iterator<Item = (Region, &str)> {
        self.parts.iter().enumerate().map(|(number, part)| (Region(number as u16), part.name.as_str()))
    }

    /// Counters that go with each region, one for each of `processors`.
    pub(crate) fn counters(&self, processors: usize) -> Vec<Counts> {
        vec![Counts::default(); self.parts.len() * processors]
    }
}
