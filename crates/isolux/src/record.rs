//! A solution as named flat arrays: what a solution file holds, whatever container it is put in.

use crate::wavefront::{Columns, TransportViolation, Transported};
use crate::{RecordError, Report, Schedule, Solution, Status, flat};
use isolux_core::kernels::visibility::Sight;
use isolux_core::links::{Hierarchy, Link, Links};
use isolux_core::scene::{
    AlphaMask, Camera, Corners, Image, Lamp, Material, Object, Plane, Polygon, Scene, Side, Sky, Wrap,
};
use isolux_core::solution::{Light, Phase, Progress, SmoothPlan, Unobserved, Watch};
use isolux_core::tree::{Bsp, Element, ElementId, Elements, Path};
use isolux_core::units::{Rgb, Unit};
use isolux_core::{DVec2, DVec3};
use isolux_wavefront::{ClusterColumns, LinkColumns, PointErrors};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

/// Format number that this version writes.
const FORMAT: u64 = 4;

/// The oldest that it reads: 3 lacks what relighting needs.
const OLDEST: u64 = 3;

/// Numbers of one type.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// Bytes.
    U8(Vec<u8>),
    /// 32-bit indices.
    U32(Vec<u32>),
    /// 64-bit names.
    U64(Vec<u64>),
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
}

impl Data {
    /// Number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Data::U8(values) => values.len(),
            Data::U32(values) => values.len(),
            Data::U64(values) => values.len(),
            Data::F32(values) => values.len(),
            Data::F64(values) => values.len(),
        }
    }

    /// True when there are no entries.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn type_name(&self) -> &'static str {
        match self {
            Data::U8(_) => "u8",
            Data::U32(_) => "u32",
            Data::U64(_) => "u64",
            Data::F32(_) => "f32",
            Data::F64(_) => "f64",
        }
    }
}

/// A named array, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Name with slashes for groups: `links/source`.
    pub name: String,
    /// Lengths of the axes; their product is the number of entries.
    pub shape: Vec<usize>,
    /// The numbers.
    pub data: Data,
}

/// A solution as attributes and arrays.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Settings, report, names and everything that is not an array, as a JSON object.
    pub attributes: String,
    /// The arrays, in a fixed order.
    pub arrays: Vec<Array>,
}

/// What is not an array.
#[derive(Debug, Serialize, Deserialize)]
struct Attributes {
    format: u64,
    version: String,
    name: String,
    scene_hash: String,
    unit: Unit,
    fronts: usize,
    joined: usize,
    diameter: f64,
    objects: Vec<String>,
    materials: Vec<Material>,
    cameras: Vec<Camera>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    lamps: Vec<Lamp>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sky: Option<Sky>,
    images: Vec<ImageHeader>,
    masks: Vec<MaskHeader>,
    report: Report,
    /// Names of the light groups, where the light is kept by them.
    #[serde(default)]
    groups: Vec<String>,
    /// Points at which rays told how wrong the light of each group is; 0 where they were not asked.
    #[serde(default)]
    points: u32,
    /// See [`Transported::limit`].
    #[serde(default)]
    limit: f32,
}

#[derive(Debug, Serialize, Deserialize)]
struct ImageHeader {
    name: String,
    mime: String,
}

#[derive(Debug, Serialize, Deserialize)]
struct MaskHeader {
    width: u32,
    height: u32,
    cutoff: f64,
    wrap: [Wrap; 2],
}

/// Corners of a patch padded to four, and their number.
fn corner_arrays<'a>(group: &str, patches: impl Iterator<Item = &'a Corners>) -> [Array; 2] {
    let mut counts = Vec::new();
    let points = flat::points(patches.flat_map(|corners| {
        counts.push(corners.len() as u8);
        let last = corners[corners.len() - 1];
        (0..4).map(move |k| corners.get(k).copied().unwrap_or(last))
    }));
    let count = counts.len();
    [
        Array { name: format!("{group}/corners"), shape: vec![count, 4, 3], data: Data::F64(points) },
        Array { name: format!("{group}/corner_count"), shape: vec![count], data: Data::U8(counts) },
    ]
}

fn rgb_array(name: &str, values: impl Iterator<Item = Rgb>) -> Array {
    let flat = flat::bands(values);
    Array { name: name.to_owned(), shape: vec![flat.len() / 3, 3], data: Data::F64(flat) }
}

fn flat_array(name: &str, data: Data) -> Array {
    Array { name: name.to_owned(), shape: vec![data.len()], data }
}

fn u32_array(name: &str, values: impl Iterator<Item = u32>) -> Array {
    flat_array(name, Data::U32(values.collect()))
}

/// Marks an index that is not there.
const NONE: u32 = u32::MAX;

/// `columns`: the light by groups, if it is to be there.
pub(crate) fn write(solution: &Solution, columns: Option<&Columns>) -> Record {
    let scene = &solution.scene;
    let Hierarchy { elements, links, light } = &solution.hierarchy;
    let attributes = Attributes {
        format: FORMAT,
        version: crate::VERSION.to_owned(),
        name: scene.name.clone(),
        scene_hash: scene.hash_text(),
        unit: scene.unit,
        fronts: scene.fronts,
        joined: scene.joined,
        diameter: scene.diameter,
        objects: scene.objects.iter().map(|object| object.name.clone()).collect(),
        materials: scene.materials.clone(),
        cameras: scene.cameras.clone(),
        lamps: scene.lamps.clone(),
        sky: scene.sky.clone(),
        images: scene
            .images
            .iter()
            .map(|image| ImageHeader { name: image.name.clone(), mime: image.mime.clone() })
            .collect(),
        masks: scene
            .masks
            .iter()
            .map(|mask| MaskHeader { width: mask.width, height: mask.height, cutoff: mask.cutoff, wrap: mask.wrap })
            .collect(),
        report: solution.report.clone(),
        groups: columns.map_or_else(Vec::new, |columns| columns.names.clone()),
        points: columns.map_or(0, |columns| columns.points.len() as u32),
        limit: solution.transport.as_ref().map_or(0.0, |transport| transport.limit),
    };
    let mut arrays = scene_arrays(solution);
    let nodes = elements.as_slice();
    arrays.extend(corner_arrays("elements", nodes.iter().map(|node| &node.corners)));
    arrays.push(flat_array("elements/area", Data::F64(nodes.iter().map(|node| node.area).collect())));
    arrays.push(u32_array("elements/polygon", nodes.iter().map(|node| node.polygon)));
    arrays.push(u32_array("elements/parent", nodes.iter().map(|node| node.parent.0)));
    arrays.push(u32_array("elements/first_child", nodes.iter().map(|node| node.first_child.0)));
    arrays.push(flat_array("elements/path", Data::U64(nodes.iter().map(|node| node.path.to_bits()).collect())));
    arrays.push(rgb_array("elements/radiosity", light.radiosities().iter().copied()));
    arrays.push(rgb_array("elements/irradiance", light.irradiances().iter().copied()));
    arrays.push(flat_array("elements/open_share", Data::F64(light.open_shares().to_vec())));
    match &solution.transport {
        Some(transport) => transport_arrays(transport, columns, &mut arrays),
        None => link_arrays(links, &solution.vertex_irradiance, &mut arrays),
    }
    let attributes = serde_json::to_string(&attributes).unwrap_or_else(|error| {
        // Only maps with keys that are not strings can fail, and there are none.
        unreachable!("attributes are plain data: {error}")
    });
    Record { attributes, arrays }
}

/// The scene's part of the arrays.
pub(crate) fn scene_arrays(solution: &Solution) -> Vec<Array> {
    let scene = &solution.scene;
    let polygons = &scene.polygons;
    let mut arrays = Vec::new();
    arrays.extend(corner_arrays("scene", polygons.iter().map(|polygon| &polygon.corners)));
    arrays.push(rgb_array("scene/reflectance", polygons.iter().map(|polygon| polygon.reflectance)));
    arrays.push(rgb_array("scene/emission", polygons.iter().map(|polygon| polygon.emission)));
    arrays.push(flat_array("scene/opacity", Data::F64(polygons.iter().map(|polygon| polygon.opacity).collect())));
    arrays.push(u32_array("scene/mask", polygons.iter().map(|polygon| polygon.mask.unwrap_or(NONE))));
    arrays.push(u32_array("scene/object", polygons.iter().map(|polygon| polygon.object)));
    arrays.push(u32_array("scene/material", polygons.iter().map(|polygon| polygon.material)));
    arrays.push(u32_array("scene/twin", polygons.iter().map(|polygon| polygon.twin.unwrap_or(NONE))));
    let faces: Vec<u32> = polygons.iter().flat_map(|polygon| polygon.faces).collect();
    arrays.push(Array { name: "scene/faces".into(), shape: vec![polygons.len(), 2], data: Data::U32(faces) });
    // NaN where a polygon has no texture coordinates.
    let uv = polygons.iter().flat_map(|polygon| polygon.uv.unwrap_or([DVec2::NAN; 4]));
    let uv: Vec<f64> = uv.flat_map(|uv| uv.to_array()).collect();
    arrays.push(Array { name: "scene/uv".into(), shape: vec![polygons.len(), 4, 2], data: Data::F64(uv) });
    let triangles = Data::F64(flat::points(scene.triangles.iter().flatten().copied()));
    let shape = vec![scene.triangles.len(), 3, 3];
    arrays.push(Array { name: "scene/triangles".into(), shape, data: triangles });
    arrays.push(u32_array("scene/face_polygon", scene.face_polygon.iter().copied()));
    arrays.push(flat_array("scene/active", Data::U8(solution.active.iter().map(|&active| u8::from(active)).collect())));
    for (index, image) in scene.images.iter().enumerate() {
        arrays.push(flat_array(&format!("scene/image_{index}"), Data::U8(image.bytes.clone())));
    }
    for (index, mask) in scene.masks.iter().enumerate() {
        let solid = mask.solid.iter().map(|&solid| u8::from(solid)).collect();
        arrays.push(flat_array(&format!("scene/mask_{index}"), Data::U8(solid)));
    }
    arrays
}

/// What `sequential` leaves behind beyond elements and light.
fn link_arrays(links: &Links, vertex_irradiance: &[Rgb], arrays: &mut Vec<Array>) {
    arrays.push(rgb_array("mesh/irradiance", vertex_irradiance.iter().copied()));
    arrays.push(u32_array("links/receiver", links.iter().map(|(receiver, _)| receiver.0)));
    arrays.push(u32_array("links/source", links.iter().map(|(_, link)| link.source.0)));
    arrays.push(flat_array("links/form_factor", Data::F64(links.iter().map(|(_, link)| link.form_factor).collect())));
    let visibility = links.iter().map(|(_, link)| link.visibility().unwrap_or(0.0) as f32).collect();
    arrays.push(flat_array("links/visibility", Data::F32(visibility)));
    let proven = links.iter().map(|(_, link)| u8::from(link.sight().is_some_and(|sight| sight.proven))).collect();
    arrays.push(flat_array("links/proven", Data::U8(proven)));
}

/// What `wavefront` leaves behind beyond elements and light.
fn transport_arrays(transport: &Transported, columns: Option<&Columns>, arrays: &mut Vec<Array>) {
    let Transported { fields, sky, links, clusters, .. } = transport;
    let table = |name: &str, shape: &[usize], data| Array { name: name.to_owned(), shape: shape.to_vec(), data };
    let values = fields.iter().flatten().flatten().copied().collect();
    arrays.push(table("elements/field", &[fields.len(), 5, 3], Data::F32(values)));
    if !sky.is_empty() {
        let values = sky.iter().flatten().flatten().copied().collect();
        arrays.push(table("elements/sky", &[sky.len(), 5, 2], Data::F32(values)));
    }
    let count = links.receiver.len();
    arrays.push(flat_array("links/receiver", Data::U32(links.receiver.clone())));
    arrays.push(flat_array("links/source", Data::U32(links.source.clone())));
    arrays.push(table("links/factors", &[count, 5], Data::F32(links.factors.as_flattened().to_vec())));
    arrays.push(flat_array("links/visibility", Data::F32(links.visibility.clone())));
    arrays.push(flat_array("links/proven", Data::U8(links.proven.clone())));
    arrays.push(table("links/centre", &[count, 2], Data::F32(links.centre.as_flattened().to_vec())));
    arrays.push(flat_array("links/whole", Data::U8(links.whole.clone())));
    let count = clusters.parent.len();
    arrays.push(table("clusters/centre", &[count, 3], Data::F64(clusters.centre.as_flattened().to_vec())));
    arrays.push(flat_array("clusters/radius", Data::F32(clusters.radius.clone())));
    arrays.push(flat_array("clusters/area", Data::F32(clusters.area.clone())));
    arrays.push(flat_array("clusters/first", Data::U32(clusters.first.clone())));
    arrays.push(flat_array("clusters/count", Data::U32(clusters.count.clone())));
    arrays.push(flat_array("clusters/parent", Data::U32(clusters.parent.clone())));
    arrays.push(flat_array("clusters/members", Data::U32(clusters.members.clone())));
    let Some(columns) = columns else { return };
    arrays.push(flat_array("groups/of", Data::U32(columns.of.clone())));
    arrays.push(rgb_array("groups/emission", columns.emission.iter().copied()));
    let leaves = columns.fields.first().map_or(0, Vec::len);
    let values = columns.fields.iter().flatten().flatten().flatten().copied().collect();
    arrays.push(table("groups/field", &[columns.fields.len(), leaves, 5, 3], Data::F32(values)));
    let (points, groups) = (&*columns.points, columns.fields.len());
    if !points.is_empty() {
        let values = points.irradiance.iter().flatten().flatten().copied().collect();
        arrays.push(table("groups/point_irradiance", &[groups, points.len(), 3], Data::F32(values)));
        let values = points.errors.iter().flatten().flatten().flatten().copied().collect();
        arrays.push(table("groups/point_error", &[groups, points.len(), 2, 3], Data::F32(values)));
    }
}

/// Arrays of a record, to be taken out one by one with their expected shape.
struct Shelf {
    arrays: HashMap<String, Array>,
}

macro_rules! take_as {
    ($method:ident, $variant:ident, $number:ty) => {
        /// Takes an array out; `columns` are the lengths of all axes but the first.
        fn $method(&mut self, name: &str, columns: &[usize]) -> Result<Vec<$number>, RecordError> {
            let array = self.take(name)?;
            let expected: usize = columns.iter().product();
            let found = format!("{} {:?}", array.data.type_name(), array.shape);
            let fits = array.shape.len() == columns.len() + 1
                && array.shape[1..] == *columns
                && array.shape[0].checked_mul(expected) == Some(array.data.len());
            match array.data {
                Data::$variant(values) if fits => Ok(values),
                _ => {
                    let expected = format!("{} (n, {columns:?})", stringify!($number));
                    Err(RecordError::Shape { name: name.to_owned(), found, expected })
                }
            }
        }
    };
}

impl Shelf {
    fn take(&mut self, name: &str) -> Result<Array, RecordError> {
        self.arrays.remove(name).ok_or_else(|| missing(name))
    }

    take_as!(f64, F64, f64);
    take_as!(f32, F32, f32);
    take_as!(u32, U32, u32);
    take_as!(u64, U64, u64);
    take_as!(u8, U8, u8);

    fn rgb(&mut self, name: &str, count: usize) -> Result<Vec<Rgb>, RecordError> {
        let values: Vec<Rgb> = self.f64(name, &[3])?.chunks_exact(3).map(|c| Rgb([c[0], c[1], c[2]])).collect();
        same_length(name, values.len(), count)?;
        Ok(values)
    }

    /// Indices below `limit`, or `NONE`.
    fn indices(&mut self, name: &str, count: usize, limit: usize) -> Result<Vec<u32>, RecordError> {
        let values = self.u32(name, &[])?;
        same_length(name, values.len(), count)?;
        match values.iter().find(|&&value| value != NONE && value as usize >= limit) {
            Some(value) => Err(inconsistent(name, format!("index {value} is out of range (there are {limit})"))),
            None => Ok(values),
        }
    }

    /// Bytes that say no (0) or yes (1).
    fn flags(&mut self, name: &str) -> Result<Vec<bool>, RecordError> {
        let values = self.u8(name, &[])?;
        match values.iter().find(|&&value| value > 1) {
            Some(value) => Err(inconsistent(name, format!("{value} is neither 0 nor 1"))),
            None => Ok(values.into_iter().map(|value| value != 0).collect()),
        }
    }

    fn corners(&mut self, group: &str) -> Result<Vec<Corners>, RecordError> {
        let name = format!("{group}/corners");
        let points = self.f64(&name, &[4, 3])?;
        let counts = self.u8(&format!("{group}/corner_count"), &[])?;
        same_length(&name, points.len() / 12, counts.len())?;
        points
            .chunks_exact(12)
            .zip(counts)
            .map(|(flat, count)| {
                let corners: Vec<DVec3> = flat.chunks_exact(3).map(DVec3::from_slice).take(count as usize).collect();
                Corners::from_slice(&corners)
                    .ok_or_else(|| inconsistent(&name, format!("{count} corners, expected 3 or 4")))
            })
            .collect()
    }
}

fn missing(name: &str) -> RecordError {
    RecordError::Missing { name: name.to_owned() }
}

fn inconsistent(name: &str, what: impl Into<String>) -> RecordError {
    RecordError::Inconsistent { name: name.to_owned(), what: what.into() }
}

fn same_length(name: &str, found: usize, expected: usize) -> Result<(), RecordError> {
    if found == expected { Ok(()) } else { Err(inconsistent(name, format!("{found} rows, expected {expected}"))) }
}

fn present(value: u32) -> Option<u32> {
    (value != NONE).then_some(value)
}

pub(crate) fn read(record: Record) -> Result<Solution, RecordError> {
    let raw: serde_json::Value = serde_json::from_str(&record.attributes)
        .map_err(|error| inconsistent("attributes", format!("not valid JSON: {error}")))?;
    let format = raw.get("format").and_then(serde_json::Value::as_u64);
    match format {
        None => return Err(RecordError::Missing { name: "attributes/format".into() }),
        Some(found) if !(OLDEST..=FORMAT).contains(&found) => {
            return Err(RecordError::Format { found, supported: FORMAT });
        }
        Some(_) => {}
    }
    let attributes: Attributes =
        serde_json::from_value(raw).map_err(|error| inconsistent("attributes", error.to_string()))?;
    let mut shelf = Shelf { arrays: record.arrays.into_iter().map(|array| (array.name.clone(), array)).collect() };
    let report = attributes.report.clone();
    let Attributes { format, limit, points, .. } = attributes;
    let beyond = Beyond { format, groups: attributes.groups.clone(), points, limit };
    let (scene, active) = read_scene(attributes, &mut shelf)?;
    if let Err(error) = report.settings.validate() {
        return Err(inconsistent("attributes/report", error.to_string()));
    }
    if report.schedule != report.settings.schedule {
        return Err(inconsistent("attributes/report", "it names another schedule than its settings"));
    }
    let part = Part { scene, active, report };
    match part.report.schedule {
        Schedule::Wavefront => read_transported(part, beyond, &mut shelf),
        Schedule::Sequential => read_linked(part, &mut shelf),
    }
}

/// What is read whatever the schedule.
struct Part {
    scene: Scene,
    active: Vec<bool>,
    report: Report,
}

/// What attributes say of a solution of `wavefront`.
struct Beyond {
    format: u64,
    groups: Vec<String>,
    points: u32,
    limit: f32,
}

/// A solution of `wavefront`.
fn read_transported(part: Part, beyond: Beyond, shelf: &mut Shelf) -> Result<Solution, RecordError> {
    let Part { scene, active, report } = part;
    let Beyond { format, groups, points, limit } = beyond;
    let elements = read_elements(&scene, shelf)?;
    let radiosity = shelf.rgb("elements/radiosity", elements.len())?;
    let irradiance = shelf.rgb("elements/irradiance", elements.len())?;
    let open_share = shelf.f64("elements/open_share", &[])?;
    same_length("elements/open_share", open_share.len(), elements.len())?;
    let light = Light::from_values(radiosity, irradiance, open_share);
    let field = shelf.f32("elements/field", &[5, 3])?;
    let mut links = LinkColumns {
        receiver: shelf.u32("links/receiver", &[])?,
        source: shelf.u32("links/source", &[])?,
        factors: shelf.f32("links/factors", &[5])?.as_chunks().0.to_vec(),
        visibility: shelf.f32("links/visibility", &[])?,
        proven: shelf.u8("links/proven", &[])?,
        centre: shelf.f32("links/centre", &[2])?.as_chunks().0.to_vec(),
        whole: Vec::new(),
    };
    links.whole = if format == OLDEST {
        links.visibility.iter().map(|&visibility| u8::from(visibility >= 1.0)).collect()
    } else {
        shelf.u8("links/whole", &[])?
    };
    let clusters = ClusterColumns {
        centre: shelf.f64("clusters/centre", &[3])?.as_chunks().0.to_vec(),
        radius: shelf.f32("clusters/radius", &[])?,
        area: shelf.f32("clusters/area", &[])?,
        first: shelf.u32("clusters/first", &[])?,
        count: shelf.u32("clusters/count", &[])?,
        parent: shelf.u32("clusters/parent", &[])?,
        members: shelf.u32("clusters/members", &[])?,
    };
    let fields = field.as_chunks().0.as_chunks().0.to_vec();
    let sky = if scene.sky.is_some() { shelf.f32("elements/sky", &[5, 2])? } else { Vec::new() };
    let sky = Arc::new(sky.as_chunks().0.as_chunks().0.to_vec());
    if !(limit.is_finite() && limit >= 0.0) {
        return Err(inconsistent("attributes/limit", format!("{limit} is not a number of 0 or more")));
    }
    let columns = if groups.is_empty() {
        OnceLock::new()
    } else {
        Arc::new(read_columns(groups, points, &elements, &scene, shelf)?).into()
    };
    let transport = Transported { fields, sky, links: Arc::new(links), clusters: Arc::new(clusters), limit, columns };
    transport.check(&scene, &elements, &light).map_err(|TransportViolation { name, what }| inconsistent(name, what))?;
    Ok(crate::wavefront::solution(Arc::new(scene), elements, light, active, transport, report))
}

/// The light by groups.
fn read_columns(
    names: Vec<String>,
    points: u32,
    elements: &Elements,
    scene: &Scene,
    shelf: &mut Shelf,
) -> Result<Columns, RecordError> {
    let emitters = scene.emitters();
    let leaves = elements.leaves().count();
    let of = shelf.indices("groups/of", emitters, names.len())?;
    let emission = shelf.rgb("groups/emission", emitters)?;
    let values = shelf.f32("groups/field", &[leaves, 5, 3])?;
    let fields: Vec<[[f32; 3]; 5]> = values.as_chunks().0.as_chunks().0.to_vec();
    same_length("groups/field", fields.len(), names.len() * leaves)?;
    let fields = fields.chunks(leaves.max(1)).map(<[_]>::to_vec).collect();
    let points = Arc::new(read_points(points, names.len(), shelf)?);
    Ok(Columns { names, of, emission, fields, points })
}

/// How wrong the light by groups is, at so many points.
fn read_points(count: u32, groups: usize, shelf: &mut Shelf) -> Result<PointErrors, RecordError> {
    if count == 0 {
        return Ok(PointErrors::default());
    }
    let count = count as usize;
    let irradiance = shelf.f32("groups/point_irradiance", &[count, 3])?;
    same_length("groups/point_irradiance", irradiance.len() / (3 * count), groups)?;
    let errors = shelf.f32("groups/point_error", &[count, 2, 3])?;
    same_length("groups/point_error", errors.len() / (6 * count), groups)?;
    Ok(PointErrors {
        irradiance: irradiance.as_chunks().0.chunks(count).map(<[_]>::to_vec).collect(),
        errors: errors.as_chunks().0.as_chunks().0.chunks(count).map(<[_]>::to_vec).collect(),
    })
}

/// A solution of `sequential`.
fn read_linked(part: Part, shelf: &mut Shelf) -> Result<Solution, RecordError> {
    let Part { scene, active, report } = part;
    let hierarchy = read_hierarchy(&scene, shelf)?;
    let bsp = Bsp::build(&scene, report.settings.order);
    let unasked = &mut Unobserved;
    let watch = &mut Watch::new(unasked, Progress::of(Phase::Interpolation));
    let plan = SmoothPlan::new(&scene, &(&scene, &bsp), &hierarchy.elements, &hierarchy.light, watch);
    let Array { shape, .. } = shelf.arrays.get("mesh/irradiance").ok_or_else(|| missing("mesh/irradiance"))?;
    let count = shape.first().copied().unwrap_or(0);
    let is_left_out = report.status == Status::Cancelled && count == 0;
    let mut vertex_irradiance = shelf.rgb("mesh/irradiance", count)?;
    if let Some(plan) = plan.as_ref().filter(|_| !is_left_out) {
        vertex_irradiance = plan.with_sides(vertex_irradiance);
        same_length("mesh/irradiance", vertex_irradiance.len(), plan.vertices())?;
    }
    if vertex_irradiance.iter().any(|value| !value.is_finite() || value.min_component() < 0.0) {
        return Err(inconsistent("mesh/irradiance", "not all values are finite and not negative"));
    }
    let surfaces = if is_left_out { None } else { plan.and_then(|plan| plan.assemble(&vertex_irradiance, watch)) };
    Ok(Solution {
        scene: Arc::new(scene),
        bsp: bsp.into(),
        tracer: OnceLock::new(),
        hierarchy,
        active,
        surfaces: surfaces.map_or_else(OnceLock::new, OnceLock::from),
        vertex_irradiance,
        transport: None,
        report,
    })
}

fn read_scene(attributes: Attributes, shelf: &mut Shelf) -> Result<(Scene, Vec<bool>), RecordError> {
    let Attributes { name, scene_hash, unit, fronts, joined, diameter, objects, materials, .. } = attributes;
    let Attributes { cameras, lamps, sky, images, masks, report, .. } = attributes;
    if report.unit != unit {
        return Err(inconsistent("attributes/unit", format!("{}, but the report has another", unit.power())));
    }
    if !(diameter.is_finite() && diameter > 0.0) {
        return Err(inconsistent("attributes/diameter", format!("{diameter} is not a positive length")));
    }
    let corners = shelf.corners("scene")?;
    let count = corners.len();
    if fronts > count {
        return Err(inconsistent("attributes/fronts", format!("{fronts} of {count} polygons")));
    }
    let reflectance = shelf.rgb("scene/reflectance", count)?;
    let emission = shelf.rgb("scene/emission", count)?;
    let opacity = shelf.f64("scene/opacity", &[])?;
    same_length("scene/opacity", opacity.len(), count)?;
    let mask = shelf.indices("scene/mask", count, masks.len())?;
    let object = shelf.indices("scene/object", count, objects.len())?;
    let material = shelf.indices("scene/material", count, materials.len())?;
    let twin = shelf.indices("scene/twin", count, count)?;
    let uv = shelf.f64("scene/uv", &[4, 2])?;
    same_length("scene/uv", uv.len() / 8, count)?;
    let triangles: Vec<[DVec3; 3]> = shelf
        .f64("scene/triangles", &[3, 3])?
        .chunks_exact(9)
        .map(|c| [DVec3::from_slice(c), DVec3::from_slice(&c[3..]), DVec3::from_slice(&c[6..])])
        .collect();
    let faces = shelf.u32("scene/faces", &[2])?;
    same_length("scene/faces", faces.len() / 2, count)?;
    let face_polygon = shelf.indices("scene/face_polygon", triangles.len(), fronts)?;
    let active = shelf.flags("scene/active")?;
    same_length("scene/active", active.len(), count)?;
    if active[..fronts].contains(&false) {
        return Err(inconsistent("scene/active", "a front took no part"));
    }
    let images = images
        .into_iter()
        .enumerate()
        .map(|(index, header)| {
            let bytes = shelf.u8(&format!("scene/image_{index}"), &[])?;
            Ok(Image { name: header.name, mime: header.mime, bytes })
        })
        .collect::<Result<Vec<_>, RecordError>>()?;
    let masks = masks
        .into_iter()
        .enumerate()
        .map(|(index, MaskHeader { width, height, cutoff, wrap })| {
            let name = format!("scene/mask_{index}");
            let solid = shelf.flags(&name)?;
            if (width as usize).checked_mul(height as usize) != Some(solid.len()) || solid.is_empty() {
                return Err(inconsistent(&name, format!("{} texels, expected {width} x {height}", solid.len())));
            }
            Ok(AlphaMask { width, height, solid, cutoff, wrap })
        })
        .collect::<Result<Vec<_>, RecordError>>()?;
    let mut polygons: Vec<Polygon> = Vec::with_capacity(count);
    for (index, corners) in corners.into_iter().enumerate() {
        let Some(normal) = corners.area_vector().try_normalize() else {
            return Err(inconsistent("scene/corners", format!("polygon {index} has no area")));
        };
        let (side, plane, area) = if index < fronts {
            (Side::Front, Plane { normal, offset: normal.dot(corners.mean()) }, corners.area())
        } else {
            // A back has exactly the plane and area of its front.
            let front = present(twin[index]).and_then(|front| polygons.get(front as usize));
            let Some(front) = front else {
                return Err(inconsistent("scene/twin", format!("back {index} has no front")));
            };
            (Side::Back, front.plane.reversed(), front.area)
        };
        let uv = &uv[8 * index..8 * index + 8];
        polygons.push(Polygon {
            corners,
            plane,
            area,
            reflectance: reflectance[index],
            emission: emission[index],
            opacity: opacity[index],
            mask: present(mask[index]),
            object: object[index],
            material: material[index],
            side,
            twin: present(twin[index]),
            faces: [faces[2 * index], faces[2 * index + 1]],
            uv: (!uv[0].is_nan()).then(|| [0, 2, 4, 6].map(|k| DVec2::new(uv[k], uv[k + 1]))),
        });
    }
    if object.iter().chain(&material).any(|&index| index == NONE) {
        return Err(inconsistent("scene/object", "a polygon has no object or material"));
    }
    let mut scene = Scene {
        front_area: Scene::area_of(&polygons[..fronts]),
        polygons,
        fronts,
        joined,
        objects: objects.into_iter().map(|name| Object { name }).collect(),
        materials,
        images,
        masks,
        cameras,
        lamps,
        sky,
        triangles,
        face_polygon,
        issues: report.issues,
        diameter,
        unit,
        hash: [0; 32],
        name,
    };
    scene.check().map_err(|violation| inconsistent("scene", violation.to_string()))?;
    scene.hash = scene.compute_hash();
    if scene.hash_text() != scene_hash || report.scene_hash != scene_hash {
        return Err(inconsistent(
            "scene",
            "the hash of the stored scene is not the one recorded: the file was altered",
        ));
    }
    Ok((scene, active))
}

fn read_elements(scene: &Scene, shelf: &mut Shelf) -> Result<Elements, RecordError> {
    let corners = shelf.corners("elements")?;
    let count = corners.len();
    let area = shelf.f64("elements/area", &[])?;
    same_length("elements/area", area.len(), count)?;
    let path = shelf.u64("elements/path", &[])?;
    same_length("elements/path", path.len(), count)?;
    let polygon = shelf.indices("elements/polygon", count, scene.polygons.len())?;
    let parent = shelf.indices("elements/parent", count, count)?;
    let first_child = shelf.indices("elements/first_child", count, count)?;
    let nodes: Vec<Element> = corners
        .into_iter()
        .enumerate()
        .map(|(index, corners)| Element {
            corners,
            area: area[index],
            polygon: polygon[index],
            parent: ElementId(parent[index]),
            first_child: ElementId(first_child[index]),
            path: Path::from_bits(path[index]),
        })
        .collect();
    if polygon.contains(&NONE) {
        return Err(inconsistent("elements/polygon", "an element has no polygon"));
    }
    let elements = Elements::from_nodes(nodes, scene.polygons.iter().map(|polygon| polygon.plane).collect());
    elements.check().map_err(|violation| inconsistent("elements", violation.to_string()))?;
    Ok(elements)
}

fn read_hierarchy(scene: &Scene, shelf: &mut Shelf) -> Result<Hierarchy, RecordError> {
    let elements = read_elements(scene, shelf)?;
    let count = elements.len();
    let radiosity = shelf.rgb("elements/radiosity", count)?;
    let irradiance = shelf.rgb("elements/irradiance", count)?;
    let open_share = shelf.f64("elements/open_share", &[])?;
    same_length("elements/open_share", open_share.len(), count)?;
    let light = Light::from_values(radiosity, irradiance, open_share);
    light.check(scene, &elements).map_err(|violation| inconsistent("elements", violation.to_string()))?;
    let form_factor = shelf.f64("links/form_factor", &[])?;
    let visibility = shelf.f32("links/visibility", &[])?;
    same_length("links/visibility", visibility.len(), form_factor.len())?;
    let proven = shelf.flags("links/proven")?;
    same_length("links/proven", proven.len(), form_factor.len())?;
    let receiver = shelf.indices("links/receiver", form_factor.len(), count)?;
    let source = shelf.indices("links/source", form_factor.len(), count)?;
    for (name, ends) in [("links/receiver", &receiver), ("links/source", &source)] {
        if let Some(index) = ends.iter().position(|&end| end == NONE) {
            return Err(inconsistent(name, format!("link {index} has no such end")));
        }
    }
    if let Some(index) = visibility.iter().position(|visibility| !(0.0..=1.0).contains(visibility)) {
        let found = visibility[index];
        return Err(inconsistent("links/visibility", format!("{found} of link {index} is not within 0 and 1")));
    }
    let mut links = Links::new(count);
    let mut first = 0;
    for run in receiver.chunk_by(|one, two| one == two) {
        let list = (first..first + run.len()).map(|index| {
            let sight = Sight { share: f64::from(visibility[index]), proven: proven[index] };
            Link::new(ElementId(source[index]), form_factor[index], sight)
        });
        first += run.len();
        let to = ElementId(run[0]);
        if receiver.get(first).is_some_and(|&next| next < run[0]) {
            return Err(inconsistent("links/receiver", format!("link {first} is not in ascending order")));
        }
        links.put_sorted(to, list.collect());
    }
    links.check(&elements, scene).map_err(|violation| inconsistent("links", violation.to_string()))?;
    Ok(Hierarchy { elements, links, light })
}
