//! SigLIP and SigLIP 2 of fixed resolution as encoders: the last hidden state of the vision tower.
//!
//! Zhai, Mustafa, Kolesnikov & Beyer, "Sigmoid Loss for Language Image Pre-Training", 2023;
//! Tschannen et al., "SigLIP 2: Multilingual Vision-Language Encoders", 2025. Checkpoints of both
//! generations that squeeze every picture to one size say `model_type: siglip`; those that keep the
//! aspect ratio (NaFlex, `siglip2`) stay with `semfm-embed`.

mod config;
mod processor;
mod safetensors;
mod vision_tower;

use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::{FormatError, read_file};
use semfm_views::PatchGrid;

use self::config::{VisionConfig, is_siglip};
use self::processor::Processor;
use self::safetensors::SafeTensors;
use self::vision_tower::VisionTower;
use super::PretrainedEncoder;
use super::content::Content;
use super::token_network::{Picture, RawTokens, TokenNetwork};
use crate::Result;
use crate::open::OpenSettings;

/// What computes: part of the version of embeddings. Another number where the same weights give other
/// tokens.
const RUNTIME: &str = "semfm-siglip-1";
const CONFIG: &str = "config.json";
const WEIGHTS: &str = "model.safetensors";

/// Whether this is a folder with a checkpoint that [`PretrainedEncoder::read_siglip`] is for.
pub(crate) fn is_siglip_folder(folder: &Path) -> bool {
    let config = folder.join(CONFIG);
    read_file(&config).is_ok_and(|json| is_siglip(&config, &json))
}

impl PretrainedEncoder {
    /// Reads a folder as written by transformers' `save_pretrained`: `config.json`, the settings of the
    /// image processor and `model.safetensors`. Of the weights, the vision tower's are read.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] where a file cannot be read; [`Error::Format`](crate::Error::Format)
    /// with the place for a configuration that this forward pass is not for, and for weights that are
    /// missing, damaged or of another shape.
    pub fn read_siglip(folder: &Path, settings: &OpenSettings) -> Result<Self> {
        let config_path = folder.join(CONFIG);
        let config = VisionConfig::parse(&config_path, &read_file(&config_path)?)?;
        let processor = Processor::read(folder)?;
        if [processor.height, processor.width] != [config.image_size; 2] {
            let expected = format!("{0} × {0} pixels, as {CONFIG} says", config.image_size);
            let found = format!("{} × {}", processor.height, processor.width);
            return Err(FormatError::new(&processor.path, "size", expected, found).into());
        }
        let mut weights = SafeTensors::open(&folder.join(WEIGHTS))?;
        let tower = VisionTower::read(config.clone(), &mut weights)?;
        let preprocessing = processor.describe();
        let parts = BTreeMap::from([
            ("config".to_owned(), hash_of(serde_json::json!(config).to_string().as_bytes())),
            ("processor".to_owned(), hash_of(preprocessing.as_bytes())),
            ("weights".to_owned(), weights.hash_of_what_was_read()),
        ]);
        let content = Content { name: name_of(folder), runtime: RUNTIME, parts };
        let network = SiglipNetwork { processor, tower };
        Ok(Self::new(Box::new(network), &content, preprocessing, settings.threads))
    }
}

/// The folder's last part, links followed.
fn name_of(folder: &Path) -> String {
    let real = folder.canonicalize();
    let real = real.as_deref().unwrap_or(folder);
    real.file_name().unwrap_or(real.as_os_str()).to_string_lossy().into_owned()
}

fn hash_of(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// A vision tower and what its pictures go through.
#[derive(Debug)]
struct SiglipNetwork {
    processor: Processor,
    tower: VisionTower,
}

impl TokenNetwork for SiglipNetwork {
    /// The fixed grid, stretched over the picture. A remainder at the right and bottom gets no token.
    fn grid(&self, height: usize, width: usize) -> Result<PatchGrid> {
        let VisionConfig { image_size, patch_size, .. } = *self.tower.config();
        let side = self.tower.config().side();
        let seen = (side * patch_size) as f32 / image_size as f32;
        let rect = [0.0, 0.0, width as f32 * seen, height as f32 * seen];
        Ok(PatchGrid { rows: side, cols: side, rect })
    }

    fn tokens(&self, picture: &Picture) -> Result<Vec<RawTokens>> {
        let side = self.tower.config().side();
        let values = self.tower.forward(&self.processor.input(picture));
        Ok(vec![RawTokens { rows: side, cols: side, dim: self.tower.config().hidden_size, values }])
    }
}
