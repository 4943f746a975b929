//! The Python package: arrays in, facade calls, arrays out.

use pyo3::prelude::*;

/// The compiled half of `semfm`.
#[pymodule]
mod _semfm {
    use super::*;

    /// Runs the command line of `semfm-cli`, arguments without the program's name; the exit code.
    #[pyfunction]
    fn run_cli(py: Python<'_>, arguments: Vec<String>) -> u8 {
        py.detach(|| semfm_cli::run(std::iter::once("semfm-cli".to_owned()).chain(arguments)))
    }
}
