//! What a viewer draws and tells: a solution goes in, one block of bytes comes out, which the page in `viewer/` reads.
//!
//! # Layout
//!
//! All numbers are little-endian.
//!
//! | bytes | what |
//! |---|---|
//! | 0..8 | `isoluxvw` |
//! | 8..12 | length of the header, u32 |
//! | 12..16 | format, u32: 1 |
//! | 16.. | the header, JSON in UTF-8, filled up with spaces to a multiple of 8 bytes |
//! | then | the body: arrays side by side, each filled up to a multiple of 8 bytes |
//!
//! The header's `arrays` tells of each array its `type` (`u8`, `u32`, `f32`, `f64`), its `shape` and its `offset` from the
//! beginning of the body, bytes. Everything else in the header is [`Header`]. `NONE` is 2³² - 1, v vertices and t triangles make
//! up the mesh, there are p polygons, r roots of quadtrees, n elements, l leaves (in ascending order), c clusters and g columns
//! of light. Positions in single precision are relative to the header's `origin`; all lengths are metres, all light is W/m² or
//! lm/m². A column is the light of one group with weight 1: what is shown is their sum, weighted by what the header's `groups`
//! say at first, and by other numbers once lights are dimmed.
//!
//! | array | what |
//! |---|---|
//! | `mesh/positions` f32 (v, 3), `mesh/triangles` u32 (t, 3) | the surfaces without cracks |
//! | `mesh/vertex_start`, `mesh/triangle_start` u32 (p + 1) | whose they are |
//! | `mesh/irradiance` f32 (g, v, 3) | irradiance at the vertices; below 0 where a part of the light is: sums are cut off there |
//! | `mesh/leaf` u32 (t), `mesh/bilinear` u8 (t) | without fields: the element of each triangle; 1 and 2 where it is the first or the second half of a quadrilateral in which values are bilinear, else 0 |
//! | `roots/corners` f64 (r, 4, 3), `roots/corner_count` u8 (r), `roots/polygon` u32 (r) | roots of the quadtrees; not relative |
//! | `elements/first_child` u32 (n) | the first of four children, or `NONE`; roots come first |
//! | `elements/cut` u8 (n) | how children cut it: 0 into quarters, 1 into strips along the first side, 2 along the second |
//! | `elements/open` f32 (n) | share that nothing covers |
//! | `elements/field` f32 (g, l, 5, 3) | irradiance of leaves at their corners (the fourth of a triangle means nothing) and their middle |
//! | `elements/mean` f32 (g, l, 3) | without fields: mean irradiance of the open part of leaves |
//! | `polygons/normal` f64 (p, 3), `polygons/reflectance`, `polygons/emission` f32 (p, 3), `polygons/opacity` f32 (p) | one-sided polygons, fronts first; what they emit with weight 1 |
//! | `polygons/group`, `polygons/object`, `polygons/material`, `polygons/twin` u32 (p), `polygons/faces` u32 (p, 2) | column that dims them or `NONE`; rows of the header's lists; the other side or `NONE`; input triangles |
//! | `points/irradiance` f32 (g x k, 3), `points/error` f32 (g x k, 6) | by group and point of its check: irradiance, and its error by both batches of rays; nothing where groups were not checked |
//! | `links/start` u32 (n + c + 1) | first link of each receiver, elements first, then clusters |
//! | `links/source` u32, `links/factor` f32, `links/visibility` u8 | links: where light comes from, mean of factor times visibility, visibility times 255 |
//! | `clusters/ball` f32 (c, 4), `clusters/parent`, `clusters/first`, `clusters/count` u32 (c), `clusters/members` u32 | middle and radius, the cluster above or `NONE`, a run of members |

use crate::render::resolve;
use crate::wavefront::Columns;
use crate::{Report, Solution, View, light_groups, smooth};
use isolux_core::DVec3;
use isolux_core::links::Hierarchy;
use isolux_core::scene::{Camera, Lamp, Projection, Scene};
use isolux_core::tree::ElementId;
use isolux_core::units::{Rgb, Unit};
use isolux_formats::write::{ToneMap, auto_exposure};
use isolux_wavefront::{NO_GROUP, mean_factor, mean_irradiance_in};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

const MAGIC: &[u8; 8] = b"isoluxvw";

/// Number of the layout.
const FORMAT: u32 = 1;

/// Marks an index that is not there.
const NONE: u32 = u32::MAX;

/// What is left out of large solutions, so that a page can hold them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewLimits {
    /// Most links: where there are more, none are there. Each takes 9 bytes.
    pub links: usize,
    /// Most bytes of fields, 60 for each leaf and light group: where they would be more, points are read off the mesh.
    pub field_bytes: usize,
    /// Is light shown by group, which may have to be made first? Else all of it is one column.
    pub groups: bool,
}

impl Default for ViewLimits {
    /// 4 million links, 256 MB of fields, and groups: what a browser takes without thinking.
    fn default() -> ViewLimits {
        ViewLimits { links: 4_000_000, field_bytes: 256 << 20, groups: true }
    }
}

/// The header, but for the arrays.
#[derive(Serialize)]
struct Header<'a> {
    /// Version of the program.
    version: &'static str,
    /// Name of the scene.
    name: &'a str,
    scene_hash: String,
    unit: Unit,
    /// Polygons before this one are fronts.
    fronts: usize,
    /// What positions in single precision are relative to.
    origin: [f64; 3],
    /// Lowest and highest corner.
    bounds: [[f64; 3]; 2],
    /// Factor on radiance that shows the scene at middle brightness.
    exposure: f64,
    /// Exposed luminance that is shown as white, see [`ToneMap::Reinhard`].
    white: f64,
    /// The columns of light.
    groups: Vec<HeaderGroup>,
    /// The scene's cameras, or a computed view where it has none: the first one is the view to begin with.
    cameras: Vec<HeaderCamera<'a>>,
    objects: Vec<&'a str>,
    materials: Vec<&'a str>,
    leaves: usize,
    /// What is not there, and why: `links`, `fields`.
    left_out: BTreeMap<&'static str, String>,
    report: &'a Report,
    arrays: BTreeMap<&'static str, HeaderArray>,
}

#[derive(Serialize)]
struct HeaderGroup {
    name: String,
    /// Emitted power with weight 1, W or lm.
    power: Rgb,
    /// Weight that it has in the solution.
    weight: Rgb,
    /// Its part of the mean irradiance over all fronts, with weight 1.
    mean_irradiance: Rgb,
}

#[derive(Serialize)]
struct HeaderCamera<'a> {
    name: &'a str,
    eye: [f64; 3],
    forward: [f64; 3],
    up: [f64; 3],
    /// Vertical opening, radians; none of a parallel projection.
    vertical_angle: Option<f64>,
    /// Height of a parallel projection's picture.
    height: Option<f64>,
}

impl HeaderCamera<'_> {
    fn of<'a>(camera: &Camera, name: &'a str) -> HeaderCamera<'a> {
        let (vertical_angle, height) = match camera.projection {
            Projection::Perspective { vertical_angle } => (Some(vertical_angle), None),
            Projection::Orthographic { height } => (None, Some(height)),
        };
        let Camera { eye, forward, up, .. } = camera;
        let [eye, forward, up] = [eye, forward, up].map(|vector| vector.to_array());
        HeaderCamera { name, eye, forward, up, vertical_angle, height }
    }
}

#[derive(Serialize)]
struct HeaderArray {
    r#type: &'static str,
    shape: Vec<usize>,
    offset: usize,
}

/// Arrays side by side.
#[derive(Default)]
struct Body {
    bytes: Vec<u8>,
    arrays: BTreeMap<&'static str, HeaderArray>,
}

/// A number as the body holds it.
trait Number: Copy {
    const NAME: &'static str;
    fn put(self, bytes: &mut Vec<u8>);
}

macro_rules! number {
    ($($type:ident)*) => {$(
        impl Number for $type {
            const NAME: &'static str = stringify!($type);

            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

number!(u8 u32 f32 f64);

impl Body {
    /// Adds an array; `columns` are the lengths of all axes but the first.
    fn add<T: Number>(&mut self, name: &'static str, columns: &[usize], values: impl IntoIterator<Item = T>) {
        let offset = self.bytes.len();
        values.into_iter().for_each(|value| value.put(&mut self.bytes));
        let rows = (self.bytes.len() - offset) / size_of::<T>() / columns.iter().product::<usize>();
        let shape = [&[rows], columns].concat();
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        self.arrays.insert(name, HeaderArray { r#type: T::NAME, shape, offset });
    }
}

/// Three bands in single precision.
fn bands(values: impl IntoIterator<Item = Rgb>) -> impl Iterator<Item = f32> {
    values.into_iter().flat_map(|value| value.0.map(|band| band as f32))
}

/// Columns of light as they are shown.
struct Shown {
    /// None: points are read off the mesh.
    columns: Option<Arc<Columns>>,
    names: Vec<String>,
    /// By polygon, [`NO_GROUP`] where nothing is dimmed.
    of: Vec<u32>,
    emission: Vec<Rgb>,
    weights: Vec<Rgb>,
    /// By column and vertex.
    vertices: Vec<Vec<Rgb>>,
}

impl Solution {
    /// What a viewer draws and tells, in the layout that `crates/isolux/src/view.rs` describes.
    #[must_use]
    pub fn view_data(&self, limits: &ViewLimits) -> Vec<u8> {
        let scene = &*self.scene;
        let Hierarchy { elements, light, .. } = &self.hierarchy;
        let shown = self.shown(limits.groups);
        let mesh = self.mesh();
        let (low, high) = bounds(scene);
        let origin = (low + high) * 0.5;
        let groups = shown.vertices.len();
        let leaves: Vec<ElementId> = elements.leaves().collect();
        let mut left_out = BTreeMap::new();

        let mut body = Body::default();
        let near = |point: &DVec3| (*point - origin).as_vec3().to_array();
        body.add("mesh/positions", &[3], mesh.positions.iter().flat_map(near));
        body.add("mesh/triangles", &[3], mesh.triangles.iter().flatten().copied());
        body.add("mesh/vertex_start", &[], mesh.vertex_start.iter().copied());
        body.add("mesh/triangle_start", &[], mesh.triangle_start.iter().copied());
        let vertices = mesh.positions.len();
        body.add("mesh/irradiance", &[vertices, 3], shown.vertices.iter().flat_map(|column| bands(column.clone())));

        let roots = &elements.as_slice()[..elements.roots()];
        let corners = roots.iter().flat_map(|root| {
            let last = root.corners[root.corners.len() - 1];
            (0..4).flat_map(move |k| root.corners.get(k).copied().unwrap_or(last).to_array())
        });
        body.add("roots/corners", &[4, 3], corners);
        body.add("roots/corner_count", &[], roots.iter().map(|root| root.corners.len() as u8));
        body.add("roots/polygon", &[], roots.iter().map(|root| root.polygon));
        body.add("elements/first_child", &[], elements.as_slice().iter().map(|element| element.first_child.0));
        let cuts = (0..elements.len() as u32).map(|id| elements.cut(ElementId(id)));
        body.add("elements/cut", &[], cuts.map(|cut| cut as u8));
        body.add("elements/open", &[], light.open_shares().iter().map(|&share| share as f32));

        let bytes = groups * leaves.len() * size_of::<[[f32; 3]; 5]>();
        let fields = shown.columns.as_ref().filter(|_| bytes <= limits.field_bytes);
        match fields {
            Some(columns) => {
                let values = columns.fields.iter().flatten().flatten().flatten().copied();
                body.add("elements/field", &[leaves.len(), 5, 3], values);
            }
            None => {
                if shown.columns.is_some() {
                    let most = limits.field_bytes;
                    let why =
                        format!("they take {bytes} bytes, more than {most}: values are read off the drawn surfaces");
                    left_out.insert("fields", why);
                }
                self.add_cells(&shown, &leaves, &mut body);
            }
        }
        add_polygons(scene, &shown, &mut body);
        add_points(&shown, &mut body);
        let count = self.link_count();
        if count <= limits.links {
            self.add_links(origin, &mut body);
        } else {
            left_out.insert("links", format!("there are {count}, more than {}", limits.links));
        }

        let own: Vec<HeaderCamera<'_>> =
            scene.cameras.iter().map(|camera| HeaderCamera::of(camera, &camera.name)).collect();
        let cameras = if own.is_empty() {
            resolve(self, &View::Default).iter().map(|camera| HeaderCamera::of(camera, "overview")).collect()
        } else {
            own
        };
        let ToneMap::Reinhard { white } = ToneMap::default() else { unreachable!("the usual tone map has a white") };
        let header = Header {
            version: crate::VERSION,
            name: &scene.name,
            scene_hash: scene.hash_text(),
            unit: scene.unit,
            fronts: scene.fronts,
            origin: origin.to_array(),
            bounds: [low.to_array(), high.to_array()],
            exposure: auto_exposure(mesh, scene),
            white,
            groups: self.header_groups(&shown, &leaves),
            cameras,
            objects: scene.objects.iter().map(|object| object.name.as_str()).collect(),
            materials: scene.materials.iter().map(|material| material.name.as_str()).collect(),
            leaves: leaves.len(),
            left_out,
            report: &self.report,
            arrays: body.arrays,
        };
        pack(&header, &body.bytes)
    }

    /// The light by groups where that is asked for and can be had, else all of it as one column. Makes the mesh where it is not
    /// there yet.
    fn shown(&self, by_groups: bool) -> Shown {
        let scene = &*self.scene;
        let Hierarchy { elements, light, .. } = &self.hierarchy;
        let transport = self.transport.as_ref().filter(|_| by_groups);
        let columns = transport.and_then(|transport| Some((transport, self.columns().ok()?)));
        let Some((transport, columns)) = columns else {
            // What emits is dimmed as one.
            let of = scene.polygons.iter().map(|polygon| if polygon.emission == Rgb::ZERO { NO_GROUP } else { 0 });
            let names = light_groups(scene).groups.into_iter().map(|group| group.name);
            let names: Vec<String> = names.collect();
            return Shown {
                columns: self.transport.as_ref().map(|transport| {
                    let fields = elements.leaves().map(|leaf| transport.fields[leaf.index()]).collect();
                    Arc::new(Columns { fields: vec![fields], ..Columns::default() })
                }),
                names: vec![if let [name] = &names[..] { name.clone() } else { crate::ALL.to_owned() }],
                of: of.collect(),
                emission: scene.polygons.iter().map(|polygon| polygon.emission).collect(),
                weights: vec![Rgb::ONE],
                vertices: vec![self.mesh().irradiance.clone()],
            };
        };
        let made = smooth::blend_columns(scene, self.tracer(), elements, light, &transport.fields, &columns.fields);
        // An observer that never says stop lets everything through.
        let (surfaces, vertices) = made.unwrap_or_default();
        // What was made before is the same.
        let _ = self.surfaces.set(surfaces);
        let relit = self.report.relit.as_ref().map_or(&[][..], |relit| &relit.weights);
        Shown {
            names: columns.names.clone(),
            of: columns.of.clone(),
            emission: columns.emission.clone(),
            weights: (0..columns.names.len()).map(|row| relit.get(row).map_or(Rgb::ONE, |told| told.weight)).collect(),
            vertices,
            columns: Some(columns),
        }
    }

    fn header_groups(&self, shown: &Shown, leaves: &[ElementId]) -> Vec<HeaderGroup> {
        let scene = &*self.scene;
        let Hierarchy { elements, light, .. } = &self.hierarchy;
        let fronts = |leaf: &ElementId| (elements.get(*leaf).polygon as usize) < scene.fronts;
        let mean = |column: usize| {
            let Some(columns) = &shown.columns else { return self.report.mean_irradiance };
            let own = leaves.iter().zip(&columns.fields[column]).filter(|(leaf, _)| fronts(leaf));
            let sum: Rgb = own
                .map(|(&leaf, field)| {
                    let element = elements.get(leaf);
                    mean_irradiance_in(&element.corners, field) * (element.area * light.open_share(leaf))
                })
                .sum();
            sum / scene.area()
        };
        let power = |column: u32| {
            let own = scene.polygons.iter().zip(&shown.emission).zip(&shown.of).filter(|(_, of)| **of == column);
            let of_surfaces: Rgb = own.map(|((polygon, &emission), _)| emission * polygon.area).sum();
            let lamps = scene.lamps.iter().zip(shown.emission.iter().zip(&shown.of).skip(scene.polygons.len()));
            let own = lamps.filter(|(_, (_, of))| **of == column);
            // Parallel light has none.
            let powers = own.filter_map(|(lamp, (&intensity, _))| Lamp { intensity, ..lamp.clone() }.power());
            of_surfaces + powers.sum()
        };
        let group = |(row, name): (usize, &String)| HeaderGroup {
            name: name.clone(),
            power: power(row as u32),
            weight: shown.weights[row],
            mean_irradiance: mean(row),
        };
        shown.names.iter().enumerate().map(group).collect()
    }

    /// What points are read off where there are no fields.
    fn add_cells(&self, shown: &Shown, leaves: &[ElementId], body: &mut Body) {
        let triangles = self.mesh().triangles.len();
        let (mut leaf, mut bilinear) = (vec![NONE; triangles], vec![0_u8; triangles]);
        for (element, range, is_bilinear) in self.surfaces().cells() {
            for (k, triangle) in range.enumerate() {
                leaf[triangle as usize] = element.0;
                bilinear[triangle as usize] = if is_bilinear { k as u8 + 1 } else { 0 };
            }
        }
        body.add("mesh/leaf", &[], leaf);
        body.add("mesh/bilinear", &[], bilinear);
        let Hierarchy { elements, light, .. } = &self.hierarchy;
        let means: Vec<Rgb> = match &shown.columns {
            Some(columns) => {
                let all = columns.fields.iter().flat_map(|column| leaves.iter().zip(column));
                all.map(|(&leaf, field)| mean_irradiance_in(&elements.get(leaf).corners, field)).collect()
            }
            None => leaves
                .iter()
                .map(|&leaf| match light.open_share(leaf) {
                    0.0 => Rgb::ZERO,
                    open => light.irradiance(leaf) / open,
                })
                .collect(),
        };
        body.add("elements/mean", &[leaves.len(), 3], bands(means));
    }

    fn link_count(&self) -> usize {
        self.transport.as_ref().map_or(self.hierarchy.links.len(), |transport| transport.links.receiver.len())
    }

    fn add_links(&self, origin: DVec3, body: &mut Body) {
        let Hierarchy { elements, links, .. } = &self.hierarchy;
        let Some(transport) = &self.transport else {
            body.add("links/start", &[], starts(elements.len(), links.iter().map(|(receiver, _)| receiver.0)));
            let own = || links.iter().map(|(_, link)| link);
            let visibility = |link: &isolux_core::links::Link| link.visibility().unwrap_or(0.0);
            body.add("links/source", &[], own().map(|link| link.source.0));
            body.add("links/factor", &[], own().map(|link| (link.form_factor * visibility(link)) as f32));
            body.add("links/visibility", &[], own().map(|link| (visibility(link) * 255.0).round() as u8));
            return;
        };
        let (links, clusters) = (&transport.links, &transport.clusters);
        let nodes = elements.len() + clusters.parent.len();
        let corners = |node: u32| elements.as_slice().get(node as usize).map(|element| &element.corners);
        let factors = links.receiver.iter().zip(&links.factors);
        body.add("links/start", &[], starts(nodes, links.receiver.iter().copied()));
        body.add("links/source", &[], links.source.iter().copied());
        body.add("links/factor", &[], factors.map(|(&receiver, factors)| mean_factor(corners(receiver), factors)));
        body.add("links/visibility", &[], links.visibility.iter().map(|visibility| (visibility * 255.0).round() as u8));
        let balls = clusters.centre.iter().zip(&clusters.radius).flat_map(|(centre, &radius)| {
            let [x, y, z] = (DVec3::from_array(*centre) - origin).as_vec3().to_array();
            [x, y, z, radius]
        });
        body.add("clusters/ball", &[4], balls);
        body.add("clusters/parent", &[], clusters.parent.iter().copied());
        body.add("clusters/first", &[], clusters.first.iter().copied());
        body.add("clusters/count", &[], clusters.count.iter().copied());
        body.add("clusters/members", &[], clusters.members.iter().copied());
    }
}

/// What tells the error of a mix; nothing where groups were not checked.
fn add_points(shown: &Shown, body: &mut Body) {
    let Some(points) = shown.columns.as_ref().map(|columns| &columns.points) else { return };
    body.add("points/irradiance", &[3], points.irradiance.iter().flatten().flatten().copied());
    body.add("points/error", &[6], points.errors.iter().flatten().flatten().flatten().copied());
}

fn add_polygons(scene: &Scene, shown: &Shown, body: &mut Body) {
    let polygons = &scene.polygons;
    body.add("polygons/normal", &[3], polygons.iter().flat_map(|polygon| polygon.plane.normal.to_array()));
    body.add("polygons/reflectance", &[3], bands(polygons.iter().map(|polygon| polygon.reflectance)));
    body.add("polygons/emission", &[3], bands(shown.emission.iter().take(polygons.len()).copied()));
    body.add("polygons/opacity", &[], polygons.iter().map(|polygon| polygon.opacity as f32));
    let groups = shown.of.iter().take(polygons.len());
    body.add("polygons/group", &[], groups.map(|&group| if group == NO_GROUP { NONE } else { group }));
    body.add("polygons/object", &[], polygons.iter().map(|polygon| polygon.object));
    body.add("polygons/material", &[], polygons.iter().map(|polygon| polygon.material));
    body.add("polygons/twin", &[], polygons.iter().map(|polygon| polygon.twin.unwrap_or(NONE)));
    body.add("polygons/faces", &[2], polygons.iter().flat_map(|polygon| polygon.faces));
}

/// Where the links of each of so many nodes begin, and where the last ones end; `receivers` ascend.
fn starts(nodes: usize, receivers: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut starts = vec![0_u32; nodes + 1];
    receivers.for_each(|receiver| starts[receiver as usize + 1] += 1);
    for node in 0..nodes {
        starts[node + 1] += starts[node];
    }
    starts
}

/// Lowest and highest corner of all surfaces, metres.
fn bounds(scene: &Scene) -> (DVec3, DVec3) {
    let corners = || scene.polygons.iter().flat_map(|polygon| polygon.corners.iter().copied());
    (corners().fold(DVec3::INFINITY, DVec3::min), corners().fold(DVec3::NEG_INFINITY, DVec3::max))
}

fn pack(header: &Header<'_>, body: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(header).unwrap_or_else(|error| {
        // Only maps with keys that are not strings can fail, and there are none.
        unreachable!("headers are plain data: {error}")
    });
    text.resize(text.len().next_multiple_of(8), b' ');
    let mut bytes = Vec::with_capacity(16 + text.len() + body.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&(text.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&FORMAT.to_le_bytes());
    bytes.extend_from_slice(&text);
    bytes.extend_from_slice(body);
    bytes
}
