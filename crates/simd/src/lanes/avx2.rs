//! Lanes in one AVX register.

use super::{Lanes, WIDTH};
use std::arch::x86_64::*;

/// Eight numbers in a register of 256 bits.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256);

// SAFETY of every block below: the instructions exist, since methods of `Avx2` are reached through `dispatch!` alone, whose
// entry asked the processor (the contract of `Lanes`).
impl Lanes for Avx2 {
    type Mask = __m256;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_set1_ps(value) })
    }
    #[inline(always)]
    fn load(values: &[f32; WIDTH]) -> Self {
        // SAFETY: see above the impl; the array holds the eight numbers that are read, and alignment is not asked for.
        Avx2(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, values: &mut [f32; WIDTH]) {
        // SAFETY: see above the impl; the array has room for eight numbers, and alignment is not asked for.
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_div_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn least(v: [Self; WIDTH]) -> Self {
        // SAFETY: see above the impl.
        unsafe {
            // Rows of two registers side by side: even lanes of both, odd lanes of both, within halves of 128 bits.
            let fold = |a: __m256, b: __m256| {
                _mm256_min_ps(_mm256_shuffle_ps::<0b10_00_10_00>(a, b), _mm256_shuffle_ps::<0b11_01_11_01>(a, b))
            };
            let (a, b) = (fold(v[0].0, v[1].0), fold(v[2].0, v[3].0));
            let (c, d) = (fold(v[4].0, v[5].0), fold(v[6].0, v[7].0));
            // Low halves hold the least of lanes 0 to 3 of four values, high halves of lanes 4 to 7.
            let (a, c) = (fold(a, b), fold(c, d));
            let low = _mm256_permute2f128_ps::<0x20>(a, c);
            let high = _mm256_permute2f128_ps::<0x31>(a, c);
            Avx2(_mm256_min_ps(low, high))
        }
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(other.0, _mm256_set1_ps(-0.0))) })
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        // SAFETY: see above the impl.
        unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        // SAFETY: see above the impl.
        unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        // SAFETY: see above the impl.
        unsafe { _mm256_and_ps(a, b) }
    }
    #[inline(always)]
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        // SAFETY: see above the impl.
        unsafe { _mm256_or_ps(a, b) }
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        // SAFETY: see above the impl.
        Avx2(unsafe { _mm256_blendv_ps(no.0, yes.0, mask) })
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        // SAFETY: see above the impl.
        (unsafe { _mm256_movemask_ps(mask) }) as u32
    }
    #[inline(always)]
    fn mask(bits: u32) -> Self::Mask {
        // SAFETY: see above the impl.
        unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let picked = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(picked, lanes))
        }
    }
}
