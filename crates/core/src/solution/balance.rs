//! Checks that need not come out right: an energy balance whose losses are measured by rays that know nothing of
//! links, and sums of form factors over the rows of the system.

use super::trace::trace;
use super::{Flow, Observer, Phase, Progress, Watch};
use crate::kernels::Probe;
use crate::kernels::visibility::is_open;
use crate::links::Hierarchy;
use crate::sampling::{Stream, mix};
use crate::scene::Scene;
use crate::tree::{Bsp, ElementId};
use crate::units::Rgb;

/// Rays of the balance: a loss of half of all light comes out within 0.2 % of the light that travels.
const RAYS: u64 = 1 << 16;

/// Points that are tried on a leaf that is partly covered: one with a sixteenth open is missed by 100 of them in
/// 0.2 % of all cases, and its ray then counts as lost.
const MOST_ATTEMPTS: u32 = 100;

/// Where the emitted power went, per band, W or lm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Emitted by all surfaces.
    pub emitted: Rgb,
    /// Turned to heat: `sum A (opacity - rho) H` over the leaves, from the solution.
    pub absorbed: Rgb,
    /// Left the scene, by rays.
    pub escaped: Rgb,
    /// Ended on black backs, or on backs that were overlooked, by rays; and emitted by parts that something covers.
    pub lost_to_backs: Rgb,
    /// Standard error of `escaped + lost_to_backs`, mean over bands.
    pub standard_error: f64,
    /// Rays shot.
    pub rays: u64,
}

impl Balance {
    /// `(absorbed + escaped + lost - emitted) / emitted`, of the means over bands: what is missing or too much.
    #[must_use]
    pub fn imbalance(&self) -> f64 {
        let emitted = self.emitted.mean();
        if emitted > 0.0 {
            ((self.absorbed + self.escaped + self.lost_to_backs).mean() - emitted) / emitted
        } else {
            0.0
        }
    }
}

/// Measures the balance. Each ray starts at a random point of the surfaces with probability proportional to the light
/// that leaves there. `None` when the observer stopped it.
pub fn balance<P: Probe>(
    scene: &Scene,
    bsp: &Bsp,
    hierarchy: &Hierarchy,
    active: &[bool],
    seed: u64,
    probe: &mut P,
    observer: &mut dyn Observer,
) -> Option<Balance> {
    let Hierarchy { elements, light, .. } = hierarchy;
    let leaves: Vec<ElementId> =
        elements.leaves().filter(|&leaf| active[elements.get(leaf).polygon as usize]).collect();
    let leaving: Vec<f64> = leaves
        .iter()
        .map(|&leaf| light.radiosity(leaf).mean() * elements.get(leaf).area * light.open_share(leaf))
        .collect();
    let total: f64 = leaving.iter().sum();
    let absorbed = leaves
        .iter()
        .map(|&leaf| {
            let element = elements.get(leaf);
            scene.polygons[element.polygon as usize].absorptance() * light.irradiance(leaf) * element.area
        })
        .sum();
    let mut balance = Balance {
        emitted: scene.emitted_power(),
        absorbed,
        escaped: Rgb::ZERO,
        lost_to_backs: Rgb::ZERO,
        standard_error: 0.0,
        rays: 0,
    };
    if total <= 0.0 {
        return Some(balance);
    }
    for &leaf in &leaves {
        let element = elements.get(leaf);
        let covered = element.area * (1.0 - light.open_share(leaf));
        balance.lost_to_backs += scene.polygons[element.polygon as usize].emission * covered;
    }
    let emitted_into_cover = balance.lost_to_backs.mean();
    let mut watch = Watch::new(observer, Progress { elements: elements.len(), ..Progress::of(Phase::Balance) });
    let mut squares = 0.0;
    let (mut at, mut passed) = (0, 0.0);
    for ray in 0..RAYS {
        if watch.step(1.0, ray as f64 / RAYS as f64) == Flow::Stop {
            return None;
        }
        let mut stream = Stream::new(mix(seed ^ 0x0062_616c_616e_6365) ^ ray);
        let target = (ray as f64 + stream.next_unit()) / RAYS as f64 * total;
        while at + 1 < leaves.len() && passed + leaving[at] <= target {
            passed += leaving[at];
            at += 1;
        }
        let element = elements.get(leaves[at]);
        let plane = &scene.polygons[element.polygon as usize].plane;
        let radiosity = light.radiosity(leaves[at]);
        let carried = radiosity * (total / RAYS as f64 / radiosity.mean());
        let mut attempt = 0;
        let lost = loop {
            attempt += 1;
            let origin = stream.point(&element.corners, plane);
            let direction = stream.cosine_direction(plane.normal);
            match trace(scene, bsp, plane, origin, direction, &mut stream, probe) {
                None => break Some(&mut balance.escaped),
                Some(ending) if ending.side.is_some_and(|side| active[side as usize]) => break None,
                // Only open parts send light: from a covered point, try another one.
                Some(_)
                    if light.open_share(leaves[at]) < 1.0
                        && attempt < MOST_ATTEMPTS
                        && !is_open(bsp, scene, origin, plane.normal, &mut stream, probe) => {}
                Some(_) => break Some(&mut balance.lost_to_backs),
            }
        };
        if let Some(lost) = lost {
            *lost += carried;
            squares += carried.mean() * carried.mean();
        }
    }
    balance.rays = RAYS;
    let loss = (balance.escaped + balance.lost_to_backs).mean() - emitted_into_cover;
    balance.standard_error = (squares - loss * loss / RAYS as f64).max(0.0).sqrt();
    Some(balance)
}

/// Sums of `F V` over the links of a leaf and its ancestors, per open share: in a closed scene, 1 everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSums {
    /// Largest sum and its leaf.
    pub largest: (f64, ElementId),
    /// Smallest sum and its leaf.
    pub smallest: (f64, ElementId),
    /// Mean, weighted by open area.
    pub mean: f64,
}

/// Measures the row sums over the leaves of active polygons; `None` when there is none.
#[must_use]
pub fn row_sums(hierarchy: &Hierarchy, active: &[bool]) -> Option<RowSums> {
    let Hierarchy { elements, links, light } = hierarchy;
    let mut sums = vec![0.0; elements.len()];
    let mut found: Option<RowSums> = None;
    let mut area = 0.0;
    // Parents come before their children.
    for (index, element) in elements.as_slice().iter().enumerate() {
        let id = ElementId(index as u32);
        let above = element.parent.some().map_or(0.0, |parent| sums[parent.index()]);
        let open_share = light.open_share(id);
        let own: f64 = links.of(id).iter().map(super::super::links::Link::weight).sum();
        let sum = above + if open_share > 0.0 { own / open_share } else { 0.0 };
        sums[index] = sum;
        if !elements.is_leaf(id) || !active[element.polygon as usize] || open_share == 0.0 {
            continue;
        }
        let record = found.get_or_insert(RowSums { largest: (sum, id), smallest: (sum, id), mean: 0.0 });
        if sum > record.largest.0 {
            record.largest = (sum, id);
        }
        if sum < record.smallest.0 {
            record.smallest = (sum, id);
        }
        record.mean += sum * element.area * open_share;
        area += element.area * open_share;
    }
    found.map(|record| RowSums { mean: record.mean / area, ..record })
}
