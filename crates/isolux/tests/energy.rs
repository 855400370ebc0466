//! Where the emitted power goes, as the report tells it: closed rooms keep it, open ones lose what geometry says.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::inputs::{Make, box_faces, empty, grey, v};
use common::{draft, paper, path_ends, scene, shipped, solved};
use isolux::core::scene::SceneInput;
use isolux::{Changes, Energy, Settings, Solution};

fn asked(error: f64) -> Settings {
    Settings { error, ..draft() }
}

fn energy(solution: &Solution) -> Energy {
    solution.report().energy.unwrap()
}

/// Share of what is emitted that leaves the scene, and that ends on black backs.
fn lost(energy: &Energy) -> (f64, f64) {
    let emitted = energy.emitted.mean();
    (energy.escaped.mean() / emitted, energy.lost_to_backs.mean() / emitted)
}

/// Two unit squares one metre apart, the lower one lit; the upper one shows it its black front, or its back.
fn squares(back: bool) -> SceneInput {
    let mut input = empty();
    let (lower, upper) = (input.object("lower"), input.object("upper"));
    let (glow, black) = (input.material("glow", grey(0.0, 1.0)), input.material("black", grey(0.0, 0.0)));
    input.face(lower, glow, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0), v(1.0, 0.0, 0.0)]);
    let mut corners = [v(0.0, 1.0, 0.0), v(1.0, 1.0, 0.0), v(1.0, 1.0, 1.0), v(0.0, 1.0, 1.0)];
    if back {
        corners.reverse();
    }
    input.face(upper, black, &corners);
    input
}

/// Form factor of two unit squares one metre apart: Howell C-11, X = Y = 1; see scenes/squares.json.
const BETWEEN_SQUARES: f64 = 0.199_824_895_698;

/// Catches light that is lost or made in closed rooms, and losses where nothing can be lost.
#[test]
fn closed_rooms_keep_what_is_emitted() {
    // Measured over five seeds, at most: 0.0006, -0.0035, -0.0058, -0.0040, -0.0043; asked for 0.03, the corridor is 0.01 too
    // dark. An empty room has nothing that hides what it is asked for.
    for (name, most) in
        [("furnace", 0.005), ("two_rooms", 0.01), ("corridor", 0.01), ("lamps", 0.01), ("leaks/contact", 0.01)]
    {
        let solution = solved(&shipped(name), &asked(0.02));
        let energy = energy(&solution);
        assert!(energy.imbalance.abs() < most, "{name}: {energy:?}");
        let (escaped, to_backs) = lost(&energy);
        // One ray of 16,384 may start closer to an edge than what counts as touching, and miss the wall there. A bright place's
        // carries up to 3.5e-4: over eight seeds none or two of them.
        assert!(escaped + to_backs < 1e-3, "{name}: {energy:?}");
    }
}

/// Catches losses of the wrong size or kind: of what a square throws, another one gets its form factor, on a black front or
/// on a back, and the rest leaves.
#[test]
fn squares_lose_what_their_form_factor_says() {
    for back in [false, true] {
        let solution = solved(&scene(squares(back)), &asked(0.01));
        let energy = energy(&solution);
        let (escaped, to_backs) = lost(&energy);
        // Of 16,384 rays, 4 standard deviations of a share of a fifth.
        assert!((escaped - (1.0 - BETWEEN_SQUARES)).abs() < 0.0125, "{energy:?}");
        let expected = if back { BETWEEN_SQUARES } else { 0.0 };
        assert!((to_backs - expected).abs() <= if back { 0.0125 } else { 0.0 }, "{energy:?}");
        assert!(energy.imbalance.abs() < 0.01 + 4.0 * energy.standard_error, "{energy:?}");
    }
}

/// A box of 2 x 1 x 1.5 without a lid, with a lamp on one wall.
fn open_box(reflectance: f64) -> SceneInput {
    let mut input = empty();
    let (walls, lamp) = (input.object("walls"), input.object("lamp"));
    let (paint, glow) = (input.material("paint", grey(reflectance, 0.0)), input.material("glow", grey(0.0, 10.0)));
    let faces = box_faces(v(0.0, 0.0, 0.0), v(2.0, 1.0, 1.5));
    // No lid; the wall at x = 2 has the lamp in its lower part.
    for index in [0, 2, 4, 5] {
        input.face(walls, paint, &faces[index]);
    }
    let strip = |low: f64, high: f64| [v(2.0, low, 0.0), v(2.0, low, 1.5), v(2.0, high, 1.5), v(2.0, high, 0.0)];
    input.face(walls, paint, &strip(0.4, 1.0));
    input.face(lamp, glow, &strip(0.0, 0.4));
    input
}

/// Paths of light: a half of them comes out within 0.6 %, four standard deviations.
const PATHS: usize = 100_000;

/// Catches losses that are not those of the scene: from a box without a lid what leaves is what paths of light say that know
/// neither elements nor links.
#[test]
fn a_box_without_a_lid_loses_what_paths_say() {
    for reflectance in [0.0, 0.7] {
        let scene = scene(open_box(reflectance));
        let energy = energy(&solved(&scene, &asked(0.03)));
        let ends = path_ends(&scene, PATHS);
        let expected = ends.iter().filter(|end| end.is_none()).count() as f64 / PATHS as f64;
        let deviation = (expected * (1.0 - expected) / PATHS as f64).sqrt();
        let noise = 4.0 * energy.standard_error.hypot(deviation);
        let (escaped, to_backs) = lost(&energy);
        // What is reflected is off by what was asked for, at most.
        assert!((escaped - expected).abs() < noise + 0.03 * reflectance * expected, "{expected}: {energy:?}");
        assert_eq!(to_backs, 0.0);
        assert!(energy.imbalance.abs() < 0.01 + 4.0 * energy.standard_error, "{energy:?}");
    }
}

/// A known gap of the paper's schedule, asserted to persist: where faces lie on each other and face the same way, all of them
/// receive light and throw it, so that it is there twice. The balance tells. The rug and the overlap of the wall's pieces are
/// 5 % of all surfaces, in the brightest places. With `wavefront` the later one counts alone (`overlaps.rs`).
#[test]
fn with_the_papers_schedule_faces_in_one_place_count_twice() {
    let solution = solved(&shipped("leaks/coplanar"), &Settings { error: 0.1, ..paper() });
    let energy = energy(&solution);
    // Measured 0.176.
    assert!((0.15..0.25).contains(&energy.imbalance), "{energy:?}");
}

/// Catches links that count light twice or not at all: what all links of a leaf account for is all of a closed room, and as
/// much of an open one as there is.
#[test]
fn links_account_for_what_there_is() {
    for name in ["furnace", "cube"] {
        let rows = solved(&shipped(name), &asked(0.03)).report().row_sum.clone().unwrap();
        assert!((rows.mean - 1.0).abs() < 0.01, "{name}: {rows:?}");
    }
    let rows = solved(&scene(squares(false)), &asked(0.01)).report().row_sum.clone().unwrap();
    assert!((rows.mean / BETWEEN_SQUARES - 1.0).abs() < 0.01, "{rows:?}");
    assert!(rows.smallest <= rows.mean && rows.mean <= rows.largest, "{rows:?}");
}

/// Catches a balance of other lamps than those that are lit.
#[test]
fn relit_solutions_have_no_balance() {
    let solution = solved(&shipped("cornell"), &asked(0.2));
    let name = solution.report().groups.as_ref().unwrap().groups[0].name.clone();
    let dimmed = |weight: f64| {
        let changes = Changes { weights: vec![(name.clone(), [weight; 3])], ..Changes::default() };
        solution.relight(&changes).unwrap()
    };
    assert_eq!(dimmed(0.5).report().energy, None);
    assert_eq!(dimmed(0.5).report().row_sum, solution.report().row_sum);
    assert_eq!(dimmed(1.0).report().energy, solution.report().energy);
}
