//! Light of the sky in the schedule `wavefront`: against closed forms and sums over directions, through windows, by groups, and what
//! is refused.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{difference, draft, irradiances, paper, points, scene, solved};
use isolux::core::DVec3;
use isolux::core::sampling::Stream;
use isolux::core::scene::{Alpha, BuildOptions, Lamp, LampShape, Scene, SceneInput, Sky, SkyPattern};
use isolux::core::solution::Unobserved;
use isolux::core::units::Rgb;
use isolux::{Changes, RenderSettings, Settings, Solution, Status, View, light_groups, render, solve};
use isolux_wavefront::{FinalGather, Receiver};
use std::f64::consts::PI;

const HORIZONTAL: f64 = 10_000.0;

fn asked(error: f64) -> Settings {
    Settings { error, ..draft() }
}

/// A sun 40 degrees high, towards +x and a little +z.
fn to_sun() -> DVec3 {
    let height = 40.0_f64.to_radians();
    DVec3::new(height.cos() * 0.9_f64.cos(), height.sin(), height.cos() * 0.9_f64.sin())
}

fn sky(pattern: SkyPattern, ground: f64) -> Option<Sky> {
    Some(Sky::by_horizontal(pattern, to_sun(), Rgb::splat(HORIZONTAL), Rgb::splat(ground)))
}

fn cie(number: usize) -> SkyPattern {
    SkyPattern::cie(number).unwrap()
}

/// A clear sky of the all-weather model: bin 7 of clearness, the sun 40 degrees high.
fn perez() -> SkyPattern {
    SkyPattern { gradation: [-0.98, -0.42, 0.0], indicatrix: [1.0, 15.3, -3.95, 0.55] }
}

/// A square of 2 x 2 in the plane through a point with a normal.
fn plate(input: &mut SceneInput, name: &str, middle: DVec3, normal: DVec3, reflectance: f64) {
    let (one, other) = normal.any_orthonormal_pair();
    let (object, paint) = (input.object(name), input.material(name, grey(reflectance, 0.0)));
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]| middle + one * a + other * b);
    input.face(object, paint, &corners);
}

/// What a sky throws on a side that nothing hides, by a sum over directions: `count` rings of equal height and as many turns.
fn thrown(sky: &Sky, normal: DVec3, count: u32) -> f64 {
    let mut sum = 0.0;
    let ground = sky.ground_by_sky().mean();
    for ring in 0..2 * count {
        let height = -1.0 + (f64::from(ring) + 0.5) / f64::from(count);
        for turn in 0..2 * count {
            let angle = PI * (f64::from(turn) + 0.5) / f64::from(count);
            let run = (1.0 - height * height).sqrt();
            let direction = DVec3::new(run * angle.cos(), height, run * angle.sin());
            let radiance = if height > 0.0 { sky.radiance_from(direction).mean() } else { ground };
            sum += radiance * normal.dot(direction).max(0.0);
        }
    }
    sum * PI / f64::from(count) / f64::from(count)
}

fn claimed(solution: &Solution) -> f64 {
    solution.report().error_estimate.unwrap().total
}

/// Catches a wrong measure of directions, a horizon that is missed, tables that are too coarse, and light on the wrong side: flat
/// ground has what was stated, walls and a slope have what a sum over directions says, of 16 kinds of skies.
#[test]
fn what_nothing_hides_has_all_of_the_sky() {
    let slope = DVec3::new(0.5, 0.7, -0.3).normalize();
    let normals = [DVec3::Y, DVec3::X, DVec3::NEG_Z, slope, DVec3::NEG_Y];
    for (pattern, ground) in (1..=16).map(|number| (cie(number), 0.3)).chain([(perez(), 0.0), (perez(), 0.2)]) {
        let mut input = SceneInput { sky: sky(pattern, ground), ..empty() };
        for (index, &normal) in normals.iter().enumerate() {
            // Each in a plane that it does not see the others from.
            plate(&mut input, &format!("plate {index}"), normal * 50.0, normal, 0.0);
        }
        let scene = scene(input);
        let solution = solved(&scene, &asked(0.05));
        let sky = scene.sky.as_ref().unwrap();
        for (index, normal) in normals.into_iter().enumerate() {
            let wanted = if index == 0 { HORIZONTAL } else { thrown(sky, normal, 500) };
            let found = solution.irradiance_at(2 * index as u32, [0.2, 0.3, 0.5]).unwrap().mean();
            // Measured 6e-4 at most, on the slope, whose horizon runs through cells.
            assert!((found - wanted).abs() < 1e-3 * HORIZONTAL, "{pattern:?} {ground} {normal}: {found} {wanted}");
        }
    }
}

/// Catches a vertical component that is off: closed forms of a uniform sky, 1/2, and of the traditional overcast
/// sky, 3/7 (1/2 + 4/(3 pi)) = 0.3962; type 1, which is darker at the horizon, has 0.3792 by a sum of 2,000 rings.
#[test]
fn a_wall_has_its_share() {
    for (number, share) in [(5, 0.5), (16, 3.0 / 7.0 * (0.5 + 4.0 / (3.0 * PI))), (1, 0.379_182)] {
        let mut input = SceneInput { sky: sky(cie(number), 0.0), ..empty() };
        plate(&mut input, "wall", DVec3::ZERO, DVec3::X, 0.0);
        let solution = solved(&scene(input), &asked(0.05));
        let found = solution.irradiance_at(0, [0.3, 0.3, 0.4]).unwrap().mean() / HORIZONTAL;
        // Measured 2e-5 at most.
        assert!((found - share).abs() < 1e-4, "type {number}: {found}");
    }
}

/// A room of 4 x 3 x 4, without a part of its wall at x = 0 (`low` and `high`: y and z of the opening), thick as paper.
fn room(reflectance: f64, low: (f64, f64), high: (f64, f64)) -> SceneInput {
    let mut input = empty();
    let (walls, paint) = (input.object("walls"), input.material("paint", grey(reflectance, 0.0)));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(4.0, 3.0, 4.0));
    input.faces.remove(0);
    let parts = [
        ((0.0, 0.0), (low.0, 4.0)),
        ((high.0, 0.0), (3.0, 4.0)),
        ((low.0, 0.0), (high.0, low.1)),
        ((low.0, high.1), (high.0, 4.0)),
    ];
    for (low, high) in parts {
        if low.0 < high.0 && low.1 < high.1 {
            let corners = [(low.0, low.1), (high.0, low.1), (high.0, high.1), (low.0, high.1)];
            input.face(walls, paint, &corners.map(|(y, z)| v(0.0, y, z)));
        }
    }
    input
}

const LOW: (f64, f64) = (1.1, 1.3);
const HIGH: (f64, f64) = (2.2, 2.8);

/// What comes through the opening of [`room`] to a place of a side: a sum over `count` squared parts of the opening.
/// None that sees it is closer than 0.8 m: 40 squared parts are off by the square of 4 cm over that, a few thousandths.
fn through_window(scene: &Scene, (place, normal): (DVec3, DVec3), count: u32) -> f64 {
    let sky = scene.sky.as_ref().unwrap();
    let ground = sky.ground_by_sky().mean();
    let part = (HIGH.0 - LOW.0) * (HIGH.1 - LOW.1) / f64::from(count * count);
    let mut sum = 0.0;
    for row in 0..count {
        for column in 0..count {
            let along =
                |low: f64, high: f64, index: u32| low + (high - low) * (f64::from(index) + 0.5) / f64::from(count);
            let towards = v(0.0, along(LOW.0, HIGH.0, row), along(LOW.1, HIGH.1, column)) - place;
            let square = towards.length_squared();
            let direction = towards / square.sqrt();
            let radiance = if direction.y > 0.0 { sky.radiance_from(direction).mean() } else { ground };
            sum += radiance * direction.dot(normal).max(0.0) * -direction.x / square;
        }
    }
    sum * part
}

fn places(scene: &Scene, points: &[(u32, [f64; 3])]) -> Vec<(DVec3, DVec3)> {
    let place = |&(face, [a, b, c]): &(u32, [f64; 3])| {
        let [p, q, r] = scene.triangles[face as usize];
        (p * a + q * b + r * c, (q - p).cross(r - p).normalize())
    };
    points.iter().map(place).collect()
}

/// Catches noise that is taken for light, edges that are missed, and an error that is not known: against sums over a window of what
/// comes straight from a clear sky and the ground, where nothing is reflected.
#[test]
fn an_error_is_no_smaller_than_it_says() {
    for (number, error) in [(1, 0.05), (12, 0.05)] {
        let scene = scene(SceneInput { sky: sky(cie(number), 0.2), ..room(0.0, LOW, HIGH) });
        let solution = solved(&scene, &asked(error));
        assert_eq!(solution.report().status, Status::Converged);
        let at = points(&scene, 3000, 3);
        let wanted: Vec<f64> = places(&scene, &at).into_iter().map(|at| through_window(&scene, at, 40)).collect();
        let off = difference(&wanted, &irradiances(&solution, &at));
        let claimed = claimed(&solution);
        assert!(off <= 1.1 * claimed && claimed <= error, "type {number}: {off} {claimed}");
    }
}

/// Catches light that passes walls: in a closed room there is none at all, and through a slit no more than the slit has.
#[test]
fn nothing_leaks() {
    let mut closed = empty();
    let (walls, paint) = (closed.object("walls"), closed.material("paint", grey(0.7, 0.0)));
    closed.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(4.0, 3.0, 4.0));
    let solution = solved(&scene(SceneInput { sky: sky(cie(1), 0.2), ..closed }), &asked(0.1));
    assert!(solution.transport().unwrap().sky.as_flattened().iter().all(|value| *value == [0.0; 2]));
    // Light that the solve begins with dies away from pass to pass: measured 2e-25.
    assert!(solution.report().mean_irradiance.mean() < 1e-15 * HORIZONTAL);
    // 2 mm of 3 m, and black walls: all that comes in is absorbed.
    let (low, high) = ((1.0, 1.0), (1.002, 3.0));
    let scene = scene(SceneInput { sky: sky(cie(5), 1.0), ..room(0.0, low, high) });
    let solution = solved(&scene, &asked(0.1));
    // A uniform sky over white ground is as bright everywhere: what falls on the slit.
    let enters = HORIZONTAL * (high.0 - low.0) * (high.1 - low.1);
    let found = solution.report().mean_irradiance.mean() * scene.area();
    // Rays may miss it from many places: what they find is no more.
    assert!(found <= 1.05 * enters, "{found} {enters}");
}

/// Catches energy that is lost or made: what comes through a window into a room that reflects is absorbed or goes out again; and it
/// is what falls on the window.
#[test]
fn a_room_keeps_what_its_window_lets_in() {
    let scene = scene(SceneInput { sky: sky(cie(5), 1.0), ..room(0.6, LOW, HIGH) });
    let solution = solved(&scene, &asked(0.05));
    let energy = solution.report().energy.unwrap();
    let enters = HORIZONTAL * (HIGH.0 - LOW.0) * (HIGH.1 - LOW.1);
    // Of a mean as much as of a root mean square, at most.
    assert!((energy.emitted[0] / enters - 1.0).abs() < 0.02, "{energy:?} {enters}");
    assert!(energy.imbalance.abs() < 0.01, "{energy:?}");
}

/// Catches an opening that is seen too large or too small: the floor under a hole in the ceiling of a black room has the hole's form
/// factor of a uniform sky, in closed form.
#[test]
fn a_hole_in_the_roof_counts_by_its_form_factor() {
    let mut input = empty();
    let (walls, paint) = (input.object("walls"), input.material("paint", grey(0.0, 0.0)));
    let face = |input: &mut SceneInput, corners: [(f64, f64); 4], y: f64| {
        input.face(walls, paint, &corners.map(|(x, z)| v(x, y, z)));
    };
    face(&mut input, [(0.0, 0.0), (0.0, 4.0), (4.0, 4.0), (4.0, 0.0)], 0.0);
    let part = |x: (f64, f64), z: (f64, f64)| [(x.0, z.0), (x.1, z.0), (x.1, z.1), (x.0, z.1)];
    for (x, z) in
        [((0.0, 1.5), (0.0, 4.0)), ((2.5, 4.0), (0.0, 4.0)), ((1.5, 2.5), (0.0, 1.5)), ((1.5, 2.5), (2.5, 4.0))]
    {
        face(&mut input, part(x, z), 3.0);
    }
    let sides = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)];
    for pair in sides.windows(2) {
        let [(a, b), (c, d)] = [pair[0], pair[1]];
        input.face(walls, paint, &[v(a, 0.0, b), v(c, 0.0, d), v(c, 3.0, d), v(a, 3.0, b)]);
    }
    let scene = scene(SceneInput { sky: sky(SkyPattern::UNIFORM, 0.0), ..input });
    let solution = solved(&scene, &asked(0.05));
    // Of a rectangle over its corner's foot, a and b its sides over the height.
    let corner = |a: f64, b: f64| {
        let part = |a: f64, b: f64| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
        (part(a, b) + part(b, a)) / (2.0 * PI)
    };
    let mut square = 0.0;
    let at: Vec<(f64, f64)> =
        (0..100).map(|k| (0.2 + 0.4 * f64::from(k % 10), 0.2 + 0.4 * f64::from(k / 10))).collect();
    for &(x, z) in &at {
        let signed = |a: f64, b: f64| corner(a.abs() / 3.0, b.abs() / 3.0) * (a * b).signum();
        let (low, high) = ((1.5 - x, 1.5 - z), (2.5 - x, 2.5 - z));
        let factor = signed(high.0, high.1) - signed(low.0, high.1) - signed(high.0, low.1) + signed(low.0, low.1);
        let (face, place) =
            (0..2).find_map(|face| Some((face, barycentric(scene.triangles[face], v(x, 0.0, z))?))).unwrap();
        let found = solution.irradiance_at(face as u32, place).unwrap().mean();
        square += (found - HORIZONTAL * factor).powi(2) / at.len() as f64;
    }
    // All that is wrong may be wrong on the floor, 16 of 79 m².
    let most = (79.0_f64 / 16.0).sqrt() * claimed(&solution) * solution.report().mean_irradiance.mean();
    assert!(square.sqrt() < most, "{} {most}", square.sqrt());
}

/// Coordinates of a point of a triangle's plane, if it is inside.
fn barycentric([a, b, c]: [DVec3; 3], point: DVec3) -> Option<[f64; 3]> {
    let normal = (b - a).cross(c - a);
    let share = |p: DVec3, q: DVec3| normal.dot((q - p).cross(point - p)) / normal.length_squared();
    let found = [share(b, c), share(c, a), share(a, b)];
    found.iter().all(|&share| share >= -1e-9).then_some(found)
}

/// Catches an order of work that gets into results.
#[test]
fn threads_change_no_bit() {
    let scene = scene(SceneInput { sky: sky(cie(12), 0.2), ..room(0.5, LOW, HIGH) });
    let of = |threads| {
        let solution = solved(&scene, &Settings { threads, ..asked(0.1) });
        let transport = solution.transport().unwrap();
        (transport.fields.clone(), transport.sky.clone())
    };
    assert!(of(1) == of(2));
}

/// Catches a sky that is not one group of its own, ground that stays bright when the sun goes, files that lose the sky, and columns
/// that are another light's: a mix is what a solve of the dimmed scene gives.
#[test]
fn the_sky_is_dimmed_by_its_name() {
    let with = |of_sky: f64, of_sun: f64| {
        let mut input = SceneInput { sky: sky(cie(12), 0.3), ..room(0.5, LOW, HIGH) };
        input.sky.as_mut().unwrap().radiance = input.sky.as_ref().unwrap().radiance * of_sky;
        let (name, side) = ("sun".into(), DVec3::Y.cross(to_sun()));
        let intensity = Rgb::splat(30_000.0 * of_sun);
        let (position, forward, shape) = (DVec3::ZERO, to_sun(), LampShape::Parallel);
        // From behind the room: only the ground before the window throws it in.
        let forward = v(forward.x, -forward.y, forward.z);
        input.lamps.push(Lamp { name, position, forward, side, intensity, shape });
        scene(input)
    };
    let solution = solved(&with(1.0, 1.0), &asked(0.1));
    let names: Vec<String> = light_groups(solution.scene()).groups.into_iter().map(|group| group.name).collect();
    assert_eq!(names, ["sun", "sky"]);
    let back = Solution::from_record(solution.to_record()).unwrap();
    back.check().unwrap();
    assert_eq!(back.scene().sky, solution.scene().sky);
    assert_eq!(back.scene().hash, solution.scene().hash);
    let at = points(solution.scene(), 20_000, 5);
    for (of_sky, of_sun) in [(0.0, 1.0), (0.5, 2.0)] {
        let weights = vec![("sky".to_owned(), [of_sky; 3]), ("sun".to_owned(), [of_sun; 3])];
        let relit = back.relight(&Changes { weights, ..Changes::default() }).unwrap();
        relit.check().unwrap();
        let own = solved(&with(of_sky, of_sun), &asked(0.1));
        let off = difference(&irradiances(&own, &at), &irradiances(&relit, &at));
        assert!(off <= claimed(&relit) + claimed(&own), "{off}: {} {}", claimed(&relit), claimed(&own));
    }
}

/// Catches a pane that lets all pass, or that counts twice: behind glass of opacity 0.3 there is 0.7 of the sky's light.
#[test]
fn panes_dim_the_sky() {
    let glazed = |opacity: f64| {
        let mut input = SceneInput { sky: sky(cie(12), 0.2), ..room(0.0, LOW, HIGH) };
        if opacity > 0.0 {
            let (object, glass) = (input.object("pane"), input.material("glass", grey(0.0, 0.0)));
            input.materials[glass as usize].surface.opacity = opacity;
            input.materials[glass as usize].alpha = Alpha::Attenuate;
            let corners = [(LOW.0, LOW.1), (HIGH.0, LOW.1), (HIGH.0, HIGH.1), (LOW.0, HIGH.1)];
            input.face(object, glass, &corners.map(|(y, z)| v(0.0, y, z)));
        }
        solved(&scene(input), &asked(0.05))
    };
    let (open, pane) = (glazed(0.0), glazed(0.3));
    let at = points(open.scene(), 5000, 2);
    let [without, with] = [&open, &pane].map(|solution| irradiances(solution, &at));
    let dimmed: Vec<f64> = without.iter().map(|value| 0.7 * value).collect();
    assert!(difference(&dimmed, &with) < claimed(&open) + claimed(&pane));
}

/// Catches a gather without a sky, on flat receivers and others: under all of a uniform sky each has what it is for.
#[test]
fn a_final_gather_sees_the_sky() {
    let mut input = SceneInput { sky: sky(SkyPattern::UNIFORM, 0.0), ..empty() };
    plate(&mut input, "plate", v(0.0, -50.0, 0.0), DVec3::Y, 0.0);
    let solution = solved(&scene(input), &asked(0.2));
    let gather = FinalGather::new(solution.tracer(), 256, 1);
    let nothing = |_: u32, _: DVec3| Rgb::ZERO;
    let of = |receiver: &Receiver| {
        let mut stream = Stream::new(1);
        gather.received(v(0.0, 10.0, 0.0), receiver, 0, &mut stream, &nothing).mean() / HORIZONTAL
    };
    assert!((of(&Receiver::Plane(DVec3::Y)) - 1.0).abs() < 1e-3);
    assert!((of(&Receiver::Plane(DVec3::X)) - 0.5).abs() < 1e-3);
    // Half of the directions, by symmetry.
    assert!((of(&Receiver::Cylinder(DVec3::Y)) - 0.5).abs() < 0.01, "{}", of(&Receiver::Cylinder(DVec3::Y)));
}

/// Catches a picture whose window is black: above the horizon the sky, below it the ground.
#[test]
fn a_picture_shows_the_sky() {
    let mut input = SceneInput { sky: sky(cie(12), 0.2), ..empty() };
    plate(&mut input, "plate", v(0.0, -50.0, 0.0), DVec3::Y, 0.5);
    let scene = scene(input);
    let solution = solved(&scene, &asked(0.2));
    let settings = RenderSettings { width: 3, height: 3, samples_per_side: 1, gather: None, threads: 1 };
    let view = |at: DVec3| View::LookAt { eye: DVec3::ZERO, at, vertical_angle: 0.001 };
    let middle = |at: DVec3| render(&solution, &view(at), &settings, &mut Unobserved).unwrap()[4];
    let sky = scene.sky.as_ref().unwrap();
    for direction in [v(1.0, 0.3, 0.2), v(-0.4, 1.0, 0.1)] {
        let direction = direction.normalize();
        let wanted = sky.radiance_from(direction);
        assert!((middle(direction * 5.0).mean() / wanted.mean() - 1.0).abs() < 1e-9);
    }
    let ground = middle(v(1.0, -0.1, 0.0)).mean();
    assert!((ground / (0.2 * HORIZONTAL / PI) - 1.0).abs() < 1e-9, "{ground}");
}

/// Catches a schedule that leaves out the sky in silence, and skies that cannot be.
#[test]
fn what_cannot_be_lit_is_said() {
    let lit = SceneInput { sky: sky(cie(1), 0.2), ..room(0.5, LOW, HIGH) };
    let error = solve(scene(lit.clone()), &paper(), &mut Unobserved).unwrap_err().to_string();
    assert!(error.contains("has a sky, which only schedule 'wavefront' can solve"), "{error}");
    let refused = |change: &dyn Fn(&mut Sky)| {
        let mut input = lit.clone();
        change(input.sky.as_mut().unwrap());
        Scene::build(input, &BuildOptions::default()).unwrap_err().to_string()
    };
    for (found, wanted) in [
        (refused(&|sky| sky.pattern.gradation[1] = 0.5), "its coefficient b is 0.5"),
        (refused(&|sky| sky.pattern.gradation = [-1.0, 0.0, 0.0]), "give no light"),
        (refused(&|sky| sky.ground = Rgb::splat(1.5)), "its ground reflects 1.5"),
        (refused(&|sky| sky.sun = DVec3::ZERO), "its sun has no direction"),
        (refused(&|sky| sky.radiance = Rgb::splat(f64::NAN)), "its radiance"),
    ] {
        assert!(found.starts_with("the sky: ") && found.contains(wanted), "{found}");
    }
}
