//! Why a file could not be written: every variant names the object, the image or the file concerned, in one line.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// A file that was not written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The mesh has no triangles at all.
    #[error("scene '{scene}' has no triangles to write")]
    Empty {
        /// Name of the scene.
        scene: String,
    },
    /// The mesh is not one of this scene: an array has the wrong length, or ranges are out of order.
    #[error("the mesh does not belong to scene '{scene}': {what} is {found}, expected {expected}")]
    Mismatch {
        /// Name of the scene.
        scene: String,
        /// Which length or index.
        what: &'static str,
        /// What is there.
        found: usize,
        /// What should be there.
        expected: usize,
    },
    /// Something names something that is not there.
    #[error("{what} {index} of '{name}' is out of range (there are {count})")]
    OutOfRange {
        /// Kind of index.
        what: &'static str,
        /// Who holds the index.
        name: String,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A value is NaN, infinite, or too large for the file's number format.
    #[error("{what} of '{name}' is {value}, which the file cannot hold")]
    NotFinite {
        /// Which value.
        what: &'static str,
        /// Object, material or camera that has it.
        name: String,
        /// The value.
        value: f64,
    },
    /// The exposure is not a positive number.
    #[error("exposure {exposure} is not a positive finite number")]
    Exposure {
        /// The value given.
        exposure: f64,
    },
    /// The white point of the tone map is not a positive number.
    #[error("white point {white} is not a positive finite number")]
    White {
        /// The value given.
        white: f64,
    },
    /// An image that the file must carry is neither PNG nor JPEG.
    #[error("image '{image}' ({mime}) is neither PNG nor JPEG by its first bytes")]
    ImageType {
        /// Name of the image.
        image: String,
        /// What it says it is.
        mime: String,
    },
    /// More data than the format can address.
    #[error("{what}: {found} is more than the {limit} that {format} can hold")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How much of it.
        found: usize,
        /// How much is possible.
        limit: usize,
        /// The format.
        format: &'static str,
    },
    /// A picture without pixels, or with as many as its sides do not say.
    #[error("a picture of {width} x {height} has {pixels} pixels")]
    PictureSize {
        /// Pixels per row.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels given.
        pixels: usize,
    },
    /// A pixel is NaN or infinite.
    #[error("pixel ({x}, {y}) is [{}, {}, {}], which no picture can hold", value[0], value[1], value[2])]
    Pixel {
        /// Column, from the left.
        x: u32,
        /// Row, from the top.
        y: u32,
        /// Its value.
        value: [f64; 3],
    },
    /// An encoder refused.
    #[error("{format} encoder: {message}")]
    Encode {
        /// The format.
        format: &'static str,
        /// What it said.
        message: String,
    },
    /// The file system refused; an earlier file under that name is as it was.
    #[error("cannot write {path:?}: {action}: {source}")]
    File {
        /// The file asked for.
        path: PathBuf,
        /// The step that failed.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
}
