//! Wavefront OBJ and its MTL libraries become a [`SceneInput`]: `tobj` parses what [`scan`] lets through; polygons of
//! three and four corners are kept, larger ones cut into triangles.

mod library;
mod polygon;
mod scan;
mod text;

use super::error::{ReadError, brief, clean, display};
use super::look::{Coverage, Loaded, Look, Map, UvTransform};
use super::names::Names;
use super::texture::Bank;
use super::{ReadOptions, files, issue};
use glam::{DVec2, DVec3};
use isolux_core::scene::{Face, Issue, IssueKind, Material, Object, SceneInput, Severity, Surface, Texture, Wrap};
use isolux_core::units::Rgb;
use library::{Entry, TextureUse};
use polygon::Cut;
use scan::Scan;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// Reflectance where no material says any.
const DEFAULT_REFLECTANCE: f64 = 0.5;

/// Reads an OBJ file that has been loaded.
pub(super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<SceneInput, ReadError> {
    let file = display(path);
    let stem = path.file_stem().map(|stem| clean(&stem.to_string_lossy())).filter(|stem| !stem.is_empty());
    let scan = scan::scan(&file, bytes, stem.as_deref().unwrap_or("scene"))?;
    let mut reader = Reader { file, ..Reader::default() };
    if options.metres_per_unit.is_none() {
        let message = "OBJ has no unit: coordinates are taken as metres (--units says otherwise)";
        let note = issue(Severity::Note, IssueKind::Assumed, &reader.file, message);
        reader.scene.issues.push(note);
    }
    for name in &scan.libraries {
        reader.open_library(path.parent().unwrap_or(Path::new("")), name);
    }
    reader.models(&scan)?;
    reader.finish(&scan, options)
}

/// What has been read so far.
#[derive(Default)]
struct Reader {
    file: String,
    scene: SceneInput,
    /// Materials that are asked for, by name, in order of first use; the empty name is that of faces without one.
    used: Vec<String>,
    /// Materials that libraries define, with the folder that their textures are relative to.
    library: HashMap<String, (Entry, PathBuf)>,
    library_missing: bool,
}

impl Reader {
    fn note(&mut self, severity: Severity, kind: IssueKind, object: &str, message: impl Into<String>) {
        self.scene.issues.push(issue(severity, kind, object, message));
    }

    fn open_library(&mut self, folder: &Path, name: &str) {
        let opened = files::relative(name).and_then(|relative| {
            let path = folder.join(relative);
            let entries = library::parse(&files::read(&path)?).map_err(|error| error.to_string())?;
            Ok((path, entries))
        });
        match opened {
            Ok((path, entries)) => {
                let folder = path.parent().unwrap_or(Path::new("")).to_owned();
                for entry in entries {
                    // The first of a name counts, as where libraries are searched in order.
                    self.library.entry(entry.material.name.clone()).or_insert_with(|| (entry, folder.clone()));
                }
            }
            Err(reason) => {
                self.library_missing = true;
                let message = format!("material library: {}", brief(&reason));
                self.note(Severity::Warning, IssueKind::MissingFile, &brief(name), message);
            }
        }
    }

    /// Has the file parsed, and puts its faces into the scene, in file order.
    fn models(&mut self, scan: &Scan) -> Result<(), ReadError> {
        let mut numbers = HashMap::new();
        for name in &scan.materials {
            numbers.entry(name.clone()).or_insert_with(|| {
                self.used.push(name.clone());
                self.used.len() - 1
            });
        }
        let all = |_: &Path| Ok((vec![tobj::Material::default(); numbers.len()], numbers.clone()));
        // The defaults: nothing is triangulated, merged or left out.
        let (models, _) =
            tobj::load_obj_buf(&mut scan.text.as_bytes(), &tobj::LoadOptions::default(), all).map_err(|error| {
                ReadError::Malformed { file: self.file.clone(), format: "OBJ", reason: error.to_string() }
            })?;
        let mut objects: HashMap<String, u32> = HashMap::new();
        let mut faces: Vec<usize> = Vec::new();
        let mut has_coordinates = scan.has_coordinates.iter();
        for tobj::Model { mesh, name } in models.iter().filter(|model| !model.mesh.indices.is_empty()) {
            let object = *objects.entry(name.clone()).or_insert_with(|| {
                self.scene.objects.push(Object { name: name.clone() });
                faces.push(0);
                self.scene.objects.len() as u32 - 1
            });
            let material = mesh.material_id.unwrap_or_else(|| {
                // Faces before the first `usemtl`.
                let known = self.used.iter().position(String::is_empty);
                known.unwrap_or_else(|| {
                    self.used.push(String::new());
                    self.used.len() - 1
                })
            });
            // No arities: all are triangles.
            let arity = |face: usize| mesh.face_arities.get(face).map_or(3, |&arity| arity as usize);
            let (mut face, mut first) = (0, 0);
            while first < mesh.indices.len() {
                let corners = first..first + arity(face);
                (face, first) = (face + 1, corners.end);
                let position = |&index: &u32| DVec3::from_slice(&mesh.positions[3 * index as usize..]);
                let outline: Vec<DVec3> = mesh.indices[corners.clone()].iter().map(position).collect();
                // Upwards in OBJ, downwards in a scene (as in glTF).
                let coordinate = |&index: &u32| {
                    let uv = DVec2::from_slice(&mesh.texcoords[2 * index as usize..]);
                    DVec2::new(uv.x, 1.0 - uv.y)
                };
                // Where a corner has none, `tobj` makes one up.
                let has_coordinates = has_coordinates.next().copied().unwrap_or(false);
                let uv: Option<Vec<DVec2>> =
                    has_coordinates.then(|| mesh.texcoord_indices[corners].iter().map(coordinate).collect());
                let made = self.face(&outline, uv.as_deref(), object, material as u32, faces[object as usize])?;
                faces[object as usize] += made;
            }
        }
        Ok(())
    }

    /// Adds a polygon; how many faces it makes. `number` is the first one's in its object.
    fn face(
        &mut self,
        outline: &[DVec3],
        uv: Option<&[DVec2]>,
        object: u32,
        material: u32,
        number: usize,
    ) -> Result<usize, ReadError> {
        let mut add = |corners: &[usize]| {
            self.scene.faces.push(Face {
                object,
                material,
                corners: corners.iter().map(|&corner| outline[corner]).collect(),
                uv: uv.map(|uv| corners.iter().map(|&corner| uv[corner]).collect()),
                surface: None,
            });
        };
        let count = outline.len();
        let (triangles, is_fan) = match count {
            3 | 4 => {
                add(&[0, 1, 2, 3][..count]);
                return Ok(1);
            }
            _ => match polygon::triangulate(outline) {
                Cut::Triangles(triangles) => (triangles, false),
                Cut::Fan(triangles) => (triangles, true),
                Cut::TooManyCorners => {
                    return Err(ReadError::TooLarge {
                        file: self.file.clone(),
                        object: brief(&self.scene.objects[object as usize].name),
                        what: "corners of a concave face",
                        count,
                        limit: polygon::MAX_CONCAVE,
                    });
                }
            },
        };
        triangles.iter().for_each(|triangle| add(triangle));
        if is_fan {
            let name = self.scene.objects[object as usize].name.clone();
            let message = format!("face {number}: {count} corners that cross or touch, cut into a fan");
            self.note(Severity::Warning, IssueKind::Assumed, &name, message);
        }
        Ok(triangles.len())
    }

    /// Gives the scene its materials, and faces under textures their surfaces.
    fn finish(mut self, scan: &Scan, options: &ReadOptions) -> Result<SceneInput, ReadError> {
        self.scene.metres_per_unit = options.metres_per_unit.unwrap_or(1.0);
        if scan.lines > 0 {
            let (file, message) = (self.file.clone(), format!("{} points and lines are ignored", scan.lines));
            self.note(Severity::Note, IssueKind::Ignored, &file, message);
        }
        if scan.vertex_colours {
            let file = self.file.clone();
            self.note(Severity::Note, IssueKind::Ignored, &file, "vertex colours are ignored: OBJ defines none");
        }
        let mut users: Vec<Vec<usize>> = vec![Vec::new(); self.used.len()];
        for (index, face) in self.scene.faces.iter().enumerate() {
            users[face.material as usize].push(index);
        }

        // Images by path, in order of first use.
        let mut paths: Vec<PathBuf> = Vec::new();
        let mut names: Vec<String> = Vec::new();
        let mut unique = Names::default();
        let mut looks = Vec::with_capacity(self.used.len());
        for (index, name) in std::mem::take(&mut self.used).into_iter().enumerate() {
            let is_used = !users[index].is_empty();
            let known = self.library.get(&name).cloned();
            let (entry, folder) = known.unwrap_or_else(|| {
                if is_used {
                    self.undefined(&name);
                }
                let grey = tobj::Material { diffuse: Some([DEFAULT_REFLECTANCE; 3]), ..tobj::Material::default() };
                (Entry { material: grey, ignored: Vec::new() }, PathBuf::new())
            });
            let name = unique.unique(Some(&name), || "default".to_owned());
            if is_used {
                for message in entry.ignored.iter().take(8) {
                    self.note(Severity::Warning, IssueKind::Ignored, &name, message.clone());
                }
                if entry.material.diffuse.is_none() && entry.diffuse_map().is_none() {
                    let message = format!("Kd is absent: reflectance {DEFAULT_REFLECTANCE} is assumed");
                    self.note(Severity::Note, IssueKind::Assumed, &name, message);
                }
            }
            let mut map = |texture: Option<TextureUse>| {
                let texture = texture?;
                // A path that is refused is found out when it is fetched.
                let path = files::relative(&texture.path).map(|path| folder.join(path)).unwrap_or_default();
                let known = paths.iter().zip(&names).position(|(old, name)| *old == path && *name == texture.path);
                let image = known.unwrap_or_else(|| {
                    paths.push(path);
                    names.push(texture.path.clone());
                    paths.len() - 1
                });
                Some(Map { image, set: 0, transform: transform(&texture), wrap: [wrap(&texture); 2] })
            };
            let base_map = map(entry.diffuse_map()).filter(|_| is_used);
            let emission_map = map(entry.emission_map()).filter(|_| is_used);
            looks.push((name, look(&entry, base_map, emission_map, options)));
        }

        let shown = names.iter().map(|name| clean(name)).collect();
        let fetch = move |image: usize| {
            files::relative(&names[image])?;
            files::read(&paths[image])
        };
        let mut bank = Bank::new(shown, Box::new(fetch));
        for ((name, look), faces) in looks.into_iter().zip(users) {
            self.dress(name, &look, &faces, &mut bank);
        }
        Ok(self.scene)
    }

    /// Says that a material is not defined.
    fn undefined(&mut self, name: &str) {
        let grey = format!("grey of reflectance {DEFAULT_REFLECTANCE} is assumed");
        if name.is_empty() {
            self.note(Severity::Note, IssueKind::Assumed, "default", format!("faces without a material: {grey}"));
        } else {
            let kind = if self.library_missing { IssueKind::MissingFile } else { IssueKind::Assumed };
            let message = format!("no material library defines it: {grey}");
            self.note(Severity::Warning, kind, name, message);
        }
    }

    /// Adds a material, and averages it over its faces.
    fn dress(&mut self, name: String, look: &Look, faces: &[usize], bank: &mut Bank<'_>) {
        let mut missing: Vec<Issue> = Vec::new();
        let loaded = look.load(bank, |what, image, reason| {
            let message = format!("{what} texture '{}': {}: its factor alone counts", brief(image), brief(&reason));
            missing.push(issue(Severity::Warning, IssueKind::MissingFile, &name, message));
        });
        self.scene.issues.extend(missing);
        let mut without = 0;
        for &index in faces {
            let face = &mut self.scene.faces[index];
            if loaded.is_uniform() {
                face.uv = None;
                continue;
            }
            without += usize::from(face.uv.is_none());
            face.surface = Some(average(face, &loaded));
            face.uv = match (&loaded.base, face.uv.take()) {
                (Some((map, _)), Some(uv)) => Some(uv.into_iter().map(|uv| map.transform.apply(uv)).collect()),
                _ => None,
            };
        }
        if without > 0 {
            let message = format!("{without} faces have no texture coordinates: the texture's mean counts");
            self.note(Severity::Warning, IssueKind::Assumed, &name, message);
        }
        let texture = loaded.base.as_ref().and_then(|(map, _)| {
            let image = bank.keep(map.image, &mut self.scene.images).ok()?;
            Some(Texture { image, factor: look.base, wrap: map.wrap })
        });
        // OBJ has no cut-outs: no mask is asked for.
        let alpha = loaded.alpha(|_, _| 0);
        let surface = loaded.surface(|_| None, None);
        self.scene.materials.push(Material { name, surface, two_sided: false, alpha, texture });
    }
}

/// What a library's values mean for light.
fn look(entry: &Entry, base_map: Option<Map>, emission_map: Option<Map>, options: &ReadOptions) -> Look {
    let without = if entry.diffuse_map().is_some() { 1.0 } else { DEFAULT_REFLECTANCE };
    // A map without a factor stands for itself.
    let emission = entry.material.emissive.or(entry.emission_map().map(|_| [1.0; 3])).unwrap_or([0.0; 3]);
    Look {
        base: Rgb(entry.material.diffuse.unwrap_or([without; 3])),
        alpha: entry.opacity().unwrap_or(1.0),
        base_map,
        // A texture's alpha is not opacity in MTL: `alpha` alone is.
        coverage: Coverage::Factor,
        emission: Rgb(emission) * (PI * options.emission_scale),
        emission_map,
        transmission: 0.0,
        transmission_map: None,
    }
}

/// MTL's scale and offset are for v upwards: `1 - (s (1 - v) + o) = s v + 1 - s - o`.
fn transform(texture: &TextureUse) -> UvTransform {
    UvTransform {
        column_u: DVec2::X * texture.scale.x,
        column_v: DVec2::Y * texture.scale.y,
        offset: DVec2::new(texture.offset.x, 1.0 - texture.scale.y - texture.offset.y),
    }
}

fn wrap(texture: &TextureUse) -> Wrap {
    if texture.clamp { Wrap::Clamp } else { Wrap::Repeat }
}

/// The surface of a face: of a quadrilateral, that of its two triangles by area.
fn average(face: &Face, loaded: &Loaded) -> Surface {
    let triangle = |[a, b, c]: [usize; 3]| {
        let corners = face.uv.as_ref().map(|uv| [uv[a], uv[b], uv[c]]);
        let area = (face.corners[b] - face.corners[a]).cross(face.corners[c] - face.corners[a]).length();
        (area, loaded.surface(|_| corners, None))
    };
    let (area, first) = triangle([0, 1, 2]);
    if face.corners.len() == 3 {
        return first;
    }
    let (other_area, second) = triangle([0, 2, 3]);
    let share = area / (area + other_area);
    let share = if share.is_finite() { share } else { 0.5 };
    let blend = |a: Rgb, b: Rgb| a * share + b * (1.0 - share);
    Surface {
        reflectance: blend(first.reflectance, second.reflectance),
        emission: blend(first.emission, second.emission),
        opacity: share * first.opacity + (1.0 - share) * second.opacity,
    }
}
