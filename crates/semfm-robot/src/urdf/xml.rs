//! The elements of an XML file as a flat list with line numbers, read under limits.
//!
//! `urdf-rs` builds a tree by recursion, expands whatever a document type declares and forgets where
//! things stood. So the text is first read here, by a streaming reader and without recursion: no
//! document type, no entities beyond the five of XML, bounded depth and counts.

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Decoder, Reader};

use super::fault::{Fault, quoted, short};

/// Largest file that is read: the largest of 160 robots in the wild has 148 kB.
pub(crate) const MAX_BYTES: u64 = 32 << 20;
/// Deepest nesting; URDF itself needs six levels, simulators' extensions some ten.
const MAX_DEPTH: usize = 64;
/// Most elements in a file.
const MAX_ELEMENTS: usize = 200_000;
/// Most attributes of one element.
const MAX_ATTRIBUTES: usize = 64;

/// An XML element with what we need of it.
#[derive(Debug)]
pub(crate) struct Element {
    /// Name as written, with its prefix.
    pub name: String,
    /// Names and values, entities resolved.
    pub attributes: Vec<(String, String)>,
    /// Elements inside, as places in the list.
    pub children: Vec<usize>,
    /// Line of its `<`, from 1.
    pub line: usize,
}

impl Element {
    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// Where it stands, in words.
    pub fn place(&self) -> String {
        match self.attribute("name") {
            Some(name) => format!("line {}: {} `{}`", self.line, self.name, short(name)),
            None => format!("line {}: {}", self.line, self.name),
        }
    }
}

/// All elements of a file in order, the root first.
#[derive(Debug)]
pub(crate) struct XmlElements {
    elements: Vec<Element>,
}

impl XmlElements {
    /// Reads a file's bytes.
    pub fn read(bytes: &[u8]) -> Result<Self, Fault> {
        let text = decode(bytes)?;
        let mut reader = Reader::from_str(text);
        let mut found = Self { elements: Vec::new() };
        let (mut open, mut lines) = (Vec::new(), Lines { text, position: 0, line: 1 });
        loop {
            let line = lines.at(reader.buffer_position() as usize);
            let event = reader.read_event().map_err(|error| malformed(line, error))?;
            match event {
                Event::Start(start) => {
                    found.push(&start, reader.decoder(), line, &open)?;
                    open.push(found.elements.len() - 1);
                }
                Event::Empty(start) => found.push(&start, reader.decoder(), line, &open)?,
                Event::End(_) => drop(open.pop()),
                Event::DocType(_) => {
                    let found = "a document type declaration";
                    return Err(Fault::new("dtd", format!("line {line}"), "plain XML", found));
                }
                Event::Decl(decl) => check_encoding(&decl, bytes)?,
                Event::GeneralRef(entity) => check_entity(&entity, line)?,
                Event::Eof => break,
                Event::Text(_) | Event::CData(_) | Event::Comment(_) | Event::PI(_) => {}
            }
        }
        if let Some(&last) = open.last() {
            let place = found.elements[last].place();
            return Err(Fault::new("xml", place, "an end tag", "the end of the file"));
        }
        Ok(found)
    }

    /// The outermost element.
    pub fn root(&self) -> Option<&Element> {
        self.elements.first()
    }

    /// The elements directly inside one.
    pub fn children<'a>(&'a self, of: &'a Element) -> impl Iterator<Item = &'a Element> {
        of.children.iter().map(|&child| &self.elements[child])
    }

    /// The first element of that name directly inside one.
    pub fn child<'a>(&'a self, of: &'a Element, name: &str) -> Option<&'a Element> {
        self.children(of).find(|child| child.name == name)
    }

    fn push(
        &mut self,
        start: &BytesStart<'_>,
        decoder: Decoder,
        line: usize,
        open: &[usize],
    ) -> Result<(), Fault> {
        if open.len() >= MAX_DEPTH {
            return Err(too_many("depth", line, "nested elements", MAX_DEPTH));
        }
        if self.elements.len() >= MAX_ELEMENTS {
            return Err(too_many("size", line, "elements", MAX_ELEMENTS));
        }
        let name = String::from_utf8_lossy(start.name().as_ref()).into_owned();
        let mut attributes = Vec::new();
        for attribute in start.attributes() {
            if attributes.len() >= MAX_ATTRIBUTES {
                return Err(too_many("size", line, "attributes of an element", MAX_ATTRIBUTES));
            }
            let attribute = attribute.map_err(|error| malformed(line, error))?;
            let key = String::from_utf8_lossy(attribute.key.as_ref()).into_owned();
            let value = attribute
                .decode_and_unescape_value(decoder)
                .map_err(|error| malformed(line, error))?;
            attributes.push((key, value.into_owned()));
        }
        let here = self.elements.len();
        match open.last() {
            Some(&parent) => self.elements[parent].children.push(here),
            None if here > 0 => {
                let found = format!("a second outermost element {}", quoted(&name));
                return Err(Fault::new("xml", format!("line {line}"), "one robot", found));
            }
            None => {}
        }
        self.elements.push(Element { name, attributes, children: Vec::new(), line });
        Ok(())
    }
}

fn malformed(line: usize, error: impl std::fmt::Display) -> Fault {
    Fault::new("xml", format!("line {line}"), "well-formed XML", error)
}

fn too_many(code: &'static str, line: usize, what: &str, most: usize) -> Fault {
    let (expected, found) = (format!("at most {most} {what}"), format!("more {what}"));
    Fault::new(code, format!("line {line}"), expected, found)
}

fn not_utf8(place: String, found: &str) -> Fault {
    Fault::new("encoding", place, "UTF-8", found)
}

/// The bytes as UTF-8, without a byte order mark.
fn decode(bytes: &[u8]) -> Result<&str, Fault> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(not_utf8("byte 0".into(), "a byte order mark of UTF-16"));
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        not_utf8(format!("byte {}", error.valid_up_to()), "bytes that are not UTF-8")
    })?;
    if let Some(byte) = text.find('\0') {
        return Err(not_utf8(format!("byte {byte}"), "a zero byte"));
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(Fault::new("root", "whole file", "an element `robot`", "nothing"));
    }
    Ok(text)
}

/// A declared encoding must be the one that we read; in pure ASCII they all agree.
fn check_encoding(
    declaration: &quick_xml::events::BytesDecl<'_>,
    bytes: &[u8],
) -> Result<(), Fault> {
    let Some(Ok(encoding)) = declaration.encoding() else { return Ok(()) };
    let name = String::from_utf8_lossy(&encoding).to_ascii_lowercase();
    if name == "utf-8" || name == "utf8" || bytes.is_ascii() && !name.starts_with("utf-16") {
        return Ok(());
    }
    Err(Fault::new("encoding", "XML declaration", "UTF-8", quoted(&name)))
}

/// References in text: to characters and to the five names that XML itself defines.
fn check_entity(entity: &quick_xml::events::BytesRef<'_>, line: usize) -> Result<(), Fault> {
    let name: &[u8] = entity;
    if entity.is_char_ref() || [&b"lt"[..], b"gt", b"amp", b"quot", b"apos"].contains(&name) {
        return Ok(());
    }
    let found = format!("the entity {}", quoted(&String::from_utf8_lossy(name)));
    Err(Fault::new("xml", format!("line {line}"), "no entities", found))
}

/// Line numbers of places that only grow.
struct Lines<'a> {
    text: &'a str,
    position: usize,
    line: usize,
}

impl Lines<'_> {
    fn at(&mut self, position: usize) -> usize {
        let position = position.min(self.text.len()).max(self.position);
        let passed = &self.text.as_bytes()[self.position..position];
        self.line += passed.iter().filter(|&&byte| byte == b'\n').count();
        self.position = position;
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(text: &str) -> &'static str {
        XmlElements::read(text.as_bytes()).unwrap_err().code
    }

    #[test]
    fn elements_keep_order_line_and_attributes() {
        let text =
            "<?xml version=\"1.0\"?>\n<robot name=\"a&amp;b\">\n  <link name='l'/>\n</robot>";
        let elements = XmlElements::read(text.as_bytes()).unwrap();
        let root = elements.root().unwrap();
        assert_eq!((root.line, root.attribute("name")), (2, Some("a&b")));
        let link = elements.child(root, "link").unwrap();
        assert_eq!((link.line, link.attribute("name")), (3, Some("l")));
        assert_eq!(link.place(), "line 3: link `l`");
    }

    #[test]
    fn nested_entities_depth_and_unknown_entities_are_refused() {
        let laughs =
            "<!DOCTYPE r [<!ENTITY a \"lol\"><!ENTITY b \"&a;&a;\">]><robot name=\"&b;\"/>";
        assert_eq!(code(laughs), "dtd");
        assert_eq!(code("<robot name=\"&b;\"/>"), "xml");
        assert_eq!(code("<robot>&b;</robot>"), "xml");
        assert_eq!(code(&format!("<robot>{}", "<a>".repeat(100_000))), "depth");
        assert_eq!(code("<robot><a></robot>"), "xml");
        assert_eq!(code("<robot><a>"), "xml");
        assert_eq!(code("<robot a='1' a='2'/>"), "xml");
        assert_eq!(code("<robot/><robot/>"), "xml");
        assert_eq!(code(" \n"), "root");
    }

    #[test]
    fn other_encodings_are_named_as_such() {
        let utf16: Vec<u8> = [0xff, 0xfe, b'<', 0].into();
        assert_eq!(XmlElements::read(&utf16).unwrap_err().code, "encoding");
        assert_eq!(XmlElements::read(b"<robot name='\xe9'/>").unwrap_err().code, "encoding");
        assert_eq!(code("<?xml version='1.0' encoding='latin1'?><robot name='é'/>"), "encoding");
        assert!(XmlElements::read(b"<?xml version='1.0' encoding='latin1'?><robot/>").is_ok());
    }
}
