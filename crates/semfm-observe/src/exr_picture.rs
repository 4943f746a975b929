//! EXR files: depth in floats, and colours in linear light.

use std::io::Cursor;
use std::path::Path;

use exr::image::FlatSamples;
use exr::prelude::{MetaData, ReadChannels, ReadLayers, read};
use image::RgbImage;
use semfm_geom::io::FormatError;

use crate::depth_image::NO_RETURN;

/// Bytes that the pixels of a file may unpack to.
const MOST_PIXEL_BYTES: u128 = 1 << 28;

/// Depths from here on, metres, say that nothing came back: Blender writes 1e10.
const FARTHEST: f64 = 65504.0;
/// The greatest number of a float of 16 bits, in which what is farther away is written, whatever its unit.
const GREATEST_F16: f32 = 65504.0;

/// Whether bytes begin as an EXR file does.
pub(crate) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// The channels of a file, all of the picture's size.
pub(crate) struct ExrPicture<'a> {
    path: &'a Path,
    pub width: usize,
    pub height: usize,
    channels: Vec<Channel>,
}

/// One number for each pixel.
struct Channel {
    /// `Z`, or `View Layer.Depth.Z`.
    name: String,
    samples: FlatSamples,
}

/// A channel of depth.
pub(crate) struct ExrDepth<'a>(&'a FlatSamples);

impl ExrDepth<'_> {
    /// Whether the file counts in whole numbers.
    pub fn is_whole(&self) -> bool {
        matches!(self.0, FlatSamples::U32(_))
    }

    /// Row-major (height × width), metres; 0 where nothing came back.
    pub fn metres(&self, per_metre: f64) -> Vec<f32> {
        let no_return = match self.0 {
            FlatSamples::F16(_) => Some(GREATEST_F16),
            FlatSamples::U32(_) => Some(f32::from(NO_RETURN)),
            FlatSamples::F32(_) => None,
        };
        let metres = |value: f32| {
            let metres = f64::from(value) / per_metre;
            // Not so for what is no number.
            if metres < FARTHEST && Some(value) != no_return { metres as f32 } else { 0.0 }
        };
        self.0.values_as_f32().map(metres).collect()
    }
}

impl<'a> ExrPicture<'a> {
    /// Of the bytes of a file; `path` is for messages.
    ///
    /// # Errors
    /// A [`FormatError`] where they are damaged or unpack to more than 256 MB, for samples of several resolutions or with
    /// depths of their own, and for pixels of a part of the picture only.
    pub fn read(path: &'a Path, bytes: &[u8]) -> Result<Self, FormatError> {
        let fault = |expected: &str, found: String| FormatError::new(path, "EXR", expected, found);
        let damaged = |error: exr::error::Error| fault("a sound EXR file", error.to_string());
        let about = MetaData::read_from_buffered(Cursor::new(bytes), true).map_err(damaged)?;
        let of_layer = |header: &exr::meta::header::Header| {
            header.layer_size.area() as u128 * header.channels.bytes_per_pixel as u128
        };
        let n_bytes: u128 = about.headers.iter().map(of_layer).sum();
        if n_bytes > MOST_PIXEL_BYTES {
            let expected = format!("pixels of at most {MOST_PIXEL_BYTES} bytes");
            return Err(fault(&expected, format!("{n_bytes} bytes")));
        }
        let layers = read().no_deep_data().largest_resolution_level().all_channels().all_layers();
        let layers = layers.all_attributes().pedantic().non_parallel();
        let image = layers.from_buffered(Cursor::new(bytes)).map_err(damaged)?;
        let window = image.attributes.display_window;
        let (width, height) = (window.size.width(), window.size.height());
        let mut channels = Vec::new();
        for layer in image.layer_data {
            if layer.size != window.size || layer.attributes.layer_position != window.position {
                let expected = format!("pixels of the whole picture, {width} × {height}");
                let found = format!("{} × {} of them", layer.size.width(), layer.size.height());
                return Err(fault(&expected, found));
            }
            let layer_name = layer.attributes.layer_name.map(|name| format!("{name}."));
            for channel in layer.channel_data.list {
                let name = format!("{}{}", layer_name.as_deref().unwrap_or(""), channel.name);
                if channel.sample_data.len() != width * height {
                    let found = format!("{} in `{name}`", channel.sample_data.len());
                    return Err(fault("a sample of each channel at each pixel", found));
                }
                channels.push(Channel { name, samples: channel.sample_data });
            }
        }
        Ok(Self { path, width, height, channels })
    }

    /// The depth: the channel with a part `depth` in its dotted name, else `Z`, else the only `*.Z` that is no part of a vector.
    /// Where there is neither, the only channel, or the R, G and B of the only layer with colours where they are the same.
    ///
    /// # Errors
    /// A [`FormatError`] with the names of the channels where none or several are meant.
    pub fn depth(&self) -> Result<ExrDepth<'_>, FormatError> {
        let all: Vec<&Channel> = self.channels.iter().collect();
        let found = self.named_depth().unwrap_or_else(|| only(all.iter().copied()).or(grey(&all)));
        let Some(Channel { samples, .. }) = found else {
            let expected = "one channel of depth: a single one, or one of the name `Z` or `depth`";
            return Err(self.other_channels(expected));
        };
        Ok(ExrDepth(samples))
    }

    /// The channel that is called depth; `None` within where several are, or only parts of vectors.
    fn named_depth(&self) -> Option<Option<&Channel>> {
        let has_depth = |channel: &&Channel| {
            channel.name.split('.').any(|part| part.eq_ignore_ascii_case("depth"))
        };
        let named: Vec<&Channel> = self.channels.iter().filter(has_depth).collect();
        if !named.is_empty() {
            return Some(only(named.iter().copied()).or(grey(&named)));
        }
        let z: Vec<&Channel> = self.channels.iter().filter(|channel| channel.is_of("z")).collect();
        if z.is_empty() {
            return None;
        }
        let depths: Vec<&Channel> = z.into_iter().filter(|z| !self.is_of_vector(z)).collect();
        let without_layer = depths.iter().copied().filter(|z| z.layer().is_empty());
        Some(only(without_layer).or_else(|| only(depths.iter().copied())))
    }

    /// Whether its layer has an X or a Y, as one of normals or of places does.
    fn is_of_vector(&self, z: &Channel) -> bool {
        let is_axis = |channel: &Channel| channel.is_of("x") || channel.is_of("y");
        self.channels.iter().any(|other| other.layer() == z.layer() && is_axis(other))
    }

    /// The colours as sRGB: R, G and B without a layer, else those of the layer `Combined`, else of the only layer that has
    /// some; or one channel as grey.
    ///
    /// # Errors
    /// A [`FormatError`] with the names of the channels where there are others, or several layers may be meant.
    pub fn color(&self) -> Result<RgbImage, FormatError> {
        let grey = || only(self.channels.iter()).map(|channel| [channel; 3]);
        let Some(rgb) = self.rgb().or_else(grey) else {
            let expected = "channels R, G and B of one layer (of several: without a name, or `Combined`), or a single one";
            return Err(self.other_channels(expected));
        };
        let rgb = rgb.map(|channel| channel.samples.values_as_f32().map(srgb).collect::<Vec<u8>>());
        let pixel = |x: u32, y: u32| {
            let at = y as usize * self.width + x as usize;
            image::Rgb([0, 1, 2].map(|c| rgb[c][at]))
        };
        Ok(RgbImage::from_fn(self.width as u32, self.height as u32, pixel))
    }

    /// R, G and B of the layer that is the picture.
    fn rgb(&self) -> Option<[&Channel; 3]> {
        let all: Vec<&Channel> = self.channels.iter().collect();
        let layers = rgb_layers(&all);
        let is_combined = |layer: &str| {
            layer.rsplit('.').next().is_some_and(|own| own.eq_ignore_ascii_case("combined"))
        };
        let of = |is_meant: &dyn Fn(&str) -> bool| -> Vec<[&Channel; 3]> {
            layers.iter().copied().filter(|[red, ..]| is_meant(red.layer())).collect()
        };
        let preferred = [of(&str::is_empty), of(&is_combined), of(&|_| true)];
        let first = preferred.into_iter().find(|layers| !layers.is_empty())?;
        only(first.into_iter())
    }

    fn other_channels(&self, expected: &str) -> FormatError {
        let names: Vec<&str> = self.channels.iter().map(|channel| channel.name.as_str()).collect();
        FormatError::new(self.path, "channels", expected, names.join(", "))
    }
}

impl Channel {
    /// Whether it has this name behind that of its layer.
    fn is_of(&self, name: &str) -> bool {
        self.name.rsplit('.').next().is_some_and(|own| own.eq_ignore_ascii_case(name))
    }

    fn layer(&self) -> &str {
        self.name.rsplit_once('.').map_or("", |(layer, _)| layer)
    }
}

/// The R, G and B of each layer that has them.
fn rgb_layers<'a>(channels: &[&'a Channel]) -> Vec<[&'a Channel; 3]> {
    let reds = channels.iter().copied().filter(|channel| channel.is_of("r"));
    let layer = |red: &'a Channel| {
        let of = |name: &str| {
            let mut all = channels.iter().copied();
            all.find(|other| other.is_of(name) && other.layer() == red.layer())
        };
        Some([red, of("g")?, of("b")?])
    };
    reds.filter_map(layer).collect()
}

/// R of the only layer with colours, where G and B are the same.
fn grey<'a>(channels: &[&'a Channel]) -> Option<&'a Channel> {
    let [red, green, blue] = only(rgb_layers(channels).into_iter())?;
    let bits =
        |channel: &Channel| channel.samples.values_as_f32().map(f32::to_bits).collect::<Vec<u32>>();
    let of_red = bits(red);
    (of_red == bits(green) && of_red == bits(blue)).then_some(red)
}

/// The item of an iterator that has one.
fn only<T>(mut items: impl Iterator<Item = T>) -> Option<T> {
    let first = items.next();
    first.filter(|_| items.next().is_none())
}

/// Linear light, 0 to 1, as sRGB of 8 bits (IEC 61966-2-1).
fn srgb(linear: f32) -> u8 {
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    let encoded =
        if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// Writes an EXR of 32-bit floats with these channels, for tests.
#[cfg(any(test, feature = "test-files"))]
pub fn write_exr(path: &Path, size: [usize; 2], channels: &[(&str, Vec<f32>)]) {
    let channels = channels.iter().map(|(name, values)| (*name, FlatSamples::F32(values.clone())));
    write_samples(path, size, channels.collect());
}

#[cfg(any(test, feature = "test-files"))]
fn write_samples(path: &Path, [width, height]: [usize; 2], channels: Vec<(&str, FlatSamples)>) {
    use exr::prelude::*;
    let channels = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples));
    let channels = AnyChannels::sort(channels.collect());
    let layer =
        Layer::new((width, height), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    Image::from_layer(layer).write().non_parallel().to_file(path).unwrap();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::read_picture;
    use crate::read_depth_image;
    use semfm_align::DepthImage;

    #[test]
    fn depth_is_in_metres_and_what_is_not_finite_is_no_return() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let values = vec![0.5, f32::NAN, f32::INFINITY, 1e10, 0.0, 1.25];
        let image = DepthImage::new(3, 2, vec![0.5, 0.0, 0.0, 0.0, 0.0, 1.25]).unwrap();
        write_exr(&at("z.exr"), [3, 2], &[("Z", values.clone())]);
        assert_eq!(read_depth_image(&at("z.exr"), None).unwrap(), image);
        let mm = values.iter().map(|z| z * 1000.0).collect();
        write_exr(&at("mm.exr"), [3, 2], &[("anything", mm)]);
        assert_eq!(read_depth_image(&at("mm.exr"), Some(1000.0)).unwrap(), image);
        // As Blender's compositor writes a single pass, and a file of many passes.
        let grey = ["R", "G", "B"].map(|name| (name, values.clone()));
        write_exr(&at("grey.exr"), [3, 2], &grey);
        assert_eq!(read_depth_image(&at("grey.exr"), None).unwrap(), image);
        let passes = ["V.Combined.R", "V.Combined.G", "V.Combined.B", "V.Normal.Z"];
        let mut passes: Vec<_> = passes.map(|name| (name, vec![0.1; 6])).into();
        passes.push(("V.Depth.Z", values));
        write_exr(&at("passes.exr"), [3, 2], &passes);
        assert_eq!(read_depth_image(&at("passes.exr"), None).unwrap(), image);
        let color = read_picture(&at("passes.exr")).unwrap().into_rgb8();
        assert_eq!(color.get_pixel(2, 1).0, [srgb(0.1); 3]);
    }

    #[test]
    fn what_is_no_return_is_told_by_the_kind_of_number() {
        use exr::prelude::f16;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("z.exr");
        let read = |samples: FlatSamples, per_metre: Option<f64>| {
            write_samples(&path, [3, 1], vec![("Z", samples)]);
            read_depth_image(&path, per_metre).unwrap().metres().to_vec()
        };
        // 70 m in millimetres is a depth, and 1e10 none whatever its unit.
        let floats = FlatSamples::F32(vec![70_000.0, 500.0, 1e10]);
        assert_eq!(read(floats, Some(1000.0)), [70.0, 0.5, 0.0]);
        let whole = FlatSamples::U32(vec![65_504, 65_535, u32::MAX]);
        assert_eq!(read(whole, None), [65.504, 0.0, 0.0]);
        let half = [500.0, 65504.0, f32::INFINITY].map(f16::from_f32);
        assert_eq!(read(FlatSamples::F16(half.to_vec()), Some(1000.0)), [0.5, 0.0, 0.0]);
    }

    #[test]
    fn colours_are_brought_from_linear_light_to_srgb() {
        assert_eq!(
            [-1.0, f32::NAN, 0.0, 0.002, 0.2140, 1.0, 9.0].map(srgb),
            [0, 0, 0, 7, 127, 255, 255]
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.exr");
        let rgb = [("R", vec![1.0, 0.0]), ("G", vec![0.214, 0.0]), ("B", vec![0.0, 1.0])];
        write_exr(&path, [2, 1], &rgb);
        let color = read_picture(&path).unwrap().into_rgb8();
        assert_eq!(
            (color.get_pixel(0, 0).0, color.get_pixel(1, 0).0),
            ([255, 127, 0], [0, 0, 255])
        );
        write_exr(&path, [2, 1], &[("mask", vec![0.0, 1.0])]);
        let of = crate::MaskedPicture { width: 2, height: 1, name: "the view" };
        assert_eq!(crate::read_mask(&path, of).unwrap(), [false, true]);
    }

    /// Channels of two pixels.
    fn pair<'a>(names: &[&'a str], value: f32) -> Vec<(&'a str, Vec<f32>)> {
        names.iter().map(|name| (*name, vec![value; 2])).collect()
    }

    #[test]
    fn of_several_passes_the_picture_is_taken_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.exr");
        let red = |layers: &[(&[&str], f32)]| {
            let channels: Vec<_> =
                layers.iter().flat_map(|(names, value)| pair(names, *value)).collect();
            write_exr(&path, [2, 1], &channels);
            read_picture(&path).map(|picture| picture.into_rgb8().get_pixel(0, 0).0[0])
        };
        let albedo: (&[&str], f32) = (&["V.Albedo.R", "V.Albedo.G", "V.Albedo.B"], 0.0);
        let combined: (&[&str], f32) = (&["V.Combined.R", "V.Combined.G", "V.Combined.B"], 1.0);
        let light: (&[&str], f32) = (&["V.Light.R", "V.Light.G", "V.Light.B"], 0.0);
        assert_eq!(red(&[albedo, combined]).unwrap(), 255);
        assert_eq!(red(&[albedo, (&["R", "G", "B"], 1.0)]).unwrap(), 255);
        assert_eq!(red(&[albedo]).unwrap(), 0);
        let several = red(&[albedo, light]).unwrap_err().to_string();
        assert!(several.contains("V.Albedo.R") && several.contains("Combined"), "{several}");
    }

    #[test]
    fn of_several_passes_the_depth_is_taken_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.exr");
        let depth = |layers: &[(&[&str], f32)]| {
            let channels: Vec<_> =
                layers.iter().flat_map(|(names, value)| pair(names, *value)).collect();
            write_exr(&path, [2, 1], &channels);
            read_depth_image(&path, None).map(|image| image.metres()[0])
        };
        let combined: (&[&str], f32) = (&["V.Combined.R", "V.Combined.G", "V.Combined.B"], 0.3);
        let normal: (&[&str], f32) = (&["V.Normal.X", "V.Normal.Y", "V.Normal.Z"], 0.6);
        assert_eq!(depth(&[combined, (&["V.Depth.Z"], 2.0)]).unwrap(), 2.0);
        assert_eq!(depth(&[combined, normal, (&["Z"], 2.0)]).unwrap(), 2.0);
        assert_eq!(depth(&[normal, (&["V.Z"], 2.0)]).unwrap(), 2.0);
        assert_eq!(depth(&[combined, (&["Depth.R", "Depth.G", "Depth.B"], 2.0)]).unwrap(), 2.0);
        assert!(depth(&[normal]).is_err(), "a normal is no depth");
        assert!(depth(&[combined, normal]).is_err(), "nor are colours beside it");
        assert!(depth(&[(&["V.Mist.Z", "V.Other.Z"], 1.0)]).is_err());
        assert!(depth(&[(&["A.Depth.Z", "B.Depth.Z"], 1.0), (&["Z"], 1.0)]).is_err());
        assert!(
            depth(&[combined, (&["W.Combined.R", "W.Combined.G", "W.Combined.B"], 1.0)]).is_err()
        );
    }

    #[test]
    fn other_files_are_refused_with_what_they_hold() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let words = |name: &str| read_depth_image(&at(name), None).unwrap_err().to_string();
        write_exr(&at("xy.exr"), [2, 1], &[("X", vec![1.0; 2]), ("Y", vec![1.0; 2])]);
        assert!(words("xy.exr").contains("X, Y") && words("xy.exr").contains("`Z`"));
        assert!(read_picture(&at("xy.exr")).unwrap_err().to_string().contains("R, G and B"));
        write_exr(&at("none.exr"), [2, 1], &[("Z", vec![f32::NAN; 2])]);
        assert!(words("none.exr").contains("2 pixels without"));
        let bytes = std::fs::read(at("none.exr")).unwrap();
        std::fs::write(at("cut.exr"), &bytes[..bytes.len() - 3]).unwrap();
        assert!(words("cut.exr").contains("a sound EXR file"), "{}", words("cut.exr"));
    }
}
