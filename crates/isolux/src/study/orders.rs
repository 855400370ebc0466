//! What the order of insertion does to the tree and to the work: orders go in, counts come out.

use super::{RunRequest, ScheduleName, StudyError, StudyProblem, StudySettings};
use isolux_core::scene::{Plane, Scene};
use isolux_core::solution::{Roots, Update};
use isolux_core::tree::{Bsp, InsertionOrder};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// Which orders are to be counted.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OrderRequest {
    /// Orders by name.
    pub orders: Vec<InsertionOrder>,
    /// Seeds of random ones.
    pub seeds: Vec<u64>,
    /// With these settings all work of a solve is counted, too.
    pub coarse: Option<Coarse>,
}

/// Epsilons at which the work is counted.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coarse {
    /// As in [`StudySettings`].
    pub bf_epsilon: f64,
    /// As in [`StudySettings`].
    pub area_epsilon: f64,
    /// As in [`StudySettings`].
    pub energy_epsilon: f64,
    /// Fragments, or polygons.
    pub roots: Roots,
}

/// What an order leads to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OrderCount {
    /// Its name.
    pub order: String,
    /// Its seed, of a random one.
    pub seed: Option<u64>,
    /// Fragments in the tree: roots, where these are elements.
    pub fragments: usize,
    /// Nodes of the tree.
    pub nodes: usize,
    /// Links between fragments of different polygons that face each other, both directions.
    pub root_links: u64,
    /// Work of a whole solve, in instructions.
    pub work: Option<u64>,
    /// Links that it made.
    pub links: Option<u64>,
    /// Seconds of the host.
    pub seconds: f64,
}

/// Counts what orders lead to.
///
/// # Errors
///
/// As a run's, where the work is counted.
pub fn count_orders(scene: &Arc<Scene>, request: &OrderRequest) -> Result<Vec<OrderCount>, StudyError> {
    let random = request.seeds.iter().map(|&seed| InsertionOrder::Random(seed));
    request.orders.iter().copied().chain(random).map(|order| count(scene, order, request.coarse)).collect()
}

fn count(scene: &Arc<Scene>, order: InsertionOrder, coarse: Option<Coarse>) -> Result<OrderCount, StudyError> {
    let since = Instant::now();
    let bsp = Bsp::build(scene, order);
    let mut counted = OrderCount {
        order: name(order).to_owned(),
        seed: if let InsertionOrder::Random(seed) = order { Some(seed) } else { None },
        fragments: bsp.fragments().len(),
        nodes: bsp.nodes().len(),
        root_links: root_links(scene, &bsp),
        work: None,
        links: None,
        seconds: 0.0,
    };
    if let Some(Coarse { bf_epsilon, area_epsilon, energy_epsilon, roots }) = coarse {
        let settings =
            StudySettings { bf_epsilon, area_epsilon, energy_epsilon, roots, order, ..StudySettings::default() };
        let run = RunRequest {
            machine: "sb-pram".to_owned(),
            schedule: ScheduleName::Sbpram,
            variant: None,
            grain: 1,
            update: Update::InPlace,
            processors: 1,
            trace: false,
        };
        let result = StudyProblem::new(Arc::clone(scene), settings)?.simulate(&run, &Arc::default())?;
        counted.work = Some(result.phases.iter().map(|phase| phase.causes["work"]).sum());
        counted.links = Some(result.links);
    }
    counted.seconds = since.elapsed().as_secs_f64();
    Ok(counted)
}

fn name(order: InsertionOrder) -> &'static str {
    match order {
        InsertionOrder::AsGiven => "as-given",
        InsertionOrder::LargestFirst => "largest-first",
        InsertionOrder::FewestCuts => "fewest-cuts",
        InsertionOrder::Random(_) => "random",
    }
}

/// Links between fragments of which each has a corner in front of the other's plane, both directions.
fn root_links(scene: &Scene, bsp: &Bsp) -> u64 {
    let mut fragments_of = vec![Vec::new(); scene.fronts];
    for fragment in bsp.fragments() {
        fragments_of[fragment.polygon as usize].push(&fragment.corners);
    }
    let in_front = |plane: &Plane, of: usize| {
        let seen = |corners: &&&isolux_core::scene::Corners| corners.iter().any(|&corner| plane.distance(corner) > 0.0);
        fragments_of[of].iter().filter(seen).count() as u64
    };
    let plane = |polygon: usize| &scene.polygons[polygon].plane;
    let pairs = (0..scene.fronts).flat_map(|a| (0..a).map(move |b| (a, b)));
    pairs.map(|(a, b)| 2 * in_front(plane(a), b) * in_front(plane(b), a)).sum()
}
