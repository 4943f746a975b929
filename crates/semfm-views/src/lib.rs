//! Rendered views, patch embeddings, and lifting them to the surface (sections IV-C of the paper).
//!
//! A [`rig()`] places cameras around an object, the renderer makes a [`View`] from each, an encoder
//! outside this crate turns the views into [`PatchEmbeddings`], and [`lift()`] carries those onto the
//! surface as a [`SemanticCloud`](semfm_geom::SemanticCloud). Views and embeddings travel in MCAP
//! files (feature `mcap`).

mod embeddings;
mod error;
#[cfg(feature = "gpu")]
mod gpu;
mod lift;
#[cfg(feature = "mcap")]
pub mod mcap;
mod render;
mod renderer;
mod rig;
mod view;

pub use embeddings::{EmbeddedView, PatchEmbeddings, PatchGrid};
pub use error::{Error, Fault, Result};
#[cfg(feature = "gpu")]
pub use gpu::GpuRenderer;
pub use lift::{LiftReport, LiftRule, LiftSettings, Lifted, lift};
pub use render::{
    CornerNormals, RenderSettings, SurfaceColor, openness, render, render_colorings, triangle_ids,
};
pub use renderer::{Renderer, RendererChoice};
pub use rig::{CLOSE_UP, RigSettings, camera_towards, rig};
pub use view::View;
