//! What comes after a solve: meshes and pictures without a BSP tree, rays against those of the tree, final gathers.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{draft, lit_box, paper, points, scene, schedules, shipped, solved};
use isolux::core::DVec3;
use isolux::core::kernels::NoProbe;
use isolux::core::sampling::Stream;
use isolux::core::scene::Scene;
use isolux::core::solution::{Flow, Observer, Progress, SurfaceMesh, Unobserved};
use isolux::core::tree::InsertionOrder;
use isolux::core::tree::{Bsp, ElementId};
use isolux::core::units::Rgb;
use isolux::{RenderError, RenderSettings, Settings, Solution, TexelSettings, Tracer, View, render};
use std::f64::consts::PI;
use std::sync::Arc;

const SMALL: RenderSettings = RenderSettings { width: 24, height: 18, samples_per_side: 2, gather: None, threads: 1 };

fn drawn(solution: &Solution, view: &View, settings: &RenderSettings) -> Vec<Rgb> {
    render(solution, view, settings, &mut Unobserved).unwrap()
}

fn gathered(solution: &Solution, rays: u32, threads: usize) -> SurfaceMesh {
    solution.gathered_mesh(rays, threads, &mut Unobserved).unwrap()
}

/// Catches the paper's tree in the way of the fast engine: nothing that is asked of its solution builds one.
#[test]
fn nothing_after_a_wavefront_solve_builds_a_bsp_tree() {
    let first = solved(&shipped("cornell"), &draft());
    let again = Solution::from_record(first.to_record()).unwrap();
    for solution in [&first, &again] {
        assert!(!solution.mesh().triangles.is_empty());
        for gather in [None, Some(4)] {
            assert!(drawn(solution, &View::Default, &RenderSettings { gather, ..SMALL }).contains(&Rgb::ZERO));
        }
        gathered(solution, 1, 1);
        solution.radiosity_at(0, [0.2, 0.3, 0.5]).unwrap();
        solution.check().unwrap();
        assert!(!solution.has_bsp());
    }
    assert!(solved(&shipped("cornell"), &paper()).has_bsp());
}

/// Catches rays that miss what the BSP tree meets, see through solid texels, stop in holes, or lose their precision far
/// outside of the scene: single precision and its rounding decide a few rays along silhouettes only.
#[test]
fn rays_meet_what_those_of_the_tree_meet() {
    for name in ["room", "cornell", "lamps", "test-inputs/mask-checker", "test-inputs/transmission-pane", "leaks/slit"]
    {
        let scene = shipped(name);
        let bsp = Bsp::build(&scene, InsertionOrder::default());
        let tracer = Tracer::new(scene.clone());
        let corners = || scene.polygons.iter().flat_map(|polygon| polygon.corners.iter().copied());
        let (low, high) =
            (corners().fold(DVec3::INFINITY, DVec3::min), corners().fold(DVec3::NEG_INFINITY, DVec3::max));
        let mut stream = Stream::new(11);
        let (mut met, mut apart) = (0, 0);
        for index in 0..6000 {
            let mut place = || {
                let share = DVec3::new(stream.next_unit(), stream.next_unit(), stream.next_unit());
                low + (high - low) * share
            };
            let (mut start, to) = (place(), place());
            if index % 3 == 0 {
                // A thousand diameters away, where single precision about the middle knows tenths of millimetres.
                start = to + (start - to).normalize() * (1000.0 * scene.diameter);
            }
            let direction = (to - start).normalize();
            let one = bsp.closest_hit(&scene, start, direction, f64::INFINITY, &mut NoProbe);
            let two = tracer.closest(start, direction, f64::INFINITY);
            met += usize::from(one.is_some());
            match (one, two) {
                (Some(one), Some(two)) if one.polygon == two.polygon => {
                    assert_eq!(one.front_facing, two.front_facing);
                    // Both meet one plane in double precision, unless they run along it.
                    let slope = scene.polygons[one.polygon as usize].plane.normal.dot(direction).abs();
                    let off = (one.distance - two.distance).abs() * slope;
                    assert!(off < 1e-10 * start.length().max(1.0), "{name}: {one:?} {two:?}");
                }
                // Of two faces back to back the tree meets the first, and the engine the one that faces the ray.
                (Some(one), Some(two)) if !one.front_facing && two.front_facing => {
                    let [back, front] =
                        [one.polygon, two.polygon].map(|polygon| scene.polygons[polygon as usize].plane);
                    let off = front.distance(start + direction * one.distance).abs();
                    let is_one_place = back.normal.dot(front.normal) < -0.999_999 && off < scene.tolerance();
                    apart += usize::from(!is_one_place);
                }
                (None, None) => {}
                _ => apart += 1,
            }
        }
        assert!(met > 500, "{name}: {met} rays met something");
        // Measured: 0 to 2 of 6000.
        assert!(apart <= 6, "{name}: {apart} rays of 6000 disagree");
    }
}

/// Catches limits that are not heeded: a ray ends where it is told to, and does not meet what it starts on.
#[test]
fn rays_end_where_they_are_told_to() {
    let scene = shipped("furnace");
    let tracer = Tracer::new(scene.clone());
    for (index, polygon) in scene.polygons[..scene.fronts].iter().enumerate() {
        let (start, direction) = (polygon.corners.mean(), polygon.plane.normal);
        let hit = tracer.closest(start, direction, f64::INFINITY).unwrap();
        assert!(hit.polygon != index as u32 && hit.front_facing && hit.distance > 0.1);
        assert!(tracer.closest(start, direction, hit.distance * 0.99).is_none());
        assert!(tracer.closest(start, direction, hit.distance * 1.01).is_some());
        assert!(tracer.closest(start, -direction, f64::INFINITY).is_none());
    }
}

/// Catches texels that show another light than asked for, that depend on threads or on what nobody sees, sides that do not
/// exist, and an observer that is not heard.
#[test]
fn texels_show_the_light_at_their_places() {
    let solution = solved(&shipped("leaks/contact"), &draft());
    let scene = solution.scene();
    let at = points(scene, 200, 3);
    let place = |&(face, weights): &(u32, [f64; 3])| (scene.face_polygon[face as usize], scene.position(face, weights));
    let places: Vec<(u32, DVec3)> = at.iter().map(place).collect();
    let texels = |settings: TexelSettings| solution.texels(&places, &settings, &mut Unobserved).unwrap();
    let elements = texels(TexelSettings { elements: true, ..TexelSettings::default() });
    for (texel, &(face, weights)) in elements.iter().zip(&at) {
        assert_eq!(Some(texel.irradiance), solution.irradiance_at(face, weights));
    }
    // What a picture shows, which may see another face of the same place.
    let smooth = texels(TexelSettings::default());
    let seen = seen(&solution, &at, None);
    let agree = smooth.iter().zip(&places).zip(&seen).filter(|((texel, (side, _)), seen)| {
        let polygon = &scene.polygons[*side as usize];
        let radiosity = (polygon.emission + polygon.reflectance * texel.irradiance).mean();
        texel.covered || (radiosity - **seen).abs() < 1e-6 * radiosity.max(1.0)
    });
    assert!(agree.count() > 190);
    let settings = TexelSettings { gather: Some(64), ..TexelSettings::default() };
    let gathered = [1, 2].map(|threads| texels(TexelSettings { threads, ..settings }));
    assert_eq!(gathered[0], gathered[1]);
    assert!(gathered[0] != smooth && gathered[0].iter().all(|texel| !texel.covered || texel.irradiance == Rgb::ZERO));
    // The box covers a part of the table's top, which is one polygon. Files hold single precision.
    let is_top = |polygon: &usize| {
        let polygon = &scene.polygons[*polygon];
        polygon.plane.normal.y > 0.9 && polygon.corners.iter().all(|corner| (corner.y - 0.72).abs() < 1e-6)
    };
    let top = (0..scene.fronts).find(is_top).unwrap() as u32;
    let height = scene.polygons[top as usize].corners[0].y;
    let on_top = [1.95, 1.5].map(|x| (top, DVec3::new(x, height, 1.3)));
    let found = solution.texels(&on_top, &TexelSettings::default(), &mut Unobserved).unwrap();
    assert!(found[0].covered && !found[1].covered);
    let sides = scene.polygons.len();
    let wrong = solution.texels(&[(sides as u32, DVec3::ZERO)], &TexelSettings::default(), &mut Unobserved);
    assert_eq!(wrong.unwrap_err(), RenderError::NoSuchSide { side: sides as u32, sides });
    struct Stopping;
    impl Observer for Stopping {
        fn observe(&mut self, _: &Progress) -> Flow {
            Flow::Stop
        }
    }
    let stopped = solution.texels(&places, &TexelSettings::default(), &mut Stopping);
    assert_eq!(stopped.unwrap_err(), RenderError::Cancelled);
}

/// Radiosities that a picture of one pixel shows at points, seen from close above them.
fn seen(solution: &Solution, at: &[(u32, [f64; 3])], gather: Option<u32>) -> Vec<f64> {
    let settings = RenderSettings { width: 1, height: 1, samples_per_side: 1, gather, threads: 1 };
    let scene = solution.scene();
    at.iter()
        .map(|&(face, barycentric)| {
            let point = scene.position(face, barycentric);
            let normal = scene.polygons[scene.face_polygon[face as usize] as usize].plane.normal;
            let eye = point + normal * (1e-3 * scene.diameter);
            let view = View::LookAt { eye, at: point, vertical_angle: 0.1 };
            drawn(solution, &view, &settings)[0].mean() * PI
        })
        .collect()
}

/// Catches pictures of other values than the answers at points.
#[test]
fn pictures_show_the_values_at_points() {
    let scene = shipped("cornell");
    for (name, settings) in schedules() {
        let solution = solved(&scene, &Settings { error: 0.1, ..settings });
        let at = points(&scene, 300, 5);
        let answers: Vec<f64> =
            at.iter().map(|&(face, place)| solution.radiosity_at(face, place).unwrap().mean()).collect();
        let off = common::difference(&answers, &seen(&solution, &at, None));
        // The paper's answers are those of the mesh; those of fields differ from it by what fields differ at borders.
        assert!(off < if name == "sequential" { 1e-9 } else { 0.05 }, "{name}: {off}");
    }
}

/// A box of unit size whose sides of reflectance 1/2 emit 1, each cut into `cuts` by `cuts` squares: radiosity is 2.
fn furnace(cuts: u32) -> Arc<Scene> {
    let mut input = empty();
    let object = input.object("sides");
    let wall = input.material("wall", grey(0.5, 1.0));
    let step = |k: u32| f64::from(k) / f64::from(cuts);
    for axis in 0..3 {
        for (side, i, j) in (0..2 * cuts * cuts).map(|k| (k % 2, k / 2 % cuts, k / 2 / cuts)) {
            let corner = |s: f64, t: f64| {
                let mut place = [f64::from(side); 3];
                (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (s, t);
                v(place[0], place[1], place[2])
            };
            let (s, t) = ([step(i), step(i + 1)], [step(j), step(j + 1)]);
            let mut face = [corner(s[0], t[0]), corner(s[1], t[0]), corner(s[1], t[1]), corner(s[0], t[1])];
            if side == 1 {
                face.reverse();
            }
            input.face(object, wall, &face);
        }
    }
    scene(input)
}

/// Catches gathers that count emission twice or not at all, weigh a direction wrongly, or lose rays at edges: in a closed
/// furnace everything receives 2, whether its emitters count one by one or in groups.
#[test]
fn gathers_know_the_furnace() {
    let [fast, paper] = schedules();
    for (cuts, rays, noise, (name, settings)) in
        [(1, 256, 1e-3, fast.clone()), (1, 256, 1e-3, paper), (5, 64, 0.08, fast)]
    {
        let solution = solved(&furnace(cuts), &Settings { error: 0.05, ..settings });
        let mesh = gathered(&solution, rays, 1);
        let values: Vec<f64> = mesh.irradiance.iter().map(|value| value.mean() / 2.0).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        // What was solved may be off by what was asked, and is a half of what arrives.
        assert!((mean - 1.0).abs() < 0.025, "{cuts} {name}: {mean}");
        let rms = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        assert!(rms < noise + 0.025, "{cuts} {name}: {rms}");
        assert_eq!(mesh.positions, solution.mesh().positions);
        assert_eq!(mesh.triangles, solution.mesh().triangles);
    }
}

/// Catches rays to emitters that see through what stands between, or no half-shadow: gathers of a coarse solve are closer to
/// a fine solve than the coarse one itself.
#[test]
fn gathers_are_better_than_what_they_read() {
    let mut input = lit_box(0.5);
    let object = input.object("box");
    input.outside_of_box(object, 0, v(0.9, 0.0, 0.6), v(1.3, 0.4, 0.9));
    let scene = scene(input);
    let at = points(&scene, 200, 8);
    let fine = solved(&scene, &Settings { error: 0.02, ..draft() });
    let known: Vec<f64> = at.iter().map(|&(face, place)| fine.radiosity_at(face, place).unwrap().mean()).collect();
    let coarse = solved(&scene, &Settings { max_elements: Some(60), ..draft() });
    // What is under the box is not seen from above it.
    let is_open = |&&(face, place): &&(u32, [f64; 3])| {
        let point = scene.position(face, place);
        !(point.y < 1e-9 && (0.9..1.3).contains(&point.x) && (0.6..0.9).contains(&point.z))
    };
    let (at, known): (Vec<_>, Vec<_>) = at.iter().zip(&known).filter(|(place, _)| is_open(place)).unzip();
    let (before, after) =
        [None, Some(1024)].map(|gather| common::difference(&known, &seen(&coarse, &at, gather))).into();
    assert!(before > 0.05 && after < 0.5 * before, "{before} {after}");
    assert!(after < 0.03, "{after}");
}

/// Catches values that depend on how the work was spread, and on nothing of the seed.
#[test]
fn gathers_are_the_same_bits_with_any_threads() {
    let scene = shipped("cornell");
    let solution = solved(&scene, &draft());
    let [one, two] = [1, 2].map(|threads| {
        let settings = RenderSettings { gather: Some(16), threads, ..SMALL };
        (gathered(&solution, 9, threads).irradiance, drawn(&solution, &View::Default, &settings))
    });
    assert_eq!(one, two);
    let other = solved(&scene, &Settings { seed: 1, ..draft() });
    assert_ne!(one.1, drawn(&other, &View::Default, &RenderSettings { gather: Some(16), ..SMALL }));
}

/// Catches islands of darkness: no vertex that is seen is dark where a thing stands on a floor, gathered or not. What stands
/// there is higher than leaves are long.
#[test]
fn nothing_that_is_seen_is_black() {
    let mut input = lit_box(0.5);
    let object = input.object("column");
    input.outside_of_box(object, 0, v(1.31, 0.0, 0.62), v(1.52, 0.8, 0.93));
    let scene = scene(input);
    let solution = solved(&scene, &Settings { error: 0.1, ..draft() });
    let floor = scene.polygons.iter().position(|polygon| polygon.plane.normal.y > 0.9 && polygon.corners[0].y == 0.0);
    let floor = floor.unwrap();
    let is_under = |at: DVec3| (1.31..=1.52).contains(&at.x) && (0.62..=0.93).contains(&at.z);
    for mesh in [solution.mesh(), &gathered(&solution, 64, 1)] {
        let range = mesh.vertices_of(floor as u32);
        let mean = solution.hierarchy().light.irradiance(ElementId(floor as u32)).mean();
        for (&at, value) in mesh.positions[range.clone()].iter().zip(&mesh.irradiance[range]) {
            assert!(is_under(at) || value.mean() > 0.05 * mean, "{at}: {} of {mean}", value.mean());
        }
    }
}

/// Says stop at the first question.
struct Stop;

impl Observer for Stop {
    fn observe(&mut self, _: &Progress) -> Flow {
        Flow::Stop
    }
}

/// Catches gathers by nonsense that run, and gathers that cannot be stopped.
#[test]
fn gathers_can_be_refused_and_stopped() {
    let solution = solved(&shipped("furnace"), &draft());
    for rays in [0, 65_537] {
        let refused = Err(RenderError::Gather { rays, most: 65_536 });
        let settings = RenderSettings { gather: Some(rays), ..SMALL };
        assert_eq!(render(&solution, &View::Default, &settings, &mut Unobserved), refused);
        assert_eq!(solution.gathered_mesh(rays, 1, &mut Unobserved).map(|_| Vec::new()), refused);
    }
    assert_eq!(solution.gathered_mesh(1, 1, &mut Stop).unwrap_err(), RenderError::Cancelled);
}
