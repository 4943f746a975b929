//! `Mesh`: checked arrays and mesh files.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyType};
use semfm::encoder::rendered_views::Drawable;
use semfm::geom::connectivity::MeshReport;
use semfm::geom::io;

use crate::arrays_in::{self, Axis};
use crate::interruptible::{guard, run};
use crate::region::region_of;
use crate::shared::Shared;
use crate::{arrays_out, errors, json, pictures};

/// A triangle mesh in its own frame and units.
///
/// The arrays are checked once and kept as they are: no vertex is moved, merged or dropped, so that
/// a vertex id means the same everywhere. Components, holes, non-manifold edges and degenerate
/// triangles are all allowed. A mesh cannot be changed.
///
/// Parameters
/// ----------
/// vertices : (n, 3) array_like
///     Positions, finite.
/// faces : (m, 3) array_like
///     Vertex ids of each triangle, counter-clockwise seen from outside.
///
/// Raises
/// ------
/// InvalidInput
///     No vertex or no triangle, a coordinate that is not finite, an id out of range.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> mesh = semfm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
/// >>> mesh
/// Mesh(3 vertices, 1 triangles)
/// >>> mesh.area
/// 0.5
#[pyclass(frozen, module = "semfm")]
pub struct Mesh {
    pub inner: Shared<semfm::Mesh>,
}

#[pymethods]
impl Mesh {
    #[new]
    fn new(vertices: &Bound<'_, PyAny>, faces: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = vertices.py();
        let points = arrays_in::points(vertices, "vertices")?;
        let (ids, _) = arrays_in::ids(faces, "faces", &[Axis::Any("m"), Axis::Is(3)])?;
        let faces = ids.as_chunks::<3>().0.to_vec();
        let mesh = guard(py, || Ok(semfm::Mesh::new(points, faces)?))?;
        Ok(Self { inner: Shared::new(mesh) })
    }

    /// Reads a mesh file in any format of ``mesh_formats()``; polygons are cut to triangles.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     The file; its format is told by the extension, else by the first bytes.
    ///
    /// Returns
    /// -------
    /// Mesh
    ///
    /// See Also
    /// --------
    /// read_mesh : the same with the colours of the file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let mesh = run(py, None, move |_| Ok(io::read_mesh(&path)?.mesh))?;
        Ok(Self { inner: Shared::new(mesh) })
    }

    /// The mesh of a `trimesh.Trimesh` or `trimesh.Scene` (what ``trimesh.load`` returns for GLB), vertex
    /// by vertex: load it with ``process=False``, or trimesh will have merged vertices.
    ///
    /// Parameters
    /// ----------
    /// mesh : object
    ///     Anything with `vertices` (n, 3) and `faces` (m, 3); or a scene, whose meshes are put behind each
    ///     other in the order of its graph, each where its node stands. Points and lines are left out.
    ///
    /// Returns
    /// -------
    /// Mesh
    #[staticmethod]
    fn from_trimesh(mesh: &Bound<'_, PyAny>) -> PyResult<Self> {
        if is_scene(mesh)? {
            let arrays = mesh.py().import("semfm.adapters.trimesh")?.getattr("scene_arrays")?;
            let (vertices, faces): (Bound<'_, PyAny>, Bound<'_, PyAny>) =
                arrays.call1((mesh,))?.extract()?;
            return Self::new(&vertices, &faces);
        }
        Self::of_arrays(mesh, "faces", "a trimesh.Trimesh, or an object with vertices and faces")
    }

    /// The mesh of an `open3d.geometry.TriangleMesh`.
    ///
    /// Parameters
    /// ----------
    /// mesh : object
    ///     Anything with `vertices` (n, 3) and `triangles` (m, 3).
    ///
    /// Returns
    /// -------
    /// Mesh
    #[staticmethod]
    fn from_open3d(mesh: &Bound<'_, PyAny>) -> PyResult<Self> {
        let wanted = "an open3d.geometry.TriangleMesh, or an object with vertices and triangles";
        Self::of_arrays(mesh, "triangles", wanted)
    }

    /// Writes a mesh file, whole or not at all, in a format that ``mesh_formats()`` says is written.
    ///
    /// OBJ, OFF and PLY keep coordinates exactly. GLB and STL have 32 bits a number.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     The file; its extension names the format.
    /// colors : (n, 4) array_like, optional
    ///     RGBA bytes of each vertex, in sRGB (uint8). Not for STL.
    /// scalars : dict, optional
    ///     Names of numbers, (n,) each, kept at the vertices in 32 bits. PLY and GLB only.
    #[pyo3(signature = (path, *, colors=None, scalars=None))]
    fn write(
        &self,
        py: Python<'_>,
        path: PathBuf,
        colors: Option<&Bound<'_, PyAny>>,
        scalars: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let n = Axis::Is(self.inner.n_vertices());
        let colors = colors.map(|colors| arrays_in::bytes(colors, "colors", &[n, Axis::Is(4)]));
        let colors = colors.transpose()?.map(|(bytes, _)| bytes.as_chunks::<4>().0.to_vec());
        let mut named: Vec<(String, Vec<f64>)> = Vec::new();
        for (name, values) in scalars.into_iter().flatten() {
            let name: String = name.extract()?;
            let values = arrays_in::floats(&values, &format!("scalars[{name:?}]"), &[n])?.0;
            named.push((name, values));
        }
        let mesh = self.inner.clone();
        run(py, None, move |_| {
            let scalars: Vec<(&str, &[f64])> =
                named.iter().map(|(name, values)| (name.as_str(), values.as_slice())).collect();
            let attributes = io::VertexAttributes { colors: colors.as_deref(), scalars: &scalars };
            Ok(io::write_mesh_with_attributes(&path, &mesh, &attributes)?)
        })
    }

    /// (n, 3) float64 array: positions, a read-only view.
    #[getter]
    fn vertices<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, 3, |mesh| bytemuck::cast_slice::<_, f64>(mesh.inner.vertices()))
    }

    /// (m, 3) uint32 array: vertex ids of each triangle, a read-only view.
    #[getter]
    fn faces<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, 3, |mesh| mesh.inner.faces().as_flattened())
    }

    /// int: number of vertices n.
    #[getter]
    fn n_vertices(&self) -> usize {
        self.inner.n_vertices()
    }

    /// int: number of triangles m.
    #[getter]
    fn n_faces(&self) -> usize {
        self.inner.n_faces()
    }

    /// float: surface area, in squared units of the mesh.
    #[getter]
    fn area(&self) -> f64 {
        self.inner.area()
    }

    /// float: length of the bounding box's diagonal.
    #[getter]
    fn diagonal(&self) -> f64 {
        self.inner.diagonal()
    }

    /// (2, 3) float64 array: lower and upper corner of the bounding box.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (low, high) = self.inner.bounds();
        arrays_out::owned_rows(py, [low.to_array(), high.to_array()].concat(), 3)
    }

    /// str: the mesh's name, ``blake3:`` and 64 digits over counts, positions and triangles.
    #[getter]
    fn hash(&self) -> String {
        self.inner.hash().to_string()
    }

    /// A third of the area of the triangles around each vertex.
    ///
    /// Returns
    /// -------
    /// (n,) float64 array
    fn vertex_areas<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.inner.vertex_areas())
    }

    /// What is regular and what is not: edges, components, boundaries, manifoldness.
    ///
    /// They are those of the surface: vertices at the same place (a UV seam, flat shading) count as one.
    ///
    /// Parameters
    /// ----------
    /// stored : bool, default False
    ///     Count vertices at the same place apart, as the file stores them.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Counts and flags by name, as `semfm-cli info --json` has them.
    ///
    /// Examples
    /// --------
    /// >>> import semfm.zoo
    /// >>> semfm.zoo.icosphere(2).report()["watertight"]
    /// True
    #[pyo3(signature = (*, stored=false))]
    fn report<'py>(&self, py: Python<'py>, stored: bool) -> PyResult<Bound<'py, PyAny>> {
        let mesh = self.inner.clone();
        let of = if stored { MeshReport::as_stored } else { MeshReport::new };
        let report = run(py, None, move |_| Ok(of(&mesh)))?;
        json::to_python(py, &report)
    }

    /// A picture from two sides, which notebooks show by themselves.
    ///
    /// Parameters
    /// ----------
    /// region : Region or path, optional
    ///     Painted grey to red by weight; the sides are those from which it is seen best.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    #[pyo3(signature = (*, region=None))]
    fn picture<'py>(
        &self,
        py: Python<'py>,
        region: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let mesh = self.inner.clone();
        let n = mesh.n_vertices();
        let weights = match region {
            Some(region) => region_of(region, &mesh)?.weights().to_vec(),
            None => vec![0.0; n],
        };
        if weights.len() != n {
            let expected = format!("a region of the mesh's {n} vertices");
            return Err(errors::invalid(py, "region", &expected, &weights.len().to_string()));
        }
        pictures::png(py, move |path, task| {
            pictures::write_mesh_picture(path, &mesh, &weights, task)
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py, None))
    }

    /// The surface that the vertices describe: those at the same place joined.
    ///
    /// `Laplacian`, `Eigenbasis` and neighbours go by vertex ids, so that a UV seam is a cut to them;
    /// give them this mesh. `Shape` and `HeatGeodesics` join by themselves.
    ///
    /// Returns
    /// -------
    /// Mesh
    ///     The joined mesh (n_joined vertices), triangles in their order.
    /// (n,) uint32 array
    ///     For each vertex of this mesh, its vertex in the joined one.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, semfm, semfm.zoo
    /// >>> ball = semfm.zoo.icosphere(1)
    /// >>> soup = semfm.Mesh(ball.vertices[ball.faces.ravel()], np.arange(240).reshape(80, 3))
    /// >>> joined, of_original = soup.weld()
    /// >>> joined.n_vertices, of_original.shape
    /// (42, (240,))
    fn weld<'py>(&self, py: Python<'py>) -> PyResult<(Self, Bound<'py, PyAny>)> {
        let mesh = self.inner.clone();
        let welded = run(py, None, move |_| Ok(semfm::geom::Welded::new(&mesh)))?;
        let of_original = arrays_out::owned(py, welded.of_original);
        Ok((Self { inner: Shared::new(welded.mesh) }, of_original))
    }

    fn __repr__(&self) -> String {
        format!("Mesh({} vertices, {} triangles)", self.inner.n_vertices(), self.inner.n_faces())
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| *other.get().inner == *self.inner)
    }

    fn __hash__(&self) -> u64 {
        let hash = self.inner.hash().0;
        hash.iter().take(8).fold(0, |sum, &byte| sum << 8 | u64::from(byte))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let arrays = (Self::vertices(slf)?, Self::faces(slf)?);
        Ok((slf.get_type(), arrays.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

impl Mesh {
    /// The mesh of an object with `vertices` and triangles under the name `faces`.
    fn of_arrays(mesh: &Bound<'_, PyAny>, faces: &str, wanted: &str) -> PyResult<Self> {
        if !mesh.hasattr("vertices")? || !mesh.hasattr(faces)? {
            return Err(errors::wrong_type("mesh", wanted, mesh));
        }
        Self::new(&mesh.getattr("vertices")?, &mesh.getattr(faces)?)
    }
}

/// Whether it is a scene of trimesh: geometries by name, and a graph that says where they stand.
fn is_scene(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(!value.hasattr("vertices")? && value.hasattr("geometry")? && value.hasattr("graph")?)
}

/// What `__reduce__` answers: the class and its arguments.
pub type Reduced<'py> = (Bound<'py, PyType>, Bound<'py, PyAny>);

/// A mesh from whatever is one: `Mesh`, a file, or an object with vertices and faces or triangles.
pub fn from_any(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Shared<semfm::Mesh>> {
    if let Ok(mesh) = value.cast::<Mesh>() {
        return Ok(mesh.get().inner.clone());
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Ok(Mesh::read(value.py(), path)?.inner);
    }
    if is_scene(value)? {
        return Ok(Mesh::from_trimesh(value)?.inner);
    }
    if value.hasattr("vertices")? {
        if value.hasattr("faces")? {
            return Ok(Mesh::from_trimesh(value)?.inner);
        }
        if value.hasattr("triangles")? {
            return Ok(Mesh::from_open3d(value)?.inner);
        }
    }
    if let Ok(file) = value.cast::<MeshFile>() {
        return Ok(file.get().mesh().inner);
    }
    let wanted = "a Mesh, a path, or an object with vertices and faces (or triangles)";
    Err(errors::wrong_type(name, wanted, value))
}

/// An object to be shown to an encoder: a mesh, with the colours of its file where there is one.
#[derive(Clone)]
pub struct GivenObject {
    pub mesh: Shared<semfm::Mesh>,
    file: Option<Arc<io::MeshFile>>,
}

impl GivenObject {
    /// From a `MeshFile`, or from whatever is a mesh; a file that a path names is read with its
    /// colours.
    pub fn of(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Self> {
        let file = match (value.cast::<MeshFile>(), value.extract::<PathBuf>()) {
            (Ok(file), _) => file.get().inner.clone(),
            (_, Ok(path)) => read_mesh(value.py(), path, None)?.inner,
            _ => return Ok(Self { mesh: from_any(value, name)?, file: None }),
        };
        Ok(Self { mesh: Shared::part_of(&file, |file| &file.mesh), file: Some(file) })
    }

    /// As an encoder is shown it.
    pub fn drawable(&self) -> Drawable<'_> {
        match &self.file {
            Some(file) => Drawable::File(file),
            None => Drawable::Mesh(&self.mesh),
        }
    }
}

/// A mesh file: the mesh and what the file says about its colours.
#[pyclass(frozen, module = "semfm")]
pub struct MeshFile {
    pub inner: Arc<io::MeshFile>,
}

#[pymethods]
impl MeshFile {
    /// Mesh: the geometry.
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh { inner: Shared::part_of(&self.inner, |file| &file.mesh) }
    }

    /// (n, 4) uint8 array, optional: RGBA of each vertex in sRGB; None where the file has none.
    #[getter]
    fn vertex_colors<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyAny>>> {
        if slf.get().inner.appearance.vertex_colors.is_none() {
            return Ok(None);
        }
        fn colors(file: &MeshFile) -> &[u8] {
            file.inner.appearance.vertex_colors.as_deref().map_or(&[], <[[u8; 4]]>::as_flattened)
        }
        arrays_out::rows(slf, 4, colors).map(Some)
    }

    /// bool: whether the file has vertex colours, materials or images.
    #[getter]
    fn has_colors(&self) -> bool {
        !self.inner.appearance.is_plain()
    }

    /// str: the format, such as ``"ply"``.
    #[getter]
    fn format(&self) -> &'static str {
        self.inner.format.name()
    }

    /// list of str: what could not be read of the colours, and why.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.inner.appearance.notes.clone()
    }

    fn __repr__(&self) -> String {
        let mesh = &self.inner.mesh;
        format!("MeshFile({} vertices, {} triangles)", mesh.n_vertices(), mesh.n_faces())
    }
}

/// Reads a mesh file with its colours.
///
/// Parameters
/// ----------
/// path : path
///     The file, in any format of ``mesh_formats()``.
/// texture : path, optional
///     An image for a mesh with texture coordinates (OBJ, PLY).
///
/// Returns
/// -------
/// MeshFile
#[pyfunction]
#[pyo3(signature = (path, *, texture=None))]
pub fn read_mesh(py: Python<'_>, path: PathBuf, texture: Option<PathBuf>) -> PyResult<MeshFile> {
    let file = run(py, None, move |_| {
        let mut file = io::read_mesh(&path)?;
        if let Some(texture) = &texture {
            file.appearance.attach_image(texture)?;
        }
        Ok(file)
    })?;
    Ok(MeshFile { inner: Arc::new(file) })
}

/// The formats of mesh files, by name.
///
/// Parameters
/// ----------
/// written : bool, default False
///     Only those that meshes are written to.
///
/// Returns
/// -------
/// list of str
///     Such as ``"ply"``, which are the extensions, too.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> "gltf" in semfm.mesh_formats(), "gltf" in semfm.mesh_formats(written=True)
/// (True, False)
#[pyfunction]
#[pyo3(signature = (*, written=false))]
pub fn mesh_formats(written: bool) -> Vec<&'static str> {
    let formats = io::MeshFormat::ALL.iter().filter(|format| format.is_writable() || !written);
    formats.map(|format| format.name()).collect()
}
