//! The forward pass of SigLIP's vision tower: a vision transformer whose tokens are all patches.
//!
//! Dosovitskiy et al., "An Image Is Worth 16×16 Words", 2021, with normalisation before each part, as
//! `SiglipVisionTransformer` of transformers has it; the head that pools the tokens is left out.
//! Tokens lie by columns (width × tokens), so that a linear layer is one product. Everything runs on
//! the calling thread: pictures share the cores among them.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::config::VisionConfig;
use super::safetensors::SafeTensors;
use crate::Result;

/// A vision tower with its numbers.
#[derive(Debug)]
pub(super) struct VisionTower {
    config: VisionConfig,
    patches: Linear,
    /// Width × tokens.
    positions: Vec<f32>,
    layers: Vec<Layer>,
    last_norm: Norm,
}

/// x ← x + attention(norm(x)); x ← x + mlp(norm(x))
#[derive(Debug)]
struct Layer {
    before_attention: Norm,
    query: Linear,
    key: Linear,
    value: Linear,
    out: Linear,
    before_mlp: Norm,
    widen: Linear,
    narrow: Linear,
}

/// y = W x + b
#[derive(Debug)]
struct Linear {
    n_in: usize,
    n_out: usize,
    /// Out × in, row-major.
    weight: Vec<f32>,
    bias: Vec<f32>,
}

/// y = (x − mean)/√(variance + ε) · weight + bias, over the width of each token.
#[derive(Debug)]
struct Norm {
    weight: Vec<f32>,
    bias: Vec<f32>,
    epsilon: f32,
}

impl VisionTower {
    /// Reads the numbers of a tower of these sizes.
    pub fn read(config: VisionConfig, file: &mut SafeTensors) -> Result<Self> {
        let VisionConfig { hidden_size: width, patch_size: patch, .. } = config;
        let stem = "vision_model.embeddings";
        let kernel = [width, config.n_patch_values() / (patch * patch), patch, patch];
        let patches = Linear {
            n_in: config.n_patch_values(),
            n_out: width,
            weight: file.read(&format!("{stem}.patch_embedding.weight"), &kernel)?,
            bias: file.read(&format!("{stem}.patch_embedding.bias"), &[width])?,
        };
        let shape = [config.n_tokens(), width];
        let positions = file.read(&format!("{stem}.position_embedding.weight"), &shape)?;
        let layers = (0..config.num_hidden_layers)
            .map(|number| {
                let layer = format!("vision_model.encoder.layers.{number}");
                Layer::read(&config, file, &layer)
            })
            .collect::<Result<_>>()?;
        let last_norm = Norm::read(&config, file, "vision_model.post_layernorm")?;
        Ok(Self { config, patches, positions, layers, last_norm })
    }

    /// The sizes.
    pub fn config(&self) -> &VisionConfig {
        &self.config
    }

    /// Tokens (tokens × width, row-major) of a picture (3 × side × side).
    pub fn forward(&self, picture: &[f32]) -> Vec<f32> {
        let mut x = self.patches.apply(&self.gathered(picture));
        add(&mut x, &self.positions);
        for layer in &self.layers {
            layer.apply(&mut x, self.config.num_attention_heads);
        }
        self.last_norm.apply(&x)
    }

    /// The numbers of each patch one behind the other: channel, row, column, as the kernel has them.
    fn gathered(&self, picture: &[f32]) -> Vec<f32> {
        let VisionConfig { image_size: size, patch_size: patch, .. } = self.config;
        let side = self.config.side();
        let mut values = Vec::with_capacity(self.config.n_tokens() * self.config.n_patch_values());
        for token in 0..self.config.n_tokens() {
            let (top, left) = (token / side * patch, token % side * patch);
            for plane in picture.chunks_exact(size * size) {
                for line in plane.chunks_exact(size).skip(top).take(patch) {
                    values.extend(&line[left..][..patch]);
                }
            }
        }
        values
    }
}

impl Layer {
    fn read(config: &VisionConfig, file: &mut SafeTensors, name: &str) -> Result<Self> {
        let (width, inner) = (config.hidden_size, config.intermediate_size);
        Ok(Self {
            before_attention: Norm::read(config, file, &format!("{name}.layer_norm1"))?,
            query: Linear::read(file, &format!("{name}.self_attn.q_proj"), width, width)?,
            key: Linear::read(file, &format!("{name}.self_attn.k_proj"), width, width)?,
            value: Linear::read(file, &format!("{name}.self_attn.v_proj"), width, width)?,
            out: Linear::read(file, &format!("{name}.self_attn.out_proj"), width, width)?,
            before_mlp: Norm::read(config, file, &format!("{name}.layer_norm2"))?,
            widen: Linear::read(file, &format!("{name}.mlp.fc1"), width, inner)?,
            narrow: Linear::read(file, &format!("{name}.mlp.fc2"), inner, width)?,
        })
    }

    fn apply(&self, x: &mut [f32], n_heads: usize) {
        let normed = self.before_attention.apply(x);
        let attended = self.attention(&normed, n_heads);
        add(x, &self.out.apply(&attended));
        let mut wide = self.widen.apply(&self.before_mlp.apply(x));
        wide.iter_mut().for_each(|x| *x = gelu(*x));
        add(x, &self.narrow.apply(&wide));
    }

    /// softmax(Qᵀ K/√d) of each head, applied to its values (Vaswani et al., 2017, equation 1).
    fn attention(&self, x: &[f32], n_heads: usize) -> Vec<f32> {
        let width = self.query.n_out;
        let (n, head) = (x.len() / width, width / n_heads);
        let [query, key, value] =
            [&self.query, &self.key, &self.value].map(|linear| linear.apply(x));
        let [query, key, value] = [&query, &key, &value]
            .map(|values| MatRef::from_column_major_slice(values.as_slice(), width, n));
        let scale = (head as f32).sqrt().recip();
        let mut scores = vec![0.0; n * n];
        let mut attended = vec![0.0; width * n];
        for number in 0..n_heads {
            let [query, key, value] =
                [query, key, value].map(|values| values.subrows(number * head, head));
            // (keys × queries): what a query sees lies in a column
            let columns = MatMut::from_column_major_slice_mut(&mut scores, n, n);
            matmul(columns, Accum::Replace, key.transpose(), query, scale, Par::Seq);
            scores.chunks_exact_mut(n).for_each(softmax);
            let shares = MatRef::from_column_major_slice(&scores, n, n);
            let columns = MatMut::from_column_major_slice_mut(&mut attended, width, n);
            let rows = columns.subrows_mut(number * head, head);
            matmul(rows, Accum::Replace, value, shares, 1.0, Par::Seq);
        }
        attended
    }
}

impl Linear {
    fn read(file: &mut SafeTensors, name: &str, n_in: usize, n_out: usize) -> Result<Self> {
        Ok(Self {
            n_in,
            n_out,
            weight: file.read(&format!("{name}.weight"), &[n_out, n_in])?,
            bias: file.read(&format!("{name}.bias"), &[n_out])?,
        })
    }

    /// Of each column of `x` (in × n): out × n.
    fn apply(&self, x: &[f32]) -> Vec<f32> {
        let n = x.len() / self.n_in;
        let mut y = self.bias.repeat(n);
        let weight = MatRef::from_column_major_slice(&self.weight, self.n_in, self.n_out);
        let columns = MatMut::from_column_major_slice_mut(&mut y, self.n_out, n);
        let x = MatRef::from_column_major_slice(x, self.n_in, n);
        matmul(columns, Accum::Add, weight.transpose(), x, 1.0, Par::Seq);
        y
    }
}

impl Norm {
    fn read(config: &VisionConfig, file: &mut SafeTensors, name: &str) -> Result<Self> {
        let shape = [config.hidden_size];
        Ok(Self {
            weight: file.read(&format!("{name}.weight"), &shape)?,
            bias: file.read(&format!("{name}.bias"), &shape)?,
            epsilon: config.layer_norm_eps,
        })
    }

    fn apply(&self, x: &[f32]) -> Vec<f32> {
        let width = self.weight.len();
        let mut y = Vec::with_capacity(x.len());
        for token in x.chunks_exact(width) {
            let mean = token.iter().map(|&x| f64::from(x)).sum::<f64>() / width as f64;
            let square = |&x: &f32| (f64::from(x) - mean) * (f64::from(x) - mean);
            let variance = token.iter().map(square).sum::<f64>() / width as f64;
            let scale = (variance + f64::from(self.epsilon)).sqrt().recip() as f32;
            let numbers = self.weight.iter().zip(&self.bias);
            y.extend(
                token.iter().zip(numbers).map(|(x, (w, b))| (x - mean as f32) * scale * w + b),
            );
        }
        y
    }
}

fn add(sum: &mut [f32], x: &[f32]) {
    sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
}

/// exp(x − max)/Σ exp(x − max)
fn softmax(column: &mut [f32]) {
    let largest = column.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    column.iter_mut().for_each(|x| *x = (*x - largest).exp());
    let share = column.iter().sum::<f32>().recip();
    column.iter_mut().for_each(|x| *x *= share);
}

/// x/2 · (1 + tanh(√(2/π)(x + .044715 x³))) (Hendrycks & Gimpel, 2016)
fn gelu(x: f32) -> f32 {
    const SCALE: f32 = 0.797_884_6; // √(2/π)
    0.5 * x * (1.0 + (SCALE * (x + 0.044_715 * x * x * x)).tanh())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_layer_is_its_definition() {
        let linear = Linear {
            n_in: 2,
            n_out: 3,
            weight: vec![1., 2., 3., 4., 5., 6.],
            bias: vec![0., 1., 2.],
        };
        assert_eq!(linear.apply(&[1.0, -1.0, 0.5, 2.0]), [-1., 0., 1., 4.5, 10.5, 16.5]);
    }

    #[test]
    fn a_normed_token_has_mean_zero_and_variance_one() {
        let norm = Norm { weight: vec![1.0; 4], bias: vec![0.0; 4], epsilon: 1e-6 };
        let y = norm.apply(&[1001.0, 1002.0, 1004.0, 1009.0]);
        assert!(y.iter().sum::<f32>().abs() < 1e-5);
        assert!((y.iter().map(|y| y * y).sum::<f32>() - 4.0).abs() < 1e-4);
    }

    #[test]
    fn shares_sum_to_one_whatever_the_scores() {
        let mut column = [1000.0, 999.0, -1000.0];
        softmax(&mut column);
        assert!((column.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((column[0] / column[1] - 1f32.exp()).abs() < 1e-5);
    }

    #[test]
    fn gelu_is_that_of_torch() {
        // torch.nn.functional.gelu(x, approximate="tanh"), torch 2.15
        for (x, expected) in [(-2.0, -0.045402), (0.5, 0.345714), (3.0, 2.996363)] {
            assert!((gelu(x) - expected).abs() < 1e-6, "{x}: {}", gelu(x));
        }
    }
}
