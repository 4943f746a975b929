//! Whatever the crate hands out may be shared between threads.

use semfm_synth::{Category, Error, Level, ObjectFiles, ObjectSettings, SynthObject};

fn is_send_and_sync<T: Send + Sync>() {}

#[test]
fn public_types_are_send_and_sync() {
    is_send_and_sync::<(Category, Error, Level, ObjectFiles, ObjectSettings, SynthObject)>();
}
