//! Files that are written whole or not at all.

use std::fs::{self, File};
use std::io::{BufWriter, Seek, Write};
use std::path::Path;

use super::input_files::remember_written;
use super::target::Target;
use super::temporary::{TemporaryFile, folder_of};
use crate::{Error, Result};

/// Writes a file through `write`: into a temporary file beside the target, flushed to the disk and
/// only then renamed over it. Whatever goes wrong, the target is either the old file or the new one,
/// and the temporary file is gone; one that a killed process left is removed by the next that writes
/// into the folder. Folders that are missing on the way are made.
///
/// A link is not replaced: what it points at is. A device or a pipe is written into. A folder, a
/// socket and a disk's device are refused.
///
/// # Errors
/// [`Error::Io`] with the target's path, whether the disk failed or `write` did; [`Error::Format`]
/// for a target that cannot be written.
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
/// The errors of `fill` as they are; [`Error::Io`] with the target's path; [`Error::Format`] for a
/// target that cannot be written.
pub fn replace_atomically<E: From<Error>>(
    path: &Path,
    fill: impl FnOnce(&mut File) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let io = Error::io(path);
    match Target::of(path)? {
        Target::File(target) => {
            let folder = folder_of(&target);
            fs::create_dir_all(folder).map_err(Error::io(folder))?;
            let mut temporary =
                TemporaryFile::beside(&target).map_err(|error| named(error, path))?;
            fill(temporary.file())?;
            temporary.put(&target).map_err(io)?;
            remember_written(&target);
        }
        Target::Stream(stream) => {
            let mut whole = tempfile::tempfile().map_err(&io)?;
            fill(&mut whole)?;
            whole.rewind().map_err(&io)?;
            let mut out = open_stream(&stream).map_err(&io)?;
            std::io::copy(&mut whole, &mut out).and_then(|_| out.flush()).map_err(io)?;
        }
    }
    Ok(())
}

/// The error with the path that the caller gave: a link's end would be news to them.
fn named(error: Error, path: &Path) -> Error {
    match error {
        Error::Io { source, .. } => Error::io(path)(source),
        other => other,
    }
}

/// How often, and how long apart, a pipe is asked for a reader: a process that was started at the
/// same time may be a little later.
#[cfg(unix)]
const READER_TRIES: u32 = 40;
#[cfg(unix)]
const READER_PAUSE: std::time::Duration = std::time::Duration::from_millis(50);

/// Opens a device or a pipe for writing. A pipe that nobody reads is an error: opening it would
/// wait for ever.
fn open_stream(path: &Path) -> std::io::Result<File> {
    let mut options = File::options();
    options.append(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
        if fs::metadata(path)?.file_type().is_fifo() {
            let mut probe = File::options();
            probe.write(true).custom_flags(libc::O_NONBLOCK);
            for _ in 0..READER_TRIES {
                if let Ok(held) = probe.open(path) {
                    // With a reader there, the second opening does not wait; and it is a blocking
                    // one, as a copy needs it.
                    let file = options.open(path);
                    drop(held);
                    return file;
                }
                std::thread::sleep(READER_PAUSE);
            }
            return Err(std::io::Error::other("a pipe that nobody reads"));
        }
    }
    options.open(path)
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
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn missing_folders_are_made_and_errors_name_the_target() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/new.txt");
        write_atomically(&path, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        let error = write_atomically(path.join("below.txt"), |_| Ok(())).unwrap_err().to_string();
        assert!(error.contains("below.txt") && !error.contains(".semfm-"), "{error}");
        assert!(write_atomically(folder.path(), |_| Ok(())).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link_and_a_pipe_a_pipe() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        symlink("there.txt", at("link")).unwrap();
        write_atomically(at("link"), |out| out.write_all(b"1")).unwrap();
        write_atomically(at("link"), |out| out.write_all(b"2")).unwrap();
        assert!(at("link").is_symlink() && fs::read(at("there.txt")).unwrap() == b"2");

        let made = std::process::Command::new("mkfifo").arg(at("pipe")).status();
        if !made.is_ok_and(|status| status.success()) {
            return; // a system without mkfifo
        }
        let pipe = at("pipe");
        let reader = std::thread::spawn(move || fs::read(pipe).unwrap());
        write_atomically(at("pipe"), |out| out.write_all(b"through")).unwrap();
        assert_eq!(reader.join().unwrap(), b"through");
        assert!(!at("pipe").metadata().unwrap().is_file());
        let error = write_atomically(at("pipe"), |out| out.write_all(b"x")).unwrap_err();
        assert!(error.to_string().contains("nobody reads"), "{error}");
    }
}
