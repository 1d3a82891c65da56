//! The device that computes, as the terminal shows it.

use crate::device::DeviceKind;
use crate::error::Result;
use crate::model::{OpenDevice, open};

/// Opens a device and prints which GPU it is, if it is one.
pub(super) fn open_and_tell(kind: DeviceKind) -> Result<OpenDevice> {
    let opened = open(kind)?;
    if let Some(adapter) = &opened.adapter {
        eprintln!("device: {adapter}");
        if adapter.software {
            eprintln!(
                "warning: no real GPU was found; this one is emulated on the CPU and slower than --device cpu"
            );
        }
    }
    Ok(opened)
}
