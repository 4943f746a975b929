//! Shows a mesh to an encoder and writes what it says of every patch, upright and at as many turns as the
//! encoder wants.
//!
//! ```sh
//! cargo run --example embed_mesh --features onnx,siglip -- mug.obj ENCODER.json mug.emb.mcap
//! ```

use std::path::Path;

use semfm_encoder::rendered_views::{Coloring, RenderedObject};
use semfm_encoder::{OpenSettings, open_encoder};
use semfm_geom::Task;
use semfm_geom::io::read_mesh;
use semfm_views::Renderer;
use semfm_views::mcap::Dtype;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, encoder, output] = &arguments[..] else {
        return Err("expected MESH ENCODER OUTPUT.emb.mcap".into());
    };
    let (file, task) = (read_mesh(mesh)?, Task::default());
    let encoder = open_encoder(encoder, &OpenSettings::default())?;
    let wanted = encoder.wants();
    let object =
        RenderedObject::new(&file, &wanted.settings(Coloring::Grey), &Renderer::cpu(), &task)?;
    let mut encoded = encoder.encode(std::slice::from_ref(&object), wanted.rolls, &task)?;
    let embeddings = encoded.pop().ok_or("no embeddings")?.into_file(&object);
    embeddings.write(Path::new(output), Dtype::F32)?;
    Ok(())
}
