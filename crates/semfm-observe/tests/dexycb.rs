//! The registered-depth trap on a real frame: `shared/data/rgbd/dexycb_frame` holds depth that was registered to the
//! colour and the intrinsics of both cameras.

#![allow(clippy::print_stdout, reason = "a skipped test says so")]

use std::path::PathBuf;

use semfm_geom::math::{DAffine3, DMat3, DVec3};
use semfm_geom::{Intrinsics, Pinhole};
use semfm_observe::{DepthGrid, NumpyArchive, check_registration, read_depth_image};

fn frame() -> Option<PathBuf> {
    let shared = std::env::var_os("SEMFM_SHARED").map(PathBuf::from);
    let shared =
        shared.unwrap_or_else(|| [env!("CARGO_MANIFEST_DIR"), "../../../shared"].iter().collect());
    let folder = shared.join("data/rgbd/dexycb_frame");
    if !folder.exists() {
        println!("SKIPPED: no shared data at {}", folder.display());
        return None;
    }
    Some(folder)
}

fn camera(fx: f64, fy: f64, cx: f64, cy: f64) -> Pinhole {
    let intrinsics = Intrinsics { width: 640, height: 480, fx, fy, cx, cy };
    Pinhole::with_pixel_centres_at_integers(intrinsics, DAffine3::IDENTITY).unwrap()
}

/// The numbers of `836212060125_640x480.yml`.
fn color() -> Pinhole {
    camera(616.640869140625, 616.2581787109375, 308.548095703125, 248.52310180664062)
}

fn depth_camera() -> Pinhole {
    camera(596.8375854492188, 596.8375854492188, 320.359619140625, 237.62452697753906)
}

fn color_from_depth() -> DAffine3 {
    let rows = [
        [0.9999802708625793, 0.0018027692567557096, -0.006022011861205101],
        [-0.0017685829661786556, 0.9999822974205017, 0.005677391309291124],
        [0.006032140459865332, -0.005666628479957581, 0.9999657273292542],
    ];
    let turn = DMat3::from_cols_array_2d(&rows).transpose();
    let shift = DVec3::new(0.014929370023310184, -1.8546150386100635e-05, -0.00013682979624718428);
    DAffine3::from_mat3_translation(turn, shift)
}

#[test]
fn the_depth_of_dexycb_is_found_to_lie_on_the_colour() {
    let Some(folder) = frame() else { return };
    let depth = read_depth_image(&folder.join("depth.png"), None).unwrap();
    let path = folder.join("labels.npz");
    let labels = NumpyArchive::read(&path).unwrap().array("seg").unwrap().unwrap().into_f64();
    let mut ids: Vec<i64> = labels.iter().map(|&x| x as i64).filter(|&x| x > 0).collect();
    ids.sort_unstable();
    ids.dedup();
    let mut n_decided = 0;
    for id in ids {
        let mask: Vec<bool> = labels.iter().map(|&label| label as i64 == id).collect();
        // With the cameras' places as measured, and as somebody has them who knows intrinsics alone.
        for motion in [color_from_depth(), DAffine3::IDENTITY] {
            let Ok(found) = check_registration(&depth, &mask, &color(), &depth_camera(), motion)
            else {
                continue;
            };
            assert_ne!(found.grid, DepthGrid::Depth, "label {id}: {found:?}");
            n_decided += usize::from(found.grid == DepthGrid::Color);
        }
    }
    assert!(n_decided >= 6, "{n_decided}");
}

/// What the trap costs: the bottle's surface under either camera.
#[test]
fn the_wrong_intrinsics_put_the_bottle_elsewhere() {
    let Some(folder) = frame() else { return };
    let depth = read_depth_image(&folder.join("depth.png"), None).unwrap();
    let path = folder.join("labels.npz");
    let archive = NumpyArchive::read(&path).unwrap();
    let labels = archive.array("seg").unwrap().unwrap().into_f64();
    let mask: Vec<bool> = labels.iter().map(|&label| label == 5.0).collect();
    let mean = |camera: &Pinhole| {
        let points = depth.points(camera, Some(&mask)).unwrap().object;
        points.iter().sum::<DVec3>() / points.len() as f64
    };
    let off = mean(&color()).distance(mean(&depth_camera()));
    assert!((0.012..0.03).contains(&off), "{off}");
}
