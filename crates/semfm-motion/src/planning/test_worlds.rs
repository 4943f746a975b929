//! Spaces whose free part is known exactly, for tests.

use super::joint_space::{JointRange, JointSpace, between, straight_length};
use super::validity::{Contact, Validity};

/// Boxes in joint space that may not be entered; each joint is an axis and a radian is a metre.
pub struct Boxes {
    pub boxes: Vec<BoxObstacle>,
    /// True of joints whose values that differ by 2π are one.
    pub continuous: Vec<bool>,
    /// Distance that counts as contact.
    pub margin: f64,
}

#[derive(Clone)]
pub struct BoxObstacle {
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

impl Boxes {
    pub fn none(n_joints: usize) -> Self {
        Self { boxes: Vec::new(), continuous: vec![false; n_joints], margin: 0.0 }
    }

    pub fn of(boxes: &[(&[f64], &[f64])]) -> Self {
        let n_joints = boxes[0].0.len();
        let boxes = boxes
            .iter()
            .map(|(lower, upper)| BoxObstacle { lower: lower.to_vec(), upper: upper.to_vec() })
            .collect();
        Self { boxes, continuous: vec![false; n_joints], margin: 0.0 }
    }

    /// The same with `margin` around each box.
    pub fn with_margin(&self, margin: f64) -> Self {
        Self { boxes: self.boxes.clone(), continuous: self.continuous.clone(), margin }
    }

    /// Distance of `q` from the nearest box; negative inside, by the way to the nearest side.
    fn signed_distance(&self, q: &[f64]) -> (f64, usize) {
        let mut nearest = (f64::INFINITY, 0);
        for (index, obstacle) in self.boxes.iter().enumerate() {
            let mut outside = 0.0;
            let mut inside = f64::NEG_INFINITY;
            for (joint, &value) in q.iter().enumerate() {
                let mut value = value;
                if self.continuous[joint] {
                    value -= std::f64::consts::TAU * (value / std::f64::consts::TAU).round();
                }
                let beyond = (obstacle.lower[joint] - value).max(value - obstacle.upper[joint]);
                outside += beyond.max(0.0).powi(2);
                inside = inside.max(beyond);
            }
            let distance = if inside > 0.0 { outside.sqrt() } else { inside };
            if distance < nearest.0 {
                nearest = (distance, index);
            }
        }
        (nearest.0 - self.margin, nearest.1)
    }
}

impl Validity for Boxes {
    fn is_free(&self, q: &[f64]) -> bool {
        self.signed_distance(q).0 > 0.0
    }

    fn motion_is_free(&self, from: &[f64], to: &[f64]) -> bool {
        let steps = (straight_length(from, to) / 1e-3).ceil().max(1.0);
        (0..=steps as usize).all(|step| self.is_free(&between(from, to, step as f64 / steps)))
    }

    fn clearance(&self, q: &[f64]) -> f64 {
        self.signed_distance(q).0.max(0.0)
    }

    fn displacement(&self, travel: &[f64]) -> f64 {
        travel.iter().map(|t| t * t).sum::<f64>().sqrt()
    }

    fn first_contact(&self, q: &[f64]) -> Option<Contact> {
        let (distance, index) = self.signed_distance(q);
        (distance <= 0.0).then(|| Contact {
            a: "arm".into(),
            b: format!("box {index}"),
            depth: -distance,
        })
    }
}

/// Joints named j0, j1, …, all with the same range.
pub fn joints(n_joints: usize, lower: f64, upper: f64) -> JointSpace {
    let joint = |j: usize| JointRange { name: format!("j{j}"), lower, upper };
    JointSpace::new((0..n_joints).map(joint).collect()).unwrap()
}
