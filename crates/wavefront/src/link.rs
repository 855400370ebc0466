//! The record of what one node throws on another.

/// Bit that tells clusters from elements in a node's number.
pub(crate) const CLUSTER: u32 = 1 << 31;

/// Points of a receiver: four towards its corners (the last of a triangle unused), see [`crate::field::INNER`], and its
/// middle.
pub(crate) const MIDDLE: usize = 4;

/// A link: light that leaves `source` and arrives at `receiver`.
///
/// 32 bytes. `factors`: what arrives at the points of an element for each unit of the source: of
/// radiosity, if it is an element (a form factor times a visibility); of intensity towards the receiver, if it is a
/// cluster (steradian per square metre times a visibility). A cluster that receives has one factor, its first, without
/// the cosine: what a surface facing the source would receive; its second says how much that may be where nothing is in
/// between and the source is seen from its front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub(crate) receiver: u32,
    pub(crate) source: u32,
    pub(crate) factors: [f32; 5],
    pub(crate) state: State,
}

/// How a link's visibility is known, and where on its source the light comes from.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct State {
    /// Mean visibility, in 255ths.
    pub(crate) visibility: u8,
    /// Range of the visibility over the receiver's points, in 255ths, what sampling adds taken off.
    pub(crate) spread: u8,
    /// Low three bits, rays: 0 for 16 between both, 1 to 3 for 4^(n+1) to each of the receiver's points, from 4 on as
    /// [`State::few`] says. The rest are flags.
    bits: u8,
    /// Centre of what arrives, on the source: coordinates from 0 to 14, four bits each; see [`State::centre`].
    centre: u8,
}

impl State {
    /// The visibility is 1, and that is proven.
    pub(crate) const CLEAR: u8 = 8;
    /// Some of the receiver's points see all of what they could see of the source, or nothing, or its regions are lit in
    /// part: the spread is that of a step.
    pub(crate) const SATURATED: u8 = 16;
    /// Balls around the nodes overlap: the link says how much there may be, not how much there is.
    pub(crate) const BROAD: u8 = 32;
    /// The plane of one cuts through the other. Between elements: it does so between the receiver's points and a corner; the
    /// spread then tells the corner's factor, in 255ths.
    pub(crate) const GRAZING: u8 = 64;
    /// All rays were blocked. The factors are what there would be without what blocks; none of it counts.
    pub(crate) const DARK: u8 = 128;

    pub(crate) fn new(visibility: u8, spread: u8, rays: u8, flags: u8, centre: [f32; 2]) -> State {
        State { visibility, spread, bits: rays | flags, centre: 0 }.from(centre)
    }

    pub(crate) fn from(self, centre: [f32; 2]) -> State {
        let [s, t] = centre.map(|share| (share.clamp(0.0, 1.0) * 14.0 + 0.5) as u8);
        State { centre: s << 4 | t, ..self }
    }

    pub(crate) fn is(self, flag: u8) -> bool {
        self.bits & flag != 0
    }

    pub(crate) fn with(self, flags: u8) -> State {
        State { bits: self.bits | flags, ..self }
    }

    pub(crate) fn seen(self, visibility: u8) -> State {
        State { visibility, ..self }
    }

    /// Code of 16 rays between both that say no more than so many of equal weight.
    pub(crate) fn few(rays: f32) -> u8 {
        match rays {
            12.0.. => 0,
            6.0.. => 4,
            3.0.. => 5,
            1.0.. => 6,
            _ => 7,
        }
    }

    /// Rays to each of the receiver's points, 0 for such between both.
    pub(crate) fn rays_of_points(self) -> u32 {
        match self.rays() {
            n @ 1..=3 => 4 << (2 * n),
            _ => 0,
        }
    }

    /// How many rays of equal weight those between both amount to.
    pub(crate) fn rays_between(self) -> f32 {
        match self.rays() {
            4 => 8.0,
            5 => 4.0,
            6 => 2.0,
            7 => 0.0,
            _ => 16.0,
        }
    }

    pub(crate) fn rays(self) -> u8 {
        self.bits & 7
    }

    /// Where on the source the light comes from, on average: `(s, t)` of the bilinear map of a quadrilateral, the weights of
    /// the second and third corner of a triangle.
    pub(crate) fn centre(self) -> [f32; 2] {
        [self.centre >> 4, self.centre & 15].map(|step| f32::from(step) / 14.0)
    }
}

const _: () = assert!(size_of::<Link>() == 32);
