//! glTF 2.0 and GLB: container, nodes, meshes and materials become a [`SceneInput`]; the `gltf` crate
//! parses and decodes, and every index, offset and length is checked before it is used.

mod accessor;
mod container;
mod cut;
mod extensions;
mod material;
mod mesh;
mod nodes;
mod profiles;

pub(super) use container::{MAGIC, looks_like_json};

use super::error::{ReadError, brief};
use super::look::Loaded;
use super::texture::{Bank, Rule};
use super::{MAX_FACES, ReadOptions, issue};
use container::Document;
use glam::{DVec2, DVec3};
use isolux_core::scene::{AlphaMask, Face, Image, IssueKind, Material, Object, SceneInput, Severity, Texture, Wrap};
use mesh::Piece;
use nodes::Instance;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;

/// Meshes by number, as their pieces.
type Meshes<'a> = BTreeMap<usize, Vec<Piece<'a>>>;

/// Reads a GLB or glTF file that has been loaded.
pub(super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<SceneInput, ReadError> {
    let document = container::open(path, bytes)?;
    let mut scene = SceneInput { metres_per_unit: options.metres_per_unit.unwrap_or(1.0), ..SceneInput::default() };
    scene.issues = extensions::notes(&document.file, document.root());
    let walk = nodes::walk(&document, options)?;
    scene.issues.extend(walk.issues);
    scene.cameras = walk.cameras;
    scene.lamps = walk.lamps;
    if document.extra.animations > 0 {
        let message = format!("{} animations are ignored", document.extra.animations);
        scene.issues.push(issue(Severity::Note, IssueKind::Ignored, &document.file, message));
    }

    let mut meshes = open_meshes(&document, &walk.instances, &mut scene)?;
    dress(&document, options, &mut meshes, &mut scene)?;
    place(&document, &walk.instances, &meshes, &mut scene);
    Ok(scene)
}

/// Opens each mesh that is shown, once.
fn open_meshes<'a>(
    document: &'a Document<'a>,
    instances: &[Instance],
    scene: &mut SceneInput,
) -> Result<Meshes<'a>, ReadError> {
    let mut meshes = Meshes::new();
    let mut faces = 0_usize;
    for instance in instances {
        let pieces = match meshes.entry(instance.mesh) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                entry.insert(mesh::open(document, instance.mesh, &instance.object, faces, &mut scene.issues)?)
            }
        };
        pieces.iter_mut().for_each(|piece| piece.shown += 1);
        faces += pieces.iter().map(|piece| piece.triangles.len()).sum::<usize>();
        if faces > MAX_FACES {
            return Err(mesh::too_many(document, &instance.object, faces));
        }
    }
    Ok(meshes)
}

/// Gives the scene its materials, and each piece its surfaces and texture coordinates; material by material, so
/// that textures need not all be decoded at once.
fn dress(
    document: &Document<'_>,
    options: &ReadOptions,
    meshes: &mut Meshes<'_>,
    scene: &mut SceneInput,
) -> Result<(), ReadError> {
    let entries = material::all(document, options)?;
    let default = entries.len() - 1;
    let mut users: BTreeMap<usize, Vec<&mut Piece<'_>>> = BTreeMap::new();
    for piece in meshes.values_mut().flatten() {
        let material = piece.material.unwrap_or(default);
        if material >= default && piece.material.is_some() {
            let owner = format!("object '{}'", brief(&piece.object));
            return Err(nodes::reference(document, owner, "material", material, default));
        }
        users.entry(material).or_default().push(piece);
    }
    let mut bank = material::bank(document);
    let mut budget = cut::MOST_PARTS;
    let mut masks = Vec::new();
    for (index, entry) in entries.into_iter().enumerate() {
        let pieces = users.remove(&index).unwrap_or_default();
        if pieces.is_empty() && index == default {
            break;
        }
        if pieces.is_empty() {
            // Not shown: its textures are nobody's business.
            let mut look = entry.look;
            (look.base_map, look.emission_map, look.transmission_map) = (None, None, None);
            let loaded = look.load(&mut bank, |_, _, _| {});
            scene.materials.push(finish(entry.name, entry.two_sided, &loaded, None, &mut masks, &mut scene.masks));
            continue;
        }
        scene.issues.extend(entry.notes);
        let loaded = entry.look.load(&mut bank, |what, image, reason| {
            let message = format!("{what} texture '{}': {}: its factor alone counts", brief(image), brief(&reason));
            scene.issues.push(issue(Severity::Warning, IssueKind::MissingFile, &entry.name, message));
        });
        for piece in pieces {
            dress_piece(piece, &loaded, &entry.name, &mut budget, scene);
        }
        let texture = keep_texture(&loaded, &mut bank, &mut scene.images);
        let material = finish(entry.name, entry.two_sided, &loaded, texture, &mut masks, &mut scene.masks);
        scene.materials.push(material);
    }
    Ok(())
}

/// The base-colour texture for outputs, its bytes put into `images`.
fn keep_texture(loaded: &Loaded, bank: &mut Bank<'_>, images: &mut Vec<Image>) -> Option<Texture> {
    let (map, _) = loaded.base.as_ref()?;
    // It was decoded a moment ago; if it cannot be had now, outputs go without.
    let image = bank.keep(map.image, images).ok()?;
    Some(Texture { image, factor: loaded.look.base, wrap: map.wrap })
}

/// What makes two masks the same: image, cut, cutoff, repetition.
type MaskKey = (usize, Rule, f64, [Wrap; 2]);

/// A material with the surface that it has by itself; its mask, if it has one, is put into `masks` once.
fn finish(
    name: String,
    two_sided: bool,
    loaded: &Loaded,
    texture: Option<Texture>,
    keys: &mut Vec<MaskKey>,
    masks: &mut Vec<AlphaMask>,
) -> Material {
    let alpha = loaded.alpha(|map, grid| {
        let cutoff = loaded.look.texture_cutoff();
        let key = (map.image, loaded.look.base_rule(), cutoff, map.wrap);
        let index = keys.iter().position(|known| *known == key).unwrap_or_else(|| {
            keys.push(key);
            masks.push(grid.mask(cutoff, map.wrap));
            masks.len() - 1
        });
        index as u32
    });
    Material { name, surface: loaded.surface(|_| None, None), two_sided, alpha, texture }
}

/// Averages a material over the triangles of a piece, cut where their emission varies: that takes of `budget`.
fn dress_piece(piece: &mut Piece<'_>, loaded: &Loaded, material: &str, budget: &mut usize, scene: &mut SceneInput) {
    for (what, used) in
        [("base-colour", &loaded.base), ("emissive", &loaded.emission), ("transmission", &loaded.transmission)]
    {
        if let Some((map, _)) = used
            && !piece.has_coordinates(map.set)
        {
            let message = format!(
                "it has no TEXCOORD_{} for the {what} texture of '{material}': the texture's mean counts",
                map.set
            );
            scene.issues.push(issue(Severity::Warning, IssueKind::Assumed, &piece.object, message));
        }
    }
    let steps = cut::steps(piece, loaded, *budget);
    if steps > 1 {
        piece.steps = steps;
        let count = piece.triangles.len() * steps * steps;
        *budget = budget.saturating_sub(count * piece.shown);
        let message = format!(
            "{} triangles are cut into {count} faces: the emissive texture of '{material}' varies",
            piece.triangles.len()
        );
        scene.issues.push(issue(Severity::Note, IssueKind::Assumed, &piece.object, message));
    }
    if let Some((map, _)) = &loaded.base
        && piece.has_coordinates(map.set)
    {
        let uv = piece.triangles.iter().filter_map(|&triangle| {
            let uv = piece.coordinates(map.set, triangle)?;
            let parts = cut::parts(piece, triangle);
            let parts: Vec<[DVec2; 3]> = parts.iter().map(|part| cut::coordinates(uv, part)).collect();
            Some(if parts.is_empty() { vec![uv] } else { parts })
        });
        let uv = uv.flatten();
        piece.uv = Some(uv.map(|uv| uv.map(|uv| map.transform.apply(uv))).collect());
    }
    if !loaded.is_uniform() || piece.has_colours() {
        let shown = &*piece;
        let surfaces = shown.triangles.iter().flat_map(|&triangle| {
            let parts = cut::parts(shown, triangle);
            let whole = parts.is_empty().then(|| cut::surface(shown, loaded, triangle, None));
            let parts = parts.into_iter().map(move |part| cut::surface(shown, loaded, triangle, Some(&part)));
            whole.into_iter().chain(parts)
        });
        piece.surfaces = Some(surfaces.collect());
    }
}

/// Puts the faces of all instances into the scene, in file order.
fn place(document: &Document<'_>, instances: &[Instance], meshes: &Meshes<'_>, scene: &mut SceneInput) {
    let default = document.root().materials.len();
    for instance in instances {
        let object = scene.objects.len() as u32;
        scene.objects.push(Object { name: instance.object.clone() });
        // Corner 0 stays first, so that barycentric coordinates keep their first corner.
        let order = if nodes::is_mirrored(&instance.world) { [0, 2, 1] } else { [0, 1, 2] };
        for piece in meshes.get(&instance.mesh).into_iter().flatten() {
            let material = piece.material.unwrap_or(default) as u32;
            let positions = piece.triangles.iter().flat_map(|&triangle| {
                let whole = triangle.map(|corner| piece.position(corner));
                let part = move |part: [DVec3; 3]| part.map(|at| whole[0] * at.x + whole[1] * at.y + whole[2] * at.z);
                let parts = cut::parts(piece, triangle);
                parts.is_empty().then_some(whole).into_iter().chain(parts.into_iter().map(part))
            });
            for (index, corners) in positions.enumerate() {
                scene.faces.push(Face {
                    object,
                    material,
                    corners: order.map(|corner| instance.world.transform_point3(corners[corner])).to_vec(),
                    uv: piece.uv.as_ref().map(|uv| order.map(|corner| uv[index][corner]).to_vec()),
                    surface: piece.surfaces.as_ref().map(|surfaces| surfaces[index]),
                });
            }
        }
    }
}
