//! The bytes of a chunk, decompressed within limits.

use std::io::Read;

use super::record::Place;
use crate::{Fault, Result};

/// A chunk may decompress to this much whatever the size of its file,
const CHUNK_BYTES: usize = 16 << 20;
/// or to this many times the size of its file,
const CHUNK_PER_FILE_BYTE: usize = 16;
/// but never to more than this.
///
/// Real recorders make chunks of 1 to 10 MB. The limits keep the reader's memory in proportion to
/// its file: 32 KB of zstd can hold a gigabyte.
const CHUNK_BYTES_AT_MOST: usize = 256 << 20;

/// Decompresses `stored`, which must give exactly `size` bytes, into `buffer`, or returns it as it is
/// where there is no compression.
///
/// # Errors
/// [`Fault::OverLimit`] for sizes over the limits (before anything is allocated),
/// [`Fault::Unsupported`] for unknown compressions, [`Fault::Decompress`] for broken streams, and
/// [`Fault::Size`] for those that give another size.
pub(super) fn decompress<'a>(
    compression: &str,
    stored: &'a [u8],
    size: u64,
    file_bytes: usize,
    buffer: &'a mut Vec<u8>,
    place: Place<'_>,
) -> Result<&'a [u8]> {
    if compression.is_empty() {
        return match stored.len() as u64 == size {
            true => Ok(stored),
            false => {
                let found = format!("{} stored without compression", stored.len());
                Err(wrong_size(place, size, found))
            }
        };
    }
    if !matches!(compression, "lz4" | "zstd") {
        let expected = "compression `lz4`, `zstd` or none";
        return Err(place.error(Fault::Unsupported, expected, format!("`{compression}`")));
    }
    if stored.is_empty() && size == 0 {
        return Ok(stored);
    }
    let limit =
        file_bytes.saturating_mul(CHUNK_PER_FILE_BYTE).clamp(CHUNK_BYTES, CHUNK_BYTES_AT_MOST);
    let length = usize::try_from(size).ok().filter(|&length| length <= limit).ok_or_else(|| {
        place.error(Fault::OverLimit, format!("at most {limit} bytes decompressed"), size)
    })?;
    buffer.resize(length, 0);
    let written = match compression {
        "zstd" => fill_from_zstd(stored, buffer),
        _ => fill_from_lz4(stored, buffer),
    };
    match written {
        Ok(Written::All) => Ok(buffer),
        Ok(Written::Other(found)) => Err(wrong_size(place, size, found)),
        Err(error) => {
            let expected = format!("a sound {compression} stream");
            Err(place.error(Fault::Decompress, expected, error))
        }
    }
}

/// How much a stream gave.
enum Written {
    /// Exactly what was to be filled.
    All,
    /// Another number of bytes, in words.
    Other(String),
}

/// In one go: the streaming decoder would allocate whatever window the stream demands.
fn fill_from_zstd(stored: &[u8], buffer: &mut [u8]) -> std::io::Result<Written> {
    let written = zstd::bulk::decompress_to_buffer(stored, buffer)?;
    Ok(if written == buffer.len() { Written::All } else { Written::Other(written.to_string()) })
}

fn fill_from_lz4(stored: &[u8], buffer: &mut [u8]) -> std::io::Result<Written> {
    let mut decoder = lz4::Decoder::new(stored)?;
    let mut written = 0;
    while written < buffer.len() {
        match decoder.read(&mut buffer[written..])? {
            0 => return Ok(Written::Other(written.to_string())),
            n => written += n,
        }
    }
    if decoder.read(&mut [0])? != 0 {
        return Ok(Written::Other("more".to_owned()));
    }
    decoder.finish().1?;
    Ok(Written::All)
}

fn wrong_size(place: Place<'_>, size: u64, found: String) -> crate::Error {
    place.error(Fault::Size, format!("{size} bytes decompressed"), found)
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::path::Path;

    use super::*;

    fn unpack(compression: &str, stored: &[u8], size: u64) -> Result<Vec<u8>> {
        let place = Place { path: Path::new("a.mcap"), opcode: None, offset: 0, chunk: None };
        let mut buffer = Vec::new();
        decompress(compression, stored, size, stored.len(), &mut buffer, place).map(<[u8]>::to_vec)
    }

    fn code(compression: &str, stored: &[u8], size: u64) -> &'static str {
        unpack(compression, stored, size).unwrap_err().code()
    }

    fn lz4(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
        encoder.write_all(bytes).unwrap();
        encoder.finish().0
    }

    #[test]
    fn every_compression_gives_its_bytes_back_and_refuses_another_size() {
        let bytes: Vec<u8> = (0..100_000u32).map(|i| (i / 7) as u8).collect();
        let zstd = zstd::bulk::compress(&bytes, 1).unwrap();
        for (name, stored) in [("", bytes.clone()), ("lz4", lz4(&bytes)), ("zstd", zstd)] {
            assert_eq!(unpack(name, &stored, 100_000).unwrap(), bytes, "{name}");
            assert!(matches!(code(name, &stored, 99_999), "size" | "decompress"), "{name}");
            assert_eq!(code(name, &stored, 100_001), "size", "{name}");
        }
    }

    #[test]
    fn a_declared_size_over_the_limit_is_refused_unallocated() {
        for name in ["lz4", "zstd"] {
            assert_eq!(code(name, &[0; 400], 8 << 30), "over-limit", "{name}");
        }
    }

    #[test]
    fn broken_streams_and_unknown_names_are_refused() {
        let cut = &lz4(&[7; 1000])[..20];
        assert!(matches!(code("lz4", cut, 1000), "decompress" | "size"));
        assert_eq!(code("zstd", b"this is no frame", 10), "decompress");
        assert_eq!(code("brotli", &[], 0), "unsupported");
    }
}
