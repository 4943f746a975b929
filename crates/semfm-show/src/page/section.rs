//! What a page tells above the viewer: figures, numbers and words that need no program.

use super::group::Fact;
use crate::html::{escape, jpeg_data_uri};
use crate::pictures::RgbPicture;

/// A part of a page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// Names and values below it; a `verdict` is drawn as such.
    pub facts: Vec<Fact>,
    /// Sentences, a line each.
    pub notes: Vec<String>,
    /// Pictures side by side.
    pub figures: Vec<Figure>,
    /// Numbers.
    pub table: Option<Table>,
}

/// A picture with what it shows.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What it shows, for those who do not see it, too.
    pub caption: String,
    /// The picture.
    pub picture: RgbPicture,
}

/// Rows below a head.
#[derive(Clone, Debug)]
pub struct Table {
    /// Names of the columns.
    pub head: Vec<String>,
    /// As many cells each.
    pub rows: Vec<Vec<String>>,
}

impl Section {
    /// Its HTML.
    pub(super) fn html(&self) -> String {
        let facts = list("facts", self.facts.iter().map(fact));
        let notes = list("told", self.notes.iter().map(|note| escape(note)));
        let figures: String = self.figures.iter().filter_map(figure).collect();
        let figures = match figures.as_str() {
            "" => String::new(),
            figures => format!("<div class=\"figures\">{figures}</div>\n"),
        };
        let table = self.table.as_ref().map_or_else(String::new, table);
        format!(
            "<section>\n<h2>{}</h2>\n{facts}{notes}{figures}{table}</section>\n",
            escape(&self.title)
        )
    }
}

/// A list with a class; nothing where it has no items.
fn list(class: &str, items: impl Iterator<Item = String>) -> String {
    let items: String = items.map(|item| format!("<li>{item}</li>")).collect();
    match items.as_str() {
        "" => String::new(),
        items => format!("<ul class=\"{class}\">{items}</ul>\n"),
    }
}

fn fact(Fact { name, value }: &Fact) -> String {
    let (name, shown) = (escape(name), escape(value));
    let class = match value.as_str() {
        "accept" | "check" | "refuse" if name == "verdict" => format!("verdict {shown}"),
        _ => String::new(),
    };
    format!("<b>{name}</b> <span class=\"{class}\">{shown}</span>")
}

/// A figure; nothing where its picture has no pixel.
fn figure(Figure { caption, picture }: &Figure) -> Option<String> {
    let RgbPicture { rgb, width, height } = picture.for_page();
    let data = jpeg_data_uri(&rgb, width, height)?;
    let caption = escape(caption);
    Some(format!(
        "<figure><img src=\"{data}\" width=\"{width}\" height=\"{height}\" alt=\"{caption}\">\
         <figcaption>{caption}</figcaption></figure>"
    ))
}

fn table(Table { head, rows }: &Table) -> String {
    let row = |cells: &[String], tag: &str| {
        let cells: String =
            cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect();
        format!("<tr>{cells}</tr>")
    };
    let rows: String = rows.iter().map(|cells| row(cells, "td")).collect();
    format!("<table class=\"told\">{}{rows}</table>\n", row(head, "th"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_cannot_break_the_page() {
        let section = Section {
            title: "a <b>".into(),
            facts: vec![Fact { name: "verdict".into(), value: "refuse".into() }],
            notes: vec!["</section>".into()],
            figures: vec![Figure {
                caption: "\"quoted\"".into(),
                picture: RgbPicture { rgb: vec![9; 48], width: 4, height: 4 },
            }],
            table: Some(Table { head: vec!["x".into()], rows: vec![vec!["<td>".into()]] }),
        };
        let html = section.html();
        assert!(html.contains("a &lt;b&gt;") && html.contains("class=\"verdict refuse\""));
        assert!(html.contains("alt=\"&quot;quoted&quot;\"") && html.contains("&lt;td&gt;"));
        assert_eq!(html.matches("</section>").count(), 1);
        let empty = Section { title: "t".into(), ..Section::default() }.html();
        assert_eq!(empty, "<section>\n<h2>t</h2>\n</section>\n");
    }
}
