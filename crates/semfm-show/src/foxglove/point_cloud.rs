//! Coloured points as Foxglove's PointCloud, there and back.

use std::path::Path;

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PackedElementField, PointCloud};
use semfm::geom::math::DVec3;
use semfm::views::mcap::messages::{pose_at, timestamp};
use semfm::views::mcap::{Message, decode, message_error, read_messages};

use super::items::{NamedNumbers, SceneNumbers, ScenePoints};
use crate::Result;

/// Position as three f32 and colour as four bytes, in the names that Foxglove looks for, then the
/// numbers, four bytes each.
pub(super) fn point_cloud(cloud: &ScenePoints<'_>) -> PointCloud {
    let mut fields = vec![
        field("x", 0, NumericType::Float32),
        field("y", 4, NumericType::Float32),
        field("z", 8, NumericType::Float32),
        field("red", 12, NumericType::Uint8),
        field("green", 13, NumericType::Uint8),
        field("blue", 14, NumericType::Uint8),
        field("alpha", 15, NumericType::Uint8),
    ];
    let mut stride = 16;
    for NamedNumbers { name, numbers } in cloud.numbers {
        let kind = match numbers {
            SceneNumbers::F32(_) => NumericType::Float32,
            SceneNumbers::I32(_) => NumericType::Int32,
            SceneNumbers::U32(_) => NumericType::Uint32,
        };
        fields.push(field(name, stride, kind));
        stride += 4;
    }
    let mut data = Vec::with_capacity(stride as usize * cloud.points.len());
    for (i, (point, rgb)) in cloud.points.iter().zip(cloud.colors).enumerate() {
        data.extend(point.as_vec3().to_array().into_iter().flat_map(f32::to_le_bytes));
        data.extend(rgb);
        data.push(u8::MAX);
        for named in cloud.numbers {
            data.extend(match named.numbers {
                SceneNumbers::F32(numbers) => numbers[i].to_le_bytes(),
                SceneNumbers::I32(numbers) => numbers[i].to_le_bytes(),
                SceneNumbers::U32(numbers) => numbers[i].to_le_bytes(),
            });
        }
    }
    PointCloud {
        timestamp: Some(timestamp(0)),
        frame_id: cloud.frame_id.to_owned(),
        pose: Some(pose_at(DVec3::ZERO)),
        point_stride: stride,
        fields,
        data: data.into(),
    }
}

fn field(name: &str, offset: u32, kind: NumericType) -> PackedElementField {
    PackedElementField { name: name.to_owned(), offset, r#type: kind.into() }
}

/// Points and their colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColoredPoints {
    /// Positions (n).
    pub points: Vec<DVec3>,
    /// sRGB bytes (n).
    pub colors: Vec<[u8; 3]>,
}

/// The cloud on a topic of a scene that this program wrote; nothing where there is none.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) with [`Container`](semfm::views::Error::Container) for a
/// damaged file and with [`Format`](semfm::views::Error::Format) for a cloud with other fields than ours.
pub fn read_cloud(path: &Path, topic: &str) -> Result<Option<ColoredPoints>> {
    let mut found = None;
    read_messages(path, |message| {
        if message.channel.topic == topic {
            found = Some(cloud_of(path, &message)?);
        }
        Ok(())
    })?;
    Ok(found)
}

fn cloud_of(path: &Path, message: &Message<'_>) -> semfm::views::Result<ColoredPoints> {
    let cloud: PointCloud = decode(path, message, "foxglove.PointCloud")?;
    let (float, byte) = (NumericType::Float32, NumericType::Uint8);
    let wanted = [
        field("x", 0, float),
        field("y", 4, float),
        field("z", 8, float),
        field("red", 12, byte),
        field("green", 13, byte),
        field("blue", 14, byte),
    ];
    let is_ours = wanted.iter().all(|field| cloud.fields.contains(field));
    let stride = cloud.point_stride as usize;
    if stride < 16 || !cloud.data.len().is_multiple_of(stride) || !is_ours {
        let expected = "x, y, z as 32-bit floats, then red, green, blue as bytes";
        let names: Vec<&str> = cloud.fields.iter().map(|field| field.name.as_str()).collect();
        let found = format!("{} of stride {stride}", names.join(", "));
        return Err(message_error(path, message, expected, found));
    }
    let mut points = ColoredPoints::default();
    for point in cloud.data.chunks_exact(stride) {
        points.points.push(DVec3::new(float_at(point, 0), float_at(point, 4), float_at(point, 8)));
        points.colors.push([point[12], point[13], point[14]]);
    }
    Ok(points)
}

fn float_at(point: &[u8], at: usize) -> f64 {
    f64::from(f32::from_le_bytes([point[at], point[at + 1], point[at + 2], point[at + 3]]))
}
