//! A real picture of an object, as an encoder wants to be shown it.

use semfm_geom::math::{DAffine3, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole, PixelDepth, Task};
use semfm_views::{Renderer, SurfaceColor, View};

use crate::rendered_views::ViewSettings;
use crate::{Error, Result};

/// A picture that a camera took of an object whose surface is known.
#[derive(Clone, Copy, Debug)]
pub struct ObservedPicture<'a> {
    /// The camera, posed in the frame of the object's mesh and in its unit.
    pub camera: Pinhole,
    /// Colours (height × width, sRGB).
    pub color: &'a [[u8; 3]],
    /// Which pixels show the object (height × width); without it those onto which the mesh projects.
    pub mask: Option<&'a [bool]>,
}

/// What is done with the brightness of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Brightness {
    /// As the camera had it.
    Kept,
    /// All colours times one number, so that the object is on average as bright as the same view of it in grey. An encoder
    /// that was trained on grey views takes a dark mug for one in the shadow.
    OfGreyView,
}

/// A pixel of the new picture shows the object where its share of the mask is at least this.
const SHOWS: f64 = 0.5;

/// Samples along each side of a pixel at most, where a large picture is made small.
const MOST_SAMPLES: usize = 8;

impl ObservedPicture<'_> {
    /// The part of the picture that shows the object, cropped, sized and set on a background as `settings` say of rendered
    /// views: the object's longer side fills the same share of a square of the same size. Depth and triangles are those of
    /// `mesh`; where something hides it, so that the mask has a gap, there is background.
    ///
    /// # Errors
    /// [`Error::Invalid`] for arrays that do not have the camera's size and for an object that is not in the picture.
    pub fn view(
        &self,
        mesh: &Mesh,
        settings: &ViewSettings,
        brightness: Brightness,
        task: &Task,
    ) -> Result<View> {
        let n_pixels = self.camera.width() as usize * self.camera.height() as usize;
        let mask = self.mask.map_or(n_pixels, <[bool]>::len);
        for (what, found) in [("picture", self.color.len()), ("mask of the picture", mask)] {
            if found != n_pixels {
                let (width, height) = (self.camera.width(), self.camera.height());
                let expected = format!("{n_pixels} pixels ({width} × {height}, as its camera)");
                return Err(Error::invalid(what, expected, found.to_string()));
            }
        }
        let crop = self.crop(mesh, settings)?;
        let grey = Renderer::cpu().render(
            mesh,
            &SurfaceColor::default(),
            &[crop.camera],
            &settings.render,
            task,
        )?;
        let Some(mut view) = grey.into_iter().next() else {
            return Err(Error::invalid("views", "one", "none"));
        };
        let side = crop.camera.width() as usize;
        let background = settings.render.background.map(|c| 255.0 * f64::from(c));
        let shown: Vec<Shown> = (0..side * side)
            .map(|pixel| self.shown(&crop, pixel, view.triangles[pixel] >= 0))
            .collect();
        let on_mesh: Vec<bool> = view.triangles.iter().map(|&t| t >= 0).collect();
        let factor = match brightness {
            Brightness::Kept => 1.0,
            Brightness::OfGreyView => brightness_factor(&view, &shown, &on_mesh),
        };
        for (pixel, shown) in shown.iter().enumerate() {
            for (channel, background) in background.iter().enumerate() {
                let object = (factor * shown.color[channel]).min(255.0);
                let mixed = shown.share * object + (1.0 - shown.share) * background;
                view.rgb[3 * pixel + channel] = mixed.round() as u8;
            }
            if shown.share < SHOWS {
                (view.triangles[pixel], view.depth[pixel]) = (-1, f32::INFINITY);
            }
        }
        if view.triangles.iter().all(|&t| t < 0) {
            let expected = "the object's surface under its mask";
            return Err(Error::invalid("picture of the object", expected, "none of it"));
        }
        Ok(view)
    }

    /// The square around the object.
    fn crop(&self, mesh: &Mesh, settings: &ViewSettings) -> Result<Crop> {
        let width = self.camera.width() as usize;
        let mut bounds = PixelBounds::NONE;
        match self.mask {
            Some(mask) => {
                for (pixel, _) in mask.iter().enumerate().filter(|(_, marked)| **marked) {
                    let (u, v) = ((pixel % width) as f64, (pixel / width) as f64);
                    bounds.add(u, v);
                    bounds.add(u + 1.0, v + 1.0);
                }
            }
            None => {
                for &p in mesh.vertices() {
                    let PixelDepth { u, v, z } = self.camera.project(p);
                    if z > 0.0 {
                        bounds.add(u, v);
                    }
                }
            }
        }
        let [left, top] = bounds.low;
        let [right, bottom] = bounds.high;
        let longer = (right - left).max(bottom - top);
        if !(longer > 0.0 && longer.is_finite()) {
            return Err(Error::invalid("picture of the object", "some pixels of it", "none"));
        }
        let side = f64::from(settings.rig.size);
        let scale = settings.rig.fill * side / longer;
        let (u, v) = ((left + right) / 2.0, (top + bottom) / 2.0);
        let Intrinsics { fx, fy, cx, cy, .. } = self.camera.intrinsics();
        let intrinsics = Intrinsics {
            width: settings.rig.size,
            height: settings.rig.size,
            fx: scale * fx,
            fy: scale * fy,
            cx: side / 2.0 + scale * (cx - u),
            cy: side / 2.0 + scale * (cy - v),
        };
        let pose = self.camera.camera_from_world();
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose)?;
        Ok(Crop { camera, left: u - side / 2.0 / scale, top: v - side / 2.0 / scale, scale })
    }

    /// What a pixel of the crop shows: the mean colour of the samples on the object, and their share.
    fn shown(&self, crop: &Crop, pixel: usize, on_mesh: bool) -> Shown {
        let side = crop.camera.width() as usize;
        let n = (crop.scale.recip().ceil() as usize).clamp(1, MOST_SAMPLES);
        let (mut color, mut n_on_object) = ([0.0; 3], 0.0);
        for sample in 0..n * n {
            let inside = |i: usize| (i as f64 + 0.5) / n as f64;
            let u = crop.left + ((pixel % side) as f64 + inside(sample % n)) / crop.scale;
            let v = crop.top + ((pixel / side) as f64 + inside(sample / n)) / crop.scale;
            let Some(found) = self.sample(u, v) else { continue };
            let is_object = self.mask.map_or(on_mesh, |mask| mask[found.nearest]);
            if is_object {
                (0..3).for_each(|channel| color[channel] += found.color[channel]);
                n_on_object += 1.0;
            }
        }
        let share = n_on_object / (n * n) as f64;
        Shown {
            color: color.map(|sum| if n_on_object > 0.0 { sum / n_on_object } else { 0.0 }),
            share,
        }
    }

    /// The colour at a place of the picture, mixed of the four pixels around it; `None` outside.
    fn sample(&self, u: f64, v: f64) -> Option<Sample> {
        let (width, height) = (self.camera.width() as usize, self.camera.height() as usize);
        if !((0.0..width as f64).contains(&u) && (0.0..height as f64).contains(&v)) {
            return None;
        }
        let nearest = v as usize * width + u as usize;
        let is_object = |pixel: usize| self.mask.is_none_or(|mask| mask[pixel] == mask[nearest]);
        let (x, y) = ((u - 0.5).max(0.0), (v - 0.5).max(0.0));
        let (mut color, mut total) = ([0.0; 3], 0.0);
        for corner in 0..4 {
            let (dx, dy) = (corner % 2, corner / 2);
            let column = (x as usize + dx).min(width - 1);
            let row = (y as usize + dy).min(height - 1);
            let across = if dx == 1 { x.fract() } else { 1.0 - x.fract() };
            let down = if dy == 1 { y.fract() } else { 1.0 - y.fract() };
            // What is behind the object does not shine into its outline.
            let pixel = row * width + column;
            if is_object(pixel) {
                let weight = across * down;
                (0..3).for_each(|c| color[c] += weight * f64::from(self.color[pixel][c]));
                total += weight;
            }
        }
        let color = if total > 0.0 {
            color.map(|sum| sum / total)
        } else {
            self.color[nearest].map(f64::from)
        };
        Some(Sample { color, nearest })
    }
}

/// A part of a picture, sized.
struct Crop {
    camera: Pinhole,
    /// Its corner in the picture's pixels.
    left: f64,
    top: f64,
    /// Pixels of the crop for one of the picture.
    scale: f64,
}

/// What a pixel shows of the object, 0 to 255, and the share of it that does.
struct Shown {
    color: [f64; 3],
    share: f64,
}

/// A place of a picture.
struct Sample {
    color: [f64; 3],
    /// The pixel in which it lies.
    nearest: usize,
}

/// The least rectangle around pixels.
struct PixelBounds {
    low: [f64; 2],
    high: [f64; 2],
}

impl PixelBounds {
    const NONE: Self = Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    fn add(&mut self, u: f64, v: f64) {
        self.low = [self.low[0].min(u), self.low[1].min(v)];
        self.high = [self.high[0].max(u), self.high[1].max(v)];
    }
}

/// By what the picture's colours are multiplied to be on average as bright as those of the grey view, over the pixels that
/// show the object in both.
fn brightness_factor(grey: &View, shown: &[Shown], on_mesh: &[bool]) -> f64 {
    let (mut of_grey, mut of_picture) = (0.0, 0.0);
    for (pixel, shown) in shown.iter().enumerate() {
        if on_mesh[pixel] && shown.share >= SHOWS {
            of_grey += luma([0, 1, 2].map(|c| f64::from(grey.rgb[3 * pixel + c])));
            of_picture += luma(shown.color);
        }
    }
    if of_picture > 0.0 { of_grey / of_picture } else { 1.0 }
}

/// ITU-R BT.601, of the sRGB bytes.
fn luma([r, g, b]: [f64; 3]) -> f64 {
    0.299 * r + 0.587 * g + 0.114 * b
}

/// The camera as it stands before a mesh that it sees through a similarity: a point p of the mesh is at s·R·p + t before the
/// camera, which projects to the same pixel as R·p + t/s, so that the camera is posed by a rotation and a shift in the mesh's
/// own unit.
///
/// # Errors
/// [`semfm_geom::Error::OutOfRange`] for a rotation that is none, and a scale that is not positive.
pub fn camera_before_mesh(
    camera: &Pinhole,
    rotation: semfm_geom::math::DQuat,
    translation: DVec3,
    scale: f64,
) -> Result<Pinhole> {
    let pose = DAffine3::from_rotation_translation(rotation, translation / scale);
    Ok(camera.posed(pose)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    const SETTINGS: fn() -> ViewSettings = || {
        let mut settings = ViewSettings::default();
        settings.rig.size = 64;
        settings
    };

    /// A camera of 200 × 100 pixels that sees a ball of radius 1 from z = −10, in the right half of its picture.
    fn camera() -> Pinhole {
        let intrinsics =
            Intrinsics { width: 200, height: 100, fx: 300.0, fy: 300.0, cx: 150.0, cy: 50.0 };
        let pose = DAffine3::from_translation(10.0 * DVec3::Z);
        Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap()
    }

    /// Red to the left of the ball's middle, green to its right, blue around it.
    fn picture(mask: &[bool]) -> Vec<[u8; 3]> {
        let color = |i: usize| match (mask[i], i % 200 < 150) {
            (false, _) => [0, 0, 255],
            (true, true) => [100, 0, 0],
            (true, false) => [0, 100, 0],
        };
        (0..20_000).map(color).collect()
    }

    fn mask() -> Vec<bool> {
        // sin of the half-angle is 1/10: 300·tan.
        let radius = 300.0 / 99f64.sqrt();
        let inside = |i: usize| {
            let (u, v) = ((i % 200) as f64 + 0.5 - 150.0, (i / 200) as f64 + 0.5 - 50.0);
            u.hypot(v) < radius
        };
        (0..20_000).map(inside).collect()
    }

    #[test]
    fn the_object_is_cropped_and_what_is_around_it_is_background() {
        let (mesh, mask) = (zoo::icosphere(4), mask());
        let color = picture(&mask);
        let picture = ObservedPicture { camera: camera(), color: &color, mask: Some(&mask) };
        let task = Task::default();
        let view = picture.view(&mesh, &SETTINGS(), Brightness::Kept, &task).unwrap();
        let at = |column: usize, row: usize| {
            let pixel = row * 64 + column;
            ([0, 1, 2].map(|c| view.rgb[3 * pixel + c]), view.triangles[pixel] >= 0)
        };
        assert_eq!(at(0, 0), ([255; 3], false));
        assert_eq!((at(20, 32), at(44, 32)), (([100, 0, 0], true), ([0, 100, 0], true)));
        // No blue runs into the outline.
        assert!(view.rgb.chunks(3).all(|c| c[2] <= c[0].max(c[1])));
        // 61 pixels across become .8 of 64.
        let wide = (0..64).filter(|&column| at(column, 32).1).count();
        assert!((49..=52).contains(&wide), "{wide}");
        // A point of the mesh is where its colour is.
        let left = view.camera.project(DVec3::new(-0.3, 0.0, -0.95));
        assert_eq!(at(left.u as usize, left.v as usize).0, [100, 0, 0]);
        let bright = picture.view(&mesh, &SETTINGS(), Brightness::OfGreyView, &task).unwrap();
        let grey = Renderer::cpu()
            .render(&mesh, &SurfaceColor::default(), &[view.camera], &SETTINGS().render, &task)
            .unwrap();
        let mean = |view: &View| {
            let on: Vec<usize> = (0..64 * 64).filter(|&i| bright.triangles[i] >= 0).collect();
            let sum: f64 =
                on.iter().map(|&i| luma([0, 1, 2].map(|c| f64::from(view.rgb[3 * i + c])))).sum();
            sum / on.len() as f64
        };
        assert!(mean(&view) < 0.5 * mean(&grey[0]));
        // 0 1 0 and 1 0 0 differ in luma, and the brighter one is cut at white.
        assert!(mean(&bright) > 0.8 * mean(&grey[0]) && mean(&bright) < 1.05 * mean(&grey[0]));
    }

    #[test]
    fn without_a_mask_the_mesh_tells_and_what_is_hidden_is_none() {
        let (mesh, mask) = (zoo::icosphere(4), mask());
        let color = picture(&mask);
        let task = Task::default();
        let all = ObservedPicture { camera: camera(), color: &color, mask: None };
        let all = all.view(&mesh, &SETTINGS(), Brightness::Kept, &task).unwrap();
        let half: Vec<bool> = (0..20_000).map(|i| mask[i] && i % 200 < 150).collect();
        let hidden = ObservedPicture { camera: camera(), color: &color, mask: Some(&half) };
        let hidden = hidden.view(&mesh, &SETTINGS(), Brightness::Kept, &task).unwrap();
        let count = |view: &View| view.triangles.iter().filter(|&&t| t >= 0).count();
        assert!((count(&hidden) as f64 / count(&all) as f64 - 0.5).abs() < 0.05);
        assert!(hidden.rgb.chunks(3).all(|c| c[1] == 0 || c[0] == c[1] || c[0] > 100));
    }

    #[test]
    fn pictures_that_show_nothing_are_refused() {
        let mesh = zoo::icosphere(1);
        let task = Task::default();
        let color = vec![[0; 3]; 20_000];
        let refused = |picture: ObservedPicture<'_>| {
            let view = picture.view(&mesh, &SETTINGS(), Brightness::Kept, &task);
            view.unwrap_err().to_string()
        };
        let none = vec![false; 20_000];
        let beside: Vec<bool> = (0..20_000).map(|i| i % 200 < 10).collect();
        let camera = camera();
        assert!(
            refused(ObservedPicture { camera, color: &color[1..], mask: None }).contains("19999")
        );
        assert!(
            refused(ObservedPicture { camera, color: &color, mask: Some(&none) }).contains("none")
        );
        assert!(
            refused(ObservedPicture { camera, color: &color, mask: Some(&beside) })
                .contains("none of it")
        );
    }

    #[test]
    fn a_similarity_leaves_each_pixel_where_it_is() {
        let turn = semfm_geom::math::DQuat::from_rotation_y(0.4);
        let (shift, scale, p) = (DVec3::new(0.1, -0.2, 2.0), 0.05, DVec3::new(3.0, 1.0, -2.0));
        let own = camera().posed(DAffine3::IDENTITY).unwrap();
        let seen = own.project(scale * (turn * p) + shift);
        let posed = camera_before_mesh(&own, turn, shift, scale).unwrap().project(p);
        assert!((seen.u - posed.u).abs() < 1e-9 && (seen.z - scale * posed.z).abs() < 1e-12);
    }
}
