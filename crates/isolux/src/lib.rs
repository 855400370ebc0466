//! The facade: settings in, a solved, checked, reopenable solution out.

mod error;
pub mod flat;
mod pace;
mod record;
mod render;
mod report;
mod settings;
mod smooth;
mod solution;
pub mod study;

pub use error::{RecordError, RenderError, SettingsError, SolveError};
pub use isolux_core as core;
pub use isolux_formats as formats;
pub use record::{Array, Data, Record};
pub use render::{RenderSettings, View, render};
pub use report::{Energy, IterationReport, LinkReport, PhaseReport, Report, RowSum, Status};
pub use settings::{Quality, Settings};

pub use isolux_core::solution::{Interpolation, Roots, Update};
pub use solution::{Solution, solve};

/// Version of the program, recorded in every result.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
