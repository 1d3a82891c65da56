//! A server that writes down what it is asked for.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use axum::Router;
use axum::extract::Request;
use axum::http::StatusCode;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, HeaderValue};
use axum::middleware::{self, Next};
use axum::response::IntoResponse;
use axum::routing::get;
use sha2::{Digest, Sha256};
use tower_http::services::ServeDir;

/// What the page may not do unnoticed: errors, rejected promises, console errors, violations of its
/// policy. Keeps the last file that it made.
pub(crate) const WATCH: &str = r#"
  globalThis.__complaints = [];
  const complain = (text) => globalThis.__complaints.push(String(text));
  addEventListener("error", (e) => complain(e.message));
  addEventListener("unhandledrejection", (e) => complain(e.reason));
  document.addEventListener("securitypolicyviolation", (e) => complain(`${e.violatedDirective}: ${e.blockedURI}`));
  const error = console.error;
  console.error = (...all) => { complain(all.join(" ")); error(...all); };
  globalThis.__made = 0;
  const makeAddress = URL.createObjectURL;
  URL.createObjectURL = (file) => {
    globalThis.__made += 1;
    globalThis.__last = file;
    return makeAddress.call(URL, file);
  };
"#;

/// A folder on a free port of the loopback for as long as the runtime of the test lives.
#[derive(Clone)]
pub struct Server {
    origin: String,
    requests: Arc<Mutex<Vec<String>>>,
    down: Arc<AtomicBool>,
}

impl Server {
    /// Serves `folder`, and under `/name/` the folders of `others`.
    pub async fn start(folder: PathBuf, others: &[(&str, PathBuf)]) -> Self {
        let files = Router::new().fallback_service(ServeDir::new(folder));
        let all = others.iter().fold(files, |router, (name, folder)| {
            router.nest_service(&format!("/{name}"), ServeDir::new(folder))
        });
        Self::listen(all).await
    }

    /// Serves the page with [`WATCH`] in it, for browsers whose driver cannot run it before the
    /// page.
    pub(crate) async fn watched(site: PathBuf) -> Self {
        let read =
            |name: &str| std::fs::read_to_string(site.join(name)).expect("a file of the site");
        let page = read("index.html");
        let watched = page.replacen("<title>", "<script src=\"/watch.js\"></script><title>", 1);
        // The copy of the page that the browser keeps is watched, too, and known by its hash.
        let hash = |text: &str| format!("{:x}", Sha256::digest(text));
        let worker = read("service-worker.js").replace(&hash(&page), &hash(&watched));
        let html = move || async move { ([(CONTENT_TYPE, "text/html")], watched).into_response() };
        let script = |text: String| {
            move || async move { ([(CONTENT_TYPE, "text/javascript")], text).into_response() }
        };
        let router = Router::new()
            .route("/", get(html.clone()))
            .route("/index.html", get(html))
            .route("/watch.js", get(script(WATCH.to_owned())))
            .route("/service-worker.js", get(script(worker)))
            .fallback_service(ServeDir::new(site));
        Self::listen(router).await
    }

    async fn listen(router: Router) -> Self {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0")
            .await
            .expect("a free port");
        let origin = format!("http://{}", listener.local_addr().expect("an address"));
        let server = Self {
            origin,
            requests: Arc::default(),
            down: Arc::default(),
        };
        let state = server.clone();
        let noted = middleware::from_fn(move |request: Request, next: Next| {
            let asked = format!("{} {}", request.method(), request.uri());
            state
                .requests
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push(asked);
            let down = state.down.load(Ordering::Relaxed);
            async move {
                if down {
                    return StatusCode::SERVICE_UNAVAILABLE.into_response();
                }
                let mut response = next.run(request).await;
                // What a static host says of files that change: ask before using a kept one.
                response
                    .headers_mut()
                    .insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
                response
            }
        });
        let service = router.layer(noted);
        tokio::spawn(async move { axum::serve(listener, service).await });
        server
    }

    /// From now on, or no longer, every answer is a failure.
    pub fn set_down(&self, down: bool) {
        self.down.store(down, Ordering::Relaxed);
    }

    /// `http://127.0.0.1:PORT`.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// What was asked for so far, as `GET /path?query`, and forgets it.
    pub fn take_requests(&self) -> Vec<String> {
        std::mem::take(&mut *self.requests.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
