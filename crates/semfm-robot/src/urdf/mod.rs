//! Robot descriptions (URDF), read under limits and checks of our own.
//!
//! A file is checked in four steps. [`RobotDescription::read`] does the first three: the XML is
//! read under limits and without document types or entities; every element and number is checked
//! against the specification, with its line; `urdf-rs` parses our own clean copy of what passed;
//! then names, references, cycles, limits and masses are checked. A description may still be a
//! fragment (a tool that hangs on another robot's link, a list of transmissions): those findings
//! are listed, and the fourth step, [`RobotDescription::tree`], refuses them where a kinematic
//! tree is needed.
//!
//! Meshes are found by [`MeshPaths`]: inside the robot's own folder or inside packages that the
//! caller maps, never elsewhere. Nothing is ever run to find a package.

mod check;
mod description;
mod fault;
mod mesh_paths;
mod schema;
mod tree;
mod xml;

pub use description::{MeshUse, RobotDescription};
pub(crate) use fault::{Fault, quoted, short};
pub use mesh_paths::{MeshPaths, MeshPlace};
pub(crate) use xml::{Element, MAX_BYTES, XmlElements};
