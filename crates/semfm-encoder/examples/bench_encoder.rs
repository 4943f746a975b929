//! Milliseconds of the built-in encoder (or of a `.net` file) for a picture, on one thread.
//!
//! `cargo run --release -p semfm-encoder --example bench_encoder -- [FILE.net]`
#![allow(clippy::print_stdout, reason = "the numbers are what this program is for")]

use std::sync::Arc;
use std::time::Instant;

use semfm_encoder::rendered_views::RenderedObject;
use semfm_encoder::{Encoder, OpenSettings, open_encoder};
use semfm_geom::{Task, zoo};
use semfm_views::Renderer;

const ROUNDS: usize = 5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "builtin".into());
    let start = Instant::now();
    let encoder: Arc<dyn Encoder> = open_encoder(&name, &OpenSettings::default())?;
    println!("opened {} in {:.1} ms", encoder.identity(), milliseconds(start));

    let (mesh, task) = (zoo::torus(60, 30), Task::default());
    let object = RenderedObject::new(&mesh, &encoder.wants().views, &Renderer::cpu(), &task)?;
    let n_views = object.views.len() as f64;
    let objects = [object];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut rounds = Vec::new();
    for _ in 0..ROUNDS {
        let start = Instant::now();
        pool.install(|| encoder.encode(&objects, 1, &task))?;
        rounds.push(milliseconds(start) / n_views);
    }
    rounds.sort_by(f64::total_cmp);
    println!("{:.2} ms a picture (median of {ROUNDS}, least {:.2})", rounds[ROUNDS / 2], rounds[0]);
    Ok(())
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
