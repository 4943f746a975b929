//! What procedural objects promise: sound meshes, labels that make sense, damage as ordered.

use semfm_geom::Mesh;
use semfm_geom::connectivity::{MeshReport, edges};
use semfm_synth::{Category, ObjectSettings, SynthObject, make_object};

const KINDS: usize = 6;

fn object(category: Category, instance: usize, settings: ObjectSettings) -> SynthObject {
    make_object(category, instance, &settings).unwrap()
}

/// Volume enclosed, positive where triangles face outwards.
fn volume(object: &SynthObject) -> f64 {
    let corners = (0..object.mesh.n_faces()).map(|face| object.mesh.corners(face));
    corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

fn length(mesh: &Mesh, edge: [u32; 2]) -> f64 {
    let [a, b] = edge.map(|id| mesh.vertices()[id as usize]);
    a.distance(b)
}

/// 1 for an equilateral triangle, 0 for one without area.
fn quality(mesh: &Mesh, face: usize) -> f64 {
    let [a, b, c] = mesh.corners(face);
    let sides = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    4.0 * 3f64.sqrt() * mesh.face_area(face) / sides
}

#[test]
fn every_kind_is_closed_manifold_even_and_labelled() {
    let mut kinds = Vec::new();
    for category in Category::ALL {
        for instance in 0..KINDS {
            let object = object(category, instance, ObjectSettings::default());
            let (mesh, name) = (&object.mesh, format!("{} ({})", object.name(), object.kind));
            let report = MeshReport::new(mesh);
            assert!(report.watertight && report.oriented, "{name}: {report:?}");
            assert_eq!(report.components, 1, "{name}");
            assert_eq!(report.non_manifold_vertices, 0, "{name}");
            assert_eq!(report.degenerate_faces + report.duplicate_faces, 0, "{name}");
            assert_eq!(report.isolated_vertices + report.duplicate_positions, 0, "{name}");
            assert!(volume(&object) > 0.0, "{name} faces inwards");
            assert!(mesh.n_vertices().abs_diff(3000) <= 300, "{name}: {}", mesh.n_vertices());
            assert!((mesh.diagonal() - 1.0).abs() < 0.6, "{name}: {}", mesh.diagonal());

            // Flat blades keep the longest edges, tight curves the shortest.
            let mut lengths: Vec<f64> = edges(mesh).into_iter().map(|e| length(mesh, e)).collect();
            lengths.sort_unstable_by(f64::total_cmp);
            let (median, long) = (lengths[lengths.len() / 2], lengths[lengths.len() * 99 / 100]);
            assert!(long < 3.5 * median, "{name}: edges of {median}, but 1 % above {long}");
            let worst = (0..mesh.n_faces()).map(|face| quality(mesh, face)).fold(1.0, f64::min);
            assert!(worst > 0.02, "{name}: a triangle of quality {worst}");

            assert_eq!(object.parts.len(), mesh.n_vertices());
            assert!(object.part_names.is_sorted() && object.part_names.len() >= 2, "{name}");
            for (part, part_name) in object.part_names.iter().enumerate() {
                let n = object.parts.iter().filter(|&&p| usize::from(p) == part).count();
                assert!(n > 0, "{name}: nothing of {part_name} is to be seen");
            }
            let n_grip = object.region.iter().filter(|&&grip| grip).count() as f64;
            let share = n_grip / mesh.n_vertices() as f64;
            assert!((0.02..0.75).contains(&share), "{name}: {share} of it is grip");
            kinds.push(object.kind);
        }
    }
    kinds.sort_unstable();
    kinds.dedup();
    assert_eq!(kinds.len(), KINDS * Category::ALL.len(), "as many kinds as objects");
}

#[test]
fn the_vertex_count_is_the_one_asked_for() {
    for n_vertices in [600, 2000, 8000] {
        for category in [Category::Cutting, Category::Containers] {
            let settings = ObjectSettings { n_vertices, ..ObjectSettings::default() };
            let found = object(category, 1, settings).mesh.n_vertices();
            assert!(found.abs_diff(n_vertices) <= n_vertices / 10, "{category}: {found}");
        }
    }
}

#[test]
fn seeds_and_instances_make_different_objects_and_the_same_ones_again() {
    let [first, again, other_seed, next_hammer] =
        [(0, 0), (0, 0), (0, 1), (KINDS, 0)].map(|(instance, seed)| {
            let settings = ObjectSettings { n_vertices: 800, seed, ..ObjectSettings::default() };
            object(Category::Tools, instance, settings).mesh.hash()
        });
    assert_eq!(first, again);
    assert_ne!(first, other_seed);
    assert_ne!(first, next_hammer, "the next hammer has other proportions");
}

#[test]
fn holes_open_the_surface_and_floaters_hover_beside_it() {
    let intact = ObjectSettings { n_vertices: 2000, ..ObjectSettings::default() };
    for category in [Category::Tools, Category::Containers] {
        let holed = ObjectSettings { holes: 3, ..intact.clone() };
        let report = MeshReport::new(&object(category, 0, holed).mesh);
        assert!(report.boundary_edges > 0, "{category}: {report:?}");
        assert!(report.non_manifold_edges == 0 && report.isolated_vertices == 0, "{category}");

        let floating = ObjectSettings { floaters: 2, ..intact.clone() };
        let report = MeshReport::new(&object(category, 0, floating).mesh);
        assert!((2..=3).contains(&report.components), "{category}: {report:?}");
        assert!(report.watertight, "{category}: a floater is closed too");
    }
}

#[test]
fn category_names_are_read_back_and_other_words_refused() {
    for category in Category::ALL {
        assert_eq!(category.name().parse::<Category>().unwrap(), category);
    }
    let error = "hats".parse::<Category>().unwrap_err().to_string();
    assert!(error.contains("hats") && error.contains("shoes"), "{error}");
}
