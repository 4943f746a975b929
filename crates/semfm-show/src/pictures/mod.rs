//! Pictures of results: what was transferred where, the features of the surfaces, grasps.

mod canvas;
mod contact_picture;
mod feature_colors;
mod features_picture;
mod grasp_picture;
#[cfg(feature = "mcap")]
mod memory_picture;
mod motion_picture;
mod painted;
mod pair_rotation;
mod photo;
mod rgb_picture;
mod row_pictures;
mod scale_bar;
mod sheet;
mod stroke_font;
mod transfer_figure;
mod transfer_picture;
mod viewpoints;

pub use contact_picture::contact_picture;
pub use grasp_picture::write_grasp_picture;
#[cfg(feature = "mcap")]
pub use memory_picture::write_memory_picture;
pub use motion_picture::{NearMiss, write_miss_picture, write_motion_picture};
pub use photo::{Photo, TintedMask};
pub use rgb_picture::RgbPicture;
pub use sheet::write_sheet;
pub use transfer_figure::TransferFigure;
pub use viewpoints::{Viewpoints, viewpoints};

pub(crate) use grasp_picture::{
    ARROW, ARROW_GAP, ARROW_RADIUS, N_SHOWN, OPACITY, TABLE_REACH, ball_radius,
};
pub(crate) use motion_picture::{lowered, write_motion_picture_of};
pub(crate) use pair_rotation::WeightedMesh;
pub(crate) use semfm::upright::upright;
pub(crate) use transfer_figure::ObjectFigure;
pub(crate) use viewpoints::{PairedViewpoints, Seen, paired_viewpoints, viewpoints_around};
