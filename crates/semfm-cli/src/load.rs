//! Files from the command line, checked against each other.

use std::path::Path;

use anyhow::{Result, bail};
use semfm::Mesh;
use semfm::geom::io::{Appearance, MeshFile, read_mesh};
use semfm::views::SurfaceColor;
use semfm::views::mcap::EmbeddingsFile;

/// A mesh with its colours; `texture` is put on it where one is given.
pub fn mesh(path: &Path, texture: Option<&Path>) -> Result<MeshFile> {
    let mut file = read_mesh(path)?;
    if let Some(texture) = texture {
        file.appearance.attach_image(texture)?;
    }
    Ok(file)
}

/// Embeddings of this very mesh.
pub fn embeddings(path: &Path, mesh: &Mesh) -> Result<EmbeddingsFile> {
    let file = EmbeddingsFile::read(path)?;
    file.check_mesh(mesh)?;
    Ok(file)
}

/// A NumPy array (n × d) of 32- or 64-bit floats, one row per vertex; row-major values.
pub fn features(path: &Path, mesh: &Mesh) -> Result<Vec<f32>> {
    let place = path.display();
    let bytes = std::fs::read(path).map_err(|error| anyhow::anyhow!("{place}: {error}"))?;
    let array = npyz::NpyFile::new(&bytes[..]).map_err(|error| {
        anyhow::anyhow!("{place}: header: expected a NumPy array, found {error}")
    })?;
    let shape = array.shape().to_vec();
    let n = mesh.n_vertices() as u64;
    let found = shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if shape.len() != 2 || shape[0] != n || shape[1] == 0 {
        bail!("{place}: shape: expected ({n}, d), one row per vertex, found ({found})");
    }
    let held = bytes.len() as u64;
    if shape[1].checked_mul(n).is_none_or(|count| count > held) {
        bail!(
            "{place}: shape: expected no more values than the file's {held} bytes, found ({found})"
        );
    }
    let (d, by_columns) = (shape[1] as usize, array.order() == npyz::Order::Fortran);
    let kind = array.dtype().descr();
    let values: Vec<f32> = if let Ok(reader) = array.data::<f32>() {
        reader.collect::<std::io::Result<_>>()
    } else if let Ok(reader) = npyz::NpyFile::new(&bytes[..]).and_then(|array| {
        array.data::<f64>().map_err(|error| std::io::Error::other(error.to_string()))
    }) {
        reader.map(|value| value.map(|x| x as f32)).collect()
    } else {
        bail!("{place}: dtype: expected float32 or float64, found {kind}");
    }
    .map_err(|error| anyhow::anyhow!("{place}: data: expected {n} × {d} values, found {error}"))?;
    if let Some(at) = values.iter().position(|x| !x.is_finite()) {
        let (row, column) =
            if by_columns { (at % n as usize, at / n as usize) } else { (at / d, at % d) };
        bail!(
            "{place}: row {row}, column {column}: expected a finite number, found {}",
            values[at]
        );
    }
    if !by_columns {
        return Ok(values);
    }
    let n = n as usize;
    Ok((0..n * d).map(|i| values[(i % d) * n + i / d]).collect())
}

/// Calls `work` with the paint of an object: its own colours, or grey.
pub fn with_paint<T>(
    mesh: &Mesh,
    appearance: Option<&Appearance>,
    work: impl FnOnce(&SurfaceColor<'_>) -> T,
) -> T {
    match appearance {
        None => work(&SurfaceColor::default()),
        Some(appearance) => {
            let color = |face: usize, weights: [f64; 3]| {
                let [r, g, b, _] = appearance.color_at(face, mesh.faces()[face], weights);
                [r, g, b].map(|c| f32::from(c) / 255.0)
            };
            work(&SurfaceColor::Surface(&color))
        }
    }
}
