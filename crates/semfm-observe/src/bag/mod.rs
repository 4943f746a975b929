//! Observations in ROS 2 bags (MCAP files): images, compressed images and depths, camera infos, clouds and transforms of
//! `sensor_msgs` and `tf2_msgs`, put together by time.

mod compressed_depth;
mod images;
mod messages;
mod point_cloud;
mod read;
mod rvl;
mod topics;
mod transforms;
mod write;

pub use read::{BagReport, BagSettings, read_bag};
pub(crate) use read::{Choice, read_chosen};
pub use write::write_bag;
