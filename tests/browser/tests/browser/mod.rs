//! A site, a driver and a browser for one test.

// Every file of tests is a program of its own and uses a part of this.
#![allow(dead_code)]

use std::future::ready;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::extract::Request;
use axum::middleware::map_request;
use serde_json::{Value, json};
use thirtyfour::prelude::*;
use tower_http::services::ServeDir;

/// Longer than anything takes on a busy machine; a test that waits this long has failed.
const PATIENCE: Duration = Duration::from_secs(60);

/// What the page may not do unnoticed: errors, rejected promises, console errors, violations of its policy.
const WATCH: &str = r#"
  globalThis.__complaints = [];
  const complain = (text) => globalThis.__complaints.push(String(text));
  addEventListener("error", (e) => complain(e.message));
  addEventListener("unhandledrejection", (e) => complain(e.reason));
  document.addEventListener("securitypolicyviolation", (e) => complain(`${e.violatedDirective}: ${e.blockedURI}`));
  const error = console.error;
  console.error = (...all) => { complain(all.join(" ")); error(...all); };
"#;

/// The built page, open in a browser of its own.
pub struct Page {
    pub driver: WebDriver,
    origin: String,
    asked: Asked,
    chromedriver: Child,
    profile: tempfile::TempDir,
}

/// What was asked of the server, path by path.
type Asked = Arc<Mutex<Vec<String>>>;

/// The folder of the built site.
pub fn site() -> PathBuf {
    from_environment("TRACKLENS_SITE")
}

/// A file or folder of the site's example.
pub fn example(name: &str) -> PathBuf {
    site().join("example").join(name)
}

/// What the `tracklens` command prints.
pub fn tracklens(arguments: &[&str]) -> Vec<u8> {
    let binary = from_environment("TRACKLENS_BIN");
    let output = Command::new(&binary)
        .args(arguments)
        .output()
        .expect("the binary runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    output.stdout
}

fn from_environment(name: &str) -> PathBuf {
    let Some(path) = std::env::var_os(name) else {
        panic!("{name} is not set; run `cargo xtask test`, which builds the site and the binary first");
    };
    PathBuf::from(path)
}

/// Serves the site on a free port of the loopback for as long as the runtime of the test lives, and with it what tests put
/// in the place of a script.
async fn serve(site: PathBuf, asked: Asked) -> String {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0")
        .await
        .expect("a free port");
    let address = listener.local_addr().expect("an address");
    let hooks = Path::new(env!("CARGO_MANIFEST_DIR")).join("hooks");
    let files = ServeDir::new(site).fallback(ServeDir::new(hooks));
    let note = move |request: Request| {
        asked
            .lock()
            .expect("no test panicked in between")
            .push(request.uri().path().to_owned());
        ready(request)
    };
    let router = axum::Router::new()
        .fallback_service(files)
        .layer(map_request(note));
    tokio::spawn(async move { axum::serve(listener, router).await });
    format!("http://{address}")
}

impl Page {
    /// Opens the page and waits until it is ready.
    pub async fn open() -> Self {
        Self::open_with("").await
    }

    /// Opens the page after a script that changes what it finds in its browser.
    pub async fn open_with(script: &str) -> Self {
        Self::open_at("", &[], script).await
    }

    /// Opens the page with a query, in a browser with further arguments, after a script.
    pub async fn open_at(query: &str, arguments: &[&str], script: &str) -> Self {
        let asked = Asked::default();
        let origin = serve(site(), Arc::clone(&asked)).await;
        let port = TcpListener::bind("127.0.0.1:0")
            .and_then(|l| l.local_addr())
            .expect("a free port")
            .port();
        let chromedriver = Command::new("chromedriver")
            .arg(format!("--port={port}"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("chromedriver starts; `cargo xtask setup --browsers` installs it");
        let profile = tempfile::tempdir().expect("a profile");
        let mut capabilities = DesiredCapabilities::chrome();
        for argument in [
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
        ] {
            capabilities.add_arg(argument).expect("an argument");
        }
        for argument in arguments {
            capabilities.add_arg(argument).expect("an argument");
        }
        let start = Instant::now();
        let driver = loop {
            match WebDriver::new(format!("http://127.0.0.1:{port}"), capabilities.clone()).await {
                Ok(driver) => break driver,
                Err(e) if start.elapsed() > PATIENCE => panic!("no browser: {e}"),
                Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
            }
        };
        let page = Self {
            driver,
            origin,
            asked,
            chromedriver,
            profile,
        };
        let watch = json!({ "source": format!("{WATCH}\n{script}") });
        page.driver
            .cdp()
            .send_raw("Page.addScriptToEvaluateOnNewDocument", watch)
            .await
            .expect("a watch");
        let address = format!("{}/{query}", page.origin);
        page.driver.goto(address).await.expect("the page");
        page.until("!document.querySelector('#try-example').disabled")
            .await;
        page
    }

    /// Whether this path was asked for.
    pub fn asked_for(&self, path: &str) -> bool {
        let asked = self.asked.lock().expect("no test panicked in between");
        asked.iter().any(|other| other == path)
    }

    /// The folder of the browser's profile, which its processes name.
    pub fn profile(&self) -> &Path {
        self.profile.path()
    }

    /// The value of a JavaScript expression.
    pub async fn value(&self, expression: &str) -> Value {
        let script = format!("return ({expression});");
        let found = self.driver.execute(script, vec![]).await;
        found
            .unwrap_or_else(|e| panic!("{expression}: {e}"))
            .json()
            .clone()
    }

    /// The value of an expression as a number.
    pub async fn number(&self, expression: &str) -> f64 {
        let value = self.value(&format!("Number({expression})")).await;
        value
            .as_f64()
            .unwrap_or_else(|| panic!("{expression} is {value}"))
    }

    /// Waits until an expression is true.
    pub async fn until(&self, expression: &str) {
        let start = Instant::now();
        while self.value(&format!("Boolean({expression})")).await != Value::Bool(true) {
            if start.elapsed() > PATIENCE {
                let shown = self.value("document.querySelector('main').innerText").await;
                let complaints = self.value("globalThis.__complaints").await;
                let shown = shown.as_str().unwrap_or_default();
                panic!("waited in vain for {expression}; complaints: {complaints}; the page shows:\n{shown}");
            }
            tokio::time::sleep(Duration::from_millis(40)).await;
        }
    }

    /// Waits until the page shows a text.
    pub async fn until_text(&self, text: &str) {
        let quoted = Value::from(text);
        self.until(&format!(
            "document.querySelector('main').textContent.includes({quoted})"
        ))
        .await;
    }

    pub async fn click(&self, selector: &str) {
        self.until(&format!(
            "document.querySelector({0})?.disabled === false",
            Value::from(selector)
        ))
        .await;
        let element = self.driver.find(By::Css(selector)).await.expect("an element");
        element.scroll_into_view().await.expect("in view");
        element
            .click()
            .await
            .unwrap_or_else(|e| panic!("{selector}: {e}"));
    }

    /// Picks files in the page's own input.
    pub async fn pick(&self, files: &[&Path]) {
        let paths: Vec<String> = files.iter().map(|f| f.to_string_lossy().into_owned()).collect();
        self.input("#input-files", &paths.join("\n")).await;
    }

    /// Picks a folder in the page's own input.
    pub async fn pick_folder(&self, folder: &Path) {
        self.input("#input-folder", &folder.to_string_lossy()).await;
    }

    async fn input(&self, selector: &str, paths: &str) {
        let input = self.driver.find(By::Css(selector)).await.expect("an input");
        input
            .send_keys(paths)
            .await
            .unwrap_or_else(|e| panic!("{selector}: {e}"));
    }

    pub async fn until_scored(&self) {
        self.until("document.querySelector('#results').dataset.tc !== undefined")
            .await;
    }

    /// Nothing went wrong behind the scenes, and nothing was asked of anyone but the page's own server.
    pub async fn close(mut self) {
        let complaints = self.value("globalThis.__complaints").await;
        assert_eq!(complaints, json!([]));
        let others = "performance.getEntriesByType('resource').map((r) => r.name).filter((n) => \
                      !n.startsWith(location.origin + '/') && !n.startsWith('blob:' + location.origin))";
        assert_eq!(self.value(others).await, json!([]));
        self.driver.clone().quit().await.expect("the browser ends");
        self.stop();
    }

    fn stop(&mut self) {
        // It may have ended by itself.
        let _ = self.chromedriver.kill();
        let _ = self.chromedriver.wait();
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.stop();
    }
}
