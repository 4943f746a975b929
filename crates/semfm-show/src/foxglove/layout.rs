//! Where the frames of a scene stand in the world: one beside the other, so that nothing overlaps.

use foxglove::messages::FrameTransform;
use semfm::geom::math::{DMat3, DQuat, DVec3, bounds};
use semfm::views::mcap::messages::transform;

use super::items::{SceneFrame, SceneMesh, ScenePoint, ScenePoints};
use crate::{Error, Result};

/// The frame in which the frames of a scene stand side by side.
pub(super) const WORLD: &str = "world";

/// Between two neighbours, as a share of the widest frame.
const GAP: f64 = 0.25;
/// Titles stand this share of the widest frame above what they belong to.
const ABOVE: f64 = 0.12;

/// Where each frame stands in the world: along x in the order in which they first appear, the middle at
/// y = 0 and the lowest point at z = 0.
pub(super) struct Layout<'a> {
    pub frames: Vec<PlacedFrame<'a>>,
    /// Extent along x of the widest frame.
    widest: f64,
}

/// A frame's place in the world.
pub(super) struct PlacedFrame<'a> {
    frame_id: &'a str,
    /// `world_from_frame`, with `shift`.
    turn: DMat3,
    shift: DVec3,
    /// Bounds of what it holds, turned and not yet shifted.
    low: DVec3,
    high: DVec3,
}

impl<'a> Layout<'a> {
    /// Clouds count only in frames without a mesh, and vertices of no triangle do not count.
    pub(super) fn new(
        turned: &[SceneFrame<'_>],
        meshes: &[SceneMesh<'a>],
        clouds: &[ScenePoints<'a>],
    ) -> Self {
        let mut layout = Self { frames: Vec::new(), widest: 0.0 };
        for mesh in meshes {
            let ids = mesh.faces.as_flattened().iter();
            let corners = ids.map(|&id| mesh.vertices[id as usize]);
            layout.extend(mesh.frame_id, turned, corners);
        }
        for cloud in clouds {
            if meshes.iter().all(|mesh| mesh.frame_id != cloud.frame_id) {
                layout.extend(cloud.frame_id, turned, cloud.points.iter().copied());
            }
        }
        layout.put_side_by_side();
        layout
    }

    /// Adds points to a frame.
    fn extend(
        &mut self,
        frame_id: &'a str,
        turned: &[SceneFrame<'_>],
        points: impl Iterator<Item = DVec3>,
    ) {
        let frame = turned.iter().find(|frame| frame.frame_id == frame_id);
        let turn = frame.map_or(DMat3::IDENTITY, |frame| frame.world_from_frame);
        let points: Vec<DVec3> = points.map(|p| turn * p).collect();
        let Some((low, high)) = bounds(&points) else { return };
        match self.frames.iter_mut().find(|frame| frame.frame_id == frame_id) {
            Some(frame) => (frame.low, frame.high) = (frame.low.min(low), frame.high.max(high)),
            None => self.frames.push(PlacedFrame { frame_id, turn, low, high, shift: DVec3::ZERO }),
        }
    }

    fn put_side_by_side(&mut self) {
        self.widest = self.frames.iter().map(|f| f.high.x - f.low.x).fold(0.0, f64::max);
        let mut edge = 0.0;
        for frame in &mut self.frames {
            let middle_y = (frame.low.y + frame.high.y) / 2.0;
            frame.shift = DVec3::new(edge - frame.low.x, -middle_y, -frame.low.z);
            edge += frame.high.x - frame.low.x + GAP * self.widest;
        }
    }

    /// # Errors
    /// [`Error::Invalid`] for a frame that holds nothing.
    pub(super) fn frame(&self, frame_id: &str) -> Result<&PlacedFrame<'a>> {
        self.frames.iter().find(|frame| frame.frame_id == frame_id).ok_or_else(|| {
            let known: Vec<&str> = self.frames.iter().map(|frame| frame.frame_id).collect();
            Error::invalid("frame of a label or link", known.join(", "), frame_id)
        })
    }

    /// # Errors
    /// [`Error::Invalid`] for a frame that holds nothing.
    pub(super) fn in_world(&self, point: ScenePoint<'_>) -> Result<DVec3> {
        let frame = self.frame(point.frame_id)?;
        Ok(frame.turn * point.position + frame.shift)
    }

    /// Where a frame's title stands, in the world.
    pub(super) fn above(&self, frame: &PlacedFrame<'_>) -> DVec3 {
        frame.top() + ABOVE * self.widest * DVec3::Z
    }
}

impl PlacedFrame<'_> {
    /// Middle of the upper side, in the world.
    fn top(&self) -> DVec3 {
        let middle = (self.low + self.high) / 2.0;
        DVec3::new(middle.x, middle.y, self.high.z) + self.shift
    }

    pub(super) fn transform(&self) -> FrameTransform {
        let rotation = DQuat::from_mat3(&self.turn).normalize();
        transform(WORLD, self.frame_id.to_owned(), 0, self.shift, rotation)
    }
}
