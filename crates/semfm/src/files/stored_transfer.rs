//! The folder of a transfer, read back.

use std::path::Path;

use semfm_geom::io::{FormatError, read_mesh};
use semfm_geom::{Mesh, MeshHash};

use super::point_map::PointMapFile;
use super::transfer_report::TransferReportFile;
use super::transferred_region::TransferredRegionFile;
use crate::{Region, Result};

/// What [`write_transfer`](super::write_transfer) wrote, checked to be of one transfer.
#[derive(Clone, Debug)]
pub struct StoredTransfer {
    /// The mesh of the source, as it was read (`source.ply`).
    pub source: Mesh,
    /// The mesh of the target (`target.ply`).
    pub target: Mesh,
    /// `point_map.json`.
    pub map: PointMapFile,
    /// `region.json`.
    pub region: TransferredRegionFile,
    /// `report.json`.
    pub report: TransferReportFile,
}

impl StoredTransfer {
    /// Reads a folder.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) for a file that is missing or cannot be read,
    /// [`Error::Format`](crate::Error::Format) for files that are not of one transfer.
    pub fn read(folder: &Path) -> Result<Self> {
        let report = TransferReportFile::read(&folder.join("report.json"))?;
        let map = PointMapFile::read(&folder.join("point_map.json"))?;
        let source = read_mesh(folder.join("source.ply"))?.mesh;
        let target = read_mesh(folder.join("target.ply"))?.mesh;
        check_hash(&folder.join("source.ply"), &source, map.source)?;
        check_hash(&folder.join("target.ply"), &target, map.target)?;
        map.check(&folder.join("point_map.json"), &source, &target)?;
        let path = folder.join("region.json");
        let region = TransferredRegionFile::read(&path)?;
        region.region.region(&path, &target)?;
        Ok(Self { source, target, map, region, report })
    }

    /// The demonstrated region, its weights to four digits.
    ///
    /// # Errors
    /// [`Error::Fmap`](crate::Error::Fmap) for a weight outside [0, 1].
    pub fn source_region(&self) -> Result<Region> {
        Ok(Region::from_weights(self.map.source_weight.clone())?)
    }
}

fn check_hash(path: &Path, mesh: &Mesh, hash: MeshHash) -> Result<()> {
    if mesh.hash() == hash {
        return Ok(());
    }
    let expected = format!("the mesh {hash} of point_map.json");
    Err(FormatError::new(path, "mesh", expected, mesh.hash().to_string()).into())
}
