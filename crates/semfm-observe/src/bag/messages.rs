//! `sensor_msgs/CameraInfo` and `tf2_msgs/TFMessage`.

use semfm_geom::math::{DAffine3, DQuat, DVec3};
use semfm_geom::{Intrinsics, Pinhole};
use semfm_views::mcap::CdrReader;

use super::compressed_depth::Fault;
use crate::distortion::Distortion;
use crate::intrinsics::Calibration;

pub(super) const CAMERA_INFO: &str = "sensor_msgs/msg/CameraInfo";
pub(super) const TF_MESSAGE: &str = "tf2_msgs/msg/TFMessage";

/// A camera as its driver describes it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CameraInfo {
    pub frame: String,
    width: u32,
    height: u32,
    model: String,
    d: Vec<f64>,
    k: [f64; 9],
    p: [f64; 12],
    binning: [u32; 2],
}

impl CameraInfo {
    pub fn read(message: &[u8]) -> Result<Self, Fault> {
        let read = || {
            let mut cdr = CdrReader::new(message)?;
            let (_, frame) = cdr.header()?;
            let (height, width) = (cdr.u32()?, cdr.u32()?);
            let model = cdr.string()?.to_owned();
            let (d, k) = (cdr.f64s()?, cdr.f64_array()?);
            let _rotation: [f64; 9] = cdr.f64_array()?;
            let p = cdr.f64_array()?;
            let binning = [cdr.u32()?, cdr.u32()?];
            Some(Self { frame: frame.to_owned(), width, height, model, d, k, p, binning })
        };
        read().ok_or_else(|| Fault::new("a CameraInfo in CDR", "fewer bytes, or another encoding"))
    }

    /// Width and height of its pictures.
    pub fn size(&self) -> [usize; 2] {
        [self.width as usize, self.height as usize]
    }

    /// The camera of pictures of a size: without distortion and of the projection `P` where they are rectified already.
    pub fn calibration(
        &self,
        [width, height]: [usize; 2],
        is_rectified: bool,
    ) -> Result<Calibration, Fault> {
        if [self.width as usize, self.height as usize] != [width, height] {
            let expected = format!("a camera of {width} × {height} pixels, as its pictures");
            return Err(Fault::new(expected, format!("{} × {}", self.width, self.height)));
        }
        if self.binning.iter().any(|&n| n > 1) {
            return Err(Fault::new("a camera without binning", format!("{:?}", self.binning)));
        }
        let has_projection = self.p[0] != 0.0;
        let [fx, fy, cx, cy] = if is_rectified && has_projection {
            [self.p[0], self.p[5], self.p[2], self.p[6]]
        } else {
            [self.k[0], self.k[4], self.k[2], self.k[5]]
        };
        if fx == 0.0 {
            return Err(Fault::new("a calibrated camera", "focal length 0: nobody calibrated it"));
        }
        let intrinsics = Intrinsics { width: self.width, height: self.height, fx, fy, cx, cy };
        let camera = Pinhole::with_pixel_centres_at_integers(intrinsics, DAffine3::IDENTITY);
        let camera = camera.map_err(|error| Fault::new("a camera", error.to_string()))?;
        Ok(Calibration { camera, distortion: if is_rectified { None } else { self.lens()? } })
    }

    fn lens(&self) -> Result<Option<Distortion>, Fault> {
        if self.d.iter().all(|&x| x == 0.0) && !is_fisheye(&self.model) {
            return Ok(None);
        }
        let lens = match self.model.as_str() {
            model if is_fisheye(model) => Distortion::equidistant(&self.d).map(Some),
            "" | "plumb_bob" | "rational_polynomial" => Distortion::brown(&self.d),
            other => {
                let expected = "distortion of plumb_bob, rational_polynomial or equidistant (image_proc takes it out)";
                return Err(Fault::new(expected, format!("`{other}`")));
            }
        };
        lens.map_err(|error| Fault::new("a lens that is known", error.to_string()))
    }
}

fn is_fisheye(model: &str) -> bool {
    matches!(model, "equidistant" | "fisheye")
}

/// How one frame stands in another at a time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Transform {
    pub time: u64,
    pub parent: String,
    pub child: String,
    pub parent_from_child: DAffine3,
}

/// The transforms of a message.
pub(super) fn transforms(message: &[u8]) -> Result<Vec<Transform>, Fault> {
    let fault = || Fault::new("a TFMessage in CDR", "fewer bytes, or another encoding");
    let mut cdr = CdrReader::new(message).ok_or_else(fault)?;
    // A transform takes at least its seven numbers.
    let n = cdr.length(56).ok_or_else(fault)?;
    let mut all = Vec::with_capacity(n);
    for _ in 0..n {
        let mut read = || {
            let (time, parent) = cdr.header()?;
            let child = cdr.string()?;
            Some((time, parent, child, cdr.pose()?))
        };
        let (time, parent, child, (shift, turn)) = read().ok_or_else(fault)?;
        let parent_from_child = motion(shift, turn).ok_or_else(|| {
            Fault::new("a shift and a unit quaternion", format!("{shift} and {turn} of `{child}`"))
        })?;
        let name = |frame: &str| frame.trim_start_matches('/').to_owned();
        all.push(Transform { time, parent: name(parent), child: name(child), parent_from_child });
    }
    Ok(all)
}

fn motion(shift: DVec3, turn: DQuat) -> Option<DAffine3> {
    let is_unit = (turn.length() - 1.0).abs() < 1e-3;
    let motion = DAffine3::from_rotation_translation(turn.normalize(), shift);
    (is_unit && shift.is_finite()).then_some(motion)
}
