//! What the hierarchy is made of: nodes of eight boxes, blocks of eight primitives, one number of all eight side by side.

use super::Primitive;
use crate::lanes::WIDTH;

/// Marks a child that is a block of primitives.
pub(crate) const LEAF: u32 = 1 << 31;
/// A child that is not there; its box is beyond all rays.
pub(crate) const NONE: u32 = u32::MAX;

/// Boxes of up to eight children, which come first.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Lower x, y, z, upper x, y, z of all children, padded.
    pub(crate) planes: [[f32; WIDTH]; 6],
    /// Index of a node, or of a block with [`LEAF`] set, or [`NONE`].
    pub(crate) children: [u32; WIDTH],
    /// Bit k: there is a child k. Only rays beyond all bounds of numbers need asking.
    pub(crate) present: u32,
    /// Number of primitives of a child that is a block.
    pub(crate) counts: [u8; WIDTH],
    /// Bit k: primitive k of a child that is a block is opaque.
    pub(crate) opaque: [u8; WIDTH],
}

impl Node {
    /// A node without children.
    pub(crate) const EMPTY: Node = Node {
        planes: [[f32::INFINITY; WIDTH]; 6],
        children: [NONE; WIDTH],
        present: 0,
        counts: [0; WIDTH],
        opaque: [0; WIDTH],
    };
}

/// Up to eight primitives, which come first. A lane without one has a zero normal and is never crossed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Block {
    /// P: the corner that both edges start from.
    pub(crate) origin: [[f32; WIDTH]; 3],
    /// -U / |N|: the first edge, reversed, over the length of N = U x V.
    pub(crate) minus_u: [[f32; WIDTH]; 3],
    /// V / |N|: the second edge.
    pub(crate) v: [[f32; WIDTH]; 3],
    /// N / |N|.
    pub(crate) normal: [[f32; WIDTH]; 3],
    /// |U| / |N|.
    pub(crate) length_u: [f32; WIDTH],
    /// |V| / |N|.
    pub(crate) length_v: [f32; WIDTH],
    /// |U - V| / |N| of a triangle, whose third edge that is; infinity for a parallelogram.
    pub(crate) length_w: [f32; WIDTH],
    /// Lower x, y, z, upper x, y, z of each, padded.
    pub(crate) planes: [[f32; WIDTH]; 6],
    /// Indices of the primitives.
    pub(crate) ids: [u32; WIDTH],
}

impl Block {
    /// A block without primitives.
    pub(crate) const EMPTY: Block = Block {
        origin: [[0.0; WIDTH]; 3],
        minus_u: [[0.0; WIDTH]; 3],
        v: [[0.0; WIDTH]; 3],
        normal: [[0.0; WIDTH]; 3],
        length_u: [0.0; WIDTH],
        length_v: [0.0; WIDTH],
        length_w: [0.0; WIDTH],
        planes: [[f32::INFINITY; WIDTH]; 6],
        ids: [NONE; WIDTH],
    };

    /// Puts a primitive with an area into a lane.
    pub(crate) fn set(&mut self, lane: usize, id: u32, primitive: &Primitive) {
        let normal = normal(primitive);
        let area = length(&normal);
        let (u, v) = (primitive.u.map(f64::from), primitive.v.map(f64::from));
        for axis in 0..3 {
            self.origin[axis][lane] = primitive.origin[axis];
            self.minus_u[axis][lane] = (-u[axis] / area) as f32;
            self.v[axis][lane] = (v[axis] / area) as f32;
            self.normal[axis][lane] = (normal[axis] / area) as f32;
        }
        let third = [u[0] - v[0], u[1] - v[1], u[2] - v[2]];
        self.length_u[lane] = (length(&u) / area) as f32;
        self.length_v[lane] = (length(&v) / area) as f32;
        self.length_w[lane] = if primitive.parallelogram { f32::INFINITY } else { (length(&third) / area) as f32 };
        self.ids[lane] = id;
    }
}

/// `U x V`.
fn normal(primitive: &Primitive) -> [f64; 3] {
    let (u, v) = (primitive.u.map(f64::from), primitive.v.map(f64::from));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn length(v: &[f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// Whether the primitive is a surface: finite, and its edges at an angle that rounding did not make.
pub(crate) fn is_surface(primitive: &Primitive) -> bool {
    let edges = length(&primitive.u.map(f64::from)) * length(&primitive.v.map(f64::from));
    let area = length(&normal(primitive));
    // Edges are rounded to 24 bits: below a sine of 2^-23 their angle is noise.
    area > edges * 2.0_f64.powi(-23)
        && area as f32 >= f32::MIN_POSITIVE
        && primitive.origin.iter().all(|x| x.is_finite())
}
