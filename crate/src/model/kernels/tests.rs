//! The kernels against plain loops in f64, and the layers against burn's own operations.
//!
//! An f32 sum of n products in any order, with or without fused multiply-add, is off by at most
//! about (n + 1) u times the sum of the absolute products, u = 2⁻²⁴ (the standard bound of a dot
//! product); tolerances are that bound for each number by itself.
//!
//! By tiles a number's error comes from all products of its tile, so there the largest of the sums
//! stands for each. Each of the three transforms adds up to 4 roundings an axis; they also magnify
//! errors, but the bound supposes all n roundings in one direction, and random ones reach a
//! fraction of it.

use burn::backend::ops::ConvOptions;
use burn::module::Param;
use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2dConfig;
use burn::nn::pool::MaxPool2dConfig;
use burn::prelude::{Device, Tensor, TensorData};
use burn::tensor::activation::relu;
use burn::tensor::module::{batch_norm_train, conv2d, interpolate};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

use super::convolution::Convolution;

const UNIT: f64 = 1.0 / (1u64 << 24) as f64;

fn noise(seed: u64, len: usize) -> Vec<f32> {
    let mut rng = StdRng::seed_from_u64(seed);
    (0..len).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// A sum of products with its bound.
#[derive(Clone, Copy, Default)]
struct Sum {
    value: f64,
    size: f64,
    terms: f64,
}

impl Sum {
    fn add(&mut self, a: f32, b: f32) {
        let product = f64::from(a) * f64::from(b);
        self.value += product;
        self.size += product.abs();
        self.terms += 1.0;
    }
}

fn compare(what: &str, case: &Convolution, by_tiles: bool, got: &[f32], expected: &[Sum]) {
    assert_eq!(got.len(), expected.len(), "{what} of {case:?}");
    let largest = expected.iter().map(|sum| sum.size).fold(0.0, f64::max);
    for (i, (got, expected)) in got.iter().zip(expected).enumerate() {
        let (roundings, size) = match by_tiles {
            true => (expected.terms + 3.0 * 2.0 * 4.0, largest),
            false => (expected.terms, expected.size),
        };
        let bound = (roundings + 1.0) * UNIT * size;
        let off = (f64::from(*got) - expected.value).abs();
        assert!(
            off <= bound,
            "{what} of {case:?} at {i}: {got}, not {}; off by {off:e}, bound {bound:e}",
            expected.value
        );
    }
}

/// Forward, input gradient and weight gradient with plain loops.
fn reference(case: &Convolution, input: &[f32], weight: &[f32], gradient: &[f32]) -> [Vec<Sum>; 3] {
    let Convolution {
        batch,
        inputs,
        outputs,
        size: [height, width],
        kernel,
        stride,
        padding,
    } = *case;
    let [rows, columns] = case.output_size();
    let mut output = vec![Sum::default(); batch * outputs * rows * columns];
    let mut of_input = vec![Sum::default(); input.len()];
    let mut of_weight = vec![Sum::default(); weight.len()];
    for image in 0..batch {
        for o in 0..outputs {
            for (row, column) in
                (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)))
            {
                let out = ((image * outputs + o) * rows + row) * columns + column;
                for i in 0..inputs {
                    for (ky, kx) in (0..kernel).flat_map(|ky| (0..kernel).map(move |kx| (ky, kx))) {
                        let (y, x) = (row * stride + ky, column * stride + kx);
                        if y < padding
                            || x < padding
                            || y >= height + padding
                            || x >= width + padding
                        {
                            continue;
                        }
                        let at =
                            ((image * inputs + i) * height + y - padding) * width + x - padding;
                        let tap = ((o * inputs + i) * kernel + ky) * kernel + kx;
                        output[out].add(weight[tap], input[at]);
                        of_input[at].add(weight[tap], gradient[out]);
                        of_weight[tap].add(input[at], gradient[out]);
                    }
                }
            }
        }
    }
    [output, of_input, of_weight]
}

fn check(case: Convolution) {
    assert!(case.is_supported());
    let [rows, columns] = case.output_size();
    let input = noise(1, case.batch * case.inputs * case.size[0] * case.size[1]);
    let weight = noise(2, case.outputs * case.inputs * case.kernel * case.kernel);
    let gradient = noise(3, case.batch * case.outputs * rows * columns);
    let [output, of_input, of_weight] = reference(&case, &input, &weight, &gradient);
    let Convolution { kernel, stride, .. } = case;
    let tiles = |layers: &[[usize; 2]]| {
        case.inputs.min(case.outputs) >= 16 && layers.contains(&[kernel, stride])
    };
    compare(
        "output",
        &case,
        tiles(&[[3, 1], [3, 2], [5, 1]]),
        &case.forward(&input, &weight),
        &output,
    );
    compare(
        "input gradient",
        &case,
        tiles(&[[3, 1], [5, 1]]),
        &case.input_gradient(&weight, &gradient),
        &of_input,
    );
    compare(
        "weight gradient",
        &case,
        tiles(&[[3, 1]]),
        &case.weight_gradient(&input, &gradient),
        &of_weight,
    );
}

/// Kernel, stride and padding of the architectures' layers.
const FILTERS: [[usize; 3]; 6] = [
    [3, 1, 1],
    [3, 2, 1],
    [7, 1, 3],
    [7, 2, 0],
    [5, 1, 0],
    [1, 1, 0],
];

/// Checks every image size and filter (kernel, stride, padding) with every batch, inputs and
/// outputs.
fn check_each(
    shapes: impl IntoIterator<Item = ([usize; 2], [usize; 3])>,
    channels: &[(usize, usize, usize)],
) {
    for (size, [kernel, stride, padding]) in shapes {
        for &(batch, inputs, outputs) in channels {
            check(Convolution {
                batch,
                inputs,
                outputs,
                size,
                kernel,
                stride,
                padding,
            });
        }
    }
}

/// Every size with every filter.
fn pairs<'a>(
    sizes: &'a [[usize; 2]],
    filters: &'a [[usize; 3]],
) -> impl Iterator<Item = ([usize; 2], [usize; 3])> + 'a {
    filters
        .iter()
        .flat_map(move |filter| sizes.iter().map(move |size| (*size, *filter)))
}

#[test]
fn convolutions_of_any_size() {
    let sizes = [[7, 7], [8, 11], [13, 9], [17, 32], [33, 50]];
    check_each(
        pairs(&sizes, &FILTERS),
        &[(1, 3, 5), (5, 4, 3), (2, 16, 9), (1, 1, 1), (11, 9, 8)],
    );
}

#[test]
fn convolutions_of_the_architectures() {
    for (inputs, outputs, side, filter) in [
        (3, 32, 40, [3, 1, 1]),
        (32, 64, 17, [3, 1, 1]),
        (3, 32, 30, [7, 1, 3]),
        (32, 64, 16, [3, 2, 1]),
        (128, 256, 9, [3, 2, 1]),
        (3, 64, 35, [7, 2, 0]),
        (64, 32, 21, [5, 1, 0]),
        (128, 16, 17, [1, 1, 0]),
    ] {
        check_each([([side; 2], filter)], &[(2, inputs, outputs)]);
    }
}

/// Channels that fill no vector, images that fill no tile, borders of all widths.
#[test]
fn convolutions_by_tiles() {
    let filters = [
        [3, 1, 1],
        [3, 1, 0],
        [3, 1, 2],
        [3, 2, 1],
        [3, 2, 0],
        [5, 1, 0],
        [5, 1, 3],
    ];
    let sizes = [[5, 5], [6, 9], [13, 9], [17, 32], [33, 50]];
    check_each(
        pairs(&sizes, &filters),
        &[(1, 16, 16), (3, 17, 20), (11, 24, 33)],
    );
}

/// Sizes that no filter fits once, images smaller than a tile, strides that skip taps: by products
/// and by tiles.
#[test]
fn convolutions_at_the_edge() {
    check_each(
        [
            ([1, 1], [3, 1, 1]),
            ([2, 3], [3, 1, 1]),
            ([2, 1], [3, 1, 2]),
            ([3, 2], [5, 1, 2]),
            ([1, 2], [3, 2, 1]),
            ([1, 4], [3, 2, 1]),
            ([1, 3], [1, 3, 0]),
            ([2, 9], [2, 4, 1]),
            ([6, 5], [4, 3, 3]),
            ([150, 3], [3, 1, 2]),
        ],
        &[(2, 3, 4), (3, 18, 16)],
    );
}

#[test]
fn bands_of_large_images() {
    check(Convolution {
        batch: 1,
        inputs: 16,
        outputs: 2,
        size: [130, 121],
        kernel: 3,
        stride: 1,
        padding: 1,
    });
}

#[test]
fn the_number_of_threads_changes_nothing() {
    for (inputs, outputs, stride) in [(5, 12, 2), (16, 17, 1), (16, 17, 2)] {
        same_with_any_threads(Convolution {
            batch: 9,
            inputs,
            outputs,
            size: [40, 37],
            kernel: 3,
            stride,
            padding: 1,
        });
    }
}

fn same_with_any_threads(case: Convolution) {
    let [rows, columns] = case.output_size();
    let maps = [case.batch, case.inputs, 40 * 37];
    let input = noise(1, maps.iter().product());
    let weight = noise(2, case.outputs * case.inputs * 9);
    let gradient = noise(3, case.batch * case.outputs * rows * columns);
    let results = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            let statistics = super::norm::statistics(&input, maps);
            let (gamma, beta) = (noise(4, case.inputs), noise(5, case.inputs));
            let line: [&[f32]; 2] = [&gamma, &beta];
            let norm = super::norm::gradients(&input, maps, &statistics, line, 1e-5, input.clone());
            [
                case.forward(&input, &weight),
                case.input_gradient(&weight, &gradient),
                case.weight_gradient(&input, &gradient),
                super::norm::normalize_relu(&input, maps, &statistics, line, 1e-5),
                statistics.mean,
                statistics.variance,
                norm.input,
                norm.gamma,
                norm.beta,
            ]
        })
    });
    assert!(results.iter().all(|result| *result == results[0]));
}

fn tensor<const D: usize>(seed: u64, shape: [usize; D], device: &Device) -> Tensor<D> {
    let values = noise(seed, shape.iter().product());
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("f32 values")
}

fn assert_close<const D: usize>(what: &str, a: Tensor<D>, b: Tensor<D>, tolerance: f32) {
    assert_eq!(a.dims(), b.dims(), "{what}");
    let (a, b) = (host(a), host(b));
    let scale = b.iter().fold(0.0f32, |max, v| max.max(v.abs()));
    for (i, (a, b)) in a.iter().zip(&b).enumerate() {
        assert!(
            (a - b).abs() <= tolerance * scale,
            "{what} at {i}: {a}, burn has {b}"
        );
    }
}

/// Both sides sum at most 1000 products of about the same size in f32: a few times sqrt(1000) u of
/// the largest number is what differently ordered sums differ by, and 1e-5 is ten times that.
#[test]
fn layers_agree_with_burn() {
    let device = Device::flex().autodiff();
    for [kernel, stride, padding] in FILTERS {
        let mut layer = Conv2dConfig::new([4, 6], [kernel, kernel])
            .with_stride([stride, stride])
            .with_padding(PaddingConfig2d::Explicit(
                padding, padding, padding, padding,
            ))
            .init(&device);
        layer.weight = Param::from_tensor(tensor(1, [6, 4, kernel, kernel], &device));
        layer.bias = Some(Param::from_tensor(tensor(2, [6], &device)));
        let input = tensor(3, [2, 4, 15, 12], &device).require_grad();
        let ours = super::conv(&layer, input.clone());
        let bias = layer.bias.as_ref().map(Param::val);
        let options = ConvOptions::new([stride; 2], [padding; 2], [1, 1], 1);
        let burns = conv2d(input.clone(), layer.weight.val(), bias.clone(), options);
        assert_close("output", ours.clone(), burns.clone(), 1e-5);
        let factors = tensor(4, ours.dims(), &device);
        let ours = (ours * factors.clone()).sum().backward();
        let burns = (burns * factors).sum().backward();
        let both =
            |tensor: &Tensor<4>| [&ours, &burns].map(|g| tensor.grad(g).expect("a gradient"));
        for (what, tensor) in [
            ("input gradient", &input),
            ("weight gradient", &layer.weight.val()),
        ] {
            let [a, b] = both(tensor);
            assert_close(what, a, b, 1e-5);
        }
        let bias = bias.expect("a bias");
        let [a, b] = [&ours, &burns].map(|g| bias.grad(g).expect("a gradient"));
        assert_close("bias gradient", a, b, 1e-5);
    }
}

#[test]
fn normalization_agrees_with_burn() {
    let device = Device::flex().autodiff();
    for shape in [[5, 3, 7, 9], [1, 2, 16, 16], [2, 4, 3, 1], [3, 1, 5, 64]] {
        let channels = shape[1];
        // Far from 0, where the variance is easily lost.
        let input = (tensor(1, shape, &device) * 0.5 + 3.0).require_grad();
        let gamma = (tensor(2, [channels], &device) + 0.5).require_grad();
        let beta = tensor(3, [channels], &device).require_grad();
        let ours = super::batch_norm_relu(input.clone(), gamma.clone(), beta.clone(), 1e-5);
        let burns = batch_norm_train(input.clone(), gamma.clone(), beta.clone(), 1e-5);
        assert_close("mean", ours.mean, burns.mean, 1e-5);
        assert_close("variance", ours.variance, burns.variance, 1e-4);
        let (ours, burns) = (ours.output, relu(burns.output));
        assert_close("output", ours.clone(), burns.clone(), 1e-4);
        let factors = tensor(4, shape, &device);
        let ours = (ours * factors.clone()).sum().backward();
        let burns = (burns * factors).sum().backward();
        let [a, b] = [&ours, &burns].map(|g| input.grad(g).expect("a gradient"));
        assert_close("input gradient", a, b, 1e-3);
        for tensor in [gamma, beta] {
            let [a, b] = [&ours, &burns].map(|g| tensor.grad(g).expect("a gradient"));
            assert_close("parameter gradient", a, b, 1e-4);
        }
    }
}

#[test]
fn pools_agree_with_burn() {
    let device = Device::flex().autodiff();
    for shape in [[2, 3, 8, 8], [1, 1, 1, 1], [2, 2, 9, 6], [1, 2, 5, 13]] {
        let pool = MaxPool2dConfig::new([2, 2])
            .with_padding(PaddingConfig2d::Explicit(1, 1, 1, 1))
            .init();
        // Equal numbers too: the first of them gets the gradient.
        let input = (tensor(1, shape, &device) * 4.0).round().require_grad();
        let ours = super::max_pool(input.clone());
        let burns = pool.forward(input.clone());
        assert_close("output", ours.clone(), burns.clone(), 0.0);
        let factors = tensor(4, ours.dims(), &device);
        let ours = (ours * factors.clone()).sum().backward();
        let burns = (burns * factors).sum().backward();
        let [a, b] = [&ours, &burns].map(|g| input.grad(g).expect("a gradient"));
        assert_close("input gradient", a, b, 0.0);
    }
}

/// Sums of at most 16 products.
#[test]
fn upsampling_agrees_with_burn() {
    let device = Device::flex().autodiff();
    for [batch, channels, height, width] in
        [[2, 3, 8, 8], [1, 1, 1, 1], [2, 2, 1, 6], [1, 2, 5, 13]]
    {
        let input = tensor(1, [batch, channels, height, width], &device).require_grad();
        let ours = super::upsample(input.clone());
        let options = super::bilinear().with_output_size([2 * height, 2 * width]);
        let burns = interpolate(input.clone(), options);
        assert_close("output", ours.clone(), burns.clone(), 1e-6);
        let factors = tensor(4, ours.dims(), &device);
        let ours = (ours * factors.clone()).sum().backward();
        let burns = (burns * factors).sum().backward();
        let [a, b] = [&ours, &burns].map(|g| input.grad(g).expect("a gradient"));
        assert_close("input gradient", a, b, 1e-6);
    }
}

/// Large tensors, so that the second step works in the memory of the first.
#[test]
fn memory_is_used_again() {
    let device = Device::flex().autodiff();
    let step = || {
        let input = tensor(1, [2, 4, 100, 110], &device).require_grad();
        let [gamma, beta] = [2, 3].map(|seed| tensor::<1>(seed, [4], &device));
        let output = super::batch_norm_relu(input.clone(), gamma, beta, 1e-5).output;
        let gradients = super::max_pool(output.clone()).square().sum().backward();
        (
            host(output),
            host(input.grad(&gradients).expect("a gradient")),
        )
    };
    let first = step();
    assert!(first == step() && first == step());
}

#[test]
fn what_is_not_a_number_stays_one() {
    let device = Device::flex().autodiff();
    let mut values = noise(1, 2 * 16);
    values[5] = f32::NAN;
    let input = Tensor::<4>::from_data(TensorData::new(values, [1, 2, 4, 4]), &device);
    let pooled = host(super::max_pool(input.clone()));
    assert_eq!(pooled.iter().filter(|v| v.is_nan()).count(), 1);
    let ones = Tensor::<1>::ones([2], &device);
    let normalized = host(super::batch_norm_relu(input, ones.clone(), ones, 1e-5).output);
    assert!(normalized[..16].iter().all(|v| v.is_nan()));
    assert!(normalized[16..].iter().all(|v| v.is_finite()));
}

#[test]
fn the_matrices_of_the_upsampling_give_its_gradient() {
    let [height, width] = [3, 5];
    let gradient = noise(4, 4 * height * width);
    let [rows, columns] = [height, width].map(super::upsample::transpose);
    let ours = super::upsample::gradient(&gradient, [height, width]);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let sum: f64 = (0..2 * height)
            .flat_map(|i| (0..2 * width).map(move |j| (i, j)))
            .map(|(i, j)| {
                let weight = rows[y * 2 * height + i] * columns[x * 2 * width + j];
                f64::from(weight) * f64::from(gradient[i * 2 * width + j])
            })
            .sum();
        // Sixteen products of at most 9/16, in two sums.
        assert!(
            (f64::from(ours[y * width + x]) - sum).abs() < 16.0 * UNIT * 4.0,
            "({x}, {y})"
        );
    }
}
