//! The renderer on a graphics driver: the same pictures as [`render`](crate::render()), from the
//! same request.
//!
//! `hardware` tells whether there is a processor to draw, `device` opens the driver, `pipelines` holds its programs (`shaders.wgsl`), `gpu_mesh` the mesh.
//! `tiles` cuts the views to the rectangles that the object fills and puts them into batches; `draw`
//! sends each to the driver, which draws it into a `render_target`, and reads it back while the next
//! is drawn. Triangle and depth are those at a pixel's centre, colour is the mean of its samples.
//!
//! A driver snaps corners to a 256th of a pixel and works in `f32`, so at silhouettes and inner
//! edges single pixels differ from the CPU's exact answer.

mod device;
mod draw;
#[cfg(test)]
mod failure_tests;
mod gpu_mesh;
mod hardware;
mod pipelines;
mod render_target;
mod tiles;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use semfm_geom::{Mesh, Pinhole, Task};

use crate::render::{Request, blank};
use crate::{Error, RenderSettings, Result, SurfaceColor, View};
use device::{Device, DriverLimits};
use draw::Draw;
use gpu_mesh::GpuMesh;
pub(crate) use hardware::may_have_graphics_processor;
use pipelines::Pipelines;
use render_target::{Extent, RenderTarget};
use tiles::{batches, extent};

/// Targets that are kept for the next call: one that is drawn into, one that is read.
const KEPT_TARGETS: usize = 2;

/// An open graphics driver. Opening costs 50 to 100 ms, so keep it.
pub struct GpuRenderer {
    driver: Mutex<Arc<Driver>>,
}

impl std::fmt::Debug for GpuRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuRenderer").field("adapter", &self.name()).finish_non_exhaustive()
    }
}

impl GpuRenderer {
    /// Opens the fastest graphics adapter of the machine.
    ///
    /// # Errors
    /// [`Error::NoGpu`] without a driver, [`Error::Gpu`] where it does not open.
    pub fn new() -> Result<Self> {
        Self::within(&DriverLimits::default())
    }

    fn within(limits: &DriverLimits) -> Result<Self> {
        Ok(Self { driver: Mutex::new(Arc::new(Driver::open(limits)?)) })
    }

    /// Adapter and interface, as the driver names itself.
    pub fn name(&self) -> String {
        let driver = self.current();
        format!("{} ({:?})", driver.device.adapter.name, driver.device.adapter.backend)
    }

    /// True for a driver that draws on the CPU (Mesa's lavapipe, say).
    pub fn is_software(&self) -> bool {
        self.current().device.adapter.device_type == wgpu::DeviceType::Cpu
    }

    /// One picture per camera, as [`render`](crate::render()) makes them.
    ///
    /// SurfaceColor that is a function of the place ([`SurfaceColor::Surface`], [`SurfaceColor::Normals`]) is asked on the
    /// CPU for what the driver found to be visible. After a failure of the driver the next call opens it anew.
    ///
    /// # Errors
    /// As [`render`](crate::render()); [`Error::BeyondGpu`] for a mesh beyond the driver's limits;
    /// [`Error::Gpu`] where the driver fails, [`Error::NoGpu`] where it does not come back.
    pub fn render(
        &self,
        mesh: &Mesh,
        color: &SurfaceColor<'_>,
        cameras: &[Pinhole],
        settings: &RenderSettings,
        task: &Task,
    ) -> Result<Vec<View>> {
        let request = Request::new(mesh, color, cameras, settings)?;
        let driver = self.usable_driver()?;
        let answer = driver.render(&request, cameras, task);
        if matches!(answer, Err(Error::Gpu { .. })) {
            driver.failed.store(true, Ordering::Relaxed);
        }
        answer
    }

    fn current(&self) -> Arc<Driver> {
        self.driver.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The driver, opened anew where it has failed.
    fn usable_driver(&self) -> Result<Arc<Driver>> {
        let mut driver = self.driver.lock().unwrap_or_else(PoisonError::into_inner);
        if driver.failed.load(Ordering::Relaxed) {
            *driver = Arc::new(Driver::open(&DriverLimits::default())?);
        }
        Ok(driver.clone())
    }
}

/// The driver, its programs, targets that are free, and whether it ever failed.
struct Driver {
    device: Device,
    pipelines: Pipelines,
    free_targets: Mutex<Vec<RenderTarget>>,
    failed: AtomicBool,
}

impl Driver {
    fn open(limits: &DriverLimits) -> Result<Self> {
        let device = Device::open(limits)?;
        let pipelines = Pipelines::new(&device);
        device.check()?;
        Ok(Self {
            device,
            pipelines,
            free_targets: Mutex::default(),
            failed: AtomicBool::new(false),
        })
    }

    fn render(&self, request: &Request<'_>, cameras: &[Pinhole], task: &Task) -> Result<Vec<View>> {
        task.step("render", 0, cameras.len())?;
        let mesh = GpuMesh::new(&self.device, request)?;
        let per_pixel = request.settings.supersampling;
        let on_surface = matches!(request.color, SurfaceColor::Surface(_) | SurfaceColor::Normals);
        let batches =
            batches(&self.device, request, cameras, if on_surface { per_pixel } else { 1 });
        let largest = batches
            .iter()
            .map(|batch| extent(batch))
            .fold(Extent { width: 0, height: 0 }, Extent::covering);
        let draw = Draw { driver: self, request, mesh: &mesh, cameras, largest };
        let mut views: Vec<View> =
            cameras.par_iter().map(|camera| blank(camera, request.settings)).collect();
        let mut in_flight = None;
        for k in 0..=batches.len() {
            let next = batches.get(k).map(|tiles| {
                let colored = draw.submit(tiles, 1, if on_surface { 0 } else { per_pixel })?;
                let samples = on_surface.then(|| draw.submit(tiles, per_pixel, 0)).transpose()?;
                Ok::<_, Error>((colored, samples))
            });
            if let Some((batch, samples)) = std::mem::replace(&mut in_flight, next.transpose()?) {
                draw.read(batch, &mut views)?;
                if let Some(samples) = samples {
                    draw.shade(samples, &mut views)?;
                }
                // Tiles are in the order of their views.
                let done = batches.get(k).map_or(cameras.len(), |tiles| tiles[0].view);
                task.step("render", done, cameras.len())?;
            }
        }
        views.par_iter_mut().for_each(|view| request.finish(view));
        Ok(views)
    }

    /// A free target, or a new one.
    fn target(&self, extent: Extent, per_pixel: u32) -> RenderTarget {
        let mut free = self.free_targets.lock().unwrap_or_else(PoisonError::into_inner);
        match free.iter().position(|target| target.fits(extent, per_pixel)) {
            Some(k) => free.swap_remove(k),
            None => RenderTarget::new(&self.device, extent, per_pixel),
        }
    }

    fn keep(&self, target: RenderTarget) {
        let mut free = self.free_targets.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(target);
        if free.len() > KEPT_TARGETS {
            free.remove(0);
        }
    }
}
