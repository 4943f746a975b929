//! The part of URDF that we read: elements, their attributes, what each value must be.
//!
//! One table serves twice: values are checked by it, with line numbers, and the text that the
//! parser gets is written by it, so that nothing unchecked and nothing foreign reaches the parser.

use super::Fault;
use super::outline::{Element, Outline, short};

/// What an attribute's text must be.
#[derive(Clone, Copy)]
enum Value {
    /// Any text that is not empty.
    Name,
    /// So many finite numbers.
    Finite(usize),
    /// So many finite numbers, none below zero.
    Size(usize),
    /// A number that may be infinite: "no limit" since URDF 1.2.
    Limit,
    /// Any text; checked elsewhere.
    Text,
}

/// An attribute: its name, its value, and what is written where it is absent (`None`: it must be
/// there; `Some("")`: it stays absent).
type Attribute = (&'static str, Value, Option<&'static str>);

/// An element of URDF as we read it.
struct Rule {
    name: &'static str,
    attributes: &'static [Attribute],
    /// Names of the elements inside.
    children: &'static [&'static str],
}

const OPTIONAL: Option<&str> = Some("");

/// `velocity` and `effort` of a limit are demanded by the specification and left out by many; no
/// grasp depends on them.
const RULES: &[Rule] = &[
    Rule {
        name: "link",
        attributes: &[("name", Value::Name, None)],
        children: &["inertial", "visual", "collision"],
    },
    Rule { name: "inertial", attributes: &[], children: &["origin", "mass", "inertia"] },
    Rule { name: "visual", attributes: &[], children: &["origin", "geometry"] },
    Rule { name: "collision", attributes: &[], children: &["origin", "geometry"] },
    Rule {
        name: "origin",
        attributes: &[
            ("xyz", Value::Finite(3), OPTIONAL),
            ("rpy", Value::Finite(3), OPTIONAL),
            ("quat_xyzw", Value::Finite(4), OPTIONAL),
        ],
        children: &[],
    },
    Rule { name: "mass", attributes: &[("value", Value::Finite(1), None)], children: &[] },
    Rule {
        name: "inertia",
        attributes: &[
            ("ixx", Value::Finite(1), Some("0")),
            ("ixy", Value::Finite(1), Some("0")),
            ("ixz", Value::Finite(1), Some("0")),
            ("iyy", Value::Finite(1), Some("0")),
            ("iyz", Value::Finite(1), Some("0")),
            ("izz", Value::Finite(1), Some("0")),
        ],
        children: &[],
    },
    Rule {
        name: "geometry",
        attributes: &[],
        children: &["box", "cylinder", "capsule", "sphere", "mesh"],
    },
    Rule { name: "box", attributes: &[("size", Value::Size(3), None)], children: &[] },
    Rule {
        name: "cylinder",
        attributes: &[("radius", Value::Size(1), None), ("length", Value::Size(1), None)],
        children: &[],
    },
    Rule {
        name: "capsule",
        attributes: &[("radius", Value::Size(1), None), ("length", Value::Size(1), None)],
        children: &[],
    },
    Rule { name: "sphere", attributes: &[("radius", Value::Size(1), None)], children: &[] },
    Rule {
        name: "mesh",
        attributes: &[("filename", Value::Text, None), ("scale", Value::Finite(3), OPTIONAL)],
        children: &[],
    },
    Rule {
        name: "joint",
        attributes: &[("name", Value::Name, None), ("type", Value::Name, None)],
        children: &["origin", "parent", "child", "axis", "limit", "mimic"],
    },
    Rule { name: "parent", attributes: &[("link", Value::Name, None)], children: &[] },
    Rule { name: "child", attributes: &[("link", Value::Name, None)], children: &[] },
    Rule { name: "axis", attributes: &[("xyz", Value::Finite(3), Some("1 0 0"))], children: &[] },
    Rule {
        name: "limit",
        attributes: &[
            ("lower", Value::Limit, OPTIONAL),
            ("upper", Value::Limit, OPTIONAL),
            ("effort", Value::Limit, Some("0")),
            ("velocity", Value::Limit, Some("0")),
        ],
        children: &[],
    },
    Rule {
        name: "mimic",
        attributes: &[
            ("joint", Value::Name, None),
            ("multiplier", Value::Finite(1), OPTIONAL),
            ("offset", Value::Finite(1), OPTIONAL),
        ],
        children: &[],
    },
];

const JOINT_TYPES: [&str; 7] =
    ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];

/// Checks a link or joint with all inside it and writes what the parser is to read.
pub(crate) fn write(outline: &Outline, element: &Element, out: &mut String) -> Result<(), Fault> {
    let Some(rule) = RULES.iter().find(|rule| rule.name == element.name) else { return Ok(()) };
    out.push('<');
    out.push_str(rule.name);
    for &attribute in rule.attributes {
        write_attribute(element, attribute, out)?;
    }
    if rule.children.is_empty() {
        out.push_str("/>");
        return Ok(());
    }
    out.push('>');
    check_children(outline, element)?;
    for name in rule.children {
        for child in outline.children(element).filter(|child| child.name == *name) {
            // Mass without a tensor says nothing about the body; urdfdom's Python reader takes it.
            if *name == "inertial" && outline.child(child, "inertia").is_none() {
                continue;
            }
            write(outline, child, out)?;
        }
    }
    out.push_str("</");
    out.push_str(rule.name);
    out.push('>');
    Ok(())
}

fn write_attribute(
    element: &Element,
    (name, value, absent): Attribute,
    out: &mut String,
) -> Result<(), Fault> {
    let text = match (element.attribute(name), absent) {
        (Some(text), _) => check_value(element, name, value, text)?,
        (None, Some("")) => return Ok(()),
        (None, Some(default)) => default.to_owned(),
        (None, None) => {
            let expected = format!("an attribute `{name}`");
            return Err(Fault::new("attribute", element.place(), expected, "none"));
        }
    };
    out.push(' ');
    out.push_str(name);
    out.push_str("=\"");
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            other => out.push(other),
        }
    }
    out.push('"');
    Ok(())
}

/// The value as it is handed on.
fn check_value(element: &Element, name: &str, value: Value, text: &str) -> Result<String, Fault> {
    let place = || format!("{}: {name}", element.place());
    let (count, code) = match value {
        Value::Text => return Ok(text.to_owned()),
        Value::Name if text.trim().is_empty() => {
            return Err(Fault::new("name", place(), "a name", "none"));
        }
        Value::Name => return Ok(text.to_owned()),
        Value::Finite(count) => (count, "number"),
        Value::Size(count) => (count, "geometry"),
        Value::Limit => (1, "limit"),
    };
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    if numbers.len() != count || text.split_whitespace().count() != count {
        let expected = if count == 1 { "a number".into() } else { format!("{count} numbers") };
        return Err(Fault::new(code, place(), expected, format!("`{}`", short(text))));
    }
    let infinite = matches!(value, Value::Limit);
    if numbers.iter().any(|x| x.is_nan() || !(infinite || x.is_finite())) {
        return Err(Fault::new("non-finite", place(), "finite", format!("`{}`", short(text))));
    }
    if matches!(value, Value::Size(_)) && numbers.iter().any(|&x| x < 0.0) {
        return Err(Fault::new("geometry", place(), "not negative", format!("`{}`", short(text))));
    }
    Ok(text.to_owned())
}

/// What must be inside an element exactly or at most once.
fn check_children(outline: &Outline, element: &Element) -> Result<(), Fault> {
    let count = |name: &str| outline.children(element).filter(|child| child.name == name).count();
    let need = |name: &str, range: std::ops::RangeInclusive<usize>| {
        let found = count(name);
        if range.contains(&found) {
            return Ok(());
        }
        let expected = if *range.start() == 1 { "one" } else { "at most one" };
        let found = format!("{found} of them");
        Err(Fault::new("element", element.place(), format!("{expected} `{name}`"), found))
    };
    match element.name.as_str() {
        "link" => need("inertial", 0..=1),
        "joint" => {
            need("parent", 1..=1)?;
            need("child", 1..=1)?;
            ["origin", "axis", "limit", "mimic"].iter().try_for_each(|name| need(name, 0..=1))?;
            let kind = element.attribute("type").unwrap_or_default();
            if JOINT_TYPES.contains(&kind) {
                return Ok(());
            }
            let (expected, found) = (JOINT_TYPES.join(", "), format!("`{}`", short(kind)));
            Err(Fault::new("joint-type", element.place(), expected, found))
        }
        "inertial" => {
            need("origin", 0..=1)?;
            need("mass", 1..=1)?;
            need("inertia", 0..=1)
        }
        "visual" | "collision" => {
            need("origin", 0..=1)?;
            need("geometry", 1..=1)
        }
        "geometry" => {
            let shapes = ["box", "cylinder", "capsule", "sphere", "mesh"];
            let found: usize = shapes.iter().map(|shape| count(shape)).sum();
            if found == 1 {
                return Ok(());
            }
            let expected = format!("one of {}", shapes.join(", "));
            Err(Fault::new("geometry", element.place(), expected, format!("{found} of them")))
        }
        _ => Ok(()),
    }
}
