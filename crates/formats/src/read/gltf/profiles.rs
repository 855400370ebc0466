//! Light profiles of `EXT_lights_ies`: what a node says of one becomes a lamp with a measured distribution; each file
//! is read once, and only if a node names it.

use super::container::Document;
use super::nodes::{self, Place};
use crate::read::error::{ReadError, brief, clean};
use crate::read::{files, luminaire};
use gltf::json::{Index, Value};
use isolux_core::scene::{Issue, Lamp, LampShape};
use isolux_core::units::{Rgb, Unit};
use isolux_photometry::{Photometry, parse};
use std::collections::BTreeMap;
use std::rc::Rc;

/// Name of the extension.
pub(super) const NAME: &str = "EXT_lights_ies";

/// Most values that the tables of all lamps may hold, 128 MiB: five hundred luminaires with an angle for every degree
/// of half a sphere. A few kilobytes of nodes that all name one profile can ask for any number.
const MAX_VALUES: usize = 1 << 24;

/// The profiles of a file, as far as they were read, and how much the lamps made of them hold.
#[derive(Default)]
pub(super) struct Profiles {
    read: BTreeMap<usize, Rc<Photometry>>,
    values: usize,
}

impl Profiles {
    /// Name of the profile that a node's extension names, if it has one.
    pub(super) fn label<'a>(document: &'a Document<'_>, extension: &Value) -> Option<&'a str> {
        let index = usize::try_from(extension["light"].as_u64()?).ok()?;
        profiles(document).get(index)?["name"].as_str()
    }

    /// The lamp that a node's extension makes, and what is to be said of it: of each profile once.
    pub(super) fn lamp(
        &mut self,
        document: &Document<'_>,
        extension: &Value,
        owner: impl FnOnce() -> String,
        (name, place): (String, Place),
        unit: Unit,
    ) -> Result<(Lamp, Vec<Issue>), ReadError> {
        let wrong = |reason: String| ReadError::Lamp {
            file: document.file.clone(),
            lamp: brief(&name),
            reason: brief(&reason),
        };
        let light = extension["light"].as_u64().ok_or_else(|| wrong(format!("{NAME} names no light")))?;
        let (index, count) = (usize::try_from(light).unwrap_or(usize::MAX), profiles(document).len());
        if index >= count {
            return Err(nodes::reference(document, owner(), "light profile", index, count));
        }
        let multiplier = number(&extension["multiplier"], 1.0)
            .ok_or_else(|| wrong(format!("{NAME}: multiplier is no number: {}", extension["multiplier"])))?;
        let color = color(&extension["color"])
            .ok_or_else(|| wrong(format!("{NAME}: color is not three numbers: {}", extension["color"])))?;
        let (luminaire, is_new) = match self.read.get(&index) {
            Some(known) => (Rc::clone(known), false),
            None => {
                let luminaire = Rc::new(open(document, index).map_err(&wrong)?);
                self.read.insert(index, Rc::clone(&luminaire));
                (luminaire, true)
            }
        };
        let web = luminaire::web(&luminaire, place.mirrored);
        self.values += web.intensity.len();
        if self.values > MAX_VALUES {
            let (count, limit, what) = (self.values, MAX_VALUES, "values of light profiles");
            return Err(ReadError::TooLarge { file: document.file.clone(), object: brief(&name), what, count, limit });
        }
        let issues = if is_new { luminaire::issues(&luminaire, &name, unit) } else { Vec::new() };
        let Place { position, forward, side, .. } = place;
        let intensity = Rgb(color) * multiplier;
        Ok((Lamp { name, position, forward, side, intensity, shape: LampShape::Web(web) }, issues))
    }
}

/// The profiles that a file lists.
fn profiles<'a>(document: &'a Document<'_>) -> &'a [Value] {
    let extension = document.root().extensions.as_ref().and_then(|extensions| extensions.others.get(NAME));
    extension.and_then(|extension| extension["lights"].as_array()).map_or(&[], Vec::as_slice)
}

/// Reads a profile; the reason in one line where it cannot be had, with the name of the file it is in and the line.
fn open(document: &Document<'_>, index: usize) -> Result<Photometry, String> {
    let profile = &profiles(document)[index];
    let label = profile["name"].as_str().map(clean).filter(|name| !name.is_empty());
    let label = label.map_or_else(|| format!("light profile {index}"), |name| format!("light profile '{name}'"));
    let (file, bytes) = match (profile["uri"].as_str(), profile["bufferView"].as_u64()) {
        (Some(uri), _) => {
            let is_embedded = uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"));
            let file = if is_embedded { label } else { clean(uri) };
            let bytes = files::fetch(document.folder, uri).map_err(|reason| format!("{file}: {reason}"))?;
            (file, bytes)
        }
        (None, Some(view)) => {
            let view = Index::new(u32::try_from(view).unwrap_or(u32::MAX));
            let bytes = document.view(view).map_err(|reason| format!("{label}: {reason}"))?.1.to_vec();
            (label, bytes)
        }
        (None, None) => return Err(format!("{label}: it has neither a URI nor a buffer view")),
    };
    parse(&bytes, &file).map_err(|error| error.to_string())
}

/// A number, or what stands for none.
fn number(value: &Value, default: f64) -> Option<f64> {
    if value.is_null() { Some(default) } else { value.as_f64() }
}

/// A colour, each band within [0, 1]; white where there is none.
fn color(value: &Value) -> Option<[f64; 3]> {
    if value.is_null() {
        return Some([1.0; 3]);
    }
    let bands: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    Some(<[f64; 3]>::try_from(bands).ok()?.map(|band| band.clamp(0.0, 1.0)))
}
