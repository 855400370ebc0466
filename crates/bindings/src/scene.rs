//! Scenes: files and arrays in, geometry, lights and findings out.

use crate::array::{entries, read_only, rows, same_length};
use crate::error::{SceneError, internal, to_python};
use crate::photometry::Photometry;
use crate::sky::{SkyTuple, sky_of, sky_tuple};
use crate::waiting::interruptible;
use isolux::core::DVec3;
use isolux::core::scene::{
    Alpha, BuildOptions, Face, Issue, Lamp, LampShape, Material, Object, Scene as CoreScene, SceneInput, Surface,
};
use isolux::core::units::{Rgb, Unit};
use isolux::formats::read::luminaire::{issues, web};
use isolux::formats::read::{LightUnits, ReadOptions, UpAxis, read};
use isolux::photometry::Photometry as Luminaire;
use numpy::PyReadonlyArrayDyn;
use numpy::prelude::*;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// A validated scene.
#[pyclass(frozen, module = "isolux._isolux")]
pub(crate) struct Scene {
    pub(crate) inner: Arc<CoreScene>,
    triangles: PyOnceLock<Py<PyAny>>,
    audited: OnceLock<Vec<Issue>>,
}

impl Scene {
    pub(crate) fn new(inner: Arc<CoreScene>) -> Scene {
        Scene { inner, triangles: PyOnceLock::new(), audited: OnceLock::new() }
    }

    fn build(py: Python<'_>, input: SceneInput) -> PyResult<Scene> {
        let scene = interruptible(py, || CoreScene::build(input, &BuildOptions::default()))?.map_err(to_python)?;
        Ok(Scene::new(Arc::new(scene)))
    }
}

/// Name, reflectance, emission, two-sided, opacity.
type MaterialTuple = (String, Triple, Triple, bool, f64);

/// Name, kind, place, direction, side, intensity per band, inner and outer angle of a cone in degrees.
type LampTuple = (String, String, Triple, Triple, Triple, Triple, (f64, f64));

/// A lamp, and of kind "web" its luminaire.
type LampEntry<'py> = (LampTuple, Option<PyRef<'py, Photometry>>);

/// Name, polygons, area in m², power per band, lamps.
type GroupTuple = (String, u64, f64, Triple, u64);

/// Severity, kind, object, message.
type IssueTuple = (String, String, String, String);

/// Three numbers as Python's tuple: bands or coordinates.
type Triple = (f64, f64, f64);

#[pymethods]
impl Scene {
    /// A scene from a file: glTF or OBJ. `unit` is "lm" or "W"; `light_units` is "spec", "unitless" or "blender";
    /// `up` is the file's axis that points up, "y" or "z"; `lamps` come after those of the file, in metres, with +Y up.
    #[staticmethod]
    #[pyo3(signature = (path, metres_per_unit, emission_scale, unit, light_units, up, lamps, sky=None))]
    #[expect(clippy::too_many_arguments, reason = "what a reader is asked for, and what is added; Python names them")]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        metres_per_unit: Option<f64>,
        emission_scale: f64,
        unit: &str,
        light_units: &str,
        up: &str,
        lamps: Vec<LampEntry<'_>>,
        sky: Option<SkyTuple>,
    ) -> PyResult<Scene> {
        let up =
            UpAxis::from_name(up).ok_or_else(|| PyValueError::new_err(format!("up is '{up}': expected 'y' or 'z'")))?;
        let light_units = LightUnits::from_name(light_units).ok_or_else(|| {
            PyValueError::new_err(format!("light_units is '{light_units}': expected 'spec', 'unitless' or 'blender'"))
        })?;
        let options = ReadOptions { metres_per_unit, emission_scale, light_units, unit: unit_of(unit)?, up };
        let file = path.clone();
        let mut input = interruptible(py, move || read(&file, &options))?.map_err(to_python)?;
        let metres = input.metres_per_unit.recip();
        hang(&mut input, lamps, metres)?;
        input.sky = sky.map(sky_of);
        let scene = interruptible(py, || CoreScene::build(input, &BuildOptions::default()))?
            .map_err(|error| SceneError::new_err(format!("{}: {error}", path.display())))?;
        Ok(Scene::new(Arc::new(scene)))
    }

    /// A scene from arrays. A row of `faces` with -1 in its fourth column is a triangle.
    #[staticmethod]
    #[pyo3(signature = (name, vertices, faces, materials, face_materials, names, face_objects, metres_per_unit, unit, lamps, sky=None))]
    #[expect(clippy::too_many_arguments, reason = "one argument per array; Python passes them by name")]
    fn from_arrays(
        py: Python<'_>,
        name: String,
        vertices: PyReadonlyArrayDyn<'_, f64>,
        faces: PyReadonlyArrayDyn<'_, i64>,
        materials: Vec<MaterialTuple>,
        face_materials: PyReadonlyArrayDyn<'_, i64>,
        names: Vec<String>,
        face_objects: PyReadonlyArrayDyn<'_, i64>,
        metres_per_unit: f64,
        unit: &str,
        lamps: Vec<LampEntry<'_>>,
        sky: Option<SkyTuple>,
    ) -> PyResult<Scene> {
        let vertices: Vec<DVec3> = rows::<f64, 3>("vertices", &vertices)?.into_iter().map(DVec3::from_array).collect();
        let faces: Vec<Vec<i64>> = match faces.shape() {
            [_, 3] => rows::<i64, 3>("faces", &faces)?.into_iter().map(Vec::from).collect(),
            [_, 4] => rows::<i64, 4>("faces", &faces)?
                .into_iter()
                .map(|face| if face[3] == -1 { face[..3].to_vec() } else { face.to_vec() })
                .collect(),
            shape => return Err(crate::array::wrong_shape("faces", "(m, 3) or (m, 4)", shape)),
        };
        let face_materials = entries("face_materials", &face_materials)?;
        let face_objects = entries("face_objects", &face_objects)?;
        same_length("face_materials", face_materials.len(), "faces", faces.len())?;
        same_length("face_objects", face_objects.len(), "faces", faces.len())?;

        let mut input = SceneInput { name, metres_per_unit, unit: unit_of(unit)?, ..SceneInput::default() };
        for (row, corners) in faces.iter().enumerate() {
            let object = index("face_objects", row, face_objects[row], names.len())?;
            let material = index("face_materials", row, face_materials[row], materials.len())?;
            let corner = |&vertex: &i64| {
                usize::try_from(vertex).ok().and_then(|vertex| vertices.get(vertex).copied()).ok_or_else(|| {
                    SceneError::new_err(format!(
                        "object '{}': face {row} names vertex {vertex}, which is out of range (there are {})",
                        names[object as usize],
                        vertices.len()
                    ))
                })
            };
            let corners = corners.iter().map(corner).collect::<PyResult<Vec<DVec3>>>()?;
            input.faces.push(Face { object, material, corners, uv: None, surface: None });
        }
        hang(&mut input, lamps, 1.0)?;
        input.sky = sky.map(sky_of);
        input.objects = names.into_iter().map(|name| Object { name }).collect();
        input.materials = materials
            .into_iter()
            .map(|(name, reflectance, emission, two_sided, opacity)| Material {
                name,
                surface: Surface { reflectance: Rgb(reflectance.into()), emission: Rgb(emission.into()), opacity },
                two_sided,
                alpha: if opacity < 1.0 { Alpha::Attenuate } else { Alpha::Opaque },
                texture: None,
            })
            .collect();
        Scene::build(py, input)
    }

    /// Raises InternalError where an invariant of the scene is broken.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        let scene = self.inner.clone();
        interruptible(py, move || scene.check())?.map_err(to_python)
    }

    /// Name of the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// SHA-256 over everything that results depend on or are read by, hexadecimal.
    #[getter]
    fn hash(&self) -> String {
        self.inner.hash_text()
    }

    /// What power is counted in: "lm" or "W".
    #[getter]
    fn unit(&self) -> &'static str {
        self.inner.unit.power()
    }

    /// Corners of the input triangles: (n, 3, 3), metres; made once, read-only.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let array = self.triangles.get_or_try_init(py, || {
            let corners = isolux::flat::points(self.inner.triangles.iter().flatten().copied());
            read_only(py, corners, &[self.inner.triangles.len(), 3, 3]).map(Bound::unbind)
        })?;
        Ok(array.bind(py).clone())
    }

    /// Name of the object of each front polygon's input triangles: (n,), index into `objects`; -1 where a triangle
    /// has no area and was dropped.
    #[getter]
    fn triangle_objects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let polygons = &self.inner.polygons;
        let object = |&polygon: &u32| polygons.get(polygon as usize).map_or(-1, |polygon| i64::from(polygon.object));
        let objects: Vec<i64> = self.inner.face_polygon.iter().map(object).collect();
        let length = objects.len();
        read_only(py, objects, &[length])
    }

    /// Names of the objects, in file order.
    #[getter]
    fn objects(&self) -> Vec<String> {
        self.inner.objects.iter().map(|object| object.name.clone()).collect()
    }

    /// The materials, in file order.
    #[getter]
    fn materials(&self) -> Vec<MaterialTuple> {
        let tuple = |material: &Material| {
            let Surface { reflectance, emission, opacity } = material.surface;
            (material.name.clone(), reflectance.0.into(), emission.0.into(), material.two_sided, opacity)
        };
        self.inner.materials.iter().map(tuple).collect()
    }

    /// Names of the cameras.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        self.inner.cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    /// Findings as (severity, kind, object, message), worst first.
    #[getter]
    fn issues(&self) -> PyResult<Vec<IssueTuple>> {
        tuples(&self.inner.issues)
    }

    /// Faults of the geometry, looked for on request and once, as `issues`.
    fn audit(&self, py: Python<'_>) -> PyResult<Vec<IssueTuple>> {
        if self.audited.get().is_none() {
            let scene = Arc::clone(&self.inner);
            let found = interruptible(py, move || isolux::core::audit::audit(&scene))?;
            // Another thread that was first has found the same.
            let _ = self.audited.set(found);
        }
        tuples(self.audited.get().map_or(&[], Vec::as_slice))
    }

    /// Objects that emit, in file order: (object, material, polygons, area in m², emitted power per band).
    #[getter]
    fn lights(&self) -> Vec<(String, String, usize, f64, Triple)> {
        let mut lights: BTreeMap<(u32, u32), (usize, f64, Rgb)> = BTreeMap::new();
        for polygon in self.inner.polygons.iter().filter(|polygon| polygon.emission != Rgb::ZERO) {
            let light = lights.entry((polygon.object, polygon.material)).or_insert((0, 0.0, Rgb::ZERO));
            light.0 += 1;
            light.1 += polygon.area;
            light.2 += polygon.emission * polygon.area;
        }
        let names = |((object, material), (polygons, area, power)): ((u32, u32), (usize, f64, Rgb))| {
            let object = self.inner.objects[object as usize].name.clone();
            let material = self.inner.materials[material as usize].name.clone();
            (object, material, polygons, area, power.0.into())
        };
        lights.into_iter().map(names).collect()
    }

    /// Lamps without a surface, in file order; and the power of each per band, of suns none. Of measured distributions the
    /// kind is "web".
    #[getter]
    fn lamps(&self) -> Vec<(LampTuple, Option<Triple>)> {
        let tuple = |lamp: &Lamp| {
            let (kind, angles) = match &lamp.shape {
                LampShape::Point => ("point", (0.0, 0.0)),
                LampShape::Spot { inner, outer } => ("spot", (inner.to_degrees(), outer.to_degrees())),
                LampShape::Parallel => ("sun", (0.0, 0.0)),
                LampShape::Web(_) => ("web", (0.0, 0.0)),
            };
            let (position, direction, side) = (lamp.position.into(), lamp.forward.into(), lamp.side.into());
            let power = lamp.power().map(|power| power.0.into());
            ((lamp.name.clone(), kind.to_owned(), position, direction, side, lamp.intensity.0.into(), angles), power)
        };
        self.inner.lamps.iter().map(tuple).collect()
    }

    /// The sky, where there is one.
    #[getter]
    fn sky(&self) -> Option<SkyTuple> {
        self.inner.sky.as_ref().map(sky_tuple)
    }

    /// Power of all lamps without a surface per band, W or lm; of suns nothing is counted.
    #[getter]
    fn lamp_power(&self) -> Triple {
        self.inner.lamp_power().0.into()
    }

    /// What light groups are made of, and each: name, polygons, area, power per band, lamps.
    #[getter]
    fn light_groups(&self) -> (&'static str, Vec<GroupTuple>) {
        let found = isolux::light_groups(&self.inner);
        let by = match found.by {
            isolux::GroupedBy::Object => "object",
            isolux::GroupedBy::Material => "material",
            isolux::GroupedBy::All => "all",
        };
        let tuple =
            |group: isolux::LightGroup| (group.name, group.polygons, group.area, group.power.0.into(), group.lamps);
        (by, found.groups.into_iter().map(tuple).collect())
    }

    /// Emitted power per band, W or lm.
    #[getter]
    fn emitted_power(&self) -> Triple {
        self.inner.emitted_power().0.into()
    }

    /// Area of all fronts, m².
    #[getter]
    fn area(&self) -> f64 {
        self.inner.area()
    }

    /// Lowest and highest corner, metres.
    #[getter]
    fn bounds(&self) -> (Triple, Triple) {
        let corners = || self.inner.polygons.iter().flat_map(|polygon| polygon.corners.iter().copied());
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        (low.into(), high.into())
    }

    /// Counts of polygons by what they are.
    #[getter]
    fn polygons<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let scene = &self.inner;
        let fronts = &scene.polygons[..scene.fronts];
        let counts = PyDict::new(py);
        counts.set_item("fronts", fronts.len())?;
        counts.set_item("two_sided", fronts.iter().filter(|polygon| polygon.twin.is_some()).count())?;
        counts.set_item("triangles", fronts.iter().filter(|polygon| polygon.corners.len() == 3).count())?;
        counts.set_item("quadrilaterals", fronts.iter().filter(|polygon| polygon.corners.len() == 4).count())?;
        counts.set_item("joined", scene.joined)?;
        let dropped = scene.face_polygon.iter().filter(|&&polygon| polygon == CoreScene::NO_POLYGON).count();
        counts.set_item("dropped_triangles", dropped)?;
        Ok(counts)
    }
}

/// Adds lamps that Python describes, and what is to be said of their luminaires; `scale` is on their places.
fn hang(input: &mut SceneInput, lamps: Vec<LampEntry<'_>>, scale: f64) -> PyResult<()> {
    for (tuple, luminaire) in lamps {
        let luminaire = luminaire.as_ref().map(|luminaire| luminaire.luminaire());
        let lamp = lamp_of(tuple, luminaire, scale)?;
        input.issues.extend(luminaire.iter().flat_map(|&luminaire| issues(luminaire, &lamp.name, input.unit)));
        input.lamps.push(lamp);
    }
    Ok(())
}

/// A lamp as Python describes it.
fn lamp_of(
    (name, kind, position, direction, side, intensity, (inner, outer)): LampTuple,
    luminaire: Option<&Luminaire>,
    scale: f64,
) -> PyResult<Lamp> {
    let wrong = |what: &str| PyValueError::new_err(format!("lamp '{name}': {what}"));
    let shape = match (kind.as_str(), luminaire) {
        ("web", Some(luminaire)) => LampShape::Web(web(luminaire, false)),
        ("web", None) => return Err(wrong("kind is 'web': it needs a photometry, see isolux.Lamp.from_file")),
        ("point" | "spot" | "sun", Some(_)) => {
            return Err(wrong(&format!("kind is '{kind}': only kind 'web' takes a photometry")));
        }
        ("point", None) => LampShape::Point,
        ("spot", None) => LampShape::Spot { inner: inner.to_radians(), outer: outer.to_radians() },
        ("sun", None) => LampShape::Parallel,
        _ => return Err(wrong(&format!("kind is '{kind}': expected 'point', 'spot', 'sun' or 'web'"))),
    };
    let (position, forward) = (DVec3::from(position) * scale, DVec3::from(direction));
    let side = match luminaire {
        Some(_) => DVec3::from(side),
        // Nothing of the others depends on how they are turned about their axis.
        None => forward.try_normalize().map_or(DVec3::X, |forward| forward.any_orthonormal_vector()),
    };
    Ok(Lamp { name, position, forward, side, intensity: Rgb(intensity.into()), shape })
}

/// A unit of power by its name.
fn unit_of(name: &str) -> PyResult<Unit> {
    Unit::from_power(name).ok_or_else(|| PyValueError::new_err(format!("unit is '{name}': expected 'lm' or 'W'")))
}

/// Issues as Python gets them: (severity, kind, object, message).
fn tuples(issues: &[Issue]) -> PyResult<Vec<IssueTuple>> {
    let text = |value: serde_json::Result<serde_json::Value>| match value {
        Ok(serde_json::Value::String(text)) => Ok(text),
        other => Err(internal(format!("not a name: {other:?}"))),
    };
    let tuple = |issue: &Issue| {
        let severity = text(serde_json::to_value(issue.severity))?;
        let kind = text(serde_json::to_value(issue.kind))?;
        Ok((severity, kind, issue.object.clone(), issue.message.clone()))
    };
    issues.iter().map(tuple).collect()
}

/// An index into a list, checked.
fn index(what: &'static str, row: usize, value: i64, count: usize) -> PyResult<u32> {
    match u32::try_from(value) {
        Ok(index) if (index as usize) < count => Ok(index),
        _ => Err(PyValueError::new_err(format!("{what}[{row}] is {value}, which is out of range (there are {count})"))),
    }
}
