//! Quadtrees of elements: splitting, finding, naming, and the check that watches over them.

#![allow(clippy::unwrap_used, reason = "tests")]

mod inputs;

use inputs::v;
use isolux_core::DVec3;
use isolux_core::sampling::Stream;
use isolux_core::scene::{Corners, Plane};
use isolux_core::tree::{Cut, Element, ElementId, Elements, Path};
use proptest::prelude::*;

fn plane_of(corners: &Corners) -> Plane {
    let normal = corners.area_vector().normalize();
    Plane { normal, offset: normal.dot(corners.mean()) }
}

fn tree(roots: &[Corners]) -> Elements {
    let elements = Elements::new(roots.iter().copied().zip(0..), roots.iter().map(plane_of).collect());
    elements.check().unwrap();
    elements
}

/// Least distance of a point to the border of a patch, positive inside, metres.
fn depth_inside(corners: &Corners, plane: &Plane, point: DVec3) -> f64 {
    let count = corners.len();
    let edges = (0..count).map(|k| (corners[k], corners[(k + 1) % count]));
    edges.map(|(a, b)| plane.normal.dot((b - a).cross(point - a)) / a.distance(b)).fold(f64::INFINITY, f64::min)
}

/// Catches quarters in the wrong places or of the wrong sense: positions of all corners, by hand.
#[test]
fn quarters_are_where_the_quadrants_say() {
    let quad = Corners::quad(v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0), v(4.0, 2.0, 0.0), v(0.0, 2.0, 0.0));
    let triangle = Corners::triangle(v(0.0, 0.0, 1.0), v(4.0, 0.0, 1.0), v(0.0, 4.0, 1.0));
    let mut elements = tree(&[quad, triangle]);
    let first = elements.split(ElementId(0));
    assert_eq!(first, ElementId(2));
    let corner = |id: u32, k: usize| elements.get(ElementId(id)).corners[k];
    for k in 0..4 {
        assert_eq!(corner(2 + k, k as usize), quad[k as usize], "quadrant {k} keeps corner {k}");
        assert_eq!(corner(2 + k, (k as usize + 2) % 4), v(2.0, 1.0, 0.0), "and has the middle opposite");
    }
    let first = elements.split(ElementId(1));
    let corners_of = |k: u32| elements.get(ElementId(first.0 + k)).corners;
    for k in 0..3 {
        assert_eq!(corners_of(k)[k as usize], triangle[k as usize]);
    }
    assert_eq!(corners_of(3), Corners::triangle(v(2.0, 2.0, 1.0), v(0.0, 2.0, 1.0), v(2.0, 0.0, 1.0)));
    elements.check().unwrap();
}

/// Catches strips in the wrong places, trees that forget how they were cut, points that are found in the wrong strip, and
/// corners that a neighbour in quarters does not have bit for bit.
#[test]
fn strips_stand_side_by_side() {
    let (a, b, c) = (v(0.1, 0.2, 0.3), v(7.3, 0.5, -0.2), v(7.5, 1.1, -0.1));
    let d = a + c - b;
    for (quad, cut) in [(Corners::quad(a, b, c, d), Cut::Along), (Corners::quad(b, c, d, a), Cut::Across)] {
        let mut elements = tree(&[quad, quad]);
        let first = elements.split_as(ElementId(0), cut);
        assert_eq!(elements.cut(ElementId(0)), cut);
        elements.check().unwrap();
        for k in 0..4 {
            let strip = elements.get(ElementId(first.0 + k));
            assert_eq!(elements.locate(ElementId(0), strip.corners.mean()), ElementId(first.0 + k));
            assert!(strip.corners.iter().all(|&corner| depth_inside(&quad, &plane_of(&quad), corner) > -1e-12));
            // The long side is quartered, the short one is as it was; rounding leaves 1e-15.
            let share = |side: usize| {
                strip.corners[side].distance(strip.corners[side + 1]) / quad[side].distance(quad[side + 1])
            };
            let long = usize::from(cut == Cut::Across);
            assert!((share(long) - 0.25).abs() < 1e-14 && (share(1 - long) - 1.0).abs() < 1e-14);
        }
        // Two levels of quarters have every corner of one level of strips.
        let quarters = elements.split(ElementId(1));
        for k in 0..4 {
            elements.split(ElementId(quarters.0 + k));
        }
        assert_eq!(elements.cut(ElementId(1)), Cut::Quarters);
        let corners = |root: u32| -> Vec<[u64; 3]> {
            let leaves = elements.as_slice().iter().filter(|node| node.polygon == root);
            leaves.flat_map(|node| node.corners.to_vec()).map(|corner| corner.to_array().map(f64::to_bits)).collect()
        };
        let shared: std::collections::HashSet<[u64; 3]> = corners(1).into_iter().collect();
        assert!(corners(0).iter().all(|corner| shared.contains(corner)), "{cut:?}");
    }
}

/// Catches a second split that adds children again, or leaves that are counted wrongly.
#[test]
fn splitting_twice_changes_nothing() {
    let mut elements = tree(&[Corners::quad(DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y)]);
    assert!(elements.is_leaf(ElementId(0)));
    let first = elements.split(ElementId(0));
    assert_eq!(elements.split(ElementId(0)), first);
    assert_eq!(elements.len(), 5);
    assert_eq!(elements.leaves().collect::<Vec<_>>(), (1..5).map(ElementId).collect::<Vec<_>>());
    assert_eq!(elements.children(ElementId(0)).count(), 4);
    assert_eq!(elements.children(first).count(), 0);
    assert_eq!(elements.roots(), 1);
}

/// Catches neighbours that disagree on the midpoint of their common edge by a rounding: meshes would have cracks.
#[test]
fn neighbours_share_corners_bit_for_bit() {
    let (a, b) = (v(0.1, 0.2, 0.3), v(0.7, -0.4, 1.1));
    let (c, d) = (v(1.3, 0.9, -0.2), v(-0.8, 0.5, 0.6));
    let one = Corners::triangle(a, b, c);
    let two = Corners::triangle(b, a, d);
    let mut elements = tree(&[one, two]);
    let corners_on_edge = |elements: &Elements, root: u32| {
        let leaves = elements.leaves().filter(|&id| elements.get(id).polygon == root);
        let corners = leaves.flat_map(|id| elements.get(id).corners.to_vec());
        let near = corners.filter(|corner| (b - a).cross(*corner - a).length() < 1e-12);
        let mut bits: Vec<[u64; 3]> = near.map(|corner| corner.to_array().map(f64::to_bits)).collect();
        bits.sort_unstable();
        bits.dedup();
        bits
    };
    for _ in 0..4 {
        for leaf in elements.leaves().collect::<Vec<_>>() {
            elements.split(leaf);
        }
    }
    elements.check().unwrap();
    let shared = corners_on_edge(&elements, 0);
    assert_eq!(shared.len(), 17);
    assert_eq!(shared, corners_on_edge(&elements, 1));
}

/// Catches a split below what a path can name.
#[test]
fn splitting_ends_where_paths_end() {
    let mut elements = tree(&[Corners::quad(DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y)]);
    let mut id = ElementId(0);
    for _ in 0..Path::MAX_DEPTH {
        assert!(elements.can_split(id));
        id = ElementId(elements.split(id).0 + 3);
    }
    assert!(!elements.can_split(id));
    elements.check().unwrap();
    assert_eq!(elements.locate(ElementId(0), v(1e-9, 1.0 - 1e-9, 0.0)), id);
}

/// Catches a check that looks at nothing: each tampering of stored nodes must be found.
#[test]
fn the_check_finds_what_was_tampered_with() {
    let square = Corners::quad(DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y);
    let mut sound = tree(&[square]);
    let first = sound.split(ElementId(0));
    sound.split(first);
    sound.check().unwrap();
    type Tamper = (&'static str, fn(&mut Vec<Element>));
    let cases: [Tamper; 13] = [
        ("areas are positive and those of the corners", |nodes| nodes[0].area = 0.0),
        ("areas are positive and those of the corners", |nodes| nodes[3].area = f64::NAN),
        ("areas are positive and those of the corners", |nodes| nodes[3].area *= 1.0 + 1e-9),
        ("areas are positive and those of the corners", |nodes| {
            nodes[3].corners = Corners::triangle(DVec3::NAN, DVec3::X, DVec3::Y);
        }),
        ("areas of children add up", |nodes| {
            (nodes[3].corners, nodes[3].area) = (nodes[5].corners, nodes[5].area);
        }),
        ("corners lie in the polygon's plane", |nodes| {
            let turned: Vec<DVec3> = nodes[3].corners.iter().map(|corner| v(corner.x, 0.5, corner.y)).collect();
            nodes[3].corners = Corners::from_slice(&turned).unwrap();
        }),
        ("children know parent, polygon and path", |nodes| nodes[2].parent = ElementId(1)),
        ("elements are roots or children of their parent", |nodes| nodes[0].path = Path::from_bits(u64::MAX)),
        ("elements are roots or children of their parent", |nodes| nodes[0].first_child = ElementId::NONE),
        ("children know parent, polygon and path", |nodes| nodes[1].first_child = ElementId(6)),
        ("children know parent, polygon and path", |nodes| nodes[2].path = nodes[3].path),
        ("children exist", |nodes| nodes[8].first_child = ElementId(9)),
        ("roots come first and only roots have no parent", |nodes| nodes.push(nodes[0].clone())),
    ];
    for (what, tamper) in cases {
        let mut nodes = sound.as_slice().to_vec();
        tamper(&mut nodes);
        let tampered = Elements::from_nodes(nodes, vec![plane_of(&square)]);
        assert_eq!(tampered.check().unwrap_err().what, what);
    }
}

/// A convex polygon: points of an ellipse in order, in a plane of any orientation, anywhere.
fn convex() -> impl Strategy<Value = Corners> {
    let angles = prop_oneof![prop::collection::vec(0.05..1.0f64, 3), prop::collection::vec(0.05..1.0f64, 4),];
    (angles, prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(-50.0..50.0f64), 0.02..1.0f64).prop_filter_map(
        "a plane has a direction",
        |(steps, normal, centre, flatness)| {
            let normal = DVec3::from(normal).try_normalize()?;
            let (x, y) = normal.any_orthonormal_pair();
            let total: f64 = steps.iter().sum();
            let mut angle = 0.0;
            let points: Vec<DVec3> = steps
                .iter()
                .map(|step| {
                    angle += step / total * std::f64::consts::TAU;
                    DVec3::from(centre) + x * angle.cos() + y * (flatness * angle.sin())
                })
                .collect();
            Corners::from_slice(&points)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, rng_seed: proptest::test_runner::RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

    /// Catches a sequence of splits that breaks an invariant, leaves that do not cover their root once, a point found
    /// in a leaf that does not hold it, and paths that repeat or sort a child before its parent.
    #[test]
    fn random_splits_keep_the_invariants(
        roots in prop::collection::vec(convex(), 1..4),
        picks in prop::collection::vec(any::<prop::sample::Index>(), 0..60),
        seed in any::<u64>(),
    ) {
        let mut elements = tree(&roots);
        for pick in picks {
            let leaves: Vec<ElementId> = elements.leaves().collect();
            let leaf = leaves[pick.index(leaves.len())];
            if elements.can_split(leaf) {
                elements.split(leaf);
            }
        }
        prop_assert_eq!(elements.check().map_err(|violation| violation.to_string()), Ok(()));
        let mut paths: Vec<Path> = elements.as_slice().iter().map(|element| element.path).collect();
        for element in elements.as_slice() {
            if let Some(parent) = element.parent.some() {
                prop_assert!(elements.get(parent).path < element.path);
                prop_assert_eq!(elements.get(parent).path.depth() + 1, element.path.depth());
            }
            prop_assert_eq!(element.path.root_index(), element.polygon);
            prop_assert_eq!(Path::from_bits(element.path.to_bits()), element.path);
        }
        paths.sort_unstable();
        paths.dedup();
        prop_assert_eq!(paths.len(), elements.len());
        let mut stream = Stream::new(seed);
        for (root, corners) in roots.iter().enumerate() {
            let root = ElementId(root as u32);
            let area: f64 = elements
                .leaves()
                .filter(|&leaf| elements.get(leaf).polygon == root.0)
                .map(|leaf| elements.get(leaf).area)
                .sum();
            // 60 splits lose 2^-52 of coordinates of 51 each.
            prop_assert!((area - corners.area()).abs() < 1e-12);
            let plane = plane_of(corners);
            for _ in 0..50 {
                let point = stream.point(corners, &plane);
                let leaf = elements.locate(root, point);
                prop_assert!(elements.is_leaf(leaf));
                prop_assert_eq!(elements.get(leaf).path.root_index(), root.0);
                let depth = depth_inside(&elements.get(leaf).corners, &plane, point);
                // Rounding of coordinates of 51: a point on a border may lie outside by some 2^-47.
                prop_assert!(depth > -1e-12, "{depth}");
            }
        }
    }
}
