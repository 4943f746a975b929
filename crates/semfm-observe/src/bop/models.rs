//! `models_info.json`: how large the objects of a dataset are, and how they look the same.

use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::{FormatError, read_json};
use semfm_geom::math::{DAffine3, DMat4, DVec3};
use serde::Deserialize;

use super::MM;
use crate::Result;

/// What a dataset says of an object's model.
#[derive(Clone, Debug, PartialEq)]
pub struct BopModel {
    /// Largest distance of two of its points, metres.
    pub diameter: f64,
    /// Motions of the model that nobody can tell, the identity not among them; metres.
    pub discrete_symmetries: Vec<DAffine3>,
    /// Axes about which any turn looks the same: direction (unit) and a point on it, metres.
    pub continuous_symmetries: Vec<(DVec3, DVec3)>,
}

#[derive(Deserialize)]
struct ModelRecord {
    diameter: f64,
    #[serde(default)]
    symmetries_discrete: Vec<[f64; 16]>,
    #[serde(default)]
    symmetries_continuous: Vec<AxisRecord>,
}

#[derive(Deserialize)]
struct AxisRecord {
    axis: [f64; 3],
    offset: [f64; 3],
}

/// Reads the models' descriptions, by number of the object.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the file cannot be read; [`Error::Format`](crate::Error::Format) for a key
/// that is no number, a diameter that is not positive, a matrix that is no motion, and an axis of no length.
pub fn read_bop_models(path: &Path) -> Result<BTreeMap<u32, BopModel>> {
    let records: BTreeMap<String, ModelRecord> = read_json(path)?;
    let mut models = BTreeMap::new();
    for (key, record) in records {
        let fault = |what: &str, expected: &str, found: String| {
            FormatError::new(path, format!("{key}.{what}"), expected, found)
        };
        let id: u32 = key.parse().map_err(|_| {
            FormatError::new(path, "keys", "numbers of objects", format!("`{key}`"))
        })?;
        if !(record.diameter > 0.0 && record.diameter.is_finite()) {
            let found = record.diameter.to_string();
            return Err(fault("diameter", "a positive length in millimetres", found).into());
        }
        let discrete = record.symmetries_discrete.iter().map(|rows| {
            let motion = DAffine3::from_mat4(DMat4::from_cols_array(rows).transpose());
            let turn = motion.matrix3;
            let off = turn * turn.transpose() - semfm_geom::math::DMat3::IDENTITY;
            let is_turn =
                off.to_cols_array().iter().all(|x| x.abs() < 1e-3) && turn.determinant() > 0.0;
            if !(is_turn && rows[12..] == [0.0, 0.0, 0.0, 1.0]) {
                return Err(fault(
                    "symmetries_discrete",
                    "the rows of a motion",
                    format!("{rows:?}"),
                ));
            }
            Ok(DAffine3::from_mat3_translation(turn, motion.translation / MM))
        });
        let continuous = record.symmetries_continuous.iter().map(|AxisRecord { axis, offset }| {
            let direction = DVec3::from_array(*axis).try_normalize();
            let direction = direction
                .ok_or_else(|| fault("symmetries_continuous", "an axis", format!("{axis:?}")))?;
            Ok((direction, DVec3::from_array(*offset) / MM))
        });
        let model = BopModel {
            diameter: record.diameter / MM,
            discrete_symmetries: discrete.collect::<std::result::Result<_, FormatError>>()?,
            continuous_symmetries: continuous.collect::<std::result::Result<_, FormatError>>()?,
        };
        models.insert(id, model);
    }
    Ok(models)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_symmetries_come_in_metres() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("models_info.json");
        let text = r#"{"1": {"diameter": 102.5, "min_x": -37},
            "2": {"diameter": 50, "symmetries_discrete": [[-1,0,0,4, 0,-1,0,0, 0,0,1,0, 0,0,0,1]],
                  "symmetries_continuous": [{"axis": [0,0,2], "offset": [1,0,0]}]}}"#;
        std::fs::write(&path, text).unwrap();
        let models = read_bop_models(&path).unwrap();
        assert!(
            (models[&1].diameter - 0.1025).abs() < 1e-15
                && models[&1].discrete_symmetries.is_empty()
        );
        assert_eq!(models[&2].discrete_symmetries[0].translation, DVec3::new(0.004, 0.0, 0.0));
        assert_eq!(models[&2].continuous_symmetries, [(DVec3::Z, DVec3::new(0.001, 0.0, 0.0))]);
        for (from, to, word) in [
            ("50", "-5", "diameter"),
            ("[0,0,2]", "[0,0,0]", "continuous"),
            ("[[-1,", "[[-2,", "discrete"),
            ("\"1\"", "\"cup\"", "cup"),
        ] {
            std::fs::write(&path, text.replace(from, to)).unwrap();
            let error = read_bop_models(&path).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
