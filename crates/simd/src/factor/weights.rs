//! The kernel of the form factor between pairs of points: sixteen rays and two normals go in, the weight of each ray's
//! visibility comes out.

use super::triple::{dot, load, splat, sub};
use crate::lanes::{Lanes, WIDTH, dispatch};

dispatch!(
    /// Weights of sixteen rays from points of a receiver (`origins`) to points of a source (`targets`), x, y, z of all.
    ///
    /// **Formula.** `w = max(0, n . r) max(0, -m . r) / (r . r)²`, which is `cos cos' / r²`, clipped.
    ///
    /// **Symbols.** `r`: from a ray's origin to its target, metres; `n`, `m`: unit normals of receiver and source; `w`: 1/m².
    ///
    /// **Source.** The kernel of the form factor between two differential surfaces, times pi: C. M. Goral, K. E. Torrance,
    /// D. P. Greenberg, B. Battaile, *Modeling the interaction of light between diffuse surfaces* (SIGGRAPH 1984).
    ///
    /// **Preconditions.** Normals of unit length, rays of 1e-9 to 1e18 metres; a ray without length has `w = 0`.
    ///
    /// **Error bound.** Against the exact value of the points as given: `4e-7 w + 2e-7 (cos + cos') / r²`, the second
    /// part that of heights near zero (test `weights_are_the_clipped_kernel`). The same bits on every backend (test
    /// `vectors_and_weights_are_alone`).
    pub fn kernel_weights(
        origins: &[[f32; 16]; 3],
        targets: &[[f32; 16]; 3],
        receiver_normal: [f32; 3],
        source_normal: [f32; 3],
    ) -> [f32; 16] = both
);

#[inline(always)]
fn both<L: Lanes>(
    origins: &[[f32; 16]; 3],
    targets: &[[f32; 16]; 3],
    receiver_normal: [f32; 3],
    source_normal: [f32; 3],
) -> [f32; 16] {
    let mut out = [0.0; 16];
    for (half, out) in out.as_chunks_mut::<WIDTH>().0.iter_mut().enumerate() {
        let ray = sub(load(&part(targets, half)), load::<L>(&part(origins, half)));
        weights(ray, splat(receiver_normal), splat(source_normal)).store(out);
    }
    out
}

#[inline(always)]
fn part(vectors: &[[f32; 16]; 3], half: usize) -> [[f32; WIDTH]; 3] {
    let mut out = [[0.0; WIDTH]; 3];
    for (from, to) in vectors.iter().zip(&mut out) {
        *to = from.as_chunks::<WIDTH>().0[half];
    }
    out
}

#[inline(always)]
fn weights<L: Lanes>(ray: [L; 3], receiver_normal: [L; 3], source_normal: [L; 3]) -> L {
    let zero = L::splat(0.0);
    let inverse = L::splat(1.0).div(dot(ray, ray));
    let rise = dot(ray, receiver_normal).max(zero).mul(inverse);
    let fall = dot(ray, source_normal).neg().max(zero).mul(inverse);
    let weight = rise.mul(fall);
    // Not a number: a ray without length.
    L::select(zero.lt(weight), weight, zero)
}
