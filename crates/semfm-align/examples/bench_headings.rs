//! Counts how often a pose is accepted whose labelled part lies elsewhere, and how often a pose
//! that is well seen is accepted: mugs, bottles and boxes at random headings and elevations.
//!
//! `cargo run -p semfm-align --example bench_headings -- N [MESH.obj…]`
//!
//! N views of each procedural object and of each mesh given (metres; labelled is what stands out of
//! the cylinder that holds most of it: a mug's or a pitcher's handle).
#![allow(clippy::print_stdout)]

#[path = "../tests/objects/mod.rs"]
mod objects;

use std::f64::consts::TAU;

use cpu_time::ProcessTime;
use objects::{Labelled, Mug, bottle, cuboid, label_error, lumpy, mug, render, view};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_align::{AlignModel, AlignSettings, ObservedCloud, Verdict, align_model};
use semfm_geom::Task;
use semfm_geom::io::read_mesh;
use semfm_geom::math::DVec3;

struct Case {
    name: String,
    /// What stands before the camera.
    object: Labelled,
    /// What is aligned to it.
    model: Labelled,
}

#[derive(Default)]
struct Counts {
    n: usize,
    accepted: usize,
    accepted_wrong: usize,
    refused: usize,
    right: usize,
}

/// A labelled part off by more is in another place, metres.
const OFF: f64 = 0.005;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let n_views: u64 = arguments.next().map_or(Ok(10), |n| n.parse())?;
    let names: Vec<String> = arguments.collect();
    let verbose = std::env::var_os("VERBOSE").is_some();
    let mut totals: [Counts; 3] = Default::default();
    let mut spent = Vec::new();
    let filter = std::env::var("CASE").unwrap_or_default();
    for case in cases(&names)? {
        if !case.name.contains(&filter) {
            continue;
        }
        let mut counts: [Counts; 3] = Default::default();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let model = AlignModel::new(&case.model.mesh, 0, &Task::default())?;
        let only: Option<u64> = std::env::var("ONLY").ok().and_then(|s| s.parse().ok());
        for seed in 0..n_views {
            let heading = TAU * rng.random::<f64>();
            let elevation = rng.random::<f64>() * 0.9 - 0.1;
            let down = rng.random::<f64>() < 0.25;
            let size = case.object.mesh.bounding_sphere().1;
            let pose = view(&case.object.mesh, 1.0, heading, elevation, down, 4.5 * size.max(0.06));
            let noise = [0.0, 0.0007, 0.0015][rng.random_range(0..3)];
            let seen = render(&case.object, &pose, noise, 1.5, seed);
            let observed = if rng.random::<f64>() < 0.5 {
                ObservedCloud::from_depth(&seen.image, &objects::camera(), Some(&seen.mask))?
            } else {
                let points = seen.image.points(&objects::camera(), Some(&seen.mask))?.object;
                ObservedCloud::from_view(&points, DVec3::ZERO)?
            };
            let init = (rng.random::<f64>() < 0.3).then_some(pose);
            let settings = AlignSettings { init, seed, ..AlignSettings::default() };
            if only.is_some_and(|only| only != seed) {
                continue;
            }
            let cpu = ProcessTime::now();
            let found = align_model(&model, &observed, &settings, &Task::default())?;
            let ms = cpu.elapsed().as_secs_f64() * 1e3;
            if init.is_none() {
                spent.push(ms);
            }
            let error = label_error(&case.object, &pose, &found.camera_from_object);
            let class = match seen.labelled_share {
                s if s < 0.002 => 0,
                s if s < 0.03 => 1,
                _ => 2,
            };
            for counts in [&mut counts[class], &mut totals[class]] {
                let accepted = found.verdict == Verdict::Accept;
                counts.n += 1;
                counts.right += usize::from(error <= OFF);
                counts.accepted += usize::from(accepted);
                counts.accepted_wrong += usize::from(accepted && error > OFF);
                counts.refused += usize::from(found.verdict == Verdict::Refuse);
            }
            let odd = (found.verdict == Verdict::Accept) != (class == 2 && error <= OFF);
            if verbose && odd {
                println!(
                    "    {} {seed}: shown {:.3} off {:.1} mm, {} std {:.4} rival {:.3} init {} elev {elevation:.2} down {down} noise {noise} {:?} {ms:.0} ms",
                    case.name,
                    seen.labelled_share,
                    1e3 * error,
                    found.verdict,
                    found.rotation_std,
                    found.rival,
                    init.is_some(),
                    found.reasons
                );
            }
        }
        print_counts(&case.name, &counts);
    }
    print_counts("all", &totals);
    spent.sort_by(f64::total_cmp);
    spent.push(0.0);
    let at = |share: f64| spent[((spent.len() - 1) as f64 * share) as usize];
    println!("without a guess: median {:.0} ms, 95 % {:.0} ms", at(0.5), at(0.95));
    Ok(())
}

fn print_counts(name: &str, counts: &[Counts; 3]) {
    print!("{name:24}");
    for (class, Counts { n, accepted, accepted_wrong, refused, right }) in
        ["hidden", "sliver", "seen"].iter().zip(counts)
    {
        print!(
            " | {class} {n}: right {right} accepted {accepted} (wrong {accepted_wrong}) refused {refused}"
        );
    }
    println!();
}

fn cases(meshes: &[String]) -> Result<Vec<Case>, Box<dyn std::error::Error>> {
    let mut cases = Vec::new();
    let mut same = |name: &str, object: Labelled| {
        let model = Labelled { mesh: object.mesh.clone(), labelled: object.labelled.clone() };
        cases.push(Case { name: name.into(), object, model });
    };
    same("mug", mug(Mug::default(), 64));
    same("mug, 24 segments", mug(Mug::default(), 24));
    let tall = Mug { radius: 0.03, height: 0.12, taper: 0.75, handle: 0.025, ..Mug::default() };
    same("tall mug, tapered", mug(tall, 72));
    same(
        "wide cup",
        mug(Mug { radius: 0.055, height: 0.06, taper: 0.6, handle: 0.02, ..Mug::default() }, 64),
    );
    same("bottle", bottle(64));
    same("tumbler", mug(Mug { handle: 0.0, taper: 0.8, ..Mug::default() }, 64));
    same("box", cuboid(DVec3::new(0.04, 0.1, 0.16)));
    for (height, name) in [(0.0005, "mug, lumps .5 mm"), (0.0015, "mug, lumps 1.5 mm")] {
        let object = mug(Mug::default(), 64);
        let model = lumpy(&object, height, 3);
        cases.push(Case { name: name.into(), object, model });
    }
    let object = lumpy(&mug(Mug::default(), 64), 0.001, 5);
    let model = Labelled { mesh: object.mesh.clone(), labelled: object.labelled.clone() };
    cases.push(Case { name: "lumpy mug, true model".into(), object, model });
    for path in meshes {
        let mesh = read_mesh(path)?.mesh;
        let labelled = standing_out(mesh.vertices());
        let name = path.split('/').rev().nth(1).unwrap_or(path).to_owned();
        let copy = Labelled { mesh: mesh.clone(), labelled: labelled.clone() };
        cases.push(Case { name, object: Labelled { mesh, labelled }, model: copy });
    }
    Ok(cases)
}

/// Vertices beyond 1.25 times the median distance from the vertical line through the middle.
fn standing_out(points: &[DVec3]) -> Vec<u32> {
    let median = |mut x: Vec<f64>| {
        x.sort_by(f64::total_cmp);
        x[x.len() / 2]
    };
    let [cx, cy] = [0, 1].map(|k| median(points.iter().map(|p| p[k]).collect()));
    let away = |p: &DVec3| (p.x - cx).hypot(p.y - cy);
    let middle = median(points.iter().map(away).collect());
    (0..points.len() as u32).filter(|&i| away(&points[i as usize]) > 1.25 * middle).collect()
}
