//! Public types go between threads and are shared by them.

use semfm_eval::compare::Comparison;
use semfm_eval::embeddings::Embedded;
use semfm_eval::workers::Workers;
use semfm_eval::{
    BootstrapSettings, Calibration, CorrespondenceDataset, Dataset, Difference, EmbeddingSource,
    Error, EvalSettings, Finished, MapMethod, MapResults, MapSettings, ObjectRow, Override,
    PairDraws, ReportSettings, Results, Row, Scope, ScoreTable, Summary, Variant,
};

fn assert_send_sync<T: Send + Sync>() {}

#[test]
fn public_types_are_send_and_sync() {
    assert_send_sync::<(BootstrapSettings, PairDraws, Calibration, Comparison)>();
    assert_send_sync::<(Embedded, EmbeddingSource, ObjectRow, Row)>();
    assert_send_sync::<(Difference, Scope, ScoreTable<'_>, Summary, Workers)>();
    assert_send_sync::<(CorrespondenceDataset, MapMethod, MapResults, MapSettings)>();
    assert_send_sync::<(Dataset, EvalSettings, Finished, Override, Variant)>();
    assert_send_sync::<(Error, ReportSettings, Results)>();
}
