//! The facade: settings in, a solved, checked, reopenable solution out.

mod error;
pub mod flat;
mod groups;
mod measure;
mod pace;
mod pictures;
mod record;
mod relight;
mod render;
mod report;
mod sequential;
mod settings;
mod smooth;
mod solution;
mod solve;
pub mod study;
mod texels;
mod view;
mod wavefront;

pub use error::{MeasureError, RecordError, RelightError, RenderError, SettingsError, SolveError};
pub use groups::{ALL, GroupedBy, LightGroup, LightGroups, MOST_GROUPS, light_groups};
pub use isolux_core as core;
pub use isolux_formats as formats;
pub use isolux_photometry as photometry;
pub use measure::{MeasureSettings, Received, looks, measure};
pub use pictures::{Onlooker, Picture};
pub use record::{Array, Data, Record};
pub use relight::Changes;
pub use render::{RenderSettings, View, render};
pub use report::{
    Energy, ErrorEstimate, GroupsReport, IterationReport, LinkReport, PhaseReport, ReflectanceReport, RelitReport,
    Report, RowSum, StageReport, Status, WeightReport,
};
pub use settings::{Quality, Schedule, Settings};

pub use isolux_core::solution::{Interpolation, Roots, Update};
pub use isolux_wavefront::{
    ClusterColumns, Control, LinkColumns, Meeting, NO_GROUP, Outlook, PointErrors, Receiver, Tracer,
};
pub use solution::Solution;
pub use solve::{solve, solve_seen};
pub use texels::{Texel, TexelSettings};
pub use view::ViewLimits;
pub use wavefront::{Columns, Transported};

/// Version of the program, recorded in every result.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
