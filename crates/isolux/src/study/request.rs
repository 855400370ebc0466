//! Requests for runs, and what comes of them, as they travel between Python and Rust.

use isolux_core::solution::{Roots, Update};
use isolux_core::tree::InsertionOrder;
use isolux_schedules::{Grain, Schedule, Switches};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What makes a problem of a scene. Epsilons are relative, as in [`crate::Settings`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StudySettings {
    /// Links carry at most this share of the scene's mean irradiance (the paper's `BF_eps`).
    pub bf_epsilon: f64,
    /// Elements below this share of the scene's area are not split (the paper's `A_eps`).
    pub area_epsilon: f64,
    /// The iteration ends when the total radiosity changes by at most this share (the paper's `epsilon`).
    pub energy_epsilon: f64,
    /// Order of insertion in the BSP tree.
    pub order: InsertionOrder,
    /// Seed of sample points.
    pub seed: u64,
    /// What the roots of quadtrees are.
    pub roots: Roots,
    /// Iterations after which a run gives up.
    pub max_iterations: u32,
}

impl Default for StudySettings {
    fn default() -> StudySettings {
        StudySettings {
            bf_epsilon: 0.1,
            area_epsilon: 1e-3,
            energy_epsilon: 0.01,
            order: InsertionOrder::FewestCuts,
            seed: 0,
            roots: Roots::Fragments,
            max_iterations: 100,
        }
    }
}

/// The organisation that switches begin with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScheduleName {
    /// SPLASH-2's.
    Splash,
    /// The SB-PRAM's.
    Sbpram,
    /// Flat rounds.
    Wavefront,
}

/// [`Switches`], by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwitchesRequest {
    /// B'.
    pub parallel_bsp: bool,
    /// F'.
    pub pair_loop: bool,
    /// V'.
    pub fine_tasks: bool,
    /// A'.
    pub interpolation_loop: bool,
    /// One queue.
    pub parallel_queue: bool,
}

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRequest {
    /// A machine's name, or the path of a file of figures.
    pub machine: String,
    /// The organisation.
    pub schedule: ScheduleName,
    /// Its switches; those of its name if absent.
    #[serde(default)]
    pub variant: Option<SwitchesRequest>,
    /// Visibilities of a V-task: 4, SPLASH-2's default, or 1, the finest.
    #[serde(default = "default_grain")]
    pub grain: u32,
    /// When a new radiosity is seen by others.
    pub update: Update,
    /// How many processors.
    pub processors: usize,
    /// Is a trace wanted?
    #[serde(default)]
    pub trace: bool,
}

fn default_grain() -> u32 {
    Grain::DEFAULT.visibilities
}

impl RunRequest {
    /// The organisation of tasks that this asks for.
    #[must_use]
    pub fn schedule(&self) -> Schedule {
        let switches = match (self.schedule, self.variant) {
            (ScheduleName::Wavefront, _) => return Schedule::Wavefront,
            (ScheduleName::Splash, None) => Switches::SPLASH,
            (ScheduleName::Sbpram, None) => Switches::SB_PRAM,
            (_, Some(asked)) => Switches {
                parallel_bsp: asked.parallel_bsp,
                pair_loop: asked.pair_loop,
                fine_tasks: asked.fine_tasks,
                interpolation_loop: asked.interpolation_loop,
                parallel_queue: asked.parallel_queue,
            },
        };
        let grain = if switches.fine_tasks || self.grain <= Grain::FINEST.visibilities {
            Grain::FINEST
        } else {
            Grain { visibilities: self.grain, ..Grain::DEFAULT }
        };
        Schedule::Tasks { switches, grain }
    }
}

/// A phase of a run, from barrier to barrier.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhaseResult {
    /// Its number in the paper, or its name where the paper has none.
    pub phase: &'static str,
    /// What it does.
    pub name: &'static str,
    /// Which iteration, from 1.
    pub iteration: Option<u32>,
    /// Time, in the machine's unit.
    pub time: u64,
    /// Longest chain of work.
    pub span: u64,
    /// Processor time by cause; adds up to processors times `time`.
    pub causes: BTreeMap<&'static str, u64>,
    /// Events that were simulated.
    pub events: u64,
}

/// An iteration of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IterationResult {
    /// From 1.
    pub iteration: u32,
    /// Relative change of the total.
    pub residual: f64,
    /// Sum of area times radiosity, W or lm.
    pub total: [f64; 3],
    /// Radiosities read by gathers.
    pub reads: u64,
    /// Of these, such as the same iteration wrote.
    pub updated_reads: u64,
    /// Links made so far.
    pub links: u64,
    /// Elements so far.
    pub elements: u64,
}

/// How the search for others' tasks went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StealResult {
    /// Tasks taken.
    pub successes: u64,
    /// Lists that were found empty after all.
    pub failures: u64,
    /// Looks at lists' lengths and the like while waiting.
    pub probes: u64,
}

/// Misses in one data structure, by cause.
pub type Misses = BTreeMap<&'static str, u64>;

/// A stretch of a processor's time: processor, start, end, cause, label.
pub type Stretch = (usize, u64, u64, &'static str, &'static str);

/// What a run came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunResult {
    /// The machine's name.
    pub machine: String,
    /// The organisation.
    pub schedule: ScheduleName,
    /// When radiosities were seen by others.
    pub update: Update,
    /// How many processors.
    pub processors: usize,
    /// Of all times: instructions, clocks, operations, or nanoseconds.
    pub unit: &'static str,
    /// Its phases, in order.
    pub phases: Vec<PhaseResult>,
    /// Its iterations.
    pub iterations: Vec<IterationResult>,
    /// Did the total settle?
    pub converged: bool,
    /// Stealing.
    pub steals: StealResult,
    /// Misses by data structure, on machines with caches.
    pub misses: BTreeMap<String, Misses>,
    /// Work charged, by class.
    pub counts: BTreeMap<&'static str, u64>,
    /// Links made, counted as in [`isolux_schedules::Outcome`].
    pub links: u64,
    /// Elements.
    pub elements: u64,
    /// Events simulated.
    pub events: u64,
    /// Seconds of the host.
    pub seconds: f64,
    /// Stretches of time, if asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<Vec<Stretch>>,
}
