//! The invariants of links, listed and checked.

use super::Links;
use crate::kernels::visibility::Sight;
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
    /// Checks the invariants:
    ///
    /// - both ends of a link exist; form factors are in `(0, 1]`; visibilities are evaluated, in `[0, 1]`, and 0 or 1
    ///   where they are proven; no polygon gathers from itself or its other side;
    /// - lists are in the order of the sources' paths, without repetition;
    /// - a pair of places exchanges light once: no source of a receiver is, or lies above or below, another source of it
    ///   or of its ancestors;
    /// - where two elements gather from each other, both links have one visibility, known in one way, and form factors
    ///   of one exchange area, `A_a F_ab = A_b F_ba`, as far as factors stay below 1.
    ///
    /// Each is settled in one pass over the links. Elements must be sound, see [`Elements::check`].
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
            let Some(Sight { share, proven }) = link.sight().filter(|sight| (0.0..=1.0).contains(&sight.share)) else {
                return fail("visibilities are evaluated and in [0, 1]");
            };
            if proven && share > 0.0 && share < 1.0 {
                return fail("a proven visibility is 0 or 1");
            }
            let (here, there) = (elements.get(receiver).polygon, elements.get(link.source).polygon);
            if here == there || scene.polygons[here as usize].twin == Some(there) {
                return fail("no polygon gathers from itself");
            }
        }
        let mut sources = Sources { links: self, elements, marks: vec![Mark::default(); elements.len()] };
        (0..elements.roots() as u32).try_for_each(|root| sources.check_below(ElementId(root)))?;
        self.check_pairs(elements)
    }

    /// Compares the two links of each pair that has both. Receivers are gone through in the order of their paths, in
    /// which every list holds its sources: so each list is walked once, by those who look for themselves in it.
    fn check_pairs(&self, elements: &Elements) -> Result<(), LinkViolation> {
        let mut order: Vec<ElementId> = (0..elements.len() as u32).map(ElementId).collect();
        order.sort_unstable_by_key(|&id| elements.get(id).path);
        let mut at = vec![0; elements.len()];
        for receiver in order {
            let (path, area) = (elements.get(receiver).path, elements.get(receiver).area);
            for link in self.of(receiver) {
                let list = self.of(link.source);
                let at = &mut at[link.source.index()];
                while list.get(*at).is_some_and(|other| elements.get(other.source).path < path) {
                    *at += 1;
                }
                let Some(other) = list.get(*at).filter(|other| other.source == receiver) else { continue };
                let fail = |what| Err(LinkViolation { receiver, source_element: link.source, what });
                if link.sight() != other.sight() {
                    return fail("both directions have one visibility");
                }
                let areas = [area, elements.get(link.source).area];
                let [one, two] = [link.form_factor * areas[0], other.form_factor * areas[1]];
                // One division and one multiplication each, of 2^-53: 1e-12 is a thousand times that. A factor that was
                // cut down to 1 stands for a larger exchange.
                let is_cut = link.form_factor == 1.0 || other.form_factor == 1.0;
                if !is_cut && (one - two).abs() > 1e-12 * one {
                    return fail("both directions have one exchange area");
                }
            }
        }
        Ok(())
    }
}

/// What the links of a receiver and its ancestors say of an element.
#[derive(Clone, Copy, Default)]
struct Mark {
    /// Is it a source?
    is_source: bool,
    /// How many sources lie below it?
    below: u32,
}

/// The sources of one receiver and all its ancestors, marked on the elements.
struct Sources<'a> {
    links: &'a Links,
    elements: &'a Elements,
    marks: Vec<Mark>,
}

impl Sources<'_> {
    fn check_below(&mut self, receiver: ElementId) -> Result<(), LinkViolation> {
        let list = self.links.of(receiver);
        let fail = |source_element, what| Err(LinkViolation { receiver, source_element, what });
        for (index, link) in list.iter().enumerate() {
            let (source, path) = (link.source, self.elements.get(link.source).path);
            if index > 0 && self.elements.get(list[index - 1].source).path >= path {
                return fail(source, "lists are in order, without repetition");
            }
            let mark = &mut self.marks[source.index()];
            let mut is_met = mark.is_source || mark.below > 0;
            mark.is_source = true;
            let mut above = self.elements.get(source).parent;
            while above != ElementId::NONE {
                let mark = &mut self.marks[above.index()];
                is_met |= mark.is_source;
                mark.below += 1;
                above = self.elements.get(above).parent;
            }
            if is_met {
                return fail(source, "a place exchanges light with a place once");
            }
        }
        for child in self.elements.children(receiver) {
            self.check_below(child)?;
        }
        for link in list {
            self.marks[link.source.index()].is_source = false;
            let mut above = self.elements.get(link.source).parent;
            while above != ElementId::NONE {
                self.marks[above.index()].below -= 1;
                above = self.elements.get(above).parent;
            }
        }
        Ok(())
    }
}
