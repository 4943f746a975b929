//! What to do with an answer: a transferred region, an aligned pose.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// What to do with an answer. Where the limits lie is up to the algorithm that gives it.
///
/// Written `accept`, `check` or `refuse`, in JSON as in text.
///
/// ```
/// use semfm_geom::Verdict;
/// assert_eq!("check".parse::<Verdict>()?, Verdict::Check);
/// assert_eq!(Verdict::Refuse.to_string(), "refuse");
/// # Ok::<(), semfm_geom::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Use it.
    Accept,
    /// Let somebody look at it.
    Check,
    /// There is no answer worth using.
    Refuse,
}

impl Verdict {
    /// All verdicts, from the best to the worst.
    pub const ALL: [Self; 3] = [Self::Accept, Self::Check, Self::Refuse];

    /// The word for it in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accept => "accept",
            Self::Check => "check",
            Self::Refuse => "refuse",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Verdict {
    type Err = Error;

    /// # Errors
    /// [`Error::OutOfRange`] for another word.
    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|verdict| verdict.name() == text).ok_or_else(|| {
            let expected = "accept, check or refuse".into();
            Error::OutOfRange { what: "verdict", expected, found: format!("`{text}`") }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_json_say_the_same_word() {
        for verdict in Verdict::ALL {
            assert_eq!(verdict.to_string().parse::<Verdict>().unwrap(), verdict);
            assert_eq!(serde_json::to_string(&verdict).unwrap(), format!("\"{verdict}\""));
        }
        assert!("Accept".parse::<Verdict>().is_err());
    }
}
