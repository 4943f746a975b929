//! Grasps as plain numbers and names, for pickles.

use semfm::geom::math::{DQuat, DVec3};
use semfm::grasp::TERMS;
use semfm::grasp::{Grasp, Grasps, Miss, Pose, Reason, SurfaceReport};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
pub struct PickledGrasps {
    grasps: Vec<PickledGrasp>,
    rejected: Vec<(String, usize)>,
    nearest_miss: Option<(String, f64, PickledGrasp)>,
    n_candidates: usize,
    n_survivors: usize,
    /// Triangles, simplified, noise, steps, deviation of the surface that contacts were sought on.
    #[serde(default)]
    surface: (usize, bool, f64, usize, f64),
}

#[derive(Serialize, Deserialize)]
pub struct PickledGrasp {
    position: [f64; 3],
    rotation: [f64; 4],
    width: f64,
    opening: f64,
    contacts: [[f64; 3]; 2],
    normals: [[f64; 3]; 2],
    epsilon: f64,
    #[serde(default)]
    closing_turn: f64,
    score: f64,
    #[serde(default)]
    hold: Option<f64>,
    terms: Vec<(String, f64)>,
}

impl PickledGrasps {
    pub fn of(found: &Grasps) -> Self {
        Self {
            grasps: found.grasps.iter().map(PickledGrasp::of).collect(),
            rejected: found
                .rejected
                .iter()
                .map(|(reason, n)| (reason.name().to_owned(), n))
                .collect(),
            nearest_miss: found.nearest_miss.as_ref().map(|miss| {
                (miss.reason.name().to_owned(), miss.by, PickledGrasp::of(&miss.grasp))
            }),
            n_candidates: found.n_candidates,
            n_survivors: found.n_survivors,
            surface: {
                let SurfaceReport { n_triangles, is_simplified, noise, smoothing_steps, deviation } =
                    found.surface;
                (n_triangles, is_simplified, noise, smoothing_steps, deviation)
            },
        }
    }

    /// The grasps again, without the times that they took. Names that this version does not know are left out.
    pub fn restore(self) -> Grasps {
        let (n_triangles, is_simplified, noise, smoothing_steps, deviation) = self.surface;
        Grasps {
            surface: SurfaceReport {
                n_triangles,
                is_simplified,
                noise,
                smoothing_steps,
                deviation,
            },
            grasps: self.grasps.into_iter().map(PickledGrasp::restore).collect(),
            rejected: self
                .rejected
                .iter()
                .filter_map(|(name, count)| Some((reason_named(name)?, *count)))
                .collect(),
            nearest_miss: self.nearest_miss.and_then(|(name, by, grasp)| {
                Some(Miss { reason: reason_named(&name)?, by, grasp: grasp.restore() })
            }),
            n_candidates: self.n_candidates,
            n_survivors: self.n_survivors,
            stages_ms: Vec::new(),
        }
    }
}

impl PickledGrasp {
    pub fn of(grasp: &Grasp) -> Self {
        Self {
            position: grasp.object_from_tcp.translation.to_array(),
            rotation: grasp.object_from_tcp.rotation.to_array(),
            width: grasp.width,
            opening: grasp.opening,
            contacts: grasp.contacts.map(|p| p.to_array()),
            normals: grasp.normals.map(|n| n.to_array()),
            epsilon: grasp.epsilon,
            closing_turn: grasp.closing_turn,
            score: grasp.score,
            hold: grasp.hold,
            terms: grasp.terms.iter().map(|&(name, x)| (name.to_owned(), x)).collect(),
        }
    }

    pub fn restore(self) -> Grasp {
        let rotation = DQuat::from_array(self.rotation);
        Grasp {
            object_from_tcp: Pose::from_parts(DVec3::from_array(self.position), rotation),
            width: self.width,
            opening: self.opening,
            contacts: self.contacts.map(DVec3::from_array),
            normals: self.normals.map(DVec3::from_array),
            epsilon: self.epsilon,
            closing_turn: self.closing_turn,
            score: self.score,
            hold: self.hold,
            terms: self
                .terms
                .iter()
                .filter_map(|(name, x)| Some((term_named(name)?, *x)))
                .collect(),
        }
    }
}

fn reason_named(name: &str) -> Option<Reason> {
    Reason::ALL.into_iter().find(|reason| reason.name() == name)
}

fn term_named(name: &str) -> Option<&'static str> {
    TERMS.into_iter().find(|term| *term == name)
}
