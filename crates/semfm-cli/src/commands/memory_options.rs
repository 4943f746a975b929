//! Features of an object for a memory: embeddings from a file, or by an encoder.

use std::path::Path;

use anyhow::{Context, Result};
use semfm::encoder::{BuiltinEncoder, rendered_views::Coloring};
use semfm::files::{MemoryEncoder, read_embeddings};
use semfm::geom::ShapeCache;
use semfm::geom::io::MeshFile;
use semfm::object_encoder::{EncodedObject, ObjectEncoder};
use semfm::{Method, PipelineSettings, Task};

use super::encoder_options::EncoderOptions;
use crate::console;
use crate::options::Common;

/// Preparation and matching for a memory: those of the default method.
pub fn settings(no_cache: bool, seed: u64) -> PipelineSettings {
    let cache = if no_cache { ShapeCache::off() } else { ShapeCache::of_user() };
    PipelineSettings { cache, ..PipelineSettings::default() }.with_seed(seed)
}

/// The embeddings of an object of a memory: those in `file`; else made by the encoder of `options`, or by the
/// memory's own where none is named. Objects are shown in grey, for colour on one side misleads.
pub fn embeddings(
    object: &MeshFile,
    file: Option<&Path>,
    options: &EncoderOptions,
    memory: Option<&MemoryEncoder>,
    cache: &ShapeCache,
    task: &Task,
    common: &Common,
) -> Result<EncodedObject> {
    if let Some(file) = file {
        let embeddings = read_embeddings(file, &object.mesh)?;
        return Ok(EncodedObject { embeddings, times: None, from_cache: false });
    }
    let encoder = encoder(options, memory, cache, common)?;
    let encoded = encoder.embed(object, Coloring::Grey, task)?;
    if let Some(note) = encoder.why_not_kept().filter(|_| !common.quiet) {
        console::message(format_args!("note: {note}"));
    }
    Ok(encoded)
}

fn encoder(
    options: &EncoderOptions,
    memory: Option<&MemoryEncoder>,
    cache: &ShapeCache,
    common: &Common,
) -> Result<ObjectEncoder> {
    let most_rolls = Method::default().info().features.rolls;
    let Some(memory) = memory else { return options.open(most_rolls, cache, common) };
    let own = EncoderOptions {
        encoder: options.encoder.clone().or_else(|| Some(memory.name.clone())),
        rolls: options.rolls.or(Some(memory.rolls)),
    };
    own.open(most_rolls, cache, common).with_context(|| {
        let is_named = options.encoder.is_some() || BuiltinEncoder::named(&memory.name).is_some();
        match is_named {
            true => format!("the memory has features by {memory}"),
            false => format!("the memory has features by {memory}: name it with --encoder, or give an embeddings file"),
        }
    })
}
