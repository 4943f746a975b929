//! Objects as files, and how the levels differ.

use semfm_geom::{Task, io::read_mesh};
use semfm_synth::{
    Category, Level, ObjectSettings, SynthObject, embed, make_object, render_views, write_object,
};
use semfm_views::View;
use semfm_views::mcap::EmbeddingsFile;

fn object(category: Category, instance: usize, n_vertices: usize) -> SynthObject {
    let settings = ObjectSettings { n_vertices, ..ObjectSettings::default() };
    make_object(category, instance, &settings).unwrap()
}

/// The vertices of a list of ids as one flag for each of `n`.
fn mask_of(ids: &serde_json::Value, n: usize) -> Vec<bool> {
    let mut mask = vec![false; n];
    ids.as_array().unwrap().iter().for_each(|id| mask[id.as_u64().unwrap() as usize] = true);
    mask
}

#[test]
fn files_say_what_the_object_is() {
    let folder = tempfile::tempdir().unwrap();
    let kettle = object(Category::Containers, 1, 1000);
    let files = write_object(folder.path(), &kettle, Level::Medium, &Task::default()).unwrap();

    let mesh = read_mesh(&files.mesh).unwrap().mesh;
    assert_eq!(mesh.hash(), kettle.mesh.hash());

    let truth = std::fs::read_to_string(&files.truth).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    let n = mesh.n_vertices();
    assert_eq!(mask_of(&truth["region"]["vertices"], n), kettle.region);
    for (part, name) in kettle.part_names.iter().enumerate() {
        let own: Vec<bool> = kettle.parts.iter().map(|&p| usize::from(p) == part).collect();
        assert_eq!(mask_of(&truth["parts"][name], n), own, "{name}");
    }

    let embeddings = EmbeddingsFile::read(&files.embeddings).unwrap();
    embeddings.check_mesh(&mesh).unwrap();
    assert!(embeddings.metadata.simulated);
    assert_eq!(embeddings.metadata.encoder, "simulated/medium");
    assert_eq!(embeddings.metadata.rolls, 1);
    assert_eq!(embeddings.views.len(), 14);
}

#[test]
fn the_same_bytes_at_every_thread_count() {
    let written = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            let folder = tempfile::tempdir().unwrap();
            let shears = object(Category::Scissors, 1, 1000);
            let files =
                write_object(folder.path(), &shears, Level::Hard, &Task::default()).unwrap();
            [files.mesh, files.truth, files.embeddings].map(|path| std::fs::read(path).unwrap())
        })
    };
    let (alone, together) = (written(1), written(4));
    for (what, (a, b)) in ["obj", "json", "mcap"].iter().zip(alone.iter().zip(&together)) {
        assert!(a == b, "{what} differs between one thread and four");
    }
}

/// Mean of unit tokens per part over an object, and the tokens of patches on one part alone.
struct PartTokens {
    means: Vec<(&'static str, Vec<f32>)>,
    tokens: Vec<(&'static str, Vec<f32>)>,
}

impl PartTokens {
    fn new(object: &SynthObject, views: &[View], level: Level) -> Self {
        let embedded = embed(object, views, level).unwrap();
        let mut tokens = Vec::new();
        for (view, embedded) in views.iter().zip(&embedded) {
            for (patch, token) in
                embedded.patches.data().chunks_exact(embedded.patches.dim()).enumerate()
            {
                if let Some(part) = only_part(object, view, patch, embedded.patches.grid().cols) {
                    let norm = token.iter().map(|x| x * x).sum::<f32>().sqrt();
                    tokens.push((part, token.iter().map(|x| x / norm).collect::<Vec<_>>()));
                }
            }
        }
        let means = object.part_names.iter().filter_map(|&name| {
            let own: Vec<_> = tokens.iter().filter(|(part, _)| *part == name).collect();
            let (_, first) = own.first()?;
            let mut mean = vec![0.0; first.len()];
            for (_, token) in &own {
                mean.iter_mut().zip(token).for_each(|(m, x)| *m += x / own.len() as f32);
            }
            Some((name, mean))
        });
        Self { means: means.collect(), tokens }
    }
}

/// The part that covers all of a patch, if one does.
fn only_part(object: &SynthObject, view: &View, patch: usize, cols: usize) -> Option<&'static str> {
    let side = view.camera.width() as usize / cols;
    let (row, col) = (patch / cols * side, patch % cols * side);
    let part_at = |x: usize, y: usize| {
        let triangle = view.triangles[y * view.camera.width() as usize + x];
        let corner = object.mesh.faces().get(usize::try_from(triangle).ok()?)?[0];
        Some(object.part_names[usize::from(object.parts[corner as usize])])
    };
    let first = part_at(col, row)?;
    let pixels = (0..side * side).map(|i| part_at(col + i % side, row + i / side));
    { pixels }.all(|part| part == Some(first)).then_some(first)
}

/// How much nearer the patches of another object are to the mean of their own part than to that of
/// any other part: 1 where they coincide with it, 0 where they lie in between, less where they are
/// nearer to another part. Squared distances, mean over all patches on one part.
fn clearness(level: Level) -> f64 {
    let (mut sum, mut n_patches) = (0.0, 0);
    for category in [Category::Tools, Category::Containers, Category::Scissors] {
        let [one, other] = [0, 5].map(|instance| {
            let object = object(category, instance, 1500);
            let views = render_views(&object, &Task::default()).unwrap();
            PartTokens::new(&object, &views, level)
        });
        for (part, token) in &other.tokens {
            // Squared distances to the mean of the own part and to the nearest of the others.
            let [own, rest] = [true, false].map(|own| {
                let parts = one.means.iter().filter(|(name, _)| (name == part) == own);
                parts.map(|(_, mean)| distance_squared(mean, token)).min_by(f32::total_cmp)
            });
            if let (Some(own), Some(rest)) = (own, rest) {
                sum += f64::from((rest - own) / (rest + own));
                n_patches += 1;
            }
        }
    }
    sum / f64::from(n_patches)
}

fn distance_squared(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[test]
fn each_level_is_harder_than_the_one_before() {
    let [easy, medium, hard] = Level::ALL.map(clearness);
    assert!(hard > 0.0, "even hard features tell parts apart: {hard}");
    assert!(easy > 1.3 * medium && medium > 1.3 * hard, "{easy} {medium} {hard}");
}
