//! Observations out of whatever holds several: a BOP scene or a bag.

use std::borrow::Borrow;
use std::path::Path;

use crate::bag::{BagSettings, Choice, read_chosen, write_bag};
use crate::bop::{BopScene, write_bop};
use crate::observation::Observation;
use crate::{Error, Result};

/// Which observations of a source are read.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceSettings {
    /// How a bag is read.
    pub bag: BagSettings,
    /// The first, and each that is so many further on.
    pub every: usize,
    /// At most so many.
    pub most: Option<usize>,
}

impl Default for SourceSettings {
    fn default() -> Self {
        Self { bag: BagSettings::default(), every: 1, most: None }
    }
}

/// What was read of a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceReport {
    /// Observations handed out.
    pub n_observations: usize,
    /// What was chosen or left out, in words.
    pub notes: Vec<String>,
}

/// Hands each wanted observation of a BOP scene (a folder with `scene_camera.json`) or of a bag (`.mcap`, or a folder of
/// them) to `visit`, in order. Pictures of the others are not decoded, and behind the last wanted one no picture is read. A
/// bag is gone through once before, for the times of all of it.
///
/// # Errors
/// As [`BopScene`] and [`read_bag`](crate::read_bag); [`Error::Invalid`] for an `every` of 0, and for settings of a bag
/// beside a BOP scene; the errors of `visit`.
pub fn read_observations(
    path: &Path,
    settings: &SourceSettings,
    mut visit: impl FnMut(Observation) -> Result<()>,
) -> Result<SourceReport> {
    if settings.every == 0 {
        return Err(Error::invalid("every", "at least 1", 0));
    }
    let most = settings.most.unwrap_or(usize::MAX);
    if BopScene::is_scene(path) {
        if let Some(setting) = settings.bag.given() {
            let found = format!("the BOP scene {}", path.display());
            return Err(Error::invalid(setting, "a bag", found));
        }
        let scene = BopScene::open(path)?;
        let mut n_observations = 0;
        for image in scene.images().step_by(settings.every).take(most) {
            visit(scene.observation(image)?)?;
            n_observations += 1;
        }
        return Ok(SourceReport { n_observations, notes: Vec::new() });
    }
    let choice = Choice { every: settings.every, most };
    let report = read_chosen(path, &settings.bag, choice, visit)?;
    let topic =
        |kind: &str, name: &Option<String>| name.as_ref().map(|name| format!("{kind} from {name}"));
    let mut notes: Vec<String> = [topic("colour", &report.color), topic("depth", &report.depth)]
        .into_iter()
        .flatten()
        .collect();
    notes.push(format!("camera from {}", report.camera_info));
    if report.n_unpaired > 0 {
        notes.push(format!(
            "{} messages without a counterpart in time were left out",
            report.n_unpaired
        ));
    }
    Ok(SourceReport { n_observations: report.n_observations, notes })
}

/// Writes observations as a bag, where the name ends with `.mcap`, else as the folder of a BOP scene.
///
/// # Errors
/// As [`write_bag`] and [`write_bop`].
pub fn write_observations<O: Borrow<Observation>>(path: &Path, observations: &[O]) -> Result<()> {
    let is_bag = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"));
    if is_bag { write_bag(path, observations) } else { write_bop(path, observations).map(drop) }
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DAffine3;
    use semfm_geom::{Intrinsics, Pinhole};

    use super::*;

    #[test]
    fn settings_of_a_bag_are_refused_beside_a_scene() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene");
        let intrinsics = Intrinsics { width: 2, height: 1, fx: 2.0, fy: 2.0, cx: 1.0, cy: 0.5 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let seen = Observation::new(camera).with_color(vec![[9; 3]; 2]).unwrap();
        write_observations(&path, &[seen]).unwrap();
        let read = |bag: BagSettings| {
            let settings = SourceSettings { bag, ..Default::default() };
            read_observations(&path, &settings, |_| Ok(())).map(|report| report.n_observations)
        };
        assert_eq!(read(BagSettings::default()).unwrap(), 1);
        let some = || Some("x".to_owned());
        for (bag, word) in [
            (BagSettings { color: some(), ..Default::default() }, "colour"),
            (BagSettings { depth: some(), ..Default::default() }, "depth"),
            (BagSettings { camera_info: some(), ..Default::default() }, "camera"),
            (BagSettings { fixed_frame: some(), ..Default::default() }, "fixed frame"),
            (BagSettings { max_gap_nanos: 1, ..Default::default() }, "max gap"),
        ] {
            let error = read(bag).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("the BOP scene"), "{error}");
        }
    }
}
