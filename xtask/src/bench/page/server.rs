//! The site as a static host would serve it, compressed, which notes what it sent and takes the
//! results of a benchmark.

use std::collections::HashMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};

use anyhow::{Context, Result};
use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use flate2::Compression;
use flate2::write::GzEncoder;

/// What was sent, in order: the path and the bytes of the (compressed) content.
pub type Sent = Vec<(String, usize)>;

/// A running server; it ends with its runtime.
pub struct Server {
    shared: Arc<Shared>,
    results: Receiver<String>,
    address: String,
    _runtime: tokio::runtime::Runtime,
}

struct Shared {
    /// Folders by the first part of the path; the empty one is for all others.
    folders: HashMap<&'static str, PathBuf>,
    /// A script that `index.html` runs before its own.
    script: &'static str,
    /// Whether pages are isolated, as shared memory needs it.
    isolated: bool,
    compressed: Mutex<HashMap<PathBuf, Arc<Content>>>,
    sent: Mutex<Sent>,
    marks: Mutex<Vec<usize>>,
    results: Mutex<Sender<String>>,
}

struct Content {
    bytes: Bytes,
    gzip: bool,
}

impl Server {
    /// Serves folders on a free port of this machine.
    ///
    /// # Errors
    /// There is no free port.
    pub fn start(
        folders: HashMap<&'static str, PathBuf>,
        script: &'static str,
        isolated: bool,
    ) -> Result<Self> {
        let (sender, results) = channel();
        let shared = Arc::new(Shared {
            folders,
            script,
            isolated,
            compressed: Mutex::default(),
            sent: Mutex::default(),
            marks: Mutex::default(),
            results: Mutex::new(sender),
        });
        let runtime = tokio::runtime::Runtime::new()?;
        let listener = runtime
            .block_on(tokio::net::TcpListener::bind("127.0.0.1:0"))
            .context("no free port")?;
        let address = format!("http://{}", listener.local_addr()?);
        let router = Router::new()
            .route("/result", post(result))
            .route("/mark", post(mark))
            .fallback(get(file))
            .with_state(shared.clone());
        runtime.spawn(async move { axum::serve(listener, router).await });
        Ok(Self {
            shared,
            results,
            address,
            _runtime: runtime,
        })
    }

    /// `http://127.0.0.1:PORT`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Where results arrive.
    pub fn results(&self) -> &Receiver<String> {
        &self.results
    }

    /// What was sent since the last call, and how many of these files before the first mark.
    pub fn take_sent(&self) -> (Sent, usize) {
        let sent = std::mem::take(&mut *lock(&self.shared.sent));
        let marks = std::mem::take(&mut *lock(&self.shared.marks));
        let first = marks.first().copied().unwrap_or(sent.len());
        (sent, first)
    }
}

/// What another thread left behind when it panicked is as good as what it would have left
/// otherwise.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

async fn result(State(shared): State<Arc<Shared>>, body: String) {
    // Nobody waits any more after a time-out.
    let _ = lock(&shared.results).send(body);
}

async fn mark(State(shared): State<Arc<Shared>>) {
    let sent = lock(&shared.sent).len();
    lock(&shared.marks).push(sent);
}

async fn file(State(shared): State<Arc<Shared>>, uri: Uri) -> Response {
    let path = uri.path().trim_start_matches('/');
    let path = if path.is_empty() { "index.html" } else { path };
    let Some((place, content)) = shared.content(path) else {
        return StatusCode::NOT_FOUND.into_response();
    };
    lock(&shared.sent).push((path.to_owned(), content.bytes.len()));
    let mut headers = HeaderMap::new();
    let mut set = |name: HeaderName, value: &str| {
        if let Ok(value) = HeaderValue::from_str(value) {
            headers.insert(name, value);
        }
    };
    set(
        header::CONTENT_TYPE,
        mime_guess::from_path(place)
            .first_or_octet_stream()
            .as_ref(),
    );
    if content.gzip {
        set(header::CONTENT_ENCODING, "gzip");
    }
    if shared.isolated {
        set(
            HeaderName::from_static("cross-origin-opener-policy"),
            "same-origin",
        );
        set(
            HeaderName::from_static("cross-origin-embedder-policy"),
            "require-corp",
        );
    }
    (headers, content.bytes.clone()).into_response()
}

impl Shared {
    /// The content of a file and where it lies; compressed the first time.
    fn content(&self, path: &str) -> Option<(PathBuf, Arc<Content>)> {
        if path.split('/').any(|part| part == "..") {
            return None;
        }
        let (first, rest) = path.split_once('/').unwrap_or(("", path));
        let place = match self.folders.get(first) {
            Some(folder) => folder.join(rest),
            None => self.folders.get("")?.join(path),
        };
        if let Some(content) = lock(&self.compressed).get(&place) {
            return Some((place, content.clone()));
        }
        let mut bytes = std::fs::read(&place).ok()?;
        if path == "index.html" && !self.script.is_empty() {
            let page = String::from_utf8(bytes).ok()?;
            let tag = format!("<script type=\"module\" src=\"{}\"></script>", self.script);
            bytes = page
                .replacen(
                    "<script type=\"module\"",
                    &format!("{tag}<script type=\"module\""),
                    1,
                )
                .into_bytes();
        }
        let content = Arc::new(Content::new(bytes, &place)?);
        lock(&self.compressed).insert(place.clone(), content.clone());
        Some((place, content))
    }
}

impl Content {
    fn new(bytes: Vec<u8>, place: &Path) -> Option<Self> {
        let kind = mime_guess::from_path(place).first_or_octet_stream();
        // As hosts do: what is compressed already, and what they do not know, is sent as it is.
        let known = ["text/", "application/wasm", "application/json", "image/svg"];
        if !known.iter().any(|known| kind.as_ref().starts_with(known)) {
            return Some(Self {
                bytes: bytes.into(),
                gzip: false,
            });
        }
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&bytes).ok()?;
        Some(Self {
            bytes: encoder.finish().ok()?.into(),
            gzip: true,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::io::Read;
    use std::net::TcpStream;

    #[test]
    fn files_are_sent_compressed_and_noted_and_results_arrive() -> Result<()> {
        let folder = tempfile::TempDir::new()?;
        let (site, made) = (folder.path().join("site"), folder.path().join("made"));
        for (file, content) in [
            (
                site.join("index.html"),
                "<script type=\"module\" src=\"main.js\"></script>".to_owned(),
            ),
            (site.join("pkg/a.wasm"), "\0".repeat(1 << 20)),
            (made.join("w.safetensors"), "weights".to_owned()),
            (folder.path().join("secret"), "secret".to_owned()),
        ] {
            std::fs::create_dir_all(file.parent().context("a folder")?)?;
            std::fs::write(file, content)?;
        }
        let server = Server::start(
            HashMap::from([("", site), ("made", made)]),
            "bench/first.js",
            true,
        )?;
        let exchange = |request: &str, body: &str| -> Result<String> {
            let mut stream = TcpStream::connect(server.address().trim_start_matches("http://"))?;
            write!(
                stream,
                "{request} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}",
                body.len()
            )?;
            let mut answer = Vec::new();
            stream.read_to_end(&mut answer)?;
            Ok(String::from_utf8_lossy(&answer).to_lowercase())
        };
        let page = exchange("GET /?tables", "")?;
        assert!(
            page.contains("content-type: text/html") && page.contains("content-encoding: gzip")
        );
        assert!(page.contains("cross-origin-embedder-policy: require-corp"));
        exchange("POST /mark", "{}")?;
        assert!(exchange("GET /pkg/a.wasm", "")?.contains("content-type: application/wasm"));
        assert!(exchange("GET /made/w.safetensors", "")?.ends_with("\r\n\r\nweights"));
        for path in ["/missing", "/../secret", "/made/../secret"] {
            assert!(
                exchange(&format!("GET {path}"), "")?.starts_with("http/1.1 404 "),
                "{path}"
            );
        }
        exchange("POST /result", "{\"tc\":1}")?;
        assert_eq!(server.results().recv()?, "{\"tc\":1}");

        let (sent, before) = server.take_sent();
        let paths: Vec<&str> = sent.iter().map(|(path, _)| path.as_str()).collect();
        assert_eq!(paths, ["index.html", "pkg/a.wasm", "made/w.safetensors"]);
        assert_eq!(before, 1);
        assert!(sent[1].1 < 2000, "{}", sent[1].1);
        let (_, page) = server.shared.content("index.html").context("the page")?;
        let mut text = String::new();
        flate2::read::GzDecoder::new(&page.bytes[..]).read_to_string(&mut text)?;
        assert!(
            text.starts_with("<script type=\"module\" src=\"bench/first.js\"></script><script"),
            "{text}"
        );
        Ok(())
    }
}
