//! `TransferSettings`: everything that can be set about a transfer, by name.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::{Method, PipelineSettings, fmap};
use serde_json::Value;

use crate::anchors::MOST;
use crate::interruptible::guard;
use crate::shape::cache_of;
use crate::{errors, json};

/// Everything that can be set about a transfer: a method's own constants, and what differs.
///
/// Parameters
/// ----------
/// method : str, default "fused"
///     ``fused``, ``semfm`` (the paper to the letter), ``anchored``, ``sinkhorn``, ``nearest`` or
///     ``wks``.
/// **changes : object
///     Settings by their names in `to_dict`, groups as dicts: ``zoomout={"k_final": 40}``.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> settings = semfm.TransferSettings("fused", zoomout={"k_final": 40}, n_anchors=3)
/// >>> settings.zoomout["k_final"], settings.zoomout["step"], settings.n_anchors
/// (40, 5, 3)
#[pyclass(frozen, module = "semfm")]
#[derive(Clone)]
pub struct TransferSettings {
    pub settings: fmap::TransferSettings,
}

#[pymethods]
impl TransferSettings {
    #[new]
    #[pyo3(signature = (method="fused", **changes))]
    fn new(py: Python<'_>, method: &str, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let method: Method = guard(py, || Ok(method.parse()?))?;
        let settings = fmap::TransferSettings::of(method);
        let Some(changes) = changes else { return Ok(Self { settings }) };
        let changes = json::from_python(changes, "changes")?;
        let mut value = serde_json::to_value(settings).unwrap_or_default();
        merge(py, &mut value, changes, "")?;
        let settings = serde_json::from_value(value).map_err(|error| {
            errors::invalid(
                py,
                "changes",
                "the types of the method's own settings",
                &error.to_string(),
            )
        })?;
        Ok(Self { settings })
    }

    /// All settings by name, groups as dicts.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.settings)
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let all = self.to_dict(py)?;
        let all = all.cast::<PyDict>()?;
        all.get_item(name)?.ok_or_else(|| {
            errors::unknown_attribute(py, &format!("TransferSettings has no `{name}`"), name)
        })
    }

    fn __repr__(&self) -> String {
        format!("TransferSettings({:?}, …)", self.settings.method.name())
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().settings == self.settings)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyAny>,))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_settings")?;
        Ok((restore, (self.to_dict(py)?,)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Settings out of a pickle.
#[pyfunction]
pub fn _restore_settings(settings: &Bound<'_, PyDict>) -> PyResult<TransferSettings> {
    let py = settings.py();
    let method = settings.get_item("method")?;
    let method =
        method.ok_or_else(|| errors::invalid_type(py, "settings", "a method", "a dict without"))?;
    let method: String = method.extract()?;
    TransferSettings::new(py, &method, Some(settings))
}

/// Puts `changes` into `value`, group by group; every name must be there already.
fn merge(py: Python<'_>, value: &mut Value, changes: Value, place: &str) -> PyResult<()> {
    let Value::Object(changes) = changes else {
        let found = changes.to_string();
        return Err(errors::invalid(py, place, "a dict of settings", &found));
    };
    let Value::Object(value) = value else { return Ok(()) };
    for (name, change) in changes {
        let path = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
        let known = value.keys().cloned().collect::<Vec<_>>().join(", ");
        let Some(slot) = value.get_mut(&name) else {
            let expected = format!("one of {known}");
            return Err(errors::invalid_type(py, &path, &expected, "no such setting"));
        };
        if change.as_u64().is_some_and(|count| count > MOST) && name != "seed" {
            let found = change.to_string();
            return Err(errors::invalid(py, &path, &format!("at most {MOST}"), &found));
        }
        if slot.is_object() {
            merge(py, slot, change, &path)?;
        } else {
            *slot = change;
        }
    }
    Ok(())
}

/// The options that the functions around a transfer have in common.
pub struct Options<'a, 'py> {
    pub method: Option<&'a str>,
    pub rule: Option<&'a str>,
    pub seed: Option<u64>,
    pub second_opinion: Option<bool>,
    pub settings: Option<&'a Bound<'py, TransferSettings>>,
    pub k: Option<usize>,
    pub working_vertices: Option<usize>,
    pub cache: Option<&'a Bound<'py, PyAny>>,
}

impl Options<'_, '_> {
    /// The settings of the whole pipeline, put together as the shell does.
    pub fn pipeline(&self, py: Python<'_>) -> PyResult<PipelineSettings> {
        let given = self.settings.map(|settings| settings.get().settings.clone());
        if given.is_some() && (self.method.is_some() || self.rule.is_some()) {
            let expected = "either settings, or method and rule";
            return Err(errors::invalid(py, "settings", expected, "both"));
        }
        let method = match &given {
            Some(settings) => settings.method,
            None => guard(py, || Ok(self.method.unwrap_or("fused").parse()?))?,
        };
        let seed = self.seed.unwrap_or(given.as_ref().map_or(0, |given| given.clusters.seed));
        let mut settings = PipelineSettings::of(method);
        if let Some(given) = given {
            settings.transfer = given;
        }
        if let Some(wanted) = self.second_opinion {
            settings.transfer.second_opinion = wanted;
        }
        if let Some(rule) = self.rule {
            settings.transfer.rule = guard(py, || Ok(rule.parse()?))?;
        }
        if let Some(n) = self.working_vertices {
            settings.shape.working_vertices = n;
        }
        if let Some(k) = self.k {
            (settings.shape.k, settings.shape.clip_k) = (k, false);
        }
        settings.cache = cache_of(self.cache)?;
        Ok(settings.with_seed(seed))
    }
}
