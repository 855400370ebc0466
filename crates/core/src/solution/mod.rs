//! From links to light: gather, push and pull, convergence, and smooth values on a restricted mesh.

mod backs;
mod balance;
mod corner_values;
mod interpolate;
mod light;
mod mesh;
mod pilot;
mod progress;
mod sides;
mod solver;
mod sums;
mod trace;
mod values;
mod vertex_gather;

pub use balance::{Balance, RowSums, balance, row_sums};
pub use corner_values::{around_corner, corner_mean};
pub use interpolate::{Blending, Obstacles, Site, SmoothPlan, SmoothSurfaces, bilinear_coordinates, smoothing_groups};
pub use light::{Light, LightViolation, Update};
pub use mesh::SurfaceMesh;
pub use pilot::pilot_irradiance;
pub use progress::{Flow, Observer, Phase, Progress, Unobserved, WATCH_INTERVAL, Watch};
pub use solver::{Interpolation, Iteration, Parameters, Roots, Solver, Stop};
pub use sums::{GATHER_CHUNK, gather_sum, tree_sum};
pub use values::{Values, area_weights, mean_of_children, pulled, reflected, settled};
pub use vertex_gather::{Gathered, Shadows, irradiance_at_site, seen_factor};
