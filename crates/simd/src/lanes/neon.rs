//! Lanes in two NEON registers.

use super::{Lanes, WIDTH};
use std::arch::aarch64::*;

/// Eight numbers in two registers of 128 bits.
#[derive(Clone, Copy)]
pub(crate) struct Neon(float32x4_t, float32x4_t);

/// Two registers of comparisons.
#[derive(Clone, Copy)]
pub(crate) struct NeonMask(uint32x4_t, uint32x4_t);

macro_rules! both {
    ($op:ident, $a:expr, $b:expr, $wrap:ident) => {
        // SAFETY: the instructions exist, since methods of `Neon` are reached through `dispatch!` alone, whose entry asked
        // the processor (the contract of `Lanes`).
        unsafe { $wrap($op($a.0, $b.0), $op($a.1, $b.1)) }
    };
}

impl Lanes for Neon {
    type Mask = NeonMask;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: as in `both!`.
        unsafe { Neon(vdupq_n_f32(value), vdupq_n_f32(value)) }
    }
    #[inline(always)]
    fn load(values: &[f32; WIDTH]) -> Self {
        // SAFETY: as in `both!`; the array holds the eight numbers that are read.
        unsafe { Neon(vld1q_f32(values.as_ptr()), vld1q_f32(values.as_ptr().add(4))) }
    }
    #[inline(always)]
    fn store(self, values: &mut [f32; WIDTH]) {
        // SAFETY: as in `both!`; the array has room for eight numbers.
        unsafe {
            vst1q_f32(values.as_mut_ptr(), self.0);
            vst1q_f32(values.as_mut_ptr().add(4), self.1);
        }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        both!(vaddq_f32, self, other, Neon)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        both!(vsubq_f32, self, other, Neon)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        both!(vmulq_f32, self, other, Neon)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        both!(vdivq_f32, self, other, Neon)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: as in `both!`.
        unsafe { Neon(vsqrtq_f32(self.0), vsqrtq_f32(self.1)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: as in `both!`.
        unsafe { Neon(vabsq_f32(self.0), vabsq_f32(self.1)) }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // `vminq` would return what is not a number; the contract asks for the other.
        Self::select(self.lt(other), self, other)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(other.lt(self), self, other)
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        // SAFETY: as in `both!`.
        unsafe {
            let sign = vdupq_n_u32(1 << 31);
            let one = |a, b| {
                vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(a), vandq_u32(vreinterpretq_u32_f32(b), sign)))
            };
            Neon(one(self.0, other.0), one(self.1, other.1))
        }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        both!(vcltq_f32, self, other, NeonMask)
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        both!(vcleq_f32, self, other, NeonMask)
    }
    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        both!(vandq_u32, a, b, NeonMask)
    }
    #[inline(always)]
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        both!(vorrq_u32, a, b, NeonMask)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        // SAFETY: as in `both!`.
        unsafe { Neon(vbslq_f32(mask.0, yes.0, no.0), vbslq_f32(mask.1, yes.1, no.1)) }
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        // SAFETY: as in `both!`; the arrays hold the four numbers that are read.
        unsafe {
            let low = vld1q_u32([1, 2, 4, 8].as_ptr());
            let high = vld1q_u32([16, 32, 64, 128].as_ptr());
            vaddvq_u32(vandq_u32(mask.0, low)) | vaddvq_u32(vandq_u32(mask.1, high))
        }
    }
    #[inline(always)]
    fn mask(bits: u32) -> Self::Mask {
        // SAFETY: as in `both!`; the arrays hold the four numbers that are read.
        unsafe {
            let low = vld1q_u32([1, 2, 4, 8].as_ptr());
            let high = vld1q_u32([16, 32, 64, 128].as_ptr());
            let all = vdupq_n_u32(bits);
            NeonMask(vtstq_u32(all, low), vtstq_u32(all, high))
        }
    }
}
