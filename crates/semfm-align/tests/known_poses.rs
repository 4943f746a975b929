//! Alignment of a lopsided pebble whose pose and scale are known.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_align::{
    AlignSettings, Alignment, DepthImage, Error, ObservedCloud, Sim3, Verdict, align,
};
use semfm_geom::math::{DAffine3, DQuat, DVec3};
use semfm_geom::sampling::sample_uniform;
use semfm_geom::{Intrinsics, Mesh, Pinhole, SurfaceIndex, Task, zoo};

/// No two sides alike, in no unit of length, far from its own origin.
fn pebble() -> Mesh {
    let sphere = zoo::icosphere(4);
    let bumps = [
        (DVec3::new(1.0, 0.3, 0.2), 0.5),
        (DVec3::new(-0.2, 1.0, -0.4), 0.35),
        (DVec3::new(0.1, -0.5, 1.0), -0.3),
    ];
    let mut points = Vec::new();
    for p in sphere.vertices() {
        let bumps = bumps.iter().map(|&(at, height): &(DVec3, f64)| {
            height * (-p.distance_squared(at.normalize()) / 0.3).exp()
        });
        let radius = 1.0 + bumps.sum::<f64>();
        points.push(
            70.0 * radius * *p * DVec3::new(1.0, 0.75, 0.55) + DVec3::new(300.0, -50.0, 20.0),
        );
    }
    Mesh::new(points, sphere.faces().to_vec()).unwrap()
}

/// About 15 cm large, half a metre away.
fn truth() -> Sim3 {
    let rotation = DQuat::from_axis_angle(DVec3::new(0.3, 1.0, -0.6).normalize(), 2.2);
    let centre = pebble().bounding_sphere().0;
    let scale = 0.00093;
    let translation = DVec3::new(0.04, -0.03, 0.6) - scale * (rotation * centre);
    Sim3 { scale, rotation, translation }
}

/// What a camera at the origin sees of the object: points of its surface that nothing hides.
fn visible(mesh: &Mesh, camera_from_object: &Sim3, n: usize, seed: u64) -> Vec<DVec3> {
    let surface = SurfaceIndex::new(mesh).unwrap();
    let eye = camera_from_object.inverse().apply(DVec3::ZERO);
    let samples = sample_uniform(mesh, 3 * n, seed).unwrap();
    let seen = samples
        .iter()
        .filter(|s| s.normal.dot(eye - s.point) > 0.0)
        .filter(|s| !surface.blocked(eye, s.point, 1e-6 * mesh.diagonal()));
    seen.map(|s| camera_from_object.apply(s.point)).take(n).collect()
}

fn normal_noise(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v) = (1.0 - rng.random::<f64>(), rng.random::<f64>());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Noise along the lines of sight.
fn noisy(points: &[DVec3], sigma: f64, seed: u64) -> Vec<DVec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    points.iter().map(|&p| p + sigma * normal_noise(&mut rng) * p.normalize()).collect()
}

fn found(mesh: &Mesh, points: &[DVec3], settings: &AlignSettings) -> Alignment {
    let observed = ObservedCloud::from_view(points, DVec3::ZERO).unwrap();
    align(mesh, &observed, settings, &Task::default()).unwrap()
}

/// Largest distance between true and found places of the object's vertices, metres.
fn error(mesh: &Mesh, alignment: &Alignment) -> f64 {
    let (a, b) = (truth(), alignment.camera_from_object);
    mesh.vertices().iter().map(|&p| a.apply(p).distance(b.apply(p))).fold(0.0, f64::max)
}

#[test]
fn a_clean_surface_is_found_exactly_without_a_guess() {
    let mesh = pebble();
    let points: Vec<DVec3> =
        sample_uniform(&mesh, 20_000, 7).unwrap().iter().map(|s| truth().apply(s.point)).collect();
    let observed = ObservedCloud::from_many_views(&points).unwrap();
    let found = align(&mesh, &observed, &AlignSettings::default(), &Task::default()).unwrap();
    let pose = found.camera_from_object;
    assert!((pose.scale / truth().scale - 1.0).abs() < 1e-6, "{found:?}");
    assert!(pose.rotation.angle_between(truth().rotation) < 1e-6, "{found:?}");
    assert!(error(&mesh, &found) < 1e-6 * mesh.diagonal() * truth().scale, "{found:?}");
    assert_eq!(found.verdict, Verdict::Accept, "{:?}", found.reasons);
}

#[test]
fn one_clean_side_is_enough() {
    let mesh = pebble();
    let found = found(&mesh, &visible(&mesh, &truth(), 6000, 1), &AlignSettings::default());
    assert!((found.camera_from_object.scale / truth().scale - 1.0).abs() < 1e-6, "{found:?}");
    assert!(error(&mesh, &found) < 1e-6, "{found:?}");
    assert_eq!(found.verdict, Verdict::Accept, "{:?}", found.reasons);
}

#[test]
fn winding_does_not_matter() {
    let mesh = pebble();
    let points = visible(&mesh, &truth(), 6000, 1);
    for every in [1, 2] {
        let faces = mesh.faces().iter().enumerate();
        let faces = faces.map(|(i, &[a, b, c])| if i % every == 0 { [a, c, b] } else { [a, b, c] });
        let turned = Mesh::new(mesh.vertices().to_vec(), faces.collect()).unwrap();
        let found = found(&turned, &points, &AlignSettings::default());
        assert!(error(&mesh, &found) < 1e-5, "every {every}: {found:?}");
    }
}

#[test]
fn clutter_and_a_piece_of_table_do_no_harm() {
    let mesh = pebble();
    let mut points = noisy(&visible(&mesh, &truth(), 6000, 2), 0.001, 3);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut spread = || 2.0 * rng.random::<f64>() - 1.0;
    // A fifth is clutter in the air around, and there is a piece of table behind the object.
    let clutter: Vec<DVec3> = (0..1500)
        .map(|_| DVec3::new(0.04, -0.03, 0.6) + 0.12 * DVec3::new(spread(), spread(), spread()))
        .collect();
    let table: Vec<DVec3> = (0..1200)
        .map(|_| DVec3::new(0.04 + 0.09 * spread(), 0.035, 0.66 + 0.07 * spread()))
        .collect();
    points.extend(clutter);
    points.extend(table);
    let found = found(&mesh, &points, &AlignSettings::default());
    assert!((found.camera_from_object.scale / truth().scale - 1.0).abs() < 0.01, "{found:?}");
    assert!(error(&mesh, &found) < 0.003, "{} {found:?}", error(&mesh, &found));
    assert_ne!(found.verdict, Verdict::Refuse, "{:?}", found.reasons);
}

#[test]
fn the_standard_deviation_of_the_scale_is_that_of_repeated_measurements() {
    let mesh = pebble();
    let settings = AlignSettings { init: Some(truth()), ..AlignSettings::default() };
    let (mut scales, mut told) = (Vec::new(), Vec::new());
    for seed in 0..40 {
        let points = noisy(&visible(&mesh, &truth(), 3000, 10 + seed), 0.001, 100 + seed);
        let found = found(&mesh, &points, &settings);
        scales.push(found.camera_from_object.scale);
        told.push(found.scale_std);
    }
    let n = scales.len() as f64;
    let mean = scales.iter().sum::<f64>() / n;
    let std = (scales.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let told = told.iter().sum::<f64>() / n;
    // Forty draws know a standard deviation to ±11 %; overlap of noise and shape adds some more.
    assert!((0.6..1.6).contains(&(told / std)), "told {told:.2e}, measured {std:.2e}");
    assert!((mean / truth().scale - 1.0).abs() < 0.002, "biased to {mean}");
}

#[test]
fn a_model_that_hides_is_refused() {
    let mesh = pebble();
    let points = noisy(&visible(&mesh, &truth(), 6000, 2), 0.001, 3);
    // Small enough to lie in a nearly flat patch, or inside; large enough to be seen through.
    for factors in [[0.15, 0.3], [2.5, 4.0]] {
        let scale_range = Some(factors.map(|f| f * truth().scale));
        let found = found(&mesh, &points, &AlignSettings { scale_range, ..Default::default() });
        assert_eq!(found.verdict, Verdict::Refuse, "{factors:?}: {found:?}");
        assert!(!found.reasons.is_empty());
    }
    // A wall behind which anything could hide.
    let wall: Vec<DVec3> = (0..10_000)
        .map(|i| DVec3::new(f64::from(i % 100) - 50.0, f64::from(i / 100) - 50.0, 150.0) / 250.0)
        .collect();
    for init in [None, Some(Sim3 { translation: truth().translation + 0.3 * DVec3::Z, ..truth() })]
    {
        let found = found(&mesh, &wall, &AlignSettings { init, ..AlignSettings::default() });
        assert_ne!(found.verdict, Verdict::Accept, "{init:?}: {found:?}");
    }
}

#[test]
fn what_a_view_does_not_determine_is_told_and_not_made_up() {
    let sphere = zoo::icosphere(4);
    let pose = Sim3 { scale: 0.05, translation: 0.5 * DVec3::Z, ..Sim3::IDENTITY };
    let points = noisy(&visible(&sphere, &pose, 5000, 1), 0.001, 2);
    let ball = found(&sphere, &points, &AlignSettings::default());
    assert!((ball.camera_from_object.scale - 0.05).abs() < 0.001, "{ball:?}");
    assert!(ball.rotation_std > 0.1, "{ball:?}");
    assert_eq!(ball.verdict, Verdict::Check, "{ball:?}");

    let grid = zoo::open_grid(12, 12);
    let flat = grid.vertices().iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect();
    let grid = Mesh::new(flat, grid.faces().to_vec()).unwrap();
    let (centre, radius) = grid.bounding_sphere();
    let pose = Sim3 { scale: 0.1 / radius, ..Sim3::IDENTITY };
    let pose = Sim3 { translation: 0.5 * DVec3::Z - pose.apply(centre), ..pose };
    let points = sample_uniform(&grid, 4000, 1).unwrap();
    let points: Vec<DVec3> = points.iter().map(|s| pose.apply(s.point)).collect();
    let sheet = found(&grid, &points, &AlignSettings::default());
    assert_eq!(sheet.verdict, Verdict::Check, "{sheet:?}");
    assert!(sheet.reasons.iter().any(|reason| reason.contains("outline")), "{sheet:?}");
    // The outline determines it: a cell of the silhouette is a sixtieth of the sheet.
    assert!((sheet.camera_from_object.scale / pose.scale - 1.0).abs() < 0.02, "{sheet:?}");
    assert!(sheet.scale_std / pose.scale > 0.002, "{sheet:?}");
}

#[test]
fn the_scale_of_a_box_seen_at_a_corner_comes_from_its_outline() {
    // Three faces leave the scale open: the box may grow out of their corner.
    let size = DVec3::new(8.0, 12.0, 20.0);
    let corners = [0, 1, 2, 3, 4, 5, 6, 7u32]
        .map(|i| DVec3::from_array([i & 1, i >> 1 & 1, i >> 2 & 1].map(f64::from)));
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let cuboid = Mesh::new(corners.map(|corner| corner * size).to_vec(), faces).unwrap();
    for (seed, angle) in [(1, 0.6), (2, 2.1), (3, 4.0)] {
        let rotation = DQuat::from_axis_angle(DVec3::new(1.0, 0.7, 0.4).normalize(), angle);
        let pose = Sim3 { scale: 0.01, rotation, translation: DVec3::new(0.0, 0.05, 0.7) };
        let points = noisy(&visible(&cuboid, &pose, 6000, seed), 0.001, seed);
        let found = found(&cuboid, &points, &AlignSettings::default());
        assert!((found.camera_from_object.scale / 0.01 - 1.0).abs() < 0.02, "{found:?}");
        assert_ne!(found.verdict, Verdict::Refuse, "{found:?}");
        // Not surer than the outline allows.
        assert!(found.scale_std > 3e-5, "{found:?}");
    }
}

#[test]
fn a_guess_narrows_the_search() {
    let mesh = pebble();
    let points = noisy(&visible(&mesh, &truth(), 6000, 2), 0.001, 3);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 1.0, 0.2).normalize(), 0.4);
    let centre = mesh.bounding_sphere().0;
    let rotation = turn * truth().rotation;
    let scale = 1.35 * truth().scale;
    let translation =
        truth().apply(centre) + DVec3::new(0.02, -0.02, 0.01) - scale * (rotation * centre);
    let init = Some(Sim3 { scale, rotation, translation });
    let near = found(&mesh, &points, &AlignSettings { init, ..AlignSettings::default() });
    assert!(error(&mesh, &near) < 0.002, "{near:?}");
    let far = found(&mesh, &points, &AlignSettings::default());
    assert!(near.n_starts < far.n_starts / 5, "{} and {}", near.n_starts, far.n_starts);
}

#[test]
fn the_same_seed_gives_the_same_pose_at_every_thread_count() {
    let mesh = pebble();
    let points = noisy(&visible(&mesh, &truth(), 4000, 2), 0.001, 3);
    let [one, three] = [1, 3].map(|n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let found = pool.install(|| found(&mesh, &points, &AlignSettings::default()));
        Alignment { stages_ms: Vec::new(), ..found }
    });
    assert_eq!(one, three);
}

#[test]
fn a_depth_image_with_a_mask_knows_what_stands_before_the_object() {
    let mesh = pebble();
    let surface = SurfaceIndex::new(&mesh).unwrap();
    let calibrated =
        Intrinsics { width: 320, height: 240, fx: 300.0, fy: 310.0, cx: 159.5, cy: 119.5 };
    let camera = Pinhole::with_pixel_centres_at_integers(calibrated, DAffine3::IDENTITY).unwrap();
    let back = truth().inverse();
    let (mut depth, mut mask) = (Vec::new(), Vec::new());
    for pixel in 0..320 * 240 {
        let ray = camera.ray(f64::from(pixel % 320) + 0.5, f64::from(pixel / 320) + 0.5);
        let origin = back.apply(DVec3::ZERO);
        let hit = surface.first_hit(origin, back.apply(ray) - origin);
        // A pole stands before the left third of the object, a wall behind it all.
        let pole = (165..172).contains(&(pixel % 320));
        mask.push(hit.is_some() && !pole);
        depth.push(if pole { 0.4 } else { hit.map_or(0.9, |hit| hit.t as f32) });
    }
    let image = DepthImage::new(320, 240, depth).unwrap();
    let observed = ObservedCloud::from_depth(&image, &camera, Some(&mask)).unwrap();
    let found = align(&mesh, &observed, &AlignSettings::default(), &Task::default()).unwrap();
    assert!(error(&mesh, &found) < 1e-4, "{} {found:?}", error(&mesh, &found));
    assert_eq!(found.verdict, Verdict::Accept, "{found:?}");
}

#[test]
fn bad_settings_and_cancelled_tasks_are_errors() {
    let mesh = pebble();
    let points = visible(&mesh, &truth(), 400, 1);
    let observed = ObservedCloud::from_view(&points, DVec3::ZERO).unwrap();
    for settings in [
        AlignSettings { scale_range: Some([0.0, 1.0]), ..AlignSettings::default() },
        AlignSettings { scale_range: Some([2.0, 1.0]), ..AlignSettings::default() },
        AlignSettings { scale_range: Some([1.0, f64::NAN]), ..AlignSettings::default() },
        AlignSettings { n_starts: 0, ..AlignSettings::default() },
        AlignSettings {
            init: Some(Sim3 { scale: f64::NAN, ..Sim3::IDENTITY }),
            ..AlignSettings::default()
        },
    ] {
        let error = align(&mesh, &observed, &settings, &Task::default()).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { .. }), "{error}");
    }
    let task = Task::default();
    task.cancel();
    let error = align(&mesh, &observed, &AlignSettings::default(), &task).unwrap_err();
    assert!(matches!(error, Error::Geom(semfm_geom::Error::Cancelled)), "{error}");
}
