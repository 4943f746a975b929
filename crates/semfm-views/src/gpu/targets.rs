//! What the driver draws into, and how it comes back.

use super::device::Device;
use super::pipelines::{COLOR_FORMAT, DEPTH_FORMAT, ID_FORMAT};
use crate::{Error, Result};

/// Rows of a copied picture start on multiples of this many bytes.
const ROW_ALIGNMENT: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// Textures for one view at a time; the driver puts the views in order.
pub(super) struct Targets {
    pub size: [u32; 2],
    pub ids: wgpu::Texture,
    pub id_depth: wgpu::TextureView,
    /// The samples' colours (sides × samples along a pixel), their depth, and the mean.
    pub samples: wgpu::TextureView,
    pub sample_depth: wgpu::TextureView,
    pub colors: wgpu::Texture,
}

impl Targets {
    /// # Errors
    /// [`Error::BeyondGpu`] where the driver cannot draw so large a picture.
    pub fn new(device: &Device, [width, height]: [u32; 2], per_pixel: u32) -> Result<Self> {
        let largest = device.device.limits().max_texture_dimension_2d;
        let needed = width.max(height) * per_pixel;
        if needed > largest {
            return Err(Error::BeyondGpu {
                what: "image side",
                expected: format!(
                    "at most {} pixels of {per_pixel}² samples each",
                    largest / per_pixel
                ),
                found: width.max(height).to_string(),
            });
        }
        let texture = |scale: u32, format, more| {
            device.device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d {
                    width: width * scale,
                    height: height * scale,
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | more,
                view_formats: &[],
            })
        };
        let (read, none) = (wgpu::TextureUsages::COPY_SRC, wgpu::TextureUsages::empty());
        let view = |texture: wgpu::Texture| texture.create_view(&Default::default());
        Ok(Self {
            size: [width, height],
            ids: texture(1, ID_FORMAT, read),
            id_depth: view(texture(1, DEPTH_FORMAT, none)),
            samples: view(texture(per_pixel, COLOR_FORMAT, wgpu::TextureUsages::TEXTURE_BINDING)),
            sample_depth: view(texture(per_pixel, DEPTH_FORMAT, none)),
            colors: texture(1, COLOR_FORMAT, read),
        })
    }
}

/// A buffer that carries the pictures of some views back, `bytes_per_pixel` for each pixel.
pub(super) struct ReadBack {
    pub buffer: wgpu::Buffer,
    size: [u32; 2],
    bytes_per_pixel: u32,
}

impl ReadBack {
    pub fn new(device: &Device, size: [u32; 2], bytes_per_pixel: u32, n_views: usize) -> Self {
        let bytes = Self::view_bytes(size, bytes_per_pixel) * n_views as u64;
        let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self { buffer, size, bytes_per_pixel }
    }

    /// Bytes that one view takes, with the padding of its rows.
    pub fn view_bytes([width, height]: [u32; 2], bytes_per_pixel: u32) -> u64 {
        u64::from((width * bytes_per_pixel).next_multiple_of(ROW_ALIGNMENT)) * u64::from(height)
    }

    /// Orders the copy of a texture into the place of view `k`.
    pub fn copy(&self, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture, k: usize) {
        let [width, height] = self.size;
        let row = (width * self.bytes_per_pixel).next_multiple_of(ROW_ALIGNMENT);
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: Self::view_bytes(self.size, self.bytes_per_pixel) * k as u64,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
    }

    /// Asks for the buffer's content; [`Device::wait`] waits for it.
    pub fn fetch(&self) {
        // A failure leaves the buffer unmapped, and reading it reports that.
        self.buffer.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    }

    /// Hands the rows of each view to `read` (view, bytes without padding).
    ///
    /// # Errors
    /// [`Error::Gpu`] where the content did not arrive.
    pub fn rows(&self, mut read: impl FnMut(usize, &[u8])) -> Result<()> {
        let mapped = self
            .buffer
            .slice(..)
            .get_mapped_range()
            .map_err(|error| Error::Gpu { reason: error.to_string() })?;
        let used = (self.size[0] * self.bytes_per_pixel) as usize;
        let padded = used.next_multiple_of(ROW_ALIGNMENT as usize);
        for (line, bytes) in mapped.chunks_exact(padded).enumerate() {
            read(line / self.size[1] as usize, &bytes[..used]);
        }
        Ok(())
    }
}
