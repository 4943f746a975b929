//! The six generators: which parts an object of each category has, and where one holds it.

mod containers;
mod controllers;
mod cutting;
mod scissors;
mod shoes;
mod tools;

use semfm_geom::math::DVec3;

use crate::Category;
use crate::sdf::{Chain, Field, smooth_min};
use crate::seed::Draw;

/// Which points of a part belong to the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Grip {
    Never,
    Always,
    /// Between two positions along the part.
    Along(f64, f64),
    /// Where x is below this.
    XBelow(f64),
}

/// One named primitive.
#[derive(Clone)]
pub(crate) struct Part {
    pub name: &'static str,
    pub field: Field,
    pub grip: Grip,
}

impl Part {
    pub(crate) fn holds(&self, p: DVec3) -> bool {
        match self.grip {
            Grip::Never => false,
            Grip::Always => true,
            Grip::Along(low, high) => (low..=high).contains(&self.field.at(p).along),
            Grip::XBelow(x) => p.x < x,
        }
    }
}

impl From<Chain> for Field {
    fn from(chain: Chain) -> Self {
        chain.field()
    }
}

fn part(name: &'static str, field: impl Into<Field>) -> Part {
    Part { name, field: field.into(), grip: Grip::Never }
}

fn grip(name: &'static str, field: impl Into<Field>, grip: Grip) -> Part {
    Part { name, field: field.into(), grip }
}

/// A generated object before meshing: its parts, and the width over which they blend.
pub(crate) struct Blueprint {
    pub kind: &'static str,
    pub parts: Vec<Part>,
    pub blend: f64,
}

impl Blueprint {
    /// Signed distance to the smooth union of all parts.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        let distances = self.parts.iter().map(|part| part.field.at(p).distance);
        distances.reduce(|a, b| smooth_min(a, b, self.blend)).unwrap_or(f64::INFINITY)
    }
}

/// The `instance`-th object of a category (six kinds, in turn) with proportions from `draw`.
pub(crate) fn blueprint(category: Category, instance: usize, draw: &mut Draw) -> Blueprint {
    let kind = instance % 6;
    match category {
        Category::Tools => tools::generate(kind, draw),
        Category::Shoes => shoes::generate(kind, draw),
        Category::Cutting => cutting::generate(kind, draw),
        Category::Containers => containers::generate(kind, draw),
        Category::Controllers => controllers::generate(kind, draw),
        Category::Scissors => scissors::generate(kind, draw),
    }
}
