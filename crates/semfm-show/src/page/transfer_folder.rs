//! The folder of a transfer as a group of the page.

use std::path::Path;

use semfm::files::{
    HypothesisRecord, PointMapFile, StoredTransfer, TransferReportFile, read_region,
};
use semfm::fmap::metrics::iou;
use semfm::weight_colors::{MARKED, PLAIN, color_bytes};
use semfm::{Mesh, Region, Task};

use super::grasps::grasps_group;
use super::group::{
    Fact, Group, Layer, LegendEntry, Panel, VIEWPOINT_SIDE, VertexColors, mesh_note,
};
use super::mesh::file_name;
use crate::Result;
use crate::colors::{EXTRA, MISSED, RIGHT, anchor_color, outcome_colors};
use crate::pictures::{PairedViewpoints, Viewpoints, WeightedMesh, paired_viewpoints};

/// Classes of a layer have numbers below 256; so many anchors or places get one of their own.
const MOST_CLASSES: usize = 200;

/// What the files of `folder` say of one transfer, and its grasps, where there are some.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) for files that are not of one transfer, [`Error::Semfm`](crate::Error::Semfm) where one cannot be read
/// or drawn.
pub(super) fn transfer_groups(folder: &Path, task: &Task) -> Result<Vec<Group>> {
    let files = TransferFolder::read(folder)?;
    let TransferFolder { source, target, map, .. } = &files;
    let viewpoints = paired_viewpoints(
        WeightedMesh { mesh: source, weights: &map.source_weight }.into(),
        WeightedMesh { mesh: target, weights: &map.target_weight }.into(),
        &map.source_of,
        VIEWPOINT_SIDE,
        task,
    )?;
    let grasps = folder.join("grasps.json");
    let grasps = match grasps.is_file() {
        true => grasps_group(&grasps, target, Some(&map.target_weight), task)?,
        false => None,
    };
    let layers = files.layers(folder)?;
    Ok(std::iter::once(files.into_group(folder, layers, viewpoints)).chain(grasps).collect())
}

/// Holds the transferred region against the true one on the target: a layer that tells what is right, too
/// much and missed, and their IoU.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for a file that is no region of the target.
pub(super) fn add_truth(group: &mut Group, path: &Path) -> Result<()> {
    let [_, target] = &group.panels[..] else { return Ok(()) };
    let truth = read_region(path, &target.mesh)?;
    let [VertexColors::Weights(given), VertexColors::Weights(found)] = &group.layers[0].colors[..]
    else {
        return Ok(());
    };
    let found = Region::from_weights(found.clone())?;
    let inside: Vec<bool> = given.iter().map(|&w| w >= Region::COUNTS).collect();
    let outcomes = [outcome_colors(&inside, &inside), outcome_colors(&found.mask(), &truth.mask())];
    let colors =
        outcomes.map(|colors| VertexColors::Colors(colors.into_iter().map(color_bytes).collect()));
    let legend = vec![
        LegendEntry::swatch(RIGHT, "right"),
        LegendEntry::swatch(EXTRA, "found, and not in the true region"),
        LegendEntry::swatch(MISSED, "in the true region, and not found"),
    ];
    let name = file_name(path);
    group.facts.push(Fact::new(format!("IoU with {name}"), format!("{:.2}", iou(&found, &truth)?)));
    let layer = Layer { name: format!("against {name}"), legend, colors: colors.into() };
    group.layers.insert(1, layer);
    Ok(())
}

/// The first letters of a version: hashes are long.
fn short(version: &str) -> String {
    version.chars().take(24).collect()
}

/// The files of a transfer that the page shows.
struct TransferFolder {
    source: Mesh,
    target: Mesh,
    map: PointMapFile,
    places: Vec<HypothesisRecord>,
    report: TransferReportFile,
}

impl TransferFolder {
    fn read(folder: &Path) -> Result<Self> {
        let StoredTransfer { source, target, map, region, report } = StoredTransfer::read(folder)?;
        let mut places = region.hypotheses;
        let n = target.n_vertices();
        places.retain(|place| place.vertices.iter().all(|&v| (v as usize) < n));
        Ok(Self { source, target, map, places, report })
    }

    fn layers(&self, folder: &Path) -> Result<Vec<Layer>> {
        let mut layers = vec![self.region_layer(), colour_transfer_layer()];
        layers.extend(features_layer(folder, [&self.source, &self.target])?);
        layers.push(self.anchor_layer());
        if self.places.len() > 1 {
            layers.push(self.places_layer());
        }
        Ok(layers)
    }

    fn region_layer(&self) -> Layer {
        let weights = [&self.map.source_weight, &self.map.target_weight];
        let colors = weights.map(|weights| VertexColors::Weights(weights.clone()));
        Layer { name: "region".into(), legend: Vec::new(), colors: colors.into() }
    }

    fn anchor_layer(&self) -> Layer {
        let PointMapFile { source_anchor, target_anchor, .. } = &self.map;
        let highest = source_anchor.iter().chain(target_anchor).copied().max().unwrap_or(-1);
        let n_anchors = highest.saturating_add(1).clamp(0, MOST_CLASSES as i64);
        let mut legend = vec![LegendEntry::swatch(color_bytes(anchor_color(-1)), "no anchor")];
        legend.extend((0..n_anchors).map(|rank| {
            let anchor = self.report.transfer.anchors.get(rank as usize);
            let cosine = anchor.map(|anchor| format!(": cosine {:.2}", anchor.anchor.cosine));
            let cosine = cosine.unwrap_or_default();
            let text = format!("anchor {}{cosine}", rank + 1);
            LegendEntry::swatch(color_bytes(anchor_color(rank)), text)
        }));
        let colors = [source_anchor, target_anchor].map(|ranks| {
            let class = |&rank: &i64| rank.saturating_add(1).clamp(0, n_anchors) as u8;
            VertexColors::Classes(ranks.iter().map(class).collect())
        });
        Layer { name: "anchors".into(), legend, colors: colors.into() }
    }

    /// The places that the region may belong to, each in its own colour.
    fn places_layer(&self) -> Layer {
        let mut legend = vec![
            LegendEntry::swatch(color_bytes(PLAIN), "elsewhere"),
            LegendEntry::swatch(color_bytes(MARKED), "the demonstrated region"),
        ];
        let mut on_target = vec![0u8; self.target.n_vertices()];
        for (i, place) in self.places.iter().enumerate().take(MOST_CLASSES) {
            let text = format!("place {}: {:.0} %", i + 1, 100.0 * place.probability);
            legend.push(LegendEntry::swatch(color_bytes(anchor_color(i as i64)), text));
            place.vertices.iter().for_each(|&v| on_target[v as usize] = i as u8 + 2);
        }
        let weights = self.map.source_weight.iter();
        let on_source = weights.map(|&w| u8::from(w >= Region::COUNTS)).collect();
        let colors = vec![VertexColors::Classes(on_source), VertexColors::Classes(on_target)];
        Layer { name: "other places".into(), legend, colors }
    }

    fn facts(&self) -> Vec<Fact> {
        let TransferReportFile { verdict, confidence, transfer, provenance, .. } = &self.report;
        let mut facts = vec![
            Fact::new("verdict", verdict),
            Fact::new("confidence", format!("{confidence:.2}")),
            Fact::new("method", transfer.settings.method),
        ];
        let encoder = self.report.target.encoder.as_ref();
        facts.extend(encoder.map(|encoder| {
            Fact::new("features", format!("{} {}", encoder.name, short(&encoder.version)))
        }));
        facts.extend(
            provenance.iou.map(|iou| Fact::new("IoU with the true grip", format!("{iou:.2}"))),
        );
        facts
    }

    fn into_group(self, folder: &Path, layers: Vec<Layer>, viewpoints: PairedViewpoints) -> Group {
        Group {
            title: title(folder),
            facts: self.facts(),
            panels: vec![
                panel("source", self.source, viewpoints.source),
                panel("target", self.target, viewpoints.target),
            ],
            layers,
            notes: Vec::new(),
            source_of: Some(self.map.source_of),
            pictures: Vec::new(),
            hands: None,
            motion: None,
        }
    }
}

fn panel(name: &str, mesh: Mesh, viewpoints: Viewpoints) -> Panel {
    Panel { name: name.into(), note: mesh_note(&mesh), mesh, viewpoints }
}

/// The folder's name, after that of the folder it lies in.
fn title(folder: &Path) -> String {
    let names: Vec<_> = folder.iter().map(|name| name.to_string_lossy()).collect();
    names[names.len().saturating_sub(2)..].join("/")
}

fn colour_transfer_layer() -> Layer {
    Layer {
        name: "colour transfer".into(),
        legend: vec![LegendEntry::note("equal colours: matched places")],
        colors: vec![VertexColors::Positions, VertexColors::Positions],
    }
}

/// Features as colours, from the clouds of the scene, where it is there and this build reads it.
#[cfg(feature = "mcap")]
fn features_layer(folder: &Path, meshes: [&Mesh; 2]) -> Result<Option<Layer>> {
    use semfm::geom::PointIndex;
    use semfm::views::Fault;

    use crate::foxglove::{ColoredPoints, read_cloud};

    let path = folder.join("transfer.mcap");
    if !path.is_file() {
        return Ok(None);
    }
    let mut colors = Vec::new();
    for (topic, mesh) in ["/source/cloud", "/target/cloud"].into_iter().zip(meshes) {
        let ColoredPoints { points, colors: of_point } = match read_cloud(&path, topic) {
            Ok(Some(cloud)) => cloud,
            Ok(None) => return Ok(None),
            // A scene of millions of vertices is beyond the reader: that costs this layer, not the page.
            Err(crate::Error::Semfm(semfm::Error::Views(semfm::views::Error::Container {
                fault: Fault::OverLimit,
                ..
            }))) => return Ok(None),
            Err(error) => return Err(error),
        };
        let index = PointIndex::new(&points)?;
        let of_vertex = mesh.vertices().iter().map(|&p| of_point[index.nearest(p).0]);
        colors.push(VertexColors::Colors(of_vertex.collect()));
    }
    let text = "three principal components of the features: equal colours are equal features";
    Ok(Some(Layer { name: "features".into(), legend: vec![LegendEntry::note(text)], colors }))
}

#[cfg(not(feature = "mcap"))]
fn features_layer(_folder: &Path, _meshes: [&Mesh; 2]) -> Result<Option<Layer>> {
    Ok(None)
}
