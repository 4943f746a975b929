//! Groups: links, joints, chains and subgroups as sets of joints and links.

use std::collections::{BTreeSet, HashMap};

use super::read::{Names, required};
use super::{ChainEnds, Group};
use crate::robot::Robot;
use crate::urdf::{Element, Fault, XmlElements, quoted};

/// Most joints and links in all groups together.
const MAX_MEMBERS: usize = 1_000_000;

/// A group before its subgroups are resolved.
struct Own<'a> {
    element: &'a Element,
    joints: BTreeSet<usize>,
    links: BTreeSet<usize>,
    chains: Vec<ChainEnds>,
    subgroups: Vec<&'a str>,
}

pub(super) fn read_groups(
    elements: &XmlElements,
    root: &Element,
    robot: &Robot,
    names: &mut Names<'_>,
) -> Result<Vec<Group>, Fault> {
    let joint_to = joints_to_links(robot);
    let mut own: Vec<Own<'_>> = Vec::new();
    let mut n_members = 0;
    for element in elements.children(root).filter(|element| element.name == "group") {
        own.push(read_own(elements, element, robot, &joint_to, names, &mut n_members)?);
    }
    let mut index: HashMap<&str, usize> = HashMap::new();
    for (i, group) in own.iter().enumerate() {
        let name = required(group.element, "name")?;
        if index.insert(name, i).is_some() {
            let place = group.element.place();
            names
                .warnings
                .push(format!("{place}: a second group of that name; the last one counts"));
        }
    }
    let mut groups = Vec::new();
    for start in 0..own.len() {
        groups.push(resolved(&own, start, &index, names, &mut n_members)?);
    }
    Ok(groups)
}

/// For each link, the joint that leads to it.
fn joints_to_links(robot: &Robot) -> Vec<Option<usize>> {
    let mut joint_to = vec![None; robot.links.len()];
    for (joint, ends) in robot.joints.iter().enumerate() {
        joint_to[ends.child] = Some(joint);
    }
    joint_to
}

fn read_own<'a>(
    elements: &'a XmlElements,
    element: &'a Element,
    robot: &Robot,
    joint_to: &[Option<usize>],
    names: &mut Names<'_>,
    n_members: &mut usize,
) -> Result<Own<'a>, Fault> {
    let (mut joints, mut links) = (BTreeSet::new(), BTreeSet::new());
    let (mut chains, mut subgroups) = (Vec::new(), Vec::new());
    for child in elements.children(element) {
        match child.name.as_str() {
            "link" => {
                if let Some(link) = names.link(child, "name")? {
                    links.insert(link);
                    joints.extend(joint_to[link]);
                }
            }
            "joint" | "passive_joint" => {
                if let Some(joint) = names.joint(child, "name")? {
                    joints.insert(joint);
                    links.insert(robot.joints[joint].child);
                }
            }
            "chain" => {
                let ends = (names.link(child, "base_link")?, names.link(child, "tip_link")?);
                let (Some(base), Some(tip)) = ends else { continue };
                let Some(path) = path(robot, joint_to, base, tip) else {
                    let place = child.place();
                    names
                        .warnings
                        .push(format!("{place}: no joints lead from base to tip; passed over"));
                    continue;
                };
                count(element, n_members, path.len())?;
                links.insert(base);
                links.extend(path.iter().map(|&joint| robot.joints[joint].child));
                joints.extend(path);
                chains.push(ChainEnds { base, tip });
            }
            "group" => subgroups.push(required(child, "name")?),
            _ => {}
        }
    }
    Ok(Own { element, joints, links, chains, subgroups })
}

/// Joints from a link outwards to another.
fn path(robot: &Robot, joint_to: &[Option<usize>], base: usize, tip: usize) -> Option<Vec<usize>> {
    let (mut path, mut at) = (Vec::new(), tip);
    while at != base {
        let joint = joint_to[at]?;
        path.push(joint);
        at = robot.joints[joint].parent;
    }
    Some(path)
}

/// A group with all that its subgroups hold; each is visited once, so cycles end.
fn resolved(
    own: &[Own<'_>],
    start: usize,
    index: &HashMap<&str, usize>,
    names: &mut Names<'_>,
    n_members: &mut usize,
) -> Result<Group, Fault> {
    let (mut joints, mut links) = (BTreeSet::new(), BTreeSet::new());
    let (mut open, mut seen) = (vec![start], BTreeSet::from([start]));
    while let Some(at) = open.pop() {
        let group = &own[at];
        count(group.element, n_members, group.joints.len() + group.links.len() + 1)?;
        joints.extend(&group.joints);
        links.extend(&group.links);
        for name in &group.subgroups {
            match index.get(name) {
                Some(&next) if seen.insert(next) => open.push(next),
                Some(_) => {}
                // Told once, where the group itself is resolved.
                None if at == start => {
                    let place = group.element.place();
                    names.warnings.push(format!("{place}: no group {}; passed over", quoted(name)));
                }
                None => {}
            }
        }
    }
    Ok(Group {
        name: required(own[start].element, "name")?.into(),
        joints: joints.into_iter().collect(),
        links: links.into_iter().collect(),
        chains: own[start].chains.clone(),
    })
}

fn count(element: &Element, n_members: &mut usize, more: usize) -> Result<(), Fault> {
    *n_members += more;
    if *n_members <= MAX_MEMBERS {
        return Ok(());
    }
    let expected = format!("at most {MAX_MEMBERS} joints and links in all groups together");
    Err(Fault::new("size", element.place(), expected, "more"))
}
