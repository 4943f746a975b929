//! The built-in encoder on rendered views. Its numbers are compared with another implementation's in
//! `python/tests/test_builtin_encoder.py`.

use semfm_encoder::rendered_views::RenderedObject;
use semfm_encoder::{
    BUILTIN_ENCODERS, EncodedViews, Encoder, NetEncoder, builtin_encoder, open_encoder,
};
use semfm_geom::{Mesh, Task, zoo};
use semfm_views::{Renderer, RigSettings, View};

const N_VIEWS: usize = 3;

fn rendered<'a>(mesh: &'a Mesh, encoder: &NetEncoder, size: u32) -> RenderedObject<'a> {
    let mut settings = encoder.wants().views;
    settings.rig = RigSettings { count: N_VIEWS, size, ..settings.rig };
    RenderedObject::new(mesh, &settings, &Renderer::cpu(), &Task::default()).unwrap()
}

fn encoded(object: RenderedObject<'_>, rolls: u32) -> EncodedViews {
    let encoder = builtin_encoder().unwrap();
    encoder.encode(&[object], rolls, &Task::default()).unwrap().remove(0)
}

fn cosine(a: &[f32], b: &[f32]) -> f32 {
    let product = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    product(a, b) / (product(a, a) * product(b, b)).sqrt()
}

#[test]
fn every_built_in_encoder_opens_by_its_name() {
    let mut names: Vec<&str> = BUILTIN_ENCODERS.iter().map(|encoder| encoder.name).collect();
    for name in &names {
        let encoder = open_encoder(name, &Default::default()).unwrap();
        assert_eq!(encoder.identity().name, *name);
        let digits = encoder.identity().version.split_once('+').unwrap().1.len();
        assert_eq!(digits, 12, "the version holds the hash of the content");
    }
    names.dedup();
    assert_eq!(names.len(), BUILTIN_ENCODERS.len());
}

#[test]
fn tokens_are_unit_vectors_one_for_each_patch() {
    let mesh = zoo::torus(40, 20);
    let encoder = builtin_encoder().unwrap();
    let size = encoder.header().size as u32;
    let EncodedViews { views, rolls, .. } = encoded(rendered(&mesh, &encoder, size), 1);
    assert_eq!((views.len(), rolls), (N_VIEWS, 1));
    for view in views {
        let (grid, side) = (view.patches.grid(), encoder.header().size / encoder.header().patch);
        assert_eq!((grid.rows, grid.cols, view.patches.dim()), (side, side, encoder.dim()));
        assert_eq!(grid.rect, [0.0, 0.0, size as f32, size as f32]);
        for patch in 0..view.patches.n_patches() {
            let token = view.patches.vector(patch);
            assert!((token.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-5);
        }
        let covered = view.patches.coverage();
        assert!(covered.contains(&0) && covered.contains(&255));
    }
}

#[test]
fn the_numbers_do_not_depend_on_threads_or_company() {
    let (torus, ball) = (zoo::torus(40, 20), zoo::icosphere(3));
    let encoder = builtin_encoder().unwrap();
    let encode = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let objects = [rendered(&torus, &encoder, 224), rendered(&ball, &encoder, 224)];
        pool.install(|| encoder.encode(&objects, 2, &Task::default()).unwrap())
    };
    let (one, three) = (encode(1), encode(3));
    assert_eq!(one, three);
    assert_eq!(one[0].views.len(), N_VIEWS);
    assert_eq!(one[1], encoded(rendered(&ball, &encoder, 224), 2));
}

/// The picture with its columns as rows: turned by a quarter, counter-clockwise.
fn turned(view: &View) -> View {
    let side = view.camera.width() as usize;
    let place = |i: usize| (i % side) * side + side - 1 - i / side;
    View {
        rgb: (0..side * side).flat_map(|i| view.rgb[3 * place(i)..][..3].to_vec()).collect(),
        depth: (0..side * side).map(|i| view.depth[place(i)]).collect(),
        triangles: (0..side * side).map(|i| view.triangles[place(i)]).collect(),
        ..view.clone()
    }
}

#[test]
fn four_rolls_turn_with_the_picture() {
    // Half of a torus, so that no picture is its own turned copy.
    let whole = zoo::torus(40, 20);
    let faces = whole.faces()[..whole.n_faces() / 2].to_vec();
    let mesh = Mesh::new(whole.vertices().to_vec(), faces).unwrap();
    let encoder = builtin_encoder().unwrap();
    let object = rendered(&mesh, &encoder, 224);
    let mut quarter = object.clone();
    quarter.views = object.views.iter().map(turned).collect();
    let (upright, quarter) = (encoded(object, 4), encoded(quarter, 4));
    for (a, b) in upright.views.iter().zip(&quarter.views) {
        let side = a.patches.grid().cols;
        for i in 0..a.patches.n_patches() {
            let place = (i % side) * side + side - 1 - i / side;
            // The same four pictures, summed in another order.
            assert!(cosine(b.patches.vector(i), a.patches.vector(place)) > 0.99999);
            assert_eq!(b.patches.coverage()[i], a.patches.coverage()[place]);
        }
    }
}

#[test]
fn pictures_that_are_not_whole_patches_and_other_rolls_are_refused() {
    let mesh = zoo::icosphere(2);
    let encoder = builtin_encoder().unwrap();
    let task = Task::default();
    let error = encoder.encode(&[rendered(&mesh, &encoder, 100)], 1, &task).unwrap_err();
    assert!(error.to_string().contains("multiples of 16"), "{error}");
    let error = encoder.encode(&[rendered(&mesh, &encoder, 64)], 3, &task).unwrap_err();
    assert!(error.to_string().contains("rolls: expected 1, 2 or 4"), "{error}");
    assert!(encoder.encode(&[rendered(&mesh, &encoder, 64)], 1, &task).is_ok());
    assert!(encoder.encode(&[], 1, &task).unwrap().is_empty());

    let stopped = Task::default();
    stopped.cancel();
    assert!(encoder.encode(&[rendered(&mesh, &encoder, 64)], 1, &stopped).is_err());
}
