//! Work that nothing observes and of which nothing is kept when it is stopped: it runs on a thread of its own, while the
//! caller's thread hears Ctrl-C.

use crate::error::internal;
use crate::panics::guarded;
use isolux::Control;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Between two looks at the signals.
const INTERVAL: Duration = Duration::from_millis(20);

/// Stack of the thread: what a main thread has by custom.
const STACK_BYTES: usize = 8 << 20;

/// Runs `work` without the interpreter's lock; a panic comes back as an `InternalError`. When a signal handler raises
/// (looked for every 20 ms), that comes back at once; the thread then works on for nobody and its result is dropped.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    interruptible_or(py, None, work)
}

/// The same for a thread that hears no signals: `stop` is asked as often; true is a `KeyboardInterrupt`, at once.
pub(crate) fn interruptible_or<T: Send + 'static>(
    py: Python<'_>,
    stop: Option<&Py<PyAny>>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    let job = move || {
        let result = crate::panics::caught(work);
        // Nobody may be there any more to take it.
        let _ = sender.send(result);
    };
    std::thread::Builder::new()
        .stack_size(STACK_BYTES)
        .spawn(job)
        .map_err(|error| internal(format!("no thread: {error}")))?;
    // Only the receiver's own thread ever sees it, but it has to be lent to a closure that might be sent.
    let receiver = std::sync::Mutex::new(receiver);
    loop {
        let waited =
            guarded(py, || receiver.lock().unwrap_or_else(std::sync::PoisonError::into_inner).recv_timeout(INTERVAL))?;
        match waited {
            Ok(result) => return result.map_err(internal),
            Err(RecvTimeoutError::Timeout) => heard(py, stop)?,
            Err(RecvTimeoutError::Disconnected) => return Err(internal("a thread was lost".into())),
        }
    }
}

/// Raises what a signal handler raises, or a `KeyboardInterrupt` where `stop` says so.
pub(crate) fn heard(py: Python<'_>, stop: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    match stop {
        Some(stop) if stop.call0(py)?.is_truthy(py)? => Err(PyKeyboardInterrupt::new_err("stopped")),
        _ => Ok(()),
    }
}

/// [`interruptible`] for work that ends soon when its control says stop, which it does when a signal handler raises.
pub(crate) fn stoppable<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Control) -> T + Send + 'static,
) -> PyResult<T> {
    let control = Arc::new(Control::default());
    let theirs = control.clone();
    let done = interruptible(py, move || work(&theirs));
    if done.is_err() {
        control.stop();
    }
    done
}
