//! The first pose: a global alignment of the mesh with what stands out of a frame.

use semfm_align::{AlignModel, AlignSettings, ObservedCloud, Sim3, align_model};
use semfm_geom::{Mesh, Task, Verdict};

use crate::Result;
use crate::depth_view::DepthView;
use crate::foreground::foreground;
use crate::settings::TrackSettings;
use crate::tracker::DepthFrame;

/// Pieces of a frame's foreground in which the object is sought.
const PIECES: usize = 3;

/// A piece wider than this (metres) is none that a hand takes: three alignments with all of a cluttered table took 26 s.
const WIDEST: f64 = 0.8;

/// Frames between two alignments, at most: each takes a tenth of a second and more, so that the first frames are tried,
/// and then fewer and fewer.
const MOST_WAIT: usize = 16;

/// Seeks an object of which nothing is known but its shape.
pub(crate) struct FirstPose {
    model: AlignModel,
    next_try: usize,
    wait: usize,
}

impl FirstPose {
    /// Prepares a mesh.
    ///
    /// # Errors
    /// As [`AlignModel::new`].
    pub fn new(mesh: &Mesh, settings: &TrackSettings, task: &Task) -> Result<Self> {
        let model = AlignModel::new(mesh, settings.seed, task)?;
        Ok(Self { model, next_try: 0, wait: 1 })
    }

    /// The best pose of the mesh (camera from object) under the mask, or in the largest pieces of the foreground; `None`
    /// where each is refused, and in frames that are not tried.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Cancelled`].
    pub fn seek(
        &mut self,
        number: usize,
        frame: &DepthFrame<'_>,
        view: &DepthView<'_>,
        settings: &TrackSettings,
        task: &Task,
    ) -> Result<Option<Sim3>> {
        if number < self.next_try || !frame.depth.has_depth() {
            return Ok(None);
        }
        self.next_try = number + self.wait;
        self.wait = (2 * self.wait).min(MOST_WAIT);
        let (width, height) = (frame.depth.width(), frame.depth.height());
        let masks: Vec<Vec<bool>> = match frame.mask {
            Some(mask) => vec![mask.to_vec()],
            None => {
                let found = foreground(view, None, f64::INFINITY, PIECES, settings.seed);
                let pieces = found.pieces.iter().filter(|piece| piece.diameter <= WIDEST);
                pieces.map(|piece| found.mask(piece, width, height)).collect()
            }
        };
        let search = AlignSettings {
            scale_range: settings.scale.map(|scale| [scale, scale]),
            seed: settings.seed,
            ..Default::default()
        };
        let mut best: Option<(f64, Sim3)> = None;
        for mask in &masks {
            // Too few points under a mask are nothing found, not a failure.
            let seen = ObservedCloud::from_depth(frame.depth, frame.camera, Some(mask));
            let Ok(observed) = seen else { continue };
            let found = align_model(&self.model, &observed, &search, &task.silent())?;
            let score = found.visibility * found.inlier_share;
            if found.verdict != Verdict::Refuse && best.is_none_or(|(most, _)| score > most) {
                best = Some((score, found.camera_from_object));
            }
        }
        Ok(best.map(|(_, pose)| pose))
    }
}
