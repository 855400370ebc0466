//! Roots of quadtrees from fragments: a scene and its BSP tree go in, the fragments come out in an order that does not
//! depend on when each was made; what becomes of them is left to others.

use super::Bsp;
use crate::scene::{Corners, Scene, Side};

/// A root that is a fragment, or the back of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FragmentRoot {
    /// Corners, counter-clockwise seen from the root's own front, metres.
    pub corners: Corners,
    /// The polygon that it is a piece of.
    pub polygon: u32,
    /// Index of the fragment in the tree; of a back, that of the fragment that it is the back of.
    pub fragment: u32,
}

/// The fragments of a tree as roots, in canonical order: by polygon, and those of one polygon by their corners
/// ([`Corners::total_cmp`]). The pieces of a back are those of its front, reversed, in the same order. So two trees
/// with the same fragments name them alike, in whatever order these came to rest.
#[must_use]
pub fn fragment_roots(scene: &Scene, bsp: &Bsp) -> Vec<FragmentRoot> {
    let mut fragments_of = vec![Vec::new(); scene.fronts];
    for (index, fragment) in bsp.fragments().iter().enumerate() {
        fragments_of[fragment.polygon as usize].push((fragment.corners, index as u32));
    }
    for fragments in &mut fragments_of {
        fragments.sort_by(|(one, _), (two, _)| one.total_cmp(two));
    }
    let mut roots = Vec::with_capacity(bsp.fragments().len());
    for (index, polygon) in scene.polygons.iter().enumerate() {
        let front = match (polygon.side, polygon.twin) {
            (Side::Back, Some(front)) => front as usize,
            _ => index,
        };
        for &(corners, fragment) in &fragments_of[front] {
            let corners = if front == index { corners } else { corners.reversed() };
            roots.push(FragmentRoot { corners, polygon: index as u32, fragment });
        }
    }
    roots
}
