//! The verdict on a pose, and the reasons for it.

use semfm_geom::Verdict;

use crate::alignment::Alignment;

/// A share that a pose should have: accepted from the first number on, refused below the second.
struct Threshold {
    name: &'static str,
    accepted: f64,
    refused: f64,
}

/// Right poses of 52 single views of 26 objects, without and with a fifth of clutter, have .977 and
/// more; models forced to hide in a patch or to stick out have little.
const VISIBILITY: Threshold =
    Threshold { name: "of the model's visible side was seen", accepted: 0.75, refused: 0.5 };

/// In those views .79 and more without clutter, .61 and more where a fifth of the points belongs to
/// nothing.
const INLIERS: Threshold =
    Threshold { name: "of the observed points lie on the model", accepted: 0.6, refused: 0.3 };

/// Relative standard deviation of the scale up to which a grasp's opening can rely on it.
const SCALE_STD: f64 = 0.015;

/// Standard deviation of the rotation, in radians, beyond which an axis counts as not determined: a
/// handle 7 cm away from it is then off by 2 mm, and seldom by 5.
const ROTATION_STD: f64 = 0.03;

/// In degrees, beyond which a number says no more than that nothing is known.
const NOT_DETERMINED: f64 = 50.0;

/// So many weak directions are left by a flat face: its outline alone tells the rest.
const FLAT: usize = 3;

/// What to do with a pose.
pub(crate) struct Judgement {
    pub verdict: Verdict,
    /// What speaks against accepting it, in words, the gravest first.
    pub reasons: Vec<String>,
}

/// Judges an alignment. `n_weak` directions were determined by the outline alone; the scale may
/// stand at the border of its range.
pub(crate) fn judge(found: &Alignment, n_weak: usize, at_border: bool) -> Judgement {
    let (mut refuse, mut check) = (Vec::new(), Vec::new());
    for (value, threshold) in [(found.visibility, VISIBILITY), (found.inlier_share, INLIERS)] {
        // NaN is no share.
        if value.is_nan() || value < threshold.refused {
            refuse.push(threshold.missed(value, threshold.refused));
        } else if value < threshold.accepted {
            check.push(threshold.missed(value, threshold.accepted));
        }
    }
    let relative = found.scale_std / found.camera_from_object.scale;
    if relative.is_nan() || relative > SCALE_STD {
        check.push(format!("the scale is known to ±{:.1} % only", 100.0 * relative));
    }
    if !found.undetermined.is_empty() {
        check.extend(found.undetermined.iter().map(ToString::to_string));
    } else if found.rotation_std.is_nan() || found.rotation_std > ROTATION_STD {
        let degrees = found.rotation_std.to_degrees();
        check.push(if degrees > NOT_DETERMINED {
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
    if found.undetermined.is_empty() && !found.alternatives.is_empty() {
        check.push("another pose explains as much".into());
    }
    if at_border {
        check.push("the scale stands at the border of its allowed range".into());
    }
    let verdict = match (refuse.is_empty(), check.is_empty()) {
        (false, _) => Verdict::Refuse,
        (true, false) => Verdict::Check,
        (true, true) => Verdict::Accept,
    };
    refuse.extend(check);
    Judgement { verdict, reasons: refuse }
}

impl Threshold {
    fn missed(&self, value: f64, least: f64) -> String {
        let (value, least) = (100.0 * value, 100.0 * least);
        format!("{value:.0} % {}, expected at least {least:.0} %", self.name)
    }
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DVec3;

    use super::*;
    use crate::ambiguity::UndeterminedAxis;
    use crate::sim3::Sim3;

    fn good() -> Alignment {
        Alignment {
            camera_from_object: Sim3::IDENTITY,
            scale_std: 0.001,
            rotation_std: 0.001,
            position_std: 0.001,
            residual_m: 0.001,
            inlier_share: 0.95,
            visibility: 0.98,
            rival: 0.3,
            undetermined: Vec::new(),
            alternatives: Vec::new(),
            n_starts: 400,
            iterations: 5,
            verdict: Verdict::Refuse,
            reasons: Vec::new(),
            stages_ms: Vec::new(),
        }
    }

    #[test]
    fn each_weakness_is_named_and_the_gravest_decides() {
        assert_eq!(judge(&good(), 0, false).verdict, Verdict::Accept);
        let open = UndeterminedAxis { axis: DVec3::Z, turns: vec![[-0.5, 1.0]] };
        for (found, n_weak, verdict, word) in [
            (Alignment { visibility: 0.7, ..good() }, 0, Verdict::Check, "70 % of the model's"),
            (Alignment { visibility: f64::NAN, ..good() }, 0, Verdict::Refuse, "visible side"),
            (Alignment { inlier_share: 0.2, ..good() }, 0, Verdict::Refuse, "at least 30 %"),
            (Alignment { scale_std: 0.02, ..good() }, 0, Verdict::Check, "±2.0 %"),
            (Alignment { rotation_std: 3.0, ..good() }, 0, Verdict::Check, "not determined"),
            (
                Alignment { alternatives: vec![Sim3::IDENTITY], ..good() },
                0,
                Verdict::Check,
                "another pose",
            ),
            (
                Alignment { undetermined: vec![open], rotation_std: 3.1, ..good() },
                0,
                Verdict::Check,
                "about (0.00, 0.00, 1.00)",
            ),
            (good(), 3, Verdict::Check, "outline"),
        ] {
            let judgement = judge(&found, n_weak, false);
            assert_eq!(judgement.verdict, verdict, "{word}");
            assert!(judgement.reasons[0].contains(word), "{:?}", judgement.reasons);
        }
    }
}
