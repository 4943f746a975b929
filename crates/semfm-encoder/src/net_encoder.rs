//! A network of ours as an encoder: pictures to tokens, in this process and without further files.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use semfm_geom::Task;
use semfm_geom::io::FormatError;
use semfm_views::{EmbeddedView, PatchEmbeddings, PatchGrid, RenderSettings, RigSettings, View};

use crate::convolution::Tensor;
use crate::coverage::coverage;
use crate::encoder::{EncodedViews, Encoder, EncoderIdentity, WantedViews};
use crate::layer::Size;
use crate::net_file::{NetFile, NetHeader};
use crate::rendered_views::{Coloring, RenderedObject, ViewSettings};
use crate::turned::{Turned, picture_size};
use crate::{Error, Result};

/// Largest file of weights that is read.
const MAX_FILE: u64 = 1 << 30;
/// Digits of the content's hash in the version.
const HASH_DIGITS: usize = 12;

/// A convolutional network that makes one unit vector of each `patch` × `patch` pixels.
///
/// Its version is the file's own with the first digits of the content's hash, so that other weights
/// are another version whatever the file says.
#[derive(Clone, Debug)]
pub struct NetEncoder {
    file: NetFile,
    wants: WantedViews,
}

impl NetEncoder {
    /// Reads `NAME.net`. It is shown the default views in grey, once each, at its own size.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] where the file cannot be read, [`Error::Format`] with the place where
    /// it breaks its format.
    pub fn read(path: &Path) -> Result<Self> {
        let io_error = |source| semfm_geom::Error::Io { path: path.to_owned(), source };
        let n_bytes = std::fs::metadata(path).map_err(io_error)?.len();
        if n_bytes > MAX_FILE {
            let expected = format!("at most {MAX_FILE} bytes");
            return Err(FormatError::new(path, "size", expected, n_bytes.to_string()).into());
        }
        Self::parse(path, &semfm_geom::io::read_file(path)?)
    }

    /// The same from a file's bytes; `path` names it in errors.
    ///
    /// # Errors
    /// [`Error::Format`] with the place where the bytes break the format.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let file = NetFile::parse(path, bytes)?;
        let rig = RigSettings { size: file.header.size as u32, ..RigSettings::default() };
        let background = file.header.background.color();
        let render = RenderSettings { background, ..RenderSettings::default() };
        let views = ViewSettings { rig, render, coloring: Coloring::Grey };
        Ok(Self { file, wants: WantedViews { views, reads_colors: false, rolls: 1 } })
    }

    /// The same network with other wishes about what it is shown.
    pub fn with_wants(self, change: impl FnOnce(&mut WantedViews)) -> Self {
        let mut changed = self;
        change(&mut changed.wants);
        changed
    }

    /// What its file says of it.
    pub fn header(&self) -> &NetHeader {
        &self.file.header
    }

    /// Length of a token.
    pub fn dim(&self) -> usize {
        self.file.dim
    }

    /// Tokens of a view turned by quarters and turned back (rows × columns × dim), each of unit
    /// length or zero.
    fn tokens(&self, view: &View, quarters: u32) -> Vec<f32> {
        let NetHeader { channels, mean, std, patch, .. } = &self.file.header;
        let (height, width) = picture_size(&view.camera);
        let turned = Turned::new(height, width, quarters);
        let (turned_height, turned_width) = turned.size();
        let size = Size { height: turned_height, width: turned_width, channels: channels.len() };
        let mut values = vec![0.0; size.len()];
        for (number, channel) in channels.iter().enumerate() {
            let plane = channel.values(view);
            let pixels = values.iter_mut().skip(number).step_by(channels.len());
            for (value, place) in pixels.zip(turned.places()) {
                *value = (plane[place] - mean[number]) / std[number];
            }
        }
        let output = self.file.network.forward(Tensor { size, values });
        let dim = self.file.dim;
        let back = Turned::new(turned_height / patch, turned_width / patch, (4 - quarters) % 4);
        let mut tokens = Vec::with_capacity(output.values.len());
        for place in back.places() {
            let token = &output.values[place * dim..][..dim];
            let norm = token.iter().map(|x| x * x).sum::<f32>().sqrt();
            let scale = if norm > 0.0 { norm.recip() } else { 0.0 };
            tokens.extend(token.iter().map(|x| x * scale));
        }
        tokens
    }

    /// The patches of a view: the mean of its tokens at all rotations, which is not scaled back to unit
    /// length.
    fn patches(&self, view: &View, quarters: &[u32]) -> Result<PatchEmbeddings> {
        let (height, width) = picture_size(&view.camera);
        let (patch, dim) = (self.file.header.patch, self.file.dim);
        let mut data = self.tokens(view, quarters[0]);
        for &turn in &quarters[1..] {
            data.iter_mut().zip(self.tokens(view, turn)).for_each(|(sum, x)| *sum += x);
        }
        let share = (quarters.len() as f32).recip();
        data.iter_mut().for_each(|sum| *sum *= share);
        let valid = data
            .chunks_exact(dim)
            .map(|token| token.iter().all(|x| x.is_finite()) && token.iter().any(|&x| x != 0.0))
            .collect();
        let grid = PatchGrid {
            rows: height / patch,
            cols: width / patch,
            rect: [0.0, 0.0, width as f32, height as f32],
        };
        Ok(PatchEmbeddings::new(grid, dim, data, coverage(view, &grid), valid)?)
    }

    /// Refuses pictures that are not whole patches, or too large for the network.
    fn check(&self, view: &View) -> Result<()> {
        let NetHeader { patch, channels, .. } = &self.file.header;
        let (height, width) = picture_size(&view.camera);
        let found = format!("{height} × {width}");
        if !(height.is_multiple_of(*patch) && width.is_multiple_of(*patch)) {
            let expected = format!("height and width that are multiples of {patch}");
            return Err(Error::invalid("pictures for the encoder", expected, found));
        }
        let size = Size { height, width, channels: channels.len() };
        let output = self.file.network.output_size(size).map_err(|(layer, misfit)| {
            let expected = format!("{}, in layer {layer}", misfit.expected);
            Error::invalid("pictures for the encoder", expected, misfit.found)
        })?;
        if (output.height, output.width) != (height / patch, width / patch) {
            let expected = "a size of which the network makes one token per patch";
            return Err(Error::invalid("pictures for the encoder", expected, found));
        }
        Ok(())
    }
}

impl Encoder for NetEncoder {
    fn identity(&self) -> EncoderIdentity {
        let NetHeader { name, version, .. } = self.header();
        let version = format!("{version}+{}", &self.file.hash[..HASH_DIGITS]);
        EncoderIdentity { name: name.clone(), version }
    }

    fn wants(&self) -> WantedViews {
        self.wants.clone()
    }

    fn content_hash(&self) -> Result<String> {
        Ok(self.file.hash.clone())
    }

    /// Pictures share the cores; the numbers do not depend on how many there are.
    fn encode(
        &self,
        objects: &[RenderedObject<'_>],
        rolls: u32,
        task: &Task,
    ) -> Result<Vec<EncodedViews>> {
        semfm_geom::keep_faer_sequential();
        let quarters = Turned::quarters_of(rolls)?;
        let views: Vec<&View> = objects.iter().flat_map(|object| &object.views).collect();
        views.iter().try_for_each(|view| self.check(view))?;
        let done = AtomicUsize::new(0);
        task.step("encode", 0, views.len())?;
        let embedded: Result<Vec<EmbeddedView>> = views
            .par_iter()
            .map(|view| {
                task.check()?;
                let patches = self.patches(view, quarters)?;
                task.step("encode", done.fetch_add(1, Ordering::Relaxed) + 1, views.len())?;
                Ok(EmbeddedView { camera: view.camera, patches })
            })
            .collect();
        let mut embedded = embedded?.into_iter();
        let encoded = objects.iter().map(|object| EncodedViews {
            encoder: self.identity(),
            preprocessing: self.preprocessing(),
            rolls,
            outliers: "none dropped".into(),
            views: embedded.by_ref().take(object.views.len()).collect(),
        });
        Ok(encoded.collect())
    }
}

impl NetEncoder {
    /// How a picture becomes the input, as one line of JSON.
    fn preprocessing(&self) -> String {
        let NetHeader { channels, mean, std, .. } = self.header();
        serde_json::json!({ "channels": channels, "mean": mean, "std": std }).to_string()
    }
}
