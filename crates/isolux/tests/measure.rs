//! Light at points in the air: against exact answers, with an error that is told rightly, the same in every run; and which
//! points are in a room.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{draft, scene, shipped, solved};
use isolux::core::DVec3;
use isolux::core::scene::{Lamp, LampShape, SceneInput};
use isolux::core::solution::{Flow, Observer, Progress, Unobserved};
use isolux::core::units::Rgb;
use isolux::{MeasureError, MeasureSettings, Received, Receiver, Settings, Solution, looks, measure};
use std::f64::consts::PI;

const SETTINGS: MeasureSettings = MeasureSettings { rays: 1024, weights: Rgb([1.0 / 3.0; 3]), threads: 1 };
const UP: Receiver = Receiver::Plane(DVec3::Y);
const ROUND: Receiver = Receiver::Cylinder(DVec3::Y);
const HALF: Receiver = Receiver::SemiCylinder { axis: DVec3::Y, facing: DVec3::X };

fn measured(solution: &Solution, points: &[DVec3], receiver: Receiver, rays: u32) -> Vec<Received> {
    let receivers = vec![receiver; points.len()];
    measure(solution, points, &receivers, &MeasureSettings { rays, ..SETTINGS }, &mut Unobserved).unwrap()
}

/// What one point has in its first band.
fn at(solution: &Solution, point: DVec3, receiver: Receiver) -> f64 {
    measured(solution, &[point], receiver, 1024)[0].irradiance[0]
}

/// A black floor of 20 x 20, so that there is something below, and a black square lamp of emitted radiosity 1 at a height of 2
/// with corners at -1 and 1, that shines down.
fn square_lamp() -> SceneInput {
    let mut input = empty();
    let (floor, lamp) = (input.object("floor"), input.object("lamp"));
    let (black, light) = (input.material("black", grey(0.0, 0.0)), input.material("light", grey(0.0, 1.0)));
    input.face(floor, black, &[v(-10.0, 0.0, -10.0), v(-10.0, 0.0, 10.0), v(10.0, 0.0, 10.0), v(10.0, 0.0, -10.0)]);
    input.face(lamp, light, &[v(-1.0, 2.0, -1.0), v(1.0, 2.0, -1.0), v(1.0, 2.0, 1.0), v(-1.0, 2.0, 1.0)]);
    input
}

/// `int w cos' / (pi r²) dA` over that lamp: what it throws.
fn integrated(point: DVec3, receiver: Receiver) -> f64 {
    let side = 500;
    let mut sum = 0.0;
    for row in 0..side {
        for column in 0..side {
            let along = |k: i32| 2.0 * (f64::from(k) + 0.5) / f64::from(side) - 1.0;
            let towards = v(along(row), 2.0, along(column)) - point;
            let distance = towards.length();
            let direction = towards / distance;
            sum += receiver.weight(direction) * direction.y / (PI * distance * distance);
        }
    }
    sum * 4.0 / f64::from(side * side)
}

/// Catches any receiver, and any part of the light, that is weighted wrongly: in a closed furnace each has 2 at every point,
/// near walls and in corners, too.
#[test]
fn everything_in_a_furnace_has_two() {
    let solution = solved(&shipped("furnace"), &Settings { error: 0.05, ..draft() });
    let (low, high) = solution
        .scene()
        .polygons
        .iter()
        .flat_map(|polygon| polygon.corners.iter())
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &corner| (low.min(corner), high.max(corner)));
    for share in [v(0.5, 0.5, 0.5), v(0.2, 0.7, 0.4), v(0.01, 0.5, 0.5), v(0.02, 0.98, 0.03)] {
        let point = low + (high - low) * share;
        for receiver in [UP, Receiver::Plane(v(0.6, 0.0, -0.8)), ROUND, HALF] {
            let found = measured(&solution, &[point], receiver, 4096)[0];
            // The solution is off by 0.3 % at the worst of 50,000 points. Rays add 4 of their standard errors at most,
            // once in 500 of such samples of eight (Student's t).
            let bound = 0.003 * 2.0 + 4.0 * found.standard_error[0];
            assert!((found.irradiance[0] - 2.0).abs() < bound, "{share} {receiver:?}: {found:?}");
            assert!(found.standard_error[0] < 0.02, "{share} {receiver:?}: {found:?}");
        }
    }
}

/// Catches a plane whose direct light is not the configuration factor: a point below the middle of a square of side 2a at a
/// distance h has `4/(2 pi) 2 X/sqrt(1+X²) atan(X/sqrt(1+X²))`, X = a/h (Howell's catalogue, B-4, four corners); and by
/// integration anywhere else, tilted planes and such as look away, too.
#[test]
fn a_plane_below_a_square_has_the_configuration_factor() {
    let solution = solved(&scene(square_lamp()), &draft());
    for height in [0.0, 0.5, 1.5, 1.9] {
        let ratio = 1.0 / (2.0 - height);
        let slant = (1.0_f64 + ratio * ratio).sqrt();
        let exact = 4.0 / PI * (ratio / slant) * (ratio / slant).atan();
        let found = measured(&solution, &[v(0.0, height, 0.0)], UP, 1024)[0];
        // Nothing stands between: nothing is left to chance.
        assert!((found.irradiance[0] / exact - 1.0).abs() < 1e-6, "{height}: {found:?}, {exact}");
        assert!(found.standard_error[0] < 1e-6, "{found:?}");
    }
    let tilted = Receiver::Plane(v(0.6, 0.8, 0.0));
    for point in [v(0.3, 0.7, 0.2), v(-2.0, 0.4, 1.0), v(4.0, 1.8, 0.0)] {
        let (found, exact) = (at(&solution, point, tilted), integrated(point, tilted));
        // The midpoint rule where the weight is cut off at the horizon.
        assert!((found - exact).abs() < 1e-4 * exact.max(0.01), "{point}: {found}, {exact}");
    }
    assert_eq!(at(&solution, v(0.0, 1.0, 0.0), Receiver::Plane(DVec3::NEG_Y)), 0.0);
    assert_eq!(at(&solution, v(0.0, 3.0, 0.0), UP), 0.0);
}

/// Catches a cylinder that is weighted wrongly, and an error that says too little or too much: over many points errors in
/// units of the standard error are Student's t with 7 degrees of freedom, whose root mean square is 1.18.
#[test]
fn cylinders_are_off_by_what_they_say() {
    let solution = solved(&scene(square_lamp()), &draft());
    let points: Vec<DVec3> = (0..300)
        .map(|k| v(f64::from(k % 20) * 0.3 - 2.9, 0.1 + 0.1 * f64::from(k % 15), f64::from(k / 20) * 0.2))
        .collect();
    for receiver in [ROUND, HALF] {
        let found = measured(&solution, &points, receiver, 512);
        let (mut squares, mut noise) = (0.0, 0.0);
        for (&point, found) in points.iter().zip(&found) {
            let exact = integrated(point, receiver);
            let off = (found.irradiance[0] - exact) / found.standard_error[0];
            // Student's t is beyond 10 once in 50,000 points.
            assert!(off.abs() < 10.0, "{point} {receiver:?}: {found:?}, {exact}");
            noise += found.standard_error[0] / exact;
            assert!((found.total_error / found.standard_error[0] - 1.0).abs() < 1e-6);
            squares += off * off;
        }
        // Of 300 the mean square of t with 7 degrees of freedom is 1.4 give or take 0.25.
        let scatter = (squares / points.len() as f64).sqrt();
        assert!((0.9..1.5).contains(&scatter), "{receiver:?}: {scatter}");
        let noise = noise / points.len() as f64;
        assert!(noise < 0.03, "{receiver:?}: {noise} {scatter}");
    }
}

/// Catches places on a lamp that are denser at one end, each taken for the same area: a trapezoid, by integration.
#[test]
fn a_trapezoid_is_even() {
    let strips = 400;
    let width = |x: f64| 0.2 + 0.8 * x;
    let point = v(0.4, 1.6, 0.0);
    let strip = |k: i32| (f64::from(k) + 0.5) / f64::from(strips);
    let exact: f64 = (0..strips * strips)
        .map(|k| {
            let (x, share) = (strip(k % strips), 2.0 * strip(k / strips) - 1.0);
            let towards = v(x, 2.0, share * width(x)) - point;
            let distance = towards.length();
            let direction = towards / distance;
            let area = 2.0 * width(x) / f64::from(strips * strips);
            ROUND.weight(direction) * direction.y / (PI * distance * distance) * area
        })
        .sum();
    let mut input = square_lamp();
    input.faces[1].corners = vec![v(0.0, 2.0, -0.2), v(1.0, 2.0, -1.0), v(1.0, 2.0, 1.0), v(0.0, 2.0, 0.2)];
    let solution = solved(&scene(input), &draft());
    let found = measured(&solution, &[point], ROUND, 16_384)[0];
    assert!((found.irradiance[0] - exact).abs() < 5.0 * found.standard_error[0], "{found:?}, {exact}");
    assert!(found.standard_error[0] < 2e-3 * exact, "{found:?}, {exact}");
}

/// Catches many emitters that are found otherwise than few: above a point a disk of 96 parts, of half-angle a, throws
/// `(a - sin a cos a)/pi` on an upright cylinder and on half a one, `sin² a` on a plane.
#[test]
fn a_disk_of_many_parts_is_a_disk() {
    let mut input = square_lamp();
    input.objects.truncate(1);
    input.faces.truncate(1);
    let disk = input.object("disk");
    let parts = 96;
    let corner = |k: i32| {
        let angle = 2.0 * PI * f64::from(k) / f64::from(parts);
        v(angle.cos(), 2.0, angle.sin())
    };
    for part in 0..parts {
        input.face(disk, 1, &[v(0.0, 2.0, 0.0), corner(part), corner(part + 1)]);
    }
    let solution = solved(&scene(input), &draft());
    let angle = 1.0_f64.atan2(1.2);
    let round = (angle - angle.sin() * angle.cos()) / PI;
    for (receiver, exact) in [(UP, angle.sin().powi(2)), (ROUND, round), (HALF, round)] {
        let found = measured(&solution, &[v(0.0, 0.8, 0.0)], receiver, 4096)[0];
        // A polygon of 96 corners has 0.9993 of its circle's area.
        let bound = 0.001 * exact + 4.0 * found.standard_error[0];
        assert!((found.irradiance[0] - exact).abs() < bound, "{receiver:?}: {found:?}, {exact}");
        assert!(found.standard_error[0] < 0.01 * exact, "{receiver:?}: {found:?}");
    }
}

/// Catches lamps without a surface that are left out, see through things, or count at a cylinder as at a plane: I cos/d²,
/// I sin/(pi d²), I (sin + cos p sin)/(pi d²).
#[test]
fn a_point_lamp_counts_by_angle_and_distance() {
    let lamp = Lamp {
        name: "bulb".into(),
        position: v(0.0, 1.5, 0.0),
        forward: DVec3::NEG_Y,
        side: DVec3::X,
        intensity: Rgb([100.0, 200.0, 300.0]),
        shape: LampShape::Point,
    };
    let mut input = square_lamp();
    input.materials[1].surface.emission = Rgb::ZERO;
    let solution = solved(&scene(SceneInput { lamps: vec![lamp], ..input }), &draft());
    for point in [v(0.4, 0.5, 0.0), v(-0.7, 1.5, 0.0), v(2.0, 0.1, -3.0)] {
        let towards = v(0.0, 1.5, 0.0) - point;
        let (square, direction) = (towards.length_squared(), towards.normalize());
        let sine = direction.x.hypot(direction.z);
        for (receiver, counts) in [(UP, direction.y.max(0.0)), (ROUND, sine / PI), (HALF, (sine + direction.x) / PI)] {
            let found = measured(&solution, &[point], receiver, 64)[0];
            for band in 0..3 {
                let exact = 100.0 * f64::from(band as u32 + 1) * counts / square;
                // Places and directions of rays are of single precision.
                assert!(
                    (found.irradiance[band] - exact).abs() < 1e-5 * exact + 1e-9,
                    "{receiver:?}: {found:?} {exact}"
                );
            }
            assert!(found.standard_error[0] < 1e-9);
        }
    }
    // Above what hangs over the lamp.
    assert_eq!(at(&solution, v(0.0, 2.5, 0.0), ROUND), 0.0);
}

/// Catches things that are too far away to stand in a lamp's way: high above a floor that hides a sun below it.
#[test]
fn far_away_shadows_are_seen() {
    let sun = Lamp {
        name: "sun".into(),
        position: DVec3::ZERO,
        forward: DVec3::Y,
        side: DVec3::X,
        intensity: Rgb::splat(100.0),
        shape: LampShape::Parallel,
    };
    let solution = solved(&scene(SceneInput { lamps: vec![sun], ..square_lamp() }), &draft());
    let down = Receiver::Plane(DVec3::NEG_Y);
    for height in [1.0, 50.0, 100.0, 1000.0] {
        assert_eq!(at(&solution, v(5.0, height, 5.0), down), 0.0, "{height}");
        assert_eq!(at(&solution, v(15.0, height, 5.0), down), 100.0, "{height}");
    }
}

/// Catches values that depend on threads, on neighbours in the list, or on chance.
#[test]
fn points_have_their_own_values() {
    let solution = solved(&shipped("cornell"), &draft());
    let points = [v(0.2, 0.2, 0.2), v(0.3, 0.4, 0.1), v(0.1, 0.3, 0.4)];
    let all = measured(&solution, &points, ROUND, 64);
    let receivers = [ROUND; 3];
    let of = |threads| {
        measure(&solution, &points, &receivers, &MeasureSettings { rays: 64, threads, ..SETTINGS }, &mut Unobserved)
    };
    assert_eq!((of(2).unwrap(), of(3).unwrap()), (all.clone(), all.clone()));
    assert_eq!(measured(&solution, &points[1..2], ROUND, 64)[0], all[1]);
    assert_ne!(all[0], all[1]);
}

/// Catches points inside furniture or behind walls that count, and points in the room that do not.
#[test]
fn points_are_in_the_room_or_not() {
    // A room of 4 x 3 x 4 seen from inside, a box on its floor without a bottom, one without a top's thickness.
    let mut input = empty();
    let (room, crate_, shelf) = (input.object("room"), input.object("box"), input.object("shelf"));
    let (paint, light) = (input.material("paint", grey(0.5, 0.0)), input.material("light", grey(0.0, 1.0)));
    let quad = |input: &mut SceneInput, object, material, corners: [[f64; 3]; 4]| {
        input.face(object, material, &corners.map(|[x, y, z]| v(x, y, z)));
    };
    quad(&mut input, room, paint, [[0., 0., 0.], [0., 0., 4.], [4., 0., 4.], [4., 0., 0.]]);
    quad(&mut input, room, light, [[0., 3., 0.], [4., 3., 0.], [4., 3., 4.], [0., 3., 4.]]);
    quad(&mut input, room, paint, [[0., 0., 0.], [4., 0., 0.], [4., 3., 0.], [0., 3., 0.]]);
    quad(&mut input, room, paint, [[4., 0., 4.], [0., 0., 4.], [0., 3., 4.], [4., 3., 4.]]);
    quad(&mut input, room, paint, [[0., 0., 4.], [0., 0., 0.], [0., 3., 0.], [0., 3., 4.]]);
    quad(&mut input, room, paint, [[4., 0., 0.], [4., 0., 4.], [4., 3., 4.], [4., 3., 0.]]);
    // Flat: 1 x 0.1 x 1.
    let (top, low, high) = (0.1, 1.0, 2.0);
    quad(&mut input, crate_, paint, [[low, top, low], [low, top, high], [high, top, high], [high, top, low]]);
    quad(&mut input, crate_, paint, [[low, 0., high], [high, 0., high], [high, top, high], [low, top, high]]);
    quad(&mut input, crate_, paint, [[high, 0., low], [low, 0., low], [low, top, low], [high, top, low]]);
    quad(&mut input, crate_, paint, [[low, 0., low], [low, 0., high], [low, top, high], [low, top, low]]);
    quad(&mut input, crate_, paint, [[high, 0., high], [high, 0., low], [high, top, low], [high, top, high]]);
    quad(&mut input, shelf, paint, [[2.5, 1., 2.5], [2.5, 1., 3.5], [3.5, 1., 3.5], [3.5, 1., 2.5]]);
    let solution = solved(&scene(input), &draft());
    let inside = [
        v(2.0, 1.5, 2.0),
        v(0.001, 1.5, 0.001),
        // On the box, and just above; below the shelf, which is nothing but its upper side.
        v(1.5, 0.1, 1.5),
        v(1.5, 0.11, 1.5),
        v(3.0, 0.8, 3.0),
        v(3.0, 0.99, 3.0),
    ];
    let outside = [
        v(1.5, 0.05, 1.5),
        v(1.05, 0.09, 1.9),
        v(-0.01, 1.5, 2.0),
        v(5.0, 1.5, 2.0),
        v(2.0, 3.01, 2.0),
        v(2.0, -0.1, 2.0),
    ];
    let out = |points: &[DVec3]| -> Vec<bool> {
        looks(&solution, points, 1, &mut Unobserved).unwrap().iter().map(|look| look.is_out()).collect()
    };
    assert_eq!(out(&inside), [false; 6]);
    assert_eq!(out(&outside), [true; 6]);
    let look = looks(&solution, &[v(2.0, 1.5, 2.0)], 1, &mut Unobserved).unwrap()[0];
    assert!((look.fronts + look.covered + look.backs + look.open - 1.0).abs() < 1e-12);
    assert_eq!(look.open, 0.0);
}

struct Stops(u32);

impl Observer for Stops {
    fn observe(&mut self, _: &Progress) -> Flow {
        self.0 += 1;
        if self.0 > 2 { Flow::Stop } else { Flow::Continue }
    }
}

/// Catches input that is taken silently, and a stop that is not heard.
#[test]
fn nonsense_is_refused_by_name_and_stops_are_heard() {
    let solution = solved(&shipped("cornell"), &draft());
    let refused = |points: &[DVec3], receivers: &[Receiver], rays| {
        measure(&solution, points, receivers, &MeasureSettings { rays, ..SETTINGS }, &mut Unobserved).unwrap_err()
    };
    let point = v(0.2, 0.2, 0.2);
    assert!(matches!(refused(&[point, v(f64::NAN, 0.0, 0.0)], &[UP; 2], 64), MeasureError::Point { index: 1, .. }));
    assert!(matches!(refused(&[point], &[UP; 2], 64), MeasureError::Count { points: 1, receivers: 2 }));
    assert!(matches!(refused(&[point], &[UP], 7), MeasureError::Rays { rays: 7, .. }));
    let long = Receiver::Plane(v(0.0, 2.0, 0.0));
    assert!(matches!(refused(&[point], &[long], 64), MeasureError::Direction { what: "normals", .. }));
    let skew = Receiver::SemiCylinder { axis: DVec3::Y, facing: v(0.6, 0.8, 0.0) };
    assert!(matches!(refused(&[point], &[skew], 64), MeasureError::Direction { what: "facing", .. }));
    let many = vec![point; 10_000];
    let stopped = measure(&solution, &many, &vec![ROUND; 10_000], &SETTINGS, &mut Stops(0));
    assert_eq!(stopped.unwrap_err(), MeasureError::Cancelled);
}
