//! A solve from what it left behind: elements, links, clusters and fields by number go in, a solve that can gather over its
//! links again comes out. No ray is traced for a link; some are to lamps without a
//! surface, and to tell which leaves are covered and which are closed in.

use crate::clusters::{Cluster, Clusters};
use crate::contacts::{Contacts, mark, split};
use crate::control::Control;
use crate::geometry::{Element, Geometry, NONE};
use crate::ideas::Ideas;
use crate::lamps::{ALL_ONLY, lit_leaves};
use crate::light::{Light, add};
use crate::link::{CLUSTER, Link, State};
use crate::order::Order;
use crate::outcome::{ClusterColumns, LinkColumns};
use crate::rounds::Transport;
use crate::rows::Closed;
use crate::sky::Known;
use crate::solve::{Before, Solved, settle};
use glam::{DVec3, Vec3};
use isolux_core::scene::Scene;
use isolux_core::tree::{ElementId, Elements};
use std::sync::Arc;

/// What a solve left behind; all of it must fit together, see [`crate::Outcome`].
#[derive(Clone, Copy, Debug)]
pub struct Remains<'a> {
    /// All quadtrees.
    pub elements: &'a Elements,
    /// Shares of the elements that nothing covers.
    pub open_shares: &'a [f64],
    /// Irradiance of leaves.
    pub fields: &'a [[[f32; 3]; 5]],
    /// What the sky and the ground throw on leaves, as [`crate::Outcome::sky`]; nothing without a sky.
    pub sky: &'a [[[f32; 2]; 5]],
    /// Links.
    pub links: &'a LinkColumns,
    /// Clusters.
    pub clusters: &'a ClusterColumns,
    /// [`crate::Outcome::limit`].
    pub limit: f32,
}

impl Solved {
    /// What a solve of the same polygons left behind, with the reflectances and emissions that `scene` has now.
    #[must_use]
    pub fn reopened(scene: Arc<Scene>, remains: &Remains<'_>) -> Solved {
        let mut geometry = Geometry::new(scene.clone());
        let mut roots = geometry.bare_roots();
        let clusters = clusters_of(remains.clusters, &roots, geometry.middle);
        geometry.contacts = Contacts::new(&geometry, &clusters, &roots);
        mark(&mut roots, &geometry, true);
        roots.iter_mut().for_each(|root| root.cut = root.compact_cut());
        let marked = quartered(roots, remains.elements, &geometry);
        let plain = |(element, share): (&Element, &f64)| {
            // What counts of a leaf is how many of its sixteen parts are open.
            let parts = (share * 16.0).round().clamp(0.0, 16.0) as u32;
            let open = if element.first_child == NONE { ((1_u32 << parts) - 1) as u16 } else { u16::MAX };
            Element { open, crossed: false, lined: 0, divided: false, ..*element }
        };
        let elements: Vec<Element> = marked.iter().zip(remains.open_shares).map(plain).collect();
        let count = elements.len() as u32;
        let links = links_of(remains.links, count);
        let order = Order::new(&elements, geometry.surfaces.len());
        let mut light = Light::even([0.0; 3], &geometry, &clusters, &elements);
        light.field = remains.fields.to_vec();
        light.pull(&geometry, &clusters, &elements, &order);
        // Lines of contact are looked at as they were.
        let closed = Closed::new(&marked, &links, &geometry, &clusters);
        let geometry = Arc::new(geometry);
        let transport = Transport {
            geometry: geometry.clone(),
            clusters: Arc::new(clusters),
            elements,
            order,
            links,
            dark: Vec::new(),
            alone: Vec::new(),
            closed,
            seed: 0,
            ideas: Ideas::default(),
            evaluated: 0,
            packets: 0,
        };
        if geometry.scene.has_remote_light() {
            light.expect_lamps(geometry.dome.is_some());
            // Fields of a file have lamps' light in them, and the sky's.
            if !geometry.scene.lamps.is_empty() {
                light.lit = lit_leaves(&transport, &vec![ALL_ONLY; geometry.scene.lamps.len()]);
            }
            light.lit_error.fill(0.0);
            if let Some(dome) = &geometry.dome {
                light.sky = remains.sky.to_vec();
                light.sky_known.fill(Known { own: true, ..Known::default() });
                for (lit, sky) in light.lit.iter_mut().zip(&light.sky) {
                    add(lit, &dome.field(sky));
                }
            }
        }
        let is_leaf = |&index: &usize| transport.elements[index].first_child == NONE;
        let indices = (0..remains.fields.len()).filter(is_leaf);
        let leaves = indices.map(|index| (index as u32, light.without_lamps(index))).collect();
        light.correct(leaves, &transport.links, &transport.evaluator());
        Solved { geometry, transport, light, stages: Vec::new(), estimate: None, bound: None, limit: remains.limit }
    }

    /// Gathers anew over the links that are there until the light changes by less than a share of `error`, or is asked to
    /// stop.
    #[must_use]
    pub fn regathered(mut self, error: f64, control: &Control) -> Solved {
        let Solved { transport, light, geometry, limit, .. } = &mut self;
        light.settle(&transport.links, *limit, &transport.evaluator());
        settle(light, transport, *limit, geometry.scene.area(), error, Before::Unknown, control);
        self
    }
}

/// The quadtrees of a solve over these roots: parts are appended in the order of their numbers.
fn quartered(roots: Vec<Element>, wanted: &Elements, geometry: &Geometry) -> Vec<Element> {
    let parents = wanted.as_slice().iter().enumerate();
    let mut parents: Vec<(u32, u32)> = parents
        .filter_map(|(index, element)| element.first_child.some().map(|first| (first.0, index as u32)))
        .collect();
    parents.sort_unstable();
    let (mut elements, mut rest) = (roots, &parents[..]);
    while !rest.is_empty() {
        // As many as are there.
        let there = rest.iter().take_while(|(_, parent)| (*parent as usize) < elements.len()).count().max(1);
        for &(_, parent) in &rest[..there] {
            elements[parent as usize].cut = wanted.cut(ElementId(parent));
        }
        split(&mut elements, rest[..there].iter().map(|&(_, parent)| parent), geometry);
        rest = &rest[there..];
    }
    elements
}

fn clusters_of(columns: &ClusterColumns, roots: &[Element], middle: DVec3) -> Clusters {
    let count = columns.parent.len();
    let mut nodes: Vec<Cluster> = (0..count)
        .map(|index| {
            let centre = (DVec3::from_array(columns.centre[index]) - middle).as_vec3();
            let half = Vec3::splat(columns.radius[index]);
            Cluster {
                low: centre - half,
                high: centre + half,
                centre,
                radius: columns.radius[index],
                area: columns.area[index],
                first: columns.first[index],
                count: columns.count[index],
                parent: columns.parent[index],
                second: 0,
            }
        })
        .collect();
    // The first child comes directly after its parent, the other one is the second.
    for index in 1..count {
        let parent = columns.parent[index] as usize;
        if parent + 1 != index {
            nodes[parent].second = index as u32;
        }
    }
    Clusters::from_parts(nodes, columns.members.clone(), roots)
}

fn links_of(columns: &LinkColumns, elements: u32) -> Vec<Link> {
    let node = |number: u32| if number < elements { number } else { (number - elements) | CLUSTER };
    let mut links: Vec<Link> = (0..columns.receiver.len())
        .map(|index| {
            let visibility = (columns.visibility[index] * 255.0).round() as u8;
            let flags = if columns.proven[index] == 1 { State::CLEAR } else { 0 };
            let spread = u8::from(columns.whole[index] == 0);
            Link {
                receiver: node(columns.receiver[index]),
                source: node(columns.source[index]),
                factors: columns.factors[index],
                state: State::new(visibility, spread, 0, flags, columns.centre[index]),
            }
        })
        .collect();
    links.sort_by_key(|link| (link.receiver & CLUSTER == 0, link.receiver));
    links
}
