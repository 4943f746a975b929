//! The layers of a network as its file names them, and the sizes that they make.

use serde::{Deserialize, Serialize};

/// One step of a network; each takes what the step before made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "op", rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Layer {
    /// A convolution with a bias.
    Conv(ConvLayer),
    /// Keeps the tensor for the next `add`.
    Save {},
    /// Adds the tensor that was kept.
    Add {
        /// Whether negative numbers become zero afterwards.
        relu: bool,
    },
}

/// A convolution: square kernels, the same padding of zeros on all four sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvLayer {
    /// Channels that it reads.
    #[serde(rename = "in")]
    pub n_in: usize,
    /// Channels that it makes.
    #[serde(rename = "out")]
    pub n_out: usize,
    /// Side of the kernel.
    pub kernel: usize,
    /// Pixels from one output to the next.
    pub stride: usize,
    /// Zeros around the input.
    pub padding: usize,
    /// Pixels from one tap of the kernel to the next.
    pub dilation: usize,
    /// Groups of channels that do not see one another; as many as channels: depthwise.
    pub groups: usize,
    /// Whether negative numbers become zero afterwards.
    pub relu: bool,
}

/// Height, width and channels of a tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub height: usize,
    pub width: usize,
    pub channels: usize,
}

/// What a layer must be, and what it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Misfit {
    pub expected: String,
    pub found: String,
}

/// Numbers of one tensor, at most: pictures of 4096² would otherwise ask for the whole memory.
const MAX_NUMBERS: usize = 1 << 28;
/// Channels of a tensor, and the numbers that describe a kernel, at most.
const MAX_CHANNELS: usize = 1 << 14;
const MAX_KERNEL: usize = 64;

impl Size {
    /// Numbers of the tensor.
    pub fn len(self) -> usize {
        self.height * self.width * self.channels
    }
}

impl ConvLayer {
    /// Channels that one output channel reads.
    pub fn n_in_of_group(&self) -> usize {
        self.n_in / self.groups
    }

    /// Channels that one group makes.
    pub fn n_out_of_group(&self) -> usize {
        self.n_out / self.groups
    }

    /// Taps of the kernel times the channels of a group: the terms of one output.
    pub fn n_terms(&self) -> usize {
        self.kernel * self.kernel * self.n_in_of_group()
    }

    /// Numbers that the file holds for it: weights (out × in/groups × kernel × kernel), then biases.
    pub fn n_numbers(&self) -> usize {
        (self.n_terms() + 1) * self.n_out
    }

    /// Whether each channel sees itself alone.
    pub fn is_depthwise(&self) -> bool {
        self.groups == self.n_in && self.groups == self.n_out
    }

    /// Refuses what is no convolution; behind it no product of the fields overflows.
    pub(crate) fn check(&self) -> Result<(), Misfit> {
        for (name, value, most) in [
            ("in", self.n_in, MAX_CHANNELS),
            ("out", self.n_out, MAX_CHANNELS),
            ("kernel", self.kernel, MAX_KERNEL),
            ("stride", self.stride, MAX_KERNEL),
            ("dilation", self.dilation, MAX_KERNEL),
            ("groups", self.groups, MAX_CHANNELS),
        ] {
            if !(1..=most).contains(&value) {
                return Err(Misfit::new(format!("`{name}` from 1 to {most}"), value));
            }
        }
        if !(self.n_in.is_multiple_of(self.groups) && self.n_out.is_multiple_of(self.groups)) {
            let expected = "`groups` that divide `in` and `out`";
            return Err(Misfit::new(
                expected,
                format!("{} for {} and {}", self.groups, self.n_in, self.n_out),
            ));
        }
        let reach = self.dilation * (self.kernel - 1);
        // Behind more zeros than that there would be outputs that see no pixel.
        if self.padding > reach {
            return Err(Misfit::new(
                format!("`padding` of at most {reach}, the kernel's reach"),
                self.padding,
            ));
        }
        Ok(())
    }

    /// The size that it makes of an input:
    ///
    /// > out = ⌊(in + 2 padding − dilation (kernel − 1) − 1)/stride⌋ + 1
    pub(crate) fn output(&self, input: Size) -> Result<Size, Misfit> {
        if input.channels != self.n_in {
            return Err(Misfit::new(format!("{} channels", input.channels), self.n_in));
        }
        let reach = self.dilation * (self.kernel - 1) + 1;
        let side = |n: usize| Some((n + 2 * self.padding).checked_sub(reach)? / self.stride + 1);
        match (side(input.height), side(input.width)) {
            (Some(height), Some(width)) => Ok(Size { height, width, channels: self.n_out }),
            _ => Err(Misfit::new(
                format!("a picture that the kernel's reach of {reach} fits into"),
                format!("{} × {}", input.height, input.width),
            )),
        }
    }
}

impl Misfit {
    pub fn new(expected: impl Into<String>, found: impl ToString) -> Self {
        Self { expected: expected.into(), found: found.to_string() }
    }
}

/// The size that the layers make of an input, or the first layer that does not take what it gets.
pub(crate) fn output_size(layers: &[Layer], input: Size) -> Result<Size, (usize, Misfit)> {
    let (mut size, mut saved) = (input, None);
    for (number, layer) in layers.iter().enumerate() {
        match layer {
            Layer::Conv(conv) => size = conv.output(size).map_err(|misfit| (number, misfit))?,
            Layer::Save {} => saved = Some(size),
            Layer::Add { .. } => match saved.take() {
                Some(saved) if saved == size => {}
                Some(saved) => {
                    let expected = format!("a tensor of {saved}, as was saved");
                    return Err((number, Misfit::new(expected, size)));
                }
                None => return Err((number, Misfit::new("`save` before `add`", "none"))),
            },
        }
        let n = (size.height as u128) * (size.width as u128) * (size.channels as u128);
        if n > MAX_NUMBERS as u128 {
            let expected = format!("a tensor of at most {MAX_NUMBERS} numbers");
            return Err((number, Misfit::new(expected, size)));
        }
    }
    Ok(size)
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} × {} × {}", self.height, self.width, self.channels)
    }
}
