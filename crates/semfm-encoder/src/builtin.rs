//! The encoders that are part of the program: one row each.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use semfm_geom::{ConfidenceWeights, LikenessScale};

use crate::Result;
use crate::encoder::{Encoder, EncoderIdentity, WantedViews};
use crate::net_encoder::NetEncoder;

/// An encoder whose weights are in the program.
#[derive(Debug)]
pub struct BuiltinEncoder {
    /// The name used by `--encoder`.
    pub name: &'static str,
    /// One line for help texts.
    pub summary: &'static str,
    /// The content of its `.net` file.
    weights: &'static [u8],
    /// What it is shown, where that is not what [`NetEncoder::parse`] says.
    shown: fn(&mut WantedViews),
    /// How evidence in answers found by its features becomes a probability: what
    /// `bench/confidence.py` fits for these weights.
    confidence: ConfidenceWeights,
    /// Made when first asked for.
    encoder: OnceLock<Arc<NetEncoder>>,
}

/// All of them; the first is the default everywhere.
pub static BUILTIN_ENCODERS: [BuiltinEncoder; 1] = [BuiltinEncoder {
    name: "builtin",
    summary: "a small network that is part of the program and needs nothing else",
    weights: include_bytes!("../weights/builtin.net"),
    // It was trained to say the same of a turned picture: one rotation is as good as four.
    shown: |wants| wants.rolls = 1,
    confidence: ConfidenceWeights {
        constant: -1.16,
        ambiguity: -0.76,
        margin: 4.37,
        round_trip: 3.43,
        likeness: Some(LikenessScale { unlike: 0.915, alike: 0.982 }),
    },
    encoder: OnceLock::new(),
}];

impl BuiltinEncoder {
    /// The built-in encoder of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        BUILTIN_ENCODERS.iter().find(|encoder| encoder.name == name)
    }

    /// The network, read once.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) where the program was built with a broken file, which a
    /// test rules out.
    pub fn encoder(&self) -> Result<Arc<NetEncoder>> {
        if let Some(encoder) = self.encoder.get() {
            return Ok(Arc::clone(encoder));
        }
        let path = format!("{}.net", self.name);
        let encoder = NetEncoder::parse(Path::new(&path), self.weights)?.with_wants(self.shown);
        Ok(Arc::clone(self.encoder.get_or_init(|| Arc::new(encoder))))
    }
}

/// The built-in default encoder.
///
/// # Errors
/// As [`BuiltinEncoder::encoder`].
pub fn builtin_encoder() -> Result<Arc<NetEncoder>> {
    BUILTIN_ENCODERS[0].encoder()
}

/// Likeness in the features of encoders outside, measured once on fifteen procedural objects (`docs/memory.md`): the
/// digits of the hash over configuration and weights that end their version, and the scale.
const MEASURED_SCALES: [(&str, LikenessScale); 1] = [
    // MobileNetV2 (ImageNet) as ONNX, outputs of stride 16.
    ("+ef86da150331", LikenessScale { unlike: 0.634, alike: 0.784 }),
];

/// The weights that make a probability of the evidence in answers found by an encoder's features: those
/// fitted for a built-in encoder, by name and version, else the general ones, with the scale of likeness where it was
/// measured.
pub fn confidence_weights(encoder: &EncoderIdentity) -> ConfidenceWeights {
    let builtin = BuiltinEncoder::named(&encoder.name);
    let fitted = builtin.filter(|row| row.encoder().is_ok_and(|net| net.identity() == *encoder));
    fitted.map_or_else(
        || ConfidenceWeights { likeness: measured_scale(encoder), ..ConfidenceWeights::default() },
        |row| row.confidence,
    )
}

fn measured_scale(encoder: &EncoderIdentity) -> Option<LikenessScale> {
    let measured = MEASURED_SCALES.iter().find(|(hash, _)| encoder.version.ends_with(hash));
    measured.map(|(_, scale)| *scale)
}
