//! A panic is a defect of the program: it becomes an `InternalError` with its place, and never a torn interpreter.

use crate::error::internal;
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

/// Message and place of the last panic on any thread of this library.
static LAST: Mutex<Option<String>> = Mutex::new(None);

/// Keeps the message of a panic for [`guarded`] instead of writing it to standard error.
pub(crate) fn remember() {
    std::panic::set_hook(Box::new(|info| {
        *LAST.lock().unwrap_or_else(PoisonError::into_inner) = Some(info.to_string().replace('\n', " "));
    }));
}

/// Runs `work` without the interpreter's lock; a panic comes back as an `InternalError`.
pub(crate) fn guarded<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| caught(work)).map_err(internal)
}

/// Runs `work`; a panic comes back as its message.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|_| {
        let message = LAST.lock().unwrap_or_else(PoisonError::into_inner).take();
        message.unwrap_or_else(|| "panicked".into())
    })
}
