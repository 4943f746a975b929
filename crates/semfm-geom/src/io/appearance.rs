//! The colours of a mesh: per vertex, or from images.

use std::path::Path;

use super::format_error::FormatError;
use super::image::{ImageBudget, Texture, Wrap};
use super::input::read_file;
use crate::Result;

/// How a mesh looks, as far as its file says.
///
/// Colours are RGBA bytes in sRGB. Texture coordinates count from the top left corner of the
/// image, u to the right and v down, whatever the file's own convention.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Appearance {
    /// A colour for each vertex (n).
    pub vertex_colors: Option<Vec<[u8; 4]>>,
    /// Texture coordinates of the corners of each triangle (m); NaN where a corner has none.
    pub corner_uvs: Option<Vec<[[f32; 2]; 3]>>,
    /// Which of `materials` each triangle has (m); `None` where all have the first.
    pub material_of: Option<Vec<u32>>,
    /// Base colours and their images; empty where the file has none.
    pub materials: Vec<Material>,
    /// What could not be read of the appearance, and why; the geometry is sound all the same.
    pub notes: Vec<String>,
}

/// A base colour, multiplied by an image where there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// RGBA in 0..1, in sRGB.
    pub color: [f32; 4],
    /// The image that `corner_uvs` point into.
    pub texture: Option<Texture>,
}

/// The colour of a surface about which the file says nothing: a light grey that allows for
/// both highlights and shadows.
pub const DEFAULT_COLOR: [u8; 4] = [200, 200, 200, 255];

/// A texture coordinate that is not there.
pub(crate) const MISSING_UV: [f32; 2] = [f32::NAN; 2];

impl Appearance {
    /// True where the file says nothing about colours.
    pub fn is_plain(&self) -> bool {
        self.vertex_colors.is_none() && self.materials.is_empty()
    }

    /// The colour at a point of triangle `face`, whose vertices are `ids`, given by barycentric
    /// coordinates: vertex colour × base colour × image, each where there is one.
    ///
    /// # Panics
    /// If `face` or an id is not of the mesh this belongs to.
    pub fn color_at(&self, face: usize, ids: [u32; 3], barycentric: [f64; 3]) -> [u8; 4] {
        if self.is_plain() {
            return DEFAULT_COLOR;
        }
        let weights = barycentric.map(|w| w as f32);
        let mut color = [1.0; 4];
        if let Some(colors) = &self.vertex_colors {
            let corners = ids.map(|id| colors[id as usize].map(|c| f32::from(c) / 255.0));
            color = std::array::from_fn(|c| (0..3).map(|i| weights[i] * corners[i][c]).sum());
        }
        let material = self.material_of.as_ref().map_or(0, |of| of[face] as usize);
        if let Some(material) = self.materials.get(material) {
            color = std::array::from_fn(|c| color[c] * material.color[c]);
            if let (Some(texture), Some(uvs)) = (&material.texture, &self.corner_uvs) {
                let uv: [f32; 2] =
                    std::array::from_fn(|c| (0..3).map(|i| weights[i] * uvs[face][i][c]).sum());
                if let Some(texel) = texture.sample(uv) {
                    color = std::array::from_fn(|c| color[c] * texel[c]);
                }
            }
        }
        color.map(byte)
    }

    /// BLAKE3, in hexadecimal, of everything that [`Appearance::color_at`] reads: equal hashes, equal
    /// colours on the same mesh.
    pub fn content_hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"semfm.appearance/1\n");
        let colors = self.vertex_colors.as_deref().unwrap_or_default();
        hash_array(&mut hasher, colors.as_flattened().to_vec());
        let uvs = self.corner_uvs.as_deref().unwrap_or_default().as_flattened().as_flattened();
        hash_array(&mut hasher, uvs.iter().flat_map(|x| x.to_le_bytes()).collect());
        let material_of = self.material_of.as_deref().unwrap_or_default();
        hash_array(&mut hasher, material_of.iter().flat_map(|id| id.to_le_bytes()).collect());
        for Material { color, texture } in &self.materials {
            hash_array(&mut hasher, color.iter().flat_map(|x| x.to_le_bytes()).collect());
            if let Some(texture) = texture {
                texture.hash_into(&mut hasher);
            }
        }
        hasher.finalize().to_hex().to_string()
    }

    /// Puts the image of a file on a mesh that has texture coordinates (an OBJ or a PLY, say).
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) or [`Error::Format`](crate::Error::Format) about the image;
    /// [`Error::Format`](crate::Error::Format) where the mesh has no
    /// texture coordinates for it.
    pub fn attach_image(&mut self, path: &Path) -> Result<()> {
        if self.corner_uvs.is_none() {
            let (expected, found) =
                ("a mesh that an image fits on", "a mesh without texture coordinates");
            return Err(FormatError::new(path, "texture", expected, found).into());
        }
        let bytes = read_file(path)?;
        let mut budget = ImageBudget::generous();
        let texture = Texture::decode(&bytes, [Wrap::Repeat; 2], &mut budget)
            .map_err(|reason| FormatError::new(path, "texture", "a PNG or JPEG image", reason))?;
        self.materials = vec![Material { color: [1.0; 4], texture: Some(texture) }];
        self.material_of = None;
        Ok(())
    }
}

/// Hashes bytes after their number, so that neighbours cannot run into each other.
fn hash_array(hasher: &mut blake3::Hasher, bytes: Vec<u8>) {
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(&bytes);
}

/// RGBA bytes from numbers in 0..1: a missing alpha (NaN) is opaque, a missing colour white.
pub(crate) fn rgba_from_floats(color: [f32; 4]) -> [u8; 4] {
    color.map(|x| if x.is_nan() { 255 } else { byte(x) })
}

fn byte(x: f32) -> u8 {
    (x * 255.0).round() as u8 // a cast saturates
}

/// sRGB of a linear value (IEC 61966-2-1).
pub(crate) fn srgb_from_linear(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertex_colours_blend_over_the_triangle() {
        let colors = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]];
        let appearance = Appearance { vertex_colors: Some(colors), ..Default::default() };
        assert_eq!(appearance.color_at(0, [0, 1, 2], [0.0, 1.0, 0.0]), [0, 255, 0, 255]);
        assert_eq!(appearance.color_at(0, [0, 1, 2], [0.4, 0.2, 0.4]), [102, 51, 102, 255]);
    }

    #[test]
    fn equal_hashes_mean_equal_colours() {
        let texture = |red| Texture::new(1, 1, vec![red, 0, 0, 255], [Wrap::Clamp; 2]);
        let with = |red| Appearance {
            materials: vec![Material { color: [1.0; 4], texture: texture(red) }],
            ..Default::default()
        };
        assert_eq!(with(7).content_hash(), with(7).content_hash());
        assert_ne!(with(7).content_hash(), with(8).content_hash());
        assert_ne!(with(7).content_hash(), Appearance::default().content_hash());
    }

    #[test]
    fn an_image_is_looked_up_from_its_top_left_corner() {
        let rgba8 = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [9, 9, 9, 255]];
        let texture = Texture::new(2, 2, rgba8.as_flattened().to_vec(), [Wrap::Clamp; 2]).unwrap();
        let appearance = Appearance {
            corner_uvs: Some(vec![[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [MISSING_UV; 3]]),
            materials: vec![Material { color: [1.0, 1.0, 0.5, 1.0], texture: Some(texture) }],
            ..Default::default()
        };
        let at = |barycentric| appearance.color_at(0, [0, 1, 2], barycentric);
        assert_eq!(at([1.0, 0.0, 0.0]), [255, 0, 0, 255]);
        assert_eq!(at([0.0, 1.0, 0.0]), [0, 255, 0, 255]);
        assert_eq!(at([0.0, 0.0, 1.0]), [0, 0, 128, 255]);
        assert_eq!(appearance.color_at(1, [0, 1, 2], [1.0, 0.0, 0.0]), [255, 255, 128, 255]);
    }
}
