//! `cargo xtask serve`: a folder over HTTP, for this machine only.

use std::fs::File;
use std::io::{self, Empty, ErrorKind};
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::thread;

use anyhow::{Context, Result, anyhow, bail};
use percent_encoding::percent_decode_str;
use tiny_http::{Header, Method, Request, Response, Server, StatusCode};

/// Where the search for a free port starts, and how many are tried.
const FIRST_PORT: u16 = 8080;
const PORTS: u16 = 100;

/// Requests answered at the same time; browsers open six connections to a server.
const THREADS: usize = 6;

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
    let server = Server::from_listener(listener, None).map_err(|error| anyhow!("cannot serve: {error}"))?;
    println!("serving {} at {address} (Ctrl-C ends it)", root.display());
    if open_page && let Err(error) = open::that_detached(&address) {
        eprintln!("cannot open a browser ({error}); open {address} in one");
    }
    thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                for request in server.incoming_requests() {
                    answer(request, &root);
                }
            });
        }
    });
    Ok(())
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
            Err(error) => return Err(error).with_context(|| format!("cannot listen on port {port}")),
        }
    }
    bail!(
        "every port from {} to {} is taken; give one with --port",
        ports.start,
        ports.end - 1
    )
}

fn answer(request: Request, root: &Path) {
    let method = request.method().clone();
    let url = request.url().to_owned();
    let (status, answered) = if !matches!(method, Method::Get | Method::Head) {
        let refusal = empty(405).with_header(header("Allow", "GET, HEAD"));
        (405, request.respond(refusal))
    } else {
        match open_file(root, &url) {
            Some((path, file)) => (
                200,
                request.respond(with_headers(Response::from_file(file), &path)),
            ),
            None => (404, request.respond(empty(404))),
        }
    };
    if status != 200 {
        eprintln!("{status} {method} {url}");
    }
    // A browser that goes away in the middle of an answer is no news.
    if let Err(error) = answered
        && !matches!(
            error.kind(),
            ErrorKind::BrokenPipe | ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted
        )
    {
        eprintln!("cannot answer {method} {url}: {error}");
    }
}

fn empty(status: u16) -> Response<Empty> {
    Response::empty(StatusCode(status))
}

/// A site under development changes at any time, so nothing is to be kept. Large files have their length told
/// too, which a page needs to show how much of one has come.
fn with_headers(response: Response<File>, path: &Path) -> Response<File> {
    response
        .with_chunked_threshold(usize::MAX)
        .with_header(header("Content-Type", mime(path)))
        .with_header(header("Cache-Control", "no-cache, no-store, must-revalidate"))
        .with_header(header("X-Content-Type-Options", "nosniff"))
}

fn header(name: &'static str, value: &'static str) -> Header {
    Header::from_bytes(name, value).expect("names and values of headers written here are ASCII")
}

/// Opens the file that a URL asks for, unless it lies outside of `root`, symbolic links followed.
fn open_file(root: &Path, url: &str) -> Option<(PathBuf, File)> {
    let path = root.join(relative_path(url)?).canonicalize().ok()?;
    if !path.starts_with(root) || !path.is_file() {
        return None;
    }
    let file = File::open(&path).ok()?;
    Some((path, file))
}

/// The path below the root that a URL names; `index.html` is meant by a URL that ends in a slash.
/// None if a part of it could lead elsewhere.
fn relative_path(url: &str) -> Option<PathBuf> {
    let path = url.split(['?', '#']).next()?.strip_prefix('/')?;
    let mut relative = PathBuf::new();
    for part in path.split('/') {
        let part = percent_decode_str(part).decode_utf8().ok()?;
        match part.as_ref() {
            "" | "." => {}
            ".." => return None,
            part if part.contains(['/', '\\', ':', '\0']) => return None,
            part => relative.push(part),
        }
    }
    if path.is_empty() || path.ends_with('/') {
        relative.push("index.html");
    }
    Some(relative)
}

/// The media type by the end of a file's name.
fn mime(path: &Path) -> &'static str {
    let extension = path
        .extension()
        .map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref().unwrap_or_default() {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "csv" => "text/csv; charset=utf-8",
        "txt" | "md" => "text/plain; charset=utf-8",
        "json" => "application/json",
        "webmanifest" => "application/manifest+json",
        "wasm" => "application/wasm",
        "zip" => "application/zip",
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        "webp" => "image/webp",
        "svg" => "image/svg+xml",
        "ico" => "image/x-icon",
        "mp4" => "video/mp4",
        "webm" => "video/webm",
        "woff2" => "font/woff2",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::io::{Read, Write};
    use std::net::TcpStream;

    #[test]
    fn wasm_and_scripts_have_the_media_types_that_browsers_insist_on() {
        assert_eq!(mime(Path::new("pkg/tracklens_bg.wasm")), "application/wasm");
        assert_eq!(mime(Path::new("main.js")), "text/javascript; charset=utf-8");
        assert_eq!(mime(Path::new("FRAME.PNG")), "image/png");
        assert_eq!(mime(Path::new("basic.safetensors")), "application/octet-stream");
        assert_eq!(mime(Path::new("LICENSE")), "application/octet-stream");
    }

    #[test]
    fn a_url_names_a_path_below_the_root() {
        let path = |url| relative_path(url).map(|path| path.to_string_lossy().replace('\\', "/"));
        assert_eq!(path("/").as_deref(), Some("index.html"));
        assert_eq!(path("/?example").as_deref(), Some("index.html"));
        assert_eq!(path("/pkg/index.js?v=1#x").as_deref(), Some("pkg/index.js"));
        assert_eq!(
            path("/example/frame%201.png").as_deref(),
            Some("example/frame 1.png")
        );
        assert_eq!(path("//example//").as_deref(), Some("example/index.html"));
    }

    #[test]
    fn a_url_that_leads_out_of_the_root_names_nothing() {
        for url in [
            "/../secret",
            "/%2e%2e/secret",
            "/a/..%2fsecret",
            "/..%5csecret",
            "/c:/secret",
            "/%00",
            "secret",
            "/%ff",
        ] {
            assert_eq!(relative_path(url), None, "{url}");
        }
    }

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
        std::fs::write(folder.path().join("secret"), "secret")?;
        let server = Server::http((Ipv4Addr::LOCALHOST, 0)).map_err(|error| anyhow!("{error}"))?;
        let address = server.server_addr().to_ip().context("no address")?;
        let exchange = |request: &str| -> Result<String> {
            let mut stream = TcpStream::connect(address)?;
            write!(
                stream,
                "{request} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
            )?;
            answer(server.recv()?, &root);
            let mut answer = String::new();
            stream.read_to_string(&mut answer)?;
            Ok(answer)
        };
        let page = exchange("GET /")?;
        assert!(
            page.starts_with("HTTP/1.1 200 ") && page.ends_with("\r\n\r\nhello"),
            "{page}"
        );
        assert!(
            page.contains("Content-Type: text/html; charset=utf-8\r\n"),
            "{page}"
        );
        assert!(page.contains("Cache-Control: no-cache"), "{page}");
        std::fs::write(root.join("frames.zip"), vec![7; 1 << 20])?;
        assert!(exchange("GET /frames.zip")?.contains("Content-Length: 1048576\r\n"));
        let head = exchange("HEAD /index.html")?;
        assert!(
            head.contains("Content-Length: 5\r\n") && head.ends_with("\r\n\r\n"),
            "{head}"
        );
        assert!(exchange("GET /missing")?.starts_with("HTTP/1.1 404 "));
        assert!(exchange("GET /../secret")?.starts_with("HTTP/1.1 404 "));
        assert!(exchange("POST /")?.starts_with("HTTP/1.1 405 "));
        Ok(())
    }
}
