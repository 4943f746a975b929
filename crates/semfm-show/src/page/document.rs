//! Writes the page: the template with the viewer's program and the data in it.

use std::path::Path;

use semfm::Verdict;
use semfm::geom::io::{refuse_input, write_atomically};

use super::data::PageData;
use super::group::Group;
use super::section::Section;
use crate::Result;
use crate::colors::{MARKED, NamedColor, PLAIN, color_bytes, css_properties, verdict_color};
use crate::html::{Field, escape, fill, policy};

/// The viewer, in the order in which its files build on each other.
const VIEWER: [&str; 9] = [
    include_str!("viewer/painter.js"),
    include_str!("viewer/panel.js"),
    include_str!("viewer/grasping.js"),
    include_str!("viewer/hands.js"),
    include_str!("viewer/charts.js"),
    include_str!("viewer/motion.js"),
    include_str!("viewer/theme.js"),
    include_str!("viewer/decode.js"),
    include_str!("viewer/viewer.js"),
];

/// Writes the page, whole or not at all.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for groups whose parts do not fit each other,
/// [`Error::Semfm`](crate::Error::Semfm) where the file cannot be written.
pub fn write_page(path: &Path, title: &str, groups: &[Group]) -> Result<()> {
    write_page_with(path, title, &[], groups)
}

/// As [`write_page`], with sections of figures and words above the viewer; without groups there is no viewer.
///
/// # Errors
/// As [`write_page`].
pub fn write_page_with(
    path: &Path,
    title: &str,
    sections: &[Section],
    groups: &[Group],
) -> Result<()> {
    groups.iter().try_for_each(Group::check)?;
    refuse_input(path)?;
    let script = format!("\"use strict\";\n{}", VIEWER.concat());
    let style = format!(":root {{ {} }}\n{}", style_colors(), include_str!("viewer/style.css"));
    let page = fill(
        include_str!("viewer/page.html"),
        &[
            Field { name: "policy", html: &policy(&style, &script) },
            Field { name: "title", html: &escape(title) },
            Field { name: "version", html: env!("CARGO_PKG_VERSION") },
            Field { name: "style", html: &style },
            Field {
                name: "sections",
                html: &sections.iter().map(Section::html).collect::<String>(),
            },
            Field { name: "script", html: &script },
            Field { name: "data", html: &script_json(&PageData::new(groups)) },
        ],
    );
    Ok(write_atomically(path, |out| out.write_all(page.as_bytes()))?)
}

/// JSON that may stand in a `script` element: `</script>` inside a string would end it.
fn script_json(data: &PageData<'_>) -> String {
    // Maps have no keys but text, and nothing here fails by itself.
    serde_json::to_string(data).unwrap_or_default().replace('<', "\\u003c")
}

/// The colours of the style sheet that are ours elsewhere, too.
fn style_colors() -> String {
    css_properties(&[
        NamedColor { name: "plain", color: color_bytes(PLAIN) },
        NamedColor { name: "marked", color: color_bytes(MARKED) },
        NamedColor { name: "accept", color: verdict_color(Verdict::Accept) },
        NamedColor { name: "check", color: verdict_color(Verdict::Check) },
        NamedColor { name: "refuse", color: verdict_color(Verdict::Refuse) },
    ])
}

#[cfg(test)]
mod tests {
    use semfm::geom::math::DVec3;
    use semfm::{Mesh, Task};

    use super::super::group::{Fact, Layer, LegendEntry, Panel, VertexColors};
    use super::*;

    fn panel(name: &str) -> Panel {
        let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]).unwrap();
        let panel = Panel::new(name, mesh, None, &Task::default()).unwrap();
        Panel { note: "</script><b>".into(), ..panel }
    }

    fn layer(name: &str, colors: VertexColors) -> Layer {
        let legend = vec![LegendEntry::swatch([1, 2, 3], "an anchor")];
        Layer { name: name.into(), legend, colors: vec![colors.clone(), colors] }
    }

    fn group(source_of: Option<Vec<u32>>) -> Group {
        Group {
            title: "pair".into(),
            facts: vec![Fact::new("verdict", "accept")],
            notes: vec!["</script> assumed".into()],
            panels: vec![panel("source"), panel("target")],
            layers: vec![
                layer("region", VertexColors::Weights(vec![0.0, 0.5, 1.0])),
                layer("anchors", VertexColors::Classes(vec![0; 3])),
            ],
            source_of,
            pictures: Vec::new(),
            hands: None,
            motion: None,
        }
    }

    #[test]
    fn a_page_is_one_file_that_nothing_in_it_can_break() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        write_page(&path, "a < b {{data}}", &[group(Some(vec![0, 1, 2]))]).unwrap();
        let page = std::fs::read_to_string(&path).unwrap();
        // The name of SVG is an address that nothing is loaded from.
        let addresses = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!addresses.contains("http://") && !addresses.contains("https://"));
        let inside = |open: &str, close: &str| {
            let start = page.rfind(open).unwrap() + open.len();
            &page[start..start + page[start..].find(close).unwrap()]
        };
        let policy = policy(inside("<style>", "</style>"), inside("<script>", "</script>"));
        assert!(page.contains(&policy), "the policy does not let the page's own program run");
        assert_eq!(page.matches("</script>").count(), 2);
        assert!(page.contains("a &lt; b {{data}}") && page.contains("--refuse: #b3261e;"));
        assert_eq!(page.matches("{{").count(), 2, "a field of the template is not filled");
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        for broken in [Some(vec![0, 1]), Some(vec![0, 1, 3])] {
            assert!(write_page(&path, "t", &[group(broken)]).is_err());
        }
        let spoil: [fn(&mut Group); 5] = [
            |group| {
                group.source_of = Some(vec![0, 1, 2]);
                group.panels.truncate(1);
                group.layers.iter_mut().for_each(|layer| layer.colors.truncate(1));
            },
            |group| group.layers.clear(),
            |group| group.layers[0].colors[1] = VertexColors::Weights(vec![0.0; 2]),
            |group| group.layers[0].colors[1] = VertexColors::Positions,
            |group| group.layers[1].colors[1] = VertexColors::Classes(vec![0, 1, 0]),
        ];
        for spoil in spoil {
            let mut broken = group(None);
            spoil(&mut broken);
            assert!(write_page(&path, "t", &[broken]).is_err());
        }
        assert!(!path.exists());
    }
}
