//! How an ONNX network is fed: the JSON `semfm.encoder/1` (`docs/encoders.md`).

use std::path::{Component, Path, PathBuf};

use semfm_geom::io::{FormatError, json_of};
use serde::{Deserialize, Serialize};

use crate::Result;

const FORMAT: &str = "semfm.encoder/1";
/// No number of a description is larger: pictures have some hundred pixels.
const LARGEST: usize = 4096;
/// A smaller standard deviation is a mistake.
const SMALLEST: f64 = 1e-6;

/// The order of an array's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Layout {
    /// Picture, channel, row, column.
    #[serde(rename = "NCHW")]
    ChannelsFirst,
    /// Picture, row, column, channel.
    #[serde(rename = "NHWC")]
    ChannelsLast,
}

/// A checked `semfm.encoder/1` file; the fields are the JSON's.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OnnxDescription {
    format: String,
    onnx: String,
    pub input: String,
    pub layout: Layout,
    pub size_multiple: usize,
    pub mean: [f64; 3],
    pub std: [f64; 3],
    pub outputs: Vec<String>,
    pub output_layout: Layout,
    pub patch: usize,
    /// For people.
    #[serde(default, rename = "licence")]
    _licence: Option<serde_json::Value>,
    #[serde(default, rename = "source")]
    _source: Option<serde_json::Value>,
}

impl OnnxDescription {
    /// Reads and checks a description; `path` is for messages.
    pub fn parse(path: &Path, json: &[u8]) -> Result<Self> {
        let description: Self = json_of(path, json)?;
        description.check(path)?;
        Ok(description)
    }

    fn check(&self, path: &Path) -> std::result::Result<(), FormatError> {
        let refuse = |field: &str, expected: String, found: String| {
            Err(FormatError::new(path, field, expected, found))
        };
        if self.format != FORMAT {
            return refuse("format", format!("`{FORMAT}`"), format!("`{}`", self.format));
        }
        for (field, text) in [("onnx", &self.onnx), ("input", &self.input)] {
            if text.is_empty() {
                return refuse(field, "some text".into(), "none".into());
            }
        }
        for (field, size) in [("patch", self.patch), ("size_multiple", self.size_multiple)] {
            if !(1..=LARGEST).contains(&size) {
                let expected = format!("a whole number from 1 to {LARGEST}");
                return refuse(field, expected, size.to_string());
            }
        }
        if !self.size_multiple.is_multiple_of(self.patch) {
            let expected = format!("a multiple of the patch, {}", self.patch);
            return refuse("size_multiple", expected, self.size_multiple.to_string());
        }
        for (field, numbers) in [("mean", self.mean), ("std", self.std)] {
            if numbers.iter().any(|x| x.abs() > LARGEST as f64) {
                let expected = format!("three numbers of at most {LARGEST}");
                return refuse(field, expected, format!("{numbers:?}"));
            }
        }
        if self.std.iter().any(|&std| std < SMALLEST) {
            let expected = format!("three numbers of at least {SMALLEST:e}");
            return refuse("std", expected, format!("{:?}", self.std));
        }
        let mut names = self.outputs.clone();
        names.sort();
        names.dedup();
        if names.is_empty() || names.len() < self.outputs.len() {
            let found = self.outputs.join(", ");
            return refuse("outputs", "names that differ, one or more".into(), found);
        }
        Ok(())
    }

    /// The network's file: in the folder of the description, wherever links lead.
    pub fn network_path(&self, path: &Path) -> Result<PathBuf> {
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let network = folder.join(&self.onnx);
        let outside = || {
            let expected = "a file inside the folder of the JSON";
            FormatError::new(path, "onnx", expected, format!("`{}`", self.onnx))
        };
        let below =
            Path::new(&self.onnx).components().all(|part| matches!(part, Component::Normal(_)));
        if !below || self.onnx.contains('\0') {
            return Err(outside().into());
        }
        // Where it cannot be followed, reading the file says why.
        if let (Ok(real_folder), Ok(real)) = (folder.canonicalize(), network.canonicalize())
            && !real.starts_with(real_folder)
        {
            return Err(outside().into());
        }
        Ok(network)
    }

    /// The network's input for a picture of this height or width: the nearest multiple.
    pub fn input_size(&self, size: usize) -> usize {
        let multiple = self.size_multiple;
        ((size + multiple / 2) / multiple * multiple).max(multiple)
    }

    /// What happens to the pixels, as one line of JSON.
    pub fn preprocessing(&self) -> String {
        serde_json::json!({
            "layout": self.layout,
            "mean": self.mean,
            "std": self.std,
            "size_multiple": self.size_multiple,
            "resize": "bilinear to the nearest multiple",
            "outputs": self.outputs,
            "patch": self.patch,
        })
        .to_string()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn good() -> Value {
        json!({
            "format": FORMAT, "onnx": "tiny.onnx", "input": "image", "layout": "NCHW",
            "size_multiple": 16, "mean": [0.5, 0.4, 0.3], "std": [0.5, 0.25, 0.2],
            "outputs": ["mean", "mix"], "output_layout": "NHWC", "patch": 8, "licence": "CC0",
        })
    }

    fn parse(value: &Value) -> Result<OnnxDescription> {
        OnnxDescription::parse(Path::new("m/tiny.json"), value.to_string().as_bytes())
    }

    #[test]
    fn a_good_description_is_read() {
        let found = parse(&good()).unwrap();
        assert_eq!((found.layout, found.patch), (Layout::ChannelsFirst, 8));
        assert_eq!(found.network_path(Path::new("m/tiny.json")).unwrap(), Path::new("m/tiny.onnx"));
        let sizes = [1, 23, 24, 40, 224].map(|size| found.input_size(size));
        assert_eq!(sizes, [16, 16, 32, 48, 224]);
    }

    #[test]
    fn a_wrong_description_is_refused_by_field() {
        for (field, value) in [
            ("format", json!("semfm.encoder/2")),
            ("patch", json!(0)),
            ("patch", json!(true)),
            ("patch", json!(5000)),
            ("size_multiple", json!(12)),
            ("mean", json!([0.5, 0.5])),
            ("mean", json!([0.5, 0.5, 1e9])),
            ("std", json!([0.5, 0.5, 0])),
            ("outputs", json!([])),
            ("outputs", json!(["mean", "mean"])),
            ("outputs", json!("mean")),
            ("layout", json!("CHW")),
            ("onnx", json!("")),
            ("pach", json!(8)),
        ] {
            let mut wrong = good();
            wrong[field] = value;
            let error = parse(&wrong).unwrap_err().to_string();
            // The parser names the value of an enumeration and of a type, not its field.
            let by_value = ["CHW", "boolean", "invalid length", "invalid type"];
            assert!(
                error.contains(field) || by_value.iter().any(|words| error.contains(words)),
                "{field}: {error}"
            );
        }
        let mut short = good();
        short.as_object_mut().unwrap().remove("std");
        assert!(parse(&short).unwrap_err().to_string().contains("std"));
    }

    #[test]
    fn networks_outside_of_the_folder_are_refused() {
        for name in ["../tiny.onnx", "a/../../tiny.onnx", "/tmp/tiny.onnx", "a\0b", "."] {
            let mut wrong = good();
            wrong["onnx"] = json!(name);
            let description = parse(&wrong).unwrap();
            let error = description.network_path(Path::new("m/tiny.json")).unwrap_err();
            assert!(error.to_string().contains("inside the folder"), "{error}");
        }
    }
}
