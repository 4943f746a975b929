//! The methods that transfer a region from one object to another.
//!
//! A method does its work in two steps: what it finds out about a pair ([`Matched`]), once, and how
//! that turns a region on the source into a vote on the target, for each region. To add one, write
//! its file with an `INFO`, name it in [`Method`], and put its row into the table below.

mod anchored;
mod fused;
mod info;
mod nearest;
mod pair;
pub(crate) mod semfm;
mod sinkhorn;
mod votes;
mod wks;

use std::fmt;
use std::str::FromStr;

use semfm_geom::suggestion::unknown_name;

use crate::method::Method;
use crate::{Error, Result};

pub(crate) use self::info::Matched;
pub use self::info::{ConfidenceRule, Lifting, MethodInfo, ViewFeatures};
pub(crate) use self::pair::{ClusteredPair, Pair};
pub(crate) use self::votes::{at_threshold, by_map, mask, on_points};

/// A row of the table is a method and the module of its file.
macro_rules! table_of_methods {
    ($($method:ident: $module:ident,)*) => {
        impl Method {
            /// All methods: the default, the published one, then the others.
            pub const ALL: [Self; [$(stringify!($method)),*].len()] = [$(Self::$method),*];

            /// What the table says of the method.
            pub fn info(self) -> &'static MethodInfo {
                match self {
                    $(Self::$method => &$module::INFO,)*
                }
            }
        }
    };
}

table_of_methods! {
    Fused: fused,
    Semfm: semfm,
    Anchored: anchored,
    Sinkhorn: sinkhorn,
    Nearest: nearest,
    Wks: wks,
}

impl Method {
    /// The name used by files and commands.
    pub fn name(self) -> &'static str {
        self.info().name
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let names = Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|method| method.name() == text);
        let given = || unknown_name(text, Self::ALL.map(Self::name));
        found.map_or_else(|| Error::out_of_range("method", names, given()), Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TransferSettings;

    #[test]
    fn names_are_read_back_and_unknown_ones_refused() {
        for method in Method::ALL {
            assert_eq!(method.name().parse::<Method>().unwrap(), method);
            assert_eq!(serde_json::to_string(&method).unwrap(), format!("\"{method}\""));
            assert_eq!(TransferSettings::of(method).method, method);
            assert!(method.info().summary.len() > 10, "{method}");
        }
        let error = "magic".parse::<Method>().unwrap_err().to_string();
        assert!(error.contains("fused, semfm") && error.contains("magic"), "{error}");
    }

    #[test]
    fn no_two_methods_share_a_colour() {
        let mut colors = Method::ALL.map(|method| method.info().color).to_vec();
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), Method::ALL.len());
    }
}
