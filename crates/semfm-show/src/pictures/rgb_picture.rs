//! A finished picture in memory.

use semfm::views::View;

/// Widest picture on a page: wider ones are made smaller by a whole factor.
const WIDEST: u32 = 1280;

/// An sRGB picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbPicture {
    /// Bytes (height × width × 3), top row first.
    pub rgb: Vec<u8>,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
}

impl RgbPicture {
    /// The picture in the bytes of a PNG or JPEG; `None` where they are none.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let picture = image::load_from_memory(bytes).ok()?.into_rgb8();
        let (width, height) = picture.dimensions();
        Some(Self { rgb: picture.into_raw(), width, height })
    }

    /// Views of one height side by side.
    pub(crate) fn beside(views: &[View]) -> Self {
        let height = views.iter().map(|view| view.camera.height()).min().unwrap_or(0);
        let width = views.iter().map(|view| view.camera.width()).sum();
        let mut rgb = Vec::with_capacity(width as usize * height as usize * 3);
        for row in 0..height as usize {
            for view in views {
                let bytes = 3 * view.camera.width() as usize;
                rgb.extend_from_slice(&view.rgb[row * bytes..][..bytes]);
            }
        }
        Self { rgb, width, height }
    }

    /// The same, as narrow as a page needs it: means of square blocks of pixels.
    pub(crate) fn for_page(&self) -> Self {
        let factor = self.width.div_ceil(WIDEST).max(1);
        if factor == 1 {
            return self.clone();
        }
        let (width, height) = (self.width / factor, self.height / factor);
        let mut rgb = Vec::with_capacity((width * height * 3) as usize);
        for y in 0..height {
            for x in 0..width {
                for channel in 0..3 {
                    let block = (0..factor * factor).map(|i| {
                        let (row, column) = (y * factor + i / factor, x * factor + i % factor);
                        u32::from(self.rgb[((row * self.width + column) * 3 + channel) as usize])
                    });
                    rgb.push((block.sum::<u32>() / (factor * factor)) as u8);
                }
            }
        }
        Self { rgb, width, height }
    }

    /// Draws over a pixel.
    pub(crate) fn tint(&mut self, pixel: usize, color: [u8; 3], opacity: f32) {
        for (under, over) in self.rgb[3 * pixel..3 * pixel + 3].iter_mut().zip(color) {
            let (below, above) = (f32::from(*under), f32::from(over));
            *under = (below + opacity * (above - below)).round() as u8;
        }
    }

    #[cfg(test)]
    pub(crate) fn at(&self, pixel: usize) -> [u8; 3] {
        [self.rgb[3 * pixel], self.rgb[3 * pixel + 1], self.rgb[3 * pixel + 2]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_picture_becomes_narrow_by_means_and_a_narrow_one_stays() {
        let wide = RgbPicture {
            rgb: (0..2 * 2 * WIDEST).flat_map(|i| [if i % 2 == 0 { 10 } else { 20 }; 3]).collect(),
            width: 2 * WIDEST,
            height: 2,
        };
        let narrow = wide.for_page();
        assert_eq!((narrow.width, narrow.height), (WIDEST, 1));
        assert!(narrow.rgb.iter().all(|&x| x == 15));
        assert_eq!(narrow.for_page(), narrow);
        assert_eq!(RgbPicture::decode(b"no picture"), None);
    }
}
