//! Functions on the vertices that describe a place: heat and wave kernels, diffused indicators.

use faer::Mat;
use pyo3::prelude::*;
use semfm::fmap::descriptors::{DescriptorNorm, Indicators, diffused_indicators as indicate};
use semfm::geom;
use semfm::geom::descriptors::{self, HksSettings, WksSettings};

use crate::arrays_in::{self, Axis, within_memory};
use crate::eigenbasis::Eigenbasis;
use crate::interruptible::run;
use crate::{arrays_out, errors};

/// Heat kernel signature (Sun, Ovsjanikov & Guibas 2009): heat left at each vertex after each time.
///
/// Parameters
/// ----------
/// basis : Eigenbasis
/// n_times : int, default 100
///     Times, spread evenly in logarithm over the range that the basis resolves.
///
/// Returns
/// -------
/// (n, n_times) float64 array
#[pyfunction]
#[pyo3(signature = (basis, *, n_times=100))]
pub fn hks<'py>(basis: &Bound<'py, Eigenbasis>, n_times: usize) -> PyResult<Bound<'py, PyAny>> {
    let settings = HksSettings { n_times };
    signature(basis, "n_times", n_times, move |basis| descriptors::hks(basis, &settings))
}

/// Wave kernel signature (Aubry, Schlickewei & Cremers 2011), with pyFM's energies and width.
///
/// Parameters
/// ----------
/// basis : Eigenbasis
/// n_energies : int, default 100
///     Energies, spread evenly over the logarithms of the eigenvalues.
///
/// Returns
/// -------
/// (n, n_energies) float64 array
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> shape = semfm.Shape(semfm.zoo.torus(20, 10), k=15)
/// >>> semfm.wks(shape.basis, n_energies=30).shape
/// (200, 30)
#[pyfunction]
#[pyo3(signature = (basis, *, n_energies=100))]
pub fn wks<'py>(basis: &Bound<'py, Eigenbasis>, n_energies: usize) -> PyResult<Bound<'py, PyAny>> {
    let settings = WksSettings { n_energies };
    signature(basis, "n_energies", n_energies, move |basis| descriptors::wks(basis, &settings))
}

fn signature<'py>(
    basis: &Bound<'py, Eigenbasis>,
    name: &str,
    count: usize,
    describe: impl FnOnce(&geom::Eigenbasis) -> geom::Result<Mat<f64>> + Send + 'static,
) -> PyResult<Bound<'py, PyAny>> {
    let py = basis.py();
    let basis = basis.get().inner.clone();
    within_memory(py, name, count, basis.n_vertices())?;
    let result = run(py, None, move |_| Ok(describe(&basis)?))?;
    arrays_out::owned_matrix(py, result.as_ref())
}

/// Coefficients of the indicator functions of labels, diffused by heat and scaled to unit norm.
///
/// Parameters
/// ----------
/// basis : Eigenbasis
/// labels : (n,) array_like
///     A label (an id) per vertex.
/// chosen : (c,) array_like
///     The labels whose indicators are wanted.
/// t : float, default 0.005
///     Heat time, relative to area 1.
/// norm : str, default "surface"
///     ``"surface"`` (∫ f² = 1) or ``"vertices"`` (Σ f² = 1, the letter of the paper).
///
/// Returns
/// -------
/// (k, c) float64 array
///     One column per chosen label; zeros for a label that no vertex bears.
#[pyfunction]
#[pyo3(signature = (basis, labels, chosen, *, t=0.005, norm="surface"))]
pub fn diffused_indicators<'py>(
    basis: &Bound<'py, Eigenbasis>,
    labels: &Bound<'py, PyAny>,
    chosen: &Bound<'py, PyAny>,
    t: f64,
    norm: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let py = basis.py();
    let rows = basis.get().rows();
    let basis = basis.get().inner.clone();
    let labels = arrays_in::ids(labels, "labels", &[rows])?.0;
    let chosen = arrays_in::ids(chosen, "chosen", &[Axis::Any("c")])?.0;
    let norm = match norm {
        "surface" => DescriptorNorm::Surface,
        "vertices" => DescriptorNorm::Vertices,
        other => {
            let found = format!("{other:?}");
            return Err(errors::invalid(py, "norm", "'surface' or 'vertices'", &found));
        }
    };
    if !(t >= 0.0 && t.is_finite()) {
        return Err(errors::invalid(py, "t", "a time of at least 0", &t.to_string()));
    }
    let result = run(py, None, move |_| {
        let indicators = Indicators { heat_time: t, norm, k: basis.k() };
        Ok(indicate(&basis, &labels, &chosen, &indicators))
    })?;
    arrays_out::owned_matrix(py, result.as_ref())
}
