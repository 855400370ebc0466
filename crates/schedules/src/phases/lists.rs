//! Lists of links: words go in, records come out, and back.

use crate::pairs::Pairs;
use crate::problem::Place;
use crate::store::{self, Counter, Store};
use crate::worker::Worker;
use isolux_core::kernels::visibility::Sight;
use isolux_core::tree::Path;
use isolux_machine::Processor;

/// A link, with its place among the links.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    /// Its record.
    pub(crate) at: u32,
    /// Where the light comes from.
    pub(crate) source: u32,
    /// The source's name.
    pub(crate) path: Path,
    /// Share of what leaves the receiver that reaches the source, unoccluded.
    pub(crate) form_factor: f64,
    /// Visibility, as a word.
    pub(crate) visibility: u64,
    /// The next record of its list + 1, as it stands in memory.
    pub(crate) next: u64,
}

impl Entry {
    /// `F V`.
    pub(crate) fn weight(&self) -> f64 {
        self.form_factor * store::decode(self.visibility).share
    }
}

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// The place of an element, by its name.
    pub(crate) async fn place_of(&self, element: u32) -> &Place {
        let path = self.p.load(self.cx.store.element(element, store::PATH)).await;
        self.place(Store::path(path))
    }

    /// The links of a list that begins with record `first - 1`.
    pub(crate) async fn read_list(&self, first: u64) -> Vec<Entry> {
        let mut list = Vec::new();
        let mut next = first;
        while let Some(at) = next.checked_sub(1) {
            let at = at as u32;
            let words: [u64; 5] = self.p.load_block(self.cx.store.link(at, 0)).await;
            next = words[store::NEXT as usize];
            list.push(Entry {
                at,
                source: words[0] as u32,
                path: Store::path(words[1]),
                form_factor: f64::from_bits(words[2]),
                visibility: words[3],
                next,
            });
        }
        list
    }

    /// Makes the records of a list follow each other, then those that begin at `rest`; gives where it begins. Only what is
    /// not so yet is written.
    pub(crate) async fn chain(&self, list: &mut [Entry], rest: u64) -> u64 {
        let mut next = rest;
        for entry in list.iter_mut().rev() {
            if entry.next != next {
                self.p.store(self.cx.store.link(entry.at, store::NEXT), next).await;
                entry.next = next;
            }
            next = u64::from(entry.at) + 1;
        }
        next
    }

    /// Writes a link, into this record or a new one, in front of the one at `next - 1`. `None` when there is no room.
    pub(crate) async fn write_link(
        &self,
        record: Option<u32>,
        (source, path): (u32, Path),
        form_factor: f64,
        visibility: u64,
        next: u64,
    ) -> Option<Entry> {
        let at = match record {
            Some(at) => at,
            None => self.reserve(Counter::Links, 1, self.cx.store.sizes.links).await?,
        };
        let words = [source.into(), path.to_bits(), form_factor.to_bits(), visibility, next];
        self.p.store_block(self.cx.store.link(at, 0), words).await;
        Some(Entry { at, source, path, form_factor, visibility, next })
    }

    /// Gives a root a link from another: an open one where there is no visibility yet. Others may be doing the same.
    pub(crate) async fn link_roots(&self, receiver: u32, source: u32, form_factor: f64, sight: Option<Sight>) {
        let (p, store) = (&self.p, &self.cx.store);
        let head = store.element(receiver, if sight.is_some() { store::LINKS } else { store::OPEN });
        let visibility = sight.map_or(store::UNKNOWN, store::encode);
        p.lock(store.lock(receiver)).await;
        let next = p.load(head).await;
        if let Some(link) = self.write_link(None, (source, Path::root(source)), form_factor, visibility, next).await {
            p.store(head, u64::from(link.at) + 1).await;
        }
        p.unlock(store.lock(receiver)).await;
    }
}
