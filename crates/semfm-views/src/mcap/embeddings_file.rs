//! `NAME.emb.mcap`: what an encoder made of each view, with the cameras.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use foxglove::bytes::Bytes;
use half::f16;
use half::slice::HalfFloatSliceExt;
use semfm_geom::Mesh;

use super::cameras::{Cameras, check_camera};
use super::decode::{Mismatch, check_count, decode, insert_once, message_error, topic_error};
use super::embeddings_message::{PATCH_EMBEDDINGS, PatchEmbeddingsMessage};
use super::messages::{camera_calibration, camera_transform, timestamp};
use super::metadata::{EmbeddingsMetadata, METADATA_NAME};
use super::reader::{Message, read_messages};
use super::topics::{OBJECT, TF, frame, parse_topic, time_of, topic};
use super::writer::{ChunkCompression, McapWriter, write_mcap};
use crate::{EmbeddedView, Error, PatchEmbeddings, PatchGrid, Result};

/// How vectors are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dtype {
    /// Half precision: three decimal digits, half the size. Normalised features lose nothing that
    /// matters to a cosine.
    #[default]
    F16,
    /// Single precision.
    F32,
}

impl Dtype {
    fn name(self) -> &'static str {
        match self {
            Self::F16 => "f16",
            Self::F32 => "f32",
        }
    }

    fn parse(name: &str) -> Option<Self> {
        [Self::F16, Self::F32].into_iter().find(|dtype| dtype.name() == name)
    }

    /// Bytes of one number.
    fn n_bytes(self) -> usize {
        match self {
            Self::F16 => 2,
            Self::F32 => 4,
        }
    }
}

/// The embeddings of an object's views.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddingsFile {
    /// The file they came from, for messages; empty for one that was never written.
    pub path: PathBuf,
    /// Of which mesh, by which encoder.
    pub metadata: EmbeddingsMetadata,
    /// The views, as numbered; at least one, all of the same dimension.
    pub views: Vec<EmbeddedView>,
}

impl EmbeddingsFile {
    /// Reads an embeddings file and checks everything in it.
    ///
    /// # Errors
    /// [`Error::Container`] for a damaged file; [`Error::Format`] with topic and message for
    /// inconsistent dimensions, numbers that are not finite in a valid patch, wrong lengths, missing
    /// or non-rigid cameras and wrong counts.
    pub fn read(path: &Path) -> Result<Self> {
        let mut cameras = Cameras::default();
        let mut patches: BTreeMap<usize, PatchEmbeddings> = BTreeMap::new();
        let contents = read_messages(path, |message| match parse_topic(&message.channel.topic) {
            Some((view, "camera")) => cameras.calibration(path, view, &message),
            Some((view, "embeddings")) => {
                let grid = read_grid(path, view, &message)?;
                if let Some(first) = patches.values().next().filter(|p| p.dim() != grid.dim()) {
                    let expected = format!("dimension {}, as in the views before", first.dim());
                    return Err(message_error(path, &message, &expected, grid.dim().to_string()));
                }
                insert_once(&mut patches, view, grid, path, &message)
            }
            _ if message.channel.topic == TF => cameras.transform(path, &message),
            _ => Ok(()),
        })?;
        let (metadata, n_views) = EmbeddingsMetadata::read(path, &contents.metadata)?;
        check_count(path, "/views/NNN/embeddings", n_views, patches.len())?;
        let size = (metadata.views.width, metadata.views.height);
        let cameras = cameras.finish(path, n_views, size)?;
        let views = cameras.into_iter().enumerate().map(|(view, camera)| {
            let patches = patches.remove(&view).ok_or_else(|| {
                topic_error(path, &topic(view, "embeddings"), "one message", "none")
            })?;
            Ok(EmbeddedView { camera, patches })
        });
        Ok(Self { path: path.to_path_buf(), metadata, views: views.collect::<Result<_>>()? })
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`Error::Invalid`] where [`read`](Self::read) would refuse the file, [`Error::Io`].
    pub fn write(&self, path: &Path, dtype: Dtype) -> Result<()> {
        self.check()?;
        write_mcap(path, "", ChunkCompression::None, |file| {
            file.metadata(METADATA_NAME, self.metadata.entries(self.views.len()))?;
            for (view, embedded) in self.views.iter().enumerate() {
                write_view(file, view, embedded, dtype)?;
            }
            Ok(())
        })
    }

    /// Refuses to be used with another mesh than the one the views were made of.
    ///
    /// # Errors
    /// [`Error::OtherMesh`], naming both.
    pub fn check_mesh(&self, mesh: &Mesh) -> Result<()> {
        self.metadata.views.check_mesh(mesh, &self.path)
    }

    /// Dimension of the embeddings; 0 without views.
    pub fn dim(&self) -> usize {
        self.views.first().map_or(0, |view| view.patches.dim())
    }

    fn check(&self) -> Result<()> {
        if self.views.is_empty() {
            return Err(Error::invalid("views", "at least one", "none"));
        }
        let size = (self.metadata.views.width, self.metadata.views.height);
        for (view, embedded) in self.views.iter().enumerate() {
            check_camera(view, &embedded.camera)?;
            let found = (embedded.camera.width(), embedded.camera.height());
            if found != size {
                let what = format!("image size of view {view:03}");
                return Err(Error::invalid(
                    what,
                    format!("{} × {}", size.0, size.1),
                    format!("{} × {}", found.0, found.1),
                ));
            }
            let found = embedded.patches.dim();
            if found != self.dim() {
                let expected = format!("dimension {}, as in view 000", self.dim());
                return Err(Error::invalid(format!("view {view:03}"), expected, found.to_string()));
            }
        }
        Ok(())
    }
}

fn write_view(
    file: &mut McapWriter<'_>,
    view: usize,
    embedded: &EmbeddedView,
    dtype: Dtype,
) -> Result<()> {
    let EmbeddedView { camera, patches } = embedded;
    let time = time_of(view);
    file.log(TF, time, &camera_transform(OBJECT, frame(view), time, camera))?;
    file.log(&topic(view, "camera"), time, &camera_calibration(frame(view), time, camera))?;
    let PatchGrid { rows, cols, rect: [x0, y0, x1, y1] } = patches.grid();
    let message = PatchEmbeddingsMessage {
        timestamp: Some(timestamp(time)),
        frame_id: frame(view),
        rows: count(rows)?,
        cols: count(cols)?,
        dim: count(patches.dim())?,
        dtype: dtype.name().to_owned(),
        data: encode(view, patches, dtype)?,
        x0,
        y0,
        x1,
        y1,
        coverage: Bytes::copy_from_slice(patches.coverage()),
        valid: patches.valid().iter().map(|&valid| valid.into()).collect::<Vec<u8>>().into(),
    };
    file.log(&topic(view, "embeddings"), time, &message)
}

fn count(n: usize) -> Result<u32> {
    u32::try_from(n)
        .map_err(|_| Error::invalid("rows, cols or dim", "less than 2^32", n.to_string()))
}

/// Numbers are converted in blocks of this many, which stay in the cache.
const BLOCK: usize = 4096;

/// Vectors as little-endian bytes.
fn encode(view: usize, patches: &PatchEmbeddings, dtype: Dtype) -> Result<Bytes> {
    let numbers = patches.data();
    let mut bytes = Vec::with_capacity(numbers.len() * dtype.n_bytes());
    match dtype {
        Dtype::F32 => extend(&mut bytes, numbers, f32::to_le_bytes),
        Dtype::F16 => {
            // Everything from here on rounds to infinity.
            let any_large = numbers.iter().fold(false, |any, x| any | (x.abs() >= 65_520.0));
            if any_large && let Some(at) = numbers.iter().position(|&x| is_beyond_half(x)) {
                let what = format!("view {view:03}, number {at}");
                return Err(Error::invalid(what, "at most 65504 for f16", numbers[at].to_string()));
            }
            let mut halves = [f16::ZERO; BLOCK];
            for numbers in numbers.chunks(BLOCK) {
                let halves = &mut halves[..numbers.len()];
                halves.convert_from_f32_slice(numbers);
                extend(&mut bytes, halves, f16::to_le_bytes);
            }
        }
    }
    Ok(bytes.into())
}

/// Finite, but not in half precision.
fn is_beyond_half(x: f32) -> bool {
    x.is_finite() && f16::from_f32(x).is_infinite()
}

/// Appends numbers as little-endian bytes: in one go where the machine holds them so already.
fn extend<T: bytemuck::NoUninit, const N: usize>(
    bytes: &mut Vec<u8>,
    numbers: &[T],
    to_le_bytes: impl Fn(T) -> [u8; N],
) {
    match cfg!(target_endian = "little") {
        true => bytes.extend_from_slice(bytemuck::cast_slice(numbers)),
        false => numbers.iter().for_each(|&x| bytes.extend(to_le_bytes(x))),
    }
}

/// One grid, checked but for its dimension, which the first view sets.
fn read_grid(path: &Path, view: usize, message: &Message<'_>) -> Result<PatchEmbeddings> {
    let grid: PatchEmbeddingsMessage = decode(path, message, PATCH_EMBEDDINGS)?;
    patches_of(view, grid).map_err(|mismatch| mismatch.in_message(path, message))
}

fn patches_of(
    view: usize,
    grid: PatchEmbeddingsMessage,
) -> std::result::Result<PatchEmbeddings, Mismatch> {
    if grid.frame_id != frame(view) {
        let found = format!("`{}`", grid.frame_id);
        return Err(Mismatch::new(format!("the frame `{}`", frame(view)), found));
    }
    let dtype = Dtype::parse(&grid.dtype)
        .ok_or_else(|| Mismatch::new("the dtype `f16` or `f32`", format!("`{}`", grid.dtype)))?;
    let product = u64::from(grid.rows).checked_mul(grid.cols.into());
    let product = product.and_then(|n| n.checked_mul(grid.dim.into()));
    let n_bytes = product.and_then(|n| n.checked_mul(dtype.n_bytes() as u64));
    if n_bytes != Some(grid.data.len() as u64) {
        let PatchEmbeddingsMessage { rows, cols, dim, .. } = grid;
        let expected = format!("{rows} × {cols} × {dim} numbers of {} bytes", dtype.n_bytes());
        return Err(Mismatch::new(expected, format!("{} bytes of data", grid.data.len())));
    }
    if let Some(byte) = grid.valid.iter().find(|&&valid| valid > 1) {
        return Err(Mismatch::new("0 or 1 for the validity of a patch", byte.to_string()));
    }
    let place = PatchGrid {
        rows: grid.rows as usize,
        cols: grid.cols as usize,
        rect: [grid.x0, grid.y0, grid.x1, grid.y1],
    };
    let data = decode_numbers(&grid.data, dtype);
    let valid = grid.valid.iter().map(|&valid| valid == 1).collect();
    PatchEmbeddings::new(place, grid.dim as usize, data, grid.coverage.to_vec(), valid).map_err(
        |refusal| match refusal {
            Error::Invalid { what, expected, found } => {
                Mismatch::new(format!("{what}: {expected}"), found)
            }
            other => Mismatch::new("sound patches", other.to_string()),
        },
    )
}

/// Numbers out of little-endian bytes.
fn decode_numbers(bytes: &[u8], dtype: Dtype) -> Vec<f32> {
    match dtype {
        Dtype::F32 => {
            bytes.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
        }
        Dtype::F16 => {
            // Through a small aligned block, so that the conversion can use the processor's own.
            let mut block = [f16::ZERO; BLOCK];
            let mut numbers = vec![0.0; bytes.len() / 2];
            for (numbers, bytes) in numbers.chunks_mut(BLOCK).zip(bytes.chunks(2 * BLOCK)) {
                let block = &mut block[..numbers.len()];
                for (half, &bytes) in block.iter_mut().zip(bytes.as_chunks::<2>().0) {
                    *half = f16::from_le_bytes(bytes);
                }
                block.convert_to_f32_slice(numbers);
            }
            numbers
        }
    }
}
