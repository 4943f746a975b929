//! Procedural objects of the paper's six categories and a simulated patch encoder.
//!
//! SemFM is measured on real meshes with a real encoder; this crate is what ships with it, so that
//! a demonstration, the tests and the synthetic evaluation need no download: `object` builds a
//! closed mesh with part labels and its true grip region from signed distances, `encoder` stands
//! in for a vision transformer and gives ordinary patch embeddings, `files` writes both as an
//! evaluation reads them, `arm` is a robot arm as URDF text, `hand` a hand that holds an object, `rgbd` what a depth
//! camera sees, `demonstration` pictures of such a hand. Nothing here knows how the
//! matching works, and whatever it writes says that it is simulated.

mod arm;
mod change;
mod demonstration;
mod encoder;
mod error;
mod files;
mod hand;
mod object;
mod rgbd;
mod sdf;
mod seed;
mod shapes;

use std::fmt;
use std::str::FromStr;

use semfm_geom::suggestion::unknown_name;

pub use arm::{ARM_FLANGE, ARM_HOME, ARM_NAME, arm_urdf};
pub use change::{Change, ChangedCopy};
pub use demonstration::{DemonstrationPictures, StandingObject, write_demonstration_pictures};
pub use encoder::{Level, embed};
pub use error::{Error, Result};
pub use files::{ObjectFiles, render_views, write_labelled_mesh, write_object};
pub use hand::{CapsuleHand, close_hand};
pub use object::{ObjectSettings, SynthObject, make_object};
pub use rgbd::{Body, RgbdPicture};

/// The six categories of the paper (section V-A).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Category {
    /// Tools with handles: hammers, pickaxes, wrenches.
    Tools,
    /// Shoes: sneakers, sandals, heels.
    Shoes,
    /// Cutting tools: knives, saws.
    Cutting,
    /// Water containers with a handle: cups, kettles, bottles.
    Containers,
    /// Controllers: game pads, remotes.
    Controllers,
    /// Scissor-type tools: scissors, shears, cutters.
    Scissors,
}

impl Category {
    /// All six, in the paper's order.
    pub const ALL: [Self; 6] = [
        Self::Tools,
        Self::Shoes,
        Self::Cutting,
        Self::Containers,
        Self::Controllers,
        Self::Scissors,
    ];

    /// The name used at the shell and in folders.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tools => "tools",
            Self::Shoes => "shoes",
            Self::Cutting => "cutting",
            Self::Containers => "containers",
            Self::Controllers => "controllers",
            Self::Scissors => "scissors",
        }
    }
}

impl fmt::Display for Category {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Category {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|category| category.name() == text).ok_or_else(|| {
            Error::Unknown {
                what: "category",
                expected: Self::ALL.map(Self::name).join(", "),
                found: unknown_name(text, Self::ALL.map(Self::name)),
            }
        })
    }
}
