//! What a solve tells of itself: counts, residuals, energy, time.

use crate::groups::{GroupedBy, LightGroup};
use crate::{Schedule, Settings};
use isolux_core::kernels::Counts;
use isolux_core::scene::{Issue, Scene};
use isolux_core::solution::{Balance, RowSums};
use isolux_core::tree::{ElementId, Elements};
use isolux_core::units::{Rgb, Unit};
use serde::{Deserialize, Serialize};

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The total radiosity settled; with `wavefront` the estimated error is below the one asked for, too.
    Converged,
    /// `max_iterations` (with `wavefront` the stages that it ever tries) were used up first.
    IterationLimit,
    /// A bound that was asked for stopped it: the report names it.
    Bounded,
    /// The observer stopped it; the solution is consistent but unfinished.
    Cancelled,
}

/// What the links are estimated to leave out, relative. Reflectances and emissions are taken as
/// given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// RMS error of irradiance over all surfaces, relative to its mean.
    pub total: f64,
    /// The same of the darker half of the surfaces, relative to that half's mean; none where it was not looked at.
    pub dark: Option<f64>,
}

/// Light groups of a solve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupsReport {
    /// What the groups are made of.
    pub by: GroupedBy,
    /// The groups, as they were solved.
    pub groups: Vec<LightGroup>,
}

/// Weight of a light group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeightReport {
    /// Name of the group.
    pub group: String,
    /// Factor on its emission, per band.
    pub weight: Rgb,
}

/// Reflectance that a material was given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReflectanceReport {
    /// Name of the material.
    pub material: String,
    /// Its diffuse reflectance, per band.
    pub reflectance: Rgb,
}

/// What a relit solution was made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelitReport {
    /// Hash of the scene that was solved, hexadecimal.
    pub scene_hash: String,
    /// Mean irradiance with all weights 1, W/m² or lm/m².
    pub mean_irradiance: Rgb,
    /// Error estimate of the solve.
    pub error_estimate: Option<ErrorEstimate>,
    /// Weight of each light group.
    pub weights: Vec<WeightReport>,
    /// Materials that were given other reflectances.
    pub reflectance: Vec<ReflectanceReport>,
    /// Is the report's error estimate that of this very mix, as rays found it at points? Otherwise, in older files, it is
    /// bounded by that of the solve, or, with changed reflectances, carried over.
    #[serde(default)]
    pub measured: bool,
}

/// One stage of `wavefront`: refinement, then gathers until the light settles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// Elements at its end.
    pub elements: u64,
    /// Links at its end.
    pub links: u64,
    /// Gathers over all links.
    pub passes: u32,
    /// Estimated relative error at its end.
    pub estimate: f64,
    /// Seconds.
    pub seconds: f64,
}

/// Links of the solution by visibility.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LinkReport {
    /// All links.
    pub total: u64,
    /// Every ray passed.
    pub full: u64,
    /// Some did.
    pub partial: u64,
    /// None did.
    pub none: u64,
}

/// One iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IterationReport {
    /// Total radiosity (sum of area times radiosity), per band.
    pub total: Rgb,
    /// Relative change of the total against the iteration before.
    pub residual: f64,
    /// Elements at its end.
    pub elements: u64,
    /// Links at its end.
    pub links: u64,
    /// Visibilities evaluated in it.
    pub visibilities: u64,
    /// Seconds.
    pub seconds: f64,
}

/// Where the emitted power went, per band, W or lm. `escaped` and `lost_to_backs` are measured by rays that know
/// nothing of the links.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// Emitted by all surfaces; what lamps without a surface throw on surfaces counts as emitted there.
    pub emitted: Rgb,
    /// Turned to heat by the fronts of all surfaces, from the solution's irradiances.
    pub absorbed: Rgb,
    /// Left the scene through openings, by rays.
    pub escaped: Rgb,
    /// Ended on black backs, by rays.
    pub lost_to_backs: Rgb,
    /// `(absorbed + escaped + lost - emitted) / emitted`, summed over bands.
    pub imbalance: f64,
    /// Standard error of the rays' part of the imbalance.
    pub standard_error: f64,
    /// Rays shot.
    pub rays: u64,
}

impl Energy {
    pub(crate) fn of(balance: &Balance) -> Energy {
        Energy {
            emitted: balance.emitted,
            absorbed: balance.absorbed,
            escaped: balance.escaped,
            lost_to_backs: balance.lost_to_backs,
            imbalance: balance.imbalance(),
            standard_error: balance.standard_error / balance.emitted.mean(),
            rays: balance.rays,
        }
    }
}

/// Sums of form factor times visibility over the links of a leaf and its ancestors: 1 in a closed scene. With `wavefront` a
/// cluster counts as what it would throw if all its surfaces threw 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RowSum {
    /// The largest.
    pub largest: f64,
    /// The object that holds it.
    pub largest_object: String,
    /// The smallest.
    pub smallest: f64,
    /// The object that holds it.
    pub smallest_object: String,
    /// Area-weighted mean over leaves.
    pub mean: f64,
}

impl RowSum {
    pub(crate) fn of(sums: &RowSums, scene: &Scene, elements: &Elements) -> RowSum {
        let name = |leaf: ElementId| scene.object_name(elements.get(leaf).polygon).to_owned();
        RowSum {
            largest: sums.largest.0,
            largest_object: name(sums.largest.1),
            smallest: sums.smallest.0,
            smallest_object: name(sums.smallest.1),
            mean: sums.mean,
        }
    }
}

/// Time of one phase.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhaseReport {
    /// Name.
    pub name: String,
    /// Seconds.
    pub seconds: f64,
}

/// Everything a solve tells of itself. What only one schedule has is none, or empty, with the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of the program.
    pub version: String,
    /// Name of the scene.
    pub scene: String,
    /// Hash of the scene, hexadecimal.
    pub scene_hash: String,
    /// What power is counted in, lm or W; all of a report's and solution's values are in it.
    pub unit: Unit,
    /// Settings as asked.
    pub settings: Settings,
    /// How the solve was organised, as the settings say.
    pub schedule: Schedule,
    /// How it ended.
    pub status: Status,
    /// The bound that stopped it, by the name of its setting.
    pub bound: Option<String>,
    /// Estimate of the error that is left (`wavefront`).
    pub error_estimate: Option<ErrorEstimate>,
    /// Absolute `BF_eps`, W/m² or lm/m² (`sequential`).
    pub bf_epsilon: Option<f64>,
    /// Absolute area below which elements are not split, m².
    pub area_epsilon: f64,
    /// Relative `epsilon` on total radiosity (`sequential`).
    pub energy_epsilon: Option<f64>,
    /// Mean irradiance over the surfaces, W/m² or lm/m².
    pub mean_irradiance: Rgb,
    /// One-sided polygons (fronts, and backs of two-sided surfaces).
    pub polygons: u64,
    /// Backs that light reached, of how many there are.
    pub lit_backs: [u64; 2],
    /// Fragments in the BSP tree (`sequential`).
    pub fragments: Option<u64>,
    /// Roots of quadtrees.
    pub roots: u64,
    /// Elements.
    pub elements: u64,
    /// Elements without children.
    pub leaves: u64,
    /// Elements by level, roots first.
    pub elements_by_level: Vec<u64>,
    /// Clusters of polygons (`wavefront`).
    pub clusters: u64,
    /// Links by visibility.
    pub links: LinkReport,
    /// Kernel evaluations (`sequential`).
    pub counts: Option<Counts>,
    /// Each iteration (`sequential`).
    pub iterations: Vec<IterationReport>,
    /// Each stage (`wavefront`).
    pub stages: Vec<StageReport>,
    /// Energy balance; none for a cancelled solve, and for a solution that was relit.
    pub energy: Option<Energy>,
    /// Row sums; none for a cancelled solve.
    pub row_sum: Option<RowSum>,
    /// Seconds per phase.
    pub phases: Vec<PhaseReport>,
    /// Peak memory of the process, bytes (0 where the system does not tell).
    pub peak_memory: u64,
    /// What was found in the scene.
    pub issues: Vec<Issue>,
    /// Light groups (`wavefront`; older files lack them).
    #[serde(default)]
    pub groups: Option<GroupsReport>,
    /// How it was relit; none where it is as it was solved.
    #[serde(default)]
    pub relit: Option<RelitReport>,
}
