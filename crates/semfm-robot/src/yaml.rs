//! YAML as a tree of texts with line numbers, read under limits.
//!
//! The parser gives one event after the other and follows no alias; here depth, number of values and repeated keys are
//! bounded before a tree is built.

use std::collections::HashSet;

use saphyr_parser::{Event, Parser, ScanError, Span, StrInput};

use crate::urdf::{Fault, quoted, short};

/// Deepest nesting.
const MAX_DEPTH: usize = 32;
/// Most values in a file.
const MAX_VALUES: usize = 100_000;

/// A value with the line that it begins in, from 1.
#[derive(Debug)]
pub(crate) struct Yaml {
    pub line: usize,
    pub value: YamlValue,
}

/// What a value is. Texts are told as written: what number or flag one means is for whoever asks.
#[derive(Debug)]
pub(crate) enum YamlValue {
    Text(String),
    Sequence(Vec<Yaml>),
    Mapping(Vec<(String, Yaml)>),
}

impl Yaml {
    /// Reads the first document of a file.
    pub fn read(text: &str) -> Result<Self, Fault> {
        let mut reader = Reader { parser: Parser::new_from_str(text), n_values: 0 };
        loop {
            match reader.next()? {
                (Event::StreamStart | Event::DocumentStart(_) | Event::Nothing, _) => {}
                (Event::StreamEnd | Event::DocumentEnd, _) => {
                    return Err(Fault::new("yaml", "whole file", "a YAML document", "nothing"));
                }
                (event, span) => return reader.value(event, span, 0),
            }
        }
    }

    /// The values of a mapping, none for anything else.
    pub fn entries(&self) -> &[(String, Yaml)] {
        match &self.value {
            YamlValue::Mapping(entries) => entries,
            _ => &[],
        }
    }

    /// The value of a key of a mapping.
    pub fn get(&self, key: &str) -> Option<&Yaml> {
        self.entries().iter().find(|(own, _)| own == key).map(|(_, value)| value)
    }

    /// What it is, for a message.
    pub fn describe(&self) -> String {
        match &self.value {
            YamlValue::Text(text) => quoted(text),
            YamlValue::Sequence(values) => format!("a list of {}", values.len()),
            YamlValue::Mapping(entries) => format!("a mapping of {}", entries.len()),
        }
    }
}

struct Reader<'a> {
    parser: Parser<'a, StrInput<'a>>,
    n_values: usize,
}

impl<'a> Reader<'a> {
    fn next(&mut self) -> Result<(Event<'a>, Span), Fault> {
        match self.parser.next_event() {
            Some(event) => event.map_err(|error| malformed(&error)),
            None => Err(Fault::new("yaml", "end of the file", "a value", "nothing")),
        }
    }

    /// The value that begins with an event. Goes down by calls of itself, no deeper than [`MAX_DEPTH`].
    fn value(&mut self, event: Event<'a>, span: Span, depth: usize) -> Result<Yaml, Fault> {
        let line = span.start.line();
        self.n_values += 1;
        if depth > MAX_DEPTH {
            let expected = format!("at most {MAX_DEPTH} nested values");
            return Err(Fault::new("depth", format!("line {line}"), expected, "more"));
        }
        if self.n_values > MAX_VALUES {
            let expected = format!("at most {MAX_VALUES} values");
            return Err(Fault::new("size", format!("line {line}"), expected, "more"));
        }
        let value = match event {
            Event::Scalar(text, ..) => YamlValue::Text(text.into_owned()),
            Event::SequenceStart(..) => YamlValue::Sequence(self.sequence(depth)?),
            Event::MappingStart(..) => YamlValue::Mapping(self.mapping(depth)?),
            Event::Alias(_) => {
                return Err(Fault::new("yaml", format!("line {line}"), "no aliases", "an alias"));
            }
            _ => return Err(Fault::new("yaml", format!("line {line}"), "a value", "none")),
        };
        Ok(Yaml { line, value })
    }

    fn sequence(&mut self, depth: usize) -> Result<Vec<Yaml>, Fault> {
        let mut values = Vec::new();
        loop {
            match self.next()? {
                (Event::SequenceEnd, _) => return Ok(values),
                (event, span) => values.push(self.value(event, span, depth + 1)?),
            }
        }
    }

    fn mapping(&mut self, depth: usize) -> Result<Vec<(String, Yaml)>, Fault> {
        let (mut entries, mut keys) = (Vec::new(), HashSet::new());
        loop {
            let (event, span) = self.next()?;
            let line = span.start.line();
            let key = match event {
                Event::MappingEnd => return Ok(entries),
                Event::Scalar(key, ..) => key.into_owned(),
                _ => {
                    let place = format!("line {line}");
                    return Err(Fault::new("yaml", place, "a text as key", "something else"));
                }
            };
            if !keys.insert(key.clone()) {
                let place = format!("line {line}: {}", quoted(&key));
                return Err(Fault::new(
                    "duplicate-name",
                    place,
                    "keys that occur once",
                    "a second one",
                ));
            }
            let (event, span) = self.next()?;
            entries.push((key, self.value(event, span, depth + 1)?));
        }
    }
}

fn malformed(error: &ScanError) -> Fault {
    let place = format!("line {}", error.marker().line());
    Fault::new("yaml", place, "well-formed YAML", short(error.info()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(text: &str) -> &'static str {
        Yaml::read(text).unwrap_err().code
    }

    #[test]
    fn values_keep_text_and_line() {
        let yaml =
            Yaml::read("# a\nlimits:\n  one: {max: 2.50, list: [1, 2]}\n---\nother: 1\n").unwrap();
        let one = yaml.get("limits").and_then(|limits| limits.get("one")).unwrap();
        assert_eq!(one.line, 3);
        assert!(matches!(&one.get("max").unwrap().value, YamlValue::Text(text) if text == "2.50"));
        assert_eq!(one.get("list").unwrap().describe(), "a list of 2");
    }

    #[test]
    fn hostile_files_are_refused() {
        assert_eq!(code(&"[".repeat(MAX_DEPTH + 2)), "depth");
        // The parser's own limit.
        assert_eq!(code(&"[".repeat(100_000)), "yaml");
        assert_eq!(code(&format!("a: [{}]", "1,".repeat(200_000))), "size");
        assert_eq!(code("a: &x 1\nb: *x"), "yaml");
        assert_eq!(code("a: 1\na: 2"), "duplicate-name");
        assert_eq!(code("[a, b]: 1"), "yaml");
        assert_eq!(code("a: [1"), "yaml");
        assert_eq!(code(""), "yaml");
        assert_eq!(code("a: 'x"), "yaml");
    }
}
