//! Writing a scene.

use std::borrow::Borrow;
use std::path::{Path, PathBuf};

use image::{GrayImage, ImageBuffer, Luma, RgbImage};
use semfm_geom::io::{FormatError, StagedFolder, write_atomically, write_json};

use super::records::{CameraRecord, ObjectRecord, SceneCameras, SceneObjects, rows_and_mm};
use crate::observation::{Mask, Observation};
use crate::{Error, Result};

/// Millimetres of one unit of depth, as it is written: 6.5 m in tenths of a millimetre; what is farther away is written
/// in millimetres.
const FINE: f64 = 0.1;
const FINE_REACHES: f32 = 6.5;
const COARSE: f64 = 1.0;
const COARSE_REACHES: f32 = 65.5;

/// Writes a scene of observations, numbered from 0, whole or not at all; returns its files. A mask that belongs to no
/// object is written as one of an object 0 in the camera's own pose, so that no pixel is lost; clouds are not written.
///
/// # Errors
/// [`Error::Invalid`] for no observation, for one with a cloud alone and for depths beyond 65 m; [`Error::Geom`] where the
/// folder cannot be written, holds something already, or is one of the files that were read.
pub fn write_bop<O: Borrow<Observation>>(
    folder: &Path,
    observations: &[O],
) -> Result<Vec<PathBuf>> {
    if observations.is_empty() {
        return Err(Error::invalid("observations", "at least one", "none"));
    }
    if std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()) {
        let expected = "a folder that is empty or not there yet";
        return Err(FormatError::new(folder, "folder", expected, "one with files in it").into());
    }
    let staged = StagedFolder::new(folder)?;
    let (mut cameras, mut objects) = (SceneCameras::new(), SceneObjects::new());
    for (image, seen) in observations.iter().map(Borrow::borrow).enumerate() {
        if seen.color().is_none() && seen.depth().is_none() {
            let what = format!("observation {image}");
            return Err(Error::invalid(what, "colour or depth: BOP has no clouds", "neither"));
        }
        let depth_scale = write_pictures(staged.path(), image, seen)?;
        let camera = seen.camera();
        let (rotation, shift_mm) = rows_and_mm(&camera.camera_from_world());
        let (cx, cy) = (camera.cx() - 0.5, camera.cy() - 0.5);
        let record = CameraRecord {
            k: [camera.fx(), 0.0, cx, 0.0, camera.fy(), cy, 0.0, 0.0, 1.0],
            depth_scale,
            camera_from_world_rotation: Some(rotation),
            camera_from_world_mm: Some(shift_mm),
            time_nanos: seen.time_nanos,
        };
        cameras.insert(image.to_string(), record);
        objects.insert(image.to_string(), write_objects(staged.path(), image, seen)?);
    }
    write_json(staged.path().join("scene_gt.json"), &objects)?;
    write_json(staged.path().join("scene_camera.json"), &cameras)?;
    Ok(staged.put(&["scene_camera.json"], &[])?)
}

/// Colour and depth; returns what one unit of depth is.
fn write_pictures(folder: &Path, image: usize, seen: &Observation) -> Result<Option<f64>> {
    let (width, height) = (seen.camera().width(), seen.camera().height());
    if let Some(color) = seen.color() {
        let picture = RgbImage::from_raw(width, height, color.as_flattened().to_vec());
        let picture = picture.expect("an observation has its camera's size");
        write_png(&folder.join(format!("rgb/{image:06}.png")), &picture.into())?;
    }
    let Some(depth) = seen.depth() else { return Ok(None) };
    let farthest = depth.metres().iter().copied().fold(0.0, f32::max);
    if farthest > COARSE_REACHES {
        let what = format!("depth of observation {image}");
        return Err(Error::invalid(what, format!("at most {COARSE_REACHES} m"), farthest));
    }
    let unit = if farthest <= FINE_REACHES { FINE } else { COARSE };
    let count = |&z: &f32| (f64::from(z) * super::MM / unit).round() as u16;
    let picture: Option<ImageBuffer<Luma<u16>, _>> = ImageBuffer::from_raw(
        width,
        height,
        depth.metres().iter().map(count).collect::<Vec<u16>>(),
    );
    let picture = picture.expect("an observation has its camera's size");
    write_png(&folder.join(format!("depth/{image:06}.png")), &picture.into())?;
    Ok(Some(unit))
}

fn write_objects(folder: &Path, image: usize, seen: &Observation) -> Result<Vec<ObjectRecord>> {
    let mut records = Vec::new();
    let mut write =
        |id: u32, pose: &semfm_geom::math::DAffine3, mask: Option<&Mask>| -> Result<()> {
            if let Some(mask) = mask {
                let (width, height) = (seen.camera().width(), seen.camera().height());
                let values =
                    mask.marked.iter().map(|&marked| if marked { 255 } else { 0 }).collect();
                let picture = GrayImage::from_raw(width, height, values);
                let picture = picture.expect("an observation has its camera's size");
                let name = format!("mask_visib/{image:06}_{:06}.png", records.len());
                write_png(&folder.join(name), &picture.into())?;
            }
            let (camera_from_object_rotation, camera_from_object_mm) = rows_and_mm(pose);
            records.push(ObjectRecord {
                camera_from_object_rotation,
                camera_from_object_mm,
                obj_id: id,
            });
            Ok(())
        };
    for object in seen.objects() {
        let mask = object.mask.map(|mask| &seen.masks()[mask]);
        write(object.id, &object.camera_from_object, mask)?;
    }
    for (index, mask) in seen.masks().iter().enumerate() {
        if seen.objects().iter().all(|object| object.mask != Some(index)) {
            write(0, &semfm_geom::math::DAffine3::IDENTITY, Some(mask))?;
        }
    }
    Ok(records)
}

fn write_png(path: &Path, picture: &image::DynamicImage) -> Result<()> {
    Ok(write_atomically(path, |out| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let written = picture.write_to(&mut bytes, image::ImageFormat::Png);
        written.map_err(std::io::Error::other)?;
        out.write_all(bytes.get_ref())
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bop::BopScene;
    use crate::observation::SeenObject;
    use semfm_align::DepthImage;
    use semfm_geom::math::{DAffine3, DMat3, DVec3};
    use semfm_geom::{Intrinsics, Pinhole};

    fn seen(time: u64) -> Observation {
        let intrinsics = Intrinsics { width: 3, height: 2, fx: 20.0, fy: 21.0, cx: 1.5, cy: 1.25 };
        let pose =
            DAffine3::from_mat3_translation(DMat3::from_rotation_y(0.3), DVec3::new(0.1, 0.0, 0.5));
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap();
        let depth = DepthImage::new(3, 2, vec![0.5, 0.0, 0.1234, 1.0, 2.0, 6.0]).unwrap();
        let cup = SeenObject { id: 5, camera_from_object: pose.inverse(), mask: Some(0) };
        let mut seen = Observation::new(camera)
            .with_color((0..6).map(|i| [i, 2 * i, 255 - i]).collect())
            .and_then(|s| s.with_depth(depth))
            .and_then(|s| s.with_mask("obj5", vec![true, false, false, true, false, false]))
            .and_then(|s| s.with_object(cup))
            .and_then(|s| s.with_object(SeenObject { id: 5, mask: None, ..cup }))
            .unwrap();
        seen.time_nanos = Some(time);
        seen
    }

    fn near(a: &DAffine3, b: &DAffine3) -> bool {
        a.abs_diff_eq(*b, 1e-9)
    }

    #[test]
    fn what_is_written_is_read_back() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("000001");
        let written: Vec<Observation> = (0..11).map(|time| seen(time * 100)).collect();
        write_bop(&folder, &written).unwrap();
        let scene = BopScene::open(&folder).unwrap();
        assert_eq!(scene.images().collect::<Vec<u32>>(), (0..11).collect::<Vec<u32>>());
        let (read, given) = (scene.observation(10).unwrap(), &written[10]);
        assert_eq!(
            (read.color(), read.masks(), read.time_nanos),
            (given.color(), given.masks(), Some(1000))
        );
        assert_eq!(read.depth().unwrap().metres(), given.depth().unwrap().metres());
        assert!(near(&read.camera().camera_from_world(), &given.camera().camera_from_world()));
        assert_eq!((read.camera().fx(), read.camera().cy()), (20.0, 1.25));
        assert_eq!(read.objects().len(), 2);
        assert_eq!((read.objects()[0].mask, read.objects()[1].mask), (Some(0), None));
        assert!(near(
            &read.objects()[0].camera_from_object,
            &given.objects()[0].camera_from_object
        ));
        let words = |result: Result<Observation>| result.unwrap_err().to_string();
        assert!(words(scene.observation(11)).contains("0 to 10"));
        assert!(write_bop(&folder, &written).unwrap_err().to_string().contains("empty"));
        let error = BopScene::open(parent.path()).unwrap_err().to_string();
        assert!(error.contains("000001"), "{error}");
    }

    #[test]
    fn damaged_scenes_are_refused_with_their_place() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("s");
        write_bop(&folder, &[seen(0)]).unwrap();
        let gt = folder.join("scene_gt.json");
        let text = std::fs::read_to_string(&gt).unwrap();
        let broken = |from: &str, to: &str| {
            std::fs::write(&gt, text.replace(from, to)).unwrap();
            let scene = BopScene::open(&folder).and_then(|scene| scene.observation(0));
            scene.unwrap_err().to_string()
        };
        assert!(broken("\"0\":", "\"7\":").contains("7"));
        assert!(broken("\"0\":", "\"first\":").contains("first"));
        assert!(broken("\"cam_R_m2c\":[", "\"cam_R_m2c\":[9,").contains("scene_gt.json"));
        std::fs::write(&gt, &text).unwrap();
        std::fs::write(
            folder.join("depth/000000.png"),
            "version https://git-lfs.github.com/spec/v1\n",
        )
        .unwrap();
        let error = BopScene::open(&folder).unwrap().observation(0).unwrap_err().to_string();
        assert!(error.contains("git lfs pull"), "{error}");
    }
}
