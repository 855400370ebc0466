//! From links to light: gather, push and pull, convergence, and smooth values on a restricted mesh.

mod mesh;

pub use mesh::SurfaceMesh;
