//! Every error of the facade becomes one exception of `isolux.exceptions`; a new variant does not compile until it has
//! its place here.

use isolux::core::scene::SceneError as CoreSceneError;
use isolux::core::scene::SceneViolation;
use isolux::formats::read::ReadError as FormatsReadError;
use isolux::formats::write::WriteError as FormatsWriteError;
use isolux::photometry::PhotometryError as CratePhotometryError;
use isolux::study::StudyError;
use isolux::{
    MeasureError as FacadeMeasureError, RecordError, RelightError as FacadeRelightError,
    RenderError as FacadeRenderError, SettingsError as FacadeSettingsError, SolveError,
};
use pyo3::import_exception;
use pyo3::prelude::*;
use pyo3::types::PyList;

import_exception!(isolux.exceptions, InternalError);
import_exception!(isolux.exceptions, MeasureError);
import_exception!(isolux.exceptions, NoLightError);
import_exception!(isolux.exceptions, NotRelightableError);
import_exception!(isolux.exceptions, PhotometryError);
import_exception!(isolux.exceptions, ReadError);
import_exception!(isolux.exceptions, RelightError);
import_exception!(isolux.exceptions, RenderError);
import_exception!(isolux.exceptions, SceneError);
import_exception!(isolux.exceptions, SettingsError);
import_exception!(isolux.exceptions, SolutionFileError);
import_exception!(isolux.exceptions, UsageError);
import_exception!(isolux.exceptions, WriteError);

/// An error with its place in Python.
pub(crate) trait PythonError {
    fn exception(self) -> PyErr;
}

/// For `map_err`.
pub(crate) fn to_python(error: impl PythonError) -> PyErr {
    error.exception()
}

/// A defect of the program.
pub(crate) fn internal(message: String) -> PyErr {
    InternalError::new_err(message)
}

impl PythonError for FacadeSettingsError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            FacadeSettingsError::Value { .. }
            | FacadeSettingsError::Schedule { .. }
            | FacadeSettingsError::Lamps { .. }
            | FacadeSettingsError::Sky { .. } => SettingsError::new_err(message),
        }
    }
}

impl PythonError for CoreSceneError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            CoreSceneError::Empty { .. }
            | CoreSceneError::NotFinite { .. }
            | CoreSceneError::CornerCount { .. }
            | CoreSceneError::OutOfRange { .. }
            | CoreSceneError::MaterialNotFinite { .. }
            | CoreSceneError::MaskSize { .. }
            | CoreSceneError::Lamp { .. }
            | CoreSceneError::Sky { .. }
            | CoreSceneError::Unit { .. }
            | CoreSceneError::TooLarge { .. } => SceneError::new_err(message),
        }
    }
}

impl PythonError for SceneViolation {
    fn exception(self) -> PyErr {
        internal(self.to_string())
    }
}

impl PythonError for SolveError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            SolveError::Settings(error) => error.exception(),
            SolveError::Scene(error) => error.exception(),
            SolveError::NoLight { .. } => NoLightError::new_err(message),
            SolveError::Internal(what) => internal(what),
        }
    }
}

impl PythonError for RecordError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            RecordError::Missing { .. }
            | RecordError::Shape { .. }
            | RecordError::Inconsistent { .. }
            | RecordError::Format { .. } => SolutionFileError::new_err(message),
        }
    }
}

impl PythonError for FacadeRelightError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            FacadeRelightError::Schedule { .. } | FacadeRelightError::Unprepared { .. } => {
                NotRelightableError::new_err(message)
            }
            FacadeRelightError::NoSuchGroup { .. }
            | FacadeRelightError::Weight { .. }
            | FacadeRelightError::NoSuchMaterial { .. }
            | FacadeRelightError::Reflectance { .. } => RelightError::new_err(message),
            FacadeRelightError::Settings(error) => error.exception(),
            // What a signal handler raised is what the caller sees; this is for whoever just says stop.
            FacadeRelightError::Cancelled => pyo3::exceptions::PyKeyboardInterrupt::new_err(message),
        }
    }
}

impl PythonError for FacadeRenderError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            FacadeRenderError::NoSuchCamera { .. }
            | FacadeRenderError::View { .. }
            | FacadeRenderError::Gather { .. }
            | FacadeRenderError::Threads { .. }
            | FacadeRenderError::NoSuchSide { .. } => RenderError::new_err(message),
            // What the observer raised is what the caller sees; this is for an observer that just says stop.
            FacadeRenderError::Cancelled => pyo3::exceptions::PyKeyboardInterrupt::new_err(message),
        }
    }
}

impl PythonError for FacadeMeasureError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            FacadeMeasureError::Point { .. }
            | FacadeMeasureError::Direction { .. }
            | FacadeMeasureError::Count { .. }
            | FacadeMeasureError::Rays { .. }
            | FacadeMeasureError::Threads { .. } => MeasureError::new_err(message),
            // What the observer raised is what the caller sees; this is for an observer that just says stop.
            FacadeMeasureError::Cancelled => pyo3::exceptions::PyKeyboardInterrupt::new_err(message),
        }
    }
}

impl PythonError for StudyError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            StudyError::Settings(error) => error.exception(),
            StudyError::NoLight { .. } => NoLightError::new_err(message),
            StudyError::Request { .. }
            | StudyError::Spec(_)
            | StudyError::Machine { .. }
            | StudyError::TooLarge { .. } => UsageError::new_err(message),
            // What the callback raised is what the caller sees; this is for one that just says stop.
            StudyError::Stopped => pyo3::exceptions::PyKeyboardInterrupt::new_err(message),
            StudyError::Internal { what } => internal(what),
        }
    }
}

impl PythonError for FormatsReadError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            FormatsReadError::Io { .. }
            | FormatsReadError::UnknownFormat { .. }
            | FormatsReadError::Malformed { .. }
            | FormatsReadError::Unsupported { .. }
            | FormatsReadError::Buffer { .. }
            | FormatsReadError::Accessor { .. }
            | FormatsReadError::Index { .. }
            | FormatsReadError::Reference { .. }
            | FormatsReadError::Lamp { .. }
            | FormatsReadError::Syntax { .. }
            | FormatsReadError::TooLarge { .. } => ReadError::new_err(message),
        }
    }
}

impl PythonError for FormatsWriteError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            FormatsWriteError::Empty { .. }
            | FormatsWriteError::NotFinite { .. }
            | FormatsWriteError::ImageType { .. }
            | FormatsWriteError::TooLarge { .. }
            | FormatsWriteError::PictureSize { .. }
            | FormatsWriteError::Pixel { .. }
            | FormatsWriteError::Encode { .. }
            | FormatsWriteError::File { .. } => WriteError::new_err(message),
            FormatsWriteError::Exposure { .. } | FormatsWriteError::White { .. } => RenderError::new_err(message),
            // Scene and mesh come from one solution: they fit, or the program is wrong.
            FormatsWriteError::Mismatch { .. } | FormatsWriteError::OutOfRange { .. } => internal(message),
        }
    }
}

impl PythonError for CratePhotometryError {
    fn exception(self) -> PyErr {
        let message = self.to_string();
        match self {
            CratePhotometryError::Io { .. }
            | CratePhotometryError::TooLarge { .. }
            | CratePhotometryError::UnknownFormat { .. }
            | CratePhotometryError::Malformed { .. }
            | CratePhotometryError::Scale { .. } => PhotometryError::new_err(message),
        }
    }
}

/// One exception of every variant, as `(variant, exception)`: the tests look at each class and message.
#[pyfunction]
#[pyo3(name = "_error_samples")]
pub(crate) fn error_samples(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let object = || String::from("lamp");
    let file = || String::from("room.glb");
    let settings = || FacadeSettingsError::Value { name: "error", value: "-1".into(), expected: "a number above 0" };
    let samples: Vec<(&str, PyErr)> = vec![
        ("SettingsError::Value", settings().exception()),
        (
            "SettingsError::Schedule",
            FacadeSettingsError::Schedule { name: "rays", value: "256".into(), schedule: "sequential" }.exception(),
        ),
        ("SettingsError::Lamps", FacadeSettingsError::Lamps { lamp: "sun".into(), schedule: "sequential" }.exception()),
        ("SettingsError::Sky", FacadeSettingsError::Sky { schedule: "sequential" }.exception()),
        ("SceneError::Empty", CoreSceneError::Empty { dropped: 2, invisible: 1 }.exception()),
        ("SceneError::NotFinite", CoreSceneError::NotFinite { object: object(), face: 3 }.exception()),
        ("SceneError::CornerCount", CoreSceneError::CornerCount { object: object(), face: 3, corners: 5 }.exception()),
        (
            "SceneError::OutOfRange",
            CoreSceneError::OutOfRange { what: "material", object: object(), index: 9, count: 4 }.exception(),
        ),
        (
            "SceneError::MaterialNotFinite",
            CoreSceneError::MaterialNotFinite { material: "paint".into(), what: "reflectance" }.exception(),
        ),
        (
            "SceneError::MaskSize",
            CoreSceneError::MaskSize { material: "leaf".into(), mask: 0, width: 2, height: 2, texels: 3 }.exception(),
        ),
        ("SceneError::Lamp", CoreSceneError::Lamp { lamp: "sun".into(), what: "it has no direction" }.exception()),
        ("SceneError::Sky", CoreSceneError::Sky { what: "its zenith has no direction".into() }.exception()),
        ("SceneError::Unit", CoreSceneError::Unit { metres_per_unit: -1.0 }.exception()),
        ("SceneError::TooLarge", CoreSceneError::TooLarge { count: 20, limit: 10 }.exception()),
        ("SceneViolation", SceneViolation { polygon: 7, what: "unit normal" }.exception()),
        ("SolveError::Settings", SolveError::Settings(settings()).exception()),
        ("SolveError::Scene", SolveError::Scene(CoreSceneError::Empty { dropped: 0, invisible: 0 }).exception()),
        ("SolveError::NoLight", SolveError::NoLight { scene: "cave".into() }.exception()),
        ("SolveError::Internal", SolveError::Internal("link 3 has no receiver".into()).exception()),
        ("StudyError::Settings", StudyError::Settings(settings()).exception()),
        ("StudyError::NoLight", StudyError::NoLight { scene: "cave".into() }.exception()),
        ("StudyError::Request", StudyError::Request { reason: "expected value".into() }.exception()),
        (
            "StudyError::Spec",
            isolux::study::machine_spec("cray").map_or_else(PythonError::exception, |_| internal("found".into())),
        ),
        (
            "StudyError::Machine",
            StudyError::Machine {
                machine: "threads".into(),
                source: isolux::study::ClassError::Processors { asked: 0, max: 64 },
            }
            .exception(),
        ),
        ("StudyError::TooLarge", StudyError::TooLarge { what: "links", needed: 20, room: 10 }.exception()),
        ("StudyError::Stopped", StudyError::Stopped.exception()),
        ("StudyError::Internal", StudyError::Internal { what: "node 3 of the tree differs".into() }.exception()),
        ("RecordError::Missing", RecordError::Missing { name: "links/source".into() }.exception()),
        (
            "RecordError::Shape",
            RecordError::Shape {
                name: "links/source".into(),
                found: "shape (3,)".into(),
                expected: "shape (4,)".into(),
            }
            .exception(),
        ),
        (
            "RecordError::Inconsistent",
            RecordError::Inconsistent { name: "links/source".into(), what: "names element 9 of 4".into() }.exception(),
        ),
        ("RecordError::Format", RecordError::Format { found: 9, supported: 1 }.exception()),
        ("RelightError::Schedule", FacadeRelightError::Schedule { schedule: "sequential" }.exception()),
        ("RelightError::Unprepared", FacadeRelightError::Unprepared { why: "it was cancelled".into() }.exception()),
        (
            "RelightError::NoSuchGroup",
            FacadeRelightError::NoSuchGroup { name: "lmap".into(), available: object() }.exception(),
        ),
        ("RelightError::Weight", FacadeRelightError::Weight { name: object(), value: "-1".into() }.exception()),
        (
            "RelightError::NoSuchMaterial",
            FacadeRelightError::NoSuchMaterial { name: "oka".into(), available: "oak".into() }.exception(),
        ),
        (
            "RelightError::Reflectance",
            FacadeRelightError::Reflectance { name: "oak".into(), value: "1.5".into(), most: 1.0 }.exception(),
        ),
        ("RelightError::Settings", FacadeRelightError::Settings(settings()).exception()),
        ("RelightError::Cancelled", FacadeRelightError::Cancelled.exception()),
        (
            "RenderError::NoSuchCamera",
            FacadeRenderError::NoSuchCamera { name: "hall".into(), available: "attic".into() }.exception(),
        ),
        ("RenderError::View", FacadeRenderError::View { what: "eye and target coincide".into() }.exception()),
        ("RenderError::Gather", FacadeRenderError::Gather { rays: 0, most: 65_536 }.exception()),
        ("RenderError::Threads", FacadeRenderError::Threads { threads: 1_000_000 }.exception()),
        ("RenderError::NoSuchSide", FacadeRenderError::NoSuchSide { side: 12, sides: 12 }.exception()),
        ("RenderError::Cancelled", FacadeRenderError::Cancelled.exception()),
        ("MeasureError::Point", FacadeMeasureError::Point { index: 3, point: isolux::core::DVec3::NAN }.exception()),
        (
            "MeasureError::Direction",
            FacadeMeasureError::Direction {
                what: "normals",
                index: 3,
                direction: isolux::core::DVec3::ZERO,
                expected: "a unit vector",
            }
            .exception(),
        ),
        ("MeasureError::Count", FacadeMeasureError::Count { points: 3, receivers: 2 }.exception()),
        ("MeasureError::Rays", FacadeMeasureError::Rays { rays: 0, least: 8, most: 65_536 }.exception()),
        ("MeasureError::Threads", FacadeMeasureError::Threads { threads: 1_000_000 }.exception()),
        ("MeasureError::Cancelled", FacadeMeasureError::Cancelled.exception()),
        ("ReadError::Io", FormatsReadError::Io { file: file(), reason: "no such file".into() }.exception()),
        (
            "ReadError::UnknownFormat",
            FormatsReadError::UnknownFormat { file: file(), found: ".xyz".into() }.exception(),
        ),
        (
            "ReadError::Malformed",
            FormatsReadError::Malformed { file: file(), format: "GLB", reason: "wrong magic".into() }.exception(),
        ),
        (
            "ReadError::Unsupported",
            FormatsReadError::Unsupported { file: file(), what: "glTF 1.0".into(), remedy: "export as 2.0".into() }
                .exception(),
        ),
        (
            "ReadError::Buffer",
            FormatsReadError::Buffer { file: file(), buffer: "buffer 0".into(), reason: "is missing".into() }
                .exception(),
        ),
        (
            "ReadError::Accessor",
            FormatsReadError::Accessor {
                file: file(),
                object: object(),
                what: "POSITION (accessor 3)".into(),
                reason: "ends beyond its buffer".into(),
            }
            .exception(),
        ),
        (
            "ReadError::Index",
            FormatsReadError::Index { file: file(), object: object(), face: 3, what: "vertex", index: 9, count: 4 }
                .exception(),
        ),
        (
            "ReadError::Reference",
            FormatsReadError::Reference { file: file(), owner: "node 'lamp'".into(), what: "mesh", index: 9, count: 4 }
                .exception(),
        ),
        (
            "ReadError::Lamp",
            FormatsReadError::Lamp { file: file(), lamp: "spot".into(), reason: "a.ies: line 4: expected x".into() }
                .exception(),
        ),
        (
            "ReadError::Syntax",
            FormatsReadError::Syntax { file: file(), line: 12, reason: "no number".into() }.exception(),
        ),
        (
            "ReadError::TooLarge",
            FormatsReadError::TooLarge { file: file(), object: object(), what: "faces", count: 20, limit: 10 }
                .exception(),
        ),
        (
            "PhotometryError::Io",
            CratePhotometryError::Io { file: "lamp.ies".into(), reason: "no such file".into() }.exception(),
        ),
        (
            "PhotometryError::TooLarge",
            CratePhotometryError::TooLarge { file: "lamp.ies".into(), bytes: 20, limit: 10 }.exception(),
        ),
        (
            "PhotometryError::UnknownFormat",
            CratePhotometryError::UnknownFormat { file: "lamp".into(), found: "'solid'".into() }.exception(),
        ),
        (
            "PhotometryError::Malformed",
            CratePhotometryError::Malformed {
                file: "lamp.ies".into(),
                line: 12,
                expected: "the input watts".into(),
                found: "'x'".into(),
            }
            .exception(),
        ),
        (
            "PhotometryError::Scale",
            CratePhotometryError::Scale { file: "lamp.ies".into(), lumens: -1.0, reason: "it has none" }.exception(),
        ),
        ("WriteError::Empty", FormatsWriteError::Empty { scene: "cave".into() }.exception()),
        (
            "WriteError::Mismatch",
            FormatsWriteError::Mismatch { scene: "cave".into(), what: "number of vertices", found: 3, expected: 4 }
                .exception(),
        ),
        (
            "WriteError::OutOfRange",
            FormatsWriteError::OutOfRange { what: "image", name: "paint".into(), index: 9, count: 4 }.exception(),
        ),
        (
            "WriteError::NotFinite",
            FormatsWriteError::NotFinite { what: "radiosity", name: "lamp".into(), value: f64::INFINITY }.exception(),
        ),
        ("WriteError::Exposure", FormatsWriteError::Exposure { exposure: -1.0 }.exception()),
        ("WriteError::White", FormatsWriteError::White { white: 0.0 }.exception()),
        (
            "WriteError::ImageType",
            FormatsWriteError::ImageType { image: "wood".into(), mime: "image/gif".into() }.exception(),
        ),
        (
            "WriteError::TooLarge",
            FormatsWriteError::TooLarge { what: "vertices", found: 20, limit: 10, format: "PLY" }.exception(),
        ),
        ("WriteError::PictureSize", FormatsWriteError::PictureSize { width: 4, height: 3, pixels: 11 }.exception()),
        ("WriteError::Pixel", FormatsWriteError::Pixel { x: 2, y: 1, value: [f64::NAN, 0.0, 0.0] }.exception()),
        ("WriteError::Encode", FormatsWriteError::Encode { format: "EXR", message: "no pixels".into() }.exception()),
        (
            "WriteError::File",
            FormatsWriteError::File {
                path: "lit.glb".into(),
                action: "write",
                source: std::io::ErrorKind::StorageFull.into(),
            }
            .exception(),
        ),
    ];
    PyList::new(py, samples.into_iter().map(|(variant, error)| (variant, error.into_value(py))))
}
