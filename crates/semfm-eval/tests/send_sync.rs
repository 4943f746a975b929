//! Public types go between threads and are shared by them.

use semfm_eval::bootstrap::{BootstrapSettings, PairDraws};
use semfm_eval::calibration::Calibration;
use semfm_eval::compare::Comparison;
use semfm_eval::embeddings::{Embedded, EmbeddingSource};
use semfm_eval::row::{ObjectRow, Row};
use semfm_eval::summary::{Difference, Scope, ScoreTable, Summary};
use semfm_eval::workers::Workers;
use semfm_eval::{
    CorrespondenceDataset, Dataset, Error, EvalSettings, Finished, MapMethod, MapResults,
    MapSettings, Override, ReportSettings, Results, Variant,
};

fn assert_send_sync<T: Send + Sync>() {}

#[test]
fn public_types_are_send_and_sync() {
    assert_send_sync::<(BootstrapSettings, PairDraws, Calibration, Comparison)>();
    assert_send_sync::<(Embedded, EmbeddingSource<'_>, ObjectRow, Row)>();
    assert_send_sync::<(Difference, Scope, ScoreTable<'_>, Summary, Workers)>();
    assert_send_sync::<(CorrespondenceDataset, MapMethod, MapResults, MapSettings)>();
    assert_send_sync::<(Dataset, EvalSettings, Finished, Override, Variant)>();
    assert_send_sync::<(Error, ReportSettings, Results)>();
}
