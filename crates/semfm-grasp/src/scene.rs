//! What stands around the object: a table, meshes, points.

use std::fmt;

use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, without_repeated_faces};

use crate::obstacle::Obstacle;
use crate::settings::direction;
use crate::{Error, Result};

/// A table top: everything below the plane is solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table {
    /// A point of the plane, in the object's frame, metres.
    pub point: DVec3,
    /// Unit normal, away from the table.
    pub normal: DVec3,
}

/// Obstacles around the object, in the object's frame (that of [`GraspObject`](crate::GraspObject)),
/// metres. The object itself is not part of it.
#[derive(Default)]
pub struct Scene {
    table: Option<Table>,
    obstacles: Vec<Obstacle>,
}

impl Scene {
    /// Nothing around.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a table through `point`; `normal` points away from it, at any length.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for numbers that are not finite and a normal of length 0.
    pub fn with_table(mut self, point: DVec3, normal: DVec3) -> Result<Self> {
        direction("normal of the table", normal)?;
        if !point.is_finite() {
            let expected = "finite coordinates".into();
            return Err(Error::OutOfRange { what: "table", expected, found: point.to_string() });
        }
        self.table = Some(Table { point, normal: normal.normalize() });
        Ok(self)
    }

    /// Adds a mesh: nothing of the gripper may touch a triangle of it, nor be inside where it is
    /// watertight.
    pub fn with_mesh(mut self, mesh: &Mesh) -> Self {
        let distinct = without_repeated_faces(mesh);
        self.obstacles.push(Obstacle::of_mesh(distinct.as_ref().unwrap_or(mesh)));
        self
    }

    /// Adds points; the gripper keeps `margin` metres away from each. An empty cloud adds nothing.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for numbers that are not finite and a negative margin.
    pub fn with_cloud(mut self, points: &[DVec3], margin: f64) -> Result<Self> {
        if !(margin >= 0.0 && margin.is_finite()) {
            return Error::out_of_range("margin around the cloud", "at least 0 m", margin);
        }
        if let Some(i) = points.iter().position(|p| !p.is_finite()) {
            let found = format!("{} at point {i}", points[i]);
            return Error::out_of_range("points of the scene", "finite coordinates", found);
        }
        if !points.is_empty() {
            self.obstacles.push(Obstacle::of_points(points.to_vec(), margin));
        }
        Ok(self)
    }

    /// The table, if there is one.
    pub fn table(&self) -> Option<Table> {
        self.table
    }

    pub(crate) fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }
}

impl fmt::Debug for Scene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scene")
            .field("table", &self.table)
            .field("n_obstacles", &self.obstacles.len())
            .finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_without_sense_is_refused() {
        assert!(Scene::new().with_table(DVec3::ZERO, DVec3::ZERO).is_err());
        assert!(Scene::new().with_cloud(&[DVec3::ZERO], -1.0).is_err());
        assert!(Scene::new().with_cloud(&[DVec3::NAN], 0.0).is_err());
        let scene = Scene::new().with_cloud(&[], 0.1).unwrap();
        assert!(scene.obstacles().is_empty());
        let table = Scene::new().with_table(DVec3::ZERO, 3.0 * DVec3::Z).unwrap().table().unwrap();
        assert_eq!(table.normal, DVec3::Z);
    }
}
