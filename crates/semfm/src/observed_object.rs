//! An object that cameras saw, as encoders are shown it: the real pictures, and its surface rendered from where it was seen.

use std::fmt;
use std::str::FromStr;

use semfm_encoder::rendered_views::{Coloring, RenderedObject, ViewSettings};
use semfm_encoder::{Brightness, EncodedViews, Encoder, ObservedPicture, WantedViews};
use semfm_geom::{Mesh, Pinhole, Task};
#[cfg(feature = "mcap")]
use semfm_views::mcap::EmbeddingsFile;
use semfm_views::{RenderSettings, Renderer, SurfaceColor, View, camera_towards, rig};

use crate::{Error, Result};

/// Which views of an observed object an encoder is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObservedViews {
    /// The pictures that cameras took.
    Pictures,
    /// The surface, rendered in grey from each camera and from around it, as far as it faces them.
    Surface,
    /// Both.
    Both,
}

/// The surface is rendered from the rig's cameras whose direction is at most this far from that of a camera that saw it,
/// radians: beyond, most of it is seen from behind.
const AROUND: f64 = 60.0 * std::f64::consts::PI / 180.0;

impl ObservedViews {
    const ALL: [(Self, &'static str); 3] =
        [(Self::Pictures, "pictures"), (Self::Surface, "surface"), (Self::Both, "both")];

    /// What is shown where nobody says: an encoder that reads colours gets both, one of grey views the surface, which looks
    /// like what it was trained on whatever the light and the paint. On three pairs (`bench/README.md`) pictures alone were
    /// better from one side and far worse from four.
    pub fn for_encoder(wants: &WantedViews) -> Self {
        if wants.reads_colors { Self::Both } else { Self::Surface }
    }

    /// Those of which [`embed_observed`] made a file; `None` for embeddings of other views.
    #[cfg(feature = "mcap")]
    pub fn of_file(file: &EmbeddingsFile) -> Option<Self> {
        let (shown, _) = file.metadata.views.rig.split_once(" of ")?;
        shown.parse().ok()
    }

    fn has_pictures(self) -> bool {
        self != Self::Surface
    }

    fn has_surface(self) -> bool {
        self != Self::Pictures
    }
}

impl fmt::Display for ObservedViews {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(views, _)| views == self).map_or("", |entry| entry.1);
        f.write_str(name)
    }
}

impl FromStr for ObservedViews {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|(_, name)| *name == text);
        found.map(|entry| entry.0).ok_or_else(|| {
            Error::invalid("views", "pictures, surface or both", format!("`{text}`"))
        })
    }
}

/// The views of a surface that cameras saw: what [`Encoder::encode`] takes. The cameras of `pictures` are posed in the frame
/// and in the unit of `mesh`, which is an observed surface ([`Observation::surface`](semfm_observe::Observation::surface)) or
/// a model at its pose ([`camera_before_mesh`](semfm_encoder::camera_before_mesh)).
///
/// # Errors
/// [`Error::Invalid`] for no picture; [`Error::Encoder`] for a picture that does not have its camera's size or that does not
/// show the mesh; [`Error::Views`] where it cannot be rendered.
pub fn observed_views<'a>(
    mesh: &'a Mesh,
    pictures: &[ObservedPicture<'_>],
    shown: ObservedViews,
    wants: &WantedViews,
    task: &Task,
) -> Result<RenderedObject<'a>> {
    if pictures.is_empty() {
        return Err(Error::invalid("pictures", "at least one", "none"));
    }
    let coloring = if shown.has_pictures() { Coloring::Own } else { Coloring::Grey };
    let settings = wants.settings(coloring);
    let mut views = Vec::new();
    if shown.has_pictures() {
        views.extend(picture_views(mesh, pictures, wants, task)?);
    }
    if shown.has_surface() {
        let cameras = cameras_of_surface(mesh, pictures, &settings)?;
        let grey = SurfaceColor::default();
        views.extend(Renderer::cpu().render(mesh, &grey, &cameras, &settings.render, task)?);
    }
    let renderer = format!("{shown} of {} frames", pictures.len());
    Ok(RenderedObject { mesh, views, settings, vertex_colors: None, renderer })
}

/// The pictures alone, cropped to the object: to join the rendered views of a model whose pose is known.
///
/// # Errors
/// As [`observed_views`].
pub fn picture_views(
    mesh: &Mesh,
    pictures: &[ObservedPicture<'_>],
    wants: &WantedViews,
    task: &Task,
) -> Result<Vec<View>> {
    let settings = wants.settings(Coloring::Own);
    let brightness = if wants.reads_colors { Brightness::Kept } else { Brightness::OfGreyView };
    let views = pictures.iter().map(|picture| picture.view(mesh, &settings, brightness, task));
    Ok(views.collect::<semfm_encoder::Result<_>>()?)
}

/// Cameras from which the surface is rendered: those that saw it, framed as rendered views are, and those of the rig that
/// stand around them.
fn cameras_of_surface(
    mesh: &Mesh,
    pictures: &[ObservedPicture<'_>],
    settings: &ViewSettings,
) -> Result<Vec<Pinhole>> {
    let middle = {
        let (low, high) = mesh.bounds();
        (low + high) / 2.0
    };
    let seen_from: Vec<_> =
        pictures.iter().filter_map(|p| (p.camera.eye() - middle).try_normalize()).collect();
    let around = rig(mesh, &settings.rig)?.into_iter().filter(|camera| {
        let direction = (camera.eye() - middle).normalize_or_zero();
        seen_from.iter().any(|seen| seen.dot(direction) >= AROUND.cos())
    });
    let mut cameras = Vec::new();
    for picture in pictures {
        let up = -picture.camera.camera_from_world().matrix3.row(1);
        let direction = picture.camera.eye() - middle;
        cameras.push(camera_towards(mesh, direction, up, &settings.rig)?);
    }
    cameras.extend(around);
    Ok(cameras)
}

/// A whole picture as a view of the mesh that it shows: depth and triangles are those of the mesh, +∞ and −1 beside it.
///
/// # Errors
/// [`Error::Invalid`] for a picture that does not have its camera's size, [`Error::Views`] where the mesh cannot be rendered.
pub fn whole_picture(mesh: &Mesh, picture: &ObservedPicture<'_>, task: &Task) -> Result<View> {
    let n_pixels = picture.camera.width() as usize * picture.camera.height() as usize;
    if picture.color.len() != n_pixels {
        let expected = format!("{n_pixels} pixels, as its camera");
        return Err(Error::invalid("picture", expected, picture.color.len().to_string()));
    }
    let settings = RenderSettings { supersampling: 1, ..RenderSettings::default() };
    let grey = SurfaceColor::default();
    let views = Renderer::cpu().render(mesh, &grey, &[picture.camera], &settings, task)?;
    let view = views.into_iter().next();
    let mut view = view.ok_or_else(|| Error::invalid("views", "one", "none"))?;
    view.rgb = picture.color.iter().flatten().copied().collect();
    Ok(view)
}

/// What an encoder makes of an observed surface ([`observed_views`]), each view at `rolls` rotations.
///
/// # Errors
/// As [`observed_views`], and [`Error::Encoder`] for an encoder without an answer.
pub fn encode_observed(
    views: &RenderedObject<'_>,
    encoder: &dyn Encoder,
    rolls: u32,
    task: &Task,
) -> Result<EncodedViews> {
    let encoded = encoder.encode(std::slice::from_ref(views), rolls, task)?;
    encoded
        .into_iter()
        .next()
        .ok_or_else(|| Error::invalid("encoder", "embeddings of the observed surface", "no answer"))
}

/// The same as the content of an embeddings file, which belongs to the mesh like any other.
///
/// # Errors
/// As [`encode_observed`].
#[cfg(feature = "mcap")]
pub fn embed_observed(
    views: &RenderedObject<'_>,
    encoder: &dyn Encoder,
    rolls: u32,
    task: &Task,
) -> Result<EmbeddingsFile> {
    let mut file = encode_observed(views, encoder, rolls, task)?.into_file(views);
    file.metadata.views.rig.clone_from(&views.renderer);
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_encoder::builtin_encoder;
    use semfm_geom::math::{DAffine3, DVec3};
    use semfm_geom::{Intrinsics, zoo};

    fn camera() -> Pinhole {
        let intrinsics =
            Intrinsics { width: 160, height: 120, fx: 300.0, fy: 300.0, cx: 80.0, cy: 60.0 };
        let pose = DAffine3::from_translation(10.0 * DVec3::Z);
        Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap()
    }

    #[test]
    fn pictures_come_first_and_no_view_looks_at_the_back() {
        let mesh = zoo::icosphere(3);
        let color = vec![[90; 3]; 160 * 120];
        let pictures = [ObservedPicture { camera: camera(), color: &color, mask: None }];
        let wants = builtin_encoder().unwrap().wants();
        let of = |shown| {
            observed_views(&mesh, &pictures, shown, &wants, &Task::default()).unwrap().views
        };
        let (pictures, surface, both) =
            (of(ObservedViews::Pictures), of(ObservedViews::Surface), of(ObservedViews::Both));
        assert_eq!((pictures.len(), both.len()), (1, 1 + surface.len()));
        assert_eq!(both[0].rgb, pictures[0].rgb);
        assert!((3..=6).contains(&surface.len()), "{}", surface.len());
        assert!(surface.iter().all(|view| view.camera.eye().normalize().z < -0.45));
        assert_eq!(ObservedViews::for_encoder(&wants), ObservedViews::Surface);
        for (shown, name) in ObservedViews::ALL {
            assert_eq!((shown.to_string().as_str(), name.parse().ok()), (name, Some(shown)));
        }
        assert!("mesh".parse::<ObservedViews>().unwrap_err().to_string().contains("`mesh`"));
    }

    #[test]
    fn embeddings_of_an_observed_surface_are_lifted_like_any_others() {
        let mesh = zoo::icosphere(3);
        let color = vec![[90; 3]; 160 * 120];
        let pictures = [ObservedPicture { camera: camera(), color: &color, mask: None }];
        let encoder = builtin_encoder().unwrap();
        let task = Task::default();
        let shown = ObservedViews::Pictures;
        let views = observed_views(&mesh, &pictures, shown, &encoder.wants(), &task).unwrap();
        let encoded = encode_observed(&views, &*encoder, 1, &task).unwrap();
        let lifted = semfm_views::lift(&mesh, &encoded.views, &Default::default(), &task).unwrap();
        // The cap that the camera sees, (1 − 1/10)/2 of the ball.
        let share = lifted.report.n_seen as f64 / lifted.samples.len() as f64;
        assert!((0.38..0.48).contains(&share), "{share}");
        assert!(observed_views(&mesh, &[], shown, &encoder.wants(), &task).is_err());
    }
}
