//! Embeddings of objects by any encoder, kept between runs.
//!
//! An object is rendered as its encoder wants it and encoded; what comes out is kept under a key of
//! everything that it depends on, the encoder's version among it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use half::f16;
use semfm_encoder::rendered_views::{Coloring, Drawable, ViewSettings};
use semfm_encoder::{Encoder, EncoderIdentity, OpenSettings, open_encoder};
use semfm_geom::io::{read_json, write_json};
use semfm_geom::{Mesh, MeshHash, ShapeCache, Task, noise_free};
use semfm_views::EmbeddedView;
use semfm_views::mcap::{Dtype, EmbeddingsFile};
use serde::{Deserialize, Serialize};

use crate::encoded_objects::EncodedObjects;
use crate::files::read_embeddings;
use crate::{Error, FeatureSource, PipelineSettings, Prepared, Result, prepare};

/// An encoder with the folder in which its embeddings are kept.
#[derive(Clone, Debug)]
pub struct ObjectEncoder {
    encoder: Arc<dyn Encoder>,
    rolls: u32,
    /// `None` where nothing is kept.
    folder: Option<PathBuf>,
}

/// Embeddings of one object.
#[derive(Clone, Debug)]
pub struct EncodedObject {
    /// The embeddings of its views.
    pub embeddings: EmbeddingsFile,
    /// What making them took, now or then; `None` where that is not known.
    pub times: Option<EncodingTimes>,
    /// Whether they were kept from an earlier run.
    pub from_cache: bool,
}

/// Embeddings of two objects.
#[derive(Clone, Debug)]
pub struct EncodedPair {
    /// Of the demonstrated object.
    pub source: EncodedObject,
    /// Of the object to act on.
    pub target: EncodedObject,
}

/// What making the embeddings of an object took (wall time), the encoder's start included.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct EncodingTimes {
    /// Milliseconds for the views.
    pub views_ms: f64,
    /// Milliseconds for the encoder.
    pub embed_ms: f64,
}

/// What embeddings depend on. The key is a hash of its JSON.
#[derive(Serialize)]
struct CacheKey {
    mesh: MeshHash,
    /// Hash of the object's colours, where they are shown.
    colors: Option<String>,
    /// Hash of everything that makes the encoder.
    encoder: String,
    /// The version of the code that draws the views.
    version: &'static str,
    rolls: u32,
    views: ViewSettings,
}

impl EncodedObject {
    /// Prepares the mesh that was encoded; what encoding took in this run is part of the report.
    ///
    /// # Errors
    /// As [`prepare`].
    pub fn prepare(
        &self,
        mesh: Mesh,
        settings: &PipelineSettings,
        task: &Task,
    ) -> Result<Prepared> {
        let mut prepared = prepare(mesh, FeatureSource::from(&self.embeddings), settings, task)?;
        if let Some(EncodingTimes { views_ms, embed_ms }) = self.times.filter(|_| !self.from_cache)
        {
            let stages = [("views", views_ms), ("embed", embed_ms)];
            prepared.report.stages_ms.splice(..0, stages);
        }
        Ok(prepared)
    }
}

impl ObjectEncoder {
    /// The encoder at the rotations that it wants. Embeddings are kept in the folder `embeddings`
    /// within that of `cache`, or not at all where the cache is off.
    pub fn new(encoder: Arc<dyn Encoder>, cache: &ShapeCache) -> Self {
        let folder = cache.folder().map(|shapes| shapes.join("embeddings"));
        Self { rolls: encoder.wants().rolls, encoder, folder }
    }

    /// Each picture at this many rotations: 1, 2 or 4.
    pub fn with_rolls(self, rolls: u32) -> Self {
        Self { rolls, ..self }
    }

    /// Rotations of each picture that are averaged.
    pub fn rolls(&self) -> u32 {
        self.rolls
    }

    /// The encoder.
    pub fn encoder(&self) -> &Arc<dyn Encoder> {
        &self.encoder
    }

    /// Why embeddings are not kept although they should be, in words.
    pub fn why_not_kept(&self) -> Option<String> {
        self.folder.as_ref()?;
        self.encoder.why_not_kept()
    }

    /// The embeddings of an object's views, in the object's own colours or in grey, as far as colours
    /// say anything to the encoder; made where they are not there yet.
    ///
    /// # Errors
    /// [`Error::Encoder`] where the object cannot be drawn or encoded, or the
    /// encoder's files cannot be read. Trouble with what is kept is never an error.
    pub fn embed<'a>(
        &self,
        object: impl Into<Drawable<'a>>,
        coloring: Coloring,
        task: &Task,
    ) -> Result<EncodedObject> {
        let object = object.into();
        match self.kept(object, coloring)? {
            Some(kept) => Ok(kept),
            None => Ok(self.make(&[object], coloring, task)?.remove(0)),
        }
    }

    /// The embeddings of two objects, in their own colours where both have some. Those that are not
    /// there yet are made in one call of the encoder, which may take longer to start than to look at
    /// an object.
    ///
    /// # Errors
    /// As [`ObjectEncoder::embed`].
    pub fn embed_pair<'a>(
        &self,
        source: impl Into<Drawable<'a>>,
        target: impl Into<Drawable<'a>>,
        task: &Task,
    ) -> Result<EncodedPair> {
        let (source, target) = (source.into(), target.into());
        let coloring = Coloring::of_pair(source, target);
        let kept = [self.kept(source, coloring)?, self.kept(target, coloring)?];
        let is_same = self.look(source, coloring) == self.look(target, coloring);
        Ok(match kept {
            [Some(source), Some(target)] => EncodedPair { source, target },
            [Some(source), None] => {
                EncodedPair { source, target: self.make(&[target], coloring, task)?.remove(0) }
            }
            [None, Some(target)] => {
                EncodedPair { source: self.make(&[source], coloring, task)?.remove(0), target }
            }
            [None, None] if is_same => {
                let both = self.make(&[source], coloring, task)?.remove(0);
                EncodedPair { source: both.clone(), target: both }
            }
            [None, None] => {
                let mut made = self.make(&[source, target], coloring, task)?;
                let target = made.remove(1);
                EncodedPair { source: made.remove(0), target }
            }
        })
    }

    /// The encoder that made a file, as far as its name tells, at that file's rotations: for the other object of a pair.
    ///
    /// # Errors
    /// As [`open_encoder`]; [`Error::Invalid`] for embeddings that no network made.
    pub fn of_file(
        file: &EmbeddingsFile,
        settings: &OpenSettings,
        cache: &ShapeCache,
    ) -> Result<Self> {
        if file.metadata.simulated {
            let expected = "those of both objects, since no encoder made these";
            return Err(Error::invalid("embeddings", expected, file.path.display().to_string()));
        }
        let encoder = open_encoder(&file.metadata.encoder, settings)?;
        Ok(Self::new(encoder, cache).with_rolls(file.metadata.rolls))
    }

    /// The encoder for the other object of a pair, at the file's rotations: the one of this name, else the one that made the
    /// file.
    ///
    /// # Errors
    /// As [`of_file`](Self::of_file).
    pub fn beside(
        file: &EmbeddingsFile,
        name: Option<&str>,
        settings: &OpenSettings,
        cache: &ShapeCache,
    ) -> Result<Self> {
        match name {
            Some(name) => {
                let encoder = open_encoder(name, settings)?;
                Ok(Self::new(encoder, cache).with_rolls(file.metadata.rolls))
            }
            None => Self::of_file(file, settings, cache),
        }
    }

    /// The embeddings of an object beside those of another that are there already: at the other's rotations, in its own
    /// colours where the other was shown in its own.
    ///
    /// # Errors
    /// As [`ObjectEncoder::embed`]; [`Error::Invalid`] where this is another encoder, or another
    /// version of it, than made the file.
    pub fn embed_beside<'a>(
        &self,
        file: &EmbeddingsFile,
        object: impl Into<Drawable<'a>>,
        task: &Task,
    ) -> Result<EncodedObject> {
        let is_colored = file.metadata.views.more.get("colors").is_some_and(|name| name == "own");
        let coloring = if is_colored { Coloring::Own } else { Coloring::Grey };
        let encoder = self.clone().with_rolls(file.metadata.rolls);
        let made = encoder.embed(object, coloring, task)?;
        let identity = |file: &EmbeddingsFile| EncoderIdentity {
            name: file.metadata.encoder.clone(),
            version: file.metadata.revision.clone(),
        };
        let (expected, found) = (identity(file), identity(&made.embeddings));
        if expected != found || file.dim() != made.embeddings.dim() {
            let what = format!("encoder beside {}", file.path.display());
            let expected = format!("{expected}, which made it, with {} dimensions", file.dim());
            let found = format!("{found} with {}", made.embeddings.dim());
            return Err(Error::invalid(what, expected, found));
        }
        Ok(made)
    }

    /// What is kept of an object. Whatever is wrong with a kept file, a new one is the cure.
    fn kept(&self, object: Drawable<'_>, coloring: Coloring) -> Result<Option<EncodedObject>> {
        let Some(folder) = &self.folder else { return Ok(None) };
        let hash = self.encoder.content_hash()?;
        if self.encoder.why_not_kept().is_some() {
            return Ok(None);
        }
        let path = self.kept_at(folder, hash, object, coloring);
        let Ok(embeddings) = read_embeddings(&path, object.mesh()) else { return Ok(None) };
        let times = read_json(path.with_extension("took.json")).ok();
        Ok(Some(EncodedObject { embeddings, times, from_cache: true }))
    }

    /// Renders the objects, has them encoded, and keeps what comes out.
    fn make(
        &self,
        objects: &[Drawable<'_>],
        coloring: Coloring,
        task: &Task,
    ) -> Result<Vec<EncodedObject>> {
        let encoder = &*self.encoder;
        let EncodedObjects { rendered, encoded, views_ms, embed_ms } =
            EncodedObjects::new(encoder, objects, coloring, self.rolls, task)?;
        let hash = match &self.folder {
            Some(_) => self.encoder.hash_of_last_run()?,
            None => None,
        };
        let mut made = Vec::new();
        for (((encoded, rendered), &object), views_ms) in
            encoded.into_iter().zip(&rendered).zip(objects).zip(views_ms)
        {
            let times = EncodingTimes { views_ms, embed_ms };
            let embeddings = encoded.into_file(rendered);
            if let (Some(folder), Some(hash)) = (&self.folder, &hash) {
                let path = self.kept_at(folder, hash.clone(), object, coloring);
                keep(folder, &path, &embeddings, &times);
            }
            made.push(EncodedObject { embeddings, times: Some(times), from_cache: false });
        }
        Ok(made)
    }

    /// Where the embeddings of an object are kept: under a hash of everything that they depend on.
    fn kept_at(
        &self,
        folder: &Path,
        encoder: String,
        object: Drawable<'_>,
        coloring: Coloring,
    ) -> PathBuf {
        let Look { mesh, colors } = self.look(object, coloring);
        let views = self.encoder.wants().settings(coloring);
        let version = env!("CARGO_PKG_VERSION");
        let key = CacheKey { mesh, colors, encoder, version, rolls: self.rolls, views };
        let key = blake3::hash(crate::files::to_json(&key).to_string().as_bytes());
        folder.join(format!("{}.emb.mcap", key.to_hex()))
    }

    /// The object as the encoder sees it.
    fn look(&self, object: Drawable<'_>, coloring: Coloring) -> Look {
        let coloring = self.encoder.wants().settings(coloring).coloring;
        let colors = (coloring == Coloring::Own).then(|| object.hash_of_colors()).flatten();
        Look { mesh: noise_free(object.mesh()).hash(), colors }
    }
}

/// An object as an encoder sees it.
#[derive(PartialEq)]
struct Look {
    /// Hash of the surface that is drawn.
    mesh: MeshHash,
    /// Hash of the object's colours, where they are shown.
    colors: Option<String>,
}

/// Keeps embeddings to the last bit, so that the next run gives the same answer. What cannot be kept
/// is made again the next time.
fn keep(folder: &Path, path: &Path, embeddings: &EmbeddingsFile, times: &EncodingTimes) {
    let kept = std::fs::create_dir_all(folder).is_ok()
        && embeddings.write(path, exact_dtype(&embeddings.views)).is_ok();
    if kept {
        let _ = write_json(path.with_extension("took.json"), times);
    }
}

/// The smallest type that holds every number as it is: programs hand over half precision.
fn exact_dtype(views: &[EmbeddedView]) -> Dtype {
    let mut numbers = views.iter().flat_map(|view| view.patches.data());
    if numbers.all(|&x| f16::from_f32(x).to_f32() == x) { Dtype::F16 } else { Dtype::F32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    #[test]
    fn the_other_object_is_encoded_by_who_made_the_file() {
        let (cup, kettle) = (zoo::icosphere(3), zoo::icosphere(2));
        let settings = OpenSettings::default();
        let builtin = open_encoder("builtin", &settings).unwrap();
        let encoder = ObjectEncoder::new(builtin, &ShapeCache::off()).with_rolls(2);
        let task = Task::default();
        let mut file = encoder.embed(&cup, Coloring::Grey, &task).unwrap().embeddings;
        let beside = ObjectEncoder::of_file(&file, &settings, &ShapeCache::off()).unwrap();
        assert_eq!(beside.rolls(), 2);
        let off = ShapeCache::off();
        let named = ObjectEncoder::beside(&file, Some("builtin"), &settings, &off).unwrap();
        assert_eq!(named.rolls(), 2);
        let made = beside.embed_beside(&file, &kettle, &task).unwrap();
        assert_eq!(
            made.embeddings,
            encoder.embed(&kettle, Coloring::Grey, &task).unwrap().embeddings
        );
        let other_rolls = beside.clone().with_rolls(1);
        assert_eq!(
            other_rolls.embed_beside(&file, &kettle, &task).unwrap().embeddings,
            made.embeddings
        );
        file.metadata.revision = "0+ffffffffffff".into();
        let error = beside.embed_beside(&file, &kettle, &task).unwrap_err().to_string();
        assert!(error.contains("builtin 0+ffffffffffff, which made it"), "{error}");
        file.metadata.simulated = true;
        assert!(ObjectEncoder::of_file(&file, &settings, &ShapeCache::off()).is_err());
    }
}
