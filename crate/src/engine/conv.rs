//! Convolutions with packed weights.

use rten_gemm::{
    BiasVector, ColOffsets, GemmExecutor, GemmInputA, GemmInputB, GemmOptions, Im2Col, PackedAMatrix,
    RowOffsets,
};
use rten_tensor::NdTensorView;

use crate::checkpoint::{ConvLayer, Tensor};
use crate::error::{Error, Result};

/// A convolution with a square kernel and zero padding.
pub(super) struct Conv {
    weights: PackedAMatrix<f32>,
    bias: Option<Vec<f32>>,
    inputs: usize,
    outputs: usize,
    kernel: usize,
    stride: usize,
    padding: usize,
}

/// Where the elements of a layer's virtual im2col matrix lie in its input; kept while the size stays.
#[derive(Default)]
pub(super) struct Im2ColOffsets {
    size: [usize; 2],
    rows: Offsets3,
    columns: Offsets2,
}

type Offsets3 = (Vec<i32>, Vec<i32>, Vec<i32>);
type Offsets2 = (Vec<i32>, Vec<i32>);

impl Conv {
    /// Packs `weight` (outputs x inputs x k x k), each output's filter multiplied by its `scale`.
    pub fn new(
        gemm: &GemmExecutor,
        layer: &ConvLayer,
        weight: &Tensor,
        scale: Option<&[f32]>,
        bias: Option<Vec<f32>>,
    ) -> Result<Self> {
        let [outputs, inputs, kernel, _] = weight.shape[..] else {
            return Err(Error::input(format!(
                "a filter bank has shape {:?}; expected four axes",
                weight.shape
            )));
        };
        let columns = inputs * kernel * kernel;
        let mut data = weight.data.clone();
        if let Some(scale) = scale {
            for (filter, scale) in data.chunks_exact_mut(columns).zip(scale) {
                filter.iter_mut().for_each(|w| *w *= scale);
            }
        }
        let matrix = NdTensorView::from_data([outputs, columns], &data[..]);
        Ok(Self {
            weights: gemm.prepack_a(matrix),
            bias,
            inputs,
            outputs,
            kernel,
            stride: layer.stride,
            padding: layer.padding,
        })
    }

    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Convolves `input` (inputs x height x width) of `size` into `output` (outputs x height' x width') of `to`.
    pub fn run(
        &self,
        gemm: &GemmExecutor,
        offsets: &mut Im2ColOffsets,
        input: &[f32],
        [width, height]: [usize; 2],
        output: &mut [f32],
        to: [usize; 2],
    ) -> Result<()> {
        let options = GemmOptions {
            bias: self.bias.as_deref().map(BiasVector::Column),
            ..GemmOptions::default()
        };
        let weights = GemmInputA::Packed(&self.weights);
        let done = if self.kernel == 1 && self.stride == 1 && self.padding == 0 {
            let matrix = NdTensorView::from_data([self.inputs, height * width], input);
            gemm.gemm(output, weights, GemmInputB::Unpacked(matrix), options)
        } else {
            offsets.prepare(gemm, self, [width, height], to);
            let im2col = Im2Col {
                image: NdTensorView::from_data([self.inputs, height, width], input),
                row_offsets: offsets.take_rows(),
                col_offsets: offsets.take_columns(),
                n_cols: to[0] * to[1],
                n_rows: self.inputs * self.kernel * self.kernel,
                max_y_offset: ((height - 1) * width) as i32,
                max_x_offset: (width - 1) as i32,
            };
            let done = gemm.gemm(output, weights, GemmInputB::Im2Col(&im2col), options);
            offsets.put_back(im2col.row_offsets, im2col.col_offsets);
            done
        };
        done.map_err(|e| Error::input(format!("a convolution could not be computed: {e}")))
    }
}

impl Im2ColOffsets {
    fn prepare(&mut self, gemm: &GemmExecutor, conv: &Conv, size: [usize; 2], to: [usize; 2]) {
        if self.size == size {
            return;
        }
        self.size = size;
        let [width, height] = size.map(|side| side as i32);
        // Beyond the matrix: an offset that is in the padding whatever is added to it.
        let outside = i32::MAX;
        let kernel = conv.kernel as i32;
        let (channel, y, x) = &mut self.rows;
        channel.clear();
        y.clear();
        x.clear();
        for c in 0..conv.inputs as i32 {
            for ky in 0..kernel {
                for kx in 0..kernel {
                    channel.push(c * width * height);
                    y.push(ky * width);
                    x.push(kx);
                }
            }
        }
        let padded = channel.len().next_multiple_of(gemm.im2col_row_count_step());
        for offsets in [channel, y, x] {
            offsets.resize(padded, outside);
        }
        let (stride, padding) = (conv.stride as i32, conv.padding as i32);
        let (top, left) = &mut self.columns;
        top.clear();
        left.clear();
        for row in 0..to[1] as i32 {
            for column in 0..to[0] as i32 {
                top.push((row * stride - padding) * width);
                left.push(column * stride - padding);
            }
        }
        let padded = top.len().next_multiple_of(gemm.im2col_col_count_step());
        for offsets in [top, left] {
            offsets.resize(padded, outside);
        }
    }

    fn take_rows(&mut self) -> RowOffsets {
        let (chan, y, x) = std::mem::take(&mut self.rows);
        RowOffsets { chan, y, x }
    }

    fn take_columns(&mut self) -> ColOffsets {
        let (y, x) = std::mem::take(&mut self.columns);
        ColOffsets { y, x }
    }

    fn put_back(&mut self, rows: RowOffsets, columns: ColOffsets) {
        self.rows = (rows.chan, rows.y, rows.x);
        self.columns = (columns.y, columns.x);
    }
}
