//! A scene and how it is written.

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::messages::{SceneEntity, SceneUpdate};
use semfm::geom::math::DVec3;
use semfm::views::mcap::messages::{camera_calibration, camera_transform, picture};
use semfm::views::mcap::{ChunkCompression, METADATA_NAME, McapWriter, TF, write_mcap};
use serde_json::Value;

use super::items::{
    SceneFrame, SceneLabel, SceneLink, SceneLog, SceneMesh, ScenePicture, ScenePoints,
};
use super::layout::{Layout, WORLD};
use super::messages::{Segment, log_message, segments_entity, text_entity};
use super::point_cloud::point_cloud;
use crate::{Error, Result};

/// What a viewer is shown. Everything is recorded at time 0.
#[derive(Clone, Debug, Default)]
pub struct FoxgloveScene<'a> {
    /// How the frames stand in `world`; those that are not named stand as they are.
    pub frames: Vec<SceneFrame<'a>>,
    /// Meshes; those of one topic go into one `foxglove.SceneUpdate`.
    pub meshes: Vec<SceneMesh<'a>>,
    /// Clouds, each a `foxglove.PointCloud`.
    pub clouds: Vec<ScenePoints<'a>>,
    /// Text.
    pub labels: Vec<SceneLabel<'a>>,
    /// Lines from frame to frame.
    pub links: Vec<SceneLink<'a>>,
    /// Pictures with their cameras.
    pub pictures: Vec<ScenePicture<'a>>,
    /// One `foxglove.Log`.
    pub log: Option<SceneLog<'a>>,
}

impl FoxgloveScene<'_> {
    /// Writes the scene whole or not at all, with `/tf` that lays the frames side by side along x in
    /// the order in which they appear, and `metadata` as JSON in the record `semfm`, key `json`,
    /// beside its `format`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for colours or numbers that do not fit their points and for labels and links
    /// of a frame that holds nothing; [`Error::Semfm`] for meshes whose colours or triangles do not fit
    /// their vertices, and where the file cannot be written.
    pub fn write(&self, path: &Path, format: &str, metadata: &Value) -> Result<()> {
        self.check()?;
        // Checks that triangles fit their vertices, which the layout takes for granted.
        let meshes = self.meshes.iter().map(mesh_entity).collect::<Result<Vec<_>>>()?;
        let layout = Layout::new(&self.frames, &self.meshes, &self.clouds);
        let updates = self.updates(meshes, &layout)?;
        write_mcap(path, "", ChunkCompression::Lz4, |file| {
            let entries = [("format", format.to_owned()), ("json", metadata.to_string())];
            file.metadata(METADATA_NAME, entries.map(|(k, v)| (k.to_owned(), v)).into())?;
            for frame in &layout.frames {
                file.log(TF, 0, &frame.transform())?;
            }
            self.pictures.iter().try_for_each(|picture| write_picture(picture, file))?;
            if let Some(log) = &self.log {
                file.log(log.topic, 0, &log_message(log))?;
            }
            for update in &updates {
                file.log(update.topic, 0, &update.message)?;
            }
            self.clouds.iter().try_for_each(|cloud| file.log(cloud.topic, 0, &point_cloud(cloud)))
        })?;
        Ok(())
    }

    fn check(&self) -> Result<()> {
        for cloud in &self.clouds {
            check_length(cloud.topic, "colours", cloud.points.len(), cloud.colors.len())?;
            for named in cloud.numbers {
                check_length(cloud.topic, named.name, cloud.points.len(), named.numbers.len())?;
            }
            check_finite(cloud.topic, cloud.points)?;
        }
        for ScenePicture { name, view, .. } in &self.pictures {
            let n_pixels = view.camera.width() as usize * view.camera.height() as usize;
            check_length(name, "bytes", 3 * n_pixels, view.rgb.len())?;
        }
        Ok(())
    }

    /// One message for each topic with meshes, labels or links, in the order of first appearance.
    fn updates(&self, meshes: Vec<SceneEntity>, layout: &Layout<'_>) -> Result<Vec<Update<'_>>> {
        let mut updates: Vec<Update<'_>> = Vec::new();
        for (mesh, entity) in self.meshes.iter().zip(meshes) {
            add_entity(&mut updates, mesh.topic, entity);
        }
        for (i, label) in self.labels.iter().enumerate() {
            add_entity(&mut updates, label.topic, label_entity(i, label, layout)?);
        }
        let mut segments: BTreeMap<&str, Vec<Segment>> = BTreeMap::new();
        for link in &self.links {
            let ends = [layout.in_world(link.from)?, layout.in_world(link.to)?];
            let segment = Segment { ends, color: link.color };
            segments.entry(link.topic).or_default().push(segment);
        }
        for (topic, segments) in segments {
            add_entity(&mut updates, topic, segments_entity(&segments));
        }
        Ok(updates)
    }
}

/// The message of one topic.
struct Update<'a> {
    topic: &'a str,
    message: SceneUpdate,
}

fn add_entity<'a>(updates: &mut Vec<Update<'a>>, topic: &'a str, entity: SceneEntity) {
    match updates.iter_mut().find(|update| update.topic == topic) {
        Some(update) => update.message.entities.push(entity),
        None => {
            let message = SceneUpdate { deletions: Vec::new(), entities: vec![entity] };
            updates.push(Update { topic, message });
        }
    }
}

fn mesh_entity(mesh: &SceneMesh<'_>) -> Result<SceneEntity> {
    Ok(mesh.entity().message(mesh.topic)?)
}

/// The `i`-th label: at its point, or above everything that its frame holds.
fn label_entity(i: usize, label: &SceneLabel<'_>, layout: &Layout<'_>) -> Result<SceneEntity> {
    let frame = layout.frame(label.frame_id)?;
    let (frame_id, at) = match label.at {
        Some(at) => (label.frame_id, at),
        None => (WORLD, layout.above(frame)),
    };
    Ok(text_entity(label, &format!("label {i}"), frame_id, at))
}

fn write_picture(
    &ScenePicture { frame_id, name, view }: &ScenePicture<'_>,
    file: &mut McapWriter<'_>,
) -> semfm::views::Result<()> {
    let own = format!("{frame_id}_{name}");
    let topic = |what: &str| format!("/{frame_id}/{name}/{what}");
    file.log(TF, 0, &camera_transform(frame_id, own.clone(), 0, &view.camera))?;
    file.log(&topic("camera"), 0, &camera_calibration(own.clone(), 0, &view.camera))?;
    file.log(&topic("image"), 0, &picture(own, 0, view)?)
}

fn check_length(topic: &str, what: &str, expected: usize, found: usize) -> Result<()> {
    if expected == found {
        return Ok(());
    }
    Err(Error::invalid(format!("{what} of {topic}"), expected.to_string(), found.to_string()))
}

fn check_finite(topic: &str, points: &[DVec3]) -> Result<()> {
    match points.iter().position(|p| !p.is_finite()) {
        None => Ok(()),
        Some(at) => {
            let what = format!("point {at} of {topic}");
            Err(Error::invalid(what, "finite coordinates", points[at].to_string()))
        }
    }
}
