//! Wavefront OBJ and its MTL libraries become a [`SceneInput`]: polygons of three and four corners are kept, larger
//! ones cut into triangles.
//!
//! Why not the crate `tobj`: it panics on a short `Kd` in a library, takes polylines for polygons, refuses files
//! whose names are not UTF-8, and its errors have no line; on sound files both agree (`obj_agrees_with_tobj`).

mod library;
mod polygon;
mod text;

use super::error::{ReadError, brief, clean, display};
use super::look::{Coverage, Loaded, Look, Map, UvTransform};
use super::names::Names;
use super::texture::Bank;
use super::{MAX_FACES, ReadOptions, files, issue};
use glam::{DVec2, DVec3};
use isolux_core::scene::{Face, Issue, IssueKind, Material, Object, SceneInput, Severity, Surface, Texture, Wrap};
use isolux_core::units::Rgb;
use library::{Entry, TextureUse};
use polygon::Cut;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use text::{Statement, statements};

/// Reflectance where no material says any.
const DEFAULT_REFLECTANCE: f64 = 0.5;

/// Reads an OBJ file that has been loaded.
pub(super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<SceneInput, ReadError> {
    let file = display(path);
    let stem = path.file_stem().map_or_else(|| "scene".to_owned(), |stem| clean(&stem.to_string_lossy()));
    let mut reader = Reader::new(file, path.parent().unwrap_or(Path::new("")), stem);
    if options.metres_per_unit.is_none() {
        let message = "OBJ has no unit: coordinates are taken as metres (--units says otherwise)";
        let note = issue(Severity::Note, IssueKind::Assumed, &reader.file, message);
        reader.scene.issues.push(note);
    }
    for statement in statements(bytes) {
        reader.statement(&statement)?;
    }
    reader.finish(options)
}

/// A corner of a face: numbers of its position and of its texture coordinates.
type Corner = (usize, Option<usize>);

/// What has been read so far.
struct Reader<'a> {
    file: String,
    folder: &'a Path,
    scene: SceneInput,
    positions: Vec<DVec3>,
    coordinates: Vec<DVec2>,
    /// Objects by name: a group may come back.
    objects: HashMap<String, u32>,
    /// Faces of each object, for messages.
    faces: Vec<usize>,
    object: String,
    /// Materials that faces use, by name, in order of first use.
    used: Vec<String>,
    numbers: HashMap<String, u32>,
    material: Option<u32>,
    library: HashMap<String, (Entry, PathBuf)>,
    library_missing: bool,
    lines: usize,
    vertex_colours: bool,
}

impl<'a> Reader<'a> {
    fn new(file: String, folder: &'a Path, object: String) -> Reader<'a> {
        Reader {
            file,
            folder,
            scene: SceneInput::default(),
            positions: Vec::new(),
            coordinates: Vec::new(),
            objects: HashMap::new(),
            faces: Vec::new(),
            object,
            used: Vec::new(),
            numbers: HashMap::new(),
            material: None,
            library: HashMap::new(),
            library_missing: false,
            lines: 0,
            vertex_colours: false,
        }
    }

    fn note(&mut self, severity: Severity, kind: IssueKind, object: &str, message: impl Into<String>) {
        self.scene.issues.push(issue(severity, kind, object, message));
    }

    fn syntax(&self, statement: &Statement<'_>, reason: impl Into<String>) -> ReadError {
        ReadError::Syntax { file: self.file.clone(), line: statement.line, reason: reason.into() }
    }

    fn statement(&mut self, statement: &Statement<'_>) -> Result<(), ReadError> {
        match statement.keyword.as_str() {
            "v" => match statement.numbers()[..] {
                [x, y, z, ref more @ ..] => {
                    self.positions.push(DVec3::new(x, y, z));
                    self.vertex_colours |= more.len() >= 3;
                }
                _ => return Err(self.syntax(statement, "a vertex needs three numbers")),
            },
            "vt" => match statement.numbers()[..] {
                // Upwards in OBJ, downwards in a scene (as in glTF).
                [u, v, ..] => self.coordinates.push(DVec2::new(u, 1.0 - v)),
                [u] => self.coordinates.push(DVec2::new(u, 1.0)),
                [] => return Err(self.syntax(statement, "a texture coordinate needs a number")),
            },
            "f" => self.face(statement)?,
            "l" | "p" => self.lines += 1,
            "o" | "g" => {
                let name = clean(statement.rest());
                if !name.is_empty() {
                    self.object = name;
                }
            }
            "usemtl" => {
                let name = clean(statement.rest());
                self.material = Some(self.material_number(name));
            }
            "mtllib" => self.open_library(statement.rest()),
            _ => {}
        }
        Ok(())
    }

    fn material_number(&mut self, name: String) -> u32 {
        let used = &mut self.used;
        *self.numbers.entry(name).or_insert_with_key(|name| {
            used.push(name.clone());
            used.len() as u32 - 1
        })
    }

    fn open_library(&mut self, name: &str) {
        let opened = files::relative(name).and_then(|relative| {
            let path = self.folder.join(relative);
            files::read(&path).map(|bytes| (path, bytes))
        });
        match opened {
            Ok((path, bytes)) => {
                let folder = path.parent().unwrap_or(Path::new("")).to_owned();
                for entry in library::parse(&bytes) {
                    // The first of a name counts, as where libraries are searched in order.
                    self.library.entry(entry.name.clone()).or_insert_with(|| (entry, folder.clone()));
                }
            }
            Err(reason) => {
                self.library_missing = true;
                let message = format!("material library: {}", brief(&reason));
                self.note(Severity::Warning, IssueKind::MissingFile, &brief(name), message);
            }
        }
    }

    fn face(&mut self, statement: &Statement<'_>) -> Result<(), ReadError> {
        let object = match self.objects.get(&self.object) {
            Some(&object) => object,
            None => {
                let object = self.scene.objects.len() as u32;
                self.scene.objects.push(Object { name: self.object.clone() });
                self.objects.insert(self.object.clone(), object);
                self.faces.push(0);
                object
            }
        };
        let number = self.faces[object as usize];
        let mut corners: Vec<Corner> = Vec::with_capacity(4);
        for word in statement.words() {
            let mut parts = word.split('/');
            let position = parts.next().unwrap_or_default();
            let position = self.resolve(statement, number, position, "vertex", self.positions.len())?;
            let coordinate = match parts.next().filter(|part| !part.is_empty()) {
                None => None,
                Some(part) => {
                    let count = self.coordinates.len();
                    Some(self.resolve(statement, number, part, "texture coordinate", count)?)
                }
            };
            corners.push((position, coordinate));
        }
        let faces: Vec<Vec<Corner>> = match corners.len() {
            0..=2 => {
                self.lines += 1;
                return Ok(());
            }
            3 | 4 => vec![corners],
            count => {
                let outline: Vec<DVec3> = corners.iter().map(|&(position, _)| self.positions[position]).collect();
                let triangles = match polygon::triangulate(&outline) {
                    Cut::Triangles(triangles) => triangles,
                    Cut::Fan(triangles) => {
                        let name = self.object.clone();
                        let message = format!("face {number}: {count} corners that cross or touch, cut into a fan");
                        self.note(Severity::Warning, IssueKind::Assumed, &name, message);
                        triangles
                    }
                    Cut::TooManyCorners => {
                        return Err(ReadError::TooLarge {
                            file: self.file.clone(),
                            object: brief(&self.object),
                            what: "corners of a concave face",
                            count,
                            limit: polygon::MAX_CONCAVE,
                        });
                    }
                };
                triangles.into_iter().map(|triangle| triangle.map(|corner| corners[corner]).to_vec()).collect()
            }
        };
        if self.scene.faces.len() + faces.len() > MAX_FACES {
            return Err(ReadError::TooLarge {
                file: self.file.clone(),
                object: brief(&self.object),
                what: "faces",
                count: self.scene.faces.len() + faces.len(),
                limit: MAX_FACES,
            });
        }
        let material = match self.material {
            Some(material) => material,
            None => {
                let material = self.material_number(String::new());
                self.material = Some(material);
                material
            }
        };
        self.faces[object as usize] += faces.len();
        for corners in faces {
            let uv: Option<Vec<DVec2>> =
                corners.iter().map(|&(_, coordinate)| coordinate.map(|index| self.coordinates[index])).collect();
            let corners = corners.iter().map(|&(position, _)| self.positions[position]).collect();
            self.scene.faces.push(Face { object, material, corners, uv, surface: None });
        }
        Ok(())
    }

    /// An index as a file gives it (from 1, or back from the last) as one from 0.
    fn resolve(
        &self,
        statement: &Statement<'_>,
        face: usize,
        text: &str,
        what: &'static str,
        count: usize,
    ) -> Result<usize, ReadError> {
        let index: i64 = text
            .parse()
            .map_err(|_| self.syntax(statement, format!("'{}' is not the number of a {what}", brief(text))))?;
        let resolved = if index < 0 { index.checked_add(count as i64) } else { index.checked_sub(1) };
        match resolved.and_then(|resolved| usize::try_from(resolved).ok()).filter(|&resolved| resolved < count) {
            Some(resolved) => Ok(resolved),
            None => {
                Err(ReadError::Index { file: self.file.clone(), object: brief(&self.object), face, what, index, count })
            }
        }
    }

    /// Gives the scene its materials, and faces under textures their surfaces.
    fn finish(mut self, options: &ReadOptions) -> Result<SceneInput, ReadError> {
        self.scene.metres_per_unit = options.metres_per_unit.unwrap_or(1.0);
        if self.lines > 0 {
            let (file, message) = (self.file.clone(), format!("{} points and lines are ignored", self.lines));
            self.note(Severity::Note, IssueKind::Ignored, &file, message);
        }
        if self.vertex_colours {
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
                (Entry { diffuse: Some([DEFAULT_REFLECTANCE; 3]), ..Entry::default() }, PathBuf::new())
            });
            let name = unique.unique(Some(&name), || "default".to_owned());
            if is_used {
                for message in entry.ignored.iter().take(8) {
                    self.note(Severity::Warning, IssueKind::Ignored, &name, message.clone());
                }
                if entry.diffuse.is_none() && entry.diffuse_map.is_none() {
                    let message = format!("Kd is absent: reflectance {DEFAULT_REFLECTANCE} is assumed");
                    self.note(Severity::Note, IssueKind::Assumed, &name, message);
                }
            }
            let mut map = |texture: &Option<TextureUse>| {
                let texture = texture.as_ref()?;
                // A path that is refused is found out when it is fetched.
                let path = files::relative(&texture.path).map(|path| folder.join(path)).unwrap_or_default();
                let known = paths.iter().zip(&names).position(|(old, name)| *old == path && *name == texture.path);
                let image = known.unwrap_or_else(|| {
                    paths.push(path);
                    names.push(texture.path.clone());
                    paths.len() - 1
                });
                Some(Map { image, set: 0, transform: transform(texture), wrap: [wrap(texture); 2] })
            };
            let base_map = map(&entry.diffuse_map).filter(|_| is_used);
            let emission_map = map(&entry.emission_map).filter(|_| is_used);
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
    let opacity = entry.dissolve.or(entry.transparency.map(|transparency| 1.0 - transparency)).unwrap_or(1.0);
    let without = if entry.diffuse_map.is_some() { 1.0 } else { DEFAULT_REFLECTANCE };
    // A map without a factor stands for itself.
    let emission = entry.emission.or(entry.emission_map.as_ref().map(|_| [1.0; 3])).unwrap_or([0.0; 3]);
    Look {
        base: Rgb(entry.diffuse.unwrap_or([without; 3])),
        alpha: opacity,
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
