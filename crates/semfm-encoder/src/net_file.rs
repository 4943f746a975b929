//! `NAME.net`: a network with its weights in one file.
//!
//! ```text
//! magic     8 bytes   SEMFMNET
//! version   u32       1
//! length    u32       bytes of the JSON
//! JSON                name, version, size, patch, channels, mean, std, background, layers, provenance
//! weights   f16       of each convolution in order: weights (out × in/groups × kernel × kernel),
//!                     row-major, then biases (out)
//! checksum  32 bytes  BLAKE3 of everything before
//! ```
//!
//! Numbers are little-endian. No length is believed before the bytes are there.

use std::fmt::Display;
use std::path::Path;

use half::f16;
use half::slice::HalfFloatSliceExt;
use semfm_geom::io::FormatError;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::channel::Channel;
use crate::layer::{Layer, Misfit, Size};
use crate::network::{Network, convolutions_of};

const MAGIC: &[u8; 8] = b"SEMFMNET";
const VERSION: u32 = 1;
const CHECKSUM: usize = 32;
/// Bytes of magic, version and length.
const FIXED: usize = 16;
/// Largest JSON, largest side of a picture and most layers that are read.
const MAX_JSON: usize = 1 << 20;
const MAX_SIDE: usize = 4096;
const MAX_LAYERS: usize = 1024;

/// What a network's file says of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetHeader {
    /// Name of the network.
    pub name: String,
    /// Its version; other weights have another one.
    pub version: String,
    /// Side of the pictures that it was trained on, in pixels.
    pub size: usize,
    /// Pixels along each side of a picture for one token.
    pub patch: usize,
    /// What it sees of a pixel, in order.
    pub channels: Vec<Channel>,
    /// Of each channel: (value − mean)/std is the input.
    pub mean: Vec<f32>,
    /// Of each channel.
    pub std: Vec<f32>,
    /// What stood behind the objects that it was trained on.
    #[serde(default)]
    pub background: Background,
    /// What it computes.
    pub layers: Vec<Layer>,
    /// How it was trained, for people.
    #[serde(default)]
    pub provenance: Map<String, Value>,
}

/// What stands behind an object in a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Background {
    /// sRGB 1, 1, 1.
    #[default]
    White,
    /// sRGB 0, 0, 0.
    Black,
}

impl Background {
    /// The colour (sRGB, 0 to 1).
    pub fn color(self) -> [f32; 3] {
        match self {
            Self::White => [1.0; 3],
            Self::Black => [0.0; 3],
        }
    }
}

/// A file's content: checked, its weights ready to be used.
#[derive(Clone, Debug)]
pub(crate) struct NetFile {
    pub header: NetHeader,
    pub network: Network,
    /// Length of a token.
    pub dim: usize,
    /// BLAKE3 of the file's content, as hexadecimal digits.
    pub hash: String,
}

impl NetFile {
    /// Reads a file's bytes; `path` names it in errors.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, FormatError> {
        let body = checked_body(path, bytes)?;
        let json_end = FIXED + number(body, 12) as usize;
        let header = NetHeader::parse(path, &body[FIXED..json_end])?;
        let dim = header.check().map_err(|fault| fault.in_file(path))?;

        let weights = &body[json_end..];
        let n_numbers: u128 = convolutions_of(&header.layers).map(|c| c.n_numbers() as u128).sum();
        if weights.len() as u128 != 2 * n_numbers {
            let expected = format!("{n_numbers} numbers of 2 bytes, as the layers have");
            return Err(FormatError::new(path, "weights", expected, bytes_of(weights.len())));
        }
        let halves: Vec<f16> =
            weights.as_chunks::<2>().0.iter().map(|&bytes| f16::from_le_bytes(bytes)).collect();
        let mut numbers = vec![0.0; halves.len()];
        halves.convert_to_f32_slice(&mut numbers);
        if let Some(at) = numbers.iter().position(|x| !x.is_finite()) {
            let place = format!("weights: number {at}");
            return Err(FormatError::new(path, place, "a finite number", numbers[at].to_string()));
        }
        let network = Network::new(header.layers.clone(), &numbers);
        Ok(Self { network, dim, hash: blake3::hash(body).to_hex().to_string(), header })
    }
}

/// The bytes of a file from the header and numbers (in the file's order), which are rounded to half
/// precision.
///
/// # Errors
/// [`crate::Error::Format`] for what [`NetEncoder::parse`](crate::NetEncoder::parse) refuses, said of
/// the file `NAME.net`.
pub fn write_net(header: &NetHeader, numbers: &[f32]) -> crate::Result<Vec<u8>> {
    let json = serde_json::to_vec(header).map_err(semfm_json)?;
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(json);
    bytes.extend(numbers.iter().flat_map(|&x| f16::from_f32(x).to_le_bytes()));
    let checksum = blake3::hash(&bytes);
    bytes.extend(checksum.as_bytes());
    NetFile::parse(Path::new(&format!("{}.net", header.name)), &bytes)?;
    Ok(bytes)
}

fn semfm_json(error: serde_json::Error) -> crate::Error {
    crate::Error::invalid("header", "what JSON can hold", error.to_string())
}

/// Everything but the checksum, which fits it; magic, version and the length of the JSON are right.
fn checked_body<'b>(path: &Path, bytes: &'b [u8]) -> Result<&'b [u8], FormatError> {
    if !bytes.starts_with(MAGIC) {
        let found = bytes[..bytes.len().min(8)].escape_ascii().to_string();
        return Err(FormatError::new(path, "byte 0", "`SEMFMNET`", format!("`{found}`")));
    }
    if bytes.len() < FIXED + CHECKSUM {
        let expected = format!("at least {} bytes", FIXED + CHECKSUM);
        return Err(FormatError::new(path, "end", expected, bytes_of(bytes.len())));
    }
    let version = number(bytes, 8);
    if version != VERSION {
        let expected = format!("version {VERSION}");
        return Err(FormatError::new(path, "byte 8", expected, version.to_string()));
    }
    let (body, checksum) = bytes.split_at(bytes.len() - CHECKSUM);
    let (length, most) = (number(body, 12) as usize, (body.len() - FIXED).min(MAX_JSON));
    if length > most {
        let expected = format!("a JSON of at most {most} bytes");
        return Err(FormatError::new(path, "byte 12", expected, length.to_string()));
    }
    if blake3::hash(body).as_bytes() != checksum {
        let expected = "the BLAKE3 hash of the content";
        return Err(FormatError::new(path, "checksum", expected, "another: the file is damaged"));
    }
    Ok(body)
}

/// The u32 at a place that is there.
fn number(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn bytes_of(n: usize) -> String {
    format!("{n} bytes")
}

/// What is wrong with a header, and where.
struct Fault {
    place: String,
    misfit: Misfit,
}

impl Fault {
    fn new(place: impl Display, expected: impl Into<String>, found: impl ToString) -> Self {
        Self { place: place.to_string(), misfit: Misfit::new(expected, found) }
    }

    fn in_file(self, path: &Path) -> FormatError {
        FormatError::new(path, self.place, self.misfit.expected, self.misfit.found)
    }
}

impl NetHeader {
    fn parse(path: &Path, json: &[u8]) -> Result<Self, FormatError> {
        serde_json::from_slice(json).map_err(|error| {
            let place = format!("JSON, line {}, column {}", error.line(), error.column());
            FormatError::new(path, place, "the header of a network", error.to_string())
        })
    }

    /// Checks all fields; the length of a token.
    fn check(&self) -> Result<usize, Fault> {
        let n = self.channels.len();
        if self.name.is_empty() || self.version.is_empty() {
            return Err(Fault::new("name, version", "some text each", "none"));
        }
        if !(1..=MAX_SIDE).contains(&self.size) || !(1..=self.size).contains(&self.patch) {
            let expected = format!("1 to {MAX_SIDE} pixels, and a patch that fits");
            return Err(Fault::new(
                "size, patch",
                expected,
                format!("{}, {}", self.size, self.patch),
            ));
        }
        if !self.size.is_multiple_of(self.patch) {
            let expected = format!("a multiple of the patch, {}", self.patch);
            return Err(Fault::new("size", expected, self.size));
        }
        if !(1..=16).contains(&n) {
            return Err(Fault::new("channels", "1 to 16", n));
        }
        for (name, values) in [("mean", &self.mean), ("std", &self.std)] {
            if values.len() != n || !values.iter().all(|x| x.is_finite()) {
                let expected = format!("{n} finite numbers, one for each channel");
                return Err(Fault::new(name, expected, format!("{values:?}")));
            }
        }
        if let Some(std) = self.std.iter().find(|&&std| std <= 0.0) {
            return Err(Fault::new("std", "positive numbers", std));
        }
        if self.layers.len() > MAX_LAYERS {
            let expected = format!("at most {MAX_LAYERS}");
            return Err(Fault::new("layers", expected, self.layers.len()));
        }
        for (number, layer) in self.layers.iter().enumerate() {
            if let Layer::Conv(conv) = layer {
                conv.check().map_err(|misfit| Fault { place: layer_place(number), misfit })?;
            }
        }
        let (side, grid) = (self.size, self.size / self.patch);
        let input = Size { height: side, width: side, channels: n };
        let output = crate::layer::output_size(&self.layers, input)
            .map_err(|(number, misfit)| Fault { place: layer_place(number), misfit })?;
        if (output.height, output.width) != (grid, grid) {
            let expected = format!("{grid} × {grid} tokens of a picture of {side} × {side}");
            return Err(Fault::new("layers", expected, output));
        }
        Ok(output.channels)
    }
}

fn layer_place(number: usize) -> String {
    format!("layer {number}")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::layer::ConvLayer;

    fn conv(n_in: usize, n_out: usize) -> Layer {
        Layer::Conv(ConvLayer {
            n_in,
            n_out,
            kernel: 4,
            stride: 4,
            padding: 0,
            dilation: 1,
            groups: 1,
            relu: true,
        })
    }

    fn header() -> NetHeader {
        NetHeader {
            name: "tiny".into(),
            version: "1".into(),
            size: 32,
            patch: 16,
            channels: vec![Channel::Grey],
            mean: vec![0.5],
            std: vec![0.5],
            background: Background::White,
            layers: vec![conv(1, 2), conv(2, 3)],
            provenance: Map::new(),
        }
    }

    const N_NUMBERS: usize = 17 * 2 + 33 * 3;

    fn tiny() -> Vec<u8> {
        let numbers: Vec<f32> = (0..N_NUMBERS).map(|i| i as f32 / 64.0).collect();
        write_net(&header(), &numbers).unwrap()
    }

    fn parse(bytes: &[u8]) -> Result<NetFile, FormatError> {
        NetFile::parse(Path::new("tiny.net"), bytes)
    }

    /// The same file with other bytes before its checksum, which is made to fit again.
    fn with_checksum(mut body: Vec<u8>) -> Vec<u8> {
        let checksum = blake3::hash(&body);
        body.extend(checksum.as_bytes());
        body
    }

    #[test]
    fn what_is_written_is_read_back() {
        let file = parse(&tiny()).unwrap();
        assert_eq!(file.header, header());
        assert_eq!((file.dim, file.hash.len()), (3, 64));
    }

    #[test]
    fn faults_are_named_with_their_place() {
        let whole = tiny();
        let body = &whole[..whole.len() - CHECKSUM];
        let mut flipped = whole.clone();
        flipped[40] ^= 1;
        let mut newer = body.to_vec();
        newer[8] = 2;
        let mut long_json = body.to_vec();
        long_json[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        let mut endless = body.to_vec();
        let at = endless.len() - 2;
        endless[at..].copy_from_slice(&f16::INFINITY.to_le_bytes());
        for (bytes, place) in [
            (b"PK\x03\x04".to_vec(), "byte 0"),
            (whole[..20].to_vec(), "end"),
            (flipped, "checksum"),
            (whole[..whole.len() - 1].to_vec(), "checksum"),
            (with_checksum(newer), "byte 8"),
            (with_checksum(long_json), "byte 12"),
            (with_checksum(body[..body.len() - 2].to_vec()), "weights"),
            (with_checksum(endless), "weights: number 132"),
        ] {
            let error = parse(&bytes).unwrap_err();
            assert_eq!(error.place, place, "{error}");
        }
    }

    #[test]
    fn headers_that_make_no_sense_are_refused() {
        type Change = fn(&mut NetHeader);
        let cases: [(Change, &str); 11] = [
            (|h| h.name.clear(), "name, version"),
            (|h| h.size = 40, "size"),
            (|h| h.patch = 0, "size, patch"),
            (|h| h.channels.clear(), "channels"),
            (|h| h.mean.push(0.0), "mean"),
            (|h| h.std[0] = 0.0, "std"),
            (|h| h.layers = vec![conv(1, 2), conv(3, 3)], "layer 1"),
            (|h| h.layers.truncate(1), "layers"),
            (|h| h.layers.push(Layer::Add { relu: false }), "layer 2"),
            (|h| h.layers[0] = conv(1, 1 << 20), "layer 0"),
            (|h| h.layers = vec![Layer::Save {}; 2000], "layers"),
        ];
        for (change, place) in cases {
            let mut header = header();
            change(&mut header);
            let numbers = vec![0.0; N_NUMBERS];
            let error = write_net(&header, &numbers).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{error}");
        }
        let json = r#"{"name":"x","version":"1","size":32,"patch":16,"channels":["smell"]}"#;
        let error = NetHeader::parse(Path::new("x.net"), json.as_bytes()).unwrap_err();
        assert!(
            error.to_string().contains("smell") && error.to_string().contains("grey"),
            "{error}"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        /// Any bytes behind a right checksum: an answer or an error, never a panic, never more memory
        /// than the file's own size calls for.
        #[test]
        fn no_file_is_trusted(at in 8usize..420, bytes in prop::collection::vec(any::<u8>(), 1..9)) {
            let whole = tiny();
            let mut body = whole[..whole.len() - CHECKSUM].to_vec();
            let at = at.min(body.len());
            let end = body.len().min(at + bytes.len());
            body.splice(at..end, bytes);
            let _ = parse(&with_checksum(body));
        }

        #[test]
        fn sizes_in_a_header_are_checked_before_they_are_used(
            numbers in prop::collection::vec(prop_oneof![0usize..70, any::<usize>()], 9),
        ) {
            let mut header = header();
            let [size, patch, n_in, n_out, kernel, stride, padding, dilation, groups] = numbers[..]
            else { unreachable!("nine numbers") };
            (header.size, header.patch) = (size, patch);
            header.layers = vec![Layer::Conv(ConvLayer {
                n_in, n_out, kernel, stride, padding, dilation, groups, relu: false,
            })];
            let _ = write_net(&header, &[0.0; 4]);
        }
    }
}
