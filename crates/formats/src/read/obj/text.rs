//! Lines of OBJ and MTL files: bytes come in, statements go out, each with its line number.

use std::borrow::Cow;

/// A statement: its keyword, what follows it, and the number of its first line, from 1.
pub(super) struct Statement<'a> {
    pub(super) line: usize,
    pub(super) keyword: String,
    rest: Cow<'a, str>,
}

impl Statement<'_> {
    /// All that follows the keyword, for names with blanks in them.
    pub(super) fn rest(&self) -> &str {
        self.rest.trim()
    }

    /// The words that follow the keyword.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.rest.split_whitespace()
    }

    /// The numbers that follow the keyword, up to the first word that is none.
    pub(super) fn numbers(&self) -> Vec<f64> {
        self.words().map_while(|word| word.parse().ok()).collect()
    }
}

/// The statements of a file: comments and empty lines left out, lines that end in `\` joined with the next. Bytes
/// that are not UTF-8 (names in Latin-1) are replaced, not refused.
pub(super) fn statements(bytes: &[u8]) -> impl Iterator<Item = Statement<'_>> {
    let mut lines = bytes.split(|&byte| byte == b'\n').enumerate();
    std::iter::from_fn(move || {
        loop {
            let (number, line) = lines.next()?;
            let mut text = String::from_utf8_lossy(line);
            while text.trim_end().ends_with('\\') {
                let joined = text.trim_end().trim_end_matches('\\').len();
                text.to_mut().truncate(joined);
                let Some((_, next)) = lines.next() else { break };
                let text = text.to_mut();
                text.push(' ');
                text.push_str(&String::from_utf8_lossy(next));
            }
            let trimmed = text.trim();
            let (keyword, rest) = trimmed.split_once(char::is_whitespace).unwrap_or((trimmed, ""));
            if keyword.is_empty() || keyword.starts_with('#') {
                continue;
            }
            let (keyword, rest) = (keyword.to_owned(), rest.to_owned());
            return Some(Statement { line: number + 1, keyword, rest: Cow::Owned(rest) });
        }
    })
}
