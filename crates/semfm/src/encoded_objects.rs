//! Objects rendered as an encoder wants them, and what it makes of them.

use std::time::Instant;

use semfm_encoder::rendered_views::{Coloring, Drawable, RenderedObject};
use semfm_encoder::{EncodedViews, Encoder};
use semfm_geom::Task;
use semfm_views::Renderer;

use crate::{Error, Result};

/// What an encoder made of objects that it was shown in one call.
pub(crate) struct EncodedObjects<'a> {
    /// The views, one for each object.
    pub rendered: Vec<RenderedObject<'a>>,
    /// What was made of them, one for each object.
    pub encoded: Vec<EncodedViews>,
    /// Milliseconds of wall time for the views of each object.
    pub views_ms: Vec<f64>,
    /// Milliseconds of wall time for the encoder, by object.
    pub embed_ms: f64,
}

impl<'a> EncodedObjects<'a> {
    /// Renders the objects, in memory, and has them encoded.
    ///
    /// # Errors
    /// [`Error::Encoder`] where an object cannot be drawn or encoded, [`Error::Invalid`] for an encoder
    /// that does not answer for each object.
    pub fn new(
        encoder: &dyn Encoder,
        objects: &[Drawable<'a>],
        coloring: Coloring,
        rolls: u32,
        task: &Task,
    ) -> Result<Self> {
        let settings = encoder.wants().settings(coloring);
        let (mut rendered, mut views_ms) = (Vec::new(), Vec::new());
        for &object in objects {
            let start = Instant::now();
            // By the CPU on every machine: what is kept must not depend on the driver that was there.
            rendered.push(RenderedObject::new(object, &settings, &Renderer::cpu(), task)?);
            views_ms.push(milliseconds_since(start));
        }
        let start = Instant::now();
        let encoded = encoder.encode(&rendered, rolls, task)?;
        let embed_ms = milliseconds_since(start) / objects.len() as f64;
        if encoded.len() != objects.len() {
            let expected = format!("embeddings of each of {} objects", objects.len());
            return Err(Error::invalid("encoder", expected, format!("those of {}", encoded.len())));
        }
        Ok(Self { rendered, encoded, views_ms, embed_ms })
    }
}

/// Milliseconds of wall time since then.
pub(crate) fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
