//! `cargo xtask serve`: a folder over HTTP, for this machine only.

use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use axum::Router;
use axum::http::{HeaderName, HeaderValue};
use tower_http::services::ServeDir;
use tower_http::set_header::SetResponseHeaderLayer;

/// Where the search for a free port starts, and how many are tried.
const FIRST_PORT: u16 = 8080;
const PORTS: u16 = 100;

/// Serves `folder` until the process is ended.
///
/// # Errors
/// The port asked for, or every port tried, is taken.
pub fn serve(folder: &Path, port: Option<u16>, open_page: bool) -> Result<()> {
    let root = folder
        .canonicalize()
        .with_context(|| format!("cannot serve {}", folder.display()))?;
    let listener = listen(port)?;
    let address = format!("http://{}/", listener.local_addr()?);
    println!("serving {} at {address} (Ctrl-C ends it)", root.display());
    if open_page && let Err(error) = open::that_detached(&address) {
        eprintln!("cannot open a browser ({error}); open {address} in one");
    }
    tokio::runtime::Runtime::new()?.block_on(run(listener, &root))
}

async fn run(listener: TcpListener, root: &Path) -> Result<()> {
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    axum::serve(listener, site(root))
        .await
        .context("cannot serve")
}

/// The files below `root`. A site under development changes at any time, so nothing is to be kept.
fn site(root: &Path) -> Router {
    let header = |name: &'static str, value: &'static str| {
        SetResponseHeaderLayer::overriding(
            HeaderName::from_static(name),
            HeaderValue::from_static(value),
        )
    };
    Router::new()
        .fallback_service(ServeDir::new(root))
        .layer(header(
            "cache-control",
            "no-cache, no-store, must-revalidate",
        ))
        .layer(header("x-content-type-options", "nosniff"))
}

fn listen(port: Option<u16>) -> Result<TcpListener> {
    let bind = |port| TcpListener::bind((Ipv4Addr::LOCALHOST, port));
    if let Some(port) = port {
        return bind(port).map_err(|error| match error.kind() {
            ErrorKind::AddrInUse => {
                anyhow!("port {port} is taken; give another one, or none for the next free one")
            }
            _ => anyhow!("cannot listen on port {port}: {error}"),
        });
    }
    first_free(FIRST_PORT..FIRST_PORT + PORTS, bind)
}

/// The first port of a range that nobody listens on.
fn first_free<T>(ports: std::ops::Range<u16>, bind: impl Fn(u16) -> io::Result<T>) -> Result<T> {
    for port in ports.clone() {
        match bind(port) {
            Ok(listener) => return Ok(listener),
            Err(error) if error.kind() == ErrorKind::AddrInUse => eprintln!("port {port} is taken"),
            Err(error) => {
                return Err(error).with_context(|| format!("cannot listen on port {port}"));
            }
        }
    }
    bail!(
        "every port from {} to {} is taken; give one with --port",
        ports.start,
        ports.end - 1
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::io::{Read, Write};
    use std::net::TcpStream;

    #[test]
    fn a_taken_port_is_passed_over() {
        let taken = |port| match port {
            8080..=8082 => Err(io::Error::from(ErrorKind::AddrInUse)),
            port => Ok(port),
        };
        assert_eq!(first_free(8080..8090, taken).ok(), Some(8083));
        assert!(first_free(8080..8083, taken).is_err());
    }

    #[test]
    fn files_are_served_and_nothing_else() -> Result<()> {
        let folder = tempfile::TempDir::new()?;
        let root = folder.path().canonicalize()?.join("site");
        std::fs::create_dir(&root)?;
        std::fs::write(root.join("index.html"), "hello")?;
        std::fs::write(root.join("tracklens_bg.wasm"), vec![7; 1 << 20])?;
        std::fs::write(root.join("main.js"), "")?;
        std::fs::write(folder.path().join("secret"), "secret")?;
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        std::thread::spawn(move || tokio::runtime::Runtime::new()?.block_on(run(listener, &root)));
        let exchange = |request: &str| -> Result<String> {
            let mut stream = TcpStream::connect(address)?;
            write!(
                stream,
                "{request} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
            )?;
            let mut answer = Vec::new();
            stream.read_to_end(&mut answer)?;
            Ok(String::from_utf8_lossy(&answer).to_lowercase())
        };
        let page = exchange("GET /?example")?;
        assert!(
            page.starts_with("http/1.1 200 ") && page.ends_with("\r\n\r\nhello"),
            "{page}"
        );
        assert!(page.contains("content-type: text/html"), "{page}");
        assert!(page.contains("cache-control: no-cache"), "{page}");
        // Browsers insist on these two, and a page that shows progress needs the length.
        let wasm = exchange("GET /tracklens_bg.wasm")?;
        assert!(
            wasm.contains("content-type: application/wasm")
                && wasm.contains("content-length: 1048576")
        );
        assert!(exchange("GET /main.js")?.contains("content-type: text/javascript"));
        let head = exchange("HEAD /index.html")?;
        assert!(
            head.contains("content-length: 5\r\n") && head.ends_with("\r\n\r\n"),
            "{head}"
        );
        for path in [
            "/missing",
            "/../secret",
            "/%2e%2e/secret",
            "/a/..%2f..%2fsecret",
        ] {
            let answer = exchange(&format!("GET {path}"))?;
            assert!(
                answer.starts_with("http/1.1 404 ") || answer.starts_with("http/1.1 400 "),
                "{path}: {answer}"
            );
        }
        assert!(exchange("POST /")?.starts_with("http/1.1 405 "));
        Ok(())
    }

    #[test]
    fn connections_that_stay_open_do_not_keep_others_waiting() -> Result<()> {
        let folder = tempfile::TempDir::new()?;
        std::fs::write(folder.path().join("index.html"), "hello")?;
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        let root = folder.path().to_owned();
        std::thread::spawn(move || tokio::runtime::Runtime::new()?.block_on(run(listener, &root)));
        let mut open = Vec::new();
        for _ in 0..64 {
            let mut stream = TcpStream::connect(address)?;
            write!(stream, "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")?;
            let mut first = [0; 12];
            stream.read_exact(&mut first)?;
            assert_eq!(&first, b"HTTP/1.1 200");
            open.push(stream);
        }
        Ok(())
    }
}
