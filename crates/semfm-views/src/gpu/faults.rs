//! What goes wrong on purpose: drivers that are lost, too small, or out of memory.
#![allow(clippy::print_stderr, reason = "tests that say what they skipped")]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Pinhole, Task, zoo};

use super::{GpuRenderer, Restraint};
use crate::{Error, Paint, RenderSettings, Renderer, Result, RigSettings, View, render, rig};

fn open(restraint: &Restraint) -> Option<GpuRenderer> {
    match GpuRenderer::within(restraint) {
        Ok(gpu) => Some(gpu),
        Err(error @ Error::NoGpu { .. }) if std::env::var_os("SEMFM_DEMAND_GPU").is_none() => {
            eprintln!("SKIPPED: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

fn scene() -> (Mesh, Vec<Pinhole>) {
    let mesh = zoo::torus(40, 24);
    let cameras = rig(&mesh, &RigSettings { count: 5, size: 150, ..Default::default() }).unwrap();
    (mesh, cameras)
}

fn draw(
    gpu: &GpuRenderer,
    (mesh, cameras): &(Mesh, Vec<Pinhole>),
    task: &Task,
) -> Result<Vec<View>> {
    gpu.render(mesh, &Paint::GREY, cameras, &RenderSettings::default(), task)
}

fn by_cpu((mesh, cameras): &(Mesh, Vec<Pinhole>)) -> Vec<View> {
    render(mesh, &Paint::GREY, cameras, &RenderSettings::default(), &Task::default()).unwrap()
}

/// Share of the pixels that see another triangle.
fn difference(one: &[View], other: &[View]) -> f64 {
    assert_eq!(one.len(), other.len());
    let pixels = one.iter().zip(other).flat_map(|(a, b)| a.triangles.iter().zip(&b.triangles));
    let (n, different) =
        pixels.fold((0, 0), |(n, different), (a, b)| (n + 1, different + usize::from(a != b)));
    different as f64 / f64::from(n)
}

#[test]
fn a_lost_driver_is_an_error_and_is_opened_anew() {
    let Some(gpu) = open(&Restraint::default()) else { return };
    let scene = scene();
    let before = draw(&gpu, &scene, &Task::default()).unwrap();
    gpu.current().device.device.destroy();
    let answer = draw(&gpu, &scene, &Task::default());
    assert!(matches!(answer, Err(Error::Gpu { .. })), "{answer:?}");
    assert_eq!(draw(&gpu, &scene, &Task::default()).unwrap(), before);
}

#[test]
fn a_driver_that_is_lost_while_it_draws_is_an_error() {
    // Small buffers, so that there are several batches.
    let restraint = || Restraint { buffer_bytes: 150 << 10, ..Default::default() };
    let Some(counted) = open(&restraint()) else { return };
    let mut scene = scene();
    scene.0 = zoo::torus(12, 8);
    let steps = Arc::new(AtomicUsize::new(0));
    let heard = steps.clone();
    let counting = Task::with_progress(move |_| {
        heard.fetch_add(1, Ordering::Relaxed);
    });
    draw(&counted, &scene, &counting).unwrap();
    let n_steps = steps.load(Ordering::Relaxed);
    assert!(n_steps > 3, "{n_steps} steps");
    for lost_at in 0..n_steps {
        let gpu = open(&restraint()).unwrap();
        let (driver, step) = (gpu.current(), AtomicUsize::new(0));
        let task = Task::with_progress(move |_| {
            if step.fetch_add(1, Ordering::Relaxed) == lost_at {
                driver.device.device.destroy();
            }
        });
        let answer = draw(&gpu, &scene, &task);
        // At the last step everything has been read.
        let done = lost_at + 1 == n_steps;
        assert!(done || matches!(answer, Err(Error::Gpu { .. })), "{lost_at}: {answer:?}");
        assert!(answer.is_ok() || draw(&gpu, &scene, &Task::default()).is_ok());
    }
}

#[test]
fn pictures_larger_than_the_driver_s_textures_are_drawn_in_parts() {
    let scene = scene();
    let exact = by_cpu(&scene);
    for restraint in [
        Restraint { texture_side: 64, ..Default::default() },
        Restraint { buffer_bytes: 250 << 10, ..Default::default() },
    ] {
        let Some(gpu) = open(&restraint) else { return };
        let views = draw(&gpu, &scene, &Task::default()).unwrap();
        assert!(difference(&views, &exact) < 1e-3);
        let stripes = |face: usize, _: [f64; 3]| [(face % 2) as f32; 3];
        let paint = Paint::Surface(&stripes);
        let (settings, task) = (RenderSettings::default(), Task::default());
        let views = gpu.render(&scene.0, &paint, &scene.1, &settings, &task).unwrap();
        assert!(difference(&views, &exact) < 1e-3);
    }
}

#[test]
fn a_mesh_beyond_the_driver_s_buffers_is_an_error_or_drawn_by_the_cpu() {
    let restraint = Restraint { buffer_bytes: 64 << 10, ..Default::default() };
    let scene = scene();
    let Some(gpu) = open(&restraint) else { return };
    let answer = draw(&gpu, &scene, &Task::default());
    assert!(matches!(answer, Err(Error::BeyondGpu { what: "triangles", .. })), "{answer:?}");
    for yielding in [true, false] {
        let renderer = Renderer::by(open(&restraint).unwrap(), yielding);
        let (settings, task) = (RenderSettings::default(), Task::default());
        let answer = renderer.render(&scene.0, &Paint::GREY, &scene.1, &settings, &task);
        assert_eq!(answer.ok(), yielding.then(|| by_cpu(&scene)));
        assert_eq!(renderer.name() == "CPU", yielding);
    }
}

#[test]
fn a_buffer_that_the_driver_refuses_is_an_error() {
    let Some(gpu) = open(&Restraint { buffer_bytes: 1 << 20, ..Default::default() }) else {
        return;
    };
    let device = &gpu.current().device;
    for (bytes, granted) in [(1 << 20, true), ((1 << 20) + 4, false), (4, true)] {
        let answer = device.buffer(&vec![1; bytes], wgpu::BufferUsages::VERTEX);
        assert!(matches!(answer, Ok(_) | Err(Error::Gpu { .. })), "{answer:?}");
        assert_eq!(answer.is_ok(), granted, "{bytes} bytes");
    }
}

#[test]
fn a_driver_without_memory_is_an_error_or_yields_to_the_cpu() {
    let restraint = Restraint { memory_percent: 0, ..Default::default() };
    let scene = scene();
    let gpu = match GpuRenderer::within(&restraint) {
        // Some drivers have nothing left for the queue's own buffers.
        Err(Error::Gpu { .. }) => return,
        Err(error) if std::env::var_os("SEMFM_DEMAND_GPU").is_none() => {
            eprintln!("SKIPPED: {error}");
            return;
        }
        gpu => gpu.unwrap(),
    };
    match draw(&gpu, &scene, &Task::default()) {
        Err(Error::Gpu { reason }) => assert!(reason.contains("emory"), "{reason}"),
        answer => {
            assert_eq!(answer.unwrap().len(), scene.1.len());
            eprintln!("SKIPPED: {} does not tell how much memory it has left", gpu.name());
        }
    }
    let renderer = Renderer::by(gpu, true);
    let (settings, task) = (RenderSettings::default(), Task::default());
    assert!(renderer.render(&scene.0, &Paint::GREY, &scene.1, &settings, &task).is_ok());
}

#[test]
fn views_that_see_nothing_cost_nothing() {
    let Some(gpu) = open(&Restraint::default()) else { return };
    let mut scene = scene();
    for camera in &mut scene.1 {
        let mut pose = camera.camera_from_world();
        pose.translation += DVec3::X * 100.0;
        *camera = camera.posed(pose).unwrap();
    }
    assert_eq!(draw(&gpu, &scene, &Task::default()).unwrap(), by_cpu(&scene));
    assert!(gpu.current().frames.lock().unwrap().is_empty());
    for camera in &mut scene.1 {
        let mut pose = camera.camera_from_world();
        pose.translation = -DVec3::Z * 100.0;
        *camera = camera.posed(pose).unwrap();
    }
    assert_eq!(draw(&gpu, &scene, &Task::default()).unwrap(), by_cpu(&scene));
}
