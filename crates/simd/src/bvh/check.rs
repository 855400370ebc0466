//! A hierarchy and the primitives it was built of in, the first broken invariant out.

use super::node::{Block, LEAF, NONE, Node, is_surface};
use super::{Bvh8, Primitive};

/// Checks that a hierarchy is well-formed; the message names the invariant and the place where it is broken.
///
/// - Every node but the first, and every block, is the child of exactly one node, which stands before it.
/// - Children come first in a node, primitives first in a block; places without one hold an empty box, a zero normal.
/// - A block holds 1 to 8 primitives, as many as its parent says; those that are opaque are marked so.
/// - Every primitive with an area stands in exactly one lane, where `places` says; no other is in the hierarchy.
/// - A child's box holds the boxes of its children, a block's box and the primitive's own its corners.
/// - `bounds` is the box of all primitives, `scale` the largest magnitude in it.
///
/// # Errors
/// The message.
pub fn check(bvh: &Bvh8, primitives: &[Primitive]) -> Result<(), String> {
    if bvh.places.len() != primitives.len() {
        return Err(format!("{} places for {} primitives", bvh.places.len(), primitives.len()));
    }
    let mut node_parents = vec![0_u32; bvh.nodes.len()];
    let mut block_parents = vec![0_u32; bvh.blocks.len()];
    let mut seen = vec![false; primitives.len()];
    let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (at, node) in bvh.nodes.iter().enumerate() {
        let count = node.children.iter().take_while(|&&child| child != NONE).count();
        if count == 0 {
            return Err(format!("node {at} has no child"));
        }
        if node.present != (1 << count) - 1 {
            return Err(format!("node {at}: {count} children, bits {:b}", node.present));
        }
        for k in count..8 {
            if !same_child(node, k, &Node::EMPTY) {
                return Err(format!("node {at}: place {k} after the last child is not empty"));
            }
        }
        for k in 0..count {
            let child = node.children[k];
            let inside = |point: [f32; 3]| {
                (0..3).all(|axis| node.planes[axis][k] < point[axis] && point[axis] < node.planes[axis + 3][k])
            };
            if child & LEAF == 0 {
                let Some(below) = bvh.nodes.get(child as usize).filter(|_| child as usize > at) else {
                    return Err(format!("node {at}: child {k} is node {child}"));
                };
                node_parents[child as usize] += 1;
                for m in (0..8).filter(|&m| below.children[m] != NONE) {
                    let holds = (0..3).all(|axis| {
                        node.planes[axis][k] <= below.planes[axis][m]
                            && below.planes[axis + 3][m] <= node.planes[axis + 3][k]
                    });
                    if !holds {
                        return Err(format!("node {at}: child {k} does not hold child {m} of its own"));
                    }
                }
                continue;
            }
            let index = (child & !LEAF) as usize;
            let Some(block) = bvh.blocks.get(index) else {
                return Err(format!("node {at}: child {k} is block {index} of {}", bvh.blocks.len()));
            };
            block_parents[index] += 1;
            let held = usize::from(node.counts[k]);
            if held == 0 || held > 8 {
                return Err(format!("node {at}: child {k} is a block of {held} primitives"));
            }
            for lane in 0..8 {
                let id = block.ids[lane];
                if lane >= held {
                    let zero = (0..3).all(|axis| block.normal[axis][lane] == 0.0);
                    if id != NONE || !zero || node.opaque[k] >> lane & 1 != 0 {
                        return Err(format!("block {index}: lane {lane} after the last primitive is not empty"));
                    }
                    continue;
                }
                let Some(primitive) = primitives.get(id as usize) else {
                    return Err(format!("block {index}: lane {lane} names primitive {id}"));
                };
                let expected = (index * 8 + lane) as u32 | u32::from(!primitive.opaque) << 31;
                if bvh.places[id as usize] != expected || std::mem::replace(&mut seen[id as usize], true) {
                    return Err(format!("primitive {id} is in block {index}, lane {lane}, and elsewhere"));
                }
                if primitive.opaque != (node.opaque[k] >> lane & 1 != 0) {
                    return Err(format!("block {index}: lane {lane} is marked as what it is not"));
                }
                let mut alone = Block::EMPTY;
                alone.set(lane, id, primitive);
                if !same_lane(block, &alone, lane) {
                    return Err(format!("block {index}: lane {lane} is not primitive {id}"));
                }
                for corner in corners(primitive) {
                    let own = (0..3).all(|axis| {
                        block.planes[axis][lane] < corner[axis] && corner[axis] < block.planes[axis + 3][lane]
                    });
                    if !inside(corner) || !own {
                        return Err(format!("primitive {id} is not in its box"));
                    }
                    for axis in 0..3 {
                        lo[axis] = lo[axis].min(corner[axis]);
                        hi[axis] = hi[axis].max(corner[axis]);
                    }
                }
            }
        }
    }
    if let Some(at) = (1..bvh.nodes.len()).find(|&at| node_parents[at] != 1) {
        return Err(format!("node {at} has {} parents", node_parents[at]));
    }
    if let Some(at) = (0..bvh.blocks.len()).find(|&at| block_parents[at] != 1) {
        return Err(format!("block {at} has {} parents", block_parents[at]));
    }
    for (id, primitive) in primitives.iter().enumerate() {
        let wanted = is_surface(primitive) && corners(primitive).iter().flatten().all(|x| x.is_finite());
        if seen[id] != wanted || !wanted && bvh.places[id] != u32::MAX {
            return Err(format!("primitive {id}: in the hierarchy {}, a surface {wanted}", seen[id]));
        }
    }
    if !bvh.nodes.is_empty() {
        let scale = lo.iter().chain(&hi).fold(0.0_f32, |scale, x| scale.max(x.abs()));
        if (bvh.lo, bvh.hi, bvh.scale) != (lo, hi, scale) {
            return Err(format!("bounds {:?} instead of {:?}", (bvh.lo, bvh.hi, bvh.scale), (lo, hi, scale)));
        }
    }
    Ok(())
}

fn corners(primitive: &Primitive) -> Vec<[f32; 3]> {
    let at = |s: f32, t: f32| -> [f32; 3] {
        std::array::from_fn(|axis| primitive.origin[axis] + s * primitive.u[axis] + t * primitive.v[axis])
    };
    let mut corners = vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)];
    if primitive.parallelogram {
        corners.push(at(1.0, 1.0));
    }
    corners
}

fn same_child(node: &Node, k: usize, other: &Node) -> bool {
    let same_planes = (0..6).all(|plane| node.planes[plane][k] == other.planes[plane][k]);
    same_planes
        && node.children[k] == other.children[k]
        && node.counts[k] == other.counts[k]
        && node.opaque[k] == other.opaque[k]
}

fn same_lane(block: &Block, other: &Block, lane: usize) -> bool {
    let rows = |block: &Block| -> Vec<f32> {
        let vectors = [block.origin, block.minus_u, block.v, block.normal];
        let mut row: Vec<f32> = vectors.iter().flatten().map(|values| values[lane]).collect();
        row.extend([block.length_u[lane], block.length_v[lane], block.length_w[lane]]);
        row
    };
    rows(block) == rows(other) && block.ids[lane] == other.ids[lane]
}
