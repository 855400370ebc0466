//! Names and sizes of regions become addresses of shared words, each with a home; and the words of machines that one
//! thread runs.

use crate::Fault;
use thiserror::Error;

/// Words on a page: 4 KB. A region starts on a page of its own, and a page has one home.
pub const PAGE_WORDS: u64 = 512;

/// Words that a machine can name. Two to the power 34 words are 128 GB: more than a run touches, and few enough for the
/// table of a machine's chunks (8 bytes for 4096 words) to fit.
const WORDS_MAX: u64 = 1 << 34;

/// A shared word of a machine. Comes from a [`Region`], never from the host's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address(u64);

impl Address {
    /// The number of the word among all words of the machine.
    pub fn word(self) -> u64 {
        self.0
    }

    /// The word that is `words` further on; that it lies in the same region is the caller's business.
    #[must_use]
    pub fn plus(self, words: u64) -> Self {
        Self(self.0.saturating_add(words))
    }
}

/// Consecutive words that were allocated together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    first: u64,
    words: u64,
}

impl Region {
    /// The address of the region's word `index`.
    ///
    /// # Panics
    ///
    /// As a slice does, when `index` is not below [`Region::words`].
    pub fn at(self, index: u64) -> Address {
        assert!(index < self.words, "word {index} of a region of {} words", self.words);
        Address(self.first + index)
    }

    /// How many words the region has.
    pub fn words(self) -> u64 {
        self.words
    }
}

/// Which processor's memory a page of a region lies in, on machines where that matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Home {
    /// Page after page, processor after processor.
    RoundRobin,
    /// The processor that touches the page first.
    FirstTouch,
    /// This processor, all pages.
    At(usize),
}

/// Why a region cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MemoryError {
    /// Two regions of one name.
    #[error("there is a region named {name:?} already")]
    Duplicate {
        /// The name.
        name: String,
    },
    /// A region without words.
    #[error("region {name:?} has no words")]
    Empty {
        /// The name.
        name: String,
    },
    /// More words than a machine can name.
    #[error("region {name:?} of {words} words does not fit: a machine has {WORDS_MAX} words")]
    TooLarge {
        /// The name.
        name: String,
        /// What was asked for.
        words: u64,
    },
    /// A home that is no processor.
    #[error("region {name:?} is to be at processor {home}, but there are {processors}")]
    NoSuchHome {
        /// The name of the region.
        name: String,
        /// The processor asked for.
        home: usize,
        /// How many there are.
        processors: usize,
    },
}

#[derive(Clone, Debug)]
struct Entry {
    name: String,
    region: Region,
    home: Home,
}

/// All regions of a machine, in the order of their addresses.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    entries: Vec<Entry>,
    limit: u64,
}

impl Layout {
    /// Adds a region behind the last one, on a page of its own, for a machine of `processors`.
    ///
    /// # Errors
    ///
    /// Says which name, size or home is at fault.
    pub fn allocate(&mut self, name: &str, words: u64, home: Home, processors: usize) -> Result<Region, MemoryError> {
        let name = name.to_owned();
        if self.entries.iter().any(|e| e.name == name) {
            return Err(MemoryError::Duplicate { name });
        }
        if words == 0 {
            return Err(MemoryError::Empty { name });
        }
        if let Home::At(home) = home
            && home >= processors
        {
            return Err(MemoryError::NoSuchHome { name, home, processors });
        }
        let first = self.limit;
        match words.checked_next_multiple_of(PAGE_WORDS).and_then(|w| w.checked_add(first)) {
            Some(limit) if limit <= WORDS_MAX => self.limit = limit,
            _ => return Err(MemoryError::TooLarge { name, words }),
        }
        let region = Region { first, words };
        self.entries.push(Entry { name, region, home });
        Ok(region)
    }

    /// The number of words up to the end of the last page.
    pub fn limit(&self) -> u64 {
        self.limit
    }

    /// Whether `address` lies on a page of a region.
    pub fn contains(&self, address: Address) -> bool {
        address.0 < self.limit
    }

    /// The region that `address` lies in, by name, and the number of the word in it.
    pub fn describe(&self, address: Address) -> Option<(&str, u64)> {
        self.entry(address).map(|e| (e.name.as_str(), address.0 - e.region.first))
    }

    /// The home of `address` among `processors`; `None` where the first touch decides, and outside all regions.
    pub fn home(&self, address: Address, processors: usize) -> Option<usize> {
        let entry = self.entry(address)?;
        match entry.home {
            Home::RoundRobin => {
                let page = (address.0 - entry.region.first) / PAGE_WORDS;
                usize::try_from(page % u64::try_from(processors.max(1)).ok()?).ok()
            }
            Home::FirstTouch => None,
            Home::At(processor) => Some(processor),
        }
    }

    fn entry(&self, address: Address) -> Option<&Entry> {
        let behind = self.entries.partition_point(|e| e.region.first <= address.0);
        let entry = self.entries.get(behind.checked_sub(1)?)?;
        (address.0 - entry.region.first < entry.region.words).then_some(entry)
    }
}

/// Words of a chunk of [`Words`].
const CHUNK_WORDS: usize = 1 << 12;

type Chunk = Option<Box<[u64; CHUNK_WORDS]>>;

/// The words of a machine that one thread runs, zero at first. Memory is taken in chunks, as they are written.
#[derive(Debug, Default)]
pub struct Words {
    limit: u64,
    chunks: Vec<Chunk>,
}

impl Words {
    /// Makes all words up to the end of the layout reachable.
    pub fn cover(&mut self, layout: &Layout) {
        self.limit = layout.limit();
        self.chunks.resize_with(self.limit.div_ceil(CHUNK_WORDS as u64) as usize, || None);
    }

    /// A word; `None` outside the layout.
    #[inline]
    pub fn get(&self, at: Address) -> Option<u64> {
        if at.0 >= self.limit {
            return None;
        }
        let (chunk, word) = split(at);
        Some(self.chunks[chunk].as_ref().map_or(0, |c| c[word]))
    }

    /// Reads consecutive words; `None` if one of them is outside the layout.
    #[inline]
    pub fn read(&self, at: Address, words: &mut [u64]) -> Option<()> {
        if at.0.checked_add(words.len() as u64)? > self.limit {
            return None;
        }
        let (chunk, word) = split(at);
        if word + words.len() > CHUNK_WORDS {
            for (word, address) in words.iter_mut().zip(at.0..) {
                *word = self.get(Address(address))?;
            }
            return Some(());
        }
        match self.chunks.get(chunk).and_then(Option::as_ref) {
            Some(chunk) => words.copy_from_slice(&chunk[word..word + words.len()]),
            None => words.fill(0),
        }
        Some(())
    }

    /// Sets a word between runs.
    ///
    /// # Panics
    /// Outside the layout.
    pub fn poke(&mut self, at: Address, value: u64) {
        match self.get_mut(at) {
            Some(word) => *word = value,
            None => panic!("{}", Fault::Address(at)),
        }
    }

    /// A word to be written; `None` outside the layout.
    #[inline]
    pub fn get_mut(&mut self, at: Address) -> Option<&mut u64> {
        if at.0 >= self.limit {
            return None;
        }
        let (chunk, word) = split(at);
        Some(&mut self.chunks[chunk].get_or_insert_with(new_chunk)[word])
    }
}

#[cold]
fn new_chunk() -> Box<[u64; CHUNK_WORDS]> {
    vec![0; CHUNK_WORDS].into_boxed_slice().try_into().expect("as many words")
}

/// The chunk of a word, and its place there.
fn split(at: Address) -> (usize, usize) {
    let word = at.0 as usize;
    (word / CHUNK_WORDS, word % CHUNK_WORDS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches regions that overlap, share a page, or are taken for one another.
    #[test]
    fn regions_lie_apart_on_pages_of_their_own() {
        let mut layout = Layout::default();
        let a = layout.allocate("a", 1, Home::FirstTouch, 2).expect("fits");
        let b = layout.allocate("b", PAGE_WORDS + 1, Home::RoundRobin, 2).expect("fits");
        let c = layout.allocate("c", 3, Home::At(1), 2).expect("fits");
        assert_eq!([a.at(0).word(), b.at(0).word(), c.at(0).word()], [0, PAGE_WORDS, 3 * PAGE_WORDS]);
        assert_eq!(layout.describe(b.at(PAGE_WORDS)), Some(("b", PAGE_WORDS)));
        assert_eq!(layout.describe(Address(1)), None, "between two regions");
        assert_eq!(layout.home(a.at(0), 2), None);
        assert_eq!([0, PAGE_WORDS - 1, PAGE_WORDS].map(|i| layout.home(b.at(i), 2)), [Some(0), Some(0), Some(1)]);
        assert_eq!(layout.home(c.at(2), 2), Some(1));
    }

    /// Catches a wrong region that is accepted, and an error that names the wrong thing.
    #[test]
    fn wrong_regions_are_refused_by_name() {
        let mut layout = Layout::default();
        layout.allocate("a", 1, Home::RoundRobin, 2).expect("fits");
        let name = || "a".to_owned();
        let mut ask = |n: &str, words, home| layout.allocate(n, words, home, 2).expect_err("is wrong");
        assert_eq!(ask("a", 1, Home::RoundRobin), MemoryError::Duplicate { name: name() });
        assert_eq!(ask("b", 0, Home::RoundRobin), MemoryError::Empty { name: "b".to_owned() });
        assert_eq!(
            ask("b", u64::MAX, Home::RoundRobin),
            MemoryError::TooLarge { name: "b".to_owned(), words: u64::MAX }
        );
        assert_eq!(ask("b", 1, Home::At(2)), MemoryError::NoSuchHome { name: "b".to_owned(), home: 2, processors: 2 });
    }

    /// Catches words that share storage, that are not zero at first, and that are reached outside all regions.
    #[test]
    fn words_are_zero_and_keep_their_values() {
        let mut layout = Layout::default();
        let mut words = Words::default();
        let region = layout.allocate("a", 1 << 33, Home::RoundRobin, 1).expect("fits");
        let ends = [region.at(0), region.at((1 << 33) - 1)];
        assert_eq!(words.get(ends[0]), None, "not covered yet");
        words.cover(&layout);
        for (value, at) in ends.into_iter().enumerate() {
            assert_eq!(words.get(at), Some(0));
            *words.get_mut(at).expect("covered") = value as u64 + 1;
        }
        assert_eq!(ends.map(|at| words.get(at)), [Some(1), Some(2)]);
        assert_eq!(words.get_mut(Address(1 << 33)), None);
    }

    /// Catches words read together that differ from those read one by one: within a chunk, from one to the next, where
    /// nothing was written, at the end.
    #[test]
    fn words_are_read_together_as_one_by_one() {
        let mut layout = Layout::default();
        let mut words = Words::default();
        let region = layout.allocate("a", 5 * CHUNK_WORDS as u64, Home::RoundRobin, 1).expect("fits");
        words.cover(&layout);
        let limit = layout.limit();
        for at in (0..2 * CHUNK_WORDS as u64).chain(limit - CHUNK_WORDS as u64..limit) {
            *words.get_mut(Address(at)).expect("covered") = at + 1;
        }
        let begins = [0, 1, CHUNK_WORDS as u64, 3 * CHUNK_WORDS as u64 - 3, limit - 8, limit - 7, limit, u64::MAX];
        for begin in begins.into_iter().chain([CHUNK_WORDS as u64 - 4, 2 * CHUNK_WORDS as u64 - 7]) {
            let at = Address(begin);
            let expected: Option<Vec<_>> = (0..8).map(|i| words.get(at.plus(i))).collect();
            let mut together = [u64::MAX; 8];
            let read = words.read(at, &mut together).map(|()| together.to_vec());
            assert_eq!(read, expected, "from {begin}");
        }
        assert_eq!(region.at(0).word(), 0);
    }

    /// Catches an index that reaches into the neighbouring region.
    #[test]
    #[should_panic(expected = "word 3 of a region of 3 words")]
    fn an_index_beyond_a_region_panics() {
        let mut layout = Layout::default();
        let _ = layout.allocate("a", 3, Home::RoundRobin, 1).expect("fits").at(3);
    }
}
