//! A convolution on one picture.
//!
//! Tensors are pixel-major (height × width × channels), so that what a kernel reads of a pixel lies in
//! a row. A convolution gathers the terms of some outputs side by side (k²·in × outputs) and takes one
//! product with the weights (out × k²·in); a depthwise one needs no product. Everything runs on the
//! calling thread: pictures share the cores among them.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use crate::layer::{ConvLayer, Size};

/// Numbers gathered at once: they and the outputs stay in the second-level cache.
const GATHERED: usize = 1 << 16;

/// Numbers by pixel and channel (height × width × channels), row-major.
#[derive(Clone, Debug)]
pub(crate) struct Tensor {
    pub size: Size,
    pub values: Vec<f32>,
}

/// A convolution with its numbers, laid out for the product.
#[derive(Clone, Debug)]
pub(crate) struct Convolution {
    pub layer: ConvLayer,
    /// By group, tap, input channel and output channel: each group is a matrix (out × terms) by
    /// columns. Of a depthwise one by tap and channel.
    weights: Vec<f32>,
    /// One for each output channel.
    bias: Vec<f32>,
}

impl Convolution {
    /// From the numbers in the file's order: weights (out × in/groups × kernel × kernel), biases.
    pub fn new(layer: ConvLayer, numbers: &[f32]) -> Self {
        let (n_in, n_out) = (layer.n_in_of_group(), layer.n_out_of_group());
        let n_taps = layer.kernel * layer.kernel;
        let (file, bias) = numbers.split_at(layer.n_terms() * layer.n_out);
        let mut weights = Vec::with_capacity(file.len());
        if layer.is_depthwise() {
            for tap in 0..n_taps {
                weights.extend(file.iter().skip(tap).step_by(n_taps));
            }
            return Self { layer, weights, bias: bias.to_vec() };
        }
        for group in 0..layer.groups {
            for tap in 0..n_taps {
                for channel in 0..n_in {
                    let of_output = |out: usize| file[(out * n_in + channel) * n_taps + tap];
                    weights.extend((group * n_out..(group + 1) * n_out).map(of_output));
                }
            }
        }
        Self { layer, weights, bias: bias.to_vec() }
    }

    /// The convolution of `input`, which must have the channels that it reads and be large enough.
    pub fn apply(&self, input: &Tensor) -> Tensor {
        let size = self.layer.output(input.size).expect("sizes are checked before");
        let mut output = Tensor { size, values: self.bias.repeat(size.height * size.width) };
        if self.layer.is_depthwise() {
            pulp::Arch::new().dispatch(Depthwise { layer: self, input, output: &mut output });
        } else if self.layer.kernel == 1 && self.layer.stride == 1 && self.layer.groups == 1 {
            self.multiply(0, &input.values, &mut output.values);
        } else {
            self.apply_gathered(input, &mut output);
        }
        if self.layer.relu {
            relu(&mut output.values);
        }
        output
    }

    /// Gathers the terms of a block of outputs, multiplies, and goes on with the next block.
    fn apply_gathered(&self, input: &Tensor, output: &mut Tensor) {
        let n_terms = self.layer.n_terms();
        let per_block = (GATHERED / n_terms).max(1);
        let width = output.size.width;
        let mut gathered = vec![0.0; per_block * n_terms];
        let blocks = output.values.chunks_mut(per_block * self.layer.n_out);
        for (block, outputs) in blocks.enumerate() {
            let n = outputs.len() / self.layer.n_out;
            for group in 0..self.layer.groups {
                for (i, terms) in gathered.chunks_exact_mut(n_terms).take(n).enumerate() {
                    let pixel = block * per_block + i;
                    self.gather(input, group, [pixel / width, pixel % width], terms);
                }
                self.multiply(group, &gathered[..n * n_terms], outputs);
            }
        }
    }

    /// The terms of one output pixel (row, column) of a group: by tap and channel, zeros outside.
    fn gather(&self, input: &Tensor, group: usize, [row, column]: [usize; 2], terms: &mut [f32]) {
        let ConvLayer { kernel, stride, padding, dilation, .. } = self.layer;
        let (n, size) = (self.layer.n_in_of_group(), input.size);
        let (top, left) = (row * stride, column * stride);
        let inside = left >= padding && left - padding + dilation * (kernel - 1) < size.width;
        for (tap_row, terms) in terms.chunks_exact_mut(kernel * n).enumerate() {
            let y = (top + tap_row * dilation).wrapping_sub(padding);
            if y >= size.height {
                terms.fill(0.0);
                continue;
            }
            let line = &input.values[y * size.width * size.channels..];
            if inside && dilation == 1 && self.layer.groups == 1 {
                terms.copy_from_slice(&line[(left - padding) * n..][..kernel * n]);
                continue;
            }
            for (tap, terms) in terms.chunks_exact_mut(n).enumerate() {
                let x = (left + tap * dilation).wrapping_sub(padding);
                if x < size.width {
                    terms.copy_from_slice(&line[x * size.channels + group * n..][..n]);
                } else {
                    terms.fill(0.0);
                }
            }
        }
    }

    /// Adds the product of a group's weights (out × terms) with `terms` (terms × outputs) to its
    /// channels of `outputs` (all channels × outputs), all by columns.
    fn multiply(&self, group: usize, terms: &[f32], outputs: &mut [f32]) {
        let (n_terms, n_out) = (self.layer.n_terms(), self.layer.n_out_of_group());
        let n = outputs.len() / self.layer.n_out;
        let weights = &self.weights[group * n_terms * n_out..][..n_terms * n_out];
        let weights = MatRef::from_column_major_slice(weights, n_out, n_terms);
        let terms = MatRef::from_column_major_slice(terms, n_terms, n);
        let outputs = MatMut::from_column_major_slice_mut(outputs, self.layer.n_out, n);
        let outputs = outputs.subrows_mut(group * n_out, n_out);
        matmul(outputs, Accum::Add, weights, terms, 1.0, Par::Seq);
    }
}

/// Each channel with its own kernel, on the widest registers that the processor has.
struct Depthwise<'a> {
    layer: &'a Convolution,
    input: &'a Tensor,
    output: &'a mut Tensor,
}

impl pulp::WithSimd for Depthwise<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Convolution { layer, weights, .. } = self.layer;
        let (size, n, width) = (self.input.size, layer.n_in, self.output.size.width);
        for (pixel, output) in self.output.values.chunks_exact_mut(n).enumerate() {
            let (row, column) = (pixel / width, pixel % width);
            for (tap, weights) in weights.chunks_exact(n).enumerate() {
                let place = |at: usize, tap: usize| {
                    (at * layer.stride + tap * layer.dilation).wrapping_sub(layer.padding)
                };
                let (y, x) = (place(row, tap / layer.kernel), place(column, tap % layer.kernel));
                if y < size.height && x < size.width {
                    let input = &self.input.values[(y * size.width + x) * n..][..n];
                    output.iter_mut().zip(input).zip(weights).for_each(|((o, i), w)| *o += i * w);
                }
            }
        }
    }
}

/// The sum of two tensors of one size.
pub(crate) fn add(tensor: &mut Tensor, other: &Tensor) {
    tensor.values.iter_mut().zip(&other.values).for_each(|(a, b)| *a += b);
}

/// Negative numbers become zero.
pub(crate) fn relu(values: &mut [f32]) {
    values.iter_mut().for_each(|x| *x = x.max(0.0));
}
