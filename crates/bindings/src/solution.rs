//! Solving, and asking a solution: settings and points come in, values, pictures and files go out.

use crate::array::{entries, from_record_array, read_only, rows, same_length, to_record_array, wrong_shape};
use crate::error::{SolutionFileError, WriteError, internal, to_python};
use crate::observer::{PythonObserver, onlooker};
use crate::panics::guarded;
use crate::scene::Scene;
use crate::waiting::{interruptible, stoppable};
use isolux::core::DVec3;
use isolux::core::units::Rgb;
use isolux::flat;
use isolux::formats::write::{self, GlbOptions, Picture, PngOptions, Provenance, Recall, ToneMap};
use isolux::{
    Array, Changes, MeasureSettings, Receiver, Record, RenderSettings, Solution as FacadeSolution, TexelSettings, View,
    ViewLimits,
};
use numpy::PyReadonlyArrayDyn;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Barycentric coordinates may miss a sum of 1 by this: single precision misses it by 2e-7, a forgotten coordinate by
/// its own size.
const BARYCENTRIC_TOLERANCE: f64 = 1e-5;

/// Name, polygons, area, power and weight of a light group.
type GroupTuple = (String, u64, f64, (f64, f64, f64), u64, (f64, f64, f64));

/// A solved scene.
#[pyclass(frozen, module = "isolux._isolux")]
pub(crate) struct Solution {
    inner: Arc<FacadeSolution>,
}

/// Solves a scene. Returns the solution and what stopped it early: the exception that a signal handler or `progress`
/// raised, or None. `pictures` is called with each picture of it, from another thread; what that raises stops the solve, too.
#[pyfunction]
#[pyo3(signature = (scene, settings, progress=None, pictures=None))]
pub(crate) fn solve(
    py: Python<'_>,
    scene: &Scene,
    settings: &str,
    progress: Option<Py<PyAny>>,
    pictures: Option<Py<PyAny>>,
) -> PyResult<(Solution, Option<Py<PyAny>>)> {
    let settings = crate::settings::parse(settings)?;
    let mut observer = PythonObserver::new(progress);
    let scene = scene.inner.clone();
    let look = pictures.map(|callback| onlooker(callback, observer.elsewhere()));
    let solution = guarded(py, || isolux::solve_seen(scene, &settings, &mut observer, look))?.map_err(to_python)?;
    let raised = observer.into_raised().map(|error| error.into_value(py).into_any());
    Ok((Solution { inner: Arc::new(solution) }, raised))
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

    /// Irradiance of receivers at points: (m, 3), its standard error: (m, 3), and that of the bands' weighted sum: (m,).
    /// `kind`: `"plane"` (looking along `directions`), `"cylinder"` (about them), or `"semicylinder"` (about them, looking along
    /// `facing`, which others do without).
    #[pyo3(signature = (points, kind, directions, facing, samples, weights, threads, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "one argument per choice; Python passes them by name")]
    fn measure<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArrayDyn<'py, f64>,
        kind: &str,
        directions: PyReadonlyArrayDyn<'py, f64>,
        facing: Option<PyReadonlyArrayDyn<'py, f64>>,
        samples: u32,
        weights: [f64; 3],
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let vectors = |name: &str, array: &PyReadonlyArrayDyn<'py, f64>| -> PyResult<Vec<DVec3>> {
            Ok(rows::<f64, 3>(name, array)?.into_iter().map(DVec3::from_array).collect())
        };
        let (points, directions) = (vectors("points", &points)?, vectors("normals", &directions)?);
        same_length("normals", directions.len(), "points", points.len())?;
        let receivers: Vec<Receiver> = match (kind, facing) {
            ("plane", None) => directions.into_iter().map(Receiver::Plane).collect(),
            ("cylinder", None) => directions.into_iter().map(Receiver::Cylinder).collect(),
            ("semicylinder", Some(facing)) => {
                let facing = vectors("facing", &facing)?;
                same_length("facing", facing.len(), "points", points.len())?;
                let pair = |(axis, facing)| Receiver::SemiCylinder { axis, facing };
                directions.into_iter().zip(facing).map(pair).collect()
            }
            _ => return Err(PyValueError::new_err(format!("'{kind}' is no receiver, or what it faces is amiss"))),
        };
        let settings = MeasureSettings { rays: samples, weights: Rgb(weights), threads };
        let mut observer = PythonObserver::new(progress);
        let found = guarded(py, || isolux::measure(&self.inner, &points, &receivers, &settings, &mut observer))?;
        let found = match (observer.raised, found) {
            (Some(raised), _) => return Err(raised),
            (None, found) => found.map_err(to_python)?,
        };
        let count = found.len();
        let irradiance = flat::bands(found.iter().map(|entry| entry.irradiance));
        let errors = flat::bands(found.iter().map(|entry| entry.standard_error));
        let totals = found.iter().map(|entry| entry.total_error).collect();
        Ok((
            read_only(py, irradiance, &[count, 3])?,
            read_only(py, errors, &[count, 3])?,
            read_only(py, totals, &[count])?,
        ))
    }

    /// What points see around them, as shares of all directions: fronts, covered fronts, backs, nothing: (m, 4); and whether that
    /// makes each a point that is in no room: (m,), 1 or 0.
    #[pyo3(signature = (points, threads, progress=None))]
    fn looks<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArrayDyn<'py, f64>,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let points: Vec<DVec3> = rows::<f64, 3>("points", &points)?.into_iter().map(DVec3::from_array).collect();
        let mut observer = PythonObserver::new(progress);
        let looks = guarded(py, || isolux::looks(&self.inner, &points, threads, &mut observer))?;
        let looks = match (observer.raised, looks) {
            (Some(raised), _) => return Err(raised),
            (None, looks) => looks.map_err(to_python)?,
        };
        let shares = looks.iter().flat_map(|look| [look.fronts, look.covered, look.backs, look.open]).collect();
        let out = looks.iter().map(|look| u8::from(look.is_out())).collect();
        Ok((read_only(py, shares, &[looks.len(), 4])?, read_only(py, out, &[looks.len()])?))
    }

    /// The surfaces as triangles with values at their vertices, as named arrays.
    fn mesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let solution = self.inner.clone();
        // Made now, unless the solve made it.
        interruptible(py, move || {
            let _ = solution.mesh();
        })?;
        let mesh = self.inner.mesh();
        let bands = |values: &[Rgb]| flat::bands(values.iter().copied());
        let vertices = mesh.positions.len();
        let arrays = PyDict::new(py);
        arrays.set_item("positions", read_only(py, flat::points(mesh.positions.iter().copied()), &[vertices, 3])?)?;
        arrays.set_item("irradiance", read_only(py, bands(&mesh.irradiance), &[vertices, 3])?)?;
        arrays.set_item("radiosity", read_only(py, bands(&mesh.radiosity), &[vertices, 3])?)?;
        let triangles: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        arrays.set_item("triangles", read_only(py, triangles, &[mesh.triangles.len(), 3])?)?;
        Ok(arrays)
    }

    /// Everything as a JSON object and named arrays, made once per call.
    fn to_record<'py>(&self, py: Python<'py>) -> PyResult<(String, Bound<'py, PyDict>)> {
        let solution = self.inner.clone();
        let record = stoppable(py, move |control| solution.to_record_until(control))?;
        let record = record.ok_or_else(|| to_python(isolux::RelightError::Cancelled))?;
        Ok((record.attributes, dictionary(py, record.arrays)?))
    }

    /// The arrays without the light by groups.
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let solution = self.inner.clone();
        dictionary(py, interruptible(py, move || solution.arrays())?)
    }

    /// What a file is written from that shows the scene: materials, lamps, cameras and images as JSON, the arrays of the
    /// scene, and the smoothing group of each polygon as `smoothing_group`.
    fn scene_record<'py>(&self, py: Python<'py>) -> PyResult<(String, Bound<'py, PyDict>)> {
        let solution = self.inner.clone();
        let (mut arrays, groups) = interruptible(py, move || (solution.scene_arrays(), solution.smoothing_groups()))?;
        let shape = vec![groups.len()];
        arrays.push(Array { name: "smoothing_group".to_owned(), shape, data: isolux::Data::U32(groups) });
        let scene = self.inner.scene();
        let images: Vec<[&str; 2]> = scene.images.iter().map(|image| [&*image.name, &*image.mime]).collect();
        let cutoffs: Vec<f64> = scene.masks.iter().map(|mask| mask.cutoff).collect();
        let attributes = serde_json::json!({
            "fronts": scene.fronts,
            "materials": scene.materials,
            "cameras": scene.cameras,
            "lamps": scene.lamps,
            "images": images,
            "mask_cutoffs": cutoffs,
        });
        Ok((attributes.to_string(), dictionary(py, arrays)?))
    }

    /// Irradiance at points of sides, (m, 3), and whether something covers them, (m,).
    #[pyo3(signature = (side, point, gather=None, elements=false, threads=0, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "one argument per choice; Python passes them by name")]
    fn texels<'py>(
        &self,
        py: Python<'py>,
        side: PyReadonlyArrayDyn<'py, u32>,
        point: PyReadonlyArrayDyn<'py, f64>,
        gather: Option<u32>,
        elements: bool,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let sides = entries("side", &side)?;
        let points = rows::<f64, 3>("point", &point)?;
        same_length("point", points.len(), "side", sides.len())?;
        let places: Vec<(u32, DVec3)> = sides.into_iter().zip(points.into_iter().map(DVec3::from_array)).collect();
        let settings = TexelSettings { gather, elements, threads };
        let mut observer = PythonObserver::new(progress);
        let texels = guarded(py, || self.inner.texels(&places, &settings, &mut observer))?;
        let texels = match (observer.raised, texels) {
            (Some(raised), _) => return Err(raised),
            (None, texels) => texels.map_err(to_python)?,
        };
        let irradiance = read_only(py, flat::bands(texels.iter().map(|texel| texel.irradiance)), &[texels.len(), 3])?;
        let covered: Vec<bool> = texels.iter().map(|texel| texel.covered).collect();
        Ok((irradiance, read_only(py, covered, &[texels.len()])?))
    }

    /// The bytes of a lightmap of (height, width, 3) irradiance: "exr"; "png" of 16 bits, linear, divided by `factor`; or
    /// "preview", PNG of 8 bits, sRGB, of a white surface times the exposure `factor`.
    fn lightmap<'py>(
        &self,
        py: Python<'py>,
        picture: PyReadonlyArrayDyn<'py, f64>,
        kind: &str,
        factor: f64,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let mut picture = to_picture(&picture)?;
        let provenance = self.provenance();
        let kind = kind.to_owned();
        let bytes = interruptible(py, move || match kind.as_str() {
            "exr" => write::lightmap_exr(&picture, &provenance).map(Some),
            "png" => write::lightmap_png(&picture, factor, &provenance).map(Some),
            "preview" => {
                picture.pixels.iter_mut().for_each(|pixel| *pixel = *pixel / std::f64::consts::PI);
                write::png(&picture, &PngOptions { exposure: factor, tone: ToneMap::Clip, provenance }).map(Some)
            }
            _ => Ok(None),
        })?;
        let bytes = bytes.map_err(to_python)?;
        let bytes = bytes.ok_or_else(|| PyValueError::new_err("kind: expected 'exr', 'png' or 'preview'"))?;
        Ok(PyBytes::new(py, &bytes))
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
        let inner = interruptible(py, || FacadeSolution::from_record(record))?.map_err(to_python)?;
        Ok(Solution { inner: Arc::new(inner) })
    }

    /// The light groups: name, one-sided polygons, area, emitted power per band, lamps, weight per band.
    #[getter]
    fn light_groups(&self) -> Vec<GroupTuple> {
        let relit = self.inner.report().relit.as_ref();
        let weights = relit.map_or(&[][..], |relit| &relit.weights);
        let groups = self.inner.report().groups.as_ref().map_or_else(
            // Of older files, and of the other schedule.
            || isolux::light_groups(self.inner.scene()).groups,
            |told| told.groups.clone(),
        );
        let weight = |row: usize| weights.get(row).map_or([1.0; 3], |entry| entry.weight.0);
        let tuple = |(row, group): (usize, isolux::LightGroup)| {
            (group.name, group.polygons, group.area, group.power.0.into(), group.lamps, weight(row).into())
        };
        groups.into_iter().enumerate().map(tuple).collect()
    }

    /// The solution with other weights of its light groups and other reflectances of materials, by name.
    fn relight(
        &self,
        py: Python<'_>,
        weights: Vec<(String, [f64; 3])>,
        reflectance: Vec<(String, [f64; 3])>,
        threads: usize,
    ) -> PyResult<Solution> {
        let solution = self.inner.clone();
        let changes = Changes { weights, reflectance, threads };
        let relit = stoppable(py, move |control| solution.relight_until(&changes, control))?.map_err(to_python)?;
        Ok(Solution { inner: Arc::new(relit) })
    }

    /// What a viewer draws and tells, as `isolux::Solution::view_data` packs it, with so many links and bytes of fields
    /// at most, and light by group or in one column.
    fn view_data<'py>(
        &self,
        py: Python<'py>,
        links: Option<usize>,
        field_bytes: Option<usize>,
        groups: bool,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let usual = ViewLimits::default();
        let (links, field_bytes) = (links.unwrap_or(usual.links), field_bytes.unwrap_or(usual.field_bytes));
        let limits = ViewLimits { links, field_bytes, groups };
        let solution = self.inner.clone();
        let bytes = interruptible(py, move || solution.view_data(&limits))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// The exposure that shows the scene at middle brightness.
    #[getter]
    fn exposure(&self, py: Python<'_>) -> PyResult<f64> {
        let solution = self.inner.clone();
        interruptible(py, move || write::auto_exposure(solution.mesh(), solution.scene()))
    }

    /// Writes the lit surfaces; the suffix of `path` (.glb, .ply, .vtu) says how. With `gather` so many rays find what the
    /// vertices receive.
    #[pyo3(signature = (path, exposure=None, gather=None, threads=0, progress=None))]
    fn bake(
        &self,
        py: Python<'_>,
        path: PathBuf,
        exposure: Option<f64>,
        gather: Option<u32>,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let gathered = match gather {
            None => None,
            Some(rays) => {
                let mut observer = PythonObserver::new(progress);
                let mesh = guarded(py, || self.inner.gathered_mesh(rays, threads, &mut observer))?;
                match (observer.raised, mesh) {
                    (Some(raised), _) => return Err(raised),
                    (None, mesh) => Some(mesh.map_err(to_python)?),
                }
            }
        };
        let (solution, provenance, suffix) = (self.inner.clone(), self.provenance(), suffix(&path));
        write_out(py, path, ".glb, .ply or .vtu", move || {
            let (scene, mesh) = (solution.scene(), gathered.as_ref().unwrap_or_else(|| solution.mesh()));
            let factor = || exposure.unwrap_or_else(|| write::auto_exposure(mesh, scene));
            match suffix.as_str() {
                "glb" => write::glb(scene, mesh, &GlbOptions { exposure, provenance }).map(Some),
                "ply" => write::ply(scene, mesh, factor(), &provenance).map(Some),
                "vtu" => write::vtu(scene, mesh, factor(), &provenance).map(Some),
                _ => Ok(None),
            }
        })
    }

    /// Writes a picture of (height, width, 3) linear radiance; the suffix of `path` (.png, .exr) says how.
    #[pyo3(signature = (path, picture, exposure=None))]
    fn write_image(
        &self,
        py: Python<'_>,
        path: PathBuf,
        picture: PyReadonlyArrayDyn<'_, f64>,
        exposure: Option<f64>,
    ) -> PyResult<()> {
        let picture = to_picture(&picture)?;
        let (solution, provenance, suffix) = (self.inner.clone(), self.provenance(), suffix(&path));
        write_out(py, path, ".png or .exr", move || match suffix.as_str() {
            "png" => {
                let exposure = exposure.unwrap_or_else(|| write::auto_exposure(solution.mesh(), solution.scene()));
                write::png(&picture, &PngOptions { exposure, tone: ToneMap::default(), provenance }).map(Some)
            }
            "exr" => write::exr(&picture, &provenance).map(Some),
            _ => Ok(None),
        })
    }

    /// Draws linear radiance: (height, width, 3).
    #[pyo3(signature = (camera, eye, at, vertical_angle, size, samples_per_side, gather, threads, progress=None))]
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
        gather: Option<u32>,
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
        let settings = RenderSettings { width, height, samples_per_side, gather, threads };
        let mut observer = PythonObserver::new(progress);
        let picture = guarded(py, || isolux::render(&self.inner, &view, &settings, &mut observer))?;
        match (observer.raised, picture) {
            (Some(raised), _) => Err(raised),
            (None, Err(error)) => Err(to_python(error)),
            (None, Ok(pixels)) => {
                let values = flat::bands(pixels);
                read_only(py, values, &[height as usize, width as usize, 3])
            }
        }
    }
}

/// Writes a file whole or not at all.
#[pyfunction]
pub(crate) fn write_aside(py: Python<'_>, path: PathBuf, contents: &[u8]) -> PyResult<()> {
    let contents = contents.to_vec();
    write_out(py, path, "", move || Ok(Some(contents)))
}

/// Writes what `make` makes, whole or not at all, Ctrl-C included; None: the suffix of `path` is none of `known`.
fn write_out(
    py: Python<'_>,
    path: PathBuf,
    known: &str,
    make: impl FnOnce() -> Result<Option<Vec<u8>>, write::WriteError> + Send + 'static,
) -> PyResult<()> {
    let recall = Recall::default();
    let (target, theirs) = (path.clone(), recall.clone());
    let written = interruptible(py, move || {
        let Some(bytes) = make()? else { return Ok(false) };
        write::write_aside_with(&target, &theirs, |file| file.write_all(&bytes)).map(|()| true)
    });
    match written {
        Ok(Ok(true)) => Ok(()),
        Ok(Ok(false)) => Err(unknown_suffix(&path, known)),
        Ok(Err(error)) => Err(to_python(error)),
        Err(stopped) => {
            recall.recall();
            Err(stopped)
        }
    }
}

/// An array of (height, width, 3) as a picture.
fn to_picture(picture: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Picture> {
    let view = picture.as_array();
    let &[height, width, 3] = view.shape() else {
        return Err(wrong_shape("picture", "(height, width, 3)", view.shape()));
    };
    let too_large = |_| PyValueError::new_err(format!("picture: {width} x {height} pixels are too many"));
    let values: Vec<f64> = view.iter().copied().collect();
    Ok(Picture {
        width: width.try_into().map_err(too_large)?,
        height: height.try_into().map_err(too_large)?,
        pixels: values.as_chunks::<3>().0.iter().map(|&pixel| Rgb(pixel)).collect(),
    })
}

/// Arrays by name.
fn dictionary(py: Python<'_>, arrays: Vec<Array>) -> PyResult<Bound<'_, PyDict>> {
    let named = PyDict::new(py);
    for array in arrays {
        named.set_item(array.name.clone(), from_record_array(py, array)?)?;
    }
    Ok(named)
}

/// The suffix of a path in lower case, without its dot.
fn suffix(path: &Path) -> String {
    path.extension().map(|suffix| suffix.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn unknown_suffix(path: &Path, known: &str) -> PyErr {
    WriteError::new_err(format!("{}: expected a name that ends in {known}", path.display()))
}

impl Solution {
    /// Where the numbers come from.
    fn provenance(&self) -> Provenance {
        let report = self.inner.report();
        Provenance {
            // Settings hold nothing that JSON cannot.
            settings: serde_json::to_string(&report.settings).unwrap_or_default(),
            seed: report.settings.seed,
            ..Provenance::of(self.inner.scene())
        }
    }

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
        let off = |weights: &[f64; 3]| {
            let excess = weights.iter().sum::<f64>() - 1.0;
            excess.is_nan() || excess.abs() > BARYCENTRIC_TOLERANCE
        };
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
