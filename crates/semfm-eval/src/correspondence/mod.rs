//! Point maps against true correspondences: the functional-map half beside other libraries.
//!
//! A dataset is a folder of sets; a set is a folder of `NAME.npz` (`V` vertices, `F` triangles, `gt`
//! the vertex at each sample of a template, perhaps `gt_sym` the one at its mirror image) and
//! `pairs.txt`, one "source target" a line. [`run_maps`] makes a map target → source of every pair by
//! every [`MapMethod`] and measures it; [`crate::report::write_maps`] writes the results.

mod annotated_shape;
mod dataset;
mod geodesic_error;
mod map_method;
mod results;
mod run;
mod table;

pub use annotated_shape::AnnotatedMesh;
pub use dataset::{CorrespondenceDataset, CorrespondenceSet};
pub use map_method::MapMethod;
pub use results::{MAP_FORMAT, MapResults, MapRow, MapSummary};
pub use run::{MapSettings, run_maps};
pub(crate) use table::{PYFM, interval, one_digit, percent, whole};
