//! A single ray in, its first hit out: all eight children of a node at once, all eight primitives of a block at once.

use super::Bvh8;
use super::build::STACK;
use super::crossing::{Ray, Surface, cross, three};
use super::node::{LEAF, NONE, Node};
use crate::lanes::{Backend, Lanes, WIDTH, dispatch};
use std::mem::MaybeUninit;

/// Where a ray crosses a primitive: at `origin + t * direction`, which is `origin + u * U + v * V` of the primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Along the ray.
    pub t: f32,
    /// Index of the primitive, `u32::MAX` where there is none.
    pub primitive: u32,
    /// Along its first edge.
    pub u: f32,
    /// Along its second edge.
    pub v: f32,
}

impl Hit {
    /// No hit.
    pub const NONE: Hit = Hit { t: f32::INFINITY, primitive: NONE, u: 0.0, v: 0.0 };
}

/// One ray in all lanes.
pub(super) struct Probe<L> {
    ray: Ray<L>,
    inverse: [L; 3],
    /// Which of [`Node::planes`] the ray enters by along each axis; it leaves by the other.
    enters: [usize; 3],
}

impl<L: Lanes> Probe<L> {
    #[inline(always)]
    pub(super) fn new(bvh: &Bvh8, origin: [f32; 3], direction: [f32; 3], near: f32, far: f32) -> Self {
        let origin = three!(axis => L::splat(origin[axis]));
        let lanes = three!(axis => L::splat(direction[axis]));
        let ray = Ray::new(bvh, origin, lanes, L::splat(near), L::splat(far));
        // Adding 0 makes -0 +0.
        Probe::of(ray, three!(axis => 1.0 / (direction[axis] + 0.0)))
    }

    /// `inverse`: one over the direction.
    #[inline(always)]
    pub(super) fn of(ray: Ray<L>, inverse: [f32; 3]) -> Self {
        Probe {
            ray,
            inverse: three!(axis => L::splat(inverse[axis])),
            enters: three!(axis => if inverse[axis] < 0.0 { axis + 3 } else { axis }),
        }
    }

    /// The children whose boxes the ray meets before `far`, and where.
    #[inline(always)]
    fn enter(&self, node: &Node, far: L) -> (u32, [f32; WIDTH]) {
        let (mut from, mut to) = (self.ray.near, far);
        for axis in 0..3 {
            let (a, b) = (self.enters[axis], (self.enters[axis] + 3) % 6);
            let a = L::load(&node.planes[a]).sub(self.ray.origin[axis]).mul(self.inverse[axis]);
            let b = L::load(&node.planes[b]).sub(self.ray.origin[axis]).mul(self.inverse[axis]);
            // 0 times infinity is no bound: the box is padded, so nothing within is as near its side.
            from = a.max(from);
            to = b.min(to);
        }
        let mut t = [0.0; WIDTH];
        from.store(&mut t);
        (L::bits(from.le(to)) & node.present, t)
    }

    /// Walks what is below a child that the ray enters at `from`, for what is hit before `hit`.
    #[inline(always)]
    pub(super) fn follow(&self, bvh: &Bvh8, child: u32, from: f32, far: f32, hit: &mut Hit) {
        let mut stack = [const { MaybeUninit::<(u32, f32)>::uninit() }; STACK];
        stack[0] = MaybeUninit::new((child, from));
        let mut top = 1;
        let mut best = if hit.t < far { hit.t } else { far };
        while top > 0 {
            top -= 1;
            // SAFETY: entries below `top` were written when it passed them.
            let (child, from) = unsafe { stack[top].assume_init() };
            // Where two primitives are hit at one t, the lower index is the answer, so equals are looked at.
            if from > best {
                continue;
            }
            if child & LEAF != 0 {
                let block = &bvh.blocks[(child & !LEAF) as usize];
                let crossing = cross(&self.ray, &Surface::all(block));
                let mut bits = L::bits(crossing.mask);
                if bits == 0 {
                    continue;
                }
                let (mut t, mut u, mut v) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
                crossing.t.div(crossing.det).store(&mut t);
                crossing.u.div(crossing.det).store(&mut u);
                crossing.v.div(crossing.det).store(&mut v);
                while bits != 0 {
                    let k = bits.trailing_zeros() as usize % WIDTH;
                    bits &= bits - 1;
                    let id = block.ids[k];
                    if t[k] < hit.t || t[k] == hit.t && id < hit.primitive {
                        *hit = Hit { t: t[k], primitive: id, u: u[k], v: v[k] };
                    }
                }
                best = if hit.t < far { hit.t } else { far };
                continue;
            }
            let node = &bvh.nodes[child as usize];
            let (mut hits, t) = self.enter(node, L::splat(best));
            // The nearest on top, by insertion, as a ray meets few children of most nodes.
            let first = top;
            while hits != 0 {
                let k = hits.trailing_zeros() as usize % WIDTH;
                hits &= hits - 1;
                let mut at = top;
                while at > first {
                    // SAFETY: entries from `first` up to `top` were written below.
                    let before = unsafe { stack[at - 1].assume_init() };
                    if before.1 >= t[k] {
                        break;
                    }
                    stack[at] = MaybeUninit::new(before);
                    at -= 1;
                }
                stack[at] = MaybeUninit::new((node.children[k], t[k]));
                top += 1;
            }
        }
    }
}

#[inline(always)]
fn closest_body<L: Lanes>(bvh: &Bvh8, origin: [f32; 3], direction: [f32; 3], near: f32, far: f32) -> Hit {
    let mut hit = Hit::NONE;
    // What is not a number is refused too.
    let some = near < far;
    if bvh.nodes.is_empty() || !some {
        return hit;
    }
    Probe::<L>::new(bvh, origin, direction, near, far).follow(bvh, 0, near, far, &mut hit);
    hit
}
dispatch!(fn closest(bvh: &Bvh8, origin: [f32; 3], direction: [f32; 3], near: f32, far: f32) -> Hit = closest_body);

impl Bvh8 {
    /// The first primitive that a segment crosses, opaque or not; of several at one t that with the lowest index.
    #[must_use]
    pub fn closest(&self, backend: Backend, origin: [f32; 3], direction: [f32; 3], near: f32, far: f32) -> Option<Hit> {
        let hit = closest(backend, self, origin, direction, near, far);
        (hit.primitive != NONE).then_some(hit)
    }
}
