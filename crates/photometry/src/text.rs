//! Bytes of a photometric file as lines and numbers: any line ends, any encoding, and the number of the line for
//! whoever has to name it.

use crate::error::{PhotometryError, Warning};

/// Most characters of a file that a message repeats.
const MOST_SHOWN: usize = 40;

/// Most angles of one kind: every hundredth of a degree of the circle.
const MOST_ANGLES: usize = 36_001;

/// A count of angles in words, as messages say what was expected.
pub(crate) fn count_words(what: &str, least: usize) -> String {
    format!("{what} (a whole number from {least} to {MOST_ANGLES})")
}

/// A number as a count of angles.
pub(crate) fn count_of(value: f64, least: usize) -> Option<usize> {
    whole(value).filter(|count| (least..=MOST_ANGLES).contains(count))
}

/// A number as a count.
fn whole(value: f64) -> Option<usize> {
    (value >= 0.0 && value.fract() == 0.0 && value < 1e9).then_some(value as usize)
}

/// The text of a file: UTF-8 or UTF-16 where it says so or is so, Latin-1 otherwise.
pub(crate) fn decode(bytes: &[u8]) -> String {
    let wide = |is_big: bool, bytes: &[u8]| {
        let units = bytes.chunks_exact(2).map(|pair| match is_big {
            true => u16::from_be_bytes([pair[0], pair[1]]),
            false => u16::from_le_bytes([pair[0], pair[1]]),
        });
        char::decode_utf16(units).map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => plain(rest),
        [0xFF, 0xFE, rest @ ..] => wide(false, rest),
        [0xFE, 0xFF, rest @ ..] => wide(true, rest),
        _ => plain(bytes),
    }
}

fn plain(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    }
}

/// Lines, whichever way they end; nothing after the mark by which DOS ends a text.
pub(crate) fn lines(text: &str) -> Vec<&str> {
    let text = text.split('\u{1A}').next().unwrap_or_default();
    let mut lines = Vec::new();
    let mut rest = text;
    while let Some(end) = rest.find(['\r', '\n']) {
        lines.push(&rest[..end]);
        rest = if rest[end..].starts_with("\r\n") { &rest[end + 2..] } else { &rest[end + 1..] };
    }
    if !rest.is_empty() {
        lines.push(rest);
    }
    lines
}

/// Text of a file for people: one line, no control characters.
pub(crate) fn clean(text: &str) -> String {
    let printable = text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect::<String>();
    printable.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What was found, in quotes, as a message repeats it.
pub(crate) fn shown(text: &str) -> String {
    let text = clean(text);
    if text.is_empty() {
        return "nothing".into();
    }
    match text.char_indices().nth(MOST_SHOWN) {
        Some((end, _)) => format!("'{}...'", &text[..end]),
        None => format!("'{text}'"),
    }
}

/// A finite number as files write it: Fortran's D for the exponent, too.
pub(crate) fn number(token: &str) -> Option<f64> {
    // Rust's own parser knows "inf" and "nan".
    if !token.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E' | b'd' | b'D')) {
        return None;
    }
    token.replace(['d', 'D'], "e").parse().ok().filter(|value: &f64| value.is_finite())
}

/// Name of the file, and what was mended so far.
pub(crate) struct Notes {
    pub(crate) file: String,
    pub(crate) warnings: Vec<Warning>,
}

impl Notes {
    pub(crate) fn new(file: &str) -> Notes {
        Notes { file: clean(file), warnings: Vec::new() }
    }

    pub(crate) fn warn(&mut self, line: usize, message: impl Into<String>) {
        self.warnings.push(Warning { file: self.file.clone(), line, message: message.into() });
    }

    pub(crate) fn error(&self, line: usize, expected: &str, found: impl Into<String>) -> PhotometryError {
        PhotometryError::Malformed {
            file: self.file.clone(),
            line: line.max(1),
            expected: expected.into(),
            found: found.into(),
        }
    }
}

/// Numbers that stand anywhere on lines.
pub(crate) struct Numbers<'a> {
    /// Number of the line, from 1, and what stands there.
    tokens: Vec<(usize, &'a str)>,
    next: usize,
    /// Whether a comma stands in a number, or between numbers.
    has_decimal_commas: bool,
    end: usize,
}

impl<'a> Numbers<'a> {
    /// Of all lines from `first` (counted from 0) on.
    pub(crate) fn new(lines: &[&'a str], first: usize, has_decimal_commas: bool) -> Numbers<'a> {
        let splits = |letter: char| {
            letter.is_whitespace() || letter.is_control() || letter == ';' || (letter == ',' && !has_decimal_commas)
        };
        let tokens = lines.iter().enumerate().skip(first).flat_map(|(index, line)| {
            line.split(splits).filter(|token| !token.is_empty()).map(move |token| (index + 1, token))
        });
        Numbers { tokens: tokens.collect(), next: 0, has_decimal_commas, end: lines.len() }
    }

    /// The next number and its line; `what` it should be is for the message.
    pub(crate) fn next(&mut self, notes: &Notes, what: &str) -> Result<(f64, usize), PhotometryError> {
        let Some(&(line, token)) = self.tokens.get(self.next) else {
            return Err(notes.error(self.end, what, "the end of the file"));
        };
        self.next += 1;
        let value = if self.has_decimal_commas {
            number(&token.trim_end_matches(',').replace(',', "."))
        } else {
            number(token)
        };
        match value {
            Some(value) => Ok((value, line)),
            None => Err(notes.error(line, what, shown(token))),
        }
    }

    /// The next number as a count of angles, at least `least`.
    pub(crate) fn count(&mut self, notes: &Notes, what: &str, least: usize) -> Result<usize, PhotometryError> {
        let what = count_words(what, least);
        let (value, line) = self.next(notes, &what)?;
        count_of(value, least).ok_or_else(|| notes.error(line, &what, format!("'{value}'")))
    }

    /// `count` ascending angles within `[low, high]`, with the line of each.
    pub(crate) fn angles(
        &mut self,
        notes: &Notes,
        what: &str,
        count: usize,
        (low, high): (f64, f64),
    ) -> Result<(Vec<f64>, Vec<usize>), PhotometryError> {
        let (left, line) = self.left();
        if left < count {
            let expected = format!("{count} {what} angles from here on");
            return Err(notes.error(line, &expected, format!("{left} words up to the end of the file")));
        }
        let (mut angles, mut places) = (Vec::new(), Vec::new());
        for index in 1..=count {
            let (angle, line) = self.next(notes, &format!("{what} angle {index} of {count}"))?;
            if !(low..=high).contains(&angle) {
                let expected = format!("{what} angle {index} of {count} within {low} and {high}");
                return Err(notes.error(line, &expected, format!("'{angle}'")));
            }
            if let Some(&before) = angles.last().filter(|&&before| angle <= before) {
                let expected = format!("{what} angle {index} of {count} above {before} (angles ascend)");
                return Err(notes.error(line, &expected, format!("'{angle}'")));
            }
            angles.push(angle);
            places.push(line);
        }
        Ok((angles, places))
    }

    /// How many are left, and the line of the next.
    pub(crate) fn left(&self) -> (usize, usize) {
        (self.tokens.len() - self.next, self.tokens.get(self.next).map_or(self.end, |&(line, _)| line))
    }

    /// Warns of what stands after the last number.
    pub(crate) fn finish(&self, notes: &mut Notes) {
        if let Some(&(line, token)) = self.tokens.get(self.next) {
            let more = self.tokens.len() - self.next;
            notes.warn(line, format!("{more} more words after the last value, from {}: ignored", shown(token)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches line ends that shift the numbers of lines, and text after DOS's end.
    #[test]
    fn all_line_ends_count() {
        assert_eq!(lines("a\r\nb\nc\rd\n\ne"), ["a", "b", "c", "d", "", "e"]);
        assert_eq!(lines("a\r\n\u{1A}junk"), ["a"]);
        assert!(lines("").is_empty());
    }

    /// Catches bytes that are no UTF-8 and get lost.
    #[test]
    fn encodings_are_told_apart() {
        assert_eq!(decode(b"\xEF\xBB\xBFIES"), "IES");
        assert_eq!(decode(b"L\xFCster"), "Lüster");
        assert_eq!(decode("Lüster".as_bytes()), "Lüster");
        assert_eq!(decode(b"\xFF\xFEI\0E\0"), "IE");
        assert_eq!(decode(b"\xFE\xFF\0I\0E"), "IE");
    }

    /// Catches words that Rust takes for numbers, and numbers of Fortran that it does not.
    #[test]
    fn numbers_are_numbers() {
        assert_eq!(number("1.5D+03"), Some(1500.0));
        assert_eq!(number("1e5"), Some(1e5));
        assert_eq!(number(".5"), Some(0.5));
        assert_eq!(number("5."), Some(5.0));
        assert_eq!(number("+7"), Some(7.0));
        for word in ["inf", "nan", "", "1e999", "0x10", "--1", "e", "1_000"] {
            assert_eq!(number(word), None, "{word}");
        }
    }
}
