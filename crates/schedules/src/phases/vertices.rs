//! Values at the corners of leaves, from the leaves around them (D34): what a bilinear picture is drawn from.

use crate::cost;
use crate::pairs::Pairs;
use crate::store::{self, Store};
use crate::worker::Worker;
use isolux_core::solution::{around_corner, corner_mean};
use isolux_core::tree::{Path, quadrant_of};
use isolux_core::units::Rgb;
use isolux_machine::Processor;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// Finds the values at a leaf's corners: the mean over the leaves of its root that meet there.
    pub(crate) async fn interpolate_leaf(&self, element: u32) {
        let place = self.place_of(element).await;
        let root = place.path.root_index();
        let outline = &self.place(Path::root(root)).corners;
        let normal = self.cx.problem.scene.polygons[place.polygon as usize].plane.normal;
        for corner in 0..place.corners.len() {
            let mut around: Vec<(u32, Rgb)> = Vec::new();
            let (mut points, mut levels) = (0, 0);
            for point in around_corner(&place.corners, corner, outline, normal) {
                let (leaf, depth) = self.locate(root, normal, point).await;
                points += 1;
                levels += u64::from(depth);
                if !around.iter().any(|&(other, _)| other == leaf) {
                    let slot = Store::slots(self.cx.problem.parameters.update, self.iteration)[1];
                    let words = self.p.load_block(self.cx.store.element(leaf, slot)).await;
                    around.push((leaf, store::rgb(words)));
                }
            }
            let values: Vec<Rgb> = around.into_iter().map(|(_, value)| value).collect();
            let mean = corner_mean(&values);
            self.charge(cost::INTERPOLATE, cost::corner_steps(points, levels)).await;
            self.p.store_block(self.cx.store.vertex(element, corner as u64), store::bits(mean)).await;
        }
    }

    /// The leaf below a root that holds a point, and how many levels below.
    async fn locate(&self, root: u32, normal: glam::DVec3, point: glam::DVec3) -> (u32, u32) {
        let mut element = root;
        let mut path = Path::root(root);
        loop {
            let first = self.p.load(self.cx.store.element(element, store::FIRST_CHILD)).await as u32;
            if first == 0 {
                return (element, path.depth());
            }
            let quadrant = quadrant_of(&self.place(path).corners, normal, point);
            (element, path) = (first + quadrant, path.child(quadrant));
        }
    }
}
