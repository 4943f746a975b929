//! The header of a PLY file: what each row of each element holds.

use crate::Result;
use crate::io::input::{Input, quote};
use crate::io::text::{Line, Lines};

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// The number types, with either of their two names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of one number in a binary body.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// True for the whole-number types.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// One value, or list of values, in each row of an element.
#[derive(Clone, Debug)]
pub(crate) struct Property {
    pub name: String,
    /// Type of the length, for a list.
    pub length: Option<Scalar>,
    /// Type of the value or of the list's items.
    pub scalar: Scalar,
}

/// A table: `count` rows of the properties.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// Everything up to `end_header`.
pub(crate) struct Header<'a> {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// The lines after the header, for an ascii body.
    pub lines: Lines<'a>,
}

impl<'a> Header<'a> {
    /// Parses the header (G. Turk, *The PLY polygon file format*, 1994). Line ends are LF, CR LF
    /// or CR, as the first line has them: a binary body may begin with either byte.
    pub fn parse(input: Input<'a>) -> Result<Self> {
        let mut lines = Lines::starting_at(input, 0, 1);
        let first = lines.next().map_or(&b""[..], |line| line.text);
        if first != b"ply" {
            return Err(input.error("line 1", "the word ply", quote(first)));
        }
        let lone_cr = input.bytes.get(3..5).is_some_and(|end| end[0] == b'\r' && end[1] != b'\n');
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let start = lines.offset();
            let Some(line) = lines.next() else {
                return Err(input.error("header", "end_header", "the end of the file"));
            };
            let words: Vec<&[u8]> = line.words().take(6).collect();
            match words[..] {
                [] | [b"comment" | b"obj_info", ..] => {}
                [b"format", name, b"1.0"] if encoding.is_none() => {
                    encoding = Some(encoding_from_name(input, line, name)?);
                }
                [b"element", name, count] => {
                    let element = element(input, line, &elements, name, count)?;
                    elements.push(element);
                }
                [b"property", ref property @ ..] => {
                    let Some(element) = elements.last_mut() else {
                        return Err(input.error(
                            line.place(),
                            "an element before its properties",
                            quote(line.text),
                        ));
                    };
                    let property = parse_property(input, line, element, property)?;
                    element.properties.push(property);
                }
                [b"end_header"] => {
                    let Some(encoding) = encoding else {
                        return Err(input.error("header", "a line `format … 1.0`", "none"));
                    };
                    if lone_cr {
                        let offset = start + line.text.len() + 1;
                        lines = Lines::starting_at(input, offset, line.number + 1);
                    }
                    return Ok(Self { encoding, elements, lines });
                }
                _ => {
                    return Err(input.error(
                        line.place(),
                        "a line of a PLY 1.0 header",
                        quote(line.text),
                    ));
                }
            }
        }
    }
}

fn encoding_from_name(input: Input<'_>, line: Line<'_>, name: &[u8]) -> Result<Encoding> {
    match name {
        b"ascii" => Ok(Encoding::Ascii),
        b"binary_little_endian" => Ok(Encoding::Little),
        b"binary_big_endian" => Ok(Encoding::Big),
        _ => Err(input.error(
            line.place(),
            "ascii, binary_little_endian or binary_big_endian",
            quote(name),
        )),
    }
}

fn element(
    input: Input<'_>,
    line: Line<'_>,
    elements: &[Element],
    name: &[u8],
    count: &[u8],
) -> Result<Element> {
    let name = String::from_utf8_lossy(name).into_owned();
    if elements.iter().any(|element| element.name == name) {
        return Err(input.error(
            line.place(),
            "each element once",
            format!("a second element {name}"),
        ));
    }
    let count =
        std::str::from_utf8(count).ok().and_then(|text| text.parse().ok()).ok_or_else(|| {
            input.error(line.place(), format!("the number of rows of element {name}"), quote(count))
        })?;
    Ok(Element { name, count, properties: Vec::new() })
}

fn scalar(input: Input<'_>, line: Line<'_>, name: &[u8]) -> Result<Scalar> {
    Scalar::from_name(name)
        .ok_or_else(|| input.error(line.place(), "a PLY number type", quote(name)))
}

fn parse_property(
    input: Input<'_>,
    line: Line<'_>,
    element: &Element,
    words: &[&[u8]],
) -> Result<Property> {
    let (length, kind, name) = match *words {
        [b"list", length, kind, name] => {
            (Some(scalar(input, line, length)?), scalar(input, line, kind)?, name)
        }
        [kind, name] => (None, scalar(input, line, kind)?, name),
        _ => {
            return Err(input.error(
                line.place(),
                "the type and the name of a property",
                quote(line.text),
            ));
        }
    };
    if length.is_some_and(|length| !length.is_integer()) {
        return Err(input.error(
            line.place(),
            "a whole-number type for a list's length",
            quote(line.text),
        ));
    }
    let name = String::from_utf8_lossy(name).into_owned();
    if element.properties.iter().any(|property| property.name == name) {
        let found = format!("a second property {name}");
        return Err(input.error(
            line.place(),
            format!("each property of {} once", element.name),
            found,
        ));
    }
    Ok(Property { name, length, scalar: kind })
}
