//! A pretrained network as an encoder.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use semfm_geom::Task;
use semfm_views::{EmbeddedView, PatchEmbeddings, View};

use super::content::Content;
use super::rolled_tokens::{OUTLIER_RATIO, averaged_tokens};
use super::token_network::TokenNetwork;
use crate::coverage::coverage;
use crate::encoder::{EncodedViews, Encoder, EncoderIdentity, PRETRAINED_ROLLS, WantedViews};
use crate::rendered_views::{Coloring, RenderedObject, ViewSettings};
use crate::turned::Turned;
use crate::{Error, Result};

/// A pretrained network of somebody else, run in this process: what an `ENCODER.json` describes
/// (`PretrainedEncoder::read_onnx`, feature `onnx`) or the vision tower of a SigLIP checkpoint
/// (`PretrainedEncoder::read_siglip`, feature `siglip`).
///
/// Its version holds the first digits of a hash over the configuration and the weights that were read.
#[derive(Debug)]
pub struct PretrainedEncoder {
    network: Box<dyn TokenNetwork>,
    identity: EncoderIdentity,
    hash: String,
    preprocessing: String,
    /// Pictures at a time; 0 stands for the threads that are there.
    threads: usize,
}

impl PretrainedEncoder {
    pub(super) fn new(
        network: Box<dyn TokenNetwork>,
        content: &Content,
        preprocessing: String,
        threads: usize,
    ) -> Self {
        let hash = content.hash();
        let identity =
            EncoderIdentity { name: content.name.clone(), version: content.version(&hash) };
        Self { network, identity, hash, preprocessing, threads }
    }

    fn embedded(&self, view: &View, quarters: &[u32]) -> Result<EmbeddedView> {
        let tokens = averaged_tokens(&*self.network, view, quarters)?;
        let covered = coverage(view, &tokens.grid);
        let patches =
            PatchEmbeddings::new(tokens.grid, tokens.dim, tokens.data, covered, tokens.valid)?;
        Ok(EmbeddedView { camera: view.camera, patches })
    }
}

impl Encoder for PretrainedEncoder {
    fn identity(&self) -> EncoderIdentity {
        self.identity.clone()
    }

    fn wants(&self) -> WantedViews {
        let views = ViewSettings { coloring: Coloring::Own, ..ViewSettings::default() };
        WantedViews { views, reads_colors: true, rolls: PRETRAINED_ROLLS }
    }

    fn content_hash(&self) -> Result<String> {
        Ok(self.hash.clone())
    }

    /// Pictures share the cores, each on one thread; the numbers do not depend on how many there are.
    fn encode(
        &self,
        objects: &[RenderedObject<'_>],
        rolls: u32,
        task: &Task,
    ) -> Result<Vec<EncodedViews>> {
        semfm_geom::keep_faer_sequential();
        let quarters = Turned::quarters_of(rolls)?;
        let views: Vec<&View> = objects.iter().flat_map(|object| &object.views).collect();
        let threads = if self.threads == 0 { rayon::current_num_threads() } else { self.threads };
        let mut embedded =
            each_view(&views, threads, task, |view| self.embedded(view, quarters))?.into_iter();
        let encoded = objects.iter().map(|object| EncodedViews {
            encoder: self.identity(),
            preprocessing: self.preprocessing.clone(),
            rolls,
            outliers: format!(
                "dropped per roll where raw norm > {OUTLIER_RATIO} x the grid's median"
            ),
            views: embedded.by_ref().take(object.views.len()).collect(),
        });
        Ok(encoded.collect())
    }
}

/// Does some work for each view, on threads of its own: a thread of rayon that waits for a runtime's
/// pool would begin further pictures meanwhile, as many as there are.
fn each_view(
    views: &[&View],
    threads: usize,
    task: &Task,
    work: impl Fn(&View) -> Result<EmbeddedView> + Sync,
) -> Result<Vec<EmbeddedView>> {
    task.step("encode", 0, views.len())?;
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Vec<Mutex<Option<Result<EmbeddedView>>>> =
        views.iter().map(|_| Mutex::new(None)).collect();
    let one_after_the_other = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(view) = views.get(number) else { return };
            let result = task.check().map_err(Error::from).and_then(|()| {
                let made = work(view)?;
                task.step("encode", done.fetch_add(1, Ordering::Relaxed) + 1, views.len())?;
                Ok(made)
            });
            if result.is_err() {
                // Nobody needs the others.
                next.store(views.len(), Ordering::Relaxed);
            }
            if let Ok(mut place) = results[number].lock() {
                *place = Some(result);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.min(views.len()) {
            scope.spawn(one_after_the_other);
        }
    });
    let results: Vec<Option<Result<EmbeddedView>>> =
        results.into_iter().map(|place| place.into_inner().ok().flatten()).collect();
    // Views are begun in order: one that was not made stands behind the one that failed.
    results.into_iter().flatten().collect()
}
