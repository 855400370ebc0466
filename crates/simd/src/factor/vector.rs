//! The closed form without a receiver's normal: eight points and a convex outline go in, the vectors that hold the form
//! factor for every normal come out; the horizon is left to the caller.

use super::Polygon;
use super::lambert::{FAR, OFF_PLANE, TOLERANCE, cubature, edge_weight, touching};
use super::triple::{add, cross, dot, load, magnitude, scale, select, splat, sub};
use crate::lanes::{Lanes, dispatch};
use std::f32::consts::FRAC_1_PI;

dispatch!(
    /// Irradiance vectors at eight points (x of all, y of all, z of all) of a one-sided polygon of radiosity 1, unoccluded.
    ///
    /// **Formula.** `G = 1/(2 pi) sum_i gamma_i (R_(i+1) x R_i)/|R_(i+1) x R_i|`, the sum over the edges.
    ///
    /// **Symbols.** `R_i = v_i - p`: from the point at `p` to corner `v_i`, metres; `gamma_i`: angle between `R_i` and
    /// `R_(i+1)`, radians; `G`: a vector towards the source, without unit: the net share through a surface of unit normal
    /// `n` is `n . G`, which is the form factor where the whole source is above the surface's horizon.
    ///
    /// **Source.** J. H. Lambert, *Photometria* (1760); as a vector: A. Gershun, *The light field* (Journal of Mathematics
    /// and Physics 18, 1939).
    ///
    /// **Preconditions.** The source planar and convex, its normal of unit length. A point behind the source's plane has
    /// `G = 0`, as has one on it, as far as rounding can tell, that does not touch the source; one that touches it has
    /// the vector just in front.
    ///
    /// **Error bound.** Where the whole source is above the horizon, `n . G` is the form factor to 1e-4, 2e-5, 2e-7, 2e-8,
    /// 1e-9 for sources at 0.01 to 0.1, 1, 8, 64 sizes and beyond (test `the_vector_holds_the_factor_of_every_normal`). The
    /// same bits on every backend and with any neighbours (test `vectors_and_weights_are_alone`).
    pub fn vector_factor(points: &[[f32; 8]; 3], source: &Polygon) -> [[f32; 8]; 3] = one
);

#[inline(always)]
fn one<L: Lanes>(points: &[[f32; 8]; 3], source: &Polygon) -> [[f32; 8]; 3] {
    let corners =
        [splat(source.corners[0]), splat(source.corners[1]), splat(source.corners[2]), splat(source.corners[3])];
    let (point, normal) = (load::<L>(points), splat(source.normal));
    let vectors = if source.count == 3 {
        vectors::<L, 3>(point, &[corners[0], corners[1], corners[2]], normal)
    } else {
        vectors::<L, 4>(point, &corners, normal)
    };
    let mut out = [[0.0; 8]; 3];
    for (vector, out) in vectors.into_iter().zip(&mut out) {
        vector.store(out);
    }
    out
}

#[inline(always)]
fn vectors<L: Lanes, const N: usize>(p: [L; 3], corners: &[[L; 3]; N], normal: [L; 3]) -> [L; 3] {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let mut rays = [[zero; 3]; N];
    let mut squares = [zero; N];
    let mut edges = [[zero; 3]; N];
    let mut edge_squares = [zero; N];
    let (mut reach, mut size_square) = (zero, zero);
    for i in 0..N {
        rays[i] = sub(corners[i], p);
        squares[i] = dot(rays[i], rays[i]);
        reach = squares[i].max(reach);
        edges[i] = sub(corners[(i + 1) % N], corners[i]);
        edge_squares[i] = dot(edges[i], edges[i]);
        size_square = edge_squares[i].max(size_square);
    }
    let thickness = L::splat(TOLERANCE).mul(L::splat(2.0).mul(magnitude(normal, p)).add(reach.sqrt()));
    let mut distance = dot(normal, rays[0]).neg();
    let mut seen = thickness.lt(distance);
    let on_plane = distance.abs().le(thickness);
    if L::bits(on_plane) != 0 {
        let clearance = L::splat(OFF_PLANE).mul(thickness);
        let step = scale(normal, clearance.sub(distance));
        let touches = L::and(on_plane, touching::<L, N>(clearance, normal, &rays, &edges, &edge_squares));
        for i in 0..N {
            rays[i] = select::<L>(touches, sub(rays[i], step), rays[i]);
            squares[i] = dot(rays[i], rays[i]);
        }
        distance = L::select(touches, dot(normal, rays[0]).neg(), distance);
        seen = L::or(seen, touches);
    }
    let seen_bits = L::bits(seen);
    if seen_bits == 0 {
        return [zero; 3];
    }
    let far = L::splat(FAR * FAR).mul(size_square).lt(squares[0]);
    let far_bits = L::bits(far) & seen_bits;
    let mut vector = [zero; 3];
    if far_bits != 0 {
        let weights = cubature::<L, N>(&squares, distance, corners, normal, &edges, &edge_squares);
        for i in 0..N {
            vector = add(vector, scale(rays[i], weights[i]));
        }
    }
    if far_bits != seen_bits {
        let mut inverses = [zero; N];
        for i in 0..N {
            inverses[i] = one.div(squares[i].sqrt());
        }
        let mut sum = [zero; 3];
        for i in 0..N {
            let j = (i + 1) % N;
            let inverse = inverses[i].mul(inverses[j]);
            let product = cross(rays[i], edges[i]);
            let weight = edge_weight(dot(rays[i], rays[j]).mul(inverse), inverse, product);
            sum = add(sum, scale(product, weight));
        }
        vector = select::<L>(far, vector, scale(sum, L::splat(-0.5 * FRAC_1_PI)));
    }
    // Not a number (a source without extent) counts as nothing.
    let valid = L::and(seen, dot(vector, vector).lt(L::splat(f32::INFINITY)));
    select::<L>(valid, vector, [zero; 3])
}
