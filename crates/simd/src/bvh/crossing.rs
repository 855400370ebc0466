//! One ray against one primitive, eight times side by side: the rule of the module's page.

use super::SKIN;
use super::node::Block;
use super::{Bvh8, Rays};
use crate::lanes::{Lanes, WIDTH};

/// One value per axis, without a closure, which might be compiled without the backend's instructions.
macro_rules! three {
    ($axis:ident => $value:expr) => {
        [
            {
                let $axis = 0;
                $value
            },
            {
                let $axis = 1;
                $value
            },
            {
                let $axis = 2;
                $value
            },
        ]
    };
}
pub(crate) use three;

/// Eight rays, or one ray eight times.
#[derive(Clone, Copy)]
pub(crate) struct Ray<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    pub(crate) near: L,
    pub(crate) far: L,
    /// d: the distance within which points coincide.
    pub(crate) skin: L,
    /// d times the direction's length.
    pub(crate) reach: L,
}

impl<L: Lanes> Ray<L> {
    /// Eight rays.
    #[inline(always)]
    pub(crate) fn new(bvh: &Bvh8, origin: [L; 3], direction: [L; 3], near: L, far: L) -> Self {
        let size = origin[0].abs().max(origin[1].abs()).max(origin[2].abs());
        let skin = size.max(L::splat(bvh.scale)).mul(L::splat(SKIN));
        let reach = skin.mul(dot(direction, direction).sqrt());
        Ray { origin, direction, near, far, skin, reach }
    }

    /// Rays `8 * half` and on.
    #[inline(always)]
    pub(crate) fn half(bvh: &Bvh8, rays: &Rays<16>, half: usize) -> Self {
        let origin = three!(axis => L::load(eight(&rays.origin[axis], half)));
        let direction = three!(axis => L::load(eight(&rays.direction[axis], half)));
        Ray::new(bvh, origin, direction, L::load(eight(&rays.near, half)), L::load(eight(&rays.far, half)))
    }
}

/// Eight numbers of sixteen.
#[inline(always)]
pub(crate) fn eight(values: &[f32; 16], half: usize) -> &[f32; WIDTH] {
    &values.as_chunks::<WIDTH>().0[half]
}

/// Eight primitives, or one primitive eight times.
#[derive(Clone, Copy)]
pub(crate) struct Surface<L> {
    origin: [L; 3],
    minus_u: [L; 3],
    v: [L; 3],
    normal: [L; 3],
    length_u: L,
    length_v: L,
    pub(crate) length_w: L,
}

impl<L: Lanes> Surface<L> {
    /// All primitives of a block.
    #[inline(always)]
    pub(crate) fn all(block: &Block) -> Self {
        Surface {
            origin: three!(axis => L::load(&block.origin[axis])),
            minus_u: three!(axis => L::load(&block.minus_u[axis])),
            v: three!(axis => L::load(&block.v[axis])),
            normal: three!(axis => L::load(&block.normal[axis])),
            length_u: L::load(&block.length_u),
            length_v: L::load(&block.length_v),
            length_w: L::load(&block.length_w),
        }
    }

    /// One primitive of a block.
    #[inline(always)]
    pub(crate) fn one(block: &Block, lane: usize) -> Self {
        let lane = lane % WIDTH;
        Surface {
            origin: three!(axis => L::splat(block.origin[axis][lane])),
            minus_u: three!(axis => L::splat(block.minus_u[axis][lane])),
            v: three!(axis => L::splat(block.v[axis][lane])),
            normal: three!(axis => L::splat(block.normal[axis][lane])),
            length_u: L::splat(block.length_u[lane]),
            length_v: L::splat(block.length_v[lane]),
            length_w: L::splat(block.length_w[lane]),
        }
    }
}

/// Where eight rays cross eight primitives.
#[derive(Clone, Copy)]
pub(crate) struct Crossing<L: Lanes> {
    /// Which do.
    pub(crate) mask: L::Mask,
    /// `|N.D| / |N|`, what the following are to be divided by.
    pub(crate) det: L,
    /// t.
    pub(crate) t: L,
    /// u.
    pub(crate) u: L,
    /// v.
    pub(crate) v: L,
}

#[inline(always)]
fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// Crosses eight rays with eight primitives.
#[inline(always)]
pub(crate) fn cross<L: Lanes>(ray: &Ray<L>, surface: &Surface<L>) -> Crossing<L> {
    let d = ray.direction;
    let s = three!(axis => surface.origin[axis].sub(ray.origin[axis]));
    let c =
        [s[1].mul(d[2]).sub(s[2].mul(d[1])), s[2].mul(d[0]).sub(s[0].mul(d[2])), s[0].mul(d[1]).sub(s[1].mul(d[0]))];
    let sign = dot(surface.normal, d);
    let det = sign.flip(sign);
    let t = dot(surface.normal, s).flip(sign);
    let u = dot(surface.v, c).flip(sign);
    let v = dot(surface.minus_u, c).flip(sign);

    // Opposite sides of the plane, both further than the skin.
    let sides = L::and(ray.near.mul(det).add(ray.skin).lt(t), t.lt(ray.far.mul(det).sub(ray.skin)));
    // Inside the outline, or outside by less than the skin.
    let inner_u = u.min(det.sub(u)).add(ray.reach.mul(surface.length_v));
    let inner_v = v.min(det.sub(v)).add(ray.reach.mul(surface.length_u));
    let inner_w = det.add(ray.reach.mul(surface.length_w)).sub(u.add(v));
    let inside = L::splat(0.0).le(inner_u.min(inner_v).min(inner_w));
    Crossing { mask: L::and(sides, inside), det, t, u, v }
}
