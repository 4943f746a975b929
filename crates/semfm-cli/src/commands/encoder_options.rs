//! The options that say which encoder makes the features.

use anyhow::{Context, Result};
use clap::Args;
use semfm::encoder::{BUILTIN_ENCODERS, OpenSettings, encoder_names, open_encoder};
use semfm::geom::ShapeCache;
use semfm::object_encoder::ObjectEncoder;
use semfm::views::mcap::EmbeddingsFile;

use crate::options::Common;

/// Which encoder, and how often it looks at each view.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Features")]
pub struct EncoderOptions {
    #[arg(long, value_name = "NAME", help = encoder_help())]
    pub encoder: Option<String>,
    /// Rotations of each view that the encoder averages [default: 1 for builtin, else 4, for `semfm` 1]
    #[arg(long, value_name = "1|2|4", value_parser = rolls)]
    pub rolls: Option<u32>,
}

impl EncoderOptions {
    /// Whether nothing was said about the encoder.
    pub fn is_default(&self) -> bool {
        self.encoder.is_none() && self.rolls.is_none()
    }

    /// The encoder for a method that asks for up to `rolls` rotations; the built-in one where none is
    /// named.
    pub fn open(&self, rolls: u32, cache: &ShapeCache, common: &Common) -> Result<ObjectEncoder> {
        let settings = OpenSettings { threads: common.threads, quiet: common.quiet };
        let name = self.encoder.as_deref().unwrap_or(BUILTIN_ENCODERS[0].name);
        let encoder = open_encoder(name, &settings).context("--encoder")?;
        let rolls = self.rolls.unwrap_or_else(|| encoder.wants().rolls_up_to(rolls));
        Ok(ObjectEncoder::new(encoder, cache).with_rolls(rolls))
    }

    /// The encoder for the other object of a pair: the named one, else the one that made the file, at the file's rotations.
    pub fn open_beside(
        &self,
        file: &EmbeddingsFile,
        cache: &ShapeCache,
        common: &Common,
    ) -> Result<ObjectEncoder> {
        let settings = OpenSettings { threads: common.threads, quiet: common.quiet };
        let name = self.encoder.as_deref();
        let encoder = ObjectEncoder::beside(file, name, &settings, cache);
        if name.is_some() { encoder.context("--encoder") } else { Ok(encoder?) }
    }
}

/// The help text of `--encoder`.
pub fn encoder_help() -> String {
    format!("Make the features with this encoder: {} [default: builtin]", encoder_names())
}

fn rolls(text: &str) -> std::result::Result<u32, String> {
    match text {
        "1" => Ok(1),
        "2" => Ok(2),
        "4" => Ok(4),
        _ => Err("expected 1, 2 or 4".into()),
    }
}
