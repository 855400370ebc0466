//! Where everything lies that more than one task may write: elements, links, tree and counters as words of a machine.
//!
//! | record | words |
//! |---|---|
//! | element | first child; parent + 1; first link + 1; first open link + 1; number of links; join counter; radiosity, two slots of three bands; irradiance, three bands; name |
//! | link | source; its name; form factor; visibility; next link + 1 |
//! | node | plane, four words; front and back child, + 1; pieces in the plane; the polygon whose plane it is |
//! | piece | polygon; number of corners; corners, twelve words; next piece + 1 |
//!
//! A link is open until its visibility is known. An element's links and open links are lists of its own: only the task that
//! refines it touches them, and before that the one that refines its parent. The name of an element and the plane of a node
//! never change. The rest is shared.
//!
//! Jacobi's update reads one slot of radiosities and writes the other, in turn; in-place updates have one.

use isolux_core::kernels::visibility::Sight;
use isolux_core::solution::Update;
use isolux_core::tree::Path;
use isolux_core::units::Rgb;
use isolux_machine::{Address, Home, LockId, Machine, MemoryError, Region};

pub(crate) const ELEMENT_WORDS: u64 = 16;
pub(crate) const FIRST_CHILD: u64 = 0;
pub(crate) const PARENT: u64 = 1;
pub(crate) const LINKS: u64 = 2;
pub(crate) const OPEN: u64 = 3;
pub(crate) const COUNT: u64 = 4;
pub(crate) const PENDING: u64 = 5;
pub(crate) const RADIOSITY: u64 = 6;
pub(crate) const IRRADIANCE: u64 = 12;
pub(crate) const PATH: u64 = 15;

pub(crate) const LINK_WORDS: u64 = 5;
pub(crate) const FORM_FACTOR: u64 = 2;
pub(crate) const VISIBILITY: u64 = 3;
pub(crate) const NEXT: u64 = 4;

pub(crate) const NODE_WORDS: u64 = 8;
pub(crate) const FRONT: u64 = 4;
pub(crate) const BACK: u64 = 5;
pub(crate) const IN_PLANE: u64 = 6;
pub(crate) const FOUNDER: u64 = 7;

pub(crate) const PIECE_WORDS: u64 = 16;
pub(crate) const NEXT_PIECE: u64 = 14;

/// Corners and plane of an element, for machines with caches.
pub(crate) const GEOMETRY_WORDS: u64 = 16;
/// Corners and edges of a fragment, likewise.
pub(crate) const FRAGMENT_WORDS: u64 = 16;

/// Locks for elements, as many as SPLASH-2's program has; an element's is its number modulo that.
const ELEMENT_LOCKS: u32 = 3900;

/// How many records of each kind there is room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Elements.
    pub elements: u64,
    /// Links.
    pub links: u64,
    /// Pieces of polygons on their way down the tree.
    pub pieces: u64,
    /// Nodes of the tree.
    pub nodes: u64,
    /// Fragments in the tree.
    pub fragments: u64,
    /// Tasks in the parallel queue.
    pub tasks: u64,
}

/// Counters, one word each, each on a line of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Counter {
    /// Elements in use.
    Elements,
    /// Links in use.
    Links,
    /// Pieces in use.
    Pieces,
    /// Nodes in use.
    Nodes,
    /// Roots inserted so far.
    Inserted,
    /// What the residual came to, as bits.
    Residual,
    /// Links that a wavefront's rounds made in this iteration.
    Fresh,
    /// Links that its rounds split.
    Splits,
    /// Elements that its rounds are to split.
    Claims,
    /// Rows that change.
    Dirty,
    /// Entries of rows in use.
    Rows,
    /// Entries of rows that are being sorted.
    Unsorted,
    /// Chunks of long rows to be sorted.
    Sorting,
    /// Chunks of long rows to be gathered.
    Gathering,
}

/// Words from one counter to the next: two lines of any machine here.
const COUNTER_STRIDE: u64 = 16;

/// A visibility that is not known yet.
pub(crate) const UNKNOWN: u64 = u64::MAX;
/// A link between places that do not see each other's front: to be dropped.
pub(crate) const DEAD: u64 = u64::MAX - 1;

/// A visibility as a word.
pub(crate) fn encode(sight: Sight) -> u64 {
    u64::from((sight.share as f32).copysign(if sight.proven { 1.0 } else { -1.0 }).to_bits())
}

/// And back.
pub(crate) fn decode(word: u64) -> Sight {
    let share = f32::from_bits(word as u32);
    Sight { share: f64::from(share.abs()), proven: share.is_sign_positive() }
}

pub(crate) fn bits(rgb: Rgb) -> [u64; 3] {
    [0, 1, 2].map(|k| rgb[k].to_bits())
}

pub(crate) fn rgb(words: [u64; 3]) -> Rgb {
    Rgb::from(words.map(f64::from_bits))
}

/// All regions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Store {
    pub(crate) sizes: Sizes,
    elements: Region,
    links: Region,
    nodes: Region,
    pieces: Region,
    inserted: Region,
    pub(crate) geometry: Region,
    pub(crate) fragments: Region,
    counters: Region,
    sums: Region,
    vertices: Region,
    locks: LockId,
}

impl Store {
    pub(crate) fn new<M: Machine>(machine: &mut M, sizes: Sizes, roots: u64) -> Result<Store, MemoryError> {
        let Sizes { elements, links, pieces, nodes, fragments, .. } = sizes;
        Ok(Store {
            sizes,
            nodes: machine.allocate("bsp nodes", nodes.max(1) * NODE_WORDS, Home::RoundRobin)?,
            fragments: machine.allocate("bsp fragments", fragments.max(1) * FRAGMENT_WORDS, Home::RoundRobin)?,
            geometry: machine.allocate("geometry", elements * GEOMETRY_WORDS, Home::FirstTouch)?,
            elements: machine.allocate("elements", elements * ELEMENT_WORDS, Home::FirstTouch)?,
            links: machine.allocate("links", links * LINK_WORDS, Home::FirstTouch)?,
            pieces: machine.allocate("pieces", pieces.max(1) * PIECE_WORDS, Home::RoundRobin)?,
            inserted: machine.allocate("inserted roots", roots.max(1), Home::RoundRobin)?,
            counters: machine.allocate("counters", 16 * COUNTER_STRIDE, Home::At(0))?,
            sums: machine.allocate("sums", 4 * roots.max(1), Home::RoundRobin)?,
            vertices: machine.allocate("vertices", elements * 12, Home::FirstTouch)?,
            locks: machine.allocate_locks(ELEMENT_LOCKS),
        })
    }

    pub(crate) fn element(&self, element: u32, word: u64) -> Address {
        self.elements.at(u64::from(element) * ELEMENT_WORDS + word)
    }

    pub(crate) fn link(&self, link: u32, word: u64) -> Address {
        self.links.at(u64::from(link) * LINK_WORDS + word)
    }

    pub(crate) fn nodes(&self) -> Region {
        self.nodes
    }

    pub(crate) fn node(&self, node: u32, word: u64) -> Address {
        self.nodes.at(u64::from(node) * NODE_WORDS + word)
    }

    pub(crate) fn piece(&self, piece: u32, word: u64) -> Address {
        self.pieces.at(u64::from(piece) * PIECE_WORDS + word)
    }

    pub(crate) fn inserted(&self, index: u64) -> Address {
        self.inserted.at(index)
    }

    pub(crate) fn counter(&self, counter: Counter) -> Address {
        self.counters.at(counter as u64 * COUNTER_STRIDE)
    }

    /// Three words for each block of roots, and for each root.
    pub(crate) fn sum(&self, index: u64) -> Address {
        self.sums.at(index * 3)
    }

    /// Three words for each corner of each element.
    pub(crate) fn vertex(&self, element: u32, corner: u64) -> Address {
        self.vertices.at(u64::from(element) * 12 + 3 * corner)
    }

    pub(crate) fn vertex_word(&self, element: u32, corner: u64, word: u64) -> Address {
        self.vertices.at(u64::from(element) * 12 + 3 * corner + word)
    }

    pub(crate) fn lock(&self, element: u32) -> LockId {
        LockId(self.locks.0 + element % ELEMENT_LOCKS)
    }

    /// Where an iteration reads radiosities, and where it writes them.
    pub(crate) fn slots(update: Update, iteration: u32) -> [u64; 2] {
        match update {
            Update::InPlace => [RADIOSITY, RADIOSITY],
            Update::Jacobi if iteration.is_multiple_of(2) => [RADIOSITY, RADIOSITY + 3],
            Update::Jacobi => [RADIOSITY + 3, RADIOSITY],
        }
    }

    /// A name, from its word.
    pub(crate) fn path(word: u64) -> Path {
        Path::from_bits(word)
    }
}
