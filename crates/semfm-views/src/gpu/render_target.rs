//! Textures that a batch is drawn into, and how they come back.

use super::device::Device;
use super::pipelines::{COLOR_FORMAT, DEPTH_FORMAT, ID_FORMAT};
use crate::{Error, Result};

/// Bytes of triangle and depth, and of the colour, of a pixel.
pub(super) const ID_BYTES: u32 = 8;
pub(super) const COLOR_BYTES: u32 = 4;

/// Textures may be this much larger than a batch needs, by area, before they are made anew.
const SLACK: u64 = 2;

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    pub width: u32,
    pub height: u32,
}

impl Extent {
    fn area(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    pub fn scaled(self, factor: u32) -> Self {
        Self { width: self.width * factor, height: self.height * factor }
    }

    /// The smallest extent that covers both.
    pub fn covering(self, other: Self) -> Self {
        Self { width: self.width.max(other.width), height: self.height.max(other.height) }
    }

    fn texture(self) -> wgpu::Extent3d {
        let Self { width, height } = self;
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 }
    }
}

/// Bytes of a copied row: rows start on multiples of 256.
pub(super) fn padded(width: u32, bytes_per_pixel: u32) -> u32 {
    (width * bytes_per_pixel).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

/// Textures and buffers for one batch.
pub(super) struct RenderTarget {
    extent: Extent,
    /// Colour samples along each side of a pixel; 0 for triangle and depth only.
    per_pixel: u32,
    pub id_view: wgpu::TextureView,
    pub id_depth: wgpu::TextureView,
    pub colors: Option<Colors>,
    ids: ReadBack,
}

/// The samples' colours (sides × samples along a pixel), their depth, and the mean.
pub(super) struct Colors {
    pub samples: wgpu::TextureView,
    pub depth: wgpu::TextureView,
    pub mean_view: wgpu::TextureView,
    mean: ReadBack,
}

impl RenderTarget {
    pub fn new(device: &Device, extent: Extent, per_pixel: u32) -> Self {
        let (read, none) = (wgpu::TextureUsages::COPY_SRC, wgpu::TextureUsages::empty());
        let samples = extent.scaled(per_pixel);
        let colors = (per_pixel > 0).then(|| {
            let sampled = wgpu::TextureUsages::TEXTURE_BINDING;
            let mean = texture(device, extent, COLOR_FORMAT, read);
            Colors {
                samples: view(&texture(device, samples, COLOR_FORMAT, sampled)),
                depth: view(&texture(device, samples, DEPTH_FORMAT, none)),
                mean_view: view(&mean),
                mean: ReadBack::new(device, mean, extent, COLOR_BYTES),
            }
        });
        let ids = texture(device, extent, ID_FORMAT, read);
        Self {
            extent,
            per_pixel,
            id_view: view(&ids),
            id_depth: view(&texture(device, extent, DEPTH_FORMAT, none)),
            colors,
            ids: ReadBack::new(device, ids, extent, ID_BYTES),
        }
    }

    /// Whether a batch can be drawn into these textures without much waste.
    pub fn fits(&self, extent: Extent, per_pixel: u32) -> bool {
        self.per_pixel == per_pixel
            && self.extent.width >= extent.width
            && self.extent.height >= extent.height
            && self.extent.area() <= SLACK * extent.area()
    }

    /// Orders the copy of what was drawn.
    pub fn copy(&self, encoder: &mut wgpu::CommandEncoder, extent: Extent) {
        self.ids.copy(encoder, extent);
        self.colors.iter().for_each(|colors| colors.mean.copy(encoder, extent));
    }

    /// Requests the copied bytes; they have arrived when the submission is done.
    pub fn fetch(&self) {
        self.ids.fetch();
        self.colors.iter().for_each(|colors| colors.mean.fetch());
    }

    /// What came back, in rows of [`padded`] bytes: triangles and depths, and colours if there are
    /// any.
    ///
    /// # Errors
    /// [`Error::Gpu`] where it did not arrive.
    pub fn read<T>(&self, read: impl FnOnce(&[u8], Option<&[u8]>) -> T) -> Result<T> {
        let ids = self.ids.view()?;
        let mean = self.colors.as_ref().map(|colors| colors.mean.view()).transpose()?;
        let answer = read(&ids, mean.as_deref());
        drop((ids, mean));
        self.ids.buffer.unmap();
        self.colors.iter().for_each(|colors| colors.mean.buffer.unmap());
        Ok(answer)
    }
}

/// A texture to be drawn into, and more.
fn texture(
    device: &Device,
    extent: Extent,
    format: wgpu::TextureFormat,
    more: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: extent.texture(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | more,
        view_formats: &[],
    })
}

fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&Default::default())
}

/// A texture and the buffer in which it comes back.
struct ReadBack {
    texture: wgpu::Texture,
    buffer: wgpu::Buffer,
    bytes_per_pixel: u32,
}

impl ReadBack {
    fn new(device: &Device, texture: wgpu::Texture, extent: Extent, bytes_per_pixel: u32) -> Self {
        let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(padded(extent.width, bytes_per_pixel)) * u64::from(extent.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self { texture, buffer, bytes_per_pixel }
    }

    fn copy(&self, encoder: &mut wgpu::CommandEncoder, extent: Extent) {
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded(extent.width, self.bytes_per_pixel)),
                    rows_per_image: None,
                },
            },
            extent.texture(),
        );
    }

    /// A failure leaves the buffer unmapped, and reading it reports that.
    fn fetch(&self) {
        self.buffer.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    }

    fn view(&self) -> Result<wgpu::BufferView> {
        let view = self.buffer.slice(..).get_mapped_range();
        view.map_err(|error| Error::Gpu { reason: error.to_string() })
    }
}
