//! The browsers, each with a driver of its own.

use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use thirtyfour::common::capabilities::firefox::FirefoxPreferences;
use thirtyfour::prelude::*;

/// What the page is tested in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Browser {
    /// Chromium through chromedriver.
    Chromium,
    /// Firefox through geckodriver.
    Firefox,
}

/// Whether whoever sits in front of a browser wants to see motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Motion {
    /// The page plays what it opens.
    Full,
    /// Nothing plays by itself, which is much of what a browser without a GPU has to do.
    Reduced,
}

/// A driver with one window of a fresh profile; it ends with this value.
pub(crate) struct Session {
    pub driver: WebDriver,
    process: Child,
    pub profile: tempfile::TempDir,
}

/// Longer than a browser needs to start on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

impl Browser {
    pub(crate) async fn start(self, arguments: &[&str], motion: Motion) -> Session {
        let profile = tempfile::tempdir().expect("a profile");
        let capabilities = self.capabilities(&profile, arguments, motion);
        let start = Instant::now();
        let (mut process, mut url) = self.start_driver(&profile);
        let driver = loop {
            match WebDriver::new(&url, capabilities.clone()).await {
                Ok(driver) => break driver,
                Err(e) if start.elapsed() > PATIENCE => {
                    stop(&mut process);
                    panic!("no browser: {e}");
                }
                // Somebody else took the port in the meantime.
                Err(_) if matches!(process.try_wait(), Ok(Some(_))) => {
                    (process, url) = self.start_driver(&profile);
                }
                Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
            }
        };
        Session {
            driver,
            process,
            profile,
        }
    }

    /// Starts the driver on a free port; returns its address, too.
    fn start_driver(self, profile: &tempfile::TempDir) -> (Child, String) {
        let port = TcpListener::bind("127.0.0.1:0")
            .and_then(|l| l.local_addr())
            .expect("a free port")
            .port();
        let process = self
            .driver()
            .arg(format!("--port={port}"))
            .args(self.profile_arguments(profile))
            // Otherwise Firefox writes caches next to its profile.
            .env("HOME", profile.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|e| {
                panic!("{self:?}: {e}; `cargo xtask setup --browsers` installs its driver")
            });
        (process, format!("http://127.0.0.1:{port}"))
    }

    /// Keeps the profile of the browser in the folder of ours, where Chromium's is by its own
    /// argument.
    fn profile_arguments(self, profile: &tempfile::TempDir) -> Option<String> {
        match self {
            Self::Chromium => None,
            Self::Firefox => Some(format!("--profile-root={}", profile.path().display())),
        }
    }

    fn driver(self) -> Command {
        match self {
            Self::Chromium => Command::new("chromedriver"),
            Self::Firefox => {
                let built = std::env::var_os("TRACKLENS_GECKODRIVER").map(PathBuf::from);
                Command::new(built.unwrap_or_else(|| "geckodriver".into()))
            }
        }
    }

    fn capabilities(
        self,
        profile: &tempfile::TempDir,
        arguments: &[&str],
        motion: Motion,
    ) -> Capabilities {
        match self {
            Self::Chromium => {
                let mut chromium = DesiredCapabilities::chrome();
                let usual = [
                    "--headless=new",
                    "--no-sandbox",
                    "--disable-gpu",
                    "--disable-dev-shm-usage",
                    "--disable-quic",
                    "--no-first-run",
                    "--disable-background-networking",
                    "--disable-component-update",
                    "--disable-sync",
                    "--window-size=1280,1000",
                    &format!("--user-data-dir={}", profile.path().display()),
                ];
                let still = match motion {
                    Motion::Full => &[][..],
                    Motion::Reduced => &["--force-prefers-reduced-motion"],
                };
                for argument in usual.iter().chain(still).chain(arguments) {
                    chromium.add_arg(argument).expect("an argument");
                }
                chromium.into()
            }
            Self::Firefox => {
                let mut firefox = DesiredCapabilities::firefox();
                for argument in ["-headless", "--width=1280", "--height=1000"]
                    .iter()
                    .chain(arguments)
                {
                    firefox.add_arg(argument).expect("an argument");
                }
                let mut preferences = FirefoxPreferences::new();
                // It asks several hosts for updates and settings when it starts. Its camera is not a
                // real one and need not be allowed.
                for (name, is_on) in [
                    ("app.normandy.enabled", false),
                    ("network.captive-portal-service.enabled", false),
                    ("network.connectivity-service.enabled", false),
                    ("media.navigator.streams.fake", true),
                    ("media.navigator.permission.disabled", true),
                ] {
                    preferences.set(name, is_on).expect("a preference");
                }
                if motion == Motion::Reduced {
                    let name = "ui.prefersReducedMotion";
                    preferences.set(name, 1).expect("a preference");
                }
                firefox.set_preferences(preferences).expect("preferences");
                firefox.into()
            }
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        stop(&mut self.process);
        // A driver that is killed leaves its browser running, which the profile on its command line
        // gives away.
        #[cfg(unix)]
        let _ = Command::new("pkill")
            .args(["-KILL", "-f", "--"])
            .arg(self.profile.path())
            .status();
    }
}

fn stop(process: &mut Child) {
    // It may have ended by itself.
    let _ = process.kill();
    let _ = process.wait();
}
