//! The region on the target: what `transfer` does.

use std::path::{Path, PathBuf};

use semfm::encoder::{BUILTIN_ENCODERS, BuiltinEncoder, OpenSettings, open_encoder};
use semfm::files::{
    Provenance, SURFACE_EMBEDDINGS, Seeds, TransferInputs, TransferResult, read_embeddings,
    read_region,
};
use semfm::fmap::transfer_with_anchors;
use semfm::geom::ShapeCache;
use semfm::geom::io::{MeshFile, read_mesh};
use semfm::object_encoder::ObjectEncoder;
use semfm::views::mcap::Dtype;
use semfm::{
    NamedMesh, PairFeatures, PairFiles, PipelineSettings, PreparedPair, Task, Verdict, prepare_pair,
};
use semfm_show::{TransferFiles, write_transfer};

use super::region::REGION_FILE;
use super::{StageContext, StageEnd, no_answer};
use crate::fingerprint::files_under;
use crate::recipe::TransferTable;
use crate::{Result, Stage};

/// Carries the region over.
pub fn transfer(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let recipe = context.recipe;
    let (source_path, target_path) = (context.source_mesh(), context.target_mesh());
    let source = NamedMesh { path: &source_path, file: read_mesh(&source_path)? };
    let target = NamedMesh { path: &target_path, file: read_mesh(&target_path)? };
    let region_path = context.file(Stage::Region, REGION_FILE);
    let region = read_region(&region_path, &source.file.mesh)?;
    let settings = settings(&recipe.transfer, recipe.seed, context.cache);
    let pair = Pair { source: &source.file, target: &target.file };
    let features = features(context, &settings, &pair, folder, task)?;
    let PreparedPair { source, target, notes } =
        prepare_pair(source, target, &features, &settings, task)?;
    let found =
        transfer_with_anchors(&source.object, &target.object, &region, &settings.transfer, task)
            .map_err(semfm::Error::from)?;
    let provenance = Provenance {
        files: Some(TransferInputs {
            source: source_path.display().to_string(),
            target: target_path.display().to_string(),
            region: region_path.display().to_string(),
        }),
        lift: Some(settings.lift.clone()),
        seeds: Some(Seeds { lift: settings.lift.seed, clusters: recipe.seed }),
        version: Some(env!("CARGO_PKG_VERSION").into()),
        ..Provenance::default()
    };
    let result = TransferResult {
        source: &source,
        target: &target,
        region: &region,
        transfer: &found,
        provenance: &provenance,
    };
    write_transfer(folder, &result, TransferFiles::All, task)?;
    let (n, of) = (found.region.vertices().len(), found.region.n_vertices());
    let mut end = StageEnd {
        summary: vec![format!(
            "{} (confidence {:.2}): {n} of {of} vertices of the target",
            found.verdict, found.confidence
        )],
        more_inputs: encoder_files(&recipe.transfer)?,
        ..StageEnd::default()
    };
    end.summary.extend(found.why().map(str::to_owned));
    end.summary.extend(notes);
    if found.verdict == Verdict::Refuse {
        let why = found.why().map_or_else(String::new, |why| format!(" ({why})"));
        end.no_answer = no_answer(
            format!(
                "the region was not found on the target: confidence {:.2}{why}",
                found.confidence
            ),
            "look at transfer/transfer.png. Are the two objects of one kind? Mark more of the part (demonstration.grow, \
             further frames), or name an encoder that knows such objects (transfer.encoder, docs/encoders.md)",
        );
    }
    Ok(end)
}

pub fn settings(table: &TransferTable, seed: u64, cache: bool) -> PipelineSettings {
    let mut settings = PipelineSettings::of(table.method);
    settings.transfer.rule = table.rule;
    if let Some(n) = table.working_vertices {
        settings.shape.working_vertices = n;
    }
    if let Some(k) = table.k {
        (settings.shape.k, settings.shape.clip_k) = (k, false);
    }
    if table.cache && cache {
        settings.cache = ShapeCache::of_user();
    }
    settings.with_seed(seed)
}

/// The meshes of a transfer.
struct Pair<'a> {
    source: &'a MeshFile,
    target: &'a MeshFile,
}

/// Where the features come from.
fn features(
    context: &StageContext<'_>,
    settings: &PipelineSettings,
    meshes: &Pair<'_>,
    folder: &Path,
    task: &Task,
) -> Result<PairFeatures> {
    let table = &context.recipe.transfer;
    let pair = |source: &Option<PathBuf>, target: &Option<PathBuf>| {
        let (source, target) = (source.clone()?, target.clone()?);
        Some(PairFiles { source, target })
    };
    if let Some(files) = pair(&table.source_features, &table.target_features) {
        return Ok(PairFeatures::PerVertex(files));
    }
    if let Some(files) = pair(&table.source_embeddings, &table.target_embeddings) {
        return Ok(PairFeatures::Embeddings(files));
    }
    if !reads_views(table) {
        return Ok(PairFeatures::Geometry);
    }
    let encoder = object_encoder(context, settings)?;
    // What was seen of an object has its embeddings; those of the other one are made to match.
    let seen = |stage: Stage, mesh: &Option<PathBuf>| {
        mesh.is_none().then(|| context.file(stage, SURFACE_EMBEDDINGS))
    };
    let seen_source = seen(Stage::DemonstrationSurface, &context.recipe.demonstration.mesh);
    let seen_target = seen(Stage::TargetSurface, &context.recipe.target.mesh);
    let beside = |seen: &Path, of: &MeshFile, mesh: &MeshFile, name: &str| -> Result<PathBuf> {
        let path = folder.join(name);
        let made = encoder.embed_beside(&read_embeddings(seen, &of.mesh)?, mesh, task)?;
        made.embeddings.write(&path, Dtype::F32).map_err(semfm::Error::from)?;
        Ok(path)
    };
    let Pair { source: a, target: b } = *meshes;
    let files = match (seen_source, seen_target) {
        (None, None) => return Ok(PairFeatures::Encoder(encoder)),
        (Some(source), Some(target)) => PairFiles { source, target },
        (Some(source), None) => {
            let target = beside(&source, a, b, "target.emb.mcap")?;
            PairFiles { source, target }
        }
        (None, Some(target)) => {
            let source = beside(&target, b, a, "source.emb.mcap")?;
            PairFiles { source, target }
        }
    };
    Ok(PairFeatures::Embeddings(files))
}

/// The encoder of the recipe.
pub fn object_encoder(
    context: &StageContext<'_>,
    settings: &PipelineSettings,
) -> Result<ObjectEncoder> {
    let table = &context.recipe.transfer;
    let name = table.encoder.as_deref().unwrap_or(BUILTIN_ENCODERS[0].name);
    let open = OpenSettings { threads: context.threads, quiet: context.quiet };
    let encoder = open_encoder(name, &open).map_err(semfm::Error::from)?;
    let most = table.method.info().features.rolls;
    let rolls = table.rolls.unwrap_or_else(|| encoder.wants().rolls_up_to(most));
    Ok(ObjectEncoder::new(encoder, &settings.cache).with_rolls(rolls))
}

/// Whether the transfer reads features of views.
pub fn reads_views(table: &TransferTable) -> bool {
    table.method.info().reads_features || table.encoder.is_some() || table.rolls.is_some()
}

/// The files of an encoder that is named by a path.
pub fn encoder_files(table: &TransferTable) -> Result<Vec<PathBuf>> {
    let name = table.encoder.as_deref().filter(|name| BuiltinEncoder::named(name).is_none());
    let named = name.map(Path::new).filter(|path| path.exists());
    named.map_or_else(|| Ok(Vec::new()), files_under)
}
