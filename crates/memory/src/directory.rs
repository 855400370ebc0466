//! What is known of each line of memory: the directory's entry, and who had and has the line, to find copies and
//! causes; how this changes is left to the system.

/// A line's entry: numbers of 64 bits, side by side so that a miss meets one place of the host's memory.
///
/// | number | what |
/// |---|---|
/// | 0 | sharing clusters, as bits; of a dirty line its owner's |
/// | 1 | 1 + the processor that has the line dirty, or 0 |
/// | `HAD` | bits of the processors that ever had the line |
/// | `holds` | bits of the processors that have it now (an index of the caches, not part of the modelled machine) |
/// | `gone` | bits of the processors that lost it to another's write and have not asked for it since |
/// | `stale`, for each word | of those in `gone`, the ones that lost it no later than a write to this word |
#[derive(Clone, Debug)]
pub(crate) struct Directory {
    /// Entries of `CHUNK` lines each, as they are first changed; the others are all zero.
    chunks: Vec<Option<Box<[u64]>>>,
    /// The entry of a line that nobody asked for.
    untouched: Box<[u64]>,
    lines: usize,
    /// Numbers for one bit of each processor.
    words: usize,
    stride: usize,
}

/// Lines to a chunk: on DASH a page's, 18 KB of the host's memory.
const CHUNK: usize = 256;

const CLUSTERS: usize = 0;
const OWNER: usize = 1;
const HAD: usize = 2;

impl Directory {
    pub(crate) fn new(processors: usize, words_per_line: usize) -> Directory {
        let words = processors.div_ceil(64);
        let stride = HAD + words * (3 + words_per_line);
        Directory { chunks: Vec::new(), untouched: vec![0; stride].into(), lines: 0, words, stride }
    }

    /// Makes room for this many lines.
    pub(crate) fn grow(&mut self, lines: usize) {
        self.lines = self.lines.max(lines);
        self.chunks.resize_with(self.lines.div_ceil(CHUNK), || None);
    }

    #[inline]
    pub(crate) fn entry(&mut self, line: u32) -> Entry<'_> {
        let (chunk, start) = (line as usize / CHUNK, line as usize % CHUNK * self.stride);
        let entries = self.chunks[chunk].get_or_insert_with(|| vec![0; CHUNK * self.stride].into());
        Entry { numbers: &mut entries[start..start + self.stride], words: self.words }
    }

    pub(crate) fn view(&self, line: u32) -> View<'_> {
        let (chunk, start) = (line as usize / CHUNK, line as usize % CHUNK * self.stride);
        let numbers = match &self.chunks[chunk] {
            Some(entries) => &entries[start..start + self.stride],
            None => &self.untouched[..],
        };
        View { numbers, words: self.words }
    }

    pub(crate) fn lines(&self) -> u32 {
        self.lines as u32
    }
}

/// A line's entry, to read.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    numbers: &'a [u64],
    words: usize,
}

impl<'a> View<'a> {
    pub(crate) fn clusters(self) -> u64 {
        self.numbers[CLUSTERS]
    }

    pub(crate) fn owner(self) -> Option<usize> {
        (self.numbers[OWNER] as usize).checked_sub(1)
    }

    fn field(self, field: usize) -> &'a [u64] {
        &self.numbers[HAD + field * self.words..][..self.words]
    }

    pub(crate) fn had(self) -> &'a [u64] {
        self.field(0)
    }

    pub(crate) fn holds(self) -> &'a [u64] {
        self.field(1)
    }

    pub(crate) fn gone(self) -> &'a [u64] {
        self.field(2)
    }

    pub(crate) fn stale(self) -> impl Iterator<Item = &'a [u64]> {
        self.numbers[HAD + 3 * self.words..].chunks_exact(self.words)
    }
}

/// A line's entry, to change.
pub(crate) struct Entry<'a> {
    numbers: &'a mut [u64],
    words: usize,
}

impl Entry<'_> {
    #[inline]
    pub(crate) fn view(&self) -> View<'_> {
        View { numbers: self.numbers, words: self.words }
    }

    pub(crate) fn set_clusters(&mut self, clusters: u64) {
        self.numbers[CLUSTERS] = clusters;
    }

    pub(crate) fn set_owner(&mut self, owner: Option<usize>) {
        self.numbers[OWNER] = owner.map_or(0, |processor| processor as u64 + 1);
    }

    fn number(&mut self, field: usize, processor: usize) -> &mut u64 {
        &mut self.numbers[HAD + field * self.words + processor / 64]
    }

    /// The processor obtains the line: nothing is stale to it any more.
    pub(crate) fn obtain(&mut self, processor: usize) {
        let bit = 1 << (processor % 64);
        *self.number(0, processor) |= bit;
        *self.number(1, processor) |= bit;
        if *self.number(2, processor) & bit != 0 {
            *self.number(2, processor) &= !bit;
            let first = HAD + 3 * self.words + processor / 64;
            for number in self.numbers[first..].iter_mut().step_by(self.words) {
                *number &= !bit;
            }
        }
    }

    /// The processor replaces the line.
    pub(crate) fn replace(&mut self, processor: usize) {
        *self.number(1, processor) &= !(1 << (processor % 64));
    }

    /// The processor loses the line to another's write.
    pub(crate) fn lose(&mut self, processor: usize) {
        self.replace(processor);
        *self.number(2, processor) |= 1 << (processor % 64);
    }

    /// These words (as bits) were written since the writer obtained the line: they are stale to all that are gone.
    pub(crate) fn write(&mut self, written: u32) {
        let (head, stale) = self.numbers.split_at_mut(HAD + 3 * self.words);
        let gone = &head[HAD + 2 * self.words..];
        let mut rest = written;
        while rest != 0 {
            let word = rest.trailing_zeros() as usize;
            for (number, gone) in stale[word * self.words..].iter_mut().zip(gone) {
                *number |= gone;
            }
            rest &= rest - 1;
        }
    }

    /// Whether this word was written since the processor, which is gone, lost the line.
    pub(crate) fn is_stale(&self, word: usize, processor: usize) -> bool {
        has(&self.numbers[HAD + (3 + word) * self.words..][..self.words], processor)
    }
}

/// Whether the processor's bit is set.
pub(crate) fn has(bits: &[u64], processor: usize) -> bool {
    bits[processor / 64] >> (processor % 64) & 1 == 1
}

/// Whether one of the `count` processors from `first` on has its bit set.
pub(crate) fn any(bits: &[u64], first: usize, count: usize) -> bool {
    let last = (first + count).min(bits.len() * 64);
    let mut at = first;
    while at < last {
        let taken = (64 - at % 64).min(last - at);
        if (bits[at / 64] >> (at % 64)) & (u64::MAX >> (64 - taken)) != 0 {
            return true;
        }
        at += taken;
    }
    false
}
