//! Pictures of a demonstration: a hand on an object, and another object of its kind, each on a table before a depth camera.

use std::path::{Path, PathBuf};

use semfm_geom::io::{write_json, write_mesh};
use semfm_geom::math::{DAffine3, DMat3, DVec3, bounds};
use semfm_geom::{Intrinsics, Mesh, Pinhole, Task};

use crate::hand::close_hand;
use crate::rgbd::{Body, RgbdPicture};
use crate::{Result, SynthObject};

/// Colours of the demonstrated object, the target, the hand and the table.
const SOURCE: [f32; 3] = [0.30, 0.47, 0.66];
const TARGET: [f32; 3] = [0.62, 0.36, 0.30];
const SKIN: [f32; 3] = [0.88, 0.68, 0.55];
const TABLE: [f32; 3] = [0.72, 0.66, 0.56];
/// Half of the table's side, and how far its top lies below what stands on it, metres.
const TABLE_REACH: f64 = 0.35;
const TABLE_TOP: f64 = -0.002;
/// The camera: pixels, and focal length in pixels; how far it is from the object, metres.
const SIZE: [u32; 2] = [640, 480];
const FOCAL: f64 = 620.0;
const DISTANCE: f64 = 0.55;
/// Height of the camera above the object, and how far it stands to the side of where the hand comes from, degrees.
const ELEVATION: f64 = 32.0;
const BESIDE_HAND: f64 = 75.0;

/// An object as it stands in a world with z up.
#[derive(Clone, Copy, Debug)]
pub struct StandingObject<'a> {
    /// The object.
    pub object: &'a SynthObject,
    /// Metres per unit of its mesh.
    pub scale: f64,
    /// Where it stands, scaled to metres.
    pub world_from_object: DAffine3,
}

/// The pictures of a demonstration and of a target, in files.
#[derive(Clone, Debug)]
pub struct DemonstrationPictures {
    /// `color.png`, `depth.png` (millimetres), `object.png` and `hand.png` (masks), `K.json`, and `hand.obj`, the hand in
    /// the camera's frame, metres.
    pub demonstration: PathBuf,
    /// `color.png`, `depth.png`, `object.png`, `K.json`, and `base_from_camera.json`, the camera in the world.
    pub target: PathBuf,
    /// Fingers that touch the demonstrated object.
    pub n_touching: usize,
}

impl StandingObject<'_> {
    /// The mesh in the world, metres.
    fn mesh(&self) -> Result<Mesh> {
        let place = |&p: &DVec3| self.world_from_object.transform_point3(self.scale * p);
        let points = self.object.mesh.vertices().iter().map(place).collect();
        Ok(Mesh::new(points, self.object.mesh.faces().to_vec())?)
    }
}

/// Writes the pictures into the folders `demonstration` and `target` within `folder`. A hand of capsules holds the source
/// where its true grip is; `None`, and nothing is written, where it finds no hold there.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) and [`Error::Views`](crate::Error::Views) where a file cannot be made.
pub fn write_demonstration_pictures(
    folder: &Path,
    source: &StandingObject<'_>,
    target: &StandingObject<'_>,
    task: &Task,
) -> Result<Option<DemonstrationPictures>> {
    let source_mesh = source.mesh()?;
    let Some(hand) = close_hand(&source_mesh, &source.object.region)? else { return Ok(None) };
    let files = DemonstrationPictures {
        demonstration: folder.join("demonstration"),
        target: folder.join("target"),
        n_touching: hand.n_touching,
    };
    // Beside the hand, so that it hides little of the object.
    let side = hand.back.y.atan2(hand.back.x) - BESIDE_HAND.to_radians();
    let camera = camera_on(&source_mesh, side)?;
    let table = table_below(&source_mesh)?;
    let bodies = [
        Body { mesh: &source_mesh, color: SOURCE },
        Body { mesh: &hand.mesh, color: SKIN },
        Body { mesh: &table, color: TABLE },
    ];
    let seen = RgbdPicture::take(&bodies, camera, task)?;
    write_picture(&files.demonstration, &seen)?;
    seen.write_mask(&files.demonstration.join("hand.png"), 1)?;
    let to_camera = camera.camera_from_world();
    let points = hand.mesh.vertices().iter().map(|&p| to_camera.transform_point3(p)).collect();
    let in_camera = Mesh::new(points, hand.mesh.faces().to_vec())?;
    write_mesh(files.demonstration.join("hand.obj"), &in_camera)?;

    let target_mesh = target.mesh()?;
    let camera = camera_on(&target_mesh, -100f64.to_radians())?;
    let table = table_below(&target_mesh)?;
    let bodies = [Body { mesh: &target_mesh, color: TARGET }, Body { mesh: &table, color: TABLE }];
    write_picture(&files.target, &RgbdPicture::take(&bodies, camera, task)?)?;
    let rows = rows(camera.camera_from_world().inverse());
    let pose = serde_json::json!({ "base_from_camera": rows });
    write_json(files.target.join("base_from_camera.json"), &pose)?;
    Ok(Some(files))
}

/// Colour, depth, the mask of the first body and the camera.
fn write_picture(folder: &Path, seen: &RgbdPicture) -> Result<()> {
    let io = |source| semfm_geom::Error::Io { path: folder.to_owned(), source };
    std::fs::create_dir_all(folder).map_err(io)?;
    seen.write_color(&folder.join("color.png"))?;
    seen.write_depth(&folder.join("depth.png"))?;
    seen.write_mask(&folder.join("object.png"), 0)?;
    seen.write_intrinsics(&folder.join("K.json"))
}

/// A camera that looks down at a mesh from a direction (an angle about z from x, radians).
fn camera_on(mesh: &Mesh, azimuth: f64) -> Result<Pinhole> {
    let (low, high) = bounds(mesh.vertices()).unwrap_or_default();
    let middle = (low + high) / 2.0;
    let elevation = ELEVATION.to_radians();
    let towards_eye = DVec3::new(
        elevation.cos() * azimuth.cos(),
        elevation.cos() * azimuth.sin(),
        elevation.sin(),
    );
    let forward = -towards_eye;
    let right = forward.cross(DVec3::Z).normalize();
    let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
    let eye = middle + DISTANCE * towards_eye;
    let camera_from_world = DAffine3::from_mat3_translation(rotation, -(rotation * eye));
    let [width, height] = SIZE;
    let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    let intrinsics = Intrinsics { width, height, fx: FOCAL, fy: FOCAL, cx, cy };
    Ok(Pinhole::with_pixel_centres_at_half(intrinsics, camera_from_world)?)
}

/// The square of table that a mesh stands on.
fn table_below(mesh: &Mesh) -> Result<Mesh> {
    let (low, high) = bounds(mesh.vertices()).unwrap_or_default();
    let middle = (low + high) / 2.0;
    let corner = |x: f64, y: f64| {
        DVec3::new(middle.x + x * TABLE_REACH, middle.y + y * TABLE_REACH, low.z + TABLE_TOP)
    };
    let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Ok(Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?)
}

/// A motion as rows of a matrix.
fn rows(motion: DAffine3) -> [[f64; 4]; 4] {
    let linear = motion.matrix3;
    let row =
        |i: usize| [linear.x_axis[i], linear.y_axis[i], linear.z_axis[i], motion.translation[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Category, ObjectSettings, make_object};

    #[test]
    fn the_pictures_show_the_object_the_hand_and_their_depth() {
        let folder = tempfile::tempdir().unwrap();
        let make = |i| make_object(Category::Containers, i, &ObjectSettings::default()).unwrap();
        let (mug, kettle) = (make(0), make(1));
        let standing = |object| StandingObject {
            object,
            scale: 0.25,
            world_from_object: DAffine3::from_translation(DVec3::X * 0.5),
        };
        let (source, target) = (standing(&mug), standing(&kettle));
        let made = write_demonstration_pictures(folder.path(), &source, &target, &Task::default());
        let made = made.unwrap().unwrap();
        let open = |name: &str| image::open(made.demonstration.join(name)).unwrap();
        let depth = open("depth.png").into_luma16();
        for name in ["object.png", "hand.png"] {
            let mask = open(name).into_luma8();
            let marked = mask.pixels().zip(depth.pixels()).filter(|(mask, _)| mask.0[0] > 0);
            let depths: Vec<u16> = marked.map(|(_, depth)| depth.0[0]).collect();
            assert!(depths.len() > 2000, "{name}: {} pixels", depths.len());
            assert!(depths.iter().all(|mm| (350..750).contains(mm)), "{name}");
        }
        assert!(made.target.join("base_from_camera.json").is_file());
        // The hand lies where its mask is: its mean projects into it.
        let hand = semfm_geom::io::read_mesh(made.demonstration.join("hand.obj")).unwrap().mesh;
        let nearest = hand.vertices().iter().map(|p| p.z).fold(1.0, f64::min);
        let mask = open("hand.png").into_luma8();
        let marked = mask.pixels().zip(depth.pixels()).filter(|(mask, _)| mask.0[0] > 0);
        let seen = marked.map(|(_, depth)| depth.0[0]).min().unwrap();
        assert!((f64::from(seen) / 1e3 - nearest).abs() < 0.004, "{seen} mm, {nearest} m");
    }
}
