//! Refinement of one receiver's links: pairs go in, decisions come out as kept links, links of children, and new
//! elements.

use super::{Evaluator, Link, Links};
use crate::kernels::Probe;
use crate::kernels::oracle::{Decision, Thresholds, bf_refinement};
use crate::solution::Light;
use crate::tree::{ElementId, Elements};

/// Everything that refinement changes: quadtrees and links grow, and with them the light on new elements.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    /// Quadtrees.
    pub elements: Elements,
    /// Links by receiver.
    pub links: Links,
    /// Radiosity and irradiance by element.
    pub light: Light,
}

impl Hierarchy {
    /// Splits an element if it is a leaf; children start with their parent's light where they are open. Returns false where
    /// a path can name no deeper level.
    fn split<P: Probe>(&mut self, id: ElementId, evaluator: &Evaluator<'_>, probe: &mut P) -> bool {
        if !self.elements.is_leaf(id) {
            return true;
        }
        if !self.elements.can_split(id) {
            return false;
        }
        self.elements.split(id);
        self.links.grow(self.elements.len());
        let first = self.elements.get(id).first_child.0;
        let open_share = [0, 1, 2, 3].map(|k| evaluator.open_share(&self.elements, ElementId(first + k), probe));
        let polygon = self.elements.get(id).polygon;
        self.light.adopt(id, evaluator.scene.polygons[polygon as usize].emission, open_share);
        true
    }
}

/// What refinement does next, told so that whoever orders the work can stop it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A link is looked at; what the oracle says may take up to four form factors.
    Decision,
    /// A visibility is evaluated.
    Visibility,
}

/// Refines the links of one receiver: evaluates visibilities that are open, asks the oracle about every link, and
/// carries out what it says until all that remain are kept. Links that the receiver's children take over end in
/// their lists, with open visibility.
///
/// `watch` is called before each step; when it says stop (false), the list is put back as it stands and false is
/// returned.
pub fn refine<P: Probe>(
    receiver: ElementId,
    evaluator: &Evaluator<'_>,
    thresholds: &Thresholds,
    hierarchy: &mut Hierarchy,
    probe: &mut P,
    watch: &mut dyn FnMut(&Hierarchy, Step) -> bool,
) -> bool {
    let mut list = hierarchy.links.take(receiver);
    let area = hierarchy.elements.get(receiver).area;
    let mut in_order = true;
    let mut go_on = true;
    let mut at = 0;
    while at < list.len() {
        if !watch(hierarchy, Step::Decision) {
            go_on = false;
            break;
        }
        let link = &mut list[at];
        let sight = match link.sight() {
            Some(sight) => sight,
            None if !watch(hierarchy, Step::Visibility) => {
                go_on = false;
                break;
            }
            None => {
                let sight = evaluator.sight(&hierarchy.elements, receiver, link.source, probe);
                link.set_sight(sight);
                in_order = false;
                sight
            }
        };
        let source = link.source;
        let areas = [area, hierarchy.elements.get(source).area];
        let emission = evaluator.scene.polygons[hierarchy.elements.get(source).polygon as usize].emission.mean();
        let radiosity = [hierarchy.light.radiosity(source).mean(), emission];
        match bf_refinement(sight, link.form_factor, radiosity, areas, thresholds, probe) {
            Decision::SplitReceiver if hierarchy.split(receiver, evaluator, probe) => {
                list.swap_remove(at);
                for child in hierarchy.elements.children(receiver) {
                    let form_factor = evaluator.form_factor(&hierarchy.elements, child, source, probe);
                    if form_factor > 0.0 {
                        hierarchy.links.push(child, Link::open(source, form_factor));
                    }
                }
                in_order = false;
            }
            Decision::SplitSource if hierarchy.split(source, evaluator, probe) => {
                list.swap_remove(at);
                for child in hierarchy.elements.children(source) {
                    let form_factor = evaluator.form_factor(&hierarchy.elements, receiver, child, probe);
                    if form_factor > 0.0 {
                        list.push(Link::open(child, form_factor));
                    }
                }
                in_order = false;
            }
            _ => at += 1,
        }
    }
    if in_order {
        hierarchy.links.put_sorted(receiver, list);
    } else {
        hierarchy.links.put(receiver, list, &hierarchy.elements);
    }
    go_on
}
