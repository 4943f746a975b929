//! What a camera saw of an object without a mesh: what `surface` does.

use std::path::Path;
use std::sync::Arc;

use semfm::observe::{ObservationFiles, SurfaceSettings};
use semfm::{ObjectFrame, ObservedObject, Task};

use super::pose::{files_of_frame, files_of_target};
use super::transfer::{encoder_files, object_encoder, reads_views, settings};
use super::{StageContext, StageEnd};
use crate::Result;

/// The demonstrated object.
pub fn demonstration(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let frame = context.recipe.demonstration.frames.first().cloned().unwrap_or_default();
    let files = files_of_frame(&frame, frame.mask.as_deref());
    surface(context, &ObservationFiles { color: frame.color.clone(), ..files }, folder, task)
}

/// The target.
pub fn target(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let frame = context.recipe.target.frame.clone().unwrap_or_default();
    surface(context, &files_of_target(&frame, true), folder, task)
}

fn surface(
    context: &StageContext<'_>,
    files: &ObservationFiles,
    folder: &Path,
    task: &Task,
) -> Result<StageEnd> {
    let frame = ObjectFrame::of(Arc::new(files.read()?), None)?;
    let object = ObservedObject::new(vec![frame], &SurfaceSettings::default())?;
    let table = &context.recipe.transfer;
    let embeddings = match reads_views(table) {
        true => {
            let settings = settings(table, context.recipe.seed, context.cache);
            Some(object.embed(&object_encoder(context, &settings)?, None, task)?)
        }
        false => None,
    };
    let embeddings = embeddings.as_ref().map(|made| (&made.file, made.shown));
    object.write(folder, embeddings, task)?;
    let mesh = object.mesh();
    let (low, high) = mesh.bounds();
    let [x, y, z] = (1e3 * (high - low)).to_array();
    let size = format!("{} vertices, {x:.0} × {y:.0} × {z:.0} mm", mesh.n_vertices());
    Ok(StageEnd {
        summary: vec![format!("what the camera saw: {size}")],
        more_inputs: if embeddings.is_some() { encoder_files(table)? } else { Vec::new() },
        ..StageEnd::default()
    })
}

#[cfg(test)]
mod tests {
    use semfm::observe::testing::npy;

    use super::*;
    use crate::Recipe;

    #[test]
    fn the_files_of_an_encoder_decide_what_was_seen_of_an_object() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        // A plate of 24 × 16 pixels before a wall.
        let is_object = |i: usize| (8..32).contains(&(i % 40)) && (7..23).contains(&(i / 40));
        let depth: Vec<f32> = (0..1200).map(|i| if is_object(i) { 0.5 } else { 0.7 }).collect();
        std::fs::write(at("depth.npy"), npy(&[30, 40], &depth)).unwrap();
        let mask: Vec<bool> = (0..1200).map(is_object).collect();
        std::fs::write(at("mask.npy"), npy(&[30, 40], &mask)).unwrap();
        let camera =
            r#"{"width": 40, "height": 30, "fx": 50.0, "fy": 50.0, "cx": 19.5, "cy": 14.5}"#;
        std::fs::write(at("K.json"), camera).unwrap();
        ["mug.obj", "r.json"].iter().for_each(|name| std::fs::write(at(name), "").unwrap());
        let weights = concat!(env!("CARGO_MANIFEST_DIR"), "/../semfm-encoder/weights/builtin.net");
        std::fs::copy(weights, at("own.net")).unwrap();
        let text = "[demonstration]\nmesh = 'mug.obj'\nregion = 'r.json'\n[target]\n[target.frame]\n\
                    depth = 'depth.npy'\nmask = 'mask.npy'\nintrinsics = 'K.json'\n[transfer]\nencoder = 'own.net'\n";
        std::fs::write(at("demo.toml"), text).unwrap();
        let recipe = Recipe::read(&at("demo.toml")).unwrap();
        let context = StageContext {
            recipe: &recipe,
            output: folder.path(),
            threads: 0,
            quiet: true,
            cache: false,
        };
        std::fs::create_dir(at("seen")).unwrap();
        let end = target(&context, &at("seen"), &Task::default()).unwrap();
        assert_eq!(end.more_inputs, [at("own.net")]);
    }
}
