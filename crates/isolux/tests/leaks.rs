//! Light stays where it belongs: nothing gets through a wall of no thickness, and what lies beside something thin is lit.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, grey, v};
use common::{draft, irradiances, lit_box, path_ends, points, scene, shipped, solved};
use isolux::core::DVec3;
use isolux::{Settings, Solution};

fn asked(error: f64) -> Settings {
    Settings { error, ..draft() }
}

/// Mean over bands of the irradiance at a point, whose face is looked for among those that face up or down.
fn irradiance_above(solution: &Solution, point: DVec3) -> f64 {
    let scene = solution.scene();
    let found = scene.triangles.iter().enumerate().find_map(|(face, &[a, b, c])| {
        let normal = (b - a).cross(c - a);
        let area = normal.length();
        let unit = normal / area;
        let of = |p: DVec3, q: DVec3| unit.dot((p - point).cross(q - point)) / area;
        let (first, second, third) = (of(b, c), of(c, a), of(a, b));
        let inside = first >= 0.0 && second >= 0.0 && third >= 0.0 && unit.dot(point - a).abs() < 1e-6;
        (inside && unit.y.abs() > 0.9).then_some((face as u32, [first, second, third]))
    });
    let (face, at) = found.unwrap();
    solution.irradiance_at(face, at).unwrap().mean()
}

/// Catches light that gets into the half behind a wall of no thickness, by an element, a link or a cluster on both
/// sides. One seed tells little: of 48 at an asked 5 % leaks are 0.0001 to 0.018 of the mean, of 24 at 2 % 0.0001 to
/// 0.0012.
#[test]
fn it_is_dark_behind_a_wall_of_no_thickness() {
    let scene = shipped("leaks/thin_wall");
    let all = points(&scene, 4000, 5);
    // At 5 % a fifth of what was asked, over half of all surfaces 2 % of its square; at 2 %, where elements are split
    // along the wall's foot, a twentieth. Means are 0.0043 over 48 seeds, 0.0027 to 0.0069 over each eight of them, and
    // 0.00029 over 24, 0.0002 to 0.0005 over each eight.
    for (error, seeds, most) in [(0.05, 6, 0.2), (0.02, 4, 0.05)] {
        let leak = |seed: u64| {
            let solution = solved(&scene, &Settings { seed, ..asked(error) });
            let (mut square, mut count, mut sum) = (0.0, 0.0, 0.0);
            for &(face, at) in &all {
                let value = solution.irradiance_at(face, at).unwrap().mean();
                sum += value;
                if scene.position(face, at).x > 2.0 {
                    square += value * value;
                    count += 1.0;
                }
            }
            let mean = sum / all.len() as f64;
            f64::sqrt(square / count) / mean
        };
        let mean = (0..seeds).map(leak).sum::<f64>() / seeds as f64;
        // Measured 0.0029 and 0.0005.
        assert!(mean < most * error, "{error}: {mean}");
    }
}

/// Catches the darkness under something that spreads over what lies beside it: 4 cm from the rug's edge the floor has what
/// it has half a metre away, to 15 %. At an asked 10 % it has a third less.
#[test]
fn the_floor_beside_a_rug_is_lit() {
    let solution = solved(&shipped("room"), &asked(0.05));
    for x in [1.5, 1.8, 2.1, 2.4] {
        let beside = irradiance_above(&solution, DVec3::new(x, 0.0, 3.09));
        let away = irradiance_above(&solution, DVec3::new(x, 0.0, 3.55));
        assert!((beside / away - 1.0).abs() < 0.15, "{x}: {beside} {away}");
    }
}

/// Catches links that are lost where the plane of a wall cuts through a floor's element, of which no part sees the wall from
/// where rays start: 6 cm beside the foot of the gallery's second partition, which is turquoise, most of what it reflects was
/// missing, a seventh of all blue. The path-traced value is that of a point of `benches/references/gallery.npz`.
#[test]
fn the_floor_beside_a_wall_has_the_walls_light() {
    let solution = solved(&shipped("gallery"), &asked(0.05));
    let found = irradiance_above(&solution, DVec3::new(6.1757, 0.0, 5.46));
    let traced = (49.70 + 93.32 + 171.02) / 3.0;
    // Measured 0.028, and 0.14 where links were lost.
    assert!((found / traced - 1.0).abs() < 0.05, "{found} {traced}");
}

/// Catches penumbras whose slopes leaves lose, or that chance makes: on the floor of the Cornell box, in the tall block's
/// shadow. Path-traced values of points of `benches/references/cornell.npz`, known to half a per cent.
#[test]
fn a_penumbra_has_its_slopes() {
    const SEEDS: u64 = 4;
    let all: Vec<Solution> =
        (0..SEEDS).map(|seed| solved(&shipped("cornell"), &Settings { seed, ..asked(0.02) })).collect();
    for (x, z, traced) in
        [(2.4977, 3.8765, 0.4865), (2.5773, 3.8087, 0.4658), (2.6632, 3.7879, 0.4448), (2.7370, 3.9719, 0.4309)]
    {
        let sum: f64 = all.iter().map(|solution| irradiance_above(solution, DVec3::new(x, 0.0, z))).sum();
        let found = sum / SEEDS as f64;
        // Measured 0.025 at most, a hundredth of the mean, and 0.082 where leaves took visibility for flatter than links do.
        assert!((found / traced - 1.0).abs() < 0.03, "{x}: {found} {traced}");
    }
}

/// Catches light that is lost at the foot of a wall where the floor's element lies mostly below what the wall belongs to: the
/// short block's side, a tenth of a millimetre above the floor. The path-traced value is that of a point of
/// `benches/references/cornell.npz`, the largest of three bands.
#[test]
fn the_foot_of_a_block_sees_the_floor() {
    let solution = solved(&shipped("cornell"), &asked(0.01));
    let (first, second) = (0.638_660_2, 5.210_425e-5);
    let found = solution.irradiance_at(21, [first, second, 1.0 - first - second]).unwrap()[0];
    // Measured 0.02; 0.54 where a visibility that no ray told was taken for a half.
    assert!((found / 0.5217 - 1.0).abs() < 0.05, "{found}");
}

/// Catches light below what stands on something: under a plate on the floor it is dark, beside it not.
#[test]
fn it_is_dark_under_a_plate() {
    let solution = solved(&shipped("leaks/contact"), &asked(0.05));
    let under = irradiance_above(&solution, DVec3::new(3.25, 0.0, 0.8));
    let beside = irradiance_above(&solution, DVec3::new(3.25, 0.0, 1.3));
    assert!(under < 1e-6 * beside, "{under} {beside}");
}

/// Catches light below what rests on a table, and darkness beside it: the table is one polygon, most of it open.
#[test]
fn it_is_dark_under_a_box_on_a_table() {
    let solution = solved(&shipped("leaks/contact"), &asked(0.02));
    let on_table = |x: f64| irradiance_above(&solution, DVec3::new(x, 0.72, 1.3));
    let beside = on_table(1.55);
    // The box stands from x = 1.7 on: 2 cm from its foot, in the middle, 2 cm before its other side.
    for x in [1.72, 1.95, 2.18] {
        assert!(on_table(x) < 1e-6 * beside, "{x}: {} {beside}", on_table(x));
    }
    // What the box hides it reflects in part.
    assert!((on_table(1.68) / beside - 1.0).abs() < 0.15, "{} {beside}", on_table(1.68));
}

/// Catches light that gets in beside a slit, and a slit that is overlooked: through one of 4 cm as much light gets into the
/// other half as paths of light say that know neither elements nor links.
#[test]
fn as_much_light_gets_through_a_slit_as_paths_say() {
    const PATHS: usize = 200_000;
    let scene = shipped("leaks/slit");
    let ends = path_ends(&scene, PATHS);
    let through = ends.iter().flatten().filter(|end| end.x > 2.0).count() as f64 / PATHS as f64;
    let all = points(&scene, 40_000, 5);
    for error in [0.1, 0.05, 0.02] {
        let solution = solved(&scene, &asked(error));
        let (mut sum, mut behind, mut count) = (0.0, 0.0, 0.0);
        for &(face, at) in &all {
            let polygon = &scene.polygons[scene.face_polygon[face as usize] as usize];
            let kept = polygon.absorptance()[1] * solution.irradiance_at(face, at).unwrap()[1];
            sum += kept;
            if scene.position(face, at).x > 2.0 {
                behind += kept;
                count += 1.0;
            }
        }
        // An RMS error e of all surfaces is a mean error of e / sqrt(s) at most on a share s of them: e sqrt(s) of all light.
        let most = error * (count / all.len() as f64).sqrt();
        // Measured 0.0147, 0.0077 and 0.0076 of all light, 0.0072 by paths.
        assert!((behind / sum - through).abs() < most, "{error}: {} {through}", behind / sum);
        assert!(behind / sum > 0.5 * through, "{error}: {} {through}", behind / sum);
    }
}

/// Catches light that gets from one closed room into the next, through a wall of no thickness between floors of their own.
#[test]
fn it_is_dark_in_a_room_without_a_lamp() {
    let mut input = lit_box(0.8);
    let (walls, paint) = (input.object("dark walls"), input.material("dark paint", grey(0.8, 0.0)));
    input.inside_of_box(walls, paint, v(2.0, 0.0, 0.0), v(4.0, 1.0, 1.5));
    let scene = scene(input);
    let all = points(&scene, 4000, 5);
    let object = scene.objects.iter().position(|object| object.name == "dark walls").unwrap() as u32;
    let is_dark = |face: u32| scene.polygons[scene.face_polygon[face as usize] as usize].object == object;
    for error in [0.2, 0.1, 0.05, 0.02] {
        let solution = solved(&scene, &asked(error));
        let lit = irradiances(&solution, &all);
        let mean = lit.iter().sum::<f64>() / lit.len() as f64;
        let dark: Vec<f64> =
            all.iter().zip(&lit).filter(|((face, _), _)| is_dark(*face)).map(|(_, lit)| lit * lit).collect();
        let leak = (dark.iter().sum::<f64>() / dark.len() as f64).sqrt();
        // Half of all surfaces may be off by 1.4 of what was asked for; where no light gets at all it is a hundredth of what
        // was asked for at most. Measured 8e-5, 5e-6, 5e-12, 7e-5.
        assert!(leak < 0.01 * error * mean, "{error}: {}", leak / mean);
    }
}
