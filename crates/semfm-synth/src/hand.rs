//! A hand of capsules that hooks its fingers around a part of an object, until each touches.

use semfm_geom::math::{DMat3, DQuat, DVec3};
use semfm_geom::{Mesh, SurfaceIndex};

use crate::Result;

/// A hand that holds an object, in the object's frame, metres.
#[derive(Clone, Debug)]
pub struct CapsuleHand {
    /// The hand, a closed surface for each bone and for the palm.
    pub mesh: Mesh,
    /// What each vertex belongs to: a finger, from 0, the thumb, to 4, the little one; `None` for the palm.
    pub finger_of_vertex: Vec<Option<u8>>,
    /// From the object to the back of the hand, of length 1.
    pub back: DVec3,
    /// Fingers that touch the object.
    pub n_touching: usize,
}

/// A finger: where it starts in the palm's frame (x across, towards the thumb; y towards the fingers; z out of the palm),
/// the direction that it points at when open, the axis that it bends about, and its bones, metres.
struct Finger {
    root: DVec3,
    points: DVec3,
    bends_about: DVec3,
    bones: [f64; 3],
    radius: f64,
}

/// Lengths of an adult's hand (means of anthropometric tables, rounded to 5 mm).
fn fingers() -> [Finger; 5] {
    let straight = |x: f64, y: f64, bones: [f64; 3]| Finger {
        root: DVec3::new(x, y, 0.0),
        points: DVec3::Y,
        bends_about: DVec3::X,
        bones,
        radius: 0.008,
    };
    [
        Finger {
            root: DVec3::new(0.035, 0.02, 0.005),
            points: DVec3::new(0.8, 0.6, 0.0).normalize(),
            bends_about: DVec3::new(0.35, -0.5, 0.8).normalize(),
            bones: [0.04, 0.035, 0.025],
            radius: 0.009,
        },
        straight(0.03, 0.09, [0.045, 0.025, 0.02]),
        straight(0.01, 0.095, [0.05, 0.03, 0.02]),
        straight(-0.01, 0.09, [0.045, 0.03, 0.02]),
        straight(-0.03, 0.08, [0.035, 0.02, 0.02]),
    ]
}

/// Step of a joint that closes, and how far each goes, radians.
const STEP: f64 = 0.035;
const FARTHEST: f64 = 1.7;

/// Half of the palm, metres; where its middle is in its own frame; and how far it keeps from the object.
const PALM: DVec3 = DVec3::new(0.04, 0.045, 0.012);
const PALM_MIDDLE: DVec3 = DVec3::new(0.0, 0.05, 0.0);
const PALM_CLEARANCE: f64 = 0.011;
/// Where what is held lies in the palm's frame: below the second joints, so that the bones beyond hook around it. With the
/// palm itself on a handle, the fingers of a hand of this size lay along the mug's side.
const HOOKED: DVec3 = DVec3::new(0.0, 0.145, 0.022);

/// Turns of the hand about its approach that are tried, radians: a hand comes about straight.
const TWISTS: [f64; 5] = [0.0, 0.25, -0.25, 0.5, -0.5];
/// Least number of fingers that hold something.
const LEAST_TOUCHING: usize = 2;

/// A hand that hooks its fingers around the part `inside` (one truth value per vertex) of a mesh in metres. It comes from the side
/// that the part sticks out to, its fingers across the part's long axis; of several turns the one with most fingers on the
/// object is taken, the straightest among equals. `None` where fewer than two fingers touch.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) for a mesh without triangles.
pub fn close_hand(mesh: &Mesh, inside: &[bool]) -> Result<Option<CapsuleHand>> {
    let surface = SurfaceIndex::new(mesh)?;
    let part: Vec<DVec3> = mesh
        .vertices()
        .iter()
        .zip(inside)
        .filter(|(_, inside)| **inside)
        .map(|(&p, _)| p)
        .collect();
    let Some(axis) = long_axis(&part) else { return Ok(None) };
    let middle = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    let beside = middle(&part) - middle(mesh.vertices());
    let Some(out) = (beside - beside.dot(axis) * axis).try_normalize() else { return Ok(None) };
    // The outermost place of the part, half way along it.
    let height = middle(&part).dot(axis);
    let outward = |p: &&DVec3| p.dot(out) - 2.0 * (p.dot(axis) - height).abs();
    let Some(&spot) = part.iter().max_by(|a, b| outward(a).total_cmp(&outward(b))) else {
        return Ok(None);
    };
    let mut best: Option<CapsuleHand> = None;
    for twist in TWISTS {
        for sign in [1.0, -1.0] {
            let across = DQuat::from_axis_angle(out, twist) * (sign * axis);
            let Some(hand) = hand_at(&surface, spot, out, across)? else { continue };
            if best.as_ref().is_none_or(|best| hand.n_touching > best.n_touching) {
                best = Some(hand);
            }
        }
    }
    Ok(best.filter(|hand| hand.n_touching >= LEAST_TOUCHING))
}

/// The direction in which points are most spread out, by power iteration on their scatter; `None` for fewer than three.
fn long_axis(points: &[DVec3]) -> Option<DVec3> {
    if points.len() < 3 {
        return None;
    }
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let scatter = points.iter().fold(DMat3::ZERO, |sum, &p| {
        let d = p - middle;
        sum + DMat3::from_cols(d.x * d, d.y * d, d.z * d)
    });
    let mut axis = DVec3::new(0.3, 0.5, 0.8);
    for _ in 0..200 {
        axis = (scatter * axis).try_normalize()?;
    }
    Some(axis)
}

/// A hand that hooks its fingers, side by side along `across`, around a spot that it reaches for against `out`.
fn hand_at(
    surface: &SurfaceIndex,
    spot: DVec3,
    out: DVec3,
    across: DVec3,
) -> Result<Option<CapsuleHand>> {
    let frame = DMat3::from_cols(across, -out, across.cross(-out));
    let origin = spot - frame * HOOKED;
    if samples_of_palm()
        .any(|p| surface.closest(origin + frame * p).is_none_or(|c| c.distance < PALM_CLEARANCE))
    {
        return Ok(None);
    }
    let mut body = Body::default();
    body.add_palm(&|p| origin + frame * (PALM_MIDDLE + p));
    let mut finger_of_vertex = vec![None; body.points.len()];
    let mut n_touching = 0;
    for (finger, number) in fingers().iter().zip(0u8..) {
        let closed = close(finger, origin, frame, surface);
        n_touching += usize::from(closed.touches);
        for bone in closed.joints.windows(2) {
            body.add_capsule(bone[0], bone[1], finger.radius);
        }
        finger_of_vertex.resize(body.points.len(), Some(number));
    }
    let mesh = Mesh::new(body.points, body.faces)?;
    Ok(Some(CapsuleHand { mesh, finger_of_vertex, back: out, n_touching }))
}

fn samples_of_palm() -> impl Iterator<Item = DVec3> {
    (0..49).map(|i| {
        let [x, y] = [f64::from(i % 7 - 3) / 3.0, f64::from(i / 7 - 3) / 3.0];
        PALM_MIDDLE + DVec3::new(0.8 * x * PALM.x, 0.8 * y * PALM.y, 0.0)
    })
}

/// A finger that is bent as far as it goes.
struct ClosedFinger {
    joints: Vec<DVec3>,
    touches: bool,
}

/// Bends a finger, joint by joint from the palm on, until the bones beyond it touch.
fn close(finger: &Finger, origin: DVec3, frame: DMat3, surface: &SurfaceIndex) -> ClosedFinger {
    let place = |angles: [f64; 3]| {
        let mut joints = vec![origin + frame * finger.root];
        let mut bent = 0.0;
        for (bone, angle) in finger.bones.iter().zip(angles) {
            bent += angle;
            let along = DQuat::from_axis_angle(finger.bends_about, bent) * finger.points;
            let last = joints[joints.len() - 1];
            joints.push(last + frame * (*bone * along));
        }
        joints
    };
    let touches = |joints: &[DVec3]| {
        joints.windows(2).any(|bone| {
            (0..=6).any(|i| {
                let p = bone[0].lerp(bone[1], f64::from(i) / 6.0);
                surface.closest(p).is_some_and(|c| c.distance < finger.radius)
            })
        })
    };
    let mut angles = [0.0; 3];
    let mut has_touched = false;
    for joint in 0..3 {
        while angles[joint] < FARTHEST {
            let mut next = angles;
            next[joint] += STEP;
            if touches(&place(next)[joint..]) {
                has_touched = true;
                break;
            }
            angles = next;
            // A finger bends all its joints as it closes in the air.
            if joint == 0 && angles[0] > 0.3 && angles[1] < 0.5 {
                let mut curled = angles;
                curled[1] += STEP;
                curled[2] += 0.5 * STEP;
                if !touches(&place(curled)) {
                    angles = curled;
                }
            }
        }
    }
    ClosedFinger { joints: place(angles), touches: has_touched }
}

/// Points of a ring.
const AROUND: usize = 10;

/// Triangles being gathered.
#[derive(Default)]
struct Body {
    points: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
}

impl Body {
    fn add_capsule(&mut self, a: DVec3, b: DVec3, radius: f64) {
        let axis = (b - a).normalize_or(DVec3::Z);
        let x = axis.any_orthonormal_vector();
        let y = axis.cross(x);
        // Angles from the one pole to the other; the cylinder lies between the two at the middle.
        let latitudes = [-60f64, -30.0, 0.0, 0.0, 30.0, 60.0].map(f64::to_radians);
        let ring = |i: usize, latitude: f64| {
            let base = if i < 3 { a } else { b };
            (0..AROUND).map(move |k| {
                let angle = std::f64::consts::TAU * k as f64 / AROUND as f64;
                let side = angle.cos() * x + angle.sin() * y;
                base + radius * (latitude.cos() * side + latitude.sin() * axis)
            })
        };
        let rings =
            latitudes.iter().enumerate().flat_map(|(i, &latitude)| ring(i, latitude)).collect();
        self.add_tube(rings, a - radius * axis, b + radius * axis);
    }

    /// A box with rounded edges: the superellipsoid of exponent 4.
    fn add_palm(&mut self, place: &dyn Fn(DVec3) -> DVec3) {
        let shape = |p: DVec3| place(p.signum() * p.abs().powf(0.5) * PALM);
        let ring = |latitude: f64| {
            (0..AROUND).map(move |k| {
                let angle = std::f64::consts::TAU * k as f64 / AROUND as f64;
                let flat = latitude.cos();
                DVec3::new(flat * angle.cos(), flat * angle.sin(), latitude.sin())
            })
        };
        let rings = (-4..=4).flat_map(|i| ring(f64::from(i) * 0.35)).map(shape).collect();
        self.add_tube(rings, shape(-DVec3::Z), shape(DVec3::Z));
    }

    /// Rings of [`AROUND`] points, closed by a point at each end.
    fn add_tube(&mut self, rings: Vec<DVec3>, first: DVec3, last: DVec3) {
        let base = self.points.len() as u32;
        let (n, n_rings) = (AROUND as u32, (rings.len() / AROUND) as u32);
        self.points.extend(rings);
        self.points.extend([first, last]);
        let (first, last) = (base + n * n_rings, base + n * n_rings + 1);
        for k in 0..n {
            let next = (k + 1) % n;
            self.faces.push([first, base + next, base + k]);
            let top = base + n * (n_rings - 1);
            self.faces.push([last, top + k, top + next]);
            for ring in 0..n_rings - 1 {
                let (low, high) = (base + n * ring, base + n * (ring + 1));
                self.faces.push([low + k, low + next, high + k]);
                self.faces.push([low + next, high + next, high + k]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Category, ObjectSettings, make_object};

    #[test]
    fn a_hand_closes_around_the_handle_of_a_mug_and_does_not_pass_through_it() {
        let mug = make_object(Category::Containers, 0, &ObjectSettings::default()).unwrap();
        let points = mug.mesh.vertices().iter().map(|&p| 0.25 * p).collect();
        let mesh = Mesh::new(points, mug.mesh.faces().to_vec()).unwrap();
        let hand = close_hand(&mesh, &mug.region).unwrap().unwrap();
        assert!(hand.n_touching >= 3, "{}", hand.n_touching);
        assert_eq!(hand.finger_of_vertex.len(), hand.mesh.n_vertices());
        let surface = SurfaceIndex::new(&hand.mesh).unwrap();
        let near = |inside: bool| {
            let vertices = mesh.vertices().iter().zip(&mug.region);
            let chosen = vertices.filter(|(_, is_grip)| **is_grip == inside);
            chosen.filter(|(p, _)| surface.closest(**p).unwrap().distance < 0.004).count()
        };
        assert!(near(true) > 20, "{} vertices of the handle are touched", near(true));
        assert!(hand.mesh.diagonal() < 0.3 && (hand.back.length() - 1.0).abs() < 1e-12);
        assert!(close_hand(&mesh, &vec![false; mesh.n_vertices()]).unwrap().is_none());
    }
}
