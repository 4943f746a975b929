//! How often a surface winds around a point: 1 inside, 0 outside, of either sign. An open wrist blurs it there and nowhere
//! else, and parts that overlap only raise it (Jacobson, Kavan & Sorkine-Hornung, *Robust Inside-Outside Segmentation
//! using Generalized Winding Numbers*, 2013). Faces that are far away count together, as one dipole (Barill et al., *Fast
//! Winding Numbers for Soups and Clouds*, 2018).

use std::f64::consts::PI;

use semfm_geom::math::DVec3;

/// Faces that are counted one by one where they are near.
const MOST_FACES: usize = 16;
/// A cluster is far from this many of its radii on: the dipole is then off by less than a percent of it.
const FAR: f64 = 3.0;

/// The faces of a surface, in clusters.
#[derive(Debug, Default)]
pub(super) struct Winding {
    clusters: Vec<Cluster>,
}

#[derive(Debug)]
struct Cluster {
    corners: Vec<[DVec3; 3]>,
    middle: DVec3,
    radius: f64,
    /// Sum of areas times normals.
    dipole: DVec3,
}

impl Winding {
    pub fn new(points: &[DVec3], faces: &[[u32; 3]]) -> Self {
        let mut clusters = Vec::new();
        let mut waiting: Vec<Vec<[DVec3; 3]>> =
            vec![faces.iter().map(|face| face.map(|v| points[v as usize])).collect()];
        while let Some(mut corners) = waiting.pop() {
            if corners.len() > MOST_FACES {
                let (low, high) =
                    corners.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), c| {
                        (l.min(c[0]), h.max(c[0]))
                    });
                let axis = (0..3)
                    .max_by(|&a, &b| (high - low)[a].total_cmp(&(high - low)[b]))
                    .unwrap_or(0);
                corners.sort_by(|a, b| a[0][axis].total_cmp(&b[0][axis]));
                let second = corners.split_off(corners.len() / 2);
                waiting.extend([corners, second]);
            } else if !corners.is_empty() {
                clusters.push(Cluster::new(corners));
            }
        }
        Self { clusters }
    }

    /// The winding number of a point.
    pub fn at(&self, point: DVec3) -> f64 {
        self.clusters.iter().map(|cluster| cluster.solid_angle(point)).sum::<f64>() / (4.0 * PI)
    }
}

impl Cluster {
    fn new(corners: Vec<[DVec3; 3]>) -> Self {
        let area = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a);
        let total: f64 = corners.iter().map(|c| area(c).length()).sum();
        let weighted =
            corners.iter().map(|c| area(c).length() * (c[0] + c[1] + c[2]) / 3.0).sum::<DVec3>();
        let middle = if total > 0.0 { weighted / total } else { corners[0][0] };
        let radius = corners.as_flattened().iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let dipole = corners.iter().map(area).sum();
        Self { corners, middle, radius, dipole }
    }

    fn solid_angle(&self, point: DVec3) -> f64 {
        let away = self.middle - point;
        let distance = away.length();
        if distance > FAR * self.radius {
            return self.dipole.dot(away) / distance.powi(3);
        }
        self.corners.iter().map(|corners| solid_angle(corners.map(|corner| corner - point))).sum()
    }
}

/// Of a triangle seen from the origin (Van Oosterom & Strackee 1983):
/// tan(Ω/2) = det(a b c) / (|a||b||c| + (a·b)|c| + (b·c)|a| + (c·a)|b|).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    #[test]
    fn clusters_wind_as_their_faces_do() {
        let torus = zoo::torus(40, 20);
        let winding = Winding::new(torus.vertices(), torus.faces());
        assert!(winding.clusters.len() > 50);
        for i in 0..200 {
            let t = f64::from(i) / 200.0;
            let point =
                DVec3::new(2.0 * (9.0 * t).sin(), 2.0 * (7.0 * t).cos(), 0.6 * (11.0 * t).sin());
            let exact = torus
                .faces()
                .iter()
                .map(|face| solid_angle(face.map(|v| torus.vertices()[v as usize] - point)));
            let exact = exact.sum::<f64>() / (4.0 * PI);
            assert!(
                (winding.at(point) - exact).abs() < 0.03,
                "{point}: {} {exact}",
                winding.at(point)
            );
        }
    }
}
