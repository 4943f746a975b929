//! The folder of an observed surface: what `semfm-cli surface` writes.

use std::path::{Path, PathBuf};

use semfm_encoder::ObservedPicture;
use semfm_geom::io::{
    StagedFolder, VertexAttributes, write_atomically, write_mesh_with_attributes,
};
use semfm_geom::math::{DAffine3, DVec3};
use semfm_geom::{Intrinsics, Mesh, MeshIdentity, Pinhole, Task};
use semfm_observe::{Observation, SurfaceReport};
use semfm_views::View;
use semfm_views::mcap::{Dtype, EmbeddingsFile, ViewsMetadata, write_views};
use serde::{Deserialize, Serialize};

use super::{MatrixRows, write_json};
use crate::Result;
use crate::observed_object::{ObservedViews, whole_picture};

/// The format that is written.
pub const FORMAT: &str = "semfm.surface/1";
/// The mesh, in the camera's frame, metres.
pub const MESH: &str = "surface.ply";
/// Its embeddings.
pub const EMBEDDINGS: &str = "surface.emb.mcap";
/// The picture as a view of it.
const VIEWS: &str = "surface.views.mcap";
/// Points of what is beside it.
pub const AROUND: &str = "around.ply";
/// What became of what.
const REPORT: &str = "surface.json";
/// All of them, the report last.
pub const FILES: &[&str] = &[MESH, EMBEDDINGS, VIEWS, AROUND, REPORT];

/// `surface.json`: where an observed surface comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceFile {
    /// `semfm.surface/1`.
    pub format: String,
    /// The mesh of `surface.ply`.
    pub mesh: MeshIdentity,
    /// The frame of `surface.ply`.
    pub frame: SurfaceFrame,
    /// The cameras that saw it.
    pub cameras: Vec<CameraRecord>,
    /// The mask of the object; null where all that was seen is the surface.
    pub object: Option<String>,
    /// What became of the pixels of a single frame; null for several.
    pub pixels: Option<PixelsRecord>,
    /// Points in `around.ply`; 0 where there is no such file.
    pub n_around: usize,
    /// Which views the encoder was shown (`pictures`, `surface`, `both`); null without embeddings.
    pub views: Option<String>,
    /// The encoder with its version; null without embeddings.
    pub encoder: Option<String>,
}

/// The frame that an observed surface is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SurfaceFrame {
    /// That of the one camera that saw it.
    Camera,
    /// That in which the cameras' poses are given.
    World,
}

impl SurfaceFrame {
    /// The camera of an observation in this frame.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be posed.
    pub fn camera(self, seen: &Observation) -> Result<Pinhole> {
        Ok(match self {
            Self::Camera => seen.camera().posed(DAffine3::IDENTITY)?,
            Self::World => *seen.camera(),
        })
    }
}

/// A pinhole camera as calibrations write it: the centre of the first pixel is at (0, 0).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the names say it")]
pub struct CameraRecord {
    pub width: u32,
    pub height: u32,
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    /// Its pose; the identity where nobody said.
    pub world_from_camera: MatrixRows,
}

impl CameraRecord {
    fn of(camera: &Pinhole) -> Self {
        let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics();
        let world_from_camera = rows(camera.camera_from_world().inverse());
        Self { width, height, fx, fy, cx: cx - 0.5, cy: cy - 0.5, world_from_camera }
    }
}

/// What became of the pixels of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PixelsRecord {
    /// Those of the object that have a depth.
    pub n_pixels: usize,
    /// Those among them whose depth was taken from around them.
    pub n_filled: usize,
    /// From one vertex to the next.
    pub step: usize,
    /// Triangles that were cut where depth jumps.
    pub n_cut: usize,
}

/// What is written of an observed surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceResult<'a> {
    /// The surface, in metres.
    pub mesh: &'a Mesh,
    /// Colours at its vertices (n).
    pub colors: Option<&'a [[u8; 3]]>,
    /// The frame of the surface and of what is around it.
    pub frame: SurfaceFrame,
    /// The frames in which it was seen; their cameras' worlds are what their files say.
    pub frames: &'a [&'a Observation],
    /// The name of its mask.
    pub object: Option<&'a str>,
    /// What became of the pixels, of a single frame.
    pub pixels: Option<SurfaceReport>,
    /// What is beside the object, in the mesh's frame.
    pub around: &'a [DVec3],
    /// Its embeddings and the views that they were made of.
    pub embeddings: Option<(&'a EmbeddingsFile, ObservedViews)>,
}

impl SurfaceResult<'_> {
    /// The content of `surface.json`.
    pub fn file(&self) -> SurfaceFile {
        let encoder = |file: &EmbeddingsFile| {
            format!("{} {}", file.metadata.encoder, file.metadata.revision).trim_end().to_owned()
        };
        let pixels = |report: SurfaceReport| {
            let SurfaceReport { n_pixels, n_filled, step, n_cut } = report;
            PixelsRecord { n_pixels, n_filled, step, n_cut }
        };
        SurfaceFile {
            format: FORMAT.into(),
            mesh: MeshIdentity::of(self.mesh),
            frame: self.frame,
            cameras: self.frames.iter().map(|seen| CameraRecord::of(seen.camera())).collect(),
            object: self.object.map(ToOwned::to_owned),
            pixels: self.pixels.map(pixels),
            n_around: self.around.len(),
            views: self.embeddings.map(|(_, views)| views.to_string()),
            encoder: self.embeddings.map(|(file, _)| encoder(file)),
        }
    }

    /// The whole pictures as views of the mesh; none where one has no colours or another size than the first.
    fn whole_pictures(&self, task: &Task) -> Result<Vec<View>> {
        let size = |seen: &Observation| (seen.camera().width(), seen.camera().height());
        let is_fit = |seen: &&Observation| {
            seen.color().is_some()
                && self.frames.first().is_some_and(|first| size(first) == size(seen))
        };
        if !self.frames.iter().all(is_fit) {
            return Ok(Vec::new());
        }
        let view = |seen: &&Observation| {
            let camera = self.frame.camera(seen)?;
            let color = seen.color().unwrap_or_default();
            whole_picture(self.mesh, &ObservedPicture { camera, color, mask: None }, task)
        };
        self.frames.iter().map(view).collect()
    }
}

/// Writes the folder of an observed surface: `surface.ply` (metres, the pictures' colours), its embeddings
/// `surface.emb.mcap`, `surface.views.mcap` (the whole pictures as views, for `region --mask --view`), `around.ply` and
/// `surface.json`, all of them or none. What is not there is not written, and what an earlier run left of it is removed.
///
/// # Errors
/// [`semfm_geom::Error::Io`]; [`semfm_geom::Error::Format`] where the folder is a file, and for a file that was read as an
/// input; [`semfm_views::Error`] for a picture that cannot be drawn.
pub fn write_surface(
    folder: &Path,
    result: &SurfaceResult<'_>,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let staged = StagedFolder::new(folder)?;
    let at = |name: &str| staged.path().join(name);
    let opaque = |colors: &[[u8; 3]]| colors.iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
    let colors: Option<Vec<[u8; 4]>> = result.colors.map(opaque);
    let attributes = VertexAttributes { colors: colors.as_deref(), ..Default::default() };
    write_mesh_with_attributes(at(MESH), result.mesh, &attributes)?;
    if let Some((embeddings, _)) = result.embeddings {
        embeddings.write(&at(EMBEDDINGS), Dtype::F32)?;
    }
    let views = result.whole_pictures(task)?;
    if let Some(first) = views.first() {
        let (width, height) = (first.camera.width(), first.camera.height());
        let rig = "pictures of a camera".into();
        let metadata = ViewsMetadata { rig, ..ViewsMetadata::of(result.mesh, width, height) };
        write_views(&at(VIEWS), &views, result.mesh, result.colors, &metadata)?;
    }
    if !result.around.is_empty() {
        write_points(&at(AROUND), result.around)?;
    }
    write_json(&at(REPORT), &result.file())?;
    let optional = [
        (EMBEDDINGS, result.embeddings.is_some()),
        (VIEWS, !views.is_empty()),
        (AROUND, !result.around.is_empty()),
    ];
    let gone: Vec<&str> =
        optional.iter().filter(|(_, is_there)| !is_there).map(|(name, _)| *name).collect();
    Ok(staged.put(&[REPORT], &gone)?)
}

fn rows(motion: DAffine3) -> MatrixRows {
    let DAffine3 { matrix3, translation } = motion;
    let row = |i: usize| {
        let r = matrix3.row(i);
        // −0 becomes 0.
        [r.x, r.y, r.z, translation[i]].map(|x| x + 0.0)
    };
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

/// A PLY of points alone, as `grasp --scene` and `align --cloud` take them.
fn write_points(path: &Path, points: &[DVec3]) -> Result<()> {
    Ok(write_atomically(path, |out| {
        write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points.len())?;
        for axis in ["x", "y", "z"] {
            writeln!(out, "property double {axis}")?;
        }
        writeln!(out, "end_header")?;
        points.iter().try_for_each(|p| {
            p.to_array().iter().try_for_each(|coordinate| out.write_all(&coordinate.to_le_bytes()))
        })
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::DepthImage;
    use semfm_geom::io::{read_json, read_mesh, read_points};
    use semfm_observe::SurfaceSettings;
    use semfm_views::mcap::read_view;

    #[test]
    fn the_folder_is_that_of_any_other_object() {
        let intrinsics =
            Intrinsics { width: 40, height: 30, fx: 50.0, fy: 50.0, cx: 20.0, cy: 15.0 };
        let pose = DAffine3::from_translation(DVec3::X);
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap();
        let is_object = |i: usize| (10..30).contains(&(i % 40)) && (8..22).contains(&(i / 40));
        let depth = (0..1200).map(|i| if is_object(i) { 0.5 } else { 0.7 }).collect();
        let seen = Observation::new(camera)
            .with_depth(DepthImage::new(40, 30, depth).unwrap())
            .and_then(|seen| seen.with_color((0..1200).map(|i| [i as u8, 2, 3]).collect()))
            .and_then(|seen| seen.with_mask("box", (0..1200).map(is_object).collect()))
            .unwrap();
        let mask = &seen.masks()[0];
        let surface = seen.surface(Some(mask), &SurfaceSettings::default()).unwrap();
        let around = seen.surroundings(mask).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let result = SurfaceResult {
            mesh: &surface.mesh,
            colors: surface.colors.as_deref(),
            frame: SurfaceFrame::Camera,
            frames: &[&seen],
            object: Some("box"),
            pixels: Some(surface.report),
            around: &around,
            embeddings: None,
        };
        let task = Task::default();
        let files = write_surface(folder.path(), &result, &task).unwrap();
        assert_eq!(files.len(), 4);
        let mesh = read_mesh(folder.path().join(MESH)).unwrap();
        assert_eq!(mesh.mesh.hash(), surface.mesh.hash());
        assert!(!mesh.appearance.is_plain());
        assert_eq!(read_points(folder.path().join(AROUND)).unwrap().points, around);
        let view = read_view(&folder.path().join(VIEWS), 0).unwrap();
        view.metadata.check_mesh(&surface.mesh, Path::new(VIEWS)).unwrap();
        assert_eq!(view.view.rgb[..6], [0, 2, 3, 1, 2, 3]);
        let n_on_mesh = view.view.triangles.iter().filter(|&&t| t >= 0).count();
        assert!((200..280).contains(&n_on_mesh), "{n_on_mesh}");
        let file: SurfaceFile = read_json(folder.path().join(REPORT)).unwrap();
        assert_eq!(file, result.file());
        assert_eq!((file.cameras[0].world_from_camera[0][3], file.cameras[0].cx), (-1.0, 19.5));
        // What a later run does not write is not left behind.
        let bare = SurfaceResult { around: &[], frames: &[], ..result };
        assert_eq!(write_surface(folder.path(), &bare, &task).unwrap().len(), 2);
        assert!(!folder.path().join(AROUND).exists() && !folder.path().join(VIEWS).exists());
    }
}
