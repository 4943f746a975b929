//! Surface points with image features.

use crate::math::DVec3;
use crate::{Error, Result};

/// Points on an object's surface, each with the mean image feature of its surroundings
/// (the paper's 𝒫ₛ, section IV-C).
///
/// `points` (M) are in the frame and units of the mesh as read; `features` (M × d, row-major,
/// f32) are what the lifting made of the patch embeddings; `n_views` (M) counts the views that
/// saw each point, 0 where the features were taken from the nearest seen point.
#[derive(Clone, Debug, PartialEq)]
pub struct SemanticCloud {
    points: Vec<DVec3>,
    features: Vec<f32>,
    dim: usize,
    n_views: Vec<u32>,
}

impl SemanticCloud {
    /// Checks that the arrays belong together and that every number is finite.
    ///
    /// # Errors
    /// [`Error::Length`] where counts differ or nothing is there, [`Error::OutOfRange`] where a
    /// coordinate or a feature is not finite.
    pub fn new(
        points: Vec<DVec3>,
        features: Vec<f32>,
        dim: usize,
        n_views: Vec<u32>,
    ) -> Result<Self> {
        if points.is_empty() || dim == 0 {
            let expected = "at least one point and one feature dimension".into();
            let found = format!("{} points of {dim} dimensions", points.len());
            return Err(Error::OutOfRange { what: "semantic cloud", expected, found });
        }
        Error::check_length("features (points × dimensions)", points.len() * dim, features.len())?;
        Error::check_length("view counts", points.len(), n_views.len())?;
        if let Some(j) = points.iter().position(|p| !p.is_finite()) {
            let (what, expected) = ("semantic cloud point", "finite coordinates".into());
            return Err(Error::OutOfRange {
                what,
                expected,
                found: format!("{} at point {j}", points[j]),
            });
        }
        if let Some(i) = features.iter().position(|x| !x.is_finite()) {
            let found = format!("{} at point {}, dimension {}", features[i], i / dim, i % dim);
            return Err(Error::OutOfRange {
                what: "semantic cloud feature",
                expected: "finite numbers".into(),
                found,
            });
        }
        Ok(Self { points, features, dim, n_views })
    }

    /// Positions (M).
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// All features (M × d), row-major.
    pub fn features(&self) -> &[f32] {
        &self.features
    }

    /// Feature vector (d) of point `j`.
    pub fn feature(&self, j: usize) -> &[f32] {
        &self.features[j * self.dim..][..self.dim]
    }

    /// Number of points M.
    pub fn n_points(&self) -> usize {
        self.points.len()
    }

    /// Feature dimension d.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// How many views saw each point (M).
    pub fn n_views(&self) -> &[u32] {
        &self.n_views
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_points_and_bad_numbers_are_named() {
        let points = vec![DVec3::ZERO, DVec3::X];
        let cloud =
            SemanticCloud::new(points.clone(), vec![1.0, 2.0, 3.0, 4.0], 2, vec![1, 0]).unwrap();
        assert_eq!(cloud.feature(1), [3.0, 4.0]);
        let error =
            SemanticCloud::new(points, vec![1.0, 2.0, f32::NAN, 4.0], 2, vec![1, 0]).unwrap_err();
        assert!(error.to_string().contains("point 1, dimension 0"), "{error}");
    }
}
