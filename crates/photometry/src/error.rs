//! What is wrong with a file, and what was mended in reading it: one line each, with the name of the file and the line.

use std::fmt;
use thiserror::Error;

/// Why no photometry came out.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PhotometryError {
    /// The file could not be opened or read.
    #[error("{file}: cannot be read: {reason}")]
    Io {
        /// Its name.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// The file is longer than any photometric file.
    #[error("{file}: has {bytes} bytes, more than the {limit} that are read")]
    TooLarge {
        /// Its name.
        file: String,
        /// Its length.
        bytes: u64,
        /// The most that is read.
        limit: u64,
    },
    /// Neither IES nor EULUMDAT.
    #[error("{file}: line 1: expected an IES file (with a line 'TILT=') or an EULUMDAT file, found {found}")]
    UnknownFormat {
        /// Its name.
        file: String,
        /// What it begins with.
        found: String,
    },
    /// A part of the file is not as it should be.
    #[error("{file}: line {line}: expected {expected}, found {found}")]
    Malformed {
        /// Its name.
        file: String,
        /// Number of the line, from 1.
        line: usize,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A flux that the luminaire cannot be scaled to.
    #[error("{file}: cannot be scaled to {lumens} lm: {reason}")]
    Scale {
        /// Its name.
        file: String,
        /// The flux asked for.
        lumens: f64,
        /// What is in the way.
        reason: &'static str,
    },
}

/// What was mended, assumed or left out while a file was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Name of the file.
    pub file: String,
    /// Number of the line, from 1.
    pub line: usize,
    /// What it is about, one line.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: line {}: {}", self.file, self.line, self.message)
    }
}
