//! Phase 1: polygons go into the tree one after the other, and pairs of roots get their form factors.

use crate::cost;
use crate::pairs::Pairs;
use crate::problem::Place;
use crate::store::{self, Counter};
use crate::task::Task;
use crate::worker::Worker;
use isolux_core::scene::{Corners, Plane};
use isolux_core::tree::Path;
use isolux_core::tree::bsp::{Cut, cut};
use isolux_machine::{Prefix, Processor};

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// B: inserts a polygon, then makes way for the next one, then has its roots' form factors found with all roots that are
    /// there already.
    pub(crate) async fn insert(&self, at: u32) {
        let problem = self.cx.problem;
        let polygon = problem.order[at as usize];
        let earlier = self.p.load(self.cx.store.counter(Counter::Inserted)).await;
        let mut inserted = earlier;
        for root in self.insert_in_tree(polygon).await {
            self.new_root(root).await;
            if problem.active_roots.binary_search(&root).is_ok() {
                self.p.store(self.cx.store.inserted(inserted), root.into()).await;
                inserted += 1;
            }
        }
        self.p.store(self.cx.store.counter(Counter::Inserted), inserted).await;
        if (at as usize) + 1 < problem.order.len() {
            self.cx.queues.announce(&self.p, 1).await;
            self.put(Task::Insert { at: at + 1 }).await;
        }
        if !self.cx.switches.pair_loop {
            for new in earlier..inserted {
                let root = self.p.load(self.cx.store.inserted(new)).await as u32;
                self.make_factors(root, earlier).await;
            }
        }
    }

    /// Sends a polygon down the tree; gives the roots that its pieces are.
    async fn insert_in_tree(&self, polygon: u32) -> Vec<u32> {
        let problem = self.cx.problem;
        self.charge(cost::INSERT, 1).await;
        let mut roots = Vec::new();
        let mut open = vec![(None, problem.scene.polygons[polygon as usize].corners)];
        while let Some((from, piece)) = open.pop() {
            // Where nothing is yet, the piece makes a node.
            let Some(node) = self.child(from).await else {
                self.new_node(from, polygon).await;
                roots.extend(problem.roots_of_piece(polygon, &piece).into_iter().flatten());
                continue;
            };
            match self.cut_at(node, &piece).await {
                Cut::Coplanar => {
                    self.p.prefix(Prefix::Add, self.cx.store.node(node, store::IN_PLANE), 1).await;
                    roots.extend(problem.roots_of_piece(polygon, &piece).into_iter().flatten());
                }
                Cut::Front => open.push((Some((node, store::FRONT)), piece)),
                Cut::Back => open.push((Some((node, store::BACK)), piece)),
                Cut::Both { front, back } => {
                    open.extend(back.iter().map(|&part| (Some((node, store::BACK)), part)));
                    open.extend(front.iter().map(|&part| (Some((node, store::FRONT)), part)));
                }
            }
        }
        // Where polygons are the roots, all pieces of one stand for the same.
        roots.sort_unstable();
        roots.dedup();
        roots
    }

    /// The node on this side of another, or the root of the tree.
    async fn child(&self, from: Option<(u32, u64)>) -> Option<u32> {
        let at = match from {
            Some((node, side)) => self.cx.store.node(node, side),
            None => self.cx.store.counter(Counter::Nodes),
        };
        let word = self.p.load(at).await as u32;
        match from {
            Some(_) => word.checked_sub(1),
            None => (word > 0).then_some(0),
        }
    }

    async fn new_node(&self, from: Option<(u32, u64)>, polygon: u32) {
        let Some(node) = self.reserve(Counter::Nodes, 1, self.cx.store.sizes.nodes).await else { return };
        self.write_node(node, polygon).await;
        if let Some((parent, side)) = from {
            self.p.store(self.cx.store.node(parent, side), u64::from(node) + 1).await;
        }
    }

    /// Writes a node in the plane of a polygon, one piece of which lies in it.
    pub(crate) async fn write_node(&self, node: u32, polygon: u32) {
        let Plane { normal, offset } = self.cx.problem.scene.polygons[polygon as usize].plane;
        let plane = [normal.x, normal.y, normal.z, offset].map(f64::to_bits);
        let words = [plane[0], plane[1], plane[2], plane[3], 0, 0, 1, polygon.into()];
        self.p.store_block(self.cx.store.node(node, 0), words).await;
    }

    /// How a piece lies to a node's plane.
    pub(crate) async fn cut_at(&self, node: u32, piece: &Corners) -> Cut {
        let words: [u64; 4] = self.p.load_block(self.cx.store.node(node, 0)).await;
        let [x, y, z, offset] = words.map(f64::from_bits);
        let plane = Plane { normal: glam::DVec3::new(x, y, z), offset };
        let parts = cut(piece, &plane, self.cx.problem.bsp.tolerance());
        self.charge(cost::CUT, 1).await;
        if matches!(parts, Cut::Both { .. }) {
            self.charge(cost::SPLIT, 1).await;
        }
        parts
    }

    /// Makes the F-tasks of a root with the first `earlier` ones.
    async fn make_factors(&self, root: u32, earlier: u64) {
        for other in 0..earlier {
            let other = self.p.load(self.cx.store.inserted(other)).await as u32;
            self.charge(cost::CULL, 1).await;
            if self.cx.problem.face_each_other(root, other) {
                self.cx.queues.announce(&self.p, 1).await;
                self.put(Task::Factor { a: root, b: other }).await;
            }
        }
    }

    /// The F-tasks of a root with all roots before it, where the whole tree is there.
    pub(crate) async fn factors(&self, root: u32, at: u32) {
        for index in 0..at as usize {
            let other = self.cx.problem.active_roots[index];
            self.charge(cost::CULL, 1).await;
            if self.cx.problem.face_each_other(root, other) {
                self.cx.queues.announce(&self.p, 1).await;
                self.put(Task::Factor { a: root, b: other }).await;
            }
        }
    }

    /// F: form factors of two roots, each direction by itself. Their visibilities follow in the first iteration (D32).
    pub(crate) async fn factor(&self, a: u32, b: u32) {
        let places: [&Place; 2] = [a, b].map(|root| self.place(Path::root(root)));
        for ([receiver, source], [to, from]) in [([a, b], places), ([b, a], [places[1], places[0]])] {
            let form_factor = self.form_factor(to, from).await;
            if form_factor > 0.0 {
                self.link_roots(receiver, source, form_factor, None).await;
            }
        }
    }
}
