//! What is known of two objects together, whatever the method.

use std::sync::{Arc, OnceLock};

use faer::Mat;
use semfm_geom::Task;

use crate::anchors::ClusteredCloud;
use crate::clusters::{ClusterSettings, Clusters};
use crate::features::JointFeatures;
use crate::nearest_points::NearestPoints;
use crate::settings::TransferSettings;
use crate::stages::Stages;
use crate::transport::{Plan, TransportSettings, Weighted, couple};
use crate::zoomout::MapSide;
use crate::{Anchors, Error, PreparedObject, Result};

/// Two prepared objects, their features in one space, and what is made when a method first reads it:
/// the transport between their clouds, their anchors.
pub(crate) struct Pair {
    pub source: PreparedObject,
    pub target: PreparedObject,
    pub joint: JointFeatures,
    transport: TransportSettings,
    clustering: ClusterSettings,
    n_anchors: usize,
    neighbours: usize,
    plan: OnceLock<Plan>,
    clustered: OnceLock<ClusteredPair>,
    nearest_source_points: OnceLock<NearestPoints>,
    nearest_target_points: OnceLock<NearestPoints>,
}

/// The clusters of both objects and which of them are anchors.
pub(crate) struct ClusteredPair {
    pub source: Arc<Clusters>,
    pub target: Arc<Clusters>,
    pub anchors: Anchors,
}

/// Cluster label of each working vertex of both objects.
pub(crate) struct VertexLabels {
    pub source: Vec<u32>,
    pub target: Vec<u32>,
}

impl ClusteredPair {
    /// The labels on the working vertices of the pair's objects.
    pub fn vertex_labels(&self, pair: &Pair) -> VertexLabels {
        VertexLabels {
            source: pair.source.vertex_labels(&self.source),
            target: pair.target.vertex_labels(&self.target),
        }
    }
}

/// Features mixed onto the working vertices of both objects (n × dims each).
pub(crate) struct VertexFeatures {
    source: Mat<f64>,
    target: Mat<f64>,
}

/// Both objects as ZoomOut reads them.
pub(crate) struct MapSides<'a> {
    pub source: MapSide<'a>,
    pub target: MapSide<'a>,
}

impl Pair {
    pub fn new(
        source: &PreparedObject,
        target: &PreparedObject,
        settings: &TransferSettings,
        stages: &mut Stages,
    ) -> Result<Self> {
        let (on_source, on_target) = (source.cloud().dim(), target.cloud().dim());
        Error::length("feature dimension of the target", on_source, on_target)?;
        let dims = settings.feature_dims;
        let joint = stages
            .time("features", || JointFeatures::new(source.features(), target.features(), dims))?;
        Ok(Self {
            source: source.clone(),
            target: target.clone(),
            joint,
            transport: settings.transport,
            clustering: settings.clusters,
            n_anchors: settings.n_anchors,
            neighbours: settings.neighbours,
            plan: OnceLock::new(),
            clustered: OnceLock::new(),
            nearest_source_points: OnceLock::new(),
            nearest_target_points: OnceLock::new(),
        })
    }

    /// The transport between the clouds in the joint space, computed when first asked for.
    pub fn couple(&self, stages: &mut Stages, task: &Task) -> Result<&Plan> {
        if let Some(plan) = self.plan() {
            return Ok(plan);
        }
        let source = Weighted { rows: self.joint.source.as_ref(), masses: self.source.masses() };
        let target = Weighted { rows: self.joint.target.as_ref(), masses: self.target.masses() };
        let plan = stages.time("transport", || couple(source, target, &self.transport, task))?;
        Ok(self.plan.get_or_init(|| plan))
    }

    /// The transport between the clouds, where something asked for it.
    pub fn plan(&self) -> Option<&Plan> {
        self.plan.get()
    }

    /// For each target point the nearest source points in the joint space, found when first asked for.
    pub fn nearest_source_points(&self) -> &NearestPoints {
        let JointFeatures { source, target } = &self.joint;
        let count = self.neighbours;
        self.nearest_source_points.get_or_init(|| NearestPoints::new(target, source, count))
    }

    /// For each source point the nearest target points in the joint space, found when first asked for.
    pub fn nearest_target_points(&self) -> &NearestPoints {
        let JointFeatures { source, target } = &self.joint;
        let count = self.neighbours;
        self.nearest_target_points.get_or_init(|| NearestPoints::new(source, target, count))
    }

    /// The clusters of both objects and their anchors, made when first asked for.
    pub fn select_anchors(&self, task: &Task) -> Result<&ClusteredPair> {
        if let Some(clustered) = self.clustered() {
            return Ok(clustered);
        }
        let clustering = &self.clustering;
        let (on_source, on_target) = rayon::join(
            || self.source.clusters(clustering, task),
            || self.target.clusters(clustering, task),
        );
        let (on_source, on_target) = (on_source?, on_target?);
        let anchors = Anchors::select(
            ClusteredCloud { cloud: self.source.cloud(), clusters: &on_source },
            ClusteredCloud { cloud: self.target.cloud(), clusters: &on_target },
            self.n_anchors,
        );
        let clustered = ClusteredPair { source: on_source, target: on_target, anchors };
        Ok(self.clustered.get_or_init(|| clustered))
    }

    /// Clusters and anchors, where something asked for them.
    pub fn clustered(&self) -> Option<&ClusteredPair> {
        self.clustered.get()
    }

    /// Joint features mixed onto the vertices of both objects.
    pub fn vertex_features(&self) -> VertexFeatures {
        VertexFeatures {
            source: self.source.rows_onto_vertices(self.joint.source.as_ref()),
            target: self.target.rows_onto_vertices(self.joint.target.as_ref()),
        }
    }

    /// Both shapes for a ZoomOut with features, on farthest-point samples.
    pub fn sampled_sides<'a>(&'a self, features: &'a VertexFeatures) -> MapSides<'a> {
        MapSides {
            source: MapSide {
                basis: self.source.shape().basis(),
                features: Some(features.source.as_ref()),
                samples: self.source.samples(),
            },
            target: MapSide {
                basis: self.target.shape().basis(),
                features: Some(features.target.as_ref()),
                samples: self.target.samples(),
            },
        }
    }

    /// Both shapes for a purely spectral ZoomOut on all vertices.
    pub fn spectral_sides(&self) -> MapSides<'_> {
        MapSides {
            source: MapSide::spectral(self.source.shape().basis()),
            target: MapSide::spectral(self.target.shape().basis()),
        }
    }

    /// The vertices (n_target) at the source points (M_target) that the target's points are given.
    pub fn through_points(&self, source_point_of: &[u32]) -> Vec<u32> {
        let vertices = self.source.vertex_of_point();
        let points = self.target.point_of_vertex().iter().map(|&j| source_point_of[j as usize]);
        points.map(|i| vertices[i as usize]).collect()
    }
}
