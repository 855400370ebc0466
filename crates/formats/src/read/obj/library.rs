//! MTL material libraries: text comes in, materials as the text has them go out; what their values mean for light
//! is `obj`'s.

use super::text::{Statement, statements};
use crate::read::error::{brief, clean};
use glam::DVec2;

/// A material as written; `None` where the text is silent.
#[derive(Clone, Debug, Default)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) diffuse: Option<[f64; 3]>,
    pub(super) emission: Option<[f64; 3]>,
    pub(super) dissolve: Option<f64>,
    pub(super) transparency: Option<f64>,
    pub(super) diffuse_map: Option<TextureUse>,
    pub(super) emission_map: Option<TextureUse>,
    /// Statements that bear on light and are not read, with the reason.
    pub(super) ignored: Vec<String>,
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
pub(super) fn parse(bytes: &[u8]) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for statement in statements(bytes) {
        if statement.keyword == "newmtl" {
            entries.push(Entry { name: clean(statement.rest()), ..Entry::default() });
            continue;
        }
        // Statements before the first material belong to none.
        let Some(entry) = entries.last_mut() else { continue };
        match statement.keyword.as_str() {
            "Kd" => entry.diffuse = colour(&statement, &mut entry.ignored),
            "Ke" => entry.emission = colour(&statement, &mut entry.ignored),
            "d" => entry.dissolve = number(&statement, &mut entry.ignored),
            "Tr" => entry.transparency = number(&statement, &mut entry.ignored),
            "map_Kd" => entry.diffuse_map = texture(statement.rest()),
            "map_Ke" => entry.emission_map = texture(statement.rest()),
            "map_d" | "map_Tr" => {
                entry.ignored.push(format!("{} is ignored: cut-outs are read from glTF only", statement.keyword));
            }
            _ => {}
        }
    }
    entries
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
        let entries = parse(b"Kd 1 1 1\nnewmtl a b\nKd 0.5\nKe spectral x.rfl\nd -halo 0.25\nTr x\n");
        assert_eq!(entries.len(), 1);
        assert_eq!((entries[0].name.as_str(), entries[0].diffuse), ("a b", Some([0.5; 3])));
        assert_eq!((entries[0].emission, entries[0].dissolve), (None, Some(0.25)));
        assert!(entries[0].ignored[0].contains("line 4: 'Ke spectral x.rfl'"));
        assert!(entries[0].ignored[1].contains("line 6"));
    }
}
