//! In which order polygons are inserted: a scene goes in, a permutation of its fronts comes out.

use super::{Cut, cut};
use crate::kernels::visibility::SplitMix64;
use crate::scene::{Corners, Plane, Scene};
use serde::{Deserialize, Serialize};

/// The order in which the fronts of a scene are inserted in its BSP tree; the number of fragments depends on it, what
/// rays hit does not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InsertionOrder {
    /// File order.
    #[default]
    AsGiven,
    /// By area, the largest first; equal areas in file order.
    LargestFirst,
    /// The order that a greedy autopartition gives: at each node the piece is chosen whose plane cuts the fewest of the
    /// others there (of equals that with the larger area, then the first in the file), the others are split by it, and
    /// what is in front and behind goes on alike. A polygon takes its place when the first of its pieces is chosen, or
    /// lies in the plane of the chosen one.
    ///
    /// After Fuchs, Kedem, Naylor 1980, "On visible surface generation by a priori tree structures", who choose the
    /// polygon that splits the fewest of the others.
    FewestCuts,
    /// A random order with this seed.
    Random(u64),
}

/// Candidates looked at where more pieces come to a node; evenly spaced in their order. The room of
/// `scenes/` has 464 fragments with 4 candidates, 428 with 16, 374 with 64, 372 with all.
const CANDIDATES: usize = 64;

impl InsertionOrder {
    /// The fronts of `scene`, each once, in this order.
    #[must_use]
    pub fn sequence(self, scene: &Scene) -> Vec<u32> {
        self.sequence_while(scene, &mut |_| true).unwrap_or_default()
    }

    /// As [`InsertionOrder::sequence`]; where this takes work, `go_on` hears for each node how many pieces were looked
    /// at. `None` when it says no.
    pub(super) fn sequence_while(self, scene: &Scene, go_on: &mut dyn FnMut(u64) -> bool) -> Option<Vec<u32>> {
        let mut sequence: Vec<u32> = (0..scene.fronts as u32).collect();
        match self {
            InsertionOrder::AsGiven => {}
            InsertionOrder::LargestFirst => {
                let area = |&polygon: &u32| scene.polygons[polygon as usize].area;
                sequence.sort_by(|p, q| area(q).total_cmp(&area(p)));
            }
            InsertionOrder::FewestCuts => return fewest_cuts(scene, go_on),
            InsertionOrder::Random(seed) => SplitMix64::new(seed).shuffle(&mut sequence),
        }
        Some(sequence)
    }
}

/// A piece of a polygon.
#[derive(Clone, Copy)]
struct Piece {
    polygon: u32,
    corners: Corners,
}

/// The sequence of [`InsertionOrder::FewestCuts`].
fn fewest_cuts(scene: &Scene, go_on: &mut dyn FnMut(u64) -> bool) -> Option<Vec<u32>> {
    let tolerance = scene.tolerance();
    let plane = |piece: &Piece| scene.polygons[piece.polygon as usize].plane;
    let mut sequence = Vec::with_capacity(scene.fronts);
    let mut placed = vec![false; scene.fronts];
    let whole = scene.polygons[..scene.fronts].iter().zip(0..);
    // Nodes that are still to be made, the next one last.
    let mut open: Vec<Vec<Piece>> =
        vec![whole.map(|(polygon, index)| Piece { polygon: index, corners: polygon.corners }).collect()];
    while let Some(pieces) = open.pop() {
        let candidates = pieces.len().min(CANDIDATES);
        let cuts = |chosen: &Piece| {
            let plane = plane(chosen);
            pieces.iter().filter(|piece| is_cut(&piece.corners, &plane, tolerance)).count()
        };
        let judged = (0..candidates).map(|k| {
            let piece = &pieces[k * pieces.len() / candidates];
            (cuts(piece), piece.corners.area(), piece)
        });
        let better = |a: &(usize, f64, &Piece), b: &(usize, f64, &Piece)| {
            a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.polygon.cmp(&b.2.polygon))
        };
        let Some((.., chosen)) = judged.min_by(better) else { continue };
        let plane = plane(chosen);
        let mut place = |polygon: u32| {
            if !std::mem::replace(&mut placed[polygon as usize], true) {
                sequence.push(polygon);
            }
        };
        place(chosen.polygon);
        let (mut front, mut back) = (Vec::new(), Vec::new());
        for piece in &pieces {
            let part = |&corners: &Corners| Piece { polygon: piece.polygon, corners };
            match cut(&piece.corners, &plane, tolerance) {
                Cut::Coplanar => place(piece.polygon),
                Cut::Front => front.push(*piece),
                Cut::Back => back.push(*piece),
                Cut::Both { front: before, back: behind } => {
                    front.extend(before.iter().map(part));
                    back.extend(behind.iter().map(part));
                }
            }
        }
        if !go_on((candidates as u64 + 1) * pieces.len() as u64) {
            return None;
        }
        open.extend([back, front].into_iter().filter(|side| !side.is_empty()));
    }
    Some(sequence)
}

/// Would [`cut`] make two parts?
fn is_cut(corners: &Corners, plane: &Plane, tolerance: f64) -> bool {
    let (mut in_front, mut behind) = (false, false);
    for &corner in corners.iter() {
        let distance = plane.distance(corner);
        in_front |= distance > tolerance;
        behind |= distance < -tolerance;
    }
    in_front && behind
}
