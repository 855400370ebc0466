//! Rays through the BSP tree and the visibility of patches, against exact cases and against rays over all polygons.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod bsp_scenes;

use bsp_scenes::*;
use isolux_core::DVec3;
use isolux_core::kernels::visibility::{
    Blocker, Rays, Sampling, Weighting, open_share, point_visibility, sight, sight_ray_by_ray, visibility,
    visibility_ray_by_ray,
};
use isolux_core::kernels::{Counts, NoProbe, Patch};
use isolux_core::sampling::Stream;
use isolux_core::scene::{AlphaMask, Plane, Polygon, Scene, Wrap};
use isolux_core::tree::bsp::Hit;
use isolux_core::tree::{Bsp, InsertionOrder};
use proptest::prelude::*;
use std::ops::ControlFlow;

const ORDERS: [InsertionOrder; 5] = [
    InsertionOrder::AsGiven,
    InsertionOrder::LargestFirst,
    InsertionOrder::FewestCuts,
    InsertionOrder::Random(1),
    InsertionOrder::Random(2),
];

const SAMPLINGS: [Sampling; 4] = [
    Sampling { rays: Rays::Sixteen, weighting: Weighting::Equal },
    Sampling { rays: Rays::TwoHundredFiftySix, weighting: Weighting::Equal },
    Sampling { rays: Rays::Sixteen, weighting: Weighting::Carried },
    Sampling { rays: Rays::TwoHundredFiftySix, weighting: Weighting::Carried },
];

/// The tree of a scene, checked.
fn tree(scene: &Scene, order: InsertionOrder) -> Bsp {
    let bsp = Bsp::build(scene, order);
    bsp.check(scene).unwrap();
    bsp
}

/// Catches a broken split: a tree of the furnished room whose fragments leave their planes, sides or areas.
#[test]
fn trees_of_a_room_keep_their_invariants() {
    let scene = furnished_room();
    for order in ORDERS {
        let bsp = tree(&scene, order);
        println!(
            "{order:?}: {} polygons, {} fragments, {} nodes",
            scene.fronts,
            bsp.fragments().len(),
            bsp.nodes().len()
        );
    }
}

/// Catches a wall that leaks or an empty room that blocks.
#[test]
fn a_wall_blocks_all_and_nothing_blocks_nothing() {
    let floor = vec![v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)];
    let ceiling = vec![v(0.0, 0.0, 1.0), v(0.0, 1.0, 1.0), v(1.0, 1.0, 1.0), v(1.0, 0.0, 1.0)];
    let between: Vec<DVec3> = floor.iter().map(|&p| p + v(0.0, 0.0, 0.5)).collect();
    for (faces, expected) in [(vec![floor.clone(), ceiling.clone()], 1.0), (vec![floor, ceiling, between], 0.0)] {
        let scene = scene_of(&faces);
        for order in ORDERS {
            let bsp = tree(&scene, order);
            let (a, b) = (patch(&scene.polygons[0]), patch(&scene.polygons[1]));
            for rays in [Rays::Sixteen, Rays::TwoHundredFiftySix] {
                for seed in 0..20 {
                    assert_eq!(visibility(&bsp, &scene, &a, &b, rays, seed, &mut NoProbe), expected);
                }
            }
        }
    }
}

/// A point inside a polygon by its corners alone, `margin` metres beyond its edges included (negative: inside of them).
fn inside(polygon: &Polygon, point: DVec3, margin: f64) -> bool {
    let corners = &polygon.corners;
    (0..corners.len()).all(|i| {
        let (p, q) = (corners[i], corners[(i + 1) % corners.len()]);
        let inward = polygon.plane.normal.cross(q - p);
        inward.length() == 0.0 || inward.dot(point - p) >= -margin * inward.length()
    })
}

/// Where a line meets a polygon's plane, and whether that is well inside (by more than `clear`), well outside, or too
/// near to an edge to say.
fn meet(polygon: &Polygon, origin: DVec3, delta: DVec3, clear: f64) -> Option<(f64, Option<bool>)> {
    let slope = polygon.plane.normal.dot(delta);
    let t = -polygon.plane.distance(origin) / slope;
    if !t.is_finite() {
        return None;
    }
    let point = origin + delta * t;
    let certain = if inside(polygon, point, -clear) {
        Some(true)
    } else if inside(polygon, point, clear) {
        None
    } else {
        Some(false)
    };
    Some((t, certain))
}

/// The nearest hit by a search over all polygons; `Err` where a ray passes an edge so closely that the answer hangs on
/// the tolerance.
fn search(scene: &Scene, origin: DVec3, direction: DVec3, max_distance: f64) -> Result<Option<(f64, u32)>, ()> {
    let clear = 4.0 * scene.tolerance();
    let mut best: Option<(f64, u32)> = None;
    for (index, polygon) in scene.polygons[..scene.fronts].iter().enumerate() {
        // A slope below 1e-4 turns a rounding of 1e-16 into one that could cross `clear`: not decided here.
        let grazing = polygon.plane.normal.dot(direction).abs() < 1e-4;
        if grazing && polygon.plane.distance(origin).abs() < clear {
            return Err(());
        }
        if let Some((t, certain)) = meet(polygon, origin, direction, clear) {
            if t <= -clear || t > max_distance + clear {
                continue;
            }
            if certain.is_none() || (certain == Some(true) && (t < clear || t > max_distance - clear)) {
                return Err(());
            }
            if certain == Some(true) && best.is_none_or(|(distance, _)| t < distance) {
                best = Some((t, index as u32));
            }
        }
    }
    Ok(best)
}

/// Random polygons, a third of them triangles; some share a plane and overlap, some cross, some are nearly degenerate.
fn random_scene(seed: u64) -> Scene {
    let mut random = Random(seed | 1);
    let mut faces: Vec<Vec<DVec3>> = Vec::new();
    for _ in 0..4 + random.below(30) {
        let axis = random.below(3);
        let mut point = |flat: Option<f64>| {
            let mut point = random.point(DVec3::ZERO, DVec3::ONE);
            if let Some(height) = flat {
                point[axis] = height;
            }
            point
        };
        let height = if axis == 2 { None } else { Some(0.25 * (axis + 1) as f64) };
        let (a, b, c) = (point(height), point(height), point(height));
        match random.below(8) {
            0 => faces.push(vec![a, b, a + (b - a) * 0.4 + (c - a) * 1e-5]),
            1..=3 => faces.push(vec![a, b, c]),
            _ => faces.push(vec![a, b, b + (c - a), c]),
        }
    }
    scene_of(&faces)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

    /// D2. Catches a subtree that is left out wrongly, a wrong edge, a hit that depends on how polygons were cut: the tree's
    /// answers against a search over all polygons, for four orders of insertion.
    #[test]
    fn rays_agree_with_a_search_over_all_polygons(seed in any::<u64>()) {
        let scene = random_scene(seed);
        let trees = ORDERS.map(|order| tree(&scene, order));
        let mut random = Random(seed.wrapping_mul(3) | 1);
        for _ in 0..300 {
            let origin = random.point(DVec3::splat(-0.2), DVec3::splat(1.2));
            let direction = random.direction();
            let max_distance = if random.below(2) == 0 { f64::INFINITY } else { random.unit() };
            let hits = trees.each_ref().map(|bsp| bsp.closest_hit(&scene, origin, direction, max_distance, &mut NoProbe));
            for hit in &hits {
                prop_assert_eq!(hit, &hits[0]);
            }
            if let Ok(expected) = search(&scene, origin, direction, max_distance) {
                match (hits[0], expected) {
                    (None, None) => {}
                    (Some(hit), Some((t, polygon))) => {
                        // Rounding over a slope of 1e-4 or more: 1e-16 / 1e-4.
                        prop_assert!((hit.distance - t).abs() < 1e-11, "{:?} {}", hit, t);
                        let surface = &scene.polygons[hit.polygon as usize];
                        let other = &scene.polygons[polygon as usize];
                        let coplanar = other.corners.iter().all(|&c| surface.plane.distance(c).abs() < 1e-9);
                        prop_assert!(hit.polygon == polygon || coplanar || (hit.distance - t).abs() < 1e-15);
                        prop_assert_eq!(hit.front_facing, surface.plane.normal.dot(direction) < 0.0);
                    }
                    (hit, expected) => prop_assert!(false, "{:?} {:?}", hit, expected),
                }
            }
        }
    }

    /// D8. Catches a beam that leaves out a blocker, or takes all rays for blocked when one is not: equal, bit for bit, to
    /// single rays, in all orders of insertion, with and without a hint, for 16 and 256 rays.
    #[test]
    fn beams_agree_with_single_rays(seed in any::<u64>()) {
        let mut scene = random_scene(seed);
        let mut random = Random(seed.wrapping_mul(5) | 1);
        for polygon in &mut scene.polygons {
            if random.below(6) == 0 {
                polygon.opacity = random.unit();
            }
        }
        let trees = ORDERS.map(|order| tree(&scene, order));
        let mut hint = Blocker::default();
        for k in 0..60 {
            let (a, b) = (random.below(scene.fronts), random.below(scene.fronts));
            let shrink = |polygon: &Polygon, level: u32, random: &mut Random| {
                if polygon.corners.len() == 3 { polygon.clone() } else {
                    let mut parts = quartered(polygon, level);
                    let part = random.below(parts.len());
                    parts.swap_remove(part)
                }
            };
            let a = shrink(&scene.polygons[a], k % 4, &mut random);
            let b = shrink(&scene.polygons[b], k % 4, &mut random);
            for rays in SAMPLINGS {
                let expected = visibility_ray_by_ray(&trees[0], &scene, &patch(&a), &patch(&b), rays, seed, &mut NoProbe);
                prop_assert!((0.0..=1.0).contains(&expected));
                for bsp in &trees {
                    let beam = visibility(bsp, &scene, &patch(&a), &patch(&b), rays, seed, &mut NoProbe);
                    prop_assert_eq!(beam.to_bits(), expected.to_bits());
                    let hinted =
                        sight(bsp, &scene, &patch(&a), &patch(&b), rays, seed, &mut hint, &mut NoProbe).share;
                    prop_assert_eq!(hinted.to_bits(), expected.to_bits());
                }
            }
        }
    }
}

/// Catches the same as `beams_agree_with_single_rays`, at the pairs of a furnished room.
#[test]
fn beams_agree_with_single_rays_in_a_room() {
    let scene = furnished_room();
    let bsp = tree(&scene, InsertionOrder::AsGiven);
    let mut random = Random(11);
    let (mut clear, mut partial, mut blocked) = (0, 0, 0);
    let mut hint = Blocker::default();
    for seed in 0..20_000 {
        let mut draw = || {
            let whole =
                &scene.polygons[if random.below(3) == 0 { random.below(6) } else { random.below(scene.fronts) }];
            let mut part = whole.clone();
            for _ in 0..random.below(5) {
                part = quartered(&part, 1).swap_remove(random.below(4));
            }
            part
        };
        let (a, b) = (draw(), draw());
        // 16 rays, equal and carried by turns.
        let sampling = SAMPLINGS[(seed % 2) as usize * 2];
        let expected = visibility_ray_by_ray(&bsp, &scene, &patch(&a), &patch(&b), sampling, seed, &mut NoProbe);
        let beam = sight(&bsp, &scene, &patch(&a), &patch(&b), sampling, seed, &mut hint, &mut NoProbe).share;
        assert_eq!(beam.to_bits(), expected.to_bits());
        *(if beam == 1.0 {
            &mut clear
        } else if beam == 0.0 {
            &mut blocked
        } else {
            &mut partial
        }) += 1;
    }
    // All three kinds were there.
    assert!(clear > 1000 && partial > 1000 && blocked > 1000, "{clear} {partial} {blocked}");
}

/// Share of segments between random points of two parallelograms that no polygon crosses, by a search over all; the
/// patches themselves are left out by name.
fn share(scene: &Scene, a: usize, b: usize, count: u32) -> f64 {
    let mut random = Random(99);
    let mut point = |polygon: &Polygon| {
        let c = &polygon.corners;
        let (s, t) = (random.unit(), random.unit());
        match c.len() {
            3 if s + t > 1.0 => c[0] + (c[1] - c[0]) * (1.0 - s) + (c[2] - c[0]) * (1.0 - t),
            3 => c[0] + (c[1] - c[0]) * s + (c[2] - c[0]) * t,
            _ => c[0] + (c[1] - c[0]) * s + (c[3] - c[0]) * t,
        }
    };
    let mut open = 0;
    for _ in 0..count {
        let (from, to) = (point(&scene.polygons[a]), point(&scene.polygons[b]));
        let blocked = scene.polygons.iter().enumerate().any(|(k, polygon)| {
            k != a
                && k != b
                && meet(polygon, from, to - from, 0.0)
                    .is_some_and(|(t, inside)| inside == Some(true) && t > 0.0 && t < 1.0)
        });
        open += u32::from(!blocked);
    }
    f64::from(open) / f64::from(count)
}

/// Two facing patches (squares, or triangles) with blockers between them.
fn between(blockers: Vec<Vec<DVec3>>, triangles: bool) -> Scene {
    let mut floor = vec![v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)];
    let mut ceiling = vec![v(0.0, 0.0, 1.0), v(0.0, 1.0, 1.0), v(1.0, 1.0, 1.0), v(1.0, 0.0, 1.0)];
    if triangles {
        floor.truncate(3);
        ceiling.truncate(3);
    }
    let mut faces = vec![floor, ceiling];
    faces.extend(blockers);
    scene_of(&faces)
}

/// Catches rays from a point that favour a part of the patch, or scatter more than independent ones: below a blocker
/// that covers [0, 1/2]² halfway up, the point (0.3, 0.4) misses of the unit square above what lies in [0, 0.7] x
/// [0, 0.6], so V = 0.58.
#[test]
fn point_visibility_is_unbiased() {
    let scene = between(vec![vec![v(0.0, 0.0, 0.5), v(0.5, 0.0, 0.5), v(0.5, 0.5, 0.5), v(0.0, 0.5, 0.5)]], false);
    let bsp = tree(&scene, InsertionOrder::AsGiven);
    let (plane, to) = (&scene.polygons[0].plane, patch(&scene.polygons[1]));
    let (mut sum, mut squares) = (0.0, 0.0);
    for seed in 0..20_000_u64 {
        let seed = seed.wrapping_mul(0x2545_f491_4f6c_dd1d);
        let share = point_visibility(&bsp, &scene, v(0.3, 0.4, 0.0), plane, &to, seed, &mut NoProbe);
        sum += share;
        squares += share * share;
    }
    let mean = sum / 20_000.0;
    let deviation = (squares / 20_000.0 - mean * mean).sqrt();
    assert!((mean - 0.58).abs() < 5.0 * deviation / 20_000_f64.sqrt(), "{mean} {deviation}");
    assert!(deviation <= 0.125, "{deviation}");
}

/// D9. Catches a bias of sampling, pairing or tree: the mean over 20,000 seeds of the estimate by 16 rays, and over 2,000 of
/// that by 256, against a million rays that know nothing of the tree; and a scatter above that of independent rays.
#[test]
fn partial_visibility_is_unbiased() {
    let square = |z: f64, low: f64, high: f64| vec![v(low, low, z), v(high, low, z), v(high, high, z), v(low, high, z)];
    let slanted = vec![v(0.2, -0.1, 0.3), v(0.9, 0.2, 0.5), v(0.6, 0.8, 0.7)];
    for (blockers, triangles) in [
        (vec![square(0.5, 0.0, 0.5)], false),
        (vec![slanted.clone()], false),
        (vec![slanted, square(0.8, 0.3, 0.6)], true),
    ] {
        let scene = between(blockers, triangles);
        let million = 1_000_000;
        let expected = share(&scene, 0, 1, million);
        let bsp = tree(&scene, InsertionOrder::AsGiven);
        let (a, b) = (patch(&scene.polygons[0]), patch(&scene.polygons[1]));
        for (rays, seeds) in [(Rays::Sixteen, 20_000_u32), (Rays::TwoHundredFiftySix, 2_000)] {
            let (mut sum, mut squares) = (0.0, 0.0);
            for seed in 0..seeds {
                // Seeds far apart, as a caller's hashes are.
                let seed = u64::from(seed).wrapping_mul(0x2545_f491_4f6c_dd1d);
                let share = visibility(&bsp, &scene, &a, &b, rays, seed, &mut NoProbe);
                sum += share;
                squares += share * share;
            }
            let n = f64::from(seeds);
            let mean = sum / n;
            let deviation = (squares / n - mean * mean).sqrt();
            // Standard errors of both means; five of them together.
            let error = (deviation * deviation / n + expected * (1.0 - expected) / f64::from(million)).sqrt();
            assert!((mean - expected).abs() < 5.0 * error, "{mean} {expected} {error}");
            // The bound that the kernel's doc states for 16 rays.
            assert!(deviation <= 0.125, "{deviation}");
            println!("{rays:?}: V = {mean:.4}, expected {expected:.4}, deviation {deviation:.4}");
        }
    }
}

/// A floor of one metre, a wall along its edge at x = 0, and a block that stands on the floor but for a rim beside the wall.
fn rim(width: f64) -> (Scene, Scene) {
    let floor = vec![v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)];
    let wall = vec![v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 1.0, 1.0), v(0.0, 0.0, 1.0)];
    let open = vec![floor, wall];
    let mut blocked = open.clone();
    blocked.extend(cuboid(v(width, 0.0, 0.0), v(1.0, 1.0, 0.4), false));
    (scene_of(&open), scene_of(&blocked))
}

/// Catches visibilities that miss where the exchange is: of floor and wall with a block on the floor, 73 to 12 % of the
/// light that they exchange unhindered runs over a rim of 0.5 to 0.05 m between block and wall. Against a million rays
/// with the density of the exchange.
#[test]
fn visibility_of_neighbours_is_the_share_of_their_exchange() {
    for width in [0.5, 0.2, 0.1, 0.05] {
        let (open, blocked) = rim(width);
        let mut stream = Stream::new(7);
        let (mut sent, mut arrived) = (0, 0);
        let trees = [tree(&open, InsertionOrder::AsGiven), tree(&blocked, InsertionOrder::AsGiven)];
        for _ in 0..1_000_000 {
            let origin = stream.point(&open.polygons[0].corners, &open.polygons[0].plane) + DVec3::Z * open.tolerance();
            let direction = stream.cosine_direction(DVec3::Z);
            let hits = [(&open, &trees[0]), (&blocked, &trees[1])]
                .map(|(scene, bsp)| bsp.closest_hit(scene, origin, direction, f64::INFINITY, &mut NoProbe));
            if hits[0].is_some_and(|hit| hit.polygon == 1) {
                sent += 1;
                arrived += u32::from(hits[1].is_some_and(|hit| hit.polygon == 1));
            }
        }
        let expected = f64::from(arrived) / f64::from(sent);
        let (a, b) = (patch(&blocked.polygons[0]), patch(&blocked.polygons[1]));
        // Scatter of independent rays: of 12, the fewest, and of 192.
        for (rays, seeds, most) in [(Rays::Sixteen, 4000_u64, 0.145), (Rays::TwoHundredFiftySix, 400, 0.036)] {
            let sampling = Sampling { rays, weighting: Weighting::Carried };
            let (mut sum, mut squares) = (0.0, 0.0);
            for seed in 0..seeds {
                let seed = seed.wrapping_mul(0x2545_f491_4f6c_dd1d);
                let share = visibility(&trees[1], &blocked, &a, &b, sampling, seed, &mut NoProbe);
                sum += share;
                squares += share * share;
            }
            let mean = sum / seeds as f64;
            let deviation = (squares / seeds as f64 - mean * mean).sqrt();
            let error = deviation / (seeds as f64).sqrt() + 0.5 / f64::from(sent).sqrt();
            println!("{width} {rays:?}: {mean:.4} for {expected:.4}, deviation {deviation:.4}");
            // A ratio of counts, whose number of rays varies: off by less than a scatter of one ray in a thousand.
            assert!((mean - expected).abs() < 5.0 * error + 1e-3, "{width}: {mean} {expected} {error}");
            assert!(deviation <= most, "{width}: {deviation}");
        }
        let equal = visibility(&trees[1], &blocked, &a, &b, Rays::TwoHundredFiftySix, 1, &mut NoProbe);
        // D11. Measured 0.68, 0.65, 0.29 and 0 of it.
        assert!(equal < 0.7 * expected, "equal rays: {equal} for {expected}");
    }
}

/// Catches open shares that count rays in place of area, or take the inside of a block for open: the rim's share of the
/// floor, on average over seeds, and 1 for the wall, the top of the block, and everything where nothing stands.
#[test]
fn the_open_share_is_what_nothing_covers() {
    for width in [0.5, 0.2, 0.1] {
        let (open, blocked) = rim(width);
        let (bare, bsp) = (tree(&open, InsertionOrder::AsGiven), tree(&blocked, InsertionOrder::AsGiven));
        let floor = patch(&blocked.polygons[0]);
        let (mut sum, mut squares) = (0.0, 0.0);
        for seed in 0..2000_u64 {
            let share = open_share(&bsp, &blocked, &floor, seed, &mut NoProbe);
            sum += share;
            squares += share * share;
            if seed < 50 {
                assert_eq!(open_share(&bsp, &blocked, &patch(&blocked.polygons[1]), seed, &mut NoProbe), 1.0);
                assert_eq!(open_share(&bare, &open, &patch(&open.polygons[0]), seed, &mut NoProbe), 1.0);
            }
        }
        let mean = sum / 2000.0;
        let deviation = (squares / 2000.0 - mean * mean).sqrt();
        assert!((mean - width).abs() < 5.0 * deviation / 2000_f64.sqrt() + 1e-9, "{mean} {width}");
        assert!(deviation <= 0.125, "{deviation}");
    }
}

/// Catches 0 and 1 where rays are few: patches that look away from each other, behind each other, in one plane.
#[test]
fn patches_that_do_not_face_each_other_see_nothing() {
    let floor = vec![v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)];
    let beside: Vec<DVec3> = floor.iter().map(|&p| p + v(2.0, 0.0, 0.0)).collect();
    let mut behind: Vec<DVec3> = floor.iter().map(|&p| p - v(0.0, 0.0, 1.0)).collect();
    behind.reverse();
    let looks_up: Vec<DVec3> = floor.iter().map(|&p| p + v(0.0, 0.0, 1.0)).collect();
    let scene = scene_of(&[floor, beside, behind, looks_up]);
    let bsp = tree(&scene, InsertionOrder::AsGiven);
    for other in 1..4 {
        for (a, b) in [(0, other), (other, 0)] {
            let (a, b) = (patch(&scene.polygons[a]), patch(&scene.polygons[b]));
            for rays in [Rays::Sixteen, Rays::TwoHundredFiftySix] {
                assert_eq!(visibility(&bsp, &scene, &a, &b, rays, 3, &mut NoProbe), 0.0);
            }
        }
    }
}

/// Catches blockage by a patch itself, its coplanar neighbours and what shares an edge with it: all pairs of elements of
/// an empty convex room see each other fully, those that touch and those that see each other at grazing angles too.
#[test]
fn an_empty_room_never_blocks_itself() {
    for (angle, size) in [(0.0, 1.0), (0.7, 1.0), (0.7, 1000.0), (0.3, 0.001)] {
        let room = turned(cuboid(v(0.0, 0.0, 0.0), v(8.0, 6.0, 3.0), true), v(1.0, 2.0, 0.0), angle);
        let room: Vec<Vec<DVec3>> = room.into_iter().map(|face| face.iter().map(|&p| p * size).collect()).collect();
        let walls: Vec<Polygon> = room.iter().filter_map(|face| polygon(face)).collect();
        // Walls as 4 x 4 polygons each: coplanar neighbours everywhere.
        let scene = scene(walls.iter().flat_map(|wall| quartered(wall, 2)).collect());
        let bsp = tree(&scene, InsertionOrder::Random(4));
        for wall in &walls {
            let elements = quartered(wall, 4);
            for other in &scene.polygons {
                if other.plane == wall.plane {
                    continue;
                }
                for element in elements.iter().step_by(5) {
                    let share =
                        visibility(&bsp, &scene, &patch(element), &patch(other), Rays::Sixteen, 9, &mut NoProbe);
                    assert_eq!(share, 1.0);
                }
            }
        }
    }
}

/// Catches self-occlusion at grazing angles: points on a floor and points a millimetre above its plane, 10 m away.
#[test]
fn grazing_rays_pass_along_a_floor_of_many_pieces() {
    let floor = polygon(&[v(0.0, 0.0, 0.0), v(10.0, 0.0, 0.0), v(10.0, 10.0, 0.0), v(0.0, 10.0, 0.0)]).unwrap();
    let mut polygons: Vec<Polygon> = Vec::new();
    for piece in quartered(&floor, 3) {
        let flipped = piece.corners.reversed();
        polygons.push(polygon(&piece.corners).unwrap());
        // Both windings: planes that differ in sign.
        polygons.push(polygon(&flipped).unwrap());
    }
    let step = polygon(&[v(10.0, 0.0, 0.0), v(10.0, 0.0, 0.001), v(10.0, 10.0, 0.001), v(10.0, 10.0, 0.0)]).unwrap();
    polygons.push(step);
    let scene = scene(polygons);
    let bsp = tree(&scene, InsertionOrder::AsGiven);
    let step = scene.polygons.last().unwrap();
    for piece in &quartered(&floor, 4) {
        if step.plane.distance(piece.corners.mean()) <= 0.0 {
            panic!("the step faces the floor");
        }
        let share = visibility(&bsp, &scene, &patch(piece), &patch(step), Rays::Sixteen, 1, &mut NoProbe);
        assert_eq!(share, 1.0);
    }
}

/// Catches a tolerance that is too large or none at all: in a room of 10 m, a wall of no thickness in contact with
/// floor, ceiling and side walls blocks every ray; a slit of 1 mm in it lets its share through.
#[test]
fn a_wall_without_thickness_blocks_and_a_gap_of_a_millimetre_is_open() {
    let room = cuboid(v(0.0, 0.0, 0.0), v(10.0, 10.0, 10.0), true);
    let wall = |low: f64, high: f64| vec![v(5.0, low, 0.0), v(5.0, high, 0.0), v(5.0, high, 10.0), v(5.0, low, 10.0)];
    let mut closed = room.clone();
    closed.push(wall(0.0, 10.0));
    let mut slit = room;
    slit.extend([wall(0.0, 5.0), wall(5.001, 10.0)]);
    for (faces, open) in [(closed, false), (slit, true)] {
        let scene = scene_of(&faces);
        for order in ORDERS {
            let bsp = tree(&scene, order);
            let (left, right) = (&scene.polygons[4], &scene.polygons[5]);
            let mut sum = 0.0;
            for (a, b) in quartered(left, 4).iter().zip(quartered(right, 4).iter().rev()) {
                for seed in 0..4 {
                    sum += visibility(&bsp, &scene, &patch(a), &patch(b), Rays::TwoHundredFiftySix, seed, &mut NoProbe);
                }
            }
            assert_eq!(sum > 0.0, open, "{order:?} {sum}");
            // A ray through the middle of the slit, at a right angle.
            let through = |y: f64| {
                let (from, to) = (v(0.0, y, 5.0), v(10.0, y, 5.0));
                let (p, q) = (left.plane, right.plane);
                bsp.transmittance(&scene, from, to, &p, &q, scene.tolerance(), &mut NoProbe)
            };
            assert_eq!(through(5.0005), if open { 1.0 } else { 0.0 });
            // A tenth of a millimetre inside of the slit's edges, and outside.
            assert_eq!([through(5.0001), through(5.0009)], if open { [1.0; 2] } else { [0.0; 2] });
            assert_eq!([through(4.9999), through(5.0011)], [0.0; 2]);
        }
    }
}

/// A furnished room, `factor` times as large.
fn scaled(factor: f64) -> Scene {
    let faces: Vec<Vec<DVec3>> = furnished_room()
        .polygons
        .iter()
        .map(|polygon| polygon.corners.iter().map(|&corner| corner * factor).collect())
        .collect();
    scene_of(&faces)
}

/// Catches a length that is not relative to the scene: the same visibilities in millimetres and kilometres, bit for bit
/// for powers of two (2^-10 and 2^10), up to 2 rays in 16,000 for 10^-3 and 10^3 (rounding may move a ray over an edge).
#[test]
fn visibility_is_free_of_scale() {
    let evaluate = |factor: f64| -> Vec<f64> {
        let scene = scaled(factor);
        let bsp = tree(&scene, InsertionOrder::AsGiven);
        let mut random = Random(21);
        (0..1000)
            .map(|seed| {
                let [a, b] = [0; 2].map(|_: i32| random.below(scene.fronts));
                let (a, b) = (patch(&scene.polygons[a]), patch(&scene.polygons[b]));
                visibility(&bsp, &scene, &a, &b, Rays::Sixteen, seed, &mut NoProbe)
            })
            .collect()
    };
    let metres = evaluate(1.0);
    assert!(metres.iter().filter(|&&share| share > 0.0 && share < 1.0).count() > 50);
    for factor in [1.0 / 1024.0, 1024.0] {
        assert_eq!(metres, evaluate(factor));
    }
    for factor in [1e-3, 1e3] {
        let difference: f64 = metres.iter().zip(evaluate(factor)).map(|(x, y)| (x - y).abs()).sum();
        assert!(difference <= 2.0 / 16.0, "{difference}");
    }
}

/// A closed mesh of triangles: a sphere's grid, bent out of shape so that no four corners share a plane.
fn closed_mesh(rings: usize, sectors: usize) -> Scene {
    let point = |i: usize, j: usize| {
        let (polar, around) = (
            std::f64::consts::PI * i as f64 / rings as f64,
            std::f64::consts::TAU * (j % sectors) as f64 / sectors as f64,
        );
        let radius = 1.0 + 0.2 * (3.0 * around).sin() * polar.sin() + 0.1 * (5.0 * polar).cos();
        // Poles are one point for all sectors.
        let ring = if i == 0 || i == rings { 0.0 } else { polar.sin() };
        v(radius * ring * around.cos(), radius * ring * around.sin(), radius_of_pole(i, rings, radius) * polar.cos())
    };
    let mut faces = Vec::new();
    for i in 0..rings {
        for j in 0..sectors {
            let (a, b, c, d) = (point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
            if i > 0 {
                faces.push(vec![a, b, d]);
            }
            if i + 1 < rings {
                faces.push(vec![b, c, d]);
            }
        }
    }
    scene_of(&faces)
}

/// The same radius for all sectors where they meet.
fn radius_of_pole(ring: usize, rings: usize, radius: f64) -> f64 {
    if ring == 0 || ring == rings { 1.0 } else { radius }
}

/// Catches leaks along shared edges and at shared corners, of polygons and of the fragments that they are cut into: a
/// million rays from inside closed meshes, aimed at edges, corners and fragments' corners, all hit; and a million
/// segments through them are all blocked.
#[test]
fn closed_meshes_are_watertight() {
    let boxes = scene_of(&turned(cuboid(v(-1.0, -1.0, -1.0), v(1.0, 1.0, 1.0), true), DVec3::ZERO, 0.4));
    for (scene, order) in [
        (closed_mesh(8, 12), InsertionOrder::AsGiven),
        (closed_mesh(8, 12), InsertionOrder::Random(3)),
        (boxes, InsertionOrder::AsGiven),
    ] {
        let bsp = tree(&scene, order);
        let mut random = Random(31);
        let far = scene.diameter;
        for k in 0..350_000_usize {
            let origin = random.point(DVec3::splat(-0.2), DVec3::splat(0.2));
            let target = if k.is_multiple_of(2) {
                let corners = &scene.polygons[random.below(scene.fronts)].corners;
                on_edge(corners, &mut random, k)
            } else {
                let fragment = &bsp.fragments()[random.below(bsp.fragments().len())];
                on_edge(&fragment.corners, &mut random, k)
            };
            let direction = (target - origin).normalize();
            let hit = bsp.closest_hit(&scene, origin, direction, f64::INFINITY, &mut NoProbe);
            assert!(hit.is_some(), "{origin} -> {target}");
            let away = Plane { normal: direction, offset: direction.dot(origin) };
            let end = origin + direction * far;
            let back = Plane { normal: -direction, offset: -direction.dot(end) };
            let passed = bsp.transmittance(&scene, origin, end, &away, &back, scene.tolerance(), &mut NoProbe);
            assert_eq!(passed, 0.0);
        }
    }
}

/// A corner (every fifth time) or a point of an edge.
fn on_edge(corners: &[DVec3], random: &mut Random, k: usize) -> DVec3 {
    let i = random.below(corners.len());
    let t = if k.is_multiple_of(5) { 0.0 } else { random.unit() };
    corners[i] + (corners[(i + 1) % corners.len()] - corners[i]) * t
}

/// D12. Catches masks and opacities that are ignored, counted twice (a polygon that is cut in many fragments) or told in the
/// wrong order.
#[test]
fn masks_and_opacity_let_light_pass() {
    let square = |z: f64| vec![v(0.0, 0.0, z), v(1.0, 0.0, z), v(1.0, 1.0, z), v(0.0, 1.0, z)];
    let mut top = square(1.0);
    top.reverse();
    // A cross of walls that cuts the panes into four fragments each.
    let walls = [
        vec![v(0.3, -1.0, 0.41), v(0.3, 2.0, 0.41), v(0.3, 2.0, 0.42), v(0.3, -1.0, 0.42)],
        vec![v(-1.0, 0.6, 0.41), v(2.0, 0.6, 0.41), v(2.0, 0.6, 0.42), v(-1.0, 0.6, 0.42)],
    ];
    let mut faces = walls.to_vec();
    faces.extend([square(0.0), top, square(0.25), square(0.75)]);
    let mut scene = scene_of(&faces);
    let (floor, ceiling, pane, screen) = (2, 3, 4, 5);
    scene.polygons[pane].opacity = 0.25;
    scene.polygons[screen].mask = Some(0);
    scene.polygons[screen].opacity = 0.5;
    scene.polygons[screen].uv = Some(UNIT_UV);
    // Solid where u < 1/2.
    scene.masks = vec![AlphaMask {
        width: 2,
        height: 1,
        solid: vec![true, false],
        cutoff: 0.5,
        wrap: [Wrap::Repeat, Wrap::Repeat],
    }];
    for order in ORDERS {
        let bsp = tree(&scene, order);
        let planes = [scene.polygons[floor].plane, scene.polygons[ceiling].plane];
        let passed = |x: f64, y: f64| {
            let (from, to) = (v(x, y, 0.0), v(x, y, 1.0));
            bsp.transmittance(&scene, from, to, &planes[0], &planes[1], scene.tolerance(), &mut NoProbe)
        };
        assert_eq!([passed(0.2, 0.5), passed(0.7, 0.5)], [0.0, 0.75]);
        // Along the lines where the panes are cut: once, not twice.
        assert_eq!([passed(0.7, 0.600_001), passed(0.7, 0.599_999)], [0.75; 2]);
        let (a, b) = (patch(&scene.polygons[floor]), patch(&scene.polygons[ceiling]));
        let mean = (0..400_u64)
            .map(|seed| visibility(&bsp, &scene, &a, &b, Rays::TwoHundredFiftySix, seed << 40, &mut NoProbe))
            .sum::<f64>()
            / 400.0;
        // Half of the rays at the screen's height, 3/4 of each; less 1 % or so for the walls' strips (0.01 high). The
        // deviation of the mean is below 0.125 / 4 / sqrt(400) = 0.0016.
        assert!((mean - 0.375).abs() < 0.015, "{mean}");
        // From below, in the open half: pane, then ceiling.
        let mut hits: Vec<(Hit, f64)> = Vec::new();
        bsp.for_each_hit(&scene, v(0.7, 0.3, 0.1), DVec3::Z, f64::INFINITY, &mut NoProbe, |hit, stopped| {
            hits.push((hit, stopped));
            ControlFlow::Continue(())
        });
        let found: Vec<(u32, f64, bool)> = hits.iter().map(|&(hit, s)| (hit.polygon, s, hit.front_facing)).collect();
        assert_eq!(found, [(pane as u32, 0.25, false), (ceiling as u32, 1.0, true)]);
        assert!((hits[0].0.distance - 0.15).abs() < 1e-15);
        // In the solid half the screen ends it, for the nearest hit too.
        let hit = bsp.closest_hit(&scene, v(0.2, 0.3, 0.5), DVec3::Z, 10.0, &mut NoProbe).unwrap();
        assert_eq!((hit.polygon, hit.front_facing), (screen as u32, false));
        let hit = bsp.closest_hit(&scene, v(0.7, 0.3, 0.5), DVec3::Z, 10.0, &mut NoProbe).unwrap();
        assert_eq!((hit.polygon, hit.front_facing), (ceiling as u32, true));
    }
}

/// Catches a seed that is ignored, or an order of arguments or of insertion that changes a result with the same seed.
#[test]
fn the_seed_alone_decides() {
    let square = |z: f64| vec![v(0.0, 0.0, z), v(0.5, 0.0, z), v(0.5, 0.5, z), v(0.0, 0.5, z)];
    let scene = between(vec![square(0.5)], false);
    let (a, b) = (patch(&scene.polygons[0]), patch(&scene.polygons[1]));
    let evaluate =
        |order, seed| visibility(&tree(&scene, order), &scene, &a, &b, Rays::Sixteen, seed, &mut NoProbe).to_bits();
    let shares: Vec<u64> = (0..50).map(|seed| evaluate(InsertionOrder::AsGiven, seed)).collect();
    assert_eq!(shares, (0..50).map(|seed| evaluate(InsertionOrder::Random(8), seed)).collect::<Vec<_>>());
    assert!(shares.iter().any(|share| *share != shares[0]));
    assert_eq!(InsertionOrder::Random(8).sequence(&scene), InsertionOrder::Random(8).sequence(&scene));
    let room = furnished_room();
    assert_ne!(InsertionOrder::Random(8).sequence(&room), InsertionOrder::Random(9).sequence(&room));
}

/// Catches a probe that is told less or more than what was done: 16 rays when a pair needs them, none when one polygon
/// settles it, and every ray of the paper's way.
#[test]
fn probes_are_told_what_was_done() {
    let square = |low: f64, high: f64| vec![v(low, low, 0.5), v(high, low, 0.5), v(high, high, 0.5), v(low, high, 0.5)];
    for (blocker, rays) in [(square(0.0, 0.5), 16), (square(-1.0, 2.0), 0)] {
        let scene = between(vec![blocker], false);
        let bsp = tree(&scene, InsertionOrder::AsGiven);
        let (a, b): (Patch, Patch) = (patch(&scene.polygons[0]), patch(&scene.polygons[1]));
        let mut counts = Counts::default();
        let beam = visibility(&bsp, &scene, &a, &b, Rays::Sixteen, 1, &mut counts);
        assert_eq!((counts.visibilities, counts.rays), (1, rays));
        assert!(counts.node_visits >= 1 && counts.node_visits <= 3 && counts.fragment_tests <= 3);
        let mut counts = Counts::default();
        let single = visibility_ray_by_ray(&bsp, &scene, &a, &b, Rays::Sixteen, 1, &mut counts);
        assert_eq!((counts.visibilities, counts.rays, beam), (1, 16, single));
        assert!(counts.node_visits >= 16);
    }
}

/// Catches a sight by single rays that is another number, or known in another way, than the solver's: pairs of a room
/// under the paper's settings; and rays that are left out of its counts because one polygon settles the pair.
#[test]
fn sights_by_single_rays_are_the_same() {
    let scene = furnished_room();
    let bsp = tree(&scene, InsertionOrder::AsGiven);
    let mut random = Random(5);
    let mut kinds = [0; 3];
    for seed in 0..20_000 {
        let mut draw = || {
            let mut part =
                scene.polygons[if random.below(3) == 0 { random.below(6) } else { random.below(scene.fronts) }].clone();
            for _ in 0..random.below(5) {
                part = quartered(&part, 1).swap_remove(random.below(4));
            }
            part
        };
        let (a, b) = (draw(), draw());
        let sampling = Sampling::from(Rays::Sixteen);
        let beam = sight(&bsp, &scene, &patch(&a), &patch(&b), sampling, seed, &mut Blocker::default(), &mut NoProbe);
        let mut counts = Counts::default();
        let single = sight_ray_by_ray(&bsp, &scene, &patch(&a), &patch(&b), sampling, seed, &mut counts);
        assert_eq!((beam.share.to_bits(), beam.proven), (single.share.to_bits(), single.proven));
        assert_eq!(counts.visibilities, 1);
        if beam.proven && beam.share == 1.0 {
            // As many as leave both fronts.
            assert!(counts.rays >= 1 && counts.node_visits >= counts.rays);
        }
        kinds[if beam.proven { usize::from(beam.share == 0.0) } else { 2 }] += 1;
    }
    // All three kinds were there: proven open, proven blocked, sampled.
    assert!(kinds.iter().all(|&count| count > 300), "{kinds:?}");
}

/// Catches an insertion that tells of fewer or more cuts than it makes: every fragment but the first of each polygon
/// comes of a split (of which one may leave three pieces), and each piece is held against at least one plane.
#[test]
fn insertions_tell_what_they_cut() {
    let square = |low: f64, high: f64| vec![v(low, low, 0.5), v(high, low, 0.5), v(high, high, 0.5), v(low, high, 0.5)];
    let wall = vec![v(0.5, -1.0, 0.0), v(0.5, 2.0, 0.0), v(0.5, 2.0, 1.0), v(0.5, -1.0, 1.0)];
    let scene = scene_of(&[wall, square(0.0, 0.4), square(0.2, 1.0)]);
    let mut bsp = Bsp::new(&scene);
    let told: Vec<(u64, u64)> = (0..3)
        .map(|polygon| {
            let mut counts = Counts::default();
            bsp.insert_counted(polygon, &scene.polygons[polygon as usize].corners, &mut counts);
            assert_eq!(counts, Counts { cuts: counts.cuts, splits: counts.splits, ..Counts::default() });
            (counts.cuts, counts.splits)
        })
        .collect();
    // The wall is the root; the first square lies on one side; the second is cut, and its one half meets the first
    // square.
    assert_eq!(told, [(0, 0), (1, 0), (2, 1)]);
}

/// Catches an order that leaves polygons out or names some twice, and a tree that cuts what it need not: of two
/// crossing walls and a row of squares on one side of both, only the walls cut each other, whatever the order in the
/// file.
#[test]
fn fewest_cuts_leaves_the_squares_whole() {
    let wall = |turned: bool| {
        let at = |s: f64, z: f64| if turned { v(0.0, s, z) } else { v(s, 0.0, z) };
        vec![at(-2.0, -1.0), at(2.0, -1.0), at(2.0, 1.0), at(-2.0, 1.0)]
    };
    // Planes of the squares cut both walls.
    let square = |k: i32| {
        let z = 0.1 * f64::from(k);
        vec![v(0.5, 0.5, z), v(1.0, 0.5, z), v(1.0, 1.0, z), v(0.5, 1.0, z)]
    };
    for first in [true, false] {
        let mut faces: Vec<Vec<DVec3>> = (0..5).map(square).collect();
        faces.splice(if first { 0..0 } else { 5..5 }, [wall(false), wall(true)]);
        let scene = scene_of(&faces);
        let mut sequence = InsertionOrder::FewestCuts.sequence(&scene);
        assert_eq!(tree(&scene, InsertionOrder::FewestCuts).fragments().len(), 8);
        sequence.sort_unstable();
        assert_eq!(sequence, (0..7).collect::<Vec<u32>>());
    }
}

/// Catches recursion: a tree that is one chain of 20,000 nodes, built, checked and walked on a stack of 64 KiB.
#[test]
fn a_chain_of_nodes_needs_no_stack() {
    let faces: Vec<Vec<DVec3>> = (0..20_000)
        .map(|k| {
            let z = 0.001 * f64::from(k);
            vec![v(0.0, 0.0, z), v(1.0, 0.0, z), v(1.0, 1.0, z), v(0.0, 1.0, z)]
        })
        .collect();
    let scene = scene_of(&faces);
    let walk = move || {
        let bsp = tree(&scene, InsertionOrder::AsGiven);
        assert_eq!(bsp.nodes().len(), scene.fronts);
        let up = bsp.closest_hit(&scene, v(0.5, 0.5, -1.0), DVec3::Z, 100.0, &mut NoProbe).unwrap();
        let down = bsp.closest_hit(&scene, v(0.5, 0.5, 30.0), DVec3::NEG_Z, 100.0, &mut NoProbe).unwrap();
        assert_eq!((up.polygon, down.polygon), (0, 19_999));
    };
    std::thread::Builder::new().stack_size(64 * 1024).spawn(walk).unwrap().join().unwrap();
}
