//! Lines, words and numbers of the text formats.

use super::input::{Input, quote};
use crate::Result;

/// Iterates over lines ended by LF, CR LF or a lone CR, numbered from 1.
pub(crate) struct Lines<'a> {
    input: Input<'a>,
    offset: usize,
    number: usize,
}

/// One line without its ending.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a> {
    /// Number of the line, from 1.
    pub number: usize,
    /// Its bytes; text formats are ASCII where it matters, names and comments may be anything.
    pub text: &'a [u8],
}

impl<'a> Lines<'a> {
    /// Starts at byte `offset`, which is the first of line `number`.
    pub fn starting_at(input: Input<'a>, offset: usize, number: usize) -> Self {
        Self { input, offset, number: number - 1 }
    }

    /// The whole file, after a UTF-8 byte order mark if there is one. UTF-16 is refused: read as
    /// bytes it would look like a file without a single known word.
    pub fn new(input: Input<'a>) -> Result<Self> {
        let bytes = input.bytes;
        if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
            return Err(input.error(
                "byte 0",
                "text in ASCII or UTF-8",
                "a UTF-16 byte order mark",
            ));
        }
        let offset = if bytes.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 };
        Ok(Self::starting_at(input, offset, 1))
    }

    /// First byte of the line that comes next.
    pub fn offset(&self) -> usize {
        self.offset
    }

    /// Number of the line that comes next.
    pub fn next_number(&self) -> usize {
        self.number + 1
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        let rest = self.input.bytes.get(self.offset..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
        let ending = if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        self.offset += (end + ending).min(rest.len());
        self.number += 1;
        Some(Line { number: self.number, text: &rest[..end] })
    }
}

impl<'a> Line<'a> {
    /// Words separated by blanks.
    pub fn words(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        self.text.split(|b| b.is_ascii_whitespace()).filter(|word| !word.is_empty())
    }

    /// The line without what follows a `#`.
    pub fn without_comment(self) -> Self {
        let end = self.text.iter().position(|&b| b == b'#').unwrap_or(self.text.len());
        Self { text: &self.text[..end], ..self }
    }

    /// Place of this line in messages.
    pub fn place(&self) -> String {
        format!("line {}", self.number)
    }
}

/// A decimal number as C and Rust write them; `nan` and `inf` parse and are left to the checks of
/// the mesh. `None` for anything else: hexadecimal, a decimal comma, `1.#IND`, trailing letters.
pub(crate) fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A whole number; `None` also where it does not fit.
pub(crate) fn integer(word: &[u8]) -> Option<i64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A stream of words over the lines of a file: rows may run over line ends, and the rest of a line
/// can be asked for. Comments are cut where the format has them.
pub(crate) struct Words<'a> {
    input: Input<'a>,
    lines: Lines<'a>,
    comments: bool,
    line: Line<'a>,
}

impl<'a> Words<'a> {
    /// Words of the lines to come; with `comments`, `#` hides the rest of its line.
    pub fn new(input: Input<'a>, lines: Lines<'a>, comments: bool) -> Self {
        let line = Line { number: lines.number.max(1), text: &[] };
        Self { input, lines, comments, line }
    }

    /// Bytes not read yet, counting the rest of this line.
    pub fn bytes_left(&self) -> usize {
        self.line.text.len() + self.input.bytes.len().saturating_sub(self.lines.offset())
    }

    /// The next word on this line.
    pub fn next_on_line(&mut self) -> Option<&'a [u8]> {
        let text = self.line.text.trim_ascii_start();
        let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        let (word, rest) = text.split_at(end);
        self.line.text = rest;
        (!word.is_empty()).then_some(word)
    }

    /// The next word on this line or a later one.
    pub fn next_word(&mut self) -> Option<&'a [u8]> {
        self.peek_line()?;
        self.next_on_line()
    }

    /// What is left of the first line that has a word, that word first; nothing is consumed.
    pub fn peek_line(&mut self) -> Option<&'a [u8]> {
        while self.line.text.trim_ascii().is_empty() {
            let line = self.lines.next()?;
            self.line = if self.comments { line.without_comment() } else { line };
        }
        self.line.text = self.line.text.trim_ascii_start();
        Some(self.line.text)
    }

    /// Consumes bytes of the line that [`peek_line`](Self::peek_line) showed.
    pub fn skip_bytes(&mut self, n_bytes: usize) {
        self.line.text = self.line.text.get(n_bytes..).unwrap_or_default();
    }

    /// Drops what is left of this line and tells whether there was a word on it.
    pub fn finish_line(&mut self) -> bool {
        let more = !self.line.text.trim_ascii().is_empty();
        self.line.text = &[];
        more
    }

    /// Where the reading stands, for messages.
    pub fn place(&self) -> String {
        self.line.place()
    }

    /// The next word as a number called `what`.
    pub fn number(&mut self, what: &str) -> Result<f64> {
        let word = self.word(what)?;
        number(word).ok_or_else(|| self.unexpected(format!("a number ({what})"), word))
    }

    /// The next word as a whole number called `what`.
    pub fn integer(&mut self, what: &str) -> Result<i64> {
        let word = self.word(what)?;
        integer(word).ok_or_else(|| self.unexpected(format!("a whole number ({what})"), word))
    }

    fn word(&mut self, what: &str) -> Result<&'a [u8]> {
        self.next_word().ok_or_else(|| self.input.error(self.place(), what, "the end of the file"))
    }

    /// An error about a word at the current line.
    pub fn unexpected(&self, expected: impl Into<String>, found: &[u8]) -> crate::Error {
        self.input.error(self.place(), expected, quote(found))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn all_three_line_endings_count() {
        let input = Input { path: Path::new("x"), bytes: b"a\nb\r\nc\rd" };
        let lines: Vec<_> = Lines::new(input).unwrap().map(|l| (l.number, l.text)).collect();
        assert_eq!(lines, [(1, &b"a"[..]), (2, b"b"), (3, b"c"), (4, b"d")]);
    }

    #[test]
    fn numbers_are_decimal() {
        for good in ["1", "+1.", ".5", "-.8e-001", "1E2", "2.e1"] {
            assert!(number(good.as_bytes()).is_some(), "{good}");
        }
        for bad in ["0x1p3", "3.1+e2", "1,5", "1.#IND", "1f", "", ".", "1e", "--1"] {
            assert!(number(bad.as_bytes()).is_none(), "{bad}");
        }
    }

    #[test]
    fn words_run_over_lines_and_glued_words_come_apart() {
        let input = Input { path: Path::new("x"), bytes: b"OFF8 6 # no\n12" };
        let mut words = Words::new(input, Lines::new(input).unwrap(), true);
        assert!(words.peek_line().unwrap().starts_with(b"OFF"));
        words.skip_bytes(3);
        let rest: Vec<_> = std::iter::from_fn(|| words.next_word()).collect();
        assert_eq!(rest, [&b"8"[..], b"6", b"12"]);
        assert_eq!(words.place(), "line 2");
    }
}
