//! A URDF file as it was found: sound in itself, perhaps not yet a tree.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use semfm_geom::io::{foreign_kind, read_at_most};

use super::check::{self, Findings};
use super::fault::{Fault, short};
use super::mesh_paths::{MeshPaths, MeshPlace};
use super::xml::{MAX_BYTES, XmlElements};
use super::{schema, tree};
use crate::Result;
use crate::robot::Robot;

/// A robot description that passed the checks of its text, numbers and references.
#[derive(Clone, Debug)]
pub struct RobotDescription {
    path: PathBuf,
    robot: urdf_rs::Robot,
    findings: Findings,
    notes: Vec<String>,
}

/// A mesh that a description names, and where it was found.
#[derive(Clone, Debug)]
pub struct MeshUse {
    /// The link that it belongs to.
    pub link: String,
    /// Its name in the file.
    pub filename: String,
    /// Whether it is there.
    pub place: MeshPlace,
}

impl RobotDescription {
    /// Reads a URDF file.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be read or is no regular file; [`Error::Urdf`](crate::Error::Urdf) with code, line and element where the file is too large, is
    /// not plain XML in UTF-8, is not a URDF (SDF, xacro source), holds a number that is not
    /// finite, a negative size or mass, an inverted limit, an axis without direction, a name that
    /// occurs twice among joints, a joint into a link that is not there, a cycle, a mimic of
    /// nothing or of itself, or several unconnected robots.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::parse(&read_at_most(path, MAX_BYTES + 1)?, path)
    }

    /// Reads the bytes of a URDF; `path` names it in messages and is where relative meshes start.
    ///
    /// # Errors
    /// [`Error::Urdf`](crate::Error::Urdf), see [`RobotDescription::read`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let Parsed { robot, findings, notes } =
            parse(bytes).map_err(|fault| fault.in_file(path))?;
        Ok(Self { path: path.to_owned(), robot, findings, notes })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The robot's name.
    pub fn name(&self) -> &str {
        &self.robot.name
    }

    /// Number of links.
    pub fn n_links(&self) -> usize {
        self.robot.links.len()
    }

    /// Number of joints.
    pub fn n_joints(&self) -> usize {
        self.robot.joints.len()
    }

    /// Number of joints that move by themselves: neither fixed nor a mimic.
    pub fn n_movable(&self) -> usize {
        let fixed = urdf_rs::JointType::Fixed;
        let joints = self.robot.joints.iter();
        joints.filter(|joint| joint.joint_type != fixed && joint.mimic.is_none()).count()
    }

    /// Names of the links that no joint leads to.
    pub fn roots(&self) -> &[String] {
        &self.findings.roots
    }

    /// What keeps it from being one kinematic tree; empty for a whole robot.
    pub fn tree_findings(&self) -> &[String] {
        &self.findings.tree
    }

    /// What was passed over or looks odd, in words.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Every mesh that a visual or collision names, each name once for a link.
    ///
    /// # Errors
    /// [`Error::Urdf`](crate::Error::Urdf) where a name leads out of the folders that are allowed or has another
    /// protocol.
    pub fn meshes(&self, paths: &MeshPaths) -> Result<Vec<MeshUse>> {
        let mut uses: Vec<MeshUse> = Vec::new();
        for (link, place) in self.robot.links.iter().zip(&self.findings.link_places) {
            let mut known = HashSet::new();
            let visuals = link.visual.iter().map(|visual| &visual.geometry);
            let solids = link.collision.iter().map(|collision| &collision.geometry);
            for geometry in visuals.chain(solids) {
                let urdf_rs::Geometry::Mesh { filename, .. } = geometry else { continue };
                if !known.insert(filename) {
                    continue;
                }
                let place = format!("{place}: mesh");
                let place = paths.find(filename, &place).map_err(|f| f.in_file(&self.path))?;
                let (link, filename) = (link.name.clone(), filename.clone());
                uses.push(MeshUse { link, filename, place });
            }
        }
        Ok(uses)
    }

    /// The kinematic tree.
    ///
    /// # Errors
    /// [`Error::Urdf`](crate::Error::Urdf) with the first of [`RobotDescription::tree_findings`]: a fragment is no tree.
    pub fn tree(&self) -> Result<Robot> {
        if let Some(finding) = self.findings.tree.first() {
            let fault = Fault::new("tree", "robot", "one tree of links", finding);
            return Err(fault.in_file(&self.path));
        }
        tree::build(&self.robot).map_err(|fault| fault.in_file(&self.path))
    }
}

/// What the checks left of a description.
struct Parsed {
    robot: urdf_rs::Robot,
    findings: Findings,
    notes: Vec<String>,
}

fn parse(bytes: &[u8]) -> std::result::Result<Parsed, Fault> {
    if bytes.len() as u64 > MAX_BYTES {
        let expected = format!("at most {} MB", MAX_BYTES >> 20);
        return Err(Fault::new("size", "whole file", expected, "more"));
    }
    if let Some(kind) = foreign_kind(bytes).filter(|kind| *kind != "XML") {
        return Err(Fault::new("urdf", "first bytes", "a URDF", kind));
    }
    let elements = XmlElements::read(bytes)?;
    let mut notes = check::before(&elements)?;
    let clean = clean_copy(&elements)?;
    let mut robot = urdf_rs::read_from_string(&clean)
        .map_err(|error| Fault::new("urdf", "robot", "a URDF", short(&error.to_string())))?;
    robot.name = elements.root().and_then(|root| root.attribute("name")).unwrap_or_default().into();
    let findings = check::after(&elements, &robot, &mut notes)?;
    Ok(Parsed { robot, findings, notes })
}

/// What the parser reads: links and joints as they passed the schema, nothing else.
fn clean_copy(elements: &XmlElements) -> std::result::Result<String, Fault> {
    let mut out = String::from("<robot");
    let Some(root) = elements.root() else { return Ok(out + "/>") };
    if let Some(version) = root.attribute("version") {
        // Digits and one dot: the version was checked.
        out.push_str(&format!(" version=\"{version}\""));
    }
    out.push('>');
    // First all of one kind: where links and joints take turns, the parser goes through all that follows for each.
    for kind in ["link", "joint"] {
        for child in elements.children(root).filter(|child| child.name == kind) {
            schema::write(elements, child, &mut out)?;
        }
    }
    out.push_str("</robot>");
    Ok(out)
}
