//! The Python extension module: arrays, paths and settings come in, arrays and exceptions go out; what they mean is
//! the facade's, and how they look to people is `python/isolux`'s.

mod array;
mod error;
mod observer;
mod panics;
mod photometry;
mod scene;
mod settings;
mod sky;
mod solution;
mod study;
mod waiting;

use pyo3::prelude::*;

/// Private to the package `isolux`: its Python modules wrap everything here.
#[pymodule]
mod _isolux {
    #[pymodule_export]
    use crate::error::error_samples;
    #[pymodule_export]
    use crate::observer::{Picture, Progress};
    #[pymodule_export]
    use crate::photometry::Photometry;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::settings::{default_settings, quality_error, validate_settings};
    #[pymodule_export]
    use crate::sky::{cie_sky, sky_horizontal, sky_pattern};
    #[pymodule_export]
    use crate::solution::{Solution, solve, write_aside};
    #[pymodule_export]
    use crate::study::{StudyProblem, check_machine, machine_names, schedule_lines, study_orders};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::panics::remember();
        module.add("__version__", isolux::VERSION)
    }
}
