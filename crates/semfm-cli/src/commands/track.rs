//! `semfm-cli track`: an object of known shape in each frame of a depth camera.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use semfm::files::{Ros2Track, TrackLine, read_pose, read_region, write_region, write_ros2_track};
use semfm::geom::io::{is_stdout, read_mesh, refuse_input};
use semfm::observe::{Observation, read_observations};
use semfm::track::{DepthFrame, TrackRecord, TrackSettings, TrackState, Tracker};
use semfm::{Mesh, Region, Task};

use super::Outcome;
use super::frame_options::{BagOptions, FrameChoice};
use crate::console;
use crate::options::Common;
use crate::output::{check_distinct, check_file};

/// Frames between two tellings of the region in the bag.
const REGION_EVERY: usize = 30;

/// Follow an object of known shape through the frames of a depth camera
///
/// Each frame becomes a line of JSON as soon as it is read: the pose with its covariance and a probability, what was seen of
/// the object, and a state that says when it is hidden or lost.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli track mug.obj recording.mcap -o track.jsonl --scale 1\n  \
    semfm-cli track kettle.obj recording.mcap -o - --init aligned.json --region out/region.json\n  \
    semfm-cli track obj_000005.ply bop/000001 -o track.jsonl --scale 0.001 --object obj5 --mcap track.mcap\n\n\
    States: new (found for the first time), tracking, occluded (hidden: the pose is the last one), lost (no pose),\n\
    reacquired (found elsewhere).\n\
    Exit code 0: the object was found. 1: in no frame. 2: bad input.")]
pub struct TrackCommand {
    /// The mesh, in any frame and any unit
    mesh: PathBuf,
    /// A bag (.mcap, or a folder of them) or the folder of a BOP scene
    source: PathBuf,
    /// Where to write the lines; `-` is stdout
    #[arg(short, long, value_name = "FILE.jsonl")]
    output: PathBuf,
    /// Write a ROS 2 bag, too: pose with covariance, TF, the lines, the region
    #[arg(long, value_name = "FILE.mcap", help_heading = "Output")]
    mcap: Option<PathBuf>,
    /// Frame of the camera in that bag
    #[arg(
        long,
        value_name = "FRAME",
        default_value = "camera",
        requires = "mcap",
        help_heading = "Output"
    )]
    camera_frame: String,
    /// A region of the mesh, whose confidence is followed, too
    #[arg(long, value_name = "region.json", help_heading = "Object")]
    region: Option<PathBuf>,
    /// Where to write the region as the frames refined it
    #[arg(long, value_name = "FILE", requires = "region", help_heading = "Output")]
    refined: Option<PathBuf>,
    /// The pose in the first frame: aligned.json or a 4 × 4 matrix, scale included [default: searched]
    #[arg(long, value_name = "FILE", help_heading = "Object")]
    init: Option<PathBuf>,
    /// Metres per unit of the mesh, 1 for a mesh in metres [default: that of --init, else from the first frame]
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Object")]
    scale: Option<f64>,
    /// The mask of the object, where the source has masks: helps to find it
    #[arg(long, value_name = "NAME", help_heading = "Object")]
    object: Option<String>,
    /// Poses that are tried in a frame in which the object is not where it was
    #[arg(long, value_name = "N", default_value_t = TrackSettings::default().hypotheses, help_heading = "Search")]
    hypotheses: usize,
    /// Seed of the mesh's samples and of the search
    #[arg(long, value_name = "N", default_value_t = TrackSettings::default().seed, help_heading = "Search")]
    seed: u64,
    #[command(flatten)]
    bag: BagOptions,
    #[command(flatten)]
    choice: FrameChoice,
}

/// A run through the frames.
struct Run<'a> {
    mesh: &'a Mesh,
    tracker: Tracker,
    lines: Lines,
    task: Task,
    quiet: bool,
    /// How often each state occurred.
    states: BTreeMap<&'static str, usize>,
    last: Option<TrackRecord>,
    mask_seen: bool,
    /// Whether it was said that a frame has no depth.
    told_of_no_depth: bool,
}

/// Where the lines go.
enum Lines {
    Stdout,
    /// A file that is made with its first line.
    File {
        path: PathBuf,
        file: Option<File>,
    },
}

impl TrackCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let lines = self.check_outputs(common)?;
        let mesh = read_mesh(&self.mesh)?.mesh;
        let region = self.region.as_deref().map(|path| read_region(path, &mesh)).transpose()?;
        let settings = TrackSettings {
            init: self.init.as_deref().map(read_pose).transpose()?,
            scale: self.scale,
            hypotheses: self.hypotheses,
            seed: self.seed,
        };
        let task = console::count(common.quiet);
        let named = || self.mesh.display().to_string();
        let mut tracker = Tracker::new(&mesh, &settings, &task).with_context(named)?;
        if let Some(region) = &region {
            tracker = tracker.with_region(region.weights())?;
        }
        let mut run = Run {
            mesh: &mesh,
            tracker,
            lines,
            task,
            quiet: common.quiet,
            states: BTreeMap::new(),
            last: None,
            mask_seen: false,
            told_of_no_depth: false,
        };
        match &self.mcap {
            None => self.frames(&mut run, None)?,
            Some(path) => {
                // Errors of the shell do not fit through the library: they wait outside.
                let mut failure = None;
                let written = write_ros2_track(path, &mesh, &self.camera_frame, |bag| {
                    self.frames(&mut run, Some(bag)).map_err(|error| {
                        failure = Some(error);
                        semfm::geom::Error::Cancelled.into()
                    })
                });
                match failure {
                    Some(error) => return Err(error),
                    None => written?,
                }
            }
        }
        self.finish(run, common)
    }

    fn check_outputs(&self, common: &Common) -> Result<Lines> {
        let mut inputs = vec![self.mesh.as_path(), self.source.as_path()];
        inputs.extend(self.region.as_deref());
        inputs.extend(self.init.as_deref());
        let further = [self.mcap.as_deref(), self.refined.as_deref()];
        for path in further.into_iter().flatten() {
            check_file(path, &inputs)?;
            check_distinct(&self.output, path)?;
        }
        if let [Some(mcap), Some(refined)] = further {
            check_distinct(mcap, refined)?;
        }
        if is_stdout(&self.output) {
            if common.json {
                bail!(
                    "-o -: the lines go to stdout, where --json wants its answer: give a file name"
                );
            }
            return Ok(Lines::Stdout);
        }
        check_file(&self.output, &inputs)?;
        Ok(Lines::File { path: self.output.clone(), file: None })
    }

    /// Reads the source and follows the object.
    fn frames(&self, run: &mut Run<'_>, mut bag: Option<&mut Ros2Track<'_, '_>>) -> Result<()> {
        let settings = self.choice.settings(&self.bag)?;
        let mut failure = None;
        let read = read_observations(&self.source, &settings, |seen| {
            self.frame(run, &seen, bag.as_deref_mut()).map_err(|error| {
                failure = Some(error);
                semfm::geom::Error::Cancelled.into()
            })
        });
        if let Some(error) = failure {
            return Err(error).with_context(|| self.source.display().to_string());
        }
        let report = read?;
        if !run.quiet {
            report.notes.iter().for_each(console::message);
        }
        if let Some(object) = self.object.as_deref().filter(|_| !run.mask_seen) {
            bail!("--object: expected a mask of some frame, found none of the name `{object}`");
        }
        Ok(())
    }

    fn frame(
        &self,
        run: &mut Run<'_>,
        seen: &Observation,
        bag: Option<&mut Ros2Track<'_, '_>>,
    ) -> Result<()> {
        let number = run.states.values().sum::<usize>();
        let depth = seen.depth_image().with_context(|| format!("frame {number}"))?;
        if !depth.has_depth() {
            run.tell_of_no_depth(number);
        }
        let mask = seen.mask_where_visible(self.object.as_deref()).context("--object")?;
        run.mask_seen |= mask.is_some();
        let frame = DepthFrame {
            depth,
            camera: seen.camera(),
            mask: mask.map(|mask| &mask.marked[..]),
            time_nanos: seen.time_nanos,
        };
        let record = run.tracker.step(&frame, &run.task)?;
        run.lines.write(&TrackLine::new(&record))?;
        if let Some(bag) = bag {
            bag.frame(&record)?;
            if number % REGION_EVERY == 0
                && let Some(weights) = run.tracker.refined_region()?
            {
                bag.region(&record, run.mesh, &weights)?;
            }
        }
        run.task.step(record.state.name(), number + 1, 0)?;
        run.tell(&record);
        *run.states.entry(record.state.name()).or_default() += 1;
        run.last = Some(record);
        Ok(())
    }

    fn finish(self, run: Run<'_>, common: &Common) -> Result<Outcome> {
        let n_frames = run.states.values().sum::<usize>();
        if n_frames == 0 {
            bail!("{}: expected at least one frame, found none", self.source.display());
        }
        run.task.step("track", n_frames, n_frames)?;
        if let (Some(path), Some(weights)) = (&self.refined, run.tracker.refined_region()?) {
            write_region(path, &Region::from_weights(weights)?, run.mesh)?;
        }
        let shares: Vec<String> =
            run.states.iter().map(|(state, n)| format!("{n} {state}")).collect();
        if !common.quiet {
            console::message(format_args!("{n_frames} frames: {}", shares.join(", ")));
        }
        let is_found = run.states.contains_key(TrackState::New.name());
        if common.json {
            console::data(serde_json::json!({
                "output": self.output.display().to_string(),
                "n_frames": n_frames,
                "states": run.states,
            }));
        } else if matches!(run.lines, Lines::File { .. }) {
            console::data(self.output.display());
            let further = [self.mcap.as_deref(), self.refined.as_deref()];
            further.into_iter().flatten().for_each(|path| console::data(path.display()));
        }
        Ok(if is_found { Outcome::Done } else { Outcome::NoAnswer })
    }
}

impl Run<'_> {
    /// Says once that frames without any depth show nothing.
    fn tell_of_no_depth(&mut self, number: usize) {
        if !(self.quiet || self.told_of_no_depth) {
            console::message(format_args!(
                "frame {number}: the depth image is empty; nothing is seen in such a frame"
            ));
        }
        self.told_of_no_depth = true;
    }

    /// Says where the state changes, and the scale where it was found.
    fn tell(&self, record: &TrackRecord) {
        let before = self.last.as_ref().map(|last| last.state);
        let goes_on =
            before.is_some_and(TrackState::is_seen) && record.state == TrackState::Tracking;
        if self.quiet || goes_on || before == Some(record.state) {
            return;
        }
        let scale = record.camera_from_object.filter(|_| record.state == TrackState::New);
        let scale = scale.map_or(String::new(), |pose| {
            format!(", {:.5} metres per unit of the mesh", pose.scale)
        });
        console::message(format_args!("frame {}: {}{scale}", record.frame, record.state));
    }
}

impl Lines {
    /// Writes a line and hands it on at once.
    fn write(&mut self, line: &TrackLine) -> Result<()> {
        let line = line.to_json();
        match self {
            Self::Stdout => console::data(line),
            Self::File { path, file } => {
                let path: &Path = path;
                let named = || path.display().to_string();
                let file = match file {
                    Some(file) => file,
                    none => {
                        // By now the files of the source are known.
                        refuse_input(path)?;
                        none.insert(File::create(path).with_context(named)?)
                    }
                };
                writeln!(file, "{line}").with_context(named)?;
            }
        }
        Ok(())
    }
}
