//! Stacked multilayer perceptrons whose weights are views of one flat vector.
//!
//! Members that share a shape are computed together on a card, side by side on the processor's
//! threads; Adam, averaging, saving and loading see the flat vector only.

use std::ops::Range;

use tch::{Device, Kind, Tensor};

use crate::adam::Adam;
use crate::checkpoint::Archive;
use crate::error::LearnError;
use crate::kernel;
use crate::precision::Precision;
use crate::threads::{self, Reading, WORTH_A_THREAD};

mod stack;
mod tangent;

pub(crate) use stack::Layer;
use stack::{Stack, StackTape};

/// Form of a stack of perceptrons.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NetShape {
    /// Perceptrons of this shape, `E`.
    pub(crate) n_members: i64,
    /// Numbers in the input, each hidden layer, the output.
    pub(crate) sizes: Vec<i64>,
    /// Of the activation for negative numbers; 0 is ReLU.
    pub(crate) slope: f64,
    /// Whether hidden layers are normalised before the activation.
    pub(crate) layer_norm: bool,
    /// Of the hidden layers' products.
    pub(crate) precision: Precision,
}

impl NetShape {
    /// `input → hidden… → output`, ReLU, not normalised, multiplied as it is stored.
    pub(crate) fn new(n_members: i64, input: i64, hidden: &[i64], output: i64) -> Self {
        let sizes = [&[input], hidden, &[output]].concat();
        Self {
            n_members,
            sizes,
            slope: 0.0,
            layer_norm: false,
            precision: Precision::F32,
        }
    }

    /// Weights of all members.
    pub(crate) fn n_values(&self) -> i64 {
        let last = self.sizes.len() - 2;
        let layer = |(i, pair): (usize, &[i64])| {
            let n_vectors = if self.layer_norm && i < last { 3 } else { 1 };
            pair[0] * pair[1] + n_vectors * pair[1]
        };
        self.n_members * self.sizes.windows(2).enumerate().map(layer).sum::<i64>()
    }

    /// Bytes of the weights with their gradient and two moments.
    pub(crate) fn trained_bytes(&self) -> u64 {
        4 * 4 * self.n_values() as u64
    }

    /// Bytes of the layers' outputs for so many rows, kept for the way back, and the gradients
    /// on it.
    pub(crate) fn pass_bytes(&self, n_rows: usize) -> u64 {
        let numbers = self.n_members * self.sizes.iter().sum::<i64>();
        2 * 4 * numbers as u64 * n_rows as u64
    }
}

/// A stack of perceptrons (or, over another vector, the gradients of one).
#[derive(Debug)]
pub(crate) struct Net {
    stack: Stack,
    /// Each member alone, where they are worked on side by side.
    members: Vec<Stack>,
}

/// What a forward pass leaves for the way back: of all members together, or of each.
#[derive(Debug)]
pub(crate) struct Tape(Vec<StackTape>);

impl Net {
    /// Views of `flat` from `offset` on.
    pub(crate) fn over(shape: &NetShape, flat: &Tensor, offset: i64) -> Self {
        let stack = Stack::over(shape, flat, offset);
        let is_apart = shape.n_members > 1 && flat.device() == Device::Cpu;
        let n_apart = if is_apart { shape.n_members } else { 0 };
        let members = (0..n_apart).map(|member| stack.member(member)).collect();
        Self { stack, members }
    }

    /// From the input on.
    pub(crate) fn layers(&self) -> &[Layer] {
        &self.stack.layers
    }

    /// The same to be filled.
    pub(crate) fn layers_mut(&mut self) -> &mut [Layer] {
        &mut self.stack.layers
    }

    /// For negative numbers.
    pub(crate) fn slope(&self) -> f64 {
        self.stack.slope
    }

    /// Outputs `[E × B × out]` for inputs `[B × in]`, shared by the members, or `[E × B × in]`.
    pub(crate) fn forward(&self, input: &Tensor) -> Tensor {
        if !self.is_worth_threads(input) {
            return self.stack.forward(input);
        }
        let parts = self.parts(input);
        let outputs = threads::each(parts, |(member, input)| member.forward(&input));
        Tensor::cat(&outputs, 0)
    }

    /// The same, keeping what the way back needs.
    pub(crate) fn forward_taped(&self, input: &Tensor) -> (Tensor, Tape) {
        if !self.is_worth_threads(input) {
            let (output, tape) = self.stack.run_taped(input);
            return (output, Tape(vec![tape]));
        }
        let parts = self.parts(input);
        let done = threads::each(parts, |(member, input)| member.run_taped(&input));
        let (outputs, tapes): (Vec<_>, Vec<_>) = done.into_iter().unzip();
        (Tensor::cat(&outputs, 0), Tape(tapes))
    }

    /// The way back. Adds the weights' gradients to `into`, and returns the gradient of the
    /// input's `columns`, `[E × B × columns]`, where they are asked for.
    pub(crate) fn backward(
        &self,
        tape: &Tape,
        output_gradient: &Tensor,
        into: Option<&mut Net>,
        columns: Option<Range<i64>>,
    ) -> Option<Tensor> {
        if let [tape] = &tape.0[..] {
            let into = into.map(|net| &mut net.stack);
            return self.stack.backward(tape, output_gradient, into, columns);
        }
        let into: Vec<Option<&mut Stack>> = match into {
            Some(net) => net.members.iter_mut().map(Some).collect(),
            None => self.members.iter().map(|_| None).collect(),
        };
        let parts = self.members.iter().zip(&tape.0).zip(into).enumerate();
        let parts = parts.map(|(index, ((member, tape), into))| {
            let own = output_gradient.narrow(0, index as i64, 1);
            (Reading(member), Reading(tape), own, into)
        });
        let gradients = threads::each(parts.collect(), |(member, tape, own, into)| {
            member.backward(&tape, &own, into, columns.clone())
        });
        let gradients: Option<Vec<Tensor>> = gradients.into_iter().collect();
        Some(Tensor::cat(&gradients?, 0))
    }

    /// Whether members are worked on side by side.
    fn is_worth_threads(&self, input: &Tensor) -> bool {
        !self.members.is_empty() && self.is_worth_a_thread(input)
    }

    /// Whether a pass of one member takes long enough. A card has threads of its own.
    pub(crate) fn is_worth_a_thread(&self, input: &Tensor) -> bool {
        let n_rows = input.size()[input.dim() - 2];
        let products = self.stack.layers.iter().map(|layer| {
            let size = layer.weight.size();
            size[1] * size[2]
        });
        input.device() == Device::Cpu && n_rows * products.sum::<i64>() >= WORTH_A_THREAD
    }

    /// Each member with its input.
    fn parts(&self, input: &Tensor) -> Vec<(Reading<'_, Stack>, Tensor)> {
        let own = |member: usize| match input.dim() {
            2 => input.shallow_clone(),
            _ => input.narrow(0, member as i64, 1),
        };
        let members = self.members.iter().enumerate();
        members
            .map(|(i, member)| (Reading(member), own(i)))
            .collect()
    }
}

/// A flat vector that is trained: values, gradient, moments.
#[derive(Debug)]
pub(crate) struct Parameters {
    /// What nets are views of.
    pub(crate) values: Tensor,
    /// What gradient nets are views of.
    pub(crate) gradient: Tensor,
    adam: Adam,
}

impl Parameters {
    pub(crate) fn new(n_values: i64, learning_rate: f64, options: (Kind, Device)) -> Self {
        Self {
            values: Tensor::zeros([n_values], options),
            gradient: Tensor::zeros([n_values], options),
            adam: Adam::new(n_values, learning_rate, options),
        }
    }

    /// Forgets the gradient.
    pub(crate) fn zero_gradient(&mut self) {
        let _ = self.gradient.zero_();
    }

    /// One Adam step along the gradient.
    pub(crate) fn step(&mut self) {
        self.adam.step(&mut self.values, &self.gradient, 1.0);
    }

    /// The same with a share of the learning rate.
    pub(crate) fn step_at(&mut self, rate: f64) {
        self.adam
            .step_at(&mut self.values, &self.gradient, 1.0, rate);
    }

    /// One Adam step along the gradient, scaled down to a norm of at most `max_norm`; returns
    /// the norm before.
    pub(crate) fn step_clipped(&mut self, max_norm: f64) -> f64 {
        let norm = self.gradient.norm().double_value(&[]);
        let scale = (max_norm / (norm + 1e-6)).min(1.0);
        self.adam.step(&mut self.values, &self.gradient, scale);
        norm
    }

    /// Forgets the moments: for fresh weights.
    pub(crate) fn reset_moments(&mut self) {
        self.adam.reset();
    }

    /// Values, moments and count of steps, as sections `name`, `name.adam…`.
    pub(crate) fn save(&self, name: &str, archive: &mut Archive) {
        save_tensor(&self.values, name, archive);
        self.adam.save(name, archive);
    }

    /// What [`Parameters::save`] wrote.
    pub(crate) fn load(&mut self, name: &str, archive: &Archive) -> Result<(), LearnError> {
        load_tensor(&mut self.values, name, archive)?;
        self.adam.load(name, archive)
    }
}

/// A flat tensor as a section.
pub(crate) fn save_tensor(tensor: &Tensor, name: &str, archive: &mut Archive) {
    archive.put_f32(name, to_vec(tensor), &tensor.size());
}

/// A section into a flat tensor of the same shape, in place: views of it stay valid.
pub(crate) fn load_tensor(
    tensor: &mut Tensor,
    name: &str,
    archive: &Archive,
) -> Result<(), LearnError> {
    let values = archive.f32(name, &tensor.size())?;
    tensor.copy_(&Tensor::from_slice(values).view_as(tensor));
    Ok(())
}

/// A tensor's numbers, row-major, on any device.
pub(crate) fn to_vec(tensor: &Tensor) -> Vec<f32> {
    let tensor = tensor
        .to_device(Device::Cpu)
        .to_kind(Kind::Float)
        .contiguous();
    kernel::values::<f32>(&tensor).to_vec()
}

/// Tensors of one number each, read together, so that a card is waited for once.
pub(crate) fn read<const N: usize>(numbers: [Tensor; N]) -> [f64; N] {
    let numbers = numbers.map(|number| number.to_kind(Kind::Double));
    let together = Tensor::stack(&numbers, 0).to_device(Device::Cpu);
    let numbers = kernel::values::<f64>(&together);
    numbers.try_into().expect("each is one number")
}

/// Blocks of numbers, each as a `[rows × columns]` tensor, moved to the device together: on a
/// card each transfer costs as much as several layers.
pub(crate) fn matrices<const N: usize>(
    blocks: [(&[f32], i64); N],
    options: (Kind, Device),
) -> [Tensor; N] {
    let together = blocks.map(|(values, _)| values).concat();
    let together = matrix(&together, 1, options);
    let mut start = 0;
    blocks.map(|(values, columns)| {
        let len = values.len() as i64;
        let block = together.narrow(0, start, len).view([-1, columns]);
        start += len;
        block
    })
}

/// Numbers as a `[rows × columns]` tensor.
pub(crate) fn matrix(values: &[f32], columns: i64, options: (Kind, Device)) -> Tensor {
    let rows = values.len() as i64 / columns;
    let tensor = Tensor::from_slice(values).view([rows, columns]);
    tensor.to_kind(options.0).to_device(options.1)
}

#[cfg(test)]
mod tests {
    use domain::random::{Rng, Stream};

    use super::*;

    fn normals(size: &[i64], step: u64) -> Tensor {
        let mut values = vec![0.0; size.iter().product::<i64>() as usize];
        Rng::new(3, Stream::Test, step).fill_normal(&mut values);
        let values: Vec<f64> = values.into_iter().map(f64::from).collect();
        Tensor::from_slice(&values).view(size)
    }

    fn close(a: &Tensor, b: &Tensor) {
        assert_eq!(a.size(), b.size());
        assert!((a - b).abs().max().double_value(&[]) < 1e-10);
    }

    #[test]
    fn members_side_by_side_compute_what_they_do_together() {
        let shape = NetShape {
            layer_norm: true,
            ..NetShape::new(3, 40, &[200, 200], 2)
        };
        let flat = normals(&[shape.n_values()], 0);
        let net = Net::over(&shape, &flat, 0);
        for input in [normals(&[120, 40], 1), normals(&[3, 120, 40], 2)] {
            assert!(net.is_worth_threads(&input));
            let (output, tape) = net.forward_taped(&input);
            let (together, tape_together) = net.stack.run_taped(&input);
            close(&output, &together);
            close(&net.forward(&input), &together);

            let gradients = [flat.zeros_like(), flat.zeros_like()];
            let [mut own, mut own_together] = gradients
                .each_ref()
                .map(|gradient| Net::over(&shape, gradient, 0));
            let slope = normals(&[3, 120, 2], 3);
            let of_input = net.backward(&tape, &slope, Some(&mut own), Some(5..9));
            let into = Some(&mut own_together.stack);
            let of_input_together = net.stack.backward(&tape_together, &slope, into, Some(5..9));
            close(&of_input.unwrap(), &of_input_together.unwrap());
            close(&gradients[0], &gradients[1]);
            let without = net.backward(&tape, &slope, None, Some(0..40));
            assert_eq!(without.unwrap().size(), [3, 120, 40]);
        }
    }
}
