//! The renderer: a mesh and cameras in, pictures with depth and triangle ids out.
//!
//! `ordered_mesh` sorts dense meshes, `triangle` turns a triangle into linear forms over the image,
//! `raster` fills a z-buffer with them, `shade` gives its samples colours, `depth_lookup` finds the
//! depth at single positions, `occlusion` darkens what little light reaches, `edges` draws outlines.
//! Everything is computed on the CPU, the same at every thread count.

pub(crate) mod depth_lookup;
mod edges;
mod occlusion;
pub(crate) mod ordered_mesh;
pub(crate) mod raster;
mod shade;
pub(crate) mod triangle;

use std::fmt;
#[cfg(feature = "gpu")]
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use semfm_geom::{Mesh, Pinhole, Sphere, Task, surface_sphere};

#[cfg(feature = "gpu")]
pub(crate) use shade::light_direction;
pub use shade::{CornerNormals, SurfaceColor};

use crate::{Error, Result, View};
pub use occlusion::openness;
use occlusion::openness_of;
use ordered_mesh::OrderedMesh;
use raster::{DrawAll, Raster};
use shade::Shader;
use triangle::Projection;

/// Largest width or height of a view, in pixels.
pub(crate) const MAX_IMAGE_SIDE: u32 = 8192;

/// Samples of one z-buffer: larger pictures are drawn in bands of rows, which bounds the memory.
const BAND_SAMPLES: usize = 1 << 20;

/// Pixels that one call may render, over all views; they take eleven bytes each.
const MAX_PIXELS: u64 = 1 << 28;

/// Light, colours and smoothing. The defaults are those that the encoder was measured with.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct RenderSettings {
    /// Colour samples along each side of a pixel (1 to 8).
    pub supersampling: u32,
    /// Colour behind the object (sRGB, 0 to 1).
    pub background: [f32; 3],
    /// Where the light comes from, in camera axes x right, y up, z towards the viewer.
    pub light: [f64; 3],
    /// Brightness of a surface that the light grazes; one that faces it has 1.
    pub ambient: f64,
    /// Vertex normals are used up to this angle from the triangle's own, in radians.
    pub crease: f64,
    /// How much what is closed in is darkened, from 0 (not at all) to 1 (by its [`openness`]).
    pub occlusion: f64,
    /// How dark silhouettes and creases are drawn, from 0 (not at all) to 1 (black).
    pub edges: f64,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            supersampling: 2,
            background: [1.0; 3],
            light: [0.25, 0.35, 0.9],
            ambient: 0.35,
            crease: 40f64.to_radians(),
            occlusion: 0.0,
            edges: 0.0,
        }
    }
}

impl fmt::Display for RenderSettings {
    /// In one line, for the metadata of files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { supersampling, light: [x, y, z], ambient, occlusion, edges, .. } = self;
        write!(f, "{supersampling}² samples, light {x} {y} {z}, ambient {ambient}, ")?;
        write!(f, "occlusion {occlusion}, edges {edges}")
    }
}

impl RenderSettings {
    fn check(&self) -> Result<()> {
        if !(1..=8).contains(&self.supersampling) {
            let found = self.supersampling.to_string();
            return Err(Error::invalid("supersampling", "1 to 8", found));
        }
        let numbers = self.light.iter().chain([&self.ambient, &self.crease]);
        if !(numbers.copied().all(f64::is_finite) && self.light.iter().any(|&x| x != 0.0)) {
            let found =
                format!("light {:?}, ambient {}, crease {}", self.light, self.ambient, self.crease);
            return Err(Error::invalid(
                "lighting",
                "finite numbers and a light of some length",
                found,
            ));
        }
        if !self.background.iter().all(|c| (0.0..=1.0).contains(c)) {
            let found = format!("{:?}", self.background);
            return Err(Error::invalid("background", "sRGB values from 0 to 1", found));
        }
        for (name, strength) in [("occlusion", self.occlusion), ("edges", self.edges)] {
            if !(0.0..=1.0).contains(&strength) {
                return Err(Error::invalid(name, "0 to 1", strength.to_string()));
            }
        }
        Ok(())
    }
}

/// One picture per camera.
///
/// Depth and triangle id are those of the ray through the pixel's centre; colour is the mean of
/// `supersampling²` rays spread evenly over the pixel, so a pixel at the silhouette may be tinted
/// and yet have no triangle. Both sides of every triangle are drawn. Depth is kept as 1/z in f32
/// and returned in f32: relative precision 2e-7. Triangles at the same f32 depth: the lowest id.
///
/// ```
/// use semfm_geom::{Mesh, Task, math::DVec3};
/// use semfm_views::{SurfaceColor, RenderSettings, RigSettings, render, rig};
/// let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]])?;
/// let cameras = rig(&mesh, &RigSettings::default())?;
/// let views = render(&mesh, &SurfaceColor::default(), &cameras, &RenderSettings::default(), &Task::default())?;
/// assert_eq!(views[0].rgb.len(), 224 * 224 * 3);
/// # Ok::<(), semfm_views::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for a camera, settings or colours out of range, or more than 2²⁸ pixels in all;
/// [`semfm_geom::Error::NoArea`] for a surface without area; [`semfm_geom::Error::Cancelled`].
pub fn render(
    mesh: &Mesh,
    color: &SurfaceColor<'_>,
    cameras: &[Pinhole],
    settings: &RenderSettings,
    task: &Task,
) -> Result<Vec<View>> {
    let mut views = render_colorings(mesh, std::slice::from_ref(color), cameras, settings, task)?;
    Ok(views.swap_remove(0))
}

/// Pictures of one surface in several colourings from the same cameras (colourings × cameras): those of [`render`],
/// but what each sample sees is found once for all colourings.
///
/// # Errors
/// As [`render`]; [`Error::Invalid`] for no colouring.
pub fn render_colorings(
    mesh: &Mesh,
    colorings: &[SurfaceColor<'_>],
    cameras: &[Pinhole],
    settings: &RenderSettings,
    task: &Task,
) -> Result<Vec<Vec<View>>> {
    let requests = Request::for_each(mesh, colorings, cameras, settings)?;
    let done = AtomicUsize::new(0);
    task.step("render", 0, cameras.len())?;
    let by_camera: Vec<Vec<View>> = cameras
        .par_iter()
        .map(|camera| {
            task.check()?;
            let views = render_one(&requests, camera);
            task.step("render", done.fetch_add(1, Ordering::Relaxed) + 1, cameras.len())?;
            Ok(views)
        })
        .collect::<Result<_>>()?;
    let mut by_coloring: Vec<Vec<View>> = requests.iter().map(|_| Vec::new()).collect();
    for views in by_camera {
        by_coloring.iter_mut().zip(views).for_each(|(to, view)| to.push(view));
    }
    Ok(by_coloring)
}

/// The triangle of every pixel (height × width, −1 on the background) for each camera: that of
/// [`render`]'s views, at a fraction of their cost.
///
/// # Errors
/// As [`render`].
pub fn triangle_ids(mesh: &Mesh, cameras: &[Pinhole], task: &Task) -> Result<Vec<Vec<i32>>> {
    check_scene(mesh, cameras)?;
    let ordered = OrderedMesh::new(mesh);
    cameras
        .par_iter()
        .map(|camera| {
            task.check()?;
            Ok(triangles_of(&ordered, camera))
        })
        .collect()
}

/// The triangle of every pixel of one view, band by band as [`render_one`] draws it.
fn triangles_of(mesh: &OrderedMesh<'_>, camera: &Pinhole) -> Vec<i32> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let mut triangles = vec![-1; width * height];
    let projection = Projection::new(mesh, camera);
    let [columns, rows] = projection.window();
    if columns.is_empty() {
        return triangles;
    }
    let rows_per_band = (BAND_SAMPLES / columns.len()).max(1);
    for first in rows.clone().step_by(rows_per_band) {
        let band = first..rows.end.min(first + rows_per_band);
        let mut rasters = [Raster::new(1, columns.clone(), band.clone())];
        let draw = DrawAll { projection: &projection, rasters: &mut rasters };
        pulp::Arch::new().dispatch(draw);
        for (row, hits) in band.zip(rasters[0].hits.chunks_exact(columns.len())) {
            let pixels = &mut triangles[row * width..][columns.clone()];
            for (triangle, hit) in pixels.iter_mut().zip(hits) {
                *triangle = hit.face().map_or(-1, |face| face as i32);
            }
        }
    }
    triangles
}

/// Refuses pictures that are too large and a surface without area.
fn check_scene(mesh: &Mesh, cameras: &[Pinhole]) -> Result<()> {
    for (k, camera) in cameras.iter().enumerate() {
        check_size(k, camera)?;
    }
    let n_pixels: u64 = cameras.iter().map(|c| u64::from(c.width()) * u64::from(c.height())).sum();
    if n_pixels > MAX_PIXELS {
        let expected = format!("at most {MAX_PIXELS}");
        return Err(Error::invalid("pixels of all views", expected, n_pixels.to_string()));
    }
    if mesh.area() <= 0.0 {
        return Err(semfm_geom::Error::NoArea { n_faces: mesh.n_faces() }.into());
    }
    Ok(())
}

/// What is to be drawn: checked, and with what all views of it share.
pub(crate) struct Request<'a> {
    pub mesh: &'a Mesh,
    /// The same in the order of drawing.
    pub ordered: Arc<OrderedMesh<'a>>,
    pub color: &'a SurfaceColor<'a>,
    pub settings: &'a RenderSettings,
    pub normals: Arc<CornerNormals>,
    /// Centre and radius of the surface.
    pub sphere: Sphere,
    /// Light that reaches each vertex (n) where occlusion is asked for.
    occlusion: Option<Arc<[f32]>>,
}

impl<'a> Request<'a> {
    /// # Errors
    /// As [`render`].
    pub fn new(
        mesh: &'a Mesh,
        color: &'a SurfaceColor<'a>,
        cameras: &[Pinhole],
        settings: &'a RenderSettings,
    ) -> Result<Self> {
        let mut requests = Self::for_each(mesh, std::slice::from_ref(color), cameras, settings)?;
        Ok(requests.swap_remove(0))
    }

    /// One for each colouring, with everything shared that they have in common.
    ///
    /// # Errors
    /// As [`render_colorings`].
    fn for_each(
        mesh: &'a Mesh,
        colorings: &'a [SurfaceColor<'a>],
        cameras: &[Pinhole],
        settings: &'a RenderSettings,
    ) -> Result<Vec<Self>> {
        if colorings.is_empty() {
            return Err(Error::invalid("colourings", "at least one", "none"));
        }
        settings.check()?;
        colorings.iter().try_for_each(|color| color.check(mesh))?;
        check_scene(mesh, cameras)?;
        let ordered = Arc::new(OrderedMesh::new(mesh));
        let is_lit = |color: &SurfaceColor<'_>| !matches!(color, SurfaceColor::Normals);
        let strength = settings.occlusion as f32;
        let occlusion = (strength > 0.0 && colorings.iter().any(is_lit)).then(|| {
            openness_of(mesh, &ordered)
                .into_iter()
                .map(|open| 1.0 - strength * (1.0 - open))
                .collect()
        });
        let normals = Arc::new(CornerNormals::new(mesh, settings.crease));
        let sphere = surface_sphere(mesh);
        let request = |color| Self {
            mesh,
            ordered: Arc::clone(&ordered),
            color,
            settings,
            normals: Arc::clone(&normals),
            sphere,
            occlusion: occlusion.clone().filter(|_| is_lit(color)),
        };
        Ok(colorings.iter().map(request).collect())
    }

    /// Share of the light that reaches a vertex.
    pub fn light_at(&self, vertex: usize) -> f32 {
        self.occlusion.as_ref().map_or(1.0, |light| light[vertex])
    }

    /// What is drawn over a finished picture.
    pub fn finish(&self, view: &mut View) {
        if self.settings.edges > 0.0 {
            edges::draw(view, self);
        }
    }

    /// Colours a window of a view (columns and rows of pixels) of which the triangle and its depth are
    /// known for every sample.
    #[cfg(feature = "gpu")]
    pub fn shade_hits(
        &self,
        view: &mut View,
        [columns, rows]: [Range<usize>; 2],
        samples: impl Iterator<Item = (i32, f32)>,
    ) {
        let projection = Projection::new(&self.ordered, &view.camera);
        let width = view.camera.width() as usize;
        let first = rows.start * width * 3;
        let raster = Raster::of(self.settings.supersampling, columns, rows, samples);
        Shader::new(&projection, self).mix(&raster, &mut view.rgb[first..], width);
    }
}

/// Refuses a view that is larger than any encoder takes.
fn check_size(view: usize, camera: &Pinhole) -> Result<()> {
    for (field, side) in [("width", camera.width()), ("height", camera.height())] {
        if side > MAX_IMAGE_SIDE {
            let expected = format!("1 to {MAX_IMAGE_SIDE} pixels");
            return Err(Error::invalid(
                format!("view {view}: {field}"),
                expected,
                side.to_string(),
            ));
        }
    }
    Ok(())
}

/// A view in which nothing is seen.
pub(crate) fn blank(camera: &Pinhole, settings: &RenderSettings) -> View {
    let n_pixels = camera.width() as usize * camera.height() as usize;
    View {
        camera: *camera,
        rgb: shade::background(settings).repeat(n_pixels),
        depth: vec![f32::INFINITY; n_pixels],
        triangles: vec![-1; n_pixels],
    }
}

/// One view for each request: they differ in their colours alone.
fn render_one(requests: &[Request<'_>], camera: &Pinhole) -> Vec<View> {
    let Some(&Request { settings, ref ordered, .. }) = requests.first() else { return Vec::new() };
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let projection = Projection::new(ordered, camera);
    let shaders: Vec<Shader<'_>> =
        requests.iter().map(|request| Shader::new(&projection, request)).collect();
    let View { rgb, mut depth, mut triangles, .. } = blank(camera, settings);
    let mut pictures = vec![rgb; requests.len()];
    let window = projection.window();
    let samples_per_row = window[0].len() * (settings.supersampling as usize).pow(2);
    let rows_per_band = (BAND_SAMPLES / samples_per_row.max(1)).clamp(1, height);
    let band_pixels = rows_per_band * width;
    // Of each band its part of every picture.
    let mut bands: Vec<Vec<&mut [u8]>> = Vec::new();
    bands.resize_with(height.div_ceil(rows_per_band), Vec::new);
    for rgb in &mut pictures {
        let parts = rgb.chunks_mut(band_pixels * 3);
        bands.iter_mut().zip(parts).for_each(|(band, part)| band.push(part));
    }
    bands
        .par_iter_mut()
        .zip(depth.par_chunks_mut(band_pixels).zip(triangles.par_chunks_mut(band_pixels)))
        .enumerate()
        .for_each(|(band, (pictures, (depth, triangles)))| {
            let first = band * rows_per_band;
            let [columns, rows] = window.clone();
            let rows = rows.start.max(first)..rows.end.min(first + depth.len() / width);
            if columns.is_empty() || rows.is_empty() {
                return;
            }
            let mut rasters = [1, settings.supersampling]
                .map(|per_pixel| Raster::new(per_pixel, columns.clone(), rows.clone()));
            let draw = DrawAll { projection: &projection, rasters: &mut rasters };
            pulp::Arch::new().dispatch(draw);
            let [centres, samples] = rasters;
            let skipped = (rows.start - first) * width;
            let lines =
                depth[skipped..].chunks_mut(width).zip(triangles[skipped..].chunks_mut(width));
            for ((depth, triangles), hits) in lines.zip(centres.hits.chunks_exact(columns.len())) {
                let pixels = depth[columns.clone()].iter_mut().zip(&mut triangles[columns.clone()]);
                for ((depth, triangle), hit) in pixels.zip(hits) {
                    *depth = 1.0 / hit.inverse_depth(); // +∞ on the background
                    *triangle = hit.face().map_or(-1, |face| face as i32);
                }
            }
            for (shader, rgb) in shaders.iter().zip(pictures) {
                shader.mix(&samples, &mut rgb[skipped * 3..], width);
            }
        });
    let view =
        |rgb| View { camera: *camera, rgb, depth: depth.clone(), triangles: triangles.clone() };
    let mut views: Vec<View> = pictures.into_iter().map(view).collect();
    requests.iter().zip(&mut views).for_each(|(request, view)| request.finish(view));
    views
}
