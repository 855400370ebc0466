//! Solutions as records: what is written comes back exactly, and what was altered is refused by name.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{draft, irradiances, lit_box, paper, points, scene, schedules, solved};
use isolux::core::scene::{Alpha, AlphaMask, Image, Wrap};
use isolux::core::solution::{Phase, Progress, SmoothPlan, Unobserved, Watch, smoothing_groups};
use isolux::core::units::Unit;
use isolux::{Array, Data, Record, RecordError, Settings, Solution};
use std::collections::{HashMap, HashSet};

/// A solution with everything that a record can hold: a two-sided pane, a cut-out mask with texture coordinates, an
/// image.
fn rich(settings: &Settings) -> Solution {
    let mut input = lit_box(0.5);
    let mut pane = input.materials[0].clone();
    pane.two_sided = true;
    pane.alpha = Alpha::Mask(0);
    pane.surface.opacity = 0.5;
    input.materials.push(pane);
    let (x, y) = ([0.2, 0.8], 0.4);
    let corners = [[x[0], y, x[0]], [x[0], y, x[1]], [x[1], y, x[1]], [x[1], y, x[0]]];
    let face = common::inputs::Make::face(&mut input, 0, 2, &corners.map(Into::into));
    common::inputs::with_uv(&mut input, face, &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let solid = vec![true, false, false, true];
    input.masks.push(AlphaMask { width: 2, height: 2, solid, cutoff: 0.75, wrap: [Wrap::Clamp; 2] });
    input.images.push(Image { name: "picture".into(), mime: "image/png".into(), bytes: vec![1, 2, 3] });
    solved(&scene(input), settings)
}

/// One of every schedule.
fn each() -> [Solution; 2] {
    schedules().map(|(_, settings)| rich(&settings))
}

/// Name, shape and the bits of all numbers (texture coordinates hold NaN where there are none).
fn bits(array: &Array) -> (String, Vec<usize>, Vec<u64>) {
    let bits = match &array.data {
        Data::U8(values) => values.iter().map(|&value| u64::from(value)).collect(),
        Data::U32(values) => values.iter().map(|&value| u64::from(value)).collect(),
        Data::U64(values) => values.clone(),
        Data::F32(values) => values.iter().map(|value| u64::from(value.to_bits())).collect(),
        Data::F64(values) => values.iter().map(|value| value.to_bits()).collect(),
    };
    (array.name.clone(), array.shape.clone(), bits)
}

fn array<'a>(record: &'a mut Record, name: &str) -> &'a mut Array {
    record.arrays.iter_mut().find(|array| array.name == name).unwrap()
}

fn reading(record: Record) -> RecordError {
    match Solution::from_record(record) {
        Err(error) => error,
        // A whole solution says nothing.
        Ok(_) => panic!("an altered record was read without complaint"),
    }
}

/// The name that an error gives.
fn name_of(error: &RecordError) -> &str {
    match error {
        RecordError::Missing { name } | RecordError::Shape { name, .. } | RecordError::Inconsistent { name, .. } => {
            name
        }
        _ => "",
    }
}

/// Catches files of `sequential` made before walls parted vertices, which are refused or fall apart: their vertices show what
/// they did, the same on both sides.
#[test]
fn files_whose_vertices_were_not_parted_open() {
    let scene = common::shipped("leaks/thin_wall");
    let solution = solved(&scene, &paper());
    let (elements, light) = (&solution.hierarchy().elements, &solution.hierarchy().light);
    let unasked = &mut Unobserved;
    let watch = &mut Watch::new(unasked, Progress::of(Phase::Interpolation));
    let plan = SmoothPlan::new(&scene, &(&*scene, solution.bsp()), elements, light, watch).unwrap();
    let group = smoothing_groups(&scene, &(&*scene, solution.bsp()), watch).unwrap();
    let key = |site: usize| {
        let polygon = elements.get(plan.sites()[site].leaf).polygon;
        (group[polygon as usize], plan.positions()[site].to_array().map(f64::to_bits))
    };
    let mut seen = HashSet::new();
    let before = (0..plan.vertices()).filter(|&site| seen.insert(key(site))).count();
    assert!(before < plan.vertices());
    let mut record = solution.to_record();
    let values = array(&mut record, "mesh/irradiance");
    values.shape[0] = before;
    let Data::F64(numbers) = &mut values.data else { panic!("not in double precision") };
    numbers.truncate(3 * before);
    let opened = Solution::from_record(record.clone()).unwrap();
    assert_eq!(opened.mesh().positions, solution.mesh().positions);
    // At least vertices that are not of two sides, nor between such, have what they had.
    let same = opened.mesh().irradiance.iter().zip(&solution.mesh().irradiance).filter(|(one, two)| one == two).count();
    assert!(10 * same > 9 * solution.mesh().irradiance.len(), "{same} of {}", solution.mesh().irradiance.len());
    assert!(same < solution.mesh().irradiance.len());
    // Any other number is refused.
    let values = array(&mut record, "mesh/irradiance");
    values.shape[0] = before - 1;
    let Data::F64(numbers) = &mut values.data else { panic!("not in double precision") };
    numbers.truncate(3 * (before - 1));
    assert_eq!(name_of(&reading(record)), "mesh/irradiance");
}

/// Catches a number that is lost, rounded or moved on its way: record, report and answers come back bit for bit.
#[test]
fn a_record_comes_back_exactly() {
    for solution in each() {
        let record = solution.to_record();
        let back = Solution::from_record(record.clone()).unwrap();
        back.check().unwrap();
        let again = back.to_record();
        assert_eq!(record.attributes, again.attributes);
        assert!(record.arrays.iter().map(bits).eq(again.arrays.iter().map(bits)));
        assert_eq!(solution.report(), back.report());
        assert_eq!(solution.scene().hash, back.scene().hash);
        let points = points(solution.scene(), 2000, 1);
        assert_eq!(irradiances(&solution, &points), irradiances(&back, &points));
        assert_eq!(solution.mesh().triangles, back.mesh().triangles);
    }
}

/// Catches facts of the scene that are lost between the arrays.
#[test]
fn joins_and_cutoffs_come_back() {
    for solution in each() {
        let back = Solution::from_record(solution.to_record()).unwrap();
        assert_eq!(back.scene().joined, solution.scene().joined);
        assert_eq!(back.scene().masks[0].cutoff, 0.75);
    }
}

/// Catches an array that is not needed (then why is it stored?) or whose absence is not named.
#[test]
fn every_missing_array_is_named() {
    for solution in each() {
        let record = solution.to_record();
        for index in 0..record.arrays.len() {
            let mut broken = record.clone();
            let name = broken.arrays.remove(index).name;
            assert_eq!(reading(broken), RecordError::Missing { name });
        }
    }
}

/// Catches an array of wrong type, wrong axes, or one row short, and names it (a missing row may be found at the
/// array that it no longer matches, of the same group).
#[test]
fn every_wrong_shape_is_named() {
    for solution in each() {
        let record = solution.to_record();
        for index in 0..record.arrays.len() {
            let original = &record.arrays[index];
            let name = original.name.clone();
            let with = |array: Array| {
                let mut broken = record.clone();
                broken.arrays[index] = array;
                reading(broken)
            };
            let other = if matches!(original.data, Data::U8(_)) { Data::F32(vec![]) } else { Data::U8(vec![]) };
            let error = with(Array { data: other, ..original.clone() });
            assert!(matches!(&error, RecordError::Shape { name: found, .. } if *found == name), "{name}: {error}");
            let mut shape = original.shape.clone();
            shape.push(1);
            let error = with(Array { shape, ..original.clone() });
            assert!(matches!(&error, RecordError::Shape { name: found, .. } if *found == name), "{name}: {error}");
            let mut shape = original.shape.clone();
            shape[0] += 1;
            let error = with(Array { shape, ..original.clone() });
            assert!(matches!(&error, RecordError::Shape { name: found, .. } if *found == name), "{name}: {error}");
            if name.starts_with("scene/image") {
                continue; // an image is what it is
            }
            let mut shape = original.shape.clone();
            shape[0] -= 1;
            let entries: usize = shape.iter().product();
            let data = match original.data.clone() {
                Data::U8(values) => Data::U8(values[..entries].to_vec()),
                Data::U32(values) => Data::U32(values[..entries].to_vec()),
                Data::U64(values) => Data::U64(values[..entries].to_vec()),
                Data::F32(values) => Data::F32(values[..entries].to_vec()),
                Data::F64(values) => Data::F64(values[..entries].to_vec()),
            };
            let error = with(Array { shape, data, ..original.clone() });
            let group = name.split('/').next().unwrap();
            assert!(name_of(&error).starts_with(group), "{name}: {error}");
        }
    }
}

/// Catches a NaN, first or last, that gets into a solution through any array of numbers.
#[test]
fn every_nan_is_refused() {
    for solution in each() {
        let record = solution.to_record();
        for index in 0..record.arrays.len() {
            for last in [false, true] {
                let mut broken = record.clone();
                let name = broken.arrays[index].name.clone();
                match &mut broken.arrays[index].data {
                    Data::F64(values) => {
                        let at = if last { values.len() - 1 } else { 0 };
                        // Where there are no texture coordinates NaN stands already, and the first tells.
                        if !values[at].is_nan() {
                            values[at] = f64::NAN;
                        } else {
                            continue;
                        }
                    }
                    Data::F32(values) => {
                        let at = if last { values.len() - 1 } else { 0 };
                        values[at] = f32::NAN;
                    }
                    _ => continue,
                }
                let group = name.split('/').next().unwrap().to_owned();
                match Solution::from_record(broken) {
                    Err(error) => assert!(name_of(&error).starts_with(&group), "{name}: {error}"),
                    Ok(_) => panic!("{name}: NaN got in"),
                }
            }
        }
    }
}

/// Catches an index that is followed out of its array.
#[test]
fn every_index_out_of_range_is_named() {
    for solution in each() {
        let record = solution.to_record();
        for name in [
            "scene/mask",
            "scene/object",
            "scene/material",
            "scene/twin",
            "scene/face_polygon",
            "scene/faces",
            "elements/polygon",
            "elements/parent",
            "elements/first_child",
            "links/receiver",
            "links/source",
            "clusters/first",
            "clusters/parent",
            "clusters/members",
        ] {
            if !record.arrays.iter().any(|array| array.name == name) {
                assert!(name.starts_with("clusters") && solution.transport().is_none(), "{name}");
                continue;
            }
            for value in [u32::MAX - 1, 1 << 30] {
                let mut broken = record.clone();
                let Data::U32(values) = &mut array(&mut broken, name).data else { panic!("{name}") };
                values[0] = value;
                let error = reading(broken);
                let group = name.split('/').next().unwrap();
                assert!(name_of(&error).starts_with(group), "{name}: {error}");
            }
        }
    }
}

/// Catches values that are in range and wrong: each breaks an invariant or the recorded hash.
#[test]
fn altered_values_are_found() {
    type Change = (&'static str, &'static str, fn(&mut Data));
    fn scale(data: &mut Data) {
        if let Data::F64(values) = data {
            values.iter_mut().for_each(|value| *value *= 1.001);
        }
    }
    fn swap(data: &mut Data) {
        match data {
            Data::U32(values) => values.reverse(),
            Data::U64(values) => values.reverse(),
            _ => {}
        }
    }
    let cases: [Change; 13] = [
        ("scene/corners", "scene", scale),
        ("scene/reflectance", "scene", scale),
        ("scene/emission", "scene", scale),
        ("scene/opacity", "scene", scale),
        ("scene/mask_0", "scene", |data| {
            if let Data::U8(values) = data {
                values[1] = 1;
            }
        }),
        ("elements/corners", "elements", scale),
        ("elements/area", "elements", scale),
        ("elements/path", "elements", swap),
        ("elements/parent", "elements", swap),
        ("elements/first_child", "elements", swap),
        ("elements/radiosity", "elements", scale),
        ("links/form_factor", "links", |data| {
            if let Data::F64(values) = data {
                values[0] = 1.5;
            }
        }),
        ("links/source", "links", swap),
    ];
    let record = rich(&paper()).to_record();
    for (name, group, change) in cases {
        let mut broken = record.clone();
        change(&mut array(&mut broken, name).data);
        match Solution::from_record(broken) {
            Err(error) => assert!(name_of(&error).starts_with(group), "{name}: {error}"),
            Ok(_) => panic!("{name}: not found"),
        }
    }
}

/// Catches attributes that are not read with care: other formats, other hashes, what is missing, what is no JSON.
#[test]
fn attributes_are_checked() {
    let record = rich(&paper()).to_record();
    let with = |from: &str, to: &str| {
        assert!(record.attributes.contains(from), "{from}");
        reading(Record { attributes: record.attributes.replacen(from, to, 1), ..record.clone() })
    };
    assert_eq!(with("\"format\":4", "\"format\":2"), RecordError::Format { found: 2, supported: 4 });
    assert_eq!(with("\"format\":4", "\"form\":4"), RecordError::Missing { name: "attributes/format".into() });
    assert_eq!(name_of(&with("{", "[")), "attributes");
    assert_eq!(name_of(&with("\"fronts\"", "\"front\"")), "attributes");
    assert_eq!(name_of(&with("\"fronts\":8", "\"fronts\":800")), "attributes/fronts");
    assert_eq!(name_of(&with("\"diameter\":", "\"diameter\":-")), "attributes/diameter");
    assert_eq!(name_of(&with("\"unit\":\"lm\"", "\"unit\":\"W\"")), "attributes/unit");
    assert_eq!(name_of(&with("\"unit\":\"lm\"", "\"unit\":\"candles\"")), "attributes");
    assert_eq!(name_of(&with("\"max_iterations\":100", "\"max_iterations\":0")), "attributes/report");
    // Of report and settings, the report comes last.
    let (settings, report) = ("\"settings\":{\"schedule\":\"sequential\"", "\"settings\":{\"schedule\":\"wavefront\"");
    assert_eq!(name_of(&with(settings, report)), "attributes/report");
    let hash = "\"scene_hash\":\"";
    let start = record.attributes.find(hash).unwrap() + hash.len();
    let digit = if record.attributes.as_bytes()[start] == b'0' { "1" } else { "0" };
    let mut attributes = record.attributes.clone();
    attributes.replace_range(start..=start, digit);
    assert_eq!(name_of(&reading(Record { attributes, ..record.clone() })), "scene");
}

/// Catches a unit that is lost between scene, report and file, or does not tell scenes apart.
#[test]
fn the_unit_comes_back() {
    let mut input = lit_box(0.5);
    let lumens = scene(input.clone());
    input.unit = Unit::Radiometric;
    let solution = solved(&scene(input), &draft());
    assert_eq!(solution.report().unit, Unit::Radiometric);
    assert_ne!(solution.scene().hash, lumens.hash);
    let back = Solution::from_record(solution.to_record()).unwrap();
    assert_eq!((back.scene().unit, back.report().unit), (Unit::Radiometric, Unit::Radiometric));
}

/// Catches links that are each a link, but contradict one another or the order that files have: light that travels one
/// way only as far as the file says, is counted twice, or is called proven where rays estimated it.
#[test]
fn links_that_contradict_each_other_are_refused() {
    let mut record = rich(&paper()).to_record();
    let take = |record: &mut Record, name: &str| match &array(record, name).data {
        Data::U32(values) => values.clone(),
        other => panic!("{name} holds {other:?}"),
    };
    let (receiver, source) = (take(&mut record, "links/receiver"), take(&mut record, "links/source"));
    let parent = take(&mut record, "elements/parent");
    let pairs: HashMap<(u32, u32), usize> = (0..receiver.len()).map(|k| ((receiver[k], source[k]), k)).collect();
    let mutual = (0..receiver.len()).find(|&k| pairs.contains_key(&(source[k], receiver[k]))).unwrap();
    let refused = |name: &str, change: &dyn Fn(&mut Data), what: &str| {
        let mut broken = record.clone();
        change(&mut array(&mut broken, name).data);
        let error = reading(broken).to_string();
        assert!(error.contains(what), "{name}: {error}");
    };
    let flip = |data: &mut Data| match data {
        Data::U8(values) => values[mutual] ^= 1,
        Data::F32(values) => values[mutual] = if values[mutual] == 1.0 { 0.0 } else { 1.0 },
        Data::F64(values) => values[mutual] *= 1.0 - 1e-9,
        other => panic!("{other:?}"),
    };
    refused("links/proven", &flip, "both directions have one visibility");
    refused("links/visibility", &flip, "both directions have one visibility");
    refused("links/form_factor", &flip, "both directions have one exchange area");
    let set = |at: usize, value: f32| {
        move |data: &mut Data| match data {
            Data::U8(values) => values[at] = value as u8,
            Data::F32(values) => values[at] = value,
            other => panic!("{other:?}"),
        }
    };
    refused("links/proven", &set(0, 2.0), "2 is neither 0 nor 1");
    refused("scene/active", &set(0, 2.0), "2 is neither 0 nor 1");
    refused("scene/active", &set(0, 0.0), "a front took no part");
    refused("links/visibility", &set(3, -0.25), "-0.25 of link 3");
    refused("links/visibility", &set(3, f32::INFINITY), "inf of link 3");
    let proven =
        (0..receiver.len()).find(|&k| match &record.arrays.iter().find(|a| a.name == "links/proven").unwrap().data {
            Data::U8(values) => values[k] == 1,
            _ => false,
        });
    refused("links/visibility", &set(proven.unwrap(), 0.5), "a proven visibility is 0 or 1");
    // The source's parent, for a receiver that keeps the other three of its children: the same place twice.
    let nested = (0..receiver.len()).find(|&k| {
        let above = parent[source[k] as usize];
        let siblings = (0..receiver.len()).filter(|&m| receiver[m] == receiver[k] && m != k);
        above != u32::MAX && siblings.into_iter().any(|m| parent[source[m] as usize] == above)
    });
    let nested = nested.unwrap();
    let parents = |data: &mut Data| match data {
        Data::U32(values) => values[nested] = parent[source[nested] as usize],
        other => panic!("{other:?}"),
    };
    let mut broken = record.clone();
    parents(&mut array(&mut broken, "links/source").data);
    let error = reading(broken).to_string();
    assert!(error.contains("exchanges light with a place once") || error.contains("in order"), "{error}");
    refused(
        "links/receiver",
        &|data| {
            if let Data::U32(values) = data {
                values.reverse()
            }
        },
        "is not in ascending order",
    );
}

/// Catches a whole solve's smooth values left out of its file, which only a cancelled one may do.
#[test]
fn smooth_values_may_be_left_out_of_what_was_cancelled_only() {
    let record = rich(&paper()).to_record();
    let mut broken = record.clone();
    *array(&mut broken, "mesh/irradiance") =
        Array { name: "mesh/irradiance".into(), shape: vec![0, 3], data: Data::F64(vec![]) };
    assert_eq!(name_of(&reading(broken.clone())), "mesh/irradiance");
    broken.attributes = broken.attributes.replacen("\"converged\"", "\"cancelled\"", 1);
    let solution = Solution::from_record(broken).unwrap();
    solution.check().unwrap();
    assert!(irradiances(&solution, &points(solution.scene(), 100, 1)).iter().all(|value| *value > 0.0));
}

/// Catches arrays of the fast engine that fit each other in shape and not in meaning: every invariant of fields, links
/// and clusters, broken one by one.
#[test]
fn what_the_fast_engine_leaves_is_checked() {
    let record = rich(&draft()).to_record();
    let refused = |name: &str, change: &dyn Fn(&mut Data), what: &str| {
        let mut broken = record.clone();
        change(&mut array(&mut broken, name).data);
        let error = reading(broken).to_string();
        assert!(error.contains(what), "{name}: {error}");
    };
    let set = |at: usize, value: f64| {
        move |data: &mut Data| match data {
            Data::U8(values) => values[at] = value as u8,
            Data::U32(values) => values[at] = value as u32,
            Data::F32(values) => values[at] = value as f32,
            Data::F64(values) => values[at] = value,
            Data::U64(_) => panic!("no such array"),
        }
    };
    refused("elements/field", &set(7, f64::INFINITY), "of element 0, not all values are finite");
    refused("elements/irradiance", &set(4, -1.0), "element 1: violated: values are finite and not negative");
    let scaled = |data: &mut Data| match data {
        Data::F64(values) => values.iter_mut().for_each(|value| *value *= 1.001),
        other => panic!("{other:?}"),
    };
    refused("elements/irradiance", &scaled, "leaves fulfil B = E + rho H");
    let roots = |data: &mut Data| match data {
        Data::F64(values) => values[..3].iter_mut().for_each(|value| *value *= 1.5),
        other => panic!("{other:?}"),
    };
    refused("elements/radiosity", &roots, "element 0: violated: parents are the mean of their children");
    let last = match &record.arrays.iter().find(|array| array.name == "links/receiver").unwrap().data {
        Data::U32(values) => values.len() - 1,
        other => panic!("{other:?}"),
    };
    refused("links/receiver", &set(last, 0.0), &format!("link {last} is not in ascending order"));
    let itself = {
        let mut broken = record.clone();
        let Data::U32(receiver) = array(&mut broken, "links/receiver").data.clone() else { panic!() };
        f64::from(receiver[3])
    };
    refused("links/source", &set(3, itself), "link 3 leads from a node to itself");
    refused("links/source", &set(3, 4e9), "link 3 has no such end");
    refused("links/factors", &set(11, -1e-6), "of link 2, not all are finite and not negative");
    refused("links/visibility", &set(2, 1.01), "1.01 of link 2 is not within 0 and 1");
    refused("links/proven", &set(1, 2.0), "2 is neither 0 nor 1");
    let doubt = |data: &mut Data| match data {
        Data::U8(values) => values.fill(1),
        other => panic!("{other:?}"),
    };
    refused("links/proven", &doubt, "is proven, but its visibility is not 1");
    refused("links/centre", &set(9, 1.5), "of link 4 it is not within 0 and 1");
    refused("clusters/members", &set(0, 1e6), "there is no polygon 1000000");
    let twice = |data: &mut Data| match data {
        Data::U32(values) => values[1] = values[0],
        other => panic!("{other:?}"),
    };
    refused("clusters/members", &twice, "occurs twice");
    refused("clusters/parent", &set(0, 0.0), "cluster 0 does not come after its parent");
    refused("clusters/parent", &set(1, 1.0), "cluster 1 does not come after its parent");
    refused("clusters/count", &set(1, 1e6), "members of cluster 1 are not its parent's");
    refused("clusters/count", &set(1, 0.0), "members of cluster 1 are not its parent's");
    refused("clusters/centre", &set(4, f64::NAN), "that of cluster 1 is not finite");
    refused("clusters/radius", &set(1, -1.0), "-1 of cluster 1 is no radius");
    refused("clusters/area", &set(1, 0.0), "0 of cluster 1 is no area");
    // Two roots that change places: each would answer for the other.
    let mut broken = record.clone();
    let Data::U32(polygon) = &mut array(&mut broken, "elements/polygon").data else { panic!() };
    polygon.swap(0, 1);
    assert!(name_of(&reading(broken)).starts_with("elements"));
}
