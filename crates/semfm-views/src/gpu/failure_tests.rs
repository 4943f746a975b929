//! Drivers that fail: lost, too small, or out of memory.
#![allow(clippy::print_stderr, reason = "tests that say what they skipped")]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Pinhole, Task, zoo};

use super::{DriverLimits, GpuRenderer};
use crate::{
    Error, RenderSettings, Renderer, Result, RigSettings, SurfaceColor, View, render, rig,
};

fn open(limits: &DriverLimits) -> Option<GpuRenderer> {
    match GpuRenderer::within(limits) {
        Ok(gpu) => Some(gpu),
        Err(error @ Error::NoGpu { .. }) if std::env::var_os("SEMFM_DEMAND_GPU").is_none() => {
            eprintln!("SKIPPED: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// An object and the cameras that see it.
struct Setup {
    mesh: Mesh,
    cameras: Vec<Pinhole>,
}

fn setup() -> Setup {
    let mesh = zoo::torus(40, 24);
    let cameras = rig(&mesh, &RigSettings { count: 5, size: 150, ..Default::default() }).unwrap();
    Setup { mesh, cameras }
}

fn draw(gpu: &GpuRenderer, Setup { mesh, cameras }: &Setup, task: &Task) -> Result<Vec<View>> {
    gpu.render(mesh, &SurfaceColor::GREY, cameras, &RenderSettings::default(), task)
}

fn by_cpu(Setup { mesh, cameras }: &Setup) -> Vec<View> {
    render(mesh, &SurfaceColor::GREY, cameras, &RenderSettings::default(), &Task::default())
        .unwrap()
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
    let Some(gpu) = open(&DriverLimits::default()) else { return };
    let setup = setup();
    let before = draw(&gpu, &setup, &Task::default()).unwrap();
    gpu.current().device.device.destroy();
    let answer = draw(&gpu, &setup, &Task::default());
    assert!(matches!(answer, Err(Error::Gpu { .. })), "{answer:?}");
    assert_eq!(draw(&gpu, &setup, &Task::default()).unwrap(), before);
}

#[test]
fn a_driver_that_is_lost_while_it_draws_is_an_error() {
    // Small buffers, so that there are several batches.
    let limits = DriverLimits { buffer_bytes: 150 << 10, ..Default::default() };
    let Some(counted) = open(&limits) else { return };
    let mut setup = setup();
    setup.mesh = zoo::torus(12, 8);
    let steps = Arc::new(AtomicUsize::new(0));
    let counter = steps.clone();
    let counting = Task::with_progress(move |_| {
        counter.fetch_add(1, Ordering::Relaxed);
    });
    draw(&counted, &setup, &counting).unwrap();
    let n_steps = steps.load(Ordering::Relaxed);
    assert!(n_steps > 3, "{n_steps} steps");
    for lost_at in 0..n_steps {
        let gpu = open(&limits).unwrap();
        let (driver, step) = (gpu.current(), AtomicUsize::new(0));
        let task = Task::with_progress(move |_| {
            if step.fetch_add(1, Ordering::Relaxed) == lost_at {
                driver.device.device.destroy();
            }
        });
        let answer = draw(&gpu, &setup, &task);
        // At the last step everything has been read.
        let done = lost_at + 1 == n_steps;
        assert!(done || matches!(answer, Err(Error::Gpu { .. })), "{lost_at}: {answer:?}");
        assert!(answer.is_ok() || draw(&gpu, &setup, &Task::default()).is_ok());
    }
}

#[test]
fn pictures_larger_than_the_driver_s_textures_are_drawn_in_parts() {
    let setup = setup();
    let exact = by_cpu(&setup);
    for limits in [
        DriverLimits { texture_side: 64, ..Default::default() },
        DriverLimits { buffer_bytes: 250 << 10, ..Default::default() },
    ] {
        let Some(gpu) = open(&limits) else { return };
        let views = draw(&gpu, &setup, &Task::default()).unwrap();
        assert!(difference(&views, &exact) < 1e-3);
        let stripes = |face: usize, _: [f64; 3]| [(face % 2) as f32; 3];
        let paint = SurfaceColor::Surface(&stripes);
        let (settings, task) = (RenderSettings::default(), Task::default());
        let views = gpu.render(&setup.mesh, &paint, &setup.cameras, &settings, &task).unwrap();
        assert!(difference(&views, &exact) < 1e-3);
    }
}

#[test]
fn a_mesh_beyond_the_driver_s_buffers_is_an_error_or_drawn_by_the_cpu() {
    let limits = DriverLimits { buffer_bytes: 64 << 10, ..Default::default() };
    let setup = setup();
    let Some(gpu) = open(&limits) else { return };
    let answer = draw(&gpu, &setup, &Task::default());
    assert!(matches!(answer, Err(Error::BeyondGpu { what: "triangles", .. })), "{answer:?}");
    for falls_back in [true, false] {
        let renderer = Renderer::with_gpu(open(&limits).unwrap(), falls_back);
        let (settings, task) = (RenderSettings::default(), Task::default());
        let answer =
            renderer.render(&setup.mesh, &SurfaceColor::GREY, &setup.cameras, &settings, &task);
        assert_eq!(answer.ok(), falls_back.then(|| by_cpu(&setup)));
        assert_eq!(renderer.name() == "CPU", falls_back);
    }
}

#[test]
fn a_buffer_that_the_driver_refuses_is_an_error() {
    let Some(gpu) = open(&DriverLimits { buffer_bytes: 1 << 20, ..Default::default() }) else {
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
    let limits = DriverLimits { memory_percent: 0, ..Default::default() };
    let setup = setup();
    let gpu = match GpuRenderer::within(&limits) {
        // Some drivers have nothing left for the queue's own buffers.
        Err(Error::Gpu { .. }) => return,
        Err(error) if std::env::var_os("SEMFM_DEMAND_GPU").is_none() => {
            eprintln!("SKIPPED: {error}");
            return;
        }
        gpu => gpu.unwrap(),
    };
    match draw(&gpu, &setup, &Task::default()) {
        Err(Error::Gpu { reason }) => assert!(reason.contains("emory"), "{reason}"),
        answer => {
            assert_eq!(answer.unwrap().len(), setup.cameras.len());
            eprintln!("SKIPPED: {} does not tell how much memory it has left", gpu.name());
        }
    }
    let renderer = Renderer::with_gpu(gpu, true);
    let (settings, task) = (RenderSettings::default(), Task::default());
    assert!(
        renderer.render(&setup.mesh, &SurfaceColor::GREY, &setup.cameras, &settings, &task).is_ok()
    );
}

#[test]
fn views_that_see_nothing_cost_nothing() {
    let Some(gpu) = open(&DriverLimits::default()) else { return };
    let mut setup = setup();
    for camera in &mut setup.cameras {
        let mut pose = camera.camera_from_world();
        pose.translation += DVec3::X * 100.0;
        *camera = camera.posed(pose).unwrap();
    }
    assert_eq!(draw(&gpu, &setup, &Task::default()).unwrap(), by_cpu(&setup));
    assert!(gpu.current().free_targets.lock().unwrap().is_empty());
    for camera in &mut setup.cameras {
        let mut pose = camera.camera_from_world();
        pose.translation = -DVec3::Z * 100.0;
        *camera = camera.posed(pose).unwrap();
    }
    assert_eq!(draw(&gpu, &setup, &Task::default()).unwrap(), by_cpu(&setup));
}
