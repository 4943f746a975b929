//! What cameras and hands leave behind, brought into one form.
//!
//! * **Observations**: colour, depth, masks, camera and pose of one moment ([`Observation`]), from single files
//!   ([`ObservationFiles`]), from folders of the BOP benchmark ([`BopScene`], [`write_bop`])
//!   and, with the feature `mcap`, from bags of ROS 2 (`read_bag`, `write_bag`).
//!   [`check_registration`] tells which camera a depth image belongs to.
//! * **Surfaces**: what a depth image shows as a mesh ([`Observation::surface`]; several: [`merged_surface`]), what lies beside it
//!   ([`Observation::surroundings`]) and what may lie behind it ([`unseen_side`]).
//! * **Hands**: what pose estimators reconstruct ([`read_hand`]), brought to its measured depth
//!   ([`Hand::at_measured_depth`]), and where it touches ([`find_contact`]).
//! * **Files of other programs**: depth images, masks, calibrations and NumPy's arrays, each with one reader.

#[cfg(feature = "mcap")]
mod bag;
mod bop;
mod coco_rle;
mod depth_filter;
mod depth_image;
mod distortion;
mod error;
mod exr_picture;
mod hand;
mod intrinsics;
mod mask;
mod merged_surface;
mod npz;
mod numpy_array;
mod observation;
mod observation_files;
mod picture;
mod registration;
#[cfg(feature = "mcap")]
mod source;
mod surface;
mod surroundings;
mod unseen;

#[cfg(feature = "mcap")]
pub use bag::{BagReport, BagSettings, read_bag, write_bag};
pub use bop::{BopModel, BopScene, read_bop_models, write_bop};
pub use depth_image::{depth_of_numbers, read_depth_image};
pub use distortion::Distortion;
pub use error::{Error, Result};
#[cfg(any(test, feature = "test-files"))]
pub use exr_picture::write_exr;
pub use hand::{
    Contact, ContactFrameRecord, ContactPartRecord, ContactReport, ContactSettings, Hand,
    HandFiles, HandFrame, HandPart, HandShift, PartContact, find_contact, merge_contacts,
    read_hand, read_vertex_ids,
};
pub use intrinsics::{Calibration, read_calibration, read_intrinsics};
pub use mask::{MaskedPicture, read_labelled_mask, read_mask};
pub use merged_surface::{MaskedFrame, MergedSurface, merged_surface};
pub use npz::NumpyArchive;
#[cfg(any(test, feature = "test-files"))]
pub use npz::testing;
pub use numpy_array::{Numbers, NumpyArray};
pub use observation::{Mask, Observation, SeenObject};
pub use observation_files::{MaskFile, ObservationFiles};
pub use registration::{DepthGrid, RegistrationCheck, check_registration, registration_doubt};
#[cfg(feature = "mcap")]
pub use source::{SourceReport, SourceSettings, read_observations, write_observations};
pub use surface::{ObservedSurface, SurfaceReport, SurfaceSettings};
pub use surroundings::merged_surroundings;
pub use unseen::{UnseenSettings, unseen_side};
