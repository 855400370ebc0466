//! Functions of a direction as nine numbers, real spherical harmonics up to order two: what a group of surfaces sends, or
//! what arrives at it, goes in; its value in a direction, or the irradiance of a surface, comes out.
//!
//! A group of surfaces of area `A_k`, radiosity `B_k` and unit normal `n_k` sends the intensity
//! `I(w) = sum_k A_k B_k max(0, n_k . w) / pi` into direction `w`: its coefficients are the sum of
//! `A_k B_k / pi` times [`clamped_cosine`]`(n_k)`, and its value is their [`product`] with [`evaluate`]`(w)`. Light that
//! arrives from directions `w_j` with irradiance `E_j` on a surface that faces it has as coefficients the sum of
//! `E_j` times [`evaluate`]`(w_j)`; what a surface of normal `n` receives of it is their product with
//! [`clamped_cosine`]`(n)`, or for eight surfaces at once [`irradiance`].

use crate::lanes::{Lanes, WIDTH, dispatch};

/// Number of harmonics up to order two: 1 + 3 + 5.
pub const TERMS: usize = 9;

/// The nine harmonics in a direction.
///
/// **Formula.** With the direction `(x, y, z)`: `sqrt(1/(4 pi))`; `sqrt(3/(4 pi))` times `y`, `z`, `x`; `sqrt(15/(4 pi))`
/// times `x y`, `y z`, `(3 z² - 1)/sqrt(12)`, `x z`, `(x² - y²)/2`. They are orthonormal over the sphere.
///
/// **Source.** R. Ramamoorthi, P. Hanrahan, *An efficient representation for irradiance environment maps* (SIGGRAPH 2001),
/// equation 3.
///
/// **Preconditions.** A unit vector, without unit.
///
/// **Error bound.** 2e-7 against double precision (test `harmonics_are_orthonormal`).
#[must_use]
pub fn evaluate(direction: [f32; 3]) -> [f32; TERMS] {
    let [x, y, z] = direction;
    [
        Y0,
        Y1 * y,
        Y1 * z,
        Y1 * x,
        Y2 * x * y,
        Y2 * y * z,
        Y2_AXIAL * (3.0 * z * z - 1.0),
        Y2 * x * z,
        Y2_PLANAR * (x * x - y * y),
    ]
}

/// Coefficients of `max(0, n . w)`, a function of the direction `w`.
///
/// **Formula.** `A_l Y_lm(n)` with `A_0 = pi`, `A_1 = 2 pi/3`, `A_2 = pi/4`.
///
/// **Symbols.** `n`: unit normal; `Y_lm`: the harmonics of [`evaluate`], all without unit.
///
/// **Source.** Ramamoorthi and Hanrahan 2001, equation 8.
///
/// **Preconditions.** A unit vector.
///
/// **Error bound.** What orders above two leave out of `max(0, n . w)`: at most 3/32 (at right angles to the normal; at most
/// 1/16 along the normal and opposite to it), `sqrt(1/768) = 0.0361` in the root mean square over the sphere; the value is
/// never below -19/480 = -0.0396 (at `n . w = -8/15`). With the rounding: 2e-6 about these (test
/// `the_clamped_cosine_errs_as_stated`).
#[must_use]
pub fn clamped_cosine(normal: [f32; 3]) -> [f32; TERMS] {
    let mut all = evaluate(normal);
    for (value, factor) in all.iter_mut().zip(COSINE) {
        *value *= factor;
    }
    all
}

/// Integral over the sphere of the product of two functions given by their coefficients; with [`evaluate`] of a direction as
/// one of them, the value of the other in that direction.
#[must_use]
pub fn product(a: &[f32; TERMS], b: &[f32; TERMS]) -> f32 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += a * b;
    }
    sum
}

dispatch!(
    /// Irradiance of eight surfaces (unit `normals`: x of all, y of all, z of all) by arriving light of three colours, nine
    /// coefficients each, in their unit.
    ///
    /// **Formula.** `E(n) = sum_lm A_l Y_lm(n) L_lm`, the [`product`] with [`clamped_cosine`].
    ///
    /// **Symbols, source, preconditions.** As of [`clamped_cosine`]; `L_lm`: coefficients of the arriving light.
    ///
    /// **Error bound.** Light from a single direction is off by what [`clamped_cosine`] states, relative to the
    /// irradiance of a surface that faces it; the result may be as much below zero. Against [`product`] of [`clamped_cosine`]:
    /// 1e-6 of the sum of the magnitudes of the terms (test `lanes_receive_what_single_surfaces_receive`). The same bits
    /// on every backend.
    pub fn irradiance(normals: &[[f32; 8]; 3], light: &[[f32; 9]; 3]) -> [[f32; 8]; 3] = receive
);

dispatch!(
    /// [`irradiance`] of many eights of surfaces by the same light.
    ///
    /// # Panics
    /// If `out` is shorter than `normals`.
    pub fn irradiance_batch(normals: &[[[f32; 8]; 3]], light: &[[f32; 9]; 3], out: &mut [[[f32; 8]; 3]]) -> () = receive_all
);

#[inline(always)]
fn receive<L: Lanes>(normals: &[[f32; WIDTH]; 3], light: &[[f32; TERMS]; 3]) -> [[f32; WIDTH]; 3] {
    let [x, y, z] = [L::load(&normals[0]), L::load(&normals[1]), L::load(&normals[2])];
    let axial = L::splat(3.0).mul(z.mul(z)).sub(L::splat(1.0));
    let planar = x.mul(x).sub(y.mul(y));
    let shapes = [y, z, x, x.mul(y), y.mul(z), axial, x.mul(z), planar];
    let mut out = [[0.0; WIDTH]; 3];
    for (light, out) in light.iter().zip(&mut out) {
        let mut sum = L::splat(light[0] * (COSINE[0] * Y0));
        for k in 1..TERMS {
            sum = sum.add(shapes[k - 1].mul(L::splat(light[k] * (COSINE[k] * FACTORS[k]))));
        }
        sum.store(out);
    }
    out
}

#[inline(always)]
fn receive_all<L: Lanes>(normals: &[[[f32; WIDTH]; 3]], light: &[[f32; TERMS]; 3], out: &mut [[[f32; WIDTH]; 3]]) {
    for (normals, out) in normals.iter().zip(&mut out[..normals.len()]) {
        *out = receive::<L>(normals, light);
    }
}

/// `sqrt(1/(4 pi))`.
const Y0: f32 = 0.282_094_8;
/// `sqrt(3/(4 pi))`.
const Y1: f32 = 0.488_602_52;
/// `sqrt(15/(4 pi))`.
const Y2: f32 = 1.092_548_5;
/// `sqrt(5/(16 pi))`.
const Y2_AXIAL: f32 = 0.315_391_57;
/// `sqrt(15/(16 pi))`.
const Y2_PLANAR: f32 = 0.546_274_24;

/// What the polynomials in x, y and z are multiplied by.
const FACTORS: [f32; TERMS] = [Y0, Y1, Y1, Y1, Y2, Y2, Y2_AXIAL, Y2, Y2_PLANAR];

/// `A_l` of [`clamped_cosine`], by term.
const COSINE: [f32; TERMS] = {
    use std::f32::consts::{FRAC_PI_4, PI};
    let first = 2.0 * PI / 3.0;
    [PI, first, first, first, FRAC_PI_4, FRAC_PI_4, FRAC_PI_4, FRAC_PI_4, FRAC_PI_4]
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Backend;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    /// Directions and weights of a rule that is exact for polynomials of degree 5 in the direction: Gauss and Legendre's
    /// three heights, six turns each.
    fn rule() -> Vec<([f64; 3], f64)> {
        let mut all = Vec::new();
        for (z, weight) in [(-(0.6_f64.sqrt()), 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.6_f64.sqrt(), 5.0 / 9.0)] {
            for turn in 0..6 {
                let (radius, angle) = ((1.0 - z * z).sqrt(), f64::from(turn) * PI / 3.0 + 0.1);
                all.push(([radius * angle.cos(), radius * angle.sin(), z], weight * PI / 3.0));
            }
        }
        all
    }

    fn narrow(v: [f64; 3]) -> [f32; 3] {
        v.map(|x| x as f32)
    }

    /// Would catch a mistyped factor or polynomial: every pair of the nine, integrated exactly.
    #[test]
    fn harmonics_are_orthonormal() {
        for a in 0..TERMS {
            for b in 0..TERMS {
                let mut integral = 0.0;
                for (direction, weight) in rule() {
                    let values = evaluate(narrow(direction));
                    integral += f64::from(values[a]) * f64::from(values[b]) * weight;
                }
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((integral - expected).abs() < 1e-6, "{a} {b}: {integral}");
            }
        }
        let s = 0.5_f64.sqrt();
        for ([x, y, z], _) in
            rule().into_iter().chain([([s, s, 0.0], 0.0), ([0.0, -s, s], 0.0), ([0.0, 0.0, -1.0], 0.0)])
        {
            let (one, two) = ((0.75 / PI).sqrt(), (3.75 / PI).sqrt());
            let expected = [
                (0.25 / PI).sqrt(),
                one * y,
                one * z,
                one * x,
                two * x * y,
                two * y * z,
                two * (3.0 * z * z - 1.0) / 12.0_f64.sqrt(),
                two * x * z,
                two * (x * x - y * y) / 2.0,
            ];
            for (value, expected) in evaluate(narrow([x, y, z])).into_iter().zip(expected) {
                assert!((f64::from(value) - expected).abs() < 2e-7, "{value} {expected}");
            }
        }
    }

    /// Would catch a wrong factor of an order, and holds the documented errors, in a tilted frame: largest, along the
    /// normal, least value, root mean square.
    #[test]
    fn the_clamped_cosine_errs_as_stated() {
        let normal = [0.48, -0.6, 0.64];
        let side = [0.8, 0.0, -0.6];
        let coefficients = clamped_cosine(narrow(normal));
        let (mut largest, mut least, mut square) = (0.0_f64, 0.0_f64, 0.0);
        let steps = 20_000;
        // Evenly in the cosine, as the sphere's area is.
        for step in 0..=steps {
            let cosine = 2.0 * f64::from(step) / f64::from(steps) - 1.0;
            let sine = (1.0 - cosine * cosine).sqrt();
            let direction = std::array::from_fn(|k| (normal[k] * cosine + side[k] * sine) as f32);
            let value = f64::from(product(&coefficients, &evaluate(direction)));
            let error = (value - cosine.max(0.0)).abs();
            largest = largest.max(error);
            least = least.min(value);
            let end = step == 0 || step == steps;
            square += error * error / f64::from(steps) * if end { 0.5 } else { 1.0 };
            if end {
                assert!((error - 1.0 / 16.0).abs() < 2e-6, "{error}");
            }
        }
        assert!((largest - 3.0 / 32.0).abs() < 2e-6, "{largest}");
        assert!((least + 19.0 / 480.0).abs() < 2e-6, "{least}");
        assert!((square.sqrt() - (1.0_f64 / 768.0).sqrt()).abs() < 2e-6, "{}", square.sqrt());
    }

    /// Would catch a sign that depends on the side, or a mean that is not a quarter: the six faces of a cube.
    #[test]
    fn a_closed_group_sends_the_same_everywhere() {
        let mut intensity = [0.0; TERMS];
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut normal = [0.0; 3];
                normal[axis] = sign;
                for (sum, value) in intensity.iter_mut().zip(clamped_cosine(normal)) {
                    *sum += value;
                }
            }
        }
        // Orders one and two cancel; each face has a mean of a quarter.
        for (direction, _) in rule() {
            assert!((product(&intensity, &evaluate(narrow(direction))) - 1.5).abs() < 1e-6);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 500, rng_seed: proptest::test_runner::RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

        /// Catches a lane, a colour or a backend that differs.
        #[test]
        fn lanes_receive_what_single_surfaces_receive(
            normals in prop::array::uniform8(prop::array::uniform3(-1.0_f32..1.0)),
            light in prop::array::uniform3(prop::array::uniform9(-10.0_f32..10.0)),
        ) {
            let normals = normals.map(|v| {
                let length = v.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-3);
                v.map(|x| x / length)
            });
            let lanes = std::array::from_fn(|axis| normals.map(|v| v[axis]));
            let plain = irradiance(Backend::Scalar, &lanes, &light);
            for backend in Backend::available() {
                let mut batch = [[[0.0; 8]; 3]; 2];
                irradiance_batch(backend, &[lanes, lanes], &light, &mut batch);
                for same in [irradiance(backend, &lanes, &light), batch[0], batch[1]] {
                    prop_assert_eq!(same.map(|x| x.map(f32::to_bits)), plain.map(|x| x.map(f32::to_bits)));
                }
            }
            for (colour, light) in light.iter().enumerate() {
                for (lane, &normal) in normals.iter().enumerate() {
                    let response = clamped_cosine(normal);
                    let scale: f32 = response.iter().zip(light).map(|(a, b)| (a * b).abs()).sum();
                    let expected = product(&response, light);
                    prop_assert!((plain[colour][lane] - expected).abs() <= 1e-6 * scale);
                }
            }
        }
    }
}
