//! The maps that are measured: from geometry alone, from a few true landmarks, from the true map.

use std::fmt;
use std::str::FromStr;

use faer::Mat;
use semfm::Task;
use semfm::fmap::descriptors::normalised_coefficients;
use semfm::fmap::fit::{FitSettings, FitSide, OrientedSurface, fit};
use semfm::fmap::zoomout::{MapSide, ZoomOutSettings, point_map, zoomout};
use semfm::fmap::{FunctionalMap, PointMap};
use semfm::geom::descriptors::{WksSettings, landmark_wks, wks};
use semfm::geom::math::DVec3;
use semfm::geom::sampling::farthest_points;
use semfm::geom::{Eigenbasis, PointIndex};

use super::shape::{K, MatchingShape};
use crate::{Error, Result};

/// Landmarks, as far from each other as they can be on the source.
const N_LANDMARKS: usize = 5;
/// Vertices matched while a map grows; the last map is on all.
const MAP_SAMPLES: usize = 1000;
/// Growth per turn of ZoomOut.
const STEP: usize = 5;
/// Weight of orientation beside the settings of the fit.
const ORIENTATION: f64 = 1.0;
/// Size of the true map that ZoomOut starts from.
const TRUE_K: usize = 20;

/// How a map is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapMethod {
    /// 100 wave kernel signatures, commutation with them and the Laplacian, k = 50.
    Wks,
    /// The same at k = 30, then ZoomOut to 200.
    WksZoomOut,
    /// The same with orientation preserved.
    WksOrientationZoomOut,
    /// Wave kernels at five true landmarks beside the signatures, k = 30.
    Landmarks,
    /// The same, then ZoomOut to 200.
    LandmarksZoomOut,
    /// The true 20 × 20 map, then ZoomOut to 200: what ZoomOut can do.
    TrueZoomOut,
}

impl MapMethod {
    /// All of them, least help first.
    pub const ALL: [Self; 6] = [
        Self::Wks,
        Self::WksZoomOut,
        Self::WksOrientationZoomOut,
        Self::Landmarks,
        Self::LandmarksZoomOut,
        Self::TrueZoomOut,
    ];

    /// The name used by files and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wks => "wks",
            Self::WksZoomOut => "wks+zoomout",
            Self::WksOrientationZoomOut => "wks+orientation+zoomout",
            Self::Landmarks => "landmarks",
            Self::LandmarksZoomOut => "landmarks+zoomout",
            Self::TrueZoomOut => "true20+zoomout",
        }
    }

    /// The map target → source, between the original meshes.
    pub(crate) fn map(
        self,
        source: &MatchingShape,
        target: &MatchingShape,
        settings: &FitSettings,
        task: &Task,
    ) -> Result<PointMap> {
        let map = match self {
            Self::Wks => described(source, target, 50, &[], settings, task)?,
            Self::WksZoomOut => described(source, target, 30, &[], settings, task)?,
            Self::WksOrientationZoomOut => {
                let settings = FitSettings { orientation: ORIENTATION, ..*settings };
                described(source, target, 30, &[], &settings, task)?
            }
            Self::Landmarks | Self::LandmarksZoomOut => {
                described(source, target, 30, &landmarks(source, target), settings, task)?
            }
            Self::TrueZoomOut => true_map(source, target)?,
        };
        let samples =
            |shape: &MatchingShape| farthest_points(shape.shape.mesh().vertices(), MAP_SAMPLES);
        let (on_source, on_target) = (samples(source), samples(target));
        let side = |shape, samples| MapSide { basis: basis_of(shape), features: None, samples };
        let (a, b) = (side(source, &on_source[..]), side(target, &on_target[..]));
        let grows = !matches!(self, Self::Wks | Self::Landmarks);
        let map = if grows {
            let k_final = K.min(a.basis.k()).min(b.basis.k());
            let settings = ZoomOutSettings {
                k_start: map.k_source(),
                k_final,
                step: STEP,
                feature_weight: 0.0,
            };
            zoomout(map, &a, &b, &settings, task)?
        } else {
            map
        };
        Ok(point_map(&map, &a, &b, 0.0).onto_originals(&source.shape, &target.shape))
    }
}

impl fmt::Display for MapMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for MapMethod {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|method| method.name() == text);
        found.ok_or_else(|| Error::invalid("method", Self::ALL.map(Self::name).join(", "), text))
    }
}

fn basis_of(shape: &MatchingShape) -> &Eigenbasis {
    shape.shape.basis()
}

/// The first `k` pairs alone: descriptors are made of what the map can hold.
fn shortened(basis: &Eigenbasis, k: usize) -> Eigenbasis {
    let k = k.min(basis.k());
    Eigenbasis {
        values: basis.values[..k].to_vec(),
        functions: basis.first(k).to_owned(),
        mass: basis.mass.clone(),
        residuals: basis.residuals[..k].to_vec(),
    }
}

/// C from wave kernel signatures, and from wave kernels at landmark pairs (source, target).
fn described(
    source: &MatchingShape,
    target: &MatchingShape,
    k: usize,
    landmarks: &[(u32, u32)],
    settings: &FitSettings,
    task: &Task,
) -> Result<FunctionalMap> {
    let asked = settings.orientation > 0.0;
    let surface =
        |of: &MatchingShape| asked.then(|| OrientedSurface::new(of.shape.mesh())).transpose();
    let surfaces = (surface(source)?, surface(target)?);
    let (source, target) = (shortened(basis_of(source), k), shortened(basis_of(target), k));
    let describe = |basis: &Eigenbasis, landmarks: Vec<u32>| -> Result<Mat<f64>> {
        let settings = WksSettings::default();
        let signature = wks(basis, &settings)?;
        let k = basis.k();
        let signature = normalised_coefficients(basis, signature.as_ref(), k);
        if landmarks.is_empty() {
            return Ok(signature);
        }
        let kernels = landmark_wks(basis, &landmarks, &settings)?;
        let kernels = normalised_coefficients(basis, kernels.as_ref(), k);
        let n = signature.ncols();
        Ok(Mat::from_fn(k, n + kernels.ncols(), |i, j| {
            if j < n { signature[(i, j)] } else { kernels[(i, j - n)] }
        }))
    };
    let a = describe(&source, landmarks.iter().map(|pair| pair.0).collect())?;
    let b = describe(&target, landmarks.iter().map(|pair| pair.1).collect())?;
    let k = a.nrows().min(b.nrows());
    let source = FitSide { basis: &source, surface: surfaces.0.as_ref() };
    let target = FitSide { basis: &target, surface: surfaces.1.as_ref() };
    Ok(fit((a.subrows(0, k), b.subrows(0, k)), source, target, settings, task)?.map)
}

/// True pairs of working vertices, far apart on the source.
fn landmarks(source: &MatchingShape, target: &MatchingShape) -> Vec<(u32, u32)> {
    let vertices = source.shape.original().vertices();
    let points: Vec<DVec3> = source.truth.iter().map(|&v| vertices[v as usize]).collect();
    let n = source.truth.len().min(target.truth.len());
    farthest_points(&points[..n], N_LANDMARKS)
        .into_iter()
        .map(|i| i as usize)
        .map(|i| (source.working(source.truth[i]), target.working(target.truth[i])))
        .collect()
}

/// C of the true correspondence, each vertex taking that of its nearest sample.
fn true_map(source: &MatchingShape, target: &MatchingShape) -> Result<FunctionalMap> {
    let vertices = target.shape.original().vertices();
    let points: Vec<DVec3> = target.truth.iter().map(|&v| vertices[v as usize]).collect();
    let index = PointIndex::new(&points)?;
    let sample_of = |&p: &DVec3| index.nearest(p).0.min(source.truth.len() - 1);
    let source_of =
        target.shape.mesh().vertices().iter().map(|p| source.working(source.truth[sample_of(p)]));
    let map = PointMap { source_of: source_of.collect() };
    let (a, b) = (basis_of(source), basis_of(target));
    Ok(FunctionalMap::from_point_map(&map, a, b, TRUE_K.min(a.k()).min(b.k()))?)
}
