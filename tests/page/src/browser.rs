//! Chromium under chromedriver, one of each for a test.

use std::future::Future;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, bail};
use serde_json::json;
use tempfile::TempDir;
use thirtyfour::prelude::*;
use thirtyfour::{ChromiumLikeCapabilities, LoggingPrefsLogLevel};

use crate::page::Page;
use crate::server::SiteServer;

/// Opens the page in a fresh browser, runs a test on it, and checks at its end that the browser logged no error and that
/// every request went to the page's own origin.
///
/// # Errors
/// The set-up or the test failed.
pub async fn with_page<F, T>(test: F) -> Result<()>
where
    F: FnOnce(Page) -> T,
    T: Future<Output = Result<()>> + Send + 'static,
{
    let server = SiteServer::start(crate::given("TRACKLENS_SITE")?)?;
    let chromedriver = Chromedriver::start()?;
    let folder = TempDir::with_prefix("tracklens-page-")?;
    let driver = WebDriver::new(&chromedriver.address, capabilities(&folder)?)
        .await
        .context("chromedriver cannot start Chromium")?;
    let page = Page::open(driver.clone(), &server.origin, folder.path().join("downloads")).await;
    // In a task of its own, so that the browser is closed after a panic too.
    let result = match page {
        Ok(page) => {
            let run = tokio::spawn(test(page.clone())).await;
            match run {
                Ok(Ok(())) => page.check_log().await,
                Ok(Err(error)) => Err(error.context(page.describe().await)),
                Err(panic) => Err(anyhow::anyhow!("{panic}").context(page.describe().await)),
            }
        }
        Err(error) => Err(error),
    };
    let closed = driver.quit().await;
    result?;
    closed.context("the browser cannot be closed")
}

fn capabilities(folder: &TempDir) -> Result<ChromeCapabilities> {
    let mut capabilities = DesiredCapabilities::chrome();
    for argument in [
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--disable-dev-shm-usage",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--window-size=1280,1000",
    ] {
        capabilities.add_arg(argument)?;
    }
    capabilities.add_arg(&format!("--user-data-dir={}", folder.path().join("profile").display()))?;
    let downloads = folder.path().join("downloads");
    std::fs::create_dir(&downloads)?;
    capabilities.add_experimental_option(
        "prefs",
        json!({ "download.default_directory": downloads, "download.prompt_for_download": false }),
    )?;
    capabilities.set_logging_prefs("browser", LoggingPrefsLogLevel::All)?;
    capabilities.set_logging_prefs("performance", LoggingPrefsLogLevel::All)?;
    Ok(capabilities)
}

/// A chromedriver on a port of its own; ends with the value.
struct Chromedriver {
    process: Child,
    address: String,
}

impl Chromedriver {
    fn start() -> Result<Self> {
        let mut process = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .context("chromedriver cannot be started; `cargo xtask setup --browsers` installs it")?;
        let mut lines = BufReader::new(process.stdout.take().context("chromedriver has no output")?).lines();
        // It says which port it took: "ChromeDriver was started successfully on port 12345."
        let port = lines.by_ref().find_map(|line| {
            let line = line.ok()?;
            let (_, port) = line.split_once("successfully on port ")?;
            port.trim_end_matches('.').parse::<u16>().ok()
        });
        let Some(port) = port else {
            // It may be gone already.
            let _ = process.kill();
            bail!("chromedriver did not say on which port it listens");
        };
        // It must not block on a full pipe.
        std::thread::spawn(move || lines.for_each(drop));
        Ok(Self { process, address: format!("http://127.0.0.1:{port}") })
    }
}

impl Drop for Chromedriver {
    fn drop(&mut self) {
        // Ended already is as good.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
