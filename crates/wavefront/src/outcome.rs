//! What a solve leaves behind, in the terms of the rest of the system: quadtrees, light, links and clusters by number.

use crate::geometry::{Geometry, NONE, lean};
use crate::leaves::is_whole;
use crate::light::{self, Field, leaned};
use crate::link::{CLUSTER, State};
use crate::rounds::Transport;
use crate::solve::{Estimate, Solved, Stage};
use isolux_core::DVec3;
use isolux_core::scene::{Corners, Scene};
use isolux_core::solution::{Light, Update};
use isolux_core::tree::{ElementId, Elements};
use isolux_core::units::Rgb;
use rayon::prelude::*;

/// Links as columns, sorted by receiver.
///
/// Nodes are numbered elements first, then clusters: node `elements + c` is cluster `c`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkColumns {
    /// Where light arrives.
    pub receiver: Vec<u32>,
    /// Where it comes from.
    pub source: Vec<u32>,
    /// At five points of the receiver, 0.6 of the way from its middle to its corners (the last of a triangle means nothing)
    /// and at its middle: what arrives for each unit of the source, visibility included. Of an element that is a form
    /// factor; of a cluster, steradian per square metre.
    pub factors: Vec<[f32; 5]>,
    /// Mean visibility, 0 to 1, in steps of 1/255.
    pub visibility: Vec<f32>,
    /// 1 where it is proven that nothing stands between, 0 where rays say what there is.
    pub proven: Vec<u8>,
    /// Where on the source the light comes from, on average: `(s, t)` in [0, 1]² of a quadrilateral's bilinear map, weights
    /// of the second and third corner of a triangle.
    pub centre: Vec<[f32; 2]>,
    /// 1 where all of the receiver's points see all of the source, 0 where some of it is, or may be, hidden.
    pub whole: Vec<u8>,
}

/// The hierarchy above polygons, as columns. Parents come before their children.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClusterColumns {
    /// Middle of the members by area, metres, in the scene's coordinates.
    pub centre: Vec<[f64; 3]>,
    /// Radius about the middle that holds all members, metres.
    pub radius: Vec<f32>,
    /// Sum of the members' areas, m².
    pub area: Vec<f32>,
    /// First member, an index into `members`.
    pub first: Vec<u32>,
    /// Number of members.
    pub count: Vec<u32>,
    /// Parent, or `u32::MAX` for the first.
    pub parent: Vec<u32>,
    /// Polygons, those of each cluster side by side.
    pub members: Vec<u32>,
}

/// A finished solve.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// All quadtrees: every polygon of the scene is a root, in order.
    pub elements: Elements,
    /// Means by element, with the share of each that nothing covers.
    pub light: Light,
    /// Irradiance at the corners and the middle of leaves; of inner elements nothing that counts.
    pub fields: Vec<Field>,
    /// What sky and ground throw on leaves, at the corners and the middle: of the sky's pattern and of the ground's radiance, sr; of
    /// inner elements nothing that counts. Empty where there is no sky.
    pub sky: Vec<Field<2>>,
    /// Links that carry light.
    pub links: LinkColumns,
    /// Clusters.
    pub clusters: ClusterColumns,
    /// Area times squared error that one source may leave on a leaf, m² (W/m²)² or m² (lm/m²)²: where more is at stake,
    /// leaves look at sources part by part.
    pub limit: f32,
}

impl Solved {
    /// Irradiance at the corners and the middle of leaves; of inner elements nothing that counts.
    #[must_use]
    pub fn fields(&self) -> &[Field] {
        &self.light.field
    }

    /// Everything by number.
    #[must_use]
    pub fn outcome(&self, scene: &Scene) -> Outcome {
        let Solved { geometry, transport, light, limit, .. } = self;
        Standing { geometry, transport, light, stages: &self.stages, estimate: self.estimate, limit: *limit }
            .outcome(scene)
    }
}

/// What stands at the end of a stage, for whoever watches a solve that goes on.
pub struct Standing<'a> {
    pub(crate) geometry: &'a Geometry,
    pub(crate) transport: &'a Transport,
    pub(crate) light: &'a light::Light,
    pub(crate) limit: f32,
    /// The stages so far.
    pub stages: &'a [Stage],
    /// How wrong it may be; none where rays were not asked yet.
    pub estimate: Option<Estimate>,
}

impl Standing<'_> {
    /// A copy of everything by number: what the solve would leave behind if it ended here.
    #[must_use]
    pub fn outcome(&self, scene: &Scene) -> Outcome {
        let own = &self.transport.elements;
        let planes = scene.polygons.iter().map(|polygon| polygon.plane).collect();
        let roots = scene.polygons.iter().enumerate().map(|(index, polygon)| (polygon.corners, index as u32));
        let mut elements = Elements::new(roots, planes);
        // Splits in the order of the numbers of the first children give every child the number that it has here.
        let mut parents: Vec<(u32, u32)> = own
            .iter()
            .enumerate()
            .filter(|(_, element)| element.first_child != NONE)
            .map(|(index, element)| (element.first_child, index as u32))
            .collect();
        parents.sort_unstable();
        for (_, parent) in parents {
            elements.split_as(ElementId(parent), own[parent as usize].cut);
        }
        let count = own.len() as u32;
        let node = |number: u32| if number & CLUSTER == 0 { number } else { count + (number & !CLUSTER) };
        let links = &self.transport.links;
        let columns = LinkColumns {
            receiver: links.iter().map(|link| node(link.receiver)).collect(),
            source: links.iter().map(|link| node(link.source)).collect(),
            factors: links.iter().map(|link| link.factors).collect(),
            visibility: links.iter().map(|link| f32::from(link.state.visibility) / 255.0).collect(),
            proven: links.iter().map(|link| u8::from(link.state.is(State::CLEAR))).collect(),
            centre: links.iter().map(|link| link.state.centre()).collect(),
            whole: links.iter().map(|link| u8::from(is_whole(link.state))).collect(),
        };
        let nodes = &self.transport.clusters.nodes;
        let clusters = ClusterColumns {
            centre: nodes.iter().map(|node| (node.centre.as_dvec3() + self.geometry.middle).to_array()).collect(),
            radius: nodes.iter().map(|node| node.radius).collect(),
            area: nodes.iter().map(|node| node.area).collect(),
            first: nodes.iter().map(|node| node.first).collect(),
            count: nodes.iter().map(|node| node.count).collect(),
            parent: nodes.iter().map(|node| node.parent).collect(),
            members: self.transport.clusters.order.clone(),
        };
        let fields = self.light.field.clone();
        let open = own.iter().map(|element| f64::from(element.open_share())).collect();
        let light = light_of(scene, &elements, &fields, open);
        let sky = self.light.sky.clone();
        Outcome { elements, light, fields, sky, links: columns, clusters, limit: self.limit }
    }
}

/// Means by element from the fields of leaves: irradiance where it is above nothing, and what follows from it. In double
/// precision, so that what follows from other values follows to the last bit. `open_shares`: of leaves.
#[must_use]
pub fn light_of(scene: &Scene, elements: &Elements, fields: &[Field], open_shares: Vec<f64>) -> Light {
    let means: Vec<Rgb> = elements
        .as_slice()
        .par_iter()
        .zip(fields)
        .with_min_len(1024)
        .map(|(element, field)| mean_irradiance_in(&element.corners, field))
        .collect();
    let mut light = Light::emitted(scene, elements, open_shares, Update::InPlace);
    for (index, element) in elements.as_slice().iter().enumerate().rev() {
        let id = ElementId(index as u32);
        if elements.is_leaf(id) {
            light.settle(id, &scene.polygons[element.polygon as usize], means[index]);
        } else {
            light.pull(id, elements);
        }
    }
    light
}

/// Irradiance at a point of a polygon from the fields of its leaves, W/m² or lm/m².
#[must_use]
pub fn irradiance_at(elements: &Elements, fields: &[Field], polygon: u32, normal: DVec3, point: DVec3) -> Rgb {
    let leaf = elements.locate(ElementId(polygon), point);
    irradiance_in(&elements.get(leaf).corners, normal, point, &fields[leaf.index()])
}

/// Irradiance at a point of a leaf from its field, W/m² or lm/m².
#[must_use]
pub fn irradiance_in(corners: &Corners, normal: DVec3, point: DVec3, field: &Field) -> Rgb {
    Rgb(crate::read::within(corners, normal, point, field).map(f64::from))
}

/// The same before it is cut off at nothing, so that parts of the light add up: W/m² or lm/m², and below 0 where a part of a
/// field is.
#[must_use]
pub fn signed_irradiance_in(corners: &Corners, normal: DVec3, point: DVec3, field: &Field) -> Rgb {
    Rgb(crate::read::signed_within(corners, normal, point, field))
}

/// Mean irradiance over a leaf, from its corners and its field, W/m² or lm/m²; not below 0.
#[must_use]
pub fn mean_irradiance_in(corners: &Corners, field: &Field) -> Rgb {
    Rgb(leaned(field, corners.len() as u8, lean_of(corners)).map(|value| f64::from(value.max(0.0))))
}

/// Mean of a link's factors over a receiver with these corners; of a cluster, which has none, the one that it has.
#[must_use]
pub fn mean_factor(corners: Option<&Corners>, factors: &[f32; 5]) -> f32 {
    corners.map_or(factors[0], |corners| crate::field::mean_over(factors, corners.len() as u8, lean_of(corners)))
}

fn lean_of(corners: &Corners) -> [f32; 2] {
    if corners.len() == 4 { lean(std::array::from_fn(|k| (corners[k] - corners[0]).as_vec3())) } else { [0.0; 2] }
}
