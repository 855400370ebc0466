//! The invariants of a BSP tree, checked: a tree and its scene go in, the first violation comes out.

use super::Bsp;
use crate::scene::Scene;
use thiserror::Error;

/// A broken invariant of a BSP tree.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("BSP node {node}, polygon {polygon}: violated: {what}")]
pub struct BspViolation {
    /// Where.
    pub node: u32,
    /// Which polygon is concerned.
    pub polygon: u32,
    /// Which invariant.
    pub what: &'static str,
}

pub(super) fn check(bsp: &Bsp, scene: &Scene) -> Result<(), BspViolation> {
    // New corners are rounded to about 1e-16 of the diameter, 1e-10 of the tolerance: a thousandth is ample.
    let tolerance = bsp.tolerance() * 1.001;
    let nodes = bsp.nodes();
    // Parent and side of every node.
    let mut above: Vec<Option<(u32, bool)>> = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        let fail = |what| {
            let polygon = bsp.fragments().get(node.first_fragment as usize).map_or(u32::MAX, |first| first.polygon);
            Err(BspViolation { node: index as u32, polygon, what })
        };
        if node.first_fragment == Bsp::NONE {
            return fail("every node holds a fragment");
        }
        if index > 0 && above[index].is_none() {
            return fail("every node but the first has a parent before it");
        }
        for (child, front) in [(node.front, true), (node.back, false)] {
            if child == Bsp::NONE {
                continue;
            }
            if child as usize >= nodes.len() || child as usize <= index || above[child as usize].is_some() {
                return fail("children come after their parents and have one");
            }
            above[child as usize] = Some((index as u32, front));
        }
    }
    let mut listed = 0;
    for node in 0..nodes.len() as u32 {
        for fragment in bsp.fragments_of(node) {
            let fragment = &bsp.fragments()[fragment as usize];
            listed += 1;
            let fail = |what| Err(BspViolation { node, polygon: fragment.polygon, what });
            if fragment.node != node {
                return fail("fragments know their node");
            }
            let plane = &nodes[node as usize].plane;
            if fragment.corners.iter().any(|&corner| plane.distance(corner).abs() > tolerance) {
                return fail("fragments lie in their node's plane");
            }
            let mut at = node;
            while let Some((parent, front)) = above[at as usize] {
                let side = if front { 1.0 } else { -1.0 };
                let plane = &nodes[parent as usize].plane;
                if fragment.corners.iter().any(|&corner| side * plane.distance(corner) < -tolerance) {
                    return fail("a subtree lies on its side of the plane");
                }
                let outer = &nodes[parent as usize];
                let inside =
                    |corner: &glam::DVec3| (0..3).all(|k| outer.lower[k] < corner[k] && corner[k] < outer.upper[k]);
                if !fragment.corners.iter().all(inside) {
                    return fail("a subtree lies in its box");
                }
                at = parent;
            }
        }
    }
    if listed != bsp.fragments().len() {
        return Err(BspViolation { node: 0, polygon: u32::MAX, what: "every fragment is listed by one node" });
    }
    let mut area = vec![0.0; scene.fronts];
    for fragment in bsp.fragments() {
        area[fragment.polygon as usize] += fragment.corners.area();
    }
    for (polygon, &sum) in area.iter().enumerate() {
        let expected = scene.polygons[polygon].corners.area();
        // Rounding of cut corners, 1e-16 of the diameter each, over edges of the diameter's length: 1e-12 is a
        // thousand cuts' worth.
        let slack = 1e-9 * expected + 1e-12 * scene.diameter * scene.diameter;
        if sum != 0.0 && (sum - expected).abs() > slack {
            let node = bsp.fragments().iter().find(|fragment| fragment.polygon as usize == polygon);
            return Err(BspViolation {
                node: node.map_or(0, |fragment| fragment.node),
                polygon: polygon as u32,
                what: "the areas of a polygon's fragments add up",
            });
        }
    }
    Ok(())
}
