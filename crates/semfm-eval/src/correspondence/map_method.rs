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
use semfm::geom::suggestion::unknown_name;
use semfm::geom::{Eigenbasis, PointIndex};

use super::annotated_shape::{AnnotatedShape, K};
use super::geodesic_error::Sent;
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
#[non_exhaustive]
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

/// A true pair of working vertices.
struct Landmark {
    source: u32,
    target: u32,
}

impl MapMethod {
    /// All of them, by how much of the truth they know.
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

    /// What it is, for people.
    pub fn about(self) -> &'static str {
        match self {
            Self::Wks => "WKS, k 50",
            Self::WksZoomOut => "WKS, k 30, ZoomOut 30→200",
            Self::WksOrientationZoomOut => "WKS + orientation, k 30, ZoomOut 30→200",
            Self::Landmarks => "5 true landmarks, k 30",
            Self::LandmarksZoomOut => "5 true landmarks, k 30, ZoomOut 30→200",
            Self::TrueZoomOut => "true 20 × 20 map, ZoomOut 20→200",
        }
    }

    /// The map target → source, between the meshes as read: to vertices, or to points of triangles where it is to be
    /// precise.
    pub(super) fn map(
        self,
        source: &AnnotatedShape,
        target: &AnnotatedShape,
        settings: &FitSettings,
        precise: bool,
        task: &Task,
    ) -> Result<Sent> {
        let map = match self {
            Self::Wks => map_of_descriptors(source, target, 50, &[], settings, task)?,
            Self::WksZoomOut => map_of_descriptors(source, target, 30, &[], settings, task)?,
            Self::WksOrientationZoomOut => {
                let settings = FitSettings { orientation: ORIENTATION, ..*settings };
                map_of_descriptors(source, target, 30, &[], &settings, task)?
            }
            Self::Landmarks | Self::LandmarksZoomOut => {
                let landmarks = landmarks(source, target);
                map_of_descriptors(source, target, 30, &landmarks, settings, task)?
            }
            Self::TrueZoomOut => true_map(source, target)?,
        };
        let on_target = farthest_points(target.shape.mesh().vertices(), MAP_SAMPLES);
        let a = MapSide { basis: source.basis(), features: None, samples: &[] };
        let b = MapSide { basis: target.basis(), features: None, samples: &on_target };
        let map = if matches!(self, Self::Wks | Self::Landmarks) {
            map
        } else {
            let k_final = K.min(a.basis.k()).min(b.basis.k());
            let settings = ZoomOutSettings {
                k_start: map.k_source(),
                k_final,
                step: STEP,
                feature_weight: 0.0,
            };
            zoomout(map, &a, &b, &settings, task)?
        };
        let (on_source, on_target) = (&source.shape, &target.shape);
        Ok(if precise {
            let map = map.precise_map(a.basis, on_source.mesh(), b.basis)?;
            Sent::Points(map.onto_originals(on_source, on_target))
        } else {
            Sent::Vertices(point_map(&map, &a, &b, 0.0)?.onto_originals(on_source, on_target))
        })
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
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            Error::invalid("method", names.join(", "), unknown_name(text, names))
        })
    }
}

/// C (k × k) from wave kernel signatures, and from wave kernels at landmarks.
fn map_of_descriptors(
    source: &AnnotatedShape,
    target: &AnnotatedShape,
    k: usize,
    landmarks: &[Landmark],
    settings: &FitSettings,
    task: &Task,
) -> Result<FunctionalMap> {
    let on_source: Vec<u32> = landmarks.iter().map(|pair| pair.source).collect();
    let on_target: Vec<u32> = landmarks.iter().map(|pair| pair.target).collect();
    let (source_surface, target_surface) = (surface(source, settings)?, surface(target, settings)?);
    let (source, target) = (shortened(source.basis(), k), shortened(target.basis(), k));
    let a = descriptors(&source, &on_source)?;
    let b = descriptors(&target, &on_target)?;
    let k = a.nrows().min(b.nrows());
    let (a, b) = (a.subrows(0, k), b.subrows(0, k));
    let source = FitSide { surface: source_surface.as_ref(), ..FitSide::new(&source, a) };
    let target = FitSide { surface: target_surface.as_ref(), ..FitSide::new(&target, b) };
    Ok(fit(source, target, settings, task)?.map)
}

/// The oriented surface, where the fit weighs orientation.
fn surface(of: &AnnotatedShape, settings: &FitSettings) -> Result<Option<OrientedSurface>> {
    if settings.orientation > 0.0 {
        Ok(Some(OrientedSurface::new(of.shape.mesh())?))
    } else {
        Ok(None)
    }
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

/// Coefficients (k × descriptors) of the wave kernel signatures, then of the wave kernels at
/// `landmarks`, each descriptor normalised.
fn descriptors(basis: &Eigenbasis, landmarks: &[u32]) -> Result<Mat<f64>> {
    let settings = WksSettings::default();
    let k = basis.k();
    let signature = wks(basis, &settings)?;
    let signature = normalised_coefficients(basis, signature.as_ref(), k);
    if landmarks.is_empty() {
        return Ok(signature);
    }
    let kernels = landmark_wks(basis, landmarks, &settings)?;
    let kernels = normalised_coefficients(basis, kernels.as_ref(), k);
    let n = signature.ncols();
    Ok(Mat::from_fn(k, n + kernels.ncols(), |i, j| {
        if j < n { signature[(i, j)] } else { kernels[(i, j - n)] }
    }))
}

/// True pairs, far apart on the source.
fn landmarks(source: &AnnotatedShape, target: &AnnotatedShape) -> Vec<Landmark> {
    let points = source.sample_points();
    let n = source.truth.len().min(target.truth.len());
    farthest_points(&points[..n], N_LANDMARKS)
        .into_iter()
        .map(|sample| sample as usize)
        .map(|sample| Landmark {
            source: source.working(source.truth[sample]),
            target: target.working(target.truth[sample]),
        })
        .collect()
}

/// C of the true correspondence, each vertex taking that of its nearest sample.
fn true_map(source: &AnnotatedShape, target: &AnnotatedShape) -> Result<FunctionalMap> {
    let index = PointIndex::new(&target.sample_points())?;
    let vertices: &[DVec3] = target.shape.mesh().vertices();
    let source_of = vertices.iter().map(|&vertex| {
        let sample = index.nearest(vertex).0.min(source.truth.len() - 1);
        source.working(source.truth[sample])
    });
    let map = PointMap { source_of: source_of.collect() };
    let (a, b) = (source.basis(), target.basis());
    Ok(FunctionalMap::from_point_map(&map, a, b, TRUE_K.min(a.k()).min(b.k()))?)
}
