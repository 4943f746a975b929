//! Reading CDR, the encoding of ROS 2 messages ([`Cdr`](super::Cdr) writes it): either byte order, and no length that
//! was not compared with the bytes.

use semfm_geom::math::{DQuat, DVec3};

/// A message in CDR being read, field by field in the order of its definition. Each method gives `None` where the
/// message ends too early, or a text is none.
#[derive(Clone, Copy, Debug)]
pub struct CdrReader<'a> {
    /// What follows the header of four bytes; alignment is counted from here.
    body: &'a [u8],
    at: usize,
    is_big_endian: bool,
}

macro_rules! number {
    ($name:ident, $kind:ty, $what:literal) => {
        #[doc = $what]
        pub fn $name(&mut self) -> Option<$kind> {
            const SIZE: usize = size_of::<$kind>();
            self.align(SIZE);
            let bytes: [u8; SIZE] = self.take(SIZE)?.try_into().ok()?;
            Some(match self.is_big_endian {
                true => <$kind>::from_be_bytes(bytes),
                false => <$kind>::from_le_bytes(bytes),
            })
        }
    };
}

impl<'a> CdrReader<'a> {
    /// A message; `None` where its header is not one of plain CDR.
    pub fn new(message: &'a [u8]) -> Option<Self> {
        let (header, body) = message.split_at_checked(4)?;
        // Plain CDR, big- or little-endian; the other encodings (parameter lists, XCDR2) lie differently.
        let is_big_endian = match header[..2] {
            [0, 0] => true,
            [0, 1] => false,
            _ => return None,
        };
        Some(Self { body, at: 0, is_big_endian })
    }

    number!(u8, u8, "One byte.");
    number!(u32, u32, "A whole number of four bytes.");
    number!(i32, i32, "A whole number of four bytes with a sign.");
    number!(f64, f64, "A number in double precision.");

    /// A sequence of bytes.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let n = self.u32()?;
        self.take(n as usize)
    }

    /// Text, without the zero that closes it.
    pub fn string(&mut self) -> Option<&'a str> {
        let bytes = self.bytes()?;
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).ok()
    }

    /// The number of members of a sequence of which each takes at least `each` bytes.
    pub fn length(&mut self, each: usize) -> Option<usize> {
        let n = self.u32()? as usize;
        (n.checked_mul(each)? <= self.body.len() - self.at).then_some(n)
    }

    /// A sequence of numbers in double precision.
    pub fn f64s(&mut self) -> Option<Vec<f64>> {
        let n = self.length(8)?;
        (0..n).map(|_| self.f64()).collect()
    }

    /// A fixed number of numbers in double precision.
    pub fn f64_array<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Some(values)
    }

    /// `builtin_interfaces/Time` in nanoseconds; `None` also for one before 1970.
    pub fn time(&mut self) -> Option<u64> {
        let (seconds, nanos) = (self.i32()?, self.u32()?);
        u64::try_from(seconds).ok()?.checked_mul(1_000_000_000)?.checked_add(nanos.into())
    }

    /// `std_msgs/Header`: nanoseconds and a frame.
    pub fn header(&mut self) -> Option<(u64, &'a str)> {
        Some((self.time()?, self.string()?))
    }

    /// `geometry_msgs/Pose` or `Transform`: a position in metres and a rotation as it stands there.
    pub fn pose(&mut self) -> Option<(DVec3, DQuat)> {
        let [x, y, z] = self.f64_array()?;
        let turn = DQuat::from_array(self.f64_array()?);
        Some((DVec3::new(x, y, z), turn))
    }

    fn align(&mut self, size: usize) {
        self.at = self.at.next_multiple_of(size);
    }

    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let bytes = self.body.get(self.at..self.at.checked_add(n)?)?;
        self.at += n;
        Some(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mcap::Cdr;

    #[test]
    fn what_is_written_is_read_and_every_cut_is_seen() {
        let mut cdr = Cdr::new();
        cdr.header(1_500_000_002, "camera");
        cdr.f64s([1.5, -2.0].into_iter());
        cdr.pose(DVec3::X, DQuat::IDENTITY);
        let bytes = cdr.into_bytes();
        let read = |bytes: &[u8]| -> Option<(u64, String, Vec<f64>, DVec3)> {
            let mut reader = CdrReader::new(bytes)?;
            let (time, frame) = reader.header()?;
            Some((time, frame.to_owned(), reader.f64s()?, reader.pose()?.0))
        };
        let expected = (1_500_000_002, "camera".to_owned(), vec![1.5, -2.0], DVec3::X);
        assert_eq!(read(&bytes), Some(expected));
        for cut in 0..bytes.len() {
            assert_eq!(read(&bytes[..cut]), None, "cut at {cut}");
        }
    }

    #[test]
    fn both_byte_orders_are_read_and_lengths_that_lie_are_not_believed() {
        let mut reader = CdrReader::new(&[0, 0, 0, 0, 0, 0, 0, 7, 1]).unwrap();
        assert_eq!((reader.u32(), reader.u8(), reader.u8()), (Some(7), Some(1), None));
        let mut reader = CdrReader::new(&[0, 1, 0, 0, 255, 255, 255, 255]).unwrap();
        assert_eq!(reader.f64s(), None);
        assert!(CdrReader::new(&[0, 3, 0, 0]).is_none() && CdrReader::new(&[0, 1]).is_none());
    }
}
