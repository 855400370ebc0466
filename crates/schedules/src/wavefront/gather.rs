//! Light: rows are gathered in chunks whose sums make the canonical one; leaves add up what arrives on the way from their root
//! down, and parents get the means of their children as the last of these ends.

use super::{BEGIN, Flat, JOIN, OWN};
use crate::cost;
use crate::pairs::Pairs;
use crate::store::{self, Counter};
use crate::worker::Worker;
use isolux_core::solution::{GATHER_CHUNK, gather_sum, tree_sum};
use isolux_core::units::Rgb;
use isolux_machine::{Cause, Mark, Note, Prefix, Processor};

const CHUNK: u64 = GATHER_CHUNK as u64;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// Gathers over all rows, and lets the light down and up the quadtrees.
    pub(crate) async fn gather_rows(&self, flat: &Flat) {
        let before = self.p.enter(Mark::new(Cause::Work, "R"));
        let elements = self.p.load(self.cx.store.counter(Counter::Elements)).await;
        self.each(elements, 1, async |element| self.gather_row(flat, element as u32).await).await;
        let chunks = self.p.load(self.cx.store.counter(Counter::Gathering)).await;
        self.each(chunks, 1, async |index| self.gather_chunk(flat, index).await).await;
        self.each(elements, 1, async |element| self.settle_below(flat, element as u32).await).await;
        self.p.enter(before);
    }

    /// A short row is gathered; a long one is cut into chunks.
    async fn gather_row(&self, flat: &Flat, element: u32) {
        if self.p.load(self.cx.store.element(element, store::FIRST_CHILD)).await != 0 {
            self.p.store(self.cx.store.element(element, store::PENDING), 4).await;
        }
        let [begin, length]: [u64; 2] = self.p.load_block(flat.row(element, BEGIN)).await;
        if length <= CHUNK {
            let own = self.sum_of(flat, begin, length).await;
            self.p.store_block(flat.row(element, OWN), store::bits(own)).await;
            return;
        }
        let chunks = length.div_ceil(CHUNK);
        let at = self.p.prefix(Prefix::Add, self.cx.store.counter(Counter::Gathering), chunks).await;
        self.p.store(flat.row(element, JOIN), chunks).await;
        for chunk in 0..chunks {
            self.p.store(flat.gathering.at(at + chunk), u64::from(element) | chunk << 32).await;
        }
    }

    async fn sum_of(&self, flat: &Flat, begin: u64, many: u64) -> Rgb {
        let mut terms = Vec::with_capacity(many as usize);
        for [source, _, form_factor, visibility, _] in self.entries(|at| flat.entry(at, 0), begin, begin + many).await {
            let radiosity = self.radiosity(source as u32).await;
            self.note_read(source as u32);
            terms.push(radiosity * (f64::from_bits(form_factor) * store::decode(visibility).share));
        }
        self.charge(cost::GATHER, many).await;
        gather_sum(terms, Rgb::ZERO)
    }

    /// One chunk of a long row; who is the last of the row adds them up.
    async fn gather_chunk(&self, flat: &Flat, index: u64) {
        let word = self.p.load(flat.gathering.at(index)).await;
        let (element, chunk) = (word as u32, word >> 32);
        let [begin, length]: [u64; 2] = self.p.load_block(flat.row(element, BEGIN)).await;
        let many = CHUNK.min(length - chunk * CHUNK);
        let sum = self.sum_of(flat, begin + chunk * CHUNK, many).await;
        self.p.store_block(flat.sum(index), store::bits(sum)).await;
        let key = [u64::MAX - 2, element.into(), 0, 0];
        self.p.note(Note::Join(key));
        if self.p.prefix(Prefix::Add, flat.row(element, JOIN), u64::MAX).await != 1 {
            return;
        }
        self.p.note(Note::Resume(key));
        let chunks = length.div_ceil(CHUNK);
        let mut sums = Vec::with_capacity(chunks as usize);
        for at in index - chunk..index - chunk + chunks {
            sums.push(store::rgb(self.p.load_block(flat.sum(at)).await));
        }
        self.charge(cost::GATHER, chunks).await;
        self.p.store_block(flat.row(element, OWN), store::bits(tree_sum(&sums, Rgb::ZERO))).await;
    }

    /// A leaf gets what arrives at it and all above it, from the root on.
    async fn settle_below(&self, flat: &Flat, element: u32) {
        if self.p.load(self.cx.store.element(element, store::FIRST_CHILD)).await != 0 {
            return;
        }
        let mut own = Vec::new();
        let (mut at, mut above) = (element, None);
        loop {
            own.push(store::rgb(self.p.load_block(flat.row(at, OWN)).await));
            let parent = self.p.load(self.cx.store.element(at, store::PARENT)).await.checked_sub(1);
            above = above.or(parent);
            match parent {
                Some(parent) => at = parent as u32,
                None => break,
            }
        }
        let arriving = own.into_iter().rev().fold(Rgb::ZERO, |sum, own| sum + own);
        let place = self.place_of(element).await;
        self.settle(element, place, arriving).await;
        self.ascend(above.map(|parent| parent as u32)).await;
    }
}
