//! Collisions of an arm with itself, with a scene and with what it carries.
//!
//! [`CollisionModel`] holds the robot's links as [`CollisionBody`]: convex pieces under trees of spheres that cover them,
//! and the pairs of links that are checked. [`Scene`] holds what stands around. [`CollisionChecker`] puts both together
//! and answers: for a state by spheres first, by the pieces where spheres meet; for a motion by halving it until the
//! distances that were found cover all of it.

mod body;
mod checker;
#[cfg(test)]
mod checker_tests;
mod convex;
mod hull;
mod joint_frames;
mod model;
mod motion;
mod moving_body;
mod nearest_free;
mod pairs;
mod scene;
mod sphere_tree;
mod surface;

pub use body::CollisionBody;
pub use checker::{AttachedBody, CollisionChecker};
pub use model::{CollisionModel, CollisionSettings};
pub use pairs::{SkipReason, SkippedPair};
pub use scene::Scene;
