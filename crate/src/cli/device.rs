//! Saying what computes.

use crate::device::DeviceKind;
use crate::error::Result;
use crate::model::{OpenDevice, open};

/// Opens a device and says which GPU it is, if it is one.
pub(super) fn open_and_tell(kind: DeviceKind) -> Result<OpenDevice> {
    let opened = open(kind)?;
    if let Some(adapter) = &opened.adapter {
        eprintln!("device: {adapter}");
        if adapter.software {
            eprintln!(
                "warning: no real GPU was found; this is a program on the CPU, slower than --device cpu"
            );
        }
    }
    Ok(opened)
}
