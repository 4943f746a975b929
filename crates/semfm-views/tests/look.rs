//! How surfaces look beside plain light: occlusion, outlines, directions as colours.

mod shapes;

use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Task};
use semfm_views::openness;
use semfm_views::{RenderSettings, RigSettings, SurfaceColor, View, render, rig};
use shapes::{ellipsoid, lumpy_torus, together};

fn views(mesh: &Mesh, paint: &SurfaceColor<'_>, settings: &RenderSettings) -> Vec<View> {
    let cameras = rig(mesh, &RigSettings { count: 4, size: 96, ..Default::default() }).unwrap();
    render(mesh, paint, &cameras, settings, &Task::default()).unwrap()
}

/// The lowest openness beside the poles, where triangles without area have no direction.
fn lowest(mesh: &Mesh, open: &[f32]) -> f32 {
    let places = mesh.vertices().iter().zip(open);
    let beside = places.filter(|(p, _)| p.truncate().length() > 1e-6);
    beside.map(|(_, &open)| open).fold(1.0, f32::min)
}

#[test]
fn convex_objects_are_open_and_what_is_closed_in_is_not() {
    let ball = ellipsoid(16, DVec3::ONE, DVec3::ZERO);
    assert!(lowest(&ball, &openness(&ball)) > 0.97);
    let shell = ellipsoid(16, DVec3::splat(2.0), DVec3::ZERO);
    let nested = openness(&together(&ball, &shell));
    let (inside, outside) = nested.split_at(ball.n_vertices());
    assert!(inside.iter().all(|&open| open < 0.01));
    assert!(lowest(&shell, outside) > 0.97);
}

#[test]
fn openness_asks_for_no_winding_and_falls_towards_a_hole() {
    let ring = lumpy_torus(24);
    let turned = ring.faces().iter().map(|&[a, b, c]| [a, c, b]).collect();
    let turned = Mesh::new(ring.vertices().to_vec(), turned).unwrap();
    let open = openness(&ring);
    assert_eq!(open, openness(&turned));
    let every_second = |(k, &[a, b, c]): (usize, &[u32; 3])| match k % 2 {
        0 => [a, b, c],
        _ => [a, c, b],
    };
    let faces = ring.faces().iter().enumerate().map(every_second).collect();
    assert_eq!(open, openness(&Mesh::new(ring.vertices().to_vec(), faces).unwrap()));
    let reach = |id: &usize| ring.vertices()[*id].truncate().length();
    let ids = 0..ring.n_vertices();
    let far = ids.clone().max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap();
    let near = ids.min_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap();
    assert!(open[near] + 0.1 < open[far], "{} {}", open[near], open[far]);
    // A sheet in free air is lit from both sides.
    let corners = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
    let sheet = Mesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    assert!(openness(&sheet).iter().all(|&open| open > 0.96));
}

#[test]
fn occlusion_darkens_by_its_strength_and_leaves_depth_alone() {
    let ring = lumpy_torus(24);
    let brightness = |strength: f64| {
        let settings = RenderSettings { occlusion: strength, ..Default::default() };
        let views = views(&ring, &SurfaceColor::GREY, &settings);
        let sum: u64 = views.iter().flat_map(|view| &view.rgb).map(|&byte| u64::from(byte)).sum();
        (sum, views[0].depth.clone())
    };
    let [(none, depth), (half, _), (full, same)] = [0.0, 0.5, 1.0].map(brightness);
    assert!(none > half && half > full);
    assert_eq!(depth, same);
}

#[test]
fn edges_are_drawn_where_the_surface_ends_and_nowhere_else() {
    // A smooth ball: its outline is all there is to draw.
    let ball = ellipsoid(32, DVec3::ONE, DVec3::ZERO);
    let plain = views(&ball, &SurfaceColor::GREY, &RenderSettings::default());
    let black = RenderSettings { edges: 1.0, ..Default::default() };
    let drawn = views(&ball, &SurfaceColor::GREY, &black);
    for (plain, drawn) in plain.iter().zip(&drawn) {
        let width = plain.camera.width() as usize;
        let mut n_edges = 0;
        for (pixel, rgb) in drawn.rgb.chunks_exact(3).enumerate() {
            if plain.triangles[pixel] < 0 {
                continue;
            }
            let beside = [pixel - 1, pixel + 1, pixel - width, pixel + width];
            let outline = beside.iter().any(|&other| plain.triangles[other] < 0);
            assert_eq!(rgb == [0; 3], outline, "pixel {pixel}");
            n_edges += usize::from(outline);
        }
        assert!(n_edges > width);
    }
}

#[test]
fn directions_as_colours_face_the_viewer() {
    let ball = ellipsoid(32, DVec3::ONE, DVec3::ZERO);
    for view in views(&ball, &SurfaceColor::Normals, &RenderSettings::default()) {
        let middle = (48 * 96 + 48) * 3;
        // Straight at the viewer in the middle of a ball: no part to the right, none upwards.
        let [right, up, towards] = [0, 1, 2].map(|k| i32::from(view.rgb[middle + k]));
        assert!((right - 128).abs() < 8 && (up - 128).abs() < 8 && towards > 250);
        let above = (20 * 96 + 48) * 3;
        assert!(view.rgb[above + 1] > 180, "{:?}", &view.rgb[above..above + 3]);
    }
}

#[test]
fn looks_out_of_range_are_named() {
    let ball = ellipsoid(4, DVec3::ONE, DVec3::ZERO);
    let cameras = rig(&ball, &RigSettings::default()).unwrap();
    for (settings, name) in [
        (RenderSettings { occlusion: 1.5, ..Default::default() }, "occlusion"),
        (RenderSettings { edges: f64::NAN, ..Default::default() }, "edges"),
        (RenderSettings { background: [0.0, 2.0, 0.0], ..Default::default() }, "background"),
    ] {
        let answer = render(&ball, &SurfaceColor::GREY, &cameras, &settings, &Task::default());
        let message = answer.unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}
