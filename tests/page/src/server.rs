//! The built site over HTTP on a free port.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use anyhow::{Result, anyhow};
use tiny_http::{Header, Request, Response, Server, StatusCode};

const THREADS: usize = 6;

/// Serves a folder until it is dropped.
pub(crate) struct SiteServer {
    server: Arc<Server>,
    threads: Vec<JoinHandle<()>>,
    /// Where the site is, with a slash at the end.
    pub(crate) origin: String,
}

impl SiteServer {
    pub(crate) fn start(folder: PathBuf) -> Result<Self> {
        let server = Server::http("127.0.0.1:0").map_err(|error| anyhow!("cannot serve the site: {error}"))?;
        let address = server.server_addr();
        let server = Arc::new(server);
        let folder = Arc::new(folder);
        let threads = (0..THREADS)
            .map(|_| {
                let (server, folder) = (Arc::clone(&server), Arc::clone(&folder));
                thread::spawn(move || {
                    for request in server.incoming_requests() {
                        answer(request, &folder);
                    }
                })
            })
            .collect();
        Ok(Self { server, threads, origin: format!("http://{address}/") })
    }
}

impl Drop for SiteServer {
    fn drop(&mut self) {
        for _ in &self.threads {
            self.server.unblock();
        }
        for thread in self.threads.drain(..) {
            // A thread that panicked has printed why.
            let _ = thread.join();
        }
    }
}

fn answer(request: Request, folder: &Path) {
    let path = request.url().split(['?', '#']).next().unwrap_or_default().trim_start_matches('/');
    let path = if path.is_empty() { "index.html" } else { path };
    let file = (!path.split('/').any(|part| part == "..")).then(|| File::open(folder.join(path)));
    // A browser that is closed in the middle of an answer is no failure of the test.
    let _ = match file {
        Some(Ok(file)) => request.respond(Response::from_file(file).with_header(content_type(path))),
        _ => request.respond(Response::empty(StatusCode(404))),
    };
}

fn content_type(path: &str) -> Header {
    let kind = match path.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript",
        Some("css") => "text/css",
        Some("svg") => "image/svg+xml",
        Some("wasm") => "application/wasm",
        Some("json") => "application/json",
        Some("png") => "image/png",
        Some("csv") => "text/csv",
        _ => "application/octet-stream",
    };
    Header::from_bytes("Content-Type", kind).unwrap_or_else(|()| unreachable!("the types above are ASCII"))
}
