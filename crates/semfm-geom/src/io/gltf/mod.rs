//! glTF 2.0 and GLB: the default scene as one mesh.
//!
//! The surface is the one that viewers show before any animation is played. Nodes are visited depth first from the
//! scene's roots, each mesh is copied once per node that shows it (or per instance of EXT_mesh_gpu_instancing), and
//! transforms are applied; a mirroring transform turns the triangles around so that they still face outwards. Hidden
//! nodes (KHR_node_visibility), points and lines are left out. Morph targets count with the weights of the node or the
//! mesh. The vertices of a skinned mesh stand where the joints carry them; its node's transform does not count
//! (glTF 2.0, section 3.7.3.3).

mod accessor;
mod buffers;
mod json;
mod material;
mod scene;
mod skin;
mod write;

pub(super) use self::write::write_node;
pub use self::write::{GlbNode, write_glb};

use self::accessor::Accessors;
use self::buffers::Buffers;
use self::json::{Asset, Root, Versioned};
use self::scene::SceneReader;
use super::format_row::{FormatRow, FormatWriter, MeshParts};
use super::input::{Input, quote};
use crate::Result;

/// Extensions that change nothing we read, or that we follow.
const KNOWN_EXTENSIONS: [&str; 6] = [
    "EXT_mesh_gpu_instancing",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_node_visibility",
    "KHR_animation_pointer",
];

/// What a compressed file is refused for.
const UNCOMPRESSED: &str = "uncompressed geometry (export without compression)";

/// The row of glTF as JSON in the table of formats.
pub(super) const GLTF: FormatRow = FormatRow {
    name: "gltf",
    extensions: &["gltf"],
    summary: "glTF 2.0 as JSON",
    recognise: |bytes| bytes.trim_ascii_start().starts_with(b"{"),
    read,
    read_points: None,
    writer: None,
};

/// The row of glTF in one binary file.
pub(super) const GLB: FormatRow = FormatRow {
    name: "glb",
    extensions: &["glb"],
    summary: "glTF 2.0 in one binary file",
    recognise: |bytes| bytes.starts_with(b"glTF"),
    read,
    read_points: None,
    writer: Some(FormatWriter {
        write: write::write,
        holds_colors: true,
        holds_scalars: true,
        is_single_precision: true,
    }),
};

/// Reads a glTF file, which is JSON, or a GLB, which has it in its first chunk.
fn read(input: Input<'_>) -> Result<MeshParts> {
    let is_glb =
        input.bytes.starts_with(b"glTF") || input.path.extension().is_some_and(|e| e == "glb");
    let (json, chunk) = if is_glb { glb_chunks(input)? } else { (input.bytes, None) };
    let json_error = |error: serde_json::Error| {
        let place = format!("JSON line {} column {}", error.line(), error.column());
        input.error(place, "the JSON of a glTF 2.0 file", error.to_string())
    };
    check_version(input, &Versioned::parse(json).map_err(json_error)?.asset)?;
    let root: Root = serde_json::from_slice(json).map_err(json_error)?;
    check_extensions(input, &root)?;
    let buffers = Buffers::new(input, &root, chunk);
    let accessors = Accessors { input, root: &root, buffers: &buffers };
    SceneReader::new(&accessors).read()
}

/// The JSON chunk and the binary chunk of a GLB (glTF 2.0, section 4.4).
fn glb_chunks(input: Input<'_>) -> Result<(&[u8], Option<&[u8]>)> {
    if !input.bytes.starts_with(b"glTF") || word(input, 4)? != 2 {
        return Err(input.error(
            "byte 0",
            "glTF and version 2",
            quote(&input.bytes[..input.bytes.len().min(8)]),
        ));
    }
    let length = word(input, 8)?;
    if length < 20 || length > input.bytes.len() {
        let found = format!("{length} in the header and a file of {} bytes", input.bytes.len());
        return Err(input.error("byte 8", "the length of the file", found));
    }
    let mut chunks = Vec::new();
    let mut offset = 12;
    // Chunks after the second are for extensions; what follows the announced length is not ours.
    while offset + 8 <= length && chunks.len() < 2 {
        let (n_bytes, kind) = (word(input, offset)?, word(input, offset + 4)?);
        let start = offset + 8;
        let end = start.saturating_add(n_bytes);
        if end > length {
            let found = format!("{} before the end", length - start);
            return Err(input.error(
                format!("byte {offset}"),
                format!("a chunk of {n_bytes} bytes"),
                found,
            ));
        }
        chunks.push((kind, &input.bytes[start..end]));
        offset = end;
    }
    const JSON: usize = u32::from_le_bytes(*b"JSON") as usize;
    const BIN: usize = u32::from_le_bytes(*b"BIN\0") as usize;
    match chunks[..] {
        [(JSON, json), (BIN, chunk)] => Ok((trim_padding(json), Some(chunk))),
        [(JSON, json), ..] => Ok((trim_padding(json), None)),
        _ => Err(input.error("byte 12", "a JSON chunk first", "another one or none")),
    }
}

/// The number in the four bytes at `offset`.
fn word(input: Input<'_>, offset: usize) -> Result<usize> {
    let bytes = input.bytes.get(offset..offset + 4).and_then(|b| b.try_into().ok());
    let bytes = bytes
        .ok_or_else(|| input.error(format!("byte {offset}"), "4 bytes", "the end of the file"))?;
    Ok(u32::from_le_bytes(bytes) as usize)
}

/// Chunks are padded with blanks; some writers pad with zeros.
fn trim_padding(mut json: &[u8]) -> &[u8] {
    while let Some(head) = json.strip_suffix(b"\0") {
        json = head;
    }
    json
}

/// Major and minor number of a version.
fn version_parts(version: &str) -> Option<[u32; 2]> {
    let (major, minor) = version.split_once('.')?;
    Some([major.parse().ok()?, minor.parse().ok()?])
}

fn check_version(input: Input<'_>, asset: &Asset) -> Result<()> {
    let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
    // A later 2.x may be read by a 2.0 reader unless `minVersion` says otherwise.
    let newest = if asset.min_version.is_some() { [2, 0] } else { [2, u32::MAX] };
    let major = version_parts(&asset.version).map(|[major, _]| major);
    if major != Some(2) || version_parts(needed).is_none_or(|version| version > newest) {
        return Err(input.error("asset", "glTF version 2", quote(needed.as_bytes())));
    }
    Ok(())
}

fn is_known_extension(name: &str) -> bool {
    let material = name.starts_with("KHR_materials_");
    // Image formats are a matter of appearance: a missing image is noted.
    let image = matches!(name, "EXT_texture_webp" | "KHR_texture_basisu" | "EXT_texture_avif");
    material || image || KNOWN_EXTENSIONS.contains(&name)
}

fn check_extensions(input: Input<'_>, root: &Root) -> Result<()> {
    let Some(name) = root.extensions_required.iter().find(|name| !is_known_extension(name)) else {
        return Ok(());
    };
    let is_compression = name.contains("meshopt") || name.contains("draco");
    let expected = if is_compression { UNCOMPRESSED } else { "extensions we follow" };
    Err(input.error("extensionsRequired", expected, quote(name.as_bytes())))
}
