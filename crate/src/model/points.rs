//! Latent points and other tensors on the host.

use std::fmt;

use burn::prelude::{Tensor, TensorData};
use ndarray::Array3;

use crate::error::{Error, ErrorKind, Result};

/// Latent points `[B, N, 2]`, (y, x) on the device, as B x N x 2, (x, y) on the host.
///
/// # Errors
/// When the device does not give the values back.
pub fn points_xy(latent: Tensor<3>) -> Result<Array3<f64>> {
    let shape = latent.dims();
    host_points(&host_values(latent)?, shape)
}

/// As [`points_xy`]; the thread does not wait for the device, which a browser does not allow.
///
/// # Errors
/// When the device does not give the values back.
pub async fn points_xy_async(latent: Tensor<3>) -> Result<Array3<f64>> {
    let shape = latent.dims();
    let data = latent.into_data_async().await.map_err(device_failed)?;
    host_points(&floats(data)?, shape)
}

fn host_points(yx: &[f32], [batch, points, _]: [usize; 3]) -> Result<Array3<f64>> {
    let values = yx
        .chunks_exact(2)
        .flat_map(|p| [f64::from(p[1]), f64::from(p[0])])
        .collect();
    Array3::from_shape_vec((batch, points, 2), values)
        .map_err(|e| Error::numeric(format!("the device returned points of another shape: {e}")))
}

/// The f32 values of a tensor, read back from its device.
pub(crate) fn host_values<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>> {
    floats(tensor.try_into_data().map_err(device_failed)?)
}

fn floats(data: TensorData) -> Result<Vec<f32>> {
    data.try_into_vec::<f32>()
        .map_err(|e| Error::numeric(format!("the device returned no f32 values: {e:?}")))
}

fn device_failed(error: impl fmt::Display) -> Error {
    Error::new(ErrorKind::Io, format!("the device failed: {error}"))
}
