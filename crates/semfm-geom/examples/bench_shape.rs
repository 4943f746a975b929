//! How the preparation of a shape grows with the mesh.
//!
//! ```text
//! cargo run --release -p semfm-geom --example bench_shape -- [MESH] [MOST_TRIANGLES]
//! ```
//!
//! The mesh (a knotted, bumpy tube where none is given) is subdivided until it has that many triangles; a little
//! noise along the normals keeps the new ones from being flat. For each size: process CPU seconds on one thread of
//! cleaning, simplification to 10 000 vertices and the whole shape, with the exponent of the growth since the size before.
#![allow(clippy::print_stdout, reason = "the numbers are what this program is for")]

use std::collections::HashMap;
use std::error::Error;
use std::f64::consts::TAU;
use std::path::Path;

use cpu_time::ProcessTime;
use semfm_geom::io::read_mesh;
use semfm_geom::math::DVec3;
use semfm_geom::{
    CleanSettings, Mesh, Shape, ShapeSettings, SimplifySettings, Task, clean, simplify,
};

/// Noise on new vertices, as a share of the edge that they halve.
const NOISE: f64 = 0.02;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut mesh = match arguments.first() {
        Some(path) => read_mesh(Path::new(path))?.mesh,
        None => knot(300, 26)?,
    };
    let most = arguments.get(1).map_or(Ok(1_000_000), |text| text.parse())?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    println!(
        "{:>10} {:>9} {:>6} {:>9} {:>6} {:>9} {:>6} {:>8} attempts",
        "triangles", "clean s", "exp.", "simple s", "exp.", "shape s", "exp.", "distance"
    );
    let mut before: Option<(f64, [f64; 3])> = None;
    loop {
        let measured = pool.install(|| measure(&mesh))?;
        let n = mesh.n_faces() as f64;
        let exponents = [0, 1, 2].map(|i| match before {
            Some((n_before, seconds)) => {
                (measured.seconds[i] / seconds[i]).ln() / (n / n_before).ln()
            }
            None => f64::NAN,
        });
        print!("{:10}", mesh.n_faces());
        for (seconds, exponent) in measured.seconds.iter().zip(exponents) {
            print!(" {seconds:9.3} {exponent:6.2}");
        }
        println!(" {:8.4} {}", measured.distance, measured.attempts);
        if 4 * mesh.n_faces() > most {
            return Ok(());
        }
        before = Some((n, measured.seconds));
        mesh = subdivided(&mesh)?;
    }
}

struct Measured {
    /// Cleaning, simplification, the whole shape.
    seconds: [f64; 3],
    distance: f64,
    attempts: usize,
}

fn measure(mesh: &Mesh) -> semfm_geom::Result<Measured> {
    let task = Task::default();
    let start = ProcessTime::now();
    let cleaned = clean(mesh, &CleanSettings::default())?.mesh;
    let cleaning = start.elapsed().as_secs_f64();
    let start = ProcessTime::now();
    let simple = simplify(&cleaned, &SimplifySettings::default(), &task)?;
    let simplification = start.elapsed().as_secs_f64();
    let start = ProcessTime::now();
    Shape::new(mesh.clone(), &ShapeSettings::default(), &task)?;
    let seconds = [cleaning, simplification, start.elapsed().as_secs_f64()];
    let (distance, attempts) =
        simple.map_or((0.0, 0), |simple| (simple.report.distance, simple.report.attempts));
    Ok(Measured { seconds, distance, attempts })
}

/// Each triangle in four, new vertices off the old edges by a little noise.
fn subdivided(mesh: &Mesh) -> semfm_geom::Result<Mesh> {
    let mut points = mesh.vertices().to_vec();
    let mut middles = HashMap::new();
    let mut faces = Vec::with_capacity(4 * mesh.n_faces());
    for (face, &[a, b, c]) in mesh.faces().iter().enumerate() {
        let normal = mesh.face_normal_scaled(face).normalize_or_zero();
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(i, j)| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                let id = points.len() as u32;
                let (p, q) = (points[i as usize], points[j as usize]);
                let noise = NOISE
                    * p.distance(q)
                    * (f64::from(id.wrapping_mul(2_654_435_761)) / 2f64.powi(32) - 0.5);
                points.push(p.midpoint(q) + noise * normal);
                id
            })
        });
        faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    Mesh::new(points, faces)
}

/// A bumpy tube along a trefoil knot.
fn knot(around: u32, along: u32) -> semfm_geom::Result<Mesh> {
    let centre = |t: f64| {
        let r = 2.0 + (3.0 * t).cos();
        DVec3::new(r * (2.0 * t).cos(), r * (2.0 * t).sin(), (3.0 * t).sin())
    };
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for i in 0..around {
        let t = TAU * f64::from(i) / f64::from(around);
        let (p, tangent) = (centre(t), (centre(t + 1e-4) - centre(t - 1e-4)).normalize());
        let u = tangent.cross(DVec3::Z).normalize();
        let v = tangent.cross(u);
        for j in 0..along {
            let a = TAU * f64::from(j) / f64::from(along);
            let radius = 0.35 * (1.0 + 0.15 * (7.0 * t).sin() + 0.1 * (3.0 * a + 5.0 * t).cos());
            points.push(p + radius * (a.cos() * u + a.sin() * v));
            let at = |i: u32, j: u32| (i % around) * along + j % along;
            faces.extend([
                [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
            ]);
        }
    }
    Mesh::new(points, faces)
}
