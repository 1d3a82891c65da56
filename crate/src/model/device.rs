//! Devices that are ready for use.

use burn::prelude::Device;

use crate::device::{Adapter, DeviceKind};
use crate::error::Result;

/// A device that is ready for use.
#[derive(Debug, Clone)]
pub struct OpenDevice {
    /// What burn's tensors live on.
    pub device: Device,
    /// What runs them; none on the CPU.
    pub adapter: Option<Adapter>,
}

/// Opens a device. A GPU is opened once a process; later calls give the same.
///
/// # Errors
/// For a GPU, when the build has no support for one (feature `gpu`), or there is none (with what
/// was looked for).
pub fn open(kind: DeviceKind) -> Result<OpenDevice> {
    match kind {
        DeviceKind::Cpu => Ok(OpenDevice {
            device: Device::flex(),
            adapter: None,
        }),
        #[cfg(feature = "gpu")]
        DeviceKind::Gpu => gpu::open(),
        #[cfg(not(feature = "gpu"))]
        DeviceKind::Gpu => Err(crate::device::built_without_gpu()),
    }
}

#[cfg(feature = "gpu")]
mod gpu {
    use std::sync::OnceLock;

    use burn::prelude::Device;
    use burn::tensor::wgpu::WgpuInitError;
    use burn::tensor::wgpu::wgpu::{AdapterInfo, Backend, DeviceType};

    use super::OpenDevice;
    use crate::device::Adapter;
    use crate::error::{Error, Result};

    /// The graphics APIs that are asked, the first one with a real GPU wins.
    const APIS: &str = if cfg!(target_os = "macos") {
        "Metal"
    } else {
        "Vulkan, Direct3D 12 or OpenGL"
    };

    pub(super) fn open() -> Result<OpenDevice> {
        // burn's runtime refuses to be set up twice.
        static OPENED: OnceLock<Result<OpenDevice>> = OnceLock::new();
        OPENED
            .get_or_init(|| {
                let (device, setup) = Device::wgpu_options()
                    .init_with_setup()
                    .map_err(|e| explain(&e))?;
                Ok(OpenDevice {
                    device,
                    adapter: Some(describe(setup.adapter.get_info())),
                })
            })
            .clone()
    }

    fn explain(error: &WgpuInitError) -> Error {
        Error::input(match error {
            WgpuInitError::AdapterUnavailable { .. } => format!(
                "no GPU found; looked for one with a driver for {APIS}: install the driver, or use the device cpu"
            ),
            other => format!("the GPU cannot be used: {other}; use the device cpu"),
        })
    }

    fn describe(info: AdapterInfo) -> Adapter {
        let api = match info.backend {
            Backend::Vulkan => "Vulkan",
            Backend::Metal => "Metal",
            Backend::Dx12 => "Direct3D 12",
            Backend::Gl => "OpenGL",
            Backend::BrowserWebGpu => "WebGPU",
            Backend::Noop => "no API",
        };
        let driver = [info.driver, info.driver_info].join(" ");
        Adapter {
            name: info.name,
            api: api.to_owned(),
            driver: driver.trim().to_owned(),
            software: info.device_type == DeviceType::Cpu,
        }
    }
}
