//! `Region`: where to act.

use std::path::PathBuf;

use pyo3::prelude::*;
use semfm::demonstration::{
    grow_region, is_one_sided, region_around_contact, region_of_paint, region_under_mask,
};
use semfm::files::{RegionFile, read_region, write_region};
use semfm::fmap::metrics;

use crate::arrays_in::{self, Axis};
use crate::interruptible::{guard, run};
use crate::mesh::{MeshFile, Reduced, from_any};
use crate::pinhole::Pinhole;
use crate::shared::Shared;
use crate::{arrays_out, errors};

/// A region (an affordance): a weight in [0, 1] for each vertex of a mesh.
///
/// A vertex counts where its weight is at least one half. The vertex ids are those of the mesh as
/// read.
///
/// Parameters
/// ----------
/// weights : (n,) array_like
///
/// Examples
/// --------
/// >>> import semfm
/// >>> grip = semfm.Region.from_vertices(5, [3, 1])
/// >>> grip.vertices.tolist()
/// [1, 3]
/// >>> grip.mask.tolist()
/// [False, True, False, True, False]
#[pyclass(frozen, module = "semfm")]
pub struct Region {
    pub inner: Shared<semfm::Region>,
}

#[pymethods]
impl Region {
    #[new]
    fn new(weights: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (values, _) = arrays_in::floats(weights, "weights", &[Axis::Any("n")])?;
        guarded(weights.py(), || Ok(semfm::Region::from_weights(values)?))
    }

    /// A region of full weight on some vertices.
    ///
    /// Parameters
    /// ----------
    /// n_vertices : int
    ///     Vertices of the mesh.
    /// vertices : (v,) array_like
    ///     Ids, which may repeat.
    ///
    /// Returns
    /// -------
    /// Region
    #[staticmethod]
    fn from_vertices(n_vertices: usize, vertices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = vertices.py();
        arrays_in::within_memory(py, "n_vertices", n_vertices, 1)?;
        let (ids, _) = arrays_in::ids(vertices, "vertices", &[Axis::Any("v")])?;
        guarded(py, || Ok(semfm::Region::from_vertices(n_vertices, &ids)?))
    }

    /// A region of full weight where a mask is true.
    ///
    /// Parameters
    /// ----------
    /// inside : (n,) array_like
    ///     Of dtype bool.
    ///
    /// Returns
    /// -------
    /// Region
    #[staticmethod]
    fn from_mask(inside: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (inside, _) = arrays_in::mask(inside, "inside", &[Axis::Any("n")])?;
        Ok(Self { inner: Shared::new(semfm::Region::from_mask(&inside)) })
    }

    /// All vertices within a geodesic radius of the surface point nearest to a contact.
    ///
    /// Parameters
    /// ----------
    /// mesh : mesh_like
    /// contact : (3,) array_like
    ///     In the mesh's frame and units; refused where it is farther from the surface than 0.3 of
    ///     the bounding box's diagonal.
    /// radius : float
    ///     In the mesh's units.
    ///
    /// Returns
    /// -------
    /// Region
    ///
    /// Examples
    /// --------
    /// >>> import semfm, semfm.zoo
    /// >>> cap = semfm.Region.near(semfm.zoo.icosphere(3), [0, 0, 2], radius=0.5)
    /// >>> 30 < len(cap.vertices) < 50
    /// True
    #[staticmethod]
    fn near(mesh: &Bound<'_, PyAny>, contact: &Bound<'_, PyAny>, radius: f64) -> PyResult<Self> {
        let contact = arrays_in::point(contact, "contact")?;
        let shared = from_any(mesh, "mesh")?;
        let region =
            run(mesh.py(), None, move |_| region_around_contact(&shared, contact, radius))?;
        Ok(Self { inner: Shared::new(region) })
    }

    /// All vertices that a camera sees inside a mask.
    ///
    /// Parameters
    /// ----------
    /// mesh : mesh_like
    /// camera : Pinhole
    /// mask : (height, width) array_like
    ///     Of dtype bool, of the camera's size.
    ///
    /// Returns
    /// -------
    /// Region
    #[staticmethod]
    fn masked(
        mesh: &Bound<'_, PyAny>,
        camera: &Bound<'_, Pinhole>,
        mask: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let camera = camera.get().camera;
        let size = [Axis::Is(camera.height() as usize), Axis::Is(camera.width() as usize)];
        let (mask, _) = arrays_in::mask(mask, "mask", &size)?;
        let shared = from_any(mesh, "mesh")?;
        let region = run(mesh.py(), None, move |_| region_under_mask(&shared, &camera, &mask))?;
        Ok(Self { inner: Shared::new(region) })
    }

    /// All vertices painted red, or in the paint given.
    ///
    /// Parameters
    /// ----------
    /// file : MeshFile
    ///     A mesh with vertex colours, from `read_mesh`.
    /// paint : tuple of int, int, int, optional
    ///     sRGB, each 0 to 255.
    ///
    /// Returns
    /// -------
    /// Region
    #[staticmethod]
    #[pyo3(signature = (file, paint=None))]
    fn painted(
        py: Python<'_>,
        file: &Bound<'_, MeshFile>,
        paint: Option<(u8, u8, u8)>,
    ) -> PyResult<Self> {
        let colors = file.get().inner.appearance.vertex_colors.as_deref();
        guarded(py, || region_of_paint(colors, paint.map(|(r, g, b)| [r, g, b])))
    }

    /// Reads a region file of a mesh.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     JSON: ``{"vertices": […], "weights": […]}``, bare or under ``"region"``.
    /// mesh : mesh_like
    ///     The mesh it belongs to; where the file names another one, that is an error.
    ///
    /// Returns
    /// -------
    /// Region
    #[staticmethod]
    fn read(path: PathBuf, mesh: &Bound<'_, PyAny>) -> PyResult<Self> {
        let shared = from_any(mesh, "mesh")?;
        guarded(mesh.py(), || read_region(&path, &shared))
    }

    /// The part that the region belongs to, where one camera saw it: the hidden side is added.
    ///
    /// A region that is known all around stays as it is. What was seen keeps its weight, what is added
    /// has weight 1.
    ///
    /// Parameters
    /// ----------
    /// mesh : mesh_like
    ///     The mesh it belongs to.
    /// camera : Pinhole, optional
    ///     The camera that saw it: what it sees beside the region is outside of the part. Without one,
    ///     the camera is looked for.
    ///
    /// Returns
    /// -------
    /// Region
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, semfm, semfm.zoo
    /// >>> torus = semfm.zoo.torus(40, 20)
    /// >>> half = semfm.Region.from_mask(torus.vertices[:, 0] > 0)
    /// >>> half.is_one_sided(torus), half.grown(torus) == half
    /// (False, True)
    #[pyo3(signature = (mesh, *, camera=None))]
    fn grown(
        &self,
        mesh: &Bound<'_, PyAny>,
        camera: Option<&Bound<'_, Pinhole>>,
    ) -> PyResult<Self> {
        let (shared, region) = (from_any(mesh, "mesh")?, self.inner.clone());
        let camera = camera.map(|camera| camera.get().camera);
        let grown = run(mesh.py(), None, move |_| {
            Ok(grow_region(&shared, &region, camera.as_ref())?.region)
        })?;
        Ok(Self { inner: Shared::new(grown) })
    }

    /// Whether the region is what one camera sees of a part, which `grown` would complete.
    ///
    /// Parameters
    /// ----------
    /// mesh : mesh_like
    ///     The mesh it belongs to.
    ///
    /// Returns
    /// -------
    /// bool
    fn is_one_sided(&self, mesh: &Bound<'_, PyAny>) -> PyResult<bool> {
        let (shared, region) = (from_any(mesh, "mesh")?, self.inner.clone());
        run(mesh.py(), None, move |_| is_one_sided(&shared, &region))
    }

    /// Writes a region file, whole or not at all.
    ///
    /// Parameters
    /// ----------
    /// path : path
    /// mesh : mesh_like
    ///     The mesh it belongs to.
    fn write(&self, path: PathBuf, mesh: &Bound<'_, PyAny>) -> PyResult<()> {
        let shared = self.of(mesh)?;
        guard(mesh.py(), || write_region(&path, &self.inner, &shared))
    }

    /// The region file's content as text.
    ///
    /// Parameters
    /// ----------
    /// mesh : mesh_like
    ///     The mesh it belongs to.
    ///
    /// Returns
    /// -------
    /// str
    fn to_json(&self, mesh: &Bound<'_, PyAny>) -> PyResult<String> {
        let shared = self.of(mesh)?;
        guard(mesh.py(), || Ok(RegionFile::new(&self.inner, &shared).to_json().to_string()))
    }

    /// (n,) float64 array: weight of each vertex, a read-only view.
    #[getter]
    fn weights<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |region| region.inner.weights())
    }

    /// (v,) uint32 array: ids of the vertices that count, ascending.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.inner.vertices())
    }

    /// (n,) bool array: whether each vertex counts.
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.inner.mask())
    }

    /// int: vertices of the mesh, inside or not.
    #[getter]
    fn n_vertices(&self) -> usize {
        self.inner.n_vertices()
    }

    /// bool: whether no vertex counts.
    #[getter]
    fn is_empty(&self) -> bool {
        self.inner.is_empty()
    }

    /// Intersection over union with the true region, in vertices or in areas.
    ///
    /// Parameters
    /// ----------
    /// truth : Region
    ///     Of the same mesh.
    /// areas : (n,) array_like, optional
    ///     Area of each vertex (`Mesh.vertex_areas`); vertices are counted where none are given.
    ///
    /// Returns
    /// -------
    /// float
    ///     0 where both are empty.
    #[pyo3(signature = (truth, areas=None))]
    fn iou(&self, truth: &Bound<'_, Self>, areas: Option<&Bound<'_, PyAny>>) -> PyResult<f64> {
        let py = truth.py();
        let truth = &truth.get().inner;
        match areas {
            None => guard(py, || Ok(metrics::iou(&self.inner, truth)?)),
            Some(areas) => {
                let areas = arrays_in::floats(areas, "areas", &[Axis::Any("n")])?.0;
                guard(py, || Ok(metrics::area_iou(&self.inner, truth, &areas)?))
            }
        }
    }

    fn __len__(&self) -> usize {
        self.inner.n_vertices()
    }

    fn __repr__(&self) -> String {
        let (inside, n) = (self.inner.vertices().len(), self.inner.n_vertices());
        format!("Region({inside} of {n} vertices)")
    }

    /// What a notebook shows: a region alone has no surface to be drawn on.
    fn _repr_html_(&self) -> String {
        let (inside, n) = (self.inner.vertices().len(), self.inner.n_vertices());
        let share = 100.0 * inside as f64 / n.max(1) as f64;
        format!(
            "<div><b>Region</b>: {inside} of {n} vertices ({share:.1} %)\
             <div style='width:16em;height:.5em;background:#c7c7c7'>\
             <div style='width:{share:.2}%;height:100%;background:#db2929'></div></div>\
             <small><code>mesh.picture(region=…)</code> draws it on its mesh</small></div>"
        )
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| *other.get().inner == *self.inner)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let parts = (Self::weights(slf)?,);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

impl Region {
    /// The mesh, if it may be the one of this region.
    fn of(&self, mesh: &Bound<'_, PyAny>) -> PyResult<Shared<semfm::Mesh>> {
        let shared = from_any(mesh, "mesh")?;
        if shared.n_vertices() == self.inner.n_vertices() {
            return Ok(shared);
        }
        let expected = format!("a mesh of {} vertices, as the region's", self.inner.n_vertices());
        Err(errors::invalid(mesh.py(), "mesh", &expected, &shared.n_vertices().to_string()))
    }
}

fn guarded(
    py: Python<'_>,
    make: impl FnOnce() -> semfm::Result<semfm::Region>,
) -> PyResult<Region> {
    Ok(Region { inner: Shared::new(guard(py, make)?) })
}

/// A region, or the file of one, on `mesh`.
pub fn region_of(
    value: &Bound<'_, PyAny>,
    mesh: &Shared<semfm::Mesh>,
) -> PyResult<Shared<semfm::Region>> {
    if let Ok(region) = value.cast::<Region>() {
        return Ok(region.get().inner.clone());
    }
    let wanted = "a Region or a path (for ids, masks and weights see Region's constructors)";
    let path: PathBuf = value.extract().map_err(|_| errors::wrong_type("region", wanted, value))?;
    let region = guard(value.py(), || read_region(&path, mesh))?;
    Ok(Shared::new(region))
}
