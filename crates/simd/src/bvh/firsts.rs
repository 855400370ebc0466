//! Sixteen rays in, the first hit of each out: a walk of the packet as a whole, nearest children first.
//!
//! Each ray has a far end of its own, which its hits draw in, and each child that waits knows where each ray enters it: a ray
//! whose far end lies before that has no more to do with the child. Where few rays are left they go on one by one.

use super::build::STACK;
use super::closest::Hit;
use super::crossing::{Ray, Surface, cross, eight};
use super::node::{Block, LEAF, NONE, Node};
use super::packet::{Hull, Packet, eight_mut, valid};
use super::{Bvh8, Rays};
use crate::lanes::{Backend, Lanes, WIDTH, dispatch};
use std::mem::MaybeUninit;

/// Up to this many rays go on one by one. In a room 2 to 6 differ by less than a tenth (bench `rays`).
const FEW: u32 = 3;

/// A child that waits to be visited.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct Waiting {
    /// Where each ray enters it.
    from: [f32; 16],
    /// What [`Node::children`] says of it.
    child: u32,
    /// Number of primitives, of a block.
    count: u32,
    /// The rays that meet its box.
    rays: u32,
}

/// What the rays have hit so far.
#[repr(C, align(32))]
struct Found {
    t: [f32; 16],
    u: [f32; 16],
    v: [f32; 16],
    /// Where each ray's search ends: at its hit, or at its far end.
    end: [f32; 16],
    ids: [u32; 16],
}

impl Found {
    #[inline(always)]
    fn hit(&self, ray: usize) -> Hit {
        let k = ray % 16;
        Hit { t: self.t[k], primitive: self.ids[k], u: self.u[k], v: self.v[k] }
    }

    /// The rays that have not ended where they enter a child.
    #[inline(always)]
    fn come_to<L: Lanes>(&self, from: &[f32; 16]) -> u32 {
        let low = L::load(eight(from, 0)).le(L::load(eight(&self.end, 0)));
        let high = L::load(eight(from, 1)).le(L::load(eight(&self.end, 1)));
        L::bits(low) | L::bits(high) << WIDTH
    }

    /// Tests a primitive with those `rays` that enter its block's box.
    #[inline(always)]
    fn visit<L: Lanes>(&mut self, packet: &Packet<'_, L>, block: &Block, lane: usize, rays: u32) {
        let lane = lane % WIDTH;
        let surface = Surface::one(block, lane);
        for half in 0..2 {
            let ray = &packet.rays[half];
            let crossing = cross(ray, &surface);
            let hit = L::bits(crossing.mask) & rays >> (half * WIDTH);
            if hit == 0 {
                continue;
            }
            let (t, before) = (crossing.t.div(crossing.det), L::load(eight(&self.t, half)));
            let mut nearer = L::bits(t.lt(before)) & hit;
            let id = block.ids[lane];
            // Of several at one t the lowest index is the answer.
            let mut ties = L::bits(t.le(before)) & hit & !nearer;
            while ties != 0 {
                let k = ties.trailing_zeros() as usize % WIDTH;
                nearer |= u32::from(id < self.ids[half * WIDTH + k]) << k;
                ties &= ties - 1;
            }
            if nearer == 0 {
                continue;
            }
            let mask = L::mask(nearer);
            let t = L::select(mask, t, before);
            t.store(eight_mut(&mut self.t, half));
            t.min(ray.far).store(eight_mut(&mut self.end, half));
            let (u, v) = (crossing.u.div(crossing.det), crossing.v.div(crossing.det));
            L::select(mask, u, L::load(eight(&self.u, half))).store(eight_mut(&mut self.u, half));
            L::select(mask, v, L::load(eight(&self.v, half))).store(eight_mut(&mut self.v, half));
            while nearer != 0 {
                let k = nearer.trailing_zeros() as usize % WIDTH;
                self.ids[half * WIDTH + k] = id;
                nearer &= nearer - 1;
            }
        }
    }

    /// Takes each of some rays below a child alone.
    #[inline(always)]
    fn one_by_one<L: Lanes>(&mut self, bvh: &Bvh8, packet: &Packet<'_, L>, child: &Waiting, mut rays: u32) {
        while rays != 0 {
            let k = rays.trailing_zeros() as usize % 16;
            rays &= rays - 1;
            let mut hit = self.hit(k);
            let far = packet.single.far[k];
            packet.probe(k).follow(bvh, child.child, child.from[k], far, &mut hit);
            (self.t[k], self.u[k], self.v[k], self.ids[k]) = (hit.t, hit.u, hit.v, hit.primitive);
            self.end[k] = if hit.t < far { hit.t } else { far };
        }
    }
}

/// The rays that meet the box of child `k` before their ends, and where.
#[inline(always)]
fn enter<L: Lanes>(packet: &Packet<'_, L>, end: &[f32; 16], node: &Node, k: usize) -> (u32, [L; 2]) {
    let k = k % WIDTH;
    let mut bits = 0;
    let mut froms = [L::splat(0.0); 2];
    for (half, found) in froms.iter_mut().enumerate() {
        let ray = &packet.rays[half];
        let (mut from, mut to) = (ray.near, L::load(eight(end, half)));
        for axis in 0..3 {
            let a = L::splat(node.planes[axis][k]).sub(ray.origin[axis]).mul(packet.inverse[half][axis]);
            let b = L::splat(node.planes[axis + 3][k]).sub(ray.origin[axis]).mul(packet.inverse[half][axis]);
            // 0 times infinity is no bound, as for a ray alone.
            from = b.min(a).max(from);
            to = a.max(b).min(to);
        }
        *found = from;
        bits |= L::bits(from.le(to)) << (half * WIDTH);
    }
    (bits, froms)
}

#[inline(always)]
fn closest16_body<L: Lanes>(bvh: &Bvh8, rays: &Rays<16>, active: u32) -> [Hit; 16] {
    let pair = [Ray::<L>::half(bvh, rays, 0), Ray::half(bvh, rays, 1)];
    let live = valid(&pair, active & 0xffff);
    let mut found = Found { t: [f32::INFINITY; 16], u: [0.0; 16], v: [0.0; 16], end: rays.far, ids: [NONE; 16] };
    if live != 0 && !bvh.nodes.is_empty() {
        walk(bvh, &Packet::new(rays, pair), live, &mut found);
    }
    std::array::from_fn(|k| found.hit(k))
}
dispatch!(fn closest16(bvh: &Bvh8, rays: &Rays<16>, active: u32) -> [Hit; 16] = closest16_body);

/// Walks the hierarchy with the rays of `live`.
#[inline(always)]
fn walk<L: Lanes>(bvh: &Bvh8, packet: &Packet<'_, L>, live: u32, found: &mut Found) {
    let hull = Hull::new(packet, live);
    let none = L::splat(f32::INFINITY);
    let mut stack = [const { MaybeUninit::<Waiting>::uninit() }; STACK];
    stack[0] = MaybeUninit::new(Waiting { from: packet.single.near, child: 0, count: 0, rays: live });
    let mut top = 1;
    while top > 0 {
        top -= 1;
        // SAFETY: entries below `top` were written when it passed them.
        let waiting = unsafe { stack[top].assume_init_ref() };
        let rays = waiting.rays & found.come_to::<L>(&waiting.from);
        if rays.count_ones() <= FEW {
            found.one_by_one(bvh, packet, waiting, rays);
            continue;
        }
        let child = waiting.child;
        if child & LEAF != 0 {
            let block = &bvh.blocks[(child & !LEAF) as usize];
            let mut left = hull.meets::<L>(&block.planes) & ((1 << waiting.count) - 1);
            if rays.count_ones() <= 2 * left.count_ones() {
                found.one_by_one(bvh, packet, waiting, rays);
                continue;
            }
            while left != 0 {
                found.visit(packet, block, left.trailing_zeros() as usize, rays);
                left &= left - 1;
            }
            continue;
        }
        let node = &bvh.nodes[child as usize];
        let mut hits = hull.meets::<L>(&node.planes) & node.present;
        let (mut nearest, mut froms, mut inside) = ([none; WIDTH], [[none; 2]; WIDTH], [0; WIDTH]);
        let mut left = hits;
        while left != 0 {
            let k = left.trailing_zeros() as usize % WIDTH;
            left &= left - 1;
            let (bits, from) = enter(packet, &found.end, node, k);
            let bits = bits & rays;
            if bits == 0 {
                hits &= !(1 << k);
                continue;
            }
            (inside[k], froms[k]) = (bits, from);
            let [low, high] =
                [L::select(L::mask(bits), from[0], none), L::select(L::mask(bits >> WIDTH), from[1], none)];
            nearest[k] = low.min(high);
        }
        let mut t = [0.0; WIDTH];
        L::least(nearest).store(&mut t);
        // The nearest on top.
        let mut order = [0_u8; WIDTH];
        let mut count = 0;
        while hits != 0 {
            let k = hits.trailing_zeros() as usize % WIDTH;
            hits &= hits - 1;
            let mut at = count;
            while at > 0 && t[usize::from(order[at - 1]) % WIDTH] < t[k] {
                order[at] = order[at - 1];
                at -= 1;
            }
            order[at] = k as u8;
            count += 1;
        }
        for &k in &order[..count] {
            let k = usize::from(k) % WIDTH;
            let mut from = [0.0; 16];
            froms[k][0].store(eight_mut(&mut from, 0));
            froms[k][1].store(eight_mut(&mut from, 1));
            let (child, count) = (node.children[k], u32::from(node.counts[k]));
            stack[top] = MaybeUninit::new(Waiting { from, child, count, rays: inside[k] });
            top += 1;
        }
    }
}

impl Bvh8 {
    /// [`Bvh8::closest`] for each active ray, [`Hit::NONE`] where there is no hit. The rays need have nothing in common, and
    /// take least time where they keep together.
    ///
    /// The answer has the same bits as a ray's alone, but for a ray that runs along a primitive and past its border by less
    /// than what the rule of the module's page allows: that may miss its box on the way down here or there.
    #[must_use]
    pub fn closest16(&self, backend: Backend, rays: &Rays<16>, active: u32) -> [Hit; 16] {
        closest16(backend, self, rays, active)
    }
}
