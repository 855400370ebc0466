//! Settings cross the border as JSON; a wrong one is named, with what was given.

use crate::error::{SettingsError, to_python};
use isolux::{Quality, Settings};
use pyo3::prelude::*;
use serde_json::{Map, Value};

/// Reads and checks settings.
pub(crate) fn parse(json: &str) -> PyResult<Settings> {
    let settings: Settings =
        serde_json::from_str(json).map_err(|error| SettingsError::new_err(name_culprit(json, &error)))?;
    settings.validate().map_err(to_python)?;
    Ok(settings)
}

/// Serde says what is wrong but not where: tries the settings one by one.
fn name_culprit(json: &str, error: &serde_json::Error) -> String {
    let Ok(Value::Object(given)) = serde_json::from_str(json) else {
        return format!("settings are not a JSON object: {error}");
    };
    for (name, value) in given {
        let alone = Value::Object(Map::from_iter([(name.clone(), value.clone())]));
        if let Err(error) = serde_json::from_value::<Settings>(alone) {
            return format!("setting '{name}' is {value}: {error}");
        }
    }
    format!("settings: {error}")
}

/// Raises SettingsError for the first setting that makes no sense.
#[pyfunction]
pub(crate) fn validate_settings(settings: &str) -> PyResult<()> {
    parse(settings).map(|_| ())
}

/// The settings that hold where none are given, as JSON.
#[pyfunction]
pub(crate) fn default_settings() -> PyResult<String> {
    serde_json::to_string(&Settings::default()).map_err(|error| crate::error::internal(error.to_string()))
}

/// The error that a named quality stands for.
#[pyfunction]
pub(crate) fn quality_error(quality: &str) -> PyResult<f64> {
    serde_json::from_value::<Quality>(Value::String(quality.into()))
        .map(Quality::error)
        .map_err(|error| SettingsError::new_err(format!("setting 'quality' is \"{quality}\": {error}")))
}
