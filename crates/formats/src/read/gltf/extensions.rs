//! Versions and extensions: what is required but not read is an error with a remedy, what is merely used and not
//! read is a note.

use crate::read::error::{ReadError, brief};
use crate::read::issue;
use gltf::json::Root;
use isolux_core::scene::{Issue, IssueKind, Severity};

/// Read and given meaning.
const READ: [&str; 9] = [
    super::profiles::NAME,
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// No effect on diffuse light: safely left out even when required.
const HARMLESS: [&str; 12] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_animation_pointer",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Only glTF 2.x is read.
pub(super) fn check_version(file: &str, root: &Root) -> Result<(), ReadError> {
    let version = root.asset.min_version.as_deref().unwrap_or(&root.asset.version);
    let number = root.asset.version.as_str();
    let readable = number.starts_with("2.") && root.asset.min_version.as_deref().is_none_or(|min| min == "2.0");
    if readable {
        return Ok(());
    }
    Err(ReadError::Unsupported {
        file: file.to_owned(),
        what: if number.is_empty() { "no glTF version at all".to_owned() } else { brief(&format!("glTF {version}")) },
        remedy: "save it as glTF 2.0".to_owned(),
    })
}

/// Refuses what the file cannot be understood without.
pub(super) fn check_required(file: &str, root: &Root) -> Result<(), ReadError> {
    let unread = root
        .extensions_required
        .iter()
        .find(|name| !READ.contains(&name.as_str()) && !HARMLESS.contains(&name.as_str()));
    match unread {
        None => Ok(()),
        Some(name) => Err(unsupported(file, name)),
    }
}

/// The error for an extension, with what to do about it.
pub(super) fn unsupported(file: &str, name: &str) -> ReadError {
    let remedy = match name {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "unpack it first (npx @gltf-transform/cli copy IN.glb OUT.glb), or export it without mesh compression"
        }
        "KHR_texture_basisu" | "MSFT_texture_dds" | "EXT_texture_avif" => {
            "export it again with PNG, JPEG or WebP textures"
        }
        "EXT_mesh_gpu_instancing" => "export it again with one node per instance",
        _ => "export it again without this extension",
    };
    ReadError::Unsupported { file: file.to_owned(), what: brief(name), remedy: remedy.to_owned() }
}

/// A note for each extension that is used and not read.
pub(super) fn notes(file: &str, root: &Root) -> Vec<Issue> {
    let mut unread: Vec<&str> =
        root.extensions_used.iter().map(String::as_str).filter(|name| !READ.contains(name)).collect();
    unread.sort_unstable();
    unread.dedup();
    unread
        .into_iter()
        .map(|name| {
            let why = if HARMLESS.contains(&name) { "no effect on diffuse light" } else { "not read" };
            issue(Severity::Note, IssueKind::Ignored, file, format!("extension {} is ignored: {why}", brief(name)))
        })
        .collect()
}
