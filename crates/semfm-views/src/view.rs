//! A rendered picture with the camera that made it.

use semfm_geom::Pinhole;

/// One rendered view: picture, depth and triangle of every pixel, row-major, top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The camera, which also gives width and height.
    pub camera: Pinhole,
    /// sRGB bytes (height × width × 3).
    pub rgb: Vec<u8>,
    /// Depth z along the camera's axis in mesh units (height × width), +∞ on the background.
    pub depth: Vec<f32>,
    /// Triangle as read (height × width), −1 on the background.
    pub triangles: Vec<i32>,
}
