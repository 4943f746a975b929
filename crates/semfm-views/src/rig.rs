//! The rig: cameras all around an object, posed in the object's own frame.

use std::fmt;

use semfm_geom::math::{DAffine3, DMat3, DVec3};
use semfm_geom::sampling::fibonacci_directions;
use semfm_geom::{Intrinsics, Mesh, Pinhole, principal_axes, surface_vertices};

use crate::render::MAX_IMAGE_SIDE;
use crate::{Error, Result};

/// The camera stands so that the bounding sphere fits its view with this much to spare.
const STAND_OFF: f64 = 1.02;

/// How many cameras there are and what each frames.
///
/// What the encoder is shown matters more than any later choice. The defaults were found on real
/// meshes with a real encoder; the frame of the file instead of the principal one, a rig of two
/// rings, and orthographic or unzoomed pictures were all worse.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct RigSettings {
    /// Number of views N.
    pub count: usize,
    /// Side of the square images in pixels.
    pub size: u32,
    /// Full angle of view that the bounding sphere would fill, in radians.
    pub field_of_view: f64,
    /// Share of the image's side that the silhouette's longer side fills.
    pub fill: f64,
    /// Zoom at most this factor beyond the fit of the bounding sphere, so that an object seen
    /// end-on stays small.
    pub max_zoom: f64,
    /// Pose the cameras in the object's principal frame (else in the file's, with z up).
    pub principal_frame: bool,
    /// Close-ups beside each view, spread along the silhouette's longer side: each frames
    /// [`CLOSE_UP`] of what the view frames, so that thin objects and small handles fill more
    /// patches. Where the zoom is at its limit, those of a view are alike.
    pub close_ups: usize,
}

/// Share of the whole view's framed square that a close-up frames.
pub const CLOSE_UP: f64 = 0.55;

/// Close-ups of one view; more would only repeat each other.
const MAX_CLOSE_UPS: usize = 8;

impl Default for RigSettings {
    fn default() -> Self {
        Self {
            count: 14,
            size: 224,
            field_of_view: 30f64.to_radians(),
            fill: 0.8,
            max_zoom: 1.5,
            principal_frame: true,
            close_ups: 0,
        }
    }
}

impl fmt::Display for RigSettings {
    /// In one line, for the metadata of files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { count, close_ups, field_of_view, fill, max_zoom, .. } = self;
        let frame = if self.principal_frame { "principal frame" } else { "z up" };
        let degrees = field_of_view.to_degrees();
        write!(f, "fibonacci {count}, {frame}, {degrees:.1}°, fill {fill}, zoom {max_zoom}")?;
        if *close_ups > 0 { write!(f, ", {close_ups} close-ups") } else { Ok(()) }
    }
}

impl RigSettings {
    /// Cameras of the method `semfm`: the paper leaves them open, so these are the default ones;
    /// what that method fixes is one upright picture per view, without rolls.
    pub fn paper() -> Self {
        Self::default()
    }

    fn check(&self) -> Result<()> {
        let Self { count, size, field_of_view, fill, max_zoom, close_ups, .. } = *self;
        let (field, expected, found) = if !(1..=4096).contains(&count) {
            ("views of the rig", "1 to 4096".to_owned(), count.to_string())
        } else if !(1..=MAX_IMAGE_SIDE).contains(&size) {
            ("image size", format!("1 to {MAX_IMAGE_SIDE} pixels"), size.to_string())
        } else if !(field_of_view > 0.0 && field_of_view < 3.0) {
            let expected = "more than 0 and less than 3 rad".to_owned();
            ("field of view", expected, field_of_view.to_string())
        } else if close_ups > MAX_CLOSE_UPS {
            ("close-ups", format!("at most {MAX_CLOSE_UPS}"), close_ups.to_string())
        } else if !(fill > 0.0 && fill <= 1.0) {
            ("fill", "more than 0 and at most 1".to_owned(), fill.to_string())
        } else if !(max_zoom >= 1.0 && max_zoom.is_finite()) {
            ("largest zoom", "a finite factor of at least 1".to_owned(), max_zoom.to_string())
        } else {
            return Ok(());
        };
        Err(Error::invalid(field, expected, found))
    }
}

/// Cameras at Fibonacci-sphere directions around the object, each zoomed and centred on the
/// silhouette's bounding rectangle by its focal length and principal point. The close-ups of a view
/// follow it.
///
/// ```
/// use semfm_geom::{Mesh, Pinhole, math::DVec3};
/// use semfm_views::{RigSettings, rig};
/// let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]])?;
/// let cameras = rig(&mesh, &RigSettings { count: 6, ..Default::default() })?;
/// assert_eq!(cameras.len(), 6);
/// # Ok::<(), semfm_views::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for settings outside their range, [`semfm_geom::Error::NoArea`] for a
/// surface without area.
pub fn rig(mesh: &Mesh, settings: &RigSettings) -> Result<Vec<Pinhole>> {
    settings.check()?;
    let frame = principal_axes(mesh)?;
    let frame = if settings.principal_frame { frame } else { DMat3::IDENTITY };
    let object = Extent::new(mesh, frame);
    let mut cameras = Vec::with_capacity(settings.count * (1 + settings.close_ups));
    for direction in fibonacci_directions(settings.count) {
        let whole = object.camera(direction, settings)?;
        cameras.push(whole);
        cameras.extend(object.close_ups(&whole, settings)?);
    }
    Ok(cameras)
}

/// One camera that looks along `-direction` at the whole object with `up` upwards in the image
/// (both in the mesh's frame), framed as the settings say: for pictures of results.
///
/// # Errors
/// As [`rig`], and [`Error::Invalid`] for a direction or an up of no length.
pub fn camera_towards(
    mesh: &Mesh,
    direction: DVec3,
    up: DVec3,
    settings: &RigSettings,
) -> Result<Pinhole> {
    settings.check()?;
    let (direction, up) = (unit_vector("view direction", direction)?, unit_vector("up", up)?);
    let frame =
        DMat3::from_cols(up.any_orthonormal_vector().cross(up), up.any_orthonormal_vector(), up);
    let frame = frame.transpose();
    let object = Extent::new(mesh, frame);
    object.camera(frame * direction, settings)
}

fn unit_vector(what: &str, v: DVec3) -> Result<DVec3> {
    v.try_normalize()
        .ok_or_else(|| Error::invalid(what, "a finite vector of some length", v.to_string()))
}

/// What a camera must frame: the surface's vertices and their bounding sphere, in a frame whose z
/// is up.
struct Extent {
    vertices: Vec<DVec3>,
    frame: DMat3,
    /// Centre of the bounding box along the frame's axes.
    centre: DVec3,
    radius: f64,
}

impl Extent {
    fn new(mesh: &Mesh, frame: DMat3) -> Self {
        let vertices = surface_vertices(mesh);
        let (low, high) = vertices
            .iter()
            .map(|&p| frame * p)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
                (low.min(p), high.max(p))
            });
        let centre = frame.transpose() * ((low + high) / 2.0);
        let radius = vertices.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        Self { vertices, frame, centre, radius }
    }

    /// The camera in direction `direction` (in the frame) that frames the silhouette.
    fn camera(&self, direction: DVec3, settings: &RigSettings) -> Result<Pinhole> {
        // Rows of the rotation: image right, image down, and forward, away from the direction.
        let right = DVec3::Z.cross(direction).try_normalize().unwrap_or(DVec3::X);
        let up = direction.cross(right);
        let camera_from_frame = DMat3::from_cols(right, -up, -direction).transpose();
        let rotation = camera_from_frame * self.frame;
        // A sphere of radius r at distance d fills the full angle 2·asin(r/d), so that it fills the
        // field of view φ at d = r / sin(φ/2).
        let distance = STAND_OFF * self.radius / (settings.field_of_view / 2.0).sin();
        let translation = DVec3::Z * distance - rotation * self.centre;
        let camera_from_object = DAffine3::from_mat3_translation(rotation, translation);

        let (low, high) = self.silhouette(camera_from_object);
        let half = ((high - low) / 2.0).truncate().max_element();
        let half_of_sphere = self.radius / distance;
        // A slope s = x/z reaches f·s pixels from the principal point. The silhouette's half h is to
        // fill the share `fill` of half a side, but zoomed no farther than `max_zoom` beyond the
        // sphere's half r/d:
        //   f = fill · side/2 / max(h, (r/d)/max_zoom),   c = side/2 − f · middle
        let side = f64::from(settings.size);
        let focal = settings.fill * side / 2.0 / half.max(half_of_sphere / settings.max_zoom);
        let middle = (low + high) / 2.0;
        let intrinsics = Intrinsics {
            width: settings.size,
            height: settings.size,
            fx: focal,
            fy: focal,
            cx: side / 2.0 - focal * middle.x,
            cy: side / 2.0 - focal * middle.y,
        };
        Ok(Pinhole::with_pixel_centres_at_half(intrinsics, camera_from_object)?)
    }

    /// Bounding rectangle of the silhouette as slopes x/z, y/z (third component 1).
    fn silhouette(&self, camera_from_object: DAffine3) -> (DVec3, DVec3) {
        self.vertices
            .iter()
            .map(|&p| {
                let p = camera_from_object.transform_point3(p);
                p / p.z
            })
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), slope| {
                (low.min(slope), high.max(slope))
            })
    }

    /// Cameras at the place of `whole` that frame [`CLOSE_UP`] of it each, from one end of the
    /// silhouette's longer side to the other.
    fn close_ups(&self, whole: &Pinhole, settings: &RigSettings) -> Result<Vec<Pinhole>> {
        let (low, high) = self.silhouette(whole.camera_from_world());
        let (middle, extent) = ((low + high) / 2.0, high - low);
        let axis = usize::from(extent.y > extent.x);
        let (side, focal) = (f64::from(settings.size), whole.fx() / CLOSE_UP);
        // At either end the silhouette keeps the margin that it has in the whole view.
        let travel = ((extent[axis] - settings.fill * side / focal) / 2.0).max(0.0);
        let mut cameras = Vec::with_capacity(settings.close_ups);
        for k in 0..settings.close_ups {
            let last = settings.close_ups as f64 - 1.0;
            let along = if last > 0.0 { 2.0 * k as f64 / last - 1.0 } else { 0.0 };
            let mut centre = middle;
            centre[axis] += along * travel;
            let [cx, cy] = [centre.x, centre.y].map(|slope| side / 2.0 - focal * slope);
            let intrinsics = Intrinsics { fx: focal, fy: focal, cx, cy, ..whole.intrinsics() };
            let pose = whole.camera_from_world();
            cameras.push(Pinhole::with_pixel_centres_at_half(intrinsics, pose)?);
        }
        Ok(cameras)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::PixelDepth;

    fn knife() -> Mesh {
        // A long thin wedge: 20 long, 2 wide, .3 thick, heavier at one end.
        let corners =
            [[0.0, 0.0, 0.0], [20.0, 0.5, 0.05], [0.0, 2.0, 0.0], [0.2, 0.4, 0.3], [6.0, 2.5, 0.1]];
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [2, 4, 1]];
        Mesh::new(corners.map(DVec3::from_array).to_vec(), faces).unwrap()
    }

    fn extents(mesh: &Mesh, camera: &Pinhole) -> (DVec3, DVec3) {
        mesh.vertices().iter().map(|&p| camera.project(p)).fold(
            (DVec3::INFINITY, -DVec3::INFINITY),
            |(low, high), PixelDepth { u, v, z }| {
                (low.min(DVec3::new(u, v, z)), high.max(DVec3::new(u, v, z)))
            },
        )
    }

    #[test]
    fn silhouettes_are_centred_and_fill_their_share() {
        let mesh = knife();
        let cameras = rig(&mesh, &RigSettings::default()).unwrap();
        assert_eq!(cameras.len(), 14);
        let mut fills = Vec::new();
        for camera in &cameras {
            let (low, high) = extents(&mesh, camera);
            assert!(
                ((low + high) / 2.0 - DVec3::splat(112.0)).truncate().abs().max_element() < 1e-6
            );
            fills.push((high - low).truncate().max_element() / 224.0);
        }
        assert!(fills.iter().all(|&fill| fill <= 0.8 + 1e-9), "{fills:?}");
        assert!(fills.iter().filter(|&&fill| fill > 0.8 - 1e-9).count() >= 8, "{fills:?}");
    }

    #[test]
    fn close_ups_show_the_whole_length_in_turns_and_larger() {
        let mesh = knife();
        let settings = RigSettings { close_ups: 2, ..Default::default() };
        let cameras = rig(&mesh, &settings).unwrap();
        assert_eq!(cameras.len(), 3 * 14);
        for shots in cameras.chunks(3) {
            let (whole, ends) = (&shots[0], &shots[1..]);
            let (low, high) = extents(&mesh, whole);
            let along = usize::from((high - low).y > (high - low).x);
            let mut seen = [f64::INFINITY, f64::NEG_INFINITY];
            for camera in ends {
                assert!((camera.fx() * CLOSE_UP / whole.fx() - 1.0).abs() < 1e-12);
                assert_eq!(camera.camera_from_world(), whole.camera_from_world());
                for &p in mesh.vertices() {
                    let PixelDepth { u, v, .. } = camera.project(p);
                    let place = [u, v][along];
                    if (0.0..=224.0).contains(&place) {
                        let PixelDepth { u, v, .. } = whole.project(p);
                        let place = [u, v][along];
                        seen = [seen[0].min(place), seen[1].max(place)];
                    }
                }
            }
            // Both ends of the silhouette, the one in one close-up and the other in the other.
            assert!((seen[0] - low[along]).abs() + (seen[1] - high[along]).abs() < 1e-6);
        }
        let too_many = RigSettings { close_ups: 9, ..Default::default() };
        assert!(rig(&mesh, &too_many).unwrap_err().to_string().contains("close-ups"));
    }

    #[test]
    fn the_longest_axis_stands_upright() {
        let mesh = knife();
        for camera in rig(&mesh, &RigSettings::default()).unwrap() {
            let PixelDepth { u: u0, v: v0, .. } = camera.project(DVec3::new(0.0, 1.0, 0.0));
            let PixelDepth { u: u1, v: v1, .. } = camera.project(DVec3::new(20.0, 0.5, 0.05));
            assert!((v1 - v0).abs() > 2.0 * (u1 - u0).abs(), "{u0} {v0} {u1} {v1}");
            // The tip is the longer tail, so it is up: towards smaller v.
            assert!(v1 < v0);
        }
    }

    #[test]
    fn the_rig_turns_with_the_object() {
        let mesh = knife();
        let turn = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_x(2.2);
        let vertices = mesh.vertices().iter().map(|&p| turn * p + DVec3::splat(5.0)).collect();
        let turned = Mesh::new(vertices, mesh.faces().to_vec()).unwrap();
        let settings = RigSettings::default();
        let (still, moved) = (rig(&mesh, &settings).unwrap(), rig(&turned, &settings).unwrap());
        for (a, b) in still.iter().zip(&moved) {
            for (&p, &q) in mesh.vertices().iter().zip(turned.vertices()) {
                let (a, b) = (a.project(p), b.project(q));
                assert!((a.u - b.u).abs() + (a.v - b.v).abs() + (a.z - b.z).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_single_camera_looks_where_it_is_told() {
        let mesh = knife();
        let settings = RigSettings { size: 400, ..Default::default() };
        let camera = camera_towards(&mesh, DVec3::Z, DVec3::Y, &settings).unwrap();
        let PixelDepth { u, v, z } = camera.project(DVec3::new(5.0, 1.0, 0.0));
        let right = camera.project(DVec3::new(6.0, 1.0, 0.0)).u;
        let above = camera.project(DVec3::new(5.0, 2.0, 0.0)).v;
        let nearer = camera.project(DVec3::new(5.0, 1.0, 1.0)).z;
        assert!(right > u && above < v && (z - nearer - 1.0).abs() < 1e-9);
        assert!(camera_towards(&mesh, DVec3::ZERO, DVec3::Y, &settings).is_err());
        assert!(camera_towards(&mesh, DVec3::Y, DVec3::Y, &settings).is_ok());
    }

    #[test]
    fn settings_out_of_range_are_named() {
        for (settings, name) in [
            (RigSettings { count: 0, ..Default::default() }, "views"),
            (RigSettings { size: 0, ..Default::default() }, "image size"),
            (RigSettings { size: 9000, ..Default::default() }, "image size"),
            (RigSettings { fill: f64::NAN, ..Default::default() }, "fill"),
            (RigSettings { field_of_view: 3.5, ..Default::default() }, "field of view"),
        ] {
            let message = rig(&knife(), &settings).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
        }
    }
}
