//! Writes one small file of each kind into a folder: `sample.views.mcap` and `sample.emb.mcap`.
//! Every number in them follows from a formula, so that a reader in
//! another language can check them (`tests/check_mcap.py` does).
//!
//! `cargo run -p semfm-views --example write_sample_files -- FOLDER`

use std::path::{Path, PathBuf};

use semfm_geom::math::{DAffine3, DMat3, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole};
use semfm_views::mcap::{Dtype, EmbeddingsFile, EmbeddingsMetadata, ViewsMetadata, write_views};
use semfm_views::{EmbeddedView, PatchEmbeddings, PatchGrid, Result, View};

const N_VIEWS: usize = 3;
const WIDTH: u32 = 16;
const HEIGHT: u32 = 12;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: write_sample_files FOLDER")?;
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder)?;
    write_samples(&folder)?;
    Ok(())
}

fn write_samples(folder: &Path) -> Result<()> {
    let mesh = tetrahedron()?;
    let mut metadata = ViewsMetadata::of(&mesh, WIDTH, HEIGHT);
    metadata.rig = "3 cameras around y".to_owned();
    metadata.background = "white".to_owned();
    metadata.seed = 7;

    let views: Vec<View> = (0..N_VIEWS).map(view).collect();
    write_views(&folder.join("sample.views.mcap"), &views, &mesh, None, &metadata)?;

    let embeddings = EmbeddingsFile {
        path: PathBuf::new(),
        metadata: EmbeddingsMetadata {
            views: metadata,
            encoder: "sample".to_owned(),
            revision: "1".to_owned(),
            preprocessing: "none".to_owned(),
            rolls: 1,
            outliers: "kept".to_owned(),
            simulated: true,
        },
        views: (0..N_VIEWS).map(embedded).collect(),
    };
    embeddings.write(&folder.join("sample.emb.mcap"), Dtype::F16)
}

fn tetrahedron() -> Result<Mesh> {
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    Ok(Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?)
}

/// Pinhole number `index`: turned by half a radian each, four units away.
fn camera(index: usize) -> Pinhole {
    let turn = DMat3::from_rotation_y(0.5 * index as f64);
    Pinhole::with_pixel_centres_at_half(
        Intrinsics { width: WIDTH, height: HEIGHT, fx: 20.0, fy: 21.0, cx: 8.0, cy: 6.0 },
        DAffine3::from_mat3_translation(turn, DVec3::new(0.0, 0.0, 4.0)),
    )
    .unwrap()
}

/// Every fifth pixel is background; the others lie on triangle p mod 4 at depth 1 + p / 256.
fn view(index: usize) -> View {
    let n_pixels = (WIDTH * HEIGHT) as usize;
    let is_background = |pixel: usize| (pixel + index).is_multiple_of(5);
    View {
        camera: camera(index),
        rgb: (0..3 * n_pixels).map(|byte| (byte * 7 + index) as u8).collect(),
        depth: (0..n_pixels)
            .map(|p| if is_background(p) { f32::INFINITY } else { 1.0 + p as f32 / 256.0 })
            .collect(),
        triangles: (0..n_pixels)
            .map(|p| if is_background(p) { -1 } else { (p % 4) as i32 })
            .collect(),
    }
}

/// A grid of 3 × 4 patches of 5 numbers, each a multiple of 1/64; the last patch is invalid.
fn embedded(index: usize) -> EmbeddedView {
    let (rows, cols, dim) = (3, 4, 5);
    let number = |i: usize| ((i * 37 + index) % 101) as f32 / 64.0 - 0.5;
    let grid = PatchGrid { rows, cols, rect: [0.0, 0.0, WIDTH as f32, HEIGHT as f32] };
    let data = (0..rows * cols * dim).map(number).collect();
    let coverage = (0..rows * cols).map(|patch| (20 * patch) as u8).collect();
    let valid = (0..rows * cols).map(|patch| patch + 1 < rows * cols).collect();
    let patches = PatchEmbeddings::new(grid, dim, data, coverage, valid)
        .expect("arrays of the grid's length");
    EmbeddedView { camera: camera(index), patches }
}
