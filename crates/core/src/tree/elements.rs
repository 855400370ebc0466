//! Quadtrees of elements: a root is a polygon (or a BSP fragment of one), a child one of four parts of its parent.

use super::{Cut, Path, quadrant_of};
use crate::kernels::Patch;
use crate::scene::{Corners, Plane};
use glam::DVec3;
use thiserror::Error;

/// Index of an element in [`Elements`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ElementId(pub u32);

impl ElementId {
    /// Where there is no element: parent of a root, child of a leaf.
    pub const NONE: ElementId = ElementId(u32::MAX);

    /// As an index into arrays that run beside the elements.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// `NONE` as `None`.
    #[must_use]
    pub fn some(self) -> Option<ElementId> {
        (self != ElementId::NONE).then_some(self)
    }
}

/// A node of a polygon's quadtree.
#[derive(Clone, Debug)]
pub struct Element {
    /// Corners, counter-clockwise seen from the front, metres.
    pub corners: Corners,
    /// Area, m².
    pub area: f64,
    /// The polygon that it is a part of.
    pub polygon: u32,
    /// Parent, or [`ElementId::NONE`] for a root.
    pub parent: ElementId,
    /// First of four consecutive children, or [`ElementId::NONE`] for a leaf.
    pub first_child: ElementId,
    /// Name by place, not by time.
    pub path: Path,
}

/// All quadtrees. Roots come first, in order; children are appended four at a time.
#[derive(Clone, Debug)]
pub struct Elements {
    nodes: Vec<Element>,
    planes: Vec<Plane>,
    roots: u32,
    /// Is any element cut into strips?
    strips: bool,
}

impl Elements {
    /// Quadtrees of one element each. `roots`: corners and polygon of each; `planes`: one per polygon.
    #[must_use]
    pub fn new(roots: impl IntoIterator<Item = (Corners, u32)>, planes: Vec<Plane>) -> Elements {
        let nodes: Vec<Element> = roots
            .into_iter()
            .enumerate()
            .map(|(index, (corners, polygon))| Element {
                corners,
                area: corners.area(),
                polygon,
                parent: ElementId::NONE,
                first_child: ElementId::NONE,
                path: Path::root(index as u32),
            })
            .collect();
        let roots = nodes.len() as u32;
        Elements { nodes, planes, roots, strips: false }
    }

    /// Quadtrees from stored nodes: `nodes` as [`Elements::as_slice`] gave them, `planes` one per polygon. The caller
    /// runs [`Elements::check`] on what it does not trust.
    #[must_use]
    pub fn from_nodes(nodes: Vec<Element>, planes: Vec<Plane>) -> Elements {
        let roots = nodes.iter().take_while(|node| node.parent == ElementId::NONE).count() as u32;
        let mut elements = Elements { nodes, planes, roots, strips: true };
        elements.strips = (0..elements.nodes.len() as u32).any(|id| elements.cut(ElementId(id)) != Cut::Quarters);
        elements
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// True when there is no root.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Number of roots: the elements `0..roots()`.
    #[must_use]
    pub fn roots(&self) -> usize {
        self.roots as usize
    }

    /// One element.
    #[must_use]
    pub fn get(&self, id: ElementId) -> &Element {
        &self.nodes[id.index()]
    }

    /// All elements, indexed by id.
    #[must_use]
    pub fn as_slice(&self) -> &[Element] {
        &self.nodes
    }

    /// What kernels see of an element.
    #[must_use]
    pub fn patch(&self, id: ElementId) -> Patch<'_> {
        let node = self.get(id);
        Patch { corners: &node.corners, plane: &self.planes[node.polygon as usize], area: node.area }
    }

    /// True when the element has no children.
    #[must_use]
    pub fn is_leaf(&self, id: ElementId) -> bool {
        self.get(id).first_child == ElementId::NONE
    }

    /// The four children of an element that is not a leaf; none of a leaf.
    pub fn children(&self, id: ElementId) -> impl Iterator<Item = ElementId> + use<> {
        let first = self.get(id).first_child;
        let count = if first == ElementId::NONE { 0 } else { 4 };
        (0..count).map(move |k| ElementId(first.0 + k))
    }

    /// All leaves, in the order of their ids.
    pub fn leaves(&self) -> impl Iterator<Item = ElementId> + '_ {
        (0..self.nodes.len() as u32).map(ElementId).filter(|&id| self.is_leaf(id))
    }

    /// Can the element be split without leaving what a path can name?
    #[must_use]
    pub fn can_split(&self, id: ElementId) -> bool {
        self.get(id).path.depth() < Path::MAX_DEPTH
    }

    /// Quarters a leaf and returns its first child; an element that has children already keeps them.
    pub fn split(&mut self, id: ElementId) -> ElementId {
        self.split_as(id, Cut::Quarters)
    }

    /// Cuts a leaf and returns its first child; an element that has children already keeps them.
    pub fn split_as(&mut self, id: ElementId, cut: Cut) -> ElementId {
        let node = self.get(id);
        if node.first_child != ElementId::NONE {
            return node.first_child;
        }
        let (corners, polygon, path) = (node.corners, node.polygon, node.path);
        self.strips |= cut != Cut::Quarters;
        let first = ElementId(self.nodes.len() as u32);
        for (part, corners) in cut.parts(&corners).into_iter().enumerate() {
            self.nodes.push(Element {
                area: corners.area(),
                corners,
                polygon,
                parent: id,
                first_child: ElementId::NONE,
                path: path.child(part as u32),
            });
        }
        self.nodes[id.index()].first_child = first;
        first
    }

    /// How an element that is not a leaf is cut: a first strip has a corner more of it than a first quarter has.
    #[must_use]
    pub fn cut(&self, id: ElementId) -> Cut {
        if !self.strips {
            return Cut::Quarters;
        }
        let node = self.get(id);
        // Of what was stored anything may be, until it is checked.
        let first = node.first_child.some().and_then(|first| self.nodes.get(first.index()));
        let (Some(first), 4) = (first, node.corners.len()) else { return Cut::Quarters };
        if first.corners.len() != 4 {
            return Cut::Quarters;
        }
        let first = &first.corners;
        if first[3] == node.corners[3] {
            Cut::Along
        } else if first[1] == node.corners[1] {
            Cut::Across
        } else {
            Cut::Quarters
        }
    }

    /// The leaf below `root` that holds a point of its plane (the nearest one, where rounding puts it outside).
    #[must_use]
    pub fn locate(&self, root: ElementId, point: DVec3) -> ElementId {
        let mut id = root;
        while let Some(first) = self.get(id).first_child.some() {
            let normal = self.planes[self.get(id).polygon as usize].normal;
            let corners = &self.get(id).corners;
            // Most trees have no strips, and this is where many points are found.
            let part = if self.strips {
                self.cut(id).part_at(corners, normal, point)
            } else {
                quadrant_of(corners, normal, point)
            };
            id = ElementId(first.0 + part);
        }
        id
    }

    /// Lists the invariants and checks them: roots come first, parents before their children; every other element is
    /// one of the children of its parent; paths name places; areas are those of the corners, and those of children add
    /// up to the parent's; corners lie in the polygon's plane.
    ///
    /// # Errors
    /// The first violation.
    pub fn check(&self) -> Result<(), TreeViolation> {
        for (index, node) in self.nodes.iter().enumerate() {
            let id = ElementId(index as u32);
            let fail = |what| Err(TreeViolation { element: id, what });
            if (index < self.roots()) != (node.parent == ElementId::NONE) {
                return fail("roots come first and only roots have no parent");
            }
            // Of other elements the parent, which comes before, is asked below.
            let is_named = match node.parent.some() {
                None => node.path == Path::root(index as u32),
                Some(parent) => parent < id && self.children(parent).any(|child| child == id),
            };
            if !is_named {
                return fail("elements are roots or children of their parent");
            }
            // The same corners give the same area up to how a compiler orders a few operations.
            let area = node.corners.area();
            if !(node.area.is_finite() && node.area > 0.0 && (node.area - area).abs() <= 1e-12 * area) {
                return fail("areas are positive and those of the corners");
            }
            let plane = &self.planes[node.polygon as usize];
            let size = node.corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
            // 1e-6 of the coordinates: what joining and snapping may leave, see `scene::RELATIVE_TOLERANCE`.
            if !node.corners.iter().all(|&corner| plane.distance(corner).abs() <= 1e-6 * size) {
                return fail("corners lie in the polygon's plane");
            }
            if node.first_child != ElementId::NONE && !self.can_split(id) {
                return fail("paths reach to the children");
            }
            let mut sum = 0.0;
            for (quadrant, child) in self.children(id).enumerate() {
                let child =
                    self.nodes.get(child.index()).ok_or(TreeViolation { element: id, what: "children exist" })?;
                if child.parent != id || child.polygon != node.polygon || child.path != node.path.child(quadrant as u32)
                {
                    return fail("children know parent, polygon and path");
                }
                sum += child.area;
            }
            // Quarters of coordinates of size s and areas a lose up to about s²·2^-50 by rounding.
            if node.first_child != ElementId::NONE && (sum - node.area).abs() > 1e-9 * node.area + 1e-14 * size * size {
                return fail("areas of children add up");
            }
        }
        Ok(())
    }
}

/// A broken invariant of the quadtrees.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("element {}: violated: {what}", element.0)]
pub struct TreeViolation {
    /// Where.
    pub element: ElementId,
    /// Which invariant.
    pub what: &'static str,
}
