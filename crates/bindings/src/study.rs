//! The scalability study's runs: requests come in as JSON, results go out as JSON; what they hold is the facade's.

use crate::error::{internal, to_python};
use crate::panics::{caught, guarded};
use crate::scene::Scene;
use crate::waiting::{heard, interruptible_or};
use isolux::study::{MachineReport, OrderRequest, RunRequest, StudyError, StudySettings, count_orders, machine_spec};
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Between two questions whether to stop.
const INTERVAL: Duration = Duration::from_millis(100);

fn parse<T: DeserializeOwned>(json: &str) -> PyResult<T> {
    serde_json::from_str(json).map_err(|error| to_python(StudyError::Request { reason: error.to_string() }))
}

fn text(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| internal(error.to_string()))
}

/// A scene with settings, ready to be simulated on any machine, by several threads at once.
#[pyclass(frozen, module = "isolux._isolux")]
pub(crate) struct StudyProblem {
    inner: Arc<isolux::study::StudyProblem>,
}

#[pymethods]
impl StudyProblem {
    /// The scene's polygons are inserted in the tree, and those found that light can reach. `stop` is asked as it is by
    /// `simulate`.
    #[new]
    #[pyo3(signature = (scene, settings, stop=None, /))]
    fn new(py: Python<'_>, scene: &Scene, settings: &str, stop: Option<Py<PyAny>>) -> PyResult<StudyProblem> {
        let settings: StudySettings = parse(settings)?;
        let scene = Arc::clone(&scene.inner);
        let make = move || isolux::study::StudyProblem::new(scene, settings);
        let problem = interruptible_or(py, stop.as_ref(), make)?;
        Ok(StudyProblem { inner: Arc::new(problem.map_err(to_python)?) })
    }

    /// JSON: polygons, roots, root pairs, nodes, irradiance.
    fn describe(&self) -> PyResult<String> {
        text(&self.inner.describe())
    }

    /// One run, as JSON. `stop` is asked ten times a second; true ends the run with a KeyboardInterrupt.
    #[pyo3(signature = (run, stop=None, /))]
    fn simulate(&self, py: Python<'_>, run: &str, stop: Option<Py<PyAny>>) -> PyResult<String> {
        let request: RunRequest = parse(run)?;
        let told = Arc::new(AtomicBool::new(false));
        let (sender, receiver) = channel();
        let (problem, flag) = (Arc::clone(&self.inner), Arc::clone(&told));
        std::thread::Builder::new()
            .spawn(move || {
                // Nobody may be there any more to take it.
                let _ = sender.send(caught(|| problem.simulate(&request, &flag)));
            })
            .map_err(|error| internal(format!("no thread: {error}")))?;
        // Only this thread ever sees it, but it has to be lent to a closure that might be sent.
        let receiver = Mutex::new(receiver);
        let mut raised = None;
        loop {
            let next = || receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(INTERVAL);
            match guarded(py, next)? {
                Ok(result) => {
                    if let Some(error) = raised {
                        return Err(error);
                    }
                    return text(&result.map_err(internal)?.map_err(to_python)?);
                }
                Err(RecvTimeoutError::Disconnected) => return Err(internal("a thread was lost".into())),
                Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                    if let Err(error) = heard(py, stop.as_ref()) {
                        told.store(true, Relaxed);
                        raised = Some(error);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

/// Machines that a run can ask for by name.
#[pyfunction]
pub(crate) fn machine_names() -> Vec<&'static str> {
    isolux::study::MACHINES.to_vec()
}

/// JSON: name, processors_max, uniform, figures; of a machine by name or file.
#[pyfunction]
#[pyo3(signature = (name_or_path, /))]
pub(crate) fn check_machine(name_or_path: &str) -> PyResult<String> {
    text(&MachineReport::new(&machine_spec(name_or_path).map_err(to_python)?))
}

/// JSON list: size of the BSP tree, root links and work by order of insertion. `stop` is asked now and then; true ends it
/// with a KeyboardInterrupt.
#[pyfunction]
#[pyo3(signature = (scene, request, stop=None, /))]
pub(crate) fn study_orders(py: Python<'_>, scene: &Scene, request: &str, stop: Option<Py<PyAny>>) -> PyResult<String> {
    let request: OrderRequest = parse(request)?;
    let scene = Arc::clone(&scene.inner);
    let counted = interruptible_or(py, stop.as_ref(), move || count_orders(&scene, &request))?;
    text(&counted.map_err(to_python)?)
}

/// JSON: lines of code of each organisation that are its own.
#[pyfunction]
pub(crate) fn schedule_lines() -> PyResult<String> {
    text(&isolux::study::schedule_lines())
}
