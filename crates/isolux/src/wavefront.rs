//! The schedule `wavefront`: a scene and settings go to the fast engine, whose outcome becomes a solution; what that holds
//! beyond elements and light, and the invariants of it.

use crate::groups::{LightGroups, light_groups};
use crate::pictures::Packer;
use crate::report::{ErrorEstimate, GroupsReport, LinkReport, PhaseReport, RowSum, StageReport};
use crate::solve::report;
use crate::{Energy, Onlooker, Report, Settings, SettingsError, Solution, SolveError, Status};
use isolux_core::links::{Hierarchy, Links};
use isolux_core::scene::Scene;
use isolux_core::solution::{Flow, Light, Observer, Phase, Progress, Update};
use isolux_core::tree::{ElementId, Elements};
use isolux_core::units::Rgb;
use isolux_wavefront::{
    Bound, ClusterColumns, Control, Estimate, Ideas, LinkColumns, NO_GROUP, Outcome, PointErrors, Prepared, Request,
    Stage,
};
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Between two looks at the observer while the engine works: Ctrl-C feels immediate.
const INTERVAL: Duration = Duration::from_millis(20);

/// Marks a cluster without parent.
const NONE: u32 = u32::MAX;

/// What the engine leaves behind beyond elements and their mean light.
///
/// Nodes are numbered elements first, then clusters: node `elements + c` is cluster `c`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transported {
    /// Irradiance by element at its corners (the last of a triangle counts for nothing) and its middle, W/m² or lm/m²; of
    /// inner elements it means nothing.
    pub fields: Vec<[[f32; 3]; 5]>,
    /// What sky and ground throw on it, part of that: by the sky's pattern and by the ground's radiance, sr. Empty without a sky.
    pub sky: Arc<Vec<[[f32; 2]; 5]>>,
    /// Links, in ascending order of their receivers.
    pub links: Arc<LinkColumns>,
    /// The hierarchy above the polygons.
    pub clusters: Arc<ClusterColumns>,
    /// Area times squared error that one source may leave on a leaf, m² (W/m²)² or m² (lm/m²)²; 0 in older files.
    pub limit: f32,
    /// The light by groups: made when it is first asked for, see [`Solution::columns`].
    pub columns: OnceLock<Arc<Columns>>,
}

/// Irradiance by light group, as it was solved: with all weights 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Names of the groups.
    pub names: Vec<String>,
    /// By polygon, then by lamp, then the sky's if there is one: its group, or [`NO_GROUP`].
    pub of: Vec<u32>,
    /// Emission by polygon, as it was solved, W/m² or lm/m²; then the intensity of each lamp, see
    /// [`Lamp::intensity`](isolux_core::scene::Lamp::intensity); then the sky's radiance, see
    /// [`Sky::radiance`](isolux_core::scene::Sky::radiance).
    pub emission: Vec<Rgb>,
    /// By group and leaf, leaves in ascending order: irradiance at corners and middle, W/m² or lm/m².
    pub fields: Vec<Vec<[[f32; 3]; 5]>>,
    /// How wrong each group is at points, by rays: what tells the error of a mix. Empty where there is one group, as it was
    /// solved, and where an older version made the columns.
    pub points: Arc<PointErrors>,
}

/// What comes back from the engine's threads.
struct Finished {
    outcome: Outcome,
    /// Polygons that take part.
    active: Vec<bool>,
    stages: Vec<Stage>,
    estimate: Option<Estimate>,
    energy: Option<Energy>,
    row_sum: Option<RowSum>,
    status: Status,
    /// The bound that stopped it, by the name of its setting.
    bound: Option<&'static str>,
    phases: Vec<PhaseReport>,
}

/// Solves a scene that has light, by settings that are valid. Of a cancelled solve there are only its polygons, with no
/// light but their own.
pub(crate) fn solve(
    scene: Arc<Scene>,
    settings: &Settings,
    observer: &mut dyn Observer,
    onlooker: Option<Onlooker>,
) -> Result<Solution, SolveError> {
    let request = Request {
        error: settings.error,
        dark: settings.dark,
        least_area: settings.least_area(&scene),
        seed: settings.seed,
        max_elements: settings.max_elements,
        memory: settings.memory,
        time: settings.time,
        ideas: Ideas::default(),
    };
    let packer = Packer::start(onlooker)?;
    let mut finished = run(&scene, settings, request, observer, packer)?.unwrap_or_else(|| bare(&scene));
    let done = Progress { done: 1.0, links: finished.outcome.links.receiver.len(), ..Progress::of(Phase::Iteration) };
    if finished.status != Status::Cancelled && observer.observe(&done) == Flow::Stop {
        finished.status = Status::Cancelled;
    }
    Ok(put_together(scene, settings, finished))
}

/// A solution of what came back from the engine.
fn put_together(scene: Arc<Scene>, settings: &Settings, finished: Finished) -> Solution {
    let start = Instant::now();
    let Finished { outcome, active, stages, estimate, energy, row_sum, status, bound, mut phases } = finished;
    let is_whole = status != Status::Cancelled;
    let Outcome { elements, light, fields, sky, links, clusters, limit } = outcome;
    let (links, clusters) = (Arc::new(in_order(links)), Arc::new(clusters));
    let sky = Arc::new(sky);
    let transport = Transported { fields, sky, links, clusters, limit, columns: OnceLock::new() };
    let LightGroups { by, groups, .. } = light_groups(&scene);
    let mut report = Report {
        area_epsilon: settings.least_area(&scene) * scene.area(),
        error_estimate: estimate.map(|estimate| ErrorEstimate { total: estimate.total, dark: Some(estimate.dark) }),
        bound: bound.map(str::to_owned),
        clusters: transport.clusters.parent.len() as u64,
        links: by_visibility(&transport.links),
        groups: Some(GroupsReport { by, groups }),
        energy: energy.filter(|_| is_whole),
        row_sum: row_sum.filter(|_| is_whole),
        stages: stages
            .iter()
            .map(|stage| StageReport {
                elements: stage.elements as u64,
                links: stage.links as u64,
                passes: stage.passes.iter().sum(),
                estimate: stage.by_links,
                seconds: stage.seconds.iter().sum(),
            })
            .collect(),
        ..report(&scene, settings, status, &elements, &light, &active)
    };
    phases.push(PhaseReport { name: "report".into(), seconds: start.elapsed().as_secs_f64() });
    report.phases = phases;
    solution(scene, elements, light, active, transport, report)
}

/// A solution of the engine from its parts: tree and mesh are made when they are asked for.
pub(crate) fn solution(
    scene: Arc<Scene>,
    elements: Elements,
    light: Light,
    active: Vec<bool>,
    transport: Transported,
    report: Report,
) -> Solution {
    Solution {
        scene,
        bsp: OnceLock::new(),
        tracer: OnceLock::new(),
        hierarchy: Hierarchy { links: Links::new(elements.len()), elements, light },
        active,
        surfaces: OnceLock::new(),
        vertex_irradiance: Vec::new(),
        transport: Some(transport),
        report,
    }
}

/// Runs the engine on so many threads, while the caller's thread asks the observer; when that says stop, the engine ends with
/// what its last whole stage had. `None` where it was never begun.
fn run(
    scene: &Arc<Scene>,
    settings: &Settings,
    request: Request,
    observer: &mut dyn Observer,
    packer: Packer,
) -> Result<Option<Finished>, SolveError> {
    let state = Progress { elements: scene.polygons.len(), ..Progress::of(Phase::Tree) };
    if observer.observe(&state) == Flow::Stop {
        return Ok(None);
    }
    let refused = |_| SettingsError::Value {
        name: "threads",
        value: settings.threads.to_string(),
        expected: "as many threads as the system grants",
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(settings.threads).build().map_err(refused)?;
    let (sender, receiver) = channel();
    let scene = scene.clone();
    let control = Arc::new(Control::default());
    let shared = control.clone();
    let settings = settings.clone();
    pool.spawn(move || {
        let finished = catch_unwind(AssertUnwindSafe(|| work(&scene, &settings, &request, &shared, packer)));
        // Nobody may be there any more to take it.
        let _ = sender.send(finished);
    });
    loop {
        match receiver.recv_timeout(INTERVAL) {
            Ok(Ok(finished)) => return Ok(Some(finished)),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Disconnected) => return Err(SolveError::Internal("a thread was lost".into())),
            Err(RecvTimeoutError::Timeout) => {
                let (stage, elements, links) = control.state();
                let done = 1.0 - 0.6_f64.powi(stage as i32);
                let now = Progress { phase: Phase::Iteration, done, elements, links, ..state };
                if observer.observe(&now) == Flow::Stop {
                    control.stop();
                }
            }
        }
    }
}

fn work(scene: &Arc<Scene>, settings: &Settings, request: &Request, control: &Control, mut packer: Packer) -> Finished {
    let begun = Instant::now();
    let prepared = Prepared::new(scene.clone());
    let tree = begun.elapsed().as_secs_f64();
    let solved = prepared.solve_seen(request, control, &mut |standing| {
        packer.offer(|| {
            let seconds = begun.elapsed().as_secs_f64();
            let (outcome, stages, estimate) = (standing.outcome(scene), standing.stages.to_vec(), standing.estimate);
            let (scene, settings) = (scene.clone(), settings.clone());
            Box::new(move || {
                let finished = Finished {
                    active: active(&scene, &outcome),
                    outcome,
                    stages,
                    estimate,
                    energy: None,
                    row_sum: None,
                    status: Status::Cancelled,
                    bound: None,
                    phases: vec![PhaseReport { name: "so far".into(), seconds }],
                };
                put_together(scene, &settings, finished)
            })
        });
    });
    let start = Instant::now();
    let outcome = solved.outcome(scene);
    let numbered = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let active = active(scene, &outcome);
    let status = status_of(solved.bound);
    let (mut energy, mut row_sum) = (None, None);
    if status != Status::Cancelled {
        energy = Some(Energy::of(&solved.balance(&outcome, &active)));
        row_sum = solved.row_sums(&active).map(|sums| RowSum::of(&sums, scene, &outcome.elements));
    }
    let balanced = start.elapsed().as_secs_f64();
    let stages = solved.stages;
    let sum = |part: usize| stages.iter().map(|stage| stage.seconds[part]).sum::<f64>();
    let phases = [
        ("tree", tree),
        ("links", sum(0)),
        ("light", sum(1)),
        ("check", sum(2)),
        ("columns", numbered),
        ("balance", balanced),
    ];
    let phases = phases.map(|(name, seconds)| PhaseReport { name: name.to_owned(), seconds }).to_vec();
    let bound = solved.bound.and_then(setting_of);
    let estimate = solved.estimate;
    packer.finish();
    Finished { outcome, active, stages, estimate, energy, row_sum, status, bound, phases }
}

/// Which polygons take part: fronts, and backs that light comes to.
fn active(scene: &Scene, outcome: &Outcome) -> Vec<bool> {
    let takes_part =
        |polygon: usize| polygon < scene.fronts || outcome.light.irradiance(ElementId(polygon as u32)) != Rgb::ZERO;
    (0..scene.polygons.len()).map(takes_part).collect()
}

/// What a bound that ended the engine means to a user.
fn status_of(bound: Option<Bound>) -> Status {
    match bound {
        None => Status::Converged,
        Some(Bound::Stop) => Status::Cancelled,
        Some(Bound::Resolution) => Status::IterationLimit,
        Some(Bound::Elements | Bound::Memory | Bound::Time) => Status::Bounded,
    }
}

/// The setting that a bound was asked for by.
fn setting_of(bound: Bound) -> Option<&'static str> {
    match bound {
        Bound::Elements => Some("max_elements"),
        Bound::Memory => Some("memory"),
        Bound::Time => Some("time"),
        Bound::Stop | Bound::Resolution => None,
    }
}

/// What there is of a solve that was cancelled before it began: the scene's polygons with no light but their own.
fn bare(scene: &Scene) -> Finished {
    let planes = scene.polygons.iter().map(|polygon| polygon.plane).collect();
    let roots = scene.polygons.iter().enumerate().map(|(index, polygon)| (polygon.corners, index as u32));
    let count = scene.polygons.len();
    let elements = Elements::new(roots, planes);
    let outcome = Outcome {
        light: Light::emitted(scene, &elements, vec![1.0; count], Update::InPlace),
        elements,
        fields: vec![[[0.0; 3]; 5]; count],
        sky: if scene.sky.is_some() { vec![[[0.0; 2]; 5]; count] } else { Vec::new() },
        links: LinkColumns::default(),
        clusters: ClusterColumns::default(),
        limit: 0.0,
    };
    Finished {
        outcome,
        active: (0..count).map(|polygon| polygon < scene.fronts).collect(),
        stages: Vec::new(),
        estimate: None,
        energy: None,
        row_sum: None,
        status: Status::Cancelled,
        bound: None,
        phases: Vec::new(),
    }
}

/// Links in ascending order of their receivers, those of one receiver as they come.
fn in_order(links: LinkColumns) -> LinkColumns {
    if links.receiver.is_sorted() {
        return links;
    }
    let mut order: Vec<u32> = (0..links.receiver.len() as u32).collect();
    order.sort_by_key(|&index| links.receiver[index as usize]);
    fn taken<T: Copy>(values: &[T], order: &[u32]) -> Vec<T> {
        order.iter().map(|&index| values[index as usize]).collect()
    }
    LinkColumns {
        receiver: taken(&links.receiver, &order),
        source: taken(&links.source, &order),
        factors: taken(&links.factors, &order),
        visibility: taken(&links.visibility, &order),
        proven: taken(&links.proven, &order),
        centre: taken(&links.centre, &order),
        whole: taken(&links.whole, &order),
    }
}

fn by_visibility(links: &LinkColumns) -> LinkReport {
    let count = |is: fn(f32) -> bool| links.visibility.iter().filter(|&&visibility| is(visibility)).count() as u64;
    LinkReport {
        total: links.visibility.len() as u64,
        full: count(|visibility| visibility >= 1.0),
        partial: count(|visibility| visibility > 0.0 && visibility < 1.0),
        none: count(|visibility| visibility <= 0.0),
    }
}

/// A broken invariant of what the engine leaves behind.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{name}: {what}")]
pub(crate) struct TransportViolation {
    /// The array, as in a record.
    pub(crate) name: &'static str,
    /// What is wrong.
    pub(crate) what: String,
}

fn wrong(name: &'static str, what: impl Into<String>) -> TransportViolation {
    TransportViolation { name, what: what.into() }
}

/// Every column of a table has one entry per row.
fn same_lengths(rows: usize, columns: &[(&'static str, usize)]) -> Result<(), TransportViolation> {
    columns.iter().try_for_each(|&(name, length)| {
        if length == rows { Ok(()) } else { Err(wrong(name, format!("{length} rows, expected {rows}"))) }
    })
}

impl Transported {
    /// Checks the invariants; elements must be sound, see [`Elements::check`]:
    ///
    /// - the roots are the scene's polygons, in order;
    /// - one finite field, mean radiosity and mean irradiance per element, means not negative; under a sky one finite field of
    ///   its light, too;
    /// - leaves fulfil `B = E + rho H`, parents have the means of their children, weighted by area, both to the engine's
    ///   single precision;
    /// - both ends of a link exist and differ; factors are finite and not negative; visibilities lie in `[0, 1]` and are 1
    ///   where that is proven; centres lie in `[0, 1]²`; receivers ascend;
    /// - of clusters, only the first has no parent, the others come after theirs; members are polygons, each once; those of
    ///   a cluster lie among those of its parent; places, radii and areas are finite, areas above 0;
    /// - of light groups, each polygon, lamp or sky that emitted has one; there is one finite field per group and leaf; where they were
    ///   checked at points, one finite irradiance and two finite errors per group and point.
    ///
    /// # Errors
    /// The first violation.
    pub(crate) fn check(&self, scene: &Scene, elements: &Elements, light: &Light) -> Result<(), TransportViolation> {
        let polygons = scene.polygons.len();
        let is_own = |root: usize| elements.as_slice()[root].polygon as usize == root;
        if elements.roots() != polygons || !(0..polygons).all(is_own) {
            return Err(wrong("elements/polygon", "the roots are not the scene's polygons in their order"));
        }
        self.check_light(scene, elements, light)?;
        self.check_clusters(polygons)?;
        self.check_links(elements.len())?;
        self.columns.get().map_or(Ok(()), |columns| self.check_columns(columns, scene, elements))
    }

    fn check_columns(&self, columns: &Columns, scene: &Scene, elements: &Elements) -> Result<(), TransportViolation> {
        let Columns { names, of, emission, fields, points } = columns;
        let emitters = scene.emitters();
        same_lengths(emitters, &[("groups/of", of.len()), ("groups/emission", emission.len())])?;
        if names.is_empty() || fields.len() != names.len() {
            return Err(wrong("groups/field", format!("{} columns of {} groups", fields.len(), names.len())));
        }
        for (index, &group) in of.iter().enumerate() {
            if group != NO_GROUP && group as usize >= names.len() {
                return Err(wrong("groups/of", format!("emitter {index} is of no group that exists")));
            }
            let own = emission[index];
            if !own.is_finite() || own.min_component() < 0.0 || group == NO_GROUP && own != Rgb::ZERO {
                return Err(wrong("groups/emission", format!("that of emitter {index} cannot be")));
            }
        }
        let leaves = elements.leaves().count();
        for column in fields {
            same_lengths(leaves, &[("groups/field", column.len())])?;
            if !column.par_iter().all(|field| field.as_flattened().iter().all(|value| value.is_finite())) {
                return Err(wrong("groups/field", "not all values are finite"));
            }
        }
        let PointErrors { irradiance, errors } = &**points;
        if irradiance.is_empty() && errors.is_empty() {
            return Ok(());
        }
        same_lengths(
            names.len(),
            &[("groups/point_irradiance", irradiance.len()), ("groups/point_error", errors.len())],
        )?;
        for (irradiance, errors) in irradiance.iter().zip(errors) {
            let rows = [("groups/point_irradiance", irradiance.len()), ("groups/point_error", errors.len())];
            same_lengths(points.len(), &rows)?;
            if !irradiance.as_flattened().iter().all(|value| value.is_finite()) {
                return Err(wrong("groups/point_irradiance", "not all values are finite"));
            }
            if !errors.as_flattened().as_flattened().iter().all(|value| value.is_finite()) {
                return Err(wrong("groups/point_error", "not all values are finite"));
            }
        }
        Ok(())
    }

    fn check_light(&self, scene: &Scene, elements: &Elements, light: &Light) -> Result<(), TransportViolation> {
        let (radiosities, irradiances) = (light.radiosities(), light.irradiances());
        let columns = [
            ("elements/field", self.fields.len()),
            ("elements/radiosity", radiosities.len()),
            ("elements/irradiance", irradiances.len()),
        ];
        same_lengths(elements.len(), &columns)?;
        if let Some(index) = self.fields.iter().position(|field| !field.iter().flatten().all(|value| value.is_finite()))
        {
            return Err(wrong("elements/field", format!("of element {index}, not all values are finite")));
        }
        if scene.sky.is_some() {
            same_lengths(elements.len(), &[("elements/sky", self.sky.len())])?;
            let is_sound = |field: &[[f32; 2]; 5]| field.as_flattened().iter().all(|value| value.is_finite());
            if let Some(index) = self.sky.iter().position(|field| !is_sound(field)) {
                return Err(wrong("elements/sky", format!("of element {index}, not all values are finite")));
            }
        }
        light.check(scene, elements).map_err(|violation| wrong("elements/radiosity", violation.to_string()))
    }

    fn check_links(&self, elements: usize) -> Result<(), TransportViolation> {
        let LinkColumns { receiver, source, factors, visibility, proven, centre, whole } = &*self.links;
        let columns = [
            ("links/source", source.len()),
            ("links/factors", factors.len()),
            ("links/visibility", visibility.len()),
            ("links/proven", proven.len()),
            ("links/centre", centre.len()),
            ("links/whole", whole.len()),
        ];
        same_lengths(receiver.len(), &columns)?;
        let nodes = elements + self.clusters.parent.len();
        for (name, ends) in [("links/receiver", receiver), ("links/source", source)] {
            if let Some(index) = ends.iter().position(|&end| end as usize >= nodes) {
                return Err(wrong(name, format!("link {index} has no such end: there are {nodes} nodes")));
            }
        }
        if let Some(index) = receiver.windows(2).position(|pair| pair[0] > pair[1]) {
            return Err(wrong("links/receiver", format!("link {} is not in ascending order", index + 1)));
        }
        if let Some(index) = (0..receiver.len()).find(|&index| receiver[index] == source[index]) {
            return Err(wrong("links/source", format!("link {index} leads from a node to itself")));
        }
        let is_factor = |factor: &f32| factor.is_finite() && *factor >= 0.0;
        if let Some(index) = factors.iter().position(|factors| !factors.iter().all(is_factor)) {
            return Err(wrong("links/factors", format!("of link {index}, not all are finite and not negative")));
        }
        if let Some(index) = visibility.iter().position(|visibility| !(0.0..=1.0).contains(visibility)) {
            let found = visibility[index];
            return Err(wrong("links/visibility", format!("{found} of link {index} is not within 0 and 1")));
        }
        for (index, &proven) in proven.iter().enumerate() {
            if proven > 1 {
                return Err(wrong("links/proven", format!("{proven} is neither 0 nor 1")));
            }
            if proven == 1 && visibility[index] < 1.0 {
                return Err(wrong("links/proven", format!("link {index} is proven, but its visibility is not 1")));
            }
        }
        if let Some(index) = (0..whole.len()).find(|&index| whole[index] > 1 || whole[index] < proven[index]) {
            return Err(wrong(
                "links/whole",
                format!("{} of link {index} is not 1 or 0, or it is proven", whole[index]),
            ));
        }
        let is_inside = |centre: &[f32; 2]| centre.iter().all(|along| (0.0..=1.0).contains(along));
        match centre.iter().position(|centre| !is_inside(centre)) {
            Some(index) => Err(wrong("links/centre", format!("of link {index} it is not within 0 and 1"))),
            None => Ok(()),
        }
    }

    fn check_clusters(&self, polygons: usize) -> Result<(), TransportViolation> {
        let ClusterColumns { centre, radius, area, first, count, parent, members } = &*self.clusters;
        let columns = [
            ("clusters/centre", centre.len()),
            ("clusters/radius", radius.len()),
            ("clusters/area", area.len()),
            ("clusters/first", first.len()),
            ("clusters/count", count.len()),
        ];
        same_lengths(parent.len(), &columns)?;
        let mut is_member = vec![false; polygons];
        for &member in members {
            match is_member.get_mut(member as usize) {
                Some(seen) if !*seen => *seen = true,
                Some(_) => return Err(wrong("clusters/members", format!("polygon {member} occurs twice"))),
                None => return Err(wrong("clusters/members", format!("there is no polygon {member}"))),
            }
        }
        let range = |index: usize| u64::from(first[index])..u64::from(first[index]) + u64::from(count[index]);
        for index in 0..parent.len() {
            let above = parent[index];
            if (above == NONE) != (index == 0) || above != NONE && above as usize >= index {
                return Err(wrong("clusters/parent", format!("cluster {index} does not come after its parent")));
            }
            let outer = if above == NONE { 0..members.len() as u64 } else { range(above as usize) };
            let own = range(index);
            if own.is_empty() || own.start < outer.start || own.end > outer.end {
                return Err(wrong("clusters/count", format!("members of cluster {index} are not its parent's")));
            }
            if !centre[index].iter().all(|along| along.is_finite()) {
                return Err(wrong("clusters/centre", format!("that of cluster {index} is not finite")));
            }
            if !(radius[index].is_finite() && radius[index] >= 0.0) {
                return Err(wrong("clusters/radius", format!("{} of cluster {index} is no radius", radius[index])));
            }
            if !(area[index].is_finite() && area[index] > 0.0) {
                return Err(wrong("clusters/area", format!("{} of cluster {index} is no area", area[index])));
            }
        }
        Ok(())
    }
}
