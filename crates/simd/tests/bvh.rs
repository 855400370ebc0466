//! The hierarchy against every primitive one by one in double precision, on all backends.

use isolux_simd::bvh::{Bvh8, Filter, Hit, NoFilter, Primitive, Rays, SKIN, check};
use isolux_simd::lanes::Backend;
use proptest::prelude::*;

type Point = [f32; 3];

fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn triangle(a: Point, b: Point, c: Point) -> Primitive {
    Primitive { origin: a, u: sub(b, a), v: sub(c, a), parallelogram: false, opaque: true }
}

fn parallelogram(a: Point, b: Point, c: Point) -> Primitive {
    Primitive { parallelogram: true, ..triangle(a, b, c) }
}

/// What double precision says of a ray and a primitive: t, u and v where it surely crosses, nothing where it surely does
/// not; `Err` within a few skins of the outline or the plane, where the rule leaves it open.
fn cross(rays: &Rays<16>, k: usize, primitive: &Primitive, scale: f32) -> Result<Option<[f64; 3]>, ()> {
    let double = |v: Point| v.map(f64::from);
    let (o, d): (Point, Point) =
        (std::array::from_fn(|axis| rays.origin[axis][k]), std::array::from_fn(|axis| rays.direction[axis][k]));
    let (o, d) = (double(o), double(d));
    let (p, u, v) = (double(primitive.origin), double(primitive.u), double(primitive.v));
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length = |a: [f64; 3]| dot(a, a).sqrt();
    let s = std::array::from_fn(|axis| p[axis] - o[axis]);
    let (n, c) = (cross(u, v), cross(s, d));
    let det = dot(n, d);
    let sign = if det < 0.0 { -1.0 } else { 1.0 };
    let (near, far) = (f64::from(rays.near[k]), f64::from(rays.far[k]).min(1e18));
    let (mut t, mut hit_u, mut hit_v) = (sign * dot(n, s), sign * dot(v, c), -sign * dot(u, c));
    let det = det.abs();

    let size = o.iter().fold(f64::from(scale), |size, x| size.max(x.abs()));
    let skin = f64::from(SKIN) * size;
    let sides = (t - near * det).min(far * det - t) / length(n);
    let total = if primitive.parallelogram { hit_u.max(hit_v) } else { hit_u + hit_v };
    let reach = (length(u) + length(v)) * (d[0].abs() + d[1].abs() + d[2].abs());
    let inside = hit_u.min(hit_v).min(det - total) / reach;
    // Surely not: too close to the plane, or beyond the outline by more than the reach, with half a skin for rounding.
    if sides < 0.5 * skin || inside < -1.5 * skin {
        return Ok(None);
    }
    if sides < 1.5 * skin || inside < -0.5 * skin {
        return Err(());
    }
    for x in [&mut t, &mut hit_u, &mut hit_v] {
        *x /= det;
    }
    Ok(Some([t, hit_u, hit_v]))
}

fn scale(primitives: &[Primitive]) -> f32 {
    let (lo, hi) = Bvh8::build(primitives).bounds();
    lo.iter().chain(&hi).fold(0.0, |scale, x| x.abs().max(scale))
}

/// Whether a primitive takes part: what is left out must not be asked about.
fn surface(primitive: &Primitive) -> bool {
    check(&Bvh8::build(&[*primitive]), &[*primitive]).unwrap();
    Bvh8::build(&[*primitive]).memory() > 4
}

/// All queries of one packet, each backend against double precision and against the others.
fn compare(primitives: &[Primitive], rays: &Rays<16>, active: u32) {
    let bvh = Bvh8::build(primitives);
    check(&bvh, primitives).unwrap();
    let scale = scale(primitives);
    let surfaces: Vec<bool> = primitives.iter().map(surface).collect();
    let mut answers = Vec::new();
    for backend in Backend::available() {
        let mut last = u32::MAX;
        let blocked = bvh.blocked(backend, rays, active, &mut last);
        assert_eq!(blocked & !active, 0);
        assert_eq!(last == u32::MAX, blocked == 0);
        // No answer depends on what was remembered.
        for mut other in [last, 0, primitives.len() as u32 / 2, 12345] {
            assert_eq!(bvh.blocked(backend, rays, active, &mut other), blocked);
        }
        let mut shares = [1.0; 16];
        shares.copy_from_slice(&bvh.transmittance(backend, rays, active, &mut last, &Half));
        let hits = bvh.closest16(backend, rays, active);
        for k in 0..16 {
            let crossings: Vec<_> = (0..primitives.len())
                .filter(|&id| surfaces[id])
                .map(|id| (id, cross(rays, k, &primitives[id], scale)))
                .collect();
            let is_active = active >> k & 1 != 0 && rays.near[k] < rays.far[k];
            let sure = |opaque: bool| {
                crossings
                    .iter()
                    .filter(move |(id, c)| primitives[*id].opaque == opaque && matches!(c, Ok(Some(_))))
                    .count()
            };
            let open = |opaque: bool| crossings.iter().any(|(id, c)| primitives[*id].opaque == opaque && c.is_err());
            let bit = blocked >> k & 1 != 0;
            if !is_active {
                assert!(!bit && hits[k] == Hit::NONE && shares[k] == 1.0, "ray {k} is not active");
                continue;
            }
            if sure(true) > 0 {
                assert!(bit, "ray {k} of {rays:?} is blocked");
            } else if !open(true) {
                assert!(!bit, "ray {k} of {rays:?} is free");
            }
            if !open(true) && !open(false) {
                let expected = if sure(true) > 0 { 0.0 } else { 0.5_f32.powi(sure(false) as i32) };
                assert_eq!(shares[k], expected, "ray {k}");
            }
            // The first hit is a crossing that is sure or open, and no sure one is before it.
            let first =
                crossings.iter().filter_map(|(_, c)| c.ok().flatten()).map(|hit| hit[0]).fold(f64::INFINITY, f64::min);
            let hit = hits[k];
            if hit == Hit::NONE {
                assert_eq!(first, f64::INFINITY, "ray {k} hits");
            } else {
                let found = crossings.iter().find(|(id, _)| *id == hit.primitive as usize).unwrap().1;
                assert_ne!(found, Ok(None), "ray {k} misses {hit:?}");
                assert!(f64::from(hit.t) <= first * (1.0 + 1e-3) + 1e-4, "ray {k}: {hit:?} after {first}");
            }
            let alone = bvh.closest(
                backend,
                std::array::from_fn(|axis| rays.origin[axis][k]),
                std::array::from_fn(|axis| rays.direction[axis][k]),
                rays.near[k],
                rays.far[k],
            );
            assert_eq!(alone.unwrap_or(Hit::NONE), hit);
        }
        let bits = |hit: &Hit| [hit.t.to_bits(), hit.primitive, hit.u.to_bits(), hit.v.to_bits()];
        answers.push((blocked, last, shares.map(f32::to_bits), hits.iter().map(bits).collect::<Vec<_>>()));
    }
    for answer in &answers {
        assert_eq!(answer, &answers[0], "backends differ");
    }
}

struct Half;
impl Filter for Half {
    fn passes(&self, _: u32, _: f32, _: f32) -> f32 {
        0.5
    }
}

fn point(size: f32) -> impl Strategy<Value = Point> {
    prop::array::uniform3(-size..size)
}

/// On a grid of quarters: coplanar, edge to edge, doubled and degenerate primitives, rays along axes and through corners.
fn grid_point() -> impl Strategy<Value = Point> {
    prop::array::uniform3((-4_i32..=4).prop_map(|x| x as f32 * 0.25))
}

fn primitive(
    points: impl Strategy<Value = Point>,
    edges: impl Strategy<Value = [Point; 2]>,
) -> impl Strategy<Value = Primitive> {
    (points, edges, any::<bool>(), prop::bool::weighted(0.8))
        .prop_map(|(origin, [u, v], parallelogram, opaque)| Primitive { origin, u, v, parallelogram, opaque })
}

fn scene() -> impl Strategy<Value = Vec<Primitive>> {
    let pair = |size: f32| (point(size), point(size)).prop_map(|(u, v)| [u, v]);
    let sliver = (point(1.0), point(1.0), -1e-3_f32..1e-3)
        .prop_map(|(u, w, thin)| [u, std::array::from_fn(|axis| u[axis] * 0.9 + thin * w[axis])]);
    prop_oneof![
        prop::collection::vec(primitive(point(1.0), pair(1.0)), 0..12),
        prop::collection::vec(primitive(point(1.0), pair(0.2)), 0..200),
        prop::collection::vec(primitive(point(1.0), sliver), 0..60),
        prop::collection::vec(primitive(grid_point(), (grid_point(), grid_point()).prop_map(|(u, v)| [u, v])), 0..60),
        // Far from the origin: rounding is that of the coordinates.
        prop::collection::vec(primitive(point(1.0).prop_map(|p| p.map(|x| x + 50.0)), pair(1.0)), 0..60)
            .prop_map(|scene| scene),
        // All in one point.
        prop::collection::vec(primitive(Just([0.25, 0.0, -0.5]), Just([[0.5, 0.0, 0.0], [0.0, 0.5, 0.25]])), 0..40),
    ]
}

fn packet() -> impl Strategy<Value = Rays<16>> {
    let ends = prop_oneof![
        prop::collection::vec((point(1.5), point(1.5)), 16),
        prop::collection::vec((grid_point(), grid_point()), 16),
        // Two patches.
        (point(1.0), point(1.0), 0.01_f32..1.0).prop_flat_map(|(a, b, size)| prop::collection::vec(
            (point(size), point(size)).prop_map(move |(p, q)| {
                (std::array::from_fn(|axis| a[axis] + p[axis]), std::array::from_fn(|axis| b[axis] + q[axis]))
            }),
            16
        )),
    ];
    let span =
        prop_oneof![Just((0.0_f32, 1.0_f32)), Just((1e-4, 0.9999)), Just((0.0, f32::INFINITY)), Just((0.5, 0.25))];
    let spans = prop_oneof![9 => span.clone().prop_map(|span| vec![span; 16]).boxed(), 1 => prop::collection::vec(span, 16).boxed()];
    (ends, spans).prop_map(|(ends, spans)| {
        let mut rays = Rays::default();
        for (k, (a, b)) in ends.into_iter().enumerate() {
            rays.set_between(k, a, b, 0.0);
            (rays.near[k], rays.far[k]) = spans[k];
        }
        rays
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]
    /// Catches a box that is too tight, a primitive lost in a split, a bound of the packet that leaves a ray out, a lane of
    /// one backend that differs, and any disagreement of the three queries.
    #[test]
    fn queries_agree_with_double_precision(scene in scene(), rays in packet(), active in 0_u32..0x1_0000) {
        compare(&scene, &rays, active);
        compare(&scene, &rays, 0xffff);
    }
}
