//! A hand-made scene with every kind of surface goes through every writer; what is read back by other code (the `gltf`,
//! `image`, `exr` crates, and small parsers below) must be the numbers that went in.
//!
//! The files stay in `target/tmp`, where `tests/gltf/validate.mjs` takes the GLB ones.

#![allow(clippy::unwrap_used)]

use gltf::Semantic;
use isolux_core::scene::{
    Alpha, AlphaMask, Camera, Corners, Image, Material, Object, Plane, Polygon, Projection, Scene, Side, Surface,
    Texture, Wrap,
};
use isolux_core::solution::SurfaceMesh;
use isolux_core::units::Rgb;
use isolux_core::{DVec2, DVec3};
use isolux_formats::read::{ReadOptions, read};
use isolux_formats::write::{
    GlbOptions, MIDDLE_GREY, Picture, PngOptions, Provenance, Recall, ToneMap, Unit, WriteError, auto_exposure, exr,
    glb, lightmap_exr, lightmap_png, luminance, ply, png, srgb_encode, srgb8, vtu, write_aside, write_aside_with,
};
use std::f64::consts::PI;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Exposure of all files here: a power of two, so that products with it are exact.
const EXPOSURE: f64 = 1.0 / 64.0;

/// Half a step of a normalised 16-bit number.
const HALF_STEP: f64 = 0.5 / 65535.0;

/// Indices of the scene's materials.
const PAINT: u32 = 0;
const WOOD: u32 = 1;
const LAMP: u32 = 2;
const PAPER: u32 = 3;
const LEAF: u32 = 4;
const GLASS: u32 = 5;
const LACE: u32 = 6;
const SCREEN: u32 = 7;

/// A small PNG of one colour type, four rows high.
fn small_png(colour: png::ColorType, width: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, 4);
    encoder.set_color(colour);
    let samples = colour.samples();
    let data: Vec<u8> = (0..4 * width as usize * samples).map(|k| (k * 37 % 256) as u8).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

fn material(name: &str, rho: f64, emission: Rgb) -> Material {
    let surface = Surface { reflectance: Rgb::splat(rho), emission, opacity: 1.0 };
    Material { name: name.to_owned(), surface, two_sided: false, alpha: Alpha::Opaque, texture: None }
}

/// A square of side 2 in a plane z = `z` (facing +z), with texture coordinates where its material has a texture.
fn square(z: f64, object: u32, material: u32, materials: &[Material]) -> Polygon {
    let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(|(x, y)| DVec3::new(x, y, z));
    let of = &materials[material as usize];
    Polygon {
        corners: Corners::quad(corners[0], corners[1], corners[2], corners[3]),
        plane: Plane { normal: DVec3::Z, offset: z },
        area: 4.0,
        reflectance: of.surface.reflectance * of.surface.opacity,
        emission: of.surface.emission,
        opacity: of.surface.opacity,
        mask: None,
        object,
        material,
        side: Side::Front,
        twin: None,
        faces: [0, 0],
        uv: of.texture.as_ref().map(|_| corners.map(|corner| DVec2::new(1.5 * corner.x, 1.0 - corner.y))),
    }
}

/// Every kind of surface once; object k at z = k.
fn scene() -> Scene {
    let texture = |image, wrap| Some(Texture { image, factor: Rgb([0.5, 0.75, 1.0]), wrap });
    let mut materials = vec![
        material("paint", 0.5, Rgb::ZERO),
        material("wood", 0.25, Rgb::ZERO),
        material("lamp", 0.125, Rgb([300.0, 200.0, 100.0])),
        material("paper", 0.5, Rgb::ZERO),
        material("leaf", 0.25, Rgb::ZERO),
        material("glass", 0.25, Rgb::ZERO),
        material("lace", 0.5, Rgb::ZERO),
        material("screen", 0.125, Rgb([8.0, 4.0, 2.0])),
    ];
    materials[WOOD as usize].texture = texture(0, [Wrap::Mirror, Wrap::Clamp]);
    materials[PAPER as usize].two_sided = true;
    materials[LEAF as usize].texture = texture(1, [Wrap::Repeat; 2]);
    materials[LEAF as usize].alpha = Alpha::Mask(0);
    materials[GLASS as usize].alpha = Alpha::Attenuate;
    materials[GLASS as usize].surface.opacity = 0.25;
    materials[LACE as usize].alpha = Alpha::Attenuate;
    materials[LACE as usize].surface.opacity = 0.5;
    materials[LACE as usize].texture = texture(1, [Wrap::Repeat; 2]);
    materials[SCREEN as usize].texture = texture(0, [Wrap::Mirror, Wrap::Clamp]);

    let names = ["wall", "floor", "lamp", "sheet", "leaf", "pane", "lace", "telly", "nothing"];
    let kinds = [PAINT, WOOD, LAMP, PAPER, LEAF, GLASS, LACE, SCREEN, PAINT];
    let mut polygons: Vec<Polygon> =
        (0..).zip(kinds).map(|(k, kind)| square(f64::from(k), k, kind, &materials)).collect();
    // The floor has a painted rim: a second material in one object.
    polygons.push(square(20.0, 1, PAINT, &materials));
    // And a piece of wood that lost its texture coordinates.
    polygons.push(Polygon { uv: None, ..square(21.0, 1, WOOD, &materials) });
    let fronts = polygons.len();
    let mut triangles = Vec::new();
    let mut face_polygon = Vec::new();
    for (index, polygon) in (0..).zip(&mut polygons) {
        let c = polygon.corners;
        polygon.faces = [2 * index, 2 * index + 1];
        triangles.extend([[c[0], c[1], c[2]], [c[0], c[2], c[3]]]);
        face_polygon.extend([index, index]);
    }
    let sheet = polygons[3].clone();
    polygons[3].twin = Some(fronts as u32);
    polygons.push(Polygon {
        corners: sheet.corners.reversed(),
        plane: sheet.plane.reversed(),
        side: Side::Back,
        twin: Some(3),
        ..sheet
    });
    let camera = |name: &str, projection| Camera {
        name: name.to_owned(),
        eye: DVec3::new(1.0, 2.0, 30.0),
        forward: DVec3::new(0.0, 0.0, -1.0),
        up: DVec3::Y,
        projection,
    };
    Scene {
        front_area: Scene::area_of(&polygons[..fronts]),
        polygons,
        fronts,
        joined: 0,
        objects: names.map(|name| Object { name: name.to_owned() }).to_vec(),
        materials,
        images: vec![
            Image { name: "grain".into(), mime: "image/png".into(), bytes: small_png(png::ColorType::Rgb, 4) },
            Image { name: "veins".into(), mime: "image/png".into(), bytes: small_png(png::ColorType::Rgba, 6) },
        ],
        masks: vec![AlphaMask { width: 1, height: 1, solid: vec![true], cutoff: 0.25, wrap: [Wrap::Repeat; 2] }],
        cameras: vec![
            camera("eye", Projection::Perspective { vertical_angle: 1.0 }),
            camera("plan", Projection::Orthographic { height: 4.0 }),
        ],
        lamps: Vec::new(),
        sky: None,
        triangles,
        face_polygon,
        issues: Vec::new(),
        unit: Unit::default(),
        diameter: 24.0,
        hash: std::array::from_fn(|k| k as u8),
        name: "Büro".into(),
    }
}

/// Irradiance at a point: differs by band, place and side.
fn irradiance(point: DVec3, side: Side) -> Rgb {
    let side = if side == Side::Front { 1.0 } else { 0.25 };
    Rgb([8.0 + point.x, 16.0 + point.y, 4.0 + 0.5 * point.z]) * side
}

/// Each polygon as 3 x 3 vertices and 8 triangles; none for the object "nothing".
fn mesh(scene: &Scene) -> SurfaceMesh {
    let mut mesh = SurfaceMesh { vertex_start: vec![0], triangle_start: vec![0], ..SurfaceMesh::default() };
    for polygon in &scene.polygons {
        if polygon.object != 8 {
            let c = polygon.corners;
            let first = mesh.positions.len() as u32;
            for row in 0..3 {
                for column in 0..3 {
                    let (s, t) = (0.5 * f64::from(column), 0.5 * f64::from(row));
                    let point = c[0] + (c[1] - c[0]) * s + (c[3] - c[0]) * t;
                    let arriving = irradiance(point, polygon.side);
                    mesh.positions.push(point);
                    mesh.irradiance.push(arriving);
                    mesh.radiosity.push(polygon.emission + polygon.reflectance * arriving);
                }
            }
            for corner in [0, 1, 3, 4] {
                let [a, b, c, d] = [0, 1, 4, 3].map(|step| first + corner + step);
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        mesh.vertex_start.push(mesh.positions.len() as u32);
        mesh.triangle_start.push(mesh.triangles.len() as u32);
    }
    mesh
}

fn provenance(scene: &Scene) -> Provenance {
    Provenance {
        settings: r#"{"error":0.05,"name":"Büro"}"#.into(),
        seed: 7,
        schedule: "wavefront".into(),
        machine: "threads: 2".into(),
        ..Provenance::of(scene)
    }
}

fn options(scene: &Scene) -> GlbOptions {
    GlbOptions { exposure: Some(EXPOSURE), provenance: provenance(scene) }
}

/// A folder of this test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Keeps a file for validators and for looking at it.
fn keep(name: &str, bytes: &[u8]) {
    write_aside(Path::new(env!("CARGO_TARGET_TMPDIR")).join(name), bytes).unwrap();
}

// ---------------------------------------------------------------------------------------------------------------- GLB

/// A GLB read back: the document, the buffer, and the JSON text as it stands.
struct Read {
    document: gltf::Document,
    blob: Vec<u8>,
    json: serde_json::Value,
}

impl Read {
    fn of(bytes: &[u8]) -> Read {
        let gltf = gltf::Gltf::from_slice(bytes).unwrap();
        let json = serde_json::from_slice(&gltf::binary::Glb::from_slice(bytes).unwrap().json).unwrap();
        Read { document: gltf.document, blob: gltf.blob.unwrap(), json }
    }

    fn primitives(&self, object: &str) -> Vec<gltf::Primitive<'_>> {
        let node = self.document.nodes().find(|node| node.name() == Some(object)).unwrap();
        assert_eq!(node.mesh().unwrap().name(), Some(object));
        node.mesh().unwrap().primitives().collect()
    }

    fn vectors(&self, primitive: &gltf::Primitive<'_>, semantic: &Semantic) -> Vec<[f32; 3]> {
        let accessor = primitive.get(semantic).unwrap();
        gltf::accessor::Iter::new(accessor, |_| Some(&self.blob[..])).unwrap().collect()
    }

    fn colours(&self, primitive: &gltf::Primitive<'_>) -> Vec<[f32; 4]> {
        primitive.reader(|_| Some(&self.blob[..])).read_colors(0).unwrap().into_rgba_f32().collect()
    }
}

/// The only primitive of an object, and its polygon.
fn single<'a>(read: &'a Read, scene: &'a Scene, object: &str) -> (gltf::Primitive<'a>, u32) {
    let index = scene.objects.iter().position(|known| known.name == object).unwrap() as u32;
    let mut primitives = read.primitives(object);
    assert_eq!(primitives.len(), 1);
    (primitives.remove(0), (0..).zip(&scene.polygons).find(|(_, polygon)| polygon.object == index).unwrap().0)
}

fn assert_colours(read: &Read, primitive: &gltf::Primitive<'_>, expected: impl Iterator<Item = (Rgb, f64)>) {
    let colours = read.colours(primitive);
    let expected: Vec<_> = expected.collect();
    assert_eq!(colours.len(), expected.len());
    for (found, (colour, alpha)) in colours.iter().zip(expected) {
        for (band, value) in found.iter().zip([colour[0], colour[1], colour[2], alpha]) {
            // Half a step, and the rounding of the reader's f32 (2^-24).
            assert!((f64::from(*band) - value.min(1.0)).abs() <= HALF_STEP + 6e-8, "{found:?} against {colour:?}");
        }
    }
}

/// Catches: irradiance where radiosity belongs and the other way round, a lost pi, a lost exposure, sRGB where linear
/// belongs, opacity counted twice or never, vertices of one polygon with another's values.
#[test]
fn glb_shows_exposed_radiance() {
    let scene = scene();
    let mesh = mesh(&scene);
    let bytes = glb(&scene, &mesh, &options(&scene)).unwrap();
    keep("lit.glb", &bytes);
    let read = Read::of(&bytes);
    for (object, of_irradiance, opacity, alpha) in [
        ("wall", false, 1.0, 1.0),
        ("floor", true, 1.0, 1.0),
        ("lamp", false, 1.0, 1.0),
        ("leaf", true, 1.0, 1.0),
        // Untextured and attenuating: blending multiplies by the alpha, which undoes the division.
        ("pane", false, 0.25, 0.25),
        // The texture has an alpha channel of its own.
        ("lace", true, 1.0, 1.0),
        ("telly", false, 1.0, 1.0),
    ] {
        let primitives = read.primitives(object);
        let index = scene.objects.iter().position(|known| known.name == object).unwrap() as u32;
        let primitive = primitives.iter().find(|p| p.get(&Semantic::TexCoords(0)).is_some() == of_irradiance).unwrap();
        let expected = mesh.vertices_of(index).map(|vertex| {
            let light = if of_irradiance { mesh.irradiance[vertex] } else { mesh.radiosity[vertex] };
            (light * (EXPOSURE / (PI * opacity)), alpha)
        });
        assert_colours(&read, primitive, expected);
    }
    // All of the lamp's red clips (300 / 64 / pi = 1.49), nothing else does.
    let extras = &read.json["asset"]["extras"];
    assert_eq!(extras["clampedVertices"], 9);
    assert_eq!(extras["vertices"], mesh.positions.len());
}

/// Catches: a texture factor lost or applied twice. What a viewer shows of an average texel must be the exposed
/// radiance: factor x mean texel x COLOR_0 = exposure x B / pi, where B = rho H with rho = factor x mean texel.
#[test]
fn glb_texture_times_colour_is_radiance() {
    let mut scene = scene();
    let texture = scene.materials[WOOD as usize].texture.as_ref().unwrap();
    let texel = 0.4;
    let rho = texture.factor * texel;
    scene.polygons[1].reflectance = rho;
    let mesh = mesh(&scene);
    let read = Read::of(&glb(&scene, &mesh, &options(&scene)).unwrap());
    let primitives = read.primitives("floor");
    let primitive = primitives.iter().find(|p| p.get(&Semantic::TexCoords(0)).is_some()).unwrap();
    let factor = primitive.material().pbr_metallic_roughness().base_color_factor();
    for (colour, vertex) in read.colours(primitive).iter().zip(mesh.vertices_of(1)) {
        for band in 0..3 {
            let shown = f64::from(factor[band]) * texel * f64::from(colour[band]);
            let radiance = EXPOSURE * mesh.radiosity[vertex][band] / PI;
            assert!((shown - radiance).abs() <= HALF_STEP + 6e-8, "{shown} against {radiance}");
        }
    }
}

/// Catches: positions, normals, raw values or texture coordinates lost, permuted, scaled or cut; indices that are not
/// shifted to their primitive; wrong bounds.
#[test]
fn glb_keeps_geometry_and_raw_values() {
    let scene = scene();
    let mesh = mesh(&scene);
    let read = Read::of(&glb(&scene, &mesh, &options(&scene)).unwrap());
    for object in ["wall", "lamp", "leaf", "pane", "lace", "telly"] {
        let (primitive, polygon) = single(&read, &scene, object);
        let range = mesh.vertices_of(polygon);
        let f32s = |values: &[Rgb]| values.iter().map(|value| value.0.map(|band| band as f32)).collect::<Vec<_>>();
        let positions: Vec<_> =
            mesh.positions[range.clone()].iter().map(|position| position.to_array().map(|x| x as f32)).collect();
        assert_eq!(read.vectors(&primitive, &Semantic::Positions), positions);
        assert_eq!(read.vectors(&primitive, &Semantic::Normals), vec![[0.0, 0.0, 1.0]; 9]);
        let raw = |name: &str| read.vectors(&primitive, &Semantic::Extras(name.into()));
        assert_eq!(raw("IRRADIANCE"), f32s(&mesh.irradiance[range.clone()]));
        assert_eq!(raw("RADIOSITY"), f32s(&mesh.radiosity[range.clone()]));
        let z = f32::from(u16::try_from(polygon).unwrap());
        assert_eq!(primitive.bounding_box().min, [0.0, 0.0, z]);
        assert_eq!(primitive.bounding_box().max, [2.0, 2.0, z]);
        let reader = primitive.reader(|_| Some(&read.blob[..]));
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        let expected: Vec<u32> =
            mesh.triangles[mesh.triangles_of(polygon)].iter().flatten().map(|v| v - range.start as u32).collect();
        assert_eq!(indices, expected);
        if let Some(uv) = reader.read_tex_coords(0) {
            let expected: Vec<[f32; 2]> = positions.iter().map(|p| [1.5 * p[0], 1.0 - p[1]]).collect();
            for (found, expected) in uv.into_f32().zip(expected) {
                // The affine map solves a 2 x 2 system: a few roundings of numbers up to 3.
                assert!((0..2).all(|k| (found[k] - expected[k]).abs() <= 4.0 * f32::EPSILON), "{found:?} {expected:?}");
            }
        }
    }
}

/// Catches: a back that is missing or drawn with its front's vertices, wound like its front, or lit like it; `doubleSided`, which would show the front's
/// light on the back.
#[test]
fn glb_writes_backs_as_triangles() {
    let scene = scene();
    let mesh = mesh(&scene);
    let read = Read::of(&glb(&scene, &mesh, &options(&scene)).unwrap());
    let primitives = read.primitives("sheet");
    assert_eq!(primitives.len(), 1);
    let positions = read.vectors(&primitives[0], &Semantic::Positions);
    let normals = read.vectors(&primitives[0], &Semantic::Normals);
    let indices: Vec<u32> = primitives[0].reader(|_| Some(&read.blob[..])).read_indices().unwrap().into_u32().collect();
    assert_eq!((positions.len(), indices.len()), (18, 48));
    for triangle in indices.chunks(3) {
        let [a, b, c] = [0, 1, 2].map(|k| DVec3::from_array(positions[triangle[k] as usize].map(f64::from)));
        let normal = normals[triangle[0] as usize];
        assert_eq!((b - a).cross(c - a).normalize().to_array().map(|x| x as f32), normal);
    }
    let backs = indices.chunks(3).filter(|triangle| normals[triangle[0] as usize][2] == -1.0).count();
    assert_eq!(backs, 8);
    let irradiance = read.vectors(&primitives[0], &Semantic::Extras("IRRADIANCE".into()));
    for vertex in 0..18 {
        let side = if normals[vertex][2] > 0.0 { Side::Front } else { Side::Back };
        let point = DVec3::from_array(positions[vertex].map(f64::from));
        assert_eq!(irradiance[vertex].map(f64::from), self::irradiance(point, side).0);
    }
    assert!(read.document.materials().all(|material| !material.double_sided()));
}

/// Catches: an object split over nodes or merged with another, a primitive per polygon, objects without triangles
/// written, a texture on polygons that have no coordinates, wrong alpha modes, images re-encoded, lost wraps.
#[test]
fn glb_has_a_node_per_object_and_a_primitive_per_material() {
    let scene = scene();
    let mesh = mesh(&scene);
    let read = Read::of(&glb(&scene, &mesh, &options(&scene)).unwrap());
    let names: Vec<_> = read.document.nodes().map(|node| node.name().unwrap().to_owned()).collect();
    assert_eq!(names, ["wall", "floor", "lamp", "sheet", "leaf", "pane", "lace", "telly", "eye", "plan"]);
    // Paint, wood, and wood without coordinates.
    assert_eq!(read.primitives("floor").len(), 3);
    let mut looks = Vec::new();
    for object in &names[..8] {
        for primitive in read.primitives(object) {
            let material = primitive.material();
            let pbr = material.pbr_metallic_roughness();
            let textured = pbr.base_color_texture().is_some();
            assert_eq!(textured, primitive.get(&Semantic::TexCoords(0)).is_some());
            let factor = if textured { [0.5, 0.75, 1.0, 1.0] } else { [1.0; 4] };
            assert_eq!(pbr.base_color_factor(), factor);
            looks.push(format!("{object} {} {textured} {:?}", material.name().unwrap(), material.alpha_mode()));
        }
    }
    let expected = [
        "wall paint false Opaque",
        "floor paint false Opaque",
        "floor wood false Opaque",
        "floor wood true Opaque",
        "lamp lamp false Opaque",
        "sheet paper false Opaque",
        "leaf leaf true Mask",
        "pane glass false Blend",
        "lace lace true Blend",
        "telly screen false Opaque",
    ];
    assert_eq!(looks, expected);
    for material in read.json["materials"].as_array().unwrap() {
        assert!(material["extensions"]["KHR_materials_unlit"].is_object(), "{material}");
    }
    assert_eq!(read.json["extensionsUsed"], serde_json::json!(["KHR_materials_unlit"]));
    // One image each, however many materials use it.
    assert_eq!(read.document.images().count(), 2);
    for (image, original) in read.document.images().zip([&scene.images[0], &scene.images[1]]) {
        let gltf::image::Source::View { view, mime_type } = image.source() else { panic!("not embedded") };
        assert_eq!(mime_type, "image/png");
        assert_eq!(&read.blob[view.offset()..view.offset() + view.length()], original.bytes);
    }
    let wraps: Vec<_> = read.document.textures().map(|t| (t.sampler().wrap_s(), t.sampler().wrap_t())).collect();
    use gltf::texture::WrappingMode::{ClampToEdge, MirroredRepeat, Repeat};
    assert_eq!(wraps, [(MirroredRepeat, ClampToEdge), (Repeat, Repeat)]);
}

/// Catches: extras that miss what a result must say of its origin, a hash in another notation, settings that are not
/// the text given, cameras that look elsewhere.
#[test]
fn glb_says_where_it_comes_from() {
    let scene = scene();
    let read = Read::of(&glb(&scene, &mesh(&scene), &options(&scene)).unwrap());
    let asset = &read.json["asset"];
    assert_eq!(asset["generator"], concat!("isolux ", env!("CARGO_PKG_VERSION")));
    for extras in [&asset["extras"], &read.json["scenes"][0]["extras"]] {
        assert_eq!(extras["exposure"], EXPOSURE);
        assert_eq!(extras["unit"], "lm/m2");
        assert_eq!(extras["sceneHash"], "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f");
        assert_eq!(extras["settings"], r#"{"error":0.05,"name":"Büro"}"#);
        assert_eq!(extras["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(extras["seed"], 7);
        assert_eq!(extras["schedule"], "wavefront");
        assert_eq!(extras["machine"], "threads: 2");
        assert_eq!(extras["scene"], "Büro");
    }
    let cameras: Vec<_> = read.document.nodes().filter(|node| node.camera().is_some()).collect();
    for camera in &cameras {
        // Looking along -z with +y up is the format's own rest position.
        let [x, y, z, w] = camera.transform().matrix();
        assert_eq!([x, y, z], [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
        assert_eq!(w, [1.0, 2.0, 30.0, 1.0]);
    }
    match cameras[0].camera().unwrap().projection() {
        gltf::camera::Projection::Perspective(camera) => assert_eq!(camera.yfov(), 1.0),
        gltf::camera::Projection::Orthographic(_) => panic!("'eye' is a perspective camera"),
    }
    match cameras[1].camera().unwrap().projection() {
        gltf::camera::Projection::Orthographic(camera) => assert_eq!(camera.ymag(), 2.0),
        gltf::camera::Projection::Perspective(_) => panic!("'plan' is an orthographic camera"),
    }
}

/// Catches: a camera's axes permuted or mirrored.
#[test]
fn glb_turns_cameras() {
    let mut scene = scene();
    scene.cameras.truncate(1);
    scene.cameras[0].forward = DVec3::X;
    scene.cameras[0].up = DVec3::Z;
    let bytes = glb(&scene, &mesh(&scene), &options(&scene)).unwrap();
    keep("turned.glb", &bytes);
    let read = Read::of(&bytes);
    let node = read.document.nodes().find(|node| node.camera().is_some()).unwrap();
    let [right, up, back, _] = node.transform().matrix();
    // Looking along +x with +z up, the right hand points along x cross z = -y.
    assert_eq!(
        [right[..3].to_vec(), up[..3].to_vec(), back[..3].to_vec()],
        [[0., -1., 0.], [0., 0., 1.], [-1., 0., 0.]]
    );
}

/// Catches: an emitter with a cut-out mask that loses its mask, and irradiance in its colours.
#[test]
fn glb_keeps_the_mask_of_emitters() {
    let mut scene = scene();
    scene.polygons[4].emission = Rgb([8.0, 4.0, 2.0]);
    let mesh = mesh(&scene);
    let bytes = glb(&scene, &mesh, &options(&scene)).unwrap();
    keep("masked.glb", &bytes);
    let read = Read::of(&bytes);
    let (primitive, polygon) = single(&read, &scene, "leaf");
    assert!(primitive.material().pbr_metallic_roughness().base_color_texture().is_some());
    assert_colours(
        &read,
        &primitive,
        mesh.vertices_of(polygon).map(|vertex| (mesh.radiosity[vertex] * (EXPOSURE / PI), 1.0)),
    );
}

/// Catches: a cutoff that viewers would cut elsewhere than the light was computed with (glTF's 0.5 where the scene has
/// another), on one that has no mask, or lost on the way back in.
#[test]
fn glb_keeps_the_cutoff_of_masks() {
    for cutoff in [0.0, 0.25, 0.5, 0.9] {
        let mut scene = scene();
        scene.masks[0].cutoff = cutoff;
        let bytes = glb(&scene, &mesh(&scene), &options(&scene)).unwrap();
        let written = Read::of(&bytes);
        for material in written.document.materials() {
            let expected = (material.name() == Some("leaf")).then_some(cutoff as f32);
            assert_eq!(material.alpha_cutoff(), expected, "{:?}", material.name());
        }
        let name = format!("cutoff-{cutoff}.glb");
        keep(&name, &bytes);
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let back = read(&path, &ReadOptions::default()).unwrap();
        let leaf = back.materials.iter().find(|material| material.name == "leaf").unwrap();
        let Alpha::Mask(mask) = leaf.alpha else { panic!("the leaf has lost its mask") };
        let mask = &back.masks[mask as usize];
        assert_eq!(mask.cutoff, f64::from(cutoff as f32));
        let picture = image::load_from_memory(&scene.images[1].bytes).unwrap().to_rgba8();
        let solid: Vec<bool> = picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0 >= mask.cutoff).collect();
        assert_eq!(mask.solid, solid, "{cutoff}");
    }
}

/// Catches: alpha from the opacity on top of the texture's own, or none at all where the texture has none.
#[test]
fn glb_blends_textures_without_alpha_by_opacity() {
    let mut scene = scene();
    scene.materials[LACE as usize].texture.as_mut().unwrap().image = 0;
    let mesh = mesh(&scene);
    let read = Read::of(&glb(&scene, &mesh, &options(&scene)).unwrap());
    let (primitive, polygon) = single(&read, &scene, "lace");
    let expected = mesh.vertices_of(polygon).map(|vertex| (mesh.irradiance[vertex] * (EXPOSURE / PI), 0.5));
    assert_colours(&read, &primitive, expected);
}

/// Catches: an order that depends on a hash map's seed, a time stamp.
#[test]
fn files_are_the_same_every_time() {
    let scene = scene();
    let mesh = mesh(&scene);
    let origin = provenance(&scene);
    let picture = gradient();
    for write in [
        &(|| glb(&scene, &mesh, &options(&scene))) as &dyn Fn() -> Result<Vec<u8>, WriteError>,
        &|| ply(&scene, &mesh, EXPOSURE, &origin),
        &|| vtu(&scene, &mesh, EXPOSURE, &origin),
        &|| exr(&picture, &origin),
    ] {
        let first = write().unwrap();
        for _ in 0..8 {
            assert!(write().unwrap() == first);
        }
    }
}

/// Catches: a mesh that is empty, foreign or holds NaN turned into a file; errors that do not name the object.
#[test]
fn what_cannot_be_written_is_an_error_that_names_it() {
    let scene = scene();
    let origin = provenance(&scene);
    let all = |scene: &Scene, mesh: &SurfaceMesh| {
        let results = [
            glb(scene, mesh, &options(scene)),
            ply(scene, mesh, EXPOSURE, &origin),
            vtu(scene, mesh, EXPOSURE, &origin),
        ];
        let messages = results.map(|result| result.unwrap_err().to_string());
        assert!(messages[0] == messages[1] && messages[1] == messages[2], "{messages:?}");
        messages[0].clone()
    };
    assert_eq!(all(&scene, &SurfaceMesh::default()), "scene 'Büro' has no triangles to write");
    let mut broken = mesh(&scene);
    broken.irradiance[0].0[1] = f64::NAN;
    assert_eq!(all(&scene, &broken), "irradiance of 'wall' is NaN, which the file cannot hold");
    let mut broken = mesh(&scene);
    broken.radiosity[20].0[1] = 1e39;
    assert!(all(&scene, &broken).starts_with("radiosity of 'lamp' is 1000000"), "{}", all(&scene, &broken));
    let mut broken = mesh(&scene);
    broken.positions[10].x = f64::INFINITY;
    assert_eq!(all(&scene, &broken), "vertex position of 'floor' is inf, which the file cannot hold");
    let mut broken = mesh(&scene);
    broken.triangles[8][0] = 0;
    assert!(all(&scene, &broken).contains("vertex (not one of its polygon) 0 of 'floor'"));
    let mut broken = mesh(&scene);
    broken.irradiance.pop();
    assert!(all(&scene, &broken).contains("the number of irradiance values is 98, expected 99"));
    let mut broken = mesh(&scene);
    broken.vertex_start.pop();
    assert!(all(&scene, &broken).contains("the number of vertex ranges is 12, expected 13"));
    let mut broken = mesh(&scene);
    broken.triangle_start[3] = 999;
    assert!(all(&scene, &broken).contains("the end of a range before its start"));
    let mut foreign = scene.clone();
    foreign.polygons[2].material = 99;
    assert!(all(&foreign, &mesh(&scene)).contains("material 99 of 'lamp' is out of range (there are 8)"));
    for exposure in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let options = GlbOptions { exposure: Some(exposure), ..options(&scene) };
        assert!(matches!(glb(&scene, &mesh(&scene), &options), Err(WriteError::Exposure { .. })));
    }
    let mut webp = scene.clone();
    webp.images[0].bytes = b"RIFF....WEBP".to_vec();
    let error = glb(&webp, &mesh(&scene), &options(&scene)).unwrap_err();
    assert_eq!(error.to_string(), "image 'grain' (image/png) is neither PNG nor JPEG by its first bytes");
    let mut blind = scene.clone();
    blind.cameras[0].up = blind.cameras[0].forward;
    assert!(glb(&blind, &mesh(&scene), &options(&scene)).unwrap_err().to_string().contains("'eye'"));
}

// --------------------------------------------------------------------------------------------------- exposure and tone

/// Two squares without emission and a lamp, with one radiosity each.
fn three(dark: f64, bright: f64, lamp: f64, size: f64) -> (Scene, SurfaceMesh) {
    let mut scene = scene();
    scene.polygons.truncate(3);
    scene.polygons.swap(1, 2);
    let mut mesh = mesh(&scene);
    // Order: wall, lamp, floor.
    for (polygon, value) in [(0, dark), (1, lamp), (2, bright)] {
        for vertex in mesh.vertices_of(polygon) {
            mesh.radiosity[vertex] = Rgb::splat(value * PI);
            mesh.positions[vertex] *= size;
        }
    }
    (scene, mesh)
}

fn exposure(dark: f64, bright: f64, lamp: f64, size: f64) -> f64 {
    let (scene, mesh) = three(dark, bright, lamp, size);
    auto_exposure(&mesh, &scene)
}

/// Catches: an arithmetic instead of a logarithmic mean, a lost pi, emitters counted, dependence on units or size, unlit
/// surfaces that drag the mean to zero, clipped surfaces.
#[test]
fn exposure_follows_its_rule() {
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} against {b}: rounding of ln and exp only");
    close(exposure(5.0, 5.0, 1e4, 1.0), MIDDLE_GREY / 5.0);
    // Logarithmic mean of 2 and 8 is 4; 8 stays below white: 0.18 / 4 < 1 / 8.
    close(exposure(2.0, 8.0, 1e4, 1.0), MIDDLE_GREY / 4.0);
    // Logarithmic mean of 1 and 100 is 10; half the area must not clip.
    close(exposure(1.0, 100.0, 1e4, 1.0), 1.0 / 100.0);
    // Scale-free in light and in length.
    close(exposure(2e-9, 8e-9, 1.0, 1.0), MIDDLE_GREY / 4e-9);
    close(exposure(2.0, 8.0, 1e4, 1e3), MIDDLE_GREY / 4.0);
    // Nothing on one wall: the other counts.
    close(exposure(0.0, 8.0, 1e4, 1.0), MIDDLE_GREY / 8.0);
    close(exposure(1e-12, 8.0, 1e4, 1.0), MIDDLE_GREY / 8.0);
    // Only the lamp shines; nothing shines.
    close(exposure(0.0, 0.0, 50.0, 1.0), MIDDLE_GREY / 50.0);
    close(exposure(0.0, 0.0, 0.0, 1.0), 1.0);
    close(exposure(f64::NAN, 8.0, 1e4, 1.0), MIDDLE_GREY / 8.0);
    let (scene, _) = three(1.0, 1.0, 1.0, 1.0);
    close(auto_exposure(&SurfaceMesh::default(), &scene), 1.0);
}

/// Catches: an exposure in the file that is not the one its colours were made with.
#[test]
fn glb_records_the_exposure_it_chose() {
    let (scene, mesh) = three(2.0, 8.0, 1e4, 1.0);
    let read = Read::of(&glb(&scene, &mesh, &GlbOptions { exposure: None, ..options(&scene) }).unwrap());
    assert_eq!(read.json["asset"]["extras"]["exposure"].as_f64(), Some(auto_exposure(&mesh, &scene)));
    let (primitive, polygon) = single(&read, &scene, "wall");
    let colour = Rgb::splat(2.0 * MIDDLE_GREY / 4.0);
    assert_colours(&read, &primitive, mesh.vertices_of(polygon).map(|_| (colour, 1.0)));
}

/// Catches: another curve than the cited one, hue shifts, values outside [0, 1], NaN that passes.
#[test]
fn tone_map_is_the_published_curve() {
    let tone = ToneMap::Reinhard { white: 4.0 };
    for (l, shown) in
        [(0.0, 0.0), (1.0, (1.0 + 1.0 / 16.0) / 2.0), (0.18, 0.18 * (1.0 + 0.18 / 16.0) / 1.18), (4.0, 1.0)]
    {
        let found = tone.apply(Rgb::splat(l));
        // Luminance weights sum to 1 up to rounding.
        assert!((found[0] - shown).abs() < 1e-15 && found[0] == found[2], "{l}: {found:?} against {shown}");
    }
    let mut before = -1.0;
    for step in 0..1000 {
        let value = tone.apply(Rgb::splat(0.01 * f64::from(step)))[1];
        assert!(value >= before && value <= 1.0);
        before = value;
    }
    let colour = Rgb([0.2, 0.4, 0.1]);
    let mapped = tone.apply(colour);
    assert!((mapped[1] / mapped[0] - 2.0).abs() < 1e-14 && (mapped[0] / mapped[2] - 2.0).abs() < 1e-14);
    assert_eq!(ToneMap::Clip.apply(Rgb([-1.0, 0.25, 2.0])), Rgb([0.0, 0.25, 1.0]));
    for tone in [tone, ToneMap::Clip] {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(tone.apply(Rgb([bad, 0.5, 0.5])).0.iter().all(|band| (0.0..=1.0).contains(band)));
        }
    }
    assert!((luminance(Rgb::ONE) - 1.0).abs() < 1e-15);
}

/// Catches: a gamma of 2.2 instead of the standard's two pieces, truncation instead of rounding.
#[test]
fn srgb_is_the_standard() {
    // Each code decoded by the inverse function of IEC 61966-2-1 must encode to itself.
    for code in 0..=255_u8 {
        let encoded = f64::from(code) / 255.0;
        let linear = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
        assert_eq!(srgb8(linear), code);
        // 4e-8: what the standard's rounded constants leave between its two pieces at 0.04045.
        assert!((srgb_encode(linear) - encoded).abs() < 4e-8);
    }
    // 0.5 encodes to 187.52, 0.001 to 3.29.
    assert_eq!([srgb8(0.5), srgb8(0.001), srgb8(-1.0), srgb8(9.0), srgb8(f64::NAN)], [188, 3, 0, 255, 0]);
}

// ------------------------------------------------------------------------------------------------------------ pictures

/// 5 x 3 pixels, each different, some above white, some negative.
fn gradient() -> Picture {
    let pixels = (0..15).map(|k| Rgb([f64::from(k) / 7.0, 100.0 / f64::from(k + 1), f64::from(k) - 2.0])).collect();
    Picture { width: 5, height: 3, pixels }
}

/// Catches: rows and columns swapped, rows bottom up, bands permuted, exposure or curve skipped, text lost or cut.
#[test]
fn png_decodes_to_exposed_mapped_encoded_bytes() {
    let picture = gradient();
    let scene = scene();
    let options = PngOptions { exposure: 0.5, tone: ToneMap::default(), provenance: provenance(&scene) };
    let bytes = png(&picture, &options).unwrap();
    keep("picture.png", &bytes);
    let decoded = image::load_from_memory(&bytes).unwrap().into_rgb8();
    assert_eq!(decoded.dimensions(), (5, 3));
    for (x, y, pixel) in decoded.enumerate_pixels() {
        let radiance = picture.pixels[(y * 5 + x) as usize];
        let expected = options.tone.apply(radiance * 0.5).0.map(srgb8);
        assert_eq!(pixel.0, expected, "at {x}, {y}");
    }
    let reader = png::Decoder::new(io::Cursor::new(&bytes)).read_info().unwrap();
    let info = reader.info();
    assert!(info.srgb.is_some());
    let text = |key: &str| {
        let chunk = info.utf8_text.iter().find(|chunk| chunk.keyword == format!("isolux:{key}")).unwrap();
        chunk.get_text().unwrap()
    };
    assert_eq!(text("settings"), options.provenance.settings);
    assert_eq!(text("exposure"), "0.5");
    assert_eq!(text("toneMap"), "reinhard2002 white=4");
    assert_eq!(text("sceneHash"), options.provenance.scene_hash);
    assert_eq!(text("radianceUnit"), "cd/m2");
    assert_eq!(info.uncompressed_latin1_text[0].text, concat!("isolux ", env!("CARGO_PKG_VERSION")));
}

/// Catches: half floats where floats were promised, exposure or curve applied to a linear file, rows flipped, bands
/// permuted, non-ASCII settings mangled, attributes lost.
#[test]
fn exr_round_trips() {
    use exr::prelude::{ReadChannels, ReadLayers};
    let picture = gradient();
    let mut origin = provenance(&scene());
    let bytes = exr(&picture, &origin).unwrap();
    keep("picture.exr", &bytes);
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| vec![vec![Rgb::ZERO; size.width()]; size.height()],
            |rows, at, (r, g, b): (f32, f32, f32)| rows[at.y()][at.x()] = Rgb([r, g, b].map(f64::from)),
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(io::Cursor::new(&bytes))
        .unwrap();
    let rows = &image.layer_data.channel_data.pixels;
    for (index, pixel) in picture.pixels.iter().enumerate() {
        assert_eq!(rows[index / 5][index % 5], pixel.map(|band| f64::from(band as f32)));
    }
    let attributes = &image.layer_data.attributes;
    assert_eq!(attributes.white_luminance, Some(1.0));
    assert_eq!(attributes.software_name.as_ref().unwrap().to_string(), origin_generator());
    let comments = attributes.comments.as_ref().unwrap().to_string();
    let comments: serde_json::Value = serde_json::from_str(&comments).unwrap();
    assert_eq!(comments["settings"], origin.settings.as_str());
    assert_eq!(comments["scene"], "Büro");
    assert_eq!(comments["sceneHash"], origin.scene_hash.as_str());
    assert!(comments.get("exposure").is_none());
    // A picture of heat has no luminance.
    origin.unit = Unit::Radiometric;
    let bytes = exr(&picture, &origin).unwrap();
    assert!(!bytes.windows(14).any(|name| name == b"whiteLuminance"));
    assert!(bytes.windows(9).any(|unit| unit == b"W/(m2 sr)"));
}

/// Catches lightmaps that readers convert (gamma, colour space), swapped bytes, a scale that is not told, cuts at the wrong
/// place, and pictures of irradiance that say they are of radiance.
#[test]
fn lightmaps_are_linear_and_say_what_they_are() {
    let picture = gradient();
    let origin = provenance(&scene());
    let bytes = lightmap_png(&picture, 4.0, &origin).unwrap();
    keep("lightmap.png", &bytes);
    let decoded = image::load_from_memory(&bytes).unwrap();
    assert_eq!(decoded.color(), image::ColorType::Rgb16);
    for (x, y, pixel) in decoded.into_rgb16().enumerate_pixels() {
        let irradiance = picture.pixels[(y * 5 + x) as usize];
        let expected = irradiance.0.map(|band| (65_535.0 * (band / 4.0).clamp(0.0, 1.0)).round() as u16);
        assert_eq!(pixel.0, expected, "at {x}, {y}");
    }
    let reader = png::Decoder::new(io::Cursor::new(&bytes)).read_info().unwrap();
    let info = reader.info();
    assert!(info.srgb.is_none() && info.source_gamma.is_none() && info.icc_profile.is_none());
    let scale = info.utf8_text.iter().find(|chunk| chunk.keyword == "isolux:scale").unwrap();
    assert_eq!(scale.get_text().unwrap(), "4");
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(lightmap_png(&picture, scale, &origin), Err(WriteError::Exposure { .. })));
    }
    let bytes = lightmap_exr(&picture, &origin).unwrap();
    assert!(bytes.windows(5).any(|unit| unit == b"lm/m2"));
    assert!(!bytes.windows(14).any(|name| name == b"whiteLuminance"));
    assert!(lightmap_exr(&Picture::default(), &origin).is_err());
}

fn origin_generator() -> String {
    format!("isolux {}", env!("CARGO_PKG_VERSION"))
}

/// Catches: NaN in a picture that is silently black, sizes that do not match turned into a skewed picture.
#[test]
fn pictures_with_holes_are_errors() {
    let scene = scene();
    let options = PngOptions { exposure: 1.0, tone: ToneMap::Clip, provenance: provenance(&scene) };
    let both = |picture: &Picture| {
        let messages = [png(picture, &options), exr(picture, &options.provenance)].map(|r| r.unwrap_err().to_string());
        assert_eq!(messages[0], messages[1]);
        messages[0].clone()
    };
    let mut holed = gradient();
    holed.pixels[8].0[2] = f64::NAN;
    assert!(both(&holed).starts_with("pixel (3, 1) is"));
    holed.pixels[8].0[2] = f64::INFINITY;
    assert!(both(&holed).starts_with("pixel (3, 1) is"));
    assert_eq!(both(&Picture { width: 4, ..gradient() }), "a picture of 4 x 3 has 15 pixels");
    assert_eq!(both(&Picture::default()), "a picture of 0 x 0 has 0 pixels");
    let dark = PngOptions { exposure: f64::NAN, ..options.clone() };
    assert!(matches!(png(&gradient(), &dark), Err(WriteError::Exposure { .. })));
    let blown = PngOptions { tone: ToneMap::Reinhard { white: 0.0 }, ..options.clone() };
    assert!(matches!(png(&gradient(), &blown), Err(WriteError::White { .. })));
}

// --------------------------------------------------------------------------------------------------------- PLY and VTU

/// Catches: header and data that disagree, wrong byte order, columns permuted, faces with another polygon's number,
/// names with line breaks or the header's last word that end the comment.
#[test]
fn ply_reads_back() {
    let mut scene = scene();
    scene.objects[0].name = "wall\nend_header".into();
    let mesh = mesh(&scene);
    let origin = provenance(&scene);
    let bytes = ply(&scene, &mesh, EXPOSURE, &origin).unwrap();
    keep("lit.ply", &bytes);
    let end = bytes.windows(12).position(|line| line == b"\nend_header\n").unwrap() + 12;
    // The first such line would be the second half of the broken name, had its break been left in.
    let header: Vec<&str> = std::str::from_utf8(&bytes[..end]).unwrap().lines().collect();
    assert_eq!(header[..2], ["ply", "format binary_little_endian 1.0"]);
    for comment in [
        "comment isolux unit lm/m2",
        "comment isolux exposure 0.015625",
        "comment isolux sceneHash 000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f",
        r#"comment isolux settings {"error":0.05,"name":"Büro"}"#,
        "comment object 0 wall end-header",
        "comment object 1 floor",
    ] {
        assert!(header.contains(&comment), "{comment}");
    }
    let properties: Vec<_> = header.iter().filter(|line| line.starts_with("property")).copied().collect();
    assert_eq!(properties.len(), 15);
    assert_eq!(properties[6], "property float irradiance_r");
    assert_eq!(properties[9], "property float radiosity_r");
    assert_eq!(
        properties[12..],
        ["property list uchar int vertex_indices", "property int polygon", "property int object"]
    );
    assert!(header.contains(&"element vertex 99") && header.contains(&"element face 88"));

    let data = &bytes[end..];
    let body = &data[99 * 48..];
    assert_eq!(body.len(), 88 * 21);
    let float = |at: usize| f64::from(f32::from_le_bytes(data[at..at + 4].try_into().unwrap()));
    for (polygon, of) in (0..).zip(&scene.polygons) {
        for vertex in mesh.vertices_of(polygon) {
            let row: [[f64; 3]; 4] =
                std::array::from_fn(|g| std::array::from_fn(|k| float(48 * vertex + 12 * g + 4 * k)));
            let single = |values: [f64; 3]| values.map(|x| f64::from(x as f32));
            assert_eq!(row[0], mesh.positions[vertex].to_array());
            assert_eq!(row[1], of.plane.normal.to_array());
            assert_eq!(row[2], single(mesh.irradiance[vertex].0));
            assert_eq!(row[3], single(mesh.radiosity[vertex].0));
        }
        for triangle in mesh.triangles_of(polygon) {
            let row = &body[21 * triangle..21 * (triangle + 1)];
            let int = |k: usize| u32::from_le_bytes(row[1 + 4 * k..5 + 4 * k].try_into().unwrap());
            assert_eq!(row[0], 3);
            assert_eq!([int(0), int(1), int(2)], mesh.triangles[triangle]);
            assert_eq!((int(3), int(4)), (polygon, of.object));
        }
    }
}

/// The bytes of an appended array of a VTU file.
fn vtu_array<'a>(file: &'a [u8], name: &str) -> (&'a str, &'a [u8]) {
    let start = file.windows(2).position(|pair| pair == b"\n_").unwrap() + 2;
    let text = std::str::from_utf8(&file[..start]).unwrap();
    let element = text.lines().find(|line| line.contains(&format!("Name=\"{name}\"") as &str)).unwrap();
    let attribute = |key: &str| element.split(&format!("{key}=\"")).nth(1).unwrap().split('"').next().unwrap();
    let offset: usize = attribute("offset").parse().unwrap();
    let header = &file[start + offset..];
    let length = u64::from_le_bytes(header[..8].try_into().unwrap()) as usize;
    (attribute("type"), &header[8..8 + length])
}

/// Catches: offsets that miss their array, lengths that disagree, wrong types, cell arrays of another polygon, the
/// second half of a joined square with the first half's face, field data that does not spell its text.
#[test]
fn vtu_reads_back() {
    let scene = scene();
    let mesh = mesh(&scene);
    let bytes = vtu(&scene, &mesh, EXPOSURE, &provenance(&scene)).unwrap();
    keep("lit.vtu", &bytes);
    let floats = |name: &str| {
        let (kind, data) = vtu_array(&bytes, name);
        assert_eq!(kind, "Float64");
        data.chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect::<Vec<_>>()
    };
    let integers = |name: &str| {
        let (kind, data) = vtu_array(&bytes, name);
        assert_eq!(kind, "Int64");
        data.chunks(8).map(|b| i64::from_le_bytes(b.try_into().unwrap())).collect::<Vec<_>>()
    };
    let flat = |values: &[Rgb]| values.iter().flat_map(|value| value.0).collect::<Vec<_>>();
    assert_eq!(floats("Points"), mesh.positions.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>());
    assert_eq!(floats("Irradiance"), flat(&mesh.irradiance));
    assert_eq!(floats("Radiosity"), flat(&mesh.radiosity));
    assert_eq!(floats("Normals").len(), 297);
    assert_eq!(integers("connectivity"), mesh.triangles.iter().flatten().map(|&v| i64::from(v)).collect::<Vec<_>>());
    assert_eq!(integers("offsets"), (1..=88).map(|k| 3 * k).collect::<Vec<i64>>());
    assert_eq!(vtu_array(&bytes, "types"), ("UInt8", &[5; 88][..]));
    let (polygons, objects) = (integers("polygon"), integers("object"));
    let (materials, faces) = (integers("material"), integers("face"));
    for (index, polygon) in (0..).zip(&scene.polygons) {
        for triangle in mesh.triangles_of(index) {
            assert_eq!(polygons[triangle], i64::from(index));
            assert_eq!(objects[triangle], i64::from(polygon.object));
            assert_eq!(materials[triangle], i64::from(polygon.material));
            let centroid = mesh.triangles[triangle].iter().map(|&v| mesh.positions[v as usize]).sum::<DVec3>() / 3.0;
            // The diagonal from corner 0 to corner 2 is y = x; face 0 is below it.
            let half = usize::from(centroid.y > centroid.x);
            assert_eq!(faces[triangle], i64::from(polygon.faces[half]), "centroid {centroid}");
        }
    }
    let text = String::from_utf8_lossy(&bytes);
    let field = |name: &str| {
        let line =
            text.lines().find(|line| line.starts_with(&format!("<Array type=\"String\" Name=\"{name}\""))).unwrap();
        let codes = line.split(['>', '<']).nth(2).unwrap();
        let bytes: Vec<u8> = codes.split(' ').map(|code| code.parse().unwrap()).collect();
        let text = String::from_utf8(bytes).unwrap();
        text.strip_suffix('\0').unwrap().split('\0').map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(field("settings"), [r#"{"error":0.05,"name":"Büro"}"#]);
    assert_eq!(field("version"), [env!("CARGO_PKG_VERSION")]);
    assert_eq!(field("sceneHash"), ["000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f"]);
    assert_eq!(field("objects").len(), 9);
    assert_eq!(field("materials")[WOOD as usize], "wood");
}

// --------------------------------------------------------------------------------------------------------- write aside

/// Names in a folder.
fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The error's text: one line that names the file.
fn complaint(path: &Path, result: Result<(), WriteError>) -> String {
    let message = result.unwrap_err().to_string();
    assert!(message.contains(path.to_str().unwrap()) && message.lines().count() == 1, "{message}");
    message
}

/// Catches: a new file not written, an old one not replaced, temporary files left behind, permissions lost.
#[test]
fn write_aside_replaces_whole_files() {
    let folder = folder("aside-good");
    let path = folder.join("lit.glb");
    write_aside(&path, b"first").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"first");
    write_aside(&path, b"2nd").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"2nd");
    assert_eq!(listing(&folder), ["lit.glb"]);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{PermissionsExt, symlink};
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        let link = folder.join("link.glb");
        symlink("lit.glb", &link).unwrap();
        write_aside(&link, b"third").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&path).unwrap(), b"third");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(listing(&folder), ["link.glb", "lit.glb"]);
    }
}

/// Catches: an old file lost or half overwritten when the disk fills up in the middle, the temporary file left behind.
#[test]
fn write_aside_keeps_the_old_file_when_the_disk_is_full() {
    let folder = folder("aside-full");
    let path = folder.join("lit.glb");
    let fill = |file: &mut dyn Write| {
        file.write_all(&[1; 4096])?;
        Err(io::ErrorKind::StorageFull.into())
    };
    // With and without a file of that name.
    assert!(complaint(&path, write_aside_with(&path, &Recall::default(), fill)).ends_with("no storage space"));
    assert_eq!(listing(&folder), [""; 0]);
    write_aside(&path, b"old").unwrap();
    complaint(&path, write_aside_with(&path, &Recall::default(), fill));
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(listing(&folder), ["lit.glb"]);
    // And when the program fails instead of the disk.
    let panicked = std::panic::catch_unwind(|| write_aside_with(&path, &Recall::default(), |_| panic!("as asked")));
    assert!(panicked.is_err());
    assert_eq!(listing(&folder), ["lit.glb"]);
}

/// Catches: a folder taken for a file, a missing folder made or blamed on nobody, a read-only file replaced.
#[test]
fn write_aside_names_what_is_in_the_way() {
    let folder = folder("aside-bad");
    let inner = folder.join("lit.glb");
    fs::create_dir(&inner).unwrap();
    assert!(complaint(&inner, write_aside(&inner, b"x")).contains("it is a folder"));
    let missing = folder.join("none").join("lit.glb");
    assert!(complaint(&missing, write_aside(&missing, b"x")).contains("create a temporary file beside it"));
    let below_file = folder.join("file").join("lit.glb");
    fs::write(folder.join("file"), b"old").unwrap();
    complaint(&below_file, write_aside(&below_file, b"x"));
    let locked = folder.join("locked.glb");
    fs::write(&locked, b"old").unwrap();
    let mut permissions = fs::metadata(&locked).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&locked, permissions).unwrap();
    assert!(complaint(&locked, write_aside(&locked, b"x")).contains("it is read-only"));
    assert_eq!(fs::read(&locked).unwrap(), b"old");
    assert_eq!(listing(&folder), ["file", "lit.glb", "locked.glb"]);
    assert!(matches!(write_aside("", b"x"), Err(WriteError::File { .. })));
}

/// Catches: an error on one line turned into several by the file's own name.
#[test]
fn write_aside_complains_in_one_line() {
    let message = write_aside(Path::new("/nonexistent/two\nlines.glb"), b"x").unwrap_err().to_string();
    assert_eq!(message.lines().count(), 1);
    assert!(message.contains(r"/nonexistent/two\nlines.glb"), "{message}");
}

/// Catches: a folder without write permission that leaves the old file damaged. Who may write everywhere (root) is
/// stopped by the process table instead, which takes no new files from anybody.
#[cfg(target_os = "linux")]
#[test]
fn write_aside_reports_a_folder_that_takes_no_files() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder("aside-locked");
    let path = folder.join("lit.glb");
    fs::write(&path, b"old").unwrap();
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o555)).unwrap();
    let permissions_count = fs::write(folder.join("probe"), b"").is_err();
    if permissions_count {
        assert!(complaint(&path, write_aside(&path, b"x")).contains("Permission denied"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
    } else {
        let path = Path::new("/proc/lit.glb");
        complaint(path, write_aside(path, b"x"));
    }
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o755)).unwrap();
}

/// Catches: a device replaced by a regular file, its failure to take bytes swallowed.
#[cfg(target_os = "linux")]
#[test]
fn write_aside_writes_to_devices_directly() {
    use std::os::unix::fs::FileTypeExt;
    let full = Path::new("/dev/full");
    assert!(complaint(full, write_aside(full, b"x")).contains("No space left"));
    write_aside("/dev/null", b"x").unwrap();
    for device in ["/dev/full", "/dev/null"] {
        assert!(fs::metadata(device).unwrap().file_type().is_char_device(), "{device}");
    }
}
