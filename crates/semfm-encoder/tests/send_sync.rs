//! The public types can be sent to and shared with other threads.

use semfm_encoder::rendered_views::{RenderedObject, ViewSettings};
use semfm_encoder::{
    BuiltinEncoder, EncodedViews, Encoder, EncoderIdentity, Error, NetEncoder, NetHeader,
    WantedViews,
};

fn is_send_and_sync<T: Send + Sync + ?Sized>() {}

#[test]
fn public_types_are_send_and_sync() {
    is_send_and_sync::<BuiltinEncoder>();
    is_send_and_sync::<EncodedViews>();
    is_send_and_sync::<dyn Encoder>();
    is_send_and_sync::<EncoderIdentity>();
    is_send_and_sync::<Error>();
    is_send_and_sync::<NetEncoder>();
    is_send_and_sync::<NetHeader>();
    is_send_and_sync::<RenderedObject<'_>>();
    is_send_and_sync::<ViewSettings>();
    is_send_and_sync::<WantedViews>();
}

#[cfg(any(feature = "onnx", feature = "siglip"))]
#[test]
fn pretrained_encoders_are_send_and_sync() {
    is_send_and_sync::<semfm_encoder::PretrainedEncoder>();
}

#[cfg(feature = "mcap")]
#[test]
fn the_program_is_send_and_sync() {
    is_send_and_sync::<semfm_encoder::CommandEncoder>();
}
