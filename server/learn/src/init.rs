//! Initial weights from our own random numbers.

use domain::random::Rng;
use tch::{Kind, Tensor};

use crate::net::Net;

/// Orthogonal weights, zero biases: SAC's networks in the released code.
///
/// The shorter side's vectors of each member's `[in × out]` matrix are orthonormal, drawn
/// uniformly (QR of a normal matrix, signs from R's diagonal).
pub(crate) fn orthogonal(net: &mut Net, rng: &mut Rng) {
    for layer in net.layers_mut() {
        let size = layer.weight.size();
        let (n_members, n_in, n_out) = (size[0], size[1], size[2]);
        let (long, short) = (n_in.max(n_out), n_in.min(n_out));
        for member in 0..n_members {
            let normals: Vec<f64> = (0..long * short).map(|_| rng.normal()).collect();
            let (q, r) =
                Tensor::linalg_qr(&Tensor::from_slice(&normals).view([long, short]), "reduced");
            let signed = q * r.diagonal(0, 0, 1).sign();
            let matrix = if n_in == long {
                signed
            } else {
                signed.transpose(0, 1)
            };
            layer.weight.get(member).copy_(&matrix);
        }
        let _ = layer.bias.zero_();
        layer.init_norm();
    }
}

/// Weights and biases uniform in ±1/√in: PyTorch's default for linear layers, which the reward
/// ensemble and the temporal distance keep in the released code.
pub(crate) fn uniform(net: &mut Net, rng: &mut Rng) {
    for layer in net.layers_mut() {
        let bound = 1.0 / (layer.weight.size()[1] as f64).sqrt();
        for tensor in [&mut layer.weight, &mut layer.bias] {
            let draws: Vec<f64> = (0..tensor.numel())
                .map(|_| rng.uniform_in(-bound, bound))
                .collect();
            tensor.copy_(
                &Tensor::from_slice(&draws)
                    .to_kind(Kind::Double)
                    .view_as(tensor),
            );
        }
        layer.init_norm();
    }
}

#[cfg(test)]
mod tests {
    use domain::random::Stream;
    use tch::{Device, Kind};

    use super::*;
    use crate::net::NetShape;

    #[test]
    fn orthogonal_weights_have_orthonormal_vectors() {
        let shape = NetShape {
            n_members: 2,
            sizes: vec![5, 16, 3],
            slope: 0.0,
            layer_norm: false,
            precision: crate::Precision::F32,
        };
        let flat = Tensor::ones([shape.n_values()], (Kind::Double, Device::Cpu));
        let mut net = Net::over(&shape, &flat, 0);
        orthogonal(&mut net, &mut Rng::new(1, Stream::Test, 0));
        for layer in net.layers_mut() {
            let w = &layer.weight;
            let is_wide = w.size()[1] < w.size()[2];
            let gram = if is_wide {
                w.matmul(&w.transpose(1, 2))
            } else {
                w.transpose(1, 2).matmul(w)
            };
            let eye = Tensor::eye(gram.size()[1], (Kind::Double, Device::Cpu));
            assert!((gram - eye).abs().max().double_value(&[]) < 1e-12);
            assert!(layer.bias.abs().max().double_value(&[]) < 1e-12);
        }
    }
}
