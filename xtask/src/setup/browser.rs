//! Chromium and Firefox with their drivers, for the tests of the page.

use std::env::consts::OS;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use super::install::Package;
use crate::run;
use crate::workspace::Workspace;

const CHROMIUM: Package = Package {
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

const FIREFOX: Package = Package {
    what: "Firefox",
    apt: &["firefox-esr"],
    elsewhere: &[
        ("brew", "brew install --cask firefox"),
        ("dnf", "sudo dnf install firefox"),
        ("pacman", "sudo pacman -S firefox"),
        ("zypper", "sudo zypper install MozillaFirefox"),
    ],
    otherwise: "Firefox is at https://www.mozilla.org/firefox",
};

/// Firefox's driver, which few systems have a package of.
const GECKODRIVER: &str = "0.37.1";

/// Where Firefox is installed outside of the path.
const FIREFOX_PLACES: [&str; 2] = [
    "/Applications/Firefox.app/Contents/MacOS/firefox",
    r"C:\Program Files\Mozilla Firefox\firefox.exe",
];

/// Finds the browsers and their drivers or installs them, and returns the path of geckodriver.
///
/// # Errors
/// One is missing and cannot be installed, or versions do not fit; says what to do.
pub fn browsers(workspace: &Workspace) -> Result<PathBuf> {
    chromium()?;
    firefox(workspace)
}

/// Finds Firefox or installs it, and builds its driver once into cargo's target directory.
fn firefox(workspace: &Workspace) -> Result<PathBuf> {
    let elsewhere = FIREFOX_PLACES
        .iter()
        .map(PathBuf::from)
        .find(|file| file.exists());
    let browser = match which::which("firefox").ok().or(elsewhere) {
        Some(found) => found,
        None => FIREFOX.program("firefox")?,
    };
    let root = workspace.tools().join("geckodriver");
    let driver = root
        .join("bin")
        .join(format!("geckodriver{}", std::env::consts::EXE_SUFFIX));
    let version = |driver: &PathBuf| run::output(run::command(driver).arg("--version"));
    let built =
        driver.exists() && version(&driver)?.starts_with(&format!("geckodriver {GECKODRIVER} "));
    if !built {
        let mut cargo = run::cargo();
        cargo
            .args(["install", "geckodriver", "--locked", "--force"])
            .args(["--version", GECKODRIVER, "--root"])
            .arg(&root)
            .arg("--target-dir")
            .arg(root.join("build"));
        run::run(&mut cargo)?;
    }
    eprintln!("browser: {}", browser.display());
    eprintln!("geckodriver: {}", driver.display());
    Ok(driver)
}

/// Finds a Chromium and a chromedriver of the same version, or installs them; returns the browser.
///
/// # Errors
/// They are missing and cannot be installed, or their versions differ; says what to do.
pub fn chromium() -> Result<PathBuf> {
    let (browser, driver) = match find() {
        Some(found) => found,
        None => {
            CHROMIUM.install()?;
            find().context("Chromium and chromedriver are installed, but not on the path")?
        }
    };
    let driver_version = run::output(run::command(&driver).arg("--version"))?;
    eprintln!(
        "chromedriver: {} ({})",
        driver.display(),
        driver_version.trim()
    );
    if OS == "windows" {
        // There, `--version` opens a window.
        eprintln!("browser: {}", browser.display());
        return Ok(browser);
    }
    let browser_version = run::output(run::command(&browser).arg("--version"))?;
    eprintln!(
        "browser: {} ({})",
        browser.display(),
        browser_version.trim()
    );
    if major(&browser_version) != major(&driver_version) {
        bail!(
            "the browser and chromedriver are of different versions ({} and {}); {}",
            browser_version.trim(),
            driver_version.trim(),
            CHROMIUM.otherwise
        );
    }
    Ok(browser)
}

fn find() -> Option<(PathBuf, PathBuf)> {
    let on_path = NAMES.iter().find_map(|name| which::which(name).ok());
    let elsewhere = || PLACES.iter().map(PathBuf::from).find(|file| file.exists());
    Some((
        on_path.or_else(elsewhere)?,
        which::which("chromedriver").ok()?,
    ))
}

/// The first part of the first word that starts with a digit: 156 of `Chromium 156.0.8078.79 built
/// on …`.
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
