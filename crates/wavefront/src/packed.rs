//! Things of many owners in boxes within boxes: lists by owner go in, what an owner has near a place comes out.

use glam::Vec3;

/// What has a place.
pub(crate) trait Extent {
    /// Lower and upper corner of its box.
    fn extent(&self) -> (Vec3, Vec3);
}

/// Lists by owner.
#[derive(Clone)]
pub(crate) struct Packed<T> {
    /// First node of each owner's boxes; empty where nobody has anything.
    start: Vec<u32>,
    boxes: Vec<Bounds>,
    items: Vec<T>,
}

impl<T> Default for Packed<T> {
    fn default() -> Self {
        Packed { start: Vec::new(), boxes: Vec::new(), items: Vec::new() }
    }
}

/// A box around some items of an owner: of itself, or of the boxes after it up to `next`.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: Vec3,
    high: Vec3,
    /// The box after all that is in this one.
    next: u32,
    /// Its items, where it has no boxes in it.
    first: u32,
    count: u32,
}

/// Most items of a box without boxes in it.
const LEAF: usize = 4;

impl<T: Extent + Copy> Packed<T> {
    pub(crate) fn new(lists: Vec<Vec<T>>) -> Packed<T> {
        let mut packed = Packed { start: Vec::with_capacity(lists.len() + 1), ..Packed::default() };
        for mut own in lists {
            packed.start.push(packed.boxes.len() as u32);
            if !own.is_empty() {
                packed.pack(&mut own);
            }
        }
        packed.start.push(packed.boxes.len() as u32);
        packed
    }

    /// Appends a box around `items`, halved along its longest side until few are in each.
    fn pack(&mut self, items: &mut [T]) {
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = items.iter().map(T::extent).fold(none, |(low, high), (l, h)| (low.min(l), high.max(h)));
        let own = self.boxes.len();
        let (first, count) = (self.items.len() as u32, items.len() as u32);
        self.boxes.push(Bounds { low, high, next: 0, first, count: 0 });
        if items.len() <= LEAF {
            self.boxes[own].count = count;
            self.items.extend_from_slice(items);
        } else {
            let axis = (high - low).max_position();
            let middle = |item: &T| {
                let (low, high) = item.extent();
                low[axis] + high[axis]
            };
            items.sort_unstable_by(|a, b| middle(a).total_cmp(&middle(b)));
            let (left, right) = items.split_at_mut(count as usize / 2);
            self.pack(left);
            self.pack(right);
        }
        self.boxes[own].next = self.boxes.len() as u32;
    }

    /// Does an owner have any?
    pub(crate) fn any(&self, owner: u32) -> bool {
        matches!(self.start.get(owner as usize..=owner as usize + 1), Some(&[from, to]) if from < to)
    }

    /// Those of an owner that are in boxes which meet the box from `low` to `high`.
    pub(crate) fn near(&self, owner: u32, low: Vec3, high: Vec3) -> impl Iterator<Item = &T> {
        let mut at = self.start.get(owner as usize).copied().unwrap_or(0);
        let end = self.start.get(owner as usize + 1).copied().unwrap_or(0);
        std::iter::from_fn(move || {
            while at < end {
                let node = &self.boxes[at as usize];
                if node.low.cmpgt(high).any() || node.high.cmplt(low).any() {
                    at = node.next;
                    continue;
                }
                at += 1;
                if node.count > 0 {
                    return Some(&self.items[node.first as usize..(node.first + node.count) as usize]);
                }
            }
            None
        })
        .flatten()
    }
}
