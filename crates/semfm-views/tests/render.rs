//! The renderer against rays, geometry that is known, and meshes that are ugly.

mod shapes;

use semfm_geom::math::{DAffine3, DMat3, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole, Task};
use semfm_views::{RenderSettings, RigSettings, SurfaceColor, View, render, rig, triangle_ids};
use shapes::{ellipsoid, lumpy_torus, together, zoo};

fn shot(mesh: &Mesh, camera: Pinhole) -> View {
    let settings = RenderSettings::default();
    render(mesh, &SurfaceColor::GREY, &[camera], &settings, &Task::default()).unwrap().remove(0)
}

/// Nearest triangle and its depth on the ray through a pixel's centre (Möller & Trumbore 1997).
fn ray_oracle(mesh: &Mesh, camera: &Pinhole, column: usize, row: usize) -> (i32, f64) {
    let (eye, ray) = (camera.eye(), camera.ray(column as f64 + 0.5, row as f64 + 0.5));
    let mut nearest = (-1, f64::INFINITY);
    for face in 0..mesh.n_faces() {
        let [a, b, c] = mesh.corners(face);
        let (ab, ac) = (b - a, c - a);
        let p = ray.cross(ac);
        let determinant = ab.dot(p);
        let t = eye - a;
        let q = t.cross(ab);
        let (u, v) = (t.dot(p) / determinant, ray.dot(q) / determinant);
        let depth = ac.dot(q) / determinant; // the ray's depth is 1
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && depth > 0.0 && depth < nearest.1 {
            nearest = (face as i32, depth);
        }
    }
    nearest
}

fn compare_with_rays(mesh: &Mesh, camera: &Pinhole) {
    let view = shot(mesh, *camera);
    let width = camera.width() as usize;
    let mut different = 0;
    for (pixel, (&triangle, &depth)) in view.triangles.iter().zip(&view.depth).enumerate() {
        let (oracle_triangle, oracle_depth) =
            ray_oracle(mesh, camera, pixel % width, pixel / width);
        if triangle != oracle_triangle {
            different += 1;
        } else if triangle >= 0 {
            let error = (f64::from(depth) / oracle_depth - 1.0).abs();
            assert!(error < 1e-5, "pixel {pixel}: depth {depth}, by ray {oracle_depth}");
        } else {
            assert_eq!(depth, f32::INFINITY);
        }
    }
    let share = f64::from(different) / view.triangles.len() as f64;
    assert!(share <= 1e-3, "{different} of {} pixels see another triangle", view.triangles.len());
}

#[test]
fn triangles_alone_are_those_of_the_views() {
    for (name, mesh) in zoo() {
        let settings = RigSettings { count: 3, size: 70, ..Default::default() };
        let cameras = rig(&mesh, &settings).unwrap();
        let (light, task) = (RenderSettings::default(), Task::default());
        let views = render(&mesh, &SurfaceColor::GREY, &cameras, &light, &task).unwrap();
        let ids = triangle_ids(&mesh, &cameras, &task).unwrap();
        for (view, ids) in views.iter().zip(&ids) {
            assert_eq!(&view.triangles, ids, "{name}");
        }
    }
}

#[test]
fn pixels_see_what_their_rays_hit() {
    let mesh = lumpy_torus(24);
    let settings = RigSettings { count: 5, size: 64, ..Default::default() };
    for camera in rig(&mesh, &settings).unwrap() {
        compare_with_rays(&mesh, &camera);
    }
}

#[test]
fn a_camera_inside_the_object_sees_what_is_in_front_and_nothing_behind() {
    // Triangles pass the camera on all sides: every one of them crosses the plane z = 0 somewhere.
    let mesh = together(&lumpy_torus(16), &ellipsoid(3, DVec3::new(9.0, 8.0, 7.0), DVec3::ZERO));
    for k in 0..6 {
        let turn =
            DMat3::from_rotation_y(f64::from(k)) * DMat3::from_rotation_x(0.7 * f64::from(k));
        let eye = DVec3::new(2.7, 0.1, 0.2); // inside the tube of the torus
        let camera = Pinhole::with_pixel_centres_at_half(
            Intrinsics {
                width: 60,
                height: 44,
                fx: 25.0, // a wide view: 100°
                fy: 30.0,
                cx: 31.5,
                cy: 20.25,
            },
            DAffine3::from_mat3_translation(turn, -(turn * eye)),
        )
        .unwrap();
        compare_with_rays(&mesh, &camera);
        let view = shot(&mesh, camera);
        assert!(view.triangles.iter().all(|&id| id >= 0), "the outer shell is all around");
    }
}

#[test]
fn neighbouring_triangles_leave_no_crack_and_no_pixel_sees_past_them() {
    // Pixel centres fall exactly on vertices, edges and diagonals of this grid of triangles.
    let n = 16u32;
    let vertices =
        (0..=n).flat_map(|i| (0..=n).map(move |j| DVec3::new(i.into(), j.into(), 0.0))).collect();
    let id = |i: u32, j: u32| i * (n + 1) + j;
    let faces = (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            [[a, b, c], [d, a, c]]
        })
        .collect();
    let grid = Mesh::new(vertices, faces).unwrap();
    for depth in [2.0, 3.0, 7.0] {
        let camera = Pinhole::with_pixel_centres_at_half(
            Intrinsics { width: 16, height: 16, fx: depth, fy: depth, cx: 0.5, cy: 0.5 },
            DAffine3::from_translation(DVec3::new(0.0, 0.0, depth)),
        )
        .unwrap();
        let view = shot(&grid, camera);
        assert!(view.triangles.iter().all(|&id| id >= 0), "{:?}", view.triangles);
        assert!(view.depth.iter().all(|&z| (f64::from(z) / depth - 1.0).abs() < 1e-6));
    }
}

#[test]
fn the_light_comes_from_the_viewer_s_side_slightly_above_and_right() {
    let sphere = ellipsoid(60, DVec3::ONE, DVec3::ZERO);
    let camera = Pinhole::with_pixel_centres_at_half(
        Intrinsics { width: 101, height: 101, fx: 150.0, fy: 150.0, cx: 50.5, cy: 50.5 },
        DAffine3::from_translation(DVec3::Z * 4.0),
    )
    .unwrap();
    let view = shot(&sphere, camera);
    let grey = |u: usize, v: usize| i32::from(view.rgb[(v * 101 + u) * 3]);
    assert!(grey(60, 40) > grey(50, 50) && grey(50, 50) > grey(40, 60));
    // In the middle the normal faces the viewer: .72 (.35 + .65 · .9/|l|).
    let light = 0.9 / (0.25f64.powi(2) + 0.35f64.powi(2) + 0.81).sqrt();
    let expected = 255.0 * 0.72 * (0.35 + 0.65 * light);
    assert!((f64::from(grey(50, 50)) - expected).abs() <= 2.0, "{} {expected}", grey(50, 50));
    assert_eq!((grey(0, 0), view.depth[0]), (255, f32::INFINITY));
    assert!((view.depth[50 * 101 + 50] - 3.0).abs() < 0.01);
}

#[test]
fn creases_stay_sharp_and_gentle_bends_are_smoothed() {
    // Two squares that meet at an angle; at the shared edge smoothing makes both sides equal.
    let bent = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let points = [
            [-1.0, -1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
            [cos, -1.0, sin],
            [cos, 1.0, sin],
        ];
        let faces = vec![[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
        Mesh::new(points.map(DVec3::from_array).to_vec(), faces).unwrap()
    };
    let step_at_edge = |mesh: &Mesh| {
        let pose = DAffine3::from_translation(DVec3::new(0.0, 0.0, 6.0));
        let camera = Pinhole::with_pixel_centres_at_half(
            Intrinsics { width: 64, height: 64, fx: 150.0, fy: 150.0, cx: 32.0, cy: 32.0 },
            pose,
        )
        .unwrap();
        let view = shot(mesh, camera);
        let grey = |u: usize| i32::from(view.rgb[(32 * 64 + u) * 3]);
        (grey(31) - grey(32)).abs()
    };
    assert!(step_at_edge(&bent(0.5)) <= 4);
    assert!(step_at_edge(&bent(1.2)) >= 15, "{}", step_at_edge(&bent(1.2)));
}

#[test]
fn paint_reaches_the_pixels() {
    let mesh = ellipsoid(20, DVec3::ONE, DVec3::ZERO);
    let cameras = rig(&mesh, &RigSettings { count: 3, size: 48, ..Default::default() }).unwrap();
    let settings = RenderSettings { ambient: 1.0, ..Default::default() };
    let task = Task::default();
    let position = |p: DVec3| [p.x, p.y, p.z].map(|x| (0.5 + 0.4 * x) as f32);
    let colours: Vec<[f32; 3]> = mesh.vertices().iter().map(|&p| position(p)).collect();
    let on_surface = |face: usize, weights: [f64; 3]| {
        let corners = mesh.corners(face);
        position((0..3).map(|k| weights[k] * corners[k]).sum())
    };
    let by_vertex =
        render(&mesh, &SurfaceColor::Vertices(&colours), &cameras, &settings, &task).unwrap();
    let by_surface =
        render(&mesh, &SurfaceColor::Surface(&on_surface), &cameras, &settings, &task).unwrap();
    for (one, other) in by_vertex.iter().zip(&by_surface) {
        let largest = one.rgb.iter().zip(&other.rgb).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(largest <= 1);
        // Away from the silhouette the colour says where the pixel's ray met the surface.
        let (camera, middle) = (one.camera, 24 * 48 + 24);
        let point = camera.eye() + camera.ray(24.5, 24.5) * f64::from(one.depth[middle]);
        for k in 0..3 {
            let error = f32::from(one.rgb[middle * 3 + k]) / 255.0 - position(point)[k];
            assert!(error.abs() < 0.03, "{error}");
        }
    }
    let refused = render(&mesh, &SurfaceColor::Vertices(&colours[1..]), &cameras, &settings, &task);
    assert!(refused.unwrap_err().to_string().contains("vertex colours"));
}

#[test]
fn every_mesh_of_the_zoo_is_seen() {
    for (name, mesh) in zoo() {
        let cameras = rig(&mesh, &RigSettings { size: 32, ..Default::default() }).unwrap();
        let settings = RenderSettings::default();
        let views =
            render(&mesh, &SurfaceColor::GREY, &cameras, &settings, &Task::default()).unwrap();
        let covered: usize =
            views.iter().map(|view| view.triangles.iter().filter(|&&id| id >= 0).count()).sum();
        assert!(covered > views.len() * 20, "{name}: {covered} pixels");
        for view in &views {
            for (&id, &depth) in view.triangles.iter().zip(&view.depth) {
                assert!(
                    id < mesh.n_faces() as i32 && (id >= 0) == depth.is_finite() && depth > 0.0,
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn bands_threads_and_repetition_change_nothing() {
    let mesh = lumpy_torus(16);
    let settings = RenderSettings { supersampling: 3, ..Default::default() };
    let cameras = rig(&mesh, &RigSettings { count: 2, size: 500, ..Default::default() }).unwrap();
    let draw =
        || render(&mesh, &SurfaceColor::GREY, &cameras, &settings, &Task::default()).unwrap();
    let views = draw();
    // 500 px · 3² samples take several bands; a window of the same picture takes one.
    let whole = cameras[0];
    let window = Intrinsics { height: 40, cy: whole.cy() - 217.0, ..whole.intrinsics() };
    let window = Pinhole::with_pixel_centres_at_half(window, whole.camera_from_world()).unwrap();
    let part = render(&mesh, &SurfaceColor::GREY, &[window], &settings, &Task::default()).unwrap();
    let offset = 217 * 500;
    assert_eq!(part[0].triangles, views[0].triangles[offset..][..40 * 500]);
    let differing =
        part[0].rgb.iter().zip(&views[0].rgb[offset * 3..]).filter(|(a, b)| a != b).count();
    assert!(differing < 20, "{differing} bytes differ");
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(one_thread.install(draw) == views);
}

#[test]
fn absurd_orders_are_refused() {
    let mesh = lumpy_torus(8);
    let camera = rig(&mesh, &RigSettings::default()).unwrap()[0];
    let settings = RenderSettings::default();
    let order = |mesh: &Mesh, cameras: &[Pinhole], settings: &RenderSettings| {
        render(mesh, &SurfaceColor::GREY, cameras, settings, &Task::default())
            .unwrap_err()
            .to_string()
    };
    let sized = |width, height| {
        let intrinsics = Intrinsics { width, height, ..camera.intrinsics() };
        Pinhole::with_pixel_centres_at_half(intrinsics, camera.camera_from_world()).unwrap()
    };
    assert!(order(&mesh, &[camera, sized(8193, 224)], &settings).starts_with("view 1: width"));
    assert!(order(&mesh, &[sized(224, 8193)], &settings).contains("height"));
    let giant = sized(8192, 8192);
    assert!(order(&mesh, &[giant; 5], &settings).starts_with("pixels of all views"));
    let none = RenderSettings { supersampling: 0, ..settings.clone() };
    assert!(order(&mesh, &[camera], &none).contains("supersampling"));
    let dark = RenderSettings { light: [0.0; 3], ..settings.clone() };
    assert!(order(&mesh, &[camera], &dark).contains("light"));
    let needle = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0], vec![[0, 1, 2]]).unwrap();
    assert!(order(&needle, &[camera], &settings).contains("no area"));
    let stopped = Task::default();
    stopped.cancel();
    assert!(render(&mesh, &SurfaceColor::GREY, &[camera], &settings, &stopped).is_err());
}
