//! Layers whose kernels on burn's CPU device (flex) are our own, because training is bound by them.
//!
//! [`conv`], [`batch_norm_relu`], [`max_pool`] and [`upsample`](fn@upsample) are what the modules
//! call. Behind them is a backend extension: [`Layers`] has burn's own operations as its bodies,
//! flex overrides them, and the gradients are operations of [`LayerGradients`] in the same manner,
//! which the one implementation for `Autodiff` calls. A further backend needs its name in the
//! attribute and two empty `impl`s to run the same modules on burn's operations.
//!
//! The kernels use rayon's current pool. Results do not depend on the number of threads.

mod buffer;
mod conv;
mod convolution;
mod gemm;
mod layout;
mod norm;
mod pool;
#[cfg(test)]
mod tests;
mod upsample;
mod winograd;

use burn::backend::autodiff::NodeId;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::flex::FlexTensor;
use burn::backend::ops::{ConvOptions, InterpolateMode, InterpolateOptions};
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    Autodiff, AutodiffBackend, Backend, Dispatch, Flex, TensorMetadata, backend_extension,
    get_or_init_device_settings,
};
use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::prelude::{Tensor, TensorData};
use burn::tensor::DType;

use convolution::Convolution;
use norm::Statistics;

use crate::engine::pool::pooled;

/// What the layer computes, with kernels of our own where there are any for its sizes.
///
/// # Shapes
/// As [`Conv2d::forward`].
pub(super) fn conv(layer: &Conv2d, input: Tensor<4>) -> Tensor<4> {
    let Some((stride, padding)) = square(layer, &input) else {
        return layer.forward(input);
    };
    let output = Dispatch::convolve(
        input.into_dispatch(),
        layer.weight.val().into_dispatch(),
        stride,
        padding,
    );
    let output = Tensor::<4>::from_dispatch(output);
    match &layer.bias {
        Some(bias) => {
            let [channels] = bias.dims();
            output + bias.val().reshape([1, channels, 1, 1])
        }
        None => output,
    }
}

/// Stride and padding of a layer that [`Convolution`] can compute.
fn square(layer: &Conv2d, input: &Tensor<4>) -> Option<(usize, usize)> {
    let [batch, inputs, height, width] = input.dims();
    let padding = match layer.padding {
        PaddingConfig2d::Valid => 0,
        PaddingConfig2d::Explicit(top, left, bottom, right)
            if [left, bottom, right] == [top; 3] =>
        {
            top
        }
        _ => return None,
    };
    let [kernel, other] = layer.kernel_size;
    let [stride, other_stride] = layer.stride;
    let convolution = Convolution {
        batch,
        inputs,
        outputs: layer.weight.dims()[0],
        size: [height, width],
        kernel,
        stride,
        padding,
    };
    let plain =
        kernel == other && stride == other_stride && layer.dilation == [1, 1] && layer.groups == 1;
    let plain = plain && layer.weight.dims()[1] == inputs && input.dtype() == DType::F32;
    (plain && convolution.is_supported()).then_some((stride, padding))
}

/// What [`batch_norm_relu`] gives.
pub(super) struct Normalized {
    /// `[B, C, H, W]`
    pub output: Tensor<4>,
    /// `[C]`
    pub mean: Tensor<1>,
    /// Biased: `[C]`.
    pub variance: Tensor<1>,
}

/// ReLU of the input, normalized by the statistics of the batch.
///
/// # Shapes
/// - `input`: `[B, C, H, W]`
/// - `gamma`, `beta`: `[C]`
pub(super) fn batch_norm_relu(
    input: Tensor<4>,
    gamma: Tensor<1>,
    beta: Tensor<1>,
    epsilon: f64,
) -> Normalized {
    let (output, mean, variance) = Dispatch::normalize(
        input.into_dispatch(),
        gamma.into_dispatch(),
        beta.into_dispatch(),
        epsilon,
    );
    Normalized {
        output: Tensor::from_dispatch(output),
        mean: Tensor::from_dispatch(mean),
        variance: Tensor::from_dispatch(variance),
    }
}

/// Max-pool over 2 x 2 cells with stride 2 and a border of -inf one cell wide.
///
/// # Shapes
/// - `input`: `[B, C, H, W]`
/// - output: `[B, C, H / 2 + 1, W / 2 + 1]`
pub(super) fn max_pool(input: Tensor<4>) -> Tensor<4> {
    Tensor::from_dispatch(Dispatch::pool(input.into_dispatch()))
}

/// Bilinear upsampling to twice the height and width, pixel edges aligned (`align_corners` is
/// false).
///
/// # Shapes
/// - `input`: `[B, C, H, W]`
/// - output: `[B, C, 2 H, 2 W]`
pub(super) fn upsample(input: Tensor<4>) -> Tensor<4> {
    Tensor::from_dispatch(Dispatch::enlarge(input.into_dispatch()))
}

/// The layers on a backend; the bodies are burn's own operations.
#[backend_extension(Flex, Cube: cfg(feature = "gpu"), Autodiff)]
trait Layers: Backend {
    fn convolve(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        stride: usize,
        padding: usize,
    ) -> FloatTensor<Self> {
        Self::conv2d(input, weight, None, options(stride, padding))
    }

    fn normalize(
        input: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f64,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let result = Self::batch_norm_train(input, gamma, beta, epsilon);
        (Self::relu(result.output), result.mean, result.variance)
    }

    fn pool(input: FloatTensor<Self>) -> FloatTensor<Self> {
        Self::max_pool2d(input, [2, 2], [2, 2], [1, 1], [1, 1], false)
    }

    fn enlarge(input: FloatTensor<Self>) -> FloatTensor<Self> {
        let [_, _, height, width] = input.shape().dims();
        Self::interpolate(input, [2 * height, 2 * width], bilinear())
    }
}

/// The gradients of [`Layers`] on a backend; the bodies are burn's own operations.
trait LayerGradients: Backend {
    fn convolve_input_gradient(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        stride: usize,
        padding: usize,
    ) -> FloatTensor<Self> {
        Self::conv2d_x_backward(input, weight, gradient, options(stride, padding))
    }

    fn convolve_weight_gradient(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        stride: usize,
        padding: usize,
    ) -> FloatTensor<Self> {
        Self::conv2d_weight_backward(input, weight, gradient, options(stride, padding))
    }

    /// The gradients of the input, gamma and beta.
    fn normalize_gradients(
        input: FloatTensor<Self>,
        statistics: [FloatTensor<Self>; 2],
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f64,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; 3] {
        let [mean, variance] = statistics;
        let output = Self::batch_norm(
            input.clone(),
            gamma.clone(),
            beta,
            mean.clone(),
            variance.clone(),
            epsilon,
        );
        let gradient = Self::relu_backward(Self::relu(output), gradient);
        let result =
            Self::batch_norm_train_backward(input, gamma, mean, variance, epsilon, gradient);
        [result.x_grad, result.gamma_grad, result.beta_grad]
    }

    fn pool_gradient(input: FloatTensor<Self>, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        let [kernel, stride, border] = [[2, 2], [2, 2], [1, 1]];
        // GPUs have no i64.
        let indices = get_or_init_device_settings::<Self>(&input.device()).int_dtype;
        let pooled = Self::max_pool2d_with_indices(
            input.clone(),
            kernel,
            stride,
            border,
            [1, 1],
            false,
            indices,
        );
        Self::max_pool2d_with_indices_backward(
            input,
            kernel,
            stride,
            border,
            [1, 1],
            false,
            gradient,
            pooled.indices,
        )
        .x_grad
    }

    fn enlarge_gradient(
        input: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        // burn has no gradient of a bilinear interpolation on GPUs. Rows and columns are enlarged
        // by a matrix each, so the gradient takes their transposes.
        let [_, _, height, width] = input.shape().dims();
        let device = input.device();
        let weights = |length: usize| {
            let shape = [1, 1, length, 2 * length];
            Self::float_from_data(TensorData::new(upsample::transpose(length), shape), &device)
        };
        let rows = Self::float_matmul(weights(height), gradient);
        Self::float_matmul(rows, Self::float_swap_dims(weights(width), 2, 3))
    }
}

fn bilinear() -> InterpolateOptions {
    InterpolateOptions::new(InterpolateMode::Bilinear).with_align_corners(false)
}

fn options(stride: usize, padding: usize) -> ConvOptions<2> {
    ConvOptions::new([stride; 2], [padding; 2], [1, 1], 1)
}

impl Layers for Flex {
    fn convolve(
        input: FlexTensor,
        weight: FlexTensor,
        stride: usize,
        padding: usize,
    ) -> FlexTensor {
        let (input, weight) = (input.to_contiguous(), weight.to_contiguous());
        let convolution = convolution(&input, &weight, stride, padding);
        let [rows, columns] = convolution.output_size();
        tensor(
            convolution.forward(values(&input), values(&weight)),
            [convolution.batch, convolution.outputs, rows, columns],
        )
    }

    fn normalize(
        input: FlexTensor,
        gamma: FlexTensor,
        beta: FlexTensor,
        epsilon: f64,
    ) -> (FlexTensor, FlexTensor, FlexTensor) {
        let [input, gamma, beta] = [input, gamma, beta].map(|t| t.to_contiguous());
        let [batch, channels, height, width] = input.shape().dims();
        let maps = [batch, channels, height * width];
        let statistics = norm::statistics(values(&input), maps);
        let line = [values(&gamma), values(&beta)];
        let output = norm::normalize_relu(values(&input), maps, &statistics, line, epsilon);
        (
            tensor(output, [batch, channels, height, width]),
            tensor(statistics.mean, [channels]),
            tensor(statistics.variance, [channels]),
        )
    }

    fn pool(input: FlexTensor) -> FlexTensor {
        let input = input.to_contiguous();
        let [batch, channels, height, width] = input.shape().dims();
        tensor(
            pool::max_pool(values(&input), [height, width]),
            [batch, channels, pooled(height), pooled(width)],
        )
    }

    fn enlarge(input: FlexTensor) -> FlexTensor {
        let input = input.to_contiguous();
        let [batch, channels, height, width] = input.shape().dims();
        tensor(
            upsample::upsample(values(&input), [height, width]),
            [batch, channels, 2 * height, 2 * width],
        )
    }
}

#[cfg(feature = "gpu")]
impl Layers for burn::backend::Cube {}

#[cfg(feature = "gpu")]
impl LayerGradients for burn::backend::Cube {}

impl LayerGradients for Flex {
    fn convolve_input_gradient(
        input: FlexTensor,
        weight: FlexTensor,
        gradient: FlexTensor,
        stride: usize,
        padding: usize,
    ) -> FlexTensor {
        let (weight, gradient) = (weight.to_contiguous(), gradient.to_contiguous());
        let convolution = convolution(&input, &weight, stride, padding);
        let result = convolution.input_gradient(values(&weight), values(&gradient));
        tensor(result, input.shape().dims::<4>())
    }

    fn convolve_weight_gradient(
        input: FlexTensor,
        weight: FlexTensor,
        gradient: FlexTensor,
        stride: usize,
        padding: usize,
    ) -> FlexTensor {
        let (input, gradient) = (input.to_contiguous(), gradient.to_contiguous());
        let convolution = convolution(&input, &weight, stride, padding);
        let result = convolution.weight_gradient(values(&input), values(&gradient));
        tensor(result, weight.shape().dims::<4>())
    }

    fn normalize_gradients(
        input: FlexTensor,
        statistics: [FlexTensor; 2],
        gamma: FlexTensor,
        beta: FlexTensor,
        epsilon: f64,
        gradient: FlexTensor,
    ) -> [FlexTensor; 3] {
        let [input, gamma, beta] = [input, gamma, beta].map(|t| t.to_contiguous());
        let [batch, channels, height, width] = input.shape().dims();
        let [mean, variance] = statistics.map(|t| values(&t.to_contiguous()).to_vec());
        let gradients = norm::gradients(
            values(&input),
            [batch, channels, height * width],
            &Statistics { mean, variance },
            [values(&gamma), values(&beta)],
            epsilon,
            owned(gradient),
        );
        [
            tensor(gradients.input, [batch, channels, height, width]),
            tensor(gradients.gamma, [channels]),
            tensor(gradients.beta, [channels]),
        ]
    }

    fn pool_gradient(input: FlexTensor, gradient: FlexTensor) -> FlexTensor {
        let (input, gradient) = (input.to_contiguous(), gradient.to_contiguous());
        let [batch, channels, height, width] = input.shape().dims();
        tensor(
            pool::gradient(values(&input), [height, width], values(&gradient)),
            [batch, channels, height, width],
        )
    }

    fn enlarge_gradient(input: FlexTensor, gradient: FlexTensor) -> FlexTensor {
        let gradient = gradient.to_contiguous();
        let [batch, channels, height, width] = input.shape().dims();
        tensor(
            upsample::gradient(values(&gradient), [height, width]),
            [batch, channels, height, width],
        )
    }
}

fn convolution(
    input: &FlexTensor,
    weight: &FlexTensor,
    stride: usize,
    padding: usize,
) -> Convolution {
    let [batch, inputs, height, width] = input.shape().dims();
    let [outputs, _, kernel, _] = weight.shape().dims();
    Convolution {
        batch,
        inputs,
        outputs,
        size: [height, width],
        kernel,
        stride,
        padding,
    }
}

fn values(tensor: &FlexTensor) -> &[f32] {
    tensor.as_slice().expect("a contiguous f32 tensor")
}

/// The values of a tensor, in its own memory if it is not shared.
fn owned(tensor: FlexTensor) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("an f32 tensor")
}

fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D]) -> FlexTensor {
    FlexTensor::from_data(TensorData::from_bytes(
        buffer::bytes(values),
        shape,
        DType::F32,
    ))
}

impl<B: Backend + Layers + LayerGradients, C: CheckpointStrategy> Layers for Autodiff<B, C> {
    fn convolve(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        stride: usize,
        padding: usize,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Convolve;

        impl<B: Backend + LayerGradients> Backward<B, 2> for Convolve {
            type State = (NodeId, NodeId, usize, usize);

            fn backward(
                self,
                ops: Ops<Self::State, 2>,
                grads: &mut Gradients,
                checkpointer: &mut Checkpointer,
            ) {
                let [of_input, of_weight] = ops.parents;
                let gradient = grads.consume::<B>(&ops.node);
                let (input, weight, stride, padding) = ops.state;
                let input: FloatTensor<B> = checkpointer.retrieve_node_output(input);
                let weight: FloatTensor<B> = checkpointer.retrieve_node_output(weight);
                if let Some(node) = of_weight {
                    let result = B::convolve_weight_gradient(
                        input.clone(),
                        weight.clone(),
                        gradient.clone(),
                        stride,
                        padding,
                    );
                    grads.register::<B>(node.id, result);
                }
                if let Some(node) = of_input {
                    let result =
                        B::convolve_input_gradient(input, weight, gradient, stride, padding);
                    grads.register::<B>(node.id, result);
                }
            }
        }

        let prepared = Convolve
            .prepare::<C>([input.node(), weight.node()])
            .compute_bound()
            .stateful();
        match prepared {
            OpsKind::Tracked(mut ops) => {
                let state = (
                    ops.checkpoint(&input),
                    ops.checkpoint(&weight),
                    stride,
                    padding,
                );
                ops.finish(
                    state,
                    B::convolve(
                        input.into_primitive(),
                        weight.into_primitive(),
                        stride,
                        padding,
                    ),
                )
            }
            OpsKind::UnTracked(ops) => ops.finish(B::convolve(
                input.into_primitive(),
                weight.into_primitive(),
                stride,
                padding,
            )),
        }
    }

    fn normalize(
        input: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f64,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        #[derive(Debug)]
        struct Normalize;

        impl<B: Backend + LayerGradients> Backward<B, 3> for Normalize {
            type State = (NodeId, NodeId, NodeId, [FloatTensor<B>; 2], f64);

            fn backward(
                self,
                ops: Ops<Self::State, 3>,
                grads: &mut Gradients,
                checkpointer: &mut Checkpointer,
            ) {
                let gradient = grads.consume::<B>(&ops.node);
                let (input, gamma, beta, statistics, epsilon) = ops.state;
                let [input, gamma, beta] = [input, gamma, beta]
                    .map(|node| checkpointer.retrieve_node_output::<FloatTensor<B>>(node));
                let results =
                    B::normalize_gradients(input, statistics, gamma, beta, epsilon, gradient);
                for (node, result) in ops.parents.into_iter().zip(results) {
                    if let Some(node) = node {
                        grads.register::<B>(node.id, result);
                    }
                }
            }
        }

        let prepared = Normalize
            .prepare::<C>([input.node(), gamma.node(), beta.node()])
            .compute_bound()
            .stateful();
        let (output, mean, variance) = match prepared {
            OpsKind::Tracked(mut ops) => {
                let nodes = [&input, &gamma, &beta].map(|tensor| ops.checkpoint(tensor));
                let (output, mean, variance) = B::normalize(
                    input.into_primitive(),
                    gamma.into_primitive(),
                    beta.into_primitive(),
                    epsilon,
                );
                let [input, gamma, beta] = nodes;
                let state = (
                    input,
                    gamma,
                    beta,
                    [mean.clone(), variance.clone()],
                    epsilon,
                );
                (ops.finish(state, output), mean, variance)
            }
            OpsKind::UnTracked(ops) => {
                let (output, mean, variance) = B::normalize(
                    input.into_primitive(),
                    gamma.into_primitive(),
                    beta.into_primitive(),
                    epsilon,
                );
                (ops.finish(output), mean, variance)
            }
        };
        (output, Self::from_inner(mean), Self::from_inner(variance))
    }

    fn pool(input: FloatTensor<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Pool;

        impl<B: Backend + LayerGradients> Backward<B, 1> for Pool {
            type State = NodeId;

            fn backward(
                self,
                ops: Ops<Self::State, 1>,
                grads: &mut Gradients,
                checkpointer: &mut Checkpointer,
            ) {
                let gradient = grads.consume::<B>(&ops.node);
                let input = checkpointer.retrieve_node_output::<FloatTensor<B>>(ops.state);
                let [of_input] = ops.parents;
                if let Some(node) = of_input {
                    grads.register::<B>(node.id, B::pool_gradient(input, gradient));
                }
            }
        }

        match Pool.prepare::<C>([input.node()]).compute_bound().stateful() {
            OpsKind::Tracked(mut ops) => {
                let state = ops.checkpoint(&input);
                ops.finish(state, B::pool(input.into_primitive()))
            }
            OpsKind::UnTracked(ops) => ops.finish(B::pool(input.into_primitive())),
        }
    }

    fn enlarge(input: FloatTensor<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Enlarge;

        impl<B: Backend + LayerGradients> Backward<B, 1> for Enlarge {
            type State = NodeId;

            fn backward(
                self,
                ops: Ops<Self::State, 1>,
                grads: &mut Gradients,
                checkpointer: &mut Checkpointer,
            ) {
                let gradient = grads.consume::<B>(&ops.node);
                let input = checkpointer.retrieve_node_output::<FloatTensor<B>>(ops.state);
                let [of_input] = ops.parents;
                if let Some(node) = of_input {
                    grads.register::<B>(node.id, B::enlarge_gradient(input, gradient));
                }
            }
        }

        match Enlarge
            .prepare::<C>([input.node()])
            .compute_bound()
            .stateful()
        {
            OpsKind::Tracked(mut ops) => {
                let state = ops.checkpoint(&input);
                ops.finish(state, B::enlarge(input.into_primitive()))
            }
            OpsKind::UnTracked(ops) => ops.finish(B::enlarge(input.into_primitive())),
        }
    }
}
