//! Carry a demonstrated region from one object to another: Semantic Anchored Functional Maps.
//!
//! A demonstration touches one object, the **source** (the handle of a mug). SemFM finds where to
//! act on another object of the same kind, the **target** (a kettle). From two meshes, a region on
//! the first and patch embeddings of rendered views, it lifts the embeddings to the surface, finds
//! semantic anchors, computes and refines a functional map, carries the region over and says how
//! sure it is (Dong & Zhi, *Affordance Transfer Across Object Instances via Semantically Anchored
//! Functional Map*).
//!
//! [`pipeline`] is the tour: it is short and in the order of the paper. The floors below are
//! re-exported whole: [`geom`] (meshes, Laplacians, eigenbases), [`views`] (cameras, rendering,
//! lifting, MCAP files) and [`fmap`] (anchors, maps, transfer).
//!
//! ```no_run
//! use semfm::{Meaning, PipelineSettings, PreparedObject, Region, Task, transfer};
//!
//! let (settings, task) = (PipelineSettings::default(), Task::default());
//! let mug = semfm::geom::io::read_mesh("mug.obj")?.mesh;
//! let kettle = semfm::geom::io::read_mesh("kettle.ply")?.mesh;
//! # let (mug_features, kettle_features) = (vec![0.0f32; 3], vec![0.0f32; 3]);
//! let grip = Region::from_vertices(mug.n_vertices(), &[12, 40])?;
//! let mug = PreparedObject::new(mug, Meaning::PerVertex(&mug_features), &settings, &task)?;
//! let kettle = PreparedObject::new(kettle, Meaning::PerVertex(&kettle_features), &settings, &task)?;
//! let carried = transfer(&mug, &kettle, &grip, &settings.transfer, &task)?;
//! println!("{:?} with confidence {:.2}", carried.verdict, carried.confidence);
//! # Ok::<(), semfm::Error>(())
//! ```

pub use semfm_align as align;
pub use semfm_fmap as fmap;
pub use semfm_geom as geom;
pub use semfm_grasp as grasp;
pub use semfm_robot as robot;
pub use semfm_views as views;

pub mod aligned;
mod error;
pub mod grasps;
pub mod observed;
pub mod output;
pub mod pipeline;
pub mod region_file;
pub mod regions;
pub mod weight_colors;

pub use error::{Error, Result};
pub use fmap::{Method, Region, Rule, Transfer, TransferSettings, Verdict};
pub use geom::{Mesh, Task};
pub use pipeline::{Meaning, PipelineSettings, PreparedObject, transfer};
