//! Bytes that a scene file names: `data:` URIs and files beside it; no other scheme, no device, no absolute path.

use base64::Engine as _;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use base64::{alphabet, engine::DecodePaddingMode};
use percent_encoding::percent_decode_str;
use std::fs::File;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

/// Standard alphabet; files in the wild leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// All bytes of a regular file; the reason in words where there is none.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, String> {
    let metadata = std::fs::metadata(path).map_err(reason)?;
    if metadata.is_dir() {
        return Err("it is a directory".to_owned());
    }
    if !metadata.is_file() {
        // A pipe or a device may never end.
        return Err("it is not a regular file".to_owned());
    }
    let mut bytes = Vec::new();
    File::open(path).map_err(reason)?.take(metadata.len()).read_to_end(&mut bytes).map_err(reason)?;
    Ok(bytes)
}

/// The bytes behind a glTF URI, with `folder` the folder of the file that names it.
pub(super) fn fetch(folder: &Path, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = strip_scheme(uri, "data") {
        return decode_data(data);
    }
    if let Some(scheme) = scheme(uri) {
        return Err(format!("URI with scheme '{scheme}:' is refused: only relative paths and data: URIs are read"));
    }
    let decoded =
        percent_decode_str(uri).decode_utf8().map_err(|_| "URI is not UTF-8 once percent-decoded".to_owned())?;
    let path = relative(&decoded)?;
    read(&folder.join(path))
}

/// A relative path as files write them: `/` or `\` between parts, `..` allowed, nothing absolute.
pub(super) fn relative(text: &str) -> Result<PathBuf, String> {
    if text.is_empty() {
        return Err("the path is empty".to_owned());
    }
    if text.contains('\0') {
        return Err("the path holds a NUL character".to_owned());
    }
    let path = PathBuf::from(text.replace('\\', "/"));
    let drive = text.as_bytes().get(1) == Some(&b':');
    if drive || path.components().any(|part| matches!(part, Component::Prefix(_) | Component::RootDir)) {
        return Err("absolute paths are refused: put the file beside the scene and name it by a relative path".into());
    }
    Ok(path)
}

/// What the system says, in one line, without its error number.
fn reason(error: std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "no such file".to_owned(),
        std::io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
        _ => error.to_string(),
    }
}

/// The scheme of an absolute URI: a letter, then letters, digits, `+`, `-`, `.`, then a colon (RFC 3986, 3.1).
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut characters = scheme.chars();
    let first = characters.next()?;
    let valid = first.is_ascii_alphabetic() && characters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    valid.then_some(scheme)
}

/// What follows `scheme:`, if that is the scheme.
fn strip_scheme<'a>(uri: &'a str, wanted: &str) -> Option<&'a str> {
    let found = scheme(uri)?;
    found.eq_ignore_ascii_case(wanted).then(|| &uri[found.len() + 1..])
}

/// The payload of a `data:` URI after its scheme: base64 or percent-encoded.
fn decode_data(data: &str) -> Result<Vec<u8>, String> {
    let (header, payload) = data.split_once(',').ok_or("data: URI without a comma")?;
    if header.to_ascii_lowercase().ends_with(";base64") {
        BASE64.decode(payload).map_err(|error| format!("data: URI is not base64: {error}"))
    } else {
        Ok(percent_decode_str(payload).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::{fetch, relative};
    use std::path::Path;

    /// Catches a data: URI read as a file, padding demanded, or percent escapes left in.
    #[test]
    fn data_uris_are_decoded() {
        let folder = Path::new("/nowhere");
        assert_eq!(fetch(folder, "data:application/octet-stream;base64,AQID").unwrap(), [1, 2, 3]);
        assert_eq!(fetch(folder, "DATA:;base64,AQ").unwrap(), [1]);
        assert_eq!(fetch(folder, "data:,a%20b").unwrap(), b"a b");
        assert!(fetch(folder, "data:;base64,%%%").unwrap_err().contains("base64"));
        assert!(fetch(folder, "data:nothing").unwrap_err().contains("comma"));
    }

    /// Catches a URI that reaches the network, a device or an absolute path.
    #[test]
    fn absolute_references_are_refused() {
        let folder = Path::new("/nowhere");
        for uri in ["http://x/y.bin", "file:///etc/passwd", "/etc/passwd", "%2Fetc%2Fpasswd", "\\\\host\\share\\x"] {
            let reason = fetch(folder, uri).unwrap_err();
            assert!(reason.contains("refused"), "{uri}: {reason}");
        }
        assert!(fetch(folder, "a%00b").unwrap_err().contains("NUL"));
        assert!(relative("C:\\textures\\x.png").unwrap_err().contains("refused"));
        assert_eq!(relative("..\\textures\\x.png").unwrap(), Path::new("../textures/x.png"));
    }
}
