//! What to do with a pose.

use serde::{Deserialize, Serialize};

use crate::Alignment;

/// Visibility from which on a pose is accepted, and below which it is refused. Right poses of 52
/// single views of 26 objects, without and with a fifth of clutter, have .977 and more; models forced
/// to hide in a patch or to stick out have little.
const VISIBILITY: [f64; 2] = [0.75, 0.5];

/// The same for the share of the observed points that lie on the model: in those views .79 and more
/// without clutter, .61 and more where a fifth of the points belongs to nothing.
const INLIERS: [f64; 2] = [0.6, 0.3];

/// Relative standard deviation of the scale up to which a grasp's opening can rely on it.
const SCALE_STD: f64 = 0.015;

/// Standard deviation of the rotation, in radians, beyond which an axis counts as not determined.
const ROTATION_STD: f64 = 0.05;

/// Another pose that explains this share of what the best one does is a rival.
pub(crate) const RIVAL: f64 = 0.97;

/// What to do with the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Use it.
    Accept,
    /// Let somebody look at it.
    Check,
    /// It explains too little of what was seen, or shows what was not there.
    Refuse,
}

/// So many weak directions are left by a flat face: its outline alone tells the rest.
const FLAT: usize = 3;

/// The verdict on an alignment, and the reasons against accepting it. `n_weak` directions were
/// settled by the outline; the scale may stand at the border of its range.
pub(crate) fn judge(a: &Alignment, n_weak: usize, at_bound: bool) -> (Verdict, Vec<String>) {
    let (mut refuse, mut check) = (Vec::new(), Vec::new());
    for (name, value, [accepted, refused]) in [
        ("of the model's visible side was seen", a.visibility, VISIBILITY),
        ("of the observed points lie on the model", a.inlier_share, INLIERS),
    ] {
        let text = |least: f64| {
            format!("{:.0} % {name}, expected at least {:.0} %", 100.0 * value, 100.0 * least)
        };
        // NaN is no share.
        if value.is_nan() || value < refused {
            refuse.push(text(refused));
        } else if value < accepted {
            check.push(text(accepted));
        }
    }
    let relative = a.scale_std / a.camera_from_object.scale;
    if relative.is_nan() || relative > SCALE_STD {
        check.push(format!("the scale is known to ±{:.1} % only", 100.0 * relative));
    }
    if a.rotation_std.is_nan() || a.rotation_std > ROTATION_STD {
        let degrees = a.rotation_std.to_degrees();
        check.push(if degrees > 50.0 {
            "the rotation about some axis is not determined by what was seen".into()
        } else {
            format!("the rotation about some axis is known to ±{degrees:.0}° only")
        });
    }
    if n_weak >= FLAT {
        check.push(
            "what was seen is flat or nearly so: only its outline tells place and scale".into(),
        );
    }
    if a.rival > RIVAL {
        check.push("another pose explains as much".into());
    }
    if at_bound {
        check.push("the scale stands at the border of its allowed range".into());
    }
    let verdict = match (refuse.is_empty(), check.is_empty()) {
        (false, _) => Verdict::Refuse,
        (true, false) => Verdict::Check,
        (true, true) => Verdict::Accept,
    };
    refuse.extend(check);
    (verdict, refuse)
}
