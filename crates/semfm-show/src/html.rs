//! The few pieces that every HTML page of ours is made of: escaped text, pictures inside the page, the
//! policy that keeps everything else out, and a template that is filled in one pass.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use sha2::{Digest, Sha256};

/// Shaded surfaces on white show no blocks at this quality, and take a third of a PNG's bytes.
const JPEG_QUALITY: u8 = 84;

/// Text as it may stand between tags and in quoted attributes, of HTML and of SVG.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
}

/// The `meta` element of a page that loads nothing: what is drawn is in the page, one style sheet and one
/// program are known by the SHA-256 of what stands between their tags, and no other is applied or run
/// (W3C, "Content Security Policy Level 3", section 6.7). Style attributes are not applied either.
pub fn policy(style: &str, script: &str) -> String {
    let [style, script] = [style, script].map(|text| base64(&Sha256::digest(text)));
    format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
         style-src 'sha256-{style}'; script-src 'sha256-{script}'; base-uri 'none'; form-action 'none'\">"
    )
}

/// Bytes in base64 (RFC 4648, with padding).
pub(crate) fn base64(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(bytes)
}

/// An RGB picture (height × width × 3) as a JPEG inside the page, a `data:` URI; none where it has no
/// pixel or other than width × height × 3 bytes.
pub fn jpeg_data_uri(rgb: &[u8], width: u32, height: u32) -> Option<String> {
    if rgb.is_empty() || rgb.len() != width as usize * height as usize * 3 {
        return None;
    }
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY)
        .write_image(rgb, width, height, ExtendedColorType::Rgb8)
        .ok()?;
    Some(format!("data:image/jpeg;base64,{}", base64(&jpeg)))
}

/// One `{{name}}` of a template and what stands there in the page.
pub(crate) struct Field<'a> {
    pub name: &'a str,
    pub html: &'a str,
}

/// Fills a template in one pass: what is filled in is not searched for names again. A name without a
/// field stays as it stands.
pub(crate) fn fill(template: &str, fields: &[Field<'_>]) -> String {
    let mut page = String::with_capacity(template.len());
    let mut rest = template;
    while let Some(start) = rest.find("{{") {
        let inside = &rest[start + 2..];
        let end = inside.find("}}");
        let field = end.and_then(|end| fields.iter().find(|field| field.name == &inside[..end]));
        let (Some(end), Some(field)) = (end, field) else {
            page.push_str(&rest[..start + 2]);
            rest = inside;
            continue;
        };
        page.push_str(&rest[..start]);
        page.push_str(field.html);
        rest = &inside[end + 2..];
    }
    page + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_leave_their_place() {
        assert_eq!(escape("\"><i>'&"), "&quot;&gt;&lt;i&gt;&#39;&amp;");
    }

    #[test]
    fn a_policy_names_the_program_by_its_hash() {
        // The example of MDN's page on the policy.
        let policy = policy("", "var inline = 1;");
        let hash = "'sha256-B2yPHKaXnvFWtRChIbabYmUBFZdVfKKXHbWtWidDVF8='";
        assert!(policy.contains(&format!("script-src {hash};")), "{policy}");
        assert!(!policy.contains("unsafe"));
    }

    #[test]
    fn a_picture_survives_and_a_wrong_size_is_none() {
        let rgb = [200, 40, 40].repeat(16 * 8);
        let uri = jpeg_data_uri(&rgb, 16, 8).unwrap();
        assert!(uri.starts_with("data:image/jpeg;base64,/9j/"), "{uri}");
        assert_eq!(jpeg_data_uri(&rgb, 16, 9), None);
        assert_eq!(jpeg_data_uri(&[], 0, 0), None);
    }

    #[test]
    fn what_is_filled_in_is_not_searched_again() {
        let fields = [Field { name: "a", html: "{{b}}" }, Field { name: "b", html: "B" }];
        assert_eq!(fill("x {{a}} {{b}} {{c}} {{", &fields), "x {{b}} B {{c}} {{");
    }
}
