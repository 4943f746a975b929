//! Follows meshes through rendered depth sequences with noise and prints what came of it: a table of the scripts, how often
//! poses of each probability were right, and how the told uncertainty compares with the true errors.
//!
//! `RAYON_NUM_THREADS=2 cargo run --release -p semfm-track --example bench_track -- [--records FILE] [--poses FILE] MESH...`
//!
//! `--records` writes a JSON line for each frame; `--poses` one for each of many poses near and far from the truth, made
//! better and examined: what `bench/track.py` fits the probability to.
#![allow(clippy::print_stdout)]

#[path = "../tests/scenes/mod.rs"]
mod scenes;

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::time::Instant;

use cpu_time::ProcessTime;
use nalgebra::{Matrix3, Matrix6, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use scenes::{FRAMES, Moment, Scene, Script};
use semfm_align::Sim3;
use semfm_geom::Task;
use semfm_geom::io::read_mesh;
use semfm_geom::math::{DQuat, DVec3};
use semfm_track::{DepthFrame, PoseEvidence, TrackRecord, TrackSettings, TrackState, Tracker};
use serde_json::{Value, json};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Diagonal of the objects, metres, and width of the pictures.
const SIZE: f64 = 0.22;
const WIDTH: u32 = 640;

/// Poses examined in each scene with `--poses`.
const POSES: usize = 60;

const SCRIPTS: [Script; 9] = [
    Script::Still,
    Script::Moving,
    Script::Hidden(0.2),
    Script::Hidden(0.5),
    Script::Hidden(0.8),
    Script::Hidden(1.0),
    Script::Pushed,
    Script::Removed,
    Script::Stolen,
];

/// One frame of a run.
struct Measured {
    record: TrackRecord,
    /// Whether the pose is right; `None` where there is none.
    right: Option<bool>,
    /// Mean distance of its surface from where it is, metres.
    surface: Option<f64>,
    /// How far its middle is from where it is, metres.
    middle: Option<DVec3>,
    /// The errors against the told covariance.
    normalized: Option<NormalizedError>,
    cpu_ms: f64,
    wall_ms: f64,
}

/// Squared errors in units of the told covariance C about the object's middle, eᵀ C⁻¹ e: of position and rotation (3 degrees
/// of freedom each), and of both (6). Chi-squared where C is right.
#[derive(Clone, Copy)]
struct NormalizedError {
    position: f64,
    rotation: f64,
    pose: f64,
}

fn main() -> Result<()> {
    let mut meshes: Vec<PathBuf> = Vec::new();
    let (mut records, mut poses) = (None, None);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut file = || -> Result<_> {
            Ok(BufWriter::new(File::create(words.next().ok_or("expected a file")?)?))
        };
        match word.as_str() {
            "--records" => records = Some(file()?),
            "--poses" => poses = Some(file()?),
            mesh => meshes.push(mesh.into()),
        }
    }
    if meshes.is_empty() {
        return Err("usage: bench_track [--records FILE] [--poses FILE] MESH...".into());
    }
    let mut runs: Vec<Vec<Vec<Measured>>> = SCRIPTS.iter().map(|_| Vec::new()).collect();
    for (number, path) in meshes.iter().enumerate() {
        let mesh = read_mesh(path)?.mesh;
        let mut rng = ChaCha8Rng::seed_from_u64(number as u64);
        let rotation = any_rotation(&mut rng);
        let scene = Scene::new(&mesh, SIZE, WIDTH).standing(rotation);
        if let Some(file) = &mut poses {
            examine(file, &scene, rotation, &mut rng)?;
        }
        for (script, runs) in SCRIPTS.iter().zip(&mut runs) {
            let run = follow(&scene, *script, rotation)?;
            if let Some(file) = &mut records {
                for frame in &run {
                    let line = line_of(&frame.record.evidence, scene.diameter(), frame.right);
                    let state = frame.record.state.name();
                    let name = path.display().to_string();
                    writeln!(
                        file,
                        "{}",
                        json!({"mesh": name, "script": script.name(), "state": state, "frame": frame.record.frame, "p": frame.record.probability, "of": line})
                    )?;
                }
            }
            runs.push(run);
        }
    }
    print_scripts(&runs);
    print_calibration(&runs);
    print_uncertainty(&runs);
    Ok(())
}

fn any_rotation(rng: &mut ChaCha8Rng) -> DQuat {
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    DQuat::from_xyzw(normal(), normal(), normal(), normal()).normalize()
}

fn follow(scene: &Scene, script: Script, rotation: DQuat) -> Result<Vec<Measured>> {
    let task = Task::default();
    let first = script.moment(scene, rotation, 0).pose.ok_or("no object at first")?;
    let settings = TrackSettings { init: Some(first), ..Default::default() };
    let mut tracker = Tracker::new(&scene.mesh, &settings, &task)?;
    let mut run = Vec::new();
    for frame in 0..FRAMES {
        let moment = script.moment(scene, rotation, frame);
        let depth = scene.depth(&moment, frame as u64);
        let seen =
            DepthFrame { depth: &depth, camera: &scene.camera, mask: None, time_nanos: None };
        let (cpu, wall) = (ProcessTime::now(), Instant::now());
        let record = tracker.step(&seen, &task)?;
        let (cpu, wall) = (cpu.elapsed().as_secs_f64(), wall.elapsed().as_secs_f64());
        let right =
            record.camera_from_object.map(|found| scene.is_right(&found, moment.pose.as_ref()));
        let surface = record
            .camera_from_object
            .zip(moment.pose)
            .map(|(found, truth)| scene.surface_error(&found, &truth));
        let normalized = moment.pose.and_then(|truth| normalized_error(scene, &record, &truth));
        let middle = record
            .camera_from_object
            .zip(moment.pose)
            .map(|(found, truth)| found.apply(scene.centre()) - truth.apply(scene.centre()));
        run.push(Measured {
            record,
            right,
            surface,
            middle,
            normalized: normalized.filter(|_| right == Some(true)),
            cpu_ms: 1e3 * cpu,
            wall_ms: 1e3 * wall,
        });
    }
    Ok(run)
}

/// The error of a pose that was seen in this frame; `None` for another.
fn normalized_error(scene: &Scene, record: &TrackRecord, truth: &Sim3) -> Option<NormalizedError> {
    let found = record.camera_from_object.filter(|_| record.state.is_seen())?;
    let about_origin = Matrix6::from_row_slice(record.covariance?.as_flattened());
    // The middle moves by v + ω × r where the origin moves by v and the object turns by ω.
    let r = found.rotation * scene.centre();
    let mut to_middle = Matrix6::identity();
    let cross = Matrix3::new(0.0, r.z, -r.y, -r.z, 0.0, r.x, r.y, -r.x, 0.0);
    to_middle.fixed_view_mut::<3, 3>(0, 3).copy_from(&cross);
    let covariance = to_middle * about_origin * to_middle.transpose();
    let shift = found.apply(scene.centre()) - truth.apply(scene.centre());
    let turn = found.rotation * truth.rotation.inverse();
    let turn = if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis();
    let error = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
    let of_block = |at: usize| -> Option<f64> {
        let block = covariance.fixed_view::<3, 3>(at, at).into_owned();
        let error = error.fixed_rows::<3>(at).into_owned();
        Some(error.dot(&block.cholesky()?.solve(&error)))
    };
    Some(NormalizedError {
        position: of_block(0)?,
        rotation: of_block(3)?,
        pose: error.dot(&covariance.cholesky()?.solve(&error)),
    })
}

/// Poses at all distances from the truth, partly hidden, made better and examined.
fn examine(
    file: &mut impl Write,
    scene: &Scene,
    rotation: DQuat,
    rng: &mut ChaCha8Rng,
) -> Result<()> {
    let settings = TrackSettings { scale: Some(1.0), ..Default::default() };
    let tracker = Tracker::new(&scene.mesh, &settings, &Task::default())?;
    let still = Script::Still.moment(scene, rotation, 0);
    let truth = still.pose.ok_or("no object")?;
    for hidden in [0.0, 0.3, 0.6, 0.85] {
        for away in [false, true] {
            let moment = Moment { pose: still.pose.filter(|_| !away), hidden };
            let depth = scene.depth(&moment, rng.random());
            let frame =
                DepthFrame { depth: &depth, camera: &scene.camera, mask: None, time_nanos: None };
            for i in 0..if away { POSES / 4 } else { POSES } {
                let far = 10f64.powf(rng.random::<f64>() * 2.5 - 2.5);
                let axis = any_rotation(rng) * DVec3::X;
                let turn =
                    DQuat::from_axis_angle(axis, (10.0 * far).min(3.0) * rng.random::<f64>());
                let shift = 0.3 * far * (any_rotation(rng) * DVec3::X);
                let start = Sim3 {
                    rotation: turn * truth.rotation,
                    translation: truth.translation + shift * f64::from(u8::from(i % 3 > 0)),
                    ..truth
                };
                let Some(found) = tracker.examine(&frame, &start)? else { continue };
                let right = scene.is_right(&found.camera_from_object, moment.pose.as_ref());
                writeln!(file, "{}", line_of(&found.evidence, scene.diameter(), Some(right)))?;
            }
        }
    }
    Ok(())
}

fn line_of(evidence: &PoseEvidence, diameter: f64, right: Option<bool>) -> Value {
    json!({
        "visible": evidence.visible_share,
        "hidden": evidence.hidden_share,
        "through": evidence.through_share,
        "outline": evidence.outline_share,
        "residual": evidence.residual,
        "probability": evidence.probability,
        "diameter": diameter,
        "right": right,
    })
}

fn print_scripts(runs: &[Vec<Vec<Measured>>]) {
    println!(
        "| run | seen | hidden | lost | false | again after | surface mm | middle mm | jitter mm | cpu ms | wall ms |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for (script, runs) in SCRIPTS.iter().zip(runs) {
        let all: Vec<&Measured> = runs.iter().flatten().collect();
        let share = |of: &dyn Fn(&Measured) -> bool| {
            let n = all.iter().filter(|frame| of(frame)).count();
            format!("{:.0} %", 100.0 * n as f64 / all.len().max(1) as f64)
        };
        let n_false =
            all.iter().filter(|f| f.record.state.is_seen() && f.right != Some(true)).count();
        let mut again: Vec<f64> =
            runs.iter().filter_map(|run| frames_to_again(*script, run)).collect();
        let n_again = again.len();
        let mut middles = Vec::new();
        let mut jumps = Vec::new();
        for run in runs {
            let mut last: Option<DVec3> = None;
            for frame in run.iter().filter(|frame| frame.record.state.is_seen()) {
                let Some(off) = frame.middle else { continue };
                middles.push(1e3 * off.length());
                jumps.extend(last.map(|last| 1e3 * off.distance(last)));
                last = Some(off);
            }
        }
        let mut cpu: Vec<f64> = all.iter().map(|frame| frame.cpu_ms).collect();
        let mut wall: Vec<f64> = all.iter().map(|frame| frame.wall_ms).collect();
        let seen = all.iter().filter(|frame| frame.record.state.is_seen());
        let mut surface: Vec<f64> = seen.filter_map(|f| f.surface).map(|d| 1e3 * d).collect();
        let again = if n_again == 0 {
            "–".into()
        } else {
            format!(
                "{} ({n_again} of {}, most {})",
                pair(&mut again, 0).0,
                runs.len(),
                again.last().copied().unwrap_or(0.0)
            )
        };
        let two = |values: &mut Vec<f64>| {
            let (half, most) = pair(values, 1);
            format!("{half} / {most}")
        };
        println!(
            "| {} | {} | {} | {} | {n_false} | {again} | {} | {} | {} | {} | {} |",
            script.name(),
            share(&|f| f.record.state.is_seen()),
            share(&|f| f.record.state == TrackState::Occluded),
            share(&|f| f.record.state == TrackState::Lost),
            two(&mut surface),
            two(&mut middles),
            two(&mut jumps),
            two(&mut cpu),
            two(&mut wall),
        );
    }
}

/// Median and 95th percentile, with so many digits; the values are sorted.
fn pair(values: &mut [f64], digits: usize) -> (String, String) {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let value = values.get((share * values.len() as f64) as usize).or(values.last());
        value.map_or("–".to_owned(), |value| format!("{value:.digits$}"))
    };
    (at(0.5), at(0.95))
}

/// Frames from the push, or from the return, to the first that sees the object where it is.
fn frames_to_again(script: Script, run: &[Measured]) -> Option<f64> {
    let from = match script {
        Script::Pushed => 20,
        Script::Removed => 35,
        _ => return None,
    };
    let seen = run[from..].iter().position(|f| f.record.state.is_seen() && f.right == Some(true));
    seen.map(|n| n as f64)
}

fn print_calibration(runs: &[Vec<Vec<Measured>>]) {
    println!("\n| probability | frames | mean | right |");
    println!("| --- | --- | --- | --- |");
    let all: Vec<(f64, bool)> = runs
        .iter()
        .flatten()
        .flatten()
        .filter_map(|frame| frame.right.map(|right| (frame.record.probability, right)))
        .collect();
    let mut error = 0.0;
    for [low, high] in [[0.0, 0.5], [0.5, 0.8], [0.8, 0.9], [0.9, 0.95], [0.95, 0.99], [0.99, 1.01]]
    {
        let here: Vec<&(f64, bool)> = all.iter().filter(|(p, _)| (low..high).contains(p)).collect();
        let n = here.len() as f64;
        if here.is_empty() {
            continue;
        }
        let mean = here.iter().map(|(p, _)| p).sum::<f64>() / n;
        let right = here.iter().filter(|(_, right)| *right).count() as f64 / n;
        error += (mean - right).abs() * n / all.len() as f64;
        println!("| {low} to {:.2} | {n} | {mean:.3} | {right:.3} |", high.min(1.0));
    }
    println!("\nexpected calibration error {error:.3} over {} poses", all.len());
}

/// Median of chi-squared, and the value that 95 % of it do not exceed, with 3 and with 6 degrees of freedom.
const CHI_SQUARED: [[f64; 2]; 2] = [[2.366, 7.815], [5.348, 12.592]];

/// How many times larger the covariance should have been (by the median), and how many errors lie within its 95 % bound.
fn print_uncertainty(runs: &[Vec<Vec<Measured>>]) {
    println!("\n| uncertainty of | poses | covariance too small by | within the 95 % bound |");
    println!("| --- | --- | --- | --- |");
    for (script, runs) in SCRIPTS.iter().zip(runs) {
        let frames: Vec<&Measured> = runs.iter().flatten().collect();
        print_uncertainty_of(&script.name(), &frames);
    }
    let all: Vec<&Measured> = runs.iter().flatten().flatten().collect();
    print_uncertainty_of("all", &all);
}

fn print_uncertainty_of(name: &str, frames: &[&Measured]) {
    let errors: Vec<NormalizedError> = frames.iter().filter_map(|f| f.normalized).collect();
    if errors.is_empty() {
        return;
    }
    let of = |value: fn(&NormalizedError) -> f64, [median, bound]: [f64; 2]| {
        let mut values: Vec<f64> = errors.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        let within = values.iter().filter(|v| **v <= bound).count();
        let share = 100.0 * within as f64 / values.len() as f64;
        (values[values.len() / 2] / median, share)
    };
    let rows = [
        of(|e| e.position, CHI_SQUARED[0]),
        of(|e| e.rotation, CHI_SQUARED[0]),
        of(|e| e.pose, CHI_SQUARED[1]),
    ];
    let factors = rows.map(|(factor, _)| format!("{factor:.2}")).join(" / ");
    let shares = rows.map(|(_, share)| format!("{share:.0} %")).join(" / ");
    println!("| {name}: position / rotation / both | {} | {factors} | {shares} |", errors.len());
}
