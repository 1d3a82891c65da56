//! The decoder of an SAE: keypoints in, an image out. It is for looking at single frames and plain
//! rather than fast.

use super::layer::batch_norm;
use super::softargmax::position;
use crate::checkpoint::{BACKGROUND, Checkpoint, ConvLayer, DENSE, Family, SIGMA, SaeConfig};
use crate::error::{Error, Result};

/// A decoder ready to run on the CPU.
pub struct CpuDecoder {
    config: SaeConfig,
    /// One for all keypoints, or one each.
    sigma: Vec<f32>,
    layers: Vec<Layer>,
    /// Weight and bias of a DSAE's only layer.
    dense: Option<(Vec<f32>, Vec<f32>)>,
    background: Option<Vec<f32>>,
}

/// A convolution with its batch norm folded in.
struct Layer {
    shape: ConvLayer,
    weight: Vec<f32>,
    shift: Vec<f32>,
}

impl CpuDecoder {
    /// The decoder of a checkpoint; `None` when it holds only an encoder.
    ///
    /// # Errors
    /// When a tensor of the decoder is missing.
    pub fn new(checkpoint: &Checkpoint) -> Result<Option<Self>> {
        if !checkpoint.has_decoder() {
            return Ok(None);
        }
        let config = checkpoint.config.clone();
        let values = |name: &str| checkpoint.tensor(name).map(|tensor| tensor.data.clone());
        let is_dsae = config.architecture.family == Family::Dsae;
        Ok(Some(Self {
            sigma: match config.architecture.trained_sigma {
                true => values(SIGMA)?,
                false => vec![config.sigma as f32],
            },
            layers: config
                .decoder_layers()
                .into_iter()
                .map(|shape| Layer::new(checkpoint, shape))
                .collect::<Result<_>>()?,
            dense: is_dsae
                .then(|| {
                    Ok::<_, Error>((
                        values(&format!("{DENSE}.weight"))?,
                        values(&format!("{DENSE}.bias"))?,
                    ))
                })
                .transpose()?,
            background: config
                .architecture
                .background
                .then(|| values(BACKGROUND))
                .transpose()?,
            config,
        }))
    }

    /// Width and height of what [`CpuDecoder::reconstruct`] makes.
    pub fn size(&self) -> [usize; 2] {
        self.config.target_size
    }

    /// The image that the decoder makes of N keypoints (x, y) in the latent space: 3 x height x
    /// width values, linear and not clipped; the images it was trained on are in [0, 1].
    ///
    /// # Errors
    /// When there are not N keypoints.
    pub fn reconstruct(&self, points: &[[f32; 2]]) -> Result<Vec<f32>> {
        if points.len() != self.config.keypoints {
            return Err(Error::input(format!(
                "{} keypoints for a decoder of {}",
                points.len(),
                self.config.keypoints
            )));
        }
        let mut image = match &self.dense {
            Some((weight, bias)) => {
                let latent: Vec<f32> = points.iter().flat_map(|[x, y]| [*y, *x]).collect();
                let rows = weight.chunks_exact(latent.len()).zip(bias);
                rows.map(|(row, bias)| {
                    bias + row.iter().zip(&latent).map(|(w, z)| w * z).sum::<f32>()
                })
                .collect()
            }
            None => {
                let mut size = self.config.map_size();
                let mut maps = self.gaussian_maps(points, size);
                for layer in &self.layers {
                    (maps, size) = layer.run(maps, size);
                }
                maps
            }
        };
        for (value, background) in image.iter_mut().zip(self.background.iter().flatten()) {
            *value += background;
        }
        Ok(image)
    }

    /// A blob a keypoint: `exp(-d² / σ²)` of the distance in latent units, less its height at the
    /// limit where there is one.
    fn gaussian_maps(&self, points: &[[f32; 2]], [width, height]: [usize; 2]) -> Vec<f32> {
        let floor = self.config.sigma_limit.map(|limit| (-limit * limit).exp());
        let blob = |(n, point): (usize, &[f32; 2])| {
            let sigma = f64::from(self.sigma[n % self.sigma.len()]);
            let profile = |centre: f32, cells: usize| -> Vec<f64> {
                let distance = |i| (position(i, cells) - f64::from(centre)) / sigma;
                (0..cells)
                    .map(|i| (-distance(i) * distance(i)).exp())
                    .collect()
            };
            let (along_x, along_y) = (profile(point[0], width), profile(point[1], height));
            let cells = along_y
                .iter()
                .flat_map(|y| along_x.iter().map(move |x| x * y));
            let heights: Vec<f32> = match floor {
                Some(floor) => cells.map(|v| (v - floor).max(0.0) as f32).collect(),
                None => cells.map(|v| v as f32).collect(),
            };
            heights
        };
        points.iter().enumerate().flat_map(blob).collect()
    }
}

impl Layer {
    fn new(checkpoint: &Checkpoint, shape: ConvLayer) -> Result<Self> {
        let mut weight = checkpoint
            .tensor(&format!("{}.weight", shape.name))?
            .data
            .clone();
        let shift = match &shape.norm {
            None => checkpoint
                .tensor(&format!("{}.bias", shape.name))?
                .data
                .clone(),
            Some(norm) => {
                let (scale, shift) = batch_norm(checkpoint, norm)?;
                let filters = weight.chunks_exact_mut(shape.inputs * shape.kernel * shape.kernel);
                for (filter, scale) in filters.zip(&scale) {
                    filter.iter_mut().for_each(|w| *w *= scale);
                }
                shift
            }
        };
        Ok(Self {
            shape,
            weight,
            shift,
        })
    }

    /// The planes that the layer makes of planes of `[width, height]`, and their size, as steps of
    /// 1 keep it.
    fn run(&self, mut planes: Vec<f32>, mut size: [usize; 2]) -> (Vec<f32>, [usize; 2]) {
        if self.shape.upsample {
            planes = upsample(&planes, size);
            size = size.map(|side| 2 * side);
        }
        let [width, height] = size;
        let (kernel, padding) = (self.shape.kernel, self.shape.padding);
        let area = width * height;
        let mut out = vec![0.0; self.shape.outputs * area];
        let filters = self
            .weight
            .chunks_exact(self.shape.inputs * kernel * kernel);
        for ((result, filter), shift) in out.chunks_exact_mut(area).zip(filters).zip(&self.shift) {
            result.fill(*shift);
            for (plane, taps) in planes
                .chunks_exact(area)
                .zip(filter.chunks_exact(kernel * kernel))
            {
                for (tap, weight) in taps.iter().enumerate() {
                    // Row y, column x of the result see row y + dy - padding, column x + dx -
                    // padding.
                    let (dy, dx) = (tap / kernel, tap % kernel);
                    let rows = padding.saturating_sub(dy)
                        ..height.min((height + padding).saturating_sub(dy));
                    let columns =
                        padding.saturating_sub(dx)..width.min((width + padding).saturating_sub(dx));
                    for y in rows {
                        let from = (y + dy - padding) * width + columns.start + dx - padding;
                        let source = &plane[from..from + columns.len()];
                        let target = &mut result[y * width + columns.start..][..columns.len()];
                        for (value, input) in target.iter_mut().zip(source) {
                            *value += weight * input;
                        }
                    }
                }
            }
            if self.shape.norm.is_some() {
                result.iter_mut().for_each(|value| *value = value.max(0.0));
            }
        }
        (out, size)
    }
}

/// Planes of twice the width and height, bilinear, corners not aligned.
fn upsample(planes: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let between = |i: usize, side: usize| {
        let at = ((i as f32 + 0.5) / 2.0 - 0.5).max(0.0);
        let first = at as usize;
        (first, (first + 1).min(side - 1), at - first as f32)
    };
    let mut out = Vec::with_capacity(4 * planes.len());
    for plane in planes.chunks_exact(width * height) {
        for y in 0..2 * height {
            let (top, bottom, down) = between(y, height);
            for x in 0..2 * width {
                let (left, right, across) = between(x, width);
                let row = |y: usize| {
                    let (a, b) = (plane[y * width + left], plane[y * width + right]);
                    a + across * (b - a)
                };
                out.push(row(top) + down * (row(bottom) - row(top)));
            }
        }
    }
    out
}
