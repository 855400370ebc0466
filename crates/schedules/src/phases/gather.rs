//! Light: an element gathers over its links, passes on what arrives to its children, and parents get the means of theirs.

use super::lists::Entry;
use super::refine::join_key;
use crate::cost;
use crate::pairs::Pairs;
use crate::problem::Place;
use crate::store::{self, Counter, Store};
use crate::task::Task;
use crate::worker::Worker;
use isolux_core::solution::{Values, gather_sum, pulled, settled, tree_sum};
use isolux_core::tree::Path;
use isolux_core::units::Rgb;
use isolux_machine::protocols::parallel_for;
use isolux_machine::{Note, Processor};

/// Roots whose light one processor adds up at a time: a subtree of the sum's tree.
const SUM_BLOCK: u64 = 16;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// The second half of R: gathers, then the children's turn, or a leaf's radiosity and the way up.
    pub(crate) async fn gather_and_descend(&self, element: u32, place: &Place, kept: Option<Vec<Entry>>) {
        let (p, store) = (&self.p, &self.cx.store);
        let head = store.element(element, store::LINKS);
        let mut links = match kept {
            Some(kept) => kept,
            None => {
                let first = p.load(head).await;
                self.read_list(first).await
            }
        };
        // D31: what is summed in one order gives one sum.
        if !links.is_sorted_by_key(|entry| entry.path) {
            links.sort_unstable_by_key(|entry| entry.path);
            let count = links.len() as u64;
            self.charge(cost::ORDER, count * cost::sorting_depth(count)).await;
            let begin = self.chain(&mut links, 0).await;
            p.store(head, begin).await;
        }
        p.store(store.element(element, store::COUNT), links.len() as u64).await;
        let mut terms = Vec::with_capacity(links.len());
        for entry in &links {
            let radiosity = self.radiosity(entry.source).await;
            self.note_read(entry.source);
            terms.push(radiosity * entry.weight());
        }
        self.charge(cost::GATHER, links.len() as u64).await;
        let own: Rgb = gather_sum(terms, Rgb::ZERO);
        let parent = p.load(store.element(element, store::PARENT)).await.checked_sub(1);
        let from_above = match parent {
            Some(parent) => store::rgb(p.load_block(store.element(parent as u32, store::IRRADIANCE)).await),
            None => Rgb::ZERO,
        };
        let arriving = from_above + own;
        let first_child = store.element(element, store::FIRST_CHILD);
        let mut first = p.load(first_child).await as u32;
        if first == 0 {
            // Others may split it: as a source for them.
            p.lock(store.lock(element)).await;
            first = p.load(first_child).await as u32;
            if first == 0 {
                self.settle(element, place, arriving).await;
            }
            p.unlock(store.lock(element)).await;
        }
        if first == 0 {
            self.ascend(parent.map(|parent| parent as u32)).await;
            return;
        }
        p.store_block(store.element(element, store::IRRADIANCE), store::bits(arriving)).await;
        self.descend(element, first).await;
    }

    /// A leaf gets its radiosity.
    pub(crate) async fn settle(&self, element: u32, place: &Place, arriving: Rgb) {
        let polygon = &self.cx.problem.scene.polygons[place.polygon as usize];
        let values = settled(polygon.emission, polygon.reflectance, arriving, 1.0);
        self.charge(cost::SETTLE, 1).await;
        self.write_light(element, &values).await;
    }

    async fn write_light(&self, element: u32, values: &Values) {
        let slot = Store::slots(self.cx.problem.parameters.update, self.iteration)[1];
        self.p.store_block(self.cx.store.element(element, slot), store::bits(values.radiosity)).await;
        let irradiance = self.cx.store.element(element, store::IRRADIANCE);
        self.p.store_block(irradiance, store::bits(values.irradiance)).await;
        self.note_update(element);
    }

    /// Children's R-tasks: tasks, where they have enough links to be worth it.
    async fn descend(&self, element: u32, first: u32) {
        let (p, store) = (&self.p, &self.cx.store);
        p.store(store.element(element, store::PENDING), 4).await;
        let mut inline = Vec::new();
        let mut tasks = Vec::new();
        for child in first..first + 4 {
            let links = p.load(store.element(child, store::COUNT)).await;
            let to = if links >= self.cx.grain.least_links.into() { &mut tasks } else { &mut inline };
            to.push(child);
        }
        self.cx.queues.announce(p, tasks.len() as u64).await;
        for child in tasks {
            self.put(Task::Refine { element: child }).await;
        }
        for child in inline {
            Box::pin(self.refine(child)).await;
        }
    }

    /// A child is done: the last one of four gives the parent its means, and so on up.
    pub(crate) async fn ascend(&self, mut parent: Option<u32>) {
        while let Some(element) = parent {
            if !self.join(element).await {
                return;
            }
            self.p.note(Note::Resume(join_key(element)));
            self.pull(element).await;
            parent = self.p.load(self.cx.store.element(element, store::PARENT)).await.checked_sub(1).map(|e| e as u32);
        }
    }

    /// A parent gets the means of its children.
    pub(crate) async fn pull(&self, element: u32) {
        let (p, store) = (&self.p, &self.cx.store);
        let place = self.place_of(element).await;
        let first = p.load(store.element(element, store::FIRST_CHILD)).await as u32;
        let slot = Store::slots(self.cx.problem.parameters.update, self.iteration)[1];
        let slot = (slot - store::RADIOSITY) as usize;
        let mut values = [Values { radiosity: Rgb::ZERO, irradiance: Rgb::ZERO, open_share: 1.0 }; 4];
        let mut areas = [0.0; 4];
        for k in 0..4 {
            let words: [u64; 9] = p.load_block(store.element(first + k as u32, store::RADIOSITY)).await;
            values[k].radiosity = store::rgb([words[slot], words[slot + 1], words[slot + 2]]);
            values[k].irradiance = store::rgb([words[6], words[7], words[8]]);
            areas[k] = self.place(place.path.child(k as u32)).area;
        }
        self.charge(cost::PULL, 1).await;
        self.write_light(element, &pulled(values, areas, place.area)).await;
    }

    /// All light that leaves, and how much it has changed since `before`: every processor helps; the first tells.
    pub(crate) async fn measure(&self, before: f64) -> f64 {
        let (p, store) = (&self.p, &self.cx.store);
        let roots = self.cx.problem.roots() as u64;
        let blocks = roots.div_ceil(SUM_BLOCK);
        let slot = Store::slots(self.cx.problem.parameters.update, self.iteration)[1];
        parallel_for(p, &self.cx.loops[3], blocks, 1, async |block| {
            let mut terms = Vec::with_capacity(SUM_BLOCK as usize);
            for root in block * SUM_BLOCK..((block + 1) * SUM_BLOCK).min(roots) {
                let radiosity = store::rgb(p.load_block(store.element(root as u32, slot)).await);
                terms.push(radiosity * self.place(Path::root(root as u32)).area);
            }
            self.charge(cost::GATHER, terms.len() as u64).await;
            p.store_block(store.sum(block), store::bits(tree_sum(&terms, Rgb::ZERO))).await;
        })
        .await;
        self.barrier().await;
        if self.is_first() {
            let mut sums = Vec::with_capacity(blocks as usize);
            for block in 0..blocks {
                sums.push(store::rgb(p.load_block(store.sum(block)).await));
            }
            self.charge(cost::GATHER, blocks).await;
            let total = tree_sum(&sums, Rgb::ZERO).mean();
            let residual = if total > 0.0 { (total - before).abs() / total } else { 0.0 };
            p.store(store.counter(Counter::Residual), residual.to_bits()).await;
        }
        self.barrier().await;
        f64::from_bits(p.load(store.counter(Counter::Residual)).await)
    }
}
