//! Lamps without a surface in the schedule `wavefront`: light against formulas, shadows, energy, groups, and what is refused.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{difference, draft, irradiances, paper, points, scene, solved};
use isolux::core::DVec3;
use isolux::core::sampling::Stream;
use isolux::core::scene::{Lamp, LampShape, Scene, SceneInput};
use isolux::core::solution::Unobserved;
use isolux::core::units::Rgb;
use isolux::{Changes, NO_GROUP, Settings, Solution, Status, light_groups, solve};
use isolux_wavefront::FinalGather;

fn asked(error: f64) -> Settings {
    Settings { error, ..draft() }
}

fn lamp(name: &str, position: DVec3, forward: DVec3, intensity: f64, shape: LampShape) -> Lamp {
    let side = forward.any_orthonormal_vector();
    Lamp { name: name.into(), position, forward, side, intensity: Rgb::splat(intensity), shape }
}

fn point(name: &str, position: DVec3, intensity: f64) -> Lamp {
    lamp(name, position, DVec3::NEG_Y, intensity, LampShape::Point)
}

fn sun(forward: DVec3, irradiance: f64) -> Lamp {
    lamp("sun", DVec3::ZERO, forward, irradiance, LampShape::Parallel)
}

/// A floor of 4 x 4 that reflects a half.
fn floor() -> SceneInput {
    let mut input = empty();
    let (object, paint) = (input.object("floor"), input.material("paint", grey(0.5, 0.0)));
    input.face(object, paint, &[v(-2.0, 0.0, -2.0), v(-2.0, 0.0, 2.0), v(2.0, 0.0, 2.0), v(2.0, 0.0, -2.0)]);
    input
}

/// Where points of faces are, and which way they look.
fn places(scene: &Scene, points: &[(u32, [f64; 3])]) -> Vec<(DVec3, DVec3)> {
    let place = |&(face, [a, b, c]): &(u32, [f64; 3])| {
        let [p, q, r] = scene.triangles[face as usize];
        (p * a + q * b + r * c, (q - p).cross(r - p).normalize())
    };
    points.iter().map(place).collect()
}

/// What the lamps of a scene throw on a place that nothing hides.
fn formula(scene: &Scene, (place, normal): (DVec3, DVec3)) -> f64 {
    let thrown = scene.lamps.iter().filter_map(|lamp| lamp.thrown_on(place));
    thrown.map(|thrown| thrown.facing.mean() * thrown.towards.dot(normal).max(0.0)).sum()
}

fn claimed(solution: &Solution) -> f64 {
    solution.report().error_estimate.unwrap().total
}

/// Claims and truths within a factor of two, or a claim below a tenth of what was asked.
fn is_honest(solution: &Solution, off: f64) -> bool {
    let claimed = claimed(solution);
    (off <= 2.0 * claimed && claimed <= 2.0 * off) || claimed.max(off) < 0.1 * solution.report().settings.error
}

fn down() -> DVec3 {
    v(0.2, -1.0, 0.1).normalize()
}

/// Catches a wrong square, cosine, cone or sign; edges of cones that leaves do not see: an open floor has what formulas say.
#[test]
fn a_floor_gets_what_the_formula_says() {
    let cone = |inner| LampShape::Spot { inner, outer: 0.6 };
    let lamps = [
        point("bulb", v(0.3, 1.0, 0.2), 100.0),
        lamp("spot", v(0.3, 1.5, 0.2), down(), 100.0, cone(0.3)),
        lamp("spot without a rim", v(0.3, 1.5, 0.2), down(), 100.0, cone(0.5999)),
        sun(v(0.3, -1.0, 0.4).normalize(), 100.0),
    ];
    for lamp in lamps {
        let name = lamp.name.clone();
        let scene = scene(SceneInput { lamps: vec![lamp], ..floor() });
        for error in [0.05, 0.01] {
            let solution = solved(&scene, &asked(error));
            assert_eq!(solution.report().status, Status::Converged, "{name}");
            // Edges of light are thin: fewer points miss them.
            let at = points(&scene, 400_000, 3);
            let exact: Vec<f64> = places(&scene, &at).into_iter().map(|place| formula(&scene, place)).collect();
            let off = difference(&exact, &irradiances(&solution, &at));
            assert!(off <= error, "{name}: {off} of {error}, claimed {}", claimed(&solution));
            assert!(is_honest(&solution, off), "{name}: {off}, claimed {}", claimed(&solution));
        }
    }
}

/// Catches luminaires whose light comes out elsewhere than their files say: under a floodlight of each type, tilted and
/// turned, the floor has intensity by cosine and squared distance, and never more flux than the file.
#[test]
fn luminaires_light_as_their_files_say() {
    for name in ["type-a.ies", "type-b.ies", "type-c.ies", "isym2.ldt"] {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../photometry/tests/files");
        let luminaire = isolux::photometry::read(&folder.join(name)).unwrap();
        let forward = v(0.3, -1.0, -0.2).normalize();
        let side = v(0.4, 0.0, 0.6).normalize();
        let side = side.reject_from_normalized(forward).normalize();
        let shape = LampShape::Web(isolux::formats::read::luminaire::web(&luminaire, false));
        let (position, intensity) = (v(0.2, 1.3, -0.1), Rgb::splat(1.0));
        let hung = Lamp { name: name.into(), position, forward, side, intensity, shape };
        let scene = scene(SceneInput { lamps: vec![hung], ..floor() });
        let solution = solved(&scene, &asked(0.02));
        assert_eq!(solution.report().status, Status::Converged, "{name}");
        // The luminaire's own frame: +X is `side`, -Z is `forward`, and +Y makes it right-handed.
        let up = side.cross(forward);
        let wanted = |&(place, normal): &(DVec3, DVec3)| {
            let from = place - position;
            let own = [from.dot(side), from.dot(up), -from.dot(forward)];
            luminaire.intensity(own) * (-from).dot(normal) / from.length().powi(3)
        };
        let at = points(&scene, 100_000, 3);
        let exact: Vec<f64> = places(&scene, &at).iter().map(wanted).collect();
        let off = difference(&exact, &irradiances(&solution, &at));
        assert!(off <= 0.02, "{name}: {off}, claimed {}", claimed(&solution));
        let arrived = exact.iter().sum::<f64>() / exact.len() as f64 * scene.area();
        assert!(arrived > 0.1 * luminaire.flux() && arrived < luminaire.flux(), "{name}: {arrived}");
        assert!((scene.lamp_power()[0] / luminaire.flux() - 1.0).abs() < 0.005, "{name}");
    }
}

/// Catches light inside a shadow, shadows of the wrong size, and claims that forget edges: a plate halfway between a lamp and a
/// floor throws a shadow of twice its size, under the zenith one of its own.
#[test]
fn a_plate_throws_a_shadow() {
    for (lamp, half) in [(point("bulb", v(0.0, 1.0, 0.0), 100.0), 0.66), (sun(DVec3::NEG_Y, 100.0), 0.33)] {
        let mut input = floor();
        let (plate, black) = (input.object("plate"), input.material("black", grey(0.0, 0.0)));
        let (y, own) = (0.5, 0.33);
        input.face(plate, black, &[v(-own, y, -own), v(-own, y, own), v(own, y, own), v(own, y, -own)]);
        input.lamps.push(lamp);
        let scene = scene(input);
        let distance = |place: DVec3| place.x.abs().max(place.z.abs());
        for error in [0.05, 0.01] {
            let solution = solved(&scene, &asked(error));
            let at = points(&scene, 400_000, 3);
            let places = places(&scene, &at);
            let exact = |&(place, normal): &(DVec3, DVec3)| {
                let is_hidden = place.y == 0.0 && distance(place) < half;
                if is_hidden { 0.0 } else { formula(&scene, (place, normal)) }
            };
            let exact: Vec<f64> = places.iter().map(exact).collect();
            let found = irradiances(&solution, &at);
            let off = difference(&exact, &found);
            assert!(off <= error, "{off} of {error}");
            assert!(is_honest(&solution, off), "{off}, claimed {}", claimed(&solution));
            let inside =
                places.iter().zip(&found).filter(|((place, _), _)| place.y == 0.0 && distance(*place) < half - 0.05);
            assert!(inside.map(|(_, &value)| value).fold(0.0, f64::max) < 1e-6);
        }
    }
}

/// Catches lamps' light that is lost or counted twice on its way over links: in a closed box the mean irradiance is what is
/// thrown, by the area, over one less the reflectance, and all of it ends as heat.
#[test]
fn a_closed_box_holds_its_light() {
    let rho = 0.5;
    let mut input = empty();
    let (walls, paint) = (input.object("walls"), input.material("paint", grey(rho, 0.0)));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(2.0, 1.0, 1.5));
    input.lamps.push(point("bulb", v(1.0, 0.5, 0.75), 100.0));
    let scene = scene(input);
    let solution = solved(&scene, &asked(0.01));
    let power = 400.0 * std::f64::consts::PI;
    let mean = solution.report().mean_irradiance.mean();
    assert!((mean * scene.area() * (1.0 - rho) / power - 1.0).abs() < 0.01, "{mean}");
    let energy = solution.report().energy.unwrap();
    assert!((energy.emitted[0] / power - 1.0).abs() < 0.002, "{energy:?}");
    assert!(energy.imbalance.abs() < 0.01, "{energy:?}");
}

fn room(lamps: Vec<Lamp>) -> SceneInput {
    let mut input = empty();
    let (walls, paint) = (input.object("walls"), input.material("paint", grey(0.7, 0.0)));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(2.0, 1.0, 1.5));
    let block = input.object("block");
    input.outside_of_box(block, paint, v(1.2, 0.0, 0.5), v(1.6, 0.4, 1.0));
    input.lamps = lamps;
    input
}

/// Catches errors that are not followed as they are reflected again and again, and solves that give up on them: a closed room has
/// 1 / (1 - ρ) times the light of its lamp on average.
#[test]
fn bright_rooms_are_as_bright_as_they_claim() {
    let reflectance = 0.9;
    let mut input = empty();
    let (walls, paint) = (input.object("walls"), input.material("paint", grey(reflectance, 0.0)));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(4.0, 4.0, 4.0));
    input.lamps = vec![point("lamp", v(2.0, 2.0, 2.0), 1.0)];
    let solution = solved(&scene(input), &asked(0.01));
    assert_eq!(solution.report().status, Status::Converged);
    let all = irradiances(&solution, &points(solution.scene(), 50_000, 7));
    let direct = 4.0 * std::f64::consts::PI / 96.0;
    let off = all.iter().sum::<f64>() / all.len() as f64 * (1.0 - reflectance) / direct - 1.0;
    // Measured over four seeds: 0.92 to 1.01 of the claim, 0.0042 to 0.0083.
    assert!(off.abs() <= 1.1 * claimed(&solution) && off.abs() <= 0.01, "{off} {}", claimed(&solution));
}

/// A ball of radius 1 as triangles: an octahedron whose faces are quartered so many times.
fn ball(times: u32) -> Vec<[DVec3; 3]> {
    let mut faces: Vec<[DVec3; 3]> = Vec::new();
    for (x, y, z) in
        [(1, 1, 1), (1, 1, -1), (1, -1, 1), (1, -1, -1), (-1, 1, 1), (-1, 1, -1), (-1, -1, 1), (-1, -1, -1)]
    {
        let [a, b, c] = [DVec3::X * f64::from(x), DVec3::Y * f64::from(y), DVec3::Z * f64::from(z)];
        faces.push(if x * y * z > 0 { [a, b, c] } else { [a, c, b] });
    }
    for _ in 0..times {
        let quarters = |&[a, b, c]: &[DVec3; 3]| {
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
        };
        faces = faces.iter().flat_map(quarters).collect();
    }
    faces
}

/// Catches a lamp that is not as bright as its candela say: a ball of 4 mm with as many lumens lights a room alike.
#[test]
fn a_point_is_a_tiny_bulb() {
    let middle = v(0.7, 0.6, 0.75);
    let of_point = scene(room(vec![point("bulb", middle, 100.0)]));
    let mut input = room(vec![]);
    let (bulb, faces, radius) = (input.object("bulb"), ball(3), 0.002);
    let area: f64 = faces.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length() * radius * radius).sum();
    let glow = input.material("glow", grey(0.0, 400.0 * std::f64::consts::PI / area));
    for face in faces {
        input.face(bulb, glow, &face.map(|corner| middle + corner * radius));
    }
    let of_ball = scene(input);
    let (one, two) = (solved(&of_point, &asked(0.01)), solved(&of_ball, &asked(0.01)));
    let [own, other] = [&one, &two].map(|solution| solution.report().mean_irradiance.mean());
    assert!((own / other - 1.0).abs() < 0.005, "{own} {other}");
    let at = points(&of_point, 50_000, 3);
    let off = difference(&irradiances(&one, &at), &irradiances(&two, &at));
    // Measured 0.0088, where both claim 0.0067: 0.0095 together.
    assert!(off < 0.01, "{off}");
}

/// Catches sun that passes walls or misses a window: its patch is the window's, thrown along the light.
#[test]
fn sun_falls_through_a_window() {
    let mut input = empty();
    let (walls, paint) = (input.object("walls"), input.material("paint", grey(0.6, 0.0)));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(4.0, 3.0, 4.0));
    // The wall at x = 0 in parts around a window of z from 1.3 to 2.3 and y from 1.1 to 2.2.
    input.faces.remove(0);
    let part = |low: (f64, f64), high: (f64, f64)| {
        [v(0.0, low.0, low.1), v(0.0, high.0, low.1), v(0.0, high.0, high.1), v(0.0, low.0, high.1)]
    };
    for (low, high) in
        [((0.0, 0.0), (1.1, 4.0)), ((2.2, 0.0), (3.0, 4.0)), ((1.1, 0.0), (2.2, 1.3)), ((1.1, 2.3), (2.2, 4.0))]
    {
        input.face(walls, paint, &part(low, high));
    }
    let forward = v(1.0, -1.0, 0.25).normalize();
    input.lamps.push(sun(forward, 1000.0));
    let scene = scene(input);
    let solution = solved(&scene, &asked(0.05));
    assert_eq!(
        solution.report().status,
        Status::Converged,
        "{:?} {:?}",
        solution.report().error_estimate,
        solution.report().stages
    );
    let direct = 1000.0 * -forward.y;
    let at = points(&scene, 200_000, 3);
    let found = irradiances(&solution, &at);
    let (mut lit, mut dark) = (Vec::new(), Vec::new());
    for ((place, normal), value) in places(&scene, &at).into_iter().zip(found).filter(|((_, n), _)| n.y > 0.5) {
        assert!(place.y.abs() < 1e-9 && normal.y > 0.5);
        // Back along the light to the wall at x = 0.
        let (y, z) = (place.x, place.z - 0.25 * place.x);
        let within = (y - 1.1).min(2.2 - y).min(z - 1.3).min(2.3 - z);
        // Leaves along the border are up to some centimetres large.
        if within > 0.05 {
            lit.push(value);
        } else if within < -0.05 {
            dark.push(value);
        }
    }
    let least = lit.iter().copied().fold(f64::INFINITY, f64::min);
    let most = dark.iter().copied().fold(0.0, f64::max);
    assert!(lit.len() > 1000 && dark.len() > 1000);
    assert!(least > direct && most < 0.3 * direct, "{least} {most} {direct}");
    assert!(solution.report().energy.unwrap().imbalance.abs() < 0.01);
}

fn two_lamps(one: f64, two: f64) -> Vec<Lamp> {
    let other = lamp(
        "spot",
        v(1.5, 0.9, 1.2),
        v(-0.5, -1.0, -0.5).normalize(),
        two,
        LampShape::Spot { inner: 0.2, outer: 0.8 },
    );
    vec![point("bulb", v(0.7, 0.6, 0.75), one), other]
}

/// Catches groups that lose lamps or their power, columns that are not of their own lamp, and relit scenes whose lamps, hash or
/// rays stay what they were: one lamp dimmed is what a solve of the dimmed scene gives.
#[test]
fn lamps_are_dimmed_by_name() {
    let solution = solved(&scene(room(two_lamps(100.0, 300.0))), &asked(0.02));
    let groups = &solution.report().groups.as_ref().unwrap().groups;
    assert_eq!(
        groups.iter().map(|group| (group.name.as_str(), group.lamps)).collect::<Vec<_>>(),
        [("bulb", 1), ("spot", 1)]
    );
    assert!((groups[0].power[0] - 400.0 * std::f64::consts::PI).abs() < 1e-9);
    let back = Solution::from_record(solution.to_record()).unwrap();
    back.check().unwrap();
    assert_eq!(back.scene().lamps, solution.scene().lamps);
    for (one, two) in [(0.0, 1.0), (1.0, 0.2)] {
        let weights = vec![("bulb".to_owned(), [one; 3]), ("spot".to_owned(), [two; 3])];
        let changes = Changes { weights, ..Changes::default() };
        let relit = back.relight(&changes).unwrap();
        relit.check().unwrap();
        assert_eq!(relit.scene().lamps[1].intensity, Rgb::splat(300.0 * two));
        let own = solved(&scene(room(two_lamps(100.0 * one, 300.0 * two))), &asked(0.02));
        let at = points(solution.scene(), 50_000, 5);
        let off = difference(&irradiances(&own, &at), &irradiances(&relit, &at));
        // What a mix claims hangs on few points on edges of shadows: over five seeds the two differ by 0.2 to 1.06 of both claims.
        assert!(off <= 1.1 * (claimed(&relit) + claimed(&own)), "{off}: {} {}", claimed(&relit), claimed(&own));
    }
}

/// Catches a lamp and an object of one name that are dimmed apart.
#[test]
fn an_object_and_its_lamp_are_one_group() {
    let mut input = room(vec![point("bulb", v(0.7, 0.6, 0.75), 1.0)]);
    let (object, glow) = (input.object("bulb"), input.material("glow", grey(0.0, 1.0)));
    input.outside_of_box(object, glow, v(0.6, 0.9, 0.7), v(0.8, 1.0, 0.8));
    let found = light_groups(&scene(input));
    let [group] = &found.groups[..] else { panic!("{:?}", found.groups) };
    assert_eq!((group.name.as_str(), group.polygons, group.lamps), ("bulb", 6, 1));
    assert!(found.of.iter().all(|&row| row == 0 || row == NO_GROUP) && found.of.last() == Some(&0));
}

/// Catches an order of work that gets into results.
#[test]
fn threads_change_no_bit() {
    let scene = scene(room(two_lamps(100.0, 300.0)));
    let of = |threads| solved(&scene, &Settings { threads, ..asked(0.1) }).transport().unwrap().fields.clone();
    let one = of(1);
    assert!(one == of(2) && one == of(3));
}

/// Catches a final gather that leaves out lamps, or that has no sharp shadows: at points it is the formula, and what the solve
/// says is reflected.
#[test]
fn a_final_gather_sees_lamps() {
    let scene = scene(SceneInput { lamps: vec![point("bulb", v(0.3, 1.0, 0.2), 100.0)], ..floor() });
    let solution = solved(&scene, &asked(0.2));
    let gather = FinalGather::new(solution.tracer(), 16, 1);
    for place in [v(0.0, 0.0, 0.0), v(1.5, 0.0, -1.0)] {
        let mut stream = Stream::new(1);
        let found = gather.irradiance(place, 0, 0, &mut stream, &|_, _| Rgb::ZERO);
        assert!((found.mean() / formula(&scene, (place, DVec3::Y)) - 1.0).abs() < 1e-5, "{found:?}");
    }
}

/// Catches a schedule that solves for surfaces alone, in silence, and lamps that light nothing taken for a failure.
#[test]
fn what_cannot_be_lit_is_said() {
    let lit = scene(room(two_lamps(100.0, 300.0)));
    let error = solve(lit, &paper(), &mut Unobserved).unwrap_err();
    assert!(error.to_string().contains("lamp 'bulb' has no surface"), "{error}");
    // The lamp is below the floor, whose back is black.
    let dark = scene(SceneInput { lamps: vec![point("bulb", v(0.0, -1.0, 0.0), 100.0)], ..floor() });
    let solution = solved(&dark, &asked(0.05));
    assert_eq!((solution.report().status, solution.report().mean_irradiance), (Status::Converged, Rgb::ZERO));
}
