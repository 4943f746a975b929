//! What is shared between threads can be.

use semfm_fmap::transport::Plan;
use semfm_fmap::{
    Anchors, Error, FunctionalMap, Matching, PointMap, PreparedObject, Region, Transfer,
    TransferSettings,
};

#[test]
fn public_types_are_send_and_sync() {
    fn check<T: Send + Sync>() {}
    check::<PreparedObject>();
    check::<Matching>();
    check::<Transfer>();
    check::<TransferSettings>();
    check::<Region>();
    check::<Anchors>();
    check::<FunctionalMap>();
    check::<PointMap>();
    check::<Plan>();
    check::<Error>();
}
