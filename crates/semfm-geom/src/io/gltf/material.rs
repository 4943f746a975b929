//! Base colours and their images.

use super::accessor::{Accessors, Component};
use super::buffers::Bytes;
use super::json::{BaseColor, TextureInfo, Whole};
use crate::io::appearance::{Material, srgb_from_linear};
use crate::io::image::{ImageBudget, Texture, Wrap};

/// A material ready for triangles: the base colour, and how its texture coordinates are found.
pub(crate) struct Surface {
    pub material: Material,
    /// Which `TEXCOORD_n` the image takes.
    pub uv_set: usize,
    /// Moves texture coordinates (KHR_texture_transform); rows of a 2 × 3 matrix.
    pub uv_from_uv: [[f32; 3]; 2],
}

impl Surface {
    /// A material of the file. What cannot be read of it goes into `notes`.
    pub fn read(
        accessors: &Accessors<'_>,
        material: Option<usize>,
        budget: &mut Option<ImageBudget>,
        notes: &mut Vec<String>,
    ) -> Self {
        let mut surface = Self {
            material: Material { color: [1.0; 4], texture: None },
            uv_set: 0,
            uv_from_uv: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        };
        let Some(id) = material else { return surface };
        let Some(json) = accessors.root.materials.get(id) else {
            notes.push(format!("material {id} does not exist"));
            return surface;
        };
        let base =
            json.pbr_metallic_roughness.as_ref().or(json.extensions.specular_glossiness.as_ref());
        let Some(BaseColor { factor, texture }) = base else { return surface };
        if let Some([r, g, b, a]) = *factor {
            // The factor is linear, we multiply in sRGB; for a power law both are the same.
            surface.material.color =
                [srgb_from_linear(r), srgb_from_linear(g), srgb_from_linear(b), a];
        }
        if let Some(info) = texture {
            surface.place(info);
            match load(accessors, info, budget) {
                Ok(texture) => surface.material.texture = Some(texture),
                Err(reason) => notes.push(format!("the image of material {id}: {reason}")),
            }
        }
        surface
    }

    fn place(&mut self, info: &TextureInfo) {
        self.uv_set = info.tex_coord.map_or(0, |set| set.0);
        if let Some(transform) = &info.extensions.transform {
            self.uv_set = transform.tex_coord.map_or(self.uv_set, |set| set.0);
            let [sx, sy] = transform.scale.unwrap_or([1.0; 2]);
            let (sin, cos) = transform.rotation.sin_cos();
            let [x, y] = transform.offset;
            self.uv_from_uv = [[cos * sx, sin * sy, x], [-sin * sx, cos * sy, y]];
        }
    }

    /// Texture coordinates of a primitive's vertices, where it has the set that the image takes.
    pub fn uvs(
        &self,
        accessors: &Accessors<'_>,
        uv_accessor: usize,
    ) -> crate::Result<Vec<[f32; 2]>> {
        let allowed = [Component::F32, Component::U8, Component::U16];
        let moved =
            |[u, v]: [f64; 2]| self.uv_from_uv.map(|[a, b, c]| a * u as f32 + b * v as f32 + c);
        Ok(accessors.vectors::<2>(uv_accessor, &allowed)?.into_iter().map(moved).collect())
    }
}

fn load(
    accessors: &Accessors<'_>,
    info: &TextureInfo,
    budget: &mut Option<ImageBudget>,
) -> Result<Texture, String> {
    let root = accessors.root;
    let texture = root.textures.get(info.index.0).ok_or("its texture does not exist")?;
    let source = texture.source.ok_or("its texture has no image that we read")?;
    let image = root.images.get(source.0).ok_or("it does not exist")?;
    let bytes = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => accessors.buffers.resolve(&format!("image {}", source.0), uri),
        (None, Some(view)) => accessors.buffers.view(view.0).map(Bytes::Own),
        (None, None) => return Err("it has neither a uri nor a buffer view".into()),
    };
    let bytes = bytes.map_err(|error| error.to_string())?;
    let sampler = texture.sampler.and_then(|id| root.samplers.get(id.0));
    let codes = [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)];
    let wrap = codes.map(|code| match code {
        Some(Whole(33_071)) => Wrap::Clamp,
        Some(Whole(33_648)) => Wrap::Mirror,
        _ => Wrap::Repeat,
    });
    let budget = budget.get_or_insert_with(|| ImageBudget::of_file(accessors.buffers.n_loaded()));
    Texture::decode(&bytes, wrap, budget)
}
