//! A camera's colour picture with what was found drawn over it: masks, a region on a mesh, a hand at a grasp.

use semfm::files::GraspsFile;
use semfm::geom::math::{DAffine3, DMat3};
use semfm::geom::{Mesh, Pinhole, Task};
use semfm::observe::Observation;
use semfm::views::{RenderSettings, SurfaceColor, View, render};
use semfm::{Region, align::Sim3};

use super::WeightedMesh;
use super::painted::Painted;
use super::rgb_picture::RgbPicture;
use crate::colors::{CONTACT, HandColors, MARKED, color_bytes};
use crate::hand::{DrawnHand, affine};
use crate::surface::Surface;
use crate::{Error, Result};

/// Opacity of a mask, of a region and of a hand: the picture shows through each, the hand least.
const MASK: f32 = 0.38;
const REGION: f32 = 0.65;
const HAND: f32 = 0.82;
/// Outlines of what is drawn over the picture.
const EDGES: f64 = 0.5;
/// Pixels of a picture above which one sample a pixel must do.
const MANY_PIXELS: u32 = 1_500_000;
/// Radius of the ball at a contact, metres.
const BALL: f64 = 0.003;

/// A colour picture and the camera that took it.
#[derive(Clone, Debug)]
pub struct Photo {
    picture: RgbPicture,
    /// Its world is the camera's own frame.
    camera: Pinhole,
}

/// Pixels to be tinted.
#[derive(Clone, Copy, Debug)]
pub struct TintedMask<'a> {
    /// Row-major (height × width).
    pub marked: &'a [bool],
    /// sRGB.
    pub color: [u8; 3],
}

impl Photo {
    /// The colour picture of an observation; `None` where it has none.
    ///
    /// # Errors
    /// [`Error::Semfm`], which a camera that was made never causes.
    pub fn of(seen: &Observation) -> Result<Option<Self>> {
        let camera = seen.camera().posed(DAffine3::IDENTITY)?;
        let (width, height) = (camera.width(), camera.height());
        let picture = |color: &[[u8; 3]]| RgbPicture { rgb: color.concat(), width, height };
        Ok(seen.color().map(|color| Self { picture: picture(color), camera }))
    }

    /// The picture as it was taken.
    pub fn picture(&self) -> &RgbPicture {
        &self.picture
    }

    /// The camera, whose world is its own frame.
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// With masks in their colours, the last on top, each with its outline.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a mask of another size.
    pub fn with_masks(&self, masks: &[TintedMask<'_>]) -> Result<RgbPicture> {
        let mut picture = self.picture.clone();
        let (width, height) = (picture.width as usize, picture.height as usize);
        for TintedMask { marked, color } in masks {
            if marked.len() != width * height {
                let expected = format!("{width} × {height} pixels, as the picture");
                return Err(Error::invalid("mask", expected, marked.len().to_string()));
            }
            let at = |x: usize, y: usize| marked[y * width + x];
            for y in 0..height {
                for x in (0..width).filter(|&x| at(x, y)) {
                    let inner = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
                    let around = || [at(x - 1, y), at(x + 1, y), at(x, y - 1), at(x, y + 1)];
                    let opacity = if inner && around() == [true; 4] { MASK } else { 1.0 };
                    picture.tint(y * width + x, *color, opacity);
                }
            }
        }
        Ok(picture)
    }

    /// With a region (one weight per vertex) on a mesh that stands so before the camera: what of the mesh would be seen is
    /// outlined, the region is tinted.
    ///
    /// # Errors
    /// [`Error::Semfm`] where it cannot be rendered, and where the task was cancelled.
    pub fn with_region(
        &self,
        object: &Mesh,
        weights: &[f64],
        camera_from_object: &Sim3,
        task: &Task,
    ) -> Result<RgbPicture> {
        let view = self.rendered(&self.object(object, weights, camera_from_object)?, task)?;
        Ok(self.over(&view, object, weights, object.n_faces()))
    }

    /// With the hand at one grasp of a file that was found before this camera, and the region that it was found in.
    ///
    /// # Errors
    /// [`Error::Semfm`] where the file has no pose before a camera, where it cannot be rendered and where the task was
    /// cancelled; [`Error::Invalid`] for a grasp that is not there.
    pub fn with_grasp(
        &self,
        object: &Mesh,
        weights: &[f64],
        grasps: &GraspsFile,
        grasp: usize,
        task: &Task,
    ) -> Result<RgbPicture> {
        let pose = grasps.camera_pose()?;
        let found = grasps.grasps.get(grasp).ok_or_else(|| {
            let expected = format!("a number below {}", grasps.grasps.len());
            Error::invalid("grasp", expected, grasp.to_string())
        })?;
        let similarity = Sim3 {
            scale: grasps.object_scale,
            rotation: pose.rotation,
            translation: pose.translation,
        };
        let camera_from_metres =
            DAffine3::from_mat3_translation(DMat3::from_quat(pose.rotation), pose.translation);
        let mut painted = self.object(object, weights, &similarity)?;
        let (hand, colors) = (DrawnHand::of(grasps), HandColors::of_one());
        let camera_from_tcp = camera_from_metres * affine(&found.object_from_tcp);
        for part in &hand.parts {
            let mut surface = Surface::default();
            let place = camera_from_tcp * affine(&found.hand.closed[part.carrier]);
            surface.add_at(&part.surface, place);
            painted.add(&surface, colors.of(part.kind));
        }
        for contact in found.contacts {
            let middle = camera_from_metres.transform_point3(contact.into());
            painted.add(&Surface::ball(middle, BALL), CONTACT);
        }
        let view = self.rendered(&painted, task)?;
        Ok(self.over(&view, object, weights, object.n_faces()))
    }

    /// The object in the camera's frame, metres, in the colours of its weights.
    fn object(&self, mesh: &Mesh, weights: &[f64], pose: &Sim3) -> Result<Painted> {
        let vertices = mesh.vertices().iter().map(|&p| pose.apply(p)).collect();
        let placed = Mesh::new(vertices, mesh.faces().to_vec())?;
        Ok(Painted::object(WeightedMesh { mesh: &placed, weights }))
    }

    fn rendered(&self, painted: &Painted, task: &Task) -> Result<View> {
        let n_pixels = self.picture.width * self.picture.height;
        let supersampling = if n_pixels > MANY_PIXELS { 1 } else { 3 };
        let settings = RenderSettings { supersampling, edges: EDGES, ..Default::default() };
        let colors = SurfaceColor::Vertices(&painted.colors);
        Ok(render(&painted.mesh()?, &colors, &[self.camera], &settings, task)?.remove(0))
    }

    /// A rendered view over the picture. Of the first `n_object` triangles, which are the object's, only those inside the
    /// region are drawn, and the object's outline.
    fn over(&self, view: &View, object: &Mesh, weights: &[f64], n_object: usize) -> RgbPicture {
        let mut picture = self.picture.clone();
        let width = picture.width as usize;
        for (at, (&triangle, over)) in
            view.triangles.iter().zip(view.rgb.as_chunks::<3>().0).enumerate()
        {
            let Ok(face) = usize::try_from(triangle) else { continue };
            if face >= n_object {
                picture.tint(at, *over, HAND);
                continue;
            }
            let corners = object.faces()[face].map(|v| weights[v as usize]);
            if corners.iter().sum::<f64>() >= 3.0 * Region::COUNTS {
                picture.tint(at, *over, REGION);
            }
            let (x, y) = (at % width, at / width);
            let beside = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then(|| at + 1),
                (y > 0).then(|| at - width),
                (at + width < view.triangles.len()).then(|| at + width),
            ];
            let is_edge = beside.into_iter().flatten().any(|next| view.triangles[next] < 0);
            if is_edge {
                picture.tint(at, color_bytes(MARKED), 1.0);
            }
        }
        picture
    }
}

#[cfg(test)]
mod tests {
    use semfm::geom::Intrinsics;
    use semfm::geom::math::{DQuat, DVec3};
    use semfm_geom::zoo::icosphere;

    use super::*;

    const SIDE: u32 = 60;

    fn photo() -> Photo {
        let size = f64::from(SIDE);
        let intrinsics = Intrinsics {
            width: SIDE,
            height: SIDE,
            fx: size,
            fy: size,
            cx: size / 2.0,
            cy: size / 2.0,
        };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let seen = Observation::new(camera);
        assert!(Photo::of(&seen).unwrap().is_none());
        let grey = vec![[100u8; 3]; (SIDE * SIDE) as usize];
        Photo::of(&seen.with_color(grey).unwrap()).unwrap().unwrap()
    }

    #[test]
    fn a_region_is_red_where_the_object_stands_and_nothing_else_changes() {
        let (photo, ball) = (photo(), icosphere(3));
        let pose = Sim3 { scale: 0.1, rotation: DQuat::IDENTITY, translation: DVec3::Z * 0.5 };
        // The half of the ball that is to the right.
        let weights: Vec<f64> = ball.vertices().iter().map(|p| f64::from(p.x > 0.0)).collect();
        let drawn = photo.with_region(&ball, &weights, &pose, &Task::default()).unwrap();
        let at = |x: u32, y: u32| drawn.at((y * SIDE + x) as usize);
        let (right, left, beside) = (at(36, 30), at(24, 30), at(2, 2));
        assert!(right[0] > right[1] + 30, "{right:?}");
        assert_eq!((left, beside), ([100; 3], [100; 3]));
    }

    #[test]
    fn masks_are_tinted_with_an_outline_and_wrong_sizes_are_refused() {
        let photo = photo();
        let marked: Vec<bool> = (0..SIDE * SIDE).map(|i| i % SIDE > 30 && i / SIDE > 30).collect();
        let mask = TintedMask { marked: &marked, color: [0, 0, 255] };
        let drawn = photo.with_masks(&[mask]).unwrap();
        let at = |x: u32, y: u32| drawn.at((y * SIDE + x) as usize);
        assert_eq!((at(31, 40), at(5, 5)), ([0, 0, 255], [100; 3]));
        let inside = at(45, 45);
        assert!(inside[2] > 140 && inside[0] > 50, "{inside:?}");
        let short = TintedMask { marked: &marked[1..], color: [0; 3] };
        assert!(photo.with_masks(&[short]).is_err());
    }
}
