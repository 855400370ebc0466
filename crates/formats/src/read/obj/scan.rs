//! A first look at an OBJ file: bytes come in, a text that `tobj` reads without panicking or guessing goes out, and
//! what `tobj` does not tell. What cannot be mended is an error with its line, or with its object and face.
//!
//! Left out: polylines and faces of fewer than three corners (`tobj` makes polygons of them), normals, weights and
//! colours of vertices, names that are empty. Mended: indices become positive, blanks single, lines whole.

use super::text::{Statement, statements};
use crate::read::MAX_FACES;
use crate::read::error::{ReadError, brief, clean};
use std::collections::HashMap;
use std::fmt::Write as _;

/// An OBJ file after the first look.
#[derive(Default)]
pub(super) struct Scan {
    /// What `tobj` reads.
    pub(super) text: String,
    /// Names of the materials that it asks for, in order of first use.
    pub(super) materials: Vec<String>,
    /// Material libraries, as written.
    pub(super) libraries: Vec<String>,
    /// For each face: does every corner have texture coordinates?
    pub(super) has_coordinates: Vec<bool>,
    /// Points, lines, and faces that are neither.
    pub(super) lines: usize,
    pub(super) vertex_colours: bool,
    positions: usize,
    coordinates: usize,
    /// Faces of each object so far.
    faces: HashMap<String, usize>,
    total: usize,
    object: String,
}

/// Looks a file through; `object` is the name of what comes before the first group.
pub(super) fn scan(file: &str, bytes: &[u8], object: &str) -> Result<Scan, ReadError> {
    let mut scan = Scan { object: object.to_owned(), ..Scan::default() };
    // One library that holds every material: which one defines a name is found out later.
    let _ = writeln!(scan.text, "mtllib all\no {object}");
    for statement in statements(bytes) {
        scan.statement(file, &statement)?;
    }
    Ok(scan)
}

impl Scan {
    fn statement(&mut self, file: &str, statement: &Statement<'_>) -> Result<(), ReadError> {
        let syntax = |reason: &str| {
            Err(ReadError::Syntax { file: file.to_owned(), line: statement.line, reason: reason.to_owned() })
        };
        let text = &mut self.text;
        // Writing to a string cannot fail.
        let _ = match statement.keyword.as_str() {
            "v" => match statement.numbers()[..] {
                [x, y, z, ref more @ ..] => {
                    self.positions += 1;
                    self.vertex_colours |= more.len() >= 3;
                    writeln!(text, "v {x} {y} {z}")
                }
                _ => return syntax("a vertex needs three numbers"),
            },
            "vt" => {
                let numbers = statement.numbers();
                let Some(u) = numbers.first() else { return syntax("a texture coordinate needs a number") };
                self.coordinates += 1;
                writeln!(text, "vt {u} {}", numbers.get(1).unwrap_or(&0.0))
            }
            "f" => return self.face(file, statement),
            "l" | "p" => {
                self.lines += 1;
                Ok(())
            }
            "o" | "g" => {
                let name = clean(statement.rest());
                if name.is_empty() {
                    return Ok(());
                }
                self.object = name;
                writeln!(text, "o {}", self.object)
            }
            "usemtl" => {
                let name = clean(statement.rest());
                if name.is_empty() {
                    return syntax("usemtl needs the name of a material");
                }
                let written = writeln!(text, "usemtl {name}");
                self.materials.push(name);
                written
            }
            "mtllib" => {
                self.libraries.push(statement.rest().to_owned());
                Ok(())
            }
            _ => Ok(()),
        };
        Ok(())
    }

    fn face(&mut self, file: &str, statement: &Statement<'_>) -> Result<(), ReadError> {
        let number = self.faces.get(&self.object).copied().unwrap_or(0);
        let resolve = |text: &str, what: &'static str, count: usize| {
            let index: i64 = text.parse().map_err(|_| ReadError::Syntax {
                file: file.to_owned(),
                line: statement.line,
                reason: format!("'{}' is not the number of a {what}", brief(text)),
            })?;
            // From 1, or back from the last.
            let resolved = if index < 0 { index.checked_add(count as i64 + 1) } else { Some(index) };
            resolved.filter(|&resolved| resolved >= 1 && resolved <= count as i64).ok_or_else(|| ReadError::Index {
                file: file.to_owned(),
                object: brief(&self.object),
                face: number,
                what,
                index,
                count,
            })
        };
        let (mut line, mut corners, mut has_coordinates) = ("f".to_owned(), 0_usize, true);
        for word in statement.words() {
            let mut parts = word.split('/');
            let position = resolve(parts.next().unwrap_or_default(), "vertex", self.positions)?;
            let _ = write!(line, " {position}");
            match parts.next().filter(|part| !part.is_empty()) {
                Some(part) => {
                    let _ = write!(line, "/{}", resolve(part, "texture coordinate", self.coordinates)?);
                }
                None => has_coordinates = false,
            }
            corners += 1;
        }
        if corners < 3 {
            self.lines += 1;
            return Ok(());
        }
        // Quadrilaterals stay whole, larger polygons become triangles.
        let count = if corners == 4 { 1 } else { corners - 2 };
        self.total += count;
        if self.total > MAX_FACES {
            return Err(ReadError::TooLarge {
                file: file.to_owned(),
                object: brief(&self.object),
                what: "faces",
                count: self.total,
                limit: MAX_FACES,
            });
        }
        match self.faces.get_mut(&self.object) {
            Some(faces) => *faces += count,
            None => drop(self.faces.insert(self.object.clone(), count)),
        }
        self.has_coordinates.push(has_coordinates);
        self.text.push_str(&line);
        self.text.push('\n');
        Ok(())
    }
}
