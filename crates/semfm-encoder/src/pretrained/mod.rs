//! Pretrained networks of others in this process: what an ENCODER.json describes (feature `onnx`) and
//! SigLIP's vision tower (feature `siglip`).
//!
//! A [`TokenNetwork`](token_network::TokenNetwork) makes raw tokens of a picture;
//! [`PretrainedEncoder`] turns the pictures, drops outliers, scales and averages as the program
//! `semfm-embed` does (`python/semfm/sidecar/patches.py`).

mod content;
mod encoder;
#[cfg(any(feature = "onnx", test))]
mod onnx;
mod resize;
mod rolled_tokens;
#[cfg(any(feature = "siglip", test))]
mod siglip;
mod token_network;

pub use encoder::PretrainedEncoder;
#[cfg(any(feature = "siglip", test))]
pub(crate) use siglip::is_siglip_folder;
