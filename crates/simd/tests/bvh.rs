//! The hierarchy against every primitive one by one in double precision, on all backends.

#![allow(clippy::unwrap_used)]

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
    let w = std::array::from_fn(|axis| u[axis] - v[axis]);
    let (u_inside, v_inside) = (hit_u / length(v), hit_v / length(u));
    let (u_beyond, v_beyond) = ((det - hit_u) / length(v), (det - hit_v) / length(u));
    let outer = if primitive.parallelogram { u_beyond.min(v_beyond) } else { (det - hit_u - hit_v) / length(w) };
    let inside = u_inside.min(v_inside).min(outer) / length(d);
    // Surely not: too close to the plane, or beyond the outline by more than the skin, with half a skin for rounding.
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
        let blocked = bvh.blocked(backend, rays, active);
        assert_eq!(blocked & !active, 0);
        let mut shares = [1.0; 16];
        shares.copy_from_slice(&bvh.transmittance(backend, rays, active, &Half));
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
        answers.push((blocked, shares.map(f32::to_bits), hits.iter().map(bits).collect::<Vec<_>>()));
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

/// One ray as a packet of its own, on the best backend.
fn is_blocked(bvh: &Bvh8, from: Point, to: Point) -> bool {
    let mut rays = Rays::default();
    rays.set_between(5, from, to, 0.0);
    bvh.blocked(Backend::best(), &rays, 1 << 5) != 0
}

fn lerp(a: Point, b: Point, t: f32) -> Point {
    std::array::from_fn(|axis| a[axis] + t * (b[axis] - a[axis]))
}

#[test]
fn nothing_is_in_an_empty_hierarchy() {
    // Catches an index into no node; primitives without an area are no primitives.
    let flat = triangle([0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]);
    let broken = triangle([f32::NAN; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let endless = Primitive { u: [f32::INFINITY, 0.0, 0.0], ..triangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]) };
    let point = triangle([1.0; 3], [1.0; 3], [1.0; 3]);
    for primitives in [vec![], vec![flat, broken, endless, point]] {
        let bvh = Bvh8::build(&primitives);
        check(&bvh, &primitives).unwrap();
        assert_eq!(bvh.bounds(), ([0.0; 3], [0.0; 3]));
        for backend in Backend::available() {
            let mut rays = Rays::default();
            rays.set_between(0, [0.0, 0.0, -1.0], [0.1, 0.1, 1.0], 0.0);
            assert_eq!(bvh.blocked(backend, &rays, 0xffff), 0);
            assert_eq!(bvh.transmittance(backend, &rays, 0xffff, &NoFilter), [1.0; 16]);
            assert_eq!(bvh.closest16(backend, &rays, 0xffff), [Hit::NONE; 16]);
            let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
            let above = square.map(|[x, y, _]| [x, y, 1.0]);
            let (floor, ceiling) = ([0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -1.0, -1.0]);
            assert!(bvh.clear_between(backend, &square, &above, floor, ceiling, 1e-6, 10));
            assert!(!bvh.blocks_all(backend, 0, &square, &above, 1e-6));
        }
    }
}

#[test]
fn threads_do_not_show_in_the_tree() {
    // Catches an order of nodes or a sum that depends on which thread built which part.
    let primitives = soup(30_000, 11);
    let tree = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh8::build(&primitives))
    };
    let one = tree(1);
    check(&one, &primitives).unwrap();
    for threads in 2..4 {
        assert!(tree(threads) == one, "{threads} threads");
    }
}

/// Numbers that look random (xorshift).
struct Random(u64);

impl Random {
    fn number(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
    fn point(&mut self, size: f32) -> Point {
        std::array::from_fn(|_| size * (2.0 * self.number() - 1.0))
    }
}

fn soup(count: usize, seed: u64) -> Vec<Primitive> {
    let mut random = Random(seed);
    (0..count)
        .map(|k| {
            let (origin, u, v) = (random.point(5.0), random.point(0.2), random.point(0.2));
            Primitive { origin, u, v, parallelogram: k % 3 == 0, opaque: k % 7 != 0 }
        })
        .collect()
}

#[test]
fn many_primitives_agree_with_double_precision() {
    // Catches what only a hierarchy of several levels and parts shows.
    let primitives = soup(20_000, 5);
    let mut random = Random(9);
    for _ in 0..8 {
        let (a, b) = (random.point(6.0), random.point(6.0));
        let mut rays = Rays::default();
        for k in 0..16 {
            let (p, q) = (random.point(0.3), random.point(0.3));
            rays.set_between(k, lerp(a, p, 0.05), lerp(b, q, 0.05), 1e-4);
        }
        compare_many(&primitives, &rays);
    }
}

/// `compare` without a hierarchy per primitive.
fn compare_many(primitives: &[Primitive], rays: &Rays<16>) {
    let bvh = Bvh8::build(primitives);
    let scale = scale(primitives);
    let blocked = bvh.blocked(Backend::best(), rays, 0xffff);
    let hits = bvh.closest16(Backend::best(), rays, 0xffff);
    for (k, hit) in hits.iter().enumerate() {
        let crossings: Vec<_> = primitives.iter().map(|primitive| cross(rays, k, primitive, scale)).collect();
        let opaque = |wanted: fn(&Result<Option<[f64; 3]>, ()>) -> bool| {
            crossings.iter().zip(primitives).any(|(crossing, primitive)| primitive.opaque && wanted(crossing))
        };
        let bit = blocked >> k & 1 != 0;
        assert!(bit || !opaque(|crossing| matches!(crossing, Ok(Some(_)))), "ray {k}");
        assert!(!bit || opaque(|crossing| *crossing != Ok(None)), "ray {k}");
        let first = crossings.iter().filter_map(|c| c.ok().flatten()).map(|hit| hit[0]).fold(f64::INFINITY, f64::min);
        if first < f64::INFINITY {
            assert!(f64::from(hit.t) <= first + 1e-5, "ray {k}");
        }
    }
}

/// A closed surface about a point: a box whose sides are parallelograms, fans of triangles, and strips that meet the
/// neighbours' edges in the middle.
fn shell(middle: Point, size: f32, turn: f32) -> (Vec<Primitive>, Vec<[Point; 2]>) {
    let (sin, cos) = turn.sin_cos();
    let at = |x: f32, y: f32, z: f32| -> Point {
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        let (y, z) = (cos * y - sin * z, sin * y + cos * z);
        [middle[0] + size * x, middle[1] + size * y, middle[2] + size * z]
    };
    let mut all = Vec::new();
    let mut edges = Vec::new();
    // Two whole sides, two sides of two triangles, one of two parallelograms, one a fan about a point that sticks out.
    let sides: [[[f32; 3]; 4]; 6] = [
        [[-1., -1., -1.], [1., -1., -1.], [1., 1., -1.], [-1., 1., -1.]],
        [[-1., -1., 1.], [1., -1., 1.], [1., 1., 1.], [-1., 1., 1.]],
        [[-1., -1., -1.], [1., -1., -1.], [1., -1., 1.], [-1., -1., 1.]],
        [[-1., 1., -1.], [1., 1., -1.], [1., 1., 1.], [-1., 1., 1.]],
        [[-1., -1., -1.], [-1., 1., -1.], [-1., 1., 1.], [-1., -1., 1.]],
        [[1., -1., -1.], [1., 1., -1.], [1., 1., 1.], [1., -1., 1.]],
    ];
    for (k, side) in sides.into_iter().enumerate() {
        let [a, b, c, d] = side.map(|[x, y, z]| at(x, y, z));
        for edge in [[a, b], [b, c], [c, d], [d, a], [a, c]] {
            edges.push(edge);
        }
        match k {
            0 | 1 => all.push(parallelogram(a, b, d)),
            2 | 3 => all.extend([triangle(a, b, c), triangle(a, c, d)]),
            4 => {
                let (m, n) = (lerp(a, b, 0.3), lerp(d, c, 0.3));
                all.extend([parallelogram(a, m, d), parallelogram(m, b, n)]);
                edges.push([m, n]);
            }
            _ => {
                let tip = at(1.3, 0.1, 0.2);
                for (p, q) in [(a, b), (b, c), (c, d), (d, a)] {
                    all.push(triangle(tip, p, q));
                    edges.push([tip, p]);
                }
            }
        }
    }
    (all, edges)
}

#[test]
fn what_lies_near_a_plane_is_found() {
    // Catches a child that is passed by, a bound on the wrong side, and an answer of all there is.
    let mut random = Random(5);
    let mut all = Vec::new();
    for _ in 0..500 {
        let at = random.point(1.0);
        let (u, v) = (random.point(0.1), random.point(0.1));
        all.push(Primitive { origin: at, u, v, parallelogram: random.point(1.0)[0] > 0.0, opaque: true });
    }
    let bvh = Bvh8::build(&all);
    let dot = |a: Point, b: Point| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mut most = 0;
    for _ in 0..200 {
        let (middle, normal) = (random.point(1.0), random.point(1.0));
        let length = dot(normal, normal).sqrt();
        let normal: Point = std::array::from_fn(|axis| normal[axis] / length);
        let (low, high) = (middle.map(|x| x - 0.2), middle.map(|x| x + 0.2));
        let offset = dot(normal, middle);
        let mut found = vec![0; all.len()];
        bvh.near_plane(low, high, [normal[0], normal[1], normal[2], offset], 0.01, &mut |k| found[k as usize] += 1);
        for (primitive, &found) in all.iter().zip(&found) {
            let Primitive { origin, u, v, parallelogram, .. } = *primitive;
            let at = |s: f32, t: f32| -> Point { std::array::from_fn(|axis| origin[axis] + s * u[axis] + t * v[axis]) };
            let mut corners = vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)];
            if parallelogram {
                corners.push(at(1.0, 1.0));
            }
            let meets = (0..3).all(|axis| {
                corners.iter().any(|c| c[axis] <= high[axis]) && corners.iter().any(|c| c[axis] >= low[axis])
            });
            let heights = || corners.iter().map(|&corner| dot(normal, corner) - offset);
            let is_near = meets && heights().any(|h| h <= 0.01) && heights().any(|h| h >= -0.01);
            assert!(found <= 1 && (found == 1 || !is_near));
        }
        most = most.max(found.iter().sum());
    }
    assert!((1..200).contains(&most), "{most}");
}

#[test]
fn no_light_passes_between_neighbours() {
    // Catches an edge test that rounds differently for two primitives with a common edge, whole or in part.
    for (middle, size) in [
        ([0.0, 0.0, 0.0], 1.0),
        ([0.3, -0.2, 0.1], 1e-3),
        ([100.0, 50.0, -70.0], 3.0),
        ([3.0, 2.0, 1.0], 0.01),
        ([0.0; 3], 1e4),
    ] {
        for turn in 0..40 {
            let (primitives, edges) = shell(middle, size, 0.1 * turn as f32);
            let bvh = Bvh8::build(&primitives);
            check(&bvh, &primitives).unwrap();
            let mut random = Random(1 + turn);
            for [p, q] in edges {
                for step in 0..9 {
                    let target = lerp(p, q, step as f32 / 8.0);
                    let inner: Point = std::array::from_fn(|axis| middle[axis] + size * 0.4 * random.point(1.0)[axis]);
                    let outer = lerp(inner, target, 1.5);
                    assert!(is_blocked(&bvh, inner, outer), "{inner:?} to {outer:?} past {target:?} of {p:?} {q:?}");
                    assert!(is_blocked(&bvh, outer, inner), "{outer:?} to {inner:?} past {target:?} of {p:?} {q:?}");
                }
            }
        }
    }
}

#[test]
fn a_ray_in_a_primitives_plane_passes_it() {
    // Catches a determinant of rounding errors that is taken for a crossing, and a primitive that blocks what starts on it.
    let mut random = Random(3);
    for k in 0..2000 {
        let (a, u, v) = (random.point(3.0), random.point(1.0), random.point(1.0));
        let primitive = Primitive { origin: a, u, v, parallelogram: k % 2 == 0, opaque: true };
        let bvh = Bvh8::build(&[primitive]);
        let on = |s: f32, t: f32| -> Point { std::array::from_fn(|axis| a[axis] + s * u[axis] + t * v[axis]) };
        let within = 0.9 * random.number();
        // Through it in its plane, from it to it, and from it to elsewhere.
        assert!(!is_blocked(&bvh, on(-0.5, within), on(1.5, 0.3)), "{primitive:?}");
        assert!(!is_blocked(&bvh, on(-1.0, -0.5), on(1.5, 1.0)), "{primitive:?}");
        assert!(!is_blocked(&bvh, on(0.2, 0.3), on(0.3, 0.1)), "{primitive:?}");
        assert!(!is_blocked(&bvh, on(0.2, 0.3), random.point(4.0)), "{primitive:?}");
        assert!(!is_blocked(&bvh, random.point(4.0), on(0.5, 0.25)), "{primitive:?}");
    }
}

#[test]
fn rays_along_axes_meet_what_is_there() {
    // Catches 0 times infinity in a box test: rays in the faces of boxes and exactly between them.
    let mut primitives = Vec::new();
    for x in -3..3 {
        for y in -3..3 {
            let (x, y) = (x as f32, y as f32);
            primitives.push(parallelogram([x, y, 0.0], [x + 1.0, y, 0.0], [x, y + 1.0, 0.0]));
        }
    }
    let bvh = Bvh8::build(&primitives);
    for backend in Backend::available() {
        for (x, y) in [(0.0, 0.0), (-0.0, 1.0), (0.5, -0.0), (1.0, 1.0), (3.0, 3.0), (2.5, -3.0)] {
            for side in [-1.0, 1.0] {
                let mut rays = Rays::default();
                for k in 0..16 {
                    rays.set_between(k, [x, y, side], [x, y, -side], 0.0);
                }
                assert_eq!(bvh.blocked(backend, &rays, 0xffff), 0xffff, "{x} {y}");
                // Single rays walk otherwise.
                assert_eq!(bvh.blocked(backend, &rays, 0x8000), 0x8000, "{x} {y}");
                let hit = bvh.closest(backend, [x, y, side], [-0.0, 0.0, -side], 0.0, f32::INFINITY).unwrap();
                assert_eq!(hit.t, 1.0);
                assert!(bvh.closest(backend, [x, y, side], [0.0, -0.0, side], 0.0, f32::INFINITY).is_none());
                assert!(bvh.closest(backend, [x, y, side], [0.0; 3], 0.0, f32::INFINITY).is_none());
                assert!(bvh.closest(backend, [x, y, side], [0.0, 0.0, f32::NAN], 0.0, f32::INFINITY).is_none());
                assert!(bvh.closest(backend, [x, y, side], [0.0, 0.0, -side], 2.0, 1.0).is_none());
            }
        }
    }
}

#[test]
fn of_equal_hits_the_lowest_index_is_first() {
    // Catches an answer that depends on the order of children.
    let square = parallelogram([-1.0, -1.0, 0.5], [1.0, -1.0, 0.5], [-1.0, 1.0, 0.5]);
    let primitives = vec![square; 50];
    let bvh = Bvh8::build(&primitives);
    check(&bvh, &primitives).unwrap();
    for backend in Backend::available() {
        let hit = bvh.closest(backend, [0.1, 0.2, 0.0], [0.0, 0.0, 2.0], 0.0, f32::INFINITY).unwrap();
        assert_eq!((hit.primitive, hit.t), (0, 0.25));
        assert!((hit.u - 0.55).abs() < 1e-6 && (hit.v - 0.6).abs() < 1e-6);
    }
}

fn plane_of(polygon: &[Point]) -> [f32; 4] {
    let (u, v) = (sub(polygon[1], polygon[0]).map(f64::from), sub(polygon[2], polygon[0]).map(f64::from));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
    let n = n.map(|x| x / length);
    let offset: f64 = (0..3).map(|axis| n[axis] * f64::from(polygon[0][axis])).sum();
    [n[0] as f32, n[1] as f32, n[2] as f32, offset as f32]
}

/// A random convex polygon of three or four corners.
fn patch(origin: Point, u: Point, v: Point, fourth: Option<f32>) -> Vec<Point> {
    let at = |s: f32, t: f32| -> Point { std::array::from_fn(|axis| origin[axis] + s * u[axis] + t * v[axis]) };
    match fourth {
        Some(w) => vec![at(0.0, 0.0), at(1.0, 0.0), at(w, w), at(0.0, 1.0)],
        None => vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)],
    }
}

/// A point of a convex polygon, not on its outline.
fn inner(polygon: &[Point], random: &mut Random) -> Point {
    let weights: Vec<f32> = polygon.iter().map(|_| 0.05 + random.number()).collect();
    let sum: f32 = weights.iter().sum();
    std::array::from_fn(|axis| polygon.iter().zip(&weights).map(|(corner, w)| corner[axis] * w / sum).sum())
}

fn polygon() -> impl Strategy<Value = Vec<Point>> {
    (point(1.0), point(0.6), point(0.6), prop::option::of(0.6_f32..1.2)).prop_map(|(o, u, v, w)| patch(o, u, v, w))
}

/// Two polygons, anywhere or with a common edge or corner, or one above the other.
fn two_polygons() -> impl Strategy<Value = (Vec<Point>, Vec<Point>)> {
    prop_oneof![
        (polygon(), polygon()),
        (point(1.0), point(0.6), point(0.6), point(0.6), prop::option::of(0.6_f32..1.2))
            .prop_map(|(o, u, v, w, fourth)| (patch(o, u, v, fourth), patch(o, u, w, fourth))),
        (polygon(), point(0.6), point(0.6)).prop_map(|(a, u, v)| { (a.clone(), patch(a[0], u, v, None)) }),
        (polygon(), point(1.0)).prop_map(|(a, d)| {
            (a.clone(), a.iter().map(|p| std::array::from_fn(|axis| p[axis] + d[axis])).collect())
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]
    /// Catches a plane that bounds too much, a direction of rounding errors, a primitive that is passed over.
    #[test]
    fn a_clear_shaft_holds_no_crossing(
        scene in prop::collection::vec(
            primitive(point(1.0), (point(0.4), point(0.4)).prop_map(|(u, v)| [u, v])), 0..12),
        (a, b) in two_polygons(),
        seed in 1_u64..u64::MAX,
    ) {
        let bvh = Bvh8::build(&scene);
        let scale = scale(&scene).max(1.0);
        let tolerance = 2.0 * SKIN * scale;
        let (plane_a, plane_b) = (plane_of(&a), plane_of(&b));
        prop_assume!(plane_a.iter().chain(&plane_b).all(|x| x.is_finite()));
        let clear = bvh.clear_between(Backend::Scalar, &a, &b, plane_a, plane_b, tolerance, 1000);
        for backend in Backend::available() {
            prop_assert_eq!(bvh.clear_between(backend, &a, &b, plane_a, plane_b, tolerance, 1000), clear);
        }
        let mut random = Random(seed);
        let mut blocked = 0;
        for _ in 0..4 {
            let mut rays = Rays::default();
            for k in 0..16 {
                rays.set_between(k, inner(&a, &mut random), inner(&b, &mut random), 1e-3);
            }
            for k in 0..16 {
                for (id, primitive) in scene.iter().enumerate() {
                    if let Ok(Some(hit)) = cross(&rays, k, primitive, scale) {
                        blocked += 1;
                        prop_assert!(!clear, "primitive {id} is hit at {hit:?} of ray {k}");
                    }
                }
            }
        }
        for id in 0..scene.len() as u32 {
            let all = bvh.blocks_all(Backend::Scalar, id, &a, &b, tolerance);
            for backend in Backend::available() {
                prop_assert_eq!(bvh.blocks_all(backend, id, &a, &b, tolerance), all);
            }
            prop_assert!(!all || blocked >= 64, "{blocked} of 64 rays blocked");
        }
    }
}

#[test]
fn shafts_are_found_clear_where_they_are() {
    // Catches a test that proves nothing: pairs of a furnished room's kind, of which the answer is plain.
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let ceiling = floor.map(|[x, y, _]| [x, y, 1.0]);
    let wall = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]];
    let other = wall.map(|[_, y, z]| [1.0, y, z]);
    let quad = |p: [Point; 4]| parallelogram(p[0], p[1], p[3]);
    let mut room = vec![quad(floor), quad(ceiling), quad(wall), quad(other)];
    let clear = |scene: &[Primitive], a: &[Point], b: &[Point]| {
        Bvh8::build(scene).clear_between(Backend::best(), a, b, plane_of(a), plane_of(b), 4.0 * SKIN, 100)
    };
    for (a, b) in [(floor, ceiling), (floor, wall), (wall, other), (ceiling, wall), (other, floor)] {
        assert!(clear(&room, &a, &b), "{a:?} {b:?}");
    }
    // A small thing in the corner of floor and wall is between them, and between floor and ceiling, but not higher up.
    room.push(parallelogram([0.01, 0.5, 0.0], [0.0, 0.5, 0.01], [0.01, 0.6, 0.0]));
    assert!(!clear(&room, &floor, &wall));
    assert!(!clear(&room, &floor, &ceiling));
    assert!(clear(&room, &ceiling, &other));
    // No budget, no proof.
    let bvh = Bvh8::build(&room);
    assert!(!bvh.clear_between(Backend::best(), &ceiling, &other, plane_of(&ceiling), plane_of(&other), 4.0 * SKIN, 0));
    // A board half way up hides floor from ceiling.
    room.push(quad([[-0.1, -0.1, 0.5], [1.1, -0.1, 0.5], [1.1, 1.1, 0.5], [-0.1, 1.1, 0.5]]));
    room.push(quad([[-0.1, -0.1, 0.6], [0.9, -0.1, 0.6], [0.9, 1.1, 0.6], [-0.1, 1.1, 0.6]]));
    let bvh = Bvh8::build(&room);
    assert!(bvh.blocks_all(Backend::best(), 5, &floor, &ceiling, 4.0 * SKIN));
    assert!(!bvh.blocks_all(Backend::best(), 6, &floor, &ceiling, 4.0 * SKIN));
    room[5].opaque = false;
    assert!(!Bvh8::build(&room).blocks_all(Backend::best(), 5, &floor, &ceiling, 4.0 * SKIN));
}

#[test]
fn a_batch_is_its_packets() {
    // Catches an answer that the packet before changes, and one that is written to another's place.
    let primitives = soup(300, 21);
    let bvh = Bvh8::build(&primitives);
    let mut random = Random(8);
    let packets: Vec<Rays<16>> = (0..64)
        .map(|_| {
            let mut rays = Rays::default();
            for k in 0..16 {
                rays.set_between(k, random.point(5.0), random.point(5.0), 1e-4);
            }
            rays
        })
        .collect();
    let mut answers = vec![0; packets.len()];
    bvh.blocked_batch(Backend::best(), &packets, &mut answers);
    for (rays, &answer) in packets.iter().zip(&answers) {
        assert_eq!(bvh.blocked(Backend::best(), rays, 0xffff), u32::from(answer));
    }
}

/// Asserts that each backend finds for a packet what one finds for its rays alone; how many hit.
fn compare_with_single(bvh: &Bvh8, rays: &Rays<16>, active: u32) -> usize {
    let bits = |hit: Hit| [hit.t.to_bits(), hit.primitive, hit.u.to_bits(), hit.v.to_bits()];
    let alone = |k: usize| {
        let [origin, direction] = [rays.origin, rays.direction].map(|v| v.map(|v| v[k]));
        let hit = bvh.closest(Backend::Scalar, origin, direction, rays.near[k], rays.far[k]);
        hit.filter(|_| active >> k & 1 == 1).unwrap_or(Hit::NONE)
    };
    let alone: [Hit; 16] = std::array::from_fn(alone);
    for backend in Backend::available() {
        let together = bvh.closest16(backend, rays, active);
        assert_eq!(together.map(bits), alone.map(bits), "{} {active:b} {rays:?}", backend.name());
    }
    alone.iter().filter(|hit| **hit != Hit::NONE).count()
}

#[test]
fn a_packet_hits_what_its_rays_hit_alone() {
    // Catches a child that is left out though one ray hits something nearer there, a far end that is drawn in for another
    // ray, an order among equals, and rays that lose what they hit where the packet falls apart.
    let mut thick = soup(3000, 17);
    // All of them twice, the second time in the opposite order, so that equals stand apart: ties all over.
    thick.extend(thick.clone().into_iter().rev());
    let mut flat = Vec::new();
    for k in 0..400 {
        let (x, y, z) = ((k % 10) as f32 - 5.0, (k / 10 % 10) as f32 - 5.0, (k / 100) as f32);
        flat.push(parallelogram([x, y, z], [x + 1.0, y, z], [x, y + 1.0, z]));
    }
    let mut random = Random(31);
    let mut hits = 0;
    for primitives in [soup(20_000, 5), soup(40, 6), thick, flat, Vec::new()] {
        let bvh = Bvh8::build(&primitives);
        check(&bvh, &primitives).unwrap();
        for turn in 0..400 {
            let (from, to, size) = (random.point(5.0), random.point(5.0), [0.02, 0.3, 1.0, 4.0][turn % 4]);
            let mut rays = Rays::default();
            for k in 0..16 {
                let (p, q) = (random.point(size), random.point(size));
                let (from, to) = match turn / 4 % 5 {
                    // From one point, from a patch to a patch, all parallel, and along planes of a grid.
                    0 => (from, lerp(to, q, 0.5)),
                    1 => (lerp(from, p, 0.1), lerp(to, q, 0.1)),
                    2 => (lerp(from, p, 0.5), std::array::from_fn(|axis| lerp(from, p, 0.5)[axis] + to[axis])),
                    3 => {
                        let on_grid = from.map(f32::round);
                        let axis = (turn / 20 + k) % 3;
                        (on_grid, std::array::from_fn(|a| on_grid[a] + if a == axis { q[a] } else { 0.0 }))
                    }
                    _ => (random.point(6.0), random.point(6.0)),
                };
                rays.set_between(k, from, to, 0.0);
                rays.near[k] = [0.0, 1e-4, 0.3][turn % 3];
                rays.far[k] = [f32::INFINITY, 1.0, 0.9999, 30.0][(turn + k / 4) % 4];
            }
            rays.far[turn % 16] = [rays.far[turn % 16], -1.0, f32::NAN][turn % 3];
            hits += compare_with_single(&bvh, &rays, 0xffff);
            let active = (random.number() * 65536.0) as u32;
            hits += compare_with_single(&bvh, &rays, active);
            compare_with_single(&bvh, &rays, 1 << (turn % 16));
        }
    }
    // Of 48,000 rays that were compared, the single ones left out.
    assert!(hits > 10_000, "{hits}");
}
