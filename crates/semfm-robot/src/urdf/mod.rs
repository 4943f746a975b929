//! Robot descriptions (URDF), read behind our own limits and checks.
//!
//! A file passes four doors. [`Description::read`] goes through the first three: the XML is read
//! under limits and without document types or entities; every element and number is checked
//! against the specification, with its line; `urdf-rs` parses our own clean copy of what passed;
//! then names, references, cycles, limits and masses are checked. A description may still be a
//! fragment (a tool that hangs on another robot's link, a list of transmissions): those findings
//! are listed, and the fourth door, [`Description::tree`], refuses them where a kinematic tree is
//! needed.
//!
//! Meshes are found by [`MeshPaths`]: inside the robot's own folder or inside packages that the
//! caller maps, never elsewhere. Nothing is ever run to find a package.

mod check;
mod description;
mod meshes;
mod outline;
mod robot;
mod schema;

pub use description::{Description, MeshUse};
pub use meshes::{MeshPaths, MeshPlace};
pub use robot::{Geometry, Joint, JointKind, Link, Mimic, Robot, Solid};

/// What is wrong with a description, before the path of its file is known.
#[derive(Clone, Debug)]
pub(crate) struct Fault {
    /// Kind of failure, kebab-case.
    pub code: &'static str,
    /// Line, element, name.
    pub place: String,
    /// What should stand there.
    pub expected: String,
    /// What stands there.
    pub found: String,
}

impl Fault {
    pub(crate) fn new(
        code: &'static str,
        place: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self { code, place: place.into(), expected: expected.into(), found: found.to_string() }
    }

    /// With the file that it is about.
    pub(crate) fn in_file(self, path: &std::path::Path) -> crate::Error {
        let Self { code, place, expected, found } = self;
        crate::Error::Urdf { path: path.to_owned(), code, place, expected, found }
    }
}
