//! The passes of members that are multiplied together.
//!
//! The way back is written out, because autograd's bookkeeping and its temporaries cost as much
//! as a third of an update at these sizes.

use std::ops::Range;

use tch::Tensor;

use super::NetShape;
use crate::kernel::{self, NormGradient, Normed};
use crate::precision::{Precision, add_outer, product};
use crate::threads::Readable;

/// One layer of all members, views.
#[derive(Debug)]
pub(crate) struct Layer {
    /// `[E × in × out]`.
    pub(crate) weight: Tensor,
    /// `[E × 1 × out]`.
    pub(crate) bias: Tensor,
    pub(super) norm: Option<Norm>,
}

/// What a normalised layer is scaled and moved by, `[E × 1 × out]` each.
#[derive(Debug)]
pub(super) struct Norm {
    pub(super) gain: Tensor,
    pub(super) shift: Tensor,
}

impl Layer {
    /// Normalisation that changes nothing yet.
    pub(crate) fn init_norm(&mut self) {
        if let Some(norm) = &mut self.norm {
            let _ = norm.gain.fill_(1.0);
            let _ = norm.shift.zero_();
        }
    }
}

/// Members that are multiplied together.
#[derive(Debug)]
pub(super) struct Stack {
    pub(super) layers: Vec<Layer>,
    pub(super) slope: f64,
    precision: Precision,
}

impl Readable for Stack {}

/// What a forward pass leaves for the way back.
#[derive(Debug)]
pub(super) struct StackTape {
    input: Tensor,
    hidden: Vec<Hidden>,
}

impl Readable for StackTape {}

#[derive(Debug)]
struct Hidden {
    output: Tensor,
    /// Normalised rows and 1/σ.
    normed: Option<(Tensor, Tensor)>,
}

impl Stack {
    /// Views of `flat` from `offset` on.
    pub(super) fn over(shape: &NetShape, flat: &Tensor, offset: i64) -> Self {
        let mut offset = offset;
        let mut view = |size: [i64; 3]| {
            let len = size.iter().product();
            let view = flat.narrow(0, offset, len).view(size);
            offset += len;
            view
        };
        let (e, last) = (shape.n_members, shape.sizes.len() - 2);
        let layer = |(i, pair): (usize, &[i64])| Layer {
            weight: view([e, pair[0], pair[1]]),
            bias: view([e, 1, pair[1]]),
            norm: (shape.layer_norm && i < last).then(|| Norm {
                gain: view([e, 1, pair[1]]),
                shift: view([e, 1, pair[1]]),
            }),
        };
        let layers = shape.sizes.windows(2).enumerate().map(layer).collect();
        Self {
            layers,
            slope: shape.slope,
            precision: shape.precision,
        }
    }

    /// One member, views of the same numbers.
    pub(super) fn member(&self, member: i64) -> Self {
        let own = |tensor: &Tensor| tensor.narrow(0, member, 1);
        let layer = |layer: &Layer| Layer {
            weight: own(&layer.weight),
            bias: own(&layer.bias),
            norm: layer.norm.as_ref().map(|norm| Norm {
                gain: own(&norm.gain),
                shift: own(&norm.shift),
            }),
        };
        Self {
            layers: self.layers.iter().map(layer).collect(),
            ..*self
        }
    }

    /// Outputs `[E × B × out]` for inputs `[B × in]`, shared by the members, or `[E × B × in]`.
    pub(super) fn forward(&self, input: &Tensor) -> Tensor {
        self.run(input, |_| ()).0
    }

    /// The same, with what the way back needs.
    pub(super) fn run_taped(&self, input: &Tensor) -> (Tensor, StackTape) {
        let mut hidden = Vec::with_capacity(self.layers.len() - 1);
        let (output, input) = self.run(input, |h| hidden.push(h));
        (output, StackTape { input, hidden })
    }

    fn run(&self, input: &Tensor, mut keep: impl FnMut(Hidden)) -> (Tensor, Tensor) {
        let input = self.expanded(input);
        let mut x = input.shallow_clone();
        let (last, hidden) = self.layers.split_last().expect("a net has layers");
        for layer in hidden {
            let mut z = product(&x, &layer.weight);
            let normed = match &layer.norm {
                None => {
                    kernel::bias_activate(&mut z, &layer.bias, self.slope);
                    x = z;
                    None
                }
                Some(norm) => {
                    let (output, inverse) = kernel::norm_activate(
                        &mut z,
                        &layer.bias,
                        (&norm.gain, &norm.shift),
                        self.slope,
                    );
                    x = output;
                    Some((z, inverse))
                }
            };
            keep(Hidden {
                output: x.shallow_clone(),
                normed,
            });
        }
        let mut z = product(&x.to_kind(last.weight.kind()), &last.weight);
        kernel::bias_activate(&mut z, &last.bias, 1.0);
        (z, input)
    }

    /// One matrix for each member, as the first layer multiplies it.
    pub(super) fn expanded(&self, input: &Tensor) -> Tensor {
        let input = self.precision.operand(input);
        match input.size()[..] {
            [rows, columns] => input
                .unsqueeze(0)
                .expand([self.layers[0].weight.size()[0], rows, columns], false),
            _ => input,
        }
    }

    /// The way back, as [`super::Net::backward`].
    pub(super) fn backward(
        &self,
        tape: &StackTape,
        output_gradient: &Tensor,
        mut into: Option<&mut Stack>,
        columns: Option<Range<i64>>,
    ) -> Option<Tensor> {
        let mut gradient = self.precision.operand(output_gradient);
        for (index, layer) in self.layers.iter().enumerate().rev() {
            let mut into = into.as_deref_mut().map(|stack| &mut stack.layers[index]);
            if let Some(hidden) = tape.hidden.get(index) {
                self.activation_backward(&mut gradient, hidden, layer, into.as_deref_mut());
            } else if let Some(into) = &mut into {
                let rows = [1_i64];
                let own = output_gradient.sum_dim_intlist(rows.as_slice(), true, None);
                let _ = into.bias.g_add_(&own);
            }
            if let Some(into) = into {
                let x = index
                    .checked_sub(1)
                    .map_or(&tape.input, |before| &tape.hidden[before].output);
                add_outer(&mut into.weight, x, &gradient);
            }
            if index > 0 {
                gradient = product(&gradient, &layer.weight.transpose(1, 2));
            }
        }
        let columns = columns?;
        let weight = self.layers[0]
            .weight
            .narrow(1, columns.start, columns.end - columns.start);
        Some(product(&gradient, &weight.transpose(1, 2)).to_kind(weight.kind()))
    }

    fn activation_backward(
        &self,
        gradient: &mut Tensor,
        hidden: &Hidden,
        layer: &Layer,
        into: Option<&mut Layer>,
    ) {
        let (Some(norm), Some((normalised, inverse))) = (&layer.norm, &hidden.normed) else {
            let bias = into.map(|into| &mut into.bias);
            kernel::bias_activate_backward(gradient, &hidden.output, self.slope, bias);
            return;
        };
        let forward = Normed {
            output: &hidden.output,
            normalised,
            inverse,
            gain: &norm.gain,
        };
        let into = into.and_then(|into| {
            let norm = into.norm.as_mut()?;
            Some(NormGradient {
                bias: &mut into.bias,
                gain: &mut norm.gain,
                shift: &mut norm.shift,
            })
        });
        kernel::norm_activate_backward(gradient, &forward, self.slope, into);
    }
}
