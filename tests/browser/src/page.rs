//! The built page, open in a browser.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use thirtyfour::prelude::*;

use crate::browser::{Browser, Motion, Session};
use crate::command::from_environment;
use crate::server::{Server, WATCH};

/// Longer than anything takes on a busy machine; a test that waits this long has failed.
const PATIENCE: Duration = Duration::from_secs(120);

/// The built page, open in a browser of its own.
pub struct Page {
    /// Its driver.
    pub driver: WebDriver,
    /// What serves it.
    pub server: Server,
    session: Session,
}

/// The folder of the built site.
pub fn site() -> PathBuf {
    from_environment("TRACKLENS_SITE")
}

/// Frames of the example.
pub const EXAMPLE_FRAMES: usize = 480;

/// Frames of each of its sequences.
pub const EXAMPLE_LENGTH: usize = 24;

/// Keypoints of the example's checkpoint.
pub const EXAMPLE_KEYPOINTS: usize = 64;

/// A file or folder of the example, as the terminal takes it.
pub fn example(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/example");
    // Chromium takes no `..` in a path.
    let folder = folder.canonicalize().expect("the example");
    folder.join(name)
}

impl Page {
    /// Opens the page in Chromium and waits until it is ready.
    pub async fn open() -> Self {
        Self::open_in(Browser::Chromium).await
    }

    /// Opens the page and waits until it is ready. As in all browsers here but those of
    /// [`open_moving`](Self::open_moving), it plays nothing before it is told to.
    pub async fn open_in(browser: Browser) -> Self {
        Self::open_with_motion(browser, Motion::Reduced).await
    }

    /// Opens the page for somebody who does not mind motion and waits until it is ready.
    pub async fn open_moving(browser: Browser) -> Self {
        Self::open_with_motion(browser, Motion::Full).await
    }

    async fn open_with_motion(browser: Browser, motion: Motion) -> Self {
        let server = match browser {
            Browser::Chromium => Server::start(site(), &[]).await,
            Browser::Firefox => Server::watched(site()).await,
        };
        let page = Self::start(browser, &[], motion, server, "").await;
        page.goto("/").await;
        page.until("!document.querySelector('#try-example').disabled")
            .await;
        page
    }

    /// Opens the page in a browser that has a camera, which nobody has to allow.
    pub async fn open_with_camera(browser: Browser) -> Self {
        if browser == Browser::Firefox {
            return Self::open_in(browser).await;
        }
        let camera = [
            "--use-fake-device-for-media-stream",
            "--use-fake-ui-for-media-stream",
        ];
        let server = Server::start(site(), &[]).await;
        Self::open_prepared(&camera, server, "/", "").await
    }

    /// Opens the page in Chromium after a script that changes what it finds in its browser.
    pub async fn open_with(script: &str) -> Self {
        let page = Self::start(
            Browser::Chromium,
            &[],
            Motion::Reduced,
            Server::start(site(), &[]).await,
            script,
        )
        .await;
        page.goto("/").await;
        page.until("!document.querySelector('#try-example').disabled")
            .await;
        page
    }

    /// Opens something on a server.
    pub async fn open_at(browser: Browser, server: Server, path: &str) -> Self {
        Self::open_with_arguments(browser, &[], server, path).await
    }

    /// Opens something on a server in a browser with more arguments on its command line.
    pub async fn open_with_arguments(
        browser: Browser,
        arguments: &[&str],
        server: Server,
        path: &str,
    ) -> Self {
        let page = Self::start(browser, arguments, Motion::Reduced, server, "").await;
        page.goto(path).await;
        page
    }

    /// Opens the page on a server in Chromium, with more arguments on its command line and after a
    /// script.
    pub async fn open_prepared(
        arguments: &[&str],
        server: Server,
        path: &str,
        script: &str,
    ) -> Self {
        let page = Self::start(
            Browser::Chromium,
            arguments,
            Motion::Reduced,
            server,
            script,
        )
        .await;
        page.goto(path).await;
        page.until("!document.querySelector('#try-example').disabled")
            .await;
        page
    }

    /// A browser with an empty window; Chromium runs `script` before every page.
    async fn start(
        browser: Browser,
        arguments: &[&str],
        motion: Motion,
        server: Server,
        script: &str,
    ) -> Self {
        let session = browser.start(arguments, motion).await;
        let page = Self {
            driver: session.driver.clone(),
            server,
            session,
        };
        if browser == Browser::Chromium {
            let source = json!({ "source": format!("{WATCH}\n{script}") });
            page.cdp("Page.addScriptToEvaluateOnNewDocument", source)
                .await;
        }
        page
    }

    /// Goes to a path of the server.
    pub async fn goto(&self, path: &str) {
        let url = format!("{}{path}", self.server.origin());
        self.driver.goto(&url).await.expect("the page");
    }

    /// Sends a command of Chromium's own protocol.
    pub async fn cdp(&self, command: &str, parameters: Value) -> Value {
        let sent = self.driver.cdp().send_raw(command, parameters).await;
        sent.unwrap_or_else(|e| panic!("{command}: {e}"))
    }

    /// The folder of the browser's profile, which its processes name.
    pub fn profile(&self) -> &Path {
        self.session.profile.path()
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

    /// Waits until an expression, or what it promises, is true. While the page goes elsewhere it is
    /// not.
    pub async fn until(&self, expression: &str) {
        let start = Instant::now();
        let script = format!("return Promise.resolve({expression}).then(Boolean);");
        loop {
            let found = self.driver.execute(&script, vec![]).await;
            if found
                .as_ref()
                .is_ok_and(|found| *found.json() == Value::Bool(true))
            {
                return;
            }
            if start.elapsed() > PATIENCE {
                let error = found.err();
                let shown = self
                    .value("document.querySelector('main')?.innerText")
                    .await;
                let complaints = self.value("globalThis.__complaints").await;
                let shown = shown.as_str().unwrap_or_default();
                panic!(
                    "waited in vain for {expression} ({error:?}); complaints: {complaints}; the page shows:\n{shown}"
                );
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

    /// Opens the tab and the details that hold what a selector finds, by their own controls.
    pub async fn reveal(&self, selector: &str) {
        let quoted = Value::from(selector);
        self.until(&format!("document.querySelector({quoted})"))
            .await;
        self.value(&format!(
            "(() => {{ const element = document.querySelector({quoted}); \
             const panel = element.closest('[role=tabpanel]'); \
             if (panel?.hidden) document.querySelector(`[aria-controls=${{panel.id}}]`).click(); \
             for (let at = element.parentElement; at; at = at.parentElement) \
             if (at.matches('details:not([open])')) at.querySelector('summary').click(); }})()"
        ))
        .await;
    }

    /// Stops what plays, and goes to the first frame of the first sequence.
    pub async fn hold(&self) {
        self.value(
            "(() => { const play = document.querySelector('#play'); \
             if (play.getAttribute('aria-label') === 'Pause') play.click(); \
             for (const id of ['#sequence-list', '#stage']) document.querySelector(id) \
             .dispatchEvent(new KeyboardEvent('keydown', { key: 'Home', bubbles: true })); })()",
        )
        .await;
        self.until("document.querySelector('#stage').dataset.frame === '0'")
            .await;
    }

    /// Clicks what a selector finds, once it is not disabled, in the tab that it is in.
    pub async fn click(&self, selector: &str) {
        self.until(&format!(
            "document.querySelector({0})?.disabled === false",
            Value::from(selector)
        ))
        .await;
        self.reveal(selector).await;
        let element = self
            .driver
            .find(By::Css(selector))
            .await
            .expect("an element");
        element.scroll_into_view().await.expect("in view");
        element
            .click()
            .await
            .unwrap_or_else(|e| panic!("{selector}: {e}"));
    }

    /// Takes everything away, and waits until it is: what is shown from then on belongs to what comes
    /// next.
    pub async fn start_over(&self) {
        self.click("#start-over").await;
        self.until("document.querySelector('#start-over').hidden")
            .await;
    }

    /// Picks files in the page's own input.
    pub async fn pick(&self, files: &[&Path]) {
        let paths: Vec<String> = files
            .iter()
            .map(|f| f.to_string_lossy().into_owned())
            .collect();
        self.input("#input-files", &paths.join("\n")).await;
    }

    /// Picks a folder in the page's own input.
    pub async fn pick_folder(&self, folder: &Path) {
        self.input("#input-folder", &folder.to_string_lossy()).await;
    }

    /// Picks paths, a line each, in an input that a selector finds.
    pub async fn input(&self, selector: &str, paths: &str) {
        let input = self.driver.find(By::Css(selector)).await.expect("an input");
        input
            .send_keys(paths)
            .await
            .unwrap_or_else(|e| panic!("{selector}: {e}"));
    }

    /// Waits until the results are there.
    pub async fn until_scored(&self) {
        self.until("document.querySelector('#results').dataset.tc !== undefined")
            .await;
    }

    /// Waits until the cards show the errors of an evaluation of the command, but for the share
    /// `tolerance` of each.
    pub async fn until_errors(&self, expected: &Value, tolerance: f64) {
        self.until_scored().await;
        for object in expected["objects"].as_array().expect("objects") {
            let card = format!(
                "document.querySelector('.card[data-object={}]')?.dataset.error",
                object["name"]
            );
            let error = object["error"].as_f64().expect("a number");
            self.until(&format!(
                "Math.abs(Number({card}) - {error}) <= {tolerance} * {error}"
            ))
            .await;
        }
    }

    /// The file that the page saves when a selector is clicked.
    pub async fn saved(&self, selector: &str) -> Vec<u8> {
        let before = self.number("globalThis.__made").await;
        self.click(selector).await;
        self.until(&format!("globalThis.__made > {before}")).await;
        let bytes = self
            .value(
                "globalThis.__last.arrayBuffer().then((b) => Array.from(new Uint8Array(b)).join(' '))",
            )
            .await;
        let bytes = bytes.as_str().expect("bytes").split_whitespace();
        bytes.map(|byte| byte.parse().expect("a byte")).collect()
    }

    /// The table of keypoints that the page saves.
    pub async fn saved_keypoints(&self) -> String {
        self.value(
            "(() => { const make = URL.createObjectURL; URL.createObjectURL = (blob) => { blob.text().then((t) => { \
             globalThis.__saved = t; }); return make(blob); }; })()",
        )
        .await;
        self.click("#save-keypoints").await;
        self.until("globalThis.__saved").await;
        let saved = self.value("globalThis.__saved").await;
        saved.as_str().expect("a table").to_owned()
    }

    /// Nothing went wrong behind the scenes, and nothing was asked of anyone but the page's own
    /// server.
    pub async fn close(self) {
        let complaints = self.value("globalThis.__complaints").await;
        assert_eq!(complaints, json!([]));
        let others = "performance.getEntriesByType('resource').map((r) => r.name).filter((n) => \
                      !n.startsWith(location.origin + '/') && !n.startsWith('blob:' + location.origin))";
        assert_eq!(self.value(others).await, json!([]));
        self.driver.clone().quit().await.expect("the browser ends");
    }
}
