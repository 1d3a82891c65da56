//! Mesa's lavapipe: Vulkan on the CPU, for the tests of the GPU.

use std::env::consts::OS;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};

use super::install::Package;

const LAVAPIPE: Package = Package {
    what: "lavapipe, Mesa's Vulkan on the CPU",
    apt: &["mesa-vulkan-drivers", "libvulkan1"],
    elsewhere: &[
        ("dnf", "sudo dnf install mesa-vulkan-drivers vulkan-loader"),
        ("pacman", "sudo pacman -S vulkan-swrast vulkan-icd-loader"),
        (
            "zypper",
            "sudo zypper install Mesa-vulkan-drivers libvulkan1",
        ),
    ],
    otherwise: "or run `cargo xtask test` without the part `gpu`",
};

/// Where distributions keep the descriptions of Vulkan drivers.
const DRIVERS: [&str; 2] = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"];

/// The description of lavapipe for the Vulkan loader, after an installation if there is none. None
/// where there is no lavapipe: macOS and Windows bring a driver of their own.
///
/// # Errors
/// It is missing and cannot be installed; says what to do.
pub fn lavapipe() -> Result<Option<PathBuf>> {
    if OS != "linux" {
        return Ok(None);
    }
    if let Some(driver) = installed() {
        return Ok(Some(driver));
    }
    LAVAPIPE.install()?;
    installed().map(Some).with_context(|| {
        format!(
            "{} is installed, but not in {}",
            LAVAPIPE.what,
            DRIVERS.join(" or ")
        )
    })
}

fn installed() -> Option<PathBuf> {
    let entries = DRIVERS
        .iter()
        .filter_map(|folder| fs::read_dir(folder).ok());
    let drivers = entries.flat_map(|folder| folder.flatten().map(|entry| entry.path()));
    let is_lavapipe = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("lvp_icd") && name.ends_with(".json")
    };
    drivers.filter(is_lavapipe).min()
}
