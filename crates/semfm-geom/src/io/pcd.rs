//! PCD, the point-cloud files of PCL: ascii, binary and compressed.
//!
//! Format: R. B. Rusu et al., *The PCD (Point Cloud Data) file format*, version .7. Fields other
//! than `x`, `y`, `z` and `rgb`/`rgba` are skipped. PCL marks a pixel without a return by NaN
//! coordinates; such rows are no points and are left out, while an infinite one is refused.

use super::PointCloud;
use super::input::{Input, quote};
use super::text::{Line, Lines, number};
use crate::math::DVec3;
use crate::{Error, Result};

/// Whether the file is a PCD, by its extension or by its first line.
pub(crate) fn is_pcd(input: Input<'_>) -> bool {
    let named = input.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("pcd"));
    named || input.bytes.starts_with(b"# .PCD")
}

/// Reads the points of a PCD file and, where it has them, their colours.
pub(crate) fn read_points(input: Input<'_>) -> Result<PointCloud> {
    let header = Header::parse(input)?;
    let rows = match header.data {
        Data::Ascii => header.ascii_rows(input)?,
        Data::Binary => header.binary_rows(input)?,
        Data::Compressed => header.compressed_rows(input)?,
    };
    let mut cloud = PointCloud { points: Vec::with_capacity(rows.len()), colors: None };
    let mut colors = Vec::new();
    for row in rows {
        // One coordinate that is no number makes the row no point.
        if !row.point.is_nan() {
            cloud.points.push(row.point);
            colors.extend(row.color);
        }
    }
    cloud.colors = header.rgb.map(|_| colors);
    Ok(cloud)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Data {
    Ascii,
    Binary,
    Compressed,
}

/// One field: `count` numbers of `size` bytes.
#[derive(Clone, Debug)]
struct Field {
    name: String,
    size: usize,
    kind: u8,
    count: usize,
    /// Bytes of a row before this field.
    offset: usize,
    /// Numbers of a row before this field.
    column: usize,
}

struct Header<'a> {
    fields: Vec<Field>,
    xyz: [usize; 3],
    rgb: Option<usize>,
    n_points: usize,
    data: Data,
    body: Lines<'a>,
}

#[derive(Clone, Copy)]
struct Row {
    point: DVec3,
    color: Option<[u8; 4]>,
}

impl<'a> Header<'a> {
    fn parse(input: Input<'a>) -> Result<Self> {
        let mut lines = Lines::new(input)?;
        let (mut names, mut sizes, mut kinds, mut counts) = (None, None, None, None);
        let (mut n_points, mut width, mut height) = (None, None, Some(1));
        let data = loop {
            let Some(line) = lines.next() else {
                return Err(input.error("header", "a line DATA", "the end of the file"));
            };
            let line = line.without_comment();
            let mut words = line.words();
            let Some(key) = words.next() else { continue };
            let rest: Vec<&[u8]> = words.collect();
            match key {
                b"VERSION" | b"VIEWPOINT" => {}
                b"FIELDS" | b"COLUMNS" => names = Some((line.number, rest)),
                b"SIZE" => sizes = Some(whole_numbers(input, line, &rest)?),
                b"TYPE" => kinds = Some(rest),
                b"COUNT" => counts = Some(whole_numbers(input, line, &rest)?),
                b"WIDTH" => width = whole_numbers(input, line, &rest)?.first().copied(),
                b"HEIGHT" => height = whole_numbers(input, line, &rest)?.first().copied(),
                b"POINTS" => n_points = whole_numbers(input, line, &rest)?.first().copied(),
                b"DATA" => break data(input, line, &rest)?,
                _ => return Err(input.error(line.place(), "a line of a PCD header", quote(key))),
            }
        };
        let (line, names) = names.ok_or_else(|| missing_line(input, "FIELDS"))?;
        let sizes = sizes.ok_or_else(|| missing_line(input, "SIZE"))?;
        let kinds = kinds.ok_or_else(|| missing_line(input, "TYPE"))?;
        let counts = counts.unwrap_or_else(|| vec![1; names.len()]);
        for (what, found) in [("SIZE", sizes.len()), ("TYPE", kinds.len()), ("COUNT", counts.len())]
        {
            if found != names.len() {
                let expected = format!("{} entries, as FIELDS has", names.len());
                return Err(input.error(format!("header, {what}"), expected, found.to_string()));
            }
        }
        let grid = width.zip(height).and_then(|(w, h)| w.checked_mul(h));
        let n_points = n_points.or(grid).ok_or_else(|| missing_line(input, "POINTS"))?;
        if grid.is_some_and(|grid| grid != n_points) {
            let expected = format!("{n_points}, the number of POINTS");
            return Err(input.error("header, WIDTH × HEIGHT", expected, format!("{grid:?}")));
        }
        let fields = fields(input, line, &names, &sizes, &kinds, &counts)?;
        let [x, y, z, rgb, rgba] = ["x", "y", "z", "rgb", "rgba"]
            .map(|name| fields.iter().position(|f| f.name == name && f.count == 1));
        let (Some(x), Some(y), Some(z)) = (x, y, z) else {
            return Err(input.error(format!("line {line}"), "fields x, y and z", "other ones"));
        };
        let rgb = rgb.or(rgba).filter(|&f| fields[f].size == 4);
        Ok(Self { xyz: [x, y, z], rgb, n_points, data, body: lines, fields })
    }

    fn row_bytes(&self) -> usize {
        self.fields.iter().map(|f| f.size * f.count).sum()
    }

    fn ascii_rows(&self, input: Input<'_>) -> Result<Vec<Row>> {
        let n_columns: usize = self.fields.iter().map(|f| f.count).sum();
        let mut rows = Vec::new();
        let lines = Lines::starting_at(input, self.body.offset(), self.body.next_number());
        for line in lines {
            let words: Vec<&[u8]> = line.words().collect();
            if words.is_empty() {
                continue;
            }
            if words.len() != n_columns || rows.len() == self.n_points {
                let expected = if rows.len() == self.n_points {
                    format!("the end after {} points", self.n_points)
                } else {
                    format!("{n_columns} numbers")
                };
                return Err(input.error(line.place(), expected, quote(line.text)));
            }
            let mut xyz = [0.0; 3];
            for (value, field) in xyz.iter_mut().zip(self.xyz) {
                *value = number_of(input, line, words[self.fields[field].column])?;
            }
            let color = match self.rgb {
                Some(field) => {
                    let value = number_of(input, line, words[self.fields[field].column])?;
                    Some(self.color_from_text(field, value))
                }
                None => None,
            };
            rows.push(Row { point: DVec3::from_array(xyz), color });
        }
        self.count(input, rows.len())?;
        Ok(rows)
    }

    /// Ascii files write the packed colour as the float of its bits (type F) or as a whole number.
    fn color_from_text(&self, field: usize, value: f64) -> [u8; 4] {
        let bits =
            if self.fields[field].kind == b'F' { (value as f32).to_bits() } else { value as u32 };
        rgba(bits)
    }

    fn binary_rows(&self, input: Input<'_>) -> Result<Vec<Row>> {
        let start = self.body.offset();
        let held = input.bytes.len().saturating_sub(start) / self.row_bytes();
        if held < self.n_points {
            self.count(input, held)?;
        }
        let row_bytes = self.row_bytes();
        Ok(self.rows_at(input.bytes, |row, field| start + row * row_bytes + field.offset))
    }

    /// Compressed files hold the fields one after the other (structure of arrays), packed by LZF.
    fn compressed_rows(&self, input: Input<'_>) -> Result<Vec<Row>> {
        let start = self.body.offset();
        let place = format!("byte {start}");
        let (Some(packed), Some(unpacked)) =
            (size_at(input.bytes, start), size_at(input.bytes, start + 4))
        else {
            return Err(input.error(place, "two sizes of 4 bytes", input.left_after(start)));
        };
        let wanted = self.n_points.checked_mul(self.row_bytes());
        if wanted != Some(unpacked) {
            let expected = format!("{} points of {} bytes", self.n_points, self.row_bytes());
            return Err(input.error(place, expected, format!("{unpacked} bytes unpacked")));
        }
        let Some(body) = input.bytes.get(start + 8..).and_then(|rest| rest.get(..packed)) else {
            return Err(input.error(place, format!("{packed} bytes"), input.left_after(start + 8)));
        };
        // LZF gains at most 264 bytes from three: a larger claim is refused before memory is asked.
        if unpacked > 88 * packed + 264 {
            return Err(input.error(
                place,
                "a size that LZF can reach",
                format!("{unpacked} bytes out of {packed}"),
            ));
        }
        let bytes = unpack_lzf(body, unpacked)
            .ok_or_else(|| input.error(place, "LZF data", "a broken stream"))?;
        Ok(self.rows_at(&bytes, |row, field| {
            self.n_points * field.offset + row * field.size * field.count
        }))
    }

    fn rows_at(&self, bytes: &[u8], at: impl Fn(usize, &Field) -> usize) -> Vec<Row> {
        (0..self.n_points)
            .map(|row| {
                let [x, y, z] = self.xyz.map(|field| {
                    let field = &self.fields[field];
                    field.value(&bytes[at(row, field)..])
                });
                let color = self.rgb.map(|field| {
                    let at = at(row, &self.fields[field]);
                    rgba(u32::from_le_bytes([
                        bytes[at],
                        bytes[at + 1],
                        bytes[at + 2],
                        bytes[at + 3],
                    ]))
                });
                Row { point: DVec3::new(x, y, z), color }
            })
            .collect()
    }

    fn count(&self, input: Input<'_>, found: usize) -> Result<()> {
        if found == self.n_points {
            return Ok(());
        }
        let expected = format!("{} points, as POINTS says", self.n_points);
        Err(input.error("data", expected, format!("{found}")))
    }
}

impl Field {
    /// The first number of this field at the start of `bytes`.
    fn value(&self, bytes: &[u8]) -> f64 {
        let mut eight = [0; 8];
        eight[..self.size].copy_from_slice(&bytes[..self.size]);
        let unsigned = u64::from_le_bytes(eight);
        let shift = 64 - 8 * self.size as u32;
        match (self.kind, self.size) {
            (b'F', 4) => f64::from(f32::from_bits(unsigned as u32)),
            (b'F', _) => f64::from_bits(unsigned),
            (b'I', _) => (((unsigned << shift) as i64) >> shift) as f64,
            _ => unsigned as f64,
        }
    }
}

fn data(input: Input<'_>, line: Line<'_>, words: &[&[u8]]) -> Result<Data> {
    match words {
        [b"ascii"] => Ok(Data::Ascii),
        [b"binary"] => Ok(Data::Binary),
        [b"binary_compressed"] => Ok(Data::Compressed),
        _ => Err(input.error(
            line.place(),
            "DATA ascii, binary or binary_compressed",
            quote(line.text),
        )),
    }
}

fn whole_numbers(input: Input<'_>, line: Line<'_>, words: &[&[u8]]) -> Result<Vec<usize>> {
    let mut numbers = Vec::with_capacity(words.len());
    for word in words {
        let value = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        numbers.push(value.ok_or_else(|| input.error(line.place(), "whole numbers", quote(word)))?);
    }
    Ok(numbers)
}

fn missing_line(input: Input<'_>, keyword: &str) -> Error {
    input.error("header", format!("a line {keyword}"), "none")
}

fn number_of(input: Input<'_>, line: Line<'_>, word: &[u8]) -> Result<f64> {
    number(word).ok_or_else(|| input.error(line.place(), "a number", quote(word)))
}

/// The size that stands at `offset`; `None` beyond the end.
fn size_at(bytes: &[u8], offset: usize) -> Option<usize> {
    let bytes = bytes.get(offset..offset + 4)?;
    Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize)
}

fn fields(
    input: Input<'_>,
    line: usize,
    names: &[&[u8]],
    sizes: &[usize],
    kinds: &[&[u8]],
    counts: &[usize],
) -> Result<Vec<Field>> {
    let (mut offset, mut column) = (0usize, 0usize);
    let mut fields = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let kind = kinds[k].first().copied().unwrap_or_default();
        let known = match kind {
            b'F' => matches!(sizes[k], 4 | 8),
            b'I' | b'U' => matches!(sizes[k], 1 | 2 | 4 | 8),
            _ => false,
        };
        // A row of a megabyte is no row.
        if !known || kinds[k].len() != 1 || counts[k] > 1 << 17 || names.len() > 1 << 10 {
            let found = format!("{} of {} bytes × {}", quote(kinds[k]), sizes[k], counts[k]);
            let expected = "types F (4 or 8 bytes), I or U (1, 2, 4 or 8)";
            return Err(input.error(
                format!("line {line}, field {}", quote(name)),
                expected,
                found,
            ));
        }
        let name = String::from_utf8_lossy(name).into_owned();
        fields.push(Field { name, size: sizes[k], kind, count: counts[k], offset, column });
        offset += sizes[k] * counts[k];
        column += counts[k];
    }
    Ok(fields)
}

/// PCL packs a colour as 0xAARRGGBB; files without an alpha leave it 0, which means opaque.
fn rgba(bits: u32) -> [u8; 4] {
    let [b, g, r, a] = bits.to_le_bytes();
    [r, g, b, if a == 0 { 255 } else { a }]
}

/// LibLZF's stream (M. Lehmann): literal runs, and references to what was unpacked before.
fn unpack_lzf(packed: &[u8], n_bytes: usize) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(n_bytes);
    let mut bytes = packed.iter().copied();
    while let Some(control) = bytes.next() {
        if control < 32 {
            for _ in 0..=control {
                out.push(bytes.next()?);
            }
        } else {
            let mut length = usize::from(control >> 5);
            if length == 7 {
                length += usize::from(bytes.next()?);
            }
            let back = (usize::from(control & 31) << 8) + usize::from(bytes.next()?) + 1;
            let start = out.len().checked_sub(back)?;
            for k in 0..length + 2 {
                out.push(out[start + k]);
            }
        }
        if out.len() > n_bytes {
            return None;
        }
    }
    (out.len() == n_bytes).then_some(out)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn read(bytes: &[u8]) -> Result<PointCloud> {
        read_points(Input { path: Path::new("cloud.pcd"), bytes })
    }

    fn header(fields: &str, sizes: &str, types: &str, n: usize, data: &str) -> Vec<u8> {
        format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\n\
             WIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {data}\n"
        )
        .into_bytes()
    }

    #[test]
    fn the_three_encodings_hold_the_same_points_and_no_return_is_no_point() {
        let points = [[1.0f32, 2.0, 3.0], [f32::NAN; 3], [-0.5, 0.25, 8.0]];
        let rgb = 0x00ff_8001u32;
        let mut ascii = header("x y z rgb", "4 4 4 4", "F F F U", 3, "ascii");
        let mut binary = header("x y z rgb", "4 4 4 4", "F F F U", 3, "binary");
        for p in points {
            ascii.extend(format!("{} {} {} {rgb}\n", p[0], p[1], p[2]).bytes());
            binary.extend(p.iter().flat_map(|x| x.to_le_bytes()).chain(rgb.to_le_bytes()));
        }
        let mut columns = Vec::new();
        (0..3).for_each(|k| columns.extend(points.iter().flat_map(|p| p[k].to_le_bytes())));
        columns.extend([rgb; 3].iter().flat_map(|c| c.to_le_bytes()));
        // Literals for three columns and one colour, then a reference for the other two colours.
        let mut packed = Vec::new();
        for run in columns[..40].chunks(32) {
            packed.push(run.len() as u8 - 1);
            packed.extend(run);
        }
        packed.extend([6 << 5, 3]);
        let mut compressed = header("x y z rgb", "4 4 4 4", "F F F U", 3, "binary_compressed");
        compressed.extend((packed.len() as u32).to_le_bytes());
        compressed.extend((columns.len() as u32).to_le_bytes());
        compressed.extend(&packed);
        for bytes in [&ascii, &binary, &compressed] {
            let cloud = read(bytes).unwrap();
            assert_eq!(cloud.points, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-0.5, 0.25, 8.0)]);
            assert_eq!(cloud.colors, Some(vec![[255, 128, 1, 255]; 2]));
        }
        for cut in [1, 7, 30] {
            let error = read(&compressed[..compressed.len() - cut]).unwrap_err();
            assert!(error.to_string().contains("cloud.pcd: byte"), "{error}");
        }
    }

    #[test]
    fn faults_are_named() {
        let xyz = |data: &str, n: usize, body: &str| {
            let mut bytes = header("x y z", "4 4 4", "F F F", n, data);
            bytes.extend(body.bytes());
            bytes
        };
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        for (bytes, place) in [
            (text(xyz("ascii", 2, "1 2 3\n")), "data"),
            (text(xyz("ascii", 1, "1 2 3\n4 5 6\n")), "line 12"),
            (text(xyz("ascii", 1, "1 2\n")), "line 11"),
            (text(xyz("ascii", 1, "1 2 q\n")), "line 11"),
            (text(xyz("binary", 4_000_000_000, "123")), "data"),
            (text(xyz("magic", 1, "")), "line 10"),
            (text(header("x y q", "4 4 4", "F F F", 1, "ascii")), "line 3"),
            (text(header("x y z", "4 4", "F F F", 1, "ascii")), "header, SIZE"),
            (text(header("x y z", "4 4 3", "F F F", 1, "ascii")), "line 3, field `z`"),
            ("# .PCD v0.7\nVERSION 0.7\n".into(), "header"),
            ("# .PCD v0.7\nHELLO 1\n".into(), "line 2"),
        ] {
            let error = read(bytes.as_bytes()).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{bytes}: {error}");
        }
    }
}
