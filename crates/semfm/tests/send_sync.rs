//! The public types can be sent to and shared with other threads.

use semfm::files::{
    AlignedFile, AlignedPose, AnchorRanks, GraspsFile, PointMapFile, Provenance, RegionFile,
    TransferReportFile, TransferResult, TransferredRegionFile,
};
use semfm::{
    Error, FeatureSource, GraspProblem, GraspRequest, GraspResult, LiftedCloud, Matching, Obstacle,
    PipelineSettings, PreparationReport, Prepared, PreparedObject, Region, Transfer,
};

fn is_send_and_sync<T: Send + Sync>() {}

#[test]
fn public_types_are_send_and_sync() {
    is_send_and_sync::<Error>();
    is_send_and_sync::<FeatureSource<'_>>();
    is_send_and_sync::<GraspProblem>();
    is_send_and_sync::<GraspRequest>();
    is_send_and_sync::<GraspResult<'_>>();
    is_send_and_sync::<LiftedCloud>();
    is_send_and_sync::<Matching>();
    is_send_and_sync::<Obstacle>();
    is_send_and_sync::<PipelineSettings>();
    is_send_and_sync::<PreparationReport>();
    is_send_and_sync::<Prepared>();
    is_send_and_sync::<PreparedObject>();
    is_send_and_sync::<Region>();
    is_send_and_sync::<Transfer>();
    is_send_and_sync::<AlignedFile>();
    is_send_and_sync::<AlignedPose>();
    is_send_and_sync::<AnchorRanks>();
    is_send_and_sync::<GraspsFile>();
    is_send_and_sync::<PointMapFile>();
    is_send_and_sync::<Provenance>();
    is_send_and_sync::<RegionFile>();
    is_send_and_sync::<TransferReportFile>();
    is_send_and_sync::<TransferResult<'_>>();
    is_send_and_sync::<TransferredRegionFile>();
}

#[cfg(feature = "mcap")]
#[test]
fn types_of_the_encoder_are_send_and_sync() {
    is_send_and_sync::<semfm::object_encoder::ObjectEncoder>();
    is_send_and_sync::<semfm::object_encoder::EncodedObject>();
}
