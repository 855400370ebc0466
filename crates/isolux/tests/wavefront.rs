//! The default schedule, `wavefront`: answers against what is known, what its solutions hold, and what is refused.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, empty, grey, v};
use common::{difference, draft, irradiances, lit_box, paper, points, scene, shipped, solved};
use isolux::core::DVec3;
use isolux::core::kernels::visibility::Rays;
use isolux::core::scene::Surface;
use isolux::core::solution::{Flow, Observer, Phase, Progress, Unobserved};
use isolux::core::units::Rgb;
use isolux::{Schedule, Settings, SettingsError, Solution, SolveError, Status, solve};

fn asked(error: f64) -> Settings {
    Settings { error, ..draft() }
}

/// Catches any error in factors, links, gather, push and pull that does not conserve light: in a closed box of reflectance
/// 1/2 and emission 1 the radiosity is 2 everywhere. What is asked for is what comes out.
#[test]
fn the_furnace_is_within_what_was_asked() {
    let scene = shipped("furnace");
    for error in [0.1, 0.02] {
        let solution = solved(&scene, &asked(error));
        assert_eq!(solution.report().status, Status::Converged);
        let at = points(&scene, 20_000, 3);
        let square: f64 = irradiances(&solution, &at).iter().map(|value| (value / 2.0 - 1.0).powi(2)).sum();
        let rms = (square / at.len() as f64).sqrt();
        assert!(rms <= error, "{error}: {rms}");
        // Half of what links say, which was claimed once, is ten times as much. Measured: 0.0022 for 0.0010 at 0.1, and 1.0
        // times at 0.02. The check has rays for the error that was asked: of a hundredth of that it tells the size.
        let claimed = solution.report().error_estimate.unwrap().total;
        assert!(claimed < (2.0 * rms).max(error / 40.0), "{error}: {claimed} for {rms}");
    }
}

/// Catches a pane that reflects its opacity's share of its opacity's share, in links or in what checks them: between walls
/// that reflect half of 1 and emit the rest, 1 arrives everywhere if a pane of opacity a and reflectance r emits a (1 - r).
#[test]
fn the_furnace_with_a_pane_knows_its_error() {
    for (opacity, reflectance) in [(0.5, 0.8), (0.2, 0.2), (0.9, 0.4)] {
        let mut input = empty();
        let walls = input.object("walls");
        let paint = input.material("paint", grey(0.5, 0.5));
        input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(1.0, 1.0, 1.0));
        let pane = Surface { opacity, ..grey(reflectance, opacity * (1.0 - reflectance)) };
        let glass = input.material("glass", pane);
        input.materials[glass as usize].two_sided = true;
        let p = |x: f64, z: f64| v(x, 0.5, z);
        input.face(walls, glass, &[p(0.2, 0.2), p(0.2, 0.8), p(0.8, 0.8), p(0.8, 0.2)]);
        let scene = scene(input);
        for error in [0.1, 0.02] {
            let solution = solved(&scene, &asked(error));
            let off = irradiances(&solution, &points(&scene, 20_000, 3)).into_iter().map(|value| (value - 1.0).powi(2));
            let rms = (off.sum::<f64>() / 20_000.0).sqrt();
            let claimed = solution.report().error_estimate.unwrap().total;
            // Measured: claims of 0.97 to 1.12 of what is; docs/accuracy.md: 1.35 up or down elsewhere.
            assert!(claimed / rms < 1.35 && rms / claimed < 1.35, "{opacity}, {error}: {claimed} for {rms}");
            // Asked for 0.02, opacity 1/2 ends at 0.023 and says so.
            let is_met = solution.report().status == Status::Converged;
            assert_eq!(is_met, rms <= error, "{opacity}, {error}: {claimed} for {rms}");
        }
    }
}

/// Catches a wrong factor of pi, area or side: the mean irradiance of a square over a lit square is their form factor.
#[test]
fn a_square_over_a_lit_square_gets_its_form_factor() {
    let mut input = empty();
    let (lower, upper) = (input.object("lower"), input.object("upper"));
    let (glow, black) = (input.material("glow", grey(0.0, 1.0)), input.material("black", grey(0.0, 0.0)));
    let p = |x: f64, y: f64, z: f64| v(x, y, z);
    input.face(lower, glow, &[p(0.0, 0.0, 0.0), p(0.0, 0.0, 1.0), p(1.0, 0.0, 1.0), p(1.0, 0.0, 0.0)]);
    input.face(upper, black, &[p(0.0, 1.0, 0.0), p(1.0, 1.0, 0.0), p(1.0, 1.0, 1.0), p(0.0, 1.0, 1.0)]);
    let solution = solved(&scene(input), &asked(0.01));
    let mean = solution.hierarchy().light.irradiances()[1][0];
    // Howell C-11, X = Y = 1; see scenes/squares.json.
    assert!((mean / 0.199_824_895_698 - 1.0).abs() < 0.01, "{mean}");
}

/// Catches an estimate that has nothing to do with the error: against a finer solve it is no less than half of it, and
/// what is left is no more than what was asked for.
#[test]
fn the_estimate_speaks_of_the_error() {
    let scene = shipped("cornell");
    let finer = solved(&scene, &asked(0.03));
    // What lies under something is not told of.
    let is_open = |point: &(u32, [f64; 3])| irradiances(&finer, &[*point])[0] > 0.0;
    let at: Vec<_> = points(&scene, 4000, 21).into_iter().filter(is_open).collect();
    let fine = irradiances(&finer, &at);
    for error in [0.2, 0.1] {
        let solution = solved(&scene, &asked(error));
        let estimate = solution.report().error_estimate.unwrap();
        let off = difference(&fine, &irradiances(&solution, &at));
        assert!(estimate.total <= error && estimate.dark.is_some(), "{estimate:?}");
        assert!(off <= error, "{error}: {off}");
        assert!(off <= 2.0 * estimate.total, "{off} {estimate:?}");
    }
}

/// Catches an error asked for that changes nothing.
#[test]
fn smaller_errors_take_more_elements_and_links() {
    let scene = shipped("cornell");
    let reports = [0.2, 0.05, 0.02].map(|error| solved(&scene, &asked(error)).report().clone());
    assert!(reports.is_sorted_by(|one, two| one.elements < two.elements && one.links.total < two.links.total));
}

/// Catches a report that leaves out what the schedule has, or tells of what only the other has; and work that the answers
/// do without.
#[test]
fn the_report_has_what_the_schedule_has() {
    let solution = solved(&shipped("cornell"), &draft());
    let report = solution.report();
    assert_eq!((report.schedule, report.settings.schedule), (Schedule::Wavefront, Schedule::Wavefront));
    assert_eq!((report.bf_epsilon, report.energy_epsilon, report.fragments), (None, None, None));
    assert!(report.counts.is_none() && report.energy.is_some() && report.row_sum.is_some());
    assert!(report.iterations.is_empty() && report.bound.is_none());
    let transport = solution.transport().unwrap();
    assert_eq!(report.clusters, transport.clusters.parent.len() as u64);
    assert_eq!(report.links.total, transport.links.receiver.len() as u64);
    let last = report.stages[report.stages.len() - 1];
    assert!(last.estimate > 0.0 && report.error_estimate.unwrap().total <= report.settings.error);
    assert!(last.passes > 0 && last.seconds >= 0.0);
    assert_eq!(report.elements_by_level.iter().sum::<u64>(), report.elements);
    assert!(solution.hierarchy().links.is_empty());
    let other = solved(&shipped("cornell"), &paper());
    assert!(other.transport().is_none());
    let report = other.report();
    assert!(report.bf_epsilon.is_some() && report.fragments.is_some() && report.counts.is_some());
    assert!(report.stages.is_empty() && report.error_estimate.is_none() && report.clusters == 0);
}

/// Catches a mesh of other values than the answers: away from the borders of leaves both are the same up to how the
/// fields bulge and differ from each other.
#[test]
fn mesh_and_answers_agree() {
    let solution = solved(&shipped("cornell"), &asked(0.05));
    let (mesh, scene) = (solution.mesh(), solution.scene());
    let total: f64 = scene.polygons.iter().map(|polygon| polygon.area).sum();
    let (mut square, mut sum) = (0.0, 0.0);
    for (index, polygon) in scene.polygons.iter().enumerate() {
        let root = isolux::core::tree::ElementId(index as u32);
        let mut mean = Rgb::ZERO;
        for &triangle in &mesh.triangles[mesh.triangles_of(index as u32)] {
            let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
            let area = 0.5 * (b - a).cross(c - a).length();
            mean += triangle.iter().map(|&vertex| mesh.irradiance[vertex as usize]).sum::<Rgb>() * (area / 3.0);
        }
        let off = mean.mean() / polygon.area - solution.hierarchy().light.irradiance(root).mean();
        square += polygon.area * off * off;
        sum += polygon.area * solution.hierarchy().light.irradiance(root).mean();
    }
    let off = (square / total).sqrt() / (sum / total);
    assert!(off < 0.05, "{off}");
}

/// Catches a dark seam where a box stands on a floor: vertices that something covers take the light beside them.
#[test]
fn covered_vertices_are_not_dark() {
    let mut input = lit_box(0.5);
    let object = input.object("box");
    input.outside_of_box(object, 0, v(0.9, 0.0, 0.6), v(1.3, 0.3, 0.9));
    let solution = solved(&scene(input), &asked(0.05));
    let mesh = solution.mesh();
    let floor = solution
        .scene()
        .polygons
        .iter()
        .position(|polygon| polygon.plane.normal.y > 0.9 && polygon.corners.iter().all(|corner| corner.y == 0.0));
    let floor = mesh.vertices_of(floor.unwrap() as u32);
    // What is dark lies under the box: nobody sees it.
    let is_under = |at: DVec3| 0.9 < at.x && at.x < 1.3 && 0.6 < at.z && at.z < 0.9;
    let mut vertices = mesh.positions[floor.clone()].iter().zip(&mesh.irradiance[floor]);
    assert!(vertices.all(|(&at, value)| value.mean() > 0.0 || is_under(at)));
}

/// Catches a setting of one schedule that the other takes without a word.
#[test]
fn settings_of_the_other_schedule_are_refused() {
    let refused = |settings: &Settings| match solve(scene(lit_box(0.5)), settings, &mut Unobserved) {
        Err(SolveError::Settings(error)) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let cases = [
        (
            Settings { bf_epsilon: Some(0.01), ..draft() },
            "setting 'bf_epsilon' is 0.01: belongs to schedule 'sequential'",
        ),
        (
            Settings { rays: Rays::TwoHundredFiftySix, ..draft() },
            "setting 'rays' is 256: belongs to schedule 'sequential'",
        ),
        (Settings { max_iterations: 3, ..draft() }, "setting 'max_iterations' is 3: belongs to schedule 'sequential'"),
        (Settings { dark: Some(0.1), ..paper() }, "setting 'dark' is 0.1: belongs to schedule 'wavefront'"),
        (Settings { memory: Some(1), ..paper() }, "setting 'memory' is 1: belongs to schedule 'wavefront'"),
    ];
    for (settings, message) in cases {
        assert_eq!(refused(&settings), message);
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for (name, settings) in [
            ("dark", Settings { dark: Some(bad), ..draft() }),
            ("min_area", Settings { min_area: Some(bad), ..draft() }),
            ("time", Settings { time: Some(bad), ..draft() }),
        ] {
            assert_eq!(settings.validate().unwrap_err().name(), name);
        }
    }
    let none = Settings { max_elements: Some(0), ..draft() }.validate().unwrap_err();
    assert!(matches!(none, SettingsError::Value { name: "max_elements", .. }));
}

/// Catches elements that are split below what was asked for.
#[test]
fn elements_are_no_smaller_than_asked() {
    let settings = Settings { min_area: Some(1e-3), ..asked(0.2) };
    let solution = solved(&scene(lit_box(0.5)), &settings);
    let least =
        solution.hierarchy().elements.as_slice().iter().map(|element| element.area).fold(f64::INFINITY, f64::min);
    assert!(least > 1e-3 / 4.0 * solution.scene().area() * (1.0 - 1e-9), "{least}");
    assert_eq!(solution.report().area_epsilon, 1e-3 * solution.scene().area());
}

/// Stops at the first question of a phase.
struct StopAt(Phase);

impl Observer for StopAt {
    fn observe(&mut self, progress: &Progress) -> Flow {
        if progress.phase == self.0 { Flow::Stop } else { Flow::Continue }
    }
}

/// Catches a cancelled solve that is broken, dark, or cannot be stored, whenever it was stopped.
#[test]
fn cancelled_solves_are_sound_and_reopen() {
    for phase in [Phase::Tree, Phase::Iteration] {
        let solution = solve(shipped("cornell"), &asked(0.05), &mut StopAt(phase)).unwrap();
        assert_eq!(solution.report().status, Status::Cancelled);
        assert_eq!((&solution.report().energy, &solution.report().row_sum), (&None, &None));
        solution.check().unwrap();
        let back = Solution::from_record(solution.to_record()).unwrap();
        for solution in [&solution, &back] {
            solution.check().unwrap();
            let brightest = solution.mesh().radiosity.iter().map(|value| value.mean()).fold(0.0, f64::max);
            assert!(brightest > 0.0);
        }
        assert_eq!(back.report(), solution.report());
    }
}
