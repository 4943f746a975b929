//! Procedural objects with a labelled part, and what a depth camera sees of them.
#![allow(dead_code, reason = "each test file and example uses some of it")]

use std::f64::consts::{PI, TAU};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_align::{DepthImage, Sim3};
use semfm_geom::math::{DAffine3, DQuat, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole, SurfaceIndex};

/// A mesh whose vertices from `labelled` on belong to the part that a user would grasp.
pub struct Labelled {
    pub mesh: Mesh,
    pub labelled: Vec<u32>,
}

/// Measures of a mug, metres.
#[derive(Clone, Copy)]
pub struct Mug {
    pub radius: f64,
    pub height: f64,
    /// Radius of the foot as a share of that of the rim.
    pub taper: f64,
    pub wall: f64,
    /// How far the handle stands out; 0 leaves it away.
    pub handle: f64,
    /// Radius of the handle's own section.
    pub thick: f64,
}

impl Default for Mug {
    fn default() -> Self {
        Self { radius: 0.04, height: 0.09, taper: 1.0, wall: 0.003, handle: 0.03, thick: 0.005 }
    }
}

/// A mug, open at the top (z up), its handle at +x. `segments` around.
pub fn mug(of: Mug, segments: u32) -> Labelled {
    let Mug { radius, height, taper, wall, handle, thick } = of;
    let at = |z: f64| radius * (taper + (1.0 - taper) * z / height);
    let rows = 24;
    let mut profile = vec![[0.0, 0.0]];
    profile.extend((0..=4).map(|i| [at(0.0) * f64::from(i + 1) / 5.0, 0.0]));
    profile.extend((1..=rows).map(|i| height * f64::from(i) / f64::from(rows)).map(|z| [at(z), z]));
    profile.extend(
        (0..rows)
            .map(|i| height - (height - wall) * f64::from(i) / f64::from(rows))
            .map(|z| [at(z) - wall, z]),
    );
    profile.extend((0..5).map(|i| [(at(wall) - wall) * f64::from(4 - i) / 5.0, wall]));
    let (mut points, mut faces) = lathe(&profile, segments);
    let first = points.len() as u32;
    if handle > 0.0 {
        // Half a torus that stands in the wall with both ends.
        let middle = DVec3::new(at(0.5 * height) - 0.5 * wall, 0.0, 0.5 * height);
        let tall = 0.33 * height;
        let (along, around) = (28u32, 10u32);
        for i in 0..=along {
            let t = PI * (f64::from(i) / f64::from(along) - 0.5);
            let out = DVec3::new(t.cos(), 0.0, t.sin());
            for j in 0..around {
                let a = TAU * f64::from(j) / f64::from(around);
                let spine = middle + DVec3::new(handle * out.x, 0.0, tall * out.z);
                points.push(spine + thick * (a.cos() * out + a.sin() * DVec3::Y));
            }
        }
        for i in 0..along {
            for j in 0..around {
                let [a, b] = [j, (j + 1) % around].map(|j| first + i * around + j);
                faces.extend([[a, b, a + around], [b, b + around, a + around]]);
            }
        }
    }
    let n = points.len() as u32;
    Labelled { mesh: Mesh::new(points, faces).unwrap(), labelled: (first..n).collect() }
}

/// A surface of revolution about z through [radius, height] pairs; radius 0 at both ends.
pub fn lathe(profile: &[[f64; 2]], segments: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for &[r, z] in profile {
        points.extend((0..segments).map(|k| {
            let a = TAU * f64::from(k) / f64::from(segments);
            DVec3::new(r * a.cos(), r * a.sin(), z)
        }));
    }
    for i in 0..profile.len() as u32 - 1 {
        for k in 0..segments {
            let [a, b] = [k, (k + 1) % segments].map(|k| i * segments + k);
            faces.extend([[a, b, a + segments], [b, b + segments, a + segments]]);
        }
    }
    (points, faces)
}

/// A bottle with a shoulder and a neck; what is labelled is a strip of its wall.
pub fn bottle(segments: u32) -> Labelled {
    let profile = [
        [0.0, 0.0],
        [0.015, 0.0],
        [0.03, 0.0],
        [0.03, 0.03],
        [0.03, 0.06],
        [0.03, 0.09],
        [0.03, 0.12],
        [0.026, 0.14],
        [0.018, 0.16],
        [0.012, 0.175],
        [0.012, 0.2],
        [0.006, 0.2],
        [0.0, 0.2],
    ];
    let (points, faces) = lathe(&profile, segments);
    let labelled = strip(&points, 0.03);
    Labelled { mesh: Mesh::new(points, faces).unwrap(), labelled }
}

/// A box with its corner at the origin, each face a grid; what is labelled is the face at +x.
pub fn cuboid(size: DVec3) -> Labelled {
    let n = 12u32;
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for face in 0..6usize {
        let (k, high) = (face / 2, face % 2 == 1);
        let first = points.len() as u32;
        for i in 0..=n {
            for j in 0..=n {
                let mut p = DVec3::ZERO;
                p[k] = if high { 1.0 } else { 0.0 };
                p[(k + 1) % 3] = f64::from(i) / f64::from(n);
                p[(k + 2) % 3] = f64::from(j) / f64::from(n);
                points.push(p * size);
            }
        }
        for i in 0..n {
            for j in 0..n {
                let a = first + i * (n + 1) + j;
                let (b, c, d) = (a + 1, a + n + 1, a + n + 2);
                let two = if high { [[a, c, b], [b, c, d]] } else { [[a, b, c], [b, d, c]] };
                faces.extend(two);
            }
        }
    }
    let labelled = strip(&points, 0.999 * size.x);
    Labelled { mesh: Mesh::new(points, faces).unwrap(), labelled }
}

/// Vertices with x of at least `least` and |y| small beside it.
fn strip(points: &[DVec3], least: f64) -> Vec<u32> {
    let ids = 0..points.len() as u32;
    ids.filter(|&i| points[i as usize].x >= 0.98 * least).collect()
}

/// The object with bumps and dents of `height` (metres), as a reconstruction has them.
pub fn lumpy(of: &Labelled, height: f64, seed: u64) -> Labelled {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (centre, radius) = of.mesh.bounding_sphere();
    let waves: Vec<(DVec3, f64)> = (0..12)
        .map(|_| {
            let mut one = || 2.0 * rng.random::<f64>() - 1.0;
            (DVec3::new(one(), one(), one()) * 9.0 / radius, 3.0 * one())
        })
        .collect();
    let moved = |p: DVec3| {
        let lift = |k: usize| -> f64 {
            waves[4 * k..4 * k + 4].iter().map(|(w, phase)| (w.dot(p - centre) + phase).sin()).sum()
        };
        p + height / 2f64.sqrt() * DVec3::new(lift(0), lift(1), lift(2)) / 2.0
    };
    let points = of.mesh.vertices().iter().map(|&p| moved(p)).collect();
    let mesh = Mesh::new(points, of.mesh.faces().to_vec()).unwrap();
    Labelled { mesh, labelled: of.labelled.clone() }
}

/// A pose in which the camera looks at the object from `elevation` above its middle, the object
/// turned by `heading` about its own z; upside down where told.
pub fn view(
    mesh: &Mesh,
    scale: f64,
    heading: f64,
    elevation: f64,
    down: bool,
    distance: f64,
) -> Sim3 {
    let centre = mesh.bounding_sphere().0;
    // World z up; the camera looks along +y of the world, tilted down.
    let flip = if down { DQuat::from_rotation_x(PI) } else { DQuat::IDENTITY };
    let camera_from_world =
        DQuat::from_rotation_x(elevation) * DQuat::from_rotation_x(-PI / 2.0).inverse();
    let rotation = camera_from_world * flip * DQuat::from_rotation_z(heading);
    let translation = DVec3::new(0.01, -0.02, distance) - scale * (rotation * centre);
    Sim3 { scale, rotation, translation }
}

/// A depth camera of 320 × 240 pixels.
pub fn camera() -> Pinhole {
    let calibrated =
        Intrinsics { width: 320, height: 240, fx: 300.0, fy: 300.0, cx: 159.5, cy: 119.5 };
    Pinhole::with_pixel_centres_at_integers(calibrated, DAffine3::IDENTITY).unwrap()
}

/// What the camera sees.
pub struct Seen {
    pub image: DepthImage,
    pub mask: Vec<bool>,
    /// Share of the object's pixels that show the labelled part.
    pub labelled_share: f64,
}

/// Draws the object with `noise` (metres) in depth before a wall at `wall` metres.
pub fn render(of: &Labelled, pose: &Sim3, noise: f64, wall: f64, seed: u64) -> Seen {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let surface = SurfaceIndex::new(&of.mesh).unwrap();
    let mut is_labelled = vec![false; of.mesh.n_vertices()];
    of.labelled.iter().for_each(|&v| is_labelled[v as usize] = true);
    let (camera, back) = (camera(), pose.inverse());
    let origin = back.apply(DVec3::ZERO);
    let (centre, radius) = of.mesh.bounding_sphere();
    let (centre, radius) = (pose.apply(centre), pose.scale * radius);
    let (mut depth, mut mask, mut n_labelled) = (Vec::new(), Vec::new(), 0);
    for pixel in 0..320 * 240u32 {
        let ray = camera.ray_in_camera(f64::from(pixel % 320) + 0.5, f64::from(pixel / 320) + 0.5);
        let away = centre.cross(ray.normalize()).length();
        let hit =
            (away < radius).then(|| surface.first_hit(origin, back.apply(ray) - origin)).flatten();
        if let Some(hit) = hit {
            let corners = of.mesh.faces()[hit.face as usize];
            n_labelled += usize::from(corners.iter().all(|&v| is_labelled[v as usize]));
        }
        mask.push(hit.is_some());
        depth.push(hit.map_or(wall as f32, |hit| (hit.t + noise * normal(&mut rng)) as f32));
    }
    let n = mask.iter().filter(|&&m| m).count().max(1);
    let image = DepthImage::new(320, 240, depth).unwrap();
    Seen { image, mask, labelled_share: n_labelled as f64 / n as f64 }
}

/// Largest distance between the true and the found place of a labelled vertex, metres.
pub fn label_error(of: &Labelled, truth: &Sim3, found: &Sim3) -> f64 {
    let places = of.labelled.iter().map(|&v| of.mesh.vertices()[v as usize]);
    places.map(|p| truth.apply(p).distance(found.apply(p))).fold(0.0, f64::max)
}

/// Three independent numbers of the normal distribution.
pub fn normal_vector(rng: &mut ChaCha8Rng) -> DVec3 {
    DVec3::new(normal(rng), normal(rng), normal(rng))
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v) = (1.0 - rng.random::<f64>(), rng.random::<f64>());
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}
