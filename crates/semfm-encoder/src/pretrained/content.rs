//! What makes a pretrained encoder this very one: its files by their content, and who computes.

use std::collections::BTreeMap;

use serde::Serialize;

/// Digits of the hash in a version.
const HASH_DIGITS: usize = 12;

/// Everything that embeddings by an encoder depend on beside the pictures.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Content {
    /// What embeddings files call the encoder.
    pub name: String,
    /// What computes, with its version.
    pub runtime: &'static str,
    /// BLAKE3 of the parts that were read, as hexadecimal digits, by a name that stays when the folder
    /// moves.
    pub parts: BTreeMap<String, String>,
}

impl Content {
    /// The hash of it all.
    pub fn hash(&self) -> String {
        let json = serde_json::json!(self).to_string();
        blake3::hash(json.as_bytes()).to_hex().to_string()
    }

    /// The version of an encoder with this hash: what computes, and the first digits.
    pub fn version(&self, hash: &str) -> String {
        format!("{}+{}", self.runtime, &hash[..HASH_DIGITS])
    }
}
