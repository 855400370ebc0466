//! Lanes as an array: the definition of every operation, and the backend of processors without a better one.

use super::{Lanes, WIDTH};

/// Eight numbers in an array.
#[derive(Clone, Copy)]
pub(crate) struct Scalar([f32; WIDTH]);

#[inline(always)]
fn zip<T, U, V: Copy + Default>(a: &[T; WIDTH], b: &[U; WIDTH], op: impl Fn(&T, &U) -> V) -> [V; WIDTH] {
    let mut out = [V::default(); WIDTH];
    for k in 0..WIDTH {
        out[k] = op(&a[k], &b[k]);
    }
    out
}

impl Lanes for Scalar {
    type Mask = [bool; WIDTH];

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Scalar([value; WIDTH])
    }
    #[inline(always)]
    fn load(values: &[f32; WIDTH]) -> Self {
        Scalar(*values)
    }
    #[inline(always)]
    fn store(self, values: &mut [f32; WIDTH]) {
        *values = self.0;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Scalar(zip(&self.0, &other.0, |a, b| a + b))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Scalar(zip(&self.0, &other.0, |a, b| a - b))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Scalar(zip(&self.0, &other.0, |a, b| a * b))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Scalar(zip(&self.0, &other.0, |a, b| a / b))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Scalar(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Scalar(zip(&self.0, &other.0, |&a, &b| if a < b { a } else { b }))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Scalar(zip(&self.0, &other.0, |&a, &b| if a > b { a } else { b }))
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        Scalar(zip(&self.0, &other.0, |a, b| f32::from_bits(a.to_bits() ^ (b.to_bits() & (1 << 31)))))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        zip(&self.0, &other.0, |a, b| a < b)
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        zip(&self.0, &other.0, |a, b| a <= b)
    }
    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        zip(&a, &b, |&a, &b| a & b)
    }
    #[inline(always)]
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        zip(&a, &b, |&a, &b| a | b)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        let mut out = no.0;
        for k in 0..WIDTH {
            out[k] = if mask[k] { yes.0[k] } else { no.0[k] };
        }
        Scalar(out)
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        mask.iter().enumerate().fold(0, |bits, (k, &yes)| bits | u32::from(yes) << k)
    }
    #[inline(always)]
    fn mask(bits: u32) -> Self::Mask {
        std::array::from_fn(|k| bits >> k & 1 == 1)
    }
}
