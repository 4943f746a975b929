//! Signed distances of the primitives that objects are made of.
//!
//! A field gives, at a point, its distance to the primitive's surface (negative inside, sometimes
//! only a bound) and how far along the primitive the point lies, 0 to 1.

use std::sync::Arc;

use semfm_geom::math::DVec3;

/// Distance to the surface, and the position along the primitive in [0, 1].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub distance: f64,
    pub along: f64,
}

/// A primitive as a function of space.
#[derive(Clone)]
pub(crate) struct Field(Arc<dyn Fn(DVec3) -> Sample + Send + Sync>);

impl Field {
    fn new(f: impl Fn(DVec3) -> Sample + Send + Sync + 'static) -> Self {
        Self(Arc::new(f))
    }

    pub(crate) fn at(&self, p: DVec3) -> Sample {
        (self.0)(p)
    }

    /// What is in this and not in `other`.
    pub(crate) fn minus(self, other: Self) -> Self {
        Self::new(move |p| {
            let s = self.at(p);
            Sample { distance: s.distance.max(-other.at(p).distance), ..s }
        })
    }

    /// What is in this and below the plane through `point` with outward `normal`.
    pub(crate) fn below(self, point: DVec3, normal: DVec3) -> Self {
        let normal = normal.normalize();
        Self::new(move |p| {
            let s = self.at(p);
            Sample { distance: s.distance.max((p - point).dot(normal)), ..s }
        })
    }
}

pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A string of rounded cones through `nodes`, one radius each.
pub(crate) struct Chain {
    nodes: Vec<DVec3>,
    radii: Vec<f64>,
    flat: Option<(DVec3, f64)>,
}

/// A chain with one radius per node.
pub(crate) fn chain(nodes: impl Into<Vec<DVec3>>, radii: impl Into<Vec<f64>>) -> Chain {
    let (nodes, radii) = (nodes.into(), radii.into());
    assert!(
        nodes.len() == radii.len() && nodes.len() >= 2,
        "one radius per node, two nodes at least"
    );
    Chain { nodes, radii, flat: None }
}

/// A chain of one radius.
pub(crate) fn tube(nodes: impl Into<Vec<DVec3>>, radius: f64) -> Chain {
    let nodes = nodes.into();
    let radii = vec![radius; nodes.len()];
    chain(nodes, radii)
}

impl Chain {
    /// Thickness along `normal` times `factor`: a blade, a strap, a sole.
    pub(crate) fn flat(mut self, normal: DVec3, factor: f64) -> Self {
        self.flat = Some((normal.normalize(), factor));
        self
    }

    /// Joins the last node to the first.
    pub(crate) fn closed(mut self) -> Self {
        self.nodes.push(self.nodes[0]);
        self.radii.push(self.radii[0]);
        self
    }

    pub(crate) fn field(self) -> Field {
        let Self { nodes, radii, flat } = self;
        let mut total = 0.0;
        let starts: Vec<f64> = nodes
            .windows(2)
            .map(|pair| {
                let start = total;
                total += pair[0].distance(pair[1]);
                start
            })
            .collect();
        Field::new(move |p| {
            let mut best = Sample { distance: f64::INFINITY, along: 0.0 };
            for (i, pair) in nodes.windows(2).enumerate() {
                let edge = pair[1] - pair[0];
                let t = ((p - pair[0]).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
                let mut offset = p - (pair[0] + t * edge);
                if let Some((normal, factor)) = flat {
                    offset += offset.dot(normal) * (1.0 / factor - 1.0) * normal;
                }
                let distance = offset.length() - (radii[i] * (1.0 - t) + radii[i + 1] * t);
                if distance < best.distance {
                    best = Sample { distance, along: (starts[i] + t * edge.length()) / total };
                }
            }
            best
        })
    }
}

/// A box with rounded edges, along its x axis from 0 to 1.
pub(crate) fn rounded_box(centre: DVec3, half: DVec3, rounding: f64) -> Field {
    Field::new(move |p| {
        let q = (p - centre).abs() - (half - rounding);
        let distance = q.max(DVec3::ZERO).length() + q.max_element().min(0.0) - rounding;
        Sample { distance, along: ((p.x - centre.x) / (2.0 * half.x) + 0.5).clamp(0.0, 1.0) }
    })
}

/// An ellipsoid with axes along x, y and z (distance is a bound).
pub(crate) fn ellipsoid(centre: DVec3, radii: DVec3) -> Field {
    Field::new(move |p| {
        let q = (p - centre) / radii;
        let distance = (q.length() - 1.0) * radii.min_element();
        Sample { distance, along: (q.x / 2.0 + 0.5).clamp(0.0, 1.0) }
    })
}

/// A solid of revolution about z through (height, radius) pairs, `wall` thick and open above where
/// given; `squareness` 2 is round, more is boxier.
pub(crate) fn revolve(profile: &[(f64, f64)], wall: Option<f64>, squareness: f64) -> Field {
    let profile = profile.to_vec();
    // Slopes of the profile make the radial difference overstate the distance a little.
    const SLOPE: f64 = 0.9;
    Field::new(move |p| {
        let rho = (p.x.abs().powf(squareness) + p.y.abs().powf(squareness)).powf(1.0 / squareness);
        let (bottom, top) = (profile[0].0, profile[profile.len() - 1].0);
        let radius = interpolate(&profile, p.z);
        let mut distance = ((rho - radius) * SLOPE).max(bottom - p.z).max(p.z - top);
        if let Some(wall) = wall {
            let inside = ((rho - (radius - wall)) * SLOPE).max(bottom + wall - p.z);
            distance = distance.max(-inside);
        }
        Sample { distance, along: ((p.z - bottom) / (top - bottom)).clamp(0.0, 1.0) }
    })
}

fn interpolate(profile: &[(f64, f64)], z: f64) -> f64 {
    let after = profile.partition_point(|&(height, _)| height <= z);
    if after == 0 {
        return profile[0].1;
    }
    let Some(&(high, above)) = profile.get(after) else { return profile[after - 1].1 };
    let (low, below) = profile[after - 1];
    below + (above - below) * (z - low) / (high - low)
}

/// Which two axes an arc lies in.
#[derive(Clone, Copy)]
pub(crate) enum Plane {
    Xy,
    Xz,
    Yz,
}

/// `n` points of an elliptic arc from `start` to `end` radians, stretched by `sx` and `sy`.
#[derive(Clone, Copy)]
pub(crate) struct Arch {
    pub centre: DVec3,
    pub radius: f64,
    pub start: f64,
    pub end: f64,
    pub n: usize,
    pub plane: Plane,
    pub stretch: (f64, f64),
}

impl Arch {
    pub(crate) fn new(centre: DVec3, radius: f64, start: f64, end: f64, n: usize) -> Self {
        Self { centre, radius, start, end, n, plane: Plane::Xz, stretch: (1.0, 1.0) }
    }

    pub(crate) fn plane(mut self, plane: Plane) -> Self {
        self.plane = plane;
        self
    }

    pub(crate) fn stretch(mut self, first: f64, second: f64) -> Self {
        self.stretch = (first, second);
        self
    }

    pub(crate) fn points(self) -> Vec<DVec3> {
        (0..self.n)
            .map(|i| {
                let angle = self.start + (self.end - self.start) * i as f64 / (self.n - 1) as f64;
                let a = self.radius * self.stretch.0 * angle.cos();
                let b = self.radius * self.stretch.1 * angle.sin();
                self.centre
                    + match self.plane {
                        Plane::Xy => v(a, b, 0.0),
                        Plane::Xz => v(a, 0.0, b),
                        Plane::Yz => v(0.0, a, b),
                    }
            })
            .collect()
    }
}

/// Smooth minimum of two distances over a blend of width `k` (Quilez's polynomial form).
pub(crate) fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (0.5 + 0.5 * (b - a) / k).clamp(0.0, 1.0);
    b * (1.0 - h) + a * h - k * h * (1.0 - h)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_knows_its_distance_and_how_far_along_a_point_lies() {
        let rod = tube([v(0.0, 0.0, 0.0), v(0.0, 0.0, 2.0)], 0.1).field();
        let s = rod.at(v(0.3, 0.0, 0.5));
        assert!((s.distance - 0.2).abs() < 1e-12 && (s.along - 0.25).abs() < 1e-12);
    }

    #[test]
    fn a_cup_is_hollow() {
        let cup = revolve(&[(0.0, 0.5), (1.0, 0.5)], Some(0.1), 2.0);
        assert!(cup.at(v(0.0, 0.0, 0.5)).distance > 0.0, "air inside");
        assert!(cup.at(v(0.45, 0.0, 0.5)).distance < 0.0, "wall");
        assert!(cup.at(v(0.0, 0.0, 0.05)).distance < 0.0, "bottom");
    }
}
