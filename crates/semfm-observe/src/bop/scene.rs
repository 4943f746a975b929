//! Reading a scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use semfm_geom::io::{FormatError, read_json};
use semfm_geom::math::DAffine3;

use super::MM;
use super::records::{CameraRecord, ObjectRecord, SceneCameras, SceneObjects, motion};
use crate::depth_image::read_depth_of_frame;
use crate::intrinsics::calibration_of;
use crate::mask::MaskedPicture;
use crate::observation::{Observation, SeenObject};
use crate::picture::read_picture;
use crate::{Error, Result, read_mask};

/// A folder of images with their cameras and, where they were labelled, their objects.
#[derive(Clone, Debug)]
pub struct BopScene {
    folder: PathBuf,
    cameras: BTreeMap<u32, CameraRecord>,
    objects: BTreeMap<u32, Vec<ObjectRecord>>,
}

impl BopScene {
    /// Opens a scene; pictures are read when they are asked for.
    ///
    /// # Errors
    /// [`Error::Geom`] where `scene_camera.json` (or `scene_gt.json`, which may be missing) cannot be read;
    /// [`Error::Format`] for a key that is no number of an image, and for objects of an image without a camera.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join("scene_camera.json");
        if !path.exists() && has_scenes(folder) {
            let expected = "the folder of one scene";
            let found = "a folder of scenes: name one of them, such as 000001";
            return Err(FormatError::new(folder, "folder", expected, found).into());
        }
        let cameras = numbered(&path, read_json::<SceneCameras>(&path)?)?;
        if cameras.is_empty() {
            return Err(FormatError::new(&path, "file", "at least one image", "none").into());
        }
        let path = folder.join("scene_gt.json");
        let objects: SceneObjects = if path.exists() { read_json(&path)? } else { BTreeMap::new() };
        let objects = numbered(&path, objects)?;
        if let Some(image) = objects.keys().find(|image| !cameras.contains_key(image)) {
            let expected = "images that scene_camera.json names";
            return Err(
                FormatError::new(&path, image, expected, "an image without a camera").into()
            );
        }
        Ok(Self { folder: folder.to_owned(), cameras, objects })
    }

    /// Whether a folder looks like a scene.
    pub fn is_scene(folder: &Path) -> bool {
        folder.join("scene_camera.json").exists()
    }

    /// Numbers of the images, ascending.
    pub fn images(&self) -> impl Iterator<Item = u32> + '_ {
        self.cameras.keys().copied()
    }

    /// The files of an image that there are, for what must not be replaced.
    pub fn files(&self, image: u32) -> Vec<PathBuf> {
        let n_objects = self.objects.get(&image).map_or(0, Vec::len);
        let masks = (0..n_objects).map(|index| self.mask_file(image, index));
        let pictures = self.color_file(image).into_iter().chain([self.depth_file(image)]);
        pictures.chain(masks).filter(|path| path.exists()).collect()
    }

    /// Reads an image: colour and depth where there are any, the masks of what is visible of each object (named
    /// `obj5`, and `obj5#1` for a second one), and the poses. Objects of which nothing is visible have no mask, and a depth
    /// image may have no depth.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an image that the scene does not have; [`Error::Format`] with the file at fault.
    pub fn observation(&self, image: u32) -> Result<Observation> {
        let Some(record) = self.cameras.get(&image) else {
            let (first, last) = (self.cameras.keys().next(), self.cameras.keys().next_back());
            let range = first.zip(last).map_or(String::new(), |(a, b)| format!(", {a} to {b}"));
            let expected = format!("one of {} images{range}", self.cameras.len());
            return Err(Error::invalid("image", expected, image));
        };
        let path = self.folder.join("scene_camera.json");
        let depth_file = Some(self.depth_file(image)).filter(|path| path.exists());
        let depth_scale = record.depth_scale.unwrap_or(1.0);
        if !(depth_scale > 0.0 && depth_scale.is_finite()) {
            let (place, found) = (format!("{image}.depth_scale"), depth_scale.to_string());
            return Err(FormatError::new(path, place, "a positive number", found).into());
        }
        let depth = depth_file.as_deref().map(|f| read_depth_of_frame(f, Some(MM / depth_scale)));
        let depth = depth.transpose()?;
        let color = self.color_file(image).as_deref().map(read_picture).transpose()?;
        let color = color.map(image::DynamicImage::into_rgb8);
        let (width, height) = match (&depth, &color) {
            (Some(depth), _) => (depth.width() as u32, depth.height() as u32),
            (None, Some(color)) => color.dimensions(),
            (None, None) => {
                let (place, expected) =
                    (format!("image {image}"), "rgb/, gray/ or depth/ with its file");
                return Err(FormatError::new(&self.folder, place, expected, "none of them").into());
            }
        };
        let calibration =
            calibration_of(&path, &serde_json::json!({ "cam_K": record.k }), width, height)?;
        let pose = match (record.camera_from_world_rotation, record.camera_from_world_mm) {
            (Some(rows), Some(shift)) => {
                motion(&path, &format!("{image}.cam_R_w2c and cam_t_w2c"), rows, shift)?
            }
            _ => DAffine3::IDENTITY,
        };
        let mut seen = Observation::new(calibration.camera).posed(pose)?;
        seen.time_nanos = record.time_nanos;
        if let Some(color) = color {
            seen = seen.with_color(color.pixels().map(|pixel| pixel.0).collect())?;
        }
        if let Some(depth) = depth {
            seen = seen.with_depth(depth)?;
        }
        self.with_objects(image, seen, MaskedPicture { width, height, name: "the image" })
    }

    fn with_objects(
        &self,
        image: u32,
        mut seen: Observation,
        of: MaskedPicture,
    ) -> Result<Observation> {
        let path = self.folder.join("scene_gt.json");
        let none = Vec::new();
        let records = self.objects.get(&image).unwrap_or(&none);
        for (index, record) in records.iter().enumerate() {
            let place = format!("{image}[{index}]");
            let camera_from_object = motion(
                &path,
                &place,
                record.camera_from_object_rotation,
                record.camera_from_object_mm,
            )?;
            let file = self.mask_file(image, index);
            let mut mask = None;
            if file.exists() && !is_dark(&file)? {
                let before = records[..index].iter().filter(|r| r.obj_id == record.obj_id).count();
                let name = match before {
                    0 => format!("obj{}", record.obj_id),
                    n => format!("obj{}#{n}", record.obj_id),
                };
                seen = seen.with_mask(name, read_mask(&file, of)?)?;
                mask = Some(seen.masks().len() - 1);
            }
            seen = seen.with_object(SeenObject { id: record.obj_id, camera_from_object, mask })?;
        }
        Ok(seen)
    }

    fn color_file(&self, image: u32) -> Option<PathBuf> {
        let names = ["rgb", "gray"].into_iter().flat_map(|folder| {
            ["png", "jpg", "jpeg"].map(|e| self.folder.join(folder).join(format!("{image:06}.{e}")))
        });
        names.into_iter().find(|path| path.exists())
    }

    fn depth_file(&self, image: u32) -> PathBuf {
        self.folder.join("depth").join(format!("{image:06}.png"))
    }

    fn mask_file(&self, image: u32, index: usize) -> PathBuf {
        self.folder.join("mask_visib").join(format!("{image:06}_{index:06}.png"))
    }
}

/// A mask that marks nothing: the object is hidden, as BOP writes it.
fn is_dark(file: &Path) -> Result<bool> {
    Ok(read_picture(file)?.into_luma8().into_raw().iter().all(|&value| value == 0))
}

fn has_scenes(folder: &Path) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    entries.flatten().any(|entry| BopScene::is_scene(&entry.path()))
}

/// The records by number of their image.
fn numbered<T>(path: &Path, records: BTreeMap<String, T>) -> Result<BTreeMap<u32, T>> {
    let number = |(key, record): (String, T)| match key.parse::<u32>() {
        Ok(image) => Ok((image, record)),
        Err(_) => {
            Err(FormatError::new(path, "keys", "numbers of images", format!("`{key}`")).into())
        }
    };
    records.into_iter().map(number).collect()
}
