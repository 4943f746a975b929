//! A recipe carried out, stage by stage.

use std::fs;
use std::path::{Component, Path, PathBuf};
use std::time::Instant;

use semfm::Task;
use semfm::files::{
    FileHash, NoAnswerRecord, RUN_FILE, RUN_FORMAT, RunFile, RunStageRecord, STAGE_FILE,
    STAGE_FORMAT, StageFile, StageState,
};
use semfm::geom::io::{
    FormatError, ReadFiles, StagedFolder, is_same_file, refuse_to_overwrite, remove_left_behind,
};
use semfm::geom::{Error as GeomError, ShapeCache};

use crate::fingerprint::{Begin, hashes, of_settings};
use crate::page::{PAGE_FILE, write_run_page};
use crate::recipe::{NamedPath, Recipe, RecipeFile};
use crate::stages::{StageContext, StageEnd};
use crate::{Error, Result, Stage};

/// The version that records name.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// How a run is carried out; nothing of it changes an answer.
#[derive(Clone, Debug)]
pub struct RunSettings {
    /// Worker threads of encoders outside this process; 0 takes one for each core.
    pub threads: usize,
    /// Encoders outside this process print nothing.
    pub quiet: bool,
    /// Prepared shapes and embeddings are kept between runs, where the recipe does not forbid it.
    pub cache: bool,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self { threads: 0, quiet: true, cache: true }
    }
}

/// A recipe with the folder of its results.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its paths from the current folder.
    recipe: Recipe,
    /// As its file has it, which decides what is done again.
    written: Recipe,
    recipe_file: PathBuf,
    output: PathBuf,
}

/// What a run would do with a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedStage {
    /// The stage.
    pub stage: Stage,
    /// Why it is to be done, in words; `None` where it is kept.
    pub why: Option<String>,
}

/// What a run has just done.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum RunProgress<'a> {
    /// A stage begins.
    Begun {
        /// The stage.
        stage: Stage,
        /// Why it is done, in words.
        why: &'a str,
    },
    /// A stage is there.
    Finished(&'a RunStageRecord),
}

impl Run {
    /// Reads a recipe whose results go into `output`.
    ///
    /// # Errors
    /// Those of [`Recipe::read`]; [`Error::Recipe`] where a result would replace a file that the recipe names, and where
    /// `output` is a file.
    pub fn open(recipe_file: &Path, output: &Path) -> Result<Self> {
        let RecipeFile { written, resolved: recipe } = RecipeFile::read(recipe_file)?;
        if output.exists() && !output.is_dir() {
            let expected = "a folder for the results";
            return Err(FormatError::new(output, "output", expected, "a file").into());
        }
        let run = Self {
            recipe,
            written,
            recipe_file: recipe_file.to_owned(),
            output: output.to_owned(),
        };
        run.check_output()?;
        Ok(run)
    }

    /// The recipe, its paths from the current folder.
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Its stages, in their order.
    pub fn stages(&self) -> Vec<Stage> {
        Stage::of(&self.recipe)
    }

    /// What [`Run::carry_out`] would do, as far as that is known before: a stage whose input is made anew is named as to be
    /// done, though it is kept where the input comes out the same.
    pub fn planned(&self) -> Vec<PlannedStage> {
        let mut planned: Vec<PlannedStage> = Vec::new();
        for stage in self.stages() {
            let anew = planned
                .iter()
                .find(|earlier| earlier.why.is_some() && stage.reads().contains(&earlier.stage));
            let after = anew.map(|earlier| format!("{} comes before it", earlier.stage.name()));
            let why = self.kept(stage).err().or(after);
            planned.push(PlannedStage { stage, why });
        }
        planned
    }

    /// Does what is to be done, writes the page and `run.json`, and tells how it went. A stage without an answer ends it.
    /// Each stage's folder has all of its files or, where something fails or the process is killed, no `stage.json`.
    ///
    /// # Errors
    /// [`Error::Stage`] with the first stage that fails; then there is neither page nor `run.json`, and the stages before it
    /// are kept.
    pub fn carry_out(
        &self,
        settings: &RunSettings,
        tell: &mut dyn FnMut(RunProgress<'_>),
        task: &Task,
    ) -> Result<RunFile> {
        let mut records: Vec<RunStageRecord> = Vec::new();
        let mut no_answer: Option<NoAnswerRecord> = None;
        for stage in self.stages() {
            let (state, file) = match self.kept(stage) {
                Ok(file) => {
                    // Of a run that was killed after it had put the record there.
                    remove_left_behind(&self.folder(stage));
                    (StageState::Kept, file)
                }
                Err(why) => {
                    tell(RunProgress::Begun { stage, why: &why });
                    self.forget_page()?;
                    let of_stage =
                        |cause| Error::Stage { stage: stage.name(), cause: Box::new(cause) };
                    (StageState::Done, self.do_stage(stage, settings, task).map_err(of_stage)?)
                }
            };
            let record = RunStageRecord {
                stage: stage.name().into(),
                state,
                seconds: file.seconds,
                summary: file.summary.clone(),
                files: file.outputs.iter().map(|output| output.file.clone()).collect(),
            };
            tell(RunProgress::Finished(&record));
            records.push(record);
            no_answer.clone_from(&file.no_answer);
            if no_answer.is_some() {
                break;
            }
        }
        task.check()?;
        // What later stages wrote in an earlier run answers another question.
        for stage in Stage::ALL {
            if !records.iter().any(|record| record.stage == stage.name()) {
                self.clear(&self.folder(stage))?;
            }
        }
        self.finish(records, no_answer, settings, task)
    }

    /// Where the page is.
    pub fn page(&self) -> PathBuf {
        self.output.join(PAGE_FILE)
    }

    fn folder(&self, stage: Stage) -> PathBuf {
        self.output.join(stage.name())
    }

    /// The record of a stage that still holds, or why there is none.
    fn kept(&self, stage: Stage) -> std::result::Result<StageFile, String> {
        let folder = self.folder(stage);
        if !folder.join(STAGE_FILE).is_file() {
            return Err("it was not done yet".into());
        }
        // A record that cannot be read is none.
        let file = StageFile::read(&folder).map_err(|_| "its stage.json cannot be read")?;
        match file.why_stale(&folder, &of_settings(&stage.settings(&self.written)), VERSION) {
            None => Ok(file),
            Some(why) => Err(why),
        }
    }

    /// Does a stage and puts its files in their place, its record last.
    fn do_stage(&self, stage: Stage, settings: &RunSettings, task: &Task) -> Result<StageFile> {
        let start = Instant::now();
        let folder = self.folder(stage);
        fs::create_dir_all(&folder).map_err(io(&folder))?;
        let staged = StagedFolder::new(&folder)?;
        let begin = Begin::of(staged.path());
        let read = ReadFiles::begin();
        let end = self.context(settings).work(stage, staged.path(), task)?;
        let StageEnd { summary, no_answer, more_inputs } = end;
        let inputs = read.finish().into_iter().filter(|path| self.is_input(path, &folder));
        let written = names_in(staged.path())?;
        let file = StageFile {
            format: STAGE_FORMAT.into(),
            stage: stage.name().into(),
            version: VERSION.into(),
            settings: of_settings(&stage.settings(&self.written)),
            inputs: begin.hashes(inputs.chain(more_inputs), &folder),
            outputs: hashes(written.iter().map(|name| staged.path().join(name)), staged.path()),
            seconds: start.elapsed().as_secs_f64(),
            summary,
            no_answer,
        };
        file.write(staged.path())?;
        // Whoever stopped the run may have begun another one.
        task.check()?;
        self.clear(&folder)?;
        staged.put(&[STAGE_FILE], &[])?;
        Ok(file)
    }

    /// Removes the record of a folder, then what it says was written there.
    fn clear(&self, folder: &Path) -> Result<()> {
        let earlier = StageFile::read(folder).map(|file| file.outputs).unwrap_or_default();
        let names = earlier.iter().map(|output| output.file.as_str());
        for name in [STAGE_FILE].into_iter().chain(names) {
            // A record names files of its own folder; one that was tampered with may name others.
            let mut parts = Path::new(name).components();
            if let (Some(Component::Normal(_)), None) = (parts.next(), parts.next()) {
                remove(&folder.join(name))?;
            }
        }
        Ok(())
    }

    /// Whether a file that was read decides a stage: not what the stage wrote itself, and not what is kept between runs.
    fn is_input(&self, path: &Path, folder: &Path) -> bool {
        let within = |folder: &Path| {
            std::path::absolute(folder).is_ok_and(|folder| path.starts_with(folder))
        };
        let cache = ShapeCache::of_user();
        let is_cached = cache.folder().is_some_and(within);
        let is_record = path.file_name().is_some_and(|name| name == STAGE_FILE);
        !(within(folder) || is_cached || is_record)
    }

    fn context(&self, settings: &RunSettings) -> StageContext<'_> {
        StageContext {
            recipe: &self.recipe,
            output: &self.output,
            threads: settings.threads,
            quiet: settings.quiet,
            cache: settings.cache,
        }
    }

    /// Writes page and `run.json`, unless they are there and tell the same.
    fn finish(
        &self,
        stages: Vec<RunStageRecord>,
        no_answer: Option<NoAnswerRecord>,
        settings: &RunSettings,
        task: &Task,
    ) -> Result<RunFile> {
        if let Some(kept) = self.kept_page(&stages) {
            return Ok(RunFile { stages, ..kept });
        }
        self.forget_page()?;
        let read = ReadFiles::begin();
        write_run_page(&self.context(settings), &stages, no_answer.as_ref(), &self.page(), task)?;
        let inputs = read.finish().into_iter().chain([self.recipe_file.clone()]);
        let page_inputs = hashes(inputs, &self.output);
        let page = FileHash::of(&self.page(), &self.output)
            .ok_or_else(|| io(&self.page())(std::io::ErrorKind::NotFound.into()))?;
        let (format, version) = (RUN_FORMAT.into(), VERSION.into());
        let file = RunFile { format, version, stages, no_answer, page, page_inputs };
        file.write(&self.output)?;
        Ok(file)
    }

    /// The record of a page that tells of these stages.
    fn kept_page(&self, stages: &[RunStageRecord]) -> Option<RunFile> {
        let kept = RunFile::read(&self.output).ok()?;
        let told = |stages: &[RunStageRecord]| -> Vec<RunStageRecord> {
            let kept = |stage: &RunStageRecord| RunStageRecord {
                state: StageState::Kept,
                ..stage.clone()
            };
            stages.iter().map(kept).collect()
        };
        let all_kept = stages.iter().all(|stage| stage.state == StageState::Kept);
        let same = told(&kept.stages) == stages && kept.version == VERSION;
        let hold = kept.page_inputs.iter().chain([&kept.page]).all(|hash| hash.holds(&self.output));
        (all_kept && same && hold).then_some(kept)
    }

    /// Removes what tells of an earlier run.
    fn forget_page(&self) -> Result<()> {
        [RUN_FILE, PAGE_FILE].iter().try_for_each(|name| remove(&self.output.join(name)))
    }

    /// Refuses results in the place of what the recipe names.
    fn check_output(&self) -> Result<()> {
        let paths = self.recipe.paths();
        let inputs: Vec<&Path> = paths
            .iter()
            .map(|NamedPath { path, .. }| path.as_path())
            .chain([self.recipe_file.as_path()])
            .collect();
        refuse_to_overwrite(&[RUN_FILE, PAGE_FILE].map(|name| self.output.join(name)), &inputs)?;
        for stage in Stage::ALL {
            let folder = self.folder(stage);
            let inside =
                |input: &&&Path| input.parent().is_some_and(|parent| is_same_file(parent, &folder));
            if let Some(input) = inputs.iter().find(inside) {
                let expected = "inputs outside of the folders of the stages (choose another -o)";
                let found = format!("{}, which the recipe names", input.display());
                return Err(FormatError::new(&folder, "output", expected, found).into());
            }
        }
        Ok(())
    }
}

/// A failure of the system with a path.
fn io(path: &Path) -> impl Fn(std::io::Error) -> GeomError {
    let path = path.to_owned();
    move |source| GeomError::Io { path: path.clone(), source }
}

/// Names of the files in a folder.
fn names_in(folder: &Path) -> Result<Vec<String>> {
    let entries = fs::read_dir(folder).map_err(io(folder))?.flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| entry.path().is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    Ok(names)
}

/// Removes a file, where it is there.
fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::from(io(path)(error)))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_is_told_to_stop_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        fs::write(at("mug.obj"), mesh).unwrap();
        let recipe = "[demonstration]\nmesh = 'mug.obj'\nnear = [0, 0, 0]\nradius = 0.5\n\
                      [target]\nmesh = 'mug.obj'\n";
        fs::write(at("demo.toml"), recipe).unwrap();
        let run = Run::open(&at("demo.toml"), &at("out")).unwrap();
        let earlier = at("out/region/region.json");
        fs::create_dir_all(earlier.parent().unwrap()).unwrap();
        fs::write(&earlier, "of an earlier run").unwrap();
        let task = Task::default();
        let mut stop = |_: RunProgress<'_>| task.cancel();
        let error = run.carry_out(&RunSettings::default(), &mut stop, &task).unwrap_err();
        assert_eq!(error.code(), "cancelled", "{error}");
        assert_eq!(fs::read_to_string(&earlier).unwrap(), "of an earlier run");
        assert_eq!(fs::read_dir(at("out/region")).unwrap().count(), 1);
    }
}
