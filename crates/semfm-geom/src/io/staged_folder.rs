//! Folders whose files appear together or not at all.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};

use super::temporary::{TemporaryFolder, folder_of};
use super::{FormatError, TEMPORARY_PREFIX, refuse_input, replace_atomically};
use crate::{Error, Result};

/// The files of an answer on their way into a folder: they are written into a temporary folder, and
/// [`StagedFolder::put`] moves them to their places when all of them are there. Dropped before that,
/// it leaves the folder as it was.
///
/// A folder that was not there appears by one renaming. In a folder that was there, the files that
/// bear the answer (`last`) are taken away first and put back last: a process that is killed in
/// between leaves no answer beside files of another.
///
/// ```
/// use semfm_geom::io::{StagedFolder, write_json};
/// # let parent = tempfile::tempdir()?;
/// let folder = parent.path().join("out");
/// let staged = StagedFolder::new(&folder)?;
/// write_json(staged.path().join("answer.json"), &[42])?;
/// assert!(!folder.exists());
/// let files = staged.put(&["answer.json"], &[])?;
/// assert_eq!(files, [folder.join("answer.json")]);
/// assert!(files[0].is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct StagedFolder {
    folder: PathBuf,
    stage: TemporaryFolder,
}

impl StagedFolder {
    /// Makes the temporary folder: inside `folder`, or beside it where it is not there yet.
    ///
    /// # Errors
    /// [`Error::Format`] where `folder` is a file; [`Error::Io`] where it cannot be written.
    pub fn new(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref().to_owned();
        let parent = match check_output_folder(&folder)? {
            true => folder.clone(),
            false => folder_of(&folder).to_owned(),
        };
        fs::create_dir_all(&parent).map_err(Error::io(&parent))?;
        let stage = TemporaryFolder::within(&parent, &folder)?;
        let mut stages = STAGES.lock().unwrap_or_else(PoisonError::into_inner);
        stages.push(Stage { path: stage.path.clone(), folder: folder.clone() });
        drop(stages);
        Ok(Self { folder, stage })
    }

    /// Where the files are written for now.
    pub fn path(&self) -> &Path {
        &self.stage.path
    }

    /// The place that a file of the temporary folder will have.
    pub fn place_of(&self, file: &Path) -> PathBuf {
        shown_path(file)
    }

    /// Puts the files in their places, those named in `last` in this order at the end, and removes
    /// the files named in `gone`, which an earlier answer may have left. Returns the paths, by name.
    ///
    /// # Errors
    /// [`Error::Format`] where one of them would replace, or take away, a file that was read as an
    /// input ([`refuse_input`]); then nothing has changed. [`Error::Io`].
    pub fn put(self, last: &[&str], gone: &[&str]) -> Result<Vec<PathBuf>> {
        let mut names: Vec<String> = Vec::new();
        for entry in fs::read_dir(self.path()).map_err(Error::io(&self.folder))?.flatten() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
        names.retain(|name| !name.starts_with(TEMPORARY_PREFIX));
        let rank = |name: &String| last.iter().position(|l| l == name).map_or(0, |place| place + 1);
        names.sort_by(|a, b| rank(a).cmp(&rank(b)).then_with(|| a.cmp(b)));
        let places: Vec<PathBuf> = names.iter().map(|name| self.folder.join(name)).collect();
        places.iter().try_for_each(refuse_input)?;
        gone.iter().try_for_each(|name| refuse_input(self.folder.join(name)))?;
        // Nobody can have read files of a folder that was not there.
        if !self.folder.exists() && fs::rename(self.path(), &self.folder).is_ok() {
            places.iter().for_each(|place| super::input_files::remember_written(place));
        } else {
            self.put_each(&names, last, gone)?;
        }
        let mut places = places;
        places.sort();
        Ok(places)
    }

    fn put_each(&self, names: &[String], last: &[&str], gone: &[&str]) -> Result<()> {
        fs::create_dir_all(&self.folder).map_err(Error::io(&self.folder))?;
        // A temporary folder is nobody else's, and its lock is held by this process already.
        let _alone = (!is_stage(&self.folder)).then(|| Alone::in_folder(&self.folder));
        for name in in_order_of_removal(last, gone) {
            let path = self.folder.join(name);
            // Only regular files: what a link points at, or a device, is written into below.
            if fs::symlink_metadata(&path).is_ok_and(|about| about.is_file()) {
                fs::remove_file(&path).map_err(Error::io(&path))?;
            }
        }
        for name in names {
            let (from, to) = (self.path().join(name), self.folder.join(name));
            let is_plain = fs::symlink_metadata(&to).map_or(true, |about| about.is_file());
            if is_plain {
                fs::rename(&from, &to).map_err(Error::io(&to))?;
                super::input_files::remember_written(&to);
            } else {
                replace_atomically(&to, |file| {
                    let copied =
                        File::open(&from).and_then(|mut from| std::io::copy(&mut from, file));
                    copied.map(|_| ()).map_err(Error::io(&to))
                })?;
            }
        }
        Ok(())
    }
}

impl Drop for StagedFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.stage.path);
        let mut stages = STAGES.lock().unwrap_or_else(PoisonError::into_inner);
        stages.retain(|stage| stage.path != self.stage.path);
    }
}

/// What is put last goes first: after each removal, what is left of `last` has all that was put before
/// it.
fn in_order_of_removal<'a>(last: &[&'a str], gone: &[&'a str]) -> Vec<&'a str> {
    last.iter().rev().chain(gone).copied().collect()
}

/// Whether the folder is there; an error where something else is.
fn check_output_folder(folder: &Path) -> Result<bool> {
    match fs::metadata(folder) {
        Ok(about) if about.is_dir() => Ok(true),
        Ok(_) => Err(FormatError::new(folder, "output", "a folder", "a file").into()),
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(Error::io(folder)(error)),
        Err(_) if folder.is_symlink() => {
            let found = "a link to what is not there";
            Err(FormatError::new(folder, "output", "a folder", found).into())
        }
        Err(_) => Ok(false),
    }
}

struct Stage {
    path: PathBuf,
    folder: PathBuf,
}

static STAGES: LazyLock<Mutex<Vec<Stage>>> = LazyLock::new(Mutex::default);

fn is_stage(folder: &Path) -> bool {
    let stages = STAGES.lock().unwrap_or_else(PoisonError::into_inner);
    stages.iter().any(|stage| stage.path == folder)
}

/// The path that a message names: for a file that is written into the temporary folder of a
/// [`StagedFolder`], the place that it will have; any other path as it is.
pub fn shown_path(path: impl AsRef<Path>) -> PathBuf {
    let mut path = path.as_ref().to_owned();
    let stages = STAGES.lock().unwrap_or_else(PoisonError::into_inner);
    // The innermost first: one may be staged inside another.
    for stage in stages.iter().rev() {
        if let Ok(rest) = path.strip_prefix(&stage.path) {
            path = stage.folder.join(rest);
        }
    }
    path
}

/// Two processes that put files into one folder do so one after the other.
struct Alone(Option<File>);

/// How often, and how long apart, the folder is tried.
const ALONE_TRIES: u32 = 200;
const ALONE_PAUSE: std::time::Duration = std::time::Duration::from_millis(10);

impl Alone {
    fn in_folder(folder: &Path) -> Self {
        let Ok(lock) = File::open(folder) else { return Self(None) };
        for _ in 0..ALONE_TRIES {
            match lock.try_lock() {
                Err(fs::TryLockError::WouldBlock) => std::thread::sleep(ALONE_PAUSE),
                _ => break, // ours, or a file system without locks
            }
        }
        Self(Some(lock))
    }
}

impl Drop for Alone {
    fn drop(&mut self) {
        if let Some(lock) = &self.0 {
            let _ = lock.unlock();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::write_json;
    use super::*;

    fn listed(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn files_come_together_or_not_at_all() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("out");
        {
            let staged = StagedFolder::new(&folder).unwrap();
            write_json(staged.path().join("region.json"), &[1]).unwrap();
            assert_eq!(staged.place_of(&staged.path().join("a")), folder.join("a"));
        }
        assert!(listed(parent.path()).is_empty(), "given up");
        // One inside another, as callers of callers do.
        let start = std::time::Instant::now();
        let outer = StagedFolder::new(&folder).unwrap();
        let inner = StagedFolder::new(outer.path()).unwrap();
        write_json(inner.path().join("a.json"), &[0]).unwrap();
        assert_eq!(shown_path(inner.path().join("a.json")), folder.join("a.json"));
        inner.put(&[], &[]).unwrap();
        assert_eq!(listed(outer.path()), ["a.json"]);
        drop(outer);
        assert!(start.elapsed().as_secs() < 1 && listed(parent.path()).is_empty());

        for answer in [1, 2] {
            let staged = StagedFolder::new(&folder).unwrap();
            for name in ["region.json", "a.json"] {
                write_json(staged.path().join(name), &[answer]).unwrap();
            }
            if answer == 1 {
                write_json(staged.path().join("grasps.json"), &[1]).unwrap();
            }
            let files = staged.put(&["region.json"], &["grasps.json"][..answer - 1]).unwrap();
            assert!(files.contains(&folder.join("region.json")));
            fs::write(folder.join("own.txt"), "the user's").unwrap();
        }
        assert_eq!(listed(&folder), ["a.json", "own.txt", "region.json"]);
        assert_eq!(fs::read_to_string(folder.join("a.json")).unwrap(), "[2]\n");
        assert_eq!(listed(parent.path()), ["out"]);
    }

    #[test]
    fn no_answer_outlives_what_was_put_before_it() {
        let order = in_order_of_removal(&["report.json", "region.json"], &["grasps.json"]);
        assert_eq!(order, ["region.json", "report.json", "grasps.json"]);
    }

    #[test]
    fn errors_name_the_place_and_inputs_stay() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("out");
        let staged = StagedFolder::new(&folder).unwrap();
        let error = write_json(staged.path(), &[1]).unwrap_err().to_string();
        assert!(error.contains("out") && !error.contains(".semfm-"), "{error}");
        drop(staged);

        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("b.json"), "[7]").unwrap();
        let _ = super::super::read_file(folder.join("b.json")).unwrap();
        let staged = StagedFolder::new(&folder).unwrap();
        for name in ["a.json", "b.json"] {
            write_json(staged.path().join(name), &[1]).unwrap();
        }
        let error = staged.put(&[], &[]).unwrap_err().to_string();
        assert!(error.contains("b.json") && error.contains("input"), "{error}");
        assert_eq!(listed(&folder), ["b.json"]);
        assert_eq!(fs::read_to_string(folder.join("b.json")).unwrap(), "[7]");
        fs::write(parent.path().join("file"), "").unwrap();
        assert!(StagedFolder::new(parent.path().join("file")).is_err());
    }
}
