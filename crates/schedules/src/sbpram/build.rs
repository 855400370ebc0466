//! Phase 1': the polygons of a node are split in two lists, and each goes on by itself. The same tree as by insertion: a
//! node's plane is that of the first polygon that comes to it, and lists keep the order.

use crate::cost;
use crate::pairs::Pairs;
use crate::store::{self, Counter};
use crate::task::Task;
use crate::worker::Worker;
use isolux_core::scene::Corners;
use isolux_core::tree::Bsp;
use isolux_core::tree::bsp::Cut;
use isolux_machine::Processor;

/// A list of pieces that grows at its end.
#[derive(Clone, Copy, Default)]
struct List {
    first: u32,
    last: u32,
}

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// Writes all polygons as the list of the tree's root: record k is the k-th in the order of insertion. Every processor
    /// writes its share.
    pub(crate) async fn list_polygons(&self) {
        let order = &self.cx.problem.order;
        let mut at = self.p.id();
        while at < order.len() {
            let corners = self.cx.problem.scene.polygons[order[at] as usize].corners;
            self.charge(cost::INSERT, 1).await;
            let next = if at + 1 < order.len() { at as u64 + 2 } else { 0 };
            self.write_piece(at as u32, order[at], &corners, next).await;
            at += self.p.count();
        }
    }

    /// B': the first piece of a list makes the node, the others go on in front of it and behind.
    pub(crate) async fn partition(&self, node: u32, first: u32) {
        let mut lists = [List::default(); 2];
        let mut at = first + 1;
        while let Some(piece) = at.checked_sub(1) {
            let words: [u64; 15] = self.p.load_block(self.cx.store.piece(piece, 0)).await;
            at = words[store::NEXT_PIECE as usize] as u32;
            let polygon = words[0] as u32;
            let Some(corners) = Self::corners(&words) else { continue };
            if piece == first {
                self.write_node(node, polygon).await;
                self.settle_piece(polygon, &corners).await;
                continue;
            }
            match self.cut_at(node, &corners).await {
                Cut::Coplanar => {
                    let in_plane = self.cx.store.node(node, store::IN_PLANE);
                    let there = self.p.load(in_plane).await;
                    self.p.store(in_plane, there + 1).await;
                    self.settle_piece(polygon, &corners).await;
                }
                Cut::Front => self.append_piece(&mut lists[0], piece).await,
                Cut::Back => self.append_piece(&mut lists[1], piece).await,
                Cut::Both { front, back } => {
                    for (list, parts) in lists.iter_mut().zip([front, back]) {
                        for part in parts.iter() {
                            let Some(new) = self.reserve(Counter::Pieces, 1, self.cx.store.sizes.pieces).await else {
                                return;
                            };
                            self.write_piece(new, polygon, part, 0).await;
                            self.append_piece(list, new).await;
                        }
                    }
                }
            }
        }
        let children = &self.cx.problem.bsp.nodes()[node as usize];
        let below = lists.into_iter().zip([(store::FRONT, children.front), (store::BACK, children.back)]);
        let below: Vec<_> = below.filter(|(list, _)| list.first != 0).collect();
        self.cx.queues.announce(&self.p, below.len() as u64).await;
        for (list, (side, child)) in below {
            self.p.store(self.cx.store.piece(list.last - 1, store::NEXT_PIECE), 0).await;
            // Nodes are named by their place in the tree; without such a place the tree is another one.
            assert_ne!(child, Bsp::NONE, "a task's tree has a node that the inserted one lacks");
            self.p.store(self.cx.store.node(node, side), u64::from(child) + 1).await;
            self.put(Task::Partition { node: child, first: list.first - 1 }).await;
        }
    }

    pub(crate) async fn settle_piece(&self, polygon: u32, corners: &Corners) {
        for &root in self.cx.problem.roots_of_piece(polygon, corners).into_iter().flatten() {
            self.new_root(root).await;
        }
    }

    async fn append_piece(&self, list: &mut List, piece: u32) {
        match list.last.checked_sub(1) {
            Some(last) => self.p.store(self.cx.store.piece(last, store::NEXT_PIECE), u64::from(piece) + 1).await,
            None => list.first = piece + 1,
        }
        list.last = piece + 1;
    }

    async fn write_piece(&self, piece: u32, polygon: u32, corners: &Corners, next: u64) {
        let mut words = [0; store::PIECE_WORDS as usize];
        (words[0], words[1]) = (polygon.into(), corners.len() as u64);
        for (k, corner) in corners.iter().enumerate() {
            words[2 + 3 * k..5 + 3 * k].copy_from_slice(&corner.to_array().map(f64::to_bits));
        }
        words[store::NEXT_PIECE as usize] = next;
        self.p.store_block(self.cx.store.piece(piece, 0), words).await;
    }
}
