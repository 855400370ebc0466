//! Two convex polygons in, proof that nothing is between them, or that one primitive is wholly, out.
//!
//! The hull of both polygons is bounded by planes through an edge of one and a corner of the other. Any direction bounds the
//! hull at its outermost corner, so a plane is never wrong, only loose, however it was rounded: a proof needs no exact
//! arithmetic. What rounding can make is a direction of nothing, where an edge is met by its own end (polygons with a
//! common edge): those are left out.

use super::build::STACK;
use super::crossing::{Ray, Surface, cross, three};
use super::node::{Block, LEAF, Node};
use super::{Bvh8, SKIN};
use crate::lanes::{Backend, Lanes, WIDTH, dispatch};
use std::mem::MaybeUninit;

/// Most corners of a polygon.
const CORNERS: usize = 4;
/// Most planes of a hull: two of the polygons and one of each edge, or twice as many of a flat hull.
const PLANES: usize = 2 * (2 + 2 * CORNERS);
/// Sine below which an edge and a corner span no plane: a hundred times what rounding the corners of a patch of the scene's
/// size leaves of it, so that the direction is good to a hundredth.
const SPAN: f32 = 1e-4;

/// Half spaces `normal . x <= offset` that hold the hull of two polygons.
struct Shaft {
    planes: [[f32; 4]; PLANES],
    count: usize,
    /// All corners, the first repeated where there are fewer than eight.
    corners: [[f32; 2 * CORNERS]; 3],
    lo: [f32; 3],
    hi: [f32; 3],
}

#[inline(always)]
fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

#[inline(always)]
fn cross3<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[1].mul(b[2]).sub(a[2].mul(b[1])), a[2].mul(b[0]).sub(a[0].mul(b[2])), a[0].mul(b[1]).sub(a[1].mul(b[0]))]
}

/// A polygon's corners, the last repeated where there are three.
#[inline(always)]
fn four(polygon: &[[f32; 3]]) -> [[f32; 3]; CORNERS] {
    let last = polygon.len().min(CORNERS).saturating_sub(1);
    [polygon[0], polygon[last.min(1)], polygon[last.min(2)], polygon[last]]
}

/// Eight primitives as what they span.
struct Shape<L: Lanes> {
    origin: [L; 3],
    u: [L; 3],
    v: [L; 3],
    triangle: L::Mask,
}

impl<L: Lanes> Shape<L> {
    #[inline(always)]
    fn new(block: &Block) -> Self {
        let (u, v) = (three!(axis => L::load(&block.minus_u[axis])), three!(axis => L::load(&block.v[axis])));
        // The block's edges are over |N|: their product is 1 / |N|. A lane without a primitive is not looked at.
        let normal = cross3(v, u);
        let area = L::splat(1.0).div(dot(normal, normal).sqrt());
        Shape {
            origin: three!(axis => L::load(&block.origin[axis])),
            u: three!(axis => u[axis].neg().mul(area)),
            v: three!(axis => v[axis].mul(area)),
            triangle: L::load(&block.length_w).lt(L::splat(f32::INFINITY)),
        }
    }

    /// The least and the largest `normal . x` of the corners.
    #[inline(always)]
    fn range(&self, normal: &[f32; 4]) -> (L, L) {
        let normal = [L::splat(normal[0]), L::splat(normal[1]), L::splat(normal[2])];
        let (p, u, v) = (dot(normal, self.origin), dot(normal, self.u), dot(normal, self.v));
        let fourth = L::select(self.triangle, L::splat(0.0), u.add(v));
        let least = u.min(v).min(fourth).min(L::splat(0.0));
        let most = u.max(v).max(fourth).max(L::splat(0.0));
        (p.add(least), p.add(most))
    }
}

impl Shaft {
    #[inline(always)]
    fn new<L: Lanes>(bvh: &Bvh8, a: &[[f32; 3]], b: &[[f32; 3]], plane_a: [f32; 4], plane_b: [f32; 4]) -> Self {
        let (a, b) = (four(a), four(b));
        let corners = three!(axis => [
            a[0][axis], a[1][axis], a[2][axis], a[3][axis], b[0][axis], b[1][axis], b[2][axis], b[3][axis],
        ]);
        let mut shaft = Shaft { planes: [[0.0; 4]; PLANES], count: 0, corners, lo: [0.0; 3], hi: [0.0; 3] };
        for (axis, corners) in corners.iter().enumerate() {
            let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
            for &x in corners {
                lo = if x < lo { x } else { lo };
                hi = if x > hi { x } else { hi };
            }
            (shaft.lo[axis], shaft.hi[axis]) = (lo, hi);
        }
        // A plane is the hull's if no corner is beyond it: by no more than the corners' own rounding.
        let slack = SKIN * bvh.scale;
        // Lanes: the two polygons' planes.
        let normal = three!(axis => L::load(&[plane_a[axis], 0.0, 0.0, 0.0, plane_b[axis], 0.0, 0.0, 0.0]));
        let base = three!(axis => L::load(&[a[0][axis], 0.0, 0.0, 0.0, b[0][axis], 0.0, 0.0, 0.0]));
        shaft.add::<L>(normal, base, slack, 0b1_0001);
        // Lanes: two edges of one polygon with four corners of the other.
        for (edges, ends) in [(&a, &b), (&b, &a)] {
            for pair in [0, 2] {
                let lane = |k: usize| {
                    (edges[pair + k / CORNERS], edges[(pair + k / CORNERS + 1) % CORNERS], ends[k % CORNERS])
                };
                let (mut p, mut q, mut r) = ([[0.0; WIDTH]; 3], [[0.0; WIDTH]; 3], [[0.0; WIDTH]; 3]);
                for k in 0..WIDTH {
                    let corners = lane(k);
                    for axis in 0..3 {
                        p[axis][k] = corners.0[axis];
                        q[axis][k] = corners.1[axis];
                        r[axis][k] = corners.2[axis];
                    }
                }
                let base = three!(axis => L::load(&p[axis]));
                let e = three!(axis => L::load(&q[axis]).sub(base[axis]));
                let f = three!(axis => L::load(&r[axis]).sub(base[axis]));
                let n = cross3(e, f);
                let square = dot(n, n);
                let spans = L::splat(SPAN * SPAN).mul(dot(e, e)).mul(dot(f, f)).lt(square);
                let length = square.sqrt();
                let n = three!(axis => n[axis].div(length));
                shaft.add::<L>(n, base, slack, L::bits(spans));
            }
        }
        shaft
    }

    /// Adds those of eight planes that bound the hull, of the lanes in `valid`.
    #[inline(always)]
    fn add<L: Lanes>(&mut self, normal: [L; 3], base: [L; 3], slack: f32, valid: u32) {
        let (mut least, mut most) = (L::splat(0.0), L::splat(0.0));
        for k in 0..2 * CORNERS {
            let height = dot(normal, three!(axis => L::splat(self.corners[axis][k]).sub(base[axis])));
            least = height.min(least);
            most = height.max(most);
        }
        let above = L::bits(most.le(L::splat(slack))) & valid;
        let below = L::bits(L::splat(-slack).le(least)) & valid;
        let offset = dot(normal, base);
        let mut normals = [[0.0; WIDTH]; 3];
        for (axis, lanes) in normal.into_iter().enumerate() {
            lanes.store(&mut normals[axis]);
        }
        let (mut upper, mut lower) = ([0.0; WIDTH], [0.0; WIDTH]);
        offset.add(most).store(&mut upper);
        offset.add(least).store(&mut lower);
        for (bits, sign, offsets) in [(above, 1.0, &upper), (below, -1.0, &lower)] {
            // Of one edge's corners, those on one side that bound the hull bound it alike.
            for group in [bits & 0x0f, bits & 0xf0] {
                if group != 0 && self.count < PLANES {
                    let k = group.trailing_zeros() as usize % WIDTH;
                    self.planes[self.count] =
                        [sign * normals[0][k], sign * normals[1][k], sign * normals[2][k], sign * offsets[k]];
                    self.count += 1;
                }
            }
        }
    }

    /// The children whose boxes may reach into the hull.
    #[inline(always)]
    fn meets<L: Lanes>(&self, node: &Node) -> u32 {
        let (lo, hi) = (three!(axis => L::load(&node.planes[axis])), three!(axis => L::load(&node.planes[axis + 3])));
        let mut inside = L::mask(0xff);
        for axis in 0..3 {
            inside = L::and(inside, lo[axis].le(L::splat(self.hi[axis])));
            inside = L::and(inside, L::splat(self.lo[axis]).le(hi[axis]));
        }
        for plane in &self.planes[..self.count] {
            // The box's corner that is farthest inside.
            let x = if plane[0] < 0.0 { hi[0] } else { lo[0] }.mul(L::splat(plane[0]));
            let y = if plane[1] < 0.0 { hi[1] } else { lo[1] }.mul(L::splat(plane[1]));
            let z = if plane[2] < 0.0 { hi[2] } else { lo[2] }.mul(L::splat(plane[2]));
            inside = L::and(inside, x.add(y).add(z).lt(L::splat(plane[3])));
            if L::bits(inside) == 0 {
                break;
            }
        }
        L::bits(inside) & node.present
    }

    /// The primitives that may reach into the hull by more than `tolerance`, and do not lie in one of the two planes.
    #[inline(always)]
    fn holds<L: Lanes>(&self, block: &Block, tolerance: f32, plane_a: [f32; 4], plane_b: [f32; 4]) -> u32 {
        let tolerance = L::splat(tolerance);
        let shape = Shape::<L>::new(block);
        let mut inside = L::mask(0xff);
        for plane in &self.planes[..self.count] {
            let (least, _) = shape.range(plane);
            inside = L::and(inside, least.lt(L::splat(plane[3]).sub(tolerance)));
        }
        let mut inside = L::bits(inside);
        if inside == 0 {
            return 0;
        }
        for plane in [plane_a, plane_b] {
            let (least, most) = shape.range(&plane);
            let offset = L::splat(plane[3]);
            let lies = L::and(offset.sub(tolerance).le(least), most.le(offset.add(tolerance)));
            inside &= !L::bits(lies);
        }
        // The hull on one side of the primitive's own plane.
        let normal = three!(axis => L::load(&block.normal[axis]));
        let (mut least, mut most) = (L::splat(f32::INFINITY), L::splat(f32::NEG_INFINITY));
        for k in 0..2 * CORNERS {
            let height = dot(normal, three!(axis => L::splat(self.corners[axis][k]).sub(shape.origin[axis])));
            least = height.min(least);
            most = height.max(most);
        }
        inside & !L::bits(L::or(most.le(tolerance), tolerance.neg().le(least)))
    }
}

#[inline(always)]
fn clear_between_body<L: Lanes>(
    bvh: &Bvh8,
    a: &[[f32; 3]],
    b: &[[f32; 3]],
    plane_a: [f32; 4],
    plane_b: [f32; 4],
    tolerance: f32,
    mut budget: u32,
) -> bool {
    if bvh.nodes.is_empty() {
        return true;
    }
    let shaft = Shaft::new::<L>(bvh, a, b, plane_a, plane_b);
    let mut stack = [const { MaybeUninit::<u32>::uninit() }; STACK];
    stack[0] = MaybeUninit::new(0);
    let mut top = 1;
    while top > 0 {
        top -= 1;
        // SAFETY: entries below `top` were written when it passed them.
        let at = unsafe { stack[top].assume_init() };
        let Some(left) = budget.checked_sub(1) else { return false };
        budget = left;
        let node = &bvh.nodes[at as usize];
        let mut hits = shaft.meets::<L>(node);
        while hits != 0 {
            let k = hits.trailing_zeros() as usize % WIDTH;
            hits &= hits - 1;
            let child = node.children[k];
            if child & LEAF == 0 {
                stack[top] = MaybeUninit::new(child);
                top += 1;
                continue;
            }
            let Some(left) = budget.checked_sub(u32::from(node.counts[k])) else { return false };
            budget = left;
            let block = &bvh.blocks[(child & !LEAF) as usize];
            let present = (1_u32 << node.counts[k]) - 1;
            if shaft.holds::<L>(block, tolerance, plane_a, plane_b) & present != 0 {
                return false;
            }
        }
    }
    true
}
dispatch!(fn clear_between(
    bvh: &Bvh8, a: &[[f32; 3]], b: &[[f32; 3]], plane_a: [f32; 4], plane_b: [f32; 4], tolerance: f32, budget: u32,
) -> bool = clear_between_body);

#[inline(always)]
fn blocks_all_body<L: Lanes>(bvh: &Bvh8, place: u32, a: &[[f32; 3]], b: &[[f32; 3]], tolerance: f32) -> bool {
    let block = &bvh.blocks[place as usize / WIDTH];
    let mut surface = Surface::<L>::one(block, place as usize % WIDTH);
    // The reach below is negative; a parallelogram has no third edge to be inside of.
    let infinity = L::splat(f32::INFINITY);
    surface.length_w = L::select(surface.length_w.lt(infinity), surface.length_w, infinity.neg());
    let (a, b) = (four(a), four(b));
    // Lanes: two corners of one polygon with four of the other.
    for pair in [0, 2] {
        let (mut origin, mut direction) = ([[0.0; WIDTH]; 3], [[0.0; WIDTH]; 3]);
        for k in 0..WIDTH {
            for axis in 0..3 {
                origin[axis][k] = a[pair + k / CORNERS][axis];
                direction[axis][k] = b[k % CORNERS][axis] - a[pair + k / CORNERS][axis];
            }
        }
        let origin = three!(axis => L::load(&origin[axis]));
        let direction = three!(axis => L::load(&direction[axis]));
        let mut ray = Ray::new(bvh, origin, direction, L::splat(0.0), L::splat(1.0));
        // Well inside the outline, where a query's rule asks for less than well outside.
        ray.skin = ray.skin.max(L::splat(tolerance));
        ray.reach = ray.skin.mul(dot(direction, direction).sqrt()).neg();
        if L::bits(cross(&ray, &surface).mask) != 0xff {
            return false;
        }
    }
    true
}
dispatch!(fn blocks_all(bvh: &Bvh8, place: u32, a: &[[f32; 3]], b: &[[f32; 3]], tolerance: f32) -> bool = blocks_all_body);

impl Bvh8 {
    /// Whether nothing, opaque or not, is between two convex polygons of 3 or 4 corners in planes `n . x = offset` (written
    /// `[n, offset]`, n of length 1): no primitive reaches into the convex hull of both by more than `tolerance`, save those
    /// within `tolerance` of one of the two planes as a whole.
    ///
    /// True is a proof, false means that none was found within a `budget` of nodes and primitives together. `tolerance` is
    /// to be [`SKIN`] times the scene's size or more.
    ///
    /// # Panics
    /// With a polygon without corners.
    #[must_use]
    #[allow(clippy::too_many_arguments)]
    pub fn clear_between(
        &self,
        backend: Backend,
        a: &[[f32; 3]],
        b: &[[f32; 3]],
        plane_a: [f32; 4],
        plane_b: [f32; 4],
        tolerance: f32,
        budget: u32,
    ) -> bool {
        clear_between(backend, self, a, b, plane_a, plane_b, tolerance, budget)
    }

    /// Whether an opaque primitive alone is crossed by all segments between two convex polygons of 3 or 4 corners, each
    /// further than `tolerance` inside its outline and with its ends further than that from its plane.
    ///
    /// The segments between corners decide: where a segment between two inner points crosses the plane is a convex
    /// combination of where those do.
    ///
    /// # Panics
    /// With a polygon without corners.
    #[must_use]
    pub fn blocks_all(&self, backend: Backend, primitive: u32, a: &[[f32; 3]], b: &[[f32; 3]], tolerance: f32) -> bool {
        match self.places.get(primitive as usize) {
            Some(&place) if place >> 31 == 0 => blocks_all(backend, self, place, a, b, tolerance),
            _ => false,
        }
    }
}
