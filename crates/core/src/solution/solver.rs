//! The sequential solver: a scene and its tree go in, refinement alternates with gathering until the total settles,
//! a hierarchy with light comes out. Time is the caller's.

use super::backs::LazyBacks;
use super::sums::gather_sum;
use super::{Flow, Light, Observer, Phase, Progress, Update, WATCH_INTERVAL, Watch};
use crate::kernels::Probe;
use crate::kernels::form_factor::FormFactor;
use crate::kernels::oracle::Thresholds;
use crate::kernels::visibility::{Covered, Sampling};
use crate::links::{Evaluator, Hierarchy, Link, Links, Step, refine};
use crate::scene::{Corners, Plane, Scene, Side};
use crate::tree::{Bsp, ElementId, Elements, fragment_roots};
use crate::units::Rgb;
use std::ops::{Add, Range};

/// What the roots of the quadtrees are (D1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Roots {
    /// The input polygons; the BSP tree's fragments only block rays.
    #[default]
    Polygons,
    /// The BSP tree's fragments, as in the paper.
    Fragments,
}

/// How vertices get their values from a settled hierarchy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// From the constant values of the leaves around them, as in the paper.
    Averaged,
    /// Gathered at each vertex over the links of its leaf, with factors of the point.
    #[default]
    Gathered,
}

/// When the iteration ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// The total radiosity changed by at most this share (the paper's rule).
    Change(f64),
    /// D18: what is still to come changes it by at most this share: the last change times `q / (1 - q)`, where q is the
    /// ratio of the last two changes.
    Remainder(f64),
}

/// Parameters of a solve, absolute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// `BF_eps` and `A_eps`.
    pub thresholds: Thresholds,
    /// When the iteration ends.
    pub stop: Stop,
    /// When a new radiosity is seen by others.
    pub update: Update,
    /// What the roots are.
    pub roots: Roots,
    /// Form factor kernel.
    pub form_factor: FormFactor,
    /// Rays of a visibility.
    pub sampling: Sampling,
    /// What becomes of covered parts of elements.
    pub covered: Covered,
    /// Seed of sample points.
    pub seed: u64,
}

/// What an iteration did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iteration {
    /// Sum of area times radiosity at its end, W or lm.
    pub total: Rgb,
    /// Relative change of the total (mean over bands).
    pub residual: f64,
    /// Is the iteration at its end by [`Stop`]?
    pub converged: bool,
}

/// The share of the first iteration in all work, where it is not known yet: 0.81 of visibilities and 0.75 to 0.80 of
/// time in SPLASH-2's run of its room.
const FIRST_ITERATION_SHARE: f64 = 0.75;

/// Largest sum of `F V / s`, s the open share, of an element that something covers. It should be 1 at most, but is made of estimates;
/// without any cover, sums reach 2.0 to 2.3 in single elements of the room and the Cornell box. A bound of 1 would take
/// the excess of single elements away and leave what others miss: the room then loses 8 % of its light.
const MOST_OPENNESS: f64 = 2.0;

/// Work of one gathered link, or one decision, in units of one visibility: for the estimate of progress, and for how
/// often the observer is asked.
const GATHER_WORK: f64 = 0.01;

/// A solve in progress.
#[derive(Debug)]
pub struct Solver<'a, P> {
    evaluator: Evaluator<'a>,
    parameters: Parameters,
    hierarchy: Hierarchy,
    roots_of: Vec<Range<u32>>,
    active: Vec<bool>,
    /// Do polygons that are not active wake when light can reach them?
    backs_sleep: bool,
    backs: LazyBacks,
    /// What kernels did so far.
    pub probe: P,
    forecast: Forecast,
    /// Work since the observer was asked, in units of one visibility.
    unwatched: f64,
    iterations: Vec<Iteration>,
}

impl<'a, P: Probe + Default> Solver<'a, P> {
    /// Roots without links, lit by their own emission only. Fronts and backs that emit take part; other backs sleep
    /// until light can reach them.
    #[must_use]
    pub fn new(scene: &'a Scene, bsp: &'a Bsp, parameters: Parameters) -> Solver<'a, P> {
        let active = scene.polygons.iter().map(|polygon| polygon.side == Side::Front || polygon.emission != Rgb::ZERO);
        let active = active.collect();
        Solver { backs_sleep: true, ..Solver::with_active(scene, bsp, parameters, active) }
    }

    /// As [`Solver::new`], with a fixed set of polygons: those that `active` says (none beyond its end) take part, and
    /// are linked from the start; the others have roots, and never a link.
    #[must_use]
    pub fn with_active(scene: &'a Scene, bsp: &'a Bsp, parameters: Parameters, mut active: Vec<bool>) -> Solver<'a, P> {
        active.resize(scene.polygons.len(), false);
        let planes: Vec<Plane> = scene.polygons.iter().map(|polygon| polygon.plane).collect();
        let roots: Vec<(Corners, u32)> = match parameters.roots {
            Roots::Polygons => scene.polygons.iter().map(|polygon| polygon.corners).zip(0..).collect(),
            Roots::Fragments => fragment_roots(scene, bsp).iter().map(|root| (root.corners, root.polygon)).collect(),
        };
        let mut roots_of = Vec::with_capacity(scene.polygons.len());
        let mut at = 0;
        for index in 0..scene.polygons.len() as u32 {
            let first = at;
            at += roots[first as usize..].iter().take_while(|&&(_, polygon)| polygon == index).count() as u32;
            roots_of.push(first..at);
        }
        let elements = Elements::new(roots, planes);
        let links = Links::new(elements.len());
        let Parameters { form_factor, sampling, covered, seed, .. } = parameters;
        let evaluator = Evaluator { scene, bsp, form_factor, sampling, covered, seed };
        let mut probe = P::default();
        let roots = (0..elements.len() as u32).map(ElementId);
        let open_share = roots.map(|root| evaluator.open_share(&elements, root, &mut probe)).collect();
        let light = Light::emitted(scene, &elements, open_share, parameters.update);
        Solver {
            evaluator,
            parameters,
            hierarchy: Hierarchy { elements, links, light },
            backs_sleep: false,
            backs: LazyBacks::default(),
            roots_of,
            active,
            probe,
            forecast: Forecast::default(),
            unwatched: 0.0,
            iterations: Vec::new(),
        }
    }

    /// Quadtrees, links and light as they stand.
    #[must_use]
    pub fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// What evaluates pairs.
    #[must_use]
    pub fn evaluator(&self) -> Evaluator<'a> {
        self.evaluator
    }

    /// Iterations so far.
    #[must_use]
    pub fn iterations(&self) -> &[Iteration] {
        &self.iterations
    }

    /// For each polygon: does it take part (all fronts, and the backs that light has reached)?
    #[must_use]
    pub fn active(&self) -> &[bool] {
        &self.active
    }

    /// Looks out from the backs that sleep, and links every pair of roots that see each other's front (D7): form factor and
    /// visibility once per pair, for both directions.
    pub fn link_roots(&mut self, observer: &mut dyn Observer) -> Flow {
        let Evaluator { scene, bsp, seed, .. } = self.evaluator;
        let mut watch = Watch::new(observer, Progress::of(Phase::RootLinks));
        if self.backs_sleep {
            match LazyBacks::new(scene, bsp, &self.active, seed, &mut watch) {
                Some(backs) => self.backs = backs,
                None => return self.cancel(),
            }
        }
        let polygons: Vec<u32> = (0..self.active.len() as u32).filter(|&index| self.active[index as usize]).collect();
        for (count, &one) in polygons.iter().enumerate() {
            let done = self.forecast.root_links(count as f64 / polygons.len() as f64);
            if self.report(observer, Phase::RootLinks, done) == Flow::Stop {
                return self.cancel();
            }
            for &two in &polygons[..count] {
                if self.link_pair(one, two, observer, Phase::RootLinks, done) == Flow::Stop {
                    return self.cancel();
                }
            }
        }
        self.sort_root_lists();
        Flow::Continue
    }

    /// Links all roots of two polygons.
    fn link_pair(&mut self, one: u32, two: u32, observer: &mut dyn Observer, phase: Phase, done: f64) -> Flow {
        let scene = self.evaluator.scene;
        let (p, q) = (&scene.polygons[one as usize], &scene.polygons[two as usize]);
        let in_front = |plane: &Plane, corners: &[glam::DVec3]| corners.iter().any(|&c| plane.distance(c) > 0.0);
        if !(in_front(&p.plane, &q.corners) && in_front(&q.plane, &p.corners)) {
            return self.watch(GATHER_WORK, observer, phase, done);
        }
        for a in self.roots_of[one as usize].clone().map(ElementId) {
            for b in self.roots_of[two as usize].clone().map(ElementId) {
                let Hierarchy { elements, links, .. } = &mut self.hierarchy;
                let exchange = self.evaluator.exchange_area(elements, a, b, &mut self.probe);
                if exchange > 0.0 {
                    let sight = self.evaluator.sight(elements, a, b, &mut self.probe);
                    for (receiver, source) in [(a, b), (b, a)] {
                        let form_factor = (exchange / elements.get(receiver).area).min(1.0);
                        links.push(receiver, Link::new(source, form_factor, sight));
                    }
                }
                if self.watch(1.0, observer, phase, done) == Flow::Stop {
                    return Flow::Stop;
                }
            }
        }
        Flow::Continue
    }

    fn sort_root_lists(&mut self) {
        let Hierarchy { elements, links, .. } = &mut self.hierarchy;
        for root in (0..elements.roots() as u32).map(ElementId) {
            let list = links.take(root);
            links.put(root, list, elements);
        }
    }

    /// One iteration: wakes backs that light has reached, refines and gathers every root, pulls, and measures the
    /// change. `None` when the observer stopped it: the hierarchy is then consistent but unfinished.
    pub fn iterate(&mut self, observer: &mut dyn Observer) -> Option<Iteration> {
        if self.wake_backs(observer) == Flow::Stop {
            self.cancel();
            return None;
        }
        let before = self.hierarchy.light.total(&self.hierarchy.elements).mean();
        let roots: Vec<ElementId> = self.active_roots();
        let estimates: Vec<f64> = roots.iter().map(|&root| self.estimate(root)).collect();
        self.forecast.begin_iteration(estimates.iter().sum(), self.iterations.len());
        for (root, estimate) in roots.into_iter().zip(estimates) {
            if self.visit(root, Arriving::default(), observer) == Flow::Stop {
                self.cancel();
                return None;
            }
            self.forecast.root_done(estimate);
        }
        self.hierarchy.light.publish();
        let total = self.hierarchy.light.total(&self.hierarchy.elements);
        let change = (total.mean() - before).abs();
        let residual = if total.mean() > 0.0 { change / total.mean() } else { 0.0 };
        let converged = self.is_converged(residual);
        let iteration = Iteration { total, residual, converged };
        self.iterations.push(iteration);
        self.forecast.end_iteration();
        (self.report(observer, Phase::Iteration, self.forecast.done()) == Flow::Continue).then_some(iteration)
    }

    fn is_converged(&self, residual: f64) -> bool {
        match self.parameters.stop {
            Stop::Change(epsilon) => residual <= epsilon,
            Stop::Remainder(epsilon) => {
                let previous = self.iterations.last().map_or(f64::INFINITY, |iteration| iteration.residual);
                // Without a contraction yet (first iterations, growth) nothing can be said of what is to come.
                let ratio = if residual == 0.0 { 0.0 } else { residual / previous };
                previous.is_finite()
                    && ratio < 1.0
                    && residual * ratio / (1.0 - ratio) <= epsilon
                    && residual <= 10.0 * epsilon
            }
        }
    }

    fn active_roots(&self) -> Vec<ElementId> {
        let active = self.roots_of.iter().zip(&self.active).filter(|&(_, &active)| active);
        active.flat_map(|(roots, _)| roots.clone().map(ElementId)).collect()
    }

    fn wake_backs(&mut self, observer: &mut dyn Observer) -> Flow {
        let woken = self.backs.wake(|polygon| {
            let roots = self.roots_of[polygon as usize].clone();
            roots.into_iter().any(|root| self.hierarchy.light.radiosity(ElementId(root)).max_component() > 0.0)
        });
        if woken.is_empty() {
            return Flow::Continue;
        }
        let done = self.forecast.shown.get();
        for back in woken {
            let others: Vec<u32> = (0..self.active.len() as u32).filter(|&other| self.active[other as usize]).collect();
            self.active[back as usize] = true;
            for other in others {
                if self.link_pair(back, other, observer, Phase::Iteration, done) == Flow::Stop {
                    return Flow::Stop;
                }
            }
        }
        self.sort_root_lists();
        Flow::Continue
    }

    /// Refines and gathers an element and all below it; `arriving` is what its ancestors gathered.
    fn visit(&mut self, id: ElementId, arriving: Arriving, observer: &mut dyn Observer) -> Flow {
        let Solver { evaluator, parameters, hierarchy, probe, forecast, unwatched, iterations, .. } = self;
        let residual = iterations.last().map_or(f64::INFINITY, |iteration| iteration.residual);
        let mut watch = |hierarchy: &Hierarchy, step: Step| {
            *unwatched += match step {
                Step::Decision => GATHER_WORK,
                Step::Visibility => {
                    forecast.visibility();
                    1.0
                }
            };
            if *unwatched < WATCH_INTERVAL {
                return true;
            }
            *unwatched = 0.0;
            let progress = Progress {
                phase: Phase::Iteration,
                done: forecast.done(),
                iteration: iterations.len() as u32,
                residual,
                elements: hierarchy.elements.len(),
                links: forecast.links,
            };
            observer.observe(&progress) == Flow::Continue
        };
        if !refine(id, evaluator, &parameters.thresholds, hierarchy, probe, &mut watch) {
            return Flow::Stop;
        }
        let arriving = self.gather(id, arriving);
        let work = (1 + self.hierarchy.links.of(id).len()) as f64 * GATHER_WORK;
        if self.watch(work, observer, Phase::Iteration, self.forecast.shown.get()) == Flow::Stop {
            return Flow::Stop;
        }
        if self.hierarchy.elements.is_leaf(id) {
            self.settle_leaf(id, arriving);
        } else {
            for child in self.hierarchy.elements.children(id) {
                if self.visit(child, arriving, observer) == Flow::Stop {
                    return Flow::Stop;
                }
            }
            self.hierarchy.light.pull(id, &self.hierarchy.elements);
        }
        Flow::Continue
    }

    /// `arriving`, and what the element's own links bring: `sum F V B` (by [`gather_sum`]), which lands on its open
    /// part alone.
    fn gather(&mut self, id: ElementId, arriving: Arriving) -> Arriving {
        let list = self.hierarchy.links.of(id);
        self.forecast.gathered(list.len());
        let (light, probe) = (&self.hierarchy.light, &mut self.probe);
        let terms = list.iter().map(|link| {
            probe.gather();
            let weight = link.weight();
            Arriving { irradiance: light.radiosity(link.source) * weight, openness: weight, partly: false }
        });
        let mut own = gather_sum(terms, Arriving::default());
        let open_share = self.hierarchy.light.open_share(id);
        if open_share < 1.0 {
            let open = if open_share > 0.0 { 1.0 / open_share } else { 0.0 };
            own = Arriving { irradiance: own.irradiance * open, openness: own.openness * open, partly: true };
        }
        arriving + own
    }

    /// Where something covers the element or an ancestor, both its open share and its visibilities are estimates, and their
    /// ratio may say that the open part sees its hemisphere many times: then what arrives is scaled down.
    fn settle_leaf(&mut self, id: ElementId, arriving: Arriving) {
        let polygon = &self.evaluator.scene.polygons[self.hierarchy.elements.get(id).polygon as usize];
        let excess = if arriving.partly { (arriving.openness / MOST_OPENNESS).max(1.0) } else { 1.0 };
        self.hierarchy.light.settle(id, polygon, arriving.irradiance / excess);
    }

    /// Drops what is unfinished and gathers once over what is there, so that every invariant holds.
    fn cancel(&mut self) -> Flow {
        self.hierarchy.links.drop_open();
        self.sort_root_lists();
        for root in self.active_roots() {
            self.regather(root, Arriving::default());
        }
        self.hierarchy.light.publish();
        Flow::Stop
    }

    fn regather(&mut self, id: ElementId, arriving: Arriving) {
        let arriving = self.gather(id, arriving);
        if self.hierarchy.elements.is_leaf(id) {
            self.settle_leaf(id, arriving);
            return;
        }
        for child in self.hierarchy.elements.children(id) {
            self.regather(child, arriving);
        }
        self.hierarchy.light.pull(id, &self.hierarchy.elements);
    }

    /// Estimated visibilities that refining a root will take. A link that carries k times `BF_eps` ends in about k²
    /// links: every quartering of the source divides what it carries by 4 and alternates with one of the receiver.
    fn estimate(&self, root: ElementId) -> f64 {
        let Hierarchy { elements, links, light } = &self.hierarchy;
        let own: f64 = links
            .of(root)
            .iter()
            .map(|link| {
                let excess = link.weight() * light.radiosity(link.source).mean() / self.parameters.thresholds.bf;
                let limit =
                    elements.get(root).area.max(elements.get(link.source).area) / self.parameters.thresholds.area;
                if excess > 1.0 { (excess * excess).min(limit * limit).max(1.0) } else { GATHER_WORK }
            })
            .sum();
        own + GATHER_WORK
    }

    /// So much work has been done: asks the observer where it is time to.
    fn watch(&mut self, work: f64, observer: &mut dyn Observer, phase: Phase, done: f64) -> Flow {
        self.unwatched += work;
        if self.unwatched < WATCH_INTERVAL {
            return Flow::Continue;
        }
        self.unwatched = 0.0;
        self.report(observer, phase, done)
    }

    fn report(&self, observer: &mut dyn Observer, phase: Phase, done: f64) -> Flow {
        let residual = self.iterations.last().map_or(f64::INFINITY, |iteration| iteration.residual);
        observer.observe(&Progress {
            phase,
            done,
            iteration: self.iterations.len() as u32,
            residual,
            elements: self.hierarchy.elements.len(),
            // Counting them would cost more than the work between two calls.
            links: if phase == Phase::Iteration { self.forecast.links } else { self.hierarchy.links.len() },
        })
    }

    /// Ends the solve: gives back spare memory and hands out what was made.
    #[must_use]
    pub fn finish(mut self) -> (Hierarchy, Vec<bool>, Vec<Iteration>, P) {
        self.hierarchy.links.shrink();
        (self.hierarchy, self.active, self.iterations, self.probe)
    }
}

/// What arrives on the open part of an element by its own and its ancestors' links.
#[derive(Clone, Copy, Debug, Default)]
struct Arriving {
    irradiance: Rgb,
    /// Sum of `F V` per open share.
    openness: f64,
    /// Is one of them partly covered?
    partly: bool,
}

impl Add for Arriving {
    type Output = Arriving;
    fn add(self, other: Arriving) -> Arriving {
        Arriving {
            irradiance: self.irradiance + other.irradiance,
            openness: self.openness + other.openness,
            partly: self.partly || other.partly,
        }
    }
}

/// How much work is left, in units of one visibility: a measure for progress bars, corrected as work is done.
#[derive(Debug, Default)]
struct Forecast {
    visibilities: u64,
    links: usize,
    gathers: f64,
    /// Work of finished iterations.
    finished: Vec<f64>,
    /// Work when this iteration began.
    started: f64,
    estimated: f64,
    estimated_done: f64,
    /// Work done when the last root ended.
    at_last_root: f64,
    shown: std::cell::Cell<f64>,
}

impl Forecast {
    /// Share of progress that the links of the roots stand for before anything is known.
    const ROOT_LINKS: f64 = 0.05;

    fn root_links(&mut self, share: f64) -> f64 {
        // Pairs grow with the square of the polygons done.
        self.shown.set(Forecast::ROOT_LINKS * share * share);
        self.shown.get()
    }

    fn work(&self) -> f64 {
        self.visibilities as f64 + self.gathers * GATHER_WORK
    }

    fn visibility(&mut self) {
        self.visibilities += 1;
    }

    fn gathered(&mut self, links: usize) {
        self.gathers += links as f64;
        self.links += links;
    }

    fn begin_iteration(&mut self, estimated: f64, _iteration: usize) {
        self.links = 0;
        self.started = self.work();
        self.at_last_root = self.started;
        self.estimated = estimated;
        self.estimated_done = 0.0;
    }

    fn root_done(&mut self, estimate: f64) {
        self.estimated_done += estimate;
        self.at_last_root = self.work();
    }

    fn end_iteration(&mut self) {
        self.finished.push(self.work() - self.started);
        self.started = self.work();
        (self.estimated, self.estimated_done) = (0.0, 0.0);
    }

    /// Share of all work that is done; never decreases.
    fn done(&self) -> f64 {
        let now = self.work() - self.started;
        // What the roots done so far took per estimated unit; before the first one, the estimate itself.
        let rate =
            if self.estimated_done > 0.0 { (self.at_last_root - self.started) / self.estimated_done } else { 1.0 };
        let this = (self.estimated * rate).max(now);
        let past: f64 = self.finished.iter().sum();
        let later = match self.finished[..] {
            [] => this * (1.0 / FIRST_ITERATION_SHARE - 1.0),
            [.., last] => {
                let first = self.finished[0];
                // Later iterations shrink geometrically; half where nothing is known better.
                let ratio = if self.finished.len() > 1 {
                    (last / first).powf(1.0 / (self.finished.len() - 1) as f64)
                } else {
                    0.5
                };
                let ratio = ratio.clamp(0.05, 0.8);
                (if self.estimated > 0.0 { this } else { last }) * ratio / (1.0 - ratio)
            }
        };
        let total = past + this + later;
        let share = if total > 0.0 { (past + now) / total } else { 0.0 };
        let done = (Forecast::ROOT_LINKS + (1.0 - Forecast::ROOT_LINKS) * share).clamp(self.shown.get(), 1.0);
        self.shown.set(done);
        done
    }
}
