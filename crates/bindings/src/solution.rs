//! Solving, and asking a solution.

use crate::array::{coordinates, entries, from_record_array, read_only, rows, same_length, to_record_array};
use crate::error::{SolutionFileError, internal, to_python};
use crate::observer::PythonObserver;
use crate::panics::guarded;
use crate::scene::Scene;
use isolux::core::DVec3;
use isolux::core::units::Rgb;
use isolux::{Record, RenderSettings, Solution as FacadeSolution, View};
use numpy::PyReadonlyArrayDyn;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Barycentric coordinates may miss a sum of 1 by this: single precision misses it by 2e-7, a forgotten coordinate by
/// its own size.
const BARYCENTRIC_TOLERANCE: f64 = 1e-5;

/// A solved scene.
#[pyclass(frozen, module = "isolux._isolux")]
pub(crate) struct Solution {
    inner: FacadeSolution,
}

/// Solves a scene. Returns the solution and what stopped it early: the exception that a signal handler or `progress`
/// raised, or None.
#[pyfunction]
#[pyo3(signature = (scene, settings, progress=None))]
pub(crate) fn solve(
    py: Python<'_>,
    scene: &Scene,
    settings: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Solution, Option<Py<PyAny>>)> {
    let settings = crate::settings::parse(settings)?;
    let mut observer = PythonObserver::new(progress);
    let scene = scene.inner.clone();
    let solution = guarded(py, || isolux::solve(scene, &settings, &mut observer))?.map_err(to_python)?;
    let raised = observer.raised.map(|error| error.into_value(py).into_any());
    Ok((Solution { inner: solution }, raised))
}

#[pymethods]
impl Solution {
    /// The scene that was solved.
    #[getter]
    fn scene(&self) -> Scene {
        Scene::new(self.inner.scene().clone())
    }

    /// Everything that the solve told of itself, as JSON.
    #[getter]
    fn report(&self) -> PyResult<String> {
        serde_json::to_string(self.inner.report()).map_err(|error| internal(error.to_string()))
    }

    /// Radiosity at points of input faces: (m, 3).
    fn radiosity_at<'py>(
        &self,
        py: Python<'py>,
        face: PyReadonlyArrayDyn<'py, i64>,
        barycentric: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.at(py, &face, &barycentric, FacadeSolution::radiosity_at)
    }

    /// Irradiance at points of input faces: (m, 3).
    fn irradiance_at<'py>(
        &self,
        py: Python<'py>,
        face: PyReadonlyArrayDyn<'py, i64>,
        barycentric: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.at(py, &face, &barycentric, FacadeSolution::irradiance_at)
    }

    /// The surfaces as triangles with values at their vertices, as named arrays.
    fn mesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let mesh = self.inner.mesh();
        let bands = |values: &[Rgb]| values.iter().flat_map(|value| value.0).collect::<Vec<f64>>();
        let vertices = mesh.positions.len();
        let arrays = PyDict::new(py);
        arrays.set_item("positions", read_only(py, coordinates(mesh.positions.iter().copied()), &[vertices, 3])?)?;
        arrays.set_item("irradiance", read_only(py, bands(&mesh.irradiance), &[vertices, 3])?)?;
        arrays.set_item("radiosity", read_only(py, bands(&mesh.radiosity), &[vertices, 3])?)?;
        let triangles: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        arrays.set_item("triangles", read_only(py, triangles, &[mesh.triangles.len(), 3])?)?;
        Ok(arrays)
    }

    /// Everything as a JSON object and named arrays, made once per call.
    fn to_record<'py>(&self, py: Python<'py>) -> PyResult<(String, Bound<'py, PyDict>)> {
        let record = guarded(py, || self.inner.to_record())?;
        let arrays = PyDict::new(py);
        for array in record.arrays {
            arrays.set_item(array.name.clone(), from_record_array(py, array)?)?;
        }
        Ok((record.attributes, arrays))
    }

    /// A solution back from a JSON object and named arrays.
    #[staticmethod]
    fn from_record(py: Python<'_>, attributes: String, arrays: &Bound<'_, PyDict>) -> PyResult<Solution> {
        let mut record = Record { attributes, arrays: Vec::with_capacity(arrays.len()) };
        for (name, value) in arrays {
            let name: String = name.extract()?;
            let array = to_record_array(name.clone(), &value).ok_or_else(|| {
                let dtype =
                    value.getattr("dtype").map_or_else(|_| value.get_type().to_string(), |dtype| dtype.to_string());
                SolutionFileError::new_err(format!("'{name}' holds {dtype}, which no solution does"))
            })?;
            record.arrays.push(array);
        }
        let inner = guarded(py, || FacadeSolution::from_record(record))?.map_err(to_python)?;
        Ok(Solution { inner })
    }

    /// Draws linear radiance: (height, width, 3).
    #[pyo3(signature = (camera, eye, at, vertical_angle, size, samples_per_side, threads, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "one argument per choice; Python passes them by name")]
    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: Option<String>,
        eye: Option<[f64; 3]>,
        at: Option<[f64; 3]>,
        vertical_angle: f64,
        size: (u32, u32),
        samples_per_side: u32,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let view = match (camera, eye, at) {
            (None, None, None) => View::Default,
            (Some(name), None, None) => View::Camera(name),
            (None, Some(eye), Some(at)) => {
                View::LookAt { eye: DVec3::from_array(eye), at: DVec3::from_array(at), vertical_angle }
            }
            _ => return Err(PyValueError::new_err("give a camera, or both eye and at, or neither")),
        };
        let (width, height) = size;
        let settings = RenderSettings { width, height, samples_per_side, threads };
        let mut observer = PythonObserver::new(progress);
        let picture = guarded(py, || isolux::render(&self.inner, &view, &settings, &mut observer))?;
        match (observer.raised, picture) {
            (Some(raised), _) => Err(raised),
            (None, Err(error)) => Err(to_python(error)),
            (None, Ok(pixels)) => {
                let values = pixels.iter().flat_map(|pixel| pixel.0).collect();
                read_only(py, values, &[height as usize, width as usize, 3])
            }
        }
    }
}

impl Solution {
    /// Looks up one value per row of `face` and `barycentric`.
    fn at<'py>(
        &self,
        py: Python<'py>,
        face: &PyReadonlyArrayDyn<'py, i64>,
        barycentric: &PyReadonlyArrayDyn<'py, f64>,
        value: impl Fn(&FacadeSolution, u32, [f64; 3]) -> Option<Rgb> + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let faces = entries("face", face)?;
        let barycentric = rows::<f64, 3>("barycentric", barycentric)?;
        same_length("barycentric", barycentric.len(), "face", faces.len())?;
        let count = self.inner.scene().triangles.len();
        if let Some(&face) = faces.iter().find(|&&face| usize::try_from(face).map_or(true, |face| face >= count)) {
            return Err(PyIndexError::new_err(format!("face {face} is out of range: the scene has {count} triangles")));
        }
        let off = |weights: &[f64; 3]| !((weights.iter().sum::<f64>() - 1.0).abs() <= BARYCENTRIC_TOLERANCE);
        if let Some(row) = barycentric.iter().position(off) {
            let [a, b, c] = barycentric[row];
            return Err(PyValueError::new_err(format!(
                "barycentric[{row}] is ({a}, {b}, {c}), which does not sum to 1"
            )));
        }
        let points = faces.len();
        let values: Vec<f64> = guarded(py, || {
            let at = |(&face, &weights): (&i64, &[f64; 3])| value(&self.inner, face as u32, weights);
            // A face that was dropped holds no light.
            faces.iter().zip(&barycentric).flat_map(|pair| at(pair).map_or([f64::NAN; 3], |value| value.0)).collect()
        })?;
        read_only(py, values, &[points, 3])
    }
}
