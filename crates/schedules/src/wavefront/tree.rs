//! The tree, level by level: all pieces of a level are cut at once, each at the plane of its node.

use super::Flat;
use crate::cost;
use crate::pairs::Pairs;
use crate::store::{self, Counter};
use crate::worker::Worker;
use isolux_core::scene::Corners;
use isolux_core::tree::bsp::{Cut, cut};
use isolux_machine::{Cause, Mark, Prefix, Processor};

/// The words of a piece that the tasks' lists use otherwise: the place in the order of insertion, and the node.
const AT: usize = 14;
const NODE: usize = 15;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// Builds the tree that insertion in order gives: the founder of a node is the first polygon that comes to it.
    pub(crate) async fn grow_tree(&self, flat: &Flat) {
        let before = self.p.enter(Mark::new(Cause::Work, "B"));
        let order = &self.cx.problem.order;
        self.each(order.len() as u64, 1, async |at| {
            let corners = self.cx.problem.scene.polygons[order[at as usize] as usize].corners;
            self.charge(cost::INSERT, 1).await;
            self.place_piece(flat, at as u32, at as u32, &corners, 0).await;
        })
        .await;
        let (mut low, mut high) = (0, order.len() as u64);
        while low < high {
            self.each(high - low, 1, async |index| self.sink(flat, (low + index) as u32).await).await;
            low = high;
            high = self.p.load(self.cx.store.counter(Counter::Pieces)).await;
            // The next level adds to the counter: not before everyone has read it.
            self.barrier().await;
        }
        self.p.enter(before);
    }

    /// A piece comes to its node: it founds it, lies in its plane, or goes on below it.
    async fn sink(&self, flat: &Flat, piece: u32) {
        let problem = self.cx.problem;
        let words: [u64; 16] = self.p.load_block(self.cx.store.piece(piece, 0)).await;
        let (at, node) = (words[AT] as u32, words[NODE] as u32);
        let polygon = problem.order[at as usize];
        let Some(corners) = Self::corners(&words) else { return };
        let founder = !self.p.load(flat.founders.at(node.into())).await as u32;
        if founder == at {
            let plane = problem.scene.polygons[polygon as usize].plane;
            let words = [plane.normal.x, plane.normal.y, plane.normal.z, plane.offset].map(f64::to_bits);
            self.p.store_block(self.cx.store.node(node, 0), words).await;
            self.p.store(self.cx.store.node(node, store::FOUNDER), polygon.into()).await;
            self.rest(node, polygon, &corners).await;
            return;
        }
        let plane = &problem.scene.polygons[problem.order[founder as usize] as usize].plane;
        self.charge(cost::CUT, 1).await;
        let children = &problem.bsp.nodes()[node as usize];
        let sides = [(store::FRONT, children.front), (store::BACK, children.back)];
        match cut(&corners, plane, problem.bsp.tolerance()) {
            Cut::Coplanar => self.rest(node, polygon, &corners).await,
            Cut::Front => self.send(flat, node, sides[0], at, &corners).await,
            Cut::Back => self.send(flat, node, sides[1], at, &corners).await,
            Cut::Both { front, back } => {
                self.charge(cost::SPLIT, 1).await;
                for (parts, side) in [front, back].into_iter().zip(sides) {
                    for part in parts.iter() {
                        self.send(flat, node, side, at, part).await;
                    }
                }
            }
        }
    }

    async fn rest(&self, node: u32, polygon: u32, corners: &Corners) {
        self.p.prefix(Prefix::Add, self.cx.store.node(node, store::IN_PLANE), 1).await;
        self.settle_piece(polygon, corners).await;
    }

    /// A piece goes to the child of a node, on the next level.
    async fn send(&self, flat: &Flat, node: u32, (side, child): (u64, u32), at: u32, corners: &Corners) {
        self.p.store(self.cx.store.node(node, side), u64::from(child) + 1).await;
        if let Some(piece) = self.reserve(Counter::Pieces, 1, self.cx.store.sizes.pieces).await {
            self.place_piece(flat, piece, at, corners, child).await;
        }
    }

    async fn place_piece(&self, flat: &Flat, piece: u32, at: u32, corners: &Corners, node: u32) {
        let mut words = [0; store::PIECE_WORDS as usize];
        words[1] = corners.len() as u64;
        for (k, corner) in corners.iter().enumerate() {
            words[2 + 3 * k..5 + 3 * k].copy_from_slice(&corner.to_array().map(f64::to_bits));
        }
        (words[AT], words[NODE]) = (at.into(), node.into());
        self.p.store_block(self.cx.store.piece(piece, 0), words).await;
        // The first in order has the largest complement.
        self.p.prefix(Prefix::Max, flat.founders.at(node.into()), !u64::from(at)).await;
    }
}
