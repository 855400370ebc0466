//! Form factors and visibilities of pairs, and what finding them costs: two places go in, a number and work come out, the
//! same whoever asks and when. Who asks, and who pays, is the schedules' affair.

use crate::cost;
use crate::problem::{Place, Problem};
use isolux_core::kernels::visibility::Sight;
use isolux_core::kernels::{Counts, NoProbe, Probe};
use isolux_core::links::Evaluator;
use isolux_machine::Work;
use rustc_hash::{FxHashMap, FxHasher};
use std::hash::{Hash, Hasher};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Nodes and fragments of the tree that a visibility's rays come by, each once, in the order in which they do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Touched {
    /// Nodes.
    pub nodes: Vec<u32>,
    /// Fragments.
    pub fragments: Vec<u32>,
}

/// Parts that the evaluation of a visibility can be cut into: one for each of 16 rays.
pub(crate) const RAY_PARTS: usize = 16;

/// Evaluates pairs.
pub trait Pairs: Sync {
    /// The exchange area `A_a F_ab = A_b F_ba`, m², and the work of one evaluation.
    fn exchange_area(&self, a: &Place, b: &Place) -> (f64, Work);

    /// The visibility, and the work of one evaluation.
    fn sight(&self, a: &Place, b: &Place) -> (Sight, Work);

    /// The work of some of the parts of a visibility's evaluation: there are 16 that can be done one by one, a ray each.
    fn part_of_sight(&self, a: &Place, b: &Place, parts: Range<usize>) -> Work;

    /// What the rays of the visibility touch.
    fn touched(&self, a: &Place, b: &Place) -> Arc<Touched>;
}

/// The evaluator of a problem.
fn evaluator<'a>(problem: &Problem<'a>) -> Evaluator<'a> {
    let isolux_core::solution::Parameters { form_factor, sampling, covered, seed, .. } = problem.parameters;
    Evaluator { scene: problem.scene, bsp: problem.bsp, form_factor, sampling, covered, seed }
}

/// Evaluates each pair whenever it is asked, and counts nothing: for real machines.
#[derive(Debug)]
pub struct Direct<'a> {
    problem: &'a Problem<'a>,
    evaluator: Evaluator<'a>,
}

impl<'a> Direct<'a> {
    /// For the places of this problem.
    #[must_use]
    pub fn new(problem: &'a Problem<'a>) -> Direct<'a> {
        Direct { problem, evaluator: evaluator(problem) }
    }
}

impl Pairs for Direct<'_> {
    fn exchange_area(&self, a: &Place, b: &Place) -> (f64, Work) {
        let pair = [self.problem.named(a), self.problem.named(b)];
        (self.evaluator.exchange_area_of(pair[0], pair[1], &mut NoProbe), Work::default())
    }

    fn sight(&self, a: &Place, b: &Place) -> (Sight, Work) {
        (self.evaluator.sight_of(self.problem.named(a), self.problem.named(b), &mut NoProbe), Work::default())
    }

    fn part_of_sight(&self, _: &Place, _: &Place, _: Range<usize>) -> Work {
        Work::default()
    }

    fn touched(&self, _: &Place, _: &Place) -> Arc<Touched> {
        Arc::default()
    }
}

/// Shards of the memory: with a handful of threads, two rarely want one at the same time.
const SHARDS: usize = 64;

/// A pair, by its names in order.
type PairKey = [u64; 2];

/// Rays, node visits and fragment tests.
type Counted = [u16; 3];

/// What is known of a pair. Small, since there are hundreds of thousands, and each is looked up several times in a run.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// Not a number where it was not asked for yet.
    exchange: f64,
    /// The visibility, if there are parts.
    share: f64,
    proven: bool,
    /// Counts of all parts together.
    counted: [u32; 3],
    /// One more than its place among the counts by part, where the visibility was asked for.
    parts: u32,
}

impl Default for Known {
    fn default() -> Known {
        Known { exchange: f64::NAN, share: 0.0, proven: false, counted: [0; 3], parts: 0 }
    }
}

impl Known {
    fn sight(&self) -> Sight {
        Sight { share: self.share, proven: self.proven }
    }
}

/// The work of a visibility, or of the part of it that has so many rays, node visits and fragment tests.
fn add_sight(work: &mut Work, first: bool, counted: [u64; 3]) {
    let [rays, node_visits, fragment_tests] = counted;
    let visibilities = u64::from(first);
    cost::add_kernel(work, &Counts { visibilities, rays, node_visits, fragment_tests, ..Counts::default() });
}

/// Counts ray by ray; of more than [`RAY_PARTS`] rays, several share a part.
#[derive(Default)]
struct PartCounts {
    rays: usize,
    parts: [Counted; RAY_PARTS],
}

impl PartCounts {
    fn count(&mut self, what: usize) {
        let count = &mut self.parts[self.rays.saturating_sub(1) % RAY_PARTS][what];
        *count = count.saturating_add(1);
    }
}

impl Probe for PartCounts {
    fn ray(&mut self) {
        self.rays += 1;
        self.count(0);
    }
    fn node_visit(&mut self, _node: u32) {
        self.count(1);
    }
    fn fragment_test(&mut self, _fragment: u32) {
        self.count(2);
    }
}

#[derive(Debug, Default)]
struct Shard {
    known: FxHashMap<PairKey, Known>,
    parts: Vec<[Counted; RAY_PARTS]>,
    touched: FxHashMap<PairKey, Arc<Touched>>,
}

/// What is known of pairs, over all runs of a problem on simulated machines: numbers that depend on no time. Every run is
/// charged for every evaluation all the same.
#[derive(Debug)]
pub struct Memory {
    shards: Vec<Mutex<Shard>>,
}

impl Default for Memory {
    fn default() -> Memory {
        Memory { shards: (0..SHARDS).map(|_| Mutex::default()).collect() }
    }
}

impl Memory {
    fn shard(&self, key: PairKey) -> MutexGuard<'_, Shard> {
        let mut hasher = FxHasher::default();
        key.hash(&mut hasher);
        let shard = (hasher.finish() >> 32) as usize % SHARDS;
        self.shards[shard].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Evaluates each pair once and remembers it. Visibilities are counted as rays that walk the tree one by one do.
#[derive(Debug)]
pub struct Remembered<'a> {
    problem: &'a Problem<'a>,
    evaluator: Evaluator<'a>,
    memory: &'a Memory,
}

impl<'a> Remembered<'a> {
    /// For the places of this problem, with what is known of them.
    #[must_use]
    pub fn new(problem: &'a Problem<'a>, memory: &'a Memory) -> Remembered<'a> {
        Remembered { problem, evaluator: evaluator(problem), memory }
    }
}

impl Remembered<'_> {
    /// What is known of a pair, once its visibility is; and what `ask` finds among its counts by part.
    fn seen<T>(&self, a: &Place, b: &Place, ask: impl Fn(&Known, &[Counted; RAY_PARTS]) -> T) -> T {
        let key = key(a, b);
        let shard = self.memory.shard(key);
        if let Some(known) = shard.known.get(&key)
            && let Some(parts) = known.parts.checked_sub(1)
        {
            return ask(known, &shard.parts[parts as usize]);
        }
        drop(shard);
        let mut counts = PartCounts::default();
        let (a, b) = (self.problem.named(a), self.problem.named(b));
        let Sight { share, proven } = self.evaluator.sight_ray_by_ray_of(a, b, &mut counts);
        let mut counted = [0; 3];
        for part in &counts.parts {
            counted.iter_mut().zip(part).for_each(|(all, &count)| *all += u32::from(count));
        }
        let mut shard = self.memory.shard(key);
        shard.parts.push(counts.parts);
        let parts = shard.parts.len() as u32;
        let known = shard.known.entry(key).or_default();
        *known = Known { share, proven, counted, parts, ..*known };
        ask(known, &counts.parts)
    }
}

fn key(a: &Place, b: &Place) -> PairKey {
    let (a, b) = (a.path.to_bits(), b.path.to_bits());
    [a.min(b), a.max(b)]
}

/// Notes each node and fragment once.
#[derive(Default)]
struct Recorder {
    touched: Touched,
    nodes: rustc_hash::FxHashSet<u32>,
    fragments: rustc_hash::FxHashSet<u32>,
}

impl Probe for Recorder {
    fn node_visit(&mut self, node: u32) {
        if self.nodes.insert(node) {
            self.touched.nodes.push(node);
        }
    }
    fn fragment_test(&mut self, fragment: u32) {
        if self.fragments.insert(fragment) {
            self.touched.fragments.push(fragment);
        }
    }
}

impl Pairs for Remembered<'_> {
    fn exchange_area(&self, a: &Place, b: &Place) -> (f64, Work) {
        let key = key(a, b);
        let counts = Counts { form_factors: 1, ..Counts::default() };
        let work = cost::of_kernel(&counts);
        let known = self.memory.shard(key).known.get(&key).map(|known| known.exchange);
        if let Some(exchange) = known.filter(|exchange| !exchange.is_nan()) {
            return (exchange, work);
        }
        let pair = [self.problem.named(a), self.problem.named(b)];
        let exchange = self.evaluator.exchange_area_of(pair[0], pair[1], &mut NoProbe);
        self.memory.shard(key).known.entry(key).or_default().exchange = exchange;
        (exchange, work)
    }

    fn sight(&self, a: &Place, b: &Place) -> (Sight, Work) {
        self.seen(a, b, |known, _| {
            let mut work = Work::default();
            add_sight(&mut work, true, known.counted.map(u64::from));
            (known.sight(), work)
        })
    }

    fn part_of_sight(&self, a: &Place, b: &Place, parts: Range<usize>) -> Work {
        self.seen(a, b, |_, counted| {
            let mut work = Work::default();
            for part in parts.clone() {
                add_sight(&mut work, part == 0, counted[part].map(u64::from));
            }
            work
        })
    }

    fn touched(&self, a: &Place, b: &Place) -> Arc<Touched> {
        let key = key(a, b);
        if let Some(touched) = self.memory.shard(key).touched.get(&key) {
            return Arc::clone(touched);
        }
        let mut recorder = Recorder::default();
        let (a, b) = (self.problem.named(a), self.problem.named(b));
        let _ = self.evaluator.sight_ray_by_ray_of(a, b, &mut recorder);
        let touched = Arc::new(recorder.touched);
        self.memory.shard(key).touched.insert(key, Arc::clone(&touched));
        touched
    }
}
