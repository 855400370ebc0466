//! What a viewer is given: it says what the solution says, in its own layout.

#![allow(clippy::unwrap_used, clippy::cast_possible_truncation, reason = "tests")]

mod common;

use common::{draft, lit_box, paper, scene, shipped, solved};
use isolux::core::DVec3;
use isolux::core::links::Hierarchy;
use isolux::core::solution::Unobserved;
use isolux::core::tree::ElementId;
use isolux::core::units::Rgb;
use isolux::{Changes, Picture, Settings, Solution, ViewLimits};
use serde_json::Value;
use std::sync::mpsc::{TryRecvError, channel};
use std::time::Instant;

/// Data taken apart again, by the layout alone.
struct View {
    header: Value,
    body: Vec<u8>,
}

impl View {
    fn of(solution: &Solution, limits: &ViewLimits) -> View {
        View::read(&solution.view_data(limits))
    }

    fn read(bytes: &[u8]) -> View {
        assert_eq!(&bytes[..8], b"isoluxvw");
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!(word(12), 1);
        let end = 16 + word(8) as usize;
        assert_eq!(end % 8, 0);
        View { header: serde_json::from_slice(&bytes[16..end]).unwrap(), body: bytes[end..].to_vec() }
    }

    fn has(&self, name: &str) -> bool {
        self.header["arrays"].get(name).is_some()
    }

    /// Numbers of an array, row by row, whatever their type.
    fn rows(&self, name: &str) -> Vec<Vec<f64>> {
        let array = &self.header["arrays"][name];
        let shape: Vec<usize> = serde_json::from_value(array["shape"].clone()).unwrap();
        let start = array["offset"].as_u64().unwrap() as usize;
        assert_eq!(start % 8, 0, "{name}");
        let width: usize = shape[1..].iter().product();
        let (size, read): (usize, fn(&[u8]) -> f64) = match array["type"].as_str().unwrap() {
            "u8" => (1, |bytes| f64::from(bytes[0])),
            "u32" => (4, |bytes| f64::from(u32::from_le_bytes(bytes.try_into().unwrap()))),
            "f32" => (4, |bytes| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()))),
            "f64" => (8, |bytes| f64::from_le_bytes(bytes.try_into().unwrap())),
            other => panic!("{name}: {other}"),
        };
        let values: Vec<f64> = self.body[start..start + size * width * shape[0]].chunks(size).map(read).collect();
        values.chunks(width).map(<[f64]>::to_vec).collect()
    }

    fn column(&self, name: &str) -> Vec<f64> {
        self.rows(name).concat()
    }

    fn vector(&self, name: &str) -> DVec3 {
        DVec3::from_array(serde_json::from_value(self.header[name].clone()).unwrap())
    }
}

fn bands(row: &[f64]) -> Rgb {
    Rgb(row[..3].try_into().unwrap())
}

/// RMS of a difference over vertices, relative to the mean.
fn difference(found: &[Rgb], expected: &[Rgb]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let mean = expected.iter().map(|value| value.mean()).sum::<f64>() / expected.len() as f64;
    let square = found.iter().zip(expected).map(|(a, b)| (a.mean() - b.mean()).powi(2)).sum::<f64>();
    (square / expected.len() as f64).sqrt() / mean
}

/// Catches what is drawn of the dark side of a wall with light of the other side, at vertices that both have, in all light and
/// in that of each group: the wall has no thickness and stands at x = 2 m, where elements end.
#[test]
fn both_sides_of_a_wall_are_drawn_in_their_own_light() {
    let scene = shipped("leaks/thin_wall");
    for settings in [draft(), paper()] {
        let solution = solved(&scene, &Settings { error: 0.1, ..settings });
        let view = View::of(&solution, &ViewLimits::default());
        let origin = view.vector("origin");
        let places: Vec<f64> = view.rows("mesh/positions").iter().map(|row| row[0] + origin.x).collect();
        let light: Vec<f64> = view.rows("mesh/irradiance")[0].chunks(3).map(|row| bands(row).mean()).collect();
        let (mut dark, mut lit) = ((0, 0.0_f64), (0.0, 0.0));
        for triangle in view.rows("mesh/triangles") {
            let corners = [0, 1, 2].map(|k| triangle[k] as usize);
            let is_wall = corners.iter().all(|&corner| places[corner] < 2.0 + 1e-6);
            if !is_wall && corners.iter().all(|&corner| places[corner] > 2.0 - 1e-6) {
                let own = corners.map(|corner| light[corner]).into_iter().fold(0.0, f64::max);
                dark = (dark.0 + 1, dark.1.max(own));
            } else if corners.iter().all(|&corner| places[corner] < 1.9) {
                lit = (lit.0 + 1.0, lit.1 + light[corners[0]]);
            }
        }
        assert!(dark.0 > 10);
        // Measured 0.048 and 0.010; 0.65 and 0.95 where vertices on the wall's foot have both sides' light.
        assert!(dark.1 < 0.15 * lit.1 / lit.0, "{} {}", dark.1, lit.1 / lit.0);
    }
}

/// Catches an array that says something else than the solution, with either schedule: geometry, trees, surfaces, links.
#[test]
fn arrays_say_what_the_solution_says() {
    for settings in [draft(), paper()] {
        let scene = scene(lit_box(0.5));
        let solution = solved(&scene, &settings);
        let view = View::of(&solution, &ViewLimits::default());
        let mesh = solution.mesh();
        let origin = view.vector("origin");
        let positions = view.rows("mesh/positions");
        assert_eq!(positions.len(), mesh.positions.len());
        for (row, position) in positions.iter().zip(&mesh.positions) {
            // Half a unit in the last place of a metre, three times.
            assert!((DVec3::from_slice(row) + origin).distance(*position) < 1e-7 * scene.diameter);
        }
        let triangles: Vec<f64> = mesh.triangles.iter().flatten().map(|&vertex| f64::from(vertex)).collect();
        assert_eq!(view.column("mesh/triangles"), triangles);
        assert_eq!(view.column("mesh/triangle_start").len(), scene.polygons.len() + 1);
        let Hierarchy { elements, links, .. } = solution.hierarchy();
        let children: Vec<f64> = elements.as_slice().iter().map(|element| f64::from(element.first_child.0)).collect();
        assert_eq!(view.column("elements/first_child"), children);
        let roots = view.rows("roots/corners");
        for (row, root) in roots.iter().zip(&elements.as_slice()[..elements.roots()]) {
            let corners: Vec<f64> = root.corners.iter().flat_map(|corner| corner.to_array()).collect();
            assert_eq!(row[..corners.len()], corners);
        }
        for (row, polygon) in view.rows("polygons/reflectance").iter().zip(&scene.polygons) {
            assert!((bands(row) - polygon.reflectance).map(f64::abs).max_component() < 1e-7);
        }
        for (row, polygon) in view.rows("polygons/normal").iter().zip(&scene.polygons) {
            assert_eq!(row[..], polygon.plane.normal.to_array());
        }
        let start = view.column("links/start");
        let receivers: Vec<u32> = match solution.transport() {
            Some(transport) => transport.links.receiver.clone(),
            None => links.iter().map(|(receiver, _)| receiver.0).collect(),
        };
        assert_eq!(view.column("links/source").len(), receivers.len());
        for (link, &receiver) in receivers.iter().enumerate() {
            let own = start[receiver as usize] as usize..start[receiver as usize + 1] as usize;
            assert!(own.contains(&link), "link {link} of node {receiver}");
        }
        // Of parallel plates a metre apart no more than all arrives.
        assert!(view.column("links/factor").iter().all(|factor| (0.0..=4.0).contains(factor)));
        assert_eq!(view.has("elements/field"), solution.transport().is_some());
        assert_eq!(view.has("mesh/leaf"), solution.transport().is_none());
    }
}

/// Catches columns that were blended by another plan than the total, or that do not add up to it.
#[test]
fn columns_add_up_to_the_total() {
    let solution = solved(&shipped("room"), &draft());
    let view = View::of(&solution, &ViewLimits::default());
    let columns = view.rows("mesh/irradiance");
    let groups = view.header["groups"].as_array().unwrap();
    assert_eq!(groups.len(), 5);
    let vertices = solution.mesh().positions.len();
    let column = |group: usize| -> Vec<Rgb> { columns[group].chunks(3).map(bands).collect() };
    let mut sum = vec![Rgb::ZERO; vertices];
    for group in 0..groups.len() {
        sum.iter_mut().zip(column(group)).for_each(|(sum, value)| *sum += value);
    }
    let found = difference(&sum, &solution.mesh().irradiance);
    // Sums of single precision: measured 7e-8.
    assert!(found < 1e-6, "{found}");
    let mean = groups.iter().map(|group| bands(&floats(&group["mean_irradiance"]))).sum::<Rgb>();
    let told = solution.report().mean_irradiance;
    // Leaves that have less than nothing of a group are cut off one by one: measured 1.2e-5.
    assert!((mean - told).map(f64::abs).max_component() < 1e-4 * told.mean(), "{mean:?} {told:?}");

    // Another mix, which the solution makes itself.
    let (lamp, window) = ("desk lamp", "window");
    let weights = vec![(lamp.to_owned(), [2.0; 3]), (window.to_owned(), [0.25; 3])];
    let relit = solution.relight(&Changes { weights, ..Changes::default() }).unwrap();
    let mut mix = vec![Rgb::ZERO; vertices];
    for (group, told) in groups.iter().enumerate() {
        let weight = match told["name"].as_str().unwrap() {
            name if name == lamp => 2.0,
            name if name == window => 0.25,
            _ => 1.0,
        };
        mix.iter_mut().zip(column(group)).for_each(|(sum, value)| *sum += value * weight);
    }
    // What is dark is decided by the light as it was solved here, by the mix there: measured 1.2e-3.
    let found = difference(&mix, &relit.mesh().irradiance);
    assert!(found < 5e-3, "{found}");
    let shown = View::of(&relit, &ViewLimits::default());
    let row = groups.iter().position(|group| group["name"] == lamp).unwrap();
    assert_eq!(floats(&shown.header["groups"][row]["weight"]), [2.0; 3]);
}

fn floats(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

/// Catches fields or light of the wrong leaf.
#[test]
fn fields_are_those_of_the_leaves() {
    let solution = solved(&scene(lit_box(0.5)), &draft());
    let view = View::of(&solution, &ViewLimits::default());
    let transport = solution.transport().unwrap();
    let leaves: Vec<ElementId> = solution.hierarchy().elements.leaves().collect();
    assert_eq!(view.header["leaves"], leaves.len());
    let fields = view.rows("elements/field").concat();
    for (row, leaf) in leaves.iter().enumerate() {
        let own: Vec<f64> = transport.fields[leaf.index()].iter().flatten().map(|&value| f64::from(value)).collect();
        assert_eq!(fields[15 * row..15 * (row + 1)], own);
    }
}

/// Catches limits that are not kept, or that nothing is said about.
#[test]
fn what_is_too_much_is_left_out_and_told() {
    let solution = solved(&scene(lit_box(0.5)), &draft());
    let all = View::of(&solution, &ViewLimits::default());
    let some = View::of(&solution, &ViewLimits { links: 3, field_bytes: 100, groups: true });
    assert_eq!(all.header["left_out"], serde_json::json!({}));
    for name in ["links", "fields"] {
        assert!(some.header["left_out"][name].as_str().unwrap().contains("more than"), "{}", some.header["left_out"]);
    }
    assert!(!some.has("links/start") && !some.has("clusters/ball") && !some.has("elements/field"));
    // Each triangle lies in the leaf that it names.
    let elements = &solution.hierarchy().elements;
    let (leaf, half) = (some.column("mesh/leaf"), some.column("mesh/bilinear"));
    for (triangle, corners) in solution.mesh().triangles.iter().enumerate() {
        let element = elements.get(ElementId(leaf[triangle] as u32));
        assert!(elements.is_leaf(ElementId(leaf[triangle] as u32)));
        let middle = corners.iter().map(|&vertex| solution.mesh().positions[vertex as usize]).sum::<DVec3>() / 3.0;
        assert_eq!(elements.locate(ElementId(element.polygon), middle).0, leaf[triangle] as u32);
        assert!(half[triangle] == 0.0 || element.corners.len() == 4);
    }
    assert!(half.contains(&1.0) && half.contains(&2.0));
}

/// Catches a solve that comes out otherwise because somebody looked; pictures that do not come, come in another order, are not
/// what stands, or come twice as often as they should.
#[test]
fn pictures_of_a_solve_show_it_and_change_nothing() {
    let scene = scene(lit_box(0.5));
    let finer = Settings { error: 0.02, ..draft() };
    for settings in [finer, paper()] {
        let (sender, receiver) = channel();
        let onlooker = Box::new(move |picture: Picture| sender.send(picture).unwrap());
        let begun = Instant::now();
        let seen = isolux::solve_seen(scene.clone(), &settings, &mut Unobserved, Some(onlooker)).unwrap();
        let most = 1 + (begun.elapsed().as_secs_f64() / 0.5) as usize;
        // All are there once it has returned, and no more will come.
        let pictures: Vec<Picture> = receiver.try_iter().collect();
        assert_eq!(receiver.try_recv().err(), Some(TryRecvError::Disconnected));
        assert!(!pictures.is_empty() && pictures.len() <= most, "{} pictures", pictures.len());
        assert_eq!(pictures[0].stage, 1);
        assert!(pictures.is_sorted_by_key(|picture| (picture.stage, picture.elements)));
        let view = View::read(&pictures[0].data);
        assert_eq!(view.header["report"]["status"], "cancelled");
        assert_eq!(view.header["report"]["elements"], pictures[0].elements);
        assert_eq!(view.header["groups"].as_array().unwrap().len(), 1);
        let unseen = solved(&scene, &settings);
        let first = unseen.report();
        let elements = first.stages.first().map(|stage| stage.elements);
        let elements = elements.or_else(|| first.iterations.first().map(|iteration| iteration.elements));
        assert_eq!(Some(pictures[0].elements), elements);
        let values = |solution: &Solution| solution.hierarchy().light.radiosities().to_vec();
        assert_eq!(values(&seen), values(&unseen));
        assert_eq!(seen.mesh().irradiance, unseen.mesh().irradiance);
        if let (Some(seen), Some(unseen)) = (seen.transport(), unseen.transport()) {
            assert_eq!((&seen.fields, &seen.links), (&unseen.fields, &unseen.links));
        }
    }
}
