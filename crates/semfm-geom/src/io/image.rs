//! Texture images: decoding within limits, and looking up colours.

use std::io::Cursor;

use image::{ImageDecoder, ImageReader, Limits};

/// An image of RGBA bytes in sRGB, rows from the top.
#[derive(Clone, PartialEq)]
pub struct Texture {
    width: u32,
    height: u32,
    rgba8: Vec<u8>,
    wrap: [Wrap; 2],
}

/// What lies outside 0..1, along u or v.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// Its edge.
    Clamp,
    /// The image, every other copy turned around.
    Mirror,
}

/// How many decoded bytes the images of one file may still take.
///
/// A few hundred bytes of PNG can unpack to gigabytes; the reader promises to stay within 64 MB
/// and 40 times the file.
#[derive(Clone, Debug)]
pub(crate) struct ImageBudget {
    bytes: u64,
}

/// Bytes that a colour profile or a text beside the pixels may unpack to; profiles have some megabytes at most.
const MOST_BESIDE: u64 = 16 << 20;

/// Longest side of an image; the largest textures in use are 8192 wide.
const MAX_SIDE: u32 = 16_384;

impl ImageBudget {
    /// The budget of a file whose bytes, images included, are `n_bytes`. Decoding holds the
    /// image twice for a moment, in the file's pixel format and in ours.
    pub fn of_file(n_bytes: usize) -> Self {
        Self { bytes: (24 << 20) + 20 * n_bytes as u64 }
    }

    /// Enough for one of the largest images, for files the user names one by one.
    pub fn generous() -> Self {
        Self { bytes: 1 << 30 }
    }
}

impl Texture {
    /// An image of `width` × `height` pixels, 4 bytes each, rows from the top; `None` if it is
    /// empty or the bytes do not fit.
    pub fn new(width: u32, height: u32, rgba8: Vec<u8>, wrap: [Wrap; 2]) -> Option<Self> {
        let n_bytes = u64::from(width) * u64::from(height) * 4;
        (n_bytes > 0 && n_bytes == rgba8.len() as u64).then_some(Self {
            width,
            height,
            rgba8,
            wrap,
        })
    }

    /// Decodes a PNG or JPEG; the reason in words where that fails.
    pub(crate) fn decode(
        bytes: &[u8],
        wrap: [Wrap; 2],
        budget: &mut ImageBudget,
    ) -> Result<Self, String> {
        let mut reader = ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|error| error.to_string())?;
        // A colour profile unpacks while the decoder is made, before its limits can be set.
        let mut beside = Limits::default();
        beside.max_alloc = Some(budget.bytes.min(MOST_BESIDE));
        reader.limits(beside);
        let mut decoder = reader.into_decoder().map_err(|error| error.to_string())?;
        let (width, height) = decoder.dimensions();
        let n_bytes = u64::from(width) * u64::from(height) * 4;
        if width > MAX_SIDE
            || height > MAX_SIDE
            || n_bytes.max(decoder.total_bytes()) > budget.bytes
        {
            let limit = budget.bytes >> 20;
            return Err(format!(
                "{width} × {height} pixels, more than {limit} MiB or {MAX_SIDE} on a side"
            ));
        }
        let mut limits = Limits::default();
        limits.max_alloc = Some(budget.bytes);
        decoder.set_limits(limits).map_err(|error| error.to_string())?;
        let pixels = image::DynamicImage::from_decoder(decoder)
            .map_err(|error| error.to_string())?
            .into_rgba8();
        budget.bytes -= n_bytes;
        Self::new(width, height, pixels.into_raw(), wrap).ok_or_else(|| "no pixels".into())
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// RGBA bytes (height × width × 4), rows from the top.
    pub fn rgba8(&self) -> &[u8] {
        &self.rgba8
    }

    /// Adds everything that [`Texture::sample`] reads to a hash.
    pub(crate) fn hash_into(&self, hasher: &mut blake3::Hasher) {
        hasher.update(&self.width.to_le_bytes());
        hasher.update(&self.height.to_le_bytes());
        hasher.update(&self.wrap.map(|wrap| wrap as u8));
        hasher.update(&self.rgba8);
    }

    /// Bilinear colour in 0..1 at `uv`, counted from the top left corner; `None` at NaN.
    pub fn sample(&self, uv: [f32; 2]) -> Option<[f32; 4]> {
        let ([x0, x1], s) = self.wrap[0].neighbours(uv[0], self.width)?;
        let ([y0, y1], t) = self.wrap[1].neighbours(uv[1], self.height)?;
        Some(std::array::from_fn(|c| {
            let top = self.texel(x0, y0, c) * (1.0 - s) + self.texel(x1, y0, c) * s;
            let bottom = self.texel(x0, y1, c) * (1.0 - s) + self.texel(x1, y1, c) * s;
            top * (1.0 - t) + bottom * t
        }))
    }

    /// Channel `c` of a pixel, in 0..1.
    fn texel(&self, x: usize, y: usize, c: usize) -> f32 {
        f32::from(self.rgba8[(y * self.width as usize + x) * 4 + c]) / 255.0
    }
}

impl Wrap {
    /// The two pixels of a row (or column) of `side` whose centres are next to a coordinate, and
    /// how far it lies from the first to the second; `None` at NaN.
    fn neighbours(self, coordinate: f32, side: u32) -> Option<([usize; 2], f32)> {
        if !coordinate.is_finite() {
            return None;
        }
        let inside = self.apply(coordinate) * side as f32 - 0.5;
        let low = inside.floor();
        let side = i64::from(side);
        let pixels = [low as i64, low as i64 + 1].map(|i| match self {
            Self::Repeat => i.rem_euclid(side) as usize,
            Self::Clamp | Self::Mirror => i.clamp(0, side - 1) as usize,
        });
        Some((pixels, inside - low))
    }

    /// Brings a coordinate into 0..1.
    fn apply(self, x: f32) -> f32 {
        match self {
            Self::Repeat => x.rem_euclid(1.0),
            Self::Clamp => x.clamp(0.0, 1.0),
            Self::Mirror => 1.0 - (x.rem_euclid(2.0) - 1.0).abs(),
        }
    }
}

impl std::fmt::Debug for Texture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Texture({} × {})", self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        image::RgbImage::new(width, height)
            .write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png)
            .unwrap();
        bytes
    }

    #[test]
    fn an_image_that_unpacks_too_large_is_refused_before_it_does() {
        let bytes = png(6000, 6000);
        assert!(bytes.len() < 1 << 20);
        let mut budget = ImageBudget::of_file(bytes.len());
        let error = Texture::decode(&bytes, [Wrap::Repeat; 2], &mut budget).unwrap_err();
        assert!(error.contains("6000 × 6000"), "{error}");
        assert!(Texture::decode(&png(8, 4), [Wrap::Repeat; 2], &mut budget).is_ok());
        assert!(
            Texture::decode(&bytes[..99], [Wrap::Repeat; 2], &mut ImageBudget::generous()).is_err()
        );
    }

    #[test]
    fn wrapping_follows_its_names() {
        for (wrap, coordinate, expected) in [
            (Wrap::Repeat, 1.25, 0.25),
            (Wrap::Repeat, -0.25, 0.75),
            (Wrap::Clamp, -3.0, 0.0),
            (Wrap::Mirror, 1.25, 0.75),
            (Wrap::Mirror, -0.25, 0.25),
        ] {
            let found: f32 = wrap.apply(coordinate);
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }
}
