//! The way back to Python while Rust works: twenty times a second, and whenever a phase begins, it hears Ctrl-C and
//! tells the progress.

use isolux::core::solution::{self as core, Flow, Phase};
use pyo3::prelude::*;
use std::time::{Duration, Instant};

/// Between two calls of Python: Ctrl-C feels immediate, and taking the interpreter's lock costs nothing that counts.
const INTERVAL: Duration = Duration::from_millis(50);

/// State of a computation.
#[pyclass(frozen, get_all, module = "isolux")]
pub(crate) struct Progress {
    phase: &'static str,
    done: f64,
    iteration: u32,
    residual: f64,
    elements: usize,
    links: usize,
}

#[pymethods]
impl Progress {
    fn __repr__(&self) -> String {
        format!("Progress(phase='{}', done={:.3}, links={})", self.phase, self.done, self.links)
    }
}

impl From<&core::Progress> for Progress {
    fn from(progress: &core::Progress) -> Progress {
        let core::Progress { phase, done, iteration, residual, elements, links } = *progress;
        Progress { phase: phase_name(phase), done, iteration, residual, elements, links }
    }
}

fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Tree => "tree",
        Phase::Pilot => "pilot",
        Phase::RootLinks => "root-links",
        Phase::Iteration => "iteration",
        Phase::Interpolation => "interpolation",
        Phase::Balance => "balance",
        Phase::Render => "render",
        Phase::Measure => "measure",
    }
}

/// Asks Python whether to go on.
pub(crate) struct PythonObserver {
    callback: Option<Py<PyAny>>,
    last: Option<(Instant, Phase)>,
    /// What the signal handler or the callback raised; the computation was told to stop then.
    pub(crate) raised: Option<PyErr>,
}

impl PythonObserver {
    pub(crate) fn new(callback: Option<Py<PyAny>>) -> PythonObserver {
        PythonObserver { callback, last: None, raised: None }
    }
}

impl core::Observer for PythonObserver {
    fn observe(&mut self, progress: &core::Progress) -> Flow {
        if self.raised.is_some() {
            return Flow::Stop;
        }
        // A phase is told at once, however short it is.
        let is_told = |(last, phase): (Instant, Phase)| phase == progress.phase && last.elapsed() < INTERVAL;
        if self.last.is_some_and(is_told) && progress.done < 1.0 {
            return Flow::Continue;
        }
        let answer = Python::attach(|py| {
            py.check_signals()?;
            if let Some(callback) = &self.callback {
                callback.call1(py, (Progress::from(progress),))?;
            }
            Ok(())
        });
        // Counted from the end of the call, so that a slow callback cannot starve the work.
        self.last = Some((Instant::now(), progress.phase));
        match answer {
            Ok(()) => Flow::Continue,
            Err(error) => {
                self.raised = Some(error);
                Flow::Stop
            }
        }
    }
}
