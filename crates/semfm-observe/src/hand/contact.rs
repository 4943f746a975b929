//! Where a hand touches an object.

use std::collections::BTreeMap;

use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

use super::offset::{Doubt, NearVertex, find};
use super::signed_distance::HandDistance;
use super::{Hand, HandPart};
use crate::{Error, Result};

/// How contact is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// A surface point touches where it is nearer to the hand than this share of the object's diagonal, within 3 to 8 mm:
    /// soft tissue gives way by some millimetres, and a hand on a spoon is not told from one on a bucket by a fixed length.
    pub reach: f64,
    /// Metres of one unit of the mesh, in which the hand is, too.
    pub metres_per_unit: f64,
    /// Where the camera stood, in the mesh's frame: along its rays a hand may be far off.
    pub viewpoint: Option<DVec3>,
    /// How far off along the ray a hand may be (standard deviation, metres); 0 and 0 leave it where it is.
    pub along_ray: f64,
    /// How far off across the ray, or in any direction where the viewpoint is not known.
    pub across_ray: f64,
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self {
            reach: 0.035,
            metres_per_unit: 1.0,
            viewpoint: None,
            along_ray: 0.010,
            across_ray: 0.004,
        }
    }
}

/// Bounds of the reach, metres.
const REACH_BOUNDS: [f64; 2] = [0.003, 0.008];

/// Weight from which on a vertex counts as touched.
const COUNTS: f64 = 0.5;

/// Where a hand touches, and how sure that is.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Weight in [0, 1] of each vertex of the mesh; touched from one half on.
    pub weights: Vec<f64>,
    /// Area of the touched surface, in squared units of the mesh.
    pub area: f64,
    /// How near is a touch, in units of the mesh.
    pub reach: f64,
    /// How far the hand was moved to rest on the object, in the mesh's frame and units.
    pub offset: DVec3,
    /// What each part does, where parts are known, those that touch first, by area.
    pub parts: Vec<PartContact>,
    /// Mean over the touched area of how far the weights are from one half, times two: 1 where all offsets that are likely
    /// agree, 0 where nothing is sure.
    pub confidence: f64,
}

/// What a finger or the palm touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartContact {
    /// Which.
    pub part: HandPart,
    /// Area that it touches, in squared units of the mesh.
    pub area: f64,
    /// Probability that it touches at all, over the offsets of the hand that are likely.
    pub probability: f64,
}

/// Finds where a hand touches a mesh; both are in the mesh's frame and units. The hand is first moved by what makes it
/// rest on the surface, within what `settings` say it may be off. The weights are smooth: 1 up to half the reach, one
/// half at the reach, 0 from one and a half reaches on, averaged over the offsets that are likely.
///
/// # Errors
/// [`Error::Invalid`] for settings out of range, a hand that cannot be one in metres, and a hand that touches nothing,
/// with its distance from the mesh.
pub fn find_contact(mesh: &Mesh, hand: &Hand, settings: &ContactSettings) -> Result<Contact> {
    settings.check()?;
    hand.check_size(settings.metres_per_unit)?;
    let unit = settings.metres_per_unit;
    let reach_m = settings.reach * mesh.diagonal() * unit;
    let reach = reach_m.clamp(REACH_BOUNDS[0], REACH_BOUNDS[1]) / unit;
    let (along, across) = (settings.along_ray / unit, settings.across_ray / unit);
    let distance = HandDistance::new(hand)?;
    let margin = 2.0 * reach + 2.0 * along.max(across);
    let areas = mesh.vertex_areas();
    let near: Vec<NearVertex> = mesh
        .vertices()
        .iter()
        .enumerate()
        .filter(|(_, p)| distance.is_near(**p, margin))
        .map(|(v, &point)| NearVertex { vertex: v as u32, point, area: areas[v] })
        .collect();
    if near.is_empty() {
        return Err(touches_nothing(mesh, &distance, reach, unit));
    }
    let middle = hand.points().iter().sum::<DVec3>() / hand.points().len() as f64;
    let offsets = if along > 0.0 || across > 0.0 {
        let least = 1e-9 / unit;
        let doubt = Doubt::new(middle, settings.viewpoint, along.max(least), across.max(least));
        find(&distance, &near, reach, &doubt)
    } else {
        vec![super::offset::Offset { shift: DVec3::ZERO, log_weight: 0.0 }]
    };
    let total: f64 = offsets.iter().map(|offset| offset.log_weight.exp()).sum();
    let mut weights = vec![0.0; mesh.n_vertices()];
    let mut area_of: BTreeMap<HandPart, (f64, f64)> = BTreeMap::new();
    for offset in &offsets {
        let share = offset.log_weight.exp() / total;
        let mut touched: BTreeMap<HandPart, f64> = BTreeMap::new();
        for v in &near {
            let Some(found) = distance.at(v.point - offset.shift, 2.0 * reach) else { continue };
            let weight = weight_of(found.distance / reach);
            weights[v.vertex as usize] += share * weight;
            if let Some(part) = found.part.filter(|_| weight >= COUNTS) {
                *touched.entry(part).or_default() += v.area;
            }
        }
        for (part, area) in touched {
            let entry = area_of.entry(part).or_default();
            *entry = (entry.0 + share * area, entry.1 + share);
        }
    }
    weights.iter_mut().for_each(|weight| *weight = weight.min(1.0));
    let touched: Vec<usize> = (0..weights.len()).filter(|&v| weights[v] >= COUNTS).collect();
    let area: f64 = touched.iter().map(|&v| areas[v]).sum();
    if touched.is_empty() {
        return Err(touches_nothing(mesh, &distance, reach, unit));
    }
    let sure: f64 = touched.iter().map(|&v| areas[v] * (2.0 * weights[v] - 1.0)).sum();
    let confidence = if area > 0.0 { sure / area } else { 0.0 };
    let mut parts: Vec<PartContact> = Vec::new();
    if hand.parts().is_some() {
        let of = |part| area_of.get(&part).copied().unwrap_or_default();
        parts.extend(HandPart::ALL.map(|part| {
            let (area, probability) = of(part);
            PartContact { part, area, probability: probability.min(1.0) }
        }));
        parts.sort_by(|a, b| b.area.total_cmp(&a.area));
    }
    Ok(Contact { weights, area, reach, offset: offsets[0].shift, parts, confidence })
}

/// Contacts of several frames of one grasp as one: the mean of their weights, so that what one frame sees wrong is outvoted.
///
/// # Errors
/// [`Error::Invalid`] for no contact, and for contacts on different meshes.
pub fn merge_contacts(contacts: &[Contact]) -> Result<Vec<f64>> {
    let Some(first) = contacts.first() else {
        return Err(Error::invalid("contacts", "at least one", "none"));
    };
    let n = first.weights.len();
    if let Some(other) = contacts.iter().find(|contact| contact.weights.len() != n) {
        let expected = format!("{n} weights, as the first");
        return Err(Error::invalid("contact", expected, other.weights.len()));
    }
    let mean =
        |v: usize| contacts.iter().map(|c| c.weights[v]).sum::<f64>() / contacts.len() as f64;
    Ok((0..n).map(mean).collect())
}

impl ContactSettings {
    fn check(&self) -> Result<()> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if !positive(self.reach) || self.reach > 1.0 {
            return Err(Error::invalid("reach", "a share of the diagonal, 0 to 1", self.reach));
        }
        if !positive(self.metres_per_unit) {
            return Err(Error::invalid(
                "metres per unit",
                "a positive number",
                self.metres_per_unit,
            ));
        }
        for (what, value) in
            [("along the ray", self.along_ray), ("across the ray", self.across_ray)]
        {
            if !(0.0..=0.1).contains(&value) {
                return Err(Error::invalid(what, "0 to 0.1 m", value));
            }
        }
        Ok(())
    }
}

/// 1 up to half the reach, one half at the reach, 0 at one and a half (a cubic step).
fn weight_of(distance: f64) -> f64 {
    let t = (1.5 - distance).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn touches_nothing(mesh: &Mesh, distance: &HandDistance<'_>, reach: f64, unit: f64) -> Error {
    let all = mesh.vertices().iter().filter_map(|&p| distance.at(p, f64::MAX));
    let nearest = all.map(|found| found.distance).fold(f64::INFINITY, f64::min);
    let expected = format!("a hand within {:.1} mm of a vertex", 1e3 * reach * unit);
    let question = if nearest * unit > 0.05 {
        "; are hand and mesh in one frame (--aligned), in one unit?"
    } else {
        "; is the hand at its right depth (--hand-depth), and is the mesh fine enough?"
    };
    Error::invalid("contact", expected, format!("{:.1} mm{question}", 1e3 * nearest * unit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    /// A ball of 4 cm and a flat hand, 10 × 8 × 2 cm, that rests on top of it once it is moved by `off`.
    fn scene(off: DVec3) -> (Mesh, Hand) {
        let ball = zoo::icosphere(5);
        let points = ball.vertices().iter().map(|p| 0.04 * *p).collect();
        let mesh = Mesh::new(points, ball.faces().to_vec()).unwrap();
        let flat = zoo::icosphere(3);
        let slab = |p: &DVec3| {
            let p = p.signum() * p.abs().powf(0.3) * DVec3::new(0.05, 0.04, 0.01);
            p + DVec3::new(0.0, 0.0, 0.05) - off
        };
        let hand = Hand::new(flat.vertices().iter().map(slab).collect(), flat.faces().to_vec());
        (mesh, hand.unwrap())
    }

    fn touched(contact: &Contact) -> Vec<bool> {
        contact.weights.iter().map(|&w| w >= COUNTS).collect()
    }

    fn iou(a: &[bool], b: &[bool]) -> f64 {
        let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
        both as f64 / a.iter().zip(b).filter(|(a, b)| **a || **b).count() as f64
    }

    #[test]
    fn a_hand_that_is_off_along_the_ray_touches_where_it_would_touch() {
        let still = ContactSettings { along_ray: 0.0, across_ray: 0.0, ..Default::default() };
        let (mesh, hand) = scene(DVec3::ZERO);
        let truth = touched(&find_contact(&mesh, &hand, &still).unwrap());
        assert!(truth.contains(&true));
        // On top, nowhere else.
        for (v, &is_touched) in truth.iter().enumerate() {
            assert!(!is_touched || mesh.vertices()[v].z > 0.02);
        }
        let seen =
            ContactSettings { viewpoint: Some(DVec3::new(0.0, 0.0, 1.0)), ..Default::default() };
        for off in [-0.01, -0.005, 0.005, 0.01] {
            let (mesh, hand) = scene(DVec3::new(0.0, 0.0, off));
            let found = find_contact(&mesh, &hand, &seen).unwrap();
            let overlap = iou(&touched(&found), &truth);
            assert!(overlap > 0.6, "{off}: {overlap}, moved by {}", found.offset);
            assert!((0.0..=1.0).contains(&found.confidence));
        }
    }

    #[test]
    fn what_touches_nothing_or_is_no_hand_says_so() {
        let (mesh, hand) = scene(DVec3::new(0.0, 0.0, -0.06));
        let settings = ContactSettings::default();
        let words =
            |hand: &Hand, settings| find_contact(&mesh, hand, settings).unwrap_err().to_string();
        assert!(words(&hand, &settings).contains("60.0 mm"), "{}", words(&hand, &settings));
        let millimetres =
            hand.transformed(&semfm_geom::math::DAffine3::from_scale(DVec3::splat(1000.0)));
        assert!(words(&millimetres, &settings).contains("millimetres?"));
        let broken = ContactSettings { reach: 0.0, ..settings };
        assert!(words(&hand, &broken).contains("reach"));
        assert!(merge_contacts(&[]).is_err());
    }

    #[test]
    fn weights_fall_smoothly_and_frames_are_averaged() {
        assert_eq!(
            [weight_of(-3.0), weight_of(0.5), weight_of(1.0), weight_of(1.5)],
            [1.0, 1.0, 0.5, 0.0]
        );
        let (mesh, hand) = scene(DVec3::ZERO);
        let contact = find_contact(&mesh, &hand, &ContactSettings::default()).unwrap();
        let nothing = Contact { weights: vec![0.0; mesh.n_vertices()], ..contact.clone() };
        let merged = merge_contacts(&[contact.clone(), nothing]).unwrap();
        assert!(merged.iter().zip(&contact.weights).all(|(m, w)| (m - 0.5 * w).abs() < 1e-15));
    }
}
