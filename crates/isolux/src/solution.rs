//! A solved scene: asks and answers.

use crate::report::{LinkReport, PhaseReport, RowSum};
use crate::{Energy, IterationReport, Record, RecordError, Report, Settings, SolveError, Status, VERSION, smooth};
use isolux_core::kernels::Counts;
use isolux_core::kernels::oracle::Thresholds;
use isolux_core::kernels::visibility::Sampling;
use isolux_core::links::Hierarchy;
use isolux_core::scene::Scene;
use isolux_core::solution::{
    Flow, Interpolation, Observer, Parameters, Phase, Progress, Roots, SmoothPlan, SmoothSurfaces, Solver, Stop,
    SurfaceMesh, Unobserved, Watch, balance, pilot_irradiance, row_sums,
};
use isolux_core::tree::{Bsp, ElementId};
use isolux_core::units::Rgb;
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

/// A solved scene.
#[derive(Debug)]
pub struct Solution {
    pub(crate) scene: Arc<Scene>,
    /// Made when it is first asked for, where a cancelled solve did without.
    pub(crate) bsp: OnceLock<Bsp>,
    pub(crate) hierarchy: Hierarchy,
    pub(crate) active: Vec<bool>,
    /// Made when first asked for, likewise.
    pub(crate) surfaces: OnceLock<SmoothSurfaces>,
    /// Irradiance by vertex of the restricted mesh: what `surfaces` is made from. Empty in a solve that was cancelled
    /// before it had any: means of the leaves around stand in.
    pub(crate) vertex_irradiance: Vec<Rgb>,
    pub(crate) report: Report,
}

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

/// Least irradiance for which a vertex sends rays of its own to a source that it may see partly, in `BF_eps`. With 1 in
/// place of 1/4, the Cornell box at an asked error of 0.1 is off by 4.9 in place of 3.9 %.
const SHADOWS_PER_BF: f64 = 0.25;

/// Seconds by phase.
struct Stopwatch {
    phases: Vec<PhaseReport>,
    since: Instant,
}

impl Stopwatch {
    fn start() -> Stopwatch {
        Stopwatch { phases: Vec::new(), since: Instant::now() }
    }

    /// Ends a phase and returns its seconds.
    fn lap(&mut self, name: &str) -> f64 {
        let seconds = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
        self.phases.push(PhaseReport { name: name.to_owned(), seconds });
        seconds
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

/// Surfaces from the means of leaves; `None` when the observer stopped it.
fn average(
    scene: &Scene,
    bsp: &Bsp,
    hierarchy: &Hierarchy,
    observer: &mut dyn Observer,
) -> Option<(Vec<Rgb>, SmoothSurfaces)> {
    let Hierarchy { elements, light, .. } = hierarchy;
    let mut watch = Watch::new(observer, Progress { elements: elements.len(), ..Progress::of(Phase::Interpolation) });
    let plan = SmoothPlan::new(scene, bsp, elements, &mut watch)?;
    let values = plan.averaged(light, &mut watch)?;
    let surfaces = plan.assemble(&values, &mut watch)?;
    Some((values, surfaces))
}

/// Something made, as a place where it may be made later.
fn made<T>(value: Option<T>) -> OnceLock<T> {
    value.map_or_else(OnceLock::new, OnceLock::from)
}

/// Solves `scene`. A solution whose status is `cancelled` is what stood when the observer said stop: consistent, and put
/// together without further work. What it lacks (smooth values, and before anything was linked the tree) is made when it
/// is asked for.
///
/// # Errors
/// [`SolveError`] for settings out of range and scenes without light.
pub fn solve(scene: Arc<Scene>, settings: &Settings, observer: &mut dyn Observer) -> Result<Solution, SolveError> {
    settings.validate()?;
    if scene.emitted_power() == Rgb::ZERO {
        return Err(SolveError::NoLight { scene: scene.name.clone() });
    }
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
        average(&scene, bsp, &hierarchy, &mut rest)
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
        version: VERSION.to_owned(),
        scene: scene.name.clone(),
        scene_hash: scene.hash_text(),
        unit: scene.unit,
        settings: settings.clone(),
        status,
        bf_epsilon: parameters.thresholds.bf,
        area_epsilon: parameters.thresholds.area,
        energy_epsilon: match parameters.stop {
            Stop::Change(epsilon) | Stop::Remainder(epsilon) => epsilon,
        },
        mean_irradiance: Rgb::ZERO,
        polygons: scene.polygons.len() as u64,
        lit_backs: [0, (scene.polygons.len() - scene.fronts) as u64],
        fragments: bsp.fragments().len() as u64,
        roots: hierarchy.elements.roots() as u64,
        elements: hierarchy.elements.len() as u64,
        leaves: hierarchy.elements.leaves().count() as u64,
        elements_by_level: Vec::new(),
        links: LinkReport::default(),
        counts,
        iterations,
        energy: measured.map(|balance| Energy {
            emitted: balance.emitted,
            absorbed: balance.absorbed,
            escaped: balance.escaped,
            lost_to_backs: balance.lost_to_backs,
            imbalance: balance.imbalance(),
            standard_error: balance.standard_error / balance.emitted.mean(),
            rays: balance.rays,
        }),
        row_sum: None,
        phases: Vec::new(),
        peak_memory: peak_memory(),
        issues: scene.issues.clone(),
    };
    summarise(&scene, &hierarchy, &active, &mut report);
    watch.lap("report");
    report.phases = watch.phases;
    Ok(Solution {
        bsp: made(tree),
        scene,
        hierarchy,
        active,
        surfaces: made(surfaces),
        vertex_irradiance: vertex_irradiance.unwrap_or_default(),
        report,
    })
}

/// Fills in what follows from elements, links and light.
fn summarise(scene: &Scene, hierarchy: &Hierarchy, active: &[bool], report: &mut Report) {
    let Hierarchy { elements, links, light } = hierarchy;
    for element in elements.as_slice() {
        let depth = element.path.depth() as usize;
        if report.elements_by_level.len() <= depth {
            report.elements_by_level.resize(depth + 1, 0);
        }
        report.elements_by_level[depth] += 1;
    }
    for (_, link) in links.iter() {
        report.links.total += 1;
        match link.visibility() {
            Some(visibility) if visibility >= 1.0 => report.links.full += 1,
            Some(visibility) if visibility > 0.0 => report.links.partial += 1,
            _ => report.links.none += 1,
        }
    }
    report.lit_backs[0] = active[scene.fronts..].iter().filter(|&&active| active).count() as u64;
    let fronts = (0..elements.roots() as u32).map(ElementId);
    let fronts = fronts.filter(|&root| (elements.get(root).polygon as usize) < scene.fronts);
    report.mean_irradiance =
        fronts.map(|root| light.irradiance(root) * elements.get(root).area).sum::<Rgb>() / scene.area();
    let name = |leaf: ElementId| scene.object_name(elements.get(leaf).polygon).to_owned();
    let sums = if report.status == Status::Cancelled { None } else { row_sums(hierarchy, active) };
    report.row_sum = sums.map(|sums| RowSum {
        largest: sums.largest.0,
        largest_object: name(sums.largest.1),
        smallest: sums.smallest.0,
        smallest_object: name(sums.smallest.1),
        mean: sums.mean,
    });
}

impl Solution {
    /// The scene that was solved.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// What the solve told of itself.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Elements, links and light.
    #[must_use]
    pub fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// The BSP tree that its rays walked.
    #[must_use]
    pub fn bsp(&self) -> &Bsp {
        self.bsp.get_or_init(|| Bsp::build(&self.scene, self.report.settings.order))
    }

    /// Smooth values at the vertices of a restricted mesh.
    #[must_use]
    pub fn mesh(&self) -> &SurfaceMesh {
        self.surfaces().mesh()
    }

    /// Smooth values at any point.
    pub(crate) fn surfaces(&self) -> &SmoothSurfaces {
        self.surfaces.get_or_init(|| {
            // An observer that never says stop lets everything through.
            average(&self.scene, self.bsp(), &self.hierarchy, &mut Unobserved).map(|(_, made)| made).unwrap_or_default()
        })
    }

    /// Irradiance of the front at a point of an input face, W/m² or lm/m²; `None` where no such face exists or where
    /// it was dropped for want of area.
    #[must_use]
    pub fn irradiance_at(&self, face: u32, barycentric: [f64; 3]) -> Option<Rgb> {
        let &polygon = self.scene.face_polygon.get(face as usize)?;
        let point = self.scene.position(face, barycentric);
        (polygon != Scene::NO_POLYGON).then(|| self.surfaces().irradiance(&self.scene, polygon, point))
    }

    /// Radiosity `E + rho H` of the front at a point of an input face, W/m² or lm/m²; `None` as above.
    #[must_use]
    pub fn radiosity_at(&self, face: u32, barycentric: [f64; 3]) -> Option<Rgb> {
        let irradiance = self.irradiance_at(face, barycentric)?;
        let polygon = &self.scene.polygons[self.scene.face_polygon[face as usize] as usize];
        Some(polygon.emission + polygon.reflectance * irradiance)
    }

    /// Checks every invariant of scene, tree, links and light.
    ///
    /// # Errors
    /// One line that names the first violation.
    pub fn check(&self) -> Result<(), String> {
        self.scene.check().map_err(|violation| violation.to_string())?;
        self.bsp().check(&self.scene).map_err(|violation| violation.to_string())?;
        self.hierarchy.elements.check().map_err(|violation| violation.to_string())?;
        self.hierarchy.links.check(&self.hierarchy.elements, &self.scene).map_err(|violation| violation.to_string())?;
        self.hierarchy.light.check(&self.scene, &self.hierarchy.elements).map_err(|violation| violation.to_string())
    }

    /// Everything as named arrays. `elements/*` (corners, corner_count, area, polygon, parent, first_child, path,
    /// radiosity, irradiance) and `links/*` (receiver, source, form_factor, visibility) are what Python shows as
    /// views; `scene/*` is the scene after validation.
    #[must_use]
    pub fn to_record(&self) -> Record {
        crate::record::write(self)
    }

    /// A solution back from its arrays.
    ///
    /// # Errors
    /// [`RecordError`] naming the array that is missing or wrong.
    pub fn from_record(record: Record) -> Result<Solution, RecordError> {
        crate::record::read(record)
    }
}

/// High-water mark of the process's resident memory, bytes; 0 where the system has no `/proc`.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).map_or(0, |kib| kib * 1024)
}
