//! Calls of a runtime that may panic.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Work of the runtime: its errors in words, and its panics as errors. A network is a program of
/// somebody else, and the runtime takes some of what it says on trust.
pub(super) fn guarded<T, E: fmt::Display>(
    work: impl FnOnce() -> Result<T, E>,
) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result.map_err(|error| error.to_string()),
        Err(panic) => {
            let words = panic
                .downcast_ref::<String>()
                .map(String::as_str)
                .or_else(|| panic.downcast_ref::<&str>().copied());
            Err(format!("the runtime failed: {}", words.unwrap_or("without a reason")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error() {
        let error = guarded(|| -> Result<(), String> { panic!("number {}", 7) }).unwrap_err();
        assert_eq!(error, "the runtime failed: number 7");
    }
}
