//! Lifting: what the images know of the surface arrives on the surface.

mod shapes;

use semfm_geom::math::DVec3;
use semfm_geom::{Intrinsics, Mesh, Pinhole, Task};
use semfm_views::{
    EmbeddedView, LiftRule, LiftSettings, PatchEmbeddings, PatchGrid, RenderSettings, RigSettings,
    SurfaceColor, lift, render, rig,
};
use shapes::{ellipsoid, lumpy_torus, together};

const DIM: usize = 4;

/// An encoder that knows the surface: each patch holds the mean of `feature` over the surface
/// points that its pixels see.
fn encode(
    mesh: &Mesh,
    cameras: &[Pinhole],
    feature: impl Fn(DVec3) -> [f32; DIM],
) -> Vec<EmbeddedView> {
    let settings = RenderSettings { supersampling: 1, ..Default::default() };
    let views = render(mesh, &SurfaceColor::GREY, cameras, &settings, &Task::default()).unwrap();
    let encode_one = |view: &semfm_views::View| {
        let camera = view.camera;
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let (rows, cols) = (height / 8, width / 8);
        let mut data = vec![0f32; rows * cols * DIM];
        let mut counts = vec![0u32; rows * cols];
        for pixel in (0..width * height).filter(|&pixel| view.triangles[pixel] >= 0) {
            let (column, row) = (pixel % width, pixel / width);
            let (u, v) = (column as f64 + 0.5, row as f64 + 0.5);
            let point = camera.eye() + camera.ray(u, v) * f64::from(view.depth[pixel]);
            let patch = (row / 8).min(rows - 1) * cols + (column / 8).min(cols - 1);
            counts[patch] += 1;
            for (sum, value) in data[patch * DIM..].iter_mut().zip(feature(point)) {
                *sum += value;
            }
        }
        for (token, &count) in data.chunks_exact_mut(DIM).zip(&counts) {
            token.iter_mut().for_each(|x| *x /= count.max(1) as f32);
        }
        let coverage = counts.iter().map(|&count| (count * 255 / 64).min(255) as u8).collect();
        let rect = [0.0, 0.0, (cols * 8) as f32, (rows * 8) as f32];
        let valid = vec![true; rows * cols];
        EmbeddedView {
            camera,
            patches: PatchEmbeddings::new(
                PatchGrid { rows, cols, rect },
                DIM,
                data,
                coverage,
                valid,
            )
            .unwrap(),
        }
    };
    views.iter().map(encode_one).collect()
}

fn cameras(mesh: &Mesh) -> Vec<Pinhole> {
    rig(mesh, &RigSettings { size: 224, ..Default::default() }).unwrap()
}

fn position(p: DVec3) -> [f32; DIM] {
    [p.x as f32, p.y as f32, p.z as f32, 1.0]
}

/// Root mean square distance between points and the positions that their features claim.
fn position_error(mesh: &Mesh, views: &[EmbeddedView], settings: &LiftSettings) -> f64 {
    let lifted = lift(mesh, views, settings, &Task::default()).unwrap();
    let cloud = lifted.cloud;
    let squares = (0..cloud.n_points()).filter(|&j| cloud.n_views()[j] > 0).map(|j| {
        let [x, y, z, one] = cloud.feature(j).try_into().unwrap();
        assert!((one - 1.0f32).abs() < 0.02, "weights do not sum to one: {one}");
        cloud.points()[j].distance_squared(DVec3::new(x.into(), y.into(), z.into()))
    });
    (squares.sum::<f64>() / cloud.n_points() as f64).sqrt()
}

#[test]
fn a_feature_that_is_the_position_comes_back_as_the_position() {
    let mesh = lumpy_torus(40);
    let views = encode(&mesh, &cameras(&mesh), position);
    let pull = LiftSettings::default();
    let error = position_error(&mesh, &views, &pull) / mesh.diagonal();
    assert!(error < 0.02, "pull: {error} of the diagonal");
    // The paper's rule blurs over a radius of 6 % of the diagonal.
    let error = position_error(&mesh, &views, &LiftSettings::paper()) / mesh.diagonal();
    assert!(error < 0.04, "unproject: {error} of the diagonal");
}

#[test]
fn wide_images_and_shifted_grids_are_read_in_place() {
    let mesh = lumpy_torus(40);
    let wide: Vec<Pinhole> = cameras(&mesh)
        .into_iter()
        .map(|camera| {
            let Intrinsics { fx, cx, .. } = camera.intrinsics();
            let (fx, cx) = (0.9 * fx, cx + 50.0);
            let wide = Intrinsics { width: 300, height: 228, fx, cx, ..camera.intrinsics() };
            Pinhole::with_pixel_centres_at_half(wide, camera.camera_from_world()).unwrap()
        })
        .collect();
    // 300 × 228 makes 37 × 28 patches that leave a margin of 4 pixels right and below.
    let views = encode(&mesh, &wide, position);
    let grid = views[0].patches.grid();
    assert_eq!((grid.cols, grid.rows), (37, 28));
    let error = position_error(&mesh, &views, &LiftSettings::default()) / mesh.diagonal();
    assert!(error < 0.02, "{error} of the diagonal");
}

#[test]
fn two_colours_stay_apart() {
    let mesh = ellipsoid(40, DVec3::new(1.0, 1.0, 4.0), DVec3::ZERO);
    let colour = |p: DVec3| if p.z > 0.5 { [1.0, 0.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0, 0.0] };
    let views = encode(&mesh, &cameras(&mesh), colour);
    for settings in [LiftSettings::default(), LiftSettings::paper()] {
        let cloud = lift(&mesh, &views, &settings, &Task::default()).unwrap().cloud;
        let right = (0..cloud.n_points())
            .filter(|&j| (cloud.feature(j)[0] > 0.5) == (cloud.points()[j].z > 0.5))
            .count();
        assert!(right as f64 > 0.97 * cloud.n_points() as f64, "{right} of {}", cloud.n_points());
    }
}

#[test]
fn what_nobody_sees_is_marked_and_filled() {
    let outer = ellipsoid(24, DVec3::new(1.0, 1.2, 1.5), DVec3::ZERO);
    let mesh = together(&outer, &ellipsoid(24, DVec3::splat(0.6), DVec3::ZERO));
    let views = encode(&mesh, &cameras(&mesh), position);
    let lifted = lift(&mesh, &views, &LiftSettings::default(), &Task::default()).unwrap();
    let n_outer = outer.n_faces() as u32;
    for (sample, &n_views) in lifted.samples.iter().zip(lifted.cloud.n_views()) {
        assert_eq!(n_views == 0, sample.face >= n_outer, "{sample:?} is seen by {n_views} views");
    }
    let hidden = lifted.samples.iter().filter(|sample| sample.face >= n_outer).count();
    assert!(hidden > 50 && lifted.report.n_seen == lifted.samples.len() - hidden);
    let filled =
        (0..lifted.samples.len()).all(|j| lifted.cloud.feature(j).iter().any(|&x| x != 0.0));
    assert!(filled);
}

#[test]
fn dropped_tokens_have_no_say_whatever_they_hold() {
    let mesh = lumpy_torus(24);
    let mut views = encode(&mesh, &cameras(&mesh), position);
    for view in &mut views {
        let patches = &view.patches;
        let (mut data, mut valid) = (patches.data().to_vec(), patches.valid().to_vec());
        for patch in (0..valid.len()).step_by(3) {
            valid[patch] = false;
            data[patch * DIM..][..DIM].fill(f32::NAN);
        }
        let (grid, coverage) = (patches.grid(), patches.coverage().to_vec());
        view.patches = PatchEmbeddings::new(grid, DIM, data, coverage, valid).unwrap();
    }
    let error = position_error(&mesh, &views, &LiftSettings::default()) / mesh.diagonal();
    assert!(error < 0.03, "{error} of the diagonal");
    assert!(lift(&mesh, &views, &LiftSettings::paper(), &Task::default()).is_ok());
}

#[test]
fn thread_count_changes_nothing() {
    let mesh = lumpy_torus(24);
    let views = encode(&mesh, &cameras(&mesh), position);
    let run = || lift(&mesh, &views, &LiftSettings::default(), &Task::default()).unwrap().cloud;
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(one_thread.install(run) == run());
}

#[test]
fn bad_embeddings_are_refused_by_name() {
    let mesh = lumpy_torus(12);
    let good = encode(&mesh, &cameras(&mesh), position);
    type Change = dyn Fn(&mut Vec<EmbeddedView>);
    let refuse = |change: &Change| {
        let mut views = good.clone();
        change(&mut views);
        lift(&mesh, &views, &LiftSettings::default(), &Task::default()).unwrap_err().to_string()
    };
    let cases: [(&Change, &str); 2] = [
        (&|views| views.clear(), "embedded views"),
        (
            &|views| {
                let patches = &views[2].patches;
                let data = patches.data()[..patches.n_patches() * 2].to_vec();
                let (coverage, valid) = (patches.coverage().to_vec(), patches.valid().to_vec());
                views[2].patches =
                    PatchEmbeddings::new(patches.grid(), 2, data, coverage, valid).unwrap();
            },
            "view 2: expected 4 dimensions",
        ),
    ];
    for (change, expected) in cases {
        let message = refuse(change);
        assert!(message.starts_with(expected), "{message}, expected {expected}");
    }
    // Cameras that look away see nothing.
    let away = refuse(&|views| {
        for view in views {
            let camera = view.camera;
            let elsewhere = Intrinsics { cx: camera.cx() + 1e4, ..camera.intrinsics() };
            let pose = camera.camera_from_world();
            view.camera = Pinhole::with_pixel_centres_at_half(elsewhere, pose).unwrap();
        }
    });
    assert!(away.contains("none in 14 views"), "{away}");
    for settings in [
        LiftSettings { n_samples: 0, ..Default::default() },
        LiftSettings { rule: LiftRule::Unproject { radius: f64::NAN }, ..LiftSettings::paper() },
    ] {
        assert!(lift(&mesh, &good, &settings, &Task::default()).is_err());
    }
}
