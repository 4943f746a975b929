//! A stand-in for a vision transformer: patch embeddings of rendered views, simulated.
//!
//! Every part has a prototype (a direction shared by its category, one shared by what the part is
//! for, one of its own); a patch sees the mean of what it covers, background included. On top come
//! what makes real features hard: an offset for each object and each of its parts, a smooth field
//! over the surface, a mix of neighbouring patches and of the whole view, the patch's
//! place in the image, and noise. The three levels set how much of each.

use std::fmt;
use std::str::FromStr;

use rayon::prelude::*;
use semfm_geom::math::DVec3;
use semfm_geom::suggestion::unknown_name;
use semfm_views::{EmbeddedView, PatchEmbeddings, PatchGrid, View};

use crate::object::SynthObject;
use crate::seed::{direction, stream};
use crate::{Error, Result};

/// How hard the features are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Level {
    /// Clean parts, little noise.
    Easy,
    /// About as informative as a real encoder on real objects.
    Medium,
    /// Parts overlap, views disagree, much noise.
    Hard,
}

impl Level {
    /// All levels, easiest first.
    pub const ALL: [Self; 3] = [Self::Easy, Self::Medium, Self::Hard];

    /// The name used at the shell.
    pub fn name(self) -> &'static str {
        match self {
            Self::Easy => "easy",
            Self::Medium => "medium",
            Self::Hard => "hard",
        }
    }

    fn strengths(self) -> &'static Strengths {
        match self {
            Self::Easy => &EASY,
            Self::Medium => &MEDIUM,
            Self::Hard => &HARD,
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Level {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|level| level.name() == text).ok_or_else(|| Error::Unknown {
            what: "level",
            expected: Self::ALL.map(Self::name).join(", "),
            found: unknown_name(text, Self::ALL.map(Self::name)),
        })
    }
}

/// Dimension of the simulated embeddings.
pub const DIM: usize = 384;
/// Side of a square patch in pixels.
pub const PATCH: u32 = 16;

/// How strong each disturbance is, relative to a part's unit prototype.
struct Strengths {
    /// Squared cosine that any two parts of a category share.
    common: f32,
    /// Offset of each object.
    instance: f32,
    /// Offset of each part of each object.
    instance_part: f32,
    /// Smooth field over the surface.
    smooth: f32,
    /// The patch's place in the image.
    position: f32,
    /// White noise of each patch.
    noise: f32,
    /// White noise of each view.
    view: f32,
    /// Share of the view's mean in each patch.
    context: f32,
    /// Share of the neighbouring patches in each patch.
    blur: f32,
    /// Weight of background pixels against the object's.
    background: f32,
}

// Calibrated at medium on six categories and two seeds (`tests/tests/simulated_features.rs`). Halfway to
// easy moves `nearest` by .01 only: what it loses there is grips that are a part of a part, not
// noise. Hard adds so much that views of one part disagree.
const EASY: Strengths = Strengths {
    common: 0.55,
    instance: 0.15,
    instance_part: 0.15,
    smooth: 0.10,
    position: 0.08,
    noise: 0.3,
    view: 0.10,
    context: 0.05,
    blur: 0.10,
    background: 0.5,
};
const MEDIUM: Strengths = Strengths {
    common: 0.65,
    instance: 0.30,
    instance_part: 0.28,
    smooth: 0.20,
    position: 0.15,
    noise: 0.6,
    view: 0.20,
    context: 0.15,
    blur: 0.25,
    background: 0.8,
};
const HARD: Strengths = Strengths {
    common: 0.75,
    instance: 0.40,
    instance_part: 0.40,
    smooth: 0.35,
    position: 0.25,
    noise: 1.0,
    view: 0.30,
    context: 0.30,
    blur: 0.40,
    background: 1.0,
};

/// What a part is for: parts of one group look alike across categories.
fn group(part: &str) -> &'static str {
    match part {
        "handle" | "loop" | "grip" => "grip",
        "collar" => "collar",
        "shank" | "pivot" => "middle",
        "guard" => "guard",
        "head" | "claw" | "blade" => "work",
        "sole" | "heel" => "sole",
        "toe" | "tongue" => "toe",
        "body" => "body",
        "lid" | "spout" => "lid",
        "button" | "pad" => "button",
        _ => "other",
    }
}

/// Embeds rendered views of a procedural object, one vector per 16-pixel patch.
///
/// The views must be of the object's own mesh: their triangles tell which parts a patch covers.
///
/// # Errors
/// [`Error::Views`] where a view names a triangle that the object does not have.
pub fn embed(object: &SynthObject, views: &[View], level: Level) -> Result<Vec<EmbeddedView>> {
    let appearance = Appearance::new(object, level.strengths());
    views.par_iter().enumerate().map(|(i, view)| appearance.embed(object, view, i)).collect()
}

/// Everything about how one object looks to the simulated encoder.
struct Appearance {
    strengths: &'static Strengths,
    key: String,
    /// One vector per part name.
    prototypes: Vec<Vec<f32>>,
    background: Vec<f32>,
    /// Directions of the smooth field, with its waves.
    waves: Vec<(Vec<f32>, DVec3, f64)>,
    /// Directions of the image position.
    places: [Vec<f32>; 4],
}

impl Appearance {
    fn new(object: &SynthObject, strengths: &'static Strengths) -> Self {
        let (category, key) = (object.category.name(), object.name());
        let common = direction(DIM, &["category", category]);
        let instance = direction(DIM, &["instance", &key]);
        let prototypes = object.part_names.iter().map(|name| {
            let mut part = scaled(&direction(DIM, &["part", name]), 0.65f32.sqrt());
            add(&mut part, &direction(DIM, &["group", group(name)]), 0.35f32.sqrt());
            // Mostly the same in every category, with a flavour of its own.
            part.iter_mut().for_each(|x| *x *= 0.85);
            add(
                &mut part,
                &direction(DIM, &["flavour", category, name]),
                (1.0f32 - 0.85 * 0.85).sqrt(),
            );
            let norm = part.iter().map(|x| x * x).sum::<f32>().sqrt();
            let mut prototype = scaled(&common, strengths.common.sqrt());
            add(&mut prototype, &part, (1.0 - strengths.common).sqrt() / norm);
            add(
                &mut prototype,
                &direction(DIM, &["instance part", name, &key]),
                strengths.instance_part,
            );
            add(&mut prototype, &instance, strengths.instance);
            prototype
        });
        let mut background = scaled(&direction(DIM, &["background"]), 0.9);
        add(&mut background, &common, 0.45);
        let mut draw = stream(&["waves", &key]);
        let waves = (0..6)
            .map(|j| {
                let frequency = 3.0 * DVec3::new(draw.normal(), draw.normal(), draw.normal());
                let phase = draw.between(0.0, std::f64::consts::TAU);
                (direction(DIM, &["smooth", &j.to_string(), &key]), frequency, phase)
            })
            .collect();
        let places = [0, 1, 2, 3].map(|j: i32| direction(DIM, &["place", &j.to_string()]));
        Self { strengths, prototypes: prototypes.collect(), background, waves, places, key }
    }

    fn embed(&self, object: &SynthObject, view: &View, number: usize) -> Result<EmbeddedView> {
        let (rows, cols) =
            ((view.camera.height() / PATCH) as usize, (view.camera.width() / PATCH) as usize);
        let contents = (0..rows * cols)
            .map(|patch| self.content_of(object, view, patch / cols, patch % cols))
            .collect::<Result<Vec<PatchContent>>>()?;
        let base: Vec<Vec<f32>> = contents.iter().map(|content| self.base(content)).collect();
        let mut tokens = self.mix_neighbours(&base, &contents, rows, cols);
        self.add_noise(&mut tokens, rows, cols, number);
        let coverage =
            contents.iter().map(|content| (content.covered * 255.0).round() as u8).collect();
        let (width, height) = (cols as u32 * PATCH, rows as u32 * PATCH);
        let grid = PatchGrid { rows, cols, rect: [0.0, 0.0, width as f32, height as f32] };
        let data = tokens.into_iter().flatten().collect();
        let patches = PatchEmbeddings::new(grid, DIM, data, coverage, vec![true; rows * cols])?;
        Ok(EmbeddedView { camera: view.camera, patches })
    }

    /// What one patch covers.
    fn content_of(
        &self,
        object: &SynthObject,
        view: &View,
        row: usize,
        col: usize,
    ) -> Result<PatchContent> {
        let mut content = PatchContent {
            shares: vec![0.0; self.prototypes.len()],
            covered: 0.0,
            place: DVec3::ZERO,
        };
        let mut hits = 0.0;
        let patch = PATCH as usize;
        for y in row * patch..(row + 1) * patch {
            for x in col * patch..(col + 1) * patch {
                let pixel = y * view.camera.width() as usize + x;
                let Ok(triangle) = usize::try_from(view.triangles[pixel]) else { continue };
                let Some(corners) = object.mesh.faces().get(triangle) else {
                    return Err(Error::Views(semfm_views::Error::Invalid {
                        what: format!("triangle of pixel ({x}, {y})"),
                        expected: format!(
                            "one of the object's {} triangles",
                            object.mesh.n_faces()
                        ),
                        found: triangle.to_string(),
                    }));
                };
                content.shares[object.parts[corners[0] as usize] as usize] += 1.0;
                let ray = view.camera.ray(x as f64 + 0.5, y as f64 + 0.5);
                content.place += view.camera.eye() + f64::from(view.depth[pixel]) * ray;
                hits += 1.0;
            }
        }
        let n_pixels = (patch * patch) as f32;
        content.shares.iter_mut().for_each(|share| *share /= n_pixels);
        content.covered = hits as f32 / n_pixels;
        if hits > 0.0 {
            content.place /= hits;
        }
        Ok(content)
    }

    /// Mean of the prototypes that a patch sees, with the smooth field at its place.
    fn base(&self, content: &PatchContent) -> Vec<f32> {
        let behind = (1.0 - content.covered) * self.strengths.background;
        let total = content.covered + behind + 1e-9;
        let mut token = scaled(&self.background, behind / total);
        for (prototype, share) in self.prototypes.iter().zip(&content.shares) {
            add(&mut token, prototype, share / total);
        }
        if content.covered > 0.0 {
            for (wave, frequency, phase) in &self.waves {
                let height = (content.place.dot(*frequency) + phase).sin() / 3f64.sqrt();
                add(&mut token, wave, self.strengths.smooth * height as f32);
            }
        }
        token
    }

    /// Mixes each token with its four neighbours, then with the mean of the object's tokens.
    fn mix_neighbours(
        &self,
        base: &[Vec<f32>],
        contents: &[PatchContent],
        rows: usize,
        cols: usize,
    ) -> Vec<Vec<f32>> {
        let Strengths { blur, context, .. } = *self.strengths;
        let mut tokens: Vec<Vec<f32>> = (0..rows * cols)
            .map(|patch| {
                let (row, col) = (patch / cols, patch % cols);
                let mut token = scaled(&base[patch], 1.0 - blur);
                let beside = [
                    (row.saturating_sub(1), col),
                    ((row + 1).min(rows - 1), col),
                    (row, col.saturating_sub(1)),
                    (row, (col + 1).min(cols - 1)),
                ];
                beside.iter().for_each(|&(r, c)| add(&mut token, &base[r * cols + c], blur / 4.0));
                token
            })
            .collect();
        let mut mean = vec![0.0; DIM];
        let on_object =
            contents.iter().filter(|content| content.covered > 0.0).count().max(1) as f32;
        for (token, _) in tokens.iter().zip(contents).filter(|(_, content)| content.covered > 0.0) {
            add(&mut mean, token, 1.0 / on_object);
        }
        for token in &mut tokens {
            token.iter_mut().for_each(|x| *x *= 1.0 - context);
            add(token, &mean, context);
        }
        tokens
    }

    /// Adds the patch's place in the image, the view's offset and white noise.
    fn add_noise(&self, tokens: &mut [Vec<f32>], rows: usize, cols: usize, number: usize) {
        let mut draw = stream(&["noise", &self.key, &number.to_string()]);
        let unit = 1.0 / (DIM as f64).sqrt();
        let [view, noise] = [self.strengths.view, self.strengths.noise].map(f64::from);
        let offset: Vec<f32> = (0..DIM).map(|_| (view * unit * draw.normal()) as f32).collect();
        for (patch, token) in tokens.iter_mut().enumerate() {
            let x = (patch % cols) as f32 / cols as f32 - 0.5;
            let y = (patch / cols) as f32 / rows as f32 - 0.5;
            let place = [x, y, 2.0 * x * y, x * x - y * y];
            for (direction, amount) in self.places.iter().zip(place) {
                add(token, direction, 2.0 * self.strengths.position * amount);
            }
            add(token, &offset, 1.0);
            token.iter_mut().for_each(|value| *value += (noise * unit * draw.normal()) as f32);
        }
    }
}

/// What a patch covers: the share of each part, of the object, and where it is.
struct PatchContent {
    shares: Vec<f32>,
    covered: f32,
    place: DVec3,
}

fn scaled(vector: &[f32], by: f32) -> Vec<f32> {
    vector.iter().map(|x| x * by).collect()
}

fn add(sum: &mut [f32], vector: &[f32], weight: f32) {
    sum.iter_mut().zip(vector).for_each(|(s, x)| *s += weight * x);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Category, ObjectSettings, make_object, render_views};
    use semfm_geom::Task;

    /// Nothing but what a patch covers.
    const CLEAN: Strengths = Strengths {
        common: 0.55,
        instance: 0.0,
        instance_part: 0.0,
        smooth: 0.0,
        position: 0.0,
        noise: 0.0,
        view: 0.0,
        context: 0.0,
        blur: 0.0,
        background: 0.0,
    };

    #[test]
    fn without_disturbance_a_patch_on_one_part_is_that_parts_prototype() {
        let settings = ObjectSettings { n_vertices: 1500, ..ObjectSettings::default() };
        let mut n_met = 0;
        for category in Category::ALL {
            let object = make_object(category, 0, &settings).unwrap();
            let views = render_views(&object, &Task::default()).unwrap();
            let clean = Appearance::new(&object, &CLEAN);
            let mut met = vec![false; object.part_names.len()];
            for (number, view) in views.iter().enumerate() {
                let patches = clean.embed(&object, view, number).unwrap().patches;
                let cols = patches.grid().cols;
                for (patch, token) in patches.data().chunks_exact(DIM).enumerate() {
                    let (row, col) = (patch / cols, patch % cols);
                    let shares = clean.content_of(&object, view, row, col).unwrap().shares;
                    let Some(own) = shares.iter().position(|&share| share == 1.0) else { continue };
                    met[own] = true;
                    for (part, prototype) in clean.prototypes.iter().enumerate() {
                        let apart = token.iter().zip(prototype).map(|(a, b)| (a - b).powi(2));
                        let apart = apart.sum::<f32>();
                        assert_eq!(apart < 1e-6, part == own, "{category}: {apart}");
                    }
                }
            }
            n_met += met.iter().filter(|&&met| met).count();
        }
        assert!(n_met >= 10, "{n_met} parts fill a patch");
    }

    #[test]
    fn parts_of_a_category_share_the_squared_cosine_that_the_level_sets() {
        let object = make_object(Category::Tools, 0, &ObjectSettings::default()).unwrap();
        let prototypes = Appearance::new(&object, &CLEAN).prototypes;
        for (i, a) in prototypes.iter().enumerate() {
            for (j, b) in prototypes.iter().enumerate() {
                let cosine: f32 = a.iter().zip(b).map(|(x, y)| x * y).sum();
                // Random directions in 384 dimensions are at right angles to about ±.1; parts of
                // one group share up to a third of what the category leaves.
                let (low, high) = if i == j { (0.8, 1.2) } else { (0.4, 0.85) };
                assert!((low..high).contains(&cosine), "{i} {j}: {cosine}");
            }
        }
    }

    #[test]
    fn a_view_of_another_mesh_is_refused() {
        let [small, large] = [500, 3000].map(|n_vertices| {
            let settings = ObjectSettings { n_vertices, ..ObjectSettings::default() };
            make_object(Category::Containers, 0, &settings).unwrap()
        });
        let views = render_views(&large, &Task::default()).unwrap();
        let error = embed(&small, &views, Level::Easy).unwrap_err().to_string();
        assert!(error.contains(&format!("{} triangles", small.mesh.n_faces())), "{error}");
    }

    #[test]
    fn level_names_are_read_back_and_other_words_refused() {
        for level in Level::ALL {
            assert_eq!(level.name().parse::<Level>().unwrap(), level);
        }
        let error = "extreme".parse::<Level>().unwrap_err().to_string();
        assert!(error.contains("extreme") && error.contains("easy, medium, hard"), "{error}");
    }
}
