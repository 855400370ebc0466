//! Why a scene file cannot be read: one line each, naming the file and what in it is at fault.

use std::path::Path;
use thiserror::Error;

/// Why a scene file cannot be read. Every message is one line: names from files are stripped of control characters
/// before they get in here.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReadError {
    /// The file cannot be opened or read, or is a directory.
    #[error("{file}: cannot be read: {reason}")]
    Io {
        /// The file.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// Neither content nor extension is one that is read here.
    #[error(
        "{file}: unknown format ({found}): .glb, .gltf and .obj are read natively, other formats through the Python \
         extra `meshes` (pip install \"isolux[meshes]\")"
    )]
    UnknownFormat {
        /// The file.
        file: String,
        /// The extension found, or `no extension`.
        found: String,
    },
    /// The container or the JSON is broken.
    #[error("{file}: not a valid {format} file: {reason}")]
    Malformed {
        /// The file.
        file: String,
        /// `GLB`, `glTF`, `OBJ`.
        format: &'static str,
        /// What is wrong, where.
        reason: String,
    },
    /// The file requires something that is not implemented.
    #[error("{file}: requires {what}, which isolux does not read: {remedy}")]
    Unsupported {
        /// The file.
        file: String,
        /// A glTF extension or version.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// The bytes of a buffer cannot be had.
    #[error("{file}: {buffer}: {reason}")]
    Buffer {
        /// The file.
        file: String,
        /// `buffer 0`, with its name or URI where it has one.
        buffer: String,
        /// What is wrong.
        reason: String,
    },
    /// The data of an object do not lie where the file says.
    #[error("{file}: object '{object}': {what}: {reason}")]
    Accessor {
        /// The file.
        file: String,
        /// Name of the object that needs the data.
        object: String,
        /// Which data: `POSITION (accessor 3)`.
        what: String,
        /// What is wrong.
        reason: String,
    },
    /// A face names a vertex that is not there.
    #[error("{file}: object '{object}': face {face}: {what} {index} is out of range (there are {count})")]
    Index {
        /// The file.
        file: String,
        /// Name of the object.
        object: String,
        /// Number of the face within the object, from 0.
        face: usize,
        /// `vertex`, `texture coordinate`.
        what: &'static str,
        /// The index, as the file gives it.
        index: i64,
        /// How many there are.
        count: usize,
    },
    /// Something names an entry of a table that is not there.
    #[error("{file}: {owner} names {what} {index}, but there are {count}")]
    Reference {
        /// The file.
        file: String,
        /// Who names it: `node 'lamp'`.
        owner: String,
        /// Kind of entry.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A lamp cannot be made: its light profile is missing or broken.
    #[error("{file}: lamp '{lamp}': {reason}")]
    Lamp {
        /// The file.
        file: String,
        /// Name of the lamp.
        lamp: String,
        /// What is wrong, with the name of the profile's file and the line.
        reason: String,
    },
    /// A line of a text file makes no sense.
    #[error("{file}: line {line}: {reason}")]
    Syntax {
        /// The file.
        file: String,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// More than a scene can hold.
    #[error("{file}: object '{object}': {count} {what} are more than the {limit} that are read")]
    TooLarge {
        /// The file.
        file: String,
        /// Name of the object at which the limit was passed.
        object: String,
        /// What there is too much of.
        what: &'static str,
        /// How many.
        count: usize,
        /// The limit.
        limit: usize,
    },
}

/// A name from a file as it may stand in a scene: control characters and line breaks of any kind become `\u{fffd}`,
/// blanks at both ends go.
pub(super) fn clean(name: &str) -> String {
    name.trim().chars().map(|c| if is_breaking(c) { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// Like [`clean`], and no longer than a line of a message bears.
pub(super) fn brief(text: &str) -> String {
    // Long enough for a path or an object name, short enough for a terminal line or two.
    const LIMIT: usize = 120;
    let text = clean(text);
    if text.chars().count() <= LIMIT { text } else { text.chars().take(LIMIT).chain(['…']).collect() }
}

/// A path for messages; the whole of it, since people look for it.
pub(super) fn display(path: &Path) -> String {
    clean(&path.display().to_string())
}

/// Control characters, and the two separators that Unicode adds to them.
fn is_breaking(c: char) -> bool {
    c.is_control() || c == '\u{2028}' || c == '\u{2029}'
}
