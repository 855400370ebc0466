//! BSP trees for rays: the fronts of a scene go in one by one, a tree of splitting planes with their fragments comes
//! out, through which rays and beams find what they hit; elements and sampling are left to others.
//!
//! Each node's plane is that of the first polygon that came to it; what lies in the plane stays at the node, what
//! straddles it is split and both parts go on down (the first phase of Podehl, Rauber, Rünger 1996, after SPLASH-2).
//! Two things are added for speed and one for exactness:
//!
//! - each node carries the bounding box of its subtree, so that a ray or a beam leaves out what it cannot reach;
//! - rays that join two patches walk as one beam, which settles most polygons by one test for all of its rays;
//! - a fragment only says *where* its polygon is: a ray is tested against the **whole** polygon, with its own plane and
//!   edges. So no ray slips between fragments of a polygon, none is counted twice, and every result is bit for bit the
//!   same whatever the order of insertion, the same as a search over all polygons without a tree.
//!
//! One distance rules all of it, [`Scene::tolerance`] `tau`: corners within `tau` of a node's plane lie in it; a polygon
//! is `tau` larger than its corners say, so that polygons with a common edge overlap there and are watertight; a hit
//! within `tau` of the plane of either end of a ray does not count. See `docs/theory/visibility.md`.

mod beam;
mod check;
mod cut;
mod order;
mod ray;
mod surface;

pub use check::BspViolation;
pub use cut::{Cut, Pieces, cut};
pub use order::InsertionOrder;
pub use ray::Hit;

use crate::kernels::{Counts, NoProbe, Probe};
use crate::scene::{Corners, Plane, Scene};
pub(crate) use beam::{Beam, Packet, Verdict};
use glam::DVec3;
pub(crate) use ray::Segment;
use std::ops::Range;
pub(crate) use surface::Surface;

/// Boxes and sides of planes are taken this many tolerances larger than the fragments in them. A hit lies up to
/// `sqrt(3) tau` outside of its polygon's corners (the margin `tau` in the two coordinates that the polygon is projected
/// to, and at most as much in the third), a fragment's corner up to `tau` from both its polygon's and its node's plane:
/// below 5 in all. 8 costs nothing measurable (0.1 mm in a room of 10 m).
const MARGIN: f64 = 8.0;

/// Slack for rounding in what is said of whole beams, in tolerances: 1e-9 of the diameter, where rounding takes 1e-16 of
/// it (and up to 1e-10, divided by a height of one tolerance).
const ROUNDING: f64 = 1e-3;

/// A node: a plane, the fragments that lie in it, and what is in front and behind.
#[derive(Clone, Debug)]
pub struct Node {
    /// Lowest corner of the box around the subtree's fragments, margin included, metres.
    lower: [f64; 3],
    /// Highest corner of that box.
    upper: [f64; 3],
    /// The splitting plane: that of the first polygon that came here.
    pub plane: Plane,
    /// Node in front of the plane, or [`Bsp::NONE`].
    pub front: u32,
    /// Node behind the plane, or [`Bsp::NONE`].
    pub back: u32,
    /// First fragment in the plane; [`Fragment::next`] leads on. Every node has one.
    pub first_fragment: u32,
    /// Last fragment in the plane.
    last_fragment: u32,
    /// Do all fragments' polygons share the plane up to rounding (and the axes that they are projected to)? Then a beam
    /// is cut with it once for all of them.
    flat: bool,
}

/// A convex piece of a polygon that no plane above it cuts.
#[derive(Clone, Debug)]
pub struct Fragment {
    /// Three or four corners, in the polygon's orientation, metres.
    pub corners: Corners,
    /// The front polygon that it is a piece of.
    pub polygon: u32,
    /// The node whose plane it lies in.
    pub node: u32,
    /// Next fragment of the same node, or [`Bsp::NONE`].
    pub next: u32,
}

/// A BSP tree of the fronts of a scene.
#[derive(Clone, Debug)]
pub struct Bsp {
    nodes: Vec<Node>,
    fragments: Vec<Fragment>,
    surfaces: Vec<Surface>,
    tolerance: f64,
    diameter: f64,
}

impl Bsp {
    /// Where there is no node or no fragment.
    pub const NONE: u32 = u32::MAX;

    /// An empty tree that the fronts of `scene` can be inserted into.
    #[must_use]
    pub fn new(scene: &Scene) -> Bsp {
        let tolerance = scene.tolerance();
        let surfaces = scene.polygons[..scene.fronts].iter().map(|polygon| Surface::new(polygon, tolerance)).collect();
        Bsp { nodes: Vec::new(), fragments: Vec::new(), surfaces, tolerance, diameter: scene.diameter }
    }

    /// The tree of all fronts of `scene`, inserted in the given order.
    #[must_use]
    pub fn build(scene: &Scene, order: InsertionOrder) -> Bsp {
        let mut bsp = Bsp::new(scene);
        for polygon in order.sequence(scene) {
            bsp.insert(polygon, &scene.polygons[polygon as usize].corners);
        }
        bsp
    }

    /// As [`Bsp::build`], telling `counts` what was cut; `go_on` hears from time to time how many pieces were looked at
    /// since it was asked last, and which share of the polygons is inserted. `None` when it says no.
    pub fn build_while(
        scene: &Scene,
        order: InsertionOrder,
        counts: &mut Counts,
        go_on: &mut dyn FnMut(u64, f64) -> bool,
    ) -> Option<Bsp> {
        let mut bsp = Bsp::new(scene);
        let sequence = order.sequence_while(scene, &mut |pieces| go_on(pieces, 0.0))?;
        for (count, &polygon) in sequence.iter().enumerate() {
            let before = counts.cuts;
            bsp.insert_counted(polygon, &scene.polygons[polygon as usize].corners, counts);
            if !go_on(counts.cuts - before, (count + 1) as f64 / sequence.len() as f64) {
                return None;
            }
        }
        Some(bsp)
    }

    /// Inserts a front polygon (`corners` may be a part of it) and returns the indices of its new fragments.
    pub fn insert(&mut self, polygon: u32, corners: &Corners) -> Range<u32> {
        self.insert_counted(polygon, corners, &mut NoProbe)
    }

    /// As [`Bsp::insert`]; tells `probe` the nodes that the pieces come by, and what is cut in two.
    ///
    /// Pieces are worked off from a list, the front ones first, so that a tree of any depth needs no call stack.
    pub fn insert_counted<P: Probe>(&mut self, polygon: u32, corners: &Corners, probe: &mut P) -> Range<u32> {
        let first = self.fragments.len() as u32;
        let mut open: Vec<(u32, Corners)> = Vec::new();
        let mut current = Some((if self.nodes.is_empty() { Bsp::NONE } else { 0 }, *corners));
        if self.nodes.is_empty() {
            self.add_node(polygon, corners);
            return first..self.fragments.len() as u32;
        }
        while let Some((node, piece)) = current.take().or_else(|| open.pop()) {
            probe.cut(node);
            self.nodes[node as usize].grow(&piece, MARGIN * self.tolerance);
            let (front, back) = match cut(&piece, &self.nodes[node as usize].plane, self.tolerance) {
                Cut::Coplanar => {
                    self.add_fragment(polygon, &piece, node);
                    continue;
                }
                Cut::Front => (Pieces::one(piece), Pieces::NONE),
                Cut::Back => (Pieces::NONE, Pieces::one(piece)),
                Cut::Both { front, back } => {
                    probe.split();
                    (front, back)
                }
            };
            // Pushed in reverse, so that front pieces are worked off first.
            for &part in back.iter().rev() {
                self.descend(polygon, part, node, false, &mut open);
            }
            for &part in front.iter().rev() {
                self.descend(polygon, part, node, true, &mut open);
            }
        }
        first..self.fragments.len() as u32
    }

    /// Sends a piece on to a child: appended to the open list, or the child's first where there is none yet.
    fn descend(&mut self, polygon: u32, piece: Corners, node: u32, front: bool, open: &mut Vec<(u32, Corners)>) {
        let parent = &self.nodes[node as usize];
        let child = if front { parent.front } else { parent.back };
        if child != Bsp::NONE {
            open.push((child, piece));
            return;
        }
        let child = self.add_node(polygon, &piece);
        let parent = &mut self.nodes[node as usize];
        *(if front { &mut parent.front } else { &mut parent.back }) = child;
    }

    fn add_node(&mut self, polygon: u32, corners: &Corners) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node {
            lower: [f64::INFINITY; 3],
            upper: [f64::NEG_INFINITY; 3],
            plane: self.surfaces[polygon as usize].plane(),
            front: Bsp::NONE,
            back: Bsp::NONE,
            first_fragment: Bsp::NONE,
            last_fragment: Bsp::NONE,
            flat: true,
        });
        self.nodes[node as usize].grow(corners, MARGIN * self.tolerance);
        self.add_fragment(polygon, corners, node);
        node
    }

    fn add_fragment(&mut self, polygon: u32, corners: &Corners, node: u32) {
        let index = self.fragments.len() as u32;
        self.fragments.push(Fragment { corners: *corners, polygon, node, next: Bsp::NONE });
        let node = &mut self.nodes[node as usize];
        node.flat &= self.surfaces[polygon as usize].lies_in(&node.plane, corners[0], self.diameter, self.tolerance);
        if node.first_fragment == Bsp::NONE {
            node.first_fragment = index;
        } else {
            self.fragments[node.last_fragment as usize].next = index;
        }
        node.last_fragment = index;
    }

    /// The nodes; the root is the first.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The fragments, in the order in which they came to rest.
    #[must_use]
    pub fn fragments(&self) -> &[Fragment] {
        &self.fragments
    }

    /// The distance below which things count as touching, metres: [`Scene::tolerance`] of the scene.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// The fragments in a node's plane.
    pub fn fragments_of(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        let mut next = self.nodes[node as usize].first_fragment;
        std::iter::from_fn(move || {
            let fragment = next;
            (fragment != Bsp::NONE).then(|| {
                next = self.fragments[fragment as usize].next;
                fragment
            })
        })
    }

    /// Lists the invariants and checks them: every node holds a fragment; a fragment's corners lie within the tolerance
    /// of its node's plane; what is below a child lies on its side of the plane, up to the tolerance, and inside the
    /// node's box; children come after their parents and have one; the areas of a polygon's fragments add up to its own
    /// (of those that were inserted, as a whole).
    ///
    /// # Errors
    /// The first violation.
    pub fn check(&self, scene: &Scene) -> Result<(), BspViolation> {
        check::check(self, scene)
    }
}

impl Node {
    fn grow(&mut self, corners: &Corners, margin: f64) {
        for corner in corners.iter() {
            let corner: [f64; 3] = DVec3::to_array(corner);
            for (axis, x) in corner.into_iter().enumerate() {
                self.lower[axis] = self.lower[axis].min(x - margin);
                self.upper[axis] = self.upper[axis].max(x + margin);
            }
        }
    }
}

/// Nodes that are still to be visited: a few in place, the rest of a deep tree's on the heap.
struct Stack {
    near: [u32; 32],
    count: usize,
    spill: Vec<u32>,
}

impl Stack {
    fn new() -> Stack {
        Stack { near: [0; 32], count: 0, spill: Vec::new() }
    }

    #[inline]
    fn push(&mut self, node: u32) {
        if self.count < self.near.len() {
            self.near[self.count] = node;
            self.count += 1;
        } else {
            self.spill.push(node);
        }
    }

    #[inline]
    fn pop(&mut self) -> Option<u32> {
        if !self.spill.is_empty() {
            return self.spill.pop();
        }
        self.count = self.count.checked_sub(1)?;
        Some(self.near[self.count])
    }
}
