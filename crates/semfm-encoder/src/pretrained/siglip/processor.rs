//! What happens to a picture before the network sees it: `preprocessor_config.json`.

use std::path::{Path, PathBuf};

use semfm_geom::io::{FormatError, read_json};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::pretrained::resize::{Filter, resized};
use crate::pretrained::token_network::Picture;

const PREPROCESSOR: &str = "preprocessor_config.json";
/// Newer checkpoints keep the settings here, in a field.
const PROCESSOR: &str = "processor_config.json";
const LARGEST: usize = 4096;

/// A checked image processor: resize to a fixed size, scale, normalise.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Processor {
    /// The file, for messages.
    pub path: PathBuf,
    pub height: usize,
    pub width: usize,
    filter: Filter,
    /// input = byte · scale + offset, by channel
    scale: [f32; 3],
    offset: [f32; 3],
    settings: Settings,
}

/// The fields of transformers' file, with its defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Settings {
    do_resize: bool,
    do_rescale: bool,
    do_normalize: bool,
    size: Size,
    /// Pillow's number of a filter.
    resample: u32,
    rescale_factor: f64,
    image_mean: [f64; 3],
    image_std: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Size {
    height: usize,
    width: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            do_resize: true,
            do_rescale: true,
            do_normalize: true,
            size: Size { height: 224, width: 224 },
            resample: 3,
            rescale_factor: 1.0 / 255.0,
            image_mean: [0.5; 3],
            image_std: [0.5; 3],
        }
    }
}

#[derive(Deserialize)]
struct WholeProcessor {
    image_processor: Settings,
}

impl Processor {
    /// Reads the settings of the image processor in a checkpoint's folder.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(PREPROCESSOR);
        if path.exists() {
            let settings = read_json(&path)?;
            return Self::new(path, settings);
        }
        let whole = folder.join(PROCESSOR);
        if whole.exists() {
            let WholeProcessor { image_processor } = read_json(&whole)?;
            return Self::new(whole, image_processor);
        }
        let expected = format!("{PREPROCESSOR} or {PROCESSOR}");
        Err(FormatError::new(folder, "image processor", expected, "neither").into())
    }

    fn new(path: PathBuf, settings: Settings) -> Result<Self> {
        let refuse = |field: &str, expected: &str, found: String| {
            Err(FormatError::new(&path, field, expected, found).into())
        };
        let Settings { image_mean: mean, image_std: std, .. } = settings;
        let Size { height, width } = settings.size;
        if !settings.do_resize {
            return refuse("do_resize", "true", "false".into());
        }
        if !(1..=LARGEST).contains(&height) || !(1..=LARGEST).contains(&width) {
            return refuse("size", "1 to 4096 pixels", format!("{height} × {width}"));
        }
        let filter = match settings.resample {
            1 => Filter::Lanczos,
            2 => Filter::Bilinear,
            3 => Filter::Bicubic,
            other => {
                return refuse(
                    "resample",
                    "1, 2 or 3 (Lanczos, bilinear, bicubic)",
                    other.to_string(),
                );
            }
        };
        let factor = if settings.do_rescale { settings.rescale_factor } else { 1.0 };
        let (mean, std) = if settings.do_normalize { (mean, std) } else { ([0.0; 3], [1.0; 3]) };
        let scale = std.map(|std| (factor / std) as f32);
        let offset: [f32; 3] = std::array::from_fn(|c| (-mean[c] / std[c]) as f32);
        if scale.iter().chain(&offset).any(|x| !x.is_finite()) || std.iter().any(|&x| x <= 0.0) {
            let found = format!("{std:?}");
            return refuse("image_std", "three positive numbers", found);
        }
        Ok(Self { height, width, filter, scale, offset, settings, path })
    }

    /// The network's input (3 × height × width).
    pub fn input(&self, picture: &Picture) -> Vec<f32> {
        let picture = resized(picture, self.height, self.width, self.filter);
        let mut values = Vec::with_capacity(3 * picture.rgb.len());
        for channel in 0..3 {
            let (scale, offset) = (self.scale[channel], self.offset[channel]);
            values.extend(picture.rgb.iter().map(|rgb| f32::from(rgb[channel]) * scale + offset));
        }
        values
    }

    /// The settings as one line of JSON.
    pub fn describe(&self) -> String {
        serde_json::json!(self.settings).to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn new(json: &str) -> Result<Processor> {
        Processor::new("preprocessor_config.json".into(), serde_json::from_str(json).unwrap())
    }

    #[test]
    fn bytes_become_what_the_network_was_trained_on() {
        let processor = new(r#"{"size": {"height": 1, "width": 2}}"#).unwrap();
        let picture = Picture { height: 1, width: 2, rgb: vec![[0, 51, 255], [255, 204, 0]] };
        let expected = [-1.0, 1.0, -0.6, 0.6, 1.0, -1.0];
        for (x, expected) in processor.input(&picture).into_iter().zip(expected) {
            assert!((x - expected).abs() < 1e-6, "{x} {expected}");
        }
    }

    #[test]
    fn settings_out_of_range_are_refused_by_name() {
        for (json, field) in [
            (r#"{"do_resize": false}"#, "do_resize"),
            (r#"{"resample": 0}"#, "resample"),
            (r#"{"size": {"height": 0, "width": 2}}"#, "size"),
            (r#"{"size": {"height": 5000, "width": 2}}"#, "size"),
            (r#"{"image_std": [0.5, 0, 0.5]}"#, "image_std"),
        ] {
            let error = new(json).unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }

    #[test]
    fn a_folder_without_a_processor_is_told_so() {
        let error = Processor::read(Path::new("nowhere")).unwrap_err().to_string();
        assert!(error.contains("preprocessor_config.json"), "{error}");
    }
}
