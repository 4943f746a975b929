//! The compiled half of the Python package: arrays in, facade calls, arrays out.
//!
//! One file per class, named as in Rust. A class holds the Rust value (`inner`) and converts:
//! `arrays_in` checks arrays of NumPy, `arrays_out` makes them, `interruptible` runs what takes
//! long, `errors` raises. Documentation is Python's: numpydoc, read by `help`, run by doctest, and
//! read by the script that writes the type stubs.
#![allow(clippy::type_complexity, reason = "pickles: a function and its arguments, as they are")]
#![allow(clippy::doc_lazy_continuation, reason = "docstrings are numpydoc, not Markdown")]
#![allow(clippy::doc_overindented_list_items, reason = "docstrings are numpydoc, not Markdown")]

use pyo3::prelude::*;

mod align;
mod anchors;
mod arrays_in;
mod arrays_out;
mod cloud;
mod descriptors;
mod eigenbasis;
mod embed;
mod embeddings;
mod errors;
mod functional_map;
mod geodesic;
mod grasp;
mod grasp_pickle;
mod grasps;
mod gripper;
mod hand;
mod interruptible;
mod json;
mod laplacian;
mod matching;
mod memory;
mod mesh;
mod observation;
mod observation_parts;
mod observations;
mod observed_object;
mod pictures;
mod pinhole;
mod plan;
mod point_map;
mod precise_map;
mod prepared;
mod region;
mod robot;
mod run;
mod scene;
mod settings;
mod shape;
mod shared;
mod stored_transfer;
mod surface;
mod synth;
mod tracker;
mod transfer;
mod transfer_function;
mod view;
mod views_file;

/// The compiled half of `semfm`.
#[pymodule]
mod _semfm {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::align::{_restore_alignment, Alignment, align_};
    #[pymodule_export]
    use crate::anchors::{_restore_anchors, Anchors, Clusters, spectral_clusters};
    #[pymodule_export]
    use crate::cloud::{SemanticCloud, lift};
    #[pymodule_export]
    use crate::descriptors::{diffused_indicators, hks, wks};
    #[pymodule_export]
    use crate::eigenbasis::{Eigenbasis, eigenbasis};
    #[pymodule_export]
    use crate::embed::embed;
    #[pymodule_export]
    use crate::embeddings::{_restore_embeddings, _restore_patches, Embeddings, PatchEmbeddings};
    #[pymodule_export]
    use crate::functional_map::FunctionalMap;
    #[pymodule_export]
    use crate::geodesic::{_restore_heat, HeatGeodesics, geodesic_distances};
    #[pymodule_export]
    use crate::grasp::{_restore_grasp, Grasp};
    #[pymodule_export]
    use crate::grasps::{_restore_grasps, Grasps, find_grasps};
    #[pymodule_export]
    use crate::gripper::{_restore_gripper, Gripper};
    #[pymodule_export]
    use crate::hand::{
        _restore_hand, _restore_touched_region, Hand, TouchedRegion, find_contact, read_hand,
    };
    #[pymodule_export]
    use crate::interruptible::{_work_for_tests, get_num_threads, set_num_threads};
    #[pymodule_export]
    use crate::json::{check_output, printable, read_file, write_file};
    #[pymodule_export]
    use crate::laplacian::{
        Laplacian, cotan_laplacian_, laplacian, point_cloud_laplacian_, tufted_laplacian_,
    };
    #[pymodule_export]
    use crate::matching::{_restore_matching, Matching};
    #[pymodule_export]
    use crate::memory::{Memory, MemoryTransfer};
    #[pymodule_export]
    use crate::mesh::{Mesh, MeshFile, mesh_formats, read_mesh};
    #[pymodule_export]
    use crate::observation::{_restore_observation, Observation};
    #[pymodule_export]
    use crate::observations::{Observations, read_observations, write_observations};
    #[pymodule_export]
    use crate::observed_object::{_restore_observed_object, ObservedObject, merged_surface};
    #[pymodule_export]
    use crate::pinhole::{Pinhole, camera_towards, rig};
    #[pymodule_export]
    use crate::plan::{GraspPlan, Segment, plan};
    #[pymodule_export]
    use crate::point_map::PointMap;
    #[pymodule_export]
    use crate::precise_map::PreciseMap;
    #[pymodule_export]
    use crate::prepared::{_restore_prepared, PreparedObject, prepare};
    #[pymodule_export]
    use crate::region::Region;
    #[pymodule_export]
    use crate::robot::{_restore_robot, Robot};
    #[pymodule_export]
    use crate::run::{_restore_run_result, RunResult, planned_stages, run};
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::settings::{_restore_settings, TransferSettings};
    #[pymodule_export]
    use crate::shape::{_restore_shape, Shape};
    #[pymodule_export]
    use crate::stored_transfer::{StoredTransfer, read_transfer};
    #[pymodule_export]
    use crate::surface::{
        SurfaceIndex, farthest_points, icosphere, sample_even, sample_uniform, torus,
    };
    #[pymodule_export]
    use crate::synth::{_restore_demo_object, DemoObject, demo_object};
    #[pymodule_export]
    use crate::tracker::{_restore_tracked_pose, TrackedPose, Tracker};
    #[pymodule_export]
    use crate::transfer::{_restore_hypothesis, _restore_transfer, Hypothesis, Transfer};
    #[pymodule_export]
    use crate::transfer_function::transfer;
    #[pymodule_export]
    use crate::view::{_restore_view, View, render};
    #[pymodule_export]
    use crate::views_file::ViewsFile;

    /// Runs the command line of `semfm-cli`.
    ///
    /// Parameters
    /// ----------
    /// arguments : list of str
    ///     Without the program's name.
    ///
    /// Returns
    /// -------
    /// int
    ///     The exit code.
    #[pyfunction]
    fn run_cli(py: Python<'_>, arguments: Vec<String>) -> PyResult<u8> {
        let words = std::iter::once("semfm-cli".to_owned()).chain(arguments);
        let words: Vec<String> = words.collect();
        crate::interruptible::run(py, None, move |_| Ok(semfm_cli::run(words)))
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::interruptible::silence_panics();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
