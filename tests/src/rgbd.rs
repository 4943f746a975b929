//! Frames of a depth camera, rendered: for tests from pictures to answers.

use std::path::Path;

use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};
use semfm::align::DepthImage;
use semfm::geom::math::{DAffine3, DMat3, DVec3};
use semfm::geom::{Intrinsics, Mesh, Pinhole};
use semfm::observe::Observation;
use semfm::views::{RenderSettings, SurfaceColor, View, render};
use semfm::{Region, Task};
use semfm_synth::{Category, ObjectSettings, SynthObject, make_object};

/// Metres of an object's diagonal, in this module's frames.
const DIAGONAL: f64 = 0.25;
/// Metres from the camera to its middle.
const DISTANCE: f64 = 0.6;

/// A small procedural container: instance 0 is a mug, instance 1 a kettle.
///
/// # Panics
/// Never, unless the maker of objects is broken.
pub fn container(instance: usize) -> SynthObject {
    let settings = ObjectSettings { n_vertices: 2500, ..Default::default() };
    make_object(Category::Containers, instance, &settings).expect("a container")
}

/// An object before a wall, seen from a direction of its own frame, and where it then is.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The object in the camera's frame, metres.
    pub mesh: Mesh,
    /// Its pose and the camera's numbers (640 × 480).
    pub camera: Pinhole,
    /// What is seen of it.
    pub view: View,
    /// The camera before the object in metres, whose middle is the origin.
    pub camera_from_object: DAffine3,
}

impl Frame {
    /// Renders it.
    ///
    /// # Panics
    /// For a direction of no length.
    pub fn new(object: &Mesh, from: DVec3) -> Self {
        let z = -from.normalize();
        let x = z.any_orthonormal_vector();
        let turn = DMat3::from_cols(x, z.cross(x), z).transpose();
        let (low, high) = object.bounds();
        let scale = DIAGONAL / object.diagonal();
        let place = |p: &DVec3| turn * (scale * (*p - (low + high) / 2.0)) + DISTANCE * DVec3::Z;
        let vertices = object.vertices().iter().map(place).collect();
        let mesh = Mesh::new(vertices, object.faces().to_vec()).expect("a moved mesh");
        let intrinsics =
            Intrinsics { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY);
        let camera = camera.expect("a camera");
        let settings = RenderSettings { supersampling: 1, ..Default::default() };
        let task = Task::default();
        let views = render(&mesh, &SurfaceColor::GREY, &[camera], &settings, &task);
        let view = views.expect("a view").remove(0);
        let camera_from_object = DAffine3::from_mat3_translation(turn, DISTANCE * DVec3::Z);
        Self { mesh, camera, view, camera_from_object }
    }

    /// What the camera saw, a wall at 1 m included, with a mask of the object; the camera's pose is told in the frame of the
    /// object.
    ///
    /// # Panics
    /// Never, unless the view has another size than its camera.
    pub fn observation(&self) -> Observation {
        let is_object: Vec<bool> = self.view.triangles.iter().map(|&face| face >= 0).collect();
        let depth = self.view.depth.iter().zip(&is_object);
        let depth = depth.map(|(&z, &is_object)| if is_object { z } else { 1.0 }).collect();
        let (pixels, _) = self.view.rgb.as_chunks::<3>();
        Observation::new(self.camera)
            .posed(self.camera_from_object)
            .and_then(|seen| seen.with_color(pixels.to_vec()))
            .and_then(|seen| seen.with_depth(DepthImage::new(640, 480, depth)?))
            .and_then(|seen| seen.with_mask("object", is_object))
            .expect("an observation")
    }

    /// Writes `c.png`, `d.png` (16 bits, millimetres; a wall at 1 m), `m.png` and `K.json` into a folder.
    ///
    /// # Panics
    /// Where they cannot be written.
    pub fn write(&self, folder: &Path) {
        std::fs::create_dir_all(folder).expect("a folder");
        let at = |x: u32, y: u32| (y * 640 + x) as usize;
        let is_object = |x: u32, y: u32| self.view.triangles[at(x, y)] >= 0;
        let color = |x: u32, y: u32| {
            let rgb = [0, 1, 2].map(|c| self.view.rgb[3 * at(x, y) + c]);
            Rgb(if is_object(x, y) { rgb } else { [90, 60, (x / 3) as u8] })
        };
        RgbImage::from_fn(640, 480, color).save(folder.join("c.png")).expect("a picture");
        let millimetres = |x: u32, y: u32| match is_object(x, y) {
            true => Luma([(1e3 * self.view.depth[at(x, y)]).round() as u16]),
            false => Luma([1000]),
        };
        let depth: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_fn(640, 480, millimetres);
        depth.save(folder.join("d.png")).expect("a depth image");
        let mask = |x: u32, y: u32| Luma([if is_object(x, y) { 255 } else { 0 }]);
        GrayImage::from_fn(640, 480, mask).save(folder.join("m.png")).expect("a mask");
        let k = r#"{"fx": 600, "fy": 600, "cx": 319.5, "cy": 239.5}"#;
        std::fs::write(folder.join("K.json"), k).expect("intrinsics");
    }

    /// Which vertices of another mesh in the camera's frame are nearest to a region of the object.
    pub fn region_on(&self, region: &[bool], mesh: &Mesh) -> Vec<bool> {
        let index = semfm::geom::PointIndex::new(self.mesh.vertices()).expect("points");
        mesh.vertices().iter().map(|&p| region[index.nearest(p).0]).collect()
    }
}

/// Intersection over union, in vertices.
pub fn iou(found: &Region, truth: &[bool]) -> f64 {
    let inside: Vec<bool> = found.weights().iter().map(|&w| w >= 0.5).collect();
    let count = |both: fn(bool, bool) -> bool| {
        inside.iter().zip(truth).filter(|(a, b)| both(**a, **b)).count() as f64
    };
    count(|a, b| a && b) / count(|a, b| a || b).max(1.0)
}
