//! MTL material libraries: text is mended where `tobj` would panic or give up, read by `tobj`, and comes out as the
//! text has it; what the values mean for light is `obj`'s.

use super::text::{Statement, statements};
use crate::read::error::{brief, clean};
use glam::DVec2;
use std::fmt::Write as _;

/// A material as written.
#[derive(Clone, Debug, Default)]
pub(super) struct Entry {
    pub(super) material: tobj::Material,
    /// Statements that bear on light and are not read, with the reason.
    pub(super) ignored: Vec<String>,
}

impl Entry {
    pub(super) fn opacity(&self) -> Option<f64> {
        // What `tobj` has no member for.
        let transparency = || self.material.unknown_param.get("Tr")?.parse::<f64>().ok();
        self.material.dissolve.or_else(|| transparency().map(|transparency| 1.0 - transparency))
    }

    pub(super) fn diffuse_map(&self) -> Option<TextureUse> {
        texture(self.material.diffuse_texture.as_ref()?)
    }

    pub(super) fn emission_map(&self) -> Option<TextureUse> {
        texture(self.material.unknown_param.get("map_Ke")?)
    }
}

/// A texture statement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureUse {
    pub(super) path: String,
    pub(super) scale: DVec2,
    pub(super) offset: DVec2,
    pub(super) clamp: bool,
}

/// The materials of a library, in its order. Values that make no sense are reported with the material.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Entry>, tobj::LoadError> {
    let (text, mut ignored) = mend(bytes);
    let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes())?;
    ignored.resize(materials.len(), Vec::new());
    Ok(materials.into_iter().zip(ignored).map(|(material, ignored)| Entry { material, ignored }).collect())
}

/// What is read of a library, each statement with as many numbers as `tobj` wants; and what was left out of each
/// material.
fn mend(bytes: &[u8]) -> (String, Vec<Vec<String>>) {
    let mut text = String::new();
    let mut left_out: Vec<Vec<String>> = Vec::new();
    let mut is_named = false;
    for statement in statements(bytes) {
        let (keyword, rest) = (statement.keyword.as_str(), statement.rest());
        if keyword == "newmtl" {
            let name = clean(rest);
            is_named = !name.is_empty();
            if is_named {
                left_out.push(Vec::new());
                let _ = writeln!(text, "newmtl {name}");
            }
            continue;
        }
        // Statements before the first material, and of one without a name, belong to none.
        let Some(ignored) = left_out.last_mut().filter(|_| is_named) else { continue };
        // Writing to a string cannot fail.
        let _ = match keyword {
            "Kd" | "Ke" => match colour(&statement, ignored) {
                Some([r, g, b]) => writeln!(text, "{keyword} {r} {g} {b}"),
                None => continue,
            },
            "d" | "Tr" => match number(&statement, ignored) {
                Some(value) => writeln!(text, "{keyword} {value}"),
                None => continue,
            },
            "map_Kd" | "map_Ke" if !rest.is_empty() => writeln!(text, "{keyword} {rest}"),
            "map_d" | "map_Tr" => {
                ignored.push(format!("{keyword} is ignored: cut-outs are read from glTF only"));
                continue;
            }
            _ => continue,
        };
    }
    (text, left_out)
}

/// Three numbers, or one for all three.
fn colour(statement: &Statement<'_>, ignored: &mut Vec<String>) -> Option<[f64; 3]> {
    match statement.numbers()[..] {
        [r, g, b, ..] => Some([r, g, b]),
        [grey] => Some([grey; 3]),
        _ => {
            let (keyword, rest) = (&statement.keyword, brief(statement.rest()));
            ignored.push(format!("line {}: '{keyword} {rest}' is ignored: not a colour", statement.line));
            None
        }
    }
}

/// A number, after `-halo` perhaps.
fn number(statement: &Statement<'_>, ignored: &mut Vec<String>) -> Option<f64> {
    let value = statement.words().find(|&word| word != "-halo").and_then(|word| word.parse().ok());
    if value.is_none() {
        let (keyword, rest) = (&statement.keyword, brief(statement.rest()));
        ignored.push(format!("line {}: '{keyword} {rest}' is ignored: not a number", statement.line));
    }
    value
}

/// Options and file name; the name is what is left, blanks included.
fn texture(mut rest: &str) -> Option<TextureUse> {
    let (mut scale, mut offset, mut clamp) = (DVec2::ONE, DVec2::ZERO, false);
    while let Some(option) = word(rest).filter(|word| word.starts_with('-')) {
        rest = rest[option.len()..].trim_start();
        let mut arguments = Vec::new();
        let (most, numeric) = match option {
            "-s" | "-o" | "-t" => (3, true),
            "-mm" => (2, true),
            "-bm" | "-boost" | "-texres" => (1, true),
            "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-type" => (1, false),
            // No option at all: a file whose name starts with a dash.
            _ => {
                rest = option;
                break;
            }
        };
        while arguments.len() < most
            && let Some(argument) = word(rest).filter(|word| !numeric || word.parse::<f64>().is_ok())
        {
            arguments.push(argument);
            rest = rest[argument.len()..].trim_start();
        }
        let value = |place: usize| arguments.get(place).and_then(|argument| argument.parse::<f64>().ok());
        match option {
            "-s" => scale = DVec2::new(value(0).unwrap_or(1.0), value(1).unwrap_or(1.0)),
            "-o" => offset = DVec2::new(value(0).unwrap_or(0.0), value(1).unwrap_or(0.0)),
            "-clamp" => clamp = arguments.first() == Some(&"on"),
            _ => {}
        }
    }
    (!rest.is_empty()).then(|| TextureUse { path: rest.to_owned(), scale, offset, clamp })
}

fn word(text: &str) -> Option<&str> {
    text.split_whitespace().next()
}

#[cfg(test)]
mod tests {
    use super::{parse, texture};
    use glam::DVec2;

    /// Catches options taken for the file name, or a name with blanks cut short.
    #[test]
    fn texture_options_are_told_from_the_name() {
        let plain = texture("old wood.png").unwrap();
        assert_eq!((plain.path.as_str(), plain.scale, plain.clamp), ("old wood.png", DVec2::ONE, false));
        let scaled = texture("-clamp on -s 2 3 1 -bm 0.5 -o 0.25 tex\\wood.png").unwrap();
        assert_eq!(scaled.path, "tex\\wood.png");
        assert_eq!((scaled.scale, scaled.offset, scaled.clamp), (DVec2::new(2.0, 3.0), DVec2::new(0.25, 0.0), true));
        assert_eq!(texture(""), None);
    }

    /// Catches a short or spectral colour that panics, or is taken for black.
    #[test]
    fn odd_colours_are_named() {
        let entries =
            parse(b"Kd 1\nnewmtl a b\nKd 0.5\nKe spectral x.rfl\nd -halo 0.25\nTr x\nnewmtl\nKd 1\n").unwrap();
        assert_eq!(entries.len(), 1);
        let material = &entries[0].material;
        assert_eq!((material.name.as_str(), material.diffuse), ("a b", Some([0.5; 3])));
        assert_eq!((material.emissive, material.dissolve), (None, Some(0.25)));
        assert!(entries[0].ignored[0].contains("line 4: 'Ke spectral x.rfl'"));
        assert!(entries[0].ignored[1].contains("line 6"));
    }
}
