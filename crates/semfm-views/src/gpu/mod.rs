//! The renderer on a graphics driver: the same pictures as [`render`](crate::render()), from the
//! same request.
//!
//! `device` opens the driver, `pipelines` holds its programs (`shaders.wgsl`), `targets` what they
//! draw into and how it comes back. Triangle and depth are those at a pixel's centre, colour is the
//! mean of its samples; all views of a call are drawn in a few submissions, and while one is read
//! back the next is drawn.
//!
//! A driver snaps corners to a 256th of a pixel and works in `f32`, so at silhouettes and inner
//! edges single pixels differ from the CPU's exact answer.

mod device;
mod pipelines;
mod targets;

use semfm_geom::math::{DAffine3, DMat4, DVec4};
use semfm_geom::{Mesh, Task};

use crate::render::{Request, light_direction};
use crate::{Camera, Error, Paint, RenderSettings, Result, View};
use device::Device;
use pipelines::{CameraBlock, Corner, Pipelines, buffer};
use targets::{ReadBack, Targets};

/// Bytes that one submission may bring back: enough to keep a driver busy, little enough that two
/// of them fit into anything.
const BATCH_BYTES: u64 = 32 << 20;

/// What lies nearer to the camera than this share of the object's radius is cut off.
const NEAR: f64 = 1e-4;

/// An open graphics driver. Opening costs 50 to 100 ms, so keep it.
pub struct GpuRenderer {
    device: Device,
    pipelines: Pipelines,
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
        let device = Device::open()?;
        let pipelines = Pipelines::new(&device);
        device.check()?;
        Ok(Self { device, pipelines })
    }

    /// Adapter and interface, as the driver names itself.
    pub fn name(&self) -> String {
        format!("{} ({:?})", self.device.adapter.name, self.device.adapter.backend)
    }

    /// True for a driver that draws on the CPU (Mesa's lavapipe, say).
    pub fn is_software(&self) -> bool {
        self.device.adapter.device_type == wgpu::DeviceType::Cpu
    }

    /// One picture per camera, as [`render`](crate::render()) makes them.
    ///
    /// Paint that is a function of the place ([`Paint::Surface`], [`Paint::Normals`]) is asked on the
    /// CPU for what the driver found to be visible.
    ///
    /// # Errors
    /// As [`render`](crate::render()); [`Error::BeyondGpu`] for images or meshes beyond the driver's
    /// limits; [`Error::Gpu`] where the driver fails.
    pub fn render(
        &self,
        mesh: &Mesh,
        paint: &Paint<'_>,
        cameras: &[Camera],
        settings: &RenderSettings,
        task: &Task,
    ) -> Result<Vec<View>> {
        let request = Request::new(mesh, paint, cameras, settings)?;
        let scene = Scene::new(&self.device, &request)?;
        let mut views = Vec::with_capacity(cameras.len());
        task.step("render", 0, cameras.len())?;
        for alike in cameras.chunk_by(|a, b| (a.width, a.height) == (b.width, b.height)) {
            self.render_alike(&request, &scene, alike, &mut |mut view| {
                request.finish(&mut view);
                views.push(view);
                Ok(task.step("render", views.len(), cameras.len())?)
            })?;
        }
        Ok(views)
    }

    /// Views of one size, handed over in order.
    fn render_alike(
        &self,
        request: &Request<'_>,
        scene: &Scene,
        cameras: &[Camera],
        done: &mut dyn FnMut(View) -> Result<()>,
    ) -> Result<()> {
        let Some(first) = cameras.first() else { return Ok(()) };
        let (size, per_pixel) = ([first.width, first.height], request.settings.supersampling);
        if matches!(request.paint, Paint::Surface(_) | Paint::Normals) {
            return self.shade_on_cpu(request, scene, cameras, done);
        }
        let targets = Targets::new(&self.device, size, per_pixel)?;
        let mut in_flight: Option<Batch<'_>> = None;
        for cameras in cameras.chunks(views_per_batch(size, ID_BYTES + COLOR_BYTES)) {
            let next = self.submit(request, scene, &targets, cameras, true)?;
            if let Some(batch) = in_flight.replace(next) {
                batch.read(&self.device, scene)?.into_iter().try_for_each(&mut *done)?;
            }
        }
        match in_flight {
            Some(batch) => batch.read(&self.device, scene)?.into_iter().try_for_each(done),
            None => Ok(()),
        }
    }

    /// The driver finds what every sample sees, the CPU gives it colour.
    fn shade_on_cpu(
        &self,
        request: &Request<'_>,
        scene: &Scene,
        cameras: &[Camera],
        done: &mut dyn FnMut(View) -> Result<()>,
    ) -> Result<()> {
        for &camera in cameras {
            let [centres, samples] = [1, request.settings.supersampling].map(|per_pixel| {
                let fine = finer(&camera, per_pixel);
                let size = [fine.width, fine.height];
                let targets = Targets::new(&self.device, size, 1)?;
                let cameras = [fine];
                let batch = self.submit(request, scene, &targets, &cameras, false)?;
                batch.read(&self.device, scene)
            });
            let (Some(mut view), Some(samples)) = (centres?.pop(), samples?.pop()) else {
                continue;
            };
            view.camera = camera;
            view.rgb = request.shade_hits(&camera, &samples.triangles, &samples.depth);
            done(view)?;
        }
        Ok(())
    }

    /// Sends the drawing of some views to the driver; `colored` or triangle and depth only.
    fn submit<'a>(
        &self,
        request: &Request<'_>,
        scene: &Scene,
        targets: &Targets,
        cameras: &'a [Camera],
        colored: bool,
    ) -> Result<Batch<'a>> {
        let device = &self.device.device;
        let bound = self.bind(request, scene, targets, cameras);
        let ids = ReadBack::new(&self.device, targets.size, ID_BYTES, cameras.len());
        let colors =
            colored.then(|| ReadBack::new(&self.device, targets.size, COLOR_BYTES, cameras.len()));
        let mut encoder = device.create_command_encoder(&Default::default());
        let [red, green, blue] = request.settings.background.map(f64::from);
        let background = wgpu::Color { r: red, g: green, b: blue, a: 1.0 };
        let id_view = targets.ids.create_view(&Default::default());
        let color_view = targets.colors.create_view(&Default::default());
        for k in 0..cameras.len() {
            let offset = [k as u32 * bound.stride];
            let mut draw = |pipeline, target, clear, depth: Option<_>, group, n_corners| {
                let mut pass = begin(&mut encoder, target, clear, depth);
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &offset);
                pass.set_vertex_buffer(0, scene.corners.slice(..));
                pass.draw(0..n_corners, 0..1);
            };
            let pipelines = &self.pipelines;
            let (nothing, depth) = (wgpu::Color::TRANSPARENT, Some(&targets.id_depth));
            draw(&pipelines.identify, &id_view, nothing, depth, &bound.camera, scene.n_corners);
            if colored {
                let (samples, depth) = (&targets.samples, Some(&targets.sample_depth));
                draw(&pipelines.paint, samples, background, depth, &bound.camera, scene.n_corners);
                draw(&pipelines.average, &color_view, background, None, &bound.samples, 3);
            }
            ids.copy(&mut encoder, &targets.ids, k);
            if let Some(colors) = &colors {
                colors.copy(&mut encoder, &targets.colors, k);
            }
        }
        self.device.queue.submit([encoder.finish()]);
        self.device.check()?;
        ids.fetch();
        colors.iter().for_each(ReadBack::fetch);
        Ok(Batch { cameras, ids, colors })
    }

    /// The cameras' numbers where the programs read them.
    fn bind(
        &self,
        request: &Request<'_>,
        scene: &Scene,
        targets: &Targets,
        cameras: &[Camera],
    ) -> Bound {
        let device = &self.device.device;
        let alignment = device.limits().min_uniform_buffer_offset_alignment as usize;
        let stride = size_of::<CameraBlock>().next_multiple_of(alignment.max(1));
        let mut bytes = vec![0; stride * cameras.len()];
        for (place, camera) in bytes.chunks_exact_mut(stride).zip(cameras) {
            let block = scene.camera_block(camera, request.settings);
            place[..size_of::<CameraBlock>()].copy_from_slice(bytemuck::bytes_of(&block));
        }
        let blocks = buffer(&self.device, &bytes, wgpu::BufferUsages::UNIFORM);
        let camera = wgpu::BindGroupEntry {
            binding: 0,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &blocks,
                offset: 0,
                size: std::num::NonZero::new(size_of::<CameraBlock>() as u64),
            }),
        };
        let samples = wgpu::BindGroupEntry {
            binding: 1,
            resource: wgpu::BindingResource::TextureView(&targets.samples),
        };
        let group = |layout, entries: &[wgpu::BindGroupEntry<'_>]| {
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries })
        };
        Bound {
            stride: stride as u32,
            camera: group(&self.pipelines.camera_layout, std::slice::from_ref(&camera)),
            samples: group(&self.pipelines.samples_layout, &[camera.clone(), samples]),
        }
    }
}

/// Bytes of triangle and depth, and of the colour, of a pixel.
const ID_BYTES: u32 = 8;
const COLOR_BYTES: u32 = 4;

fn views_per_batch(size: [u32; 2], bytes_per_pixel: u32) -> usize {
    (BATCH_BYTES / ReadBack::view_bytes(size, bytes_per_pixel).max(1)).clamp(1, 64) as usize
}

/// The camera with `per_pixel` times as many pixels along each side.
fn finer(camera: &Camera, per_pixel: u32) -> Camera {
    let scale = f64::from(per_pixel);
    Camera {
        width: camera.width * per_pixel,
        height: camera.height * per_pixel,
        fx: camera.fx * scale,
        fy: camera.fy * scale,
        cx: camera.cx * scale,
        cy: camera.cy * scale,
        ..*camera
    }
}

fn begin<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    view: &wgpu::TextureView,
    clear: wgpu::Color,
    depth: Option<&wgpu::TextureView>,
) -> wgpu::RenderPass<'a> {
    let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store: wgpu::StoreOp::Store };
    let color =
        wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops };
    let depth = depth.map(|view| wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Clear(0.0), // endlessly far
            store: wgpu::StoreOp::Discard,
        }),
        stencil_ops: None,
    });
    encoder
        .begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(color)],
            depth_stencil_attachment: depth,
            ..Default::default()
        })
        .forget_lifetime()
}

/// Where the programs find the cameras' numbers, `stride` bytes apart.
struct Bound {
    stride: u32,
    camera: wgpu::BindGroup,
    samples: wgpu::BindGroup,
}

/// A mesh on the driver.
struct Scene {
    corners: wgpu::Buffer,
    n_corners: u32,
    /// Object coordinates of the corners' origin and unit.
    centre: semfm_geom::math::DVec3,
    radius: f64,
}

impl Scene {
    fn new(device: &Device, request: &Request<'_>) -> Result<Self> {
        let mesh = request.mesh;
        let (centre, radius) = mesh.bounding_sphere();
        let bytes = (mesh.n_faces() * 3 * size_of::<Corner>()) as u64;
        let largest = device.device.limits().max_buffer_size.min(u64::from(u32::MAX));
        if bytes > largest {
            let allowed = largest / (3 * size_of::<Corner>() as u64);
            return Err(Error::BeyondGpu {
                what: "triangles",
                expected: format!("at most {allowed}"),
                found: mesh.n_faces().to_string(),
            });
        }
        let corners: Vec<Corner> = mesh
            .faces()
            .iter()
            .zip(request.normals.corners())
            .flat_map(|(ids, normals)| {
                [0, 1, 2].map(|corner| {
                    let id = ids[corner] as usize;
                    let position = ((mesh.vertices()[id] - centre) / radius).as_vec3().to_array();
                    let color = match request.paint {
                        Paint::Plain(color) => *color,
                        Paint::Vertices(colors) => colors[id],
                        Paint::Surface(_) | Paint::Normals => [0.0; 3],
                    };
                    let color = color.map(|c| c * request.light_at(id));
                    Corner { position, normal: normals[corner], color }
                })
            })
            .collect();
        let n_corners = corners.len() as u32;
        let corners = buffer(device, bytemuck::cast_slice(&corners), wgpu::BufferUsages::VERTEX);
        device.check()?;
        Ok(Self { corners, n_corners, centre, radius })
    }

    fn camera_block(&self, camera: &Camera, settings: &RenderSettings) -> CameraBlock {
        let pose = camera.camera_from_object;
        let pose = DAffine3::from_mat3_translation(
            pose.matrix3,
            pose.transform_point3(self.centre) / self.radius,
        );
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let clip_from_camera = DMat4::from_cols(
            DVec4::new(2.0 * camera.fx / width, 0.0, 0.0, 0.0),
            DVec4::new(0.0, -2.0 * camera.fy / height, 0.0, 0.0),
            DVec4::new(2.0 * camera.cx / width - 1.0, 1.0 - 2.0 * camera.cy / height, 0.0, 1.0),
            DVec4::new(0.0, 0.0, NEAR, 0.0),
        );
        let [x, y, z] = light_direction(camera, settings).as_vec3().to_array();
        CameraBlock {
            clip_from_mesh: (clip_from_camera * DMat4::from(pose)).as_mat4().to_cols_array(),
            light: [x, y, z, settings.ambient as f32],
            per_pixel: settings.supersampling,
            padding: [0; 3],
        }
    }
}

/// Views that the driver is drawing.
struct Batch<'a> {
    cameras: &'a [Camera],
    ids: ReadBack,
    colors: Option<ReadBack>,
}

impl Batch<'_> {
    fn read(self, device: &Device, scene: &Scene) -> Result<Vec<View>> {
        device.wait()?;
        let empty = |camera: &Camera| {
            let n = camera.width as usize * camera.height as usize;
            View {
                camera: *camera,
                rgb: Vec::with_capacity(if self.colors.is_some() { 3 * n } else { 0 }),
                depth: Vec::with_capacity(n),
                triangles: Vec::with_capacity(n),
            }
        };
        let mut views: Vec<View> = self.cameras.iter().map(empty).collect();
        self.ids.rows(|k, row| {
            for pixel in row.chunks_exact(ID_BYTES as usize) {
                let [a, b, c, d, e, f, g, h] = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| pixel[i]);
                let (triangle, depth) =
                    (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
                views[k].triangles.push(triangle as i32 - 1);
                let depth = (f64::from(f32::from_bits(depth)) * scene.radius) as f32;
                views[k].depth.push(if triangle == 0 { f32::INFINITY } else { depth });
            }
        })?;
        if let Some(colors) = &self.colors {
            colors.rows(|k, row| {
                row.chunks_exact(COLOR_BYTES as usize)
                    .for_each(|rgba| views[k].rgb.extend_from_slice(&rgba[..3]));
            })?;
        }
        Ok(views)
    }
}
