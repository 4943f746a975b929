//! An observation out of single files.

use std::path::{Path, PathBuf};

use semfm_geom::io::FormatError;
use semfm_geom::math::DAffine3;

use crate::depth_image::read_depth_image;
use crate::intrinsics::read_calibration;
use crate::mask::{MaskedPicture, read_labelled_mask, read_mask};
use crate::observation::Observation;
use crate::picture::read_picture;
use crate::{Error, Result};

/// The files of one observation. Colour, depth and masks share one grid of pixels: depth that has its own must be
/// registered to the colour first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObservationFiles {
    /// A PNG, JPEG or EXR.
    pub color: Option<PathBuf>,
    /// A grey PNG of 16 bits, an EXR, or an array ([`read_depth_image`]).
    pub depth: Option<PathBuf>,
    /// Units of the depth to the metre; 1000 for whole numbers and 1 for floats where none is given.
    pub depth_scale: Option<f64>,
    /// The camera ([`read_calibration`]).
    pub calibration: PathBuf,
    /// What the pixels show.
    pub masks: Vec<MaskFile>,
    /// Where the camera stood; its own frame is the world where none is given.
    pub camera_from_world: Option<DAffine3>,
}

/// A mask's file ([`read_mask`]), or one label in a picture of labels ([`read_labelled_mask`]).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskFile {
    /// The file.
    pub path: PathBuf,
    /// The label that marks, in a picture of labels.
    pub label: Option<u32>,
    /// What the mask is called, where it is not as its file is.
    pub called: Option<String>,
}

impl MaskFile {
    /// `FILE`, or `FILE#LABEL`.
    pub fn parse(text: &str) -> Self {
        let of = |path: &str, label| Self { path: path.into(), label, called: None };
        match text.rsplit_once('#') {
            Some((path, label)) if !path.is_empty() && label.parse::<u32>().is_ok() => {
                of(path, label.parse().ok())
            }
            _ => of(text, None),
        }
    }

    /// The same, under another name than its file's.
    pub fn named(self, name: impl Into<String>) -> Self {
        Self { called: Some(name.into()), ..self }
    }

    /// Reads it.
    ///
    /// # Errors
    /// As [`read_mask`] and [`read_labelled_mask`].
    pub fn read(&self, of: MaskedPicture) -> Result<Vec<bool>> {
        match self.label {
            Some(label) => read_labelled_mask(&self.path, of, label),
            None => read_mask(&self.path, of),
        }
    }

    /// What it is called: its file's name without extension, and the label, where no other name was given.
    pub fn name(&self) -> String {
        if let Some(name) = &self.called {
            return name.clone();
        }
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        self.label.map_or_else(|| stem.to_string(), |label| format!("{stem}#{label}"))
    }
}

impl ObservationFiles {
    /// The files, for messages and for what must not be replaced.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        let pictures = [&self.color, &self.depth].into_iter().filter_map(|path| path.as_deref());
        pictures
            .chain([self.calibration.as_path()])
            .chain(self.masks.iter().map(|m| m.path.as_path()))
    }

    /// Reads the observation; pictures of a lens that distorts come out without distortion.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is neither colour nor depth; [`Error::Format`] with the file at fault, sizes that
    /// differ among them.
    pub fn read(&self) -> Result<Observation> {
        let depth = self.depth.as_deref().map(|path| read_depth_image(path, self.depth_scale));
        let depth = depth.transpose()?;
        let color = self.color.as_deref().map(read_picture).transpose()?;
        let color = color.map(image::DynamicImage::into_rgb8);
        let (width, height) = match (&depth, &color) {
            (Some(depth), _) => (depth.width() as u32, depth.height() as u32),
            (None, Some(color)) => color.dimensions(),
            (None, None) => {
                return Err(Error::invalid("observation", "colour or depth", "neither"));
            }
        };
        let calibration = read_calibration(&self.calibration, width, height)?;
        let mut seen = Observation::new(calibration.camera);
        if let (Some(color), Some(path)) = (color, &self.color) {
            if color.dimensions() != (width, height) {
                let expected = format!(
                    "{width} × {height}, as the depth image (which must be registered to the colour)"
                );
                let found = format!("{} × {}", color.width(), color.height());
                return Err(FormatError::new(path, "size", expected, found).into());
            }
            seen = seen.with_color(color.pixels().map(|pixel| pixel.0).collect())?;
        }
        let name = if depth.is_some() { "the depth image" } else { "the colour picture" };
        if let Some(depth) = depth {
            seen = seen.with_depth(depth)?;
        }
        for mask in &self.masks {
            let marked = mask.read(MaskedPicture { width, height, name })?;
            seen = seen.with_mask(mask.name(), marked)?;
        }
        if let Some(lens) = &calibration.distortion {
            seen = seen.undistorted(lens)?;
        }
        match self.camera_from_world {
            Some(pose) => seen.posed(pose),
            None => Ok(seen),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_become_one_observation_and_sizes_that_differ_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        image::RgbImage::from_fn(4, 3, |x, y| image::Rgb([x as u8, y as u8, 9]))
            .save(at("c.png"))
            .unwrap();
        let depth = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(4, 3, |x, y| {
            image::Luma([if x == 0 { 65535 } else { 500 + y as u16 }])
        });
        depth.save(at("d.png")).unwrap();
        let labels: Vec<u8> = (0..12).map(|i| [0, 1, 1, 5][i % 4]).collect();
        image::GrayImage::from_raw(4, 3, labels).unwrap().save(at("ids.png")).unwrap();
        std::fs::write(at("K.json"), r#"{"fx": 50, "fy": 50, "cx": 1.5, "cy": 1}"#).unwrap();
        let mask = MaskFile::parse(&format!("{}#5", at("ids.png").display()));
        assert_eq!((mask.name().as_str(), mask.label), ("ids#5", Some(5)));
        assert_eq!(mask.clone().named("cup").name(), "cup");
        let files = ObservationFiles {
            color: Some(at("c.png")),
            depth: Some(at("d.png")),
            calibration: at("K.json"),
            masks: vec![mask],
            camera_from_world: Some(DAffine3::from_translation(semfm_geom::math::DVec3::X)),
            ..Default::default()
        };
        let seen = files.read().unwrap();
        assert_eq!(seen.color().unwrap()[5], [1, 1, 9]);
        assert_eq!(seen.points(seen.mask("ids#5").ok()).unwrap().object.len(), 3);
        assert_eq!(seen.points(None).unwrap().object.len(), 9, "65535 is no return");
        assert_eq!(seen.camera().eye(), -semfm_geom::math::DVec3::X);
        image::RgbImage::new(5, 3).save(at("wide.png")).unwrap();
        let wide = ObservationFiles { color: Some(at("wide.png")), ..files.clone() };
        let error = wide.read().unwrap_err().to_string();
        assert!(error.contains("wide.png") && error.contains("5 × 3"), "{error}");
        let none = ObservationFiles { calibration: at("K.json"), ..Default::default() };
        assert!(none.read().unwrap_err().to_string().contains("neither"));
    }

    #[test]
    fn a_lens_is_taken_out() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let depth = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_pixel(
            64,
            48,
            image::Luma([700]),
        );
        depth.save(at("d.png")).unwrap();
        let k = r#"{"fx": 40, "fy": 40, "cx": 31.5, "cy": 23.5, "D": [0.3, 0, 0, 0, 0]}"#;
        std::fs::write(at("K.json"), k).unwrap();
        let files = ObservationFiles {
            depth: Some(at("d.png")),
            calibration: at("K.json"),
            ..Default::default()
        };
        let seen = files.read().unwrap();
        // A lens with k1 > 0 shows less of the world: the corners come from outside of the picture.
        let depth = seen.depth().unwrap();
        assert_eq!((depth.metres()[0], depth.metres()[24 * 64 + 32]), (0.0, 0.7));
    }
}
