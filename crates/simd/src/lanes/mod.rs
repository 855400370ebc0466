//! Eight numbers of single precision side by side: one trait, a backend per instruction set, the same bits from each.
//!
//! Only operations that IEEE 754 fixes to the last bit are here (no fused multiply-add, no estimates), so that a result
//! does not depend on the machine that computed it.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "aarch64")]
pub(crate) use neon::Neon;
pub(crate) use scalar::Scalar;

use std::sync::OnceLock;

/// Number of lanes.
pub const WIDTH: usize = 8;

/// Eight lanes of `f32`.
///
/// A kernel is an `#[inline(always)]` function generic over its lanes; its entry for a backend with instructions of its own
/// is a `#[target_feature]` function that calls it, so that everything is inlined under the features it needs. Methods of
/// a backend may be called only where the instructions exist: entries are reached through [`Backend::best`], which asks
/// the processor.
pub(crate) trait Lanes: Copy {
    /// Eight yes-or-nos.
    type Mask: Copy;

    /// The same number in all lanes.
    fn splat(value: f32) -> Self;
    /// Lane k from entry k.
    fn load(values: &[f32; WIDTH]) -> Self;
    /// Entry k from lane k.
    fn store(self, values: &mut [f32; WIDTH]);
    /// Sum.
    fn add(self, other: Self) -> Self;
    /// Difference.
    fn sub(self, other: Self) -> Self;
    /// Product.
    fn mul(self, other: Self) -> Self;
    /// Quotient.
    fn div(self, other: Self) -> Self;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// `self < other ? self : other`: `other` where either is not a number.
    fn min(self, other: Self) -> Self;
    /// `self > other ? self : other`: `other` where either is not a number.
    fn max(self, other: Self) -> Self;
    /// `self < other`; no where either is not a number.
    fn lt(self, other: Self) -> Self::Mask;
    /// `self <= other`; no where either is not a number.
    fn le(self, other: Self) -> Self::Mask;
    /// Both.
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Either.
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// `yes` where the mask says so, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Lane k as bit k.
    fn bits(mask: Self::Mask) -> u32;
    /// Bit k as lane k; higher bits are ignored.
    fn mask(bits: u32) -> Self::Mask;

    /// With the sign flipped.
    #[inline(always)]
    fn neg(self) -> Self {
        Self::splat(0.0).sub(self)
    }

    /// Without the sign.
    #[inline(always)]
    fn abs(self) -> Self {
        self.max(self.neg())
    }

    /// Lane k is the least lane of `values[k]`, found as [`least`] does.
    #[inline(always)]
    fn least(values: [Self; WIDTH]) -> Self {
        let mut out = [0.0; WIDTH];
        for (value, out) in values.into_iter().zip(&mut out) {
            let mut numbers = [0.0; WIDTH];
            value.store(&mut numbers);
            *out = least(&numbers);
        }
        Self::load(&out)
    }

    /// With the sign flipped where the other's sign bit is set.
    fn flip(self, other: Self) -> Self;
}

/// The least of eight, compared in an order that all backends keep: neighbours, then pairs, then halves.
#[inline(always)]
fn least(v: &[f32; WIDTH]) -> f32 {
    let min = |a: f32, b: f32| if a < b { a } else { b };
    min(min(min(v[0], v[1]), min(v[2], v[3])), min(min(v[4], v[5]), min(v[6], v[7])))
}

/// An instruction set that lanes can be made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    /// Plain code, on every processor.
    Scalar,
    /// AVX2 of x86-64, with the instructions on bits that came with it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// NEON of AArch64, two registers of four.
    #[cfg(target_arch = "aarch64")]
    Neon,
}

impl Backend {
    /// The fastest that this processor has.
    #[must_use]
    pub fn best() -> Backend {
        static BEST: OnceLock<Backend> = OnceLock::new();
        *BEST.get_or_init(|| *Backend::available().last().unwrap_or(&Backend::Scalar))
    }

    /// All that this processor has, the fastest last.
    #[must_use]
    pub fn available() -> Vec<Backend> {
        let mut all = vec![Backend::Scalar];
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("lzcnt")
            && std::arch::is_x86_feature_detected!("popcnt")
        {
            all.push(Backend::Avx2);
        }
        #[cfg(target_arch = "aarch64")]
        if std::arch::is_aarch64_feature_detected!("neon") {
            all.push(Backend::Neon);
        }
        all
    }

    /// Its name, for reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Backend::Scalar => "scalar",
            #[cfg(target_arch = "x86_64")]
            Backend::Avx2 => "avx2",
            #[cfg(target_arch = "aarch64")]
            Backend::Neon => "neon",
        }
    }
}

/// Runs an `#[inline(always)]` function generic over [`Lanes`] on a backend.
///
/// `dispatch!(fn name(arg: Type, ...) -> Result = body)` makes `fn name(backend: Backend, arg: Type, ...) -> Result`, which
/// calls `body::<L>(arg, ...)` with the backend's lanes, compiled with its instructions. One generic argument is passed on:
/// `fn name<F: Trait>(...)` calls `body::<L, F>`.
macro_rules! dispatch {
    ($(#[$meta:meta])* $visibility:vis fn $name:ident $(<$kind:ident: $bound:path>)? (
        $($argument:ident: $type:ty),* $(,)?
    ) -> $result:ty = $body:ident) => {
        $(#[$meta])*
        #[allow(clippy::too_many_arguments)]
        $visibility fn $name$(<$kind: $bound>)?(backend: $crate::lanes::Backend, $($argument: $type),*) -> $result {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
            #[allow(clippy::too_many_arguments)]
            fn avx2$(<$kind: $bound>)?($($argument: $type),*) -> $result {
                $body::<$crate::lanes::Avx2 $(, $kind)?>($($argument),*)
            }
            #[cfg(target_arch = "aarch64")]
            #[target_feature(enable = "neon")]
            #[allow(clippy::too_many_arguments)]
            fn neon$(<$kind: $bound>)?($($argument: $type),*) -> $result {
                $body::<$crate::lanes::Neon $(, $kind)?>($($argument),*)
            }
            match backend {
                $crate::lanes::Backend::Scalar => $body::<$crate::lanes::Scalar $(, $kind)?>($($argument),*),
                // SAFETY: the processor has the instructions: such a `Backend` comes from `Backend::available`, which asked it.
                #[cfg(target_arch = "x86_64")]
                $crate::lanes::Backend::Avx2 => unsafe { avx2($($argument),*) },
                // SAFETY: as above.
                #[cfg(target_arch = "aarch64")]
                $crate::lanes::Backend::Neon => unsafe { neon($($argument),*) },
            }
        }
    };
}
pub(crate) use dispatch;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[inline(always)]
    fn everything<L: Lanes>(a: &[f32; WIDTH], b: &[f32; WIDTH]) -> Vec<u32> {
        let (x, y) = (L::load(a), L::load(b));
        let numbers = [
            x.add(y),
            x.sub(y),
            x.mul(y),
            x.div(y),
            x.abs().sqrt(),
            x.min(y),
            x.max(y),
            x.neg(),
            x.abs(),
            x.flip(y),
            L::least([x, y, x.neg(), y.neg(), x.sub(y), y.abs(), x.add(y), y]),
            L::select(x.lt(y), x, y),
            L::select(L::mask(0b1010_0110), x, y),
            L::splat(a[3]),
        ];
        let masks = [x.lt(y), x.le(y), L::and(x.lt(y), y.lt(L::splat(1.0))), L::or(x.lt(y), x.le(L::splat(0.0)))];
        let mut all: Vec<u32> = masks.iter().map(|&mask| L::bits(mask)).collect();
        for number in numbers {
            let mut out = [0.0; WIDTH];
            number.store(&mut out);
            // Which bits a NaN has is the one thing that IEEE 754 leaves open.
            all.extend(out.map(|value| if value.is_nan() { u32::MAX } else { value.to_bits() }));
        }
        all
    }
    dispatch!(fn run(a: &[f32; WIDTH], b: &[f32; WIDTH]) -> Vec<u32> = everything);

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![any::<f32>(), -2.0_f32..2.0, Just(0.0), Just(-0.0), Just(f32::INFINITY), Just(f32::NAN)]
    }

    proptest! {
        /// Catches an operation that one backend rounds, orders or compares differently.
        #[test]
        fn backends_agree_bit_for_bit(a in prop::array::uniform8(number()), b in prop::array::uniform8(number())) {
            let plain = run(Backend::Scalar, &a, &b);
            for backend in Backend::available() {
                prop_assert_eq!(&run(backend, &a, &b), &plain, "{}", backend.name());
            }
        }
    }
}
