//! A network: layers with their numbers, and the forward pass.

use crate::convolution::{Convolution, Tensor, add, relu};
use crate::layer::{ConvLayer, Layer, Misfit, Size, output_size};

/// A checked sequence of layers with their numbers.
#[derive(Clone, Debug)]
pub(crate) struct Network {
    layers: Vec<Layer>,
    /// One for each convolution, in the order of the layers.
    convolutions: Vec<Convolution>,
}

impl Network {
    /// From layers that fit one another and all their numbers, in the file's order.
    pub fn new(layers: Vec<Layer>, mut numbers: &[f32]) -> Self {
        let mut convolutions = Vec::new();
        for layer in convolutions_of(&layers) {
            let (own, rest) = numbers.split_at(layer.n_numbers());
            convolutions.push(Convolution::new(*layer, own));
            numbers = rest;
        }
        Self { layers, convolutions }
    }

    /// The size of what it makes of an input, or the first layer that does not take what it gets.
    pub fn output_size(&self, input: Size) -> Result<Size, (usize, Misfit)> {
        output_size(&self.layers, input)
    }

    /// The forward pass. The input's size is one that [`output_size`](Self::output_size) takes.
    pub fn forward(&self, input: Tensor) -> Tensor {
        let (mut tensor, mut saved) = (input, None);
        let mut convolutions = self.convolutions.iter();
        for layer in &self.layers {
            match layer {
                Layer::Conv(_) => {
                    let next = convolutions.next().expect("one for each convolution");
                    tensor = next.apply(&tensor);
                }
                Layer::Save {} => saved = Some(tensor.clone()),
                Layer::Add { relu: with_relu } => {
                    add(&mut tensor, &saved.take().expect("checked: saved before it is added"));
                    if *with_relu {
                        relu(&mut tensor.values);
                    }
                }
            }
        }
        tensor
    }
}

/// The convolutions among the layers.
pub(crate) fn convolutions_of(layers: &[Layer]) -> impl Iterator<Item = &ConvLayer> {
    layers.iter().filter_map(|layer| match layer {
        Layer::Conv(conv) => Some(conv),
        Layer::Save {} | Layer::Add { .. } => None,
    })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn numbers(n: usize, seed: u64) -> Vec<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    /// The definition, one output at a time in f64.
    fn convolved_by_hand(
        layer: &ConvLayer,
        numbers: &[f32],
        input: &Tensor,
        out: Size,
    ) -> Vec<f64> {
        let (n_in, k) = (layer.n_in_of_group(), layer.kernel);
        let bias = &numbers[layer.n_terms() * layer.n_out..];
        let mut values = Vec::new();
        for place in 0..out.height * out.width * out.channels {
            let (pixel, channel) = (place / out.channels, place % out.channels);
            let (row, column) = (pixel / out.width, pixel % out.width);
            let group = channel / layer.n_out_of_group();
            let mut sum = f64::from(bias[channel]);
            for term in 0..n_in * k * k {
                let (i, ky, kx) = (term / (k * k), term / k % k, term % k);
                let at = |n: usize, tap: usize| {
                    (n * layer.stride + tap * layer.dilation) as isize - layer.padding as isize
                };
                let (y, x) = (at(row, ky), at(column, kx));
                let Size { height, width, channels } = input.size;
                if (0..height as isize).contains(&y) && (0..width as isize).contains(&x) {
                    let pixel = y as usize * width + x as usize;
                    let value = input.values[pixel * channels + group * n_in + i];
                    sum += f64::from(numbers[channel * n_in * k * k + term]) * f64::from(value);
                }
            }
            values.push(if layer.relu { sum.max(0.0) } else { sum });
        }
        values
    }

    #[test]
    fn every_kind_of_convolution_is_its_definition() {
        let plain = ConvLayer {
            n_in: 6,
            n_out: 8,
            kernel: 3,
            stride: 1,
            padding: 1,
            dilation: 1,
            groups: 1,
            relu: false,
        };
        let cases = [
            plain,
            ConvLayer { stride: 2, relu: true, ..plain },
            ConvLayer { dilation: 2, padding: 2, ..plain },
            ConvLayer { dilation: 3, padding: 1, ..plain },
            ConvLayer { kernel: 1, padding: 0, ..plain },
            ConvLayer { kernel: 1, padding: 0, stride: 2, ..plain },
            ConvLayer { kernel: 4, stride: 4, padding: 0, ..plain },
            ConvLayer { kernel: 2, padding: 0, ..plain },
            ConvLayer { groups: 2, ..plain },
            ConvLayer { groups: 2, kernel: 1, padding: 0, ..plain },
            ConvLayer { n_out: 6, groups: 6, relu: true, ..plain },
            ConvLayer { n_out: 6, groups: 6, stride: 2, dilation: 2, padding: 2, ..plain },
            ConvLayer { n_out: 12, groups: 6, kernel: 5, padding: 2, ..plain },
            ConvLayer { n_in: 1, n_out: 1, ..plain },
        ];
        for (case, layer) in cases.into_iter().enumerate() {
            layer.check().unwrap();
            let size = Size { height: 12, width: 17, channels: layer.n_in };
            let input = Tensor { size, values: numbers(size.len(), 1) };
            let numbers = numbers(layer.n_numbers(), 2 + case as u64);
            let network = Network::new(vec![Layer::Conv(layer)], &numbers);
            let out = network.output_size(size).unwrap();
            let found = network.forward(input.clone());
            assert_eq!(found.size, out);
            let expected = convolved_by_hand(&layer, &numbers, &input, out);
            assert_eq!(found.values.len(), expected.len());
            for (a, b) in found.values.iter().zip(expected) {
                // Up to 96 terms of at most 1 in f32.
                assert!((f64::from(*a) - b).abs() < 2e-5, "case {case}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_block_of_gathered_terms_ends_nowhere_in_particular() {
        // 64 × 9 terms: the outputs of 40 × 30 pixels come in many blocks, the last one short.
        let layer = ConvLayer {
            n_in: 64,
            n_out: 3,
            kernel: 3,
            stride: 1,
            padding: 1,
            dilation: 1,
            groups: 1,
            relu: false,
        };
        let size = Size { height: 40, width: 30, channels: 64 };
        let input = Tensor { size, values: numbers(size.len(), 5) };
        let numbers = numbers(layer.n_numbers(), 6);
        let network = Network::new(vec![Layer::Conv(layer)], &numbers);
        let out = network.output_size(size).unwrap();
        let expected = convolved_by_hand(&layer, &numbers, &input, out);
        for (a, b) in network.forward(input).values.iter().zip(expected) {
            assert!((f64::from(*a) - b).abs() < 1e-4, "{a} {b}");
        }
    }

    #[test]
    fn a_saved_tensor_is_added_and_then_cut_at_zero() {
        let double = ConvLayer {
            n_in: 1,
            n_out: 1,
            kernel: 1,
            stride: 1,
            padding: 0,
            dilation: 1,
            groups: 1,
            relu: false,
        };
        let layers = vec![Layer::Save {}, Layer::Conv(double), Layer::Add { relu: true }];
        let network = Network::new(layers, &[-3.0, 1.0]);
        let size = Size { height: 1, width: 3, channels: 1 };
        let out = network.forward(Tensor { size, values: vec![1.0, 0.25, -2.0] });
        assert_eq!(out.values, [0.0, 0.5, 5.0]); // x − 3x + 1
    }

    #[test]
    fn layers_that_do_not_fit_are_named() {
        let conv = |n_in, n_out| {
            Layer::Conv(ConvLayer {
                n_in,
                n_out,
                kernel: 3,
                stride: 2,
                padding: 1,
                dilation: 1,
                groups: 1,
                relu: false,
            })
        };
        let size = Size { height: 8, width: 8, channels: 1 };
        for (layers, place, found) in [
            (vec![conv(1, 4), conv(5, 4)], 1, "5"),
            (vec![Layer::Save {}, conv(1, 1), Layer::Add { relu: false }], 2, "4 × 4 × 1"),
            (vec![Layer::Add { relu: false }], 0, "none"),
        ] {
            let (number, misfit) = output_size(&layers, size).unwrap_err();
            assert_eq!((number, misfit.found.as_str()), (place, found));
        }
        let tiny = Size { height: 8, width: 0, channels: 1 };
        assert!(output_size(&[conv(1, 1), conv(1, 1)], tiny).is_err());
    }
}
