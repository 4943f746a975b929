//! The folder of a transfer: what it leaves behind for programs. Pictures and scenes are added by
//! `semfm-show`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use semfm_fmap::{Anchor, PreparedObject};
use semfm_geom::io::{
    GlbNode, StagedFolder, VertexAttributes, write_mesh_in_node, write_mesh_with_attributes,
};
use semfm_geom::{Mesh, Task};

use super::point_map::{FORMAT as POINT_MAP_FORMAT, PointMapFile};
use super::transfer_report::{Provenance, TransferReportFile};
use super::transferred_region::TransferredRegionFile;
use crate::encoded_objects::milliseconds_since;
use crate::upright::upright;
use crate::weight_colors::{color_bytes, weight_colors};
use crate::{Prepared, Region, Result, Transfer};

/// A finished transfer with everything that its files tell.
#[derive(Clone, Copy, Debug)]
pub struct TransferResult<'a> {
    /// The demonstrated object.
    pub source: &'a Prepared,
    /// The object to act on.
    pub target: &'a Prepared,
    /// The demonstrated region on the source.
    pub region: &'a Region,
    /// The transfer.
    pub transfer: &'a Transfer,
    /// Where it came from.
    pub provenance: &'a Provenance,
}

impl<'a> TransferResult<'a> {
    /// The mesh of the source as read.
    pub fn source_mesh(&self) -> &'a Mesh {
        self.source.object.shape().original()
    }

    /// The mesh of the target as read.
    pub fn target_mesh(&self) -> &'a Mesh {
        self.target.object.shape().original()
    }

    /// The content of `report.json`.
    pub fn report(&self) -> TransferReportFile {
        TransferReportFile::new(self)
    }

    /// Writes `report.json` into `folder`, after the other files: its stage `write` is the time since
    /// `start`, when they were begun.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write_report(&self, folder: &Path, start: Instant) -> Result<()> {
        let mut report = self.report();
        report.transfer.stages_ms.push("write", milliseconds_since(start));
        report.write(&folder.join("report.json"))
    }

    /// Where the anchors lie on both objects.
    ///
    /// # Errors
    /// [`Error::Fmap`](crate::Error::Fmap) where the clusters cannot be made: they are kept in the
    /// objects, so only a method that did not read them makes them here.
    pub fn anchor_ranks(&self, task: &Task) -> Result<AnchorRanks> {
        let anchors: Vec<Anchor> =
            self.transfer.report.anchors.iter().map(|report| report.anchor).collect();
        let sources: Vec<u32> = anchors.iter().map(|anchor| anchor.source).collect();
        let targets: Vec<u32> = anchors.iter().map(|anchor| anchor.target).collect();
        Ok(AnchorRanks {
            source: self.ranks_on(&self.source.object, &sources, task)?,
            target: self.ranks_on(&self.target.object, &targets, task)?,
        })
    }

    /// Ranks of the anchors whose cluster labels on `object` are `labels`, best first.
    fn ranks_on(
        &self,
        object: &PreparedObject,
        labels: &[u32],
        task: &Task,
    ) -> Result<ObjectAnchors> {
        let clusters = object.clusters(&self.transfer.report.settings.clusters, task)?;
        let cluster_of_point = clusters.labels().to_vec();
        let of_point: Vec<i64> =
            cluster_of_point.iter().map(|&label| rank_of(label, labels)).collect();
        let of_vertex =
            object.point_of_original_vertex().iter().map(|&p| of_point[p as usize]).collect();
        Ok(ObjectAnchors { cluster_of_point, of_point, of_vertex })
    }
}

/// The place of a label in a list, −1 where it is not there.
fn rank_of(label: u32, labels: &[u32]) -> i64 {
    labels.iter().position(|&other| other == label).map_or(-1, |rank| rank as i64)
}

/// Where the anchors of a transfer lie on both objects.
#[derive(Clone, Debug)]
pub struct AnchorRanks {
    /// On the source.
    pub source: ObjectAnchors,
    /// On the target.
    pub target: ObjectAnchors,
}

/// Where the anchors of a transfer lie on one object.
#[derive(Clone, Debug)]
pub struct ObjectAnchors {
    /// Cluster of each cloud point.
    pub cluster_of_point: Vec<u32>,
    /// Rank of the anchor that each cloud point's cluster is, best first; −1 for none.
    pub of_point: Vec<i64>,
    /// The same for each vertex of the mesh as read.
    pub of_vertex: Vec<i64>,
}

/// The files that say what came out, with a verdict: they are put into the folder of a transfer last,
/// so that nothing there has a verdict unless everything is there.
pub const ANSWERS: &[&str] = &["report.json", "region.json"];

/// Every file that the folder of a transfer can have, with pictures and grasps; `memory.png` is that of a
/// memory's answer.
pub const FILES: &[&str] = &[
    "region.json",
    "report.json",
    "point_map.json",
    "source.ply",
    "target.ply",
    "target.glb",
    "transfer.png",
    "features.png",
    "transfer.mcap",
    "memory.png",
    "grasps.json",
    "grasps.png",
];

/// Name of the node in `target.glb` that turns the mesh as read to stand upright, y up.
const UPRIGHT_NODE: &str = "upright_from_target";

/// Writes a transfer into `folder`, which is made if it is not there: `region.json`, `report.json`,
/// `point_map.json`, `source.ply`, `target.ply` and `target.glb`. The folder has all of them or, where
/// something fails, what it had before. What an earlier transfer left besides is
/// removed. Returns the paths.
///
/// # Errors
/// [`semfm_geom::Error::Io`] for the first file that cannot be written; [`semfm_geom::Error::Format`]
/// where one would replace a file that was read as an input ([`semfm_geom::io::refuse_input`]); those
/// of [`TransferResult::anchor_ranks`].
pub fn write_transfer(
    folder: &Path,
    result: &TransferResult<'_>,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let start = Instant::now();
    let staged = StagedFolder::new(folder)?;
    write_transfer_data(staged.path(), result, task)?;
    result.write_report(staged.path(), start)?;
    put_transfer(staged)
}

/// Writes the files of [`write_transfer`] but for the report into a folder that is not in its place yet, and touches no
/// other: pictures may be drawn into it meanwhile.
///
/// # Errors
/// As [`write_transfer`].
pub fn write_transfer_data(folder: &Path, result: &TransferResult<'_>, task: &Task) -> Result<()> {
    region_file(folder, result)?;
    data_files(folder, result, task)
}

/// Writes only the answer of a transfer into `folder`, which is made if it is not there:
/// `region.json` and `report.json`; what an earlier transfer left besides is removed. Returns the
/// paths.
///
/// # Errors
/// As [`write_transfer`].
pub fn write_answer(folder: &Path, result: &TransferResult<'_>) -> Result<Vec<PathBuf>> {
    let start = Instant::now();
    let staged = StagedFolder::new(folder)?;
    region_file(staged.path(), result)?;
    result.write_report(staged.path(), start)?;
    put_transfer(staged)
}

/// Puts the files of a transfer that were written into a temporary folder in their places. Those of
/// [`FILES`] that are not among them are removed: they are of an earlier transfer.
///
/// # Errors
/// As [`StagedFolder::put`].
pub fn put_transfer(staged: StagedFolder) -> Result<Vec<PathBuf>> {
    let gone: Vec<&str> =
        FILES.iter().copied().filter(|name| !staged.path().join(name).exists()).collect();
    Ok(staged.put(ANSWERS, &gone)?)
}

fn region_file(folder: &Path, result: &TransferResult<'_>) -> Result<()> {
    let file = TransferredRegionFile::new(result.transfer, result.target_mesh());
    file.write(&folder.join("region.json"))
}

fn data_files(folder: &Path, result: &TransferResult<'_>, task: &Task) -> Result<()> {
    let (source, target) = (result.source_mesh(), result.target_mesh());
    let names = ["point_map.json", "source.ply", "target.ply", "target.glb"];
    let [point_map, source_ply, target_ply, target_glb] = names.map(|name| folder.join(name));
    point_map_file(result, &result.anchor_ranks(task)?).write(&point_map)?;
    write_weighted(&source_ply, source, result.region.weights())?;
    write_weighted(&target_ply, target, result.transfer.weights())?;
    write_upright(&target_glb, target, result.transfer.weights())
}

fn point_map_file(result: &TransferResult<'_>, ranks: &AnchorRanks) -> PointMapFile {
    PointMapFile {
        format: POINT_MAP_FORMAT.into(),
        source: result.source_mesh().hash(),
        target: result.target_mesh().hash(),
        source_of: result.transfer.point_map.source_of.clone(),
        source_anchor: ranks.source.of_vertex.clone(),
        target_anchor: ranks.target.of_vertex.clone(),
        source_weight: result.region.weights().iter().map(|&w| rounded(w)).collect(),
        target_weight: result.transfer.weights().iter().map(|&w| rounded(w)).collect(),
    }
}

/// A weight to four digits: enough for eyes, and a third of the bytes. Never up to where a vertex
/// begins to count.
fn rounded(weight: f64) -> f64 {
    let rounded = (weight * 1e4).round() / 1e4;
    if (rounded >= Region::COUNTS) == (weight >= Region::COUNTS) {
        rounded
    } else {
        Region::COUNTS - 1e-4
    }
}

/// A mesh as read with a weight per vertex, as property and as colour.
pub(super) fn write_weighted(path: &Path, mesh: &Mesh, weights: &[f64]) -> Result<()> {
    let colors = bytes_of(weights);
    let attributes = VertexAttributes { colors: Some(&colors), scalars: &[("weight", weights)] };
    Ok(write_mesh_with_attributes(path, mesh, &attributes)?)
}

/// The same as a GLB in whose scene the object stands upright; its coordinates stay as read.
pub(super) fn write_upright(path: &Path, mesh: &Mesh, weights: &[f64]) -> Result<()> {
    let colors = bytes_of(weights);
    let attributes = VertexAttributes { colors: Some(&colors), scalars: &[("weight", weights)] };
    let rotation = upright(mesh)?.y_up_from_mesh().to_array();
    let node = GlbNode { name: UPRIGHT_NODE, rotation };
    Ok(write_mesh_in_node(path, mesh, &attributes, &node)?)
}

/// Colours of weights, RGBA in sRGB.
fn bytes_of(weights: &[f64]) -> Vec<[u8; 4]> {
    let opaque = |color| {
        let [r, g, b] = color_bytes(color);
        [r, g, b, u8::MAX]
    };
    weight_colors(weights).into_iter().map(opaque).collect()
}
