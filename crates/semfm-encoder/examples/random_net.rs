//! Writes a network of random weights: what any trained encoder must beat.
//!
//! `cargo run -p semfm-encoder --example random_net -- random.net [SEED]`

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_encoder::{Background, Channel, ConvLayer, Layer, NetHeader, write_net};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("usage: random_net FILE.net [SEED]")?;
    let seed: u64 = arguments.next().map_or(Ok(0), |seed| seed.parse())?;
    let layers = layers();
    let header = NetHeader {
        name: "random".into(),
        version: seed.to_string(),
        size: 224,
        patch: 16,
        channels: vec![Channel::Grey],
        mean: vec![0.5],
        std: vec![0.5],
        background: Background::White,
        provenance: [("seed".to_owned(), seed.into()), ("trained".to_owned(), false.into())]
            .into_iter()
            .collect(),
        layers: layers.clone(),
    };
    std::fs::write(path, write_net(&header, &numbers(&layers, seed))?)?;
    Ok(())
}

/// Four stages: 56, 28 and 14 pixels a side, then tokens of 64 numbers.
fn layers() -> Vec<Layer> {
    let mut layers = vec![conv(1, 32, 4, 4, 0), conv(32, 64, 3, 2, 1)];
    layers.extend(residual(64, 1));
    layers.push(conv(64, 104, 3, 2, 1));
    for dilation in [1, 2, 1, 2] {
        layers.extend(residual(104, dilation));
    }
    layers.push(Layer::Conv(ConvLayer { relu: false, ..conv_layer(104, 64, 1, 1, 0) }));
    layers
}

fn conv_layer(
    n_in: usize,
    n_out: usize,
    kernel: usize,
    stride: usize,
    padding: usize,
) -> ConvLayer {
    ConvLayer { n_in, n_out, kernel, stride, padding, dilation: 1, groups: 1, relu: true }
}

fn conv(n_in: usize, n_out: usize, kernel: usize, stride: usize, padding: usize) -> Layer {
    Layer::Conv(conv_layer(n_in, n_out, kernel, stride, padding))
}

fn residual(n: usize, dilation: usize) -> [Layer; 4] {
    let first = ConvLayer { dilation, ..conv_layer(n, n, 3, 1, dilation) };
    let second = ConvLayer { relu: false, ..first };
    [Layer::Save {}, Layer::Conv(first), Layer::Conv(second), Layer::Add { relu: true }]
}

/// Uniform weights that keep the size of activations (He et al. 2015), small biases.
fn numbers(layers: &[Layer], seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut numbers = Vec::new();
    for layer in layers {
        if let Layer::Conv(conv) = layer {
            let n_terms = conv.n_terms();
            let bound = (6.0 / n_terms as f32).sqrt();
            numbers.extend((0..n_terms * conv.n_out).map(|_| rng.random_range(-bound..bound)));
            numbers.extend((0..conv.n_out).map(|_| rng.random_range(-0.05..0.05f32)));
        }
    }
    numbers
}
