//! An object out of what cameras saw of it, in one frame or in several: surface, surroundings, embeddings, files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use semfm_encoder::rendered_views::RenderedObject;
use semfm_encoder::{ObservedPicture, WantedViews};
use semfm_geom::math::{DAffine3, DVec3};
use semfm_geom::{Mesh, Pinhole, Task};
use semfm_observe::{
    Mask, MaskedFrame, MergedSurface, Observation, ObservedSurface, SurfaceReport, SurfaceSettings,
    merged_surface, merged_surroundings,
};
use semfm_views::mcap::EmbeddingsFile;

use crate::files::{SurfaceFrame, SurfaceResult, write_surface};
use crate::object_encoder::ObjectEncoder;
use crate::observed_object::{ObservedViews, embed_observed, observed_views};
use crate::{Error, Result};

/// A frame in which an object was seen.
#[derive(Clone, Debug)]
pub struct ObjectFrame {
    /// What the camera saw.
    pub seen: Arc<Observation>,
    /// The object's mask among those of the observation; `None` where all that was seen is the object.
    pub mask: Option<usize>,
}

/// Which of many frames show an object.
#[derive(Clone, Debug)]
pub struct VisibleFrames {
    /// Those that show it, in order; all, without a mask, where none has one.
    pub frames: Vec<ObjectFrame>,
    /// Which were left out and why, in words.
    pub left_out: Vec<String>,
}

impl VisibleFrames {
    /// Leaves out the frames without a mask of the object or without depth under it.
    ///
    /// # Errors
    /// As [`ObjectFrame::where_visible`]; [`Error::Invalid`] where the object is named and no frame shows it, and where nobody
    /// names it and the masks of the frames have several names.
    pub fn of(
        all: impl IntoIterator<Item = Arc<Observation>>,
        object: Option<&str>,
    ) -> Result<Self> {
        let all = all.into_iter().map(|seen| ObjectFrame::where_visible(seen, object));
        let all: Vec<ObjectFrame> = all.collect::<Result<_>>()?;
        if all.iter().all(|frame| frame.mask.is_none()) {
            return match object {
                Some(name) => {
                    let found = format!("none of the name `{name}`");
                    Err(Error::invalid("object", "a mask of some frame", found))
                }
                None => Ok(Self { frames: all, left_out: Vec::new() }),
            };
        }
        let masks = all.iter().filter_map(ObjectFrame::mask);
        let names: BTreeSet<&str> = masks.map(|mask| mask.name.as_str()).collect();
        if names.len() > 1 {
            let names: Vec<&str> = names.into_iter().collect();
            let expected = format!("one of the masks {}", names.join(", "));
            return Err(Error::invalid("mask of the object", expected, "none"));
        }
        let mut visible = Self { frames: Vec::new(), left_out: Vec::new() };
        for (number, frame) in all.into_iter().enumerate() {
            let why = match frame.mask() {
                None => "it has no mask of the object",
                Some(mask) if frame.seen.points(Some(mask)).is_err() => "no depth under its mask",
                Some(_) => {
                    visible.frames.push(frame);
                    continue;
                }
            };
            visible.left_out.push(format!("frame {number} is left out: {why}"));
        }
        if visible.frames.is_empty() {
            return Err(Error::invalid("frames", "depth under the mask of some frame", "none"));
        }
        Ok(visible)
    }
}

/// What cameras saw of an object, as an object: what `semfm-cli surface` makes.
#[derive(Clone, Debug)]
pub struct ObservedObject {
    frame: SurfaceFrame,
    frames: Vec<ObjectFrame>,
    mesh: Mesh,
    colors: Option<Vec<[u8; 3]>>,
    pixels: Option<SurfaceReport>,
    around: Vec<DVec3>,
}

/// Embeddings of an observed object.
#[derive(Clone, Debug)]
pub struct ObservedEmbeddings {
    /// The content of the file.
    pub file: EmbeddingsFile,
    /// The views that the encoder was shown.
    pub shown: ObservedViews,
}

impl ObjectFrame {
    /// With the object's mask of this name, or the only one that there is.
    ///
    /// # Errors
    /// As [`Observation::mask_of_object`].
    pub fn of(seen: Arc<Observation>, object: Option<&str>) -> Result<Self> {
        let mask = place_of(&seen, seen.mask_of_object(object)?);
        Ok(Self { seen, mask })
    }

    /// The same of one of many frames, in which the object may not be visible.
    ///
    /// # Errors
    /// As [`Observation::mask_where_visible`].
    pub fn where_visible(seen: Arc<Observation>, object: Option<&str>) -> Result<Self> {
        let mask = place_of(&seen, seen.mask_where_visible(object)?);
        Ok(Self { seen, mask })
    }

    /// The object's mask.
    pub fn mask(&self) -> Option<&Mask> {
        self.mask.and_then(|at| self.seen.masks().get(at))
    }

    fn masked(&self) -> MaskedFrame<'_> {
        MaskedFrame { seen: &self.seen, mask: self.mask() }
    }
}

impl ObservedObject {
    /// Of one frame its surface in the camera's frame, of several what [`merged`](Self::merged) makes of them; metres.
    ///
    /// # Errors
    /// As [`merged`](Self::merged).
    pub fn new(frames: Vec<ObjectFrame>, settings: &SurfaceSettings) -> Result<Self> {
        match &frames[..] {
            [only] => Self::before_camera(only, settings),
            _ => Self::merged(frames, settings),
        }
    }

    /// One surface in the frame in which the cameras are posed, of one frame as of several; metres.
    ///
    /// # Errors
    /// [`Error::Invalid`] for no frame, for several frames whose cameras' poses nobody said, and as [`SurfaceSettings::check`],
    /// [`Observation::surface`] and [`merged_surface`].
    pub fn merged(frames: Vec<ObjectFrame>, settings: &SurfaceSettings) -> Result<Self> {
        settings.check()?;
        match &frames[..] {
            [] => return Err(Error::invalid("frames", "at least one", "none")),
            [only] => return Self::before_camera(only, settings)?.in_world(),
            _ => {}
        }
        let mut poses = frames.iter().map(|f| f.seen.camera().camera_from_world());
        if poses.all(|pose| pose == DAffine3::IDENTITY) {
            let expected = "the camera's pose in each frame (a BOP scene with cam_R_w2c and cam_t_w2c, a bag \
                            whose fixed frame is named)";
            return Err(Error::invalid("frames", expected, "none"));
        }
        let masked: Vec<MaskedFrame<'_>> = frames.iter().map(ObjectFrame::masked).collect();
        let MergedSurface { mesh, colors, .. } = merged_surface(&masked, settings)?;
        let around = merged_surroundings(&masked)?;
        Ok(Self { frame: SurfaceFrame::World, frames, mesh, colors, pixels: None, around })
    }

    /// Of one frame, in the camera's frame.
    fn before_camera(frame: &ObjectFrame, settings: &SurfaceSettings) -> Result<Self> {
        settings.check()?;
        let (seen, mask) = (&frame.seen, frame.mask());
        let ObservedSurface { mesh, colors, report, .. } = seen.surface(mask, settings)?;
        let around = mask.map(|mask| seen.surroundings(mask)).transpose()?;
        Ok(Self {
            frame: SurfaceFrame::Camera,
            frames: vec![frame.clone()],
            mesh,
            colors,
            pixels: Some(report),
            around: around.unwrap_or_default(),
        })
    }

    /// The same of one frame, moved from its camera's frame to that of the camera's pose.
    fn in_world(mut self) -> Result<Self> {
        let [only] = &self.frames[..] else { return Ok(self) };
        let world_from_camera = only.seen.camera().camera_from_world().inverse();
        let moved = |p: &DVec3| world_from_camera.transform_point3(*p);
        let vertices = self.mesh.vertices().iter().map(moved).collect();
        self.mesh = Mesh::new(vertices, self.mesh.faces().to_vec())?;
        self.around = self.around.iter().map(moved).collect();
        self.frame = SurfaceFrame::World;
        Ok(self)
    }

    /// The frame of its mesh and of what is around it.
    pub fn frame(&self) -> SurfaceFrame {
        self.frame
    }

    /// The frames in which it was seen.
    pub fn frames(&self) -> &[ObjectFrame] {
        &self.frames
    }

    /// The surface, metres.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The pictures' colours at its vertices (n), where every frame has some.
    pub fn colors(&self) -> Option<&[[u8; 3]]> {
        self.colors.as_deref()
    }

    /// What became of the pixels, of a single frame.
    pub fn pixels(&self) -> Option<SurfaceReport> {
        self.pixels
    }

    /// Points of what was seen beside it, in the mesh's frame.
    pub fn around(&self) -> &[DVec3] {
        &self.around
    }

    /// What an encoder is shown: `views`, or what suits the encoder ([`ObservedViews::for_encoder`]).
    ///
    /// # Errors
    /// [`Error::Invalid`] where pictures are asked for and a frame has no colours.
    pub fn shown(
        &self,
        views: Option<ObservedViews>,
        wants: &WantedViews,
    ) -> Result<ObservedViews> {
        let has_color = self.frames.iter().all(|frame| frame.seen.color().is_some());
        match views {
            Some(views) if !has_color && views != ObservedViews::Surface => {
                Err(Error::invalid(format!("views {views}"), "a colour picture", "depth alone"))
            }
            Some(views) => Ok(views),
            None if has_color => Ok(ObservedViews::for_encoder(wants)),
            None => Ok(ObservedViews::Surface),
        }
    }

    /// What an encoder makes of it, for [`transfer`](crate::transfer) like any other embeddings.
    ///
    /// # Errors
    /// As [`shown`](Self::shown), [`observed_views`] and [`embed_observed`].
    pub fn embed(
        &self,
        encoder: &ObjectEncoder,
        views: Option<ObservedViews>,
        task: &Task,
    ) -> Result<ObservedEmbeddings> {
        let wants = encoder.encoder().wants();
        let shown = self.shown(views, &wants)?;
        let pictures = self.frames.iter().map(|frame| self.picture(frame));
        let pictures: Vec<ObservedPicture<'_>> = pictures.collect::<Result<_>>()?;
        let views: RenderedObject<'_> = observed_views(&self.mesh, &pictures, shown, &wants, task)?;
        let file = embed_observed(&views, &**encoder.encoder(), encoder.rolls(), task)?;
        Ok(ObservedEmbeddings { file, shown })
    }

    /// The frames' cameras in the mesh's frame.
    ///
    /// # Errors
    /// [`Error::Geom`] where a camera cannot be posed.
    pub fn cameras(&self) -> Result<Vec<Pinhole>> {
        self.frames.iter().map(|frame| self.frame.camera(&frame.seen)).collect()
    }

    /// A frame's picture before the mesh.
    fn picture<'a>(&self, frame: &'a ObjectFrame) -> Result<ObservedPicture<'a>> {
        let camera = self.frame.camera(&frame.seen)?;
        // The surface is rendered without colours.
        let color = frame.seen.color().unwrap_or_default();
        Ok(ObservedPicture { camera, color, mask: frame.mask().map(|mask| &mask.marked[..]) })
    }

    /// Hands `use_it` what is written of it, with its embeddings where there are some.
    pub fn with_result<T>(
        &self,
        embeddings: Option<(&EmbeddingsFile, ObservedViews)>,
        use_it: impl FnOnce(&SurfaceResult<'_>) -> T,
    ) -> T {
        let frames: Vec<&Observation> = self.frames.iter().map(|frame| &*frame.seen).collect();
        let object = self.frames.iter().find_map(ObjectFrame::mask);
        use_it(&SurfaceResult {
            mesh: &self.mesh,
            colors: self.colors(),
            frame: self.frame,
            frames: &frames,
            object: object.map(|mask| mask.name.as_str()),
            pixels: self.pixels,
            around: &self.around,
            embeddings,
        })
    }

    /// Writes its folder ([`write_surface`]); the files.
    ///
    /// # Errors
    /// As [`write_surface`].
    pub fn write(
        &self,
        folder: &Path,
        embeddings: Option<(&EmbeddingsFile, ObservedViews)>,
        task: &Task,
    ) -> Result<Vec<PathBuf>> {
        self.with_result(embeddings, |result| write_surface(folder, result, task))
    }
}

/// Which of the masks of an observation this one is.
fn place_of(seen: &Observation, mask: Option<&Mask>) -> Option<usize> {
    seen.masks().iter().position(|one| mask.is_some_and(|mask| std::ptr::eq(one, mask)))
}

#[cfg(test)]
mod tests {
    use semfm_align::DepthImage;
    use semfm_encoder::Encoder;
    use semfm_geom::Intrinsics;

    use super::*;

    /// A plate of 20 × 14 pixels at .5 m before a wall, by a camera that stands at x.
    fn frame(x: f64) -> Observation {
        let intrinsics =
            Intrinsics { width: 40, height: 30, fx: 50.0, fy: 50.0, cx: 20.0, cy: 15.0 };
        let pose = DAffine3::from_translation(-x * DVec3::X);
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap();
        let is_object = |i: usize| (10..30).contains(&(i % 40)) && (8..22).contains(&(i / 40));
        let depth = (0..1200).map(|i| if is_object(i) { 0.5 } else { 0.7 }).collect();
        Observation::new(camera)
            .with_depth(DepthImage::new(40, 30, depth).unwrap())
            .and_then(|seen| seen.with_mask("plate", (0..1200).map(is_object).collect()))
            .unwrap()
    }

    fn object(frames: &[Observation]) -> Result<ObservedObject> {
        let frames = frames.iter().map(|seen| ObjectFrame::of(Arc::new(seen.clone()), None));
        ObservedObject::new(frames.collect::<Result<_>>()?, &SurfaceSettings::default())
    }

    #[test]
    fn one_frame_is_a_surface_before_its_camera_and_several_are_merged() {
        let one = object(&[frame(3.0)]).unwrap();
        assert!(one.pixels().is_some() && !one.around().is_empty());
        assert!(one.mesh().vertices().iter().all(|p| p.x.abs() < 0.2 && (p.z - 0.5).abs() < 1e-6));
        let two = object(&[frame(3.0), frame(3.01)]).unwrap();
        assert!(two.mesh().vertices().iter().all(|p| (p.x - 3.0).abs() < 0.2));
        assert!(two.pixels().is_none() && two.around().iter().all(|p| (p.x - 3.0).abs() < 1.0));
        two.with_result(None, |result| assert_eq!(result.object, Some("plate")));
        // A single frame of many is moved to the others' frame, and so is its camera.
        let only = ObjectFrame::of(Arc::new(frame(3.0)), None).unwrap();
        let of_many = ObservedObject::merged(vec![only], &SurfaceSettings::default()).unwrap();
        assert!(of_many.mesh().vertices().iter().all(|p| (p.x - 3.0).abs() < 0.2));
        assert!(of_many.around().iter().all(|p| (p.x - 3.0).abs() < 1.0));
        assert!((of_many.cameras().unwrap()[0].eye() - 3.0 * DVec3::X).length() < 1e-12);
        assert_eq!((one.frame(), of_many.frame()), (SurfaceFrame::Camera, SurfaceFrame::World));
        let unmasked = Observation::new(*frame(0.0).camera());
        let all = [frame(3.0), unmasked, frame(3.01)].map(Arc::new);
        let visible = VisibleFrames::of(all.clone(), Some("plate")).unwrap();
        assert_eq!((visible.frames.len(), visible.left_out.len()), (2, 1));
        assert!(visible.left_out[0].starts_with("frame 1 is left out"), "{:?}", visible.left_out);
        assert!(VisibleFrames::of(all, Some("cup")).unwrap_err().to_string().contains("`cup`"));
    }

    #[test]
    fn frames_of_several_objects_are_told_apart_by_name() {
        let cup = frame(3.0).masks()[0].marked.clone();
        let camera = *frame(3.0).camera();
        let of_cup = Observation::new(camera)
            .with_depth(frame(3.0).depth().unwrap().clone())
            .and_then(|seen| seen.with_mask("cup", cup))
            .unwrap();
        let all = [frame(3.01), of_cup].map(Arc::new);
        let error = VisibleFrames::of(all.clone(), None).unwrap_err().to_string();
        assert!(error.contains("cup, plate"), "{error}");
        assert_eq!(VisibleFrames::of(all, Some("cup")).unwrap().frames.len(), 1);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert!(object(&[]).unwrap_err().to_string().contains("none"));
        let unposed = object(&[frame(0.0), frame(0.0)]).unwrap_err().to_string();
        assert!(unposed.contains("pose in each frame"), "{unposed}");
        let wants = semfm_encoder::builtin_encoder().unwrap().wants();
        let one = object(&[frame(0.0)]).unwrap();
        assert_eq!(one.shown(None, &wants).unwrap(), ObservedViews::Surface);
        let blind = one.shown(Some(ObservedViews::Both), &wants).unwrap_err().to_string();
        assert!(blind.contains("views both") && blind.contains("depth alone"), "{blind}");
    }
}
