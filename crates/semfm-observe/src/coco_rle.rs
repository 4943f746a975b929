//! Masks as run lengths, in the two forms of COCO (pycocotools `maskApi.c`): counts of pixels column by column,
//! unmarked ones first, as a list of numbers or packed into text.

use std::path::Path;

use semfm_geom::io::FormatError;
use serde_json::Value;

use crate::Result;

/// What is marked (height × width, row-major) by a COCO segmentation: `{"size": [height, width], "counts": …}`, bare, or
/// the field `segmentation` of an annotation.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) for polygons, for counts that do not add up to the size, and for another
/// size than `width` × `height`.
pub(crate) fn decode(path: &Path, value: &Value, width: usize, height: usize) -> Result<Vec<bool>> {
    let fault = |place: &str, expected: &str, found: String| {
        Err(FormatError::new(path, place, expected, found).into())
    };
    let rle = value.get("segmentation").unwrap_or(value);
    if rle.is_array() {
        let expected = "run lengths: {\"size\": [height, width], \"counts\": …} (pycocotools' annToRLE \
                        makes them of polygons)";
        return fault("segmentation", expected, "a list, as of polygons or several masks".into());
    }
    let size = rle.get("size").and_then(Value::as_array);
    let size = size.map(|size| size.iter().filter_map(Value::as_u64).collect::<Vec<_>>());
    let expected = format!("[{height}, {width}] (height, then width), as the picture");
    match size.as_deref() {
        Some([h, w]) if (*h, *w) == (height as u64, width as u64) => {}
        Some(size) => return fault("size", &expected, format!("{size:?}")),
        None => return fault("size", &expected, "nothing".into()),
    }
    let n = width * height;
    let counts = match rle.get("counts") {
        Some(Value::String(text)) => packed_counts(text),
        Some(Value::Array(counts)) => counts.iter().map(Value::as_u64).collect(),
        _ => return fault("counts", "a list of numbers, or text", "nothing of the kind".into()),
    };
    let Some(counts) = counts else {
        return fault("counts", "numbers of pixels", "something else".into());
    };
    let total = counts.iter().try_fold(0u64, |sum, &count| sum.checked_add(count));
    if total != Some(n as u64) {
        let found = total.map_or("more than can be counted".into(), |total| total.to_string());
        return fault("counts", &format!("{n} pixels in all"), found);
    }
    let mut marked = vec![false; n];
    let (mut at, mut is_marked) = (0, false);
    for count in counts {
        let end = at + count as usize;
        if is_marked {
            for by_column in at..end {
                marked[by_column % height * width + by_column / height] = true;
            }
        }
        (at, is_marked) = (end, !is_marked);
    }
    Ok(marked)
}

/// The counts in COCO's text: five bits a letter from `0` on, the sixth says that more follow, and from the fourth
/// count on each is the difference to the one two before (`rleFrString`). `None` where it is no such text.
fn packed_counts(text: &str) -> Option<Vec<u64>> {
    let mut counts: Vec<u64> = Vec::new();
    let mut letters = text.bytes();
    while let Some(mut letter) = letters.next() {
        let (mut value, mut shift) = (0i64, 0);
        loop {
            let bits = letter.checked_sub(b'0').filter(|bits| *bits < 64)?;
            if shift > 55 {
                return None;
            }
            value |= i64::from(bits & 0x1f) << shift;
            shift += 5;
            if bits & 0x20 == 0 {
                if bits & 0x10 != 0 {
                    value |= -1 << shift;
                }
                break;
            }
            letter = letters.next()?;
        }
        if counts.len() > 2 {
            value = value.checked_add(*counts.get(counts.len() - 2)? as i64)?;
        }
        counts.push(u64::try_from(value).ok()?);
    }
    Some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The texts below are those of pycocotools 2.0.11: `mask.encode(np.asfortranarray(m))` and `mask.frPyObjects`.
    const WIDTH: usize = 5;
    const HEIGHT: usize = 4;

    fn mask() -> Vec<bool> {
        (0..WIDTH * HEIGHT).map(|i| (1..4).contains(&(i % WIDTH)) && i / WIDTH >= 2).collect()
    }

    #[test]
    fn lists_and_text_mark_the_same_pixels() {
        // Column by column: 6 not, 2, 2 not, 2, 2 not, 2, 4 not.
        let counts = "[6, 2, 2, 2, 2, 2, 4]";
        // Differences from the fourth count on: 6 2 2 0 0 0 2.
        for counts in [counts, "\"6220002\""] {
            let text = format!("{{\"size\": [4, 5], \"counts\": {counts}}}");
            let value = serde_json::from_str(&text).unwrap();
            assert_eq!(decode(Path::new("m.json"), &value, WIDTH, HEIGHT).unwrap(), mask());
            let nested = serde_json::json!({ "segmentation": value, "id": 3 });
            assert_eq!(decode(Path::new("m.json"), &nested, WIDTH, HEIGHT).unwrap(), mask());
        }
    }

    #[test]
    fn long_and_negative_numbers_are_unpacked() {
        // 1000 = 0b11111_01000: low five bits 8 with more to come, then 31; the sign bit of 31 needs a third letter.
        assert_eq!(packed_counts("Xo0"), Some(vec![1000]));
        // The fourth count is 5 less than the second: 10 → 5.
        assert_eq!(packed_counts("1:3K^2"), Some(vec![1, 10, 3, 5, 81]));
        assert_eq!(packed_counts("\u{7f}"), None);
        assert_eq!(packed_counts("X"), None);
        assert_eq!(packed_counts("O"), None, "less than no pixels");
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_field() {
        for (text, word) in [
            (r#"{"size": [5, 4], "counts": [20]}"#, "size"),
            (r#"{"counts": [20]}"#, "size"),
            (r#"{"size": [4, 5], "counts": [19]}"#, "20 pixels"),
            (r#"{"size": [4, 5], "counts": [-1, 21]}"#, "counts"),
            (r#"{"size": [4, 5]}"#, "counts"),
            (r#"{"segmentation": [[0, 0, 1, 0, 1, 1]]}"#, "annToRLE"),
        ] {
            let value = serde_json::from_str(text).unwrap();
            let error = decode(Path::new("m.json"), &value, WIDTH, HEIGHT).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("m.json"), "{error}");
        }
    }
}
