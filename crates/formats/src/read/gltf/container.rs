//! The bytes of a glTF file: container and JSON go through the `gltf` crate, buffers are fetched; a [`Document`]
//! comes out.
//!
//! The crate's data model is read as it is, by index and with every index checked where it is followed. Its
//! validation and the wrappers that follow references by themselves are left out: both panic on indices past a
//! table's end (`POSITION`), and the validation refuses sound files (quantised ones; positions without `min`).

use crate::read::error::{ReadError, brief, display};
use crate::read::files;
use gltf::json::buffer::View;
use gltf::json::{Index, Root, Value};
use std::borrow::Cow;
use std::cell::Cell;
use std::path::Path;

/// First bytes of a GLB file.
pub(in crate::read) const MAGIC: &[u8] = b"glTF";
/// Bytes of the GLB header.
const HEADER: usize = 12;

/// A glTF file with its buffers.
pub(super) struct Document<'a> {
    /// The file, for messages.
    pub(super) file: String,
    /// Where URIs are relative to.
    pub(super) folder: &'a Path,
    pub(super) gltf: gltf::Document,
    pub(super) extra: Extra,
    buffers: Vec<Cow<'a, [u8]>>,
    /// Elements of sparse accessors decoded so far.
    pub(super) sparse_elements: Cell<usize>,
}

/// What the crate's data model does not tell.
pub(super) struct Extra {
    /// Number of animations: they are not parsed, so that an odd one does no harm.
    pub(super) animations: usize,
    /// Materials without `metallicFactor`, which is not the same as one of 1.
    pub(super) without_metallic: Vec<bool>,
}

/// Does the text start like JSON?
pub(in crate::read) fn looks_like_json(bytes: &[u8]) -> bool {
    without_mark(bytes).trim_ascii_start().first() == Some(&b'{')
}

/// Splits the container, parses the JSON, refuses what cannot be read, fetches the buffers.
pub(super) fn open<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<Document<'a>, ReadError> {
    let file = display(path);
    let (json, bin) = if bytes.starts_with(MAGIC) {
        let glb = split(bytes).map_err(|reason| ReadError::Malformed { file: file.clone(), format: "GLB", reason })?;
        (glb.json, glb.bin)
    } else {
        (Cow::Borrowed(bytes), None)
    };
    let malformed = |error: serde_json::Error| ReadError::Malformed {
        file: file.clone(),
        format: "glTF",
        reason: brief(&format!("JSON: {error}")),
    };
    let mut value: Value = serde_json::from_slice(without_mark(&json)).map_err(malformed)?;
    let extra = prepare(&mut value);
    let root: Root = serde_json::from_value(value).map_err(malformed)?;
    super::extensions::check_version(&file, &root)?;
    super::extensions::check_required(&file, &root)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = (0..root.buffers.len())
        .map(|index| {
            buffer(&root, index, folder, &bin).map_err(|reason| ReadError::Buffer {
                file: file.clone(),
                buffer: buffer_name(&root, index),
                reason: brief(&reason),
            })
        })
        .collect::<Result<_, _>>()?;
    let gltf = gltf::Document::from_json_without_validation(root);
    Ok(Document { file, folder, gltf, extra, buffers, sparse_elements: Cell::new(0) })
}

impl Document<'_> {
    /// The parsed JSON.
    pub(super) fn root(&self) -> &Root {
        self.gltf.as_json()
    }

    /// Bytes of all buffers: more elements than that no honest accessor has.
    pub(super) fn total_bytes(&self) -> usize {
        self.buffers.iter().map(|buffer| buffer.len()).sum()
    }

    /// Bytes of a buffer.
    pub(super) fn buffer(&self, index: usize) -> Option<&[u8]> {
        self.buffers.get(index).map(|buffer| &buffer[..])
    }

    /// A buffer view and its bytes.
    pub(super) fn view(&self, index: Index<View>) -> Result<(&View, &[u8]), String> {
        let view = found(self.root(), "buffer view", index)?;
        let buffer = self
            .buffer(view.buffer.value())
            .ok_or_else(|| out_of_range("buffer", view.buffer.value(), self.buffers.len()))?;
        let (offset, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let bytes = range(offset, length).and_then(|range| buffer.get(range)).ok_or_else(|| {
            let size = buffer.len();
            format!("buffer view {index} covers {length} bytes from {offset}, but buffer {} has {size}", view.buffer)
        })?;
        Ok((view, bytes))
    }
}

/// An entry of one of the file's tables, or the words for an index past the table's end.
pub(super) fn found<'a, T>(root: &'a Root, what: &str, index: Index<T>) -> Result<&'a T, String>
where
    Root: AsRef<[T]>,
{
    let table: &[T] = root.as_ref();
    table.get(index.value()).ok_or_else(|| out_of_range(what, index.value(), table.len()))
}

fn out_of_range(what: &str, index: usize, count: usize) -> String {
    format!("{what} {index} is out of range (there are {count})")
}

fn range(offset: u64, length: u64) -> Option<std::ops::Range<usize>> {
    let end = offset.checked_add(length)?;
    Some(usize::try_from(offset).ok()?..usize::try_from(end).ok()?)
}

/// Text without a byte order mark.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// JSON and BIN chunks of a GLB file.
fn split(bytes: &[u8]) -> Result<gltf::Glb<'_>, String> {
    use gltf::binary::Error;
    let claimed = bytes.get(8..HEADER).and_then(|length| length.try_into().ok()).map(u32::from_le_bytes);
    // The crate subtracts the header from the length before it looks.
    let Some(claimed) = claimed.map(|claimed| claimed as usize).filter(|&claimed| claimed >= HEADER) else {
        return Err(format!("truncated: {} bytes, of which the header claims less than itself", bytes.len()));
    };
    match gltf::Glb::from_slice(&bytes[..claimed.min(bytes.len())]) {
        Ok(glb) => Ok(glb),
        Err(gltf::Error::Binary(Error::Io(_))) => {
            Err("truncated: it ends within a header, or there is no JSON chunk".to_owned())
        }
        Err(gltf::Error::Binary(Error::Version(version))) => Err(format!("container version {version}, expected 2")),
        Err(gltf::Error::Binary(Error::Length { .. })) => {
            Err(format!("truncated: the header claims {claimed} bytes, the file has {}", bytes.len()))
        }
        Err(gltf::Error::Binary(Error::ChunkLength { length, length_read, .. })) => {
            Err(format!("truncated: a chunk claims {length} bytes where {length_read} are left"))
        }
        Err(gltf::Error::Binary(error)) => Err(error.to_string()),
        Err(error) => Err(format!("{error:?}")),
    }
}

/// Makes JSON ready for the crate's data model: leaves out what is not read and may be odd, fills in what the model
/// wants and glTF does not, and keeps indices of more than 32 bits, which the model would cut, out of range.
fn prepare(value: &mut Value) -> Extra {
    let animations = value["animations"].as_array().map_or(0, Vec::len);
    let materials = value["materials"].as_array().map_or(&[][..], Vec::as_slice);
    let metallic = |material: &Value| material["pbrMetallicRoughness"]["metallicFactor"].is_null();
    let without_metallic = materials.iter().map(metallic).collect();
    if let Some(root) = value.as_object_mut() {
        root.remove("animations");
        root.remove("skins");
    }
    let scenes = value.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten();
    for scene in scenes.filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    clamp_indices(value, false);
    Extra { animations, without_metallic }
}

/// Members that hold an index, or several.
const INDICES: [&str; 15] = [
    "attributes",
    "buffer",
    "bufferView",
    "camera",
    "children",
    "index",
    "indices",
    "light",
    "material",
    "mesh",
    "nodes",
    "sampler",
    "scene",
    "skin",
    "source",
];

/// Indices of more than 32 bits become the largest of 32, which no table reaches.
fn clamp_indices(value: &mut Value, is_index: bool) {
    match value {
        Value::Number(number) if is_index && number.as_u64() > Some(u64::from(u32::MAX)) => *value = u32::MAX.into(),
        Value::Array(entries) => entries.iter_mut().for_each(|entry| clamp_indices(entry, is_index)),
        Value::Object(members) => members.iter_mut().for_each(|(name, member)| {
            // The members of `attributes` are indices; those of other objects go by their own names.
            let inherits = is_index && (name.starts_with("TEXCOORD_") || name == "POSITION" || name == "COLOR_0");
            clamp_indices(member, inherits || INDICES.contains(&name.as_str()));
        }),
        _ => {}
    }
}

fn buffer_name(root: &Root, index: usize) -> String {
    let buffer = &root.buffers[index];
    let label = buffer.name.as_deref().or(buffer.uri.as_deref().filter(|uri| !uri.starts_with("data:")));
    label.map_or_else(|| format!("buffer {index}"), |label| format!("buffer {index} ('{}')", brief(label)))
}

fn buffer<'a>(root: &Root, index: usize, folder: &Path, bin: &Option<Cow<'a, [u8]>>) -> Result<Cow<'a, [u8]>, String> {
    let buffer = &root.buffers[index];
    let bytes = match (&buffer.uri, bin) {
        (Some(uri), _) => Cow::Owned(files::fetch(folder, uri)?),
        // Borrowed from the file: cloning copies nothing.
        (None, Some(bin)) if index == 0 => bin.clone(),
        // Filled by a compression extension that is optional and not read; no view of it is needed then.
        (None, _) if buffer.byte_length.0 == 0 => Cow::Borrowed(&[][..]),
        (None, _) => return Err("it has neither a URI nor the GLB's BIN chunk".to_owned()),
    };
    if (bytes.len() as u64) < buffer.byte_length.0 {
        return Err(format!("{} bytes are claimed, {} are there", buffer.byte_length.0, bytes.len()));
    }
    Ok(bytes)
}
