//! An ONNX network on the runtime `rten`.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rten::{Model, ModelOptions, NodeId, RunOptions, ThreadPool, Value};
use semfm_geom::io::FormatError;
use semfm_views::PatchGrid;

use super::description::{Layout, OnnxDescription};
use super::guarded::guarded;
use crate::Error;
use crate::pretrained::resize::{Filter, resized};
use crate::pretrained::token_network::{Picture, RawTokens, TokenNetwork, by_token};

/// A network that was read, its input and outputs found.
pub(super) struct OnnxNetwork {
    description: OnnxDescription,
    /// For messages.
    path: PathBuf,
    model: Model,
    input: NodeId,
    outputs: Vec<NodeId>,
    /// input = rgb · scale + offset, by channel
    scale: [f32; 3],
    offset: [f32; 3],
}

impl OnnxNetwork {
    /// From a network's bytes and those of the files with its weights, by the names that it has for
    /// them.
    pub fn new(
        description: OnnxDescription,
        path: &Path,
        bytes: Vec<u8>,
        external: Vec<(String, Vec<u8>)>,
    ) -> crate::Result<Self> {
        let mut options = ModelOptions::with_all_ops();
        for (location, content) in external {
            options.external_data(&location, content);
        }
        let refuse = |place: &str, expected: String, found: String| {
            Error::from(FormatError::new(path, place, expected, found))
        };
        let model = guarded(|| options.load(bytes))
            .map_err(|reason| refuse("network", "one that rten can load".into(), reason))?;
        let name =
            |&id: &NodeId| model.node_info(id).and_then(|info| info.name().map(String::from));
        let found = |names: &[NodeId]| names.iter().filter_map(name).collect::<Vec<_>>().join(", ");
        let of_name = |names: &[NodeId], wanted: &str| {
            names.iter().copied().find(|id| name(id).as_deref() == Some(wanted))
        };
        let input = of_name(model.input_ids(), &description.input).ok_or_else(|| {
            refuse("inputs", format!("`{}`", description.input), found(model.input_ids()))
        })?;
        let mut outputs = Vec::new();
        for wanted in &description.outputs {
            outputs.push(of_name(model.output_ids(), wanted).ok_or_else(|| {
                refuse("outputs", format!("`{wanted}`"), found(model.output_ids()))
            })?);
        }
        let (mean, std) = (description.mean.map(|x| x as f32), description.std.map(|x| x as f32));
        let scale = std.map(|std| (1.0 / 255.0) / std);
        let offset = std::array::from_fn(|c| -mean[c] / std[c]);
        Ok(Self { path: path.to_owned(), description, model, input, outputs, scale, offset })
    }

    /// The network's input of a picture (1 × 3 × height × width, or channels last).
    fn input(&self, picture: &Picture) -> Result<Value, String> {
        let Picture { height, width, rgb } = picture;
        let n = height * width;
        let mut values = vec![0.0; 3 * n];
        for (pixel, color) in rgb.iter().enumerate() {
            for (channel, &byte) in color.iter().enumerate() {
                let place = match self.description.layout {
                    Layout::ChannelsFirst => channel * n + pixel,
                    Layout::ChannelsLast => 3 * pixel + channel,
                };
                values[place] = f32::from(byte) * self.scale[channel] + self.offset[channel];
            }
        }
        let shape = match self.description.layout {
            Layout::ChannelsFirst => [1, 3, *height, *width],
            Layout::ChannelsLast => [1, *height, *width, 3],
        };
        Value::from_shape(shape, values).map_err(|error| error.to_string())
    }

    /// The tokens in an output, which must be a grid of `rows` × `cols`.
    fn read_output(
        &self,
        name: &str,
        value: Value,
        rows: usize,
        cols: usize,
    ) -> Result<RawTokens, String> {
        let layout = self.description.output_layout;
        let (shape, values) = value
            .into_shape_vec::<f32, 4>()
            .map_err(|error| format!("output `{name}`: {error}"))?;
        let (dim, found) = match layout {
            Layout::ChannelsFirst => (shape[1], [shape[0], shape[2], shape[3]]),
            Layout::ChannelsLast => (shape[3], [shape[0], shape[1], shape[2]]),
        };
        if found != [1, rows, cols] || dim == 0 {
            let axes = if layout == Layout::ChannelsFirst { "NCHW" } else { "NHWC" };
            return Err(format!(
                "output `{name}`: expected {rows} × {cols} tokens in {axes}, found {shape:?}"
            ));
        }
        let values = match layout {
            Layout::ChannelsLast => values,
            Layout::ChannelsFirst => by_token(&values, dim),
        };
        Ok(RawTokens { rows, cols, dim, values })
    }
}

impl TokenNetwork for OnnxNetwork {
    /// Tokens tile the whole picture.
    fn grid(&self, height: usize, width: usize) -> crate::Result<PatchGrid> {
        let [rows, cols] =
            [height, width].map(|n| self.description.input_size(n) / self.description.patch);
        Ok(PatchGrid { rows, cols, rect: [0.0, 0.0, width as f32, height as f32] })
    }

    fn tokens(&self, picture: &Picture) -> crate::Result<Vec<RawTokens>> {
        let [height, width] =
            [picture.height, picture.width].map(|n| self.description.input_size(n));
        let picture = resized(picture, height, width, Filter::Bilinear);
        let patch = self.description.patch;
        let run = || {
            let input = self.input(&picture)?;
            // One thread: the numbers are the same on every machine of one kind.
            let pool = Arc::new(ThreadPool::with_num_threads(1));
            let options = RunOptions::default().with_thread_pool(Some(pool));
            let inputs = vec![(self.input, input.into())];
            let values = self
                .model
                .run(inputs, &self.outputs, Some(options))
                .map_err(|error| error.to_string())?;
            let named = self.description.outputs.iter().zip(values);
            named
                .map(|(name, value)| self.read_output(name, value, height / patch, width / patch))
                .collect()
        };
        guarded(run).map_err(|reason| Error::Network { path: self.path.clone(), reason })
    }
}

impl fmt::Debug for OnnxNetwork {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OnnxNetwork")
            .field("description", &self.description)
            .finish_non_exhaustive()
    }
}
