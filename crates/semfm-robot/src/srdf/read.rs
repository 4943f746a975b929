//! From the elements of an SRDF to what they mean for a robot.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::groups::read_groups;
use super::{DisabledPair, EndEffector, GroupState, Srdf, VirtualJoint};
use crate::robot::Robot;
use crate::urdf::{Element, Fault, XmlElements, quoted};

/// Most pairs of links that a file may switch off.
const MAX_PAIRS: usize = 1_000_000;

/// Places of links and joints by name, and where warnings go.
pub(super) struct Names<'a> {
    links: HashMap<&'a str, usize>,
    joints: HashMap<&'a str, usize>,
    pub warnings: Vec<String>,
}

impl Names<'_> {
    /// The link that an attribute names; unknown ones are a warning.
    pub fn link(&mut self, element: &Element, attribute: &str) -> Result<Option<usize>, Fault> {
        let name = required(element, attribute)?;
        let link = self.links.get(name).copied();
        if link.is_none() {
            self.unknown(element, "link", name);
        }
        Ok(link)
    }

    /// The joint that an attribute names; unknown ones are a warning.
    pub fn joint(&mut self, element: &Element, attribute: &str) -> Result<Option<usize>, Fault> {
        let name = required(element, attribute)?;
        let joint = self.joints.get(name).copied();
        if joint.is_none() {
            self.unknown(element, "joint", name);
        }
        Ok(joint)
    }

    fn unknown(&mut self, element: &Element, kind: &str, name: &str) {
        let place = element.place();
        self.warnings
            .push(format!("{place}: no {kind} {} in the robot; passed over", quoted(name)));
    }
}

/// The value of an attribute that must be there.
pub(super) fn required<'a>(element: &'a Element, attribute: &str) -> Result<&'a str, Fault> {
    element.attribute(attribute).filter(|value| !value.trim().is_empty()).ok_or_else(|| {
        Fault::new("attribute", element.place(), format!("an attribute `{attribute}`"), "none")
    })
}

pub(super) fn read(elements: &XmlElements, robot: &Robot) -> Result<Srdf, Fault> {
    let Some(root) = elements.root().filter(|root| root.name == "robot") else {
        let found = elements.root().map_or_else(String::new, |root| quoted(&root.name));
        return Err(Fault::new("srdf", "outermost element", "`robot`", found));
    };
    let mut names = Names {
        links: robot.links.iter().enumerate().map(|(i, link)| (link.name.as_str(), i)).collect(),
        joints: robot.joints.iter().enumerate().map(|(i, j)| (j.name.as_str(), i)).collect(),
        warnings: Vec::new(),
    };
    let mut srdf =
        Srdf { name: root.attribute("name").unwrap_or_default().into(), ..Srdf::default() };
    if srdf.name != robot.name {
        let [own, other] = [&srdf.name, &robot.name].map(|name| quoted(name));
        names.warnings.push(format!("the file is for robot {own}, the description is of {other}"));
    }
    srdf.groups = read_groups(elements, root, robot, &mut names)?;
    for element in elements.children(root) {
        match element.name.as_str() {
            "group_state" => srdf.states.push(state(elements, element, robot, &mut names)?),
            "end_effector" => srdf.end_effectors.extend(end_effector(element, &mut names)?),
            "virtual_joint" => srdf.virtual_joints.extend(virtual_joint(element, &mut names)?),
            "passive_joint" => srdf.passive_joints.extend(names.joint(element, "name")?),
            _ => {}
        }
    }
    srdf.disabled = disabled_pairs(elements, root, robot, &mut names)?;
    srdf.warnings = names.warnings;
    Ok(srdf)
}

/// Pairs that are switched off: `disable_default_collisions` for all pairs of a link, `enable_collisions` takes some of
/// these back, `disable_collisions` for single pairs.
fn disabled_pairs(
    elements: &XmlElements,
    root: &Element,
    robot: &Robot,
    names: &mut Names<'_>,
) -> Result<Vec<DisabledPair>, Fault> {
    let mut pairs: BTreeMap<[usize; 2], String> = BTreeMap::new();
    let of_kind =
        |kind: &'static str| elements.children(root).filter(move |element| element.name == kind);
    let mut whole: BTreeSet<usize> = BTreeSet::new();
    for element in of_kind("disable_default_collisions") {
        let Some(link) = names.link(element, "link")? else { continue };
        if whole.insert(link) {
            check_number(element, pairs.len() + robot.links.len())?;
            for other in (0..robot.links.len()).filter(|&other| other != link) {
                pairs.insert(sorted(link, other), "disabled by default".into());
            }
        }
    }
    for element in of_kind("enable_collisions") {
        if let Some(pair) = pair(element, names)? {
            pairs.remove(&pair);
        }
    }
    for element in of_kind("disable_collisions") {
        let Some(pair) = pair(element, names)? else { continue };
        check_number(element, pairs.len() + 1)?;
        if pair[0] == pair[1] {
            names.warnings.push(format!("{}: a link with itself; passed over", element.place()));
            continue;
        }
        pairs.insert(pair, element.attribute("reason").unwrap_or_default().into());
    }
    Ok(pairs.into_iter().map(|(links, reason)| DisabledPair { links, reason }).collect())
}

fn pair(element: &Element, names: &mut Names<'_>) -> Result<Option<[usize; 2]>, Fault> {
    let (a, b) = (names.link(element, "link1")?, names.link(element, "link2")?);
    Ok(a.zip(b).map(|(a, b)| sorted(a, b)))
}

fn sorted(a: usize, b: usize) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

fn check_number(element: &Element, n_pairs: usize) -> Result<(), Fault> {
    if n_pairs <= MAX_PAIRS {
        return Ok(());
    }
    Err(Fault::new("size", element.place(), format!("at most {MAX_PAIRS} pairs of links"), "more"))
}

fn state(
    elements: &XmlElements,
    element: &Element,
    robot: &Robot,
    names: &mut Names<'_>,
) -> Result<GroupState, Fault> {
    let (name, group) = (required(element, "name")?.into(), required(element, "group")?.into());
    let mut positions = Vec::new();
    for child in elements.children(element).filter(|child| child.name == "joint") {
        let value = required(child, "value")?;
        let Some(joint) = names.joint(child, "name")? else { continue };
        if !robot.joints[joint].kind.has_position() {
            let place = child.place();
            names
                .warnings
                .push(format!("{place}: one number does not tell its position; passed over"));
            continue;
        }
        let place = format!("{}: value", child.place());
        match value.trim().parse::<f64>() {
            Ok(position) if position.is_finite() => positions.push((joint, position)),
            Ok(_) => return Err(Fault::new("non-finite", place, "finite", quoted(value))),
            Err(_) => return Err(Fault::new("number", place, "a number", quoted(value))),
        }
    }
    Ok(GroupState { name, group, positions })
}

fn end_effector(element: &Element, names: &mut Names<'_>) -> Result<Option<EndEffector>, Fault> {
    let (name, group) = (required(element, "name")?.into(), required(element, "group")?.into());
    let parent_group = element.attribute("parent_group").map(Into::into);
    let parent_link = names.link(element, "parent_link")?;
    Ok(parent_link.map(|parent_link| EndEffector { name, group, parent_link, parent_group }))
}

fn virtual_joint(element: &Element, names: &mut Names<'_>) -> Result<Option<VirtualJoint>, Fault> {
    let [name, kind, parent_frame] =
        ["name", "type", "parent_frame"].map(|attribute| required(element, attribute));
    let (name, kind, parent_frame) = (name?.into(), kind?.into(), parent_frame?.into());
    let child_link = names.link(element, "child_link")?;
    Ok(child_link.map(|child_link| VirtualJoint { name, kind, parent_frame, child_link }))
}
