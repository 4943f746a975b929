//! Files that are written whole or not at all.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::{Error, Result};

/// Writes a file through `write`: into a temporary file beside the target, flushed to the disk and
/// only then renamed over it. Whatever goes wrong, the target is either the old file or the new one,
/// and the temporary file is gone.
///
/// # Errors
/// [`Error::Io`] with the target's path, whether the disk failed or `write` did.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("answer.txt");
/// semfm_geom::io::write_atomically(&path, |out| out.write_all(b"42\n"))?;
/// assert_eq!(std::fs::read(&path)?, b"42\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_atomically(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    let path = path.as_ref();
    replace_atomically(path, |file| {
        let mut out = BufWriter::new(file);
        let written = write(&mut out).and_then(|()| out.flush());
        written.map_err(Error::io(path))
    })
}

/// As [`write_atomically`], for writers that seek and fail in ways of their own.
///
/// # Errors
/// The errors of `fill` as they are; [`Error::Io`] with the target's path.
pub fn replace_atomically<E: From<Error>>(
    path: &Path,
    fill: impl FnOnce(&mut File) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let io = Error::io(path);
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".semfm-");
    #[cfg(unix)]
    {
        // Temporary files are private; ours becomes an ordinary file, so it starts as one (less
        // the umask) or keeps what the file in its place allows.
        use std::os::unix::fs::PermissionsExt;
        let ordinary = std::fs::Permissions::from_mode(0o666);
        builder.permissions(std::fs::metadata(path).map_or(ordinary, |old| old.permissions()));
    }
    let mut temporary = builder.tempfile_in(folder).map_err(&io)?;
    fill(temporary.as_file_mut())?;
    temporary.as_file().sync_all().map_err(&io)?;
    temporary.persist(path).map_err(|error| io(error.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept.txt");
        write_atomically(&path, |out| out.write_all(b"old")).unwrap();
        let error = write_atomically(&path, |out| {
            out.write_all(b"half of the n")?;
            Err(std::io::Error::other("the disk is full"))
        });
        assert!(error.unwrap_err().to_string().contains("kept.txt: the disk is full"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
