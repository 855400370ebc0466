//! The closed form from points to a polygon: eight differential receivers and a convex outline go in, their form factors
//! come out.

use super::triple::{add, cross, dot, load, magnitude, scale, select, splat, sub};
use super::{Points, Polygon};
use crate::lanes::{Lanes, dispatch};
use std::f32::consts::{FRAC_1_PI, PI};

dispatch!(
    /// Form factors from eight differential receivers (`points` and `normals`: x of all, y of all, z of all) to a one-sided
    /// polygon, unoccluded.
    ///
    /// **Formula.** `F = 1/(2 pi) sum_i gamma_i (R_(i+1) x R_i)/|R_(i+1) x R_i| . n`, the sum over the edges of the part of
    /// the source above the receiver's horizon; the edge along the horizon adds just its angle.
    ///
    /// **Symbols.** `R_i = v_i - p`: from the receiver at `p` to corner `v_i`, metres; `n`: unit normal of the receiver;
    /// `gamma_i`: angle between `R_i` and `R_(i+1)`, radians; `F`: share of what leaves the receiver that reaches the
    /// source, 0 to 1; as much is the receiver's irradiance for a source of radiosity 1.
    ///
    /// **Source.** J. H. Lambert, *Photometria* (1760); in this form D. R. Baum, H. E. Rushmeier, J. M. Winget, *Improving
    /// radiosity solutions through the use of analytically determined form-factors* (SIGGRAPH 1989).
    ///
    /// **Preconditions.** Normals of unit length; the source planar and convex. A receiver behind the source's plane has
    /// `F = 0`, as has one on it, as far as rounding can tell, that does not touch the source. One on the plane that
    /// touches the source, as the corner of a patch that shares an edge with it, has the factor that a point of the same
    /// receiver has just in front; if the receiver lies in the source's plane as a whole, that is 0.
    ///
    /// **How it is evaluated.** Every lane takes the same steps: an edge's end below the horizon is replaced by where the
    /// outline enters or exits, of which a convex outline has one each. Steps that none of the eight lanes needs are left
    /// out, which changes no result. `R_i x R_(i+1) = R_i x e_i` with the edge `e_i` keeps rounding in proportion to
    /// the edge. What is left of the cancellation between edges is a relative error of about `r/s` units of rounding
    /// for a source of size `s` at distance `r`; beyond `r/s = 16` three-point rules on the triangles of a fan take over
    /// where the source is whole.
    ///
    /// **Error bound.** Absolute, for sources at 0.01 to 0.1, 1, 8, 64 sizes and beyond: 1e-4, 6e-6, 2e-7, 2e-8, 1e-9
    /// (test `the_closed_form_is_met_at_all_distances`; slivers, 1e-5 for the second: `slivers_keep_the_absolute_bounds`);
    /// relative 1e-4 from one size on with both normals within 60 degrees (test `far_sources_keep_relative_accuracy`). Next
    /// to an edge that patches share, absolute 2e-3 (test `a_receiver_near_a_shared_edge_is_met_at_every_gap`); on it or its
    /// end, 4e-3 (test `a_receiver_on_the_sources_edge_sees_what_its_neighbour_inside_sees`). A lane's result has the same
    /// bits on every backend and with any neighbours (test `lanes_are_shares_and_alone`).
    pub fn point_factors(points: &[[f32; 8]; 3], normals: &[[f32; 8]; 3], source: &Polygon) -> [f32; 8] = one
);

dispatch!(
    /// [`point_factors`] of the first `n` pairs of eight receivers and a polygon, `out[k]` from `points[k]` and `sources[k]`.
    ///
    /// With five receivers a pair (corners and middle of a patch) in eight lanes a pair takes some 26 ns far away, 40 ns close
    /// by, 45 ns across the horizon (bench `factors`, AVX2). Eight pairs in the eight lanes, receiver by receiver, were tried
    /// with 0.69, 0.73 and 0.97 of that, but 1.16 where the three are mixed, as then every eight takes all ways.
    ///
    /// # Panics
    /// If one of the slices is shorter than `n`.
    pub fn point_factors_batch(n: usize, points: &[Points], sources: &[Polygon], out: &mut [[f32; 8]]) -> () = batch
);

#[inline(always)]
fn one<L: Lanes>(points: &[[f32; 8]; 3], normals: &[[f32; 8]; 3], source: &Polygon) -> [f32; 8] {
    let corners =
        [splat(source.corners[0]), splat(source.corners[1]), splat(source.corners[2]), splat(source.corners[3])];
    let normal = splat(source.normal);
    let (point, receiver_normal) = (load::<L>(points), load::<L>(normals));
    let factors = if source.count == 3 {
        factors::<L, 3>(point, receiver_normal, &[corners[0], corners[1], corners[2]], normal)
    } else {
        factors::<L, 4>(point, receiver_normal, &corners, normal)
    };
    let mut out = [0.0; 8];
    factors.store(&mut out);
    out
}

#[inline(always)]
fn batch<L: Lanes>(n: usize, points: &[Points], sources: &[Polygon], out: &mut [[f32; 8]]) {
    for ((receivers, source), out) in points[..n].iter().zip(&sources[..n]).zip(&mut out[..n]) {
        *out = one::<L>(&receivers.points, &receivers.normals, source);
    }
}

/// Tolerance of heights above a plane, in magnitudes of what they are computed from.
///
/// Subtracting two points, one scalar product, and the rounding of its three inputs err by at most 6 units of rounding (each
/// half of `EPSILON`) of the magnitudes `sum |n_k| (|p_k| + |v_k|)`; 8 are taken. `|v_k|` is bounded by
/// `|p_k|` and the distance to the farthest corner.
pub(super) const TOLERANCE: f32 = 4.0 * f32::EPSILON;

/// Where a receiver that touches the source is put, in tolerances of its distance from the source's plane.
///
/// Closer, the rounding of the receiver turns the direction to the edge; farther, the move itself shows. Measured as the
/// worst error of test `a_receiver_on_the_sources_edge_sees_what_its_neighbour_inside_sees`: 7.3e-3 at 4, 2.0e-3 at 16,
/// 2.5e-3 at 64.
pub(super) const OFF_PLANE: f32 = 16.0;

/// Least square of the sine between the planes (some 11 degrees) for which a receiver is moved all the way off the source's
/// plane: a flatter one would have to be moved along its own plane farther than five times its new distance.
const LEAST_TURN: f32 = 0.04;

/// Distance in sizes (longest edges) of the source beyond which the three-point rules replace the closed form.
///
/// Measured as the worst relative error of test `far_sources_keep_relative_accuracy`, closed form / three-point rules: at 10
/// to 16 sizes 5.8e-5 / 1.4e-4, at 16 to 32 sizes 1.1e-4 / 1.5e-5.
pub(super) const FAR: f32 = 16.0;

/// Form factors of eight lanes.
#[inline(always)]
fn factors<L: Lanes, const N: usize>(p: [L; 3], n: [L; 3], corners: &[[L; 3]; N], normal: [L; 3]) -> L {
    let zero = L::splat(0.0);
    let mut rays = [[zero; 3]; N];
    let mut squares = [zero; N];
    let mut heights = [zero; N];
    let mut reach = zero;
    for i in 0..N {
        rays[i] = sub(corners[i], p);
        squares[i] = dot(rays[i], rays[i]);
        heights[i] = dot(rays[i], n);
        reach = squares[i].max(reach);
    }
    reach = reach.sqrt();
    let two = L::splat(2.0);
    let level = L::splat(TOLERANCE).mul(two.mul(magnitude(n, p)).add(reach));
    let mut above = [L::mask(0); N];
    let (mut any_above, mut all_above) = (L::mask(0), L::mask(u32::MAX));
    for i in 0..N {
        above[i] = level.lt(heights[i]);
        any_above = L::or(any_above, above[i]);
        all_above = L::and(all_above, above[i]);
    }
    let thickness = L::splat(TOLERANCE).mul(two.mul(magnitude(normal, p)).add(reach));
    let mut distance = dot(normal, rays[0]).neg();
    let mut seen = L::and(thickness.lt(distance), any_above);
    let on_plane = L::and(distance.abs().le(thickness), any_above);

    let mut edges = [[zero; 3]; N];
    let mut edge_squares = [zero; N];
    let mut size_square = zero;
    for i in 0..N {
        edges[i] = sub(corners[(i + 1) % N], corners[i]);
        edge_squares[i] = dot(edges[i], edges[i]);
        size_square = edge_squares[i].max(size_square);
    }

    if L::bits(on_plane) != 0 {
        // A receiver on the source's plane moves within its own plane to a small distance in front, if it touches.
        let clearance = L::splat(OFF_PLANE).mul(thickness);
        let cosine = dot(n, normal);
        let turn = L::splat(1.0).sub(cosine.mul(cosine)).max(L::splat(LEAST_TURN));
        let step = scale(sub(normal, scale(n, cosine)), clearance.sub(distance).div(turn));
        let touches = L::and(on_plane, touching::<L, N>(clearance, normal, &rays, &edges, &edge_squares));
        for i in 0..N {
            rays[i] = select::<L>(touches, sub(rays[i], step), rays[i]);
            squares[i] = dot(rays[i], rays[i]);
        }
        distance = L::select(touches, dot(normal, rays[0]).neg(), distance);
        seen = L::or(seen, L::and(touches, zero.lt(distance)));
    }
    let seen_bits = L::bits(seen);
    if seen_bits == 0 {
        return zero;
    }

    let far = L::and(all_above, L::splat(FAR * FAR).mul(size_square).lt(squares[0]));
    let far_bits = L::bits(far) & seen_bits;
    let mut factor = zero;
    if far_bits != 0 {
        let weights = cubature::<L, N>(&squares, distance, corners, normal, &edges, &edge_squares);
        for i in 0..N {
            factor = factor.add(weights[i].mul(heights[i]));
        }
    }
    if far_bits != seen_bits {
        let contour = if seen_bits & !L::bits(all_above) == 0 {
            contour::<L, N, false>(&rays, &squares, &heights, &above, level, n, corners, &edges)
        } else {
            contour::<L, N, true>(&rays, &squares, &heights, &above, level, n, corners, &edges)
        };
        factor = L::select(far, factor, contour);
    }
    // Not a number (a source without extent) counts as nothing.
    L::select(L::and(seen, zero.lt(factor)), factor.min(L::splat(1.0)), zero)
}

/// Where a receiver on the source's plane is within `clearance` of the source, metres: on the inner side of every edge.
#[inline(always)]
pub(super) fn touching<L: Lanes, const N: usize>(
    clearance: L,
    normal: [L; 3],
    rays: &[[L; 3]; N],
    edges: &[[L; 3]; N],
    edge_squares: &[L; N],
) -> L::Mask {
    let mut touches = L::mask(u32::MAX);
    for i in 0..N {
        let inside = dot(normal, cross(rays[i], edges[i]));
        touches = L::and(touches, clearance.mul(edge_squares[i].sqrt()).neg().le(inside));
    }
    touches
}

/// Weights `k_i`, 1/m², of the rays to the corners with which `F = n . sum k_i R_i`, far from the source.
///
/// Three points at the middle of the edges of each triangle of a fan (exact for quadratics; Strang and Fix 1973, page 184),
/// each with the kernel `cos cos' / (pi r²)`. The ray to a middle is the mean of its ends', its square the mean of theirs
/// less a quarter of the edge's, and all have the receiver's own `distance` from the source's plane.
#[inline(always)]
pub(super) fn cubature<L: Lanes, const N: usize>(
    squares: &[L; N],
    distance: L,
    corners: &[[L; 3]; N],
    normal: [L; 3],
    edges: &[[L; 3]; N],
    edge_squares: &[L; N],
) -> [L; N] {
    let zero = L::splat(0.0);
    // A third of an area for each point, half of the area's double, half of a ray for each end.
    let common = distance.mul(L::splat(FRAC_1_PI / 12.0));
    let mut weights = [zero; N];
    let mut before = zero;
    for i in 1..N {
        // The triangle of corners 0, i, i + 1, and with it the middles of edge i and of the chord from 0 to i.
        let chord = sub(corners[i], corners[0]);
        let after = if i + 1 < N { dot(cross(chord, edges[i]), normal).mul(common) } else { zero };
        let chord_square = match i {
            1 => edge_squares[0],
            _ if i + 1 == N => edge_squares[N - 1],
            _ => dot(chord, chord),
        };
        let inner = middle(squares[0], squares[i], chord_square, before.add(after));
        weights[0] = weights[0].add(inner);
        weights[i] = weights[i].add(inner);
        if i + 1 < N {
            let outer = middle(squares[i], squares[i + 1], edge_squares[i], after);
            weights[i] = weights[i].add(outer);
            weights[i + 1] = weights[i + 1].add(outer);
        }
        before = after;
    }
    weights
}

/// `area / r⁴` at the middle of an edge.
#[inline(always)]
fn middle<L: Lanes>(first_square: L, second_square: L, edge_square: L, area: L) -> L {
    let square = L::splat(0.5).mul(first_square.add(second_square)).sub(L::splat(0.25).mul(edge_square));
    area.div(square.mul(square))
}

/// The contour integral, `CLIP`ped at the horizon.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn contour<L: Lanes, const N: usize, const CLIP: bool>(
    rays: &[[L; 3]; N],
    squares: &[L; N],
    heights: &[L; N],
    above: &[L::Mask; N],
    level: L,
    n: [L; 3],
    corners: &[[L; 3]; N],
    edges: &[[L; 3]; N],
) -> L {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let mut inverses = [zero; N];
    for i in 0..N {
        inverses[i] = one.div(squares[i].sqrt());
    }
    let mut fractions = [one; N];
    let (mut exit, mut entry) = ([zero; 3], [zero; 3]);
    let (mut exit_local, mut entry_local) = ([zero; 3], [zero; 3]);
    let (mut exit_inverse, mut entry_inverse) = (zero, zero);
    let mut crossed = L::mask(0);
    if CLIP {
        let mut snapped = [zero; N];
        let mut below = [L::mask(0); N];
        let mut locals = [[zero; 3]; N];
        for i in 0..N {
            snapped[i] = L::select(heights[i].abs().le(level), zero, heights[i]).abs();
            below[i] = heights[i].le(level);
            locals[i] = sub(corners[i], corners[0]);
        }
        for i in 0..N {
            let j = (i + 1) % N;
            let out = L::and(above[i], below[j]);
            let inward = L::and(below[i], above[j]);
            // From the end that is nearer to the horizon, so that an end on it is met exactly.
            let from_first = snapped[i].lt(snapped[j]);
            let share = snapped[i].min(snapped[j]).div(snapped[i].add(snapped[j]));
            let step = scale(edges[i], share);
            let point = select::<L>(from_first, add(rays[i], step), sub(rays[j], step));
            let local = select::<L>(from_first, add(locals[i], step), sub(locals[j], step));
            let rest = one.sub(share);
            let first = L::select(from_first, share, rest);
            let second = L::select(from_first, rest, share);
            fractions[i] = L::select(out, first, L::select(inward, second, one));
            exit = select::<L>(out, point, exit);
            exit_local = select::<L>(out, local, exit_local);
            entry = select::<L>(inward, point, entry);
            entry_local = select::<L>(inward, local, entry_local);
            crossed = L::or(crossed, out);
        }
        exit_inverse = one.div(dot(exit, exit).sqrt());
        entry_inverse = one.div(dot(entry, entry).sqrt());
    }
    let mut vector = [zero; 3];
    for i in 0..N {
        let j = (i + 1) % N;
        let (mut a, mut b, mut inverse) = (rays[i], rays[j], inverses[i].mul(inverses[j]));
        if CLIP {
            a = select::<L>(above[i], a, entry);
            b = select::<L>(above[j], b, exit);
            inverse =
                L::select(above[i], inverses[i], entry_inverse).mul(L::select(above[j], inverses[j], exit_inverse));
        }
        let cosine = dot(a, b).mul(inverse);
        let product = cross(rays[i], edges[i]);
        if CLIP {
            inverse = inverse.mul(fractions[i]);
        }
        let mut weight = edge_weight(cosine, inverse, product);
        if CLIP {
            weight = L::select(L::or(above[i], above[j]), weight, zero);
        }
        vector = add(vector, scale(product, weight));
    }
    let mut sum = dot(vector, n).neg();
    if CLIP {
        let inverse = exit_inverse.mul(entry_inverse);
        let cosine = dot(exit, entry).mul(inverse);
        let sine = dot(cross(exit, sub(entry_local, exit_local)), n).abs().mul(inverse);
        let acute = angle_over_sine(cosine.abs()).mul(sine);
        let angle = L::select(cosine.lt(zero), L::splat(PI).sub(acute), acute);
        sum = sum.add(L::select(crossed, angle, zero));
    }
    sum.mul(L::splat(0.5 * FRAC_1_PI))
}

/// `gamma / |a x b|` of an edge from a to b, with the cosine of the angle between them, `1 / (|a| |b|)`, and `product`
/// along `a x b`. Of a clipped edge with the product of the whole edge: times the fraction that is left, which is in
/// `inverse` already.
#[inline(always)]
pub(super) fn edge_weight<L: Lanes>(cosine: L, inverse: L, product: [L; 3]) -> L {
    let acute = angle_over_sine(cosine.abs()).mul(inverse);
    let obtuse = cosine.lt(L::splat(0.0));
    if L::bits(obtuse) == 0 {
        return acute;
    }
    // gamma/sin gamma = pi/sin gamma - (pi - gamma)/sin gamma, the first sine from the product itself, which stays accurate
    // as the receiver nears the edge.
    L::select(obtuse, L::splat(PI).div(dot(product, product).sqrt()).sub(acute), acute)
}

/// `gamma / sin gamma` as a function of `cos gamma`, for angles up to a right angle.
///
/// **Formula.** `gamma / sin gamma = acos(c) / sqrt(1 - c²)`, `c = cos gamma`, as a polynomial of degree 8 in `1 - c` that is
/// exactly 1 at `c = 1`; the nearest singularity is at `c = -1`.
///
/// **Source.** Interpolation of `(gamma / sin gamma - 1) / (1 - c)` at the eight Chebyshev nodes of `1 - c` in [0, 1], solved
/// with 40 digits and rounded.
///
/// **Error bound.** Relative 6e-7, rounding included (test `angle_over_sine_meets_its_bound`). Degree 7 would leave 1.4e-6
/// without rounding, this one 2.4e-7, degree 9 4.4e-8.
#[inline(always)]
fn angle_over_sine<L: Lanes>(cosine: L) -> L {
    let y = L::splat(1.0).sub(cosine);
    let (y2, c) = (y.mul(y), &ANGLE_OVER_SINE);
    let y4 = y2.mul(y2);
    let pair = |low: f32, high: f32| L::splat(low).add(L::splat(high).mul(y));
    let low = pair(c[0], c[1]).add(pair(c[2], c[3]).mul(y2));
    let high = pair(c[4], c[5]).add(pair(c[6], c[7]).mul(y2));
    low.add(high.add(L::splat(c[8]).mul(y4)).mul(y4))
}

/// Coefficients of `gamma / sin gamma` in powers of `1 - cos gamma`.
const ANGLE_OVER_SINE: [f32; 9] = [
    1.0,
    0.333_333_13,
    0.133_357_08,
    0.056_653_757,
    0.029_165_696,
    -0.002_373_610_4,
    0.032_192_625,
    -0.024_256_019,
    0.012_723_292,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Backend;

    #[inline(always)]
    fn evaluate<L: Lanes>(cosines: &[f32; 8]) -> [f32; 8] {
        let mut out = [0.0; 8];
        angle_over_sine(L::load(cosines)).store(&mut out);
        out
    }
    dispatch!(fn run(cosines: &[f32; 8]) -> [f32; 8] = evaluate);

    /// Would catch a mistyped coefficient: `gamma / sin gamma` in double precision over the whole range, and 1 at 1.
    #[test]
    fn angle_over_sine_meets_its_bound() {
        assert_eq!(run(Backend::best(), &[1.0; 8]), [1.0; 8]);
        for step in 0..5000_u16 {
            let cosine = f32::from(step) / 5000.0;
            let c = f64::from(cosine);
            let error = f64::from(run(Backend::best(), &[cosine; 8])[0]) / (c.acos() / (1.0 - c * c).sqrt()) - 1.0;
            assert!(error.abs() < 6e-7, "{cosine}: {error:e}");
        }
    }
}
