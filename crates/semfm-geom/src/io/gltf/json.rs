//! The part of glTF's JSON that shapes and colours need.
//!
//! Field names and defaults follow Khronos, *glTF 2.0 specification*, section 5. Everything else in
//! the file is skipped unread.

use std::collections::{HashMap, HashSet};
use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// A whole number from 0: an index, a count, an offset. JSON may write 3 as `3.0`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Whole(pub usize);

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = serde_json::Number::deserialize(deserializer)?;
        let whole = number.as_u64().or_else(|| {
            let exact = number.as_f64().filter(|x| x.fract() == 0.0 && (0.0..9e15).contains(x));
            exact.map(|x| x as u64)
        });
        let size = whole.and_then(|whole| usize::try_from(whole).ok());
        size.map(Self)
            .ok_or_else(|| D::Error::custom(format!("{number} is not a whole number from 0")))
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Root {
    pub scene: Option<Whole>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub skins: Vec<Skin>,
    #[serde(default)]
    pub animations: Vec<IgnoredAny>,
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub buffers: Vec<Buffer>,
    #[serde(default)]
    pub materials: Vec<Material>,
    #[serde(default)]
    pub textures: Vec<Texture>,
    #[serde(default)]
    pub images: Vec<Image>,
    #[serde(default)]
    pub samplers: Vec<Sampler>,
    #[serde(default)]
    pub extensions_used: Vec<String>,
    #[serde(default)]
    pub extensions_required: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Asset {
    pub version: String,
    pub min_version: Option<String>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Scene {
    #[serde(default)]
    pub nodes: Vec<Whole>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Node {
    pub mesh: Option<Whole>,
    pub skin: Option<Whole>,
    #[serde(default)]
    pub children: Vec<Whole>,
    /// Column-major.
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    /// x, y, z, w.
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    /// Of the mesh's morph targets, in place of the mesh's own.
    pub weights: Option<Vec<f64>>,
    #[serde(default)]
    pub extensions: NodeExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(crate) struct NodeExtensions {
    #[serde(rename = "KHR_node_visibility")]
    pub visibility: Option<NodeVisibility>,
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub instancing: Option<MeshGpuInstancing>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct NodeVisibility {
    /// True unless it says otherwise.
    pub visible: Option<bool>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct MeshGpuInstancing {
    /// TRANSLATION, ROTATION and SCALE of each instance.
    #[serde(default)]
    pub attributes: HashMap<String, Whole>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Skin {
    #[serde(default)]
    pub joints: Vec<Whole>,
    pub inverse_bind_matrices: Option<Whole>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Mesh {
    #[serde(default)]
    pub primitives: Vec<Primitive>,
    /// Of the primitives' morph targets; zeros where they are absent.
    #[serde(default)]
    pub weights: Vec<f64>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Primitive {
    #[serde(default)]
    pub attributes: HashMap<String, Whole>,
    pub indices: Option<Whole>,
    pub material: Option<Whole>,
    pub mode: Option<Whole>,
    /// Morph targets: displacements by attribute.
    #[serde(default)]
    pub targets: Vec<HashMap<String, Whole>>,
    #[serde(default)]
    pub extensions: HashMap<String, IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Accessor {
    pub buffer_view: Option<Whole>,
    pub byte_offset: Option<Whole>,
    pub component_type: Whole,
    #[serde(default)]
    pub normalized: bool,
    pub count: Whole,
    #[serde(rename = "type")]
    pub kind: String,
    pub sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Sparse {
    pub count: Whole,
    pub indices: SparseIndices,
    pub values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct SparseIndices {
    pub buffer_view: Whole,
    pub byte_offset: Option<Whole>,
    pub component_type: Whole,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct SparseValues {
    pub buffer_view: Whole,
    pub byte_offset: Option<Whole>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct BufferView {
    pub buffer: Whole,
    pub byte_offset: Option<Whole>,
    pub byte_length: Whole,
    pub byte_stride: Option<Whole>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Buffer {
    pub uri: Option<String>,
    pub byte_length: Whole,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Material {
    pub pbr_metallic_roughness: Option<BaseColor>,
    #[serde(default)]
    pub extensions: MaterialExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(crate) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<BaseColor>,
}

/// The colour under all lights, in either of the two material models.
#[derive(Debug, Deserialize)]
pub(crate) struct BaseColor {
    #[serde(rename = "baseColorFactor", alias = "diffuseFactor")]
    pub factor: Option<[f32; 4]>,
    #[serde(rename = "baseColorTexture", alias = "diffuseTexture")]
    pub texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct TextureInfo {
    pub index: Whole,
    pub tex_coord: Option<Whole>,
    #[serde(default)]
    pub extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(crate) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<TextureTransform>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct TextureTransform {
    #[serde(default)]
    pub offset: [f32; 2],
    #[serde(default)]
    pub rotation: f32,
    pub scale: Option<[f32; 2]>,
    pub tex_coord: Option<Whole>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Texture {
    pub sampler: Option<Whole>,
    pub source: Option<Whole>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Image {
    pub uri: Option<String>,
    pub buffer_view: Option<Whole>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Sampler {
    pub wrap_s: Option<Whole>,
    pub wrap_t: Option<Whole>,
}

/// What tells a glTF file's version, whatever the rest looks like in that version.
#[derive(Debug, Deserialize)]
pub(crate) struct Versioned {
    pub asset: Asset,
}

impl Versioned {
    /// Parses the JSON and checks that no object in it has a name twice, as glTF demands.
    pub fn parse(json: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice::<UniqueNames>(json)?;
        serde_json::from_slice(json)
    }
}

/// Any JSON value in which names are unique within their object.
struct UniqueNames;

impl<'de> Deserialize<'de> for UniqueNames {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(UniqueNamesVisitor)
    }
}

struct UniqueNamesVisitor;

impl<'de> Visitor<'de> for UniqueNamesVisitor {
    type Value = UniqueNames;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<UniqueNames, A::Error> {
        let mut names = HashSet::new();
        while let Some(name) = map.next_key::<String>()? {
            map.next_value::<UniqueNames>()?;
            if let Some(twice) = names.replace(name) {
                return Err(A::Error::custom(format!(
                    "the name `{twice}` stands twice in one object"
                )));
            }
        }
        Ok(UniqueNames)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<UniqueNames, A::Error> {
        while seq.next_element::<UniqueNames>()?.is_some() {}
        Ok(UniqueNames)
    }

    fn visit_bool<E>(self, _: bool) -> Result<UniqueNames, E> {
        Ok(UniqueNames)
    }

    fn visit_i64<E>(self, _: i64) -> Result<UniqueNames, E> {
        Ok(UniqueNames)
    }

    fn visit_u64<E>(self, _: u64) -> Result<UniqueNames, E> {
        Ok(UniqueNames)
    }

    fn visit_f64<E>(self, _: f64) -> Result<UniqueNames, E> {
        Ok(UniqueNames)
    }

    fn visit_str<E>(self, _: &str) -> Result<UniqueNames, E> {
        Ok(UniqueNames)
    }

    fn visit_unit<E>(self) -> Result<UniqueNames, E> {
        Ok(UniqueNames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_may_be_written_as_floats() {
        for good in ["3", "3.0", "30e-1"] {
            assert_eq!(serde_json::from_str::<Whole>(good).unwrap(), Whole(3));
        }
        for bad in ["-1", "2.5", "1e300", "\"3\""] {
            assert!(serde_json::from_str::<Whole>(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_name_stands_once_in_an_object() {
        let json = |extra: &str| format!(r#"{{"asset": {{"version": "2.0"}}, "extras": {extra}}}"#);
        assert!(Versioned::parse(json(r#"[{"a": 1}, {"a": 2}]"#).as_bytes()).is_ok());
        let error = Versioned::parse(json(r#"[{"a": 1, "a": 2}]"#).as_bytes()).unwrap_err();
        assert!(error.to_string().contains("`a` stands twice"), "{error}");
    }
}
