//! `sensor_msgs/PointCloud2`: rows of records with x, y and z somewhere in them.

use semfm_geom::math::DVec3;
use semfm_views::mcap::CdrReader;

use super::compressed_depth::Fault;

pub(super) const POINT_CLOUD: &str = "sensor_msgs/msg/PointCloud2";

/// Numbers of the field types `FLOAT32` and `FLOAT64`.
const FLOAT32: u8 = 7;
const FLOAT64: u8 = 8;

#[derive(Clone, Copy)]
struct Field {
    offset: usize,
    kind: u8,
}

/// The points with finite coordinates.
pub(super) fn points(message: &[u8]) -> Result<Vec<DVec3>, Fault> {
    let cut = || Fault::new("a PointCloud2 in CDR", "fewer bytes, or another encoding");
    let mut cdr = CdrReader::new(message).ok_or_else(cut)?;
    cdr.header().ok_or_else(cut)?;
    let (height, width) = cdr.u32().zip(cdr.u32()).ok_or_else(cut)?;
    // A field takes at least 4 bytes of name, offset, type and count.
    let n_fields = cdr.length(13).ok_or_else(cut)?;
    let mut axes: [Option<Field>; 3] = [None; 3];
    for _ in 0..n_fields {
        let mut read = || Some((cdr.string()?, cdr.u32()? as usize, cdr.u8()?, cdr.u32()?));
        let (name, offset, kind, _) = read().ok_or_else(cut)?;
        if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
            axes[axis] = Some(Field { offset, kind });
        }
    }
    let mut read =
        || Some((cdr.u8()? != 0, cdr.u32()? as usize, cdr.u32()? as usize, cdr.bytes()?));
    let (is_big_endian, point_step, row_step, data) = read().ok_or_else(cut)?;
    let [Some(x), Some(y), Some(z)] = axes else {
        return Err(Fault::new("the fields x, y and z", "not all of them"));
    };
    for field in [x, y, z] {
        let size = match field.kind {
            FLOAT32 => 4,
            FLOAT64 => 8,
            other => {
                return Err(Fault::new(
                    "coordinates in FLOAT32 or FLOAT64",
                    format!("type {other}"),
                ));
            }
        };
        if field.offset.checked_add(size).is_none_or(|end| end > point_step) {
            let expected = format!("coordinates within the {point_step} bytes of a point");
            return Err(Fault::new(expected, format!("offset {}", field.offset)));
        }
    }
    let (width, height) = (width as usize, height as usize);
    let needed = height.saturating_sub(1).checked_mul(row_step);
    let needed = needed.and_then(|rows| rows.checked_add(width.checked_mul(point_step)?));
    if width == 0
        || height == 0
        || needed.is_none_or(|n| n > data.len())
        || row_step / point_step < width
    {
        let expected = format!("{width} × {height} points of {point_step} bytes");
        return Err(Fault::new(expected, format!("{} bytes", data.len())));
    }
    let rows = data.chunks(row_step).take(height);
    let records = rows.flat_map(|row| row[..width * point_step].chunks_exact(point_step));
    let point = |record: &[u8]| {
        let [x, y, z] =
            [x, y, z].map(|field| number(&record[field.offset..], field.kind, is_big_endian));
        DVec3::new(x, y, z)
    };
    Ok(records.map(point).filter(|p| p.is_finite()).collect())
}

fn number(bytes: &[u8], kind: u8, is_big_endian: bool) -> f64 {
    let four = || bytes[..4].try_into().expect("the field lies within the record");
    let eight = || bytes[..8].try_into().expect("the field lies within the record");
    match (kind, is_big_endian) {
        (FLOAT32, false) => f32::from_le_bytes(four()).into(),
        (FLOAT32, true) => f32::from_be_bytes(four()).into(),
        (_, false) => f64::from_le_bytes(eight()),
        (_, true) => f64::from_be_bytes(eight()),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use semfm_views::mcap::Cdr;

    /// A cloud with an intensity before its coordinates.
    pub(in crate::bag) fn message(
        time: u64,
        frame: &str,
        points: &[[f32; 3]],
        step: u32,
    ) -> Vec<u8> {
        let mut cdr = Cdr::new();
        cdr.header(time, frame);
        cdr.u32(1);
        cdr.u32(points.len() as u32);
        cdr.length(4);
        for (name, offset) in [("intensity", 0), ("x", 4), ("y", 8), ("z", 12)] {
            cdr.string(name);
            cdr.u32(offset);
            cdr.u8(FLOAT32);
            cdr.u32(1);
        }
        cdr.u8(0);
        cdr.u32(step);
        cdr.u32(step * points.len() as u32);
        let mut data = Vec::new();
        for point in points {
            let start = data.len();
            data.extend(9.0f32.to_le_bytes());
            point.iter().for_each(|x| data.extend(x.to_le_bytes()));
            data.resize(start + step as usize, 0);
        }
        cdr.byte_sequence(&data);
        cdr.u8(0);
        cdr.into_bytes()
    }

    #[test]
    fn points_stand_anywhere_in_their_records_and_missing_returns_are_left_out() {
        let given = [[1.0, 2.0, 3.0], [f32::NAN, 0.0, 0.0], [4.0, 5.0, 6.0]];
        let read = points(&message(1, "lidar", &given, 20)).unwrap();
        assert_eq!(read, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]);
        assert!(points(&message(1, "lidar", &given, 12)).is_err(), "z lies outside of the record");
        let whole = message(1, "lidar", &given, 16);
        for cut in 0..whole.len() - 1 {
            assert!(points(&whole[..cut]).is_err(), "cut at {cut}");
        }
    }
}
