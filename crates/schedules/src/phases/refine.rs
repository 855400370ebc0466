//! R: an element's links are refined until all that remain are kept; then it gathers. Where visibilities are missing, tasks
//! find them, and the last of these goes on: no processor waits for another's task.

use super::lists::Entry;
use crate::cost;
use crate::pairs::Pairs;
use crate::problem::Place;
use crate::store;
use crate::task::{Task, VISIBILITIES_MAX};
use crate::worker::Worker;
use isolux_core::kernels::NoProbe;
use isolux_core::kernels::oracle::{Decision, bf_refinement};
use isolux_core::tree::Path;
use isolux_machine::{Cause, Mark, Note, Prefix, Processor};

/// The key under which those wait that an element's refinement depends on.
pub(crate) fn join_key(element: u32) -> [u64; 4] {
    [u64::MAX, element.into(), 0, 0]
}

/// Links that the children of an element take over, until they are put into their lists.
#[derive(Default)]
struct Handed {
    first_child: Option<u32>,
    lists: [Vec<Entry>; 4],
}

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// R: from the start.
    pub(crate) async fn refine(&self, element: u32) {
        let first = self.p.load(self.cx.store.element(element, store::LINKS)).await;
        let links = self.read_list(first).await;
        let place = self.place_of(element).await;
        let mut kept = Vec::with_capacity(links.len());
        let mut open = Vec::new();
        let count = links.len();
        self.decide(element, place, links, &mut kept, &mut open).await;
        if kept.len() < count {
            let head = self.chain(&mut kept, 0).await;
            self.p.store(self.cx.store.element(element, store::LINKS), head).await;
        }
        let head = self.cx.store.element(element, store::OPEN);
        let there = self.p.load(head).await;
        let from_others = self.read_list(there).await;
        if !open.is_empty() {
            let begin = self.chain(&mut open, there).await;
            self.p.store(head, begin).await;
        }
        open.extend(from_others);
        self.close_links(element, place, open, Some(kept)).await;
    }

    /// R goes on, now that all open links have visibilities.
    async fn resume(&self, element: u32) {
        let before = self.p.enter(Mark::new(Cause::Work, "R"));
        self.p.note(Note::Resume(join_key(element)));
        let place = self.place_of(element).await;
        let open = self.p.load(self.cx.store.element(element, store::OPEN)).await;
        let seen = self.read_list(open).await;
        let open = self.absorb(element, place, seen, None).await;
        self.close_links(element, place, open, None).await;
        self.p.enter(before);
    }

    /// Asks the oracle about links that have just got their visibility: what is kept goes to the element's links (and to
    /// `kept`); gives what is open now.
    async fn absorb(&self, element: u32, place: &Place, seen: Vec<Entry>, kept: Option<&mut Vec<Entry>>) -> Vec<Entry> {
        let (mut keep, mut open) = (Vec::with_capacity(seen.len()), Vec::new());
        self.decide(element, place, seen, &mut keep, &mut open).await;
        if !keep.is_empty() {
            let head = self.cx.store.element(element, store::LINKS);
            let there = self.p.load(head).await;
            let begin = self.chain(&mut keep, there).await;
            self.p.store(head, begin).await;
        }
        let begin = self.chain(&mut open, 0).await;
        self.p.store(self.cx.store.element(element, store::OPEN), begin).await;
        if let Some(kept) = kept {
            kept.extend(keep);
        }
        open
    }

    /// Has visibilities found until no link is open; then the element gathers. `kept`: its other links, where they are at
    /// hand.
    async fn close_links(&self, element: u32, place: &Place, mut open: Vec<Entry>, mut kept: Option<Vec<Entry>>) {
        while !open.is_empty() {
            if open.len() < self.cx.grain.least_visibilities as usize {
                let links: Vec<u32> = open.iter().map(|entry| entry.at).collect();
                self.see(element, &links).await;
            } else if !self.make_visibility_tasks(element, &open).await {
                return;
            }
            let first = u64::from(open[0].at) + 1;
            let seen = self.read_list(first).await;
            open = self.absorb(element, place, seen, kept.as_mut()).await;
        }
        self.gather_and_descend(element, place, kept).await;
    }

    /// Makes tasks for the visibilities of a list. Gives true where all of them have been found here: else whoever finds the
    /// last one goes on.
    async fn make_visibility_tasks(&self, element: u32, open: &[Entry]) -> bool {
        let size = (self.cx.grain.visibilities as usize).clamp(1, VISIBILITIES_MAX);
        let tasks = open.len().div_ceil(size);
        let pending = self.cx.store.element(element, store::PENDING);
        self.p.store(pending, tasks as u64).await;
        self.cx.queues.announce(&self.p, tasks as u64).await;
        for part in open.chunks(size) {
            let mut links = [0; VISIBILITIES_MAX];
            links.iter_mut().zip(part).for_each(|(link, entry)| *link = entry.at);
            let task = Task::Visibility { element, count: part.len() as u32, links };
            if self.cx.queues.put(&self.p, task).await.is_err() {
                let before = self.p.enter(task.mark());
                self.see(element, &links[..part.len()]).await;
                self.p.enter(before);
                let last = self.join(element).await;
                self.cx.queues.finish(&self.p).await;
                if last {
                    self.p.note(Note::Resume(join_key(element)));
                    return true;
                }
            }
        }
        false
    }

    /// V or V': finds visibilities; whoever finds an element's last one goes on with its R.
    pub(crate) async fn visibility_task(&self, element: u32, links: &[u32]) {
        self.see(element, links).await;
        if self.join(element).await {
            self.resume(element).await;
        }
    }

    /// What links lack is found.
    async fn see(&self, element: u32, links: &[u32]) {
        if self.cx.switches.fine_tasks && !self.has_form_factors(links).await {
            self.complete_links(element, links).await;
        } else {
            self.visibilities(element, links).await;
        }
    }

    /// Whether open links come with form factors: those between roots do, where F-tasks have found them.
    async fn has_form_factors(&self, links: &[u32]) -> bool {
        let word = self.p.load(self.cx.store.link(links[0], store::FORM_FACTOR)).await;
        !f64::from_bits(word).is_nan()
    }

    /// One that an element waits for is there. Gives whether it was the last.
    pub(crate) async fn join(&self, element: u32) -> bool {
        self.p.note(Note::Join(join_key(element)));
        self.p.prefix(Prefix::Add, self.cx.store.element(element, store::PENDING), u64::MAX).await == 1
    }

    /// Asks the oracle about each link: what it keeps goes to `keep`, links to children of the source go to `open`, links of
    /// children of the receiver into their lists.
    async fn decide(
        &self,
        element: u32,
        place: &Place,
        links: Vec<Entry>,
        keep: &mut Vec<Entry>,
        open: &mut Vec<Entry>,
    ) {
        let thresholds = &self.cx.problem.parameters.thresholds;
        let mut handed = Handed::default();
        for entry in links {
            if entry.visibility == store::DEAD {
                continue;
            }
            let source = self.place(entry.path);
            let emission = self.cx.problem.scene.polygons[source.polygon as usize].emission.mean();
            let radiosity = self.radiosity(entry.source).await.mean();
            self.charge(cost::ORACLE, 1).await;
            let decision = bf_refinement(
                store::decode(entry.visibility),
                entry.form_factor,
                [radiosity, emission],
                [place.area, source.area],
                thresholds,
                &mut NoProbe,
            );
            let done = match decision {
                Decision::Keep => false,
                Decision::SplitReceiver => self.hand_down(element, place, &entry, &mut handed).await,
                Decision::SplitSource => self.split_source(place, &entry, open).await,
            };
            if !done {
                keep.push(entry);
            }
        }
        if let Some(first) = handed.first_child {
            for (k, mut list) in handed.lists.into_iter().enumerate().filter(|(_, list)| !list.is_empty()) {
                let head = self.cx.store.element(first + k as u32, store::OPEN);
                let there = self.p.load(head).await;
                let begin = self.chain(&mut list, there).await;
                self.p.store(head, begin).await;
                let count = self.cx.store.element(first + k as u32, store::COUNT);
                let before = self.p.load(count).await;
                self.p.store(count, before + list.len() as u64).await;
            }
        }
    }

    /// The receiver's children take a link over. False where it cannot be split.
    async fn hand_down(&self, element: u32, place: &Place, entry: &Entry, handed: &mut Handed) -> bool {
        if handed.first_child.is_none() {
            handed.first_child = self.split(element, place.path).await;
        }
        if handed.first_child.is_none() {
            return false;
        }
        let source = (entry.source, entry.path);
        let mut record = Some(entry.at);
        for (k, list) in handed.lists.iter_mut().enumerate() {
            let receiver = self.place(place.path.child(k as u32));
            if let Some(form_factor) = self.form_factor_of_new(receiver, self.place(entry.path)).await {
                let next = list.last().map_or(0, |last| u64::from(last.at) + 1);
                let link = self.write_link(record.take(), source, form_factor, store::UNKNOWN, next).await;
                list.extend(link);
            }
        }
        for list in &mut handed.lists {
            // Each was written in front of the one before it.
            debug_assert!(list.windows(2).all(|w| w[1].next == u64::from(w[0].at) + 1));
        }
        true
    }

    /// Links to the source's children take a link's place. False where it cannot be split.
    async fn split_source(&self, place: &Place, entry: &Entry, open: &mut Vec<Entry>) -> bool {
        let Some(first) = self.split(entry.source, entry.path).await else { return false };
        let mut record = Some(entry.at);
        for k in 0..4 {
            let path: Path = entry.path.child(k);
            if let Some(form_factor) = self.form_factor_of_new(place, self.place(path)).await {
                let link = self.write_link(record.take(), (first + k, path), form_factor, store::UNKNOWN, 0).await;
                open.extend(link);
            }
        }
        true
    }

    /// The form factor of a new link: found now, or not a number where a fine task is to find it. `None`: no link.
    async fn form_factor_of_new(&self, receiver: &Place, source: &Place) -> Option<f64> {
        if self.cx.switches.fine_tasks {
            return Some(f64::NAN);
        }
        let before = self.p.enter(Mark::new(Cause::Work, "F"));
        let form_factor = self.form_factor(receiver, source).await;
        self.p.enter(before);
        (form_factor > 0.0).then_some(form_factor)
    }
}
