//! Solving: a scene and settings come in, the schedule that was asked for does the work, and what every report holds is
//! put together here.

use crate::report::{LinkReport, PhaseReport};
use crate::{
    Onlooker, Report, Schedule, Settings, SettingsError, Solution, SolveError, Status, VERSION, sequential, wavefront,
};
use isolux_core::scene::Scene;
use isolux_core::solution::{Light, Observer};
use isolux_core::tree::{ElementId, Elements};
use isolux_core::units::Rgb;
use std::sync::Arc;
use std::time::Instant;

/// Solves `scene`. A solution whose status is `cancelled` is what stood when the observer said stop: consistent, and put
/// together without further work. What it lacks is made when it is asked for.
///
/// # Errors
/// [`SolveError`] for settings out of range, scenes without light, and lamps or a sky that the schedule does not know.
pub fn solve(scene: Arc<Scene>, settings: &Settings, observer: &mut dyn Observer) -> Result<Solution, SolveError> {
    solve_seen(scene, settings, observer, None)
}

/// Solves `scene` as [`solve`] does, to the last bit, and shows `onlooker` what stands at the end of stages and iterations: at
/// most one picture in half a second, none while the one before is still being looked at, and none once this has returned. A
/// solve that is bounded in time has less of it.
///
/// # Errors
/// As [`solve`].
pub fn solve_seen(
    scene: Arc<Scene>,
    settings: &Settings,
    observer: &mut dyn Observer,
    onlooker: Option<Onlooker>,
) -> Result<Solution, SolveError> {
    settings.validate()?;
    if scene.emitted_power() == Rgb::ZERO && !scene.has_remote_light() {
        return Err(SolveError::NoLight { scene: scene.name.clone() });
    }
    match settings.schedule {
        Schedule::Wavefront => wavefront::solve(scene, settings, observer, onlooker),
        Schedule::Sequential => {
            check_lamps(&scene, settings.schedule.name())?;
            sequential::solve(scene, settings, observer, onlooker)
        }
    }
}

/// The paper's method knows only surfaces that emit.
pub(crate) fn check_lamps(scene: &Scene, schedule: &'static str) -> Result<(), SettingsError> {
    match (scene.lamps.first(), &scene.sky) {
        (Some(lamp), _) => Err(SettingsError::Lamps { lamp: lamp.name.clone(), schedule }),
        (None, Some(_)) => Err(SettingsError::Sky { schedule }),
        (None, None) => Ok(()),
    }
}

/// Seconds by phase.
pub(crate) struct Stopwatch {
    pub(crate) phases: Vec<PhaseReport>,
    since: Instant,
}

impl Stopwatch {
    pub(crate) fn start() -> Stopwatch {
        Stopwatch { phases: Vec::new(), since: Instant::now() }
    }

    /// Ends a phase and returns its seconds.
    pub(crate) fn lap(&mut self, name: &str) -> f64 {
        let seconds = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
        self.phases.push(PhaseReport { name: name.to_owned(), seconds });
        seconds
    }
}

/// What a report says whatever the schedule: scene, settings, elements and their light. `active`: polygons that took part.
pub(crate) fn report(
    scene: &Scene,
    settings: &Settings,
    status: Status,
    elements: &Elements,
    light: &Light,
    active: &[bool],
) -> Report {
    let mut elements_by_level = Vec::new();
    for element in elements.as_slice() {
        let depth = element.path.depth() as usize;
        if elements_by_level.len() <= depth {
            elements_by_level.resize(depth + 1, 0);
        }
        elements_by_level[depth] += 1;
    }
    let lit_backs = active[scene.fronts..].iter().filter(|&&active| active).count() as u64;
    let fronts = (0..elements.roots() as u32).map(ElementId);
    let fronts = fronts.filter(|&root| (elements.get(root).polygon as usize) < scene.fronts);
    let mean_irradiance =
        fronts.map(|root| light.irradiance(root) * elements.get(root).area).sum::<Rgb>() / scene.area();
    Report {
        version: VERSION.to_owned(),
        scene: scene.name.clone(),
        scene_hash: scene.hash_text(),
        unit: scene.unit,
        settings: settings.clone(),
        schedule: settings.schedule,
        status,
        bound: None,
        error_estimate: None,
        bf_epsilon: None,
        area_epsilon: 0.0,
        energy_epsilon: None,
        mean_irradiance,
        polygons: scene.polygons.len() as u64,
        lit_backs: [lit_backs, (scene.polygons.len() - scene.fronts) as u64],
        fragments: None,
        roots: elements.roots() as u64,
        elements: elements.len() as u64,
        leaves: elements.leaves().count() as u64,
        elements_by_level,
        clusters: 0,
        links: LinkReport::default(),
        counts: None,
        iterations: Vec::new(),
        stages: Vec::new(),
        energy: None,
        row_sum: None,
        phases: Vec::new(),
        peak_memory: peak_memory(),
        issues: scene.issues.clone(),
        groups: None,
        relit: None,
    }
}

/// High-water mark of the process's resident memory, bytes; 0 where the system has no `/proc`.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).map_or(0, |kib| kib * 1024)
}
