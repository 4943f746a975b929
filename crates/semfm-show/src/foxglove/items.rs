//! What a scene is made of.

use semfm::geom::math::{DMat3, DVec3};
use semfm::views::View;
use semfm::views::mcap::messages::MeshEntity;

/// How a frame stands in `world`.
#[derive(Clone, Copy, Debug)]
pub struct SceneFrame<'a> {
    /// The frame.
    pub frame_id: &'a str,
    /// A rotation.
    pub world_from_frame: DMat3,
}

/// A triangle mesh to be shown.
#[derive(Clone, Copy, Debug)]
pub struct SceneMesh<'a> {
    /// Topic, such as `/source/mesh`.
    pub topic: &'a str,
    /// Frame of the vertices, such as `source`.
    pub frame_id: &'a str,
    /// What it is; unique in its topic.
    pub name: &'a str,
    /// Positions (n).
    pub vertices: &'a [DVec3],
    /// Triangles (m).
    pub faces: &'a [[u32; 3]],
    /// sRGB colours of the vertices (n), grey without.
    pub colors: Option<&'a [[u8; 3]]>,
}

impl SceneMesh<'_> {
    /// The entity of its message.
    pub(super) fn entity(&self) -> MeshEntity<'_> {
        let Self { frame_id, name, vertices, faces, colors, .. } = *self;
        MeshEntity { frame_id, name, vertices, faces, colors }
    }
}

/// A point cloud to be shown.
#[derive(Clone, Copy, Debug)]
pub struct ScenePoints<'a> {
    /// Topic, such as `/source/cloud`.
    pub topic: &'a str,
    /// Frame of the points.
    pub frame_id: &'a str,
    /// Positions (n).
    pub points: &'a [DVec3],
    /// sRGB colours (n).
    pub colors: &'a [[u8; 3]],
    /// Numbers (n each) to colour by.
    pub numbers: &'a [NamedNumbers<'a>],
}

/// One number for each point, and its name.
#[derive(Clone, Copy, Debug)]
pub struct NamedNumbers<'a> {
    /// Name, such as `weight`.
    pub name: &'a str,
    /// One number for each point.
    pub numbers: SceneNumbers<'a>,
}

/// One number for each point.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum SceneNumbers<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Signed.
    I32(&'a [i32]),
    /// Unsigned.
    U32(&'a [u32]),
}

impl SceneNumbers<'_> {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::F32(numbers) => numbers.len(),
            Self::I32(numbers) => numbers.len(),
            Self::U32(numbers) => numbers.len(),
        }
    }
}

/// Text in the scene.
#[derive(Clone, Debug)]
pub struct SceneLabel<'a> {
    /// Topic.
    pub topic: &'a str,
    /// Frame of `at`, or which frame's objects to stand above.
    pub frame_id: &'a str,
    /// Where; above everything that the frame holds without.
    pub at: Option<DVec3>,
    /// The text.
    pub text: String,
    /// sRGB.
    pub color: [u8; 3],
}

/// A line between points of two frames, shown in `world`.
#[derive(Clone, Copy, Debug)]
pub struct SceneLink<'a> {
    /// Topic.
    pub topic: &'a str,
    /// Where it begins.
    pub from: ScenePoint<'a>,
    /// Where it ends.
    pub to: ScenePoint<'a>,
    /// sRGB.
    pub color: [u8; 3],
}

/// A point in a frame.
#[derive(Clone, Copy, Debug)]
pub struct ScenePoint<'a> {
    /// The frame.
    pub frame_id: &'a str,
    /// In the frame's coordinates.
    pub position: DVec3,
}

/// A picture with its camera: topics `/FRAME/NAME/image` and `/FRAME/NAME/camera`, frame
/// `FRAME_NAME`.
#[derive(Clone, Copy, Debug)]
pub struct ScenePicture<'a> {
    /// Frame of what was drawn.
    pub frame_id: &'a str,
    /// Name of the picture, such as `view`.
    pub name: &'a str,
    /// The picture and its camera.
    pub view: &'a View,
}

/// How grave a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// All is well.
    Info,
    /// Look at it.
    Warning,
    /// It failed.
    Error,
}

/// A line of the log.
#[derive(Clone, Debug)]
pub struct SceneLog<'a> {
    /// Topic.
    pub topic: &'a str,
    /// How grave it is.
    pub severity: Severity,
    /// The text.
    pub text: String,
}
