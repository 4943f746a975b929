//! CDR (OMG Common Data Representation, XCDR1, little-endian), in which ROS 2 messages travel: a header of four bytes,
//! then each number on a multiple of its own size, counted from behind the header; a string as its length with the
//! closing zero, a sequence as its length and its members.

use semfm_geom::math::{DQuat, DVec3};

const NANOS: u64 = 1_000_000_000;

/// A message in CDR being written, field by field in the order of its definition.
#[derive(Clone, Debug)]
pub struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    /// Bytes before the first number; alignment is counted from behind them.
    const HEADER: [u8; 4] = [0, 1, 0, 0]; // plain CDR, little-endian, no options

    /// A message without a field.
    pub fn new() -> Self {
        Self { bytes: Self::HEADER.to_vec() }
    }

    /// The message.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    fn align(&mut self, size: usize) {
        let body = self.bytes.len() - Self::HEADER.len();
        self.bytes.resize(Self::HEADER.len() + body.next_multiple_of(size), 0);
    }

    /// A whole number of four bytes.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    /// A truth value.
    pub fn bool(&mut self, value: bool) {
        self.bytes.push(u8::from(value));
    }

    /// A number in single precision.
    pub fn f32(&mut self, value: f32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    /// One byte, as a truth value is.
    pub fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// A sequence of bytes.
    pub fn byte_sequence(&mut self, bytes: &[u8]) {
        self.length(bytes.len());
        self.bytes.extend(bytes);
    }

    /// The length of a sequence, before its members.
    pub fn length(&mut self, n: usize) {
        self.u32(u32::try_from(n).unwrap_or(u32::MAX));
    }

    /// A number in double precision.
    pub fn f64(&mut self, value: f64) {
        self.align(8);
        self.bytes.extend(value.to_le_bytes());
    }

    /// A sequence of numbers in double precision.
    pub fn f64s(&mut self, values: impl ExactSizeIterator<Item = f64>) {
        self.length(values.len());
        values.for_each(|value| self.f64(value));
    }

    /// Text.
    pub fn string(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    /// A sequence of texts.
    pub fn strings<'a>(&mut self, texts: impl ExactSizeIterator<Item = &'a str>) {
        self.length(texts.len());
        texts.for_each(|text| self.string(text));
    }

    /// `builtin_interfaces/Time` or `Duration`: seconds and nanoseconds.
    pub fn time(&mut self, nanos: u64) {
        self.u32(u32::try_from(nanos / NANOS).unwrap_or(u32::MAX));
        self.u32((nanos % NANOS) as u32);
    }

    /// `std_msgs/Header`: a time in nanoseconds and a frame.
    pub fn header(&mut self, nanos: u64, frame_id: &str) {
        self.time(nanos);
        self.string(frame_id);
    }

    /// `geometry_msgs/Pose` or `Transform`: a position in metres and a rotation.
    pub fn pose(&mut self, position: DVec3, rotation: DQuat) {
        position.to_array().into_iter().chain(rotation.to_array()).for_each(|x| self.f64(x));
    }
}

impl Default for Cdr {
    fn default() -> Self {
        Self::new()
    }
}
