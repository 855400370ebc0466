//! From links to light: gather, push and pull, convergence, and smooth values on a restricted mesh.

mod mesh;
mod progress;

pub use mesh::SurfaceMesh;
pub use progress::{Flow, Observer, Phase, Progress, Unobserved};
