//! The way forward of a derivative: what outputs do when all weights move at once.

use tch::Tensor;

use super::Net;
use crate::kernel::NORM_EPSILON;

impl Net {
    /// d/dε of the outputs `[E × B × out]` when the weights move by ε · `direction`, a net of
    /// the same shape over another vector. The inner product of this with any output gradient is
    /// that of the weights' gradient with the direction.
    pub(crate) fn tangent(&self, input: &Tensor, direction: &Net) -> Tensor {
        // In the weights' own numbers, whatever those of other products are.
        let kind = self.layers()[0].weight.kind();
        let mut x = self.stack.expanded(input).to_kind(kind);
        let mut dx: Option<Tensor> = None;
        let last = self.layers().len() - 1;
        for (index, (layer, along)) in self.layers().iter().zip(direction.layers()).enumerate() {
            let mut dz = x.bmm(&along.weight) + &along.bias;
            if let Some(dx) = &dx {
                let _ = dz.g_add_(&dx.bmm(&layer.weight));
            }
            if index == last {
                return dz;
            }
            let mut z = x.bmm(&layer.weight) + &layer.bias;
            if let (Some(norm), Some(along)) = (&layer.norm, &along.norm) {
                let centred = &z - mean(&z);
                let inverse = (mean(&centred.square()) + NORM_EPSILON).rsqrt();
                let rows = centred * &inverse;
                let drows = (&dz - mean(&dz) - &rows * mean(&(&rows * &dz))) * inverse;
                dz = drows * &norm.gain + &rows * &along.gain + &along.shift;
                z = rows * &norm.gain + &norm.shift;
            }
            let is_positive = z.gt(0.0).to_kind(z.kind());
            let slope = is_positive * (1.0 - self.slope()) + self.slope();
            x = z * &slope;
            dx = Some(dz * slope);
        }
        unreachable!("a net has layers")
    }
}

/// Of each row.
fn mean(tensor: &Tensor) -> Tensor {
    tensor.mean_dim([-1_i64].as_slice(), true, None)
}

#[cfg(test)]
mod tests {
    use domain::random::{Rng, Stream};
    use tch::{Device, Kind};

    use super::*;
    use crate::net::NetShape;

    fn normals(n: i64, step: u64) -> Tensor {
        let mut rng = Rng::new(6, Stream::Test, step);
        let values: Vec<f64> = (0..n).map(|_| rng.normal()).collect();
        Tensor::from_slice(&values)
    }

    /// ⟨J v, c⟩ = ⟨v, Jᵀ c⟩: forward and backward are each other's transpose, in f64.
    #[test]
    fn it_is_the_transpose_of_the_way_back() {
        crate::device::init();
        for (layer_norm, slope) in [(false, 0.0), (true, 0.0), (false, 0.01)] {
            let shape = NetShape {
                slope,
                layer_norm,
                ..NetShape::new(2, 5, &[16, 12], 1)
            };
            let [weights, direction] = [0, 1].map(|step| normals(shape.n_values(), step));
            let (net, along) = (
                Net::over(&shape, &weights, 0),
                Net::over(&shape, &direction, 0),
            );
            let input = normals(9 * 5, 2).view([9, 5]);
            let c = normals(2 * 9, 3).view([2, 9, 1]);
            let forward = (net.tangent(&input, &along) * &c).sum(Kind::Double);
            let gradient = Tensor::zeros([shape.n_values()], (Kind::Double, Device::Cpu));
            let (_, tape) = net.forward_taped(&input);
            net.backward(&tape, &c, Some(&mut Net::over(&shape, &gradient, 0)), None);
            let backward = (gradient * direction).sum(Kind::Double);
            let (forward, backward) = (forward.double_value(&[]), backward.double_value(&[]));
            assert!(
                (forward - backward).abs() < 1e-9 * backward.abs(),
                "{forward} {backward} (layer norm {layer_norm}, slope {slope})"
            );
        }
    }
}
