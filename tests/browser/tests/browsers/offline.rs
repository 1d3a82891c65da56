//! The page works without a network, changes versions as a whole, and talks with nobody but its own
//! server.

use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tracklens_page_tests::{Browser, Page, Server, copy_folder, example, site};

/// Opens a site and waits until its copy is in the browser, then opens it once more, from there.
async fn kept(site: &Path) -> Page {
    let server = Server::start(site.to_owned(), &[]).await;
    let page = Page::open_at(Browser::Chromium, server, "/").await;
    page.until("!document.querySelector('#offline').hidden")
        .await;
    page.goto("/").await;
    page.until(
        "navigator.serviceWorker.controller && !document.querySelector('#try-example').disabled",
    )
    .await;
    page
}

#[tokio::test(flavor = "multi_thread")]
async fn after_the_first_load_the_page_works_without_a_network() {
    let page = kept(&site()).await;
    page.server.set_down(true);
    page.server.take_requests();
    page.goto("/").await;
    page.click("#try-example").await;
    page.until_scored().await;
    page.until("document.querySelector('#stage').dataset.picture?.endsWith('.png')")
        .await;
    // The browser looks for a newer version; nothing else is asked for.
    let asked = page.server.take_requests();
    assert!(
        asked.iter().all(|r| r == "GET /service-worker.js"),
        "{asked:?}"
    );
    // It can be installed: a manifest with a name, a start and icons that are there.
    let manifest = "(() => { const { name, start_url, display, icons } = globalThis.__manifest; \
                    return Boolean(name && start_url && display === 'standalone' && icons.length >= 3); })()";
    page.value(
        "fetch('manifest.webmanifest').then((r) => r.json()).then(async (m) => { for (const { src } of m.icons) \
         await createImageBitmap(await (await fetch(src)).blob()).catch(() => src.endsWith('svg') || Promise.reject(src)); \
         globalThis.__manifest = m; })",
    )
    .await;
    page.until("globalThis.__manifest").await;
    assert_eq!(page.value(manifest).await, Value::Bool(true));
    page.close().await;
}

/// Nothing of the files leaves the page: all that its scripts and workers ask for, as the browser
/// itself writes it down, are files of the site.
#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_asked_for_but_files_of_the_site() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("net.json");
    let server = Server::start(site(), &[]).await;
    let argument = format!("--log-net-log={}", log.display());
    let page =
        Page::open_with_arguments(Browser::Chromium, &[&argument], server.clone(), "/").await;
    page.until("!document.querySelector('#offline').hidden")
        .await;
    page.pick_folder(&example("frames")).await;
    page.pick(&[
        &example("checkpoint.safetensors"),
        &example("ground_truth.csv"),
    ])
    .await;
    page.until_scored().await;
    page.click(".layer[data-mark=heat]").await;
    page.until("document.querySelector('#stage').dataset.heat === 'true'")
        .await;
    page.click("#save-evaluation").await;
    page.close().await;

    let files = |request: &String| {
        let path = request
            .strip_prefix("GET /")
            .filter(|path| !path.contains('?'));
        path.is_some_and(|path| {
            path.is_empty() || site().join(path).is_file() || path == "favicon.ico"
        })
    };
    let asked = server.take_requests();
    let others: Vec<&String> = asked.iter().filter(|request| !files(request)).collect();
    assert!(others.is_empty(), "{others:?}");

    let log: Value = serde_json::from_slice(&fs::read(&log).expect("a log")).expect("JSON");
    let requests: Vec<(&str, &str)> = log["events"]
        .as_array()
        .expect("events")
        .iter()
        .filter_map(|event| {
            Some((
                event["params"]["initiator"].as_str()?,
                event["params"]["url"].as_str()?,
            ))
        })
        .filter(|(initiator, _)| initiator.starts_with(server.origin()))
        .collect();
    assert!(requests.len() > 20, "{requests:?}");
    for (_, url) in requests {
        assert!(url.starts_with(&format!("{}/", server.origin())), "{url}");
    }
}

/// Puts a changed file into a site, as a newer version of it would have it.
fn change(site: &Path, name: &str, from: &str, to: &str, hash_of: &str) {
    let file = site.join(name);
    let text = fs::read_to_string(&file).expect("a file");
    let changed = text.replacen(from, to, 1);
    assert_ne!(text, changed);
    fs::write(&file, &changed).expect("written");
    let worker = site.join("service-worker.js");
    let text = fs::read_to_string(&worker).expect("a worker");
    let line = text
        .lines()
        .find(|line| line.starts_with("const SITE = "))
        .expect("a list");
    let json = line
        .trim_start_matches("const SITE = ")
        .trim_end_matches(';');
    let mut list: Value = serde_json::from_str(json).expect("JSON");
    let hash = format!("{:x}", Sha256::digest(hash_of.replacen(from, to, 1)));
    list["version"] = Value::from(&hash[..16]);
    list["files"][name] = json!({ "hash": hash, "bytes": changed.len() });
    fs::write(
        &worker,
        text.replace(line, &format!("const SITE = {list};")),
    )
    .expect("written");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_newer_version_comes_as_a_whole_and_when_the_user_agrees() {
    let folder = tempfile::tempdir().expect("a folder");
    let site_copy = folder.path().join("site");
    copy_folder(&site(), &site_copy);
    let page = kept(&site_copy).await;
    let update =
        "navigator.serviceWorker.getRegistration().then((r) => r.update()).catch(() => {})";
    let title = "document.querySelector('#intake-title').textContent";
    let (old, new) = (
        "Do the keypoints track the objects?</h1>",
        "Are the objects tracked?</h1>",
    );
    let index = fs::read_to_string(site_copy.join("index.html")).expect("a page");

    // Half a deployment: the list names another content than the server has. The old version stays.
    change(
        &site_copy,
        "ui/base.css",
        ":root {",
        "\n:root {",
        "something else",
    );
    page.value(update).await;
    page.until(
        "navigator.serviceWorker.getRegistration().then((r) => !r.installing && !r.waiting)",
    )
    .await;
    page.goto("/").await;
    page.until("!document.querySelector('#try-example').disabled")
        .await;
    assert_eq!(
        page.value("document.querySelector('#update').hidden").await,
        true
    );

    // The whole of it, with another change.
    let style = fs::read_to_string(site_copy.join("ui/base.css")).expect("a style");
    change(&site_copy, "ui/base.css", "\n:root {", ":root {", &style);
    change(&site_copy, "index.html", old, new, &index);
    // A deployment of a later time: hosts tell changes apart by the second.
    let later = SystemTime::now() + Duration::from_secs(10);
    for name in ["ui/base.css", "index.html", "service-worker.js"] {
        let file = fs::File::options().append(true).open(site_copy.join(name));
        file.and_then(|file| file.set_modified(later))
            .expect("dated");
    }
    // Asked again and again: a browser that is just looking, as it does after a visit, may have
    // seen the state before.
    page.until(&format!(
        "{update}.then(() => !document.querySelector('#update').hidden)"
    ))
    .await;
    // Nothing has changed for this page, nor for one opened now.
    page.goto("/").await;
    page.until("!document.querySelector('#update').hidden")
        .await;
    assert_eq!(
        page.value(title).await,
        "Do the keypoints track the objects?"
    );

    page.click("#use-update").await;
    page.until(&format!("{title} === 'Are the objects tracked?'"))
        .await;
    page.until("caches.keys().then((names) => names.length === 1)")
        .await;
    page.close().await;
}
