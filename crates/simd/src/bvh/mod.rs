//! Primitives go in; which of them segments cross comes out: a bounding volume hierarchy with eight children a node.
//!
//! What a primitive is to the caller (which polygon, whose material) stays with the caller: here it has an index.
//!
//! # When a primitive is crossed
//!
//! One rule holds for every query. Let `d = SKIN * m`, where m is the largest magnitude of a coordinate in the hierarchy or of
//! the ray's origin. A primitive is crossed by `origin + t * direction`, t in (near, far), when
//!
//! - the segment's ends lie on opposite sides of its plane, each more than d away from it, and
//! - the segment's line passes inside each of its edges, or outside by no more than d.
//!
//! So a segment that starts or ends on a primitive, or on one coplanar with it, is not blocked by it, and none that lies in a
//! primitive's plane is blocked by that primitive: no identifiers are compared. And no line passes between two primitives
//! with a common edge, even where their corners agree to rounding only or the one's corner lies on the other's edge. The
//! price is an outline too large by d, two millionths of the scene's size: of rays between random patches of a dense scene,
//! 2 in 10,000 are blocked that pass a silhouette more closely than that (`examples/dump_rays.rs`).
//!
//! The line's distance from an edge is a signed volume of numbers relative to the ray's origin O. With `s = P - O`,
//! `c = s x D`, `N = U x V`: `det = N.D`, `t det = N.s`, `u det = V.c`, `v det = -U.c`, and `V.c / (|V| |D|)` is the distance
//! from the edge u = 0 (Moeller and Trumbore 1997, without the division). In units of rounding, 2^-24, `V.c` is wrong by at most 6.5 `|V| |D| |s|` (one
//! for s, 2.5 for c, three for the scalar product), which is 22 m in distance where s spans the scene, `|s| <= 2 sqrt(3) m`;
//! rounding U and V moves a corner by up to 3.5 m on either side of an edge. [`SKIN`] is 32 units, above their sum of 29.
//! (`no_light_passes_between_neighbours` aims at edges and corners.) So a scene is best centred on the origin, and ray
//! origins belong within ten times its size: farther out, boxes are padded by less than the rounding.

mod build;
mod check;
mod closest;
mod crossing;
mod firsts;
mod near;
mod node;
mod packet;
mod shaft;

pub use check::check;
pub use closest::Hit;
pub use packet::{Filter, NoFilter};

use node::{Block, Node};

/// Distance within which points coincide, over the largest magnitude of a coordinate: 32 units of rounding, of which 29 are
/// needed (see the module's page).
pub const SKIN: f32 = 32.0 / 16_777_216.0;

/// A planar convex surface with 3 or 4 corners: `origin`, `origin + u`, `origin + v` and, of a parallelogram,
/// `origin + u + v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primitive {
    /// The corner that both edges start from.
    pub origin: [f32; 3],
    /// The first edge.
    pub u: [f32; 3],
    /// The second edge.
    pub v: [f32; 3],
    /// Whether the fourth corner belongs to it.
    pub parallelogram: bool,
    /// Whether it lets nothing pass.
    pub opaque: bool,
}

/// N segments `origin + t * direction`, t in (near, far), one number of all rays side by side.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Rays<const N: usize> {
    /// Where t is 0; per axis.
    pub origin: [[f32; N]; 3],
    /// What t multiplies, of any length; per axis.
    pub direction: [[f32; N]; 3],
    /// Where each segment starts, at least 0.
    pub near: [f32; N],
    /// Where each segment ends, possibly infinity. A ray with `far <= near` crosses nothing.
    pub far: [f32; N],
}

impl<const N: usize> Default for Rays<N> {
    fn default() -> Self {
        Rays { origin: [[0.0; N]; 3], direction: [[0.0; N]; 3], near: [0.0; N], far: [0.0; N] }
    }
}

impl<const N: usize> Rays<N> {
    /// Makes ray `k` the segment between two points, both left out by the share `margin` of its length.
    pub fn set_between(&mut self, k: usize, from: [f32; 3], to: [f32; 3], margin: f32) {
        for axis in 0..3 {
            self.origin[axis][k] = from[axis];
            self.direction[axis][k] = to[axis] - from[axis];
        }
        self.near[k] = margin;
        self.far[k] = 1.0 - margin;
    }
}

/// A bounding volume hierarchy of [`Primitive`]s, eight children a node.
///
/// It is the same whatever the number of threads that built it, and so are the answers, bit for bit, whatever the backend.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh8 {
    nodes: Vec<Node>,
    blocks: Vec<Block>,
    /// Where primitive k is: block * 8 + lane, the highest bit set where it is not opaque; `u32::MAX` where it has no area
    /// and is left out.
    places: Vec<u32>,
    lo: [f32; 3],
    hi: [f32; 3],
    /// Largest magnitude of a coordinate.
    scale: f32,
}

impl Bvh8 {
    /// Lower and upper corner of the box of all primitives; zeros when there are none.
    #[must_use]
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        (self.lo, self.hi)
    }

    /// Bytes held.
    #[must_use]
    pub fn memory(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..]) + size_of_val(&self.places[..])
    }

    /// Number of primitives given to [`Bvh8::build`].
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether it was built of no primitive.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }
}
