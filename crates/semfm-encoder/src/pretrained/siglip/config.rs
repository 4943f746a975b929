//! The sizes of a vision tower: `config.json`.

use std::path::Path;

use semfm_geom::io::{FormatError, json_of};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::Result;

/// `model_type` of a whole checkpoint, and of a vision tower alone.
const WHOLE: &str = "siglip";
const TOWER: &str = "siglip_vision_model";
/// The only nonlinearity of released checkpoints.
const ACTIVATION: &str = "gelu_pytorch_tanh";
/// The largest sizes that are read: several times those of released checkpoints (1152, 4304, 27, 512,
/// 1024 tokens).
const MAX_WIDTH: usize = 1 << 14;
const MAX_LAYERS: usize = 128;
const MAX_SIDE: usize = 4096;
const MAX_TOKENS: usize = 4096;

/// A vision tower's sizes, with transformers' defaults where the file says nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct VisionConfig {
    pub hidden_size: usize,
    pub intermediate_size: usize,
    pub num_hidden_layers: usize,
    pub num_attention_heads: usize,
    num_channels: usize,
    pub image_size: usize,
    pub patch_size: usize,
    hidden_act: String,
    pub layer_norm_eps: f32,
}

impl Default for VisionConfig {
    fn default() -> Self {
        Self {
            hidden_size: 768,
            intermediate_size: 3072,
            num_hidden_layers: 12,
            num_attention_heads: 12,
            num_channels: 3,
            image_size: 224,
            patch_size: 16,
            hidden_act: ACTIVATION.into(),
            layer_norm_eps: 1e-6,
        }
    }
}

/// The part of the file that tells the families apart.
#[derive(Deserialize)]
struct Family {
    #[serde(default)]
    model_type: String,
    #[serde(default)]
    vision_config: Option<Value>,
}

/// Whether a `config.json` is of a family that is read here.
pub(super) fn is_siglip(path: &Path, json: &[u8]) -> bool {
    json_of::<Family>(path, json).is_ok_and(|family| [WHOLE, TOWER].contains(&&*family.model_type))
}

impl VisionConfig {
    /// Reads and checks the sizes; `path` is for messages.
    pub fn parse(path: &Path, json: &[u8]) -> Result<Self> {
        let family: Family = json_of(path, json)?;
        let config: Self = match (family.model_type.as_str(), family.vision_config) {
            (WHOLE, Some(vision)) => json_of(path, vision.to_string().as_bytes())?,
            (WHOLE, None) => Self::default(),
            (TOWER, _) => json_of(path, json)?,
            (other, _) => {
                let expected = format!("`{WHOLE}` or `{TOWER}`");
                let found = format!("`{other}`");
                return Err(FormatError::new(path, "model_type", expected, found).into());
            }
        };
        config.check(path)?;
        Ok(config)
    }

    fn check(&self, path: &Path) -> std::result::Result<(), FormatError> {
        let refuse = |field: &str, expected: String, found: String| {
            Err(FormatError::new(path, field, expected, found))
        };
        for (field, size, most) in [
            ("hidden_size", self.hidden_size, MAX_WIDTH),
            ("intermediate_size", self.intermediate_size, MAX_WIDTH),
            ("num_hidden_layers", self.num_hidden_layers, MAX_LAYERS),
            ("num_attention_heads", self.num_attention_heads, self.hidden_size),
            ("image_size", self.image_size, MAX_SIDE),
            ("patch_size", self.patch_size, self.image_size),
        ] {
            if !(1..=most).contains(&size) {
                return refuse(field, format!("1 to {most}"), size.to_string());
            }
        }
        if !self.hidden_size.is_multiple_of(self.num_attention_heads) {
            let expected = format!("a divisor of the width, {}", self.hidden_size);
            return refuse("num_attention_heads", expected, self.num_attention_heads.to_string());
        }
        if self.n_tokens() > MAX_TOKENS {
            let expected = format!("at most {MAX_TOKENS} patches");
            return refuse("patch_size", expected, self.n_tokens().to_string());
        }
        if self.num_channels != 3 {
            return refuse("num_channels", "3".into(), self.num_channels.to_string());
        }
        if self.hidden_act != ACTIVATION {
            return refuse(
                "hidden_act",
                format!("`{ACTIVATION}`"),
                format!("`{}`", self.hidden_act),
            );
        }
        if !(self.layer_norm_eps > 0.0 && self.layer_norm_eps < 1.0) {
            let expected = "a number between 0 and 1".into();
            return refuse("layer_norm_eps", expected, self.layer_norm_eps.to_string());
        }
        Ok(())
    }

    /// Patches along each side.
    pub fn side(&self) -> usize {
        self.image_size / self.patch_size
    }

    /// Patches of a picture.
    pub fn n_tokens(&self) -> usize {
        self.side() * self.side()
    }

    /// Numbers in a patch.
    pub fn n_patch_values(&self) -> usize {
        self.num_channels * self.patch_size * self.patch_size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(json: &str) -> Result<VisionConfig> {
        VisionConfig::parse(Path::new("config.json"), json.as_bytes())
    }

    #[test]
    fn what_is_not_said_is_the_default_of_transformers() {
        let config = parse(r#"{"model_type": "siglip", "vision_config": {"image_size": 256}}"#);
        let expected = VisionConfig { image_size: 256, ..VisionConfig::default() };
        assert_eq!(config.unwrap(), expected);
        let tower = parse(r#"{"model_type": "siglip_vision_model", "patch_size": 14}"#).unwrap();
        assert_eq!((tower.side(), tower.n_tokens()), (16, 256));
        assert_eq!(parse(r#"{"model_type": "siglip"}"#).unwrap(), VisionConfig::default());
    }

    #[test]
    fn sizes_out_of_range_are_refused_by_name() {
        for (json, field) in [
            (r#"{"model_type": "siglip2"}"#, "model_type"),
            (r#"{"model_type": 5}"#, "line 1"),
            (r#"{"model_type": "siglip_vision_model", "hidden_size": 0}"#, "hidden_size"),
            (r#"{"model_type": "siglip_vision_model", "hidden_size": 999999}"#, "hidden_size"),
            (r#"{"model_type": "siglip_vision_model", "num_attention_heads": 5}"#, "num_attention"),
            (r#"{"model_type": "siglip_vision_model", "patch_size": 1}"#, "patch_size"),
            (r#"{"model_type": "siglip_vision_model", "patch_size": 999}"#, "patch_size"),
            (r#"{"model_type": "siglip_vision_model", "hidden_act": "gelu"}"#, "hidden_act"),
            (r#"{"model_type": "siglip_vision_model", "num_channels": 4}"#, "num_channels"),
            (r#"{"model_type": "siglip_vision_model", "layer_norm_eps": 0}"#, "layer_norm_eps"),
        ] {
            let error = parse(json).unwrap_err().to_string();
            assert!(error.contains(field), "{json}: {error}");
        }
    }
}
