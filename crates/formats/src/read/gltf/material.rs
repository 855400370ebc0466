//! Materials: glTF's factors and textures come in, [`Look`]s go out, with an issue for all that is assumed.

use super::container::Document;
use super::nodes;
use crate::read::error::{ReadError, brief, clean};
use crate::read::look::{Coverage, Look, Map, UvTransform};
use crate::read::names::Names;
use crate::read::texture::Bank;
use crate::read::{ReadOptions, files, issue};
use glam::DVec2;
use gltf::json::Material;
use gltf::json::material::AlphaMode;
use gltf::json::texture::{Info, Sampler, WrappingMode};
use gltf::json::validation::Checked;
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
    let mut entries = Vec::with_capacity(document.root().materials.len() + 1);
    for (index, material) in document.root().materials.iter().enumerate() {
        let name = names.unique(material.name.as_deref(), || format!("material {index}"));
        let says_metallic = !document.extra.without_metallic.get(index).copied().unwrap_or(true);
        entries.push(entry(document, options, name, material, says_metallic)?);
    }
    let mut default =
        entry(document, options, names.unique(Some("default"), String::new), &Material::default(), false)?;
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
    says_metallic: bool,
) -> Result<Entry, ReadError> {
    let mut notes = Vec::new();
    let mut note = |severity, kind, message: &str| notes.push(issue(severity, kind, &name, message));
    let pbr = &material.pbr_metallic_roughness;
    let extensions = material.extensions.clone().unwrap_or_default();
    let (factor, texture) = match &extensions.pbr_specular_glossiness {
        Some(specular) => (specular.diffuse_factor.0, &specular.diffuse_texture),
        None => (pbr.base_color_factor.0, &pbr.base_color_texture),
    };
    let [r, g, b, alpha] = factor.map(f64::from);
    let map = |info: &Option<Info>| match info {
        Some(info) => texture_map(document, &name, info),
        None => Ok(None),
    };

    if extensions.unlit.is_some() {
        note(Severity::Note, IssueKind::Assumed, "unlit (KHR_materials_unlit): base colour is taken as reflectance");
    } else if extensions.pbr_specular_glossiness.is_none() {
        let metallic = pbr.metallic_factor.0;
        let taken = "base colour is taken as diffuse reflectance all the same";
        if !says_metallic {
            let message = format!("metallicFactor is absent, which means 1: {taken}");
            note(Severity::Note, IssueKind::Assumed, &message);
        } else if metallic > 0.0 {
            note(Severity::Warning, IssueKind::Assumed, &format!("metallicFactor is {metallic}: {taken}"));
        }
    }

    let coverage = match material.alpha_mode {
        Checked::Valid(AlphaMode::Opaque) => Coverage::Opaque,
        Checked::Valid(AlphaMode::Mask) => {
            Coverage::Mask(material.alpha_cutoff.map_or(0.5, |cutoff| f64::from(cutoff.0)))
        }
        Checked::Valid(AlphaMode::Blend) => Coverage::Blend,
        Checked::Invalid => {
            note(Severity::Warning, IssueKind::Assumed, "alphaMode is none of glTF's: taken as OPAQUE");
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
    let transmitted = transmission.map_or(0.0, |transmission| f64::from(transmission.transmission_factor.0));
    if transmitted > 0.0 {
        let message = match coverage {
            Coverage::Mask(_) => "transmission is attenuation by the mask only: a material with alphaMode MASK",
            _ => "transmission (KHR_materials_transmission) lets light pass straight through, without its tint",
        };
        note(Severity::Note, IssueKind::Assumed, message);
    }

    let strength = extensions.emissive_strength.map_or(1.0, |emissive| f64::from(emissive.emissive_strength.0));
    let emission = Rgb(material.emissive_factor.0.map(f64::from)) * (PI * strength * options.emission_scale);
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
fn texture_map(document: &Document<'_>, material: &str, info: &Info) -> Result<Option<Map>, ReadError> {
    let owner = || format!("material '{}'", brief(material));
    let texture = nodes::entry(document, owner, "texture", info.index)?;
    let others = texture.extensions.as_ref().and_then(|extensions| extensions.others.get("EXT_texture_webp"));
    let webp = others.and_then(|webp| webp["source"].as_u64()).map(|source| source as usize);
    let image = webp.unwrap_or(texture.source.value());
    // How the crate says that a texture has no source.
    if image == u32::MAX as usize {
        return Ok(None);
    }
    let images = document.root().images.len();
    if image >= images {
        return Err(nodes::reference(document, owner(), "image", image, images));
    }
    let sampler: Option<&Sampler> = match texture.sampler {
        Some(index) => Some(nodes::entry(document, owner, "sampler", index)?),
        None => None,
    };
    let wrap = |mode: Option<Checked<WrappingMode>>| match mode {
        Some(Checked::Valid(WrappingMode::ClampToEdge)) => Wrap::Clamp,
        Some(Checked::Valid(WrappingMode::MirroredRepeat)) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
    Ok(Some(Map {
        image,
        set: transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord),
        transform: transform.map_or(UvTransform::IDENTITY, |transform| {
            let scale = DVec2::from_array(transform.scale.0.map(f64::from));
            let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
            // KHR_texture_transform: translation * rotation * scale. The angle is counter-clockwise seen with v
            // downwards; the listing in the extension's text once turned the other way (KhronosGroup/glTF#1563).
            UvTransform {
                column_u: DVec2::new(cos, -sin) * scale.x,
                column_v: DVec2::new(sin, cos) * scale.y,
                offset: DVec2::from_array(transform.offset.0.map(f64::from)),
            }
        }),
        wrap: [wrap(sampler.map(|sampler| sampler.wrap_s)), wrap(sampler.map(|sampler| sampler.wrap_t))],
    }))
}

/// The images of the file, fetched when wanted.
pub(super) fn bank<'a>(document: &'a Document<'a>) -> Bank<'a> {
    let images = &document.root().images;
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
