use std::collections::{BTreeMap, BTreeSet};

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;

use crate::checkpoint::{Checkpoint, SIGMA, SaeConfig, TEMPERATURE, Tensor, read_tensors};
use crate::error::{Error, Result};

/// The weights of an untrained SAE, drawn on the host: the same seed gives the same weights on
/// every device.
///
/// The distributions are PyTorch's defaults: convolutions, dense layers and their biases uniform in
/// ±1/√(fan-in), batch norm scale 1 and offset 0. σ and temperature start at the configured value,
/// the background at 0 (paper, appendix, "Modifications"). The first convolution of a DSAE is drawn
/// as the others; [`load_first_layer`] takes it from a DenseNet-201, as the authors' code does.
pub fn fresh_weights(config: &SaeConfig, seed: u64) -> Checkpoint {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut tensors = BTreeMap::new();
    let mut fan_in = 1;
    for (name, shape) in config.tensor_shapes() {
        let count = shape.iter().product();
        // A bias has the fan-in of its weight, which comes right before it.
        let is_weight = matches!(shape.len(), 2 | 4);
        let is_drawn_bias = name.ends_with("aggregate_conv.bias") || name.ends_with("dense.bias");
        if is_weight {
            fan_in = shape[1..].iter().product();
        }
        let data = if is_weight || is_drawn_bias {
            let bound = 1.0 / (fan_in as f32).sqrt();
            (0..count)
                .map(|_| rng.random_range(-bound..=bound))
                .collect()
        } else if name == SIGMA {
            vec![config.sigma as f32; count]
        } else if name == TEMPERATURE {
            vec![config.temperature as f32; count]
        } else if name.ends_with(".bias") || name.ends_with(".running_mean") {
            vec![0.0; count]
        } else {
            vec![1.0; count]
        };
        tensors.insert(name, Tensor { shape, data });
    }
    Checkpoint {
        config: config.clone(),
        tensors,
        metadata: BTreeMap::new(),
    }
}

/// How sharp the attention of the first and of the last keypoint is in a [`pointwise_encoder`].
const SHARPNESS: [f64; 2] = [0.5, 5.0];

/// Draws the encoder of an untrained SAE anew, as a filter of colours.
///
/// Every convolution becomes a random orthogonal 1 x 1 convolution in the middle of its kernel, zero
/// around it (a delta-orthogonal start: Xiao et al., "Dynamical Isometry and a Mean Field Theory of
/// CNNs", ICML 2018); its bias is 0. The maps then have the resolution of their cells from the first
/// step on, and a keypoint attends to a colour wherever it is in the image. Convolutions drawn as
/// PyTorch draws them average over all that their kernels see, in which an object of few pixels is
/// lost. The second convolution of a block starts as the identity: drawn as well, it would mix
/// colours that the first one has told apart.
///
/// The first convolution sees colours multiplied by `colors`, a matrix that makes them vary alike in
/// all directions, so that small coloured objects count as much as large grey ones. The filters of
/// the maps have lengths from 0.5 to 5, in geometric steps: keypoints with long ones attend to single
/// cells, as the smallest objects need it, those with short ones to the middle of large parts.
///
/// Batch norms and the decoder stay as they are.
///
/// # Errors
/// When a tensor of the encoder is missing.
pub fn pointwise_encoder(
    weights: &mut Checkpoint,
    colors: &[[f64; 3]; 3],
    seed: u64,
) -> Result<()> {
    // Other numbers than those that the decoder was drawn from.
    let mut rng = StdRng::seed_from_u64(!seed);
    let layers = weights.config.encoder_layers();
    for (i, layer) in layers.iter().enumerate() {
        let (rows, columns) = (layer.outputs, layer.inputs);
        let mut filters = match layer.is_second_in_block() {
            true => identity(rows),
            false => orthogonal(rows, columns, &mut rng),
        };
        if i == 0 {
            for filter in filters.chunks_exact_mut(columns) {
                let of = |j: usize| (0..3).map(|k| filter[k] * colors[k][j]).sum();
                let product: [f64; 3] = [of(0), of(1), of(2)];
                filter.copy_from_slice(&product);
            }
        }
        if layer.norm.is_none() {
            let [first, last] = SHARPNESS;
            let steps = (rows.max(2) - 1) as f64;
            for (n, filter) in filters.chunks_exact_mut(columns).enumerate() {
                let length = first * (last / first).powf(n as f64 / steps);
                // Where there are more maps than inputs, rows are shorter than 1.
                let own = filter.iter().map(|v| v * v).sum::<f64>().sqrt();
                for value in filter {
                    *value *= length / own.max(1e-6);
                }
            }
        }
        let side = layer.kernel;
        let centre = side * (side / 2) + side / 2;
        let weight = weights.tensor_mut(&format!("{}.weight", layer.name))?;
        weight.data.fill(0.0);
        for (kernel, value) in weight.data.chunks_exact_mut(side * side).zip(filters) {
            kernel[centre] = value as f32;
        }
        if layer.norm.is_none() {
            let bias = weights.tensor_mut(&format!("{}.bias", layer.name))?;
            bias.data.fill(0.0);
        }
    }
    Ok(())
}

/// The identity of `size` rows, row by row.
fn identity(size: usize) -> Vec<f64> {
    (0..size * size)
        .map(|i| f64::from(u8::from(i % (size + 1) == 0)))
        .collect()
}

/// A random matrix with orthonormal rows or columns, whichever are fewer: row by row, `rows` x
/// `columns`.
fn orthogonal(rows: usize, columns: usize, rng: &mut StdRng) -> Vec<f64> {
    let (count, size) = (rows.min(columns), rows.max(columns));
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(count);
    while basis.len() < count {
        let mut vector: Vec<f64> = (0..size).map(|_| rng.sample(StandardNormal)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // Twice: the first time leaves rounding errors of the length that is taken away.
        for other in basis.iter().chain(&basis) {
            let along = dot(&vector, other);
            for (value, other) in vector.iter_mut().zip(other) {
                *value -= along * other;
            }
        }
        let length = dot(&vector, &vector).sqrt();
        if length > 1e-6 {
            basis.push(vector.into_iter().map(|value| value / length).collect());
        }
    }
    (0..rows * columns)
        .map(|i| (i / columns, i % columns))
        .map(|(row, column)| match rows <= columns {
            true => basis[row][column],
            false => basis[column][row],
        })
        .collect()
}

/// Gives an untrained SAE the first convolution of a trained network, as the authors' DSAE has that
/// of a DenseNet-201 trained on ImageNet (their code; the paper does not say so); returns the name
/// of the tensor that was taken.
///
/// `file` holds the weights of any network, in any format that checkpoints come in. Taken is the
/// tensor with the name that the SAE's own first convolution has, else torchvision's name in a
/// DenseNet (`features.conv0.weight`), else the only one of its shape: filters x 3 x side x side.
///
/// # Errors
/// When the bytes are not a file of weights, or it has no such tensor, several, or one that is not
/// finite.
pub fn load_first_layer(weights: &mut Checkpoint, file: &[u8]) -> Result<String> {
    const DENSENET: &str = "features.conv0.weight";
    let layers = weights.config.encoder_layers();
    let own = layers
        .first()
        .map(|layer| format!("{}.weight", layer.name))
        .ok_or_else(|| Error::input("the encoder has no convolution"))?;
    let shape = weights.tensor(&own)?.shape.clone();
    let mut found = read_tensors(file)?;
    let fitting: Vec<String> = found
        .iter()
        .filter(|(_, tensor)| tensor.shape == shape)
        .map(|(name, _)| name.clone())
        .collect();
    let named = [&own, DENSENET]
        .into_iter()
        .find(|name| fitting.iter().any(|f| f == name));
    let name = match (named, fitting.as_slice()) {
        (Some(name), _) => name.to_owned(),
        (None, [only]) => only.clone(),
        (None, several) => {
            let count = match several.len() {
                0 => format!("none of its {} tensors has", found.len()),
                n => format!("{n} of its tensors ({}, …) have", several[0]),
            };
            return Err(Error::mismatch(format!(
                "{count} the shape {shape:?} of the first convolution; expected one, best named `{DENSENET}` as in \
                 torchvision's DenseNet-201"
            )));
        }
    };
    let tensor = found
        .remove(&name)
        .ok_or_else(|| Error::input("the tensor is gone"))?;
    if let Some(value) = tensor.data.iter().find(|v| !v.is_finite()) {
        return Err(Error::input(format!(
            "tensor `{name}` holds {value}; the weights are damaged"
        )));
    }
    weights.tensors.insert(own, tensor);
    Ok(name)
}

/// Gives an untrained SAE every weight of a trained one, encoder and decoder, for a training that
/// goes on from it on other recordings, another input size or another learning rate.
///
/// `file` is a checkpoint in any format. Its tensors must have the names and shapes of `weights`,
/// which depend on the family, the channels, the kernels, the number of keypoints, `-std` and
/// `-bg`, and, for the background, the target size.
///
/// # Errors
/// When the bytes are not a checkpoint, it holds only an encoder, or a tensor is missing, is one
/// too many or has another shape.
pub fn load_weights(weights: &mut Checkpoint, file: &[u8]) -> Result<()> {
    let trained = Checkpoint::from_bytes(file)?;
    if !trained.has_decoder() {
        return Err(Error::mismatch(
            "the checkpoint holds an encoder alone; expected a decoder too, as in checkpoint_best.safetensors of a run",
        ));
    }
    let [own, its] =
        [&weights.config, &trained.config].map(|c| BTreeMap::from_iter(c.tensor_shapes()));
    let names: BTreeSet<&String> = own.keys().chain(its.keys()).collect();
    if let Some(name) = names
        .into_iter()
        .find(|name| own.get(*name) != its.get(*name))
    {
        let [own, its] = [&own, &its].map(|shapes| match shapes.get(name) {
            Some(shape) => format!("the shape {shape:?}"),
            None => "no such tensor".to_owned(),
        });
        return Err(Error::mismatch(format!(
            "the checkpoint is a {} with {its} for `{name}`; expected {own}, for the {} to train: give the same \
             architecture and sizes (`tracklens inspect` says those of the checkpoint)",
            trained.config.name(),
            weights.config.name()
        )));
    }
    let layers = trained.config.encoder_layers();
    let mut strides = weights.config.encoder_layers().into_iter().zip(layers);
    if let Some((to_train, found)) = strides.find(|(a, b)| a.stride != b.stride) {
        return Err(Error::mismatch(format!(
            "the checkpoint has stride {} at `{}`; expected {}, as in the encoder to train: give the same encoder \
             strides",
            found.stride, found.name, to_train.stride
        )));
    }
    weights.tensors = trained.tensors;
    weights.tensors.retain(|name, _| own.contains_key(name));
    Ok(())
}
