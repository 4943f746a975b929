//! Folders in the form of the BOP benchmark (Hodaň et al., *BOP: Benchmark for 6D Object Pose Estimation*, 2018;
//! `bop_toolkit/docs/bop_datasets_format.md`): lengths in millimetres, rotations row by row, pixel centres at whole
//! coordinates.
//!
//! ```text
//! SCENE/scene_camera.json      {"0": {"cam_K": [9], "depth_scale": 0.1, "cam_R_w2c": [9], "cam_t_w2c": [3]}}
//! SCENE/scene_gt.json          {"0": [{"obj_id": 5, "cam_R_m2c": [9], "cam_t_m2c": [3]}]}
//! SCENE/rgb/000000.png         or .jpg; gray/ where there is no colour
//! SCENE/depth/000000.png       16 bits; times depth_scale they are millimetres
//! SCENE/mask_visib/000000_000000.png   image, then which of its objects
//! ```

mod models;
mod records;
mod scene;
mod write;

pub use models::{BopModel, read_bop_models};
pub use scene::BopScene;
pub use write::write_bop;

/// Millimetres to the metre.
const MM: f64 = 1000.0;
