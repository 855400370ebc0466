//! The one door into a scene: what it joins, mends, refuses and says.

#![allow(clippy::unwrap_used, reason = "tests")]

mod inputs;

use inputs::{Make, built, empty, grey, plain, v, with_uv};
use isolux_core::scene::{
    Alpha, AlphaMask, BuildOptions, Camera, Corners, Image, Issue, IssueKind, Lamp, LampShape, Material, Object, Pole,
    Projection, Scene, SceneError, SceneInput, Severity, Side, Surface, Texture, Web, Wrap,
};
use isolux_core::units::{Rgb, Unit};
use isolux_core::{DVec2, DVec3};
use proptest::prelude::*;

fn build(input: SceneInput) -> Result<Scene, SceneError> {
    Scene::build(input, &BuildOptions::default())
}

fn issues_of(scene: &Scene, kind: IssueKind) -> Vec<&Issue> {
    scene.issues.iter().filter(|issue| issue.kind == kind).collect()
}

/// Corners of the unit square in the plane z = 0, front up.
fn square() -> [DVec3; 4] {
    [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)]
}

/// Two triangles (as corner indices of `points`) of one object and material.
fn two_triangles(points: &[DVec3], one: [usize; 3], two: [usize; 3]) -> SceneInput {
    let mut input = plain();
    for picks in [one, two] {
        input.face(0, 0, &picks.map(|pick| points[pick]));
    }
    input
}

/// The set of corners, for comparison without order.
fn sorted(corners: &Corners) -> Vec<[f64; 3]> {
    let mut corners: Vec<[f64; 3]> = corners.iter().map(|corner| corner.to_array()).collect();
    corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
    corners
}

// Joining

/// Catches a pair that is missed for the way its shared edge is numbered, a quad whose diagonal is not that edge, and
/// faces that do not name the quad: all 9 rotations of the pair.
#[test]
fn every_rotation_of_a_triangle_pair_is_joined() {
    for turn_one in 0..3 {
        for turn_two in 0..3 {
            let (mut one, mut two) = ([0, 1, 2], [0, 2, 3]);
            one.rotate_left(turn_one);
            two.rotate_left(turn_two);
            let scene = built(two_triangles(&square(), one, two));
            assert_eq!((scene.polygons.len(), scene.joined), (1, 1), "{one:?} {two:?}");
            let quad = &scene.polygons[0];
            assert_eq!(quad.faces, [0, 1]);
            assert_eq!(scene.face_polygon, [0, 0]);
            assert_eq!(quad.area, 1.0);
            assert_eq!(quad.plane.normal, DVec3::Z);
            assert_eq!(sorted(&quad.corners), sorted(&Corners::from_slice(&square()).unwrap()));
            let diagonal = [quad.corners[0], quad.corners[2]];
            assert!(diagonal.contains(&v(0.0, 0.0, 0.0)) && diagonal.contains(&v(1.0, 1.0, 0.0)));
        }
    }
}

/// Catches a third triangle drawn into a pair, and pairs counted from the wrong triangle after a single one.
#[test]
fn triangles_pair_in_file_order() {
    let p = square();
    let far = v(5.0, 0.0, 0.0);
    let mut input = plain();
    input.face(0, 0, &[far, far + DVec3::X, far + DVec3::Y]);
    input.face(0, 0, &[p[0], p[1], p[2]]);
    input.face(0, 0, &[p[0], p[2], p[3]]);
    input.face(0, 0, &[p[0], p[3], v(-1.0, 1.0, 0.0)]);
    let scene = built(input);
    let faces: Vec<[u32; 2]> = scene.polygons.iter().map(|polygon| polygon.faces).collect();
    assert_eq!(faces, [[0, Scene::NO_POLYGON], [1, 2], [3, Scene::NO_POLYGON]]);
    assert_eq!(scene.face_polygon, [0, 1, 1, 2]);
    assert_eq!(scene.joined, 1);
}

/// Catches joining what would not be a planar convex quadrilateral, or what does not share an edge with the same
/// orientation: concave, folded by 0.6 degrees, a flat corner, one triangle flipped, only a corner in common.
#[test]
fn what_makes_no_convex_plane_quad_stays_apart() {
    let concave = [v(0.0, 0.0, 0.0), v(2.0, -1.0, 0.0), v(0.5, 0.0, 0.0), v(2.0, 1.0, 0.0)];
    let mut folded = square();
    folded[3].z = 0.01;
    let flat_corner = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 1.0, 0.0)];
    let p = square();
    let cases = [
        ("concave", two_triangles(&concave, [0, 1, 2], [0, 2, 3])),
        ("folded", two_triangles(&folded, [0, 1, 2], [0, 2, 3])),
        ("flat corner", two_triangles(&flat_corner, [0, 1, 3], [1, 2, 3])),
        ("flipped", two_triangles(&p, [0, 1, 2], [0, 3, 2])),
        (
            "corner only",
            two_triangles(&[p[0], p[1], p[2], v(-1.0, 0.0, 0.0), v(-1.0, -1.0, 0.0)], [0, 1, 2], [0, 3, 4]),
        ),
    ];
    for (what, input) in cases {
        let scene = built(input);
        assert_eq!((scene.polygons.len(), scene.joined), (2, 0), "{what}");
        assert_eq!(scene.face_polygon, [0, 1], "{what}");
    }
}

/// Catches two things joined into one: different objects, different materials, or when joining is not wanted.
#[test]
fn triangles_of_different_objects_or_materials_stay_apart() {
    let joinable = || two_triangles(&square(), [0, 1, 2], [0, 2, 3]);
    let mut objects = joinable();
    objects.faces[1].object = objects.object("other");
    assert_eq!(built(objects).polygons.len(), 2);
    let mut materials = joinable();
    materials.faces[1].material = materials.material("other", grey(0.5, 1.0));
    assert_eq!(built(materials).polygons.len(), 2);
    let apart = Scene::build(joinable(), &BuildOptions { join: false }).unwrap();
    apart.check().unwrap();
    assert_eq!(apart.polygons.len(), 2);
}

/// Catches joining across a seam of texture coordinates, or where the second triangle's map is another, or where only
/// one has any; and refusing where the coordinates do continue.
#[test]
fn texture_seams_keep_triangles_apart() {
    let joined = |one: Option<[[f64; 2]; 3]>, two: Option<[[f64; 2]; 3]>| {
        let mut input = two_triangles(&square(), [0, 1, 2], [0, 2, 3]);
        for (face, uv) in [one, two].into_iter().enumerate() {
            if let Some(uv) = uv {
                with_uv(&mut input, face as u32, &uv);
            }
        }
        built(input).polygons.len() == 1
    };
    let first = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]];
    assert!(joined(Some(first), Some([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]])), "continues");
    assert!(!joined(Some(first), Some([[0.5, 0.0], [1.5, 1.0], [0.5, 1.0]])), "seam");
    assert!(!joined(Some(first), Some([[0.0, 0.0], [1.0, 1.0], [0.3, 0.6]])), "another map");
    assert!(!joined(Some(first), None), "one without");
}

/// Catches texture coordinates that are mixed up when a quad starts at another corner than its triangles: the map at
/// a point must be that of the file.
#[test]
fn joined_quads_keep_their_texture_map() {
    let p = [v(0.0, 0.0, 0.0), v(3.0, 0.0, 0.0), v(3.0, 2.0, 0.0), v(0.0, 2.0, 0.0)];
    let map = |point: DVec3| [0.1 + 0.2 * point.x, 0.7 - 0.3 * point.y];
    let mut input = two_triangles(&p, [1, 2, 0], [3, 0, 2]);
    with_uv(&mut input, 0, &[map(p[1]), map(p[2]), map(p[0])]);
    with_uv(&mut input, 1, &[map(p[3]), map(p[0]), map(p[2])]);
    input.materials[0].two_sided = true;
    let scene = built(input);
    assert_eq!((scene.fronts, scene.polygons.len()), (1, 2));
    for polygon in 0..2 {
        for point in [v(0.3, 0.4, 0.0), v(2.9, 1.5, 0.0), p[3]] {
            let uv = scene.texture_coordinates(polygon, point).unwrap();
            // Rounding of a 2 x 2 system with entries of about 10.
            assert!((uv - DVec2::from(map(point))).abs().max_element() < 1e-14, "{polygon} {point}");
        }
    }
}

/// Catches a joined quad that takes the first triangle's averaged texture for the whole: values are means by area.
#[test]
fn joined_triangles_average_their_surfaces() {
    // Areas 1 and 3 of a trapezium-like quad.
    let p = [v(0.0, 0.0, 0.0), v(1.0, -2.0, 0.0), v(2.0, 0.0, 0.0), v(1.0, 3.0, 0.0)];
    let mut input = two_triangles(&p, [0, 1, 2], [0, 2, 3]);
    input.faces[0].surface = Some(grey(0.2, 5.0));
    input.faces[1].surface = Some(grey(0.7, 0.0));
    let scene = built(input);
    assert_eq!(scene.polygons.len(), 1);
    let polygon = &scene.polygons[0];
    // Areas are 2 and 3.
    assert!((polygon.reflectance[0] - 0.5).abs() < 1e-15);
    assert!((scene.emitted_power()[1] - 2.0 * 5.0).abs() < 1e-14);
}

// Faces

/// Catches quads that count as one face: the face index would then be off for all that follow.
#[test]
fn a_quad_counts_as_two_faces() {
    let p = square();
    let up = |point: DVec3| point + DVec3::Z;
    let mut input = plain();
    input.face(0, 0, &p);
    input.face(0, 0, &[up(p[0]), up(p[1]), up(p[2])]);
    input.face(0, 0, &p.map(|point| up(up(point))));
    let scene = built(input);
    assert_eq!(scene.face_polygon, [0, 0, 1, 2, 2]);
    assert_eq!(scene.triangles[0], [p[0], p[1], p[2]]);
    assert_eq!(scene.triangles[1], [p[0], p[2], p[3]]);
    assert_eq!(scene.triangles[2], [up(p[0]), up(p[1]), up(p[2])]);
    assert_eq!(scene.position(1, [0.5, 0.25, 0.25]), v(0.25, 0.5, 0.0));
    let holder = &scene.polygons[scene.face_polygon[4] as usize];
    assert_eq!(holder.faces, [3, 4]);
}

/// Catches a quad that is taken for plane where it is not, and silence about it; also a concave one.
#[test]
fn bent_quads_are_cut_and_said() {
    let mut bent = square();
    bent[2].z = 0.1;
    let concave = [v(0.0, 0.0, 5.0), v(2.0, -1.0, 5.0), v(0.5, 0.0, 5.0), v(2.0, 1.0, 5.0)];
    for corners in [bent, concave] {
        let mut input = plain();
        input.face(0, 0, &corners);
        let scene = built(input);
        let issues = issues_of(&scene, IssueKind::NonPlanarQuad);
        assert_eq!(issues.len(), 1);
        assert_eq!((issues[0].object.as_str(), issues[0].severity), ("thing", Severity::Warning));
        assert!(scene.polygons.iter().all(|polygon| polygon.corners.len() == 3));
    }
}

/// Catches degenerate faces that stay, that shift the face index of the others, that are not said, or that make one
/// line each.
#[test]
fn faces_without_area_are_dropped_and_counted() {
    let p = square();
    let mut input = plain();
    let other = input.object("needle box");
    input.face(0, 0, &p);
    input.face(other, 0, &[p[0], p[1], p[1]]);
    input.face(other, 0, &[p[0], p[0].lerp(p[2], 0.5), p[2]]);
    input.face(other, 0, &[p[3]; 4]);
    input.face(0, 0, &p.map(|point| point + DVec3::Z));
    let scene = built(input);
    assert_eq!(scene.face_polygon, [0, 0, u32::MAX, u32::MAX, u32::MAX, u32::MAX, 1, 1]);
    let issues = issues_of(&scene, IssueKind::DegenerateFace);
    assert_eq!(issues.len(), 1);
    assert_eq!(issues[0].object, "needle box");
    assert!(issues[0].message.contains("face 2"), "{}", issues[0].message);
}

/// Catches a drop by area instead of height: a strip of 1 mm along 10 m is a surface, one of a nanometre is none.
#[test]
fn thin_strips_are_kept_down_to_the_tolerance() {
    let strip = |height: f64| {
        let mut input = plain();
        input.face(0, 0, &[v(0.0, 0.0, 0.0), v(10.0, 0.0, 0.0), v(10.0, height, 0.0), v(0.0, height, 0.0)]);
        input.face(0, 0, &square().map(|point| point + DVec3::Z));
        built(input).fronts
    };
    assert_eq!(strip(1e-3), 2);
    assert_eq!(strip(1e-9), 1);
}

/// Catches a scene of nothing that is let in, or that is refused without the count.
#[test]
fn a_scene_without_surfaces_is_an_error() {
    assert_eq!(build(plain()).unwrap_err(), SceneError::Empty { dropped: 0, invisible: 0 });
    let mut input = plain();
    input.face(0, 0, &[v(1.0, 1.0, 1.0); 3]);
    assert_eq!(build(input).unwrap_err(), SceneError::Empty { dropped: 1, invisible: 0 });
}

// What is refused

/// Catches NaN or infinity that gets in through any coordinate, and errors that do not name object and face.
#[test]
fn coordinates_that_are_not_numbers_name_object_and_face() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for corner in 0..4 {
            for axis in 0..3 {
                let mut input = plain();
                input.face(0, 0, &square());
                let mut corners = square();
                corners[corner][axis] = bad;
                let object = input.object("broken");
                input.face(object, 0, &corners);
                let error = build(input).unwrap_err();
                assert_eq!(error, SceneError::NotFinite { object: "broken".into(), face: 1 });
                assert!(error.to_string().contains("broken"));
            }
        }
    }
    let mut input = plain();
    let face = input.face(0, 0, &square());
    with_uv(&mut input, face, &[[0.0, 0.0], [1.0, f64::NAN], [1.0, 1.0], [0.0, 1.0]]);
    assert_eq!(build(input).unwrap_err(), SceneError::NotFinite { object: "thing".into(), face: 0 });
}

/// Catches coordinates that are finite in the file and overflow in metres.
#[test]
fn coordinates_that_overflow_in_metres_are_refused() {
    let mut input = plain();
    input.metres_per_unit = 1e10;
    input.face(0, 0, &square().map(|point| point * 1e300));
    assert_eq!(build(input).unwrap_err(), SceneError::NotFinite { object: "thing".into(), face: 0 });
}

/// Catches indices that are followed without a look, each kind: object, material, mask, image.
#[test]
fn indices_out_of_range_name_their_holder() {
    let base = || {
        let mut input = plain();
        input.face(0, 0, &square());
        input
    };
    let mut object = base();
    object.faces[0].object = 7;
    let mut material = base();
    material.faces[0].material = 3;
    let mut mask = base();
    mask.materials[0].alpha = Alpha::Mask(2);
    let mut image = base();
    image.materials[0].texture = Some(Texture { image: 1, factor: Rgb::ONE, wrap: [Wrap::Repeat; 2] });
    let cases = [
        (object, "object", "face 0", 7, 1),
        (material, "material", "thing", 3, 1),
        (mask, "mask", "paint", 2, 0),
        (image, "image", "paint", 1, 0),
    ];
    for (input, what, holder, index, count) in cases {
        let expected = SceneError::OutOfRange { what, object: holder.into(), index, count };
        assert_eq!(build(input).unwrap_err(), expected);
    }
}

/// Catches polygons of two or five corners that get in.
#[test]
fn faces_have_three_or_four_corners() {
    for count in [0, 1, 2, 5] {
        let mut input = plain();
        input.face(0, 0, &vec![DVec3::ZERO; count]);
        let expected = SceneError::CornerCount { object: "thing".into(), face: 0, corners: count };
        assert_eq!(build(input).unwrap_err(), expected);
    }
}

/// Catches a list of texture coordinates that is shorter than the corners.
#[test]
fn texture_coordinates_are_as_many_as_corners() {
    let mut input = plain();
    let face = input.face(0, 0, &square());
    with_uv(&mut input, face, &[[0.0, 0.0]; 3]);
    assert!(matches!(build(input), Err(SceneError::NotFinite { face: 0, .. })));
}

/// Catches material values that poison every radiosity.
#[test]
fn material_values_that_are_not_numbers_are_refused() {
    let nan = Rgb([0.1, f64::NAN, 0.1]);
    let surface = grey(0.5, 1.0);
    let cases = [
        (Surface { reflectance: nan, ..surface }, "reflectance"),
        (Surface { emission: nan, ..surface }, "emission"),
        (Surface { opacity: f64::INFINITY, ..surface }, "opacity"),
    ];
    for (surface, what) in cases {
        let mut by_material = plain();
        by_material.face(0, 0, &square());
        by_material.materials[0].surface = surface;
        let mut by_face = plain();
        by_face.face(0, 0, &square());
        by_face.faces[0].surface = Some(surface);
        for input in [by_material, by_face] {
            let expected = SceneError::MaterialNotFinite { material: "paint".into(), what };
            assert_eq!(build(input).unwrap_err(), expected);
        }
    }
}

/// Catches a length unit of nothing.
#[test]
fn units_are_positive_lengths() {
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut input = plain();
        input.face(0, 0, &square());
        input.metres_per_unit = scale;
        assert!(matches!(build(input), Err(SceneError::Unit { .. })), "{scale}");
    }
}

// What is mended and said

/// Catches a reflectance of 1 or more that gets in (the solve would never settle), silence about it, and clamping of
/// what is allowed.
#[test]
fn reflectances_of_one_are_clamped_and_said() {
    let mut input = plain();
    input.face(0, 0, &square());
    input.materials[0].surface.reflectance = Rgb([1.0, 0.999, 3.5]);
    let scene = built(input);
    assert_eq!(scene.polygons[0].reflectance, Rgb([0.99, 0.999, 0.99]));
    let issues = issues_of(&scene, IssueKind::ReflectanceClamped);
    assert_eq!(issues.len(), 1);
    assert_eq!(issues[0].object, "paint");
    assert!(issues[0].message.contains("3.5"), "{}", issues[0].message);
}

/// Catches an opacity that lets more light pass than arrives, or less than none, believed or mended in silence; at the
/// material and at a face, with and without a mask.
#[test]
fn opacities_out_of_range_are_clamped_and_said() {
    for (opacity, clamped) in [(1.5, 1.0), (-0.5, 0.0)] {
        for masked in [false, true] {
            let surface = Surface { opacity, ..grey(0.2, 1.0) };
            let mut by_material = plain();
            by_material.face(0, 0, &square());
            by_material.face(0, 0, &square().map(|corner| corner + DVec3::Z));
            by_material.materials[0].alpha = if masked { Alpha::Mask(0) } else { Alpha::Attenuate };
            by_material.masks.push(AlphaMask {
                width: 1,
                height: 1,
                cutoff: 0.5,
                solid: vec![true],
                wrap: [Wrap::Repeat; 2],
            });
            by_material.faces[0].surface = Some(Surface { opacity: 0.5, ..surface });
            let mut by_face = by_material.clone();
            by_material.materials[0].surface = surface;
            by_face.faces[1].surface = Some(surface);
            for input in [by_material, by_face] {
                let scene = built(input);
                let issues = issues_of(&scene, IssueKind::OpacityClamped);
                assert_eq!(issues.len(), 1);
                assert_eq!((issues[0].object.as_str(), issues[0].severity), ("paint", Severity::Warning));
                assert!(issues[0].message.contains(&opacity.to_string()), "{}", issues[0].message);
                // The holes of a mask do not shine, so what is nothing but holes is left out.
                let is_left_out = masked && clamped == 0.0;
                let found: Vec<f64> = scene.polygons.iter().map(|polygon| polygon.opacity).collect();
                assert_eq!(found, if is_left_out { vec![0.5] } else { vec![0.5, clamped] });
                assert_eq!(issues_of(&scene, IssueKind::Ignored).len(), usize::from(is_left_out));
            }
        }
    }
}

/// Catches a mask whose texels end before its claimed size does: the first ray through it would read beyond them.
#[test]
fn masks_have_the_texels_that_they_claim() {
    for (width, height, texels) in [(2, 2, 3), (2, 2, 5), (0, 2, 0), (u32::MAX, u32::MAX, 1)] {
        let mut input = plain();
        input.face(0, 0, &square());
        input.materials[0].alpha = Alpha::Mask(0);
        input.masks.push(AlphaMask { width, height, cutoff: 0.5, solid: vec![true; texels], wrap: [Wrap::Repeat; 2] });
        let expected = SceneError::MaskSize { material: "paint".into(), mask: 0, width, height, texels };
        assert_eq!(build(input).unwrap_err(), expected);
    }
}

/// Catches negative light.
#[test]
fn negative_values_are_set_to_zero_and_said() {
    let mut input = plain();
    input.face(0, 0, &square());
    input.materials[0].surface.reflectance = Rgb([-0.5, 0.5, 0.5]);
    input.materials[0].surface.emission = Rgb([1.0, -3.0, 1.0]);
    let scene = built(input);
    assert_eq!(scene.polygons[0].reflectance, Rgb([0.0, 0.5, 0.5]));
    assert_eq!(scene.polygons[0].emission, Rgb([1.0, 0.0, 1.0]));
    let issues = issues_of(&scene, IssueKind::NegativeValue);
    assert!(issues.len() == 1 && issues[0].message.contains("-3"), "{issues:?}");
}

/// Catches darkness that is not announced, and an announcement where there is light.
#[test]
fn scenes_without_light_are_said() {
    let mut input = plain();
    input.face(0, 0, &square());
    assert!(issues_of(&built(input.clone()), IssueKind::NoLight).is_empty());
    input.materials[0].surface.emission = Rgb::ZERO;
    assert_eq!(issues_of(&built(input), IssueKind::NoLight).len(), 1);
}

fn lamp(name: &str, shape: LampShape) -> Lamp {
    let (position, forward, side) = (v(1.0, 2.0, 3.0), v(0.0, -2.0, 0.0), v(3.0, 1.0, 0.0));
    Lamp { name: name.into(), position, forward, side, intensity: Rgb::splat(100.0), shape }
}

fn with_lamps(lamps: Vec<Lamp>) -> SceneInput {
    let mut input = plain();
    input.face(0, 0, &square());
    input.materials[0].surface.emission = Rgb::ZERO;
    SceneInput { lamps, metres_per_unit: 0.5, ..input }
}

/// Catches lamps that keep the file's unit or vectors of any length, equal names, and a scene lit by lamps that is called dark;
/// a scene whose lamps differ must not have the hash of another.
#[test]
fn lamps_are_admitted() {
    let scene = built(with_lamps(vec![lamp("bulb", LampShape::Point), lamp("bulb", LampShape::Parallel)]));
    assert!(issues_of(&scene, IssueKind::NoLight).is_empty());
    let [bulb, sun] = &scene.lamps[..] else { panic!("{:?}", scene.lamps) };
    assert_ne!(bulb.name, sun.name);
    assert_eq!((bulb.position, bulb.forward, bulb.side), (v(0.5, 1.0, 1.5), v(0.0, -1.0, 0.0), v(1.0, 0.0, 0.0)));
    assert_eq!(bulb.intensity, Rgb::splat(100.0));
    assert_eq!(scene.lamp_power(), Rgb::splat(400.0 * std::f64::consts::PI));
    assert_eq!(scene.emitted_power(), Rgb::ZERO);
    let other = built(with_lamps(vec![lamp("bulb", LampShape::Point)]));
    assert_ne!(scene.hash, other.hash);
    assert_ne!(other.hash, built(with_lamps(vec![])).hash);
    let web = |pole| Web { polar: vec![0.0, 90.0], around: vec![0.0], intensity: vec![1.0, 0.0], pole };
    let hashes = [Pole::Forward, Pole::Across, Pole::Aside]
        .map(|pole| built(with_lamps(vec![lamp("bulb", LampShape::Web(web(pole)))])).hash);
    assert!(hashes[0] != hashes[1] && hashes[0] != hashes[2] && hashes[1] != hashes[2]);
}

/// Catches lamps that would make the light not a number, or that throw nothing and are dropped in silence.
#[test]
fn lamps_that_make_no_sense_are_refused_or_said() {
    let refused = |change: &dyn Fn(&mut Lamp)| {
        let mut odd = lamp("odd", LampShape::Point);
        change(&mut odd);
        let message = build(with_lamps(vec![odd])).unwrap_err().to_string();
        assert!(message.starts_with("lamp 'odd': "), "{message}");
        message
    };
    assert!(refused(&|odd| odd.forward = DVec3::ZERO).contains("direction"));
    assert!(refused(&|odd| odd.position.x = f64::NAN).contains("finite"));
    assert!(refused(&|odd| odd.intensity = Rgb([f64::INFINITY, 0.0, 0.0])).contains("finite"));
    for (inner, outer) in [(0.5, 0.4), (-0.1, 0.4), (0.1, 1.7), (f64::NAN, 0.4)] {
        assert!(refused(&|odd| odd.shape = LampShape::Spot { inner, outer }).contains("cone"));
    }
    let web = |polar: &[f64], around: &[f64], intensity: &[f64]| {
        LampShape::Web(Web {
            polar: polar.into(),
            around: around.into(),
            intensity: intensity.into(),
            pole: Pole::Forward,
        })
    };
    for table in [
        web(&[0.0], &[0.0], &[1.0]),
        web(&[0.0, 90.0], &[0.0], &[1.0]),
        web(&[90.0, 0.0], &[0.0], &[1.0, 1.0]),
        web(&[0.0, 181.0], &[0.0], &[1.0, 1.0]),
        web(&[0.0, 90.0], &[0.0, 180.0], &[1.0; 4]),
        web(&[0.0, 90.0], &[0.0], &[1.0, -1.0]),
    ] {
        assert!(refused(&|odd| odd.shape = table.clone()).contains("table"), "{table:?}");
    }
    let dark = Lamp { intensity: Rgb([0.0, -1.0, 0.0]), ..lamp("dark", LampShape::Point) };
    let burnt_out = lamp("burnt out", web(&[0.0, 90.0], &[0.0], &[0.0, 0.0]));
    let scene = built(with_lamps(vec![dark, burnt_out]));
    assert!(scene.lamps.is_empty());
    assert!(issues_of(&scene, IssueKind::Ignored).iter().any(|issue| issue.object == "burnt out"));
    let said = |kind| issues_of(&scene, kind).iter().any(|issue| issue.object == "dark");
    assert!(said(IssueKind::Ignored) && said(IssueKind::NegativeValue));
    assert_eq!(issues_of(&scene, IssueKind::NoLight).len(), 1);
}

/// Catches what a reader found and said being lost.
#[test]
fn issues_of_the_reader_are_kept() {
    let mut input = plain();
    input.face(0, 0, &square());
    let message = "fog is ignored".to_owned();
    let issue = Issue { severity: Severity::Note, kind: IssueKind::Ignored, object: "fog".into(), message };
    input.issues.push(issue.clone());
    assert!(built(input).issues.contains(&issue));
}

// Sides, units, names, hash

/// Catches backs that are not the mirror image of their fronts, that come before fronts, or whose twin is another.
#[test]
fn two_sided_materials_make_twins() {
    let mut input = plain();
    input.materials[0].two_sided = true;
    let single = input.material("one-sided", grey(0.3, 0.0));
    input.face(0, single, &square());
    input.face(0, 0, &square().map(|point| point + DVec3::Z));
    input.face(0, 0, &[v(0.0, 0.0, 3.0), v(1.0, 0.0, 3.0), v(0.0, 1.0, 3.0)]);
    let scene = built(input);
    assert_eq!((scene.fronts, scene.polygons.len()), (3, 5));
    assert_eq!(scene.polygons[0].twin, None);
    for (front, back) in [(1, 3), (2, 4)] {
        let (p, q) = (&scene.polygons[front], &scene.polygons[back]);
        assert_eq!((p.side, q.side), (Side::Front, Side::Back));
        assert_eq!((p.twin, q.twin), (Some(back as u32), Some(front as u32)));
        assert_eq!(q.plane, p.plane.reversed());
        assert_eq!(q.corners.area_vector(), -p.corners.area_vector());
        assert_eq!((q.area, q.reflectance, q.emission, q.faces), (p.area, p.reflectance, p.emission, p.faces));
    }
    // Both sides shine.
    assert_eq!(scene.emitted_power()[0], 2.0 * 1.5);
    assert_eq!(scene.area(), 2.5);
}

/// Catches lengths that are not scaled: corners, faces, diameter, cameras; areas go with the square.
#[test]
fn coordinates_come_out_in_metres() {
    let made = |scale: f64| {
        let mut input = plain();
        input.metres_per_unit = scale;
        input.face(0, 0, &square());
        for projection in [Projection::Perspective { vertical_angle: 0.7 }, Projection::Orthographic { height: 3.0 }] {
            let (eye, forward, up) = (v(1.0, 2.0, 3.0), -DVec3::Z, DVec3::Y);
            input.cameras.push(Camera { name: "c".into(), eye, forward, up, projection });
        }
        built(input)
    };
    let (metres, halves) = (made(1.0), made(0.5));
    assert_eq!(halves.diameter, 0.5 * metres.diameter);
    assert_eq!(halves.polygons[0].area, 0.25 * metres.polygons[0].area);
    assert_eq!(halves.triangles[1][2], metres.triangles[1][2] * 0.5);
    assert_eq!(halves.cameras[0].eye, v(0.5, 1.0, 1.5));
    assert_eq!(halves.cameras[0].projection, metres.cameras[0].projection);
    assert_eq!(halves.cameras[1].projection, Projection::Orthographic { height: 1.5 });
}

/// Catches two objects or materials that a report could not tell apart, also where a made name is taken already.
#[test]
fn names_are_made_unique() {
    let mut input = empty();
    for name in ["lamp", "lamp", "lamp#2", "", ""] {
        input.objects.push(Object { name: name.into() });
        input.material(name, grey(0.5, 1.0));
    }
    input.face(0, 0, &square());
    let scene = built(input);
    let objects: Vec<&str> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(objects, ["lamp", "lamp#2", "lamp#2#2", "object 3", "object 4"]);
    let materials: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(materials, ["lamp", "lamp#2", "lamp#2#2", "material 3", "material 4"]);
}

/// Catches a solution that is taken for another scene's: the hash must change with every value that links or light
/// depend on, and with nothing else.
#[test]
fn the_hash_tells_scenes_apart_by_what_results_depend_on() {
    let base = || {
        let mut input = plain();
        let face = input.face(0, 0, &square());
        with_uv(&mut input, face, &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        input.materials[0].alpha = Alpha::Mask(0);
        let solid = vec![true, false, true, true];
        input.masks.push(AlphaMask { width: 2, height: 2, solid, cutoff: 0.5, wrap: [Wrap::Repeat; 2] });
        input
    };
    let hash = |change: &dyn Fn(&mut SceneInput)| {
        let mut input = base();
        change(&mut input);
        let scene = built(input);
        assert_eq!(scene.hash, scene.compute_hash());
        scene.hash
    };
    let original = hash(&|_| {});
    type Change = (&'static str, fn(&mut SceneInput));
    let seen: [Change; 13] = [
        ("corner", |input| input.faces[0].corners.iter_mut().for_each(|corner| corner.z += 1e-9)),
        ("length unit", |input| input.metres_per_unit = 1.5),
        ("unit of power", |input| input.unit = Unit::Radiometric),
        ("reflectance", |input| input.materials[0].surface.reflectance[2] += 1e-9),
        ("emission", |input| input.materials[0].surface.emission[0] += 1e-9),
        ("opacity", |input| input.materials[0].surface.opacity = 0.9),
        ("sides", |input| input.materials[0].two_sided = true),
        ("mask", |input| input.masks[0].solid[1] = true),
        ("wrap", |input| input.masks[0].wrap[1] = Wrap::Mirror),
        ("uv of the mask", |input| input.faces[0].uv.as_mut().unwrap().iter_mut().for_each(|uv| uv.x += 0.25)),
        ("object name", |input| input.objects[0].name = "other".into()),
        ("material name", |input| input.materials[0].name = "other".into()),
        ("unused material", |input| {
            input.material("unused", grey(0.1, 9.0));
        }),
    ];
    for (what, change) in seen {
        assert_ne!(hash(&change), original, "{what}");
    }
    let unseen: [Change; 3] = [
        ("scene name", |input| input.name = "other".into()),
        ("camera", |input| {
            let (name, projection) = ("eye".into(), Projection::Orthographic { height: 1.0 });
            input.cameras.push(Camera { name, eye: DVec3::ZERO, forward: DVec3::NEG_Z, up: DVec3::Y, projection });
        }),
        ("image", |input| {
            input.images.push(Image { name: "wood".into(), mime: "image/png".into(), bytes: vec![1] });
        }),
    ];
    for (what, change) in unseen {
        assert_eq!(hash(&change), original, "{what}");
    }
}

/// Catches anything that the built scene holds and the hash leaves out: each is changed by itself, as a damaged or
/// doctored file would.
#[test]
fn the_hash_covers_every_part_of_a_scene() {
    let mut input = two_triangles(&square(), [0, 1, 2], [0, 2, 3]);
    input.materials[0].two_sided = true;
    input.materials[0].alpha = Alpha::Mask(0);
    input.materials[0].texture = Some(Texture { image: 0, factor: Rgb::ONE, wrap: [Wrap::Repeat; 2] });
    input.images.push(Image { name: "wood".into(), mime: "image/png".into(), bytes: vec![1] });
    input.masks.push(AlphaMask { width: 2, height: 1, cutoff: 0.5, solid: vec![true, false], wrap: [Wrap::Repeat; 2] });
    let scene = built(input);
    type Change = (&'static str, fn(&mut Scene));
    let changes: [Change; 33] = [
        ("fronts", |scene| scene.fronts = 2),
        ("diameter", |scene| scene.diameter *= 1.0 + 1e-15),
        ("unit", |scene| scene.unit = Unit::Radiometric),
        ("triangles", |scene| scene.triangles[1][2].x += 1e-12),
        ("a triangle less", |scene| scene.triangles.truncate(1)),
        ("face_polygon", |scene| scene.face_polygon[1] = Scene::NO_POLYGON),
        ("object name", |scene| scene.objects[0].name.push('x')),
        ("material name", |scene| scene.materials[0].name.push('x')),
        ("material reflectance", |scene| scene.materials[0].surface.reflectance[1] += 1e-12),
        ("material emission", |scene| scene.materials[0].surface.emission[1] += 1e-12),
        ("material opacity", |scene| scene.materials[0].surface.opacity -= 1e-12),
        ("material sides", |scene| scene.materials[0].two_sided = false),
        ("material alpha", |scene| scene.materials[0].alpha = Alpha::Attenuate),
        ("texture", |scene| scene.materials[0].texture = None),
        ("texture image", |scene| scene.materials[0].texture.as_mut().unwrap().image = 1),
        ("texture factor", |scene| scene.materials[0].texture.as_mut().unwrap().factor[0] = 0.5),
        ("texture wrap", |scene| scene.materials[0].texture.as_mut().unwrap().wrap[0] = Wrap::Clamp),
        ("mask width", |scene| scene.masks[0].width = 1),
        ("mask height", |scene| scene.masks[0].height = 2),
        ("mask texel", |scene| scene.masks[0].solid[1] = true),
        ("mask wrap", |scene| scene.masks[0].wrap[0] = Wrap::Clamp),
        ("corner", |scene| scene.polygons[0].corners = scene.polygons[0].corners.reversed()),
        ("normal", |scene| scene.polygons[0].plane.normal.x += 1e-16),
        ("offset", |scene| scene.polygons[0].plane.offset += 1e-16),
        ("area", |scene| scene.polygons[0].area += 1e-12),
        ("reflectance", |scene| scene.polygons[1].reflectance[2] += 1e-12),
        ("emission", |scene| scene.polygons[1].emission[0] += 1e-12),
        ("opacity", |scene| scene.polygons[1].opacity -= 1e-12),
        ("polygon's mask", |scene| scene.polygons[1].mask = None),
        ("polygon's object", |scene| scene.polygons[1].object = 1),
        ("side", |scene| scene.polygons[1].side = Side::Front),
        ("twin", |scene| scene.polygons[0].twin = None),
        ("faces", |scene| scene.polygons[0].faces.reverse()),
    ];
    let mut hashes = std::collections::HashSet::from([scene.hash]);
    for (what, change) in changes {
        let mut changed = scene.clone();
        change(&mut changed);
        assert!(hashes.insert(changed.compute_hash()), "{what}");
    }
    let mut uv = scene.clone();
    uv.polygons[0].uv = Some([DVec2::ZERO; 4]);
    let mut material = scene.clone();
    material.polygons[0].material = 1;
    assert!(hashes.insert(uv.compute_hash()) && hashes.insert(material.compute_hash()));
}

/// Catches a check that looks at nothing: each tampering breaks one invariant and must be found.
#[test]
fn the_check_finds_what_was_tampered_with() {
    let mut input = plain();
    input.materials[0].two_sided = true;
    input.face(0, 0, &square());
    input.face(0, 0, &square().map(|point| point + DVec3::Z));
    let sound = built(input);
    type Tamper = (&'static str, fn(&mut Scene));
    let cases: [Tamper; 13] = [
        ("fronts come before backs", |scene| scene.fronts = 3),
        ("twins know each other", |scene| scene.polygons[2].twin = Some(1)),
        ("twins know each other", |scene| scene.polygons[2].twin = None),
        ("normals are of unit length", |scene| scene.polygons[0].plane.normal *= 1.001),
        ("corners lie in the plane", |scene| scene.polygons[0].plane.offset += 0.001),
        ("areas are positive", |scene| scene.polygons[0].area = f64::NAN),
        ("reflectance, emission and opacity are finite and not negative", |scene| {
            scene.polygons[0].emission = Rgb([1.0, f64::NAN, 1.0]);
        }),
        ("reflectance is below 1 and at most opacity", |scene| scene.polygons[0].reflectance = Rgb::ONE),
        ("reflectance is below 1 and at most opacity", |scene| scene.polygons[0].opacity = 0.25),
        ("faces and polygons name each other", |scene| scene.polygons[0].faces = [0, 2]),
        ("faces and polygons name each other", |scene| scene.face_polygon[0] = 1),
        ("faces and polygons name each other", |scene| scene.polygons[0].faces[1] = Scene::NO_POLYGON),
        ("triangles have corners of their polygon", |scene| scene.triangles[3][2].x = f64::NAN),
    ];
    for (what, tamper) in cases {
        let mut scene = sound.clone();
        tamper(&mut scene);
        assert_eq!(scene.check().unwrap_err().what, what);
    }
}

// Random scenes

/// A coordinate that often coincides with others, is often plain, and at times nearly another.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => (-2i32..=2).prop_map(f64::from),
        2 => -2.0..2.0f64,
        1 => (-2i32..=2, -9i32..-3).prop_map(|(whole, power)| f64::from(whole) + 10f64.powi(power)),
    ]
}

fn point() -> impl Strategy<Value = DVec3> {
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| v(x, y, z))
}

/// Corners of a face: any three or four points (bent, crossed, repeated), a parallelogram, a sliver.
fn corners() -> impl Strategy<Value = Vec<DVec3>> {
    prop_oneof![
        prop::collection::vec(point(), 3..=4),
        (point(), point(), point()).prop_map(|(a, b, c)| vec![a, b, b + c - a, c]),
        (point(), point(), point(), -9i32..-1)
            .prop_map(|(a, b, c, power)| { vec![a, b, b + (c - b) * 10f64.powi(power)] }),
    ]
}

fn surface() -> impl Strategy<Value = Surface> {
    let value = || prop_oneof![Just(0.0), Just(1.0), -0.5..2.0f64];
    (value(), value(), value()).prop_map(|(reflectance, emission, opacity)| Surface {
        reflectance: Rgb([reflectance, 0.5 * reflectance, 0.25]),
        emission: Rgb([emission, 0.0, emission]),
        opacity,
    })
}

fn any_input() -> impl Strategy<Value = SceneInput> {
    let faces = prop::collection::vec((corners(), 0u32..2, 0u32..2, prop::option::of(surface())), 1..24);
    let materials = prop::collection::vec((surface(), any::<bool>()), 2);
    let scale = prop_oneof![Just(1.0), Just(1e-3), Just(0.0254), Just(1e3)];
    (faces, materials, scale, any::<bool>()).prop_map(|(faces, materials, scale, repeat)| {
        let mut input = SceneInput { metres_per_unit: scale, ..empty() };
        input.object("one");
        input.object("two");
        for (surface, two_sided) in materials {
            input.materials.push(Material {
                name: "m".into(),
                surface,
                two_sided,
                alpha: Alpha::Opaque,
                texture: None,
            });
        }
        for (corners, object, material, surface) in &faces {
            let face = input.face(*object, *material, corners);
            input.faces[face as usize].surface = *surface;
        }
        if repeat {
            // Every face twice, the second time from the other side.
            for (corners, object, material, _) in &faces {
                let reversed: Vec<DVec3> = corners.iter().rev().copied().collect();
                input.face(*object, *material, &reversed);
            }
        }
        input
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, rng_seed: proptest::test_runner::RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

    /// Catches a panic on what files may hold, a scene that breaks its own invariants, a face that is neither held
    /// nor counted as dropped, and area that is lost or made by joining and cutting.
    #[test]
    fn any_input_makes_a_sound_scene_or_an_error(input in any_input(), join in any::<bool>()) {
        let faces: usize = input.faces.iter().map(|face| face.corners.len() - 2).sum();
        match Scene::build(input, &BuildOptions { join }) {
            Err(SceneError::Empty { dropped, invisible }) => prop_assert!(dropped + invisible <= faces),
            Err(error) => prop_assert!(false, "{error}"),
            Ok(scene) => {
                prop_assert_eq!(scene.check().map_err(|violation| violation.to_string()), Ok(()));
                prop_assert_eq!(scene.triangles.len(), faces);
                prop_assert_eq!(scene.face_polygon.len(), faces);
                let triangle_area = |face: usize| Corners::from_slice(&scene.triangles[face]).unwrap().area();
                let held: f64 = (0..faces)
                    .filter(|&face| scene.face_polygon[face] != Scene::NO_POLYGON)
                    .map(triangle_area)
                    .sum();
                // Quads are plane to 5e-7 of their coordinates (at most 4 units): their area is the triangles' to
                // that share at worst.
                prop_assert!((held - scene.area()).abs() <= 1e-5 * held, "{held} {}", scene.area());
                let dropped = scene.face_polygon.contains(&Scene::NO_POLYGON);
                let reasons = [IssueKind::DegenerateFace, IssueKind::Ignored];
                let told = reasons.into_iter().any(|kind| !issues_of(&scene, kind).is_empty());
                prop_assert_eq!(dropped, told);
            }
        }
    }
}
