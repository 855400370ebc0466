//! A box and a plane in, the primitives that may come near both out.

use super::Bvh8;
use super::node::LEAF;
use crate::lanes::WIDTH;

impl Bvh8 {
    /// Calls `found` with every primitive whose box meets the box from `low` to `high` and comes within `slack` of the plane
    /// `normal . x = offset`; with some whose box barely does not, since boxes are padded. In no order that means anything.
    ///
    /// `plane`: the unit normal and the offset.
    pub fn near_plane(&self, low: [f32; 3], high: [f32; 3], plane: [f32; 4], slack: f32, found: &mut impl FnMut(u32)) {
        if self.nodes.is_empty() {
            return;
        }
        let meets = |planes: &[[f32; WIDTH]; 6], k: usize| {
            let mut beside = false;
            // Middle and half width of the box along the normal.
            let (mut middle, mut half) = (-plane[3], slack);
            for axis in 0..3 {
                let (from, to) = (planes[axis][k], planes[axis + 3][k]);
                beside |= from > high[axis] || to < low[axis];
                middle += plane[axis] * 0.5 * (from + to);
                half += plane[axis].abs() * 0.5 * (to - from);
            }
            !beside && middle.abs() <= half
        };
        let mut stack = vec![0];
        while let Some(child) = stack.pop() {
            if child & LEAF != 0 {
                let block = &self.blocks[(child & !LEAF) as usize];
                let count = block.ids.iter().take_while(|&&id| id != super::node::NONE).count();
                (0..count).filter(|&k| meets(&block.planes, k)).for_each(|k| found(block.ids[k]));
                continue;
            }
            let node = &self.nodes[child as usize];
            let children = (0..WIDTH).filter(|k| node.present >> k & 1 == 1);
            stack.extend(children.filter(|&k| meets(&node.planes, k)).map(|k| node.children[k]));
        }
    }
}
