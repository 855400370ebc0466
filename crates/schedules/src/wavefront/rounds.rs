//! Rounds: open links get their form factors and visibilities, the oracle decides, and what it splits is appended, open again.

use super::{CHANGED, CLAIMED, ENTRY_VISIBILITY, FRESH_JOIN, FRESH_VISIBILITY, Flat, LIVE};
use crate::cost;
use crate::pairs::{Pairs, RAY_PARTS};
use crate::store::{self, Counter, Store};
use crate::worker::Worker;
use isolux_core::kernels::NoProbe;
use isolux_core::kernels::oracle::{Decision, bf_refinement};
use isolux_core::tree::Path;
use isolux_machine::{Cause, Mark, Note, Prefix, Processor};

/// Entries of rows that are asked about at a time.
const ENTRIES: u64 = 15;

/// Pairs of polygons that are compared at a time.
const PAIRS: u64 = 4;

/// A loop over visibilities should have so many items for each processor, or as many as there are rays: what its last item
/// costs is then 1/64 of it, or a ray.
const ITEMS_PER_PROCESSOR: u64 = 64;

/// Who is linked with whom: elements and names of receiver and source.
#[derive(Clone, Copy)]
struct Ends {
    elements: [u32; 2],
    paths: [Path; 2],
}

impl Ends {
    fn from_words(words: &[u64]) -> Ends {
        Ends { elements: [words[0] as u32, words[1] as u32], paths: [Store::path(words[2]), Store::path(words[3])] }
    }

    fn words(self) -> [u64; 4] {
        let ([a, b], [c, d]) = (self.elements, self.paths);
        [a.into(), b.into(), c.to_bits(), d.to_bits()]
    }
}

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// Links all pairs of roots that see each other's front.
    pub(crate) async fn link_pairs(&self, flat: &Flat) {
        let roots = &self.cx.problem.active_roots;
        let count = roots.len() as u64;
        let before = self.p.enter(Mark::new(Cause::Work, "F"));
        self.each(count * count.saturating_sub(1) / 2, PAIRS, async |index| {
            let (i, j) = crate::sbpram::pair(index);
            let elements = [roots[i], roots[j]];
            let ends = Ends { elements, paths: elements.map(Path::root) };
            self.charge(cost::CULL, 1).await;
            if self.cx.problem.face_each_other(elements[0], elements[1]) {
                let exchange = self.exchange_area(self.place(ends.paths[0]), self.place(ends.paths[1])).await;
                if exchange > 0.0 {
                    self.append_fresh(flat, ends, exchange).await;
                }
            }
        })
        .await;
        let high = self.p.load(self.cx.store.counter(Counter::Fresh)).await;
        self.look(flat, 0, high, false).await;
        self.p.enter(Mark::new(Cause::Work, "R"));
        self.build_rows(flat, true).await;
        self.p.enter(before);
    }

    /// Before an iteration: counters begin anew, but those of rows.
    pub(crate) async fn begin_rounds(&self) {
        if self.is_first() {
            for counter in [
                Counter::Fresh,
                Counter::Splits,
                Counter::Claims,
                Counter::Dirty,
                Counter::Unsorted,
                Counter::Sorting,
                Counter::Gathering,
            ] {
                self.p.store(self.cx.store.counter(counter), 0).await;
            }
        }
        self.begin(0).await;
    }

    /// Asks about all links, and about those that come of splitting, until none is left to split; then rows are what they
    /// should be.
    pub(crate) async fn rounds(&self, flat: &Flat) {
        let before = self.p.enter(Mark::new(Cause::Work, "R"));
        let count = |counter| self.p.load(self.cx.store.counter(counter));
        let entries = count(Counter::Rows).await;
        self.each(entries.div_ceil(ENTRIES), 1, async |block| {
            self.ask_entries(flat, block * ENTRIES, ((block + 1) * ENTRIES).min(entries)).await;
        })
        .await;
        let (mut splits, mut claims, mut fresh) = (0, 0, 0);
        loop {
            let (new_splits, new_claims) = (count(Counter::Splits).await, count(Counter::Claims).await);
            if new_splits == splits {
                break;
            }
            self.each(new_claims - claims, 1, async |index| {
                let element = self.p.load(flat.claims.at(claims + index)).await as u32;
                self.split_claimed(element).await;
            })
            .await;
            self.p.enter(Mark::new(Cause::Work, "F"));
            self.each((new_splits - splits) * 4, 1, async |index| {
                self.append_child(flat, splits + index / 4, (index % 4) as u32).await;
            })
            .await;
            (splits, claims) = (new_splits, new_claims);
            let new_fresh = count(Counter::Fresh).await;
            self.look(flat, fresh, new_fresh, true).await;
            fresh = new_fresh;
        }
        self.p.enter(Mark::new(Cause::Work, "R"));
        self.build_rows(flat, false).await;
        self.p.enter(before);
    }

    async fn append_fresh(&self, flat: &Flat, ends: Ends, form_factor: f64) {
        let Some(at) = self.reserve(Counter::Fresh, 1, flat.sizes.links).await else { return };
        let [a, b, c, d] = ends.words();
        let words = [a, b, c, d, form_factor.to_bits(), store::UNKNOWN, 0, 0];
        self.p.store_block(flat.fresh(at.into(), 0), words).await;
    }

    /// Visibilities of the fresh links `low..high`: their rays, some at a time. Who is the last one at a link asks the oracle.
    async fn look(&self, flat: &Flat, low: u64, high: u64, ask: bool) {
        let before = self.p.enter(Mark::new(Cause::Work, "V"));
        let wanted = ITEMS_PER_PROCESSOR * self.p.count() as u64;
        let mut pieces = 1;
        while (high - low) * pieces < wanted && pieces < RAY_PARTS as u64 {
            pieces *= 2;
        }
        let rays = RAY_PARTS as u64 / pieces;
        self.each((high - low) * pieces, 1, async |index| {
            let (at, piece) = (low + index / pieces, index % pieces);
            let words: [u64; 5] = self.p.load_block(flat.fresh(at, 0)).await;
            let ends = Ends::from_words(&words);
            let places = ends.paths.map(|path| self.place(path));
            let parts = (piece * rays) as usize..((piece + 1) * rays) as usize;
            self.p.charge(&self.cx.pairs.part_of_sight(places[0], places[1], parts)).await;
            if pieces > 1 {
                let key = [u64::MAX - 1, at, 0, 0];
                self.p.note(Note::Join(key));
                if self.p.prefix(Prefix::Add, flat.fresh(at, FRESH_JOIN), 1).await != pieces - 1 {
                    return;
                }
                self.p.note(Note::Resume(key));
            }
            if self.p.has_caches() {
                self.touch_sight([(ends.elements[0], places[0]), (ends.elements[1], places[1])]).await;
            }
            // All of it has been charged.
            let (sight, _) = self.cx.pairs.sight(places[0], places[1]);
            let visibility = store::encode(sight);
            let split = ask && self.ask(flat, ends, f64::from_bits(words[4]), visibility).await;
            let word = if split { store::DEAD } else { visibility };
            self.p.store(flat.fresh(at, FRESH_VISIBILITY), word).await;
        })
        .await;
        self.p.enter(before);
    }

    /// Asks about links of the last iteration; those that are split leave their rows.
    async fn ask_entries(&self, flat: &Flat, from: u64, to: u64) {
        let entries = self.entries(|at| flat.entry(at, 0), from, to).await;
        let mut known = None;
        for (at, [source, path, form_factor, visibility, receiver]) in (from..).zip(entries) {
            if visibility == store::DEAD {
                continue;
            }
            let receiver = receiver as u32;
            // Entries of one row follow each other.
            let name = match known {
                Some((element, name)) if element == receiver => name,
                _ => self.place_of(receiver).await.path,
            };
            known = Some((receiver, name));
            let ends = Ends { elements: [receiver, source as u32], paths: [name, Store::path(path)] };
            if self.ask(flat, ends, f64::from_bits(form_factor), visibility).await {
                self.p.store(flat.entry(at, ENTRY_VISIBILITY), store::DEAD).await;
                self.p.prefix(Prefix::Add, flat.row(receiver, LIVE), u64::MAX).await;
                self.note_change(flat, receiver).await;
            }
        }
    }

    /// A row is to be made anew.
    pub(super) async fn note_change(&self, flat: &Flat, element: u32) {
        if self.p.prefix(Prefix::Or, flat.row(element, CHANGED), 1).await == 0 {
            let at = self.p.prefix(Prefix::Add, self.cx.store.counter(Counter::Dirty), 1).await;
            self.p.store(flat.changed.at(at), element.into()).await;
        }
    }

    /// Asks the oracle. What it splits is put down, and true given.
    async fn ask(&self, flat: &Flat, ends: Ends, form_factor: f64, visibility: u64) -> bool {
        let [receiver, source] = ends.paths.map(|path| self.place(path));
        let emission = self.cx.problem.scene.polygons[source.polygon as usize].emission.mean();
        let radiosity = self.radiosity(ends.elements[1]).await.mean();
        self.charge(cost::ORACLE, 1).await;
        let decision = bf_refinement(
            store::decode(visibility),
            form_factor,
            [radiosity, emission],
            [receiver.area, source.area],
            &self.cx.problem.parameters.thresholds,
            &mut NoProbe,
        );
        let which = match decision {
            Decision::Keep => return false,
            Decision::SplitReceiver => 0,
            Decision::SplitSource => 1,
        };
        if ends.paths[which].depth() >= Path::MAX_DEPTH {
            return false;
        }
        let element = ends.elements[which];
        if self.p.load(self.cx.store.element(element, store::FIRST_CHILD)).await == 0
            && self.p.prefix(Prefix::Or, flat.row(element, CLAIMED), 1).await == 0
        {
            let at = self.p.prefix(Prefix::Add, self.cx.store.counter(Counter::Claims), 1).await;
            self.p.store(flat.claims.at(at), element.into()).await;
        }
        let Some(at) = self.reserve(Counter::Splits, 1, flat.sizes.links).await else { return false };
        let [a, b, c, d] = ends.words();
        self.p.store_block(flat.split(at.into()), [a, b, c, d, which as u64]).await;
        true
    }

    /// The link to, or of, a child of what was split, where there is one.
    async fn append_child(&self, flat: &Flat, split: u64, k: u32) {
        let words: [u64; 5] = self.p.load_block(flat.split(split)).await;
        let (mut ends, which) = (Ends::from_words(&words), words[4] as usize);
        let first = self.p.load(self.cx.store.element(ends.elements[which], store::FIRST_CHILD)).await as u32;
        if first == 0 {
            // There was no room for children; the run ends with an error.
            return;
        }
        ends.elements[which] = first + k;
        ends.paths[which] = ends.paths[which].child(k);
        let form_factor = self.form_factor(self.place(ends.paths[0]), self.place(ends.paths[1])).await;
        if form_factor > 0.0 {
            self.append_fresh(flat, ends, form_factor).await;
        }
    }
}
