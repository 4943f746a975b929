//! One demonstration, many objects: what is costly is done once, and can be watched and stopped.
//!
//! Preparing an object (cleaning, Laplacian, eigenbasis, parts) depends on nothing but that object.
//! A robot that was shown one tool keeps it prepared, prepares whatever lies before it, matches the
//! two, and transfers any number of regions with the match.
//!
//! `cargo run --release -p semfm --example reuse_prepared`
#![allow(clippy::print_stdout, reason = "the answers are what this program is for")]

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use semfm::geom::math::DVec3;
use semfm::geom::zoo::icosphere;
use semfm::{FeatureSource, Matching, Mesh, PipelineSettings, PreparedObject, Region, Task};

fn main() -> Result<(), Box<dyn Error>> {
    let settings = PipelineSettings::default();

    // Whoever holds the flag can stop the work: here a watchdog, on a robot its emergency stop.
    let stop = Arc::new(AtomicBool::new(false));
    let reports = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&reports);
    let task = Task::with_progress(move |_progress| {
        counter.fetch_add(1, Ordering::Relaxed); // a real listener moves a bar: stage, done, total
    })
    .with_cancel_flag(Arc::clone(&stop));
    let watchdog = Arc::clone(&stop);
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(30));
        watchdog.store(true, Ordering::Relaxed);
    });

    // Once: the demonstrated tool and its regions.
    let source = tool(2.0, 0.4, &settings, &task)?;
    let mesh = source.shape().original();
    let (low, high) = mesh.bounds();
    let share = |p: &DVec3| (p.x - low.x) / (high.x - low.x);
    let grip: Vec<bool> = mesh.vertices().iter().map(|p| share(p) < 0.4).collect();
    let head: Vec<bool> = mesh.vertices().iter().map(|p| share(p) > 0.8).collect();
    let regions = [("grip", Region::from_mask(&grip)), ("head", Region::from_mask(&head))];

    // For each object that turns up: prepare it, match it, transfer every region.
    for (length, thickness) in [(1.2, 0.6), (2.5, 0.3), (3.0, 0.5)] {
        let target = tool(length, thickness, &settings, &task)?;
        let matching = Matching::new(&source, &target, &settings.transfer, &task)?;
        for (name, region) in &regions {
            let transferred = matching.transfer(region)?;
            println!(
                "handle {length} × {thickness}: {name} on {} vertices, {} ({:.2})",
                transferred.region.vertices().len(),
                transferred.verdict,
                transferred.confidence
            );
        }
    }
    println!("{} progress reports", reports.load(Ordering::Relaxed));

    // Stopped work comes back at once, with an error that says so.
    stop.store(true, Ordering::Relaxed);
    match tool(1.0, 0.5, &settings, &task) {
        Err(error) => println!("stopped: {error}"),
        Ok(_) => return Err("a stopped preparation went on to its end".into()),
    }
    Ok(())
}

/// A tool along x whose features tell its handle from its head, as an encoder's would.
fn tool(
    length: f64,
    thickness: f64,
    settings: &PipelineSettings,
    task: &Task,
) -> semfm::Result<PreparedObject> {
    let sphere = icosphere(4);
    let drawn_out = sphere.vertices().iter().map(|&p| {
        let handle = (-3.0 * p.x).clamp(0.0, 1.0);
        let narrow = 1.0 + (thickness - 1.0) * handle;
        let x = if p.x < 0.0 { p.x * length } else { p.x };
        DVec3::new(x, p.y * narrow, p.z * narrow)
    });
    let mesh = Mesh::new(drawn_out.collect(), sphere.faces().to_vec())?;
    let near = |x: f64, centre: f64| (-8.0 * (x - centre).powi(2)).exp() as f32;
    let places = [-1.0, -0.5, 0.0, 0.5, 1.0];
    let features: Vec<f32> =
        sphere.vertices().iter().flat_map(|p| places.map(|centre| near(p.x, centre))).collect();
    Ok(semfm::prepare(mesh, FeatureSource::PerVertex(&features), settings, task)?.object)
}
