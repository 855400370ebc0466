//! The scalability study's runs: a scene and a request for a run go in; times, losses, counts and traces by phase come out.
//! Which runs a study makes, and what it shows of them, is Python's.

mod lines;
mod orders;
mod request;
mod simulate;

pub use isolux_machine::ClassError;
pub use lines::schedule_lines;
pub use orders::{OrderCount, OrderRequest, count_orders};
pub use request::{
    IterationResult, Misses, PhaseResult, RunRequest, RunResult, ScheduleName, StealResult, Stretch, StudySettings,
    SwitchesRequest,
};

use crate::{Schedule, Settings};
use isolux_core::kernels::form_factor::FormFactor;
use isolux_core::kernels::oracle::Thresholds;
use isolux_core::kernels::visibility::{Covered, Rays, Sampling};
use isolux_core::scene::Scene;
use isolux_core::solution::{Parameters, Solver, Stop, Unobserved, Update, pilot_irradiance};
use isolux_core::tree::Bsp;
use isolux_core::units::Rgb;
use isolux_machine::RunError;
use isolux_schedules::{Memory, ScheduleError};
use isolux_simulator::{MachineSpec, SpecError};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use thiserror::Error;

/// Why a study's run cannot be.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum StudyError {
    /// An epsilon or seed that makes no sense.
    #[error(transparent)]
    Settings(#[from] crate::SettingsError),
    /// No surface emits light.
    #[error("scene '{scene}' has no light: no surface emits")]
    NoLight {
        /// The scene's name.
        scene: String,
    },
    /// The text of a request is none.
    #[error("request: {reason}")]
    Request {
        /// What the parser says.
        reason: String,
    },
    /// A machine that there is none of, or a figure of it that cannot be.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// A number of processors that a real machine does not have.
    #[error("machine {machine}: {source}")]
    Machine {
        /// Its name.
        machine: String,
        /// What is wrong.
        source: ClassError,
    },
    /// A problem that is larger than what schedules have room for.
    #[error("{what}: {needed} are needed, there is room for {room}; larger epsilons need fewer")]
    TooLarge {
        /// What of.
        what: &'static str,
        /// How many there would have to be, at least.
        needed: u64,
        /// How many there may be.
        room: u64,
    },
    /// The caller stopped the run.
    #[error("stopped")]
    Stopped,
    /// A defect of the program.
    #[error("internal error: {what}")]
    Internal {
        /// What is wrong.
        what: String,
    },
}

impl From<ScheduleError> for StudyError {
    fn from(error: ScheduleError) -> StudyError {
        match error {
            ScheduleError::Full { what, needed, room } => StudyError::TooLarge { what, needed, room },
            ScheduleError::Stopped => StudyError::Stopped,
            ScheduleError::Run(error) => error.into(),
            ScheduleError::Memory(error) => StudyError::Internal { what: error.to_string() },
        }
    }
}

impl From<RunError> for StudyError {
    fn from(error: RunError) -> StudyError {
        match error {
            RunError::Stopped => StudyError::Stopped,
            error => StudyError::Internal { what: error.to_string() },
        }
    }
}

/// Machines that a run can ask for by name: simulated ones, then real ones.
pub const MACHINES: [&str; MachineSpec::NAMES.len() + 2] = {
    let mut all = [""; MachineSpec::NAMES.len() + 2];
    let mut at = 0;
    while at < MachineSpec::NAMES.len() {
        all[at] = MachineSpec::NAMES[at];
        at += 1;
    }
    all[at] = "sequential";
    all[at + 1] = "threads";
    all
};

/// A machine that comes along, or one of a file of figures, by name or path; with what kernels cost.
///
/// # Errors
///
/// Names the machine, or the file and the key.
pub fn machine_spec(name_or_path: &str) -> Result<MachineSpec, StudyError> {
    let mut spec = if MachineSpec::NAMES.contains(&name_or_path) || !name_or_path.ends_with(".toml") {
        MachineSpec::named(name_or_path)?
    } else {
        MachineSpec::open(Path::new(name_or_path))?
    };
    // A file may bring figures of its own; the others are those that come along.
    spec.default_work(isolux_schedules::COST_MODEL, "cost_model.toml")?;
    Ok(spec)
}

/// What a study says of a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MachineReport {
    /// Its name.
    pub name: String,
    /// The most processors that it can have.
    pub processors_max: usize,
    /// Does every access take the same time?
    pub uniform: bool,
    /// All its figures, to tell whether two are the same.
    pub figures: String,
}

impl MachineReport {
    /// Of these figures.
    #[must_use]
    pub fn new(spec: &MachineSpec) -> MachineReport {
        MachineReport {
            name: spec.name().to_owned(),
            processors_max: spec.processors_max(),
            uniform: spec.caches().is_none(),
            figures: format!("{spec:?}"),
        }
    }
}

/// What a study says of its problem before any run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProblemReport {
    /// Polygons, backs included.
    pub polygons: usize,
    /// Roots of quadtrees.
    pub roots: usize,
    /// Roots that exchange light.
    pub active_roots: usize,
    /// Pairs of these.
    pub root_pairs: usize,
    /// Nodes of the BSP tree.
    pub nodes: usize,
    /// Mean irradiance that `BF_eps` refers to, W/m² or lm/m².
    pub irradiance: f64,
}

/// A scene to be solved again and again: what does not depend on schedule and machine is found once and remembered.
#[derive(Debug)]
pub struct StudyProblem {
    scene: Arc<Scene>,
    settings: StudySettings,
    bsp: Bsp,
    irradiance: f64,
    active: Vec<bool>,
    memory: Memory,
}

impl StudyProblem {
    /// Inserts the scene's polygons in the order asked for, and finds the polygons that light can reach.
    ///
    /// # Errors
    ///
    /// Settings out of range, and a scene without light.
    pub fn new(scene: Arc<Scene>, settings: StudySettings) -> Result<StudyProblem, StudyError> {
        let check = Settings {
            schedule: Schedule::Sequential,
            bf_epsilon: Some(settings.bf_epsilon),
            area_epsilon: Some(settings.area_epsilon),
            energy_epsilon: Some(settings.energy_epsilon),
            ..Settings::default()
        };
        check.validate()?;
        crate::solve::check_lamps(&scene, "that of a study")?;
        if scene.emitted_power() == Rgb::ZERO {
            return Err(StudyError::NoLight { scene: scene.name.clone() });
        }
        let bsp = Bsp::build(&scene, settings.order);
        let pilot = pilot_irradiance(&scene, &bsp, settings.seed, &mut Unobserved).unwrap_or(0.0);
        // Where no surface catches any light, any positive scale will do.
        let irradiance = if pilot > 0.0 { pilot } else { scene.emitted_power().mean() / scene.area() };
        let mut problem = StudyProblem { scene, settings, bsp, irradiance, active: vec![], memory: Memory::default() };
        problem.active = problem.find_active();
        Ok(problem)
    }

    /// Polygons that take part: all fronts, and the backs that a sequential solve finds lit.
    fn find_active(&self) -> Vec<bool> {
        if self.scene.fronts == self.scene.polygons.len() {
            return vec![true; self.scene.fronts];
        }
        let parameters = self.parameters(Update::InPlace);
        let mut solver: Solver<'_, isolux_core::kernels::Counts> = Solver::new(&self.scene, &self.bsp, parameters);
        solver.link_roots(&mut Unobserved);
        for _ in 0..self.settings.max_iterations {
            if solver.iterate(&mut Unobserved).is_none_or(|iteration| iteration.converged) {
                break;
            }
        }
        solver.active().to_vec()
    }

    /// The paper's way, with the settings' epsilons.
    fn parameters(&self, update: Update) -> Parameters {
        let StudySettings { bf_epsilon, area_epsilon, energy_epsilon, seed, roots, .. } = self.settings;
        Parameters {
            thresholds: Thresholds {
                bf: bf_epsilon * self.irradiance,
                partial: 0.0,
                partial_form_factor: 1.0,
                emission: 1.0,
                area: area_epsilon * self.scene.area(),
            },
            stop: Stop::Change(energy_epsilon),
            update,
            roots,
            form_factor: FormFactor::Disks,
            sampling: Sampling::from(Rays::Sixteen),
            covered: Covered::Counted,
            seed,
        }
    }

    /// What there is to be solved.
    #[must_use]
    pub fn describe(&self) -> ProblemReport {
        let problem = self.problem(Update::InPlace);
        let active = problem.active_roots.len();
        ProblemReport {
            polygons: self.scene.polygons.len(),
            roots: problem.roots(),
            active_roots: active,
            root_pairs: active * active.saturating_sub(1) / 2,
            nodes: self.bsp.nodes().len(),
            irradiance: self.irradiance,
        }
    }

    fn problem(&self, update: Update) -> isolux_schedules::Problem<'_> {
        let parameters = self.parameters(update);
        isolux_schedules::Problem::new(&self.scene, &self.bsp, self.settings.order, parameters, &self.active)
    }
}
