//! What kernels see of an element: its corners, plane and area, borrowed.

use crate::scene::{Corners, Plane};

/// A planar convex patch with a front: a polygon, an element, or a BSP fragment.
#[derive(Clone, Copy, Debug)]
pub struct Patch<'a> {
    /// Corners, counter-clockwise seen from the front, metres.
    pub corners: &'a Corners,
    /// Supporting plane (that of the whole polygon, so that all elements of a polygon share it exactly).
    pub plane: &'a Plane,
    /// Area, m².
    pub area: f64,
}
