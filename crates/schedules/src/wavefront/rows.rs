//! Rows: each element's links in the order of their sources' names. Rows that changed are made anew: collected, sorted in
//! chunks, and the chunks merged by rank.

use super::{BEGIN, END, ENTRY_VISIBILITY, Entry, FRESH, FRESH_JOIN, Flat, LIVE, UNSORTED};
use crate::cost;
use crate::pairs::Pairs;
use crate::store::{self, Counter, Store};
use crate::worker::Worker;
use isolux_core::solution::GATHER_CHUNK;
use isolux_machine::{Address, Prefix, Processor};

/// Links of a chunk: rows are cut where their sums are.
const CHUNK: u64 = GATHER_CHUNK as u64;

/// Entries of a sorted chunk that are merged at a time.
const MERGED: u64 = 8;

/// Fresh links, and entries, that are moved at a time.
const MOVED: u64 = 9;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// Makes the rows anew that have lost links or are given fresh ones; `pairs`: each fresh link stands for both directions.
    pub(super) async fn build_rows(&self, flat: &Flat, pairs: bool) {
        let count = |counter| self.p.load(self.cx.store.counter(counter));
        let fresh = count(Counter::Fresh).await;
        self.each(fresh.div_ceil(MOVED), 1, async |block| {
            for at in block * MOVED..((block + 1) * MOVED).min(fresh) {
                self.count_fresh(flat, at, pairs).await;
            }
        })
        .await;
        let changed = count(Counter::Dirty).await;
        if changed == 0 {
            return;
        }
        let entries = count(Counter::Rows).await;
        self.each(changed, 1, async |index| {
            let element = self.p.load(flat.changed.at(index)).await as u32;
            let [live, new]: [u64; 2] = self.p.load_block(flat.row(element, LIVE)).await;
            let first = self.p.prefix(Prefix::Add, self.cx.store.counter(Counter::Unsorted), live + new).await;
            self.p.store(flat.row(element, UNSORTED), first).await;
            self.p.store(flat.row(element, END), first + live + new).await;
        })
        .await;
        self.each_and_go_on(entries.div_ceil(MOVED), 1, async |block| {
            self.move_entries(flat, block * MOVED, ((block + 1) * MOVED).min(entries)).await;
        })
        .await;
        self.each(fresh.div_ceil(MOVED), 1, async |block| {
            for at in block * MOVED..((block + 1) * MOVED).min(fresh) {
                self.move_fresh(flat, at, pairs).await;
            }
        })
        .await;
        self.each(changed, 1, async |index| {
            let element = self.p.load(flat.changed.at(index)).await as u32;
            self.renew_row(flat, element).await;
        })
        .await;
        let chunks = count(Counter::Sorting).await;
        if chunks == 0 {
            return;
        }
        self.each(chunks, 1, async |index| {
            let (element, chunk) = self.chunk(flat.sorting.at(index)).await;
            let [_, length, _, _, unsorted]: [u64; 5] = self.p.load_block(flat.row(element, BEGIN)).await;
            let first = unsorted + chunk * CHUNK;
            let sorted = self.sorted(flat, first, CHUNK.min(length - chunk * CHUNK)).await;
            for (at, entry) in (first..).zip(sorted) {
                self.p.store_block(flat.unsorted(at, 0), entry).await;
            }
        })
        .await;
        let parts = CHUNK / MERGED;
        self.each(chunks * parts, 1, async |index| {
            let (element, chunk) = self.chunk(flat.sorting.at(index / parts)).await;
            self.merge(flat, element, chunk, index % parts * MERGED).await;
        })
        .await;
    }

    async fn chunk(&self, at: Address) -> (u32, u64) {
        let word = self.p.load(at).await;
        (word as u32, word >> 32)
    }

    /// A fresh link's receiver, and for a pair its source too, get to know of it.
    async fn count_fresh(&self, flat: &Flat, at: u64, pairs: bool) {
        let words: [u64; 6] = self.p.load_block(flat.fresh(at, 0)).await;
        if words[5] == store::DEAD {
            return;
        }
        for (end, &receiver) in words[..1 + usize::from(pairs)].iter().enumerate() {
            let receiver = receiver as u32;
            let place = self.p.prefix(Prefix::Add, flat.row(receiver, FRESH), 1).await;
            self.p.store(flat.fresh(at, FRESH_JOIN + end as u64), place).await;
            self.note_change(flat, receiver).await;
        }
    }

    /// Entries leave rows that change: they take places from the beginning on.
    async fn move_entries(&self, flat: &Flat, from: u64, to: u64) {
        let entries = self.entries(|at| flat.entry(at, 0), from, to).await;
        let mut known = None;
        for (at, entry) in (from..).zip(entries) {
            if entry[3] == store::DEAD {
                continue;
            }
            let receiver = entry[4] as u32;
            let to = match known {
                Some((element, to)) if element == receiver => to,
                _ => {
                    let [unsorted, changed]: [u64; 2] = self.p.load_block(flat.row(receiver, UNSORTED)).await;
                    (changed != 0).then_some(unsorted)
                }
            };
            known = Some((receiver, to));
            if let Some(unsorted) = to {
                let left = self.p.prefix(Prefix::Add, flat.row(receiver, LIVE), u64::MAX).await;
                self.p.store_block(flat.unsorted(unsorted + left - 1, 0), entry).await;
                self.p.store(flat.entry(at, ENTRY_VISIBILITY), store::DEAD).await;
            }
        }
    }

    /// A fresh link takes a place in its receiver's row, from the end on.
    async fn move_fresh(&self, flat: &Flat, at: u64, pairs: bool) {
        let words: [u64; 8] = self.p.load_block(flat.fresh(at, 0)).await;
        if words[5] == store::DEAD {
            return;
        }
        for end in 0..1 + usize::from(pairs) {
            let (receiver, source) = (words[end], words[1 - end]);
            let (own, path) = (Store::path(words[2 + end]), words[3 - end]);
            let form_factor =
                if pairs { (f64::from_bits(words[4]) / self.place(own).area).min(1.0).to_bits() } else { words[4] };
            let behind = self.p.load(flat.row(receiver as u32, END)).await;
            let entry = [source, path, form_factor, words[5], receiver];
            self.p.store_block(flat.unsorted(behind - 1 - words[6 + end], 0), entry).await;
        }
    }

    /// A row gets new room, and is filled if it is short; a long one is cut into chunks.
    async fn renew_row(&self, flat: &Flat, element: u32) {
        let [_, _, _, _, unsorted, _, _, behind]: [u64; 8] = self.p.load_block(flat.row(element, BEGIN)).await;
        let length = behind - unsorted;
        let Some(begin) = self.reserve(Counter::Rows, length, flat.sizes.links).await.map(u64::from) else { return };
        // Begin, length, live, fresh, begin while unsorted, changed.
        self.p.store_block(flat.row(element, BEGIN), [begin, length, length, 0, unsorted, 0]).await;
        if length <= CHUNK {
            let sorted = self.sorted(flat, unsorted, length).await;
            for (at, entry) in (begin..).zip(sorted) {
                self.p.store_block(flat.entry(at, 0), entry).await;
            }
            return;
        }
        let chunks = length.div_ceil(CHUNK);
        let at = self.p.prefix(Prefix::Add, self.cx.store.counter(Counter::Sorting), chunks).await;
        for chunk in 0..chunks {
            self.p.store(flat.sorting.at(at + chunk), u64::from(element) | chunk << 32).await;
        }
    }

    async fn sorted(&self, flat: &Flat, first: u64, many: u64) -> Vec<Entry> {
        let mut entries = self.entries(|at| flat.unsorted(at, 0), first, first + many).await;
        entries.sort_unstable_by_key(|entry| entry[1]);
        self.charge(cost::ORDER, many * cost::sorting_depth(many)).await;
        entries
    }

    /// Some entries of a sorted chunk go to their places in the row: behind all smaller ones of all chunks.
    async fn merge(&self, flat: &Flat, element: u32, chunk: u64, from: u64) {
        let [begin, length, _, _, unsorted]: [u64; 5] = self.p.load_block(flat.row(element, BEGIN)).await;
        let many = CHUNK.min(length - chunk * CHUNK);
        for k in from..(from + MERGED).min(many) {
            let entry: Entry = self.p.load_block(flat.unsorted(unsorted + chunk * CHUNK + k, 0)).await;
            let mut rank = k;
            for other in (0..length.div_ceil(CHUNK)).filter(|&other| other != chunk) {
                let first = unsorted + other * CHUNK;
                let (mut low, mut high) = (0, CHUNK.min(length - other * CHUNK));
                while low < high {
                    let middle = u64::midpoint(low, high);
                    let path = self.p.load(flat.unsorted(first + middle, 1)).await;
                    if path < entry[1] { low = middle + 1 } else { high = middle }
                }
                self.charge(cost::ORDER, 1).await;
                rank += low;
            }
            self.p.store_block(flat.entry(begin + rank, 0), entry).await;
        }
    }
}
