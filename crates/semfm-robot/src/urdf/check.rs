//! What `urdf-rs` does not check: before it, whether this is a URDF at all; after it, names,
//! references, cycles, limits and masses.

use std::collections::{HashMap, HashSet};

use super::fault::{Fault, quoted, short};
use super::xml::{Element, XmlElements};

/// What keeps a sound description from being one tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Findings {
    /// Links without a joint that leads to them.
    pub roots: Vec<String>,
    /// Where each link stands.
    pub link_places: Vec<String>,
    /// Each deviation in words.
    pub tree: Vec<String>,
}

type Result<T> = std::result::Result<T, Fault>;

/// Shortest axis that has a direction.
const MIN_AXIS: f64 = 1e-9;

// ---- before the parser

/// Checks root, version, xacro, materials and transmissions; gives notes.
pub(crate) fn before(elements: &XmlElements) -> Result<Vec<String>> {
    let Some(root) = elements.root() else {
        return Err(Fault::new("root", "whole file", "an element `robot`", "no element"));
    };
    if root.name != "robot" {
        let found = quoted(&root.name);
        return Err(Fault::new("root", root.place(), "an element `robot`", found));
    }
    check_version(root)?;
    let mut notes = Vec::new();
    for child in elements.children(root) {
        match child.name.as_str() {
            "material" => {
                let (color, texture) =
                    (elements.child(child, "color"), elements.child(child, "texture"));
                if color.is_none() && texture.is_none() {
                    let expected = "a colour or a texture";
                    return Err(Fault::new("material", child.place(), expected, "neither"));
                }
            }
            "transmission" => check_transmission(elements, child)?,
            name => check_xacro(name, child, &mut notes)?,
        }
    }
    Ok(notes)
}

/// `1.0`, `1.1` or `1.2`, as urdfdom reads it: two numbers and a dot.
fn check_version(root: &Element) -> Result<()> {
    let Some(version) = root.attribute("version") else { return Ok(()) };
    if let Some(("1", minor)) = version.split_once('.')
        && (1..4).contains(&minor.len())
        && minor.bytes().all(|byte| byte.is_ascii_digit())
    {
        return Ok(());
    }
    Err(Fault::new("version", root.place(), "version 1.x", quoted(version)))
}

/// A transmission in the present form (its type an element) connects joints with actuators.
fn check_transmission(elements: &XmlElements, transmission: &Element) -> Result<()> {
    if elements.child(transmission, "type").is_none() {
        return Ok(());
    }
    for need in ["joint", "actuator"] {
        if elements.child(transmission, need).is_none() {
            let expected = format!("at least one `{need}`");
            return Err(Fault::new("transmission", transmission.place(), expected, "none"));
        }
    }
    Ok(())
}

/// Directives of xacro mean that this is a source which was never expanded. A call of a macro that
/// nobody knew is left over by old expanders, and is noted.
fn check_xacro(name: &str, element: &Element, notes: &mut Vec<String>) -> Result<()> {
    const DIRECTIVES: [&str; 8] =
        ["include", "macro", "property", "arg", "if", "unless", "insert_block", "call"];
    let Some(rest) = name.strip_prefix("xacro:") else { return Ok(()) };
    if DIRECTIVES.contains(&rest) {
        let found = quoted(name);
        return Err(Fault::new("xacro", element.place(), "a URDF that xacro has expanded", found));
    }
    notes.push(format!("line {}: `{}` was never expanded", element.line, short(name)));
    Ok(())
}

// ---- after the parser

/// Checks joints and links of the parsed robot; line numbers come from the elements, which are in
/// the same order.
pub(crate) fn after(
    elements: &XmlElements,
    robot: &urdf_rs::Robot,
    notes: &mut Vec<String>,
) -> Result<Findings> {
    let [links, joints] = ["link", "joint"].map(|name| places(elements, name));
    if (links.len(), joints.len()) != (robot.links.len(), robot.joints.len()) {
        let expected = format!("{} links, {} joints", links.len(), joints.len());
        let found = format!("{}, {}", robot.links.len(), robot.joints.len());
        return Err(Fault::new("urdf", "robot", expected, found));
    }
    for (link, place) in robot.links.iter().zip(&links) {
        check_mass(&link.inertial, place, notes)?;
        check_scales(link, place)?;
    }
    let elements_of_joints = elements
        .root()
        .into_iter()
        .flat_map(|root| elements.children(root).filter(|child| child.name == "joint"));
    for ((joint, place), element) in robot.joints.iter().zip(&joints).zip(elements_of_joints) {
        check_motion(joint, place, elements.child(element, "limit"), notes)?;
    }
    check_names(robot, &joints)?;
    check_mimics(robot, &joints)?;
    let findings = check_tree(robot, &joints)?;
    Ok(Findings { link_places: links, ..findings })
}

/// Where each element of that name in the robot stands.
fn places(elements: &XmlElements, name: &str) -> Vec<String> {
    let children = elements.root().into_iter().flat_map(|root| elements.children(root));
    children.filter(|child| child.name == name).map(Element::place).collect()
}

fn check_mass(inertial: &urdf_rs::Inertial, place: &str, notes: &mut Vec<String>) -> Result<()> {
    let (mass, i) = (inertial.mass.value, &inertial.inertia);
    if mass < 0.0 {
        return Err(Fault::new("inertia", place, "a mass not below zero", mass));
    }
    if let Some(&moment) = [i.ixx, i.iyy, i.izz].iter().find(|&&moment| moment < 0.0) {
        return Err(Fault::new("inertia", place, "a moment of inertia not below zero", moment));
    }
    // Sylvester's criterion: the tensor of a body is positive semidefinite, so no leading minor is
    // negative (to rounding).
    let minor = i.ixx * i.iyy - i.ixy * i.ixy;
    let determinant = i.ixx * (i.iyy * i.izz - i.iyz * i.iyz)
        - i.ixy * (i.ixy * i.izz - i.iyz * i.ixz)
        + i.ixz * (i.ixy * i.iyz - i.iyy * i.ixz);
    let scale = i.ixx.max(i.iyy).max(i.izz);
    if minor < -1e-9 * scale.powi(2) || determinant < -1e-9 * scale.powi(3) {
        notes.push(format!("{place}: the inertia is not that of a body"));
    }
    Ok(())
}

fn check_scales(link: &urdf_rs::Link, place: &str) -> Result<()> {
    let visuals = link.visual.iter().map(|visual| &visual.geometry);
    let solids = link.collision.iter().map(|collision| &collision.geometry);
    for geometry in visuals.chain(solids) {
        if let urdf_rs::Geometry::Mesh { scale: Some(scale), .. } = geometry
            && scale.contains(&0.0)
        {
            let [x, y, z] = scale.0;
            let found = format!("{x} {y} {z}");
            return Err(Fault::new("geometry", place, "a scale without a zero", found));
        }
    }
    Ok(())
}

fn check_motion(
    joint: &urdf_rs::Joint,
    place: &str,
    limit: Option<&Element>,
    notes: &mut Vec<String>,
) -> Result<()> {
    use urdf_rs::JointType::{Continuous, Planar, Prismatic, Revolute};
    let turns = matches!(joint.joint_type, Revolute | Continuous | Prismatic | Planar);
    let axis = joint.axis.xyz.0;
    if turns && axis.iter().map(|x| x * x).sum::<f64>().sqrt() < MIN_AXIS {
        let [x, y, z] = axis;
        let found = format!("{x} {y} {z}");
        return Err(Fault::new("axis", place, "an axis with a direction", found));
    }
    if matches!(joint.joint_type, Revolute | Prismatic) {
        let (lower, upper) = (joint.limit.lower, joint.limit.upper);
        if lower > upper {
            let expected = format!("an upper limit of at least {lower}");
            return Err(Fault::new("limit", place, expected, upper));
        }
        let is_told = limit.is_some_and(|limit| {
            ["lower", "upper"].iter().any(|end| limit.attribute(end).is_some())
        });
        if !is_told {
            let kind = if joint.joint_type == Revolute { "revolute" } else { "prismatic" };
            notes.push(format!(
                "{place}: a {kind} joint without limits (`lower` and `upper` of `limit`) does not move"
            ));
        } else if lower == upper {
            notes.push(format!("{place}: no range of motion"));
        }
    }
    Ok(())
}

/// Joints are named by mimics and by controllers, so a name must mean one of them.
fn check_names(robot: &urdf_rs::Robot, places: &[String]) -> Result<()> {
    let mut known = HashSet::new();
    for (joint, place) in robot.joints.iter().zip(places) {
        if !known.insert(&joint.name) {
            let expected = "names of joints that occur once";
            return Err(Fault::new("duplicate-name", place, expected, "a second one"));
        }
    }
    Ok(())
}

fn check_mimics(robot: &urdf_rs::Robot, places: &[String]) -> Result<()> {
    let index: HashMap<&str, usize> =
        robot.joints.iter().enumerate().map(|(i, joint)| (joint.name.as_str(), i)).collect();
    // The end of the chain of each joint that was followed, so that no chain is walked twice.
    let mut ends = vec![false; places.len()];
    let mut walk_of = vec![usize::MAX; places.len()];
    for (walk, place) in places.iter().enumerate() {
        let mut at = walk;
        let mut chain = Vec::new();
        while let Some(mimic) = &robot.joints[at].mimic {
            if ends[at] {
                break;
            }
            if walk_of[at] == walk {
                return Err(Fault::new("cycle", place, "a mimic that ends", "a cycle"));
            }
            walk_of[at] = walk;
            chain.push(at);
            let Some(&next) = index.get(mimic.joint.as_str()) else {
                let found = quoted(&mimic.joint);
                return Err(Fault::new("reference", place, "a mimic of a joint there is", found));
            };
            at = next;
        }
        chain.into_iter().for_each(|joint| ends[joint] = true);
    }
    Ok(())
}

/// One tree, or why not: what can be meant as part of a larger robot is listed, the rest refused.
fn check_tree(robot: &urdf_rs::Robot, places: &[String]) -> Result<Findings> {
    let mut findings = Findings::default();
    let mut names = HashSet::new();
    for link in &robot.links {
        if !names.insert(link.name.as_str()) {
            findings.tree.push(format!("link `{}` occurs twice", short(&link.name)));
        }
    }
    let mut parents: HashMap<&str, usize> = HashMap::new();
    for (joint, place) in robot.joints.iter().zip(places) {
        if !names.contains(joint.child.link.as_str()) {
            let found = quoted(&joint.child.link);
            return Err(Fault::new("reference", place, "a child that is a link", found));
        }
        if !names.contains(joint.parent.link.as_str()) {
            let parent = short(&joint.parent.link);
            findings.tree.push(format!("{place}: hangs on a link `{parent}` that is not here"));
        }
        *parents.entry(&joint.child.link).or_default() += 1;
    }
    for link in &robot.links {
        if parents.get(link.name.as_str()).is_some_and(|&n| n > 1) {
            findings.tree.push(format!("link `{}` has two parents", short(&link.name)));
        }
    }
    check_cycles(robot, places)?;
    let links = robot.links.iter();
    let roots: Vec<&urdf_rs::Link> =
        links.filter(|link| !parents.contains_key(link.name.as_str())).collect();
    check_roots(robot, &roots, &mut findings)?;
    findings.roots = roots.iter().map(|link| link.name.clone()).collect();
    Ok(findings)
}

/// Takes away joints from links that no joint leads to until none is left or a cycle is (Kahn 1962, "Topological sorting
/// of large networks").
fn check_cycles(robot: &urdf_rs::Robot, places: &[String]) -> Result<()> {
    let mut joints_on: HashMap<&str, Vec<usize>> = HashMap::new();
    let mut n_parents: HashMap<&str, usize> = HashMap::new();
    for (i, joint) in robot.joints.iter().enumerate() {
        joints_on.entry(&joint.parent.link).or_default().push(i);
        *n_parents.entry(&joint.child.link).or_default() += 1;
    }
    let mut left = vec![true; robot.joints.len()];
    let mut free: Vec<&str> =
        joints_on.keys().copied().filter(|link| !n_parents.contains_key(link)).collect();
    while let Some(link) = free.pop() {
        for &joint in joints_on.get(link).into_iter().flatten() {
            left[joint] = false;
            let child = robot.joints[joint].child.link.as_str();
            let parents = n_parents.entry(child).or_default();
            *parents -= 1;
            if *parents == 0 {
                free.push(child);
            }
        }
    }
    match left.iter().position(|&left| left) {
        Some(joint) => {
            Err(Fault::new("cycle", places[joint].clone(), "joints without a cycle", "a cycle"))
        }
        None => Ok(()),
    }
}

/// Several roots are several robots, unless all but one are bare names: frames without a body that
/// nothing uses.
fn check_roots(
    robot: &urdf_rs::Robot,
    roots: &[&urdf_rs::Link],
    findings: &mut Findings,
) -> Result<()> {
    let bears: HashSet<&str> =
        robot.joints.iter().map(|joint| joint.parent.link.as_str()).collect();
    let is_bare = |link: &urdf_rs::Link| is_bodiless(link) && !bears.contains(link.name.as_str());
    match roots {
        [_] => Ok(()),
        [] => {
            findings.tree.push("no root: no link that no joint leads to".into());
            Ok(())
        }
        _ if roots.iter().filter(|link| !is_bare(link)).count() == 1 => {
            for link in roots.iter().filter(|link| is_bare(link)) {
                let name = short(&link.name);
                findings.tree.push(format!("link `{name}` is bare and connected to nothing"));
            }
            Ok(())
        }
        _ => {
            let shown: Vec<String> = roots.iter().take(4).map(|link| quoted(&link.name)).collect();
            let found = format!("{}: {}", roots.len(), shown.join(", "));
            Err(Fault::new("tree", "robot", "one root", found))
        }
    }
}

/// A frame without a body.
fn is_bodiless(link: &urdf_rs::Link) -> bool {
    link.visual.is_empty() && link.collision.is_empty() && link.inertial.mass.value == 0.0
}
