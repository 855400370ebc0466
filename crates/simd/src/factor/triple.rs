//! Vectors of three components, each component lanes: the few operations that the kernels of this folder need.

use crate::lanes::Lanes;

/// The same vector in all lanes.
#[inline(always)]
pub(super) fn splat<L: Lanes>(vector: [f32; 3]) -> [L; 3] {
    [L::splat(vector[0]), L::splat(vector[1]), L::splat(vector[2])]
}

/// Lane k from entry k of each component.
#[inline(always)]
pub(super) fn load<L: Lanes>(vectors: &[[f32; 8]; 3]) -> [L; 3] {
    [L::load(&vectors[0]), L::load(&vectors[1]), L::load(&vectors[2])]
}

/// Sum.
#[inline(always)]
pub(super) fn add<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0].add(b[0]), a[1].add(b[1]), a[2].add(b[2])]
}

/// Difference.
#[inline(always)]
pub(super) fn sub<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

/// Multiple.
#[inline(always)]
pub(super) fn scale<L: Lanes>(a: [L; 3], by: L) -> [L; 3] {
    [a[0].mul(by), a[1].mul(by), a[2].mul(by)]
}

/// Scalar product.
#[inline(always)]
pub(super) fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// Sum of the magnitudes of a scalar product's terms.
#[inline(always)]
pub(super) fn magnitude<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul(b[0]).abs().add(a[1].mul(b[1]).abs()).add(a[2].mul(b[2]).abs())
}

/// Vector product.
#[inline(always)]
pub(super) fn cross<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[1].mul(b[2]).sub(a[2].mul(b[1])), a[2].mul(b[0]).sub(a[0].mul(b[2])), a[0].mul(b[1]).sub(a[1].mul(b[0]))]
}

/// `yes` where the mask says so, else `no`.
#[inline(always)]
pub(super) fn select<L: Lanes>(mask: L::Mask, yes: [L; 3], no: [L; 3]) -> [L; 3] {
    [L::select(mask, yes[0], no[0]), L::select(mask, yes[1], no[1]), L::select(mask, yes[2], no[2])]
}
