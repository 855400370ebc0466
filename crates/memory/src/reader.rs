//! The one reader of spec files: a TOML text goes in, its figures come out key by key, or one error of one line that
//! names the file and the key; what a figure means is left to those who ask for it.

use std::path::Path;
use toml::{Table, Value};

/// Thousandths: decimal figures have at most three places.
const PARTS: f64 = 1000.0;

/// What is wrong with a spec file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SpecError {
    /// The file cannot be read.
    #[error("{file}: cannot be read: {reason}")]
    Unreadable {
        /// The file.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// The file is not TOML.
    #[error("{file}: {reason}")]
    Syntax {
        /// The file.
        file: String,
        /// What the parser says, with the line.
        reason: String,
    },
    /// A figure is not there.
    #[error("{file}: {key} is missing")]
    Missing {
        /// The file.
        file: String,
        /// The figure, with its table.
        key: String,
    },
    /// A key means nothing here.
    #[error("{file}: {key} is not a figure of a machine")]
    Unknown {
        /// The file.
        file: String,
        /// The key, with its table.
        key: String,
    },
    /// A value has the wrong type.
    #[error("{file}: {key} must be {expected}, not {found}")]
    Type {
        /// The file.
        file: String,
        /// The figure, with its table.
        key: String,
        /// The type that it must have.
        expected: &'static str,
        /// The type that it has.
        found: &'static str,
    },
    /// A figure cannot be true.
    #[error("{file}: {key} = {value}: {reason}")]
    Absurd {
        /// The file.
        file: String,
        /// The figure, with its table.
        key: String,
        /// Its value.
        value: String,
        /// What it must be.
        reason: String,
    },
}

/// The text of a file, and what errors call it.
///
/// # Errors
/// If the file cannot be read.
pub fn read(path: &Path) -> Result<(String, String), SpecError> {
    let file = path.display().to_string();
    match std::fs::read_to_string(path) {
        Ok(text) => Ok((file, text)),
        Err(error) => Err(SpecError::Unreadable { file, reason: error.to_string() }),
    }
}

/// A table of a file whose keys are taken one by one; what is left is unknown.
#[derive(Clone, Debug)]
pub struct Section<'a> {
    file: &'a str,
    path: &'static str,
    table: Table,
}

impl<'a> Section<'a> {
    /// The whole text; `file` is what errors call it.
    ///
    /// # Errors
    /// If it is not TOML.
    pub fn parse(file: &'a str, text: &str) -> Result<Self, SpecError> {
        let table = text.parse::<Table>().map_err(|error| {
            let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            SpecError::Syntax { file: file.to_owned(), reason: format!("line {line}: {}", error.message()) }
        })?;
        Ok(Self { file, path: "", table })
    }

    fn key(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// That a key is missing.
    pub fn missing(&self, key: &str) -> SpecError {
        SpecError::Missing { file: self.file.to_owned(), key: self.key(key) }
    }

    fn wrong(&self, key: &str, expected: &'static str, found: &Value) -> SpecError {
        SpecError::Type { file: self.file.to_owned(), key: self.key(key), expected, found: found.type_str() }
    }

    /// That a figure cannot be.
    pub fn absurd(&self, key: &str, value: impl ToString, reason: impl Into<String>) -> SpecError {
        let (file, value) = (self.file.to_owned(), value.to_string());
        SpecError::Absurd { file, key: self.key(key), value, reason: reason.into() }
    }

    /// Whether there is such a key, not taken yet.
    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Takes a text.
    ///
    /// # Errors
    /// If it is missing or no text.
    pub fn text(&mut self, key: &str) -> Result<String, SpecError> {
        match self.table.remove(key) {
            Some(Value::String(text)) => Ok(text),
            Some(other) => Err(self.wrong(key, "a string", &other)),
            None => Err(self.missing(key)),
        }
    }

    /// Takes a whole number.
    ///
    /// # Errors
    /// If it is missing, no whole number, or out of bounds.
    pub fn integer(&mut self, key: &str, least: i64, most: i64) -> Result<i64, SpecError> {
        match self.table.remove(key) {
            Some(Value::Integer(value)) if (least..=most).contains(&value) => Ok(value),
            Some(Value::Integer(value)) => Err(self.absurd(key, value, format!("must lie in {least} to {most}"))),
            Some(other) => Err(self.wrong(key, "an integer", &other)),
            None => Err(self.missing(key)),
        }
    }

    /// Takes a power of two.
    ///
    /// # Errors
    /// As [`Section::integer`], and if it is none.
    pub fn power_of_two(&mut self, key: &str, least: i64, most: i64) -> Result<i64, SpecError> {
        let value = self.integer(key, least, most)?;
        if value.count_ones() == 1 { Ok(value) } else { Err(self.absurd(key, value, "must be a power of two")) }
    }

    /// Takes a table.
    ///
    /// # Errors
    /// If it is none.
    pub fn section(&mut self, key: &'static str) -> Result<Option<Section<'a>>, SpecError> {
        match self.table.remove(key) {
            Some(Value::Table(table)) => Ok(Some(Section { file: self.file, path: key, table })),
            Some(other) => Err(self.wrong(key, "a table", &other)),
            None => Ok(None),
        }
    }

    /// Takes a table that must be there.
    ///
    /// # Errors
    /// If it is not, or is no table.
    pub fn required(&mut self, key: &'static str) -> Result<Section<'a>, SpecError> {
        self.section(key)?.ok_or_else(|| self.missing(key))
    }

    /// Takes all that is left as decimal numbers from 0 to `most`, in thousandths, by name.
    ///
    /// # Errors
    /// If one is no number, out of bounds, or has more than three decimals.
    pub fn decimals(self, most: u32) -> Result<Vec<(String, u64)>, SpecError> {
        let mut figures = Vec::with_capacity(self.table.len());
        for (key, value) in &self.table {
            let Some(figure) = value.as_float().or(value.as_integer().map(|i| i as f64)) else {
                return Err(self.wrong(key, "a number", value));
            };
            let parts = (figure * PARTS).round();
            // The nearest number of thousandths is off by what a decimal fraction is off in binary, a part in 10^16.
            let exact = (figure * PARTS - parts).abs() <= parts.abs() * 1e-12;
            if !exact || !(0.0..=f64::from(most) * PARTS).contains(&parts) {
                let reason = format!("must lie in 0 to {most}, with at most three decimals");
                return Err(self.absurd(key, value, reason));
            }
            figures.push((key.clone(), parts as u64));
        }
        Ok(figures)
    }

    /// Ends the table.
    ///
    /// # Errors
    /// If a key is left.
    pub fn done(self) -> Result<(), SpecError> {
        match self.table.keys().next() {
            Some(key) => Err(SpecError::Unknown { file: self.file.to_owned(), key: self.key(key) }),
            None => Ok(()),
        }
    }
}
