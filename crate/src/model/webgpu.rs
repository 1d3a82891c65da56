//! The GPU that a browser offers.

use std::sync::{Arc, OnceLock};

use burn::prelude::Device;
use burn::tensor::wgpu::WgpuInitError;

use crate::error::{Error, ErrorKind, Result};

/// An open WebGPU device.
#[derive(Debug, Clone)]
pub struct WebGpu {
    /// What burn's tensors live on.
    pub device: Device,
    /// Bytes that a tensor may take.
    pub tensor_limit: u64,
    /// The first thing that went wrong on it.
    failure: Arc<OnceLock<String>>,
}

impl WebGpu {
    /// Opens the adapter that the browser prefers for speed. burn can do that once in an instance
    /// of the module.
    ///
    /// # Errors
    /// When there is no adapter, when it gives no device, or when it was opened before.
    pub async fn open() -> Result<Self> {
        let (device, setup) = Device::wgpu_options()
            .init_with_setup_async()
            .await
            .map_err(|e| Error::input(explain(&e)))?;
        let failure = Arc::new(OnceLock::new());
        let first = Arc::clone(&failure);
        // In place of a panic: a shader that is refused leaves its outputs as they were, and
        // nothing else reports it.
        setup.device.on_uncaptured_error(Arc::new(move |error| {
            // Only the first one counts.
            let _ = first.set(error.to_string());
        }));
        let limits = setup.device.limits();
        Ok(Self {
            device,
            tensor_limit: limits
                .max_buffer_size
                .min(limits.max_storage_buffer_binding_size),
            failure,
        })
    }

    /// # Errors
    /// When anything went wrong on the device since it was opened: what it computed may be stale.
    pub fn check(&self) -> Result<()> {
        match self.failure.get() {
            Some(failure) => Err(Error::new(
                ErrorKind::Io,
                format!("the GPU failed: {failure}"),
            )),
            None => Ok(()),
        }
    }
}

fn explain(error: &WgpuInitError) -> String {
    match error {
        WgpuInitError::AdapterUnavailable { .. } => "the browser offers no GPU".to_owned(),
        other => format!("the GPU cannot be used: {other}"),
    }
}
