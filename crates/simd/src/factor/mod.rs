//! Form factors in lanes: receivers and one-sided planar sources go in, the share that passes between them comes out,
//! without anything in between; visibility and averaging over the receiver are left to the caller.

mod lambert;
mod triple;
mod vector;
mod weights;

pub use lambert::{point_factors, point_factors_batch};
pub use vector::vector_factor;
pub use weights::kernel_weights;

/// A planar convex source with a front.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Polygon {
    /// Corners, counter-clockwise seen from the front, metres; of a triangle the first three.
    pub corners: [[f32; 3]; 4],
    /// Number of corners: 3, else 4.
    pub count: u32,
    /// Unit normal of the front.
    pub normal: [f32; 3],
}

/// Eight receivers: differential surfaces.
///
/// A caller with fewer fills the other lanes with copies: what a lane gives does not depend on the others, but a lane close
/// to the source makes all eight take as long as it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Points {
    /// Where they are, metres: x of all, y of all, z of all.
    pub points: [[f32; 8]; 3],
    /// Their unit normals, in the same order.
    pub normals: [[f32; 8]; 3],
}
