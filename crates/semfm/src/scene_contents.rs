//! What stands around an arm, for collision checks and for what is shown, kept side by side.

use std::path::Path;
use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_geom::Mesh;
use semfm_geom::math::{DQuat, DVec3};
use semfm_motion::Scene;
use semfm_robot::Geometry;

use crate::files::{read_obstacle, read_scene};
use crate::{Error, MotionObstacle, Obstacle, ObstacleShape, POINT_MARGIN, Result};

/// Obstacles around an arm, each with a name of its own, in the frame of the arm's base, metres.
///
/// ```
/// use semfm::SceneContents;
/// use semfm::geom::math::DVec3;
/// use semfm::motion::Pose;
/// use semfm::robot::Geometry;
///
/// let shelf = Geometry::Box { size: DVec3::new(0.6, 0.3, 0.02) };
/// let scene = SceneContents::new()
///     .with_primitive("shelf", &shelf, Pose::translation(0.5, 0.0, 0.4))?
///     .with_table("table", DVec3::ZERO, DVec3::Z)?;
/// assert_eq!(scene.obstacles.len(), 2);
/// # Ok::<(), semfm::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SceneContents {
    /// For collision checks.
    pub scene: Scene,
    /// For pictures and for files that keep the scene.
    pub obstacles: Vec<MotionObstacle>,
}

impl SceneContents {
    /// Nothing around.
    pub fn new() -> Self {
        Self::default()
    }

    /// Reads what stands around: at most one `scene.json`, then meshes (metres) and point clouds, which are named after
    /// their files; clouds are kept [`POINT_MARGIN`] away from.
    ///
    /// # Errors
    /// Those of [`read_scene`] and [`read_obstacle`]; [`Error::Invalid`] for a second `scene.json`; [`Error::Motion`]
    /// for two files of one name.
    pub fn read<P: AsRef<Path>>(files: &[P]) -> Result<Self> {
        let is_scene =
            |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let paths = files.iter().map(AsRef::as_ref);
        let (scenes, others): (Vec<&Path>, Vec<&Path>) = paths.partition(|path| is_scene(path));
        let mut contents = match scenes.as_slice() {
            [] => Self::new(),
            [path] => read_scene(path)?,
            [_, second, ..] => {
                let found = format!("a second one, {}", second.display());
                return Err(Error::invalid("scene", "one scene.json at most", found));
            }
        };
        for path in others {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            contents = match read_obstacle(path)? {
                Obstacle::Mesh(mesh) => contents.with_mesh(&name, &mesh, 1.0, Pose::IDENTITY)?,
                Obstacle::Points(points) => {
                    contents.with_cloud(&name, points, POINT_MARGIN, Pose::IDENTITY)?
                }
            };
        }
        Ok(contents)
    }

    /// Adds a box, cylinder, capsule or ball.
    ///
    /// # Errors
    /// [`Error::Motion`] for negative sizes, numbers that are not finite, a mesh file, and a name
    /// that is there already.
    pub fn with_primitive(mut self, name: &str, shape: &Geometry, at: Pose) -> Result<Self> {
        self.scene = self.scene.with_primitive(name, shape, at)?;
        Ok(self.and(name, at, ObstacleShape::Primitive(shape.clone())))
    }

    /// Adds a mesh whose units are `scale` metres; where it is watertight, its inside is solid.
    ///
    /// # Errors
    /// [`Error::Motion`] for a mesh without triangles, a scale that is not positive, numbers that
    /// are not finite, and a name that is there already.
    pub fn with_mesh(mut self, name: &str, mesh: &Mesh, scale: f64, at: Pose) -> Result<Self> {
        self.scene = self.scene.with_mesh(name, mesh, scale, at)?;
        let points = mesh.vertices().iter().map(|&p| p * scale).collect();
        let in_metres = Mesh::new(points, mesh.faces().to_vec())?;
        Ok(self.and(name, at, ObstacleShape::Mesh(Arc::new(in_metres))))
    }

    /// Adds points; everything keeps `margin` metres away from each.
    ///
    /// # Errors
    /// [`Error::Motion`] for a negative margin, numbers that are not finite, and a name that is
    /// there already.
    pub fn with_cloud(
        mut self,
        name: &str,
        points: Vec<DVec3>,
        margin: f64,
        at: Pose,
    ) -> Result<Self> {
        self.scene = self.scene.with_cloud(name, &points, margin, at)?;
        Ok(self.and(name, at, ObstacleShape::Points(points)))
    }

    /// Adds a table: everything below the plane through `point` is solid. `normal` points away from it, at any length.
    ///
    /// # Errors
    /// [`Error::Motion`] for numbers that are not finite, a normal of length 0, and a name that is
    /// there already.
    pub fn with_table(mut self, name: &str, point: DVec3, normal: DVec3) -> Result<Self> {
        self.scene = self.scene.with_table(name, point, normal)?;
        let turn = DQuat::from_rotation_arc(DVec3::Z, normal.normalize());
        Ok(self.and(name, Pose::from_parts(point, turn), ObstacleShape::HalfSpace))
    }

    fn and(mut self, name: &str, at: Pose, shape: ObstacleShape) -> Self {
        self.obstacles.push(MotionObstacle { name: name.into(), base_from_obstacle: at, shape });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_checked_and_what_is_shown_have_the_same_names_and_places() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = Mesh::new(corners.clone(), vec![[0, 1, 2]]).unwrap();
        let at = Pose::translation(0.1, 0.2, 0.3);
        let contents = SceneContents::new()
            .with_primitive("ball", &Geometry::Sphere { radius: 0.1 }, at)
            .and_then(|scene| scene.with_mesh("sheet", &mesh, 0.01, at))
            .and_then(|scene| scene.with_cloud("cloud", corners, 0.005, at))
            .and_then(|scene| scene.with_table("table", DVec3::ZERO, 3.0 * DVec3::X))
            .unwrap();
        let shown: Vec<&str> = contents.obstacles.iter().map(|o| o.name.as_str()).collect();
        assert_eq!(contents.scene.names().collect::<Vec<_>>(), shown);
        let ObstacleShape::Mesh(sheet) = &contents.obstacles[1].shape else { panic!() };
        assert_eq!(sheet.vertices()[1], DVec3::new(0.01, 0.0, 0.0));
        let away = contents.obstacles[3].base_from_obstacle.rotation * DVec3::Z;
        assert!(away.distance(DVec3::X) < 1e-12);
        let twice = contents.with_table("ball", DVec3::ZERO, DVec3::Z);
        assert!(twice.unwrap_err().to_string().contains("ball"));
    }
}
