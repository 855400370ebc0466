//! What is to be solved, before anything is done: a scene, its tree and parameters go in; names, places and sizes that all
//! schedules share come out. Nothing here depends on time.

use glam::DVec3;
use isolux_core::kernels::Patch;
use isolux_core::links::Named;
use isolux_core::scene::{Corners, Scene};
use isolux_core::solution::{Parameters, Roots};
use isolux_core::tree::{Bsp, InsertionOrder, Path, fragment_roots, quarter};
use rustc_hash::FxHashMap;
use std::sync::OnceLock;

/// An element's place: what its name alone determines.
#[derive(Debug)]
pub struct Place {
    /// Its name.
    pub path: Path,
    /// Corners, metres.
    pub corners: Corners,
    /// Area, m².
    pub area: f64,
    /// The polygon that it is a part of.
    pub polygon: u32,
    quarters: OnceLock<Box<[Place; 4]>>,
}

impl Place {
    fn new(path: Path, corners: Corners, polygon: u32) -> Place {
        Place { path, corners, area: corners.area(), polygon, quarters: OnceLock::new() }
    }

    fn quarters(&self) -> &[Place; 4] {
        self.quarters.get_or_init(|| {
            let parts = quarter(&self.corners);
            Box::new([0, 1, 2, 3].map(|k| Place::new(self.path.child(k as u32), parts[k], self.polygon)))
        })
    }
}

/// A piece of a polygon, by its corners' bits.
type PieceKey = (u32, Vec<[u64; 3]>);

/// A scene to be solved by schedules.
#[derive(Debug)]
pub struct Problem<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its tree, for the rays of kernels; the one that tasks build is compared with it.
    pub bsp: &'a Bsp,
    /// Thresholds and kernels.
    pub parameters: Parameters,
    /// Fronts in the order of insertion.
    pub order: Vec<u32>,
    /// Roots that exchange light, in the order of their names.
    pub active_roots: Vec<u32>,
    roots: Vec<Place>,
    pieces: FxHashMap<PieceKey, Vec<u32>>,
}

impl<'a> Problem<'a> {
    /// The problem of a scene whose tree was built in this order. `active` says of each polygon whether it takes part.
    #[must_use]
    pub fn new(
        scene: &'a Scene,
        bsp: &'a Bsp,
        order: InsertionOrder,
        parameters: Parameters,
        active: &[bool],
    ) -> Problem<'a> {
        let fragments = fragment_roots(scene, bsp);
        let mut pieces: FxHashMap<PieceKey, Vec<u32>> = FxHashMap::default();
        for (index, root) in fragments.iter().enumerate() {
            let fragment = &bsp.fragments()[root.fragment as usize];
            let root = match parameters.roots {
                Roots::Polygons => root.polygon,
                Roots::Fragments => index as u32,
            };
            pieces.entry(key(fragment.polygon, &fragment.corners)).or_default().push(root);
        }
        let corners: Vec<(Corners, u32)> = match parameters.roots {
            Roots::Polygons => scene.polygons.iter().map(|polygon| polygon.corners).zip(0..).collect(),
            Roots::Fragments => fragments.iter().map(|root| (root.corners, root.polygon)).collect(),
        };
        let places = corners
            .into_iter()
            .zip(0..)
            .map(|((corners, polygon), root)| Place::new(Path::root(root), corners, polygon));
        let places: Vec<Place> = places.collect();
        let active_roots = (0..places.len() as u32).filter(|&r| active[places[r as usize].polygon as usize]).collect();
        Problem { scene, bsp, parameters, order: order.sequence(scene), active_roots, roots: places, pieces }
    }

    /// Number of roots, those that take no part included.
    #[must_use]
    pub fn roots(&self) -> usize {
        self.roots.len()
    }

    /// The place of a name.
    #[must_use]
    pub fn place(&self, path: Path) -> &Place {
        path.quadrants().fold(&self.roots[path.root_index() as usize], |place, k| &place.quarters()[k])
    }

    /// A place as the evaluation of pairs wants it.
    #[must_use]
    pub fn named<'b>(&'b self, place: &'b Place) -> Named<'b> {
        let plane = &self.scene.polygons[place.polygon as usize].plane;
        Named { path: place.path, patch: Patch { corners: &place.corners, plane, area: place.area } }
    }

    /// The roots that a piece of a front stands for: its own (or its polygon's, where polygons are the roots), and that of
    /// the back. `None` for a piece that the tree does not have.
    #[must_use]
    pub fn roots_of_piece(&self, front: u32, corners: &Corners) -> Option<&[u32]> {
        self.pieces.get(&key(front, corners)).map(Vec::as_slice)
    }

    /// Can light go straight from one root to the other, as far as their polygons' planes say?
    #[must_use]
    pub fn face_each_other(&self, a: u32, b: u32) -> bool {
        let polygon = |root: u32| &self.scene.polygons[self.roots[root as usize].polygon as usize];
        if self.roots[a as usize].polygon == self.roots[b as usize].polygon {
            return false;
        }
        let (p, q) = (polygon(a), polygon(b));
        let in_front = |plane: &isolux_core::scene::Plane, corners: &[DVec3]| {
            corners.iter().any(|&corner| plane.distance(corner) > 0.0)
        };
        in_front(&p.plane, &q.corners) && in_front(&q.plane, &p.corners)
    }
}

fn key(polygon: u32, corners: &Corners) -> PieceKey {
    (polygon, corners.iter().map(|corner| corner.to_array().map(f64::to_bits)).collect())
}
