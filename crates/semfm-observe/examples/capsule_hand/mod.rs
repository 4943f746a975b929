//! A hand of capsules that closes its fingers around an object.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_geom::math::{DMat3, DQuat, DVec3};
use semfm_geom::sampling::sample_uniform;
use semfm_geom::{Mesh, SurfaceIndex};
use semfm_observe::Hand;

/// An object in a hand.
pub struct GraspedObject {
    pub hand: Hand,
    /// From the object to the back of the hand.
    pub back: DVec3,
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

/// Half of the palm, metres.
const PALM: DVec3 = DVec3::new(0.04, 0.045, 0.012);

/// A hand whose palm comes down on a spot of the object and whose fingers close until they touch; `None` where the palm
/// does not come near, or fewer than two fingers touch.
pub fn grasp(mesh: &Mesh, seed: u64) -> Result<Option<GraspedObject>, semfm_geom::Error> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let surface = SurfaceIndex::new(mesh)?;
    let (low, high) = mesh.bounds();
    let long = match (high - low).max_element() {
        most if most == (high - low).x => DVec3::X,
        most if most == (high - low).y => DVec3::Y,
        _ => DVec3::Z,
    };
    for spot in sample_uniform(mesh, 40, seed)? {
        let out = if spot.normal.dot(spot.point) < 0.0 { -spot.normal } else { spot.normal };
        // The fingers close around the long axis.
        let Some(across) = (long - long.dot(out) * out).try_normalize() else { continue };
        let twist = DQuat::from_axis_angle(out, random.random_range(-0.5..0.5));
        let x = twist * across;
        let frame = DMat3::from_cols(x, (-out).cross(x), -out);
        let centre = DVec3::new(0.0, 0.05, 0.0);
        let clearance = |height: f64| {
            let origin = spot.point + height * out - frame * centre;
            samples_of_palm()
                .map(|p| surface.closest(origin + frame * p).map_or(1.0, |c| c.distance))
                .fold(1.0, f64::min)
        };
        let height = (0..40).map(|i| 0.012 + 0.001 * f64::from(i)).find(|&h| clearance(h) > 0.011);
        let Some(height) = height else { continue };
        let origin = spot.point + height * out - frame * centre;
        let (mut points, mut faces) = (Vec::new(), Vec::new());
        let mut parts = Vec::new();
        add_ellipsoid(&mut points, &mut faces, &|p| origin + frame * (centre + p));
        parts.resize(points.len(), semfm_observe::HandPart::Palm);
        let mut n_touching = 0;
        for (finger, part) in fingers().iter().zip(semfm_observe::HandPart::ALL) {
            let (joints, touches) = close(finger, origin, frame, &surface);
            n_touching += usize::from(touches);
            for bone in joints.windows(2) {
                add_capsule(&mut points, &mut faces, bone[0], bone[1], finger.radius);
            }
            parts.resize(points.len(), part);
        }
        if n_touching >= 2 {
            let hand = Hand::new(points, faces).and_then(|hand| hand.with_parts(parts));
            return Ok(hand.ok().map(|hand| GraspedObject { hand, back: out }));
        }
    }
    Ok(None)
}

fn samples_of_palm() -> impl Iterator<Item = DVec3> {
    (0..49).map(|i| {
        DVec3::new(
            f64::from(i % 7 - 3) / 3.0 * 0.8 * PALM.x,
            0.05 + f64::from(i / 7 - 3) / 3.0 * 0.8 * PALM.y,
            0.0,
        )
    })
}

/// Bends a finger, joint by joint from the palm on, until the bones beyond it touch; the joints' places, and whether it did.
fn close(
    finger: &Finger,
    origin: DVec3,
    frame: DMat3,
    surface: &SurfaceIndex,
) -> (Vec<DVec3>, bool) {
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
            let joints = place(next);
            if touches(&joints[joint..]) {
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
    (place(angles), has_touched)
}

const AROUND: usize = 10;

fn add_capsule(
    points: &mut Vec<DVec3>,
    faces: &mut Vec<[u32; 3]>,
    a: DVec3,
    b: DVec3,
    radius: f64,
) {
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
    let rings = latitudes.iter().enumerate().flat_map(|(i, &latitude)| ring(i, latitude)).collect();
    add_tube(points, faces, rings, a - radius * axis, b + radius * axis);
}

fn add_ellipsoid(
    points: &mut Vec<DVec3>,
    faces: &mut Vec<[u32; 3]>,
    place: &dyn Fn(DVec3) -> DVec3,
) {
    // A box with rounded edges: the superellipsoid of exponent 4.
    let shape = |p: DVec3| place(p.signum() * p.abs().powf(0.5) * PALM);
    let ring = |latitude: f64| {
        (0..AROUND).map(move |k| {
            let angle = std::f64::consts::TAU * k as f64 / AROUND as f64;
            DVec3::new(latitude.cos() * angle.cos(), latitude.cos() * angle.sin(), latitude.sin())
        })
    };
    let rings = (-4..=4).flat_map(|i| ring(f64::from(i) * 0.35)).map(shape).collect();
    add_tube(points, faces, rings, shape(-DVec3::Z), shape(DVec3::Z));
}

/// Rings of [`AROUND`] points, closed by a point at each end.
fn add_tube(
    points: &mut Vec<DVec3>,
    faces: &mut Vec<[u32; 3]>,
    rings: Vec<DVec3>,
    first: DVec3,
    last: DVec3,
) {
    let base = points.len() as u32;
    let (n, n_rings) = (AROUND as u32, (rings.len() / AROUND) as u32);
    points.extend(rings);
    points.extend([first, last]);
    let (first, last) = (base + n * n_rings, base + n * n_rings + 1);
    for k in 0..n {
        let next = (k + 1) % n;
        faces.push([first, base + next, base + k]);
        let top = base + n * (n_rings - 1);
        faces.push([last, top + k, top + next]);
        for ring in 0..n_rings - 1 {
            let (low, high) = (base + n * ring, base + n * (ring + 1));
            faces.push([low + k, low + next, high + k]);
            faces.push([low + next, high + next, high + k]);
        }
    }
}
