//! The body of a PLY file: numbers one after the other, whatever the encoding.

use super::header::{Element, Encoding, Header, Property, Scalar};
use crate::Result;
use crate::io::input::{Input, quote};
use crate::io::text::{Words, number};

/// A cursor over the values of all rows.
///
/// Every PLY number fits a f64 exactly, so that is what comes out.
pub(crate) struct Body<'a> {
    input: Input<'a>,
    source: Source<'a>,
    /// The row being read, for messages.
    element: String,
    row: usize,
}

enum Source<'a> {
    Text(Words<'a>),
    Binary { offset: usize, big_endian: bool },
}

impl<'a> Body<'a> {
    /// The body after `header`.
    pub fn new(input: Input<'a>, header: Header<'a>) -> Self {
        let offset = header.lines.offset();
        let source = match header.encoding {
            Encoding::Ascii => Source::Text(Words::new(input, header.lines, false)),
            encoding => Source::Binary { offset, big_endian: encoding == Encoding::Big },
        };
        Self { input, source, element: String::new(), row: 0 }
    }

    /// Begins a table: its row count must be one that the rest of the file can hold.
    pub fn begin(&mut self, element: &Element) -> Result<()> {
        self.element.clone_from(&element.name);
        self.row = 0;
        // The least that a row takes: its scalars and empty lists.
        let row: usize = match self.source {
            Source::Text(_) => 2 * element.properties.len(), // a digit and a blank each
            Source::Binary { .. } => {
                let lengths = element.properties.iter().map(|p| p.length.unwrap_or(p.scalar));
                lengths.map(Scalar::size).sum()
            }
        };
        if row == 0 && element.count > 0 {
            let found = format!("element {} without properties", element.name);
            return Err(self.input.error(
                "header",
                "properties for every element with rows",
                found,
            ));
        }
        // The last line of an ascii file may lack its end.
        if element.count.saturating_mul(row) > self.bytes_left() + 1 {
            let expected = format!("{} rows of element {}", element.count, element.name);
            return Err(self.input.error(
                self.place(),
                expected,
                format!("only {} bytes more", self.bytes_left()),
            ));
        }
        Ok(())
    }

    fn bytes_left(&self) -> usize {
        match &self.source {
            Source::Text(words) => words.bytes_left(),
            Source::Binary { offset, .. } => self.input.bytes.len().saturating_sub(*offset),
        }
    }

    /// Where the reading stands, for messages.
    pub fn place(&self) -> String {
        match &self.source {
            Source::Text(words) => format!("{}, {} {}", words.place(), self.element, self.row),
            Source::Binary { offset, .. } => {
                format!("byte {offset}, {} {}", self.element, self.row)
            }
        }
    }

    /// The next value.
    pub fn scalar(&mut self, kind: Scalar) -> Result<f64> {
        match &mut self.source {
            Source::Text(words) => match words.next_word() {
                Some(word) => number(word)
                    .ok_or_else(|| self.input.error(self.place(), "a number", quote(word))),
                None => Err(self.input.error(self.place(), "a number", "the end of the file")),
            },
            Source::Binary { offset, big_endian } => {
                let size = kind.size();
                let Some(bytes) = self.input.bytes.get(*offset..*offset + size) else {
                    return Err(self.input.error(
                        self.place(),
                        format!("{size} bytes"),
                        "the end of the file",
                    ));
                };
                let mut little = [0; 8];
                little[..size].copy_from_slice(bytes);
                if *big_endian {
                    little[..size].reverse();
                }
                *offset += size;
                Ok(decode(kind, little))
            }
        }
    }

    /// The length of the list that comes next: a whole number that the rest of the file can hold.
    pub fn length(&mut self, length: Scalar, item: Scalar) -> Result<usize> {
        let given = self.scalar(length)?;
        let least = if matches!(self.source, Source::Text(_)) { 1 } else { item.size() };
        if given < 0.0 || given.fract() != 0.0 || given.is_nan() {
            return Err(self.input.error(
                self.place(),
                "the length of a list",
                format!("{given:?}"),
            ));
        }
        let n_items = given as usize; // saturates, and then the next check refuses it
        if n_items.saturating_mul(least) > self.bytes_left() {
            let found = format!("only {} bytes more", self.bytes_left());
            return Err(self.input.error(self.place(), format!("a list of {n_items}"), found));
        }
        Ok(n_items)
    }

    /// Reads a property nobody wants.
    pub fn skip(&mut self, property: &Property) -> Result<()> {
        let n_items = match property.length {
            Some(length) => self.length(length, property.scalar)?,
            None => 1,
        };
        (0..n_items).try_for_each(|_| self.scalar(property.scalar).map(drop))
    }

    /// Ends a row. In ascii the line must end with it: values that the header does not declare
    /// mean that it describes another table, and then nothing in it can be trusted.
    pub fn end_row(&mut self) -> Result<()> {
        if let Source::Text(words) = &mut self.source
            && words.finish_line()
        {
            let expected = "the end of the line after the declared properties";
            return Err(self.input.error(self.place(), expected, "more values"));
        }
        self.row += 1;
        Ok(())
    }
}

/// The number in the first bytes of `little`.
fn decode(kind: Scalar, little: [u8; 8]) -> f64 {
    let [a, b, c, d, ..] = little;
    match kind {
        Scalar::I8 => f64::from(i8::from_le_bytes([a])),
        Scalar::U8 => f64::from(a),
        Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
        Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
        Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
        Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
        Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
        Scalar::F64 => f64::from_le_bytes(little),
    }
}
