//! The mesh as the driver gets it.

use semfm_geom::math::{DAffine3, DMat4, DVec3, DVec4};
use semfm_geom::{Pinhole, Sphere};

use super::device::Device;
use super::pipelines::{CameraBlock, Corner};
use crate::render::{Request, light_direction};
use crate::{Error, RenderSettings, Result, SurfaceColor};

/// What lies nearer to the camera than this share of the object's radius is cut off.
const NEAR: f64 = 1e-4;

/// The mesh in the driver's memory: three corners for each triangle.
///
/// Neighbours do not share corners: a driver counts corners, and by that a triangle knows its number.
/// (Sharing them, with the number in each triangle's first corner, saves a twentieth on lavapipe, and
/// turns triangles, so that of two in one place another one wins.)
pub(super) struct GpuMesh {
    pub corners: wgpu::Buffer,
    pub n_corners: u32,
    /// Object coordinates of the corners' origin and unit.
    pub centre: DVec3,
    pub radius: f64,
}

impl GpuMesh {
    /// # Errors
    /// [`Error::BeyondGpu`] for a mesh that does not fit into a buffer, [`Error::Gpu`].
    pub fn new(device: &Device, request: &Request<'_>) -> Result<Self> {
        let mesh = request.mesh;
        let Sphere { centre, radius } = request.sphere;
        let bytes_each = 3 * size_of::<Corner>() as u64;
        let largest = device.device.limits().max_buffer_size.min(u64::from(u32::MAX));
        if mesh.n_faces() as u64 > largest / bytes_each {
            return Err(Error::BeyondGpu {
                what: "triangles",
                expected: format!("at most {}", largest / bytes_each),
                found: mesh.n_faces().to_string(),
            });
        }
        let corners: Vec<Corner> = mesh
            .faces()
            .iter()
            .zip(request.normals.corners())
            .flat_map(|(ids, normals)| {
                [0, 1, 2].map(|corner| {
                    let id = ids[corner] as usize;
                    let position = ((mesh.vertices()[id] - centre) / radius).as_vec3().to_array();
                    let color = match request.color {
                        SurfaceColor::Uniform(color) => *color,
                        SurfaceColor::Vertices(colors) => colors[id],
                        SurfaceColor::Surface(_) | SurfaceColor::Normals => [0.0; 3],
                    };
                    let color = color.map(|c| c * request.light_at(id));
                    Corner { position, normal: normals[corner], color }
                })
            })
            .collect();
        let n_corners = corners.len() as u32;
        let corners = device.buffer(bytemuck::cast_slice(&corners), wgpu::BufferUsages::VERTEX)?;
        Ok(Self { corners, n_corners, centre, radius })
    }

    pub fn camera_block(&self, camera: &Pinhole, settings: &RenderSettings) -> CameraBlock {
        let pose = camera.camera_from_world();
        let pose = DAffine3::from_mat3_translation(
            pose.matrix3,
            pose.transform_point3(self.centre) / self.radius,
        );
        let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
        let clip_from_camera = DMat4::from_cols(
            DVec4::new(2.0 * camera.fx() / width, 0.0, 0.0, 0.0),
            DVec4::new(0.0, -2.0 * camera.fy() / height, 0.0, 0.0),
            DVec4::new(2.0 * camera.cx() / width - 1.0, 1.0 - 2.0 * camera.cy() / height, 0.0, 1.0),
            DVec4::new(0.0, 0.0, NEAR, 0.0),
        );
        let [x, y, z] = light_direction(camera, settings).as_vec3().to_array();
        CameraBlock {
            clip_from_mesh: (clip_from_camera * DMat4::from(pose)).as_mat4().to_cols_array(),
            light: [x, y, z, settings.ambient as f32],
            per_pixel: settings.supersampling,
            padding: [0; 3],
        }
    }
}
