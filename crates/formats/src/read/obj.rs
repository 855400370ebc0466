//! Stub
use super::{ReadError, ReadOptions};
use isolux_core::scene::SceneInput;
use std::path::Path;
pub(super) fn read(_path: &Path, _bytes: &[u8], _options: &ReadOptions) -> Result<SceneInput, ReadError> {
    Ok(SceneInput::default())
}
