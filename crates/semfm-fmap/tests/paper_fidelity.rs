//! The literal method beside the reference implementation of the paper, number by number.
//!
//! `fixtures/paper` was written by `fixtures/dump_reference.py` (versions are named there). Clusters
//! and the signs of eigenvectors differ between libraries, so the comparison starts from the
//! reference's own samples, features, labels and bases; everything after them must agree to rounding.

use std::path::PathBuf;

use faer::{Mat, MatRef};
use npyz::NpyFile;
use semfm_fmap::clusters::Clusters;
use semfm_fmap::zoomout::{MapSide, point_map, zoomout};
use semfm_fmap::{Anchors, ClusteredCloud, LabelledBasis, Method, TransferSettings, anchor_fit};
use semfm_geom::math::DVec3;
use semfm_geom::{Eigenbasis, PointIndex, SemanticCloud, Task};

/// Rounding of a chain of products with condition numbers around 1e3.
const TOLERANCE: f64 = 1e-9;

fn open(name: &str) -> NpyFile<std::fs::File> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures/paper")
        .join(format!("{name}.npy"));
    NpyFile::new(std::fs::File::open(path).unwrap()).unwrap()
}

fn floats(name: &str) -> Mat<f64> {
    let file = open(name);
    let shape = file.shape().to_vec();
    let columns = shape.get(1).copied().unwrap_or(1) as usize;
    let values: Vec<f64> = file.into_vec().unwrap();
    MatRef::from_row_major_slice(&values, shape[0] as usize, columns).to_owned()
}

fn ids(name: &str) -> Vec<u32> {
    open(name).into_vec().unwrap()
}

fn column(matrix: &Mat<f64>) -> Vec<f64> {
    matrix.col_as_slice(0).to_vec()
}

fn points(matrix: &Mat<f64>) -> Vec<DVec3> {
    (0..matrix.nrows())
        .map(|i| DVec3::new(matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)]))
        .collect()
}

struct Object {
    cloud: SemanticCloud,
    clusters: Clusters,
    vertex_labels: Vec<u32>,
    basis: Eigenbasis,
}

fn object(side: &str) -> Object {
    let named = |what: &str| format!("{side}_{what}");
    let features = floats(&named("S"));
    let rows = (0..features.nrows())
        .flat_map(|i| features.row(i).iter().map(|x| *x as f32).collect::<Vec<_>>());
    let on_surface = points(&floats(&named("P")));
    let index = PointIndex::new(&on_surface).unwrap();
    let labels = ids(&named("labels"));
    let vertices = points(&floats(&named("vertices")));
    let vertex_labels = vertices.iter().map(|&p| labels[index.nearest(p).0]).collect();
    let n = on_surface.len();
    let cloud =
        SemanticCloud::new(on_surface, rows.collect(), features.ncols(), vec![1; n]).unwrap();
    let values = column(&floats(&named("eigenvalues")));
    let basis = Eigenbasis {
        residuals: vec![0.0; values.len()],
        values,
        functions: floats(&named("eigenfunctions")),
        mass: column(&floats(&named("mass"))),
    };
    Object { cloud, clusters: Clusters::from_labels(&labels), vertex_labels, basis }
}

fn assert_close(found: MatRef<'_, f64>, expected: &Mat<f64>, what: &str) {
    assert_eq!((found.nrows(), found.ncols()), (expected.nrows(), expected.ncols()), "{what}");
    let off = (found - expected).norm_l2() / expected.norm_l2();
    assert!(off < TOLERANCE, "{what} is off by {off:e}");
}

/// Runs one rule: the map goes from `from` to `to`, and the anchors are given in that order.
fn check_rule(rule: &str, from: &Object, to: &Object, anchors: &Anchors) -> Vec<u32> {
    let settings = TransferSettings::of(Method::Semfm);
    let task = Task::default();
    let on_source = LabelledBasis { basis: &from.basis, labels: &from.vertex_labels };
    let on_target = LabelledBasis { basis: &to.basis, labels: &to.vertex_labels };
    let fit = anchor_fit(on_source, on_target, anchors, &settings, &task).unwrap();
    assert_eq!((fit.report.rank, fit.report.minimum_norm), (2, true));
    assert_close(fit.map.matrix(), &floats(&format!("{rule}_C_start")), "C before ZoomOut");
    let (from, to) = (MapSide::spectral(&from.basis), MapSide::spectral(&to.basis));
    let map = zoomout(fit.map, &from, &to, &settings.zoomout, &task).unwrap();
    assert_close(map.matrix(), &floats(&format!("{rule}_C_final")), "C after ZoomOut");
    let map = point_map(&map, &from, &to, 0.0).unwrap().source_of;
    assert_eq!(map, ids(&format!("{rule}_point_map")), "point map");
    map
}

#[test]
fn anchors_maps_and_regions_are_the_references_under_both_rules() {
    let (source, target) = (object("source"), object("target"));
    let anchors = Anchors::select(
        ClusteredCloud { cloud: &source.cloud, clusters: &source.clusters },
        ClusteredCloud { cloud: &target.cloud, clusters: &target.clusters },
        2,
    );
    assert_close(anchors.cosines.as_ref(), &floats("preimage_cosines"), "cosines");
    let mut pairs: Vec<u32> = anchors.pairs.iter().flat_map(|a| [a.source, a.target]).collect();
    if pairs[0] > pairs[2] {
        pairs.rotate_left(2); // ours are by cosine, the reference's by source cluster
    }
    assert_eq!(pairs, ids("preimage_anchors"));
    let region: Vec<u8> = open("region").into_vec().unwrap();

    let forth = check_rule("preimage", &source, &target, &anchors);
    let preimage: Vec<u8> = forth.iter().map(|&i| region[i as usize]).collect();
    assert_eq!(preimage, open("preimage_region").into_vec::<u8>().unwrap());

    // The paper's own rule: C from target to source functions, the point map from source to target.
    let back = check_rule("image", &target, &source, &anchors.swapped());
    let mut image = vec![0u8; target.vertex_labels.len()];
    back.iter()
        .zip(&region)
        .filter(|(_, inside)| **inside == 1)
        .for_each(|(&j, _)| image[j as usize] = 1);
    assert_eq!(image, open("image_region").into_vec::<u8>().unwrap());
    assert!(preimage != image, "the two rules are told apart by this pair");
}
