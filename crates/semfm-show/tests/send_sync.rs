//! Public types go from thread to thread.

use semfm_show::{Error, Group, Layer, Panel, Picture, TransferFigure, VertexColors, Viewpoints};

fn is_send_and_sync<T: Send + Sync>() {}

#[test]
fn public_types_are_send_and_sync() {
    is_send_and_sync::<Error>();
    is_send_and_sync::<Group>();
    is_send_and_sync::<Layer>();
    is_send_and_sync::<Panel>();
    is_send_and_sync::<Picture>();
    is_send_and_sync::<TransferFigure<'_>>();
    is_send_and_sync::<VertexColors>();
    is_send_and_sync::<Viewpoints>();
}
