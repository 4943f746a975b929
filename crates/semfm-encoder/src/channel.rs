//! What a network sees of a picture, by pixel.

use semfm_views::View;
use serde::{Deserialize, Serialize};

/// A channel of a network's input. A new one is a row here and a match arm in
/// [`values`](Channel::values); one that has a direction must turn it with the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Channel {
    /// Brightness from 0 to 1: (.299 R + .587 G + .114 B)/255 of the sRGB bytes (ITU-R BT.601).
    Grey,
}

impl Channel {
    /// The channel's values (height × width) of a view, row-major.
    pub fn values(self, view: &View) -> Vec<f32> {
        match self {
            Self::Grey => view.rgb.as_chunks::<3>().0.iter().map(|&rgb| grey(rgb)).collect(),
        }
    }
}

fn grey([r, g, b]: [u8; 3]) -> f32 {
    (0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b)) / 255.0
}
