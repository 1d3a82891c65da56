//! Chromium and chromedriver, for the tests of the page.

use std::env::consts::OS;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use super::install::Package;
use crate::run;

const BROWSERS: Package = Package {
    what: "Chromium and chromedriver",
    apt: &["chromium", "chromium-driver"],
    elsewhere: &[
        ("brew", "brew install --cask google-chrome chromedriver"),
        ("dnf", "sudo dnf install chromium chromedriver"),
        ("pacman", "sudo pacman -S chromium"),
        ("zypper", "sudo zypper install chromium chromedriver"),
    ],
    otherwise: "Chrome and the chromedriver of the same version are at \
                https://googlechromelabs.github.io/chrome-for-testing; put chromedriver on the path",
};

/// The names of Chromium and Chrome on the path, then where they are installed outside of it.
const NAMES: [&str; 5] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
];
const PLACES: [&str; 4] = [
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Google\Chrome\Application\chrome.exe",
];

/// Finds a Chromium and a chromedriver of the same version, or installs them; returns the browser.
///
/// # Errors
/// They are missing and cannot be installed, or their versions differ; says what to do.
pub fn browsers() -> Result<PathBuf> {
    let (browser, driver) = match find() {
        Some(found) => found,
        None => {
            BROWSERS.install()?;
            find().context("Chromium and chromedriver are installed, but not on the path")?
        }
    };
    let driver_version = run::output(run::command(&driver).arg("--version"))?;
    eprintln!("chromedriver: {} ({})", driver.display(), driver_version.trim());
    if OS == "windows" {
        // There, `--version` opens a window.
        eprintln!("browser: {}", browser.display());
        return Ok(browser);
    }
    let browser_version = run::output(run::command(&browser).arg("--version"))?;
    eprintln!("browser: {} ({})", browser.display(), browser_version.trim());
    if major(&browser_version) != major(&driver_version) {
        bail!(
            "the browser and chromedriver are of different versions ({} and {}); {}",
            browser_version.trim(),
            driver_version.trim(),
            BROWSERS.otherwise
        );
    }
    Ok(browser)
}

fn find() -> Option<(PathBuf, PathBuf)> {
    let on_path = NAMES.iter().find_map(|name| which::which(name).ok());
    let elsewhere = || PLACES.iter().map(PathBuf::from).find(|file| file.exists());
    Some((on_path.or_else(elsewhere)?, which::which("chromedriver").ok()?))
}

/// The first part of the first word that starts with a digit: 156 of `Chromium 156.0.8078.79 built on …`.
fn major(version: &str) -> Option<u32> {
    let number = version
        .split_whitespace()
        .find(|word| word.starts_with(|c: char| c.is_ascii_digit()))?;
    number.split('.').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_major_version_is_found_in_what_browsers_and_drivers_print() {
        assert_eq!(
            major("Chromium 156.0.8078.79 built on Debian GNU/Linux 12 (bookworm)\n"),
            Some(156)
        );
        assert_eq!(major("Google Chrome 149.0.1.2 \n"), Some(149));
        assert_eq!(
            major("ChromeDriver 156.0.8078.79 (a21ce95-refs/branch-heads/8078@{#1704})"),
            Some(156)
        );
        assert_eq!(major("no number"), None);
    }
}
