//! Medians of rendering and lifting on a mesh: the CPU's renderer, a graphics driver's, and both
//! side by side in one run.
//!
//! ```sh
//! cargo run --release -p semfm-views --example bench_render -- MESH [--who cpu,driver,lift]
//!     [--shots 14x224,12x448] [--repeats 15] [--sheet SHEET.png] [--folder FOLDER]
//! ```
//!
//! `--shots` are numbers of views and sides in pixels. `--folder` writes what another program needs
//! to draw the same: the mesh, cameras and times in `bench.json`, and the pictures as raw arrays.
#![allow(clippy::print_stdout)]

use std::path::{Path, PathBuf};
use std::time::Instant;

use cpu_time::ProcessTime;
use semfm_geom::{Mesh, Pinhole, Task};
use semfm_views::{
    EmbeddedView, LiftSettings, PatchEmbeddings, PatchGrid, RenderSettings, RigSettings,
    SurfaceColor, View, lift, render, rig,
};
use serde_json::{Value, json};

const DIM: usize = 416;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let order = Order::read(std::env::args().skip(1))?;
    let mesh = semfm_geom::io::read_mesh(&order.mesh)?.mesh;
    println!("{} vertices, {} triangles", mesh.n_vertices(), mesh.n_faces());
    let mut bench = Bench { order: &order, mesh: &mesh, times: Vec::new(), exact: Vec::new() };
    for who in &order.who {
        match who.as_str() {
            "cpu" => bench.draw("cpu", &|cameras| {
                let (settings, task) = (RenderSettings::default(), Task::default());
                render(&mesh, &SurfaceColor::GREY, cameras, &settings, &task)
            })?,
            "driver" => bench_driver(&mut bench)?,
            "lift" => bench_lift(&bench)?,
            other => return Err(format!("--who: cpu, driver or lift, not {other}").into()),
        }
    }
    if let Some(folder) = &order.folder {
        let array = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes);
        array("vertices.f64", bytemuck::cast_slice(mesh.vertices()))?;
        array("faces.u32", bytemuck::cast_slice(mesh.faces()))?;
        let shots: Result<Vec<Value>, Failure> =
            order.shots.iter().map(|shot| Ok(shot.told(&shot.cameras(&mesh)?))).collect();
        let report = json!({ "mesh": order.mesh, "shots": shots?, "times": bench.times });
        std::fs::write(folder.join("bench.json"), serde_json::to_vec_pretty(&report)?)?;
    }
    Ok(())
}

/// What was asked for.
struct Order {
    mesh: PathBuf,
    who: Vec<String>,
    shots: Vec<Shot>,
    repeats: usize,
    sheet: Option<PathBuf>,
    folder: Option<PathBuf>,
}

impl Order {
    fn read(mut arguments: impl Iterator<Item = String>) -> Result<Self, Failure> {
        let mesh = arguments.next().ok_or("which mesh?")?.into();
        let list = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
        let (mut who, mut shots) = (list("cpu,driver,lift"), list("14x224,12x448"));
        let (mut repeats, mut sheet, mut folder) = (15, None, None);
        while let Some(option) = arguments.next() {
            let value = arguments.next().ok_or_else(|| format!("{option} needs a value"))?;
            match option.as_str() {
                "--who" => who = list(&value),
                "--shots" => shots = list(&value),
                "--repeats" => repeats = value.parse()?,
                "--sheet" => sheet = Some(value.into()),
                "--folder" => folder = Some(value.into()),
                _ => return Err(format!("there is no option {option}").into()),
            }
        }
        let shots = shots.iter().map(|shot| Shot::read(shot)).collect::<Result<_, _>>()?;
        Ok(Self { mesh, who, shots, repeats, sheet, folder })
    }
}

/// Views of one size.
#[derive(Clone, Copy)]
struct Shot {
    count: usize,
    size: u32,
}

impl Shot {
    fn read(text: &str) -> Result<Self, Failure> {
        let (count, size) = text.split_once('x').ok_or("--shots: such as 14x224,12x448")?;
        Ok(Self { count: count.parse()?, size: size.parse()? })
    }

    fn cameras(self, mesh: &Mesh) -> semfm_views::Result<Vec<Pinhole>> {
        rig(mesh, &RigSettings { count: self.count, size: self.size, ..Default::default() })
    }

    /// For other programs: matrices are rows.
    fn told(self, cameras: &[Pinhole]) -> Value {
        let cameras = cameras.iter().map(|camera| {
            let pose = camera.camera_from_world();
            json!({
                "fx": camera.fx(), "fy": camera.fy(), "cx": camera.cx(), "cy": camera.cy(),
                "rotation": pose.matrix3.transpose().to_cols_array_2d(),
                "translation": pose.translation.to_array(),
            })
        });
        json!({ "count": self.count, "size": self.size, "cameras": cameras.collect::<Vec<_>>() })
    }
}

struct Bench<'a> {
    order: &'a Order,
    mesh: &'a Mesh,
    times: Vec<Value>,
    /// The CPU's views of each shot, once it drew them.
    exact: Vec<Vec<View>>,
}

impl Bench<'_> {
    /// Draws every shot `repeats` times.
    fn draw(
        &mut self,
        who: &str,
        draw: &dyn Fn(&[Pinhole]) -> semfm_views::Result<Vec<View>>,
    ) -> Result<(), Failure> {
        for (k, shot) in self.order.shots.iter().enumerate() {
            let cameras = shot.cameras(self.mesh)?;
            let name = format!("{who}: {} views at {} px", shot.count, shot.size);
            let mut views = Vec::new();
            let [wall, cpu] = self.time(&name, shot.count, || {
                views = draw(&cameras)?;
                Ok(())
            })?;
            self.times.push(json!({
                "who": who, "count": shot.count, "size": shot.size, "wall_ms": wall, "cpu_ms": cpu,
            }));
            if let Some(exact) = self.exact.get(k) {
                println!(
                    "    {:.3} % of the pixels see the CPU's triangle",
                    100.0 * same(exact, &views)
                );
            }
            if let Some(folder) = &self.order.folder {
                write_pictures(folder, &format!("{who}-{}x{}", shot.count, shot.size), &views)?;
            }
            if let Some(sheet) = self.order.sheet.as_ref().filter(|_| k == 0) {
                save_sheet(&views, sheet)?;
            }
            if who == "cpu" {
                self.exact.push(views);
            }
        }
        Ok(())
    }

    /// Medians of wall and process CPU time in milliseconds.
    fn time(
        &self,
        name: &str,
        n_views: usize,
        mut work: impl FnMut() -> Result<(), Failure>,
    ) -> Result<[f64; 2], Failure> {
        let mut times = Vec::new();
        for _ in 0..self.order.repeats {
            let (wall, cpu) = (Instant::now(), ProcessTime::now());
            work()?;
            times.push([wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64()]);
        }
        let median = |which: usize| {
            let mut values: Vec<f64> = times.iter().map(|time| time[which]).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2] * 1e3
        };
        let [wall, cpu] = [median(0), median(1)];
        let per_view = wall / n_views as f64;
        println!("{name}: {wall:.1} ms wall ({per_view:.2} a view), {cpu:.1} ms CPU");
        Ok([wall, cpu])
    }
}

/// The same pictures by a graphics driver, where there is one.
#[cfg(feature = "gpu")]
fn bench_driver(bench: &mut Bench<'_>) -> Result<(), Failure> {
    let start = Instant::now();
    let gpu = match semfm_views::GpuRenderer::new() {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("{error}");
            return Ok(());
        }
    };
    let opened = start.elapsed().as_secs_f64() * 1e3;
    println!("driver: {} opened in {opened:.0} ms", gpu.name());
    bench.times.push(json!({ "who": "driver", "adapter": gpu.name(), "open_ms": opened }));
    let mesh = bench.mesh;
    bench.draw("driver", &|cameras| {
        gpu.render(mesh, &SurfaceColor::GREY, cameras, &RenderSettings::default(), &Task::default())
    })
}

#[cfg(not(feature = "gpu"))]
fn bench_driver(_: &mut Bench<'_>) -> Result<(), Failure> {
    Ok(())
}

fn bench_lift(bench: &Bench<'_>) -> Result<(), Failure> {
    let (mesh, task) = (bench.mesh, Task::default());
    let cameras = rig(mesh, &RigSettings::default())?;
    let views = render(mesh, &SurfaceColor::GREY, &cameras, &RenderSettings::default(), &task)?;
    let embedded: Vec<EmbeddedView> = views.iter().map(noise_tokens).collect();
    for (name, settings) in
        [("pull", LiftSettings::default()), ("unproject", LiftSettings::paper())]
    {
        let mut seen = 0;
        bench.time(&format!("lift by {name}, 14 views, d = {DIM}"), 14, || {
            seen = lift(mesh, &embedded, &settings, &task)?.report.n_seen;
            Ok(())
        })?;
        println!("    {seen} of {} samples seen", settings.n_samples);
    }
    Ok(())
}

/// Tokens of the right shape without an encoder: patches of 16 pixels.
fn noise_tokens(view: &View) -> EmbeddedView {
    let side = view.camera.width() as usize / 16;
    let rect = [0.0, 0.0, view.camera.width() as f32, view.camera.height() as f32];
    let grid = PatchGrid { rows: side, cols: side, rect };
    let data = (0..side * side * DIM).map(|i| (i as f32 * 0.37).sin()).collect();
    let (coverage, valid) = (vec![255; side * side], vec![true; side * side]);
    let patches = PatchEmbeddings::new(grid, DIM, data, coverage, valid)
        .expect("sines are finite, and there is one for each dimension");
    EmbeddedView { camera: view.camera, patches }
}

/// Share of the pixels that see the same triangle.
fn same(one: &[View], other: &[View]) -> f64 {
    let all = |views: &[View]| views.iter().flat_map(|view| view.triangles.clone()).collect();
    let (one, other): (Vec<i32>, Vec<i32>) = (all(one), all(other));
    let n_same = one.iter().zip(&other).filter(|(a, b)| a == b).count();
    n_same as f64 / one.len().max(other.len()) as f64
}

/// All views of a shot, one after the other, as raw arrays.
fn write_pictures(folder: &Path, name: &str, views: &[View]) -> std::io::Result<()> {
    let all = |of: fn(&View) -> &[u8]| views.iter().flat_map(of).copied().collect::<Vec<u8>>();
    let write = |kind: &str, bytes| std::fs::write(folder.join(format!("{name}.{kind}")), bytes);
    write("triangles.i32", all(|view| bytemuck::cast_slice(&view.triangles)))?;
    write("depth.f32", all(|view| bytemuck::cast_slice(&view.depth)))?;
    write("rgb.u8", all(|view| &view.rgb))
}

fn save_sheet(views: &[View], path: &Path) -> image::ImageResult<()> {
    let side = views[0].camera.width();
    let columns = 5;
    let mut sheet =
        image::RgbImage::new(side * columns, side * (views.len() as u32).div_ceil(columns));
    for (k, view) in (0u32..).zip(views) {
        for (pixel, rgb) in (0u32..).zip(view.rgb.chunks_exact(3)) {
            let (u, v) = (k % columns * side + pixel % side, k / columns * side + pixel / side);
            sheet.put_pixel(u, v, image::Rgb([rgb[0], rgb[1], rgb[2]]));
        }
    }
    sheet.save(path)
}
