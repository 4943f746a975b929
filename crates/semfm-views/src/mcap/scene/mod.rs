//! Coloured meshes, point clouds, labels and pictures for a viewer: `transfer.mcap`.

mod items;
mod messages;
mod point_cloud;

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::messages::{FrameTransform, SceneEntity, SceneUpdate};
use semfm_geom::math::{DMat3, DQuat, DVec3, bounds};

use self::items::WORLD;
pub use self::items::{
    SceneFrame, SceneLabel, SceneLink, SceneLog, SceneMesh, SceneNumbers, ScenePicture,
    ScenePoints, Severity,
};
use self::messages::{Segment, log_message, segments_entity, text_entity};
use self::point_cloud::point_cloud;
pub use self::point_cloud::read_cloud;
use super::messages::{camera_calibration, camera_transform, picture, transform};
use super::metadata::METADATA_NAME;
use super::topics::TF;
use super::writer::{ChunkCompression, McapWriter, write_mcap};
use crate::{Error, Result};

/// What a viewer is shown. Everything is recorded at time 0.
#[derive(Clone, Debug, Default)]
pub struct Scene<'a> {
    /// How the frames stand in `world`; those that are not named stand as they are.
    pub frames: Vec<SceneFrame<'a>>,
    /// Meshes; those of one topic go into one `foxglove.SceneUpdate`.
    pub meshes: Vec<SceneMesh<'a>>,
    /// Clouds, each a `foxglove.PointCloud`.
    pub clouds: Vec<ScenePoints<'a>>,
    /// Words.
    pub labels: Vec<SceneLabel<'a>>,
    /// Lines from frame to frame.
    pub links: Vec<SceneLink<'a>>,
    /// Pictures with their cameras.
    pub pictures: Vec<ScenePicture<'a>>,
    /// One `foxglove.Log`.
    pub log: Option<SceneLog<'a>>,
}

/// Room between two neighbours, as a share of the larger one.
const GAP: f64 = 0.25;
/// Labels stand this share of the widest frame above what they belong to.
const ABOVE: f64 = 0.12;

impl Scene<'_> {
    /// Writes the scene whole or not at all, with `/tf` that lays the frames side by side along x in
    /// the order in which they appear, and `metadata` as JSON in the record `semfm`, key `json`,
    /// beside its `format`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for colours, numbers or triangles that do not fit their points and for
    /// labels and links of a frame that holds nothing, [`Error::Io`].
    pub fn write(&self, path: &Path, format: &str, metadata: &serde_json::Value) -> Result<()> {
        self.check()?;
        let stands = self.side_by_side();
        let updates = self.updates(&stands)?;
        write_mcap(path, "", ChunkCompression::Lz4, |file| {
            let entries = [("format", format.to_owned()), ("json", metadata.to_string())];
            file.metadata(METADATA_NAME, entries.map(|(k, v)| (k.to_owned(), v)).into())?;
            for stand in &stands {
                file.log(TF, 0, &stand.transform())?;
            }
            for picture in &self.pictures {
                picture.write(file)?;
            }
            if let Some(log) = &self.log {
                file.log(log.topic, 0, &log_message(log))?;
            }
            for (topic, update) in &updates {
                file.log(topic, 0, update)?;
            }
            self.clouds.iter().try_for_each(|cloud| file.log(cloud.topic, 0, &point_cloud(cloud)))
        })
    }

    fn check(&self) -> Result<()> {
        for cloud in &self.clouds {
            check_length(cloud.topic, "colours", cloud.points.len(), cloud.colors.len())?;
            for (name, numbers) in cloud.numbers {
                check_length(cloud.topic, name, cloud.points.len(), numbers.len())?;
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
    fn updates(&self, stands: &[Stand<'_>]) -> Result<Vec<(String, SceneUpdate)>> {
        let mut updates: Vec<(String, SceneUpdate)> = Vec::new();
        let mut add = |topic: &str, entity: SceneEntity| match updates
            .iter_mut()
            .find(|(known, _)| known == topic)
        {
            Some((_, update)) => update.entities.push(entity),
            None => {
                let update = SceneUpdate { deletions: Vec::new(), entities: vec![entity] };
                updates.push((topic.to_owned(), update));
            }
        };
        let stand = |frame_id: &str| {
            let known = || stands.iter().map(|s| s.frame_id).collect::<Vec<_>>().join(", ");
            stands.iter().find(|stand| stand.frame_id == frame_id).ok_or_else(|| Error::Invalid {
                what: "frame of a label or link".to_owned(),
                expected: known(),
                found: frame_id.to_owned(),
            })
        };
        for mesh in &self.meshes {
            add(mesh.topic, mesh.entity().message(mesh.topic)?);
        }
        let widest = stands.iter().map(|s| s.high.x - s.low.x).fold(0.0, f64::max);
        for (i, label) in self.labels.iter().enumerate() {
            let stand = stand(label.frame_id)?;
            let (frame, at) = match label.at {
                Some(at) => (label.frame_id, at),
                None => (WORLD, stand.top() + ABOVE * widest * DVec3::Z),
            };
            add(label.topic, text_entity(label, &format!("label {i}"), frame, at));
        }
        let mut segments: BTreeMap<&str, Vec<Segment>> = BTreeMap::new();
        for link in &self.links {
            let end = |(frame, p): (&str, DVec3)| Ok::<_, Error>(stand(frame)?.world_from(p));
            let ends = [end(link.from)?, end(link.to)?];
            segments.entry(link.topic).or_default().push((ends, link.color));
        }
        segments.iter().for_each(|(topic, segments)| add(topic, segments_entity(segments)));
        Ok(updates)
    }

    /// Where each frame stands in the world, so that nothing overlaps: one beside the other along x,
    /// all with their lowest point at z = 0.
    fn side_by_side(&self) -> Vec<Stand<'_>> {
        // Vertices of no triangle do not count, be they in a cloud as well.
        let corners = |mesh: &SceneMesh<'_>| {
            let ids = mesh.faces.as_flattened().iter();
            ids.map(|&id| mesh.vertices[id as usize]).collect::<Vec<DVec3>>()
        };
        let is_meshed = |frame_id| self.meshes.iter().any(|mesh| mesh.frame_id == frame_id);
        let shown = self.meshes.iter().map(|mesh| (mesh.frame_id, corners(mesh)));
        let clouds = self.clouds.iter().filter(|cloud| !is_meshed(cloud.frame_id));
        let shown = shown.chain(clouds.map(|cloud| (cloud.frame_id, cloud.points.to_vec())));
        let mut stands: Vec<Stand<'_>> = Vec::new();
        for (frame_id, mut turned) in shown {
            let frame = self.frames.iter().find(|frame| frame.frame_id == frame_id);
            let turn = frame.map_or(DMat3::IDENTITY, |frame| frame.world_from_frame);
            turned.iter_mut().for_each(|p| *p = turn * *p);
            let Some((low, high)) = bounds(&turned) else { continue };
            match stands.iter_mut().find(|stand| stand.frame_id == frame_id) {
                Some(stand) => (stand.low, stand.high) = (stand.low.min(low), stand.high.max(high)),
                None => stands.push(Stand { frame_id, turn, low, high, shift: DVec3::ZERO }),
            }
        }
        let widest = stands.iter().map(|s| s.high.x - s.low.x).fold(0.0, f64::max);
        let mut edge = 0.0;
        for stand in &mut stands {
            let middle_y = (stand.low.y + stand.high.y) / 2.0;
            stand.shift = DVec3::new(edge - stand.low.x, -middle_y, -stand.low.z);
            edge += stand.high.x - stand.low.x + GAP * widest;
        }
        stands
    }
}

/// A frame's place in the world.
struct Stand<'a> {
    frame_id: &'a str,
    /// `world_from_frame`, with `shift`.
    turn: DMat3,
    shift: DVec3,
    /// Bounds of what it holds, turned and not yet shifted.
    low: DVec3,
    high: DVec3,
}

impl Stand<'_> {
    fn world_from(&self, point: DVec3) -> DVec3 {
        self.turn * point + self.shift
    }

    /// Middle of the upper side, in the world.
    fn top(&self) -> DVec3 {
        let middle = (self.low + self.high) / 2.0;
        DVec3::new(middle.x, middle.y, self.high.z) + self.shift
    }

    fn transform(&self) -> FrameTransform {
        let rotation = DQuat::from_mat3(&self.turn).normalize();
        transform(WORLD, self.frame_id.to_owned(), 0, self.shift, rotation)
    }
}

impl ScenePicture<'_> {
    fn write(&self, file: &mut McapWriter<'_>) -> Result<()> {
        let Self { frame_id, name, view } = *self;
        let camera = &view.camera;
        let own = format!("{frame_id}_{name}");
        let topic = |what: &str| format!("/{frame_id}/{name}/{what}");
        file.log(TF, 0, &camera_transform(frame_id, own.clone(), 0, camera))?;
        file.log(&topic("camera"), 0, &camera_calibration(own.clone(), 0, camera))?;
        file.log(&topic("image"), 0, &picture(own, 0, view)?)
    }
}

fn check_length(topic: &str, what: &str, expected: usize, found: usize) -> Result<()> {
    match expected == found {
        true => Ok(()),
        false => Err(Error::Invalid {
            what: format!("{what} of {topic}"),
            expected: expected.to_string(),
            found: found.to_string(),
        }),
    }
}

fn check_finite(topic: &str, points: &[DVec3]) -> Result<()> {
    match points.iter().position(|p| !p.is_finite()) {
        None => Ok(()),
        Some(at) => Err(Error::Invalid {
            what: format!("point {at} of {topic}"),
            expected: "finite coordinates".to_owned(),
            found: points[at].to_string(),
        }),
    }
}
