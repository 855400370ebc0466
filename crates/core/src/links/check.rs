//! The invariants of links, listed and checked.

use super::Links;
use crate::scene::Scene;
use crate::tree::{ElementId, Elements};
use thiserror::Error;

/// A broken invariant of the links.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("link {} <- {}: violated: {what}", receiver.0, source_element.0)]
pub struct LinkViolation {
    /// Receiver.
    pub receiver: ElementId,
    /// Source.
    pub source_element: ElementId,
    /// Which invariant.
    pub what: &'static str,
}

impl Links {
    /// Checks the invariants: lists are in the order of the sources' paths without repetition; form factors are in
    /// `(0, 1]` and visibilities evaluated, in `[0, 1]`; no element gathers from its own polygon; and a pair of places
    /// exchanges light once: no source of a receiver is an ancestor or descendant of another source of it or of its
    /// ancestors.
    ///
    /// # Errors
    /// The first violation.
    pub fn check(&self, elements: &Elements, scene: &Scene) -> Result<(), LinkViolation> {
        for (receiver, link) in self.iter() {
            let fail = |what| Err(LinkViolation { receiver, source_element: link.source, what });
            if link.source.index() >= elements.len() || receiver.index() >= elements.len() {
                return fail("both ends exist");
            }
            if !(link.form_factor > 0.0 && link.form_factor <= 1.0) {
                return fail("form factors are in (0, 1]");
            }
            if !link.visibility().is_some_and(|visibility| (0.0..=1.0).contains(&visibility)) {
                return fail("visibilities are evaluated and in [0, 1]");
            }
            let (here, there) = (elements.get(receiver).polygon, elements.get(link.source).polygon);
            if here == there || scene.polygons[here as usize].twin == Some(there) {
                return fail("no polygon gathers from itself");
            }
        }
        (0..elements.roots() as u32).try_for_each(|root| self.check_below(ElementId(root), &mut Vec::new(), elements))
    }

    /// `above`: path intervals of the sources of all ancestors.
    fn check_below(
        &self,
        receiver: ElementId,
        above: &mut Vec<ElementId>,
        elements: &Elements,
    ) -> Result<(), LinkViolation> {
        let before = above.len();
        above.extend(self.of(receiver).iter().map(|link| link.source));
        let paths: Vec<_> = self.of(receiver).iter().map(|link| elements.get(link.source).path).collect();
        if let Some(at) = paths.windows(2).position(|pair| pair[0] >= pair[1]) {
            let source_element = self.of(receiver)[at + 1].source;
            return Err(LinkViolation { receiver, source_element, what: "lists are in order, without repetition" });
        }
        if elements.is_leaf(receiver) {
            let all: std::collections::HashSet<ElementId> = above.iter().copied().collect();
            for &source in above.iter() {
                let mut ancestor = elements.get(source).parent;
                while ancestor != ElementId::NONE {
                    if all.contains(&ancestor) {
                        let what = "a place exchanges light with a place once";
                        return Err(LinkViolation { receiver, source_element: source, what });
                    }
                    ancestor = elements.get(ancestor).parent;
                }
            }
            if all.len() != above.len() {
                let what = "a place exchanges light with a place once";
                return Err(LinkViolation { receiver, source_element: above[above.len() - 1], what });
            }
        }
        for child in elements.children(receiver) {
            self.check_below(child, above, elements)?;
        }
        above.truncate(before);
        Ok(())
    }
}
