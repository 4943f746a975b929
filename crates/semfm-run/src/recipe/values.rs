//! Values of a recipe that may be told in two ways.

use std::fmt;
use std::path::PathBuf;

use serde::de::{SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

/// A pose: numbers, or a file with a 4 × 4 matrix.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PoseValue {
    /// 6 or 7 numbers, as [`pose_of_numbers`](semfm::pose_of_numbers) reads them.
    Numbers(Vec<f64>),
    /// A file, as [`read_rigid_pose`](semfm::files::read_rigid_pose) reads it.
    File(PathBuf),
}

/// Where a motion starts.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum StartValue {
    /// Joint values, base to tip.
    Joints(Vec<f64>),
    /// A state of the SRDF.
    State(String),
}

/// The top of a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableValue {
    /// A point of it, metres.
    pub point: [f64; 3],
    /// Away from it.
    pub normal: [f64; 3],
}

/// A list of numbers or a text.
enum NumbersOrText {
    Numbers(Vec<f64>),
    Text(String),
}

/// Reads one, with words of its own for what is neither.
struct NumbersOrTextVisitor {
    expected: &'static str,
}

impl<'de> Visitor<'de> for NumbersOrTextVisitor {
    type Value = NumbersOrText;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_str<E>(self, text: &str) -> Result<NumbersOrText, E> {
        Ok(NumbersOrText::Text(text.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<NumbersOrText, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(seq)).map(NumbersOrText::Numbers)
    }
}

impl<'de> Deserialize<'de> for PoseValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "6 or 7 numbers, or the name of a file";
        Ok(match deserializer.deserialize_any(NumbersOrTextVisitor { expected })? {
            NumbersOrText::Numbers(numbers) => Self::Numbers(numbers),
            NumbersOrText::Text(file) => Self::File(file.into()),
        })
    }
}

impl<'de> Deserialize<'de> for StartValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "joint values, or the name of a state";
        Ok(match deserializer.deserialize_any(NumbersOrTextVisitor { expected })? {
            NumbersOrText::Numbers(numbers) => Self::Joints(numbers),
            NumbersOrText::Text(name) => Self::State(name),
        })
    }
}
