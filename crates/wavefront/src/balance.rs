//! Two checks of a finished solve that need not come out right: where the emitted power went, with losses that rays measure
//! which know nothing of links, and how much of its surroundings the links of each leaf account for.

use crate::geometry::{End, NONE};
use crate::light::mean_over;
use crate::outcome::{Outcome, irradiance_in};
use crate::rays::even_point_of;
use crate::solve::Solved;
use crate::spread::arriving;
use isolux_core::sampling::{Stream, mix};
use isolux_core::solution::{Balance, RowSums};
use isolux_core::tree::ElementId;
use isolux_core::units::Rgb;
use rayon::prelude::*;

/// Rays of the balance: a loss of half of all light comes out within 0.4 % of the light that travels.
const RAYS: usize = 1 << 14;

/// Points that are tried on a leaf that is partly covered: one with a sixteenth open is missed by 100 of them in 0.2 % of
/// all cases, and its ray then counts as lost.
const MOST_ATTEMPTS: u32 = 100;

/// Rays that are followed one after the other.
const CHUNK: usize = 256;

/// What a ray carries away for good.
#[derive(Clone, Copy)]
enum Loss {
    Escaped(Rgb),
    ToBacks(Rgb),
}

/// Leaves by the light that leaves them.
struct Leaving {
    leaves: Vec<ElementId>,
    /// Light that leaves all leaves before each, mean over bands, W or lm.
    before: Vec<f64>,
    total: f64,
}

impl Leaving {
    fn new(outcome: &Outcome, active: &[bool]) -> Leaving {
        let Outcome { elements, light, .. } = outcome;
        let mut leaving = Leaving { leaves: Vec::new(), before: Vec::new(), total: 0.0 };
        for leaf in elements.leaves().filter(|&leaf| active[elements.get(leaf).polygon as usize]) {
            let power = light.radiosity(leaf).mean() * elements.get(leaf).area * light.open_share(leaf);
            if power > 0.0 {
                leaving.leaves.push(leaf);
                leaving.before.push(leaving.total);
                leaving.total += power;
            }
        }
        leaving
    }

    /// The leaf that holds a share in [0, 1) of the light.
    fn at(&self, share: f64) -> ElementId {
        let after = self.before.partition_point(|&before| before <= share * self.total);
        self.leaves[after.max(1) - 1]
    }
}

impl Solved {
    /// Where the emitted power went, by the light of `outcome`; what lamps throw on surfaces, as this solve has it, is emitted
    /// there. Each ray starts at a random point of the surfaces, with
    /// probability proportional to the light that leaves its leaf, and carries what leaves that point. `active`: polygons
    /// that take part.
    #[must_use]
    pub fn balance(&self, outcome: &Outcome, active: &[bool]) -> Balance {
        let scene = &*self.geometry.scene;
        let Outcome { elements, light, .. } = outcome;
        let mut balance = Balance {
            emitted: scene.emitted_power(),
            absorbed: Rgb::ZERO,
            escaped: Rgb::ZERO,
            lost_to_backs: Rgb::ZERO,
            standard_error: 0.0,
            rays: 0,
        };
        // What lamps throw counts as emitted where it arrives: parallel light has no other measure.
        for (leaf, lit) in self.transport.elements.iter().zip(&self.light.lit) {
            if leaf.first_child == NONE {
                let power = mean_over(lit, leaf).map(|value| f64::from(value * leaf.area * leaf.open_share()));
                balance.emitted += Rgb(power);
            }
        }
        for leaf in elements.leaves() {
            let element = elements.get(leaf);
            let polygon = &scene.polygons[element.polygon as usize];
            balance.absorbed += polygon.absorptance() * light.irradiance(leaf) * element.area;
            balance.lost_to_backs += polygon.emission * (element.area * (1.0 - light.open_share(leaf)));
        }
        let leaving = Leaving::new(outcome, active);
        if leaving.total <= 0.0 {
            return balance;
        }
        let losses: Vec<Option<Loss>> = (0..RAYS)
            .into_par_iter()
            .with_min_len(CHUNK)
            .map(|ray| self.loss(&leaving, ray, outcome, active))
            .collect();
        let (mut sum, mut squares) = (0.0, 0.0);
        for loss in losses.into_iter().flatten() {
            let carried = match loss {
                Loss::Escaped(carried) => {
                    balance.escaped += carried;
                    carried
                }
                Loss::ToBacks(carried) => {
                    balance.lost_to_backs += carried;
                    carried
                }
            };
            sum += carried.mean();
            squares += carried.mean() * carried.mean();
        }
        balance.rays = RAYS as u64;
        balance.standard_error = (squares - sum * sum / RAYS as f64).max(0.0).sqrt();
        balance
    }

    /// What the ray of that number carries away; nothing where it ends on a side that takes part.
    fn loss(&self, leaving: &Leaving, ray: usize, outcome: &Outcome, active: &[bool]) -> Option<Loss> {
        let geometry = &*self.geometry;
        let mut stream = Stream::new(mix(self.transport.seed ^ 0x0062_616c_616e_6365) ^ ray as u64);
        let leaf = leaving.at((ray as f64 + stream.next_unit()) / RAYS as f64);
        let element = &self.transport.elements[leaf.index()];
        let normal = geometry.surfaces[element.polygon as usize].normal;
        let mut attempt = 0;
        loop {
            attempt += 1;
            let jitter = [stream.next_unit() as f32, stream.next_unit() as f32];
            let point = even_point_of(element, jitter);
            let direction = stream.cosine_direction(normal.as_dvec3()).as_vec3();
            let is_lost = match geometry.end(point, normal, direction, &mut stream) {
                End::Nowhere => Loss::Escaped,
                End::Side(side, _) if active[side as usize] => return None,
                End::Side(..) | End::Back => Loss::ToBacks,
            };
            // Only open parts send light: from a covered point, try another one.
            let may_be_covered = outcome.light.open_share(leaf) < 1.0 && attempt < MOST_ATTEMPTS;
            if may_be_covered && crate::contacts::is_covered(point, element.polygon, geometry) {
                continue;
            }
            let polygon = &geometry.scene.polygons[element.polygon as usize];
            let core = outcome.elements.get(leaf);
            let place = point.as_dvec3() + geometry.middle;
            let received = irradiance_in(&core.corners, polygon.plane.normal, place, &outcome.fields[leaf.index()]);
            let radiosity = polygon.emission + polygon.reflectance * received;
            let mean = outcome.light.radiosity(leaf).mean();
            return Some(is_lost(radiosity * (leaving.total / RAYS as f64 / mean)));
        }
    }

    /// Sums of form factor times visibility over the links of a leaf and of all above it: what it would receive if every
    /// surface threw 1. A cluster throws what its intensity says, as it does in the solve. Over the leaves of `active`
    /// polygons; `None` where there is none.
    #[must_use]
    pub fn row_sums(&self, active: &[bool]) -> Option<RowSums> {
        let elements = &self.transport.elements;
        let sums = arriving(&vec![[1.0; 3]; elements.len()], &self.transport);
        let (mut found, mut open) = (None::<RowSums>, 0.0);
        let leaves = elements.iter().enumerate().filter(|(_, element)| {
            element.first_child == NONE && element.open != 0 && active[element.polygon as usize]
        });
        for (index, element) in leaves {
            let (id, sum) = (ElementId(index as u32), f64::from(sums[index][0]));
            let area = f64::from(element.area * element.open_share());
            let record = found.get_or_insert(RowSums { largest: (sum, id), smallest: (sum, id), mean: 0.0 });
            if sum > record.largest.0 {
                record.largest = (sum, id);
            }
            if sum < record.smallest.0 {
                record.smallest = (sum, id);
            }
            record.mean += sum * area;
            open += area;
        }
        found.map(|record| RowSums { mean: record.mean / open, ..record })
    }
}
