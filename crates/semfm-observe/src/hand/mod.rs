//! Hands, as programs that reconstruct them from pictures give them, and where they touch an object.

mod contact;
mod depth_of_hand;
mod files;
mod hand_frame;
mod offset;
mod part;
mod report;
mod signed_distance;
mod winding;

pub use contact::{Contact, ContactSettings, PartContact, find_contact, merge_contacts};
pub use depth_of_hand::HandShift;
pub use files::{read_hand, read_vertex_ids};
pub use hand_frame::{HandFiles, HandFrame};
pub use part::HandPart;
pub use report::{ContactFrameRecord, ContactPartRecord, ContactReport};

use semfm_geom::math::{DAffine3, DVec3, bounds};

use crate::observation::{Mask, Observation};
use crate::{Error, Result};

/// A hand: a surface, open at the wrist or not, or points alone, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    points: Vec<DVec3>,
    /// Empty for points alone.
    faces: Vec<[u32; 3]>,
    /// What each point belongs to, where that is known.
    parts: Option<Vec<HandPart>>,
    /// Whether the points are one side of a hand with the other side unknown.
    is_one_sided: bool,
}

/// A hand is as long as this, from fist to spread, in metres; a whole body is longer.
const SMALLEST: f64 = 0.04;
const LARGEST: f64 = 0.4;

/// How thick a finger is behind the side that a camera sees, and at which steps it is filled, metres.
const THICKNESS: f64 = 0.015;
const THICKNESS_STEP: f64 = 0.003;

impl Hand {
    /// A hand of points with faces (none for a cloud), metres.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than 3 points, a coordinate that is not finite, and a face that names a point that is not there.
    pub fn new(points: Vec<DVec3>, faces: Vec<[u32; 3]>) -> Result<Self> {
        if points.len() < 3 {
            return Err(Error::invalid("hand", "at least 3 points", points.len()));
        }
        if let Some(at) = points.iter().position(|p| !p.is_finite()) {
            return Err(Error::invalid(format!("hand, point {at}"), "finite numbers", points[at]));
        }
        let n = points.len();
        if let Some(at) = faces.iter().position(|face| face.iter().any(|&v| v as usize >= n)) {
            let expected = format!("ids below {n}");
            return Err(Error::invalid(
                format!("hand, face {at}"),
                expected,
                format!("{:?}", faces[at]),
            ));
        }
        let parts = part::of_mano(&points, &faces);
        Ok(Self { points, faces, parts, is_one_sided: false })
    }

    /// A hand of which a camera saw one side: the points of an observation under a mask, in the camera's frame. Contact
    /// lies behind them, by the thickness of a finger.
    ///
    /// # Errors
    /// As [`Observation::points`].
    pub fn from_mask(seen: &Observation, mask: &Mask) -> Result<Self> {
        let surface = seen.points(Some(mask))?.object;
        let n_steps = (THICKNESS / THICKNESS_STEP).round() as usize;
        let behind = |p: &DVec3| {
            let ray = p.normalize();
            (0..=n_steps).map(move |i| i as f64 * THICKNESS_STEP * ray).map({
                let p = *p;
                move |step| p + step
            })
        };
        let points = surface.iter().flat_map(behind).collect();
        Ok(Self::new(points, Vec::new())?.one_sided())
    }

    /// With the part that each point belongs to.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of parts than points.
    pub fn with_parts(self, parts: Vec<HandPart>) -> Result<Self> {
        if parts.len() != self.points.len() {
            let expected = format!("{} parts, one for each point", self.points.len());
            return Err(Error::invalid("hand", expected, parts.len()));
        }
        Ok(Self { parts: Some(parts), ..self })
    }

    /// The same points as one side of a hand, whose other side is unknown, as [`Hand::from_mask`] makes them.
    pub fn one_sided(self) -> Self {
        Self { is_one_sided: true, ..self }
    }

    /// With parts by the 21 joints that pose estimators give: the wrist, then four of each finger from the thumb to the
    /// little one, its tip last (OpenPose's order, which HaMeR and WiLoR keep). A point belongs to the nearest bone.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of joints.
    pub fn with_joints(self, joints: &[DVec3]) -> Result<Self> {
        let parts = part::of_joints(&self.points, joints)?;
        self.with_parts(parts)
    }

    /// Only the points `ids` and the faces among them: the hand of a whole body.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an id that is not there, and for fewer than 3 points.
    pub fn cut_to(&self, ids: &[u32]) -> Result<Self> {
        let mut new_id = vec![u32::MAX; self.points.len()];
        let mut points = Vec::new();
        for &id in ids {
            let place = new_id.get_mut(id as usize).ok_or_else(|| {
                Error::invalid("hand vertices", format!("ids below {}", self.points.len()), id)
            })?;
            if *place == u32::MAX {
                *place = points.len() as u32;
                points.push(self.points[id as usize]);
            }
        }
        let renamed = self.faces.iter().map(|face| face.map(|v| new_id[v as usize]));
        let faces = renamed.filter(|face| !face.contains(&u32::MAX)).collect();
        Self::new(points, faces)
    }

    /// Only what a camera sees inside a mask, and what lies within a hand's thickness behind it: the hand of a whole body.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the mask shows fewer than 3 points of it.
    pub fn cut_by(&self, seen: &Observation, mask: &Mask) -> Result<Self> {
        let ids = depth_of_hand::under_mask(self, seen, mask)?;
        self.cut_to(&ids)
    }

    /// The hand moved, and scaled where the motion scales.
    pub fn transformed(&self, motion: &DAffine3) -> Self {
        let points = self.points.iter().map(|&p| motion.transform_point3(p)).collect();
        Self { points, ..self.clone() }
    }

    /// The other hand, as in a mirror across x: programs that know right hands turn pictures of left ones around.
    pub fn mirrored(&self) -> Self {
        let points = self.points.iter().map(|p| DVec3::new(-p.x, p.y, p.z)).collect();
        let faces = self.faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
        Self { points, faces, ..self.clone() }
    }

    /// The points, metres.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// The faces; none for points alone.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Whether the points are one side of a hand with the other side unknown.
    pub fn is_one_sided(&self) -> bool {
        self.is_one_sided
    }

    /// What each point belongs to, where that is known.
    pub fn parts(&self) -> Option<&[HandPart]> {
        self.parts.as_deref()
    }

    /// Length of the bounding box's diagonal.
    pub fn diagonal(&self) -> f64 {
        bounds(&self.points).map_or(0.0, |(low, high)| low.distance(high))
    }

    /// Refuses what cannot be one hand in metres.
    pub(crate) fn check_size(&self, metres_per_unit: f64) -> Result<()> {
        let size = self.diagonal() * metres_per_unit;
        if (SMALLEST..=LARGEST).contains(&size) {
            return Ok(());
        }
        let question = match size {
            size if size > 40.0 => "is it in millimetres?",
            size if size > LARGEST => {
                "a whole body? name its hand's vertices (--hand-vertices) or a mask (--hand-mask); or is its depth \
                 that of another focal length? (--hand-depth)"
            }
            _ => "is its unit right?",
        };
        let expected = format!("a hand of {SMALLEST} to {LARGEST} m");
        Err(Error::invalid("hand", expected, format!("{size:.3} m: {question}")))
    }
}

/// Turns points of OpenGL's camera (y up, z towards the viewer) into ours where all lie behind ours; whether it did.
pub(crate) fn from_opengl(points: &mut [DVec3]) -> bool {
    let is_behind = points.iter().all(|p| p.z < 0.0);
    if is_behind {
        points.iter_mut().for_each(|p| *p = DVec3::new(p.x, -p.y, -p.z));
    }
    is_behind
}
