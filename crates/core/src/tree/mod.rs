//! The tree: polygons in a BSP tree for rays ([`Bsp`]), and under each root a quadtree of [`Elements`] that grows by
//! need.

pub mod bsp;
mod cut;
mod elements;
mod path;
mod roots;

pub use bsp::{Bsp, BspViolation, InsertionOrder};
pub use cut::{Cut, quadrant_of, quarter};
pub use elements::{Element, ElementId, Elements, TreeViolation};
pub use path::Path;
pub use roots::{FragmentRoot, fragment_roots};
