//! The roads for other devices cannot be taken on the processor by themselves: half precision,
//! which the loops do not take, leads there; the gradients' tests check the loops.

use domain::random::{Rng, Stream};

use super::*;

const FLOAT: (Kind, Device) = (Kind::Float, Device::Cpu);

fn normals(size: [i64; 3], step: u64) -> Tensor {
    let mut values = vec![0.0; size.iter().product::<i64>() as usize];
    Rng::new(6, Stream::Test, step).fill_normal(&mut values);
    Tensor::from_slice(&values).view(size)
}

/// The same numbers for both roads: first rounded to what half precision can hold.
fn both(size: [i64; 3], step: u64) -> (Tensor, Tensor) {
    let half = normals(size, step).to_kind(Kind::Half);
    (half.to_kind(Kind::Float), half)
}

fn close(a: &Tensor, b: &Tensor) {
    let error = (a - b.to_kind(Kind::Float)).abs().max() / a.abs().max();
    assert!(error.double_value(&[]) < 0.03, "{error:?}");
}

#[test]
fn both_roads_through_a_plain_layer_agree() {
    let ((mut z, mut z2), (b, b2)) = (both([2, 9, 21], 0), both([2, 1, 21], 1));
    bias_activate(&mut z, &b, 0.25);
    bias_activate(&mut z2, &b2, 0.25);
    close(&z, &z2);
    let ((mut g, mut g2), (mut s, mut s2)) = (both([2, 9, 21], 2), both([2, 1, 21], 3));
    bias_activate_backward(&mut g, &z, 0.25, Some(&mut s));
    bias_activate_backward(&mut g2, &z2, 0.25, Some(&mut s2));
    close(&g, &g2);
    close(&s, &s2);
}

#[test]
fn both_roads_through_a_normalised_layer_agree() {
    let ((mut z, mut z2), (b, b2)) = (both([2, 9, 21], 0), both([2, 1, 21], 1));
    let ((gain, gain2), (shift, shift2)) = (both([2, 1, 21], 2), both([2, 1, 21], 3));
    let (y, inverse) = norm_activate(&mut z, &b, (&gain, &shift), 0.0);
    let (y2, inverse2) = norm_activate(&mut z2, &b2, (&gain2, &shift2), 0.0);
    close(&y, &y2);
    close(&z, &z2);
    let (mut g, mut g2) = both([2, 9, 21], 4);
    let zeros =
        |like: &Tensor| [0; 3].map(|_| Tensor::zeros([2, 1, 21], (like.kind(), Device::Cpu)));
    let ([mut a, mut b, mut c], [mut a2, mut b2, mut c2]) = (zeros(&g), zeros(&g2));
    let forward = Normed {
        output: &y,
        normalised: &z,
        inverse: &inverse,
        gain: &gain,
    };
    let into = NormGradient {
        bias: &mut a,
        gain: &mut b,
        shift: &mut c,
    };
    norm_activate_backward(&mut g, &forward, 0.0, Some(into));
    let forward = Normed {
        output: &y2,
        normalised: &z2,
        inverse: &inverse2,
        gain: &gain2,
    };
    let into = NormGradient {
        bias: &mut a2,
        gain: &mut b2,
        shift: &mut c2,
    };
    norm_activate_backward(&mut g2, &forward, 0.0, Some(into));
    for (ours, theirs) in [(&g, &g2), (&b, &b2), (&c, &c2)] {
        close(ours, theirs);
    }
}

#[test]
fn adam_makes_the_steps_of_its_definition() {
    let [mut p, mut m, mut v] = [1.0, 0.5, 0.25].map(|x| Tensor::full([3], x, FLOAT));
    let g = Tensor::full([3], 2.0, FLOAT);
    let step = AdamStep {
        rate: 0.1,
        root_correction: 0.5,
        scale: 0.5,
    };
    adam(&mut p, &g, (&mut m, &mut v), step);
    let (first, second) = (0.9 * 0.5 + 0.1 * 1.0, 0.999 * 0.25 + 0.001 * 1.0_f64);
    let expected = 1.0 - 0.1 * first / (second.sqrt() / 0.5 + 1e-8);
    assert!((p.double_value(&[1]) - expected).abs() < 1e-6);
    let mut target = Tensor::zeros([3], FLOAT);
    lerp(&mut target, &Tensor::ones([3], FLOAT), 0.005);
    assert!((target.double_value(&[2]) - 0.005).abs() < 1e-9);
}
