//! How long each stage of a transfer took.

use std::borrow::Cow;
use std::fmt;
use std::time::{Duration, Instant};

use serde::de::{MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize};

/// Wall time per stage in milliseconds, in the order in which the stages ran; a JSON object by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stages(Vec<(Cow<'static, str>, f64)>);

impl Stages {
    /// Name and milliseconds of each stage.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(stage, ms)| (&**stage, *ms))
    }

    /// Milliseconds in all.
    pub fn total_ms(&self) -> f64 {
        self.0.iter().map(|stage| stage.1).sum()
    }

    /// Adds a stage after the others.
    pub fn push(&mut self, stage: impl Into<Cow<'static, str>>, ms: f64) {
        self.0.push((stage.into(), ms));
    }

    /// Runs `work` and books its time under `stage`.
    pub(crate) fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.put(stage, start.elapsed());
        result
    }

    /// Books time under `stage`, adding to what is there.
    fn put(&mut self, stage: &'static str, time: Duration) {
        let ms = time.as_secs_f64() * 1e3;
        match self.0.iter_mut().find(|entry| entry.0 == stage) {
            Some(entry) => entry.1 += ms,
            None => self.0.push((Cow::Borrowed(stage), ms)),
        }
    }
}

impl Serialize for Stages {
    fn serialize<S: serde::Serializer>(
        &self,
        serializer: S,
    ) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (stage, ms) in &self.0 {
            map.serialize_entry(stage, ms)?;
        }
        map.end()
    }
}

/// Reads the names in the order of the file.
impl<'de> Deserialize<'de> for Stages {
    fn deserialize<D: serde::Deserializer<'de>>(
        deserializer: D,
    ) -> std::result::Result<Self, D::Error> {
        struct InOrder;
        impl<'de> Visitor<'de> for InOrder {
            type Value = Stages;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("milliseconds by stage")
            }

            fn visit_map<A: MapAccess<'de>>(
                self,
                mut map: A,
            ) -> std::result::Result<Stages, A::Error> {
                let mut stages = Vec::new();
                while let Some((name, ms)) = map.next_entry::<String, f64>()? {
                    stages.push((Cow::Owned(name), ms));
                }
                Ok(Stages(stages))
            }
        }
        deserializer.deserialize_map(InOrder)
    }
}
