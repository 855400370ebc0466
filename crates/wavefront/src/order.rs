//! The order of elements, by which several threads work on one hierarchy: all that is below an element stands together, the
//! quarters first, then what is below the first quarter, the second, and so on. Parts of the hierarchy are then ranges of
//! arrays, and results do not depend on who works on which.

use crate::geometry::{Element, NONE};
use rayon::prelude::*;
use std::ops::Range;

/// Most elements of a part, unless a single polygon's quarter has more: half a megabyte of light.
const PART: usize = 2048;

/// Values of roots that come one after the other, and of all that is below them.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Part {
    roots: Range<usize>,
    below: Range<usize>,
}

/// Parts of a hierarchy that have nothing to do with each other, and what is above them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Order {
    roots: usize,
    parts: Vec<Part>,
    /// Parents that are in no part, the upper ones first.
    above: Vec<u32>,
}

/// Arrays, one value of each per element, that can be divided.
pub(crate) trait Columns: Sized + Send {
    /// Those before an index, and those from there on.
    fn divide(self, index: usize) -> (Self, Self);
}

impl<T: Send> Columns for &mut [T] {
    fn divide(self, index: usize) -> (Self, Self) {
        self.split_at_mut(index)
    }
}

/// The columns of a part, under the numbers of all elements.
pub(crate) struct View<C> {
    roots: C,
    first_root: usize,
    below: C,
    first_below: usize,
}

impl<C> View<C> {
    /// The columns that hold an element, and its place there. Quarters of one element have places one after the other.
    #[inline(always)]
    pub(crate) fn of(&mut self, element: usize) -> (&mut C, usize) {
        if element < self.first_below {
            (&mut self.roots, element - self.first_root)
        } else {
            (&mut self.below, element - self.first_below)
        }
    }
}

/// How many elements are below each.
fn below(elements: &[Element], roots: usize) -> Vec<u32> {
    let mut below = vec![0; elements.len()];
    for index in (roots..elements.len()).rev() {
        below[elements[index].parent as usize] += below[index] + 1;
    }
    below
}

/// The place of each element in the order; parents come before their quarters, in what goes in as in what comes out.
pub(crate) fn places(elements: &[Element], roots: usize) -> Vec<u32> {
    let below = below(elements, roots);
    let mut places: Vec<u32> = (0..elements.len() as u32).collect();
    // Where what is below an element begins.
    let mut starts = vec![0; elements.len()];
    let mut next = roots as u32;
    for root in 0..roots {
        starts[root] = next;
        next += below[root];
    }
    for (index, element) in elements.iter().enumerate().filter(|(_, element)| element.first_child != NONE) {
        let (first, start) = (element.first_child as usize, starts[index]);
        let mut next = start + 4;
        for quarter in 0..4 {
            places[first + quarter] = start + quarter as u32;
            starts[first + quarter] = next;
            next += below[first + quarter];
        }
    }
    places
}

/// Values in a new order.
pub(crate) fn arranged<T: Copy + Send + Sync>(values: &[T], places: &[u32]) -> Vec<T> {
    let mut from = vec![0_u32; places.len()];
    places.iter().enumerate().for_each(|(index, &place)| from[place as usize] = index as u32);
    from.par_iter().with_min_len(PART).map(|&index| values[index as usize]).collect()
}

/// Puts the new numbers of parents and quarters into elements that stand in a new order.
pub(crate) fn renumber(elements: &mut [Element], places: &[u32]) {
    elements.par_iter_mut().with_min_len(PART).for_each(|element| {
        for number in [&mut element.parent, &mut element.first_child] {
            if *number != NONE {
                *number = places[*number as usize];
            }
        }
    });
}

impl Order {
    /// Of elements that stand as [`places`] says; of others, all is above.
    pub(crate) fn new(elements: &[Element], roots: usize) -> Order {
        let mut order = Order { roots, parts: Vec::new(), above: Vec::new() };
        if places(elements, roots).iter().enumerate().any(|(index, &place)| index != place as usize) {
            let parents = (0..elements.len() as u32).filter(|&index| elements[index as usize].first_child != NONE);
            order.above = parents.collect();
            return order;
        }
        Order::of_arranged(elements, roots)
    }

    /// Of elements that are known to stand so.
    pub(crate) fn of_arranged(elements: &[Element], roots: usize) -> Order {
        let mut order = Order { roots, parts: Vec::new(), above: Vec::new() };
        let below = below(elements, roots);
        let (mut first, mut begin, mut next) = (0, roots, roots);
        for root in 0..roots {
            let size = below[root] as usize;
            let is_large = size > PART;
            if is_large || root - first + next - begin + size > PART {
                order.parts.push(Part { roots: first..root, below: begin..next });
                (first, begin) = (root, next);
            }
            if is_large {
                order.open(root, next, elements, &below);
                (first, begin) = (root + 1, next + size);
            }
            next += size;
        }
        order.parts.push(Part { roots: first..roots, below: begin..next });
        order
    }

    /// Makes parts of what is below an element, from place `start` on.
    fn open(&mut self, index: usize, start: usize, elements: &[Element], below: &[u32]) {
        self.above.push(index as u32);
        let first = elements[index].first_child as usize;
        let (mut begin, mut next) = (start + 4, start + 4);
        let none = self.parts.last().map_or(0..0, |part| part.roots.end..part.roots.end);
        for quarter in first..first + 4 {
            let size = below[quarter] as usize;
            let is_large = size > PART;
            if next > begin && (is_large || next - begin + size > PART) {
                self.parts.push(Part { roots: none.clone(), below: begin..next });
                begin = next;
            }
            if is_large {
                self.open(quarter, next, elements, below);
                begin = next + size;
            } else if size > 0 {
                self.above.push(quarter as u32);
            }
            next += size;
        }
        if next > begin {
            self.parts.push(Part { roots: none, below: begin..next });
        }
    }

    /// Calls `pass` with every parent of a part after those above it, for all parts side by side.
    pub(crate) fn down<C: Columns>(&self, elements: &[Element], columns: C, pass: impl Fn(&mut View<C>, usize) + Sync) {
        self.views(columns).into_par_iter().zip(&self.parts).for_each(|(mut view, part)| {
            part.parents(elements).for_each(|index| pass(&mut view, index));
        });
    }

    /// Calls `pull` with every parent of a part before those above it, for all parts side by side.
    pub(crate) fn up<C: Columns>(&self, elements: &[Element], columns: C, pull: impl Fn(&mut View<C>, usize) + Sync) {
        self.views(columns).into_par_iter().zip(&self.parts).for_each(|(mut view, part)| {
            part.parents(elements).rev().for_each(|index| pull(&mut view, index));
        });
    }

    /// The parents that are in no part, the upper ones first, and the columns of all elements: before [`Order::down`], and in
    /// reverse after [`Order::up`].
    pub(crate) fn above<C: Columns>(&self, columns: C) -> (View<C>, impl DoubleEndedIterator<Item = usize> + '_) {
        let (roots, below) = columns.divide(self.roots);
        let view = View { roots, first_root: 0, below, first_below: self.roots };
        (view, self.above.iter().map(|&index| index as usize))
    }

    fn views<C: Columns>(&self, columns: C) -> Vec<View<C>> {
        let (mut roots, mut below) = columns.divide(self.roots);
        let (mut first_root, mut first_below) = (0, self.roots);
        let mut views = Vec::with_capacity(self.parts.len());
        for part in &self.parts {
            let (own_roots, later_roots) = roots.divide(part.roots.start - first_root).1.divide(part.roots.len());
            let (own, later) = below.divide(part.below.start - first_below).1.divide(part.below.len());
            views.push(View {
                roots: own_roots,
                first_root: part.roots.start,
                below: own,
                first_below: part.below.start,
            });
            (roots, below) = (later_roots, later);
            (first_root, first_below) = (part.roots.end, part.below.end);
        }
        views
    }
}

impl Part {
    /// Elements of the part that have quarters, the upper ones first.
    fn parents(&self, elements: &[Element]) -> impl DoubleEndedIterator<Item = usize> {
        self.roots.clone().chain(self.below.clone()).filter(move |&index| elements[index].first_child != NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use isolux_core::tree::Path;

    /// Roots that are split at random until there are so many elements.
    fn hierarchy(roots: u32, count: usize) -> Vec<Element> {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        let mut elements: Vec<Element> =
            (0..roots).map(|root| Element::new(corners, 4, root, NONE, Path::root(root))).collect();
        let mut state = 1_u64;
        while elements.len() < count {
            state = isolux_core::sampling::mix(state);
            // Most splits fall on few polygons, as on a floor.
            let index = ((state as f64 / u64::MAX as f64).powi(3) * elements.len() as f64) as usize;
            if elements[index].first_child == NONE && elements[index].path.depth() < Path::MAX_DEPTH {
                let quarters = elements[index].quarters(index as u32);
                elements[index].first_child = elements.len() as u32;
                elements.extend(quarters);
            }
        }
        elements
    }

    fn in_order(elements: &[Element], roots: usize) -> Vec<Element> {
        let places = places(elements, roots);
        let mut elements = arranged(elements, &places);
        renumber(&mut elements, &places);
        elements
    }

    #[test]
    fn elements_keep_their_parents_and_quarters() {
        let before = hierarchy(50, 30_000);
        let after = in_order(&before, 50);
        let paths = |elements: &[Element]| {
            let mut paths: Vec<u64> = elements.iter().map(|element| element.path.to_bits()).collect();
            paths.sort_unstable();
            paths
        };
        assert_eq!(paths(&before), paths(&after));
        for (index, element) in after.iter().enumerate().filter(|(_, element)| element.first_child != NONE) {
            for quarter in 0..4 {
                let child = &after[element.first_child as usize + quarter];
                assert_eq!(child.parent as usize, index);
                assert_eq!(child.path.to_bits(), element.path.child(quarter as u32).to_bits());
            }
        }
    }

    #[test]
    fn every_parent_is_visited_once_and_after_its_own() {
        let scattered = hierarchy(300, 60_000);
        let arranged = in_order(&scattered, 300);
        for elements in [&scattered, &arranged] {
            let order = Order::new(elements, 300);
            // Depth, handed down; number of elements below, pulled up.
            let mut depth = vec![0_u32; elements.len()];
            let pass = |view: &mut View<&mut [u32]>, index: usize| {
                let (values, own) = view.of(index);
                let above = values[own];
                let (values, first) = view.of(elements[index].first_child as usize);
                values[first..first + 4].iter_mut().for_each(|value| *value += above + 1);
            };
            let (mut view, parents) = order.above(&mut depth[..]);
            parents.for_each(|index| pass(&mut view, index));
            order.down(elements, &mut depth[..], pass);
            assert!(elements.iter().zip(&depth).all(|(element, &depth)| element.path.depth() == depth));

            let mut size = vec![0_u32; elements.len()];
            let pull = |view: &mut View<&mut [u32]>, index: usize| {
                let (values, first) = view.of(elements[index].first_child as usize);
                let sum: u32 = values[first..first + 4].iter().map(|value| value + 1).sum();
                let (values, own) = view.of(index);
                values[own] = sum;
            };
            order.up(elements, &mut size[..], pull);
            let (mut view, parents) = order.above(&mut size[..]);
            parents.rev().for_each(|index| pull(&mut view, index));
            assert_eq!(size, below(elements, 300));
        }
        assert!(Order::new(&arranged, 300).parts.len() > 20);
        assert!(Order::new(&scattered, 300).parts.is_empty());
    }
}
