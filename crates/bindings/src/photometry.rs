//! Luminaires: photometric files in, facts, tables and intensities out.

use crate::array::{read_only, rows};
use crate::error::to_python;
use crate::waiting::interruptible;
use isolux::photometry::{Kind, LampSet, Photometry as Inner, Tilt, read};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// A luminaire as a photometric file describes it.
#[pyclass(frozen, module = "isolux._isolux")]
pub(crate) struct Photometry {
    inner: Arc<Inner>,
    vertical: PyOnceLock<Py<PyAny>>,
    horizontal: PyOnceLock<Py<PyAny>>,
    candela: PyOnceLock<Py<PyAny>>,
}

impl Photometry {
    fn new(inner: Inner) -> Photometry {
        Photometry {
            inner: Arc::new(inner),
            vertical: PyOnceLock::new(),
            horizontal: PyOnceLock::new(),
            candela: PyOnceLock::new(),
        }
    }

    /// What lamps are made of.
    pub(crate) fn luminaire(&self) -> &Inner {
        &self.inner
    }
}

/// Count, name, lumens, watts, colour, rendering.
type LampTuple<'a> = (f64, &'a str, Option<f64>, Option<f64>, &'a str, &'a str);

fn lamp_tuple(set: &LampSet) -> LampTuple<'_> {
    (set.count, &set.name, set.lumens, set.watts, &set.colour, &set.rendering)
}

#[pymethods]
impl Photometry {
    /// A luminaire from a file: IES or EULUMDAT.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Photometry> {
        interruptible(py, move || read(&path))?.map_err(to_python).map(Photometry::new)
    }

    /// All facts by name, as `python/isolux/photometry.py` takes them.
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inner = &self.inner;
        let kind = match inner.web.kind() {
            Kind::A => "A",
            Kind::B => "B",
            Kind::C => "C",
        };
        let tilt = match &inner.tilt {
            Tilt::None => "none".to_owned(),
            Tilt::Included { angles, .. } => format!("{} factors, not applied", angles.len()),
            Tilt::File(name) => format!("factors in file '{name}', not read"),
            Tilt::Measured(degrees) => format!("measured with a tilt of {degrees} degrees, not turned back"),
        };
        let peak = inner.web.peak();
        let facts = PyDict::new(py);
        facts.set_item("file", &inner.file)?;
        facts.set_item("format", inner.format.name())?;
        facts.set_item("kind", kind)?;
        facts.set_item("symmetry", inner.web.symmetry().name())?;
        facts.set_item("luminaire", &inner.luminaire)?;
        facts.set_item("catalogue", &inner.catalogue)?;
        facts.set_item("manufacturer", &inner.manufacturer)?;
        facts.set_item("absolute", inner.absolute)?;
        facts.set_item("lamps", inner.lamps.iter().map(lamp_tuple).collect::<Vec<_>>())?;
        facts.set_item("lamp_lumens", inner.lamp_lumens)?;
        facts.set_item("stated_lumens", inner.stated_lumens)?;
        facts.set_item("flux", inner.flux())?;
        facts.set_item("output_ratio", inner.output_ratio())?;
        facts.set_item("downward", inner.downward())?;
        facts.set_item("watts", inner.watts)?;
        facts.set_item("opening", (inner.opening.shape.name(), <(f64, f64, f64)>::from(inner.opening.size)))?;
        let direction = <(f64, f64, f64)>::from(peak.direction);
        facts.set_item("peak", (peak.candela, peak.vertical, peak.horizontal, direction))?;
        facts.set_item("beam", <(Option<f64>, Option<f64>)>::from(inner.beam()))?;
        facts.set_item("field", <(Option<f64>, Option<f64>)>::from(inner.field()))?;
        facts.set_item("tilt", tilt)?;
        facts.set_item("keywords", inner.keywords.clone())?;
        facts.set_item("warnings", inner.warnings.iter().map(ToString::to_string).collect::<Vec<_>>())?;
        Ok(facts)
    }

    /// (n,) vertical angles, degrees; read-only.
    #[getter]
    fn vertical(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let angles = self.inner.web.vertical();
        let make = || Ok::<_, PyErr>(read_only(py, angles.to_vec(), &[angles.len()])?.unbind());
        Ok(self.vertical.get_or_try_init(py, make)?.clone_ref(py))
    }

    /// (m,) horizontal angles, degrees; read-only.
    #[getter]
    fn horizontal(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let angles = self.inner.web.horizontal();
        let make = || Ok::<_, PyErr>(read_only(py, angles.to_vec(), &[angles.len()])?.unbind());
        Ok(self.horizontal.get_or_try_init(py, make)?.clone_ref(py))
    }

    /// (m, n) intensities, candela; read-only.
    #[getter]
    fn candela(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let web = &self.inner.web;
        let shape = [web.horizontal().len(), web.vertical().len()];
        let make = || Ok::<_, PyErr>(read_only(py, web.candela().to_vec(), &shape)?.unbind());
        Ok(self.candela.get_or_try_init(py, make)?.clone_ref(py))
    }

    /// (n,) intensities in candela for (n, 3) directions; not a number where one has no direction.
    fn intensity<'py>(&self, py: Python<'py>, directions: PyReadonlyArrayDyn<'_, f64>) -> PyResult<Bound<'py, PyAny>> {
        let directions = rows::<f64, 3>("directions", &directions)?;
        let inner = Arc::clone(&self.inner);
        let candela: Vec<f64> =
            interruptible(py, move || directions.into_iter().map(|direction| inner.intensity(direction)).collect())?;
        let count = candela.len();
        read_only(py, candela, &[count])
    }

    /// The same distribution with another flux.
    fn with_flux(&self, lumens: f64) -> PyResult<Photometry> {
        self.inner.with_flux(lumens).map_err(to_python).map(Photometry::new)
    }
}
