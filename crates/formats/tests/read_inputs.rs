//! The scenes and the small malformed and special files under `scenes/`, against what stands beside them.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use isolux_core::audit::audit;
use isolux_core::scene::{BuildOptions, Polygon, Scene, Severity};
use isolux_core::units::Rgb;
use isolux_formats::read::{ReadOptions, read};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// Relative; single precision in the files, and 16 bits per texel in averages of textures (measured: below 2e-5).
const TOLERANCE: f64 = 1e-4;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The scene, or the line that a user sees.
fn open(path: &Path) -> Result<Scene, String> {
    let input = read(path, &ReadOptions::default()).map_err(|error| error.to_string())?;
    let scene = Scene::build(input, &BuildOptions::default());
    let scene = scene.map_err(|error| format!("{}: {error}", path.display()))?;
    scene.check().unwrap();
    Ok(scene)
}

fn fronts<'a>(scene: &'a Scene, object: &'a str) -> impl Iterator<Item = &'a Polygon> {
    let of = move |polygon: &&Polygon| scene.objects[polygon.object as usize].name == object;
    scene.polygons[..scene.fronts].iter().filter(of)
}

/// Mean of a value over an object's area.
fn mean(scene: &Scene, object: &str, value: impl Fn(&Polygon) -> Rgb) -> Rgb {
    let area: f64 = fronts(scene, object).map(|polygon| polygon.area).sum();
    fronts(scene, object).map(|polygon| value(polygon) * polygon.area).sum::<Rgb>() / area
}

fn assert_close(found: &[f64], expected: &Value, what: &str) {
    let expected: Vec<f64> = match expected {
        Value::Array(values) => values.iter().map(|value| value.as_f64().unwrap()).collect(),
        value => vec![value.as_f64().unwrap()],
    };
    let close = |(a, b): (&f64, &f64)| (a - b).abs() <= TOLERANCE * b.abs().max(1.0);
    assert!(found.len() == expected.len() && found.iter().zip(&expected).all(close), "{what}: {found:?}, {expected:?}");
}

/// Linear colour of an object's texture at texture coordinates (u, 1/2).
fn texel(scene: &Scene, object: &str, u: f64) -> Rgb {
    let material = fronts(scene, object).next().unwrap().material;
    let texture = scene.materials[material as usize].texture.as_ref().unwrap();
    let picture = image::load_from_memory(&scene.images[texture.image as usize].bytes).unwrap().to_rgb8();
    let pixel = picture.get_pixel((u * f64::from(picture.width())) as u32, picture.height() / 2);
    let linear = |code: u8| {
        // IEC 61966-2-1.
        let value = f64::from(code) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    Rgb(pixel.0.map(linear)) * texture.factor
}

/// Compares a scene with the facts that are known of it.
fn compare(scene: &Scene, expect: &Map<String, Value>, file: &str) {
    for (key, value) in expect {
        let what = |object: &str| format!("{file}: {key} of '{object}'");
        let objects = || value.as_object().unwrap().iter();
        match key.as_str() {
            "polygons" => assert_eq!(scene.fronts as u64, value.as_u64().unwrap(), "{file}"),
            "triangles" => assert_eq!(scene.triangles.len() as u64, value.as_u64().unwrap(), "{file}"),
            "double_sided_polygons" => {
                let count = scene.polygons.len() - scene.fronts;
                assert_eq!(count as u64, value.as_u64().unwrap(), "{file}");
            }
            "area_m2" => objects().for_each(|(object, area)| {
                assert_close(&[fronts(scene, object).map(|polygon| polygon.area).sum()], area, &what(object));
            }),
            "mean_reflectance" => objects().for_each(|(object, reflectance)| {
                assert_close(&mean(scene, object, |polygon| polygon.reflectance).0, reflectance, &what(object));
            }),
            "reflectance_of_half" => objects().for_each(|(half, reflectance)| {
                let (object, side) = half.split_once(", ").unwrap();
                let u = if side == "x < 0.5" { 0.25 } else { 0.75 };
                assert_close(&texel(scene, object, u).0, reflectance, &what(half));
            }),
            "flux_lm_rgb" => objects().for_each(|(object, flux)| {
                let found: Rgb = fronts(scene, object).map(|polygon| polygon.emission * polygon.area).sum();
                assert_close(&found.0, flux, &what(object));
            }),
            "transmittance" => objects().for_each(|(object, transmittance)| {
                let opacity = mean(scene, object, |polygon| Rgb::splat(polygon.opacity));
                assert_close(&[1.0 - opacity.mean()], transmittance, &what(object));
            }),
            "normal" => {
                for object in expect["area_m2"].as_object().unwrap().keys() {
                    for polygon in fronts(scene, object) {
                        assert_close(&polygon.plane.normal.to_array(), value, &what(object));
                    }
                }
            }
            "outward_normals" => {
                for object in expect["area_m2"].as_object().unwrap().keys() {
                    let centre: DVec3 = fronts(scene, object).map(|polygon| polygon.corners.mean()).sum();
                    let centre = centre / fronts(scene, object).count() as f64;
                    let outward = |polygon: &Polygon| (polygon.corners.mean() - centre).dot(polygon.plane.normal) > 0.0;
                    assert!(fronts(scene, object).all(outward), "{}", what(object));
                }
            }
            "closed" => {
                let sum: DVec3 = scene.polygons.iter().map(|polygon| polygon.corners.area_vector()).sum();
                assert!(sum.length() < 1e-12, "{file}: the outline of the surfaces is {sum}");
            }
            "findings" => {}
            _ => panic!("{file}: no comparison for '{key}'"),
        }
    }
}

/// What the audit warns of: objects by kind.
fn findings(scene: &Scene) -> Map<String, Value> {
    let mut findings = Map::new();
    for issue in audit(scene).into_iter().filter(|issue| issue.severity == Severity::Warning) {
        let kind = serde_json::to_value(issue.kind).unwrap().as_str().unwrap().to_owned();
        let objects = findings.entry(kind).or_insert_with(|| Value::Array(Vec::new()));
        objects.as_array_mut().unwrap().push(Value::String(issue.object));
    }
    findings
}

/// Catches a broken file that is read, a sound one that is refused or warned of, a message that does not name what is
/// at fault, faults of the geometry that are missed or made up, and numbers that are not those of the file; and inputs that nothing is known of.
#[test]
fn test_inputs_are_what_expected_json_says() {
    let folder = scenes().join("test-inputs");
    let records = json(&folder.join("expected.json"));
    let mut files = Vec::new();
    for record in records.as_array().unwrap() {
        let text = |key: &str| record[key].as_str().unwrap();
        let file = text("file");
        files.push(file.to_owned());
        let names: Vec<&str> = record["names"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
        let result = open(&folder.join(file));
        if text("kind") == "error" {
            let message = result.map(|_| ()).expect_err(file);
            assert!(names.iter().all(|name| message.contains(name)), "{file}: {message} does not name {names:?}");
            assert!(!message.contains('\n'), "{message}");
            continue;
        }
        let scene = result.unwrap_or_else(|message| panic!("{message}"));
        let of = |severity| scene.issues.iter().filter(move |issue| issue.severity == severity);
        let severity = match text("kind") {
            "warning" => Some(Severity::Warning),
            "note" => Some(Severity::Note),
            "ok" => None,
            other => panic!("{file}: unknown kind {other}"),
        };
        let warnings = of(Severity::Warning).count();
        assert_eq!(warnings > 0, severity == Some(Severity::Warning), "{file}: {:#?}", scene.issues);
        if let Some(severity) = severity {
            // The file itself stands above a scene's issues.
            let named = |name: &&str| {
                *name == file || of(severity).any(|i| i.object.contains(name) || i.message.contains(name))
            };
            assert!(names.iter().all(named), "{file}: {names:?} are not in {:#?}", scene.issues);
        }
        let expected = record["expect"].get("findings").cloned().unwrap_or_else(|| Value::Object(Map::new()));
        assert_eq!(Value::Object(findings(&scene)), expected, "{file}");
        if let Some(expect) = record["expect"].as_object() {
            compare(&scene, expect, file);
        }
    }
    for entry in std::fs::read_dir(&folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let is_input = [".glb", ".gltf", ".obj"].iter().any(|extension| name.ends_with(extension));
        assert!(!is_input || files.contains(&name), "expected.json does not know {name}");
    }
}

/// Catches a sound scene that is refused, warned of by its reader or by the audit, or read with other surfaces than it was made of.
#[test]
fn the_scenes_are_read_whole() {
    let mut count = 0;
    for entry in std::fs::read_dir(scenes()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "glb") {
            continue;
        }
        let scene = open(&path).unwrap();
        let warnings: Vec<_> = scene.issues.iter().filter(|issue| issue.severity == Severity::Warning).collect();
        assert!(warnings.is_empty(), "{}: {warnings:#?}", path.display());
        assert_eq!(findings(&scene), Map::new(), "{}", path.display());
        let known = json(&path.with_extension("json"));
        assert_eq!(scene.fronts as u64, known["polygons"].as_u64().unwrap(), "{}", path.display());
        assert_eq!(scene.triangles.len() as u64, known["triangles"].as_u64().unwrap(), "{}", path.display());
        count += 1;
    }
    assert!(count >= 6, "{count} scenes");
}
