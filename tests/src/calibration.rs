//! How well each method carries the grip between procedural objects with simulated features: what
//! the strengths of the simulated encoder are calibrated by.

use semfm::fmap::{Method, metrics::iou};
use semfm::{Meaning, PipelineSettings, PreparedObject, Region, Task, transfer};
use semfm_synth::{Category, Level, ObjectSettings, SynthObject, embed, make_object, render_views};

/// What to measure.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// Difficulty of the features.
    pub level: Level,
    /// The methods, each with its own constants and its own lifting.
    pub methods: &'a [Method],
    /// Seeds of the objects.
    pub seeds: std::ops::Range<u64>,
    /// Objects of each category and seed; all ordered pairs among them are carried.
    pub n_objects: usize,
}

/// Vertex IoU of every pair, by category and method.
#[derive(Clone, Debug)]
pub struct Scores {
    methods: Vec<Method>,
    /// Category, place in `methods`, IoU.
    rows: Vec<(Category, usize, f64)>,
}

/// Result of a measurement.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

impl Scores {
    /// Carries the grip between all ordered pairs of objects within each category and seed.
    ///
    /// # Errors
    /// Whatever a step reports: procedural objects give none a reason.
    pub fn measure(plan: &Plan<'_>) -> Result<Self> {
        let mut scores = Self { methods: plan.methods.to_vec(), rows: Vec::new() };
        for category in Category::ALL {
            for seed in plan.seeds.clone() {
                let objects = (0..plan.n_objects)
                    .map(|instance| {
                        let settings = ObjectSettings { seed, ..ObjectSettings::default() };
                        Actor::new(make_object(category, instance, &settings)?, plan.level)
                    })
                    .collect::<Result<Vec<_>>>()?;
                for (i, source) in objects.iter().enumerate() {
                    for (_, target) in objects.iter().enumerate().filter(|&(j, _)| j != i) {
                        for (k, &method) in plan.methods.iter().enumerate() {
                            scores.rows.push((category, k, source.carry_to(target, method)?));
                        }
                    }
                }
            }
        }
        Ok(scores)
    }

    /// Mean over all pairs; none for a method that was not measured.
    pub fn mean(&self, method: Method) -> Option<f64> {
        self.mean_where(method, |_| true)
    }

    /// Mean over the pairs of one category.
    pub fn mean_of(&self, category: Category, method: Method) -> Option<f64> {
        self.mean_where(method, |c| c == category)
    }

    fn mean_where(&self, method: Method, wanted: impl Fn(Category) -> bool) -> Option<f64> {
        let place = self.methods.iter().position(|&m| m == method)?;
        let chosen = self.rows.iter().filter(|&&(c, k, _)| k == place && wanted(c));
        let (sum, n) = chosen.fold((0.0, 0), |(sum, n), &(_, _, iou)| (sum + iou, n + 1));
        (n > 0).then(|| sum / f64::from(n))
    }
}

impl std::fmt::Display for Scores {
    /// A table: a row for each method, a column for each category.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "| method |")?;
        Category::ALL.iter().try_for_each(|category| write!(f, " {category} |"))?;
        write!(f, " mean |\n|{}", "---|".repeat(Category::ALL.len() + 2))?;
        for &method in &self.methods {
            write!(f, "\n| {method} |")?;
            for category in Category::ALL {
                write!(f, " {:.2} |", self.mean_of(category, method).unwrap_or(f64::NAN))?;
            }
            write!(f, " {:.3} |", self.mean(method).unwrap_or(f64::NAN))?;
        }
        Ok(())
    }
}

/// An object with its true grip, prepared as the published method wants it and as ours do.
struct Actor {
    grip: Region,
    as_published: PreparedObject,
    as_ours: PreparedObject,
}

impl Actor {
    fn new(object: SynthObject, level: Level) -> Result<Self> {
        let task = Task::default();
        let views = embed(&object, &render_views(&object, &task)?, level)?;
        let as_wanted_by = |method| {
            let settings = PipelineSettings::of(method);
            PreparedObject::new(object.mesh.clone(), Meaning::Views(&views), &settings, &task)
        };
        let (as_published, as_ours) = (as_wanted_by(Method::Semfm)?, as_wanted_by(Method::Fused)?);
        let held: Vec<u32> =
            (0..).zip(&object.region).filter(|(_, held)| **held).map(|(id, _)| id).collect();
        let grip = Region::from_vertices(object.mesh.n_vertices(), &held)?;
        Ok(Self { grip, as_published, as_ours })
    }

    fn prepared(&self, method: Method) -> &PreparedObject {
        if method == Method::Semfm { &self.as_published } else { &self.as_ours }
    }

    /// IoU on the target's vertices as read.
    fn carry_to(&self, target: &Self, method: Method) -> Result<f64> {
        let settings = PipelineSettings::of(method).transfer;
        let (source, onto) = (self.prepared(method), target.prepared(method));
        let carried = transfer(source, onto, &self.grip, &settings, &Task::default())?;
        Ok(iou(&carried.region, &target.grip)?)
    }
}
