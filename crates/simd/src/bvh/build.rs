//! Primitives in, hierarchy out: binned splits by the surface area heuristic, straight into nodes of eight children.
//!
//! The primitives' boxes stand in one array that each split reorders in place; big parts are built by several threads, each
//! into lists of its own, which are then laid end to end. No step depends on which thread took it.

use super::node::{Block, LEAF, Node, is_surface};
use super::{Bvh8, Primitive, SKIN};
use rayon::prelude::*;

/// Most primitives of a leaf.
const LEAF_SIZE: usize = 8;
/// Cost of entering a box in terms of the cost of testing a primitive. Between 0.5 and 5 visibility in the room differs by
/// a twentieth (bench `rays`).
const ENTER: f32 = 2.0;
/// Bins along each axis. With 8, visibility takes a tenth longer; with 32, as long (bench `rays`).
const BINS: usize = 16;
/// Levels after which parts are halved by number, so that the hierarchy's height, and with it the stack of a walk
/// ([`STACK`]), is bounded: reached by boxes that shrink by powers of two only.
const TALL: usize = 32;
/// Room for what a walk has yet to visit: seven children a level, [`TALL`] levels and those that halve 2^28 primitives.
pub(crate) const STACK: usize = 7 * (TALL + 28) + 8;
/// Below this number of primitives a part is one thread's: some milliseconds of work.
const TASK: usize = 8192;

/// A primitive's box. The fourth numbers make rows of four, which compile to vector code.
#[derive(Clone, Copy)]
struct Item {
    lo: [f32; 4],
    hi: [f32; 4],
    id: u32,
}

impl Item {
    fn new(id: u32, primitive: &Primitive) -> Item {
        let (mut lo, mut hi) = ([0.0; 4], [0.0; 4]);
        for axis in 0..3 {
            let (p, u, v) = (primitive.origin[axis], primitive.u[axis], primitive.v[axis]);
            let corner = if primitive.parallelogram { p + u + v } else { p };
            let (a, b) = (p + u, p + v);
            lo[axis] = p.min(a).min(b).min(corner);
            hi[axis] = p.max(a).max(b).max(corner);
        }
        Item { lo, hi, id }
    }

    /// Twice the middle.
    fn middle(&self) -> [f32; 4] {
        std::array::from_fn(|axis| self.lo[axis] + self.hi[axis])
    }
}

#[derive(Clone, Copy)]
struct Bounds {
    lo: [f32; 4],
    hi: [f32; 4],
}

impl Bounds {
    const EMPTY: Bounds = Bounds { lo: [f32::INFINITY; 4], hi: [f32::NEG_INFINITY; 4] };

    fn add(&mut self, lo: &[f32; 4], hi: &[f32; 4]) {
        for axis in 0..4 {
            self.lo[axis] = if lo[axis] < self.lo[axis] { lo[axis] } else { self.lo[axis] };
            self.hi[axis] = if hi[axis] > self.hi[axis] { hi[axis] } else { self.hi[axis] };
        }
    }

    /// Half the surface.
    fn area(&self) -> f32 {
        let [x, y, z] = std::array::from_fn(|axis| self.hi[axis] - self.lo[axis]);
        x * y + y * z + z * x
    }

    fn of(items: &[Item]) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for item in items {
            bounds.add(&item.lo, &item.hi);
        }
        bounds
    }
}

/// A part of the array of items with its box.
#[derive(Clone, Copy)]
struct Part {
    start: usize,
    end: usize,
    bounds: Bounds,
    /// Whether it stays one leaf.
    whole: bool,
}

impl Part {
    fn len(&self) -> usize {
        self.end - self.start
    }
}

/// Splits `items[part]` in two where the surface area heuristic says; no answer if it had better stay a leaf.
fn split(items: &mut [Item], part: &Part, offset: usize, level: usize) -> Option<[Part; 2]> {
    let slice = &mut items[part.start - offset..part.end - offset];
    let count = slice.len();
    if count < 2 {
        return None;
    }
    let mut middles = Bounds::EMPTY;
    for item in slice.iter() {
        let middle = item.middle();
        middles.add(&middle, &middle);
    }

    // Bins along all axes in one go.
    let scale: [f32; 4] = std::array::from_fn(|axis| {
        let extent = middles.hi[axis] - middles.lo[axis];
        if extent > 0.0 { BINS as f32 * (1.0 - 1e-6) / extent } else { 0.0 }
    });
    let bin = |item: &Item, axis: usize| -> usize {
        let k = (item.lo[axis] + item.hi[axis] - middles.lo[axis]) * scale[axis];
        (k as usize).min(BINS - 1)
    };
    let mut bins = [[Bounds::EMPTY; BINS]; 3];
    let mut counts = [[0_u32; BINS]; 3];
    for item in slice.iter() {
        for axis in 0..3 {
            let k = bin(item, axis);
            bins[axis][k].add(&item.lo, &item.hi);
            counts[axis][k] += 1;
        }
    }
    let mut best = (f32::INFINITY, 0, 0);
    for axis in 0..3 {
        if scale[axis] == 0.0 {
            continue;
        }
        let mut right = [0.0_f32; BINS];
        let (mut bounds, mut sum) = (Bounds::EMPTY, 0);
        for k in (1..BINS).rev() {
            bounds.add(&bins[axis][k].lo, &bins[axis][k].hi);
            sum += counts[axis][k];
            right[k] = if sum > 0 { bounds.area() * sum as f32 } else { f32::INFINITY };
        }
        let (mut bounds, mut sum) = (Bounds::EMPTY, 0);
        for k in 0..BINS - 1 {
            bounds.add(&bins[axis][k].lo, &bins[axis][k].hi);
            sum += counts[axis][k];
            if sum > 0 {
                let cost = bounds.area() * sum as f32 + right[k + 1];
                if cost < best.0 {
                    best = (cost, axis, k);
                }
            }
        }
    }

    let area = part.bounds.area();
    let pays = best.0 + 2.0 * ENTER * area < count as f32 * area;
    if count <= LEAF_SIZE && !pays {
        return None;
    }
    let middle = if best.0 < f32::INFINITY && level < TALL {
        let (_, axis, last) = best;
        let (mut low, mut high) = (0, count);
        while low < high {
            if bin(&slice[low], axis) <= last {
                low += 1;
            } else {
                high -= 1;
                slice.swap(low, high);
            }
        }
        low
    } else {
        // All middles in one point, or too tall a tree.
        count / 2
    };
    let (a, b) = slice.split_at(middle);
    let at = part.start + middle;
    Some([
        Part { start: part.start, end: at, bounds: Bounds::of(a), whole: false },
        Part { start: at, end: part.end, bounds: Bounds::of(b), whole: false },
    ])
}

/// Up to eight parts of a part, always that with the largest box split next.
fn open(items: &mut [Item], part: &Part, offset: usize, level: usize) -> ([Part; 8], usize) {
    let mut parts = [*part; 8];
    let mut count = 1;
    while count < 8 {
        let mut widest = None;
        let mut area = f32::NEG_INFINITY;
        for (k, part) in parts[..count].iter().enumerate() {
            if !part.whole && part.bounds.area() > area {
                area = part.bounds.area();
                widest = Some(k);
            }
        }
        let Some(k) = widest else { break };
        match split(items, &parts[k], offset, level) {
            Some([a, b]) => {
                parts[k] = a;
                parts[count] = b;
                count += 1;
            }
            None => parts[k].whole = true,
        }
    }
    // What is small enough is a leaf; splitting it further would take a node of its own.
    for part in &mut parts[..count] {
        part.whole |= part.len() <= LEAF_SIZE;
    }
    (parts, count)
}

/// Where a leaf's primitives stand in the array of items.
#[derive(Clone, Copy)]
struct Leaf {
    start: u32,
    count: u32,
}

/// A part of the hierarchy; children and leaves count from its own beginnings.
#[derive(Default)]
struct Piece {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// A part of the hierarchy that another thread may have built, or a node above such parts.
enum Tree {
    Piece(Piece),
    Fork(Box<(Node, Vec<Option<Tree>>, Vec<Part>)>),
}

fn node_of(parts: &[Part], pad: f32) -> Node {
    let mut node = Node { present: (1 << parts.len()) - 1, ..Node::EMPTY };
    for (k, part) in parts.iter().enumerate() {
        for axis in 0..3 {
            node.planes[axis][k] = part.bounds.lo[axis] - pad;
            node.planes[axis + 3][k] = part.bounds.hi[axis] + pad;
        }
        node.counts[k] = if part.whole { part.len() as u8 } else { 0 };
    }
    node
}

fn leaf_of(part: &Part) -> Leaf {
    Leaf { start: part.start as u32, count: part.len() as u32 }
}

/// Builds a part into lists, its node first.
fn build_piece(items: &mut [Item], part: &Part, offset: usize, level: usize, pad: f32, piece: &mut Piece) -> u32 {
    let (parts, count) = open(items, part, offset, level);
    let index = piece.nodes.len();
    piece.nodes.push(node_of(&parts[..count], pad));
    for (k, part) in parts[..count].iter().enumerate() {
        if part.whole {
            piece.nodes[index].children[k] = LEAF | piece.leaves.len() as u32;
            piece.leaves.push(leaf_of(part));
        }
    }
    for (k, part) in parts[..count].iter().enumerate() {
        if !part.whole {
            piece.nodes[index].children[k] = build_piece(items, part, offset, level + 1, pad, piece);
        }
    }
    index as u32
}

/// Builds a part, its big parts by several threads.
fn build_tree(items: &mut [Item], part: &Part, level: usize, pad: f32) -> Tree {
    let offset = part.start;
    if part.len() <= TASK {
        let mut piece = Piece::default();
        build_piece(items, part, offset, level, pad, &mut piece);
        return Tree::Piece(piece);
    }
    let (mut parts, count) = open(items, part, offset, level);
    let parts = &mut parts[..count];
    parts.sort_by_key(|part| part.start);
    let mut slices = Vec::with_capacity(count);
    let mut rest = items;
    for part in parts.iter() {
        let (slice, tail) = rest.split_at_mut(part.len());
        slices.push((slice, *part));
        rest = tail;
    }
    let children = slices
        .into_par_iter()
        .map(|(slice, part)| if part.whole { None } else { Some(build_tree(slice, &part, level + 1, pad)) })
        .collect();
    Tree::Fork(Box::new((node_of(parts, pad), children, parts.to_vec())))
}

/// Lays a tree's parts end to end.
fn lay_out(tree: Tree, all: &mut Piece) -> u32 {
    let base = all.nodes.len() as u32;
    match tree {
        Tree::Piece(piece) => {
            let leaves = all.leaves.len() as u32;
            all.nodes.extend(piece.nodes.into_iter().zip(0..).map(|(mut node, _)| {
                for child in &mut node.children {
                    *child = match *child {
                        super::node::NONE => super::node::NONE,
                        leaf if leaf & LEAF != 0 => leaf + leaves,
                        node => node + base,
                    };
                }
                node
            }));
            all.leaves.extend(piece.leaves);
        }
        Tree::Fork(fork) => {
            let (node, children, parts) = *fork;
            all.nodes.push(node);
            for (k, (child, part)) in children.into_iter().zip(parts).enumerate() {
                all.nodes[base as usize].children[k] = match child {
                    Some(tree) => lay_out(tree, all),
                    None => {
                        all.leaves.push(leaf_of(&part));
                        LEAF | (all.leaves.len() - 1) as u32
                    }
                };
            }
        }
    }
    base
}

impl Bvh8 {
    /// Builds the hierarchy of primitives, each named by its place in the slice. Those without an area or with coordinates
    /// that are not finite are left out.
    ///
    /// # Panics
    /// With 2^28 primitives or more.
    #[must_use]
    pub fn build(primitives: &[Primitive]) -> Bvh8 {
        assert!(primitives.len() < 1 << 28, "{} primitives are more than an index can name", primitives.len());
        let mut items: Vec<Item> = primitives
            .par_iter()
            .zip(0_u32..primitives.len() as u32)
            .filter(|(primitive, _)| is_surface(primitive))
            .map(|(primitive, id)| Item::new(id, primitive))
            .filter(|item| (0..3).all(|axis| item.lo[axis].is_finite() && item.hi[axis].is_finite()))
            .collect();
        let mut bvh = Bvh8 {
            nodes: Vec::new(),
            blocks: Vec::new(),
            places: vec![u32::MAX; primitives.len()],
            lo: [0.0; 3],
            hi: [0.0; 3],
            scale: 0.0,
        };
        if items.is_empty() {
            return bvh;
        }
        let bounds = Bounds::of(&items);
        bvh.lo = [bounds.lo[0], bounds.lo[1], bounds.lo[2]];
        bvh.hi = [bounds.hi[0], bounds.hi[1], bounds.hi[2]];
        bvh.scale = bvh.lo.iter().chain(&bvh.hi).fold(0.0, |scale, x| x.abs().max(scale));

        let root = Part { start: 0, end: items.len(), bounds, whole: false };
        // Twice the skin: once for the outline, once for the rounding of the boxes' own tests.
        let tree = build_tree(&mut items, &root, 0, 2.0 * SKIN * bvh.scale);
        let mut all = Piece::default();
        lay_out(tree, &mut all);
        bvh.nodes = all.nodes;
        bvh.blocks = all
            .leaves
            .par_iter()
            .map(|leaf| {
                let mut block = Block::EMPTY;
                let items = &items[leaf.start as usize..(leaf.start + leaf.count) as usize];
                for (lane, item) in items.iter().enumerate() {
                    block.set(lane, item.id, &primitives[item.id as usize]);
                    for axis in 0..3 {
                        block.planes[axis][lane] = item.lo[axis] - 2.0 * SKIN * bvh.scale;
                        block.planes[axis + 3][lane] = item.hi[axis] + 2.0 * SKIN * bvh.scale;
                    }
                }
                block
            })
            .collect();
        for (k, block) in bvh.blocks.iter().enumerate() {
            for (lane, &id) in block.ids.iter().enumerate() {
                if let Some(place) = bvh.places.get_mut(id as usize) {
                    *place = (k * 8 + lane) as u32 | u32::from(!primitives[id as usize].opaque) << 31;
                }
            }
        }
        for node in &mut bvh.nodes {
            for k in 0..8 {
                if node.counts[k] > 0 {
                    let block = &bvh.blocks[(node.children[k] & !LEAF) as usize];
                    node.opaque[k] = (0..usize::from(node.counts[k]))
                        .filter(|&lane| primitives[block.ids[lane] as usize].opaque)
                        .fold(0, |bits, lane| bits | 1 << lane);
                }
            }
        }
        bvh
    }
}
