//! What an evaluation compares, and how.

use std::collections::BTreeSet;

use semfm::TransferSettings;
use semfm::geom::{ShapeCache, ShapeSettings};

use crate::bootstrap::BootstrapSettings;
use crate::variant::{Override, Variant};
use crate::workers::Workers;
use crate::{Error, Result};

/// What to compare, and how.
#[derive(Clone, Debug)]
pub struct EvalSettings {
    /// The methods, in the order of the tables.
    pub variants: Vec<Variant>,
    /// Settings of theirs that are changed.
    pub overrides: Vec<Override>,
    /// Seed of everything drawn by chance.
    pub seed: u64,
    /// How the machine is shared.
    pub workers: Workers,
    /// Working mesh, Laplacian and basis.
    pub shape: ShapeSettings,
    /// Where prepared shapes are kept.
    pub cache: ShapeCache,
    /// Whether each prediction is written.
    pub keep_predictions: bool,
    /// Whether to forget what an interrupted run left.
    pub fresh: bool,
    /// Name, version or hash of the program, so that another one does not go on with its rows.
    pub program: String,
    /// How intervals are made.
    pub bootstrap: BootstrapSettings,
}

impl Default for EvalSettings {
    fn default() -> Self {
        Self {
            variants: Variant::all(),
            overrides: Vec::new(),
            seed: 0,
            workers: Workers::new(0, 0),
            shape: ShapeSettings::default(),
            cache: ShapeCache::off(),
            keep_predictions: true,
            fresh: false,
            program: env!("CARGO_PKG_VERSION").into(),
            bootstrap: BootstrapSettings::default(),
        }
    }
}

/// A method as it is run.
pub(crate) struct MethodRun {
    pub variant: Variant,
    /// None where nothing is matched.
    pub settings: Option<TransferSettings>,
}

impl EvalSettings {
    /// The methods with their settings, overrides applied.
    pub(crate) fn methods(&self) -> Result<Vec<MethodRun>> {
        let mut seen = BTreeSet::new();
        if self.variants.is_empty() || !self.variants.iter().all(|v| seen.insert(v.name())) {
            let names: Vec<_> = self.variants.iter().map(|v| v.name()).collect();
            return Err(Error::invalid("methods", "at least one, each once", names.join(",")));
        }
        for change in &self.overrides {
            if !self.variants.iter().any(|variant| variant.name() == change.method) {
                let what = format!("setting of {}", change.method);
                return Err(Error::invalid(what, "a method that is evaluated", &change.key));
            }
        }
        self.variants.iter().map(|&variant| self.method(variant)).collect()
    }

    fn method(&self, variant: Variant) -> Result<MethodRun> {
        let mut settings = variant.settings(self.seed);
        if let Some(own) = settings.take() {
            let mut changes = self.overrides.iter();
            settings = Some(changes.try_fold(own, |own, change| change.apply(variant, own))?);
        }
        Ok(MethodRun { variant, settings })
    }
}
