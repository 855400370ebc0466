//! Sixteen rays in, which of them are blocked out: a walk of the packet as a whole.
//!
//! A node's eight boxes are tested at once against the packet's hull: at t between the packet's ends, all rays are inside a
//! box whose six sides move linearly with t, so each side of each child allows an interval of t, and a child whose six have
//! no t in common is passed by. Then each ray is tested against the boxes that are left.

use super::build::STACK;
use super::crossing::{Crossing, Ray, Surface, cross, three};
use super::node::{Block, LEAF};
use super::{Bvh8, Rays};
use crate::lanes::{Backend, Lanes, WIDTH, dispatch};
use std::mem::MaybeUninit;

/// How much passes a primitive that is not opaque.
pub trait Filter {
    /// The share that passes at `origin + u * U + v * V` of the primitive: 0 blocks, 1 lets everything pass. A ray within
    /// rounding of an edge may ask with u or v outside [0, 1] by as much.
    fn passes(&self, primitive: u32, u: f32, v: f32) -> f32;
}

/// Every primitive blocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoFilter;

impl Filter for NoFilter {
    fn passes(&self, _primitive: u32, _u: f32, _v: f32) -> f32 {
        0.0
    }
}

/// One moving side of the packet's hull against one side of a box.
#[derive(Clone, Copy)]
struct Side<L> {
    /// Which of [`super::node::Node::planes`].
    plane: usize,
    /// Where the hull's side is at t = 0.
    base: L,
    /// One over how far it moves until t = 1.
    inverse: L,
}

/// The packet as a whole: t is 0 at the near ends and 1 at the far ends.
struct Hull<L> {
    /// Sides that are inside from some t on, then those that are inside up to some t.
    sides: [Side<L>; 6],
    /// Number of the former.
    from: usize,
}

/// Farthest t that is computed with; a ray of any sensible length has left the scene.
const FAR: f32 = 1e18;

impl<L: Lanes> Hull<L> {
    /// The hull of the active rays.
    #[inline(always)]
    fn new(packet: &Packet<L>, active: u32) -> Self {
        // Lower and negated upper coordinates of near and far ends.
        let mut least = [[L::splat(f32::INFINITY); 6]; 2];
        for half in 0..2 {
            let ray = &packet.rays[half];
            let mask = L::mask(active >> (half * WIDTH));
            let far = ray.far.min(L::splat(FAR));
            for axis in 0..3 {
                for (end, t) in [ray.near, far].into_iter().enumerate() {
                    let x = ray.origin[axis].add(t.mul(ray.direction[axis]));
                    let none = L::splat(f32::INFINITY);
                    least[end][axis] = L::select(mask, x, none).min(least[end][axis]);
                    least[end][axis + 3] = L::select(mask, x.neg(), none).min(least[end][axis + 3]);
                }
            }
        }
        let near = least_of(least[0]);
        let far = least_of(least[1]);
        let blank = Side { plane: 0, base: L::splat(0.0), inverse: L::splat(0.0) };
        let mut hull = Hull { sides: [blank; 6], from: 0 };
        let mut up_to = 6;
        for axis in 0..3 {
            for upper in [false, true] {
                // The hull's lower side meets the box's upper one, and the other way round.
                let (base, end, plane) =
                    if upper { (-near[axis + 3], -far[axis + 3], axis) } else { (near[axis], far[axis], axis + 3) };
                // Adding 0 makes -0 +0.
                let moves = end - base + 0.0;
                let side = Side { plane, base: L::splat(base), inverse: L::splat(1.0 / moves) };
                if (moves >= 0.0) == upper {
                    hull.sides[hull.from] = side;
                    hull.from += 1;
                } else {
                    up_to -= 1;
                    hull.sides[up_to] = side;
                }
            }
        }
        hull
    }

    /// The children that the hull meets.
    #[inline(always)]
    fn meets(&self, planes: &[[f32; WIDTH]; 6]) -> u32 {
        let (mut from, mut to) = (L::splat(0.0), L::splat(1.0));
        if self.from == 3 {
            for k in 0..3 {
                // 0/0 is no bound: `max` and `min` answer the other.
                from = self.sides[k].time(planes).max(from);
                to = self.sides[k + 3].time(planes).min(to);
            }
        } else {
            for side in &self.sides[..self.from] {
                from = side.time(planes).max(from);
            }
            for side in &self.sides[self.from..] {
                to = side.time(planes).min(to);
            }
        }
        L::bits(from.le(to))
    }
}

impl<L: Lanes> Side<L> {
    #[inline(always)]
    fn time(&self, planes: &[[f32; WIDTH]; 6]) -> L {
        L::load(&planes[self.plane]).sub(self.base).mul(self.inverse)
    }
}

/// The least of each of six.
#[inline(always)]
fn least_of<L: Lanes>(values: [L; 6]) -> [f32; 6] {
    let mut least = [0.0; 6];
    for (value, least) in values.into_iter().zip(&mut least) {
        let mut numbers = [0.0; WIDTH];
        value.store(&mut numbers);
        let four: [f32; 4] =
            std::array::from_fn(|k| if numbers[k] < numbers[k + 4] { numbers[k] } else { numbers[k + 4] });
        let two: [f32; 2] = std::array::from_fn(|k| if four[k] < four[k + 2] { four[k] } else { four[k + 2] });
        *least = if two[0] < two[1] { two[0] } else { two[1] };
    }
    least
}

/// Sixteen rays as two times eight lanes.
struct Packet<L> {
    rays: [Ray<L>; 2],
    /// One over the direction.
    inverse: [[L; 3]; 2],
}

impl<L: Lanes> Packet<L> {
    #[inline(always)]
    fn new(bvh: &Bvh8, rays: &Rays<16>) -> Self {
        let rays = [Ray::half(bvh, rays, 0), Ray::half(bvh, rays, 1)];
        let one = L::splat(1.0);
        let inverse =
            [three!(axis => one.div(rays[0].direction[axis])), three!(axis => one.div(rays[1].direction[axis]))];
        Packet { rays, inverse }
    }

    /// Those of `active` that have a length.
    #[inline(always)]
    fn valid(&self, active: u32) -> u32 {
        let some = |half: usize| L::bits(self.rays[half].near.lt(self.rays[half].far));
        active & (some(0) | some(1) << WIDTH)
    }

    /// The rays that meet the box of child `k`.
    #[inline(always)]
    fn enter(&self, planes: &[[f32; WIDTH]; 6], k: usize) -> u32 {
        let k = k % WIDTH;
        let mut bits = 0;
        for half in 0..2 {
            let ray = &self.rays[half];
            let (mut from, mut to) = (ray.near, ray.far);
            for axis in 0..3 {
                let a = L::splat(planes[axis][k]).sub(ray.origin[axis]).mul(self.inverse[half][axis]);
                let b = L::splat(planes[axis + 3][k]).sub(ray.origin[axis]).mul(self.inverse[half][axis]);
                // 0 times infinity is no bound: the box is padded, so nothing within is as near its side.
                from = a.min(b).max(from);
                to = a.max(b).min(to);
            }
            bits |= L::bits(from.le(to)) << (half * WIDTH);
        }
        bits
    }

    /// The rays that cross a primitive.
    #[inline(always)]
    fn crosses(&self, block: &Block, lane: usize) -> u32 {
        let surface = Surface::one(block, lane);
        let low = cross(&self.rays[0], &surface);
        let high = cross(&self.rays[1], &surface);
        L::bits(low.mask) | L::bits(high.mask) << WIDTH
    }
}

/// What a walk does with the primitives it comes to.
trait Visit<L: Lanes> {
    /// Tests a block with those `rays` that enter its box; answers the rays of all that go on.
    fn visit(&mut self, packet: &Packet<L>, block: &Block, count: usize, opaque: u32, rays: u32, live: u32) -> u32;
}

/// Walks the hierarchy with the rays of `live`.
#[inline(always)]
fn walk<L: Lanes>(bvh: &Bvh8, packet: &Packet<L>, mut live: u32, visitor: &mut impl Visit<L>) {
    if bvh.nodes.is_empty() || live == 0 {
        return;
    }
    let hull = Hull::new(packet, live);
    let mut stack = [const { MaybeUninit::<(u32, u32)>::uninit() }; STACK];
    let mut top = 0;
    let (mut at, mut rays) = (0_u32, live);
    loop {
        let node = &bvh.nodes[at as usize];
        let mut hits = hull.meets(&node.planes);
        while hits != 0 {
            let k = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            let inside = packet.enter(&node.planes, k) & rays & live;
            if inside == 0 {
                continue;
            }
            let child = node.children[k];
            if child & LEAF != 0 {
                let block = &bvh.blocks[(child & !LEAF) as usize];
                live =
                    visitor.visit(packet, block, usize::from(node.counts[k]), u32::from(node.opaque[k]), inside, live);
                if live == 0 {
                    return;
                }
            } else {
                stack[top] = MaybeUninit::new((child, inside));
                top += 1;
            }
        }
        loop {
            if top == 0 {
                return;
            }
            top -= 1;
            // SAFETY: entries below `top` were written when it passed them.
            (at, rays) = unsafe { stack[top].assume_init() };
            rays &= live;
            if rays != 0 {
                break;
            }
        }
    }
}

/// Collects the rays that opaque primitives block.
struct Blocked {
    bits: u32,
    last: u32,
}

impl<L: Lanes> Visit<L> for Blocked {
    #[inline(always)]
    fn visit(&mut self, packet: &Packet<L>, block: &Block, _: usize, opaque: u32, mut rays: u32, mut live: u32) -> u32 {
        let mut left = opaque;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let hit = packet.crosses(block, lane) & rays;
            if hit != 0 {
                self.bits |= hit;
                self.last = block.ids[lane % WIDTH];
                live &= !hit;
                rays &= !hit;
                if rays == 0 {
                    break;
                }
            }
        }
        live
    }
}

#[inline(always)]
fn blocked_body<L: Lanes>(bvh: &Bvh8, rays: &Rays<16>, active: u32, last: &mut u32) -> u32 {
    let packet = Packet::<L>::new(bvh, rays);
    let mut live = packet.valid(active & 0xffff);
    let mut found = Blocked { bits: 0, last: *last };
    if let Some((block, lane)) = bvh.opaque_place(*last) {
        found.bits = packet.crosses(block, lane) & live;
        live &= !found.bits;
    }
    walk(bvh, &packet, live, &mut found);
    *last = found.last;
    found.bits
}
dispatch!(fn blocked(bvh: &Bvh8, rays: &Rays<16>, active: u32, last: &mut u32) -> u32 = blocked_body);

#[inline(always)]
fn blocked_batch_body<L: Lanes>(bvh: &Bvh8, rays: &[Rays<16>], blocked: &mut [u16], last: &mut u32) {
    for (rays, blocked) in rays.iter().zip(blocked) {
        *blocked = blocked_body::<L>(bvh, rays, 0xffff, last) as u16;
    }
}
dispatch!(fn blocked_batch(bvh: &Bvh8, rays: &[Rays<16>], blocked: &mut [u16], last: &mut u32) -> () = blocked_batch_body);

/// Multiplies what primitives let pass.
struct Passed<'a, F> {
    share: [f32; 16],
    last: u32,
    filter: &'a F,
}

impl<L: Lanes, F: Filter> Visit<L> for Passed<'_, F> {
    #[inline(always)]
    fn visit(&mut self, packet: &Packet<L>, block: &Block, count: usize, opaque: u32, rays: u32, live: u32) -> u32 {
        let mut blocked = 0;
        for lane in 0..count.min(WIDTH) {
            let surface = Surface::one(block, lane);
            for half in 0..2 {
                let crossing = cross(&packet.rays[half], &surface);
                let hit = L::bits(crossing.mask) << (half * WIDTH) & rays & !blocked;
                if hit == 0 {
                    continue;
                }
                if opaque >> lane & 1 != 0 {
                    blocked |= hit;
                    self.last = block.ids[lane];
                } else {
                    blocked |= self.pass(block.ids[lane], &crossing, hit, half);
                }
            }
        }
        for ray in 0..16 {
            if blocked >> ray & 1 != 0 {
                self.share[ray] = 0.0;
            }
        }
        live & !blocked
    }
}

impl<F: Filter> Passed<'_, F> {
    /// Asks the filter for the rays that hit; answers those that it stops.
    #[inline(always)]
    fn pass<L: Lanes>(&mut self, id: u32, crossing: &Crossing<L>, mut hit: u32, half: usize) -> u32 {
        let (mut u, mut v) = ([0.0; WIDTH], [0.0; WIDTH]);
        crossing.u.div(crossing.det).store(&mut u);
        crossing.v.div(crossing.det).store(&mut v);
        let mut stopped = 0;
        while hit != 0 {
            let ray = hit.trailing_zeros() as usize;
            hit &= hit - 1;
            let lane = ray - half * WIDTH;
            self.share[ray] *= self.filter.passes(id, u[lane], v[lane]);
            if self.share[ray] <= 0.0 {
                stopped |= 1 << ray;
            }
        }
        stopped
    }
}

#[inline(always)]
fn transmittance_body<L: Lanes, F: Filter>(
    bvh: &Bvh8,
    rays: &Rays<16>,
    active: u32,
    last: &mut u32,
    filter: &F,
) -> [f32; 16] {
    let packet = Packet::<L>::new(bvh, rays);
    let mut live = packet.valid(active & 0xffff);
    let mut found = Passed { share: [1.0; 16], last: *last, filter };
    if let Some((block, lane)) = bvh.opaque_place(*last) {
        let hit = packet.crosses(block, lane) & live;
        for ray in 0..16 {
            if hit >> ray & 1 != 0 {
                found.share[ray] = 0.0;
            }
        }
        live &= !hit;
    }
    walk(bvh, &packet, live, &mut found);
    *last = found.last;
    found.share
}

dispatch!(fn transmittance<F: Filter>(
    bvh: &Bvh8, rays: &Rays<16>, active: u32, last: &mut u32, filter: &F,
) -> [f32; 16] = transmittance_body);

impl Bvh8 {
    /// Where a primitive is, if it is an opaque one.
    #[inline(always)]
    fn opaque_place(&self, id: u32) -> Option<(&Block, usize)> {
        let place = *self.places.get(id as usize)?;
        self.blocks.get(place as usize / WIDTH).map(|block| (block, place as usize % WIDTH))
    }

    /// Bit k: ray k of `active` is blocked by an opaque primitive.
    ///
    /// `last` is the primitive that blocked the last packet (`u32::MAX`: none); it is tested first, and replaced by one that
    /// blocks this packet. No answer depends on it.
    #[must_use]
    pub fn blocked(&self, backend: Backend, rays: &Rays<16>, active: u32, last: &mut u32) -> u32 {
        blocked(backend, self, rays, active, last)
    }

    /// [`Bvh8::blocked`] for many packets with all their rays active: `blocked[k]` is the answer for `rays[k]`.
    pub fn blocked_batch(&self, backend: Backend, rays: &[Rays<16>], answers: &mut [u16], last: &mut u32) {
        blocked_batch(backend, self, rays, answers, last);
    }

    /// The share that passes along each ray: 0 where an opaque primitive blocks it or what the filter says of all others
    /// multiplies to 0; 1 for rays that are not active.
    #[must_use]
    pub fn transmittance(
        &self,
        backend: Backend,
        rays: &Rays<16>,
        active: u32,
        last: &mut u32,
        filter: &impl Filter,
    ) -> [f32; 16] {
        transmittance(backend, self, rays, active, last, filter)
    }
}
