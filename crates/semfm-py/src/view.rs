//! `View`: a rendered picture with depth and triangles.

use std::sync::Arc;

use pyo3::prelude::*;
use semfm::views::{self, RenderSettings, RigSettings, SurfaceColor};

use crate::arrays_in::{self, Axis};
use crate::interruptible::run;
use crate::mesh::{MeshFile, from_any};
use crate::pinhole::{self, Pinhole, rows_and_columns};
use crate::shared::Shared;
use crate::{arrays_out, errors};

/// One rendered view of an object.
///
/// See Also
/// --------
/// render, ViewsFile
#[pyclass(frozen, module = "semfm")]
pub struct View {
    pub view: Arc<views::View>,
}

#[pymethods]
impl View {
    /// Pinhole: the one the picture was taken with.
    #[getter]
    fn camera(&self) -> Pinhole {
        Pinhole { camera: self.view.camera }
    }

    /// (height, width, 3) uint8 array: sRGB, a read-only view.
    #[getter]
    fn rgb<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let flat = arrays_out::vector(slf, |view| view.view.rgb.as_slice())?;
        flat.call_method1("reshape", (rows_and_columns(slf.py(), &slf.get().view.camera, &[3])?,))
    }

    /// (height, width) float32 array: depth along the camera's axis in mesh units, infinite on the background, a read-only view.
    #[getter]
    fn depth<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let flat = arrays_out::vector(slf, |view| view.view.depth.as_slice())?;
        flat.call_method1("reshape", (rows_and_columns(slf.py(), &slf.get().view.camera, &[])?,))
    }

    /// (height, width) int32 array: triangle of each pixel, −1 on the background, a read-only view.
    #[getter]
    fn triangles<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let flat = arrays_out::vector(slf, |view| view.view.triangles.as_slice())?;
        flat.call_method1("reshape", (rows_and_columns(slf.py(), &slf.get().view.camera, &[])?,))
    }

    fn __repr__(&self) -> String {
        format!("View({} × {})", self.view.camera.width(), self.view.camera.height())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(
        Bound<'py, PyAny>,
        (Pinhole, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>),
    )> {
        let restore = slf.py().import("semfm._semfm")?.getattr("_restore_view")?;
        let parts = (slf.get().camera(), Self::rgb(slf)?, Self::depth(slf)?, Self::triangles(slf)?);
        Ok((restore, parts))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// A view out of a pickle.
#[pyfunction]
pub fn _restore_view(
    camera: &Bound<'_, Pinhole>,
    rgb: &Bound<'_, PyAny>,
    depth: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
) -> PyResult<View> {
    let camera = camera.get().camera;
    let (height, width) = (Axis::Is(camera.height() as usize), Axis::Is(camera.width() as usize));
    let shifted = triangles.call_method1("__add__", (1,))?; // ids have no −1
    let triangles = arrays_in::ids(&shifted, "triangles", &[height, width])?.0;
    let view = views::View {
        camera,
        rgb: arrays_in::bytes(rgb, "rgb", &[height, width, Axis::Is(3)])?.0,
        depth: arrays_in::any32(depth, "depth", &[height, width])?.0, // infinite on the background
        triangles: triangles.into_iter().map(|id| id as i32 - 1).collect(),
    };
    Ok(View { view: Arc::new(view) })
}

/// Colours to render with, owned.
enum Colors {
    Grey,
    Normals,
    Vertices(Vec<[f32; 3]>),
    File(Arc<semfm::geom::io::MeshFile>),
}

/// One picture per camera, with depth and triangle of every pixel.
///
/// Parameters
/// ----------
/// mesh : mesh_like or MeshFile
///     A `MeshFile` is drawn in its own colours.
/// cameras : list of Pinhole, optional
///     As `rig` makes them where none are given.
/// colors : (n, 3) array_like, optional
///     sRGB of each vertex, 0 to 1.
/// supersampling : int, default 2
///     Colour samples along each side of a pixel, 1 to 8.
/// background : (3,) array_like, optional
///     sRGB, 0 to 1; white where none is given.
/// occlusion : float, default 0.0
///     How much what is closed in is darkened, 0 to 1.
/// edges : float, default 0.0
///     How dark silhouettes and creases are drawn, 0 to 1.
/// normals : bool, default False
///     Draw the surface's directions as colours, instead of light.
/// progress : progress, optional
///
/// Returns
/// -------
/// list of View
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> mesh = semfm.zoo.torus(40, 20)
/// >>> views = semfm.render(mesh, semfm.rig(mesh, count=3, size=64))
/// >>> len(views), views[0].rgb.shape
/// (3, (64, 64, 3))
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
#[pyo3(signature = (mesh, cameras=None, *, colors=None, supersampling=2, background=None, occlusion=0.0, edges=0.0, normals=false, progress=None))]
pub fn render(
    mesh: &Bound<'_, PyAny>,
    cameras: Option<&Bound<'_, PyAny>>,
    colors: Option<&Bound<'_, PyAny>>,
    supersampling: u32,
    background: Option<&Bound<'_, PyAny>>,
    occlusion: f64,
    edges: f64,
    normals: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<View>> {
    let (shared, mut paint) = match mesh.cast::<MeshFile>() {
        Ok(file) => {
            let file = file.get().inner.clone();
            let colored = !file.appearance.is_plain();
            (
                Shared::part_of(&file, |file| &file.mesh),
                if colored { Colors::File(file) } else { Colors::Grey },
            )
        }
        Err(_) => (from_any(mesh, "mesh")?, Colors::Grey),
    };
    if let Some(colors) = colors {
        let rows = [Axis::Is(shared.n_vertices()), Axis::Is(3)];
        let values = arrays_in::floats32(colors, "colors", &rows)?.0;
        paint = Colors::Vertices(values.as_chunks::<3>().0.to_vec());
    }
    if normals && colors.is_some() {
        return Err(errors::invalid(mesh.py(), "normals", "False where colors are given", "True"));
    }
    if normals {
        paint = Colors::Normals;
    }
    let mut settings = RenderSettings { supersampling, occlusion, edges, ..Default::default() };
    if let Some(background) = background {
        settings.background = arrays_in::point(background, "background")?.as_vec3().to_array();
    }
    let cameras = cameras.map(pinhole::list).transpose()?;
    let rendered = run(mesh.py(), progress, move |task| {
        let cameras = match cameras {
            Some(cameras) => cameras,
            None => views::rig(&shared, &RigSettings::default())?,
        };
        let draw =
            |paint: &SurfaceColor<'_>| views::render(&shared, paint, &cameras, &settings, task);
        Ok(match &paint {
            Colors::Grey => draw(&SurfaceColor::default()),
            Colors::Normals => draw(&SurfaceColor::Normals),
            Colors::Vertices(colors) => draw(&SurfaceColor::Vertices(colors)),
            Colors::File(file) => draw(&SurfaceColor::Surface(&|face, weights| {
                let [r, g, b, _] = file.appearance.color_at(face, shared.faces()[face], weights);
                [r, g, b].map(|c| f32::from(c) / 255.0)
            })),
        }?)
    })?;
    Ok(rendered.into_iter().map(|view| View { view: Arc::new(view) }).collect())
}
