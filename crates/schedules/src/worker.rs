//! One processor at work: what it shares with the others goes through machine words, what kernels answer is charged. The
//! tasks themselves are in `splash`, `sbpram` and `phases`.

use crate::pairs::Pairs;
use crate::problem::{Place, Problem};
use crate::queues::Queues;
use crate::store::{self, Counter, Store};
use crate::task::Task;
use crate::variant::{Grain, Switches};
use crate::wavefront::Flat;
use isolux_core::kernels::visibility::Sight;
use isolux_core::scene::Corners;
use isolux_core::tree::Path;
use isolux_core::units::Rgb;
use isolux_machine::protocols::{ParallelLoop, StealCounts};
use isolux_machine::{BarrierId, Prefix, Processor, Work};
use std::cell::{Cell, RefCell};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

/// Loops that a phase may have: some by number, the last four in turn.
pub(crate) const LOOPS: usize = 8;

/// What all processors know, and what nobody changes while they work.
#[derive(Debug)]
pub(crate) struct Context<'a, K> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) pairs: K,
    pub(crate) switches: Switches,
    pub(crate) grain: Grain,
    pub(crate) store: Store,
    pub(crate) queues: Queues,
    pub(crate) loops: [ParallelLoop; LOOPS],
    pub(crate) flat: Option<Flat>,
    pub(crate) barrier: BarrierId,
    /// The iteration in which each element last got a radiosity: what the share of updated reads is told from. No part of
    /// the program: it takes no time.
    pub(crate) updated: Vec<AtomicU32>,
    /// Room for some kind of record has run out.
    pub(crate) full: AtomicBool,
}

/// What a processor did that its machine does not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Radiosities read by gathers.
    pub reads: u64,
    /// Of these, values that the same iteration wrote.
    pub updated_reads: u64,
    /// How its search for others' tasks went.
    pub steals: StealCounts,
}

impl Tally {
    /// Adds another's.
    pub fn add(&mut self, other: &Tally) {
        self.reads += other.reads;
        self.updated_reads += other.updated_reads;
        self.steals.add(&other.steals);
    }
}

/// One processor, in one iteration.
pub(crate) struct Worker<'a, P, K> {
    pub(crate) p: P,
    pub(crate) cx: &'a Context<'a, K>,
    pub(crate) iteration: u32,
    pub(crate) tally: RefCell<Tally>,
    /// How many loops of a row of loops have been.
    pub(crate) turn: Cell<usize>,
}

impl<'a, P: Processor, K: Pairs> Worker<'a, P, K> {
    pub(crate) fn new(p: P, cx: &'a Context<'a, K>, iteration: u32) -> Worker<'a, P, K> {
        Worker { p, cx, iteration, tally: RefCell::default(), turn: Cell::new(0) }
    }

    pub(crate) fn place(&self, path: Path) -> &'a Place {
        self.cx.problem.place(path)
    }

    pub(crate) async fn charge(&self, class: isolux_machine::WorkClass, count: u64) {
        self.p.charge(&Work::of(class, count)).await;
    }

    /// Runs tasks until all are finished.
    pub(crate) async fn run_tasks(&self) {
        let mut steals = StealCounts::default();
        while let Some(task) = self.cx.queues.next(&self.p, &mut steals).await {
            self.run(task).await;
            self.cx.queues.finish(&self.p).await;
        }
        self.tally.borrow_mut().steals.add(&steals);
    }

    /// Runs a task.
    pub(crate) async fn run(&self, task: Task) {
        let before = self.p.enter(task.mark());
        self.start(task).await;
        self.p.enter(before);
    }

    /// A task's program. Its state is on the heap, so that idle processors are small.
    fn start(&self, task: Task) -> Pin<Box<dyn Future<Output = ()> + '_>> {
        match task {
            Task::Insert { at } => Box::pin(self.insert(at)),
            Task::Partition { node, first } => Box::pin(self.partition(node, first)),
            Task::Factors { root, at } => Box::pin(self.factors(root, at)),
            Task::Factor { a, b } => Box::pin(self.factor(a, b)),
            Task::Refine { element } => Box::pin(self.refine(element)),
            Task::Visibility { element, count, links } => {
                Box::pin(async move { self.visibility_task(element, &links[..count as usize]).await })
            }
            Task::Interpolate { element } => Box::pin(self.interpolate_below(element)),
        }
    }

    /// Puts a task that has been announced, or runs it where there is no room for it.
    pub(crate) async fn put(&self, task: Task) {
        if self.cx.queues.put(&self.p, task).await.is_err() {
            Box::pin(self.run(task)).await;
            self.cx.queues.finish(&self.p).await;
        }
    }

    /// Form factor from receiver to source: one evaluation, charged.
    pub(crate) async fn form_factor(&self, receiver: &Place, source: &Place) -> f64 {
        (self.exchange_area(receiver, source).await / receiver.area).min(1.0)
    }

    pub(crate) async fn exchange_area(&self, a: &Place, b: &Place) -> f64 {
        let (exchange, work) = self.cx.pairs.exchange_area(a, b);
        self.p.charge(&work).await;
        exchange
    }

    /// Visibility of two elements: one evaluation, charged.
    pub(crate) async fn sight(&self, [a, b]: [(u32, &Place); 2]) -> Sight {
        let (sight, work) = self.cx.pairs.sight(a.1, b.1);
        self.p.charge(&work).await;
        if self.p.has_caches() {
            self.touch_sight([a, b]).await;
        }
        sight
    }

    /// Reads what a visibility reads, for machines with caches.
    pub(crate) async fn touch_sight(&self, [a, b]: [(u32, &Place); 2]) {
        let (p, store) = (&self.p, &self.cx.store);
        let touched = self.cx.pairs.touched(a.1, b.1);
        p.touch(store.geometry, store::GEOMETRY_WORDS, &[a.0, b.0]).await;
        p.touch(store.nodes(), store::NODE_WORDS, &touched.nodes).await;
        p.touch(store.fragments, store::FRAGMENT_WORDS, &touched.fragments).await;
    }

    /// Reserves records by multiprefix, where SPLASH-2's program takes one at a time under a global lock (D29); `None` when
    /// there is no room, which ends the run with an error once it is over.
    pub(crate) async fn reserve(&self, counter: Counter, count: u64, limit: u64) -> Option<u32> {
        let first = self.p.prefix(Prefix::Add, self.cx.store.counter(counter), count).await;
        if first + count > limit {
            self.cx.full.store(true, Relaxed);
            return None;
        }
        Some(first as u32)
    }

    /// Writes a root.
    pub(crate) async fn new_root(&self, root: u32) {
        let place = self.place(Path::root(root));
        let emission = self.cx.problem.scene.polygons[place.polygon as usize].emission;
        self.write_element(root, None, place.path, [emission, emission], Rgb::ZERO).await;
    }

    async fn write_element(&self, element: u32, parent: Option<u32>, path: Path, slots: [Rgb; 2], irradiance: Rgb) {
        let mut words = [0; store::ELEMENT_WORDS as usize];
        words[store::PARENT as usize] = parent.map_or(0, |parent| u64::from(parent) + 1);
        let lit = [slots[0], slots[1], irradiance].map(store::bits);
        let radiosity = store::RADIOSITY as usize;
        words[radiosity..radiosity + 9].copy_from_slice(lit.as_flattened());
        words[store::PATH as usize] = path.to_bits();
        self.p.store_block(self.cx.store.element(element, 0), words).await;
    }

    /// The first child of an element, which is split if it is a leaf; `None` where a name can reach no deeper. Children
    /// start with their parent's light, in both slots: so it makes no difference whether the parent has been gathered in
    /// this iteration already.
    pub(crate) async fn split(&self, element: u32, path: Path) -> Option<u32> {
        let (p, store) = (&self.p, &self.cx.store);
        let first_child = store.element(element, store::FIRST_CHILD);
        let first = p.load(first_child).await as u32;
        if first != 0 {
            return Some(first);
        }
        if path.depth() >= Path::MAX_DEPTH {
            return None;
        }
        p.lock(store.lock(element)).await;
        let mut first = p.load(first_child).await as u32;
        if first == 0 {
            first = self.make_children(element, path).await.unwrap_or(0);
        }
        p.unlock(store.lock(element)).await;
        (first != 0).then_some(first)
    }

    /// Splits a leaf that nobody else can be splitting.
    pub(crate) async fn split_claimed(&self, element: u32) {
        let path = self.place_of(element).await.path;
        self.make_children(element, path).await;
    }

    async fn make_children(&self, element: u32, path: Path) -> Option<u32> {
        let (p, store) = (&self.p, &self.cx.store);
        let first = self.reserve(Counter::Elements, 4, store.sizes.elements).await?;
        let lit: [u64; 9] = p.load_block(store.element(element, store::RADIOSITY)).await;
        let part = |k: usize| store::rgb([lit[3 * k], lit[3 * k + 1], lit[3 * k + 2]]);
        for k in 0..4 {
            self.write_element(first + k, Some(element), path.child(k), [part(0), part(1)], part(2)).await;
        }
        p.store(store.element(element, store::FIRST_CHILD), first.into()).await;
        Some(first)
    }

    /// Radiosity of an element, as this iteration sees it.
    pub(crate) async fn radiosity(&self, element: u32) -> Rgb {
        let slot = Store::slots(self.cx.problem.parameters.update, self.iteration)[0];
        store::rgb(self.p.load_block(self.cx.store.element(element, slot)).await)
    }

    /// An element has got its radiosity.
    pub(crate) fn note_update(&self, element: u32) {
        self.cx.updated[element as usize].store(self.iteration + 1, Relaxed);
    }

    /// A gather reads a radiosity.
    pub(crate) fn note_read(&self, element: u32) {
        let updated = self.cx.updated[element as usize].load(Relaxed) == self.iteration + 1;
        let mut tally = self.tally.borrow_mut();
        tally.reads += 1;
        tally.updated_reads +=
            u64::from(updated && self.cx.problem.parameters.update == isolux_core::solution::Update::InPlace);
    }

    /// The corners of a piece, from its words.
    pub(crate) fn corners(words: &[u64]) -> Option<Corners> {
        let points: Vec<glam::DVec3> = words[2..2 + 3 * (words[1] as usize).min(4)]
            .chunks_exact(3)
            .map(|c| glam::DVec3::new(f64::from_bits(c[0]), f64::from_bits(c[1]), f64::from_bits(c[2])))
            .collect();
        Corners::from_slice(&points)
    }

    /// Who is in place to do what one alone must do.
    pub(crate) fn is_first(&self) -> bool {
        self.p.id() == 0
    }

    /// Waits for the others.
    pub(crate) async fn barrier(&self) {
        self.p.barrier(self.cx.barrier).await;
    }

    /// All loops and the count of tasks begin anew: the first processor does it, between two barriers.
    pub(crate) async fn begin(&self, tasks: u64) {
        if self.is_first() {
            for indices in &self.cx.loops {
                indices.reset(&self.p).await;
            }
            self.cx.queues.begin(&self.p, tasks).await;
        }
        self.barrier().await;
    }
}
