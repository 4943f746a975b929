//! Medians of rendering and lifting on a given OBJ mesh, and contact sheets of the rig to look at.
//!
//! `cargo run --release -p semfm-views --example bench_render -- MESH.obj [SHEET.png]`
#![allow(clippy::print_stdout)]

use std::time::Instant;

use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Task};
use semfm_views::{
    Camera, EmbeddedView, LiftSettings, Paint, PatchEmbeddings, RenderSettings, RigSettings, View,
    lift, render, rig,
};

const REPEATS: usize = 15;
const DIM: usize = 416;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("usage: bench_render MESH.obj [SHEET.png]")?;
    let mesh = read_obj(&std::fs::read_to_string(path)?)?;
    println!("{} vertices, {} triangles", mesh.n_vertices(), mesh.n_faces());
    let (settings, task) = (RenderSettings::default(), Task::default());
    let draw = |cameras: &[Camera]| render(&mesh, &Paint::GREY, cameras, &settings, &task);

    let default = rig(&mesh, &RigSettings::default())?;
    let large = rig(&mesh, &RigSettings { count: 12, size: 448, ..Default::default() })?;
    report("rig of 14", || rig(&mesh, &RigSettings::default()).map(drop))?;
    report("render 14 views at 224 px", || draw(&default).map(drop))?;
    report("render 12 views at 448 px", || draw(&large).map(drop))?;

    bench_driver(&mesh, [("14 views at 224 px", &default), ("12 views at 448 px", &large)])?;

    let views = draw(&default)?;
    let embedded: Vec<EmbeddedView> = views.iter().map(noise_tokens).collect();
    for (name, settings) in
        [("pull", LiftSettings::default()), ("unproject", LiftSettings::paper())]
    {
        let mut seen = 0;
        report(&format!("lift by {name}, 14 views, d = {DIM}"), || {
            seen = lift(&mesh, &embedded, &settings, &task)?.report.n_seen;
            Ok(())
        })?;
        println!("    {seen} of {} samples seen", settings.n_samples);
    }
    if let Some(sheet) = arguments.next() {
        save_sheet(&views, &sheet)?;
    }
    Ok(())
}

/// The same pictures by a graphics driver, where there is one.
#[cfg(feature = "gpu")]
fn bench_driver(mesh: &Mesh, shots: [(&str, &Vec<Camera>); 2]) -> semfm_views::Result<()> {
    let start = Instant::now();
    let gpu = match semfm_views::GpuRenderer::new() {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("{error}");
            return Ok(());
        }
    };
    println!("{} opened in {:.0} ms", gpu.name(), start.elapsed().as_secs_f64() * 1e3);
    let (settings, task) = (RenderSettings::default(), Task::default());
    for (name, cameras) in shots {
        report(&format!("driver: {name}"), || {
            gpu.render(mesh, &Paint::GREY, cameras, &settings, &task).map(drop)
        })?;
    }
    Ok(())
}

#[cfg(not(feature = "gpu"))]
fn bench_driver(_: &Mesh, _: [(&str, &Vec<Camera>); 2]) -> semfm_views::Result<()> {
    Ok(())
}

/// Wall and process CPU time, medians.
fn report(
    name: &str,
    mut work: impl FnMut() -> semfm_views::Result<()>,
) -> semfm_views::Result<()> {
    let mut times = Vec::new();
    for _ in 0..REPEATS {
        let (wall, cpu) = (Instant::now(), cpu_seconds());
        work()?;
        times.push((wall.elapsed().as_secs_f64(), cpu_seconds() - cpu));
    }
    let median = |pick: fn(&(f64, f64)) -> f64| {
        let mut values: Vec<f64> = times.iter().map(pick).collect();
        values.sort_by(f64::total_cmp);
        values[REPEATS / 2] * 1e3
    };
    println!("{name}: {:.1} ms wall, {:.1} ms CPU", median(|t| t.0), median(|t| t.1));
    Ok(())
}

/// CPU time of all threads of this process, from Linux's scheduler statistics; 0 elsewhere.
fn cpu_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return 0.0 };
    let nanos = |thread: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    threads.flatten().filter_map(nanos).sum::<f64>() / 1e9
}

/// Tokens of the right shape without an encoder: patches of 16 pixels.
fn noise_tokens(view: &View) -> EmbeddedView {
    let side = view.camera.width as usize / 16;
    let patches = PatchEmbeddings {
        rows: side,
        cols: side,
        dim: DIM,
        data: (0..side * side * DIM).map(|i| (i as f32 * 0.37).sin()).collect(),
        rect: [0.0, 0.0, view.camera.width as f32, view.camera.height as f32],
        coverage: vec![255; side * side],
        valid: vec![true; side * side],
    };
    EmbeddedView { camera: view.camera, patches }
}

fn save_sheet(views: &[View], path: &str) -> image::ImageResult<()> {
    let side = views[0].camera.width;
    let columns = 5;
    let mut sheet =
        image::RgbImage::new(side * columns, side * (views.len() as u32).div_ceil(columns));
    for (k, view) in (0u32..).zip(views) {
        for (pixel, rgb) in (0u32..).zip(view.rgb.chunks_exact(3)) {
            let (u, v) = (k % columns * side + pixel % side, k / columns * side + pixel / side);
            sheet.put_pixel(u, v, image::Rgb([rgb[0], rgb[1], rgb[2]]));
        }
    }
    sheet.save(path)
}

/// Positions and triangles of a plain OBJ file: enough for a benchmark.
fn read_obj(text: &str) -> Result<Mesh, Box<dyn std::error::Error>> {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let xyz = words.take(3).map(str::parse).collect::<Result<Vec<f64>, _>>()?;
                vertices.push(DVec3::from_slice(&xyz));
            }
            Some("f") => {
                let ids = words
                    .map(|word| {
                        word.split('/').next().unwrap_or_default().parse::<u32>().map(|id| id - 1)
                    })
                    .collect::<Result<Vec<u32>, _>>()?;
                faces.extend((2..ids.len()).map(|k| [ids[0], ids[k - 1], ids[k]]));
            }
            _ => {}
        }
    }
    Ok(Mesh::new(vertices, faces)?)
}
