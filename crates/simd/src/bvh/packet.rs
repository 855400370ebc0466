//! Sixteen rays in, which of them are blocked out: a walk of the packet as a whole.
//!
//! A node's eight boxes are tested at once against the packet's hull: at t between the packet's ends, all rays are inside a
//! box whose six sides move linearly with t, so each side of each child allows an interval of t, and a child whose six have
//! no t in common is passed by. Then each ray is tested against the boxes that are left.

use super::build::STACK;
use super::closest::Probe;
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

/// The packet as a whole: t is 0 at the near ends and 1 at the far ends. Sides 0 to 2 are the lower ones, which meet a box's
/// upper planes; sides 3 to 5 are the upper ones, which meet the lower planes: side k meets plane `(k + 3) % 6`.
pub(super) struct Hull {
    /// Where a side is at t = 0.
    base: [f32; WIDTH],
    /// One over how far it moves until t = 1.
    inverse: [f32; WIDTH],
    /// 0 where a side is inside from some t on, minus infinity where it is inside up to some t.
    from: [f32; WIDTH],
    /// Infinity where it is inside from some t on, 0 where it is inside up to some t.
    to: [f32; WIDTH],
    /// Whether along each axis one side is of the one kind and the other of the other, as it is unless rays spread or meet.
    parallel: bool,
    /// The sides of the first kind then.
    enters: [usize; 3],
}

/// Farthest t that is computed with; a ray of any sensible length has left the scene.
const FAR: f32 = 1e18;

impl Hull {
    /// The hull of the active rays.
    #[inline(always)]
    pub(super) fn new<L: Lanes>(packet: &Packet<'_, L>, active: u32) -> Self {
        // Lower and negated upper coordinates of near and far ends.
        let none = L::splat(f32::INFINITY);
        let (mut near, mut far) = ([none; WIDTH], [none; WIDTH]);
        for half in 0..2 {
            let ray = &packet.rays[half];
            let mask = L::mask(active >> (half * WIDTH));
            let end = ray.far.min(L::splat(FAR));
            for axis in 0..3 {
                let a = ray.origin[axis].add(ray.near.mul(ray.direction[axis]));
                let b = ray.origin[axis].add(end.mul(ray.direction[axis]));
                near[axis] = L::select(mask, a, none).min(near[axis]);
                near[axis + 3] = L::select(mask, a.neg(), none).min(near[axis + 3]);
                far[axis] = L::select(mask, b, none).min(far[axis]);
                far[axis + 3] = L::select(mask, b.neg(), none).min(far[axis + 3]);
            }
        }
        // Sides 3 to 5 back to their signs.
        let upper = L::mask(0b11_1000);
        let (near, far) = (L::least(near), L::least(far));
        let (near, far) = (L::select(upper, near.neg(), near), L::select(upper, far.neg(), far));
        // Adding 0 makes -0 +0.
        let moves = far.sub(near).add(L::splat(0.0));
        let mut hull = Hull {
            base: [0.0; WIDTH],
            inverse: [0.0; WIDTH],
            from: [0.0; WIDTH],
            to: [0.0; WIDTH],
            parallel: false,
            enters: [0; 3],
        };
        near.store(&mut hull.base);
        L::splat(1.0).div(moves).store(&mut hull.inverse);
        // An upper side that rises comes to a lower plane, a lower side that falls to an upper plane.
        let rises = L::bits(L::splat(0.0).le(moves));
        let from = (rises ^ 0b00_0111) & 0b11_1111;
        L::select(L::mask(from), L::splat(0.0), none.neg()).store(&mut hull.from);
        L::select(L::mask(from), none, L::splat(0.0)).store(&mut hull.to);
        hull.parallel = (from ^ from >> 3) & 0b111 == 0b111;
        hull.enters = three!(axis => axis + 3 * (from >> (axis + 3) & 1) as usize);
        hull
    }

    /// The t from or up to which side k is inside the children.
    #[inline(always)]
    fn time<L: Lanes>(&self, planes: &[[f32; WIDTH]; 6], k: usize, plane: usize) -> L {
        L::load(&planes[plane]).sub(L::splat(self.base[k])).mul(L::splat(self.inverse[k]))
    }

    /// The children that the hull meets.
    #[inline(always)]
    pub(super) fn meets<L: Lanes>(&self, planes: &[[f32; WIDTH]; 6]) -> u32 {
        let (mut from, mut to) = (L::splat(0.0), L::splat(1.0));
        if self.parallel {
            for axis in 0..3 {
                let enters = self.enters[axis];
                let leaves = 2 * axis + 3 - enters;
                // 0/0 is no bound: `max` and `min` answer the other.
                from = self.time::<L>(planes, enters, leaves).max(from);
                to = self.time::<L>(planes, leaves, enters).min(to);
            }
        } else {
            for k in 0..6 {
                let t = self.time::<L>(planes, k, (k + 3) % 6);
                from = t.add(L::splat(self.from[k])).max(from);
                to = t.add(L::splat(self.to[k])).min(to);
            }
        }
        L::bits(from.le(to))
    }
}

/// Sixteen rays as two times eight lanes, and one by one.
pub(super) struct Packet<'a, L> {
    pub(super) rays: [Ray<L>; 2],
    /// One over the direction.
    pub(super) inverse: [[L; 3]; 2],
    pub(super) single: &'a Rays<16>,
    single_inverse: [[f32; 16]; 3],
    skin: [f32; 16],
    reach: [f32; 16],
}

impl<'a, L: Lanes> Packet<'a, L> {
    #[inline(always)]
    pub(super) fn new(single: &'a Rays<16>, rays: [Ray<L>; 2]) -> Self {
        let one = L::splat(1.0);
        // Adding 0 makes -0 +0.
        let zero = L::splat(0.0);
        let inverse = [
            three!(axis => one.div(rays[0].direction[axis].add(zero))),
            three!(axis => one.div(rays[1].direction[axis].add(zero))),
        ];
        let (mut skin, mut reach, mut single_inverse) = ([0.0; 16], [0.0; 16], [[0.0; 16]; 3]);
        for half in 0..2 {
            rays[half].skin.store(eight_mut(&mut skin, half));
            rays[half].reach.store(eight_mut(&mut reach, half));
            for axis in 0..3 {
                inverse[half][axis].store(eight_mut(&mut single_inverse[axis], half));
            }
        }
        Packet { rays, inverse, single, single_inverse, skin, reach }
    }

    /// Ray `k` in all lanes.
    #[inline(always)]
    fn ray(&self, k: usize) -> Ray<L> {
        let k = k % 16;
        Ray {
            origin: three!(axis => L::splat(self.single.origin[axis][k])),
            direction: three!(axis => L::splat(self.single.direction[axis][k])),
            near: L::splat(self.single.near[k]),
            far: L::splat(self.single.far[k]),
            skin: L::splat(self.skin[k]),
            reach: L::splat(self.reach[k]),
        }
    }

    /// Ray `k` alone.
    #[inline(always)]
    pub(super) fn probe(&self, k: usize) -> Probe<L> {
        Probe::of(self.ray(k), three!(axis => self.single_inverse[axis][k % 16]))
    }

    /// The children whose boxes ray `k` meets.
    #[inline(always)]
    fn children(&self, planes: &[[f32; WIDTH]; 6], k: usize) -> u32 {
        let k = k % 16;
        let (mut from, mut to) = (L::splat(self.single.near[k]), L::splat(self.single.far[k]));
        for axis in 0..3 {
            let (origin, inverse) = (L::splat(self.single.origin[axis][k]), L::splat(self.single_inverse[axis][k]));
            let a = L::load(&planes[axis]).sub(origin).mul(inverse);
            let b = L::load(&planes[axis + 3]).sub(origin).mul(inverse);
            from = a.min(b).max(from);
            to = a.max(b).min(to);
        }
        L::bits(from.le(to))
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
}

/// Those of `active` that have a length.
#[inline(always)]
pub(super) fn valid<L: Lanes>(rays: &[Ray<L>; 2], active: u32) -> u32 {
    active & (L::bits(rays[0].near.lt(rays[0].far)) | L::bits(rays[1].near.lt(rays[1].far)) << WIDTH)
}

/// The rays that cross a primitive.
#[inline(always)]
fn crosses<L: Lanes>(rays: &[Ray<L>; 2], block: &Block, lane: usize) -> u32 {
    let surface = Surface::one(block, lane);
    let low = cross(&rays[0], &surface);
    let high = cross(&rays[1], &surface);
    L::bits(low.mask) | L::bits(high.mask) << WIDTH
}

#[inline(always)]
pub(super) fn eight_mut(values: &mut [f32; 16], half: usize) -> &mut [f32; WIDTH] {
    &mut values.as_chunks_mut::<WIDTH>().0[half]
}

/// What a walk does with the primitives it comes to.
trait Visit<L: Lanes> {
    /// Tests a block with those `rays` that enter its box; answers the rays of all that go on.
    #[allow(clippy::too_many_arguments)]
    fn visit(
        &mut self,
        packet: &Packet<'_, L>,
        hull: &Hull,
        block: &Block,
        count: usize,
        opaque: u32,
        rays: u32,
        live: u32,
    ) -> u32;
}

/// Up to this many rays, each is tested against all eight boxes or primitives; what more rays do depends on how many of
/// the eight the packet's hull meets. 1 to 8 differ by less than a tenth (bench `rays`).
const FEW: u32 = 4;

/// Walks the hierarchy with the rays of `live`.
#[inline(always)]
fn walk<L: Lanes>(bvh: &Bvh8, packet: &Packet<'_, L>, mut live: u32, visitor: &mut impl Visit<L>) {
    if bvh.nodes.is_empty() || live == 0 {
        return;
    }
    let hull = Hull::new(packet, live);
    let mut stack = [const { MaybeUninit::<(u32, u32)>::uninit() }; STACK];
    let mut top = 0;
    let (mut at, mut rays) = (0_u32, live);
    loop {
        let node = &bvh.nodes[at as usize];
        let mut inside_of = [0_u32; WIDTH];
        let count = rays.count_ones();
        let mut hits = if count <= FEW { node.present } else { hull.meets::<L>(&node.planes) & node.present };
        if count <= FEW.max(hits.count_ones()) {
            let mut left = rays;
            let met = hits;
            hits = 0;
            while left != 0 {
                let ray = left.trailing_zeros();
                left &= left - 1;
                let mut children = packet.children(&node.planes, ray as usize) & met;
                hits |= children;
                while children != 0 {
                    inside_of[children.trailing_zeros() as usize % WIDTH] |= 1 << ray;
                    children &= children - 1;
                }
            }
        } else {
            let mut left = hits;
            while left != 0 {
                let k = left.trailing_zeros() as usize % WIDTH;
                left &= left - 1;
                inside_of[k] = packet.enter(&node.planes, k) & rays;
            }
        }
        while hits != 0 {
            let k = hits.trailing_zeros() as usize % WIDTH;
            hits &= hits - 1;
            let inside = inside_of[k] & live;
            if inside == 0 {
                continue;
            }
            let child = node.children[k];
            if child & LEAF != 0 {
                let block = &bvh.blocks[(child & !LEAF) as usize];
                live = visitor.visit(
                    packet,
                    &hull,
                    block,
                    usize::from(node.counts[k]),
                    u32::from(node.opaque[k]),
                    inside,
                    live,
                );
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
}

impl<L: Lanes> Visit<L> for Blocked {
    #[inline(always)]
    fn visit(
        &mut self,
        packet: &Packet<'_, L>,
        hull: &Hull,
        block: &Block,
        _: usize,
        opaque: u32,
        mut rays: u32,
        mut live: u32,
    ) -> u32 {
        let count = rays.count_ones();
        let mut left = if count <= FEW { opaque } else { opaque & hull.meets::<L>(&block.planes) };
        if count <= 2 * left.count_ones() {
            let surface = Surface::all(block);
            while rays != 0 {
                let ray = rays.trailing_zeros();
                rays &= rays - 1;
                let hit = L::bits(cross(&packet.ray(ray as usize), &surface).mask) & opaque;
                if hit != 0 {
                    self.bits |= 1 << ray;
                    live &= !(1 << ray);
                }
            }
            return live;
        }
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let hit = crosses(&packet.rays, block, lane) & rays;
            if hit != 0 {
                self.bits |= hit;
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
fn blocked_body<L: Lanes>(bvh: &Bvh8, rays: &Rays<16>, active: u32) -> u32 {
    let pair = [Ray::<L>::half(bvh, rays, 0), Ray::half(bvh, rays, 1)];
    let live = valid(&pair, active & 0xffff);
    let mut found = Blocked { bits: 0 };
    if live != 0 {
        walk(bvh, &Packet::new(rays, pair), live, &mut found);
    }
    found.bits
}
dispatch!(fn blocked(bvh: &Bvh8, rays: &Rays<16>, active: u32) -> u32 = blocked_body);

#[inline(always)]
fn blocked_batch_body<L: Lanes>(bvh: &Bvh8, rays: &[Rays<16>], blocked: &mut [u16]) {
    for (rays, blocked) in rays.iter().zip(blocked) {
        *blocked = blocked_body::<L>(bvh, rays, 0xffff) as u16;
    }
}
dispatch!(fn blocked_batch(bvh: &Bvh8, rays: &[Rays<16>], blocked: &mut [u16]) -> () = blocked_batch_body);

/// Multiplies what primitives let pass.
struct Passed<'a, F> {
    share: [f32; 16],
    filter: &'a F,
}

impl<L: Lanes, F: Filter> Visit<L> for Passed<'_, F> {
    #[inline(always)]
    fn visit(
        &mut self,
        packet: &Packet<'_, L>,
        hull: &Hull,
        block: &Block,
        count: usize,
        opaque: u32,
        rays: u32,
        live: u32,
    ) -> u32 {
        let mut blocked = 0;
        let number = rays.count_ones();
        let mut left = (1 << count) - 1;
        if number > FEW {
            left &= hull.meets::<L>(&block.planes);
        }
        if number <= 2 * left.count_ones() {
            blocked = self.one_by_one(packet, block, opaque, left, rays);
            left = 0;
        }
        while left != 0 {
            let lane = left.trailing_zeros() as usize % WIDTH;
            left &= left - 1;
            let surface = Surface::one(block, lane);
            for half in 0..2 {
                let crossing = cross(&packet.rays[half], &surface);
                let hit = L::bits(crossing.mask) << (half * WIDTH) & rays & !blocked;
                if hit == 0 {
                    continue;
                }
                if opaque >> lane & 1 != 0 {
                    blocked |= hit;
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
    /// Each ray against all primitives; answers the rays that are stopped.
    #[inline(always)]
    fn one_by_one<L: Lanes>(
        &mut self,
        packet: &Packet<'_, L>,
        block: &Block,
        opaque: u32,
        lanes: u32,
        mut rays: u32,
    ) -> u32 {
        let surface = Surface::all(block);
        let mut stopped = 0;
        while rays != 0 {
            let ray = rays.trailing_zeros() as usize % 16;
            rays &= rays - 1;
            let crossing = cross(&packet.ray(ray), &surface);
            let mut hit = L::bits(crossing.mask) & lanes;
            if hit & opaque != 0 {
                stopped |= 1 << ray;
                continue;
            }
            if hit == 0 {
                continue;
            }
            let (mut u, mut v) = ([0.0; WIDTH], [0.0; WIDTH]);
            crossing.u.div(crossing.det).store(&mut u);
            crossing.v.div(crossing.det).store(&mut v);
            while hit != 0 {
                let lane = hit.trailing_zeros() as usize % WIDTH;
                hit &= hit - 1;
                self.share[ray] *= self.filter.passes(block.ids[lane], u[lane], v[lane]);
            }
            if self.share[ray] <= 0.0 {
                stopped |= 1 << ray;
            }
        }
        stopped
    }

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
fn transmittance_body<L: Lanes, F: Filter>(bvh: &Bvh8, rays: &Rays<16>, active: u32, filter: &F) -> [f32; 16] {
    let pair = [Ray::<L>::half(bvh, rays, 0), Ray::half(bvh, rays, 1)];
    let live = valid(&pair, active & 0xffff);
    let mut found = Passed { share: [1.0; 16], filter };
    if live != 0 {
        walk(bvh, &Packet::new(rays, pair), live, &mut found);
    }
    found.share
}
dispatch!(fn transmittance<F: Filter>(
    bvh: &Bvh8, rays: &Rays<16>, active: u32, filter: &F,
) -> [f32; 16] = transmittance_body);

impl Bvh8 {
    /// Bit k: ray k of `active` is blocked by an opaque primitive.
    ///
    /// Equal packets have equal answers, whatever was asked before. A ray that runs along a primitive and past its
    /// border, by less than what the rule of the module's page allows, may miss its box on the way down: it is not
    /// blocked then.
    #[must_use]
    pub fn blocked(&self, backend: Backend, rays: &Rays<16>, active: u32) -> u32 {
        blocked(backend, self, rays, active)
    }

    /// [`Bvh8::blocked`] for many packets with all their rays active: `blocked[k]` is the answer for `rays[k]`.
    pub fn blocked_batch(&self, backend: Backend, rays: &[Rays<16>], answers: &mut [u16]) {
        blocked_batch(backend, self, rays, answers);
    }

    /// The share that passes along each ray: 0 where an opaque primitive blocks it or what the filter says of all others
    /// multiplies to 0; 1 for rays that are not active.
    #[must_use]
    pub fn transmittance(&self, backend: Backend, rays: &Rays<16>, active: u32, filter: &impl Filter) -> [f32; 16] {
        transmittance(backend, self, rays, active, filter)
    }
}
