//! Text of others, made safe for a terminal.

use std::borrow::Cow;
use std::fmt::Write;

/// The text without anything that a terminal would obey: control characters other than the line
/// feed and the tab, and characters that turn the direction of writing, become `\u001b` and the
/// like. Other text stays as it is, and so do the values of JSON: the form is JSON's own.
///
/// Whatever prints text that comes from a file, a model or a file's name passes it through here.
///
/// ```
/// use semfm_geom::io::printable;
/// assert_eq!(printable("mug 50 µm"), "mug 50 µm");
/// assert_eq!(printable("\x1b]0;owned\x07"), "\\u001b]0;owned\\u0007");
/// ```
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_obeyed(c) {
            // All of them are below U+10000; writing to a string does not fail.
            let _ = write!(safe, "\\u{:04x}", u32::from(c));
        } else {
            safe.push(c);
        }
    }
    Cow::Owned(safe)
}

/// As [`printable`], on one line: line feeds and tabs are written out, too. For names.
pub fn printable_name(text: &str) -> Cow<'_, str> {
    if !text.contains(['\n', '\t']) {
        return printable(text);
    }
    Cow::Owned(printable(text).replace('\n', "\\n").replace('\t', "\\t"))
}

/// Whether a terminal obeys the character instead of showing it: C0 and C1 controls, DEL, and the
/// embeddings, overrides and isolates of the bidirectional algorithm.
fn is_obeyed(c: char) -> bool {
    (c.is_control() && c != '\n' && c != '\t')
        || matches!(c, '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_control_character_is_left_and_json_stays_json() {
        let everything: String = (0..0x3000u32).filter_map(char::from_u32).collect();
        let safe = printable(&everything);
        assert!(!safe.contains(|c: char| c.is_control() && c != '\n' && c != '\t'));
        assert!(!safe.contains('\u{202e}') && safe.contains('é') && safe.contains('→'));
        let json = serde_json::to_string(&everything).unwrap();
        let back: String = serde_json::from_str(&printable(&json)).unwrap();
        assert_eq!(back, everything);
        assert_eq!(printable_name("a\nerror: b"), "a\\nerror: b");
    }
}
