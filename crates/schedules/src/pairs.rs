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
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Nodes and fragments of the tree that a visibility's rays come by, each once, in the order in which they do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Touched {
    /// Nodes.
    pub nodes: Vec<u32>,
    /// Fragments.
    pub fragments: Vec<u32>,
}

/// Evaluates pairs.
pub trait Pairs: Sync {
    /// The exchange area `A_a F_ab = A_b F_ba`, m², and the work of one evaluation.
    fn exchange_area(&self, a: &Place, b: &Place) -> (f64, Work);

    /// The visibility, and the work of one evaluation.
    fn sight(&self, a: &Place, b: &Place) -> (Sight, Work);

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

    fn touched(&self, _: &Place, _: &Place) -> Arc<Touched> {
        Arc::default()
    }
}

/// Shards of the memory: with a handful of threads, two rarely want one at the same time.
const SHARDS: usize = 64;

/// A pair, by its names in order.
type PairKey = [u64; 2];

#[derive(Clone, Copy, Debug)]
struct Seen {
    sight: Sight,
    rays: u32,
    node_visits: u32,
    fragment_tests: u32,
}

#[derive(Debug, Default)]
struct Shard {
    exchange: FxHashMap<PairKey, f64>,
    seen: FxHashMap<PairKey, Seen>,
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
        // Four points to four disks, whatever the pair.
        let counts = Counts { form_factors: 1, form_factor_terms: 16, ..Counts::default() };
        let work = cost::of_kernel(&counts);
        if let Some(&exchange) = self.memory.shard(key).exchange.get(&key) {
            return (exchange, work);
        }
        let pair = [self.problem.named(a), self.problem.named(b)];
        let exchange = self.evaluator.exchange_area_of(pair[0], pair[1], &mut NoProbe);
        self.memory.shard(key).exchange.insert(key, exchange);
        (exchange, work)
    }

    fn sight(&self, a: &Place, b: &Place) -> (Sight, Work) {
        let key = key(a, b);
        let known = self.memory.shard(key).seen.get(&key).copied();
        let seen = known.unwrap_or_else(|| {
            let mut counts = Counts::default();
            let (a, b) = (self.problem.named(a), self.problem.named(b));
            let sight = self.evaluator.sight_ray_by_ray_of(a, b, &mut counts);
            let seen = Seen {
                sight,
                rays: counts.rays as u32,
                node_visits: counts.node_visits as u32,
                fragment_tests: counts.fragment_tests as u32,
            };
            self.memory.shard(key).seen.insert(key, seen);
            seen
        });
        let counts = Counts {
            visibilities: 1,
            rays: seen.rays.into(),
            node_visits: seen.node_visits.into(),
            fragment_tests: seen.fragment_tests.into(),
            ..Counts::default()
        };
        (seen.sight, cost::of_kernel(&counts))
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
