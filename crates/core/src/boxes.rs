//! A tree of boxes to find neighbours in: boxes go in, those that a question concerns come out, in the same order every
//! time.

use glam::DVec3;
use std::ops::ControlFlow;

/// Boxes in a leaf. With 4 or 16 the whole audit of 100,000 triangles takes as long, within the noise of 30 %.
const LEAF: usize = 8;

/// An axis-parallel box, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Box3 {
    pub(crate) low: DVec3,
    pub(crate) high: DVec3,
}

impl Box3 {
    /// The smallest box around points, larger by `margin` on every side.
    pub(crate) fn around(points: impl IntoIterator<Item = DVec3>, margin: f64) -> Box3 {
        let empty = Box3 { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };
        let tight =
            points.into_iter().fold(empty, |all, point| Box3 { low: all.low.min(point), high: all.high.max(point) });
        Box3 { low: tight.low - margin, high: tight.high + margin }
    }

    /// Do the boxes have a point in common?
    pub(crate) fn meets(&self, other: &Box3) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Does the box meet the segment from `a` to `b`?
    pub(crate) fn meets_segment(&self, a: DVec3, b: DVec3) -> bool {
        let (mut near, mut far) = (0.0, 1.0);
        for axis in 0..3 {
            let (start, step) = (a[axis], b[axis] - a[axis]);
            if step == 0.0 {
                if start < self.low[axis] || start > self.high[axis] {
                    return false;
                }
                continue;
            }
            let (t0, t1) = ((self.low[axis] - start) / step, (self.high[axis] - start) / step);
            near = f64::max(near, t0.min(t1));
            far = f64::min(far, t0.max(t1));
        }
        near <= far
    }

    /// Least and largest of `normal . x` over the box.
    pub(crate) fn extent_along(&self, normal: DVec3) -> (f64, f64) {
        let middle = normal.dot((self.low + self.high) * 0.5);
        let half = normal.abs().dot((self.high - self.low) * 0.5);
        (middle - half, middle + half)
    }

    fn around_both(&self, other: &Box3) -> Box3 {
        Box3 { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

enum Below {
    /// Its boxes, as a range of `order`.
    Items(usize, usize),
    /// The second child; the first is the next node.
    Nodes(usize),
}

/// A balanced tree over boxes, split at the median along the longest side.
pub(crate) struct Boxes {
    nodes: Vec<(Box3, Below)>,
    order: Vec<u32>,
    items: Vec<Box3>,
}

impl Boxes {
    pub(crate) fn new(items: Vec<Box3>) -> Boxes {
        let order = (0..items.len() as u32).collect();
        let mut tree = Boxes { nodes: Vec::new(), order, items };
        if !tree.items.is_empty() {
            tree.grow(0, tree.items.len());
        }
        tree
    }

    /// Halves the range until it fits a leaf: as deep as the logarithm of the number of boxes.
    fn grow(&mut self, start: usize, end: usize) {
        let items = &self.items;
        let range = &mut self.order[start..end];
        let first = items[range[0] as usize];
        let around = range.iter().fold(first, |all, &item| all.around_both(&items[item as usize]));
        let node = self.nodes.len();
        if range.len() <= LEAF {
            self.nodes.push((around, Below::Items(start, end)));
            return;
        }
        let middle = |item: u32| items[item as usize].low + items[item as usize].high;
        let spread = Box3::around(range.iter().map(|&item| middle(item)), 0.0);
        let sides = spread.high - spread.low;
        let axis = (0..3).fold(0, |best, axis| if sides[axis] > sides[best] { axis } else { best });
        let half = range.len() / 2;
        range.select_nth_unstable_by(half, |&p, &q| middle(p)[axis].total_cmp(&middle(q)[axis]).then(p.cmp(&q)));
        self.nodes.push((around, Below::Nodes(0)));
        self.grow(start, start + half);
        self.nodes[node].1 = Below::Nodes(self.nodes.len());
        self.grow(start + half, end);
    }

    /// Calls `found` for every box that `concerns` says yes to, as long as it says to continue. `concerns` must say yes
    /// to every box around one that it says yes to.
    pub(crate) fn search(&self, concerns: impl Fn(&Box3) -> bool, found: impl FnMut(u32) -> ControlFlow<()>) {
        self.search_along(DVec3::ZERO, concerns, found);
    }

    /// As [`Boxes::search`], roughly in the order in which a direction comes by: for questions that what is found makes
    /// narrower.
    pub(crate) fn search_along(
        &self,
        direction: DVec3,
        concerns: impl Fn(&Box3) -> bool,
        mut found: impl FnMut(u32) -> ControlFlow<()>,
    ) {
        let mut open = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = open.pop() {
            let (around, below) = &self.nodes[index];
            if !concerns(around) {
                continue;
            }
            match *below {
                Below::Nodes(second) => {
                    let place = |node: usize| direction.dot(self.nodes[node].0.low + self.nodes[node].0.high);
                    let is_behind = place(second) < place(index + 1);
                    open.extend(if is_behind { [index + 1, second] } else { [second, index + 1] });
                }
                Below::Items(start, end) => {
                    for &item in &self.order[start..end] {
                        if concerns(&self.items[item as usize]) && found(item).is_break() {
                            return;
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Stream;

    /// Catches boxes that a search misses or tells twice, for boxes, segments and planes, against looking at all.
    #[test]
    fn a_search_finds_what_looking_at_all_finds() {
        let mut stream = Stream::new(7);
        let mut point = |size: f64| DVec3::new(stream.next_unit(), stream.next_unit(), stream.next_unit()) * size;
        let items: Vec<Box3> = (0..500)
            .map(|k| {
                let (low, size) = (point(1.0), if k % 7 == 0 { 1.0 } else { 0.05 });
                Box3 { low, high: low + point(size) }
            })
            .collect();
        let boxes = Boxes::new(items.clone());
        let check = |concerns: &dyn Fn(&Box3) -> bool| {
            let mut found = Vec::new();
            boxes.search(concerns, |item| {
                found.push(item);
                ControlFlow::Continue(())
            });
            found.sort_unstable();
            let expected: Vec<u32> = (0..500).filter(|&k| concerns(&items[k as usize])).collect();
            assert_eq!(found, expected);
            found.len()
        };
        let mut met = 0;
        for k in 0..50 {
            let (a, b) = (point(1.5), point(1.5));
            // Along an axis, too, where a slab is parallel to the segment.
            let b = if k % 5 == 0 { DVec3::new(a.x, b.y, a.z) } else { b };
            met += check(&|around| around.meets_segment(a, b));
            let probe = Box3::around([a, a + point(0.2)], 0.0);
            met += check(&|around| around.meets(&probe));
            let normal = (b - a).normalize();
            met += check(&|around| {
                let (low, high) = around.extent_along(normal);
                low <= normal.dot(a) && normal.dot(a) <= high
            });
        }
        assert!(met > 1000, "{met}: the searches found too little to say anything");
    }

    /// Catches a segment taken for missing a box that it crosses, for lying beside, before or behind it, or for touching.
    #[test]
    fn a_segment_meets_the_box_that_it_crosses() {
        let unit = Box3 { low: DVec3::ZERO, high: DVec3::ONE };
        let at = DVec3::new;
        let meets = |a, b| unit.meets_segment(a, b);
        assert!(meets(at(-1.0, 0.5, 0.5), at(2.0, 0.5, 0.5)) && meets(at(2.0, 0.5, 0.5), at(-1.0, 0.5, 0.5)));
        assert!(meets(at(0.2, 0.2, 0.2), at(0.3, 0.3, 0.3)) && meets(at(-1.0, -1.0, -1.0), at(0.0, 0.0, 0.0)));
        assert!(!meets(at(-1.0, 0.5, 0.5), at(-0.1, 0.5, 0.5)) && !meets(at(-1.0, 1.5, 0.5), at(2.0, 1.5, 0.5)));
        assert!(!meets(at(-0.6, 0.5, 0.5), at(0.5, 1.7, 0.5)));
    }
}
