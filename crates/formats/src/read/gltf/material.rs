//! Materials: glTF's factors and textures come in, [`Look`]s go out, with an issue for all that is assumed.

use super::container::Document;
use super::nodes::reference;
use super::schema::{Material, TextureInfo};
use crate::read::error::{ReadError, brief, clean};
use crate::read::look::{Coverage, Look, Map, UvTransform};
use crate::read::names::Names;
use crate::read::texture::Bank;
use crate::read::{ReadOptions, files, issue};
use glam::DVec2;
use isolux_core::scene::{Issue, IssueKind, Severity, Wrap};
use isolux_core::units::Rgb;
use std::f64::consts::PI;

/// A material as glTF has it, ready to be loaded.
pub(super) struct Entry {
    /// Unique name.
    pub(super) name: String,
    pub(super) look: Look,
    pub(super) two_sided: bool,
    /// What is assumed of it, to be said if a face uses it.
    pub(super) notes: Vec<Issue>,
}

/// All materials of the file, in its order, and glTF's default one last.
pub(super) fn all(document: &Document<'_>, options: &ReadOptions) -> Result<Vec<Entry>, ReadError> {
    let mut names = Names::default();
    let mut entries = Vec::with_capacity(document.root.materials.len() + 1);
    for (index, material) in document.root.materials.iter().enumerate() {
        let name = names.unique(material.name.as_deref(), || format!("material {index}"));
        entries.push(entry(document, options, name, material)?);
    }
    let mut default = entry(document, options, names.unique(Some("default"), String::new), &Material::default())?;
    let message = "faces without a material get glTF's default one: white, metallic taken as diffuse reflectance 1";
    default.notes = vec![issue(Severity::Warning, IssueKind::Assumed, &default.name, message)];
    entries.push(default);
    Ok(entries)
}

fn entry(
    document: &Document<'_>,
    options: &ReadOptions,
    name: String,
    material: &Material,
) -> Result<Entry, ReadError> {
    let mut notes = Vec::new();
    let mut note = |severity, kind, message: &str| notes.push(issue(severity, kind, &name, message));
    let pbr = &material.pbr_metallic_roughness;
    let extensions = &material.extensions;
    let (factor, texture) = match &extensions.specular_glossiness {
        Some(specular) => (specular.diffuse_factor, &specular.diffuse_texture),
        None => (pbr.base_color_factor, &pbr.base_color_texture),
    };
    let [r, g, b, alpha] = factor.unwrap_or([1.0; 4]);
    let map = |info: &Option<TextureInfo>| match info {
        Some(info) => texture_map(document, &name, info),
        None => Ok(None),
    };

    if extensions.unlit.is_some() {
        note(Severity::Note, IssueKind::Assumed, "unlit (KHR_materials_unlit): base colour is taken as reflectance");
    } else if extensions.specular_glossiness.is_none() {
        match pbr.metallic_factor {
            None => note(
                Severity::Note,
                IssueKind::Assumed,
                "metallicFactor is absent, which means 1: base colour is taken as diffuse reflectance all the same",
            ),
            Some(metallic) if metallic > 0.0 => note(
                Severity::Warning,
                IssueKind::Assumed,
                &format!("metallicFactor is {metallic}: base colour is taken as diffuse reflectance all the same"),
            ),
            Some(_) => {}
        }
    }

    let coverage = match material.alpha_mode.as_deref() {
        None | Some("OPAQUE") => Coverage::Opaque,
        Some("MASK") => Coverage::Mask(material.alpha_cutoff.unwrap_or(0.5)),
        Some("BLEND") => Coverage::Blend,
        Some(other) => {
            let message = format!("alphaMode {} is unknown: taken as OPAQUE", brief(other));
            note(Severity::Warning, IssueKind::Assumed, &message);
            Coverage::Opaque
        }
    };
    if let (Coverage::Mask(cutoff), None) = (coverage, texture)
        && alpha < cutoff
    {
        let message = format!("alpha {alpha} is below alphaCutoff {cutoff} everywhere: nothing of it is there");
        note(Severity::Warning, IssueKind::Assumed, &message);
    }
    let transmission = extensions.transmission.as_ref();
    let transmitted = transmission.map_or(0.0, |transmission| transmission.transmission_factor);
    if transmitted > 0.0 {
        let message = match coverage {
            Coverage::Mask(_) => "transmission is attenuation by the mask only: a material with alphaMode MASK",
            _ => "transmission (KHR_materials_transmission) lets light pass straight through, without its tint",
        };
        note(Severity::Note, IssueKind::Assumed, message);
    }

    let strength = extensions.emissive_strength.as_ref().and_then(|emissive| emissive.emissive_strength).unwrap_or(1.0);
    let emission = Rgb(material.emissive_factor.unwrap_or([0.0; 3])) * (PI * strength * options.emission_scale);
    let look = Look {
        base: Rgb([r, g, b]),
        alpha,
        base_map: map(texture)?,
        coverage,
        emission,
        emission_map: if emission == Rgb::ZERO { None } else { map(&material.emissive_texture)? },
        transmission: transmitted.clamp(0.0, 1.0),
        transmission_map: match transmission {
            Some(transmission) if transmitted > 0.0 => map(&transmission.transmission_texture)?,
            _ => None,
        },
    };
    Ok(Entry { name, look, two_sided: material.double_sided, notes })
}

/// Where a texture reference leads; `None` where the texture has no image that is read.
fn texture_map(document: &Document<'_>, material: &str, info: &TextureInfo) -> Result<Option<Map>, ReadError> {
    let root = &document.root;
    let owner = || format!("material '{}'", brief(material));
    let texture = root
        .textures
        .get(info.index)
        .ok_or_else(|| reference(document, owner(), "texture", info.index, root.textures.len()))?;
    let webp = texture.extensions.webp.as_ref().and_then(|webp| webp.source);
    let Some(image) = webp.or(texture.source) else { return Ok(None) };
    if image >= root.images.len() {
        return Err(reference(document, owner(), "image", image, root.images.len()));
    }
    let sampler = match texture.sampler {
        Some(index) => Some(
            root.samplers
                .get(index)
                .ok_or_else(|| reference(document, owner(), "sampler", index, root.samplers.len()))?,
        ),
        None => None,
    };
    let wrap = |mode: Option<u64>| match mode {
        Some(33_071) => Wrap::Clamp,
        Some(33_648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    let transform = info.extensions.transform.as_ref();
    Ok(Some(Map {
        image,
        set: transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord),
        transform: transform.map_or(UvTransform::IDENTITY, |transform| {
            let scale = DVec2::from_array(transform.scale.unwrap_or([1.0; 2]));
            let (sin, cos) = transform.rotation.unwrap_or(0.0).sin_cos();
            // KHR_texture_transform: translation * rotation * scale. The angle is counter-clockwise seen with v
            // downwards; the listing in the extension's text once turned the other way (KhronosGroup/glTF#1563).
            UvTransform {
                column_u: DVec2::new(cos, -sin) * scale.x,
                column_v: DVec2::new(sin, cos) * scale.y,
                offset: DVec2::from_array(transform.offset.unwrap_or([0.0; 2])),
            }
        }),
        wrap: [wrap(sampler.and_then(|sampler| sampler.wrap_s)), wrap(sampler.and_then(|sampler| sampler.wrap_t))],
    }))
}

/// The images of the file, fetched when wanted.
pub(super) fn bank<'a>(document: &'a Document<'a>) -> Bank<'a> {
    let images = &document.root.images;
    let names = images.iter().enumerate().map(|(index, image)| {
        let file = image.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
        let label = file.or(image.name.as_deref()).map(clean).filter(|name| !name.is_empty());
        label.unwrap_or_else(|| format!("image {index}"))
    });
    Bank::new(
        names.collect(),
        Box::new(move |index| {
            let image = &images[index];
            match (&image.uri, image.buffer_view) {
                (_, Some(view)) => Ok(document.view(view)?.1.to_vec()),
                (Some(uri), None) => files::fetch(document.folder, uri),
                (None, None) => Err("it has neither a URI nor a buffer view".to_owned()),
            }
        }),
    )
}
