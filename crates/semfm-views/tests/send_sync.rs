//! Values of this crate may be shared between threads.

use semfm_views::{
    EmbeddedView, Error, LiftSettings, Lifted, PatchEmbeddings, RenderSettings, Renderer,
    RigSettings, SurfaceColor, View,
};

fn assert_send_sync<T: Send + Sync>() {}

#[test]
fn public_types_are_send_and_sync() {
    assert_send_sync::<View>();
    assert_send_sync::<PatchEmbeddings>();
    assert_send_sync::<EmbeddedView>();
    assert_send_sync::<Lifted>();
    assert_send_sync::<LiftSettings>();
    assert_send_sync::<RenderSettings>();
    assert_send_sync::<RigSettings>();
    assert_send_sync::<SurfaceColor<'static>>();
    assert_send_sync::<Renderer>();
    assert_send_sync::<Error>();
}

#[cfg(feature = "mcap")]
#[test]
fn files_are_send_and_sync() {
    use semfm_views::mcap::{Contents, EmbeddingsFile, McapReport, ViewsFile};
    assert_send_sync::<ViewsFile>();
    assert_send_sync::<EmbeddingsFile>();
    assert_send_sync::<Contents>();
    assert_send_sync::<McapReport>();
}

#[cfg(feature = "gpu")]
#[test]
fn the_driver_is_send_and_sync() {
    assert_send_sync::<semfm_views::GpuRenderer>();
}
