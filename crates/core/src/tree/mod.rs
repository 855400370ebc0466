//! The tree: polygons in a BSP tree for rays ([`Bsp`]), and under each root a quadtree of [`Elements`] that grows by
//! need.

pub mod bsp;
mod elements;
mod path;
mod roots;

pub use bsp::{Bsp, BspViolation, InsertionOrder};
pub use elements::{Element, ElementId, Elements, TreeViolation, quadrant_of, quarter};
pub use path::Path;
pub use roots::{FragmentRoot, fragment_roots};
