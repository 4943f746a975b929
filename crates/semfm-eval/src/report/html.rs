//! The few pieces of HTML that the page is made of: tables, figures, sections.

use std::fmt::Write;

pub(super) use semfm_show::html::escape;

use crate::table::number;

/// One cell of a table's body.
pub(super) struct Cell {
    html: String,
    /// What the column is sorted by, where that is not the text.
    value: Option<f64>,
    class: &'static str,
}

impl Cell {
    /// Plain words.
    pub fn text(text: &str) -> Self {
        Self { html: escape(text), value: None, class: "" }
    }

    /// A value with so many digits; a dash for none.
    pub fn number(value: Option<f64>, digits: usize) -> Self {
        Self::written(value, number(value, digits))
    }

    /// A value that is written in its own way.
    pub fn written(value: Option<f64>, text: String) -> Self {
        Self { html: escape(&text), value, class: "n" }
    }

    /// Adds a smaller second line.
    pub fn with_small(mut self, text: &str) -> Self {
        if !text.is_empty() {
            let _ = write!(self.html, " <small>{}</small>", escape(text));
        }
        self
    }

    /// Puts weight on it.
    pub fn strong_if(mut self, strong: bool) -> Self {
        if strong {
            self.html = format!("<strong>{}</strong>", self.html);
        }
        self
    }
}

/// A table with a caption, a heading for each column and one for each line.
pub(super) struct Table {
    caption: String,
    head: Vec<String>,
    body: String,
    /// Which columns hold numbers, as the first line has them.
    numeric: Vec<bool>,
    n_lines: usize,
    sortable: bool,
}

impl Table {
    /// A table of these columns, the first of which names the lines.
    pub fn new(caption: &str, head: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let head = head.into_iter().map(Into::into).collect();
        Self {
            caption: caption.into(),
            head,
            body: String::new(),
            numeric: vec![],
            n_lines: 0,
            sortable: false,
        }
    }

    /// Gives the columns buttons that sort by them.
    pub fn sortable(mut self) -> Self {
        self.sortable = true;
        self
    }

    /// Adds a line; `class` is that of the `tr`. `note` follows the name in small letters.
    pub fn line(
        &mut self,
        class: &str,
        name: &str,
        note: &str,
        cells: impl IntoIterator<Item = Cell>,
    ) {
        let note = match note {
            "" => String::new(),
            note => format!(" <small>{}</small>", escape(note)),
        };
        let _ = write!(
            self.body,
            "<tr{}><th scope=\"row\">{}{note}</th>",
            class_of(class),
            escape(name)
        );
        let first = self.n_lines == 0;
        for cell in cells {
            if first {
                self.numeric.push(cell.class == "n");
            }
            let value = cell.value.map_or_else(String::new, |v| format!(" data-v=\"{v}\""));
            let _ = write!(self.body, "<td{}{value}>{}</td>", class_of(cell.class), cell.html);
        }
        self.body.push_str("</tr>\n");
        self.n_lines += 1;
    }

    /// Whether it has no lines.
    pub fn is_empty(&self) -> bool {
        self.n_lines == 0
    }

    /// The element, in a frame that scrolls where the screen is narrower than the table.
    pub fn html(&self) -> String {
        let kinds = [false].iter().chain(&self.numeric).chain(std::iter::repeat(&false));
        let mut head = String::new();
        for (name, numeric) in self.head.iter().zip(kinds) {
            let class = class_of(if *numeric { "n" } else { "" });
            let _ = write!(head, "<th scope=\"col\"{class}>{}</th>", escape(name));
        }
        let class = if self.sortable { " class=\"sortable\"" } else { "" };
        format!(
            "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\">\
             <table{class}><caption>{caption}</caption><thead><tr>{head}</tr></thead>\
             <tbody>\n{}</tbody></table></div>\n",
            self.body,
            caption = escape(&self.caption),
        )
    }
}

fn class_of(class: &str) -> String {
    if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") }
}

/// An image with its description.
pub(super) fn img(uri: &str, alt: &str) -> String {
    format!("<img class=\"pic\" loading=\"lazy\" src=\"{uri}\" alt=\"{}\">", escape(alt))
}

/// A plot with a description and a caption, which is HTML.
pub(super) fn plot(svg: &str, description: &str, caption: &str) -> String {
    format!(
        "<figure class=\"plot\"><div role=\"img\" aria-label=\"{}\">{svg}</div>\
         <figcaption>{caption}</figcaption></figure>\n",
        escape(description)
    )
}

/// A picture (HTML) with a word or two below it.
pub(super) fn shown(picture: &str, words: &str) -> String {
    format!("<figure>{picture}<figcaption>{}</figcaption></figure>", escape(words))
}

/// A section with a heading that the contents link to.
pub(super) fn section(id: &str, title: &str, body: &str) -> String {
    format!("<section id=\"{id}\">\n<h2>{}</h2>\n{body}</section>\n", escape(title))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_leave_their_place() {
        let mut table = Table::new("\"><script>", ["a<b"]);
        table.line("", "<i>", "", [Cell::text("x & 'y'"), Cell::number(Some(0.745), 2)]);
        let html = table.html();
        assert!(!html.contains("<script>") && !html.contains("<i>"), "{html}");
        assert!(html.contains("x &amp; &#39;y&#39;"), "{html}");
        assert!(html.contains("<td class=\"n\" data-v=\"0.745\">.7"), "{html}");
        assert!(img("data:,", "\"onload=").contains("alt=\"&quot;onload=\""));
    }
}
