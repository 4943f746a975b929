//! How much of a transfer is left where the target is not a mesh but what a depth camera saw of it.
//!
//! ```text
//! SEMFM_SHARED=../shared cargo run --release -p semfm --example bench_observed -- [PAIRS OF EACH GROUP] [--pictures]
//! ```
//!
//! Pairs of `shared/data/objects`, every so many of each group of `pairs.json`. The target is 20 cm long, stands before a
//! wall and is seen by cameras at .6 m (640 × 480, f = 600, noise of .2 % of the depth, one pixel of 20 without a return):
//! from a direction drawn for each pair, from the opposite one too, and from two more across. Its picture has the target's own
//! colours where `coloured/` has some, else grey with a pattern, a light from the side, and noise. True region: what is nearest
//! to the true region of the whole target. Prints a table of mean IoU in vertices of the observed mesh; `whole mesh` is the
//! answer for the complete target, held against the same vertices.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "the numbers are what this program is for"
)]

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};

use semfm::align::DepthImage;
use semfm::encoder::{Encoder, ObservedPicture, builtin_encoder};
use semfm::files::read_region;
use semfm::geom::io::{MeshFile, read_mesh};
use semfm::geom::math::{DAffine3, DMat3, DVec3};
use semfm::geom::{Intrinsics, Mesh, Pinhole, PointIndex, Task};
use semfm::observe::{MaskedFrame, Observation, SurfaceSettings, merged_surface};
use semfm::observed_object::{ObservedViews, encode_observed, observed_views, picture_views};
use semfm::views::{EmbeddedView, RenderSettings, Renderer, SurfaceColor, rig};
use semfm::{FeatureSource, PipelineSettings, Prepared, Region, prepare, transfer};

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

const LENGTH: f64 = 0.2;
const DISTANCE: f64 = 0.6;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let with_pictures = arguments.iter().any(|a| a == "--pictures");
    let n_pairs = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(3);
    let shared = std::env::var_os("SEMFM_SHARED").map_or("../shared".into(), PathBuf::from);
    let folder = shared.join("data/objects");
    if !folder.exists() {
        eprintln!("SKIPPED: no shared data at {}", folder.display());
        return Ok(());
    }
    let mut table = Table::default();
    for (group, pairs) in pairs(&folder)? {
        let step = pairs.len().div_ceil(n_pairs).max(1);
        for (i, [source, target]) in pairs.iter().step_by(step).enumerate() {
            let source = Object::read(&folder, source)?;
            let target = Object::read(&folder, target)?;
            let rows = measure(&source, &target, i as u64, with_pictures)?;
            eprintln!("{group}: {} → {}: {rows:.2?}", source.name, target.name);
            table.add(&group, rows);
        }
    }
    table.print();
    Ok(())
}

/// The pairs of each group.
fn pairs(folder: &Path) -> Outcome<BTreeMap<String, Vec<[String; 2]>>> {
    Ok(serde_json::from_slice(&std::fs::read(folder.join("pairs.json"))?)?)
}

struct Object {
    name: String,
    mesh: Mesh,
    region: Region,
    colors: Option<Vec<[u8; 4]>>,
}

impl Object {
    /// 20 cm long, around the origin.
    fn read(folder: &Path, name: &str) -> Outcome<Self> {
        let found = std::fs::read_dir(folder)?.flatten().find_map(|category| {
            let path = category.path().join(format!("{name}.obj"));
            (path.exists() && path.with_extension("json").exists()).then_some(path)
        });
        let path = found.ok_or_else(|| format!("no object {name}"))?;
        let MeshFile { mesh, .. } = read_mesh(&path)?;
        let region = read_region(&path.with_extension("json"), &mesh)?;
        let (low, high) = mesh.bounds();
        let scale = LENGTH / (high - low).max_element();
        let vertices = mesh.vertices().iter().map(|p| scale * (*p - (low + high) / 2.0)).collect();
        let mesh = Mesh::new(vertices, mesh.faces().to_vec())?;
        let colored = folder.join("coloured").join(format!("{name}.ply"));
        let colors = match colored.exists() {
            true => read_mesh(&colored)?.appearance.vertex_colors,
            false => None,
        };
        let colors = colors.filter(|colors| colors.len() == mesh.n_vertices());
        Ok(Self { name: name.into(), mesh, region, colors })
    }
}

type Rows = Vec<(String, f64)>;

fn measure(source: &Object, target: &Object, seed: u64, with_pictures: bool) -> Outcome<Rows> {
    let mut rows = Rows::new();
    let encoder = builtin_encoder()?;
    let settings = PipelineSettings::default();
    let task = Task::default();
    let features = FeatureSource::Encoder(&*encoder);
    let demonstrated = prepare(source.mesh.clone(), features.clone(), &settings, &task)?;
    let whole = prepare(target.mesh.clone(), features, &settings, &task)?;
    let on_whole = answer(&demonstrated, source, &whole)?;
    rows.push(("whole mesh, all of it".into(), iou(&on_whole, &mask_of(&target.region))));
    let mut random = Random(seed + 77);
    let first = random.direction();
    let second = first.any_orthonormal_vector();
    let frames: Vec<Observation> = [first, -first, second, -second]
        .iter()
        .map(|&from| seen(target, from, &mut random))
        .collect::<Outcome<_>>()?;
    let nearest = PointIndex::new(target.mesh.vertices())?;
    let truth_of = |mesh: &Mesh, mask: &[bool]| -> Vec<bool> {
        mesh.vertices().iter().map(|&p| mask[nearest.nearest(p).0]).collect()
    };
    for n in [1, 2, 4] {
        let mesh = surface_of(&frames[..n])?;
        let truth = truth_of(&mesh, &mask_of(&target.region));
        if !truth.contains(&true) {
            continue;
        }
        let sides = format!("{n} side{}", if n > 1 { "s" } else { "" });
        rows.push((format!("{sides}, whole mesh"), iou(&truth_of(&mesh, &on_whole), &truth)));
        let mut add = |name: &str, features: FeatureSource<'_>| -> Outcome<()> {
            let seen = prepare(mesh.clone(), features, &settings, &task)?;
            rows.push((
                format!("{sides}, {name}"),
                iou(&answer(&demonstrated, source, &seen)?, &truth),
            ));
            Ok(())
        };
        let pictures: Vec<ObservedPicture<'_>> = frames[..n].iter().map(picture).collect();
        for shown in [ObservedViews::Surface, ObservedViews::Pictures, ObservedViews::Both] {
            let views = observed_views(&mesh, &pictures, shown, &encoder.wants(), &task)?;
            let encoded = encode_observed(&views, &*encoder, 1, &task)?;
            add(&shown.to_string(), FeatureSource::Views(&encoded.views))?;
        }
        add("as a mesh", FeatureSource::Encoder(&*encoder))?;
    }
    if with_pictures {
        // The reconstruction at its pose: rendered views, and the pictures of one camera and of four among them.
        let wants = encoder.wants();
        let cameras = rig(&target.mesh, &wants.views.rig)?;
        let grey = SurfaceColor::default();
        let rendered =
            Renderer::cpu().render(&target.mesh, &grey, &cameras, &wants.views.render, &task)?;
        for n in [1, 4] {
            let pictures: Vec<ObservedPicture<'_>> = frames[..n].iter().map(picture).collect();
            let mut views = picture_views(&target.mesh, &pictures, &wants, &task)?;
            views.extend(rendered.iter().cloned());
            let embedded = encoded(&target.mesh, views, &*encoder, &task)?;
            let joined =
                prepare(target.mesh.clone(), FeatureSource::Views(&embedded), &settings, &task)?;
            let found = answer(&demonstrated, source, &joined)?;
            rows.push((
                format!("whole mesh, {n} pictures joined"),
                iou(&found, &mask_of(&target.region)),
            ));
        }
    }
    Ok(rows)
}

fn encoded(
    mesh: &Mesh,
    views: Vec<semfm::views::View>,
    encoder: &dyn Encoder,
    task: &Task,
) -> Outcome<Vec<EmbeddedView>> {
    let settings = encoder.wants().views;
    let renderer = String::new();
    let object = semfm::encoder::rendered_views::RenderedObject {
        mesh,
        views,
        settings,
        vertex_colors: None,
        renderer,
    };
    Ok(encoder.encode(&[object], 1, task)?.remove(0).views)
}

fn picture(seen: &Observation) -> ObservedPicture<'_> {
    let mask = seen.masks().first().map(|mask| &mask.marked[..]);
    ObservedPicture { camera: *seen.camera(), color: seen.color().unwrap_or_default(), mask }
}

/// In the target's frame.
fn surface_of(frames: &[Observation]) -> Outcome<Mesh> {
    let settings = SurfaceSettings::default();
    if let [seen] = frames {
        let surface = seen.surface(seen.masks().first(), &settings)?;
        let back = seen.camera().camera_from_world().inverse();
        let vertices = surface.mesh.vertices().iter().map(|&p| back.transform_point3(p)).collect();
        return Ok(Mesh::new(vertices, surface.mesh.faces().to_vec())?);
    }
    let masked: Vec<MaskedFrame<'_>> =
        frames.iter().map(|seen| MaskedFrame { seen, mask: seen.masks().first() }).collect();
    Ok(merged_surface(&masked, &settings)?.mesh)
}

fn answer(source: &Prepared, object: &Object, target: &Prepared) -> Outcome<Vec<bool>> {
    let settings = PipelineSettings::default().transfer;
    let task = Task::default();
    let found = transfer(&source.object, &target.object, &object.region, &settings, &task)?;
    Ok(mask_of(&found.region))
}

fn mask_of(region: &Region) -> Vec<bool> {
    region.weights().iter().map(|&weight| weight >= 0.5).collect()
}

fn iou(a: &[bool], b: &[bool]) -> f64 {
    let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
    let either = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
    both as f64 / either.max(1) as f64
}

/// What a camera in a direction sees of an object in the origin before a wall.
fn seen(object: &Object, from: DVec3, random: &mut Random) -> Outcome<Observation> {
    let z = -from;
    let x = z.any_orthonormal_vector();
    let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
    let pose = DAffine3::from_mat3_translation(rotation, DISTANCE * DVec3::Z);
    let (width, height) = (640, 480);
    let intrinsics = Intrinsics { width, height, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0 };
    let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose)?;
    let light = RenderSettings { light: [0.7, 0.2, 0.4], ambient: 0.25, ..Default::default() };
    let paint = |face: usize, weights: [f64; 3]| {
        let corners = object.mesh.faces()[face];
        match &object.colors {
            Some(colors) => [0, 1, 2].map(|channel| {
                let at = |k: usize| f64::from(colors[corners[k] as usize][channel]) / 255.0;
                (0..3).map(|k| weights[k] * at(k)).sum::<f64>() as f32
            }),
            None => {
                let [a, b, c] = object.mesh.corners(face);
                let p = a * weights[0] + b * weights[1] + c * weights[2];
                let waves = (90.0 * p.x).sin() * (70.0 * p.y).sin() * (80.0 * p.z).cos();
                let grey = (0.5 + 0.25 * waves) as f32;
                [grey, 0.9 * grey, 0.75 * grey]
            }
        }
    };
    let color = SurfaceColor::Surface(&paint);
    let view = Renderer::cpu()
        .render(&object.mesh, &color, &[camera], &light, &Task::default())?
        .remove(0);
    let marked: Vec<bool> = view.triangles.iter().map(|&t| t >= 0).collect();
    let mut depth = Vec::new();
    for &z in &view.depth {
        let z = if z.is_finite() { z } else { 1.2 };
        let is_lost = random.uniform() < 0.05;
        depth.push(if is_lost { 0.0 } else { z * (1.0 + 0.002 * random.normal() as f32) });
    }
    let (pixels, _) = view.rgb.as_chunks::<3>();
    let mut picture = Vec::new();
    for (i, &pixel) in pixels.iter().enumerate() {
        let behind = [60 + (i / 7 % 40) as u8, 90, 40 + (i / 640 % 90) as u8];
        let base = if marked[i] { pixel } else { behind };
        let noise = 4.0 * random.normal();
        picture.push(base.map(|c| (f64::from(c) + noise).clamp(0.0, 255.0) as u8));
    }
    Ok(Observation::new(camera)
        .with_depth(DepthImage::new(width as usize, height as usize, depth)?)?
        .with_color(picture)?
        .with_mask("object", marked)?)
}

/// Numbers drawn by chance, the same on every machine (SplitMix64).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Of standard deviation 1, by twelve uniform ones.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.uniform() - 1.0;
        let turn = std::f64::consts::TAU * self.uniform();
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * turn.cos(), r * turn.sin(), z)
    }
}

/// Rows by name, in the order in which they came.
#[derive(Default)]
struct Table {
    rows: Vec<(String, BTreeMap<String, Vec<f64>>)>,
}

impl Table {
    fn add(&mut self, group: &str, rows: Rows) {
        for (name, iou) in rows {
            let at = self.rows.iter().position(|row| row.0 == name).unwrap_or_else(|| {
                self.rows.push((name, BTreeMap::new()));
                self.rows.len() - 1
            });
            self.rows[at].1.entry(group.to_owned()).or_default().push(iou);
        }
    }

    fn print(&self) {
        let mut rows: Vec<&(String, BTreeMap<String, Vec<f64>>)> = self.rows.iter().collect();
        rows.sort_by_key(|row| row.0.split(',').next().map(ToOwned::to_owned));
        println!("| target | pairs | mean IoU | median | below .3 |");
        println!("| --- | --- | --- | --- | --- |");
        for (name, groups) in rows {
            let mut all: Vec<f64> = groups.values().flatten().copied().collect();
            all.sort_by(f64::total_cmp);
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            let poor = all.iter().filter(|&&iou| iou < 0.3).count() as f64 / all.len() as f64;
            let (n, median) = (all.len(), all[all.len() / 2]);
            println!("| {name} | {n} | {mean:.3} | {median:.3} | {poor:.2} |");
        }
        for (name, groups) in &self.rows {
            let means: Vec<String> = groups
                .iter()
                .map(|(group, all)| {
                    format!("{group} {:.2}", all.iter().sum::<f64>() / all.len() as f64)
                })
                .collect();
            eprintln!("{name}: {}", means.join(", "));
        }
    }
}
