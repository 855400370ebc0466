//! What the audit reports of scenes with one known fault each, and what it leaves alone.

#![allow(clippy::unwrap_used, reason = "tests")]

mod inputs;

use inputs::{Make, box_faces, built, empty, grey, v};
use isolux_core::DVec3;
use isolux_core::audit::{audit, coplanar_overlaps, flipped_faces, t_joints};
use isolux_core::scene::{Issue, IssueKind, Scene, SceneInput, Severity};
use proptest::prelude::*;

/// An input with a grey material (index 0) and a lamp's (index 1).
fn furnished() -> SceneInput {
    let mut input = empty();
    input.material("grey", grey(0.5, 0.0));
    input.material("glow", grey(0.0, 10.0));
    input
}

/// A room of 4 x 3 x 5 m with a lamp, as a box, that every wall sees; its walls are object 0.
fn room() -> SceneInput {
    let mut input = furnished();
    let walls = input.object("walls");
    input.inside_of_box(walls, 0, DVec3::ZERO, v(4.0, 3.0, 5.0));
    let lamp = input.object("lamp");
    input.outside_of_box(lamp, 1, v(1.0, 2.0, 1.0), v(1.1, 2.1, 1.1));
    input
}

/// Turns faces round.
fn flip(input: &mut SceneInput, faces: impl IntoIterator<Item = usize>) {
    for face in faces {
        input.faces[face].corners.reverse();
    }
}

/// Adds a chair of seat, back and four legs, its feet at `floor`; the range of its faces.
fn chair(input: &mut SceneInput, at: DVec3) -> std::ops::Range<usize> {
    let first = input.faces.len();
    let object = input.object("chair");
    let mut part = |low: DVec3, high: DVec3| input.outside_of_box(object, 0, at + low, at + high);
    part(v(0.0, 0.45, 0.0), v(0.45, 0.5, 0.45));
    part(v(0.0, 0.55, 0.0), v(0.45, 1.0, 0.04));
    for (x, z) in [(0.0, 0.0), (0.41, 0.0), (0.0, 0.41), (0.41, 0.41)] {
        part(v(x, 0.0, z), v(x + 0.04, 0.449, z + 0.04));
    }
    first..input.faces.len()
}

fn said(issues: &[Issue]) -> Vec<(Severity, IssueKind, &str)> {
    issues.iter().map(|issue| (issue.severity, issue.kind, issue.object.as_str())).collect()
}

/// The count that a message starts with.
fn count(issue: &Issue) -> usize {
    issue.message.split(' ').next().unwrap().parse().unwrap()
}

fn flipped_count(scene: &Scene) -> usize {
    flipped_faces(scene).iter().map(count).sum()
}

/// Moves and scales all corners: what is found must not depend on where a scene lies or how large it is.
fn placed(mut input: SceneInput, scale: f64, turn: f64, shift: DVec3) -> SceneInput {
    let (sin, cos) = turn.sin_cos();
    for corner in input.faces.iter_mut().flat_map(|face| &mut face.corners) {
        let [x, y, z] = corner.to_array();
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        *corner = v(x, cos * y - sin * z, sin * y + cos * z) * scale + shift;
    }
    input
}

// Flipped faces

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Catches a flipped wall that is missed, and a sound one that is blamed for its neighbours, in closed rooms of any
    /// proportions (to 1 : 8) and any place, for every subset of walls: exactly these are reported, since every wall
    /// sees the lamp.
    #[test]
    fn exactly_the_flipped_walls_of_a_lit_room_are_reported(
        subset in 0_usize..64, sides in [0.5..4.0, 0.5..4.0, 0.5..4.0_f64], at in [0.1..0.8, 0.1..0.8, 0.1..0.8_f64],
        turn in 0.0..6.0_f64, scale in prop::sample::select(vec![1e-3, 1.0, 1e3]),
    ) {
        let mut input = furnished();
        let sides = DVec3::from_array(sides);
        for (number, wall) in box_faces(DVec3::ZERO, sides).into_iter().enumerate() {
            let object = input.object(&format!("wall {number}"));
            input.face(object, 0, &wall);
        }
        let lamp = input.object("lamp");
        let low = DVec3::from_array(at) * sides;
        input.outside_of_box(lamp, 1, low, low + sides.min_element() * 0.1);
        let wrong = || (0..6).filter(|wall| subset >> wall & 1 == 1);
        flip(&mut input, wrong());
        let scene = built(placed(input, scale, turn, v(3.0, -2.0, 1.0) * scale));
        let expected: Vec<String> = wrong().map(|wall| format!("wall {wall}")).collect();
        let found: Vec<String> = flipped_faces(&scene).into_iter().map(|issue| issue.object).collect();
        prop_assert_eq!(found, expected);
    }

    /// Catches the same where nothing emits and rays count sides: with one wall flipped in a room of up to 1 : 2, its back
    /// sees nothing but lit sides and no other wall's back sees any.
    #[test]
    fn a_flipped_wall_of_a_dark_room_is_reported(wrong in 0_usize..7, sides in [1.0..2.0, 1.0..2.0, 1.0..2.0_f64]) {
        let mut input = furnished();
        for (number, wall) in box_faces(DVec3::ZERO, DVec3::from_array(sides)).into_iter().enumerate() {
            let object = input.object(&format!("wall {number}"));
            input.face(object, 0, &wall);
        }
        flip(&mut input, (0..6).filter(|&wall| wall == wrong));
        let found: Vec<String> = flipped_faces(&built(input)).into_iter().map(|issue| issue.object).collect();
        let expected: Vec<String> = (0..6).filter(|&wall| wall == wrong).map(|wall| format!("wall {wall}")).collect();
        prop_assert_eq!(found, expected);
    }
}

/// Catches an object that is inside out and passes, since its fronts see each other; and one that is right and does not.
#[test]
fn an_object_that_is_inside_out_in_a_lit_room_is_reported() {
    let mut input = room();
    let faces = chair(&mut input, v(2.0, 0.0, 2.0));
    let right = built(input.clone());
    assert!(flipped_faces(&right).is_empty());
    flip(&mut input, faces);
    let scene = built(input);
    let issues = flipped_faces(&scene);
    assert_eq!(said(&issues), [(Severity::Warning, IssueKind::FlippedFace, "chair")]);
    // All but those whose backs see no light, right or wrong: 4 undersides of feet on the floor, 4 tops of legs a
    // millimetre below the seat, the underside of the back 5 cm above it, which sees the seat's black back.
    assert_eq!(count(&issues[0]), 36 - 9, "{}", issues[0].message);
    assert!(issues[0].message.contains("of 36 polygons") && issues[0].message.contains("face 24"), "{issues:?}");
}

/// Catches a box in the open that is taken for flipped though it is right, whatever is around; one that is inside out
/// on lit ground and passes; and the undecidable case decided: alone, it is a room.
#[test]
fn a_box_in_the_open() {
    for (ground, lamp, inside_out, expected) in [
        (false, false, false, 0),
        (false, false, true, 0),
        (false, true, false, 0),
        (true, false, false, 0),
        (true, true, false, 0),
        // All but the bottom, which touches the ground.
        (true, true, true, 5),
    ] {
        let mut input = furnished();
        let thing = input.object("box");
        input.outside_of_box(thing, 0, v(-0.5, 0.0, -0.5), v(0.5, 1.0, 0.5));
        if inside_out {
            flip(&mut input, 0..6);
        }
        if ground {
            let object = input.object("ground");
            input.face(object, 0, &[v(-9.0, 0.0, -9.0), v(-9.0, 0.0, 9.0), v(9.0, 0.0, 9.0), v(9.0, 0.0, -9.0)]);
        }
        if lamp {
            let object = input.object("lamp");
            input.face(object, 1, &[v(1.0, 3.0, 1.0), v(2.0, 3.0, 1.0), v(2.0, 3.0, 2.0), v(1.0, 3.0, 2.0)]);
        }
        let scene = built(input);
        assert_eq!(flipped_count(&scene), expected, "ground {ground}, lamp {lamp}, inside out {inside_out}");
    }
}

/// Catches black backs blamed that nobody sees, though what they look at is lit elsewhere: of a flat box without its
/// underside on the floor, of a picture before a wall, of a roof on walls without a floor.
#[test]
fn hidden_backs_are_no_fault() {
    let mut input = room();
    let low = input.object("rug");
    input.outside_of_box(low, 0, v(2.0, 0.0, 2.0), v(3.5, 0.01, 4.0));
    input.faces.remove(input.faces.len() - 4);
    let picture = input.object("picture");
    input.face(picture, 0, &[v(2.0, 1.0, 0.02), v(3.0, 1.0, 0.02), v(3.0, 2.0, 0.02), v(2.0, 2.0, 0.02)]);
    assert!(flipped_faces(&built(input)).is_empty());

    let mut input = furnished();
    let hall = input.object("hall");
    input.outside_of_box(hall, 0, v(-9.0, 0.0, -9.0), v(9.0, 3.0, 9.0));
    input.faces.remove(2);
    let ground = input.object("ground");
    input.face(ground, 0, &[v(-30.0, 0.0, -30.0), v(-30.0, 0.0, 30.0), v(30.0, 0.0, 30.0), v(30.0, 0.0, -30.0)]);
    let sun = input.object("sun");
    input.face(sun, 1, &[v(0.0, 50.0, 0.0), v(9.0, 50.0, 0.0), v(9.0, 50.0, 9.0), v(0.0, 50.0, 9.0)]);
    assert!(flipped_faces(&built(input)).is_empty());
}

/// Catches a lamp that shines out of its room and passes, and two-sided walls that are blamed.
#[test]
fn lamps_are_asked_by_what_they_see_and_two_sided_walls_not_at_all() {
    let mut input = furnished();
    let walls = input.object("walls");
    input.inside_of_box(walls, 0, DVec3::ZERO, v(2.0, 2.0, 2.0));
    input.objects.push(isolux_core::scene::Object { name: "ceiling lamp".into() });
    input.faces[3].object = 1;
    input.faces[3].material = 1;
    assert!(flipped_faces(&built(input.clone())).is_empty());
    flip(&mut input, [3]);
    assert_eq!(said(&flipped_faces(&built(input))), [(Severity::Warning, IssueKind::FlippedFace, "ceiling lamp")]);

    let mut input = room();
    flip(&mut input, [0, 2]);
    assert_eq!(flipped_count(&built(input.clone())), 2);
    input.materials[0].two_sided = true;
    assert!(flipped_faces(&built(input)).is_empty());
}

// T-joints

/// A rectangle in the plane z = 0, front up.
fn tile(input: &mut SceneInput, object: u32, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2]) {
    input.face(object, 0, &[v(x0, y0, 0.0), v(x1, y0, 0.0), v(x1, y1, 0.0), v(x0, y1, 0.0)]);
}

/// One tile above two, in one object or two; the corner between the two is `off` above the upper one's edge.
fn one_above_two(second_object: bool, off: f64) -> SceneInput {
    let mut input = furnished();
    let object = input.object("wall");
    let other = if second_object { input.object("other") } else { object };
    tile(&mut input, object, [0.0, 1.0], [2.0, 2.0]);
    input.face(other, 0, &[v(0.0, 0.0, 0.0), v(0.8, 0.0, 0.0), v(0.8, 1.0 + off, 0.0), v(0.0, 1.0, 0.0)]);
    input.face(other, 0, &[v(0.8, 0.0, 0.0), v(2.0, 0.0, 0.0), v(2.0, 1.0, 0.0), v(0.8, 1.0 + off, 0.0)]);
    input
}

/// Catches a T-joint that is missed at some scale or place, and the wrong faces or place told.
#[test]
fn a_corner_inside_a_neighbours_edge_is_reported() {
    for (scale, turn) in [(1.0, 0.0), (1e-3, 0.7), (1e3, 2.0)] {
        let issues = t_joints(&built(placed(one_above_two(false, 0.0), scale, turn, DVec3::ZERO)));
        assert_eq!(said(&issues), [(Severity::Warning, IssueKind::TJoint, "wall")], "{scale} {turn}");
        assert_eq!(count(&issues[0]), 1);
    }
    let issues = t_joints(&built(one_above_two(false, 0.0)));
    let place = "a corner of face 2 inside an edge of face 0 at 0.8000, 1.0000, 0.0000 m";
    assert!(issues[0].message.contains(place), "{}", issues[0].message);
}

/// Catches a tolerance other than the one that is promised, 1e-6 of the diameter: half of it still touches, four times
/// as much is a gap.
#[test]
fn touching_is_ruled_by_the_scenes_tolerance() {
    let tolerance = built(one_above_two(false, 0.0)).tolerance();
    for (off, expected) in [(0.5, 1), (-0.5, 1), (4.0, 0), (-4.0, 0)] {
        let issues = t_joints(&built(one_above_two(false, off * tolerance)));
        assert_eq!(issues.len(), expected, "{off} tolerances: {issues:?}");
    }
}

/// Catches reports on what is sound: other objects, shared edges, boxes that touch within an object, single touches.
#[test]
fn what_stands_against_something_is_no_t_joint() {
    assert!(t_joints(&built(one_above_two(true, 0.0))).is_empty());

    let mut grid = furnished();
    let object = grid.object("grid");
    for (x, y) in (0..9).map(|k| (f64::from(k % 3), f64::from(k / 3))) {
        tile(&mut grid, object, [x, y], [x + 1.0, y + 1.0]);
    }
    assert!(t_joints(&built(grid)).is_empty());

    // A box whose bottom edges run along the edges of the one below, in one object.
    let mut stack = furnished();
    let object = stack.object("stack");
    stack.outside_of_box(object, 0, DVec3::ZERO, v(3.0, 1.0, 1.0));
    stack.outside_of_box(object, 0, v(1.0, 1.0, 0.0), v(2.0, 2.0, 1.0));
    assert!(t_joints(&built(stack)).is_empty());

    // A point that touches an edge.
    let mut point = furnished();
    let object = point.object("point");
    tile(&mut point, object, [0.0, 0.0], [2.0, 1.0]);
    point.face(object, 0, &[v(1.0, 1.0, 0.0), v(1.5, 2.0, 0.0), v(0.5, 2.0, 0.0)]);
    assert!(t_joints(&built(point)).is_empty());
}

/// Catches creases and outlines that warn like seams within a surface, and a joint that several corners count twice.
#[test]
fn creases_and_outlines_are_notes() {
    let mut crease = one_above_two(false, 0.0);
    for corner in crease.faces[1..].iter_mut().flat_map(|face| &mut face.corners) {
        *corner = v(corner.x, 1.0, 1.0 - corner.y);
    }
    assert_eq!(said(&t_joints(&built(crease))), [(Severity::Note, IssueKind::TJoint, "wall")]);

    // Two books of different height.
    let mut outline = furnished();
    let object = outline.object("books");
    tile(&mut outline, object, [0.0, 0.0], [1.0, 2.0]);
    tile(&mut outline, object, [1.0, 0.0], [2.0, 1.0]);
    let issues = t_joints(&built(outline));
    assert_eq!(said(&issues), [(Severity::Note, IssueKind::TJoint, "books")]);
    assert_eq!(count(&issues[0]), 1);
}

/// Catches a line per joint, and a count that misses or doubles some: bricks, each row moved by a third.
#[test]
fn t_joints_are_one_line_for_an_object() {
    let mut input = furnished();
    let object = input.object("bricks");
    let (rows, columns) = (40, 50);
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let (x, y) = (f64::from(column) + if row % 2 == 0 { 0.0 } else { 0.375 }, f64::from(row));
        tile(&mut input, object, [x, y], [x + 1.0, y + 1.0]);
    }
    let issues = t_joints(&built(input));
    // Between two rows, each of the 2 * 49 + 1 + 1 corners that have a neighbour lies inside an edge of the other row;
    // the last edges on both sides are free in part.
    let found: Vec<_> = issues.iter().map(|issue| (issue.severity, count(issue))).collect();
    let seams = (rows as usize) - 1;
    assert_eq!(found, [(Severity::Warning, seams * 2 * 49), (Severity::Note, seams * 2)]);
}

// Coplanar overlaps

/// A floor with a smaller tile of another object at height `z`.
fn rug(z: f64) -> SceneInput {
    let mut input = furnished();
    let (floor, rug) = (input.object("floor"), input.object("rug"));
    tile(&mut input, floor, [0.0, 0.0], [4.0, 4.0]);
    input.face(rug, 0, &[v(1.0, 1.0, z), v(3.0, 1.5, z), v(2.5, 3.0, z), v(1.0, 3.0, z)]);
    input
}

/// Catches an overlap that is missed at some scale or place, told twice, or told of the wrong object.
#[test]
fn a_rug_in_the_plane_of_the_floor_is_reported() {
    for (scale, turn) in [(1.0, 0.0), (1e-3, 0.7), (1e3, 2.0)] {
        let issues = coplanar_overlaps(&built(placed(rug(0.0), scale, turn, DVec3::ZERO)));
        assert_eq!(said(&issues), [(Severity::Warning, IssueKind::CoplanarOverlap, "rug")], "{scale} {turn}");
        let named = issues[0].message.contains("face 2 with face 0 of 'floor'");
        assert!(count(&issues[0]) == 1 && named, "{}", issues[0].message);
    }
    // Half a tolerance apart they are in one plane, four of them are a gap.
    let tolerance = built(rug(0.0)).tolerance();
    assert_eq!(coplanar_overlaps(&built(rug(0.5 * tolerance))).len(), 1);
    assert!(coplanar_overlaps(&built(rug(4.0 * tolerance))).is_empty());
}

/// Catches reports on what is sound: a box that stands on the floor, a sheet modelled by a polygon for each side,
/// two-sided surfaces, neighbours.
#[test]
fn what_faces_away_or_lies_beside_is_no_overlap() {
    let mut standing = furnished();
    let (floor, thing) = (standing.object("floor"), standing.object("box"));
    standing.face(floor, 0, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 4.0), v(4.0, 0.0, 4.0), v(4.0, 0.0, 0.0)]);
    standing.outside_of_box(thing, 0, v(1.0, 0.0, 1.0), v(2.0, 1.0, 2.0));
    standing.materials[0].two_sided = true;
    assert!(coplanar_overlaps(&built(standing)).is_empty());

    let mut sheet = rug(0.0);
    flip(&mut sheet, [1]);
    assert!(coplanar_overlaps(&built(sheet)).is_empty());
    assert!(coplanar_overlaps(&built(one_above_two(false, 0.0))).is_empty());
}

/// Catches a threshold other than the one that is promised, 1 % of the smaller polygon, and thin neighbours whose common
/// edge is off by as much as touching allows.
#[test]
fn an_overlap_is_more_than_a_hundredth_of_the_smaller() {
    for (share, expected) in [(0.005, 0), (0.02, 1)] {
        let mut input = furnished();
        let object = input.object("tiles");
        tile(&mut input, object, [0.0, 0.0], [4.0, 4.0]);
        tile(&mut input, object, [4.0 - share, 1.0], [5.0 - share, 2.0]);
        assert_eq!(coplanar_overlaps(&built(input)).len(), expected, "{share}");
    }
    let mut input = furnished();
    let object = input.object("tiles");
    tile(&mut input, object, [0.0, 0.0], [4.0, 4.0]);
    let tolerance = 4.0 * 2.0_f64.sqrt() * 1e-6;
    tile(&mut input, object, [4.0 - 2.0 * tolerance, 0.0], [4.0 + 2.0 * tolerance, 4.0]);
    assert!(coplanar_overlaps(&built(input)).is_empty());
}

/// Catches one line for each of many faces that are there twice, and equal ones that are each blamed on the other.
#[test]
fn faces_that_are_there_twice_are_one_line() {
    let mut input = furnished();
    let (one, two) = (input.object("one"), input.object("two"));
    for object in [one, two] {
        for k in 0..30 {
            tile(&mut input, object, [f64::from(k), 0.0], [f64::from(k) + 1.0, 1.0]);
        }
    }
    let issues = coplanar_overlaps(&built(input));
    assert_eq!(said(&issues), [(Severity::Warning, IssueKind::CoplanarOverlap, "two")]);
    assert_eq!(count(&issues[0]), 30);
}

// All of them

/// Catches a finding left out of the whole, notes before warnings, and an order that changes.
#[test]
fn the_audit_tells_all_worst_first() {
    let mut input = room();
    flip(&mut input, [1]);
    let rug = input.object("rug");
    input.face(rug, 0, &[v(1.0, 0.0, 1.0), v(1.0, 0.0, 2.0), v(2.0, 0.0, 2.0), v(2.0, 0.0, 1.0)]);
    let books = input.object("books");
    let book = |x: f64, height: f64| [v(x, 0.5, 2.0), v(x + 0.1, 0.5, 2.0), v(x + 0.1, height, 2.0), v(x, height, 2.0)];
    input.face(books, 0, &book(1.0, 1.0));
    input.face(books, 0, &book(1.1, 0.8));
    let scene = built(input);
    let issues = audit(&scene);
    let expected = [
        (Severity::Warning, IssueKind::FlippedFace, "walls"),
        (Severity::Warning, IssueKind::CoplanarOverlap, "rug"),
        (Severity::Note, IssueKind::TJoint, "books"),
    ];
    assert_eq!(said(&issues), expected);
    assert_eq!(audit(&scene), issues);
    assert!(scene.issues.is_empty(), "the audit is asked for, not part of building");
}
