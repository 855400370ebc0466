//! The way back to Python while Rust works: twenty times a second, and whenever a phase begins, it hears Ctrl-C and
//! tells the progress.

use isolux::Onlooker;
use isolux::core::solution::{self as core, Flow, Phase};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::{Arc, Mutex, PoisonError};
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

/// What stands at the end of a stage or an iteration of a solve, for `isolux.viewer`.
#[pyclass(frozen, get_all, module = "isolux")]
pub(crate) struct Picture {
    stage: u32,
    elements: u64,
    links: u64,
    error: Option<f64>,
    data: Py<PyBytes>,
}

#[pymethods]
impl Picture {
    fn __repr__(&self) -> String {
        let Picture { stage, elements, links, .. } = self;
        let error = self.error.map_or("None".to_owned(), |error| format!("{error:.4}"));
        format!("Picture(stage={stage}, elements={elements}, links={links}, error={error})")
    }
}

/// What a callback raised on another thread than the one that watches the computation.
pub(crate) type Raised = Arc<Mutex<Option<PyErr>>>;

/// Calls Python with each picture until it raises; what it raised is then in `raised`, where a [`PythonObserver`] finds it.
pub(crate) fn onlooker(callback: Py<PyAny>, raised: Raised) -> Onlooker {
    Box::new(move |picture| {
        let mut raised = raised.lock().unwrap_or_else(PoisonError::into_inner);
        if raised.is_some() {
            return;
        }
        let isolux::Picture { stage, elements, links, error, data } = picture;
        let called = Python::attach(|py| {
            let data = PyBytes::new(py, &data).unbind();
            callback.call1(py, (Picture { stage, elements, links, error, data },)).map(|_| ())
        });
        *raised = called.err();
    })
}

/// Asks Python whether to go on.
pub(crate) struct PythonObserver {
    callback: Option<Py<PyAny>>,
    last: Option<(Instant, Phase)>,
    /// What was raised elsewhere.
    elsewhere: Raised,
    /// What the signal handler or the callback raised; the computation was told to stop then.
    pub(crate) raised: Option<PyErr>,
}

impl PythonObserver {
    pub(crate) fn new(callback: Option<Py<PyAny>>) -> PythonObserver {
        PythonObserver { callback, last: None, elsewhere: Raised::default(), raised: None }
    }

    /// Where another thread may leave what it raised: the computation is told to stop then, too.
    pub(crate) fn elsewhere(&self) -> Raised {
        self.elsewhere.clone()
    }

    /// What stopped the computation, or was raised elsewhere when it had ended already.
    pub(crate) fn into_raised(self) -> Option<PyErr> {
        self.raised.or_else(|| self.elsewhere.lock().unwrap_or_else(PoisonError::into_inner).take())
    }
}

impl core::Observer for PythonObserver {
    fn observe(&mut self, progress: &core::Progress) -> Flow {
        if self.raised.is_some() {
            return Flow::Stop;
        }
        // Who holds it calls Python just now, and may wait for this thread: that is asked again soon.
        if let Some(raised) = self.elsewhere.try_lock().ok().and_then(|mut raised| raised.take()) {
            self.raised = Some(raised);
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
