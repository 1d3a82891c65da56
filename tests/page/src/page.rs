//! The page as a user sees it.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};
use thirtyfour::extensions::cdp::ChromeDevTools;
use thirtyfour::prelude::*;

/// A hundred frames on the CPU, on a machine that does something else as well.
const PATIENCE: Duration = Duration::from_secs(240);
const POLL: Duration = Duration::from_millis(25);

/// An open page.
#[derive(Clone)]
pub struct Page {
    driver: WebDriver,
    origin: String,
    downloads: PathBuf,
}

/// What the page says of all objects.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Tracking capability.
    pub tc: f64,
    /// One card an object, in order.
    pub cards: Vec<Card>,
}

/// What the page says of an object.
#[derive(Debug, Clone, PartialEq)]
pub struct Card {
    /// The object's name.
    pub object: String,
    /// Whether it is tracked.
    pub tracked: bool,
    /// Its tracking error with the best keypoint.
    pub error: f64,
    /// The threshold in force.
    pub threshold: f64,
    /// The best keypoint.
    pub keypoint: u64,
    /// Frames in which it is visible.
    pub frames: u64,
    /// Of these, frames in which it lies outside the image.
    pub outside: u64,
}

impl Page {
    pub(crate) async fn open(driver: WebDriver, origin: &str, downloads: PathBuf) -> Result<Self> {
        driver.goto(origin).await?;
        let page = Self { driver, origin: origin.to_owned(), downloads };
        page.wait("#try-example:enabled").await?;
        Ok(page)
    }

    // What a user does

    /// Picks files in the page's file input.
    ///
    /// # Errors
    /// The browser refuses.
    pub async fn pick_files(&self, files: &[PathBuf]) -> Result<()> {
        let paths: Vec<_> = files.iter().map(|file| file.to_string_lossy()).collect();
        let input = self.driver.find(By::Id("input-files")).await?;
        Ok(input.send_keys(paths.join("\n")).await?)
    }

    /// Picks a folder in the page's folder input.
    ///
    /// # Errors
    /// The browser refuses.
    pub async fn pick_folder(&self, folder: &Path) -> Result<()> {
        let input = self.driver.find(By::Id("input-folder")).await?;
        Ok(input.send_keys(folder.to_string_lossy()).await?)
    }

    /// Drops files and folders onto the page, as from a file manager.
    ///
    /// # Errors
    /// The browser refuses.
    pub async fn drop(&self, paths: &[&Path]) -> Result<()> {
        let tools = ChromeDevTools::new(self.driver.handle().clone());
        for kind in ["dragEnter", "dragOver", "drop"] {
            let event = json!({
                "type": kind, "x": 300, "y": 300,
                "data": { "items": [], "files": paths, "dragOperationsMask": 1 },
            });
            tools.execute_cdp_with_params("Input.dispatchDragEvent", event).await?;
        }
        Ok(())
    }

    /// Clicks the element.
    ///
    /// # Errors
    /// There is none, or it cannot be clicked.
    pub async fn click(&self, selector: &str) -> Result<()> {
        let element = self.wait(selector).await?;
        element.scroll_into_view().await?;
        element.click().await.with_context(|| format!("cannot click {selector}"))
    }

    /// Replaces the text of a field.
    ///
    /// # Errors
    /// There is none, or it takes no text.
    pub async fn fill(&self, selector: &str, text: &str) -> Result<()> {
        let element = self.wait(selector).await?;
        element.send_keys(Key::Control + "a").await?;
        Ok(element.send_keys(text).await?)
    }

    /// Presses a key in an element.
    ///
    /// # Errors
    /// There is none.
    pub async fn press(&self, selector: &str, key: Key) -> Result<()> {
        let element = self.wait(selector).await?;
        Ok(element.send_keys(key + "").await?)
    }

    /// Clicks something that downloads a file, and returns its content.
    ///
    /// # Errors
    /// No file arrives.
    pub async fn download(&self, selector: &str, file: &str) -> Result<String> {
        self.click(selector).await?;
        let path = self.downloads.join(file);
        let started = Instant::now();
        while !path.exists() {
            ensure!(started.elapsed() < PATIENCE, "{file} was not downloaded");
            tokio::time::sleep(POLL).await;
        }
        Ok(std::fs::read_to_string(path)?)
    }

    // What a user sees

    /// The element once it is there and visible.
    ///
    /// # Errors
    /// It does not come.
    pub async fn wait(&self, selector: &str) -> Result<WebElement> {
        self.wait_for(selector, PATIENCE).await
    }

    /// The element, which must come within `patience`.
    ///
    /// # Errors
    /// It does not come.
    pub async fn wait_for(&self, selector: &str, patience: Duration) -> Result<WebElement> {
        let found = self.driver.query(By::Css(selector)).wait(patience, POLL).and_displayed().first();
        found.await.with_context(|| format!("{selector} does not appear"))
    }

    /// Waits until there is no such element on display.
    ///
    /// # Errors
    /// It does not go away.
    pub async fn wait_gone(&self, selector: &str) -> Result<()> {
        let started = Instant::now();
        loop {
            let shown = "return [...document.querySelectorAll(arguments[0])].some((e) => e.checkVisibility())";
            if self.run(shown, vec![json!(selector)]).await? == json!(false) {
                return Ok(());
            }
            ensure!(started.elapsed() < PATIENCE, "{selector} does not go away");
            tokio::time::sleep(POLL).await;
        }
    }

    /// The text of the element once it is there.
    ///
    /// # Errors
    /// It does not come.
    pub async fn text(&self, selector: &str) -> Result<String> {
        Ok(self.wait(selector).await?.text().await?)
    }

    /// A `data-` attribute of the element once it is there.
    ///
    /// # Errors
    /// The element does not come, or it has no such attribute.
    pub async fn data(&self, selector: &str, name: &str) -> Result<String> {
        let value = self.wait(selector).await?.attr(format!("data-{name}")).await?;
        value.with_context(|| format!("{selector} has no data-{name}"))
    }

    /// Waits until an element's text contains `part`, and returns the text.
    ///
    /// # Errors
    /// It does not; the message has the text there is.
    pub async fn wait_text(&self, selector: &str, part: &str) -> Result<String> {
        let started = Instant::now();
        loop {
            let text = self.text(selector).await?;
            if text.contains(part) {
                return Ok(text);
            }
            ensure!(started.elapsed() < Duration::from_secs(20), "{selector} says {text:?}, expected {part:?} in it");
            tokio::time::sleep(POLL).await;
        }
    }

    /// Waits for the score.
    ///
    /// # Errors
    /// It does not come.
    pub async fn wait_score(&self) -> Result<Score> {
        self.wait("#main[data-state=scored] #results[data-tc]").await?;
        self.score().await
    }

    /// The score on display.
    ///
    /// # Errors
    /// There is none.
    pub async fn score(&self) -> Result<Score> {
        let read = "const { tc } = document.querySelector('#results').dataset;
            return { tc, cards: [...document.querySelectorAll('.card')].map((card) => ({ ...card.dataset })) };";
        let read = self.run(read, Vec::new()).await?;
        let cards = read["cards"].as_array().context("the page shows no cards")?;
        Ok(Score {
            tc: number(&read["tc"])?,
            cards: cards.iter().map(card).collect::<Result<_>>()?,
        })
    }

    /// Runs a script in the page.
    ///
    /// # Errors
    /// The script throws.
    pub async fn run(&self, script: &str, arguments: Vec<Value>) -> Result<Value> {
        let returned = self.driver.execute(script, arguments).await?;
        Ok(returned.json().clone())
    }

    /// The state for the message of a failure.
    pub(crate) async fn describe(&self) -> String {
        let read = "return document.querySelector('#main').dataset.state + '\\n' + document.querySelector('main').innerText";
        match self.run(read, Vec::new()).await {
            Ok(state) => format!("the page was: {}", state.as_str().unwrap_or_default()),
            Err(error) => format!("the page cannot be read: {error}"),
        }
    }

    /// Checks that nothing was logged as an error and nothing requested from elsewhere.
    pub(crate) async fn check_log(&self) -> Result<()> {
        let severe: Vec<String> = self
            .driver
            .get_log("browser")
            .await?
            .into_iter()
            .filter(|entry| ["SEVERE", "WARNING"].contains(&entry.level.as_str()))
            .map(|entry| entry.message)
            .collect();
        ensure!(severe.is_empty(), "the browser logged {severe:#?}");
        let requests = self.requests().await?;
        ensure!(!requests.is_empty(), "the browser logged no requests at all");
        for url in requests {
            let own = url.starts_with(&self.origin) || url.starts_with(&format!("blob:{}", self.origin));
            ensure!(own || url.starts_with("data:"), "the page requested {url}");
        }
        Ok(())
    }

    /// The addresses of the page's requests since the last call.
    async fn requests(&self) -> Result<Vec<String>> {
        let mut urls = Vec::new();
        for entry in self.driver.get_log("performance").await? {
            let event: Value = serde_json::from_str(&entry.message)?;
            let event = &event["message"];
            if event["method"] == "Network.requestWillBeSent" {
                let url = event["params"]["request"]["url"].as_str();
                urls.push(url.context("a request without an address")?.to_owned());
            }
        }
        Ok(urls)
    }
}

fn card(data: &Value) -> Result<Card> {
    let text = |name: &str| data[name].as_str().with_context(|| format!("a card lacks {name}"));
    Ok(Card {
        object: text("object")?.to_owned(),
        tracked: match text("tracked")? {
            "true" => true,
            "false" => false,
            other => bail!("tracked is {other}"),
        },
        error: number(&data["error"])?,
        threshold: number(&data["threshold"])?,
        keypoint: text("keypoint")?.parse()?,
        frames: text("frames")?.parse()?,
        outside: text("outside")?.parse()?,
    })
}

fn number(value: &Value) -> Result<f64> {
    let text = value.as_str().context("a number is missing")?;
    text.parse().with_context(|| format!("`{text}` is not a number"))
}
