//! What frames so far say of each place on the surface.

use semfm_geom::PointIndex;

use crate::Result;
use crate::evidence::{Evidence, Seen};
use crate::model::TrackModel;

/// Frames that a mean reaches back, at most: older ones count less and less (Curless & Levoy 1996 with the cap of Newcombe et
/// al., KinectFusion, 2011).
const MOST_WEIGHT: f32 = 60.0;

/// Logarithm of the odds that a place gains when it is seen, and when it is looked through, and where they end (Hornung et
/// al., OctoMap, 2013): so much evidence one way is undone by as much the other way.
const SEEN: f32 = 0.4;
const THROUGH: f32 = -0.7;
const MOST_ODDS: f32 = 4.0;

/// A deviation of the surface that halves the confidence's logarithm, metres, noise aside.
const DEVIATION: f32 = 0.005;

/// One place.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    /// Logarithm of the odds that surface is there; 0 where nobody looked.
    odds: f32,
    /// Mean distance of what was seen before the surface, metres.
    deviation: f32,
    /// Frames in that mean, up to the cap.
    weight: f32,
    /// Whether it is seen in this frame.
    now: bool,
}

/// One place for each sample of the model; its size does not change.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceMemory {
    places: Vec<Place>,
    /// Weight of the region at each sample; empty without one.
    region: Vec<f32>,
}

/// A summary over the region.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegionState {
    pub confidence: f64,
    pub visible: f64,
    pub observed: f64,
    pub deviation: f64,
}

impl SurfaceMemory {
    /// Nothing seen yet. `region` holds a weight for each vertex.
    pub fn new(model: &TrackModel, region: Option<&[f64]>) -> Self {
        let places = vec![Place::default(); model.samples.len()];
        let weight = |weights: &[f64]| {
            model.samples.iter().map(|s| weights[s.vertex as usize] as f32).collect()
        };
        Self { places, region: region.map(weight).unwrap_or_default() }
    }

    /// No place is seen in this frame.
    pub fn none_visible(&mut self) {
        self.places.iter_mut().for_each(|place| place.now = false);
    }

    /// Takes what a frame says of the places that its pose shows. Hidden places stay as they are.
    pub fn take(&mut self, evidence: &Evidence) {
        self.none_visible();
        for &(id, seen) in &evidence.samples {
            let place = &mut self.places[id as usize];
            let change = match seen {
                Seen::Here(deviation) => {
                    place.now = true;
                    place.weight = (place.weight + 1.0).min(MOST_WEIGHT);
                    place.deviation += (deviation as f32 - place.deviation) / place.weight;
                    SEEN
                }
                Seen::Through => THROUGH,
                Seen::Hidden | Seen::Unknown => continue,
            };
            place.odds = (place.odds + change).clamp(-MOST_ODDS, MOST_ODDS);
        }
    }

    /// How sure it is that surface is at a place as the mesh has it, 0 to 1: with the odds l, the mean deviation d of n
    /// frames and the noise σ,
    ///
    /// > min(1, 2/(1 + e⁻ˡ)) · exp(−½ (max(0, |d| − 2σ/√n)/5 mm)²)
    ///
    /// 1 where nobody looked: that is what the mesh says.
    fn confidence(&self, id: usize, noise: f64) -> f64 {
        let Place { odds, deviation, weight, .. } = self.places[id];
        let there = (2.0 / (1.0 + (-odds).exp())).min(1.0);
        let beyond = (deviation.abs() - 2.0 * noise as f32 / weight.max(1.0).sqrt()).max(0.0);
        f64::from(there * (-0.5 * (beyond / DEVIATION).powi(2)).exp())
    }

    /// The region so far; `None` without one.
    pub fn region(&self, noise: f64) -> Option<RegionState> {
        let total: f64 = self.region.iter().map(|&w| f64::from(w)).sum();
        if total <= 0.0 {
            return None;
        }
        let mean = |value: &dyn Fn(usize) -> f64| {
            let weighted = self.region.iter().enumerate().filter(|(_, w)| **w > 0.0);
            weighted.map(|(id, &w)| f64::from(w) * value(id)).sum::<f64>() / total
        };
        let observed = mean(&|id| f64::from(u8::from(self.places[id].weight > 0.0)));
        let deviation = mean(&|id| f64::from(self.places[id].deviation));
        Some(RegionState {
            confidence: mean(&|id| self.confidence(id, noise)),
            visible: mean(&|id| f64::from(u8::from(self.places[id].now))),
            observed,
            deviation: if observed > 0.0 { deviation / observed } else { 0.0 },
        })
    }

    /// The middle of the region in the inner frame.
    pub fn region_centre(&self, model: &TrackModel) -> Option<semfm_geom::math::DVec3> {
        let total: f64 = self.region.iter().map(|&w| f64::from(w)).sum();
        let samples = model.samples.iter().zip(&self.region);
        let sum: semfm_geom::math::DVec3 = samples.map(|(s, &w)| s.point * f64::from(w)).sum();
        (total > 0.0).then(|| sum / total)
    }

    /// The region's weights by vertex, each times the confidence of the sample nearest to it.
    ///
    /// # Errors
    /// [`semfm_geom::Error`] where the samples make no index.
    pub fn refined(
        &self,
        model: &TrackModel,
        vertices: &[semfm_geom::math::DVec3],
        weights: &[f64],
        noise: f64,
    ) -> Result<Vec<f64>> {
        let points: Vec<_> = model.samples.iter().map(|sample| sample.point).collect();
        let index = PointIndex::new(&points)?;
        let refined = vertices.iter().zip(weights).map(|(&vertex, &weight)| {
            if weight <= 0.0 {
                return weight;
            }
            let (id, _) = index.nearest(model.scale * (vertex - model.centre));
            weight * self.confidence(id, noise)
        });
        Ok(refined.collect())
    }

    /// Bytes that it keeps.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.places[..]) + size_of_val(&self.region[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::{Task, zoo};

    #[test]
    fn what_is_looked_through_or_deviates_loses_and_hidden_places_keep_their_confidence() {
        let mesh = zoo::icosphere(2);
        let model = TrackModel::new(&mesh, 0.05, 0, &Task::default()).unwrap();
        let weights = vec![1.0; mesh.n_vertices()];
        let mut memory = SurfaceMemory::new(&model, Some(&weights));
        let confidence = |memory: &SurfaceMemory| memory.region(0.001).unwrap().confidence;
        let frame = |seen: Seen| Evidence {
            samples: (0..model.samples.len() as u32).map(|id| (id, seen)).collect(),
            ..Default::default()
        };
        assert_eq!(confidence(&memory), 1.0);
        (0..10).for_each(|_| memory.take(&frame(Seen::Hidden)));
        assert_eq!((confidence(&memory), memory.region(0.001).unwrap().observed), (1.0, 0.0));
        (0..10).for_each(|_| memory.take(&frame(Seen::Here(0.0003))));
        assert!(confidence(&memory) > 0.99 && memory.region(0.001).unwrap().visible == 1.0);
        (0..20).for_each(|_| memory.take(&frame(Seen::Through)));
        assert!(confidence(&memory) < 0.1, "{}", confidence(&memory));
        (0..40).for_each(|_| memory.take(&frame(Seen::Here(0.0003))));
        assert!(confidence(&memory) > 0.95, "old evidence decays: {}", confidence(&memory));
        (0..200).for_each(|_| memory.take(&frame(Seen::Here(0.012))));
        assert!(confidence(&memory) < 0.2, "{}", confidence(&memory));
        let refined = memory.refined(&model, mesh.vertices(), &weights, 0.001).unwrap();
        assert!(refined.len() == weights.len() && refined.iter().all(|&w| w < 0.2));
        let bytes = memory.bytes();
        (0..500).for_each(|_| memory.take(&frame(Seen::Here(0.0))));
        assert_eq!(memory.bytes(), bytes);
    }
}
