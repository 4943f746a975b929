//! From meaning to maps: semantic anchors, functional maps, ZoomOut, transport, and the region that
//! travels.
//!
//! The **source** is the demonstrated object and carries the region; the **target** is the one that
//! is looked at now. Everything here keeps that order:
//!
//! * a [`PointMap`] names one source vertex for each target vertex (target → source);
//! * a [`FunctionalMap`] C (k_target × k_source) moves functions the other way, source → target, by
//!   pulling them back through the point map;
//! * a region travels by the **preimage rule**: a target vertex belongs to it where its source
//!   vertex does.
//!
//! The rooms, in the order in which the data walks through them: [`clusters`] cuts a semantic cloud
//! into parts, [`anchors`] pairs the parts of two objects by an exact [`assignment`],
//! [`descriptors`] turn the pairs into smooth functions, [`fit`] finds the C that agrees with
//! them, [`zoomout`] refines it, [`point_map`] reads vertices off it. Beside that road run
//! [`features`] (both clouds in one small space) and [`transport`] (a coupling of the clouds without
//! any map); [`propagation`] draws the outline of what arrived along the target's own features. [`transfer`](mod@transfer) offers six methods made of these pieces under one interface,
//! [`confidence`] says how far to trust the answer, [`metrics`] how good it was.
//!
//! [`PreparedObject`] is made once for each object, [`Matching`] once for each pair; the matching
//! carries any number of regions. [`transfer()`] is the short call for one region.

pub mod anchors;
pub mod assignment;
pub mod clusters;
pub mod confidence;
pub mod descriptors;
mod error;
pub mod features;
pub mod fit;
pub mod functional_map;
mod kmeans;
pub mod metrics;
mod nearest_rows;
mod neighbour_graph;
pub mod point_map;
mod prepared_object;
pub mod propagation;
pub mod region;
#[cfg(test)]
mod test_objects;
pub mod transfer;
pub mod transport;
pub mod zoomout;

pub use anchors::{Anchor, Anchors};
pub use confidence::{Evidence, Hypothesis, Verdict};
pub use error::{Error, Result};
pub use functional_map::FunctionalMap;
pub use nearest_rows::nearest_rows;
pub use point_map::PointMap;
pub use prepared_object::PreparedObject;
pub use region::Region;
pub use transfer::{Matching, Method, Rule, Transfer, TransferReport, TransferSettings, transfer};
