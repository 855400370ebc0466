//! Scene files built here, read back: what a file says must be what the scene has, and a broken file must be an
//! error of one line.

#![allow(clippy::unwrap_used, clippy::float_cmp)]

use glam::{DVec2, DVec3};
use image::{Rgba, RgbaImage};
use isolux_core::scene::{
    Alpha, BuildOptions, Face, Issue, IssueKind, LampShape, Projection, Scene, SceneInput, Severity, Wrap,
};
use isolux_core::units::Rgb;
use isolux_formats::read::{LightUnits, MAX_FACES, ReadError, ReadOptions, UpAxis, read};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

// ---------------------------------------------------------------------------------------------------- making files

/// A folder that goes when the test does.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Folder {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let name = format!("isolux-read-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<SceneInput, ReadError> {
        read(&self.write(name, bytes), &ReadOptions::default())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A GLB file in the making: JSON, and the bytes its views cover.
struct Glb {
    json: Value,
    bin: Vec<u8>,
}

const BYTE: u64 = 5120;
const UBYTE: u64 = 5121;
const USHORT: u64 = 5123;
const UINT: u64 = 5125;
const FLOAT: u64 = 5126;

impl Glb {
    fn new() -> Glb {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "materials": [], "textures": [], "images": [], "samplers": [],
            "cameras": [],
        });
        Glb { json, bin: Vec::new() }
    }

    /// One node `tri` with the triangle (0,0,0) (1,0,0) (0,1,0) of material 0.
    fn triangle(material: Value) -> Glb {
        let mut glb = Glb::new();
        let position = glb.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        glb.push("materials", material);
        glb.push("meshes", json!({"primitives": [{"attributes": {"POSITION": position}, "material": 0}]}));
        glb.push("nodes", json!({"name": "tri", "mesh": 0}));
        glb
    }

    fn push(&mut self, table: &str, entry: Value) -> usize {
        let table = self.json[table].as_array_mut().unwrap();
        table.push(entry);
        table.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    fn accessor(&mut self, kind: &str, component: u64, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "count": count, "type": kind}))
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = ["", "SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|name| *name == kind).unwrap();
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(kind, FLOAT, values.len() / width, &bytes)
    }

    fn indices_u16(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor("SCALAR", USHORT, values.len(), &bytes)
    }

    fn attribute(&mut self, name: &str, accessor: usize) {
        self.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
    }

    /// A texture of an embedded PNG; its number.
    fn texture(&mut self, pixels: &RgbaImage, sampler: Value) -> usize {
        let view = self.view(&png(pixels));
        let image = self.push("images", json!({"bufferView": view, "mimeType": "image/png", "name": "picture"}));
        let sampler = self.push("samplers", sampler);
        self.push("textures", json!({"source": image, "sampler": sampler}))
    }

    fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if !self.bin.is_empty() {
            json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        }
        container(json.to_string().as_bytes(), &self.bin)
    }

    fn scene(&self) -> SceneInput {
        Folder::new().read("room.glb", self.bytes()).unwrap()
    }

    fn error(&self) -> ReadError {
        let error = Folder::new().read("room.glb", self.bytes()).unwrap_err();
        assert_one_line(&error);
        error
    }
}

fn container(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], fill: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), fill);
        bytes
    };
    let (json, bin) = (pad(json, b' '), pad(bin, 0));
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend_from_slice(&((12 + 8 + json.len() + 8 + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", bin)] {
        file.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        file.extend_from_slice(kind);
        file.extend_from_slice(&chunk);
    }
    file
}

fn png(pixels: &RgbaImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    pixels.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

// ------------------------------------------------------------------------------------------------------- looking

fn assert_one_line(error: &ReadError) {
    let text = error.to_string();
    assert!(!text.contains(|c: char| c.is_control()), "{text:?}");
    assert!(text.len() < 600, "{text}");
}

fn find(scene: &SceneInput, kind: IssueKind, object: &str, part: &str) -> Issue {
    let found = scene.issues.iter().find(|i| i.kind == kind && i.object == object && i.message.contains(part));
    found.unwrap_or_else(|| panic!("no {kind:?} of '{object}' with '{part}' in {:#?}", scene.issues)).clone()
}

/// Rounding of a number of order 1 to the single precision that glTF's JSON is read in.
const F32: f64 = 1e-7;

fn close(a: Rgb, b: [f64; 3], tolerance: f64) {
    for band in 0..3 {
        assert!((a[band] - b[band]).abs() <= tolerance, "{a:?} is not {b:?}");
    }
}

fn near(a: DVec3, b: [f64; 3]) {
    // f32 in the file.
    assert!((a - DVec3::from_array(b)).length() < 1e-6, "{a} is not {b:?}");
}

fn normal(face: &Face) -> DVec3 {
    (face.corners[1] - face.corners[0]).cross(face.corners[2] - face.corners[0]).normalize()
}

fn linear(srgb: u8) -> f64 {
    let value = f64::from(srgb) / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Left half one colour, right half another.
fn halves(left: [u8; 4], right: [u8; 4]) -> RgbaImage {
    RgbaImage::from_fn(8, 8, |x, _| Rgba(if x < 4 { left } else { right }))
}

/// A rectangle of two triangles over the whole texture, so that means are plain.
fn textured(pixels: &RgbaImage, sampler: Value, material: impl Fn(usize) -> Value) -> Glb {
    let mut glb = Glb::new();
    let texture = glb.texture(pixels, sampler);
    glb.push("materials", material(texture));
    let position = glb.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let uv = glb.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
    let indices = glb.indices_u16(&[0, 1, 2, 0, 2, 3]);
    glb.push(
        "meshes",
        json!({"primitives": [{
            "attributes": {"POSITION": position, "TEXCOORD_0": uv}, "indices": indices, "material": 0,
        }]}),
    );
    glb.push("nodes", json!({"name": "wall", "mesh": 0}));
    glb
}

// ---------------------------------------------------------------------------------------------------- geometry

/// Catches transforms applied in the wrong order, or not inherited; names lost; faces not in document order.
#[test]
fn nodes_are_placed_depth_first_with_their_ancestors_transforms() {
    let mut glb = Glb::triangle(json!({}));
    glb.json["meshes"][0]["name"] = json!("leaf");
    glb.json["scenes"] = json!([{"nodes": [4]}, {"nodes": [1, 4]}]);
    glb.json["scene"] = json!(1);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    glb.json["nodes"] = json!([
        {"mesh": 0, "translation": [0, 0, 3]},
        {"name": "arm", "children": [2, 0], "translation": [10, 0, 0], "rotation": [0, 0, half, half]},
        {"name": "arm", "mesh": 0, "scale": [2, 2, 2]},
        {"name": "unreached", "mesh": 0},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -5, 0, 1]},
    ]);
    let scene = glb.scene();
    let names: Vec<&str> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["arm", "leaf", "leaf#2"]);
    assert_eq!(scene.faces.iter().map(|face| face.object).collect::<Vec<_>>(), [0, 1, 2]);
    // A quarter turn about z takes (2, 0, 0) to (0, 2, 0).
    near(scene.faces[0].corners[1], [10.0, 2.0, 0.0]);
    near(scene.faces[1].corners[1], [10.0, 1.0, 3.0]);
    near(scene.faces[2].corners[2], [0.0, -4.0, 0.0]);
    find(&scene, IssueKind::Ignored, &glb_path(&scene), "1 of 2 scenes");
    assert_eq!((scene.name.as_str(), scene.metres_per_unit), ("room", 1.0));
}

/// Issues of the whole file are filed under its path.
fn glb_path(scene: &SceneInput) -> String {
    scene.issues.iter().map(|issue| issue.object.clone()).find(|object| object.ends_with("room.glb")).unwrap()
}

/// Catches a mirrored instance whose front looks inwards, or whose texture coordinates stay behind.
#[test]
fn mirrored_transforms_keep_fronts_in_front() {
    let mut glb = Glb::triangle(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    glb.texture(&halves([0; 4], [255; 4]), json!({}));
    let uv = glb.floats("VEC2", &[0.0, 0.0, 0.5, 0.0, 0.0, 0.25]);
    glb.attribute("TEXCOORD_0", uv);
    glb.json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let scene = glb.scene();
    let face = &scene.faces[0];
    assert!(normal(face).z > 0.0);
    near(face.corners[0], [0.0, 0.0, 0.0]);
    near(face.corners[1], [0.0, 1.0, 0.0]);
    assert_eq!(face.uv.as_ref().unwrap()[..], [DVec2::ZERO, DVec2::new(0.0, 0.25), DVec2::new(0.5, 0.0)]);
}

/// Catches a strip whose every second triangle is turned over, a fan with the wrong hub, or faces out of order.
#[test]
fn strips_and_fans_become_triangles() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    let mut glb = Glb::new();
    let strip = glb.floats("VEC3", &corners.concat());
    let fan = glb.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    glb.push(
        "meshes",
        json!({"primitives": [
            {"attributes": {"POSITION": strip}, "mode": 5}, {"attributes": {"POSITION": fan}, "mode": 6},
            {"attributes": {"POSITION": fan}, "mode": 1}, {"attributes": {"POSITION": fan}, "mode": 0},
        ]}),
    );
    glb.push("nodes", json!({"mesh": 0}));
    let scene = glb.scene();
    assert_eq!(scene.objects[0].name, "node 0");
    assert_eq!(scene.faces.len(), 5);
    assert!(scene.faces.iter().all(|face| normal(face).z > 0.0));
    near(scene.faces[1].corners[1], [1.0, 1.0, 0.0]);
    // Strip of 5 corners: 3 triangles of 1/2; fan of 4: 2 of 1/2.
    let area: f64 = scene
        .faces
        .iter()
        .map(|f| 0.5 * (f.corners[1] - f.corners[0]).cross(f.corners[2] - f.corners[0]).length())
        .sum();
    assert!((area - 2.5).abs() < 1e-9);
    find(&scene, IssueKind::Ignored, "node 0", "lines are ignored");
    find(&scene, IssueKind::Ignored, "node 0", "points are ignored");
    find(&scene, IssueKind::Assumed, "default", "without a material");
}

/// Catches an index width or component type decoded wrongly, normalised or not, interleaved or sparse.
#[test]
fn every_way_to_store_a_vertex_gives_the_same_triangle() {
    let expect = |glb: &Glb| {
        let scene = glb.scene();
        assert_eq!(scene.faces.len(), 1);
        for (corner, expected) in
            scene.faces[0].corners.iter().zip([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
        {
            assert!((*corner - DVec3::from_array(expected)).length() < 1e-12, "{corner}");
        }
    };
    let base = || {
        let mut glb = Glb::new();
        glb.push("meshes", json!({"primitives": [{"attributes": {}}]}));
        glb.push("nodes", json!({"mesh": 0}));
        glb
    };
    let floats = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];

    for (component, bytes) in
        [(UBYTE, vec![2_u8, 1, 0]), (USHORT, vec![2, 0, 1, 0, 0, 0]), (UINT, vec![2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0])]
    {
        let mut glb = base();
        let position = glb.floats("VEC3", &floats);
        glb.attribute("POSITION", position);
        let indices = glb.accessor("SCALAR", component, 3, &bytes);
        glb.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        expect(&glb);
    }

    // KHR_mesh_quantization: bytes, normalised, padded to a stride of 4.
    let mut glb = base();
    let bytes: Vec<u8> = [0_i8, 0, 0, 0, 127, 0, 0, 0, 0, -128, 0, 0].iter().map(|&byte| byte as u8).collect();
    let position = glb.accessor("VEC3", BYTE, 3, &bytes);
    glb.json["accessors"][position]["normalized"] = json!(true);
    glb.json["bufferViews"][position]["byteStride"] = json!(4);
    glb.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    glb.attribute("POSITION", position);
    expect(&glb);

    // Sparse over nothing: zeros, of which two are replaced.
    let mut glb = base();
    let indices = glb.view(&[1, 0, 2, 0]);
    let values: Vec<u8> = [1.0_f32, 0.0, 0.0, 0.0, -1.0, 0.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let values = glb.view(&values);
    let position = glb.push(
        "accessors",
        json!({"componentType": FLOAT, "count": 3, "type": "VEC3", "sparse": {
            "count": 2, "indices": {"bufferView": indices, "componentType": USHORT}, "values": {"bufferView": values},
        }}),
    );
    glb.attribute("POSITION", position);
    expect(&glb);
}

/// Catches a hierarchy that hangs, overflows the stack, or shows a node twice.
#[test]
fn cycles_and_long_chains_of_nodes_end() {
    let mut glb = Glb::triangle(json!({}));
    glb.json["nodes"] =
        json!([{"name": "a", "mesh": 0, "children": [1, 1]}, {"name": "b", "mesh": 0, "children": [0]}]);
    let scene = glb.scene();
    assert_eq!(scene.faces.len(), 2);
    find(&scene, IssueKind::Ignored, &glb_path(&scene), "2 times");

    let mut nodes: Vec<Value> = (1..200_000).map(|child| json!({"children": [child]})).collect();
    nodes.push(json!({"mesh": 0, "name": "end"}));
    glb.json["nodes"] = json!(nodes);
    assert_eq!(glb.scene().objects[0].name, "end");
}

/// Catches nodes lost where the file has no scenes.
#[test]
fn without_scenes_all_roots_are_read() {
    let mut glb = Glb::triangle(json!({}));
    glb.json["nodes"] = json!([{"name": "child", "mesh": 0}, {"name": "root", "mesh": 0, "children": [0]}, {"name": "other", "mesh": 0}]);
    glb.json["scenes"] = json!([]);
    glb.json.as_object_mut().unwrap().remove("scene");
    let names: Vec<String> = glb.scene().objects.into_iter().map(|object| object.name).collect();
    assert_eq!(names, ["root", "child", "other"]);
}

/// Catches cameras in mesh space, or looking the wrong way; skins and animations dropped in silence.
#[test]
fn cameras_are_read_and_what_is_not_read_is_said() {
    let mut glb = Glb::triangle(json!({}));
    glb.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.75, "znear": 0.1}}));
    glb.push(
        "cameras",
        json!({"type": "orthographic", "name": "plan", "orthographic": {"xmag": 3, "ymag": 2, "zfar": 9, "znear": 0}}),
    );
    glb.json["nodes"] = json!([
        {"name": "tri", "mesh": 0, "skin": 0, "children": [1, 2, 3]},
        {"name": "eye", "camera": 0, "translation": [1, 2, 3], "rotation": [0, 1, 0, 0]},
        {"camera": 1},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]);
    glb.json["meshes"][0]["primitives"][0]["targets"] = json!([{}]);
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "name": "lamp"}]}});
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_ior", "ACME_thing"]);
    glb.json["animations"] = json!([{"odd": true}]);
    let scene = glb.scene();
    assert_eq!(scene.cameras.len(), 2);
    let eye = &scene.cameras[0];
    assert_eq!((eye.name.as_str(), eye.projection), ("eye", Projection::Perspective { vertical_angle: 0.75 }));
    near(eye.eye, [1.0, 2.0, 3.0]);
    near(eye.forward, [0.0, 0.0, 1.0]);
    near(eye.up, [0.0, 1.0, 0.0]);
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic { height: 4.0 });
    assert_eq!(scene.cameras[1].name, "plan");
    assert_eq!(scene.lamps.len(), 1);
    find(&scene, IssueKind::Ignored, "tri", "skin");
    find(&scene, IssueKind::Ignored, "tri", "morph");
    find(&scene, IssueKind::Ignored, &glb_path(&scene), "1 animations");
    find(&scene, IssueKind::Ignored, &glb_path(&scene), "KHR_materials_ior is ignored: no effect");
    find(&scene, IssueKind::Ignored, &glb_path(&scene), "ACME_thing");
}

// ---------------------------------------------------------------------------------------------------- materials

/// A picture of 8 x 8 texels, all different, on a screen of 1 x 2 that two triangles make; and what its emissive
/// strength is.
fn with_screen(size: u32, nodes: usize) -> (Glb, RgbaImage) {
    let picture = RgbaImage::from_fn(size, size, |x, y| Rgba([(x * 29) as u8, (y * 31) as u8, (x * y * 5) as u8, 255]));
    let mut glb = Glb::new();
    let position = glb.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 2.0, 0.0]);
    let uv = glb.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let indices = glb.indices_u16(&[0, 1, 2, 0, 2, 3]);
    let texture = glb.texture(&picture, json!({"magFilter": 9728}));
    glb.push(
        "materials",
        json!({"name": "screen", "emissiveFactor": [1, 0.5, 0.25], "emissiveTexture": {"index": texture},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 40}}}),
    );
    let primitive = json!({"attributes": {"POSITION": position, "TEXCOORD_0": uv}, "indices": indices, "material": 0});
    glb.push("meshes", json!({"primitives": [primitive]}));
    let roots: Vec<usize> = (0..nodes).map(|_| glb.push("nodes", json!({"name": "tv", "mesh": 0}))).collect();
    glb.json["scenes"][0]["nodes"] = json!(roots);
    (glb, picture)
}

/// What the texels that a face covers emit, per m², by a sum over points of it.
fn emitted(face: &Face, picture: &RgbaImage) -> [f64; 3] {
    let steps = 96;
    let [a, b, c] = face.corners[..] else { panic!("{face:?}") };
    let mut sum = [0.0; 3];
    for i in 0..steps {
        for j in 0..steps - i {
            let (s, t) = ((f64::from(i) + 1.0 / 3.0) / f64::from(steps), (f64::from(j) + 1.0 / 3.0) / f64::from(steps));
            let at = a + (b - a) * s + (c - a) * t;
            let texel = |share: f64| ((share * f64::from(picture.width())) as u32).min(picture.width() - 1);
            let pixel = picture.get_pixel(texel(at.x), texel(1.0 - at.y / 2.0));
            for (band, factor) in [1.0, 0.5, 0.25].into_iter().enumerate() {
                sum[band] += PI * 40.0 * factor * linear(pixel[band]) * 2.0 / f64::from(steps * (steps + 1));
            }
        }
    }
    sum
}

/// Catches a screen that lights like its mean: parts have to emit what their texels do, in linear light, leave no gap,
/// and all of it has to stay what the texture gives; a texture that is even to a part is left whole.
#[test]
fn screens_emit_what_their_pictures_show() {
    let (glb, picture) = with_screen(8, 1);
    let scene = glb.scene();
    // 8 steps: each part lies in one texel.
    assert_eq!(scene.faces.len(), 2 * 8 * 8);
    find(&scene, IssueKind::Assumed, "tv", "2 triangles are cut into 128 faces");
    let area =
        |face: &Face| (face.corners[1] - face.corners[0]).cross(face.corners[2] - face.corners[0]).length() / 2.0;
    assert!((scene.faces.iter().map(area).sum::<f64>() - 2.0).abs() < 1e-12);
    let mut totals = [0.0; 3];
    for face in &scene.faces {
        assert!(normal(face).z > 0.0);
        let (found, wanted) = (face.surface.unwrap().emission, emitted(face, &picture));
        // Points of a sum over 96 steps; of the strongest texel.
        close(found, wanted, 0.02 * PI * 40.0);
        (0..3).for_each(|band| totals[band] += area(face) * found[band]);
    }
    let texels = f64::from(picture.width() * picture.height());
    for (band, factor) in [1.0, 0.5, 0.25].into_iter().enumerate() {
        let mean = picture.pixels().map(|pixel| linear(pixel[band])).sum::<f64>() / texels;
        // Two-point Gauss along 45 degrees through texels.
        assert!((totals[band] / (2.0 * PI * 40.0 * factor * mean) - 1.0).abs() < 1e-3, "{totals:?}");
    }
    let built = Scene::build(scene, &BuildOptions::default()).unwrap();
    assert_eq!(built.fronts, 2 * (28 + 8));
    // Joined parts stay within a texel.
    for polygon in &built.polygons {
        let at = polygon.corners.mean();
        let pixel = picture.get_pixel((at.x * 8.0) as u32, ((1.0 - at.y / 2.0) * 8.0) as u32);
        let texel: [f64; 3] = std::array::from_fn(|band| PI * 40.0 * [1.0, 0.5, 0.25][band] * linear(pixel[band]));
        close(polygon.emission, texel, 1e-3 * PI * 40.0);
    }
    // Grey of one value, and noise finer than any part: nothing to be told apart.
    let (mut glb, _) = with_screen(1, 1);
    assert_eq!(glb.scene().faces.len(), 2);
    let chequers = RgbaImage::from_fn(512, 512, |x, y| Rgba([((x + y) % 2 * 255) as u8; 4]));
    let texture = glb.texture(&chequers, json!({}));
    glb.json["materials"][0]["emissiveTexture"]["index"] = json!(texture);
    assert_eq!(glb.scene().faces.len(), 2);
}

/// Catches cutting without a bound: a few bytes of nodes that all show one screen can ask for any number of faces.
#[test]
fn screens_are_cut_within_bounds() {
    for (nodes, each) in [(16, 128), (60, 32), (200, 8), (9000, 2)] {
        assert_eq!(with_screen(8, nodes).0.scene().faces.len(), nodes * each, "{nodes}");
    }
}

/// Catches emission without pi, strength or the option's scale; metallic and two-sided not heeded.
#[test]
fn plain_materials_become_surfaces() {
    let glb = Glb::triangle(json!({
        "name": "lamp", "doubleSided": true, "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 0.5]},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 100}},
    }));
    let folder = Folder::new();
    let options = ReadOptions { emission_scale: 2.0, metres_per_unit: Some(0.01), ..ReadOptions::default() };
    let scene = read(&folder.write("room.glb", glb.bytes()), &options).unwrap();
    let material = &scene.materials[0];
    close(material.surface.reflectance, [0.2, 0.4, 0.6], F32);
    close(material.surface.emission, [200.0 * PI, 100.0 * PI, 0.0], 1e-9);
    assert_eq!((material.surface.opacity, material.two_sided, material.alpha), (1.0, true, Alpha::Opaque));
    assert_eq!((scene.faces[0].surface, scene.faces[0].uv.as_ref()), (None, None));
    assert_eq!(scene.metres_per_unit, 0.01);
    assert_eq!(find(&scene, IssueKind::Assumed, "lamp", "metallicFactor is absent").severity, Severity::Note);
}

/// Catches what has +Z up turned the wrong way, mirrored, or in part: corners, cameras and lamps alike.
#[test]
fn what_has_z_up_is_turned() {
    let mut glb = Glb::triangle(json!({}));
    let light = json!({"lights": [{"type": "spot", "spot": {}}]});
    glb.json["extensions"] = json!({"KHR_lights_punctual": light});
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    glb.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    let nodes = glb.json["nodes"].as_array_mut().unwrap();
    let extra = nodes.len();
    nodes.push(json!({"camera": 0, "translation": [1, 2, 3]}));
    nodes.push(json!({"translation": [4, 5, 6], "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    glb.json["scenes"][0]["nodes"].as_array_mut().unwrap().extend([json!(extra), json!(extra + 1)]);
    let folder = Folder::new();
    let path = folder.write("room.glb", glb.bytes());
    let of = |up: UpAxis| read(&path, &ReadOptions { up, ..ReadOptions::default() }).unwrap();
    let (as_is, turned) = (of(UpAxis::Y), of(UpAxis::Z));
    let turn = |v: DVec3| DVec3::new(v.x, v.z, -v.y);
    assert_eq!((as_is.faces.len(), as_is.cameras.len(), as_is.lamps.len()), (1, 1, 1));
    let corners: Vec<DVec3> = as_is.faces[0].corners.iter().map(|&corner| turn(corner)).collect();
    assert_eq!(turned.faces[0].corners, corners);
    assert_eq!(turned.cameras[0].eye, DVec3::new(1.0, 3.0, -2.0));
    assert_eq!(turned.cameras[0].forward, turn(as_is.cameras[0].forward));
    assert_eq!(turned.cameras[0].up, turn(as_is.cameras[0].up));
    assert_eq!(turned.lamps[0].position, DVec3::new(4.0, 6.0, -5.0));
    assert_eq!(turned.lamps[0].forward, turn(as_is.lamps[0].forward));
    assert_eq!(turned.lamps[0].side, turn(as_is.lamps[0].side));
}

/// Catches metallic said once per face, said of a dielectric, or not told apart from an absent one.
#[test]
fn metallic_is_said_once_per_material() {
    let said = |pbr: Value, extensions: Value| {
        let glb = Glb::triangle(json!({"pbrMetallicRoughness": pbr, "extensions": extensions}));
        let of = |issue: &Issue| issue.object == "material 0";
        glb.scene().issues.into_iter().filter(of).map(|issue| (issue.severity, issue.message)).collect::<Vec<_>>()
    };
    assert_eq!(said(json!({"metallicFactor": 0}), json!({})), []);
    let explicit = said(json!({"metallicFactor": 0.75}), json!({}));
    assert_eq!((explicit.len(), explicit[0].0), (1, Severity::Warning));
    assert!(explicit[0].1.contains("0.75"));
    assert_eq!(said(json!({}), json!({}))[0].0, Severity::Note);
    let unlit = said(json!({}), json!({"KHR_materials_unlit": {}}));
    assert!(unlit.len() == 1 && unlit[0].1.contains("unlit"), "{unlit:?}");
}

/// Catches averages taken on encoded values: the mean of black and white is 0.5, not 0.214.
#[test]
fn textures_average_in_linear_space() {
    let pixels = halves([0, 0, 0, 255], [255, 255, 255, 255]);
    let with_texture = |factor: [f64; 3]| {
        textured(&pixels, json!({}), |texture| {
            json!({"emissiveFactor": factor, "emissiveTexture": {"index": texture}, "pbrMetallicRoughness": {
                "metallicFactor": 0, "baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": {"index": texture},
            }})
        })
    };
    let aglow = with_texture([1.0; 3]).scene();
    // Lower right triangle: the right half holds 3/4 of it, on average over the four equal parts that it is cut into,
    // each in one half.
    let parts = &aglow.faces[..aglow.faces.len() / 2];
    let mean = |value: &dyn Fn(&isolux_core::scene::Surface) -> Rgb| {
        parts.iter().map(|face| value(face.surface.as_ref().unwrap())).sum::<Rgb>() / parts.len() as f64
    };
    assert_eq!(parts.len(), 4);
    assert!(
        parts.iter().all(|face| [0.0, PI].iter().any(|&all| (face.surface.unwrap().emission[0] - all).abs() < 1e-3))
    );
    close(mean(&|surface| surface.emission), [0.75 * PI; 3], 1e-3);
    close(mean(&|surface| surface.reflectance), [0.375, 0.75, 0.75], 1e-4);
    // Parts are counted from the right angle.
    let uv = [DVec2::new(1.0, 0.0), DVec2::new(1.0, 0.5), DVec2::new(0.5, 0.0)];
    assert_eq!(aglow.faces[0].uv.as_deref(), Some(&uv[..]));
    let scene = with_texture([0.0; 3]).scene();
    let surface = scene.faces[0].surface.unwrap();
    close(surface.reflectance, [0.375, 0.75, 0.75], 1e-4);
    close(scene.faces[1].surface.unwrap().reflectance, [0.125, 0.25, 0.25], 1e-4);
    let material = &scene.materials[0];
    close(material.surface.reflectance, [0.25, 0.5, 0.5], 1e-4);
    let texture = material.texture.as_ref().unwrap();
    assert_eq!((texture.factor, texture.wrap), (Rgb([0.5, 1.0, 1.0]), [Wrap::Repeat; 2]));
    assert_eq!(scene.images.len(), 1);
    assert_eq!((scene.images[0].mime.as_str(), &scene.images[0].bytes), ("image/png", &png(&pixels)));
    assert_eq!(scene.faces[0].uv.as_ref().unwrap()[1], DVec2::new(1.0, 0.0));

    let grey = textured(
        &halves([128, 128, 128, 255], [128, 128, 128, 255]),
        json!({}),
        |texture| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}),
    );
    close(grey.scene().faces[0].surface.unwrap().reflectance, [linear(128); 3], 1e-4);
}

/// Catches a texture transform, texture coordinate set or wrap mode that is not honoured, or a wrong turn.
#[test]
fn texture_transforms_sets_and_wraps_are_honoured() {
    let quadrants =
        RgbaImage::from_fn(8, 8, |x, y| Rgba([if x < 4 { 0 } else { 255 }, if y < 4 { 0 } else { 255 }, 255, 255]));
    let colours = |info: Value, sampler: Value| {
        let mut glb = textured(&quadrants, sampler, |texture| {
            let mut info = info.clone();
            info["index"] = json!(texture);
            json!({"pbrMetallicRoughness": {"baseColorTexture": info}})
        });
        let second = glb.floats("VEC2", &[0.5, 0.5, 1.0, 0.5, 1.0, 1.0, 0.5, 1.0]);
        glb.attribute("TEXCOORD_1", second);
        let scene = glb.scene();
        let surfaces: Vec<Rgb> = scene.faces.iter().map(|face| face.surface.unwrap().reflectance).collect();
        ((surfaces[0] + surfaces[1]) / 2.0, scene)
    };
    let transform = |json: Value| json!({"extensions": {"KHR_texture_transform": json}});
    close(colours(json!({}), json!({})).0, [0.5, 0.5, 1.0], 1e-4);
    close(colours(json!({"texCoord": 1}), json!({})).0, [1.0, 1.0, 1.0], 1e-4);
    close(colours(transform(json!({"scale": [0.5, 0.5], "offset": [0.5, 0]})), json!({})).0, [1.0, 0.0, 1.0], 1e-4);
    let (mean, scene) = colours(transform(json!({"texCoord": 1, "offset": [-0.5, 0]})), json!({}));
    close(mean, [0.0, 1.0, 1.0], 1e-4);
    assert_eq!(scene.faces[0].uv.as_ref().unwrap()[0], DVec2::new(0.0, 0.5));
    // A quarter turn: +u goes to -v (upwards), +v to +u. The unit square lands on u in 0..1, v in -1..0.
    let quarter = json!({"rotation": PI / 2.0, "scale": [0.5, 0.5], "offset": [0, 1]});
    let (mean, scene) = colours(transform(quarter), json!({}));
    close(mean, [0.0, 1.0, 1.0], 1e-4);
    assert!((scene.faces[0].uv.as_ref().unwrap()[1] - DVec2::new(0.0, 0.5)).length() < 1e-6);
    // Beyond the edge: clamped to the last column; mirrored to the first half again.
    let beyond = json!({"offset": [1, 0], "scale": [0.5, 1]});
    let clamp = json!({"wrapS": 33071, "wrapT": 33071});
    close(colours(transform(beyond.clone()), clamp).0, [1.0, 0.5, 1.0], 1e-4);
    close(colours(transform(beyond.clone()), json!({"wrapS": 33648})).0, [1.0, 0.5, 1.0], 1e-4);
    close(colours(transform(beyond), json!({})).0, [0.0, 0.5, 1.0], 1e-4);
}

/// Catches vertex colours decoded as sRGB, not normalised, or not averaged.
#[test]
fn vertex_colours_multiply_the_base_colour() {
    let mut glb = Glb::triangle(json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]}}));
    let colours = glb.accessor("VEC4", UBYTE, 3, &[255, 0, 51, 255, 255, 0, 51, 255, 255, 255, 51, 255]);
    glb.json["accessors"][colours]["normalized"] = json!(true);
    glb.attribute("COLOR_0", colours);
    close(glb.scene().faces[0].surface.unwrap().reflectance, [0.5, 1.0 / 3.0, 0.2], 1e-12);
}

/// Catches a mask that is upside down, cut at the wrong alpha, or coloured by what is not there.
#[test]
fn masks_are_kept_per_texel() {
    let pixels = halves([0, 255, 0, 100], [255, 0, 0, 200]);
    let mask = |cutoff: f64, factor: f64| {
        textured(&pixels, json!({"wrapS": 33071}), |texture| {
            json!({"alphaMode": "MASK", "alphaCutoff": cutoff, "pbrMetallicRoughness": {
                "baseColorFactor": [1, 1, 1, factor], "baseColorTexture": {"index": texture},
            }})
        })
        .scene()
    };
    let scene = mask(0.5, 1.0);
    assert_eq!(scene.materials[0].alpha, Alpha::Mask(0));
    let found = &scene.masks[0];
    assert_eq!((found.width, found.height, found.wrap), (8, 8, [Wrap::Clamp, Wrap::Repeat]));
    assert!(!found.is_solid(DVec2::new(0.4, 0.1)) && found.is_solid(DVec2::new(0.6, 0.1)));
    let surface = scene.faces[0].surface.unwrap();
    assert!((surface.opacity - 0.75).abs() < 1e-4);
    close(surface.reflectance, [1.0, 0.0, 0.0], 1e-4);
    // The factor multiplies alpha before the cut: 200/255 * 0.5 is below 0.5, above 0.35.
    assert!(mask(0.5, 0.5).masks[0].solid.iter().all(|solid| !solid));
    assert_eq!(mask(0.35, 0.5).masks[0].solid.iter().filter(|&&solid| solid).count(), 32);
    // What is kept for writing is a cut of the texture alone; a factor of 0 leaves nothing of it, a cutoff of 0 all.
    for (cutoff, factor, expected) in [(0.5, 1.0, 0.5), (0.375, 0.5, 0.75), (0.0, 0.0, 0.0)] {
        assert_eq!(mask(cutoff, factor).masks[0].cutoff, expected);
    }
    let nothing = &mask(0.25, 0.0).masks[0];
    assert!(nothing.cutoff > 1.0 && nothing.cutoff.is_finite() && !nothing.solid.contains(&true));

    // Two materials that cut alike share a mask; one that cuts otherwise has its own.
    let mut twins = textured(
        &pixels,
        json!({}),
        |texture| json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}),
    );
    for cutoff in [0.5, 0.9] {
        let primitive = twins.json["meshes"][0]["primitives"][0].clone();
        let mut material = twins.json["materials"][0].clone();
        material["alphaCutoff"] = json!(cutoff);
        let number = twins.push("materials", material);
        let primitives = twins.json["meshes"][0]["primitives"].as_array_mut().unwrap();
        primitives.push(primitive);
        primitives.last_mut().unwrap()["material"] = json!(number);
    }
    let scene = twins.scene();
    let alphas: Vec<Alpha> = scene.materials.iter().map(|material| material.alpha).collect();
    assert_eq!(alphas, [Alpha::Mask(0), Alpha::Mask(0), Alpha::Mask(1)]);
    assert_eq!((scene.masks[0].cutoff, scene.masks[1].cutoff as f32), (0.5, 0.9));
    assert_eq!(scene.masks.len(), 2);

    let whole = |alpha: f64| {
        let pbr = json!({"baseColorFactor": [1, 1, 1, alpha]});
        Glb::triangle(json!({"alphaMode": "MASK", "pbrMetallicRoughness": pbr})).scene()
    };
    assert_eq!((whole(0.6).materials[0].surface.opacity, whole(0.6).materials[0].alpha), (1.0, Alpha::Opaque));
    assert_eq!((whole(0.4).materials[0].surface.opacity, whole(0.4).materials[0].alpha), (0.0, Alpha::Attenuate));
    find(&whole(0.4), IssueKind::Assumed, "material 0", "below alphaCutoff");
}

/// Catches alpha averaged wrongly, colour not weighted by it, or light made by glass.
#[test]
fn blend_and_transmission_attenuate() {
    let glb = textured(&halves([0, 0, 255, 51], [255, 0, 0, 255]), json!({}), |texture| {
        json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {
            "baseColorFactor": [1, 1, 1, 0.5], "baseColorTexture": {"index": texture},
        }})
    });
    let scene = glb.scene();
    assert_eq!(scene.materials[0].alpha, Alpha::Attenuate);
    let surface = scene.materials[0].surface;
    // Alpha 0.2 and 1 in halves, times 0.5.
    assert!((surface.opacity - 0.3).abs() < 1e-4);
    close(surface.reflectance, [0.5 / 0.6, 0.0, 0.1 / 0.6], 1e-4);

    let glass = Glb::triangle(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.8, 0.7, 1], "metallicFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.75}},
    }))
    .scene();
    let surface = glass.materials[0].surface;
    assert_eq!(glass.materials[0].alpha, Alpha::Attenuate);
    // Passing 0.75 * 0.8; reflected 0.25 of the base colour, by the opaque 0.4.
    assert!((surface.opacity - 0.4).abs() < F32);
    close(surface.reflectance * surface.opacity, [0.225, 0.2, 0.175], F32);
    for band in 0..3 {
        assert!(surface.reflectance[band] <= 1.0, "glass must not make light");
    }
}

/// Catches a missing or broken picture that ends the reading, or goes unsaid.
#[test]
fn a_missing_image_leaves_the_factor() {
    let material = json!({"name": "paper", "pbrMetallicRoughness": {
        "baseColorFactor": [0.5, 0.5, 0.5, 1], "baseColorTexture": {"index": 0},
    }});
    for (uri, part) in [
        ("gone%20away.png", "no such file"),
        ("http://example.org/x.png", "refused"),
        ("data:image/png;base64,AAAA", "cannot be decoded"),
    ] {
        let mut glb = Glb::triangle(material.clone());
        glb.push("images", json!({"uri": uri}));
        glb.push("textures", json!({"source": 0}));
        let scene = glb.scene();
        let issue = find(&scene, IssueKind::MissingFile, "paper", part);
        assert!(issue.message.contains("image 0") || issue.message.contains(uri), "{issue:?}");
        close(scene.materials[0].surface.reflectance, [0.5; 3], 1e-12);
        assert_eq!((scene.materials[0].texture.as_ref(), scene.images.len()), (None, 0));
    }
}

/// Catches pixels allocated because a header of 54 bytes claims them.
#[test]
fn an_image_that_claims_too_much_is_refused() {
    let mut header = b"BM\x36\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0".to_vec();
    [30_000_u32, 30_000].iter().for_each(|side| header.extend_from_slice(&side.to_le_bytes()));
    header.extend_from_slice(&[1, 0, 24, 0]);
    header.resize(54, 0);
    let folder = Folder::new();
    folder.write("claim.bmp", header);
    let mut glb = Glb::triangle(json!({"name": "paper", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    glb.push("images", json!({"uri": "claim.bmp"}));
    glb.push("textures", json!({"source": 0}));
    find(&folder.read("room.glb", glb.bytes()).unwrap(), IssueKind::MissingFile, "paper", "30000 x 30000 texels");
}

/// Catches files beside the scene that are not found, and pictures of other formats passed on as they are.
#[test]
fn external_files_are_found() {
    let folder = Folder::new();
    let mut glb = textured(
        &halves([0; 4], [255; 4]),
        json!({}),
        |texture| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}),
    );
    glb.json["buffers"] = json!([{"uri": "data%20files/room.bin", "byteLength": glb.bin.len()}]);
    glb.json["images"] = json!([{"uri": "../pictures/wall.bmp"}]);
    folder.write("scene/data files/room.bin", &glb.bin);
    halves([0, 0, 0, 255], [255; 4]).save(folder.write("pictures/wall.bmp", [])).unwrap();
    // A byte order mark before the JSON, too.
    let scene = folder.read("scene/room.gltf", format!("\u{feff}{}", glb.json)).unwrap();
    close(scene.materials[0].surface.reflectance, [0.5; 3], 1e-4);
    assert_eq!(scene.images[0].mime, "image/png");
    assert!(scene.images[0].bytes.starts_with(b"\x89PNG"));
}

// ---------------------------------------------------------------------------------------------------- errors

/// Catches a broken container or JSON that panics, allocates, or is reported without its file.
#[test]
fn broken_containers_are_errors() {
    let folder = Folder::new();
    let whole = Glb::triangle(json!({})).bytes();
    for length in 0..whole.len() {
        let error = folder.read("cut.glb", &whole[..length]).unwrap_err();
        assert_one_line(&error);
        assert!(error.to_string().contains("cut.glb"));
    }
    let malformed = |name: &str, bytes: &[u8], part: &str| {
        let error = folder.read(name, bytes).unwrap_err();
        assert_one_line(&error);
        assert!(matches!(error, ReadError::Malformed { .. }), "{error}");
        assert!(error.to_string().contains(part), "{error}");
    };
    malformed("magic.glb", b"glTX\x02\0\0\0", "JSON");
    malformed("old.glb", b"glTF\x01\0\0\0\x0c\0\0\0", "version 1");
    malformed("huge.glb", b"glTF\x02\0\0\0\xff\xff\xff\xff\xff\xff\xff\xffJSON", "truncated");
    malformed("short.glb", b"glTF\x02\0\0\0\x02\0\0\0\0\0\0\0", "truncated");
    malformed("empty.glb", b"glTF\x02\0\0\0\x0c\0\0\0", "no JSON chunk");
    malformed("deep.gltf", "[".repeat(1 << 20).as_bytes(), "JSON");
    let deep = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"extras\":{}", "[".repeat(1 << 20));
    malformed("deep2.gltf", deep.as_bytes(), "JSON");
}

/// Catches directories, missing files, unknown formats reported without what to do.
#[test]
fn unreadable_paths_are_errors() {
    let folder = Folder::new();
    let say = |path: &Path| {
        let error = read(path, &ReadOptions::default()).unwrap_err();
        assert_one_line(&error);
        error.to_string()
    };
    assert!(say(&folder.0).contains("directory"));
    assert!(say(&folder.0.join("gone.glb")).contains("no such file"));
    let unknown = say(&folder.write("room.dae", "<COLLADA/>"));
    for part in [".dae", ".glb", ".gltf", ".obj", "isolux[meshes]"] {
        assert!(unknown.contains(part), "{unknown}");
    }
    assert!(say(&folder.write("room", "?")).contains("no extension"));
    assert!(say(&folder.write("a\nb.dae", "?")).contains('\u{fffd}'));
    // Content counts more than the name.
    read(&folder.write("room.bin", Glb::triangle(json!({})).bytes()), &ReadOptions::default()).unwrap();
}

/// Catches lengths, offsets and indices that are believed: each must be an error that names the object.
#[test]
fn claims_are_checked_against_the_file() {
    let object = |change: &dyn Fn(&mut Value), part: &str| {
        let mut glb = Glb::triangle(json!({}));
        glb.json["nodes"][0]["name"] = json!("evil\nname");
        change(&mut glb.json);
        let error = glb.error().to_string();
        assert!(error.contains("room.glb") && error.contains("evil\u{fffd}name") && error.contains(part), "{error}");
    };
    let huge = u64::MAX / 2;
    object(&|json| json["accessors"][0]["count"] = json!(4_000_000_000_u64), "do not fit");
    object(&|json| json["accessors"][0]["count"] = json!(huge), "do not fit");
    object(&|json| json["accessors"][0]["byteOffset"] = json!(huge), "do not fit");
    object(&|json| json["bufferViews"][0]["byteStride"] = json!(huge), "do not fit");
    object(&|json| json["bufferViews"][0]["byteStride"] = json!(1), "stride");
    object(&|json| json["bufferViews"][0]["byteOffset"] = json!(huge), "buffer view 0");
    object(&|json| json["bufferViews"][0]["buffer"] = json!(7), "buffer 7");
    object(&|json| json["accessors"][0]["bufferView"] = json!(9), "buffer view 9");
    object(&|json| json["accessors"][0]["type"] = json!("VEC2"), "VEC2");
    object(&|json| json["accessors"][0]["componentType"] = json!(1), "component type");
    object(&|json| drop(json["accessors"][0].as_object_mut().unwrap().remove("bufferView")), "no data");
    object(&|json| json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(5), "accessor 5");
    object(&|json| json["meshes"][0]["primitives"][0]["material"] = json!(5), "material 5");
    object(&|json| json["nodes"][0]["mesh"] = json!(5), "mesh 5");
    object(&|json| json["nodes"][0]["camera"] = json!(5), "camera 5");
    object(
        &|json| {
            json["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": 0, "componentType": 5121,
                "byteOffset": 6}, "values": {"bufferView": 0}});
            json["accessors"][0]["count"] = json!(0);
        },
        "sparse element",
    );
    object(
        &|json| {
            json["accessors"][0]["sparse"] = json!({"count": 2, "indices": {"bufferView": 0, "componentType": 5121},
                "values": {"bufferView": 0}});
        },
        "out of order",
    );
    // The data model of the `gltf` crate would cut these to 0.
    object(&|json| json["nodes"][0]["mesh"] = json!(1_u64 << 32), "mesh 4294967295");
    object(
        &|json| json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(1_u64 << 32),
        "accessor 4294967295",
    );
    // Zeros by the thousand million, of which none is in the file.
    object(
        &|json| {
            json["accessors"][0] = json!({"componentType": 5126, "type": "VEC3", "count": 4_000_000_000_u64, "sparse":
                {"count": 0, "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 0}}});
        },
        "more than the file has bytes for",
    );

    let mut glb = Glb::triangle(json!({}));
    let indices = glb.indices_u16(&[0, 1, 2, 0, 2, 3]);
    glb.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let expected = "object 'tri': face 1: vertex 3 is out of range (there are 3)";
    assert!(glb.error().to_string().contains(expected));

    let mut glb = Glb::triangle(json!({}));
    glb.json["scenes"][0]["nodes"] = json!([77]);
    assert!(glb.error().to_string().contains("node 77"));
    glb.json["scene"] = json!(3);
    assert!(glb.error().to_string().contains("scene 3"));
}

/// Catches buffers that are missing, short, or fetched from where they should not be.
#[test]
fn buffers_must_be_there() {
    let folder = Folder::new();
    for (buffer, part) in [
        (json!({"uri": "gone.bin", "byteLength": 4}), "buffer 0 ('gone.bin'): no such file"),
        (json!({"uri": "https://example.org/a.bin", "byteLength": 4}), "refused"),
        (json!({"uri": "/etc/hostname", "byteLength": 4}), "refused"),
        (json!({"uri": "data:;base64,AAAA", "byteLength": 4_000_000_000_u64}), "3 are there"),
        (json!({"byteLength": 4}), "neither"),
        (json!({"uri": ".", "byteLength": 4}), "directory"),
    ] {
        let json = json!({"asset": {"version": "2.0"}, "buffers": [buffer]});
        let error = folder.read("room.gltf", json.to_string()).unwrap_err();
        assert_one_line(&error);
        assert!(matches!(error, ReadError::Buffer { .. }) && error.to_string().contains(part), "{error}");
    }
}

/// Catches a file read although it says that it cannot be understood, or refused without a remedy.
#[test]
fn required_extensions_are_heeded() {
    for (name, remedy) in [
        ("KHR_draco_mesh_compression", "without mesh compression"),
        ("EXT_meshopt_compression", "without mesh compression"),
        ("KHR_texture_basisu", "PNG"),
        ("ACME_thing", "without this extension"),
    ] {
        let mut glb = Glb::triangle(json!({}));
        glb.json["extensionsRequired"] = json!([name]);
        let error = glb.error().to_string();
        assert!(error.contains("room.glb") && error.contains(name) && error.contains(remedy), "{error}");
    }
    let mut glb = Glb::triangle(json!({}));
    glb.json["extensionsRequired"] = json!(["KHR_materials_clearcoat", "KHR_texture_transform"]);
    assert_eq!(glb.scene().faces.len(), 1);
    // Draco that is optional, but without the data it is optional to.
    let accessor = glb.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 3}));
    glb.attribute("POSITION", accessor);
    glb.json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0}});
    assert!(glb.error().to_string().contains("Draco") || glb.error().to_string().contains("draco"));
    glb.json["asset"]["version"] = json!("1.0");
    assert!(glb.error().to_string().contains("glTF 1.0"));
}

/// Catches a small file that asks for more faces than memory holds.
#[test]
fn instances_by_the_million_are_refused() {
    let mut glb = Glb::new();
    let position = glb.floats("VEC3", &[0.0; 9]);
    let indices = glb.accessor("SCALAR", UBYTE, 60_000, &[0; 60_000]);
    glb.push("meshes", json!({"primitives": [{"attributes": {"POSITION": position}, "indices": indices}]}));
    let count = MAX_FACES / 20_000 + 1;
    glb.json["nodes"] = (0..count).map(|_| json!({"mesh": 0})).collect();
    glb.json["scenes"][0]["nodes"] = (0..count).collect();
    assert!(matches!(glb.error(), ReadError::TooLarge { .. }));
}

/// Numbers at the edges of what counts, offsets, indices, component types and factors may be.
const HOSTILE: [&str; 22] = [
    "0",
    "1",
    "2",
    "3",
    "4",
    "5",
    "7",
    "12",
    "16",
    "255",
    "5121",
    "5123",
    "5125",
    "5126",
    "33071",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "-1",
    "0.5",
    "1e300",
];

fn everything() -> Glb {
    let mut glb = textured(&halves([9, 200, 30, 40], [255, 0, 0, 255]), json!({"wrapS": 33648}), |texture| {
        json!({"alphaMode": "MASK", "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": texture},
            "pbrMetallicRoughness": {"baseColorTexture": {"index": texture,
                "extensions": {"KHR_texture_transform": {"rotation": 0.3}}}}})
    });
    let colours = glb.accessor("VEC4", UBYTE, 4, &[7; 16]);
    glb.attribute("COLOR_0", colours);
    glb.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}));
    let camera = glb.push("nodes", json!({"camera": 0}));
    glb.json["nodes"][0]["children"] = json!([camera]);
    // A mesh whose positions and indices are sparse and quantised.
    let positions = glb.accessor("VEC3", BYTE, 4, &[1; 16]);
    let view = glb.json["accessors"][positions]["bufferView"].as_u64().unwrap() as usize;
    glb.json["bufferViews"][view]["byteStride"] = json!(4);
    let indices = glb.indices_u16(&[0, 1, 2, 2, 1, 3]);
    let (places, values) = (glb.view(&[0, 2]), glb.view(&[0; 8]));
    let sparse = |component: u64| {
        json!({"count": 2, "indices": {"bufferView": places, "componentType": component},
            "values": {"bufferView": values}})
    };
    glb.json["accessors"][positions]["sparse"] = sparse(UBYTE);
    glb.json["accessors"][indices]["sparse"] = sparse(UBYTE);
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices, "mode": 5});
    let mesh = glb.push("meshes", json!({"primitives": [primitive]}));
    let node = glb.push("nodes", json!({"mesh": mesh, "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    glb.json["scenes"][0]["nodes"] = json!([0, node]);
    let lamp = json!({"type": "spot", "color": [1, 0.5, 0.2], "intensity": 30, "range": 9,
        "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.7}});
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [lamp]}});
    glb
}

/// A triangle with one lamp of each kind below turned and scaled nodes.
fn with_lamps() -> Glb {
    let mut glb = Glb::triangle(json!({}));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    glb.json["nodes"] = json!([
        {"name": "tri", "mesh": 0, "children": [1, 3]},
        {"name": "arm", "translation": [1, 2, 3], "scale": [2, 2, 2], "rotation": [-half, 0, 0, half], "children": [2]},
        {"name": "bulb", "translation": [0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"rotation": [0, half, 0, half], "children": [4, 5, 6]},
        {"name": "bulb", "extensions": {"KHR_lights_punctual": {"light": 1}}},
        {"extensions": {"KHR_lights_punctual": {"light": 2}}},
        {"name": "odd", "extensions": {"KHR_lights_punctual": {"light": 3}}},
    ]);
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "color": [1, 0.5, 0], "intensity": 40, "range": 5,
            "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.7}},
        {"type": "point"},
        {"type": "directional", "name": "sun", "intensity": 3},
        {"type": "laser"},
    ]}});
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    glb
}

/// Catches lamps in their node's space, or shining along another axis than -z; wrong defaults; names that collide; a kind that
/// there is none of, or a range, dropped in silence.
#[test]
fn lamps_are_read() {
    let scene = with_lamps().scene();
    let [spot, point, sun] = &scene.lamps[..] else { panic!("{:?}", scene.lamps) };
    assert_eq!([&spot.name, &point.name, &sun.name].map(String::as_str), ["bulb", "bulb#2", "sun"]);
    // Twice the step along z, which the arm turns to y.
    near(spot.position, [1.0, 4.0, 3.0]);
    near(spot.forward, [0.0, -1.0, 0.0]);
    assert_eq!(spot.intensity, Rgb([40.0, 20.0, 0.0]));
    let LampShape::Spot { inner, outer } = spot.shape else { panic!("{:?}", spot.shape) };
    assert!((inner - 0.2).abs() < 1e-7 && (outer - 0.7).abs() < 1e-7);
    assert_eq!((&point.shape, point.intensity), (&LampShape::Point, Rgb::splat(1.0)));
    assert_eq!((&sun.shape, sun.intensity), (&LampShape::Parallel, Rgb::splat(3.0)));
    near(sun.forward, [-1.0, 0.0, 0.0]);
    find(&scene, IssueKind::Ignored, "bulb", "range");
    assert_eq!(find(&scene, IssueKind::Ignored, "odd", "type").severity, Severity::Warning);
}

/// Catches a spot without angles that is no cone of 45 degrees, and one without a rim that cannot be built.
#[test]
fn cones_have_defaults() {
    for (spot, wanted) in [
        (json!({}), (0.0, std::f64::consts::FRAC_PI_4)),
        (json!({"innerConeAngle": 0.5, "outerConeAngle": 0.5}), (0.4995, 0.5)),
    ] {
        let mut glb = with_lamps();
        glb.json["extensions"]["KHR_lights_punctual"]["lights"][0]["spot"] = spot;
        let input = glb.scene();
        let LampShape::Spot { inner, outer } = input.lamps[0].shape else { panic!("{:?}", input.lamps[0]) };
        // Angles are in single precision.
        assert!((inner - wanted.0).abs() < 1e-6 && (outer - wanted.1).abs() < 1e-6, "{inner} {outer}");
        Scene::build(input, &BuildOptions::default()).unwrap();
    }
}

/// Catches factors between units: by Blender's convention 1 W is 683 lm, in all directions alike.
#[test]
fn light_units_are_as_blender_exports_them() {
    let intensities = |light_units: LightUnits| {
        let options = ReadOptions { light_units, ..ReadOptions::default() };
        let scene = read(&Folder::new().write("room.glb", with_lamps().bytes()), &options).unwrap();
        [1, 2].map(|lamp: usize| scene.lamps[lamp].intensity[0])
    };
    let per_watt = 683.0;
    for (units, wanted) in [
        (LightUnits::Spec, [1.0, 3.0]),
        (LightUnits::Unitless, [per_watt, 3.0 * per_watt]),
        (LightUnits::Blender, [per_watt / (4.0 * PI), 3.0 * per_watt]),
    ] {
        let found = intensities(units);
        assert!((0..2).all(|k| (found[k] / wanted[k] - 1.0).abs() < 1e-12), "{units:?} {found:?}");
    }
    assert_eq!(LightUnits::from_name("blender"), Some(LightUnits::Blender));
    assert_eq!(LightUnits::from_name("lumen"), None);
}

/// A luminaire of 1, 0.8 and 0 times 100 cd at 0, 45 and 90 degrees, its horizontal angles one or those of a quarter
/// circle that has half of that at 90.
fn ies(is_round: bool) -> String {
    let (angles, rows) = if is_round { ("1", "0\n100 80 0") } else { ("2", "0 90\n100 80 0\n50 40 0") };
    format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 {angles} 1 2 0 0 0\n1 1 10\n0 45 90\n{rows}\n")
}

/// A triangle with three light profiles, one of each way to bring them along, and nodes that show them: hanging,
/// turned, mirrored.
fn with_profiles() -> Glb {
    let mut glb = Glb::triangle(json!({}));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let view = glb.view(ies(true).as_bytes());
    let data = format!("data:application/x-ies-lm-63,{}", ies(false).replace('\n', "%0A"));
    let node = |light: usize| json!({"EXT_lights_ies": {"light": light}});
    glb.json["nodes"] = json!([
        {"name": "tri", "mesh": 0, "children": [1, 2, 3, 4]},
        {"name": "hanging", "translation": [1, 2, 3], "scale": [3, 3, 3], "rotation": [-half, 0, 0, half],
            "extensions": {"EXT_lights_ies": {"light": 0, "multiplier": 2.5, "color": [1, 0.5, 7]}}},
        {"translation": [0, 1, 0], "rotation": [0, half, 0, half], "extensions": node(1)},
        {"name": "mirror", "scale": [1, -1, 1], "extensions": node(1)},
        {"name": "beside", "extensions": node(2)},
    ]);
    glb.json["extensions"] = json!({"EXT_lights_ies": {"lights": [
        {"bufferView": view, "mimeType": "application/x-ies-lm-63"},
        {"uri": data, "name": "oval"},
        {"uri": "my%20lamps/round.ies"},
        {"uri": "nobody shows it.ies"},
    ]}});
    glb.json["extensionsUsed"] = json!(["EXT_lights_ies"]);
    glb.json["extensionsRequired"] = json!(["EXT_lights_ies"]);
    glb
}

fn read_profiles(glb: &Glb, beside: &str) -> Result<SceneInput, ReadError> {
    let folder = Folder::new();
    folder.write("my lamps/round.ies", beside);
    folder.read("room.glb", glb.bytes())
}

/// Catches light profiles that are not found where they are, that point along another axis than -z, a lost multiplier
/// or tint, a luminaire that stays the same where its node is a mirror, and flux that changes with a node's scale.
#[test]
fn light_profiles_are_read() {
    let scene = read_profiles(&with_profiles(), &ies(true)).unwrap();
    let [hanging, oval, mirror, beside] = &scene.lamps[..] else { panic!("{:?}", scene.lamps) };
    let names = [hanging, oval, mirror, beside].map(|lamp| lamp.name.as_str());
    assert_eq!(names, ["hanging", "oval", "mirror", "beside"]);
    near(hanging.position, [1.0, 2.0, 3.0]);
    near(hanging.forward, [0.0, -1.0, 0.0]);
    assert_eq!(hanging.intensity, Rgb([2.5, 1.25, 2.5]));
    assert_eq!(beside.intensity, Rgb::splat(1.0));
    near(oval.forward, [-1.0, 0.0, 0.0]);
    near(oval.side, [0.0, 0.0, -1.0]);
    // The file's piecewise linear function: integral of I(v) sin v over both halves of the quarter circle.
    let (q, h) = (PI / 4.0, 0.5_f64.sqrt());
    let first = 100.0 - 80.0 * h - 20.0 / q * h;
    let second = 80.0 * h - 80.0 / q * (1.0 - h);
    let round = 2.0 * PI * (first + second);
    for (lamp, wanted) in [(hanging, 2.5 * round), (oval, 0.75 * round), (mirror, 0.75 * round), (beside, round)] {
        let power = lamp.power().unwrap()[0];
        assert!((power / wanted - 1.0).abs() < 1e-9, "{}: {power} {wanted}", lamp.name);
    }
    // Along +x of the node H is 0, along its y it is 90, and 270 the other way: alike in this file.
    let at = |x: f64, y: f64| DVec3::new(x, y, -1.0).normalize();
    for (direction, wanted) in [(at(1.0, 0.0), 80.0), (at(0.0, 1.0), 40.0), (at(0.0, -1.0), 40.0), (at(h, h), 60.0)] {
        let found = mirror.share(direction);
        assert!((found - wanted).abs() < 1e-6, "{direction}: {found}");
    }
    assert!(scene.issues.iter().all(|issue| !issue.message.contains("EXT_lights_ies")), "{:?}", scene.issues);
    Scene::build(scene, &BuildOptions::default()).unwrap();
}

/// Catches a lamp that counts twice where a file has a light for readers that know no profiles, and a warning of a
/// luminaire's file that is lost, or said for each lamp.
#[test]
fn light_profiles_take_precedence_and_tell_what_was_mended() {
    let mut glb = with_profiles();
    glb.json["nodes"][1]["extensions"]["KHR_lights_punctual"] = json!({"light": 0});
    glb.json["extensions"]["KHR_lights_punctual"] = json!({"lights": [{"type": "point"}]});
    glb.json["nodes"][2]["extensions"]["EXT_lights_ies"]["light"] = json!(2);
    let scene = read_profiles(&glb, &ies(true).replace("IESNA:LM-63-2002", "IESNA:LM-63-2077")).unwrap();
    assert_eq!(scene.lamps.len(), 4);
    assert!(scene.lamps.iter().all(|lamp| matches!(lamp.shape, LampShape::Web(_))));
    assert_eq!(find(&scene, IssueKind::Ignored, "hanging", "KHR_lights_punctual").severity, Severity::Warning);
    let told: Vec<&Issue> = scene.issues.iter().filter(|issue| issue.message.contains("round.ies: line 1")).collect();
    assert_eq!(told.len(), 1, "{:?}", scene.issues);
}

/// Catches light profiles that are missing or broken and pass in silence, or whose error names neither lamp nor file
/// nor line.
#[test]
fn broken_light_profiles_are_errors_by_name() {
    let refused = |change: &dyn Fn(&mut Glb), beside: &str| {
        let mut glb = with_profiles();
        change(&mut glb);
        let error = read_profiles(&glb, beside).unwrap_err();
        assert_one_line(&error);
        error.to_string()
    };
    let node = |member: &'static str, value: Value| {
        move |glb: &mut Glb| glb.json["nodes"][4]["extensions"]["EXT_lights_ies"][member] = value.clone()
    };
    let profile =
        |value: Value| move |glb: &mut Glb| glb.json["extensions"]["EXT_lights_ies"]["lights"][2] = value.clone();
    let sound = ies(true);
    let broken = refused(&|_| {}, &sound.replace("80", "eighty"));
    assert!(broken.contains("room.glb: lamp 'beside': my%20lamps/round.ies: line 7: expected "), "{broken}");
    for (message, parts) in [
        (refused(&node("light", json!(4)), &sound), ["node 'beside'", "light profile 4, but there are 4"]),
        (refused(&node("light", json!(1_u64 << 32)), &sound), ["node 'beside'", "but there are 4"]),
        (refused(&node("light", json!("first")), &sound), ["lamp 'beside'", "names no light"]),
        (refused(&node("multiplier", json!("much")), &sound), ["lamp 'beside'", "multiplier is no number"]),
        (refused(&node("color", json!([1, 2])), &sound), ["lamp 'beside'", "color is not three numbers"]),
        (refused(&profile(json!({"uri": "gone.ies"})), &sound), ["lamp 'beside'", "gone.ies: no such file"]),
        (refused(&profile(json!({"uri": "/etc/passwd"})), &sound), ["lamp 'beside'", "absolute paths are refused"]),
        (refused(&profile(json!({"uri": "data:,nothing"})), &sound), ["lamp 'beside'", "light profile 2: line 1"]),
        (refused(&profile(json!({"bufferView": 99})), &sound), ["light profile 2", "buffer view 99 is out of range"]),
        (refused(&profile(json!({})), &sound), ["lamp 'beside'", "neither a URI nor a buffer view"]),
    ] {
        assert!(parts.iter().all(|part| message.contains(part)), "{message} {parts:?}");
    }
}

/// All numbers of a JSON text, to be changed.
fn numbers<'a>(value: &'a mut Value, found: &mut Vec<&'a mut Value>) {
    match value {
        Value::Number(_) => found.push(value),
        Value::Array(entries) => entries.iter_mut().for_each(|entry| numbers(entry, found)),
        Value::Object(members) => members.values_mut().for_each(|member| numbers(member, found)),
        _ => {}
    }
}

/// Catches a file that the next test would spoil in vain, since it is not read in the first place.
#[test]
fn the_file_to_be_damaged_is_sound() {
    // Two meshes of two triangles, and one of two that shines: its parts.
    assert!(everything().scene().faces.len() > 6);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Catches a panic, or an error of several lines, on any damage to a sound file.
    #[test]
    fn damaged_files_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let mut bytes = everything().bytes();
        for (place, value) in changes {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Err(error) = Folder::new().read("damaged.glb", bytes) {
            assert_one_line(&error);
        }
    }

    /// Catches a count, offset, index, type or mode that is believed: most of what `gltf`'s iterators panic on.
    #[test]
    fn wrong_numbers_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0..HOSTILE.len()), 1..4),
    ) {
        let mut glb = everything();
        let mut found = Vec::new();
        numbers(&mut glb.json, &mut found);
        for (place, value) in changes {
            let place = place.index(found.len());
            *found[place] = serde_json::from_str(HOSTILE[value]).unwrap();
        }
        if let Err(error) = Folder::new().read("wrong.glb", glb.bytes()) {
            assert_one_line(&error);
        }
    }

    /// Catches the same for OBJ.
    #[test]
    fn damaged_obj_files_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(b"0123456789-/ \n\\vftog.e".to_vec())), 1..12),
    ) {
        let mut bytes = OBJ.as_bytes().to_vec();
        for (place, value) in changes {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        if let Err(error) = Folder::new().read("damaged.obj", bytes) {
            assert_one_line(&error);
        }
    }
}

// ---------------------------------------------------------------------------------------------------- OBJ

const OBJ: &str = "\
# a room
mtllib room.mtl
v 0 0 0
v 2 0 0
v 2 1 0
v 0 1 0
v 1 1 0.0 1.0
v 1 2 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
o floor
usemtl wood
f 1/1 2/2 3/3 4/4
usemtl light source
f -6 -5 -4
g roof
usemtl nowhere
f 1 2 3 5 4
l 1 2 3
f 1 2
o floor
f 4// 3//\\
 6//
";

const MTL: &str = "\
newmtl wood
Kd 0.5 1 1
map_Kd wood.png
newmtl light source
Kd 0.2 0.2 0.2
Ke 1 2 3
d 0.25
Tr 0.9
";

/// Catches a quadrilateral cut up, a group lost, an index resolved wrongly, v upside down, Ke without pi, d for Tr.
#[test]
fn obj_is_read_with_its_library() {
    let folder = Folder::new();
    folder.write("room.mtl", MTL);
    // Upper half black, lower half white.
    let picture = RgbaImage::from_fn(4, 4, |_, y| Rgba(if y < 2 { [0, 0, 0, 255] } else { [255; 4] }));
    folder.write("wood.png", png(&picture));
    let scene = folder.read("room.obj", OBJ).unwrap();

    let names: Vec<&str> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["floor", "roof"]);
    // One quadrilateral, one triangle, five corners as three triangles, one triangle of floor again.
    assert_eq!(scene.faces.iter().map(|face| face.corners.len()).collect::<Vec<_>>(), [4, 3, 3, 3, 3, 3]);
    assert_eq!(scene.faces.iter().map(|face| face.object).collect::<Vec<_>>(), [0, 0, 1, 1, 1, 0]);
    let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["wood", "light source", "nowhere"]);

    let quad = &scene.faces[0];
    close(quad.surface.unwrap().reflectance, [0.25, 0.5, 0.5], 1e-4);
    assert_eq!(quad.uv.as_ref().unwrap()[0], DVec2::new(0.0, 1.0));
    assert_eq!(scene.materials[0].texture.as_ref().unwrap().factor, Rgb([0.5, 1.0, 1.0]));
    near(scene.faces[1].corners[2], [2.0, 1.0, 0.0]);
    near(scene.faces[5].corners[2], [1.0, 2.0, 0.0]);
    let light = &scene.materials[1];
    close(light.surface.reflectance, [0.2; 3], 1e-12);
    // d is opacity; it takes its share of the emission, too.
    close(light.surface.emission, [0.25 * PI, 0.5 * PI, 0.75 * PI], 1e-12);
    assert_eq!((light.surface.opacity, light.alpha), (0.25, Alpha::Attenuate));
    close(scene.materials[2].surface.reflectance, [0.5; 3], 1e-12);
    find(&scene, IssueKind::Assumed, "nowhere", "no material library defines it");
    assert!(scene.issues.iter().any(|issue| issue.kind == IssueKind::Assumed && issue.message.contains("metres")));
    assert!(scene.issues.iter().any(|issue| issue.message.contains("2 points and lines")));
}

/// Catches a missing library that ends the reading, or goes unsaid.
#[test]
fn obj_without_its_library_is_grey() {
    let scene = Folder::new().read("room.obj", OBJ).unwrap();
    find(&scene, IssueKind::MissingFile, "room.mtl", "no such file");
    find(&scene, IssueKind::MissingFile, "wood", "0.5");
    assert!(scene.materials.iter().all(|material| material.surface.reflectance == Rgb::splat(0.5)));
}

/// Catches errors without object, face or line.
#[test]
fn obj_errors_say_where() {
    let folder = Folder::new();
    let say = |text: &str| {
        let error = folder.read("room.obj", text).unwrap_err();
        assert_one_line(&error);
        error.to_string()
    };
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\no sofa\nf 1 2 3\n";
    assert!(
        say(&format!("{triangle}f 1 2 9")).contains("object 'sofa': face 1: vertex 9 is out of range (there are 3)")
    );
    for index in ["0", "-4", "9223372036854775807", "-9223372036854775808"] {
        assert!(say(&format!("{triangle}f 1 2 {index}")).contains("out of range"), "{index}");
    }
    assert!(say(&format!("{triangle}f 1/1 2/1 3/1")).contains("texture coordinate 1 is out of range"));
    assert!(say(&format!("{triangle}f 1 2 99999999999999999999")).contains("line 6"));
    assert!(say("v 1 2").contains("line 1"));
    let many = (0..2000).map(|i| format!("v {} {} 0\n", i % 7, i)).collect::<String>();
    let face: String = (1..=2000).map(|i| format!(" {i}")).collect();
    assert!(say(&format!("{many}f{face}")).contains("concave"));
}
