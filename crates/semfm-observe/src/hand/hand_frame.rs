//! A frame of a demonstration: its files, and what the hand in it touches.

use std::path::{Path, PathBuf};

use semfm_align::Sim3;
use semfm_geom::Mesh;
use semfm_geom::math::{DAffine3, DMat4, DVec3};

use super::files::named;
use super::{
    Contact, ContactSettings, Hand, HandShift, LARGEST, find_contact, read_hand, read_vertex_ids,
};
use crate::observation::{Mask, Observation};
use crate::observation_files::ObservationFiles;
use crate::{Error, Result};

/// The files of a hand in one frame. At least a hand, or a depth image with the mask of one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HandFiles {
    /// The hand ([`read_hand`]); without one it is what the mask shows, lifted by the depth.
    pub hand: Option<PathBuf>,
    /// Ids of the vertices that are the hand, where the file is a whole body ([`read_vertex_ids`]).
    pub vertices: Option<PathBuf>,
    /// Whether the hand stands in the file as in a mirror: a left one out of a network that knows right ones.
    pub is_mirrored: bool,
    /// Depth, calibration and the hand's mask: the hand is brought to its measured depth. Without a depth image the mask
    /// only cuts the hand out of a body.
    pub seen: Option<ObservationFiles>,
    /// Focal length in pixels that the hand was made with, where it is not the camera's.
    pub focal: Option<f64>,
    /// How the object stands before the camera; without it hand and mesh are in one frame, in metres.
    pub camera_from_object: Option<Sim3>,
}

/// A hand in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct HandFrame {
    /// The hand, in the camera's frame where the object's pose is known, else in the object's.
    pub hand: Hand,
    /// How the object stands before the camera.
    pub camera_from_object: Option<Sim3>,
    /// How the hand was brought to its measured depth, where it was.
    pub shift: Option<HandShift>,
}

impl HandFiles {
    /// The files, for messages and for what must not be replaced.
    pub fn paths(&self) -> Vec<&Path> {
        let seen = self.seen.iter().flat_map(ObservationFiles::paths);
        let own = [&self.hand, &self.vertices].into_iter().filter_map(|path| path.as_deref());
        own.chain(seen).collect()
    }

    /// Reads the hand and does to it what the files ask for.
    ///
    /// # Errors
    /// [`Error::Invalid`] for neither a hand nor a mask with depth; those of [`read_hand`], [`Hand::cut_to`], [`Hand::cut_by`] and
    /// [`Hand::at_measured_depth`].
    pub fn read(&self) -> Result<HandFrame> {
        let seen = self.seen.as_ref().map(ObservationFiles::read).transpose()?;
        let with_mask = seen.as_ref().and_then(|seen| Some((seen, seen.masks().first()?)));
        let (hand, shift) = match (&self.hand, with_mask) {
            (Some(path), None) => (self.hand_of(path)?, None),
            (Some(path), Some((seen, mask))) => {
                let (hand, is_cut) = (self.hand_of(path)?, self.vertices.is_some());
                let placed = hand.before_camera(seen, mask, self.focal, is_cut);
                placed.map_err(|error| named(path, error))?
            }
            (None, Some((seen, mask))) => (Hand::from_mask(seen, mask)?, None),
            (None, None) => {
                return Err(Error::invalid("hand", "a file, or a mask with depth", "neither"));
            }
        };
        Ok(HandFrame { hand, camera_from_object: self.camera_from_object, shift })
    }

    /// The hand of a file, turned back and cut out of a body where that was asked for.
    fn hand_of(&self, path: &Path) -> Result<Hand> {
        let hand = read_hand(path)?;
        let hand = if self.is_mirrored { hand.mirrored() } else { hand };
        match &self.vertices {
            Some(ids) => hand.cut_to(&read_vertex_ids(ids)?).map_err(|error| named(ids, error)),
            None => Ok(hand),
        }
    }
}

impl Hand {
    /// The hand as a camera saw it under its mask: cut out of a whole body, unless it `is_cut` already, and brought to its
    /// measured depth where the observation has depth. `focal` is the focal length in pixels that the hand was made with,
    /// where it is not the camera's.
    ///
    /// # Errors
    /// As [`Hand::cut_by`] and [`Hand::at_measured_depth`].
    pub fn before_camera(
        self,
        seen: &Observation,
        mask: &Mask,
        focal: Option<f64>,
        is_cut: bool,
    ) -> Result<(Self, Option<HandShift>)> {
        let is_body = !is_cut && focal.is_none() && self.diagonal() > LARGEST;
        let hand = if is_body { self.cut_by(seen, mask)? } else { self };
        if seen.depth().is_none() {
            return Ok((hand, None));
        }
        let (hand, shift) = hand.at_measured_depth(seen, mask, focal)?;
        Ok((hand, Some(shift)))
    }
}

impl HandFrame {
    /// What the hand touches ([`find_contact`]). Where the object's pose is known, it says how large a unit of the mesh is,
    /// and where the camera stood.
    ///
    /// # Errors
    /// As [`find_contact`].
    pub fn contact(&self, mesh: &Mesh, settings: &ContactSettings) -> Result<Contact> {
        let Some(camera_from_object) = &self.camera_from_object else {
            return find_contact(mesh, &self.hand, settings);
        };
        let object_from_camera = camera_from_object.inverse();
        let rows = DMat4::from_cols_array_2d(&object_from_camera.to_rows()).transpose();
        let hand = self.hand.transformed(&DAffine3::from_mat4(rows));
        let settings = ContactSettings {
            metres_per_unit: camera_from_object.scale,
            viewpoint: Some(object_from_camera.apply(DVec3::ZERO)),
            ..*settings
        };
        find_contact(mesh, &hand, &settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    #[test]
    fn a_hand_before_the_camera_touches_what_stands_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hand.obj");
        // A ball of radius 1 that is 5 cm large, at 0.6 m; a hand of radius 4 cm that rests on its right side.
        let ball = zoo::icosphere(4);
        let pose = Sim3::from_rows([
            [0.0, -0.05, 0.0, 0.0],
            [0.05, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.05, 0.6],
            [0.0, 0.0, 0.0, 1.0],
        ])
        .unwrap();
        let points = ball.vertices().iter().map(|p| DVec3::new(0.089, 0.0, 0.6) + 0.04 * *p);
        let hand = Mesh::new(points.collect(), ball.faces().to_vec()).unwrap();
        semfm_geom::io::write_mesh(&path, &hand).unwrap();
        let files =
            HandFiles { hand: Some(path), camera_from_object: Some(pose), ..Default::default() };
        let contact = files.read().unwrap().contact(&ball, &ContactSettings::default()).unwrap();
        for (v, weight) in contact.weights.iter().enumerate() {
            // The camera's x is the object's −y: right is there where y = −1.
            assert!(*weight < 0.5 || ball.vertices()[v].y < -0.8, "{v}");
        }
        assert!(contact.area > 0.05);
        assert!(HandFiles::default().read().unwrap_err().to_string().contains("neither"));
    }
}
