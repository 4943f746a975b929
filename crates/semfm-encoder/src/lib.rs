//! Encoders: rendered views in, one vector per image patch out.
//!
//! An [`Encoder`] says what it wants to be shown ([`WantedViews`]), gets the pictures
//! ([`RenderedObject`](rendered_views::RenderedObject)) and gives back [`EncodedViews`]. One is built in ([`builtin_encoder`]): a small
//! convolutional network of our own whose weights are part of the program, with a forward pass in some
//! three hundred lines ([`NetEncoder`]); it needs no Python, no download and no further file, and its
//! pictures never leave memory. Pretrained networks of others run in this process, too: what an
//! `ENCODER.json` describes (feature `onnx`) and SigLIP's vision tower (feature `siglip`). All others
//! answer through the program `semfm-embed` ([`CommandEncoder`], feature `mcap`). [`open_encoder`] finds any of them by name.

mod builtin;
mod channel;
#[cfg(feature = "mcap")]
mod command;
#[cfg(feature = "mcap")]
mod command_inputs;
mod convolution;
mod coverage;
mod encoder;
mod error;
mod layer;
mod net_encoder;
mod net_file;
mod network;
mod observed_picture;
mod open;
// Tests of what needs no runtime run without the features, too.
#[cfg(any(feature = "onnx", feature = "siglip", test))]
#[cfg_attr(not(all(feature = "onnx", feature = "siglip")), allow(dead_code, unused_imports))]
mod pretrained;
pub mod rendered_views;
mod turned;

pub use builtin::{BUILTIN_ENCODERS, BuiltinEncoder, builtin_encoder, confidence_weights};
pub use channel::Channel;
#[cfg(feature = "mcap")]
pub use command::{CommandEncoder, PROGRAM_VARIABLE};
pub use encoder::{EncodedViews, Encoder, EncoderIdentity, WantedViews};
pub use error::{Error, Result};
pub use layer::{ConvLayer, Layer};
pub use net_encoder::NetEncoder;
pub use net_file::{Background, NetHeader, write_net};
pub use observed_picture::{Brightness, ObservedPicture, camera_before_mesh};
pub use open::{OpenSettings, encoder_names, open_encoder};
#[cfg(any(feature = "onnx", feature = "siglip"))]
pub use pretrained::PretrainedEncoder;
