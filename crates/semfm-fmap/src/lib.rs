//! Functional maps with semantic anchors, and the transfer of regions between shapes.
//!
//! The **source** is the demonstrated object and has the region; the **target** is the one that
//! is looked at now. Everything here keeps that order:
//!
//! * a [`PointMap`] names one source vertex for each target vertex (target → source);
//! * a [`FunctionalMap`] C (k_target × k_source) moves functions the other way, source → target, by
//!   pulling them back through the point map;
//! * a region is transferred by the **preimage rule**: a target vertex belongs to it where its source
//!   vertex does.
//!
//! In the order of the data: [`clusters`] cuts a semantic cloud into parts, [`Anchors`] pair the parts
//! of two objects by an exact assignment, [`descriptors`] turn the pairs into smooth functions,
//! [`fit`] finds the C that agrees with them, [`zoomout`] refines it and reads a point map off it.
//! Two more steps need no anchors: [`features`] puts both clouds into one small space, and
//! [`transport`] couples them there; [`propagation`] spreads the vote that was transferred along the
//! target's own features, unless the target is the source's surface once more. A [`Method`] is made of
//! these steps, [`confidence`] says how far to trust its answer, [`metrics`] how good the answer was.
//!
//! [`PreparedObject`] is made once for each object, [`Matching`] once for each pair; the matching
//! transfers any number of regions. [`transfer()`] is the short call for one region:
//!
//! ```
//! use std::sync::Arc;
//! use semfm_fmap::{PreparedObject, Region, TransferSettings, transfer};
//! use semfm_geom::{Mesh, SemanticCloud, Shape, ShapeSettings, Task, zoo};
//!
//! /// A ball drawn out along x, whose features say where along x a point is.
//! fn prepare(length: f64, task: &Task) -> semfm_fmap::Result<PreparedObject> {
//!     let ball = zoo::icosphere(3);
//!     let vertices = ball.vertices().iter().map(|&p| p.with_x(length * p.x)).collect();
//!     let mesh = Mesh::new(vertices, ball.faces().to_vec())?;
//!     let features = ball.vertices().iter().flat_map(|p| [p.x as f32, 1.0 - p.x.abs() as f32]);
//!     let (points, n) = (mesh.vertices().to_vec(), mesh.n_vertices());
//!     let cloud = SemanticCloud::new(points, features.collect(), 2, vec![1; n])?;
//!     let shape = Shape::new(mesh, &ShapeSettings::default(), task)?;
//!     PreparedObject::new(Arc::new(shape), Arc::new(cloud), task)
//! }
//!
//! let task = Task::default();
//! let (source, target) = (prepare(1.5, &task)?, prepare(2.5, &task)?);
//! let vertices = source.shape().original().vertices();
//! let tip: Vec<bool> = vertices.iter().map(|p| p.x > 1.0).collect();
//! let settings = TransferSettings::default();
//! let answer = transfer(&source, &target, &Region::from_mask(&tip), &settings, &task)?;
//! assert!(!answer.region.is_empty());
//! # Ok::<(), semfm_fmap::Error>(())
//! ```

mod anchors;
mod assignment;
mod closest_triangle;
pub mod clusters;
pub mod confidence;
mod congruence;
pub mod descriptors;
mod error;
pub mod features;
pub mod fit;
mod functional_map;
pub mod fusion;
mod hypotheses;
mod kmeans;
pub mod likeness;
mod match_search;
mod matching;
mod method;
mod methods;
pub mod metrics;
mod nearest_points;
mod nearest_rows;
mod neighbour_graph;
mod point_map;
mod precise_map;
mod prepared_object;
pub mod propagation;
mod region;
mod report;
mod sampled_projection;
mod settings;
mod stages;
#[cfg(test)]
mod test_objects;
mod transfer;
pub mod transport;
pub mod zoomout;

pub use anchors::{Anchor, Anchors, ClusteredCloud};
pub use confidence::Evidence;
pub use error::{Error, Result};
pub use functional_map::FunctionalMap;
pub use hypotheses::Hypothesis;
pub use matching::{Matching, transfer, transfer_with_anchors};
pub use method::Method;
pub use methods::semfm::{LabelledBasis, anchor_fit};
pub use methods::{ConfidenceRule, Lifting, MethodInfo, ViewFeatures};
pub use nearest_rows::nearest_rows;
pub use point_map::PointMap;
pub use precise_map::{PreciseMap, SparseRows};
pub use prepared_object::PreparedObject;
pub use region::Region;
pub use report::{AnchorReport, MapQuality, OtherRule, TransferReport, TransportReport};
pub use semfm_geom::Verdict;
pub use settings::{Rule, TransferSettings};
pub use stages::Stages;
pub use transfer::Transfer;
