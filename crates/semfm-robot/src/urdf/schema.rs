//! The part of URDF that we read: elements, their attributes, what each value must be.
//!
//! One table serves twice: values are checked by it, with line numbers, and the text that `urdf-rs`
//! parses is written by it, so that nothing unchecked and nothing unknown is parsed.

use super::fault::{Fault, quoted};
use super::xml::{Element, XmlElements};

/// Largest number of a length, an angle, a mass or a factor. Nothing in a robot comes near it, and products of several
/// stay finite.
const MAX_NUMBER: f64 = 1e12;

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

/// What is written where an attribute is absent.
#[derive(Clone, Copy)]
enum Absent {
    /// It must be there.
    Refuse,
    /// Nothing: it stays absent.
    Omit,
    /// This text.
    Write(&'static str),
}

/// An attribute of an element.
#[derive(Clone, Copy)]
struct Attribute {
    name: &'static str,
    value: Value,
    absent: Absent,
}

const fn required(name: &'static str, value: Value) -> Attribute {
    Attribute { name, value, absent: Absent::Refuse }
}

const fn optional(name: &'static str, value: Value) -> Attribute {
    Attribute { name, value, absent: Absent::Omit }
}

const fn defaulted(name: &'static str, value: Value, text: &'static str) -> Attribute {
    Attribute { name, value, absent: Absent::Write(text) }
}

/// An element of URDF as we read it.
struct Rule {
    name: &'static str,
    attributes: &'static [Attribute],
    /// Names of the elements inside.
    children: &'static [&'static str],
}

/// `velocity` and `effort` of a limit, and `k_velocity` of a safety controller, are demanded by the
/// specification and left out by many; no grasp depends on them.
const RULES: &[Rule] = &[
    Rule {
        name: "link",
        attributes: &[required("name", Value::Name)],
        children: &["inertial", "visual", "collision"],
    },
    Rule { name: "inertial", attributes: &[], children: &["origin", "mass", "inertia"] },
    Rule { name: "visual", attributes: &[], children: &["origin", "geometry"] },
    Rule { name: "collision", attributes: &[], children: &["origin", "geometry"] },
    Rule {
        name: "origin",
        attributes: &[
            optional("xyz", Value::Finite(3)),
            optional("rpy", Value::Finite(3)),
            optional("quat_xyzw", Value::Finite(4)),
        ],
        children: &[],
    },
    Rule { name: "mass", attributes: &[required("value", Value::Finite(1))], children: &[] },
    Rule {
        name: "inertia",
        attributes: &[
            defaulted("ixx", Value::Finite(1), "0"),
            defaulted("ixy", Value::Finite(1), "0"),
            defaulted("ixz", Value::Finite(1), "0"),
            defaulted("iyy", Value::Finite(1), "0"),
            defaulted("iyz", Value::Finite(1), "0"),
            defaulted("izz", Value::Finite(1), "0"),
        ],
        children: &[],
    },
    Rule {
        name: "geometry",
        attributes: &[],
        children: &["box", "cylinder", "capsule", "sphere", "mesh"],
    },
    Rule { name: "box", attributes: &[required("size", Value::Size(3))], children: &[] },
    Rule {
        name: "cylinder",
        attributes: &[required("radius", Value::Size(1)), required("length", Value::Size(1))],
        children: &[],
    },
    Rule {
        name: "capsule",
        attributes: &[required("radius", Value::Size(1)), required("length", Value::Size(1))],
        children: &[],
    },
    Rule { name: "sphere", attributes: &[required("radius", Value::Size(1))], children: &[] },
    Rule {
        name: "mesh",
        attributes: &[required("filename", Value::Text), optional("scale", Value::Finite(3))],
        children: &[],
    },
    Rule {
        name: "joint",
        attributes: &[required("name", Value::Name), required("type", Value::Name)],
        children: &["origin", "parent", "child", "axis", "limit", "mimic", "safety_controller"],
    },
    Rule { name: "parent", attributes: &[required("link", Value::Name)], children: &[] },
    Rule { name: "child", attributes: &[required("link", Value::Name)], children: &[] },
    Rule {
        name: "axis",
        attributes: &[defaulted("xyz", Value::Finite(3), "1 0 0")],
        children: &[],
    },
    Rule {
        name: "limit",
        attributes: &[
            optional("lower", Value::Limit),
            optional("upper", Value::Limit),
            defaulted("effort", Value::Limit, "0"),
            defaulted("velocity", Value::Limit, "0"),
        ],
        children: &[],
    },
    Rule {
        name: "safety_controller",
        attributes: &[
            defaulted("soft_lower_limit", Value::Finite(1), "-inf"),
            defaulted("soft_upper_limit", Value::Finite(1), "inf"),
            optional("k_position", Value::Finite(1)),
            defaulted("k_velocity", Value::Finite(1), "0"),
        ],
        children: &[],
    },
    Rule {
        name: "mimic",
        attributes: &[
            required("joint", Value::Name),
            optional("multiplier", Value::Finite(1)),
            optional("offset", Value::Finite(1)),
        ],
        children: &[],
    },
];

const JOINT_TYPES: [&str; 7] =
    ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];

/// Checks a link or joint with all inside it and writes what the parser is to read.
pub(crate) fn write(
    elements: &XmlElements,
    element: &Element,
    out: &mut String,
) -> Result<(), Fault> {
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
    check_children(elements, element)?;
    for name in rule.children {
        for child in elements.children(element).filter(|child| child.name == *name) {
            // Mass without a tensor says nothing about the body; urdfdom's Python reader takes it.
            if *name == "inertial" && elements.child(child, "inertia").is_none() {
                continue;
            }
            write(elements, child, out)?;
        }
    }
    out.push_str("</");
    out.push_str(rule.name);
    out.push('>');
    Ok(())
}

fn write_attribute(element: &Element, attribute: Attribute, out: &mut String) -> Result<(), Fault> {
    let Attribute { name, value, absent } = attribute;
    let text = match (element.attribute(name), absent) {
        (Some(text), _) => check_value(element, name, value, text)?,
        (None, Absent::Omit) => return Ok(()),
        (None, Absent::Write(text)) => text.to_owned(),
        (None, Absent::Refuse) => {
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
    let place = format!("{}: {name}", element.place());
    let (count, code) = match value {
        Value::Text => return Ok(text.to_owned()),
        Value::Name if text.trim().is_empty() => {
            return Err(Fault::new("name", place, "a name", "none"));
        }
        Value::Name => return Ok(text.to_owned()),
        Value::Finite(count) => (count, "number"),
        Value::Size(count) => (count, "geometry"),
        Value::Limit => (1, "limit"),
    };
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    if numbers.len() != count || text.split_whitespace().count() != count {
        let expected = if count == 1 { "a number".into() } else { format!("{count} numbers") };
        return Err(Fault::new(code, place, expected, quoted(text)));
    }
    let infinite = matches!(value, Value::Limit);
    if numbers.iter().any(|x| x.is_nan() || !(infinite || x.is_finite())) {
        return Err(Fault::new("non-finite", place, "finite", quoted(text)));
    }
    if !infinite && numbers.iter().any(|x| x.abs() > MAX_NUMBER) {
        return Err(Fault::new(code, place, format!("at most {MAX_NUMBER:e}"), quoted(text)));
    }
    if matches!(value, Value::Size(_)) && numbers.iter().any(|&x| x < 0.0) {
        return Err(Fault::new("geometry", place, "not negative", quoted(text)));
    }
    Ok(text.to_owned())
}

/// What must be inside an element exactly or at most once.
fn check_children(elements: &XmlElements, element: &Element) -> Result<(), Fault> {
    let (once, at_most_once): (&[&str], &[&str]) = match element.name.as_str() {
        "link" => (&[], &["inertial"]),
        "joint" => {
            (&["parent", "child"], &["origin", "axis", "limit", "mimic", "safety_controller"])
        }
        "inertial" => (&["mass"], &["origin", "inertia"]),
        "visual" | "collision" => (&["geometry"], &["origin"]),
        "geometry" => return check_geometry(elements, element),
        _ => return Ok(()),
    };
    for name in once {
        let found = count(elements, element, name);
        if found != 1 {
            return Err(wrong_count(element, format!("one `{name}`"), found));
        }
    }
    for name in at_most_once {
        let found = count(elements, element, name);
        if found > 1 {
            return Err(wrong_count(element, format!("at most one `{name}`"), found));
        }
    }
    let kind = element.attribute("type").unwrap_or_default();
    if element.name == "joint" && !JOINT_TYPES.contains(&kind) {
        let expected = JOINT_TYPES.join(", ");
        return Err(Fault::new("joint-type", element.place(), expected, quoted(kind)));
    }
    Ok(())
}

fn check_geometry(elements: &XmlElements, element: &Element) -> Result<(), Fault> {
    const SHAPES: [&str; 5] = ["box", "cylinder", "capsule", "sphere", "mesh"];
    let found: usize = SHAPES.iter().map(|shape| count(elements, element, shape)).sum();
    if found == 1 {
        return Ok(());
    }
    let expected = format!("one of {}", SHAPES.join(", "));
    Err(Fault::new("geometry", element.place(), expected, format!("{found} of them")))
}

/// Number of elements of that name directly inside one.
fn count(elements: &XmlElements, element: &Element, name: &str) -> usize {
    elements.children(element).filter(|child| child.name == name).count()
}

fn wrong_count(element: &Element, expected: String, found: usize) -> Fault {
    Fault::new("element", element.place(), expected, format!("{found} of them"))
}
