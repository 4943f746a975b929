//! Links: rigid bodies with their shapes.

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

/// A rigid body with its shapes, in its own frame, metres.
#[derive(Clone, Debug)]
pub struct Link {
    /// Name in the file.
    pub name: String,
    /// What collides.
    pub collisions: Vec<LinkGeometry>,
    /// What is seen.
    pub visuals: Vec<LinkGeometry>,
    /// Mass and its distribution; zero where the file tells none.
    pub inertial: Inertial,
}

/// Mass of a link and how it is distributed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Kilograms.
    pub mass: f64,
    /// Frame at the centre of mass in which the tensor is given.
    pub link_from_inertial: Pose,
    /// Moments of inertia (xx, yy, zz), kg m².
    pub moments: [f64; 3],
    /// Products of inertia (xy, xz, yz), kg m².
    pub products: [f64; 3],
}

/// A shape at its place in a link.
#[derive(Clone, Debug)]
pub struct LinkGeometry {
    /// Its place.
    pub link_from_geometry: Pose,
    /// Its shape, metres.
    pub geometry: Geometry,
}

/// Shapes of URDF, about their own origin; cylinders and capsules along z.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Geometry {
    /// A box by its full edge lengths.
    Box {
        /// Lengths along x, y and z.
        size: DVec3,
    },
    /// A cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
    /// A cylinder with half spheres at its ends.
    Capsule {
        /// Radius.
        radius: f64,
        /// Length between the centres of the half spheres.
        length: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A mesh file.
    Mesh {
        /// Its name as written.
        filename: String,
        /// Factors along x, y and z; a negative one mirrors.
        scale: DVec3,
    },
}
