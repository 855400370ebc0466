//! The schedule `sequential`: the paper's method on a scene, one pair of elements after the other, in iterations; a
//! solution with BSP tree, links and smooth surfaces goes out.

use crate::pictures::{Job, Packer};
use crate::report::{PhaseReport, RowSum};
use crate::solve::{Stopwatch, report};
use crate::{Energy, IterationReport, Onlooker, Report, Settings, Solution, SolveError, Status, smooth};
use isolux_core::kernels::Counts;
use isolux_core::kernels::oracle::Thresholds;
use isolux_core::kernels::visibility::Sampling;
use isolux_core::links::Hierarchy;
use isolux_core::scene::Scene;
use isolux_core::solution::{
    Flow, Interpolation, Observer, Parameters, Phase, Progress, Roots, Solver, Stop, Watch, balance, pilot_irradiance,
    row_sums,
};
use isolux_core::tree::Bsp;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// D15: `BF_eps` in units of asked error times mean irradiance.
const BF_PER_ERROR: f64 = 0.25;

/// `A_eps` in units of asked error squared times the scene's area.
const AREA_PER_ERROR_SQUARED: f64 = 0.004;

/// Share of the asked error that may come from stopping the iteration early.
const ENERGY_PER_ERROR: f64 = 0.05;

/// Shares of progress after which the tree and the first guess are made.
const TREE_SHARE: f64 = 0.01;
const PILOT_SHARE: f64 = 0.02;

/// Share of progress after which the iteration ends and its evaluation begins.
const SOLVER_SHARE: f64 = 0.75;

/// Share of progress after which values are smooth and only the balance is left.
const SMOOTH_SHARE: f64 = 0.98;

/// Least irradiance for which a vertex sends rays of its own to a source that it may see partly, in `BF_eps`. With 1 in
/// place of 1/4, the Cornell box at an asked error of 0.1 is off by 4.9 in place of 3.9 %.
const SHADOWS_PER_BF: f64 = 0.25;

/// Passes progress on, as a part of a larger whole, and remembers that it was told to stop.
struct Part<'a> {
    observer: &'a mut dyn Observer,
    from: f64,
    to: f64,
    stopped: bool,
}

impl Observer for Part<'_> {
    fn observe(&mut self, progress: &Progress) -> Flow {
        let done = self.from + (self.to - self.from) * progress.done;
        let flow = self.observer.observe(&Progress { done, ..*progress });
        self.stopped |= flow == Flow::Stop;
        flow
    }
}

/// Inserts the scene's polygons, counting in `counts`; `None` when the observer stopped it.
fn build_tree(scene: &Scene, settings: &Settings, counts: &mut Counts, observer: &mut dyn Observer) -> Option<Bsp> {
    let mut watch = Watch::new(observer, Progress::of(Phase::Tree));
    if watch.ask(0.0) == Flow::Stop {
        return None;
    }
    // A piece at a node costs a hundredth of a visibility.
    Bsp::build_while(scene, settings.order, counts, &mut |pieces, done| {
        watch.step(1.0 + 0.01 * pieces as f64, done) == Flow::Continue
    })
}

/// Something made, as a place where it may be made later.
fn made<T>(value: Option<T>) -> OnceLock<T> {
    value.map_or_else(OnceLock::new, OnceLock::from)
}

/// Solves a scene that has light, by settings that are valid. A cancelled solve lacks smooth values and, before anything
/// was linked, the tree.
pub(crate) fn solve(
    scene: Arc<Scene>,
    settings: &Settings,
    observer: &mut dyn Observer,
    onlooker: Option<Onlooker>,
) -> Result<Solution, SolveError> {
    let mut packer = Packer::start(onlooker)?;
    let mut watch = Stopwatch::start();
    let mut part = Part { observer, from: 0.0, to: TREE_SHARE, stopped: false };
    let mut cut = Counts::default();
    let tree = build_tree(&scene, settings, &mut cut, &mut part);
    watch.lap("tree");
    let mut part = Part { observer: part.observer, from: TREE_SHARE, to: PILOT_SHARE, stopped: false };
    let pilot = tree.as_ref().and_then(|bsp| pilot_irradiance(&scene, bsp, settings.seed, &mut part));
    watch.lap("pilot");
    let mut status = if pilot.is_some() { Status::IterationLimit } else { Status::Cancelled };
    let pilot = pilot.unwrap_or(0.0);
    // A solve that was stopped before it had a tree ends with its polygons, unlinked: fragments there are none yet.
    let roots = if tree.is_some() { settings.roots } else { Roots::Polygons };
    let bare = Bsp::new(&scene);
    let bsp = tree.as_ref().unwrap_or(&bare);
    // Where no surface catches any light, any positive scale will do.
    let scale = if pilot > 0.0 { pilot } else { scene.emitted_power().mean() / scene.area() };
    let error = settings.error;
    let parameters = Parameters {
        thresholds: Thresholds {
            bf: settings.bf_epsilon.unwrap_or(BF_PER_ERROR * error) * scale,
            partial: settings.partial_visibility,
            partial_form_factor: settings.partial_form_factor,
            emission: settings.emission_weight,
            area: settings.area_epsilon.unwrap_or(AREA_PER_ERROR_SQUARED * error * error) * scene.area(),
        },
        stop: settings.energy_epsilon.map_or(Stop::Remainder(ENERGY_PER_ERROR * error), Stop::Change),
        update: settings.update,
        roots,
        form_factor: settings.form_factor,
        sampling: Sampling { rays: settings.rays, weighting: settings.weighting },
        covered: settings.covered,
        seed: settings.seed,
    };
    let mut part = Part { observer: part.observer, from: PILOT_SHARE, to: SOLVER_SHARE, stopped: false };
    let mut solver: Solver<'_, Counts> = Solver::new(&scene, bsp, parameters);
    let mut iterations = Vec::new();
    if status != Status::Cancelled && solver.link_roots(&mut part) == Flow::Stop {
        status = Status::Cancelled;
    }
    watch.lap("root links");
    while status != Status::Cancelled && iterations.len() < settings.max_iterations as usize {
        let before = solver.probe.visibilities;
        let since = Instant::now();
        let Some(iteration) = solver.iterate(&mut part) else {
            status = Status::Cancelled;
            break;
        };
        iterations.push(IterationReport {
            total: iteration.total,
            residual: iteration.residual,
            elements: solver.hierarchy().elements.len() as u64,
            links: solver.hierarchy().links.len() as u64,
            visibilities: solver.probe.visibilities - before,
            seconds: since.elapsed().as_secs_f64(),
        });
        packer.offer(|| standing(&scene, settings, bsp, &solver, &iterations));
        if iteration.converged {
            status = Status::Converged;
            break;
        }
    }
    let evaluator = solver.evaluator();
    let (mut hierarchy, active, _, mut counts) = solver.finish();
    counts.add(&cut);
    watch.lap("iteration");
    let mut rest = Part { observer: part.observer, from: SOLVER_SHARE, to: SMOOTH_SHARE, stopped: false };
    let smooth = if status == Status::Cancelled {
        None
    } else if settings.interpolation == Interpolation::Averaged {
        smooth::average(&scene, bsp, &hierarchy, &mut rest)
    } else {
        let above = SHADOWS_PER_BF * parameters.thresholds.bf;
        smooth::gather(&scene, &evaluator, &mut hierarchy, above, error, settings.threads, &mut counts, &mut rest)
    };
    if smooth.is_none() {
        status = Status::Cancelled;
    }
    let (vertex_irradiance, surfaces) = smooth.unzip();
    watch.lap("interpolation");
    let mut rest = Part { observer: rest.observer, from: SMOOTH_SHARE, to: 1.0, stopped: false };
    let measured = if status == Status::Cancelled {
        None
    } else {
        balance(&scene, bsp, &hierarchy, &active, settings.seed, &mut Counts::default(), &mut rest)
    };
    if status != Status::Cancelled && rest.stopped {
        status = Status::Cancelled;
    }
    watch.lap("balance");
    let mut report = Report {
        bf_epsilon: Some(parameters.thresholds.bf),
        area_epsilon: parameters.thresholds.area,
        energy_epsilon: Some(match parameters.stop {
            Stop::Change(epsilon) | Stop::Remainder(epsilon) => epsilon,
        }),
        fragments: Some(bsp.fragments().len() as u64),
        counts: Some(counts),
        iterations,
        energy: measured.as_ref().map(Energy::of),
        ..report(&scene, settings, status, &hierarchy.elements, &hierarchy.light, &active)
    };
    summarise(&scene, &hierarchy, &active, &mut report);
    watch.lap("report");
    report.phases = watch.phases;
    packer.finish();
    Ok(Solution {
        bsp: made(tree),
        tracer: OnceLock::new(),
        scene,
        hierarchy,
        active,
        surfaces: made(surfaces),
        vertex_irradiance: vertex_irradiance.unwrap_or_default(),
        transport: None,
        report,
    })
}

/// Copies what stands at the end of an iteration: vertices get means of the leaves around them.
fn standing(
    scene: &Arc<Scene>,
    settings: &Settings,
    bsp: &Bsp,
    solver: &Solver<'_, Counts>,
    iterations: &[IterationReport],
) -> Job {
    let hierarchy = solver.hierarchy().clone();
    let (scene, settings, bsp, iterations) = (scene.clone(), settings.clone(), bsp.clone(), iterations.to_vec());
    Box::new(move || {
        let active: Vec<bool> = (0..scene.polygons.len()).map(|polygon| polygon < scene.fronts).collect();
        let Hierarchy { elements, light, .. } = &hierarchy;
        let seconds = iterations.iter().map(|iteration| iteration.seconds).sum();
        let phases = vec![PhaseReport { name: "so far".into(), seconds }];
        let mut report =
            Report { iterations, phases, ..report(&scene, &settings, Status::Cancelled, elements, light, &active) };
        summarise(&scene, &hierarchy, &active, &mut report);
        Solution {
            bsp: made(Some(bsp)),
            tracer: OnceLock::new(),
            scene,
            hierarchy,
            active,
            surfaces: OnceLock::new(),
            vertex_irradiance: Vec::new(),
            transport: None,
            report,
        }
    })
}

/// Fills in what follows from the links.
fn summarise(scene: &Scene, hierarchy: &Hierarchy, active: &[bool], report: &mut Report) {
    let Hierarchy { elements, links, .. } = hierarchy;
    for (_, link) in links.iter() {
        report.links.total += 1;
        match link.visibility() {
            Some(visibility) if visibility >= 1.0 => report.links.full += 1,
            Some(visibility) if visibility > 0.0 => report.links.partial += 1,
            _ => report.links.none += 1,
        }
    }
    let sums = if report.status == Status::Cancelled { None } else { row_sums(hierarchy, active) };
    report.row_sum = sums.map(|sums| RowSum::of(&sums, scene, elements));
}
