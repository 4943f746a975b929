//! Where a demonstration touched an object: a region from a contact and a radius, from a mask in a
//! view, or from the colours of a painted mesh; and what one camera saw of a part, completed.

use semfm_geom::geodesic::{HeatGeodesics, HeatSettings};
use semfm_geom::math::{DVec3, bounds};
use semfm_geom::{
    CameraSearch, Mesh, Pinhole, PixelDepth, SurfaceIndex, Viewpoint, complete_patch,
    surface_vertices,
};
use semfm_observe::{Contact, ContactReport, ContactSettings, HandFrame, merge_contacts};

use crate::{Error, Region, Result};

/// A contact may lie this far from the surface, as a share of the bounding box's diagonal: inside a handle or a few
/// millimetres in front of it. What is farther off was measured in another unit or another frame.
const FARTHEST_CONTACT: f64 = 0.3;

/// All vertices within the geodesic `radius` of the surface point nearest to `contact`.
///
/// Both are in the mesh's own frame and units. Distances are those of the heat method (Crane,
/// Weischedel & Wardetzky 2013) from the corners of the triangle that was touched, each at its own
/// distance from the contact. They run on the surface: vertices doubled at a UV seam or by flat shading stop nothing.
///
/// # Errors
/// [`Error::Invalid`] for a radius that is not positive, a contact that is not finite or farther from the surface than
/// 0.3 of the bounding box's diagonal, or where no vertex is within the radius.
pub fn region_around_contact(mesh: &Mesh, contact: DVec3, radius: f64) -> Result<Region> {
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(Error::invalid("radius", "a positive length", radius.to_string()));
    }
    let surface = SurfaceIndex::new(mesh)?;
    let touched = surface
        .closest(contact)
        .ok_or_else(|| Error::invalid("contact", "finite coordinates", contact.to_string()))?;
    let size = surface_box_diagonal(mesh);
    if touched.distance > FARTHEST_CONTACT * size {
        return Err(far_contact(mesh, &surface, contact, touched.distance));
    }
    let corners = mesh.faces()[touched.face as usize];
    let geodesics = HeatGeodesics::new(mesh, &HeatSettings::default())?;
    let from_corners = geodesics.distances_from_each(&corners)?;
    let offsets = corners.map(|v| mesh.vertices()[v as usize].distance(touched.point));
    let inside: Vec<bool> = (0..mesh.n_vertices())
        .map(|v| (0..3).any(|c| from_corners[(v, c)] + offsets[c] <= radius))
        .collect();
    if !inside.contains(&true) {
        let nearest = offsets.iter().copied().fold(f64::INFINITY, f64::min);
        let expected = format!("at least {nearest:.3e}, the distance to the nearest vertex");
        return Err(Error::invalid("radius", expected, radius.to_string()));
    }
    Ok(Region::from_mask(&inside))
}

/// Length of the diagonal of the surface's bounding box.
fn surface_box_diagonal(mesh: &Mesh) -> f64 {
    bounds(&surface_vertices(mesh)).map_or(0.0, |(low, high)| low.distance(high))
}

/// The refusal of a contact that is not on the mesh, with the question that the numbers suggest.
fn far_contact(mesh: &Mesh, surface: &SurfaceIndex, contact: DVec3, distance: f64) -> Error {
    let size = surface_box_diagonal(mesh);
    let near = |factor: f64| {
        let place = surface.closest(contact * factor);
        place.is_some_and(|place| place.distance < FARTHEST_CONTACT / 3.0 * size)
    };
    let question = if near(1e-3) {
        "is the contact in millimetres and the mesh in metres?"
    } else if near(1e-2) {
        "is the contact in centimetres and the mesh in metres?"
    } else if near(1e3) {
        "is the contact in metres and the mesh in millimetres?"
    } else if near(1e2) {
        "is the contact in metres and the mesh in centimetres?"
    } else {
        "is it in the mesh's frame and units?"
    };
    let expected = format!(
        "a point within {:.4} of the surface of a mesh {size:.4} across",
        FARTHEST_CONTACT * size
    );
    Error::invalid("contact", expected, format!("{contact}, {distance:.4} away; {question}"))
}

/// How far behind the visible surface a vertex may lie and still be seen, as a share of the
/// bounding-sphere radius. Less loses vertices at grazing angles, more paints through thin walls.
const OCCLUSION_TOLERANCE: f64 = 0.01;

/// All vertices that `camera` sees inside `mask` (height × width, row-major).
///
/// # Errors
/// [`Error::Invalid`] where the mask is not of the camera's size or shows no vertex.
pub fn region_under_mask(mesh: &Mesh, camera: &Pinhole, mask: &[bool]) -> Result<Region> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    if mask.len() != width * height {
        let expected = format!("{} pixels ({width} × {height}, as the view)", width * height);
        return Err(Error::invalid("mask", expected, format!("{} pixels", mask.len())));
    }
    let surface = SurfaceIndex::new(mesh)?;
    let margin = OCCLUSION_TOLERANCE * mesh.bounding_sphere().1;
    let eye = camera.eye();
    let inside: Vec<bool> = mesh
        .vertices()
        .iter()
        .map(|&p| {
            let PixelDepth { u, v, z } = camera.project(p);
            let on_image = z > 0.0 && u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64;
            on_image && mask[v as usize * width + u as usize] && !surface.blocked(eye, p, margin)
        })
        .collect();
    if !inside.contains(&true) {
        let found = format!("none behind {} marked pixels", mask.iter().filter(|&&m| m).count());
        return Err(Error::invalid("mask", "at least one visible vertex", found));
    }
    Ok(Region::from_mask(&inside))
}

/// A region that a hand touched.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchedRegion {
    /// The region, with smooth weights.
    pub region: Region,
    /// Which fingers touched what in each frame, and how sure that is.
    pub report: ContactReport,
}

/// What a hand touches of a mesh, in one frame of a demonstration or in several of one grasp
/// ([`find_contact`](semfm_observe::find_contact)); the weights of several frames are averaged.
///
/// # Errors
/// [`Error::Invalid`] for no frame, for a hand that touches nothing and for frames that disagree on all of it.
pub fn region_of_hands(
    mesh: &Mesh,
    frames: &[HandFrame],
    settings: &ContactSettings,
) -> Result<TouchedRegion> {
    let contacts: Vec<Contact> = frames
        .iter()
        .map(|frame| frame.contact(mesh, settings))
        .collect::<semfm_observe::Result<_>>()?;
    let region = Region::from_weights(merge_contacts(&contacts)?)?;
    if region.is_empty() {
        let expected = "a vertex that is touched in half of the frames";
        return Err(Error::invalid("hands", expected, "none: are these frames of one grasp?"));
    }
    Ok(TouchedRegion { region, report: ContactReport::new(frames, &contacts) })
}

/// The regions of several views, or frames, of one mesh as one: each vertex has the largest of its weights.
///
/// # Errors
/// [`Error::Invalid`] for no region and for regions of different meshes.
pub fn merge_regions(regions: impl IntoIterator<Item = Region>) -> Result<Region> {
    let mut regions = regions.into_iter();
    let none = || Error::invalid("regions", "at least one", "none");
    let mut merged = regions.next().ok_or_else(none)?.weights().to_vec();
    for region in regions {
        if region.n_vertices() != merged.len() {
            let expected = format!("{} weights, as the first region", merged.len());
            return Err(Error::invalid("region", expected, region.n_vertices().to_string()));
        }
        merged
            .iter_mut()
            .zip(region.weights())
            .for_each(|(most, &weight)| *most = most.max(weight));
    }
    Ok(Region::from_weights(merged)?)
}

/// A region that was to be completed.
#[derive(Clone, Debug, PartialEq)]
pub struct GrownRegion {
    /// The region, completed where one camera saw it, else as it was.
    pub region: Region,
    /// Vertices that count now and did not before.
    pub n_added: usize,
    /// Share of the given region that one camera can see, where the camera was looked for: below .85 it
    /// is taken for known all around, and stays as it is.
    pub visible_share: Option<f64>,
}

/// Completes what one camera saw of a part to the part that it belongs to: the back of a handle, which no
/// single mask shows. What was seen keeps its weight, what is added has weight 1.
///
/// With the `camera` of the demonstration, everything that it saw and that is not in the region lies
/// outside of the part. Without one, the camera is looked for; a region that no camera can see for the most
/// part is known all around already, and stays as it is. How, and what it cannot do:
/// [`complete_patch`] and [`CameraSearch`]; what it is worth: `bench/README.md`.
///
/// # Errors
/// [`Error::Invalid`] for a region that is empty or of another mesh, [`semfm_geom::Error::NoArea`].
pub fn grow_region(mesh: &Mesh, region: &Region, camera: Option<&Pinhole>) -> Result<GrownRegion> {
    let inside = mask_on(mesh, region)?;
    let search = CameraSearch::new(mesh)?;
    let (viewpoint, visible_share) = match camera {
        Some(camera) => (Some(Viewpoint::Camera(*camera)), None),
        None => {
            let likely = search.likely_camera(&inside);
            let one_sided = likely.filter(|camera| camera.is_one_sided());
            let viewpoint = one_sided.map(|camera| Viewpoint::Towards(camera.towards_eye));
            (viewpoint, Some(likely.map_or(0.0, |camera| camera.share)))
        }
    };
    let outside: Vec<bool> = match viewpoint {
        Some(viewpoint) => {
            let seen = search.seen(viewpoint);
            seen.iter().zip(&inside).map(|(&seen, &inside)| seen && !inside).collect()
        }
        None => Vec::new(),
    };
    // Where nothing was seen outside of the region, nothing tells where its part ends.
    if !outside.contains(&true) {
        return Ok(GrownRegion { region: region.clone(), n_added: 0, visible_share });
    }
    let part = complete_patch(mesh, &inside, &outside)?;
    let given = region.weights().iter().zip(&inside).zip(part);
    let weights = given.map(|((&weight, &inside), part)| match part >= Region::COUNTS {
        true if !inside => 1.0,
        _ => weight,
    });
    let grown = Region::from_weights(weights.collect())?;
    let n_added = grown.vertices().len() - region.vertices().len();
    Ok(GrownRegion { region: grown, n_added, visible_share })
}

/// Whether a region is what one camera sees of a part, which [`grow_region`] would complete.
///
/// # Errors
/// As [`grow_region`].
pub fn is_one_sided(mesh: &Mesh, region: &Region) -> Result<bool> {
    let inside = mask_on(mesh, region)?;
    let likely = CameraSearch::new(mesh)?.likely_camera(&inside);
    Ok(likely.is_some_and(|camera| camera.is_one_sided()))
}

/// Which vertices of a mesh a region holds; at least one.
fn mask_on(mesh: &Mesh, region: &Region) -> Result<Vec<bool>> {
    if region.n_vertices() != mesh.n_vertices() {
        let expected = format!("{} weights, one per vertex of the mesh", mesh.n_vertices());
        return Err(Error::invalid("region", expected, region.n_vertices().to_string()));
    }
    let inside = region.mask();
    match inside.contains(&true) {
        true => Ok(inside),
        false => Err(Error::invalid("region", "at least one vertex that counts", "none")),
    }
}

/// How much redder than green and blue a vertex must be to count as painted. The colours that we
/// write ourselves cross this at weight one half.
const REDNESS: i16 = 90;

/// How far a vertex's colour may be from the one asked for, in each channel.
const PAINT_TOLERANCE: i16 = 60;

/// All vertices painted red, or in the `paint` given (sRGB).
///
/// # Errors
/// [`Error::Invalid`] where the mesh has no colours or none is of that paint.
pub fn region_of_paint(colors: Option<&[[u8; 4]]>, paint: Option<[u8; 3]>) -> Result<Region> {
    let Some(colors) = colors else {
        return Err(Error::invalid("vertex colours", "a painted mesh", "a mesh without colours"));
    };
    let inside: Vec<bool> = colors.iter().map(|&color| is_painted(color, paint)).collect();
    if !inside.contains(&true) {
        let wanted = paint.map_or("red".into(), |[r, g, b]| format!("({r}, {g}, {b})"));
        let expected = format!("at least one vertex painted {wanted}");
        return Err(Error::invalid(
            "vertex colours",
            expected,
            format!("none of {}", colors.len()),
        ));
    }
    Ok(Region::from_mask(&inside))
}

fn is_painted(color: [u8; 4], paint: Option<[u8; 3]>) -> bool {
    let [r, g, b, _] = color.map(i16::from);
    match paint {
        Some(paint) => {
            [r, g, b].iter().zip(paint).all(|(c, p)| (c - i16::from(p)).abs() <= PAINT_TOLERANCE)
        }
        None => r - g.max(b) >= REDNESS,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DAffine3;
    use semfm_geom::{Intrinsics, zoo};

    #[test]
    fn near_takes_a_geodesic_disc() {
        let sphere = zoo::icosphere(4);
        let region = region_around_contact(&sphere, DVec3::new(0.0, 0.0, 1.2), 0.5).unwrap();
        for (v, inside) in region.mask().into_iter().enumerate() {
            let angle = sphere.vertices()[v].normalize().z.clamp(-1.0, 1.0).acos();
            // Within the heat method's error at this resolution.
            assert!(
                (angle - 0.5).abs() < 0.05 || inside == (angle < 0.5),
                "angle {angle}: {inside}"
            );
        }
        assert!(region_around_contact(&sphere, DVec3::Z, -1.0).is_err());
        assert!(region_around_contact(&sphere, DVec3::NAN, 0.5).is_err());
    }

    #[test]
    fn near_crosses_seams() {
        let sphere = zoo::icosphere(4);
        let soup = zoo::as_soup(&sphere);
        let contact = DVec3::new(0.1, -0.3, 1.0);
        let whole = region_around_contact(&sphere, contact, 0.4).unwrap().mask();
        let cut = region_around_contact(&soup, contact, 0.4).unwrap().mask();
        for (corner, &id) in sphere.faces().as_flattened().iter().enumerate() {
            assert_eq!(cut[corner], whole[id as usize], "corner {corner}");
        }
    }

    #[test]
    fn a_contact_off_the_mesh_is_refused_with_the_question_that_the_numbers_ask() {
        let sphere = zoo::icosphere(3);
        for (contact, question) in [
            (DVec3::new(0.0, 0.0, 1000.0), "in millimetres and the mesh in metres?"),
            (DVec3::new(0.0, 90.0, 0.0), "in centimetres and the mesh in metres?"),
            (DVec3::new(0.0, 0.0, 3.0), "in the mesh's frame and units?"),
        ] {
            let refused = region_around_contact(&sphere, contact, 0.5).unwrap_err().to_string();
            assert!(refused.contains(question), "{refused}");
        }
        // Inside, but not far.
        assert!(region_around_contact(&sphere, DVec3::Z * 0.2, 0.5).is_ok());
    }

    #[test]
    fn a_mask_marks_what_faces_the_camera_only() {
        let sphere = zoo::icosphere(3);
        let camera = Pinhole::with_pixel_centres_at_half(
            Intrinsics { width: 64, height: 64, fx: 100.0, fy: 100.0, cx: 32.0, cy: 32.0 },
            DAffine3::from_translation(DVec3::new(0.0, 0.0, 4.0)),
        )
        .unwrap();
        let region = region_under_mask(&sphere, &camera, &[true; 64 * 64]).unwrap();
        let seen = region.vertices();
        assert!(
            seen.iter().all(|&v| sphere.vertices()[v as usize].z < 0.0),
            "the far side is hidden"
        );
        assert!(seen.len() > sphere.n_vertices() / 4);
        assert!(region_under_mask(&sphere, &camera, &[true; 10]).is_err());
        assert!(region_under_mask(&sphere, &camera, &[false; 64 * 64]).is_err());
    }

    /// One camera above a torus sees a little less than half of one of its halves.
    fn half_of_a_torus() -> (semfm_geom::Mesh, Pinhole, Vec<bool>, Region) {
        let torus = zoo::torus(64, 32);
        let part: Vec<bool> = torus.vertices().iter().map(|p| p.x > 0.0).collect();
        let turn = semfm_geom::math::DMat3::from_rotation_x(std::f64::consts::PI);
        let camera = Pinhole::with_pixel_centres_at_half(
            Intrinsics { width: 200, height: 200, fx: 250.0, fy: 250.0, cx: 100.0, cy: 100.0 },
            DAffine3::from_mat3_translation(turn, DVec3::new(0.0, 0.0, 6.0)),
        )
        .unwrap();
        // The camera looks down with x to the right: the right half of its picture.
        let mask: Vec<bool> = (0..200 * 200).map(|pixel| pixel % 200 >= 100).collect();
        let seen = region_under_mask(&torus, &camera, &mask).unwrap();
        (torus, camera, part, seen)
    }

    #[test]
    fn what_one_camera_saw_is_completed_and_what_is_whole_stays() {
        let (torus, camera, part, seen) = half_of_a_torus();
        let overlap = |region: &Region| {
            let both = region.mask().iter().zip(&part).filter(|(a, b)| **a && **b).count();
            let either = region.mask().iter().zip(&part).filter(|(a, b)| **a || **b).count();
            both as f64 / either as f64
        };
        assert!(is_one_sided(&torus, &seen).unwrap() && overlap(&seen) < 0.6);
        for camera in [Some(&camera), None] {
            let grown = grow_region(&torus, &seen, camera).unwrap();
            assert!(overlap(&grown.region) > 0.93, "{camera:?}: {}", overlap(&grown.region));
            let n_added = grown.region.vertices().len() - seen.vertices().len();
            assert_eq!(grown.n_added, n_added);
            assert_eq!(grown.visible_share.is_none(), camera.is_some());
            // What was seen is still there.
            assert!(seen.vertices().iter().all(|&v| grown.region.mask()[v as usize]));
        }
        let whole = Region::from_mask(&part);
        assert!(!is_one_sided(&torus, &whole).unwrap());
        let grown = grow_region(&torus, &whole, None).unwrap();
        assert_eq!((&grown.region, grown.n_added), (&whole, 0));
        assert!(grown.visible_share.unwrap() < 0.85);
        let empty = Region::from_mask(&vec![false; part.len()]);
        assert!(grow_region(&torus, &empty, None).is_err());
        assert!(grow_region(&zoo::icosphere(1), &whole, None).is_err());
    }

    #[test]
    fn several_views_mark_what_each_of_them_marks() {
        let regions =
            [vec![0.2, 0.9, 0.0], vec![0.6, 0.1, 0.0]].map(|w| Region::from_weights(w).unwrap());
        let merged = merge_regions(regions.clone()).unwrap();
        assert_eq!((merged.weights(), merged.vertices()), (&[0.6, 0.9, 0.0][..], vec![0, 1]));
        assert!(merge_regions([]).is_err());
        let other = Region::from_weights(vec![1.0; 4]).unwrap();
        assert!(merge_regions([regions[0].clone(), other]).is_err());
    }

    #[test]
    fn paint_is_red_unless_said_otherwise() {
        let colors = [[220, 40, 40, 255], [200, 200, 200, 255], [30, 40, 200, 255]];
        assert_eq!(region_of_paint(Some(&colors), None).unwrap().vertices(), [0]);
        assert_eq!(region_of_paint(Some(&colors), Some([20, 20, 220])).unwrap().vertices(), [2]);
        assert!(region_of_paint(Some(&colors[1..2]), None).is_err());
        assert!(region_of_paint(None, None).is_err());
    }
}
