//! A batch on its way: sent to the driver, and read back into the views.

use rayon::prelude::*;
use semfm_geom::Pinhole;

use super::Driver;
use super::device::Device;
use super::gpu_mesh::GpuMesh;
use super::pipelines::CameraBlock;
use super::render_target::{COLOR_BYTES, Extent, ID_BYTES, RenderTarget, padded};
use super::tiles::{Tile, extent};
use crate::render::Request;
use crate::{Result, View};

/// One call's work.
pub(super) struct Draw<'a> {
    pub driver: &'a Driver,
    pub request: &'a Request<'a>,
    pub mesh: &'a GpuMesh,
    pub cameras: &'a [Pinhole],
    /// What every batch fits into.
    pub largest: Extent,
}

/// Tiles that the driver is drawing, with `scale` pixels along each side of a view's pixel.
pub(super) struct Batch<'a> {
    tiles: &'a [Tile],
    scale: u32,
    target: RenderTarget,
    submission: wgpu::SubmissionIndex,
}

impl Draw<'_> {
    /// Sends the drawing of a batch to the driver, with `per_pixel` samples along each side of a
    /// pixel for its colour; 0 for triangle and depth only.
    pub fn submit<'a>(&self, tiles: &'a [Tile], scale: u32, per_pixel: u32) -> Result<Batch<'a>> {
        let Self { driver, request, .. } = self;
        let target = driver.target(self.largest.scaled(scale), per_pixel);
        let bound = self.bind(&target, tiles)?;
        let extent = extent(tiles).scaled(scale);
        let mut encoder = driver.device.device.create_command_encoder(&Default::default());
        let pass = begin(&mut encoder, &target.id_view, NO_TRIANGLE, Some(&target.id_depth));
        self.draw(pass, &driver.pipelines.identify, &bound, tiles, scale);
        if let (Some(colors), Some(samples)) = (&target.colors, &bound.samples) {
            let [r, g, b] = request.settings.background.map(f64::from);
            let background = wgpu::Color { r, g, b, a: 0.0 };
            let pass = begin(&mut encoder, &colors.samples, background, Some(&colors.depth));
            self.draw(pass, &driver.pipelines.shade, &bound, tiles, scale * per_pixel);
            let mut pass = begin(&mut encoder, &colors.mean_view, background, None);
            pass.set_pipeline(&driver.pipelines.average);
            pass.set_bind_group(0, samples, &[0]);
            pass.set_scissor_rect(0, 0, extent.width, extent.height);
            pass.draw(0..3, 0..1);
        }
        target.copy(&mut encoder, extent);
        let submission = driver.device.queue.submit([encoder.finish()]);
        driver.device.check()?;
        target.fetch();
        Ok(Batch { tiles, scale, target, submission })
    }

    /// Draws the mesh once for each tile.
    fn draw(
        &self,
        mut pass: wgpu::RenderPass<'_>,
        pipeline: &wgpu::RenderPipeline,
        bound: &Bound,
        tiles: &[Tile],
        scale: u32,
    ) {
        pass.set_pipeline(pipeline);
        pass.set_vertex_buffer(0, self.mesh.corners.slice(..));
        for (tile, k) in tiles.iter().zip(0..) {
            let [top, width, height] =
                [tile.top, tile.columns.len(), tile.rows.len()].map(|n| n as u32 * scale);
            pass.set_bind_group(0, &bound.camera, &[k * bound.stride]);
            pass.set_viewport(0.0, top as f32, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, top, width, height);
            pass.draw(0..self.mesh.n_corners, 0..1);
        }
    }

    /// The cameras' numbers where the programs read them.
    fn bind(&self, target: &RenderTarget, tiles: &[Tile]) -> Result<Bound> {
        let (driver, pipelines) = (&self.driver.device, &self.driver.pipelines);
        let alignment = driver.device.limits().min_uniform_buffer_offset_alignment as usize;
        let stride = size_of::<CameraBlock>().next_multiple_of(alignment.max(1));
        let mut bytes = vec![0; stride * tiles.len()];
        for (place, tile) in bytes.chunks_exact_mut(stride).zip(tiles) {
            let camera = tile.camera(&self.cameras[tile.view]);
            let block = self.mesh.camera_block(&camera, self.request.settings);
            place[..size_of::<CameraBlock>()].copy_from_slice(bytemuck::bytes_of(&block));
        }
        let blocks = driver.buffer(&bytes, wgpu::BufferUsages::UNIFORM)?;
        let camera = entry(
            0,
            wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &blocks,
                offset: 0,
                size: std::num::NonZero::new(size_of::<CameraBlock>() as u64),
            }),
        );
        let samples = target.colors.as_ref().map(|colors| {
            let samples = entry(1, wgpu::BindingResource::TextureView(&colors.samples));
            let between = entry(2, wgpu::BindingResource::Sampler(&pipelines.between));
            group(driver, &pipelines.samples_layout, &[camera.clone(), samples, between])
        });
        let camera = group(driver, &pipelines.camera_layout, &[camera]);
        Ok(Bound { stride: stride as u32, camera, samples })
    }

    /// Puts what the driver drew into the views.
    pub fn read(&self, batch: Batch<'_>, views: &mut [View]) -> Result<()> {
        self.driver.device.wait(&batch.submission)?;
        let width = extent(batch.tiles).width;
        let [id_row, color_row] =
            [ID_BYTES, COLOR_BYTES].map(|bytes| padded(width, bytes) as usize);
        batch.target.read(|ids, colors| {
            each_tile(batch.tiles, views, |view, tile| {
                for (row, line) in tile.rows.clone().zip(tile.top..) {
                    let first = row * view.camera.width() as usize;
                    let pixels = first + tile.columns.start..first + tile.columns.end;
                    let hits = ids[line * id_row..].as_chunks::<{ ID_BYTES as usize }>().0;
                    let places = view.triangles[pixels.clone()].iter_mut();
                    let places = places.zip(&mut view.depth[pixels.clone()]);
                    for ((triangle, depth), &hit) in places.zip(hits) {
                        (*triangle, *depth) = self.seen(hit);
                    }
                    let Some(colors) = colors else { continue };
                    let colors =
                        colors[line * color_row..].as_chunks::<{ COLOR_BYTES as usize }>().0;
                    let places = view.rgb[pixels.start * 3..pixels.end * 3].as_chunks_mut::<3>().0;
                    for (place, &[r, g, b, covered]) in places.iter_mut().zip(colors) {
                        // Where nothing is drawn stand the background's exact bytes already.
                        *place = if covered == 0 { *place } else { [r, g, b] };
                    }
                }
            });
        })?;
        self.driver.keep(batch.target);
        Ok(())
    }

    /// Gives the samples that the driver found their colours, on the CPU.
    pub fn shade(&self, batch: Batch<'_>, views: &mut [View]) -> Result<()> {
        self.driver.device.wait(&batch.submission)?;
        let scale = batch.scale as usize;
        let row = padded(extent(batch.tiles).scaled(batch.scale).width, ID_BYTES) as usize;
        batch.target.read(|ids, _| {
            each_tile(batch.tiles, views, |view, tile| {
                let lines = tile.top * scale..(tile.top + tile.rows.len()) * scale;
                let samples = lines.flat_map(|line| {
                    let samples = ids[line * row..].as_chunks::<{ ID_BYTES as usize }>().0;
                    samples[..tile.columns.len() * scale].iter().map(|&hit| self.seen(hit))
                });
                let window = [tile.columns.clone(), tile.rows.clone()];
                self.request.shade_hits(view, window, samples);
            });
        })?;
        self.driver.keep(batch.target);
        Ok(())
    }

    /// Triangle and depth from what the driver wrote.
    fn seen(&self, hit: [u8; 8]) -> (i32, f32) {
        let bits = u64::from_le_bytes(hit);
        let depth = f32::from_bits((bits >> 32) as u32);
        (bits as i32, (f64::from(depth) * self.mesh.radius) as f32)
    }
}

/// Hands each view that has tiles in a batch to `work`, tile by tile.
fn each_tile(tiles: &[Tile], views: &mut [View], work: impl Fn(&mut View, &Tile) + Sync) {
    let (first, last) = (tiles[0].view, tiles[tiles.len() - 1].view);
    views[first..=last].par_iter_mut().enumerate().for_each(|(k, view)| {
        tiles.iter().filter(|tile| tile.view == first + k).for_each(|tile| work(view, tile));
    });
}

/// What a pixel holds that sees no triangle: number −1, and an endless depth.
const NO_TRIANGLE: wgpu::Color =
    wgpu::Color { r: u32::MAX as f64, g: f32::INFINITY.to_bits() as f64, b: 0.0, a: 0.0 };

fn entry(binding: u32, resource: wgpu::BindingResource<'_>) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource }
}

fn group(
    device: &Device,
    layout: &wgpu::BindGroupLayout,
    entries: &[wgpu::BindGroupEntry<'_>],
) -> wgpu::BindGroup {
    let description = wgpu::BindGroupDescriptor { label: None, layout, entries };
    device.device.create_bind_group(&description)
}

/// A pass that clears its target before it draws.
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
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(color)],
        depth_stencil_attachment: depth,
        ..Default::default()
    })
}

/// Where the programs find the cameras' numbers, `stride` bytes apart.
struct Bound {
    stride: u32,
    camera: wgpu::BindGroup,
    samples: Option<wgpu::BindGroup>,
}
