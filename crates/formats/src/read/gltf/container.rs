//! The bytes of a glTF file: GLB chunks, JSON, buffers; a [`Document`] comes out, whose ranges are all checked.

use super::schema::{BufferView, Root};
use crate::read::error::{ReadError, brief, display};
use crate::read::files;
use std::borrow::Cow;
use std::path::Path;

/// First bytes of a GLB file.
pub(in crate::read) const MAGIC: &[u8] = b"glTF";
/// Bytes of the GLB header, and of each chunk's.
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;
const JSON: &[u8] = b"JSON";
const BIN: &[u8] = b"BIN\0";

/// A glTF file with its buffers.
pub(super) struct Document<'a> {
    /// The file, for messages.
    pub(super) file: String,
    /// Where URIs are relative to.
    pub(super) folder: &'a Path,
    pub(super) root: Root,
    buffers: Vec<Cow<'a, [u8]>>,
}

/// Does the text start like JSON?
pub(in crate::read) fn looks_like_json(bytes: &[u8]) -> bool {
    without_mark(bytes).trim_ascii_start().first() == Some(&b'{')
}

/// Splits the container, parses the JSON, refuses what cannot be read, fetches the buffers.
pub(super) fn open<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<Document<'a>, ReadError> {
    let file = display(path);
    let (json, bin) = if bytes.starts_with(MAGIC) {
        split(bytes).map_err(|reason| ReadError::Malformed { file: file.clone(), format: "GLB", reason })?
    } else {
        (bytes, None)
    };
    let root: Root = serde_json::from_slice(without_mark(json)).map_err(|error| ReadError::Malformed {
        file: file.clone(),
        format: "glTF",
        reason: brief(&format!("JSON: {error}")),
    })?;
    super::extensions::check_version(&file, &root)?;
    super::extensions::check_required(&file, &root)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = (0..root.buffers.len())
        .map(|index| {
            buffer(&root, index, folder, bin).map_err(|reason| ReadError::Buffer {
                file: file.clone(),
                buffer: buffer_name(&root, index),
                reason: brief(&reason),
            })
        })
        .collect::<Result<_, _>>()?;
    Ok(Document { file, folder, root, buffers })
}

impl Document<'_> {
    /// Bytes of all buffers: more elements than that no honest accessor has.
    pub(super) fn total_bytes(&self) -> usize {
        self.buffers.iter().map(|buffer| buffer.len()).sum()
    }

    /// A buffer view and its bytes.
    pub(super) fn view(&self, index: usize) -> Result<(&BufferView, &[u8]), String> {
        let views = &self.root.buffer_views;
        let view = views.get(index).ok_or_else(|| out_of_range("buffer view", index, views.len()))?;
        let buffer =
            self.buffers.get(view.buffer).ok_or_else(|| out_of_range("buffer", view.buffer, self.buffers.len()))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| buffer.get(view.byte_offset..end)).ok_or_else(|| {
            format!(
                "buffer view {index} covers {} bytes from {}, but buffer {} has {}",
                view.byte_length,
                view.byte_offset,
                view.buffer,
                buffer.len()
            )
        })?;
        Ok((view, bytes))
    }
}

/// The words for an index past a table's end.
pub(super) fn out_of_range(what: &str, index: usize, count: usize) -> String {
    format!("{what} {index} is out of range (there are {count})")
}

/// Text without a byte order mark.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// JSON and BIN chunks of a GLB file.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let header = bytes.get(..HEADER).ok_or_else(|| format!("truncated: {} bytes are no header", bytes.len()))?;
    let version = word(&header[4..]);
    if version != 2 {
        return Err(format!("container version {version}, expected 2"));
    }
    let length = word(&header[8..]) as usize;
    let mut rest = bytes
        .get(HEADER..length)
        .ok_or_else(|| format!("truncated: the header claims {length} bytes, the file has {}", bytes.len()))?;
    let (mut json, mut bin) = (None, None);
    while rest.len() >= CHUNK_HEADER {
        let (header, after) = rest.split_at(CHUNK_HEADER);
        let length = word(header) as usize;
        let kind = &header[4..];
        let chunk = after
            .get(..length)
            .ok_or_else(|| format!("truncated: a chunk claims {length} bytes where {} are left", after.len()))?;
        if json.is_none() {
            if kind != JSON {
                return Err("the first chunk is not JSON".to_owned());
            }
            json = Some(chunk);
        } else if bin.is_none() && kind == BIN {
            bin = Some(chunk);
        }
        // Chunks of other kinds are to be skipped (glTF 2.0, 4.4.3).
        rest = &after[length..];
    }
    Ok((json.ok_or("there is no JSON chunk")?, bin))
}

/// Little-endian word at the start of at least four bytes.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |word, &byte| word << 8 | u32::from(byte))
}

fn buffer_name(root: &Root, index: usize) -> String {
    let buffer = &root.buffers[index];
    let label = buffer.name.as_deref().or(buffer.uri.as_deref().filter(|uri| !uri.starts_with("data:")));
    label.map_or_else(|| format!("buffer {index}"), |label| format!("buffer {index} ('{}')", brief(label)))
}

fn buffer<'a>(root: &Root, index: usize, folder: &Path, bin: Option<&'a [u8]>) -> Result<Cow<'a, [u8]>, String> {
    let buffer = &root.buffers[index];
    let bytes = match (&buffer.uri, bin) {
        (Some(uri), _) => Cow::Owned(files::fetch(folder, uri)?),
        (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
        // Filled by a compression extension that is optional and not read; no view of it is needed then.
        (None, _) if buffer.byte_length == 0 => Cow::Borrowed(&[][..]),
        (None, _) => return Err("it has neither a URI nor the GLB's BIN chunk".to_owned()),
    };
    if bytes.len() < buffer.byte_length {
        return Err(format!("{} bytes are claimed, {} are there", buffer.byte_length, bytes.len()));
    }
    Ok(bytes)
}
