//! Outlines: pixels where the surface ends, jumps in depth or folds are drawn darker.

use semfm_geom::math::DVec3;

use super::Request;
use crate::View;

/// A step in depth of this share of the bounding-sphere radius is an edge, where the surface behind
/// it is not so steep that a step of two pixels explains it.
const JUMP: f64 = 0.03;
const PIXELS: f64 = 2.0;

/// Darkens the pixels of the object that border on something farther away or beyond a crease.
pub(super) fn draw(view: &mut View, request: &Request<'_>) {
    let is_edge = Edges { view, request, jump: JUMP * request.sphere.radius }.find();
    let kept = 1.0 - request.settings.edges as f32;
    for (pixel, _) in view.rgb.chunks_exact_mut(3).zip(is_edge).filter(|(_, is_edge)| *is_edge) {
        pixel.iter_mut().for_each(|byte| *byte = (f32::from(*byte) * kept + 0.5) as u8);
    }
}

struct Edges<'a> {
    view: &'a View,
    request: &'a Request<'a>,
    jump: f64,
}

impl Edges<'_> {
    /// Which pixels (height × width) are edges, each on the nearer side of its border.
    fn find(&self) -> Vec<bool> {
        let (width, height) =
            (self.view.camera.width() as usize, self.view.camera.height() as usize);
        let mut is_edge = vec![false; width * height];
        for here in 0..width * height {
            let right = (here % width + 1 < width).then_some(here + 1);
            let below = (here + width < width * height).then_some(here + width);
            for there in [right, below].into_iter().flatten() {
                let nearer_first = self.view.depth[here] <= self.view.depth[there];
                let (near, far) = if nearer_first { (here, there) } else { (there, here) };
                if self.is_border(near, far) {
                    is_edge[near] = true;
                }
            }
        }
        is_edge
    }

    /// Whether two neighbouring pixels belong to different places of the surface.
    fn is_border(&self, near: usize, far: usize) -> bool {
        let (one, other) = (self.view.triangles[near], self.view.triangles[far]);
        if one == other || one < 0 {
            return false;
        }
        if other < 0 {
            return true; // the background
        }
        let camera = &self.view.camera;
        let normal = self.normal(other);
        let [nearer, depth] = [near, far].map(|pixel| f64::from(self.view.depth[pixel]));
        let width = camera.width() as usize;
        let (u, v) = ((far % width) as f64 + 0.5, (far / width) as f64 + 0.5);
        let cosine = normal.dot(camera.ray(u, v).normalize()).abs();
        let steepness = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine;
        depth - nearer > self.jump + PIXELS * depth / camera.fx().min(camera.fy()) * steepness
            || self.normal(one).dot(normal).abs() < self.request.settings.crease.cos()
    }

    fn normal(&self, triangle: i32) -> DVec3 {
        self.request.mesh.face_normal_scaled(triangle as usize).normalize_or_zero()
    }
}
