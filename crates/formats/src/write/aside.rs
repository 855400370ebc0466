//! Bytes come in, a whole file under the asked name goes out, or nothing changes.
//!
//! The bytes go to a temporary file in the same folder, which is flushed to the disk and then renamed over the asked
//! name: at every moment that name holds the old file or the new one. On any failure the temporary file is removed.

use super::WriteError;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Names tried before giving up: more than one collision needs leftovers of a process with the same number.
const ATTEMPTS: u32 = 100;

/// Number of the next temporary file of this process. Only uniqueness matters, so any memory order will do.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// Writes `bytes` to `path`, whole or not at all.
///
/// A symbolic link keeps pointing at its file, which is replaced; a replaced file keeps its permissions. What is no
/// regular file (a pipe, `/dev/stdout`) is written to directly.
///
/// # Errors
/// [`WriteError::File`] naming `path`; what was under that name is then as before.
pub fn write_aside(path: impl AsRef<Path>, bytes: &[u8]) -> Result<(), WriteError> {
    write_aside_with(path, &Recall::default(), |file| file.write_all(bytes))
}

/// [`write_aside`] for contents that `fill` streams out; another thread may recall it.
///
/// # Errors
/// As [`write_aside`], where `fill` fails, and where the write was recalled.
pub fn write_aside_with(
    path: impl AsRef<Path>,
    recall: &Recall,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    let asked = path.as_ref();
    let failed =
        |action: &'static str| move |source: io::Error| WriteError::File { path: asked.to_owned(), action, source };
    // A link that leads nowhere is replaced by the file; one that leads to a file stays.
    let target = fs::canonicalize(asked).unwrap_or_else(|_| asked.to_owned());
    let existing = fs::metadata(&target).ok();
    if let Some(existing) = &existing {
        if existing.is_dir() {
            return Err(failed("it is a folder")(io::ErrorKind::IsADirectory.into()));
        }
        if !existing.is_file() {
            let mut device = OpenOptions::new().write(true).open(&target).map_err(failed("open"))?;
            return fill(&mut device).and_then(|()| device.flush()).map_err(failed("write"));
        }
    }
    if existing.as_ref().is_some_and(|existing| existing.permissions().readonly()) {
        // A rename would not mind, but whoever made the file read-only does.
        return Err(failed("it is read-only")(io::ErrorKind::PermissionDenied.into()));
    }
    if target.file_name().is_none() {
        return Err(failed("it names no file")(io::ErrorKind::InvalidInput.into()));
    }
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let (mut file, temporary) =
        Temporary::create(folder, recall).map_err(failed("create a temporary file beside it"))?;
    fill(&mut file).map_err(failed("write"))?;
    file.flush().and_then(|()| file.sync_all()).map_err(failed("flush to disk"))?;
    if let Some(existing) = existing {
        file.set_permissions(existing.permissions()).map_err(failed("keep its permissions"))?;
    }
    drop(file);
    temporary.rename(&target).map_err(failed("rename the temporary file"))?;
    // The new file is in place; a folder that cannot be flushed (some systems refuse to open one) loses nothing now.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Takes back a write that is under way on another thread. Its clones are one.
#[derive(Clone, Debug, Default)]
pub struct Recall(Arc<Mutex<Pending>>);

#[derive(Debug, Default)]
struct Pending {
    is_recalled: bool,
    temporary: Option<PathBuf>,
}

impl Recall {
    /// From now on nothing appears under the asked name, and the temporary file is gone; unless the whole file is in
    /// place already.
    pub fn recall(&self) {
        let mut pending = self.lock();
        pending.is_recalled = true;
        pending.remove();
    }

    fn lock(&self) -> MutexGuard<'_, Pending> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Pending {
    fn remove(&mut self) {
        if let Some(path) = self.temporary.take() {
            // The failure that led here is reported; a second one while cleaning up has nobody to go to.
            let _ = fs::remove_file(path);
        }
    }

    fn unless_recalled(&self) -> io::Result<()> {
        if self.is_recalled { Err(io::Error::new(io::ErrorKind::Interrupted, "recalled")) } else { Ok(()) }
    }
}

/// A temporary file that is removed when dropped, unless it was renamed.
struct Temporary {
    recall: Recall,
}

impl Temporary {
    fn create(folder: &Path, recall: &Recall) -> io::Result<(File, Temporary)> {
        let mut pending = recall.lock();
        pending.unless_recalled()?;
        let mut last = io::Error::from(io::ErrorKind::AlreadyExists);
        for _ in 0..ATTEMPTS {
            let number = NEXT.fetch_add(1, Ordering::Relaxed);
            let path = folder.join(format!(".isolux-{}-{number}.tmp", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => {
                    pending.temporary = Some(path);
                    return Ok((file, Temporary { recall: recall.clone() }));
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => last = error,
                Err(error) => return Err(error),
            }
        }
        Err(last)
    }

    fn rename(self, target: &Path) -> io::Result<()> {
        let mut pending = self.recall.lock();
        pending.unless_recalled()?;
        if let Some(path) = &pending.temporary {
            fs::rename(path, target)?;
        }
        pending.temporary = None;
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        self.recall.lock().remove();
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.collect()
    }

    /// Catches a recalled write that still appears, that leaves its temporary file behind or harms the old file, at each
    /// moment that it may be recalled in; and one that takes back what is in place.
    #[test]
    fn a_recalled_write_leaves_no_trace() {
        let folder = std::env::temp_dir().join(format!("isolux-recall-{}", std::process::id()));
        fs::create_dir(&folder).unwrap();
        let path = folder.join("room");
        write_aside(&path, b"old").unwrap();
        let before = Recall::default();
        before.recall();
        let error = write_aside_with(&path, &before, |file| file.write_all(b"new")).unwrap_err();
        assert!(error.to_string().contains("recalled"), "{error}");
        let during = Recall::default();
        let fill = |file: &mut dyn Write| {
            file.write_all(b"ne")?;
            assert_eq!(names(&folder).len(), 2);
            during.recall();
            assert_eq!(names(&folder), ["room"]);
            file.write_all(b"w")
        };
        write_aside_with(&path, &during, fill).unwrap_err();
        assert_eq!((names(&folder), fs::read(&path).unwrap()), (vec!["room".to_owned()], b"old".to_vec()));
        let after = Recall::default();
        write_aside_with(&path, &after, |file| file.write_all(b"new")).unwrap();
        after.recall();
        assert_eq!((names(&folder), fs::read(&path).unwrap()), (vec!["room".to_owned()], b"new".to_vec()));
        fs::remove_dir_all(&folder).unwrap();
    }
}
