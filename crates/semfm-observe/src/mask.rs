//! Masks: pictures that are bright, or opaque, where something is; arrays; run lengths; labels.

use std::path::Path;

use image::DynamicImage;
use semfm_geom::io::{FormatError, read_json};

use crate::numpy_array::NumpyArray;
use crate::picture::read_picture;
use crate::{Result, coco_rle};

/// The picture that a mask belongs to: they must be of one size.
#[derive(Clone, Copy, Debug)]
pub struct MaskedPicture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// What it is, for messages: "the depth image".
    pub name: &'static str,
}

/// A pixel is marked from this value on.
const MARKED: u8 = 128;

/// Reads the mask of a picture (height × width, row-major), in the form that the file's name and contents show:
///
/// * a PNG or JPEG: true where it is opaque, if its alpha channel is not the same everywhere, else where it is bright.
///   Half of the range is enough for both;
/// * a NumPy array (`.npy`) of truth values, or of numbers, which mark where they are not 0: (height, width), or with
///   one axis of length 1 before or behind;
/// * COCO's run lengths (`.json`), plain or packed.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) for another size and for a mask that marks nothing or
/// everything, which tells the object from nothing.
pub fn read_mask(path: &Path, of: MaskedPicture) -> Result<Vec<bool>> {
    match MaskForm::of(path) {
        MaskForm::Numpy => {
            let values = array_of(path, of)?;
            check_marks(
                path,
                values.into_iter().map(|x| x != 0.0).collect(),
                "a number that is not 0",
            )
        }
        MaskForm::Json => {
            let value = read_json(path)?;
            let marked = coco_rle::decode(path, &value, of.width as usize, of.height as usize)?;
            check_marks(path, marked, "a marked pixel")
        }
        MaskForm::Picture => read_marked_picture(path, of),
    }
}

/// Reads which pixels of a picture of labels have the label `id`: a grey PNG of 8 or 16 bits, or a NumPy array of whole
/// numbers, such as segmentations come in.
///
/// # Errors
/// As [`read_mask`]; a label that no pixel has is named together with those that there are.
pub fn read_labelled_mask(path: &Path, of: MaskedPicture, id: u32) -> Result<Vec<bool>> {
    let labels: Vec<f64> = match MaskForm::of(path) {
        MaskForm::Numpy => array_of(path, of)?,
        MaskForm::Json => {
            let expected = "a picture or an array of labels, one number a pixel";
            return Err(FormatError::new(path, "file", expected, "JSON").into());
        }
        MaskForm::Picture => {
            let picture = read_picture(path)?;
            check_size(path, of, [picture.width(), picture.height()])?;
            match picture {
                DynamicImage::ImageLuma8(p) => p.into_raw().into_iter().map(f64::from).collect(),
                DynamicImage::ImageLuma16(p) => p.into_raw().into_iter().map(f64::from).collect(),
                other => {
                    let found = format!("{:?}", other.color());
                    let expected = "grey pixels, each a label";
                    return Err(FormatError::new(path, "pixel format", expected, found).into());
                }
            }
        }
    };
    let marked: Vec<bool> = labels.iter().map(|&label| label == f64::from(id)).collect();
    if !marked.contains(&true) {
        let mut there: Vec<i64> = labels.iter().map(|&label| label as i64).collect();
        there.sort_unstable();
        there.dedup();
        let n = there.len();
        there.truncate(20);
        let further =
            if n > there.len() { format!(" and {} more", n - there.len()) } else { String::new() };
        let expected = format!("pixels with the label {id}");
        let found = format!("only {there:?}{further}");
        return Err(FormatError::new(path, "labels", expected, found).into());
    }
    check_marks(path, marked, "a pixel of the label")
}

/// Which form a mask is in.
enum MaskForm {
    Picture,
    Numpy,
    Json,
}

impl MaskForm {
    fn of(path: &Path) -> Self {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        match extension.to_ascii_lowercase().as_str() {
            "npy" => Self::Numpy,
            "json" => Self::Json,
            _ => Self::Picture,
        }
    }
}

/// An array of the picture's size.
fn array_of(path: &Path, of: MaskedPicture) -> Result<Vec<f64>> {
    let array = NumpyArray::read(path)?;
    let size = [of.height as usize, of.width as usize];
    let mut sides = array.shape.clone();
    if sides.len() == 3 && (sides[0] == 1 || sides[2] == 1) {
        sides.remove(if sides[0] == 1 { 0 } else { 2 });
    }
    if sides != size {
        let expected = format!("({}, {}), as {}", of.height, of.width, of.name);
        return Err(FormatError::new(path, "shape", expected, array.shape_in_words()).into());
    }
    Ok(array.into_f64())
}

fn check_size(path: &Path, of: MaskedPicture, size: [u32; 2]) -> Result<()> {
    let MaskedPicture { width, height, name } = of;
    if size == [width, height] {
        return Ok(());
    }
    let expected = format!("{width} × {height}, as {name}");
    Err(FormatError::new(path, "size", expected, format!("{} × {}", size[0], size[1])).into())
}

/// Refuses a mask that marks nothing or everything.
fn check_marks(path: &Path, marked: Vec<bool>, mark: &str) -> Result<Vec<bool>> {
    let n = marked.iter().filter(|&&marked| marked).count();
    let (expected, found) = if n == 0 {
        (format!("at least {mark}"), "none: nothing is marked".to_owned())
    } else if n == marked.len() {
        let found = "every pixel marked (leave the mask away if the picture shows nothing else)";
        ("a mask of the object only".to_owned(), found.to_owned())
    } else {
        return Ok(marked);
    };
    Err(FormatError::new(path, "pixels", expected, found).into())
}

fn read_marked_picture(path: &Path, of: MaskedPicture) -> Result<Vec<bool>> {
    let picture = read_picture(path)?;
    check_size(path, of, [picture.width(), picture.height()])?;
    let (values, marking) = match alpha(&picture) {
        Some(alpha) => (alpha, "opaque"),
        None => (picture.into_luma8().into_raw(), "bright"),
    };
    let marked: Vec<bool> = values.iter().map(|&value| value >= MARKED).collect();
    if !marked.contains(&true) {
        let most = values.iter().max().copied().unwrap_or_default();
        let expected = format!("at least one {marking} pixel ({MARKED} and more of 255)");
        let mut found = format!("{most} at most: nothing is marked");
        if marking == "bright" && most > 0 {
            found += " (a picture of labels? then name one of them)";
        }
        return Err(FormatError::new(path, "pixels", expected, found).into());
    }
    check_marks(path, marked, &format!("one {marking} pixel"))
}

/// The alpha channel, where there is one that tells anything: opaque all over, it was only carried
/// along.
fn alpha(picture: &DynamicImage) -> Option<Vec<u8>> {
    if !picture.color().has_alpha() {
        return None;
    }
    let alpha: Vec<u8> = picture.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect();
    alpha.iter().any(|&a| a < u8::MAX).then_some(alpha)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::npz::testing::npy;

    #[test]
    fn bright_pixels_are_marked_and_other_sizes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        image::GrayImage::from_raw(2, 1, vec![255, 0]).unwrap().save(at("mask.png")).unwrap();
        image::GrayImage::new(3, 1).save(at("wide.png")).unwrap();
        image::RgbImage::new(2, 1).save(at("dark.png")).unwrap();
        let read = |name: &str| {
            read_mask(&at(name), MaskedPicture { width: 2, height: 1, name: "the depth image" })
        };
        assert_eq!(read("mask.png").unwrap(), [true, false]);
        assert!(read("wide.png").unwrap_err().to_string().contains("3 × 1"));
        assert!(read("dark.png").unwrap_err().to_string().contains("bright"));
    }

    #[test]
    fn an_alpha_channel_marks_the_object_whatever_the_colours_are() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let read = |name: &str, pixels: [[u8; 4]; 3]| {
            let pixels = pixels.concat();
            image::RgbaImage::from_raw(3, 1, pixels).unwrap().save(at(name)).unwrap();
            read_mask(&at(name), MaskedPicture { width: 3, height: 1, name: "the view" })
        };
        let [white, black, clear] = [[255; 4], [0, 0, 0, 255], [255, 255, 255, 0]];
        assert_eq!(read("cut.png", [white, clear, clear]).unwrap(), [true, false, false]);
        assert_eq!(read("dark.png", [black, clear, black]).unwrap(), [true, false, true]);
        // Opaque all over: the brightness tells.
        assert_eq!(read("grey.png", [black, white, black]).unwrap(), [false, true, false]);
        for (name, pixels, word) in [
            ("none.png", [clear; 3], "nothing is marked"),
            ("all.png", [white; 3], "every pixel marked"),
            ("black.png", [black; 3], "nothing is marked"),
        ] {
            let error = read(name, pixels).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains(name), "{error}");
        }
        // Grey with alpha, sixteen bits.
        let image = image::ImageBuffer::<image::LumaA<u16>, _>::from_raw(
            3,
            1,
            vec![9u16, 65535, 9, 0, 9, 40000],
        );
        image.unwrap().save(at("deep.png")).unwrap();
        let of = MaskedPicture { width: 3, height: 1, name: "the view" };
        assert_eq!(read_mask(&at("deep.png"), of).unwrap(), [true, false, true]);
    }

    #[test]
    fn arrays_and_run_lengths_mark_what_a_picture_marks() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let of = MaskedPicture { width: 2, height: 3, name: "the view" };
        let truths = [true, false, false, true, false, false];
        std::fs::write(at("a.npy"), npy(&[3, 2], &truths)).unwrap();
        std::fs::write(at("b.npy"), npy(&[1, 3, 2], &truths.map(f32::from))).unwrap();
        std::fs::write(at("c.json"), r#"{"size": [3, 2], "counts": [0, 1, 3, 1, 1]}"#).unwrap();
        for name in ["a.npy", "b.npy", "c.json"] {
            assert_eq!(read_mask(&at(name), of).unwrap(), truths, "{name}");
        }
        std::fs::write(at("turned.npy"), npy(&[2, 3], &truths)).unwrap();
        std::fs::write(at("all.npy"), npy(&[3, 2], &[true; 6])).unwrap();
        std::fs::write(at("none.json"), r#"{"size": [3, 2], "counts": [6]}"#).unwrap();
        for (name, word) in [
            ("turned.npy", "(2, 3)"),
            ("all.npy", "every pixel"),
            ("none.json", "nothing is marked"),
        ] {
            let error = read_mask(&at(name), of).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains(name), "{error}");
        }
    }

    #[test]
    fn one_label_of_many_is_picked() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let of = MaskedPicture { width: 3, height: 1, name: "the view" };
        image::GrayImage::from_raw(3, 1, vec![0, 2, 7]).unwrap().save(at("ids.png")).unwrap();
        std::fs::write(at("ids.npy"), npy(&[1, 3], &[0u16, 2, 7])).unwrap();
        for name in ["ids.png", "ids.npy"] {
            assert_eq!(read_labelled_mask(&at(name), of, 2).unwrap(), [false, true, false]);
            let error = read_labelled_mask(&at(name), of, 3).unwrap_err().to_string();
            assert!(error.contains("[0, 2, 7]"), "{error}");
        }
        assert!(read_mask(&at("ids.png"), of).unwrap_err().to_string().contains("labels?"));
    }
}
