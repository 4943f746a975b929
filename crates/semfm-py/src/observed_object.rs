//! `ObservedObject`: what cameras saw of an object, as an object.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use semfm::files::SurfaceFrame;
use semfm::geom::ShapeCache;
use semfm::observe::{self, SurfaceSettings};
use semfm::observed_object::ObservedViews;
use semfm::{Method, ObjectFrame, ObservedObject as Seen, VisibleFrames};

use crate::embeddings::Embeddings;
use crate::interruptible::{guard, run};
use crate::mesh::Mesh;
use crate::observation::{Observation, observation_of};
use crate::pinhole::Pinhole;
use crate::prepared::encoder_of;
use crate::shared::Shared;
use crate::{arrays_out, errors, json, pictures};

/// What a depth camera saw of an object, as an object: the surface with the pictures' colours and what lies around it.
///
/// Made by `Observation.surface` and `merged_surface`. Its mesh and the embeddings that `embed` makes are taken by
/// `transfer`, `prepare` and `find_grasps` like those of any other object.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import semfm
/// >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=800) for i in (0, 1))
/// >>> camera = semfm.rig(kettle.mesh, count=2, size=96)[0]
/// >>> view = semfm.render(kettle.mesh, [camera])[0]
/// >>> depth = np.where(np.isfinite(view.depth), view.depth, 0)
/// >>> seen = semfm.Observation(camera, depth=depth, masks={"kettle": view.triangles >= 0}).surface()
/// >>> result = semfm.transfer(mug.mesh, seen.mesh, mug.region, target_embeddings=seen.embed())
/// >>> result.region.n_vertices == seen.mesh.n_vertices
/// True
#[pyclass(frozen, module = "semfm")]
pub struct ObservedObject {
    inner: Arc<Seen>,
    settings: SurfaceSettings,
    notes: Vec<String>,
}

/// What a pickle holds: observations, the places of the object's masks, the settings, whether it is a merged surface, and
/// the notes.
type Pickled = (Vec<Observation>, Vec<Option<usize>>, (usize, usize, usize), bool, Vec<String>);

impl ObservedObject {
    /// Of one frame, in its camera's frame, or of several whose cameras' poses are known.
    pub fn new(
        py: Python<'_>,
        frames: Vec<ObjectFrame>,
        settings: SurfaceSettings,
    ) -> PyResult<Self> {
        let inner = run(py, None, move |_| Seen::new(frames, &settings))?;
        Ok(Self { inner: Arc::new(inner), settings, notes: Vec::new() })
    }

    /// In the frame of the cameras' poses.
    fn merged(
        py: Python<'_>,
        frames: Vec<ObjectFrame>,
        settings: SurfaceSettings,
        notes: Vec<String>,
    ) -> PyResult<Self> {
        let inner = run(py, None, move |_| Seen::merged(frames, &settings))?;
        Ok(Self { inner: Arc::new(inner), settings, notes })
    }
}

#[pymethods]
impl ObservedObject {
    /// Mesh: the surface, metres, in its camera's own frame; in that of the cameras' poses where it was merged.
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh { inner: Shared::part_of(&self.inner, Seen::mesh) }
    }

    /// (n, 3) uint8 array, optional: sRGB of each vertex, a read-only view; None where a frame has no colours.
    #[getter]
    fn colors<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyAny>>> {
        if slf.get().inner.colors().is_none() {
            return Ok(None);
        }
        fn bytes(seen: &ObservedObject) -> &[u8] {
            seen.inner.colors().map_or(&[], <[[u8; 3]]>::as_flattened)
        }
        arrays_out::rows(slf, 3, bytes).map(Some)
    }

    /// (m, 3) float64 array: points of what was seen beside the object, in the frame of `mesh`, metres: obstacles
    /// (``scene_points``) of `find_grasps`.
    #[getter]
    fn around<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::points(py, self.inner.around())
    }

    /// list of Observation: the frames.
    #[getter]
    fn observations(&self) -> Vec<Observation> {
        let observation = |frame: &ObjectFrame| Observation { inner: frame.seen.clone() };
        self.inner.frames().iter().map(observation).collect()
    }

    /// list of str: which frames `merged_surface` left out, and why, as ``semfm-cli surface --merge`` prints it.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// list of Pinhole: the cameras in the frame of `mesh`.
    #[getter]
    fn cameras(&self, py: Python<'_>) -> PyResult<Vec<Pinhole>> {
        let cameras = guard(py, || self.inner.cameras())?;
        Ok(cameras.into_iter().map(|camera| Pinhole { camera }).collect())
    }

    /// dict: where it comes from and what became of the pixels, as `surface.json` of ``semfm-cli surface`` has it.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let file = self.inner.with_result(None, |result| result.file());
        json::to_python(py, &file)
    }

    /// Embeddings for `transfer` and `prepare`: of the pictures, of the surface rendered from where it was seen, or of both.
    ///
    /// Parameters
    /// ----------
    /// encoder : str, default "builtin"
    ///     ``builtin``, a ``.net`` file, a Hugging Face name, a local checkpoint, an ONNX encoder's JSON,
    ///     or ``package.module:Class``.
    /// rolls : int, optional
    ///     Rotations of each view that are averaged, 1, 2 or 4; what the encoder wants where none is given.
    /// views : str, optional
    ///     What the encoder is shown: ``"pictures"``, ``"surface"`` or ``"both"``; what suits it where none is given:
    ///     ``"surface"`` where it was trained on grey views, as the built-in one, or where there are no colours.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// Embeddings
    #[pyo3(signature = (*, encoder="builtin", rolls=None, views=None, progress=None))]
    fn embed(
        &self,
        py: Python<'_>,
        encoder: &str,
        rolls: Option<u32>,
        views: Option<&str>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Embeddings> {
        if let Some(rolls) = rolls.filter(|rolls| ![1, 2, 4].contains(rolls)) {
            return Err(errors::invalid(py, "rolls", "1, 2 or 4", &rolls.to_string()));
        }
        let views: Option<ObservedViews> =
            guard(py, || views.map(str::parse::<ObservedViews>).transpose())?;
        let most_rolls = Method::default().info().features.rolls;
        let encoder = encoder_of(py, Some(encoder), rolls, most_rolls, &ShapeCache::off())?;
        let seen = self.inner.clone();
        let made = run(py, progress, move |task| seen.embed(&encoder, views, task))?;
        Ok(Embeddings { inner: Arc::new(made.file) })
    }

    /// Writes the folder that ``semfm-cli surface`` writes: `surface.ply`, `surface.emb.mcap`, `surface.views.mcap`,
    /// `around.ply` and `surface.json`.
    ///
    /// Parameters
    /// ----------
    /// folder : path
    ///     Made if it is not there.
    /// embeddings : Embeddings, optional
    ///     From `embed`; without them `surface.emb.mcap` is not written.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// list of str
    ///     The files.
    #[pyo3(signature = (folder, *, embeddings=None, progress=None))]
    fn write(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        embeddings: Option<&Bound<'_, Embeddings>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<String>> {
        let file = embeddings.map(|embeddings| embeddings.get().inner.clone());
        let embeddings = match file {
            Some(file) => {
                guard(py, || Ok(file.check_mesh(self.inner.mesh())?))?;
                let shown = ObservedViews::of_file(&file).ok_or_else(|| {
                    let found = format!("views `{}`", file.metadata.views.rig);
                    errors::invalid(py, "embeddings", "those of ObservedObject.embed", &found)
                })?;
                Some((file, shown))
            }
            None => None,
        };
        let seen = self.inner.clone();
        let files = run(py, progress, move |task| {
            let embeddings = embeddings.as_ref().map(|(file, shown)| (&**file, *shown));
            seen.write(&folder, embeddings, task)
        })?;
        Ok(files.iter().map(|file| file.display().to_string()).collect())
    }

    /// A picture of the surface in its colours, which notebooks show by themselves.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let seen = self.inner.clone();
        pictures::png(py, move |path, task| pictures::write_observed_picture(path, &seen, task))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py))
    }

    fn __repr__(&self) -> String {
        let (mesh, n) = (self.inner.mesh(), self.inner.frames().len());
        let frames = if n == 1 { "1 frame".to_owned() } else { format!("{n} frames") };
        format!(
            "ObservedObject({} vertices, {} triangles, of {frames})",
            mesh.n_vertices(),
            mesh.n_faces()
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Pickled)> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_observed_object")?;
        let masks = self.inner.frames().iter().map(|frame| frame.mask).collect();
        let SurfaceSettings { smooth_pixels, trim_pixels, most_vertices } = self.settings;
        let settings = (smooth_pixels, trim_pixels, most_vertices);
        let is_merged = self.inner.frame() == SurfaceFrame::World;
        Ok((restore, (self.observations(), masks, settings, is_merged, self.notes())))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// An observed object out of a pickle: made again, which gives the same.
#[pyfunction]
pub fn _restore_observed_object(
    py: Python<'_>,
    observations: Vec<Bound<'_, Observation>>,
    masks: Vec<Option<usize>>,
    settings: (usize, usize, usize),
    is_merged: bool,
    notes: Vec<String>,
) -> PyResult<ObservedObject> {
    let frames = observations.iter().zip(masks);
    let frames = frames.map(|(seen, mask)| ObjectFrame { seen: seen.get().inner.clone(), mask });
    let (smooth_pixels, trim_pixels, most_vertices) = settings;
    let settings = SurfaceSettings { smooth_pixels, trim_pixels, most_vertices };
    match is_merged {
        true => ObservedObject::merged(py, frames.collect(), settings, notes),
        false => ObservedObject::new(py, frames.collect(), settings),
    }
}

/// The settings of a surface; what is wrong with them is named as the argument.
pub fn surface_settings(
    py: Python<'_>,
    smooth_pixels: usize,
    trim_pixels: usize,
    most_vertices: usize,
) -> PyResult<SurfaceSettings> {
    let settings = SurfaceSettings { smooth_pixels, trim_pixels, most_vertices };
    settings.check().map_err(|error| match error {
        observe::Error::Invalid { what, expected, found } => {
            let argument = match what.as_str() {
                "smooth" => "smooth_pixels",
                "trim" => "trim_pixels",
                "vertices" => "most_vertices",
                other => other,
            };
            errors::invalid(py, argument, &expected, &found)
        }
        other => errors::raise(py, &other.into()),
    })?;
    Ok(settings)
}

/// One surface of what several frames saw from known places: ``semfm-cli surface --merge``.
///
/// Parameters
/// ----------
/// observations : list of Observation
///     Their cameras' poses are known (`Observation.camera`), and the object stands still in them.
/// mask : str, optional
///     Name of the object's mask; the only one of each frame where none is given. Frames that have none, or no depth under
///     it, are left out: `ObservedObject.notes` says which.
/// smooth_pixels : int, default 3
///     Radius of the window in which depth is smoothed, 0 to 20.
/// trim_pixels : int, default 1
///     Pixels along the mask's outline that are left out, 0 to 100.
///
/// Returns
/// -------
/// ObservedObject
///     In the frame of the cameras' poses, metres.
#[pyfunction]
#[pyo3(signature = (observations, *, mask=None, smooth_pixels=3, trim_pixels=1))]
pub fn merged_surface(
    observations: &Bound<'_, PyAny>,
    mask: Option<&str>,
    smooth_pixels: usize,
    trim_pixels: usize,
) -> PyResult<ObservedObject> {
    let py = observations.py();
    let most_vertices = SurfaceSettings::default().most_vertices;
    let settings = surface_settings(py, smooth_pixels, trim_pixels, most_vertices)?;
    let list = observations.try_iter();
    let list =
        list.map_err(|_| errors::wrong_type("observations", "Observations", observations))?;
    let seen = list.map(|seen| Ok(observation_of(&seen?)?.inner.clone()));
    let seen = seen.collect::<PyResult<Vec<_>>>()?;
    let object = mask.map(ToOwned::to_owned);
    let visible = run(py, None, move |_| VisibleFrames::of(seen, object.as_deref()))?;
    ObservedObject::merged(py, visible.frames, settings, visible.left_out)
}
