//! A scene and its lit mesh come in, a binary glTF 2.0 file goes out that any viewer shows lit without a light of its
//! own (`KHR_materials_unlit`, `COLOR_0`) and that keeps the raw numbers (`_IRRADIANCE`, `_RADIOSITY`).
//!
//! What a viewer shows is `texture * factor * COLOR_0`, all linear. With exposure `x`, radiosity `B`, irradiance `H`:
//!
//! | surface | material | `COLOR_0` |
//! |---|---|---|
//! | untextured | white base | `x B / pi` |
//! | textured | base-colour texture and factor | `x H / pi` |
//! | emitting | white base, texture left out | `x B / pi`, emission included |
//! | emitting, cut-out mask | base-colour texture kept for the mask | `x B / pi` (shown times the texture) |
//! | attenuating, untextured | white base, BLEND | `x B / (pi opacity)`, alpha `opacity` |
//!
//! `COLOR_0` is cut to `[0, 1]`, as the format demands; how many vertices that concerns is in the extras.

use super::surfaces::{Surfaces, finite, finite_vector};
use super::tone::unit;
use super::{Provenance, WriteError, auto_exposure};
use gltf_json as json;
use isolux_core::scene::{Alpha, Camera, Image, Polygon, Projection, Scene, Wrap};
use isolux_core::solution::SurfaceMesh;
use isolux_core::units::Rgb;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::buffer::Target;
use json::mesh::Semantic;
use json::texture::{MagFilter, MinFilter, WrappingMode};
use json::validation::{Checked::Valid, USize64};
use json::{Index, serialize};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Near plane of cameras as a share of the scene's diameter: 1.7 cm in a room of 10 m x 10 m x 10 m, nearer than any
/// eye is to a wall. The file format needs a number, the scene has none.
const NEAR_SHARE: f64 = 1e-3;

/// Far plane of orthographic cameras in diameters of the scene: sees all of it from anywhere within a diameter of it.
const FAR_DIAMETERS: f64 = 3.0;

/// How [`glb`] writes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlbOptions {
    /// Factor from radiance to displayed value; `None`: [`auto_exposure`].
    pub exposure: Option<f64>,
    /// Where the solution comes from.
    pub provenance: Provenance,
}

/// The scene's surfaces with their light as a GLB file.
///
/// One node and mesh per object under the object's name, one primitive per object and material (two where only some
/// of its polygons are textured), world coordinates in metres; backs of two-sided surfaces are triangles of their own.
/// Cameras are carried along; an orthographic one gets a square picture, for the scene knows its height only.
///
/// # Errors
/// [`WriteError`] where the mesh is empty or not one of this scene, where a number is not finite, where an image is
/// neither PNG nor JPEG, and where the file would pass 4 GiB.
pub fn glb(scene: &Scene, mesh: &SurfaceMesh, options: &GlbOptions) -> Result<Vec<u8>, WriteError> {
    let surfaces = Surfaces::check(scene, mesh)?;
    let exposure = options.exposure.unwrap_or_else(|| auto_exposure(mesh, scene));
    if !(exposure.is_finite() && exposure > 0.0) {
        return Err(WriteError::Exposure { exposure });
    }
    let mut writer = Writer {
        surfaces,
        exposure,
        root: json::Root::default(),
        bin: Vec::new(),
        materials: BTreeMap::new(),
        textures: BTreeMap::new(),
        images: BTreeMap::new(),
        samplers: BTreeMap::new(),
        clamped: 0,
        vertices: 0,
    };
    let mut nodes = writer.objects()?;
    for camera in &scene.cameras {
        nodes.push(writer.camera(camera)?);
    }
    writer.finish(nodes, &options.provenance)
}

/// What decides which primitive of its object a polygon goes to: material, and whether its texture is shown.
type Kind = (u32, bool);

/// The growing document.
struct Writer<'a> {
    surfaces: Surfaces<'a>,
    exposure: f64,
    root: json::Root,
    bin: Vec<u8>,
    materials: BTreeMap<Kind, Index<json::Material>>,
    textures: BTreeMap<(u32, [u32; 2]), Index<json::Texture>>,
    images: BTreeMap<u32, Index<json::Image>>,
    samplers: BTreeMap<[u32; 2], Index<json::texture::Sampler>>,
    clamped: usize,
    vertices: usize,
}

impl Writer<'_> {
    /// A node and a mesh for every object that has triangles, in the scene's order.
    fn objects(&mut self) -> Result<Vec<Index<json::Node>>, WriteError> {
        let scene = self.surfaces.scene;
        let mut objects: BTreeMap<u32, BTreeMap<Kind, Vec<u32>>> = BTreeMap::new();
        for (index, polygon) in self.surfaces.polygons() {
            let kind = (polygon.material, shows_texture(scene, polygon));
            objects.entry(polygon.object).or_default().entry(kind).or_default().push(index);
        }
        let mut nodes = Vec::with_capacity(objects.len());
        for (object, kinds) in objects {
            let name = &scene.objects[object as usize].name;
            let mut primitives = Vec::with_capacity(kinds.len());
            for (kind, polygons) in kinds {
                primitives.push(self.primitive(name, kind, &polygons)?);
            }
            let mesh = self.root.push(json::Mesh {
                extensions: None,
                extras: None,
                name: Some(name.clone()),
                primitives,
                weights: None,
            });
            nodes.push(self.root.push(json::Node {
                mesh: Some(mesh),
                name: Some(name.clone()),
                ..json::Node::default()
            }));
        }
        Ok(nodes)
    }

    /// The polygons of one object and kind as one list of triangles.
    fn primitive(&mut self, name: &str, kind: Kind, polygons: &[u32]) -> Result<json::mesh::Primitive, WriteError> {
        let (scene, mesh) = (self.surfaces.scene, self.surfaces.mesh);
        let (_, textured) = kind;
        let mut vertices = Vertices::default();
        let mut indices = Vec::new();
        for &index in polygons {
            let polygon = &scene.polygons[index as usize];
            let look = Look::of(scene, polygon, textured, self.exposure);
            let range = self.surfaces.vertices_of(index);
            let shift = vertices.positions.len() as u32;
            let first = range.start as u32;
            for triangle in &mesh.triangles[mesh.triangles_of(index)] {
                indices.extend(triangle.map(|vertex| vertex - first + shift));
            }
            for vertex in range {
                let position = mesh.positions[vertex];
                let colour = look.colour(mesh.irradiance[vertex], mesh.radiosity[vertex]);
                self.clamped += usize::from(colour.max_component() > 1.0);
                self.vertices += 1;
                vertices.positions.push(position.to_array().map(|x| x as f32));
                vertices.normals.push(polygon.plane.normal.to_array().map(|x| x as f32));
                let [r, g, b] = colour.0;
                vertices.colours.push([r, g, b, look.alpha].map(|x| (65535.0 * unit(x)).round() as u16));
                vertices.irradiance.push(mesh.irradiance[vertex].0.map(|x| x as f32));
                vertices.radiosity.push(mesh.radiosity[vertex].0.map(|x| x as f32));
                if let (true, Some(uv)) = (textured, polygon.texture_coordinates(position)) {
                    finite("texture coordinate", name, uv.x)?;
                    finite("texture coordinate", name, uv.y)?;
                    vertices.uv.push([uv.x as f32, uv.y as f32]);
                }
            }
        }
        let material = self.material(kind)?;
        let mut attributes = BTreeMap::new();
        let positions = self.floats(&vertices.positions, Type::Vec3);
        self.bounds(positions, &vertices.positions);
        attributes.insert(Valid(Semantic::Positions), positions);
        attributes.insert(Valid(Semantic::Normals), self.floats(&vertices.normals, Type::Vec3));
        attributes.insert(Valid(Semantic::Colors(0)), self.colours(&vertices.colours));
        if textured {
            attributes.insert(Valid(Semantic::TexCoords(0)), self.floats(&vertices.uv, Type::Vec2));
        }
        let irradiance = self.floats(&vertices.irradiance, Type::Vec3);
        attributes.insert(Valid(Semantic::Extras("IRRADIANCE".to_owned())), irradiance);
        let radiosity = self.floats(&vertices.radiosity, Type::Vec3);
        attributes.insert(Valid(Semantic::Extras("RADIOSITY".to_owned())), radiosity);
        Ok(json::mesh::Primitive {
            attributes,
            extensions: None,
            extras: None,
            indices: Some(self.indices(&indices)),
            material: Some(material),
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
        })
    }

    /// The unlit material of a kind, made once.
    fn material(&mut self, kind: Kind) -> Result<Index<json::Material>, WriteError> {
        if let Some(&known) = self.materials.get(&kind) {
            return Ok(known);
        }
        let scene = self.surfaces.scene;
        let (index, textured) = kind;
        let material = &scene.materials[index as usize];
        let mut pbr = json::material::PbrMetallicRoughness {
            // What viewers without KHR_materials_unlit fall back to: a matte surface.
            metallic_factor: json::material::StrengthFactor(0.0),
            roughness_factor: json::material::StrengthFactor(1.0),
            ..Default::default()
        };
        let shown = material.texture.as_ref().filter(|_| textured);
        if let Some(texture) = shown {
            let [r, g, b] = texture.factor.0.map(|band| unit(band) as f32);
            pbr.base_color_factor = json::material::PbrBaseColorFactor([r, g, b, 1.0]);
            let index = self.texture(texture.image, texture.wrap)?;
            pbr.base_color_texture = Some(json::texture::Info { index, tex_coord: 0, extensions: None, extras: None });
        }
        let alpha_mode = match material.alpha {
            Alpha::Mask(_) if textured => json::material::AlphaMode::Mask,
            Alpha::Attenuate => json::material::AlphaMode::Blend,
            Alpha::Opaque | Alpha::Mask(_) => json::material::AlphaMode::Opaque,
        };
        let alpha_cutoff = match material.alpha {
            Alpha::Mask(mask) if textured => {
                scene.masks.get(mask as usize).map(|mask| json::material::AlphaCutoff(mask.cutoff as f32))
            }
            _ => None,
        };
        let made = self.root.push(json::Material {
            name: Some(material.name.clone()),
            alpha_mode: Valid(alpha_mode),
            alpha_cutoff,
            pbr_metallic_roughness: pbr,
            extensions: Some(json::extensions::material::Material {
                unlit: Some(json::extensions::material::Unlit {}),
                ..Default::default()
            }),
            ..json::Material::default()
        });
        self.materials.insert(kind, made);
        Ok(made)
    }

    /// A texture of an image with a wrap, made once.
    fn texture(&mut self, image: u32, wrap: [Wrap; 2]) -> Result<Index<json::Texture>, WriteError> {
        let modes = wrap.map(wrapping);
        let codes = modes.map(|mode| mode.as_gl_enum());
        if let Some(&known) = self.textures.get(&(image, codes)) {
            return Ok(known);
        }
        let source = self.image(image)?;
        let sampler = match self.samplers.get(&codes) {
            Some(&known) => known,
            None => self.root.push(json::texture::Sampler {
                mag_filter: Some(Valid(MagFilter::Linear)),
                min_filter: Some(Valid(MinFilter::LinearMipmapLinear)),
                wrap_s: Valid(modes[0]),
                wrap_t: Valid(modes[1]),
                ..Default::default()
            }),
        };
        self.samplers.insert(codes, sampler);
        let name = Some(self.surfaces.scene.images[image as usize].name.clone());
        let made =
            self.root.push(json::Texture { name, sampler: Some(sampler), source, extensions: None, extras: None });
        self.textures.insert((image, codes), made);
        Ok(made)
    }

    /// An image with its bytes, made once.
    fn image(&mut self, index: u32) -> Result<Index<json::Image>, WriteError> {
        if let Some(&known) = self.images.get(&index) {
            return Ok(known);
        }
        let image = &self.surfaces.scene.images[index as usize];
        let Some(mime) = mime_of(&image.bytes) else {
            return Err(WriteError::ImageType { image: image.name.clone(), mime: image.mime.clone() });
        };
        let view = self.view(&image.bytes, None);
        let made = self.root.push(json::Image {
            buffer_view: Some(view),
            mime_type: Some(json::image::MimeType(mime.to_owned())),
            name: Some(image.name.clone()),
            uri: None,
            extensions: None,
            extras: None,
        });
        self.images.insert(index, made);
        Ok(made)
    }

    /// A camera and its node.
    fn camera(&mut self, camera: &Camera) -> Result<Index<json::Node>, WriteError> {
        let name = &camera.name;
        for (what, vector) in [("eye", camera.eye), ("viewing direction", camera.forward), ("up direction", camera.up)]
        {
            finite_vector(what, name, vector)?;
        }
        // Cameras of the file format look along -z with +y up.
        let back = -camera.forward.normalize_or_zero();
        let right = camera.up.cross(back).normalize_or_zero();
        let up = back.cross(right);
        if up.length() < 0.5 {
            // The up direction is parallel to the viewing direction, or one of them is zero.
            return Err(WriteError::NotFinite { what: "up direction", name: name.clone(), value: f64::NAN });
        }
        let diameter = self.surfaces.scene.diameter;
        finite("near plane", name, diameter)?;
        let near = (NEAR_SHARE * diameter) as f32;
        let (perspective, orthographic, kind) = match camera.projection {
            Projection::Perspective { vertical_angle } => {
                finite("opening angle", name, vertical_angle)?;
                let perspective = json::camera::Perspective {
                    aspect_ratio: None,
                    yfov: vertical_angle as f32,
                    zfar: None,
                    znear: near,
                    extensions: None,
                    extras: None,
                };
                (Some(perspective), None, json::camera::Type::Perspective)
            }
            Projection::Orthographic { height } => {
                finite("height", name, height)?;
                let orthographic = json::camera::Orthographic {
                    xmag: (0.5 * height) as f32,
                    ymag: (0.5 * height) as f32,
                    zfar: (FAR_DIAMETERS * diameter) as f32,
                    znear: 0.0,
                    extensions: None,
                    extras: None,
                };
                (None, Some(orthographic), json::camera::Type::Orthographic)
            }
        };
        let made = self.root.push(json::Camera {
            name: Some(name.clone()),
            orthographic,
            perspective,
            type_: Valid(kind),
            extensions: None,
            extras: None,
        });
        let columns = [right.extend(0.0), up.extend(0.0), back.extend(0.0), camera.eye.extend(1.0)];
        let mut matrix = [0.0; 16];
        for (to, from) in matrix.iter_mut().zip(columns.iter().flat_map(|column| column.to_array())) {
            *to = from as f32;
        }
        Ok(self.root.push(json::Node {
            camera: Some(made),
            matrix: Some(matrix),
            name: Some(name.clone()),
            ..json::Node::default()
        }))
    }

    /// Appends bytes, aligned to 4, as a view.
    fn view(&mut self, bytes: &[u8], target: Option<Target>) -> Index<json::buffer::View> {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.root.push(json::buffer::View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(offset)),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: None,
        })
    }

    /// Appends an array with a view of its own.
    fn accessor(
        &mut self,
        bytes: &[u8],
        count: usize,
        (component, kind): (ComponentType, Type),
        target: Target,
    ) -> Index<json::Accessor> {
        let view = self.view(bytes, Some(target));
        self.root.push(json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: None,
            type_: Valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: component == ComponentType::U16,
            sparse: None,
        })
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], kind: Type) -> Index<json::Accessor> {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, values.len(), (ComponentType::F32, kind), Target::ArrayBuffer)
    }

    fn colours(&mut self, values: &[[u16; 4]]) -> Index<json::Accessor> {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, values.len(), (ComponentType::U16, Type::Vec4), Target::ArrayBuffer)
    }

    fn indices(&mut self, values: &[u32]) -> Index<json::Accessor> {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let kind = (ComponentType::U32, Type::Scalar);
        self.accessor(&bytes, values.len(), kind, Target::ElementArrayBuffer)
    }

    /// Adds the bounds that the format demands of positions.
    fn bounds(&mut self, accessor: Index<json::Accessor>, values: &[[f32; 3]]) {
        let fold = |pick: fn(f32, f32) -> f32, start: f32| {
            let bound = values.iter().fold([start; 3], |a, b| [pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2])]);
            Some(json::Value::from(bound.to_vec()))
        };
        let accessor = &mut self.root.accessors[accessor.value()];
        accessor.min = fold(f32::min, f32::INFINITY);
        accessor.max = fold(f32::max, f32::NEG_INFINITY);
    }

    /// Scene, asset, extras; then the two chunks of the container.
    fn finish(mut self, nodes: Vec<Index<json::Node>>, provenance: &Provenance) -> Result<Vec<u8>, WriteError> {
        let mut extras = provenance.json(Some(self.exposure));
        extras.insert("color0".to_owned(), "linear; exposure * radiosity / pi, textured: irradiance".into());
        extras.insert("vertices".to_owned(), self.vertices.into());
        extras.insert("clampedVertices".to_owned(), self.clamped.into());
        let extras = serialize::to_string(&extras).map_err(encode_error)?;
        let extras = json::extras::RawValue::from_string(extras).map_err(encode_error)?;
        self.root.asset.generator = Some(provenance.generator());
        self.root.asset.extras = Some(extras.clone());
        self.root.extensions_used = vec!["KHR_materials_unlit".to_owned()];
        let name = Some(self.surfaces.scene.name.clone());
        let scene = self.root.push(json::Scene { extensions: None, extras: Some(extras), name, nodes });
        self.root.scene = Some(scene);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.root.push(json::Buffer {
            byte_length: USize64::from(self.bin.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        });
        let mut text = serialize::to_vec(&self.root).map_err(encode_error)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        container(&text, &self.bin)
    }
}

/// The GLB container (glTF 2.0, section 4.4): header, JSON chunk, binary chunk; both are padded to 4 bytes already.
fn container(text: &[u8], bin: &[u8]) -> Result<Vec<u8>, WriteError> {
    let total = 12 + 8 + text.len() + 8 + bin.len();
    let limit = u32::MAX as usize;
    if total > limit {
        return Err(WriteError::TooLarge { what: "bytes", found: total, limit, format: "GLB" });
    }
    let mut file = Vec::with_capacity(total);
    file.extend_from_slice(b"glTF");
    file.extend_from_slice(&2_u32.to_le_bytes());
    file.extend_from_slice(&(total as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bin)] {
        file.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        file.extend_from_slice(kind);
        file.extend_from_slice(chunk);
    }
    Ok(file)
}

/// Arrays of one primitive, vertex by vertex.
#[derive(Default)]
struct Vertices {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    colours: Vec<[u16; 4]>,
    uv: Vec<[f32; 2]>,
    irradiance: Vec<[f32; 3]>,
    radiosity: Vec<[f32; 3]>,
}

/// How the vertices of a polygon get their colour.
struct Look {
    /// From irradiance (true) or from radiosity.
    of_irradiance: bool,
    /// Factor on it.
    factor: f64,
    /// Alpha of the vertices.
    alpha: f64,
}

impl Look {
    fn of(scene: &Scene, polygon: &Polygon, textured: bool, exposure: f64) -> Look {
        let material = &scene.materials[polygon.material as usize];
        let of_irradiance = textured && polygon.emission == Rgb::ZERO;
        let texture_has_alpha =
            || material.texture.as_ref().is_some_and(|texture| has_alpha(&scene.images[texture.image as usize]));
        let alpha = match material.alpha {
            // A texture's own alpha channel is what the opacity is the mean of.
            Alpha::Attenuate if textured && texture_has_alpha() => 1.0,
            Alpha::Attenuate => polygon.opacity,
            Alpha::Opaque | Alpha::Mask(_) => 1.0,
        };
        // Radiosity counts the opacity already; blending will multiply by it once more.
        let doubled = if of_irradiance || alpha <= 0.0 { 1.0 } else { alpha };
        Look { of_irradiance, factor: exposure / (PI * doubled), alpha }
    }

    /// Linear, not yet cut to `[0, 1]`.
    fn colour(&self, irradiance: Rgb, radiosity: Rgb) -> Rgb {
        (if self.of_irradiance { irradiance } else { radiosity }) * self.factor
    }
}

/// Is the texture of a polygon shown? It needs coordinates; and emission, which is not in the base-colour texture,
/// would be multiplied by it, so that only cut-out emitters keep theirs (for the mask's sake).
fn shows_texture(scene: &Scene, polygon: &Polygon) -> bool {
    let material = &scene.materials[polygon.material as usize];
    let keeps = polygon.emission == Rgb::ZERO || matches!(material.alpha, Alpha::Mask(_));
    material.texture.is_some() && polygon.uv.is_some() && keeps
}

/// Type of an image by its first bytes.
fn mime_of(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some("image/png")
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        Some("image/jpeg")
    } else {
        None
    }
}

/// Has an image an alpha channel? JPEG has none; PNG says so in the colour type of its header (byte 25: 4 grey with
/// alpha, 6 RGB with alpha) or by a `tRNS` chunk before its pixels.
fn has_alpha(image: &Image) -> bool {
    let bytes = &image.bytes;
    if mime_of(bytes) != Some("image/png") {
        return false;
    }
    if matches!(bytes.get(25), Some(4 | 6)) {
        return true;
    }
    let mut rest = &bytes[8..];
    while let Some((head, tail)) = rest.split_at_checked(8) {
        match &head[4..] {
            b"tRNS" => return true,
            b"IDAT" => return false,
            _ => {}
        }
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        // Data and checksum.
        rest = tail.get(length.saturating_add(4)..).unwrap_or_default();
    }
    false
}

/// The wrap in the format's terms.
fn wrapping(wrap: Wrap) -> WrappingMode {
    match wrap {
        Wrap::Repeat => WrappingMode::Repeat,
        Wrap::Clamp => WrappingMode::ClampToEdge,
        Wrap::Mirror => WrappingMode::MirroredRepeat,
    }
}

fn encode_error(error: json::Error) -> WriteError {
    WriteError::Encode { format: "GLB", message: error.to_string() }
}
