//! What a trajectory in a file must keep.

use std::path::Path;

use semfm_geom::io::FormatError;
use semfm_motion::{Segment, TrajectoryPoint};

use super::trajectory::check_names;
use crate::Result;

/// Farthest apart that the end of one segment and the start of the next may be, and fastest that a joint at rest may
/// move: what is left of sums in floating point.
const TOLERANCE: f64 = 1e-9;

/// Names that stand once, lists of one length, finite numbers, times that rise from 0, segments that follow one
/// another without a gap and begin and end at rest.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) with the place at fault.
pub(super) fn check_segments(path: &Path, joints: &[String], segments: &[Segment]) -> Result<()> {
    check_names(path, joints)?;
    let fault = |place: String, expected: &str, found: String| -> Result<()> {
        Err(FormatError::new(path, place, expected, found).into())
    };
    if segments.is_empty() {
        return fault("segments".into(), "at least one", "none".into());
    }
    let mut before: Option<&TrajectoryPoint> = None;
    for (i, segment) in segments.iter().enumerate() {
        let place = |k: usize, what: &str| format!("segments[{i}].points[{k}].{what}");
        let points = &segment.points;
        if points.len() < 2 {
            let found = points.len().to_string();
            return fault(format!("segments[{i}].points"), "at least two", found);
        }
        for (k, point) in points.iter().enumerate() {
            check_point(path, point, joints.len(), |what| place(k, what))?;
            let Some(earlier) = k.checked_sub(1).map(|k| &points[k]) else { continue };
            if point.time <= earlier.time {
                let expected = format!("more than {}", earlier.time);
                return fault(place(k, "time"), &expected, point.time.to_string());
            }
        }
        let (first, last) = (&points[0], &points[points.len() - 1]);
        for (k, point) in [(0, first), (points.len() - 1, last)] {
            if let Some(v) = point.velocities.iter().find(|v| v.abs() > TOLERANCE) {
                return fault(place(k, "velocities"), "0, at rest", v.to_string());
            }
        }
        let expected_time = before.map_or(0.0, |end| end.time);
        if (first.time - expected_time).abs() > TOLERANCE {
            let expected = format!("{expected_time}, where the segment before ends");
            return fault(place(0, "time"), &expected, first.time.to_string());
        }
        let moved = before.map(|end| end.positions.iter().zip(&first.positions));
        if let Some((a, b)) = moved.and_then(|mut m| m.find(|(a, b)| (*a - *b).abs() > TOLERANCE)) {
            let expected = format!("{a}, where the segment before ends");
            return fault(place(0, "positions"), &expected, b.to_string());
        }
        before = Some(last);
    }
    Ok(())
}

fn check_point(
    path: &Path,
    point: &TrajectoryPoint,
    n_joints: usize,
    place: impl Fn(&str) -> String,
) -> Result<()> {
    let lists = [
        ("positions", &point.positions),
        ("velocities", &point.velocities),
        ("accelerations", &point.accelerations),
    ];
    for (what, list) in lists {
        if list.len() != n_joints {
            let expected = format!("{n_joints} numbers, one a joint");
            let found = list.len().to_string();
            return Err(FormatError::new(path, place(what), expected, found).into());
        }
        if let Some(x) = list.iter().find(|x| !x.is_finite()) {
            let found = x.to_string();
            return Err(FormatError::new(path, place(what), "finite numbers", found).into());
        }
    }
    for (what, x) in [("time", point.time), ("opening", point.opening)] {
        if !(x >= 0.0 && x.is_finite()) {
            let expected = "a number of at least 0";
            return Err(FormatError::new(path, place(what), expected, x.to_string()).into());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use semfm_motion::SegmentKind;

    use super::*;

    fn point(time: f64, q: f64) -> TrajectoryPoint {
        let [positions, velocities, accelerations] = [vec![q], vec![0.0], vec![0.0]];
        TrajectoryPoint { time, positions, velocities, accelerations, opening: 0.04 }
    }

    fn sound() -> Vec<Segment> {
        vec![
            Segment {
                kind: SegmentKind::ToPreGrasp,
                points: vec![point(0.0, 0.0), point(0.5, 0.4), point(1.0, 1.0)],
            },
            Segment { kind: SegmentKind::Approach, points: vec![point(1.0, 1.0), point(2.0, 1.1)] },
        ]
    }

    #[test]
    fn faults_are_named_by_their_place() {
        let joints = ["a".to_owned()];
        check_segments(Path::new("t.json"), &joints, &sound()).unwrap();
        type Spoil = fn(&mut Vec<Segment>);
        let spoil: [(&str, Spoil); 10] = [
            ("segments", |s| s.clear()),
            ("segments[1].points", |s| s[1].points.truncate(1)),
            ("segments[0].points[1].time", |s| s[0].points[1].time = 0.0),
            ("segments[0].points[0].time", |s| s[0].points[0].time = 0.1),
            ("segments[1].points[0].time", |s| s[1].points[0].time = 1.2),
            ("segments[1].points[0].positions", |s| s[1].points[0].positions[0] = 1.01),
            ("segments[1].points[1].velocities", |s| s[1].points[1].velocities[0] = 0.1),
            ("segments[0].points[1].accelerations", |s| s[0].points[1].accelerations.push(0.0)),
            ("segments[0].points[1].positions", |s| s[0].points[1].positions[0] = f64::NAN),
            ("segments[0].points[2].opening", |s| s[0].points[2].opening = -0.1),
        ];
        for (place, spoil) in spoil {
            let mut segments = sound();
            spoil(&mut segments);
            let error = check_segments(Path::new("t.json"), &joints, &segments).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{error}");
        }
        for names in [vec![], vec!["a".to_owned(); 2], vec![String::new()]] {
            let error = check_segments(Path::new("t.json"), &names, &sound()).unwrap_err();
            assert_eq!(error.place().as_deref(), Some("joint_names"), "{error}");
        }
    }
}
