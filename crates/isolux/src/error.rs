//! What can fail, by operation; every variant carries the offending name and value.

use isolux_core::scene::SceneError;
use thiserror::Error;

/// A setting that makes no sense.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SettingsError {
    /// No schedule takes such a value.
    #[error("setting '{name}' is {value}: expected {expected}")]
    Value {
        /// Name of the setting.
        name: &'static str,
        /// What was given.
        value: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The schedule that was asked for does not know it.
    #[error("setting '{name}' is {value}: belongs to schedule '{schedule}'")]
    Schedule {
        /// Name of the setting.
        name: &'static str,
        /// What was given.
        value: String,
        /// The schedule that has it.
        schedule: &'static str,
    },
    /// The scene has lamps without a surface, which this schedule does not know.
    #[error(
        "setting 'schedule' is {schedule}: lamp '{lamp}' has no surface, which only schedule 'wavefront' can solve"
    )]
    Lamps {
        /// Name of the first such lamp.
        lamp: String,
        /// The schedule.
        schedule: &'static str,
    },
    /// The scene has a sky, which this schedule does not know.
    #[error("setting 'schedule' is {schedule}: the scene has a sky, which only schedule 'wavefront' can solve")]
    Sky {
        /// The schedule.
        schedule: &'static str,
    },
}

impl SettingsError {
    /// Name of the setting.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            SettingsError::Value { name, .. } | SettingsError::Schedule { name, .. } => name,
            SettingsError::Lamps { .. } | SettingsError::Sky { .. } => "schedule",
        }
    }
}

/// Why no solution came out.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SolveError {
    /// A setting makes no sense.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The scene cannot be solved.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Nothing emits: the answer would be black everywhere.
    #[error("scene '{scene}' has no light: no surface emits, and there is no lamp and no sky")]
    NoLight {
        /// Name of the scene.
        scene: String,
    },
    /// An invariant is broken: a defect of the program.
    #[error("internal: {0}")]
    Internal(String),
}

/// Why a solution could not be read back.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RecordError {
    /// An array or attribute is missing.
    #[error("'{name}' is missing")]
    Missing {
        /// Its name.
        name: String,
    },
    /// An array has the wrong type or shape.
    #[error("'{name}' has {found}, expected {expected}")]
    Shape {
        /// Its name.
        name: String,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// The contents contradict each other.
    #[error("'{name}': {what}")]
    Inconsistent {
        /// Name of the part.
        name: String,
        /// What is wrong.
        what: String,
    },
    /// Written by a version that this one cannot read.
    #[error("file format {found} is not supported (this version reads up to {supported})")]
    Format {
        /// Format number in the file.
        found: u64,
        /// The highest format number that this version reads.
        supported: u64,
    },
}

/// Why a solution could not be relit.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RelightError {
    /// Its schedule keeps no light by groups.
    #[error("a solution of schedule '{schedule}' cannot be relit: solve with schedule 'wavefront'")]
    Schedule {
        /// Name of the schedule.
        schedule: &'static str,
    },
    /// It lacks what relighting needs.
    #[error("the solution cannot be relit: {why}; solve the scene again")]
    Unprepared {
        /// What is in the way.
        why: String,
    },
    /// The scene has no light group of that name.
    #[error("there is no light group '{name}'; the solution has: {available}")]
    NoSuchGroup {
        /// The name asked for.
        name: String,
        /// Names that exist.
        available: String,
    },
    /// A weight that no lamp can have.
    #[error("weight of '{name}' is {value}: expected a number of 0 or more")]
    Weight {
        /// The light group.
        name: String,
        /// What was given.
        value: String,
    },
    /// The scene has no material of that name.
    #[error("there is no material '{name}'; the scene has: {available}")]
    NoSuchMaterial {
        /// The name asked for.
        name: String,
        /// Names that exist.
        available: String,
    },
    /// A reflectance that no material can have.
    #[error("reflectance of '{name}' is {value}: expected at least 0, below 1, and at most the opacity, {most}")]
    Reflectance {
        /// The material.
        name: String,
        /// What was given.
        value: String,
        /// The least opacity of its surfaces.
        most: f64,
    },
    /// A setting makes no sense.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// It was asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Why no picture came out.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RenderError {
    /// The scene has no camera of that name.
    #[error("there is no camera '{name}'; the scene has: {available}")]
    NoSuchCamera {
        /// The name asked for.
        name: String,
        /// Names that exist.
        available: String,
    },
    /// The view makes no sense (eye and target coincide, size of zero).
    #[error("view: {what}")]
    View {
        /// What is wrong.
        what: String,
    },
    /// A final gather by no rays, or by more than make sense.
    #[error("gather: {rays} rays (1 to {most})")]
    Gather {
        /// Rays asked for.
        rays: u32,
        /// Most that there may be.
        most: u32,
    },
    /// So many threads could not be had.
    #[error("threads: {threads}, but the system grants fewer")]
    Threads {
        /// Threads asked for.
        threads: usize,
    },
    /// The scene has no such side of a polygon.
    #[error("side {side} is out of range: the scene has {sides}")]
    NoSuchSide {
        /// The side asked for.
        side: u32,
        /// How many there are.
        sides: usize,
    },
    /// The observer stopped it.
    #[error("cancelled")]
    Cancelled,
}

/// Why nothing was measured.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MeasureError {
    /// A point that is nowhere.
    #[error("points[{index}] is {point}: expected finite coordinates")]
    Point {
        /// Which one.
        index: usize,
        /// What it is.
        point: isolux_core::DVec3,
    },
    /// A direction that a receiver cannot have.
    #[error("{what}[{index}] is {direction}: expected {expected}")]
    Direction {
        /// Which direction of the receiver.
        what: &'static str,
        /// Which receiver.
        index: usize,
        /// What it is.
        direction: isolux_core::DVec3,
        /// What it should be.
        expected: &'static str,
    },
    /// As many receivers as points belong together.
    #[error("{receivers} receivers for {points} points")]
    Count {
        /// Points given.
        points: usize,
        /// Receivers given.
        receivers: usize,
    },
    /// No rays, or more than make sense.
    #[error("samples: {rays} rays ({least} to {most})")]
    Rays {
        /// Rays asked for.
        rays: u32,
        /// Least that there may be.
        least: u32,
        /// Most that there may be.
        most: u32,
    },
    /// So many threads could not be had.
    #[error("threads: {threads}, but the system grants fewer")]
    Threads {
        /// Threads asked for.
        threads: usize,
    },
    /// The observer stopped it.
    #[error("cancelled")]
    Cancelled,
}
