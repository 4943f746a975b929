//! The picture of grasps: hands at the object, so that the region shows through them.
//!
//! Above, the best grasp from two sides, with the arrow along which the hand comes, the two contacts, the
//! table where there is one, and a bar that tells the size; below, the best few together, the better the
//! darker.

use std::path::Path;

use semfm::files::{GraspRecord, GraspsFile};
use semfm::geom::math::{DVec3, bounds};
use semfm::geom::{Mesh, Pinhole, Task};
use semfm::upright::upright;
use semfm::views::View;

use super::painted::Painted;
use super::scale_bar::draw_scale_bar;
use super::sheet::{Entry, PICTURE_SIDE, Row, Sheet};
use super::viewpoints::viewpoints_around;
use super::{Viewpoints, WeightedMesh};
use crate::Result;
use crate::colors::{APPROACH, CONTACT, HandColors, TABLE, grasp_color};
use crate::hand::{DrawnHand, affine};
use crate::surface::Surface;

/// More hands than this hide each other and the object.
pub(crate) const N_SHOWN: usize = 6;
/// How much of a hand is seen: with .5 its parts run into each other, with .8 the region is hidden.
pub(crate) const OPACITY: f32 = 0.62;
/// Outlines, without which translucent parts run into each other.
const EDGES: f64 = 0.45;
/// The arrow's length as a share of the hand's, its radius as a share of its length, and the space between
/// arrow and hand as a share of the hand's length.
pub(crate) const ARROW: f64 = 0.45;
pub(crate) const ARROW_RADIUS: f64 = 0.055;
pub(crate) const ARROW_GAP: f64 = 0.06;
/// Radius of a contact's ball as a share of the object's diagonal, and its bounds in metres.
const BALL: f64 = 0.012;
const BALL_RADII: [f64; 2] = [0.0012, 0.004];
/// The drawn part of the table reaches this much farther than the object.
pub(crate) const TABLE_REACH: f64 = 1.35;

/// Writes the picture of the first few grasps of a file on its mesh, which is in its own units; `weights`
/// is the region, one weight per vertex.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails, and where the task was
/// cancelled.
pub fn write_grasp_picture(
    path: &Path,
    mesh: &Mesh,
    weights: &[f64],
    grasps: &GraspsFile,
    task: &Task,
) -> Result<()> {
    let vertices = mesh.vertices().iter().map(|&p| p * grasps.object_scale).collect();
    let in_metres = Mesh::new(vertices, mesh.faces().to_vec())?;
    let scene = GraspScene::new(grasps, WeightedMesh { mesh: &in_metres, weights });
    let n = grasps.grasps.len();
    let shown = &grasps.grasps[..n.min(N_SHOWN)];
    let Some(best) = shown.first() else {
        let pictures = scene.pictures(&[], task)?;
        let rows = [Row { title: "no grasp was found".into(), pictures: &pictures }];
        return Sheet { columns: &[], rows: &rows, legend: &[Entry::Weights] }.write(path);
    };
    let which = if n == 1 { "the only grasp" } else { "the best grasp" };
    let (millimetres, score) = (1e3 * best.width, best.score);
    let title = format!("{which}: {millimetres:.0} mm between the pads, score {score:.2}");
    let mut legend = vec![Entry::Weights];
    let HandColors { palm, pad, .. } = HandColors::of_one();
    let names = [(palm, "hand"), (pad, "pad"), (CONTACT, "contact"), (APPROACH, "approach")];
    legend.extend(names.map(|(color, name)| Entry::Swatch(color, name.into())));
    legend.extend(grasps.table.map(|_| Entry::Swatch(TABLE, "table".into())));
    let alone = scene.pictures(&shown[..1], task)?;
    if shown.len() == 1 {
        let rows = [Row { title, pictures: &alone }];
        return Sheet { columns: &[], rows: &rows, legend: &legend }.write(path);
    }
    let together = scene.pictures(shown, task)?;
    let second = format!("the best {} of {n} grasps", shown.len());
    let rows = [Row { title, pictures: &alone }, Row { title: second, pictures: &together }];
    legend.push(Entry::Swatch(grasp_color(0, shown.len()), "best of several".into()));
    legend.push(Entry::Swatch(grasp_color(shown.len() - 1, shown.len()), "last shown".into()));
    Sheet { columns: &[], rows: &rows, legend: &legend }.write(path)
}

/// Radius of the ball at a contact of an object with this diagonal, metres.
pub(crate) fn ball_radius(diagonal: f64) -> f64 {
    let [least, most] = BALL_RADII;
    (BALL * diagonal).clamp(least, most)
}

/// An object in metres with the grasps of a file.
struct GraspScene<'a> {
    file: &'a GraspsFile,
    object: WeightedMesh<'a>,
    hand: DrawnHand,
}

impl<'a> GraspScene<'a> {
    fn new(file: &'a GraspsFile, object: WeightedMesh<'a>) -> Self {
        Self { file, object, hand: DrawnHand::of(file) }
    }

    /// The object with hands, from where the region is seen best and from another side. One hand has its
    /// arrow and its contacts beside it, several have the colours of their ranks.
    fn pictures(&self, grasps: &[GraspRecord], task: &Task) -> Result<Vec<View>> {
        let mut solid = Painted::object(self.object);
        if let [grasp] = grasps {
            self.add_marks(grasp, &mut solid);
        }
        let mut with_hands = solid.clone();
        for (rank, grasp) in grasps.iter().enumerate() {
            let colors = match grasps.len() {
                1 => HandColors::of_one(),
                n => HandColors::of_rank(rank, n),
            };
            self.add_hand(grasp, colors, &mut with_hands);
        }
        let viewpoints = self.viewpoints(&with_hands, task)?;
        let cameras = [viewpoints.best, viewpoints.other];
        let mut views = Vec::with_capacity(cameras.len());
        for camera in cameras {
            views.push(self.picture(&solid, &with_hands, camera, task)?);
        }
        Ok(views)
    }

    /// From where the object with hands is looked at: the object's own way up counts, or the table's.
    fn viewpoints(&self, with_hands: &Painted, task: &Task) -> Result<Viewpoints> {
        let mesh = with_hands.mesh()?;
        let mut weights = self.object.weights.to_vec();
        weights.resize(mesh.n_vertices(), 0.0);
        let up = match &self.file.table {
            Some(table) => DVec3::from_array(table.normal),
            None => upright(self.object.mesh)?.up,
        };
        let all = WeightedMesh { mesh: &mesh, weights: &weights };
        viewpoints_around(up, all, PICTURE_SIDE, task)
    }

    /// What is solid, and the hands over it as if of tinted glass. A table is glass, too, from below.
    fn picture(
        &self,
        solid: &Painted,
        with_hands: &Painted,
        camera: Pinhole,
        task: &Task,
    ) -> Result<View> {
        let (mut solid, mut with_hands) = (solid.clone(), with_hands.clone());
        if let Some(table) = &self.file.table {
            let [point, normal] = [table.point, table.normal].map(DVec3::from_array);
            let disc = self.table_disc(point, normal);
            with_hands.add(&disc, TABLE);
            if (camera.eye() - point).dot(normal) > 0.0 {
                solid.add(&disc, TABLE);
            }
        }
        let under = solid.rendered(camera, 0.0, task)?;
        let over = with_hands.rendered(camera, EDGES, task)?;
        let n_solid = self.object.mesh.n_faces() as i32;
        let mut rgb = under.rgb;
        let pixels = rgb.as_chunks_mut::<3>().0.iter_mut().zip(over.rgb.as_chunks::<3>().0);
        for ((under, over), triangle) in pixels.zip(&over.triangles) {
            // The object itself has no outlines.
            if !(0..n_solid).contains(triangle) {
                *under = tinted(*under, *over);
            }
        }
        let mut view = View { rgb, ..over };
        let middle =
            bounds(self.object.mesh.vertices()).map_or(DVec3::ZERO, |(a, b)| (a + b) / 2.0);
        draw_scale_bar(&mut view, camera.project(middle).z);
        Ok(view)
    }

    /// The part of the table below the object.
    fn table_disc(&self, point: DVec3, normal: DVec3) -> Surface {
        let (middle, radius) = self.object.mesh.bounding_sphere();
        let foot = middle - (middle - point).dot(normal) * normal;
        Surface::disc(foot, normal, TABLE_REACH * radius)
    }

    fn add_hand(&self, grasp: &GraspRecord, colors: HandColors, painted: &mut Painted) {
        let object_from_tcp = affine(&grasp.object_from_tcp);
        for part in &self.hand.parts {
            let place = object_from_tcp * affine(&grasp.hand.closed[part.carrier]);
            let mut surface = Surface::default();
            surface.add_at(&part.surface, place);
            painted.add(&surface, colors.of(part.kind));
        }
    }

    /// The arrow behind the hand and the contacts.
    fn add_marks(&self, grasp: &GraspRecord, painted: &mut Painted) {
        let back = self.hand.back(grasp);
        let (length, tip) = (-ARROW * back, (1.0 + ARROW_GAP) * back);
        let mut arrow = Surface::default();
        let along_z = Surface::arrow(tip - length, tip, ARROW_RADIUS * length);
        arrow.add_at(&along_z, affine(&grasp.object_from_tcp));
        painted.add(&arrow, APPROACH);
        let radius = ball_radius(self.object.mesh.diagonal());
        for contact in grasp.contacts {
            painted.add(&Surface::ball(DVec3::from_array(contact), radius), CONTACT);
        }
    }
}

/// A pixel seen through another.
fn tinted(under: [u8; 3], over: [u8; 3]) -> [u8; 3] {
    std::array::from_fn(|c| {
        let (under, over) = (f32::from(under[c]), f32::from(over[c]));
        (under + OPACITY * (over - under)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use parry3d_f64::math::Pose;
    use parry3d_f64::shape::Cuboid;
    use semfm::GraspResult;
    use semfm::grasp::{Grasp, Grasps, Rejected, SurfaceReport};
    use semfm::robot::Gripper;

    use super::*;

    /// A grasp of a block of 4 cm from above, on a table.
    fn block() -> Mesh {
        let (points, faces) = Cuboid::new(DVec3::splat(0.02)).to_trimesh();
        Mesh::new(points, faces).unwrap()
    }

    fn grasps_of(block: &Mesh, gripper: &str, n: usize) -> GraspsFile {
        let grasp = Grasp {
            object_from_tcp: Pose::from_parts(
                DVec3::new(0.0, 0.0, 0.012),
                semfm::geom::math::DQuat::from_rotation_x(std::f64::consts::PI),
            ),
            width: 0.0402,
            opening: 0.08,
            contacts: [DVec3::new(0.0, 0.02, 0.012), DVec3::new(0.0, -0.02, 0.012)],
            normals: [DVec3::Y, -DVec3::Y],
            epsilon: 0.0,
            closing_turn: 0.0,
            score: 1.0,
            hold: None,
            terms: Vec::new(),
        };
        let gripper = Gripper::builtin(gripper).unwrap();
        let found = Grasps {
            grasps: vec![grasp; n],
            rejected: Rejected::default(),
            nearest_miss: None,
            surface: SurfaceReport::of(block),
            n_candidates: n,
            n_survivors: n,
            stages_ms: Vec::new(),
        };
        let result = GraspResult {
            mesh: block,
            object_scale: 1.0,
            camera_from_object: None,
            gripper: &gripper,
            found: &found,
        };
        GraspsFile::new(&result)
    }

    /// Pixels that are neither grey nor red.
    fn n_blue(views: &[View]) -> usize {
        let pixels = views.iter().flat_map(|view| view.rgb.chunks_exact(3));
        pixels.filter(|rgb| rgb[2] > rgb[0].saturating_add(25)).count()
    }

    #[test]
    fn the_hand_is_in_the_picture_and_the_region_shows_through_it() {
        let block = block();
        let object = WeightedMesh { mesh: &block, weights: &[1.0; 8] };
        for gripper in ["franka", "robotiq-2f85"] {
            let file = grasps_of(&block, gripper, 1);
            let scene = GraspScene::new(&file, object);
            let none = scene.pictures(&[], &Task::default()).unwrap();
            let one = scene.pictures(&file.grasps, &Task::default()).unwrap();
            assert_eq!(n_blue(&none), 0);
            assert!(n_blue(&one) > 2000, "{gripper}: {}", n_blue(&one));
            // Where a finger stands before the block, the picture is redder than the finger alone.
            let tinted = one.iter().flat_map(|view| view.rgb.chunks_exact(3));
            let tinted = tinted.filter(|rgb| rgb[0] > rgb[1].saturating_add(20) && rgb[2] > rgb[1]);
            assert!(tinted.count() > 100, "{gripper}: nothing of the region shows through");
        }
    }

    #[test]
    fn several_grasps_differ_in_lightness() {
        let lightness = |[r, g, b]: [f32; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
        let all: Vec<f32> =
            (0..N_SHOWN).map(|rank| lightness(grasp_color(rank, N_SHOWN))).collect();
        assert!(all.windows(2).all(|pair| pair[1] > pair[0] + 0.05), "{all:?}");
    }

    #[test]
    fn files_without_a_grasp_and_with_many_are_drawn() {
        let (block, folder) = (block(), tempfile::tempdir().unwrap());
        for n in [0, 1, 9] {
            let path = folder.path().join(format!("{n}.png"));
            let file = grasps_of(&block, "franka", n);
            write_grasp_picture(&path, &block, &[0.0; 8], &file, &Task::default()).unwrap();
            let (_, height) = image::image_dimensions(&path).unwrap();
            assert_eq!(height > 2 * PICTURE_SIDE, n > 1);
        }
    }
}
