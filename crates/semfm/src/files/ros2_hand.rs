//! A hand that is no part of the robot's description, as markers for RViz.
//!
//! `/robot_description` stays the file that controllers know, so a mounted hand is shown beside it: each part stands in a
//! frame of its own on `/tf` and is a list of triangles locked to that frame.

use parry3d_f64::shape::SharedShape;
use semfm_geom::math::{DQuat, DVec3};
use semfm_views::mcap::Cdr;

use super::PartRecord;
use crate::{FrameOwner, MotionFrame, MountedHand};

/// `visualization_msgs/Marker`: a list of triangles, added.
const TRIANGLE_LIST: u32 = 11;
const ADD: u32 = 0;
/// Red, green, blue and opacity: the grey of pictures of hands.
const COLOR: [f32; 4] = [0.55, 0.6, 0.66, 1.0];

/// A `visualization_msgs/MarkerArray` with a marker for each part, named after the hand.
pub(super) fn hand_markers(hand: &MountedHand, frames: &[MotionFrame]) -> Vec<u8> {
    let mut cdr = Cdr::new();
    cdr.length(hand.parts.len());
    for (i, part) in hand.parts.iter().enumerate() {
        let frame = frames.iter().find(|frame| frame.owner == FrameOwner::HandPart(i));
        cdr.header(0, frame.map_or("", |frame| &frame.name));
        cdr.string(&hand.name);
        // Neither numbers of markers nor kinds are negative, so that their bits are those of unsigned ones.
        for number in [u32::try_from(i).unwrap_or(u32::MAX), TRIANGLE_LIST, ADD] {
            cdr.u32(number);
        }
        cdr.pose(DVec3::ZERO, DQuat::IDENTITY);
        for scale in [1.0; 3] {
            cdr.f64(scale);
        }
        for channel in COLOR {
            cdr.f32(channel);
        }
        cdr.time(0); // lifetime: for ever
        cdr.bool(true); // locked to its frame
        let corners = triangles(part);
        cdr.length(corners.len());
        corners.iter().flat_map(|p| p.to_array()).for_each(|x| cdr.f64(x));
        cdr.length(0); // colours of corners
        cdr.string(""); // texture
        cdr.header(0, "");
        cdr.string("");
        cdr.length(0);
        cdr.length(0); // coordinates in it
        cdr.string(""); // text
        cdr.string(""); // mesh
        cdr.string("");
        cdr.length(0);
        cdr.bool(false);
    }
    cdr.into_bytes()
}

/// Corners of the triangles of a part's pieces, three a triangle, in the part's frame.
fn triangles(part: &PartRecord) -> Vec<DVec3> {
    let mut corners = Vec::new();
    for hull in &part.hulls {
        let points: Vec<DVec3> = hull.iter().map(|&p| DVec3::from_array(p)).collect();
        // The pieces were convex solids when the hand was checked; what is none is left out.
        let shape = if points.len() >= 4 { SharedShape::convex_hull(&points) } else { None };
        let polyhedron = shape.as_ref().and_then(|shape| shape.as_convex_polyhedron());
        if let Some((vertices, faces)) = polyhedron.map(|polyhedron| polyhedron.to_trimesh()) {
            corners.extend(faces.into_iter().flatten().map(|v| vertices[v as usize]));
        }
    }
    corners
}
