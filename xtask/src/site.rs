//! `cargo xtask site`: the page and the package it loads, in one folder that any static host
//! serves.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::{NamedTempFile, TempDir};
use zip::write::{SimpleFileOptions, ZipWriter};

use crate::package::Build;
use crate::setup::Minifier;
use crate::workspace::Workspace;
use crate::{package, setup};

/// Marks a folder as made here and lists what was put into it, each file with its SHA-256.
const MARKER: &str = "tracklens-site.json";

/// Keeps a copy of the site in the browser, and has to know its files for that.
const WORKER: &str = "service-worker.js";
/// Where libraries of others lie in the site.
const LIBRARIES: &str = "vendor/";
const PLACEHOLDER: &str = r#"const SITE = { version: "", files: {} };"#;

/// The frames of the example, which a host would be asked for one by one, and the archive that the
/// site has in their place.
const FRAMES: &str = "example/frames/";
const ARCHIVE: &str = "example/frames.zip";

/// Where each file of the site comes from, by its path in the site with `/` between the parts.
type Sources = BTreeMap<String, PathBuf>;

/// Writes the site into `out`, with or without extraction on GPUs, or brings one written before up
/// to date: files of the last time that are gone are removed, files of somebody else stay. Of a full
/// build the scripts are made small as well.
///
/// # Errors
/// `out` holds files but was not made here, or lies in the sources; a source is missing; a file
/// cannot be written.
pub fn write(workspace: &Workspace, out: &Path, build: Build, gpu: bool) -> Result<()> {
    let out =
        std::path::absolute(out).with_context(|| format!("cannot resolve {}", out.display()))?;
    let existing = out
        .ancestors()
        .find_map(|folder| folder.canonicalize().ok())
        .unwrap_or_default();
    for sources in [workspace.web(), workspace.package()] {
        if sources
            .canonicalize()
            .is_ok_and(|sources| existing.starts_with(sources))
        {
            bail!(
                "{} is among the sources of the site; give another folder",
                out.display()
            );
        }
    }
    let before = files_before(&out)?;
    let sources = sources(workspace, gpu)?;

    let mut contents = BTreeMap::new();
    for (name, source) in &sources {
        let content =
            fs::read(source).with_context(|| format!("cannot read {}", source.display()))?;
        contents.insert(name.as_str(), content);
    }
    pack_frames(&mut contents)?;
    if build == Build::Full {
        match setup::minifier(workspace) {
            Ok(minifier) => minify(&minifier, &mut contents)?,
            Err(error) => eprintln!(
                "warning: without esbuild the scripts are larger than they could be: {error:#}"
            ),
        }
    }
    if let Some(worker) = contents.remove(WORKER) {
        let worker = with_files(&worker, &contents)?;
        contents.insert(WORKER, worker);
    }
    let hashes: BTreeMap<&str, String> = contents
        .iter()
        .map(|(name, c)| (*name, sha256(c)))
        .collect();
    let marker = serde_json::to_vec_pretty(
        &json!({ "tracklens": env!("CARGO_PKG_VERSION"), "files": hashes }),
    )?;

    let is_gone = |name: &&String| !contents.contains_key(name.as_str());
    for name in before.iter().filter(is_gone) {
        let gone = joined(&out, name);
        eprintln!("removing {}", gone.display());
        fs::remove_file(&gone).with_context(|| format!("cannot remove {}", gone.display()))?;
    }
    // Before the files, so that a folder left half written is known as ours the next time.
    put(&out.join(MARKER), &marker)?;
    for (name, content) in &contents {
        put(&joined(&out, name), content)?;
    }
    println!("{}: {} files", out.display(), contents.len());
    Ok(())
}

/// Puts the frames of the example into an archive, stored as they are: images are packed already.
fn pack_frames(contents: &mut BTreeMap<&str, Vec<u8>>) -> Result<()> {
    let frames: Vec<_> = contents
        .extract_if(.., |name, _| name.starts_with(FRAMES))
        .collect();
    if frames.is_empty() {
        return Ok(());
    }
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, frame) in frames {
        archive.start_file(&name[FRAMES.len()..], stored)?;
        archive.write_all(&frame)?;
    }
    contents.insert(ARCHIVE, archive.finish()?.into_inner());
    Ok(())
}

/// Makes the page's scripts and those of the package small, each on its own. Libraries are small, and
/// the worker is still to be filled in.
fn minify(minifier: &Minifier, contents: &mut BTreeMap<&str, Vec<u8>>) -> Result<()> {
    let is_script =
        |name: &str| name.ends_with(".js") && !name.starts_with(LIBRARIES) && name != WORKER;
    let folder = || TempDir::new().context("no folder for scripts");
    let (from, to) = (folder()?, folder()?);
    let mut scripts = Vec::new();
    for (name, content) in contents.iter().filter(|(name, _)| is_script(name)) {
        let script = joined(from.path(), name);
        put(&script, content)?;
        scripts.push(script);
    }
    minifier.run(from.path(), to.path(), &scripts)?;
    for (name, content) in contents.iter_mut().filter(|(name, _)| is_script(name)) {
        let script = joined(to.path(), name);
        *content =
            fs::read(&script).with_context(|| format!("cannot read {}", script.display()))?;
    }
    Ok(())
}

/// The service worker with the list of all other files: their hashes, their sizes, and a version
/// that changes with any of them or with the worker itself.
fn with_files(worker: &[u8], contents: &BTreeMap<&str, Vec<u8>>) -> Result<Vec<u8>> {
    let worker = std::str::from_utf8(worker).with_context(|| format!("{WORKER} is not UTF-8"))?;
    let file = |content: &Vec<u8>| json!({ "hash": sha256(content), "bytes": content.len() });
    let files: BTreeMap<&str, Value> = contents.iter().map(|(name, c)| (*name, file(c))).collect();
    let version = sha256(format!("{worker}{}", json!(files)).as_bytes());
    let site = json!({ "version": &version[..16], "files": files });
    let (before, rest) = worker
        .split_once(PLACEHOLDER)
        .with_context(|| format!("{WORKER} has no line `{PLACEHOLDER}`"))?;
    Ok(format!("{before}const SITE = {site};{rest}").into_bytes())
}

fn sha256(content: &[u8]) -> String {
    format!("{:x}", Sha256::digest(content))
}

/// The files that were put into the folder the last time and are still there.
fn files_before(out: &Path) -> Result<Vec<String>> {
    let marker = out.join(MARKER);
    if let Ok(content) = fs::read(&marker) {
        let marker_of: Value = serde_json::from_slice(&content)
            .with_context(|| format!("{} is damaged; delete the folder", marker.display()))?;
        let files = marker_of["files"]
            .as_object()
            .into_iter()
            .flat_map(|files| files.keys().cloned());
        return Ok(files
            .filter(|name| is_inside(name) && joined(out, name).is_file())
            .collect());
    }
    let is_empty = match fs::read_dir(out) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => true,
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", out.display())),
    };
    if !is_empty {
        bail!(
            "{} holds files that `cargo xtask site` did not put there (it has no {MARKER}); \
             give an empty or a new folder",
            out.display()
        );
    }
    Ok(Vec::new())
}

/// Everything in web/ but hidden files, libraries, and of the package what a browser loads.
fn sources(workspace: &Workspace, gpu: bool) -> Result<Sources> {
    let mut sources = Sources::new();
    add_folder(&workspace.web(), "", &mut sources)?;
    if !sources.contains_key("index.html") {
        bail!("{} has no index.html", workspace.web().display());
    }
    for (place, file) in setup::page_files(workspace) {
        sources.insert(place.to_owned(), file);
    }
    for file in package::for_browsers(&workspace.package(), gpu)? {
        let place = format!("pkg/{file}");
        if sources
            .insert(place.clone(), workspace.package().join(file))
            .is_some()
        {
            bail!("web/{place} is in the way of the built package");
        }
    }
    Ok(sources)
}

fn add_folder(folder: &Path, prefix: &str, sources: &mut Sources) -> Result<()> {
    let unreadable = || format!("cannot read {}", folder.display());
    for entry in fs::read_dir(folder).with_context(unreadable)? {
        let entry = entry.with_context(unreadable)?;
        let Ok(name) = entry.file_name().into_string() else {
            bail!("{} has a name that is not Unicode", entry.path().display());
        };
        if name.starts_with('.') {
            continue;
        }
        if entry.path().is_dir() {
            add_folder(&entry.path(), &format!("{prefix}{name}/"), sources)?;
        } else {
            sources.insert(format!("{prefix}{name}"), entry.path());
        }
    }
    Ok(())
}

/// Whether a name from a marker stays in the folder of the marker.
fn is_inside(name: &str) -> bool {
    name.split('/')
        .all(|part| !["", ".", ".."].contains(&part) && !part.contains(['\\', ':']))
}

fn joined(folder: &Path, name: &str) -> PathBuf {
    name.split('/')
        .fold(folder.to_owned(), |path, part| path.join(part))
}

/// Writes a file at once and only if its content is another one, so that its time says when it
/// changed.
fn put(file: &Path, content: &[u8]) -> Result<()> {
    if fs::read(file).is_ok_and(|last| last == content) {
        return Ok(());
    }
    let folder = file.parent().unwrap_or(Path::new("."));
    let written = fs::create_dir_all(folder).and_then(|()| {
        let temporary = NamedTempFile::new_in(folder)?;
        fs::write(&temporary, content)?;
        readable_by_all(&temporary)?;
        temporary.persist(file)?;
        Ok(())
    });
    written.with_context(|| format!("cannot write {}", file.display()))
}

/// Temporary files are private, those of a site are not.
#[cfg(unix)]
fn readable_by_all(file: &NamedTempFile) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.as_file()
        .set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable_by_all(_: &NamedTempFile) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn workspace(folder: &Path) -> Result<Workspace> {
        for (file, content) in [
            ("web/index.html", "<!doctype html>"),
            ("web/example/truth.csv", "sequence,frame,object,x,y"),
            ("web/.hidden", ""),
            (
                "pkg/package.json",
                r#"{ "files": ["index.js", "index.d.ts", "node.js", "tracklens_bg.wasm"] }"#,
            ),
            ("pkg/index.js", "export {};"),
            ("pkg/node.js", "export {};"),
            ("pkg/tracklens_bg.wasm", "\0asm"),
        ] {
            put(&folder.join(file), content.as_bytes())?;
        }
        Ok(Workspace::at(folder))
    }

    fn files(folder: &Path) -> Result<Vec<String>> {
        let mut sources = Sources::new();
        add_folder(folder, "", &mut sources)?;
        Ok(sources.into_keys().collect())
    }

    #[test]
    fn the_site_has_the_page_and_what_a_browser_loads_of_the_package() -> Result<()> {
        let folder = TempDir::new()?;
        let out = folder.path().join("out");
        write(&workspace(folder.path())?, &out, Build::Quick, false)?;
        let expected = [
            "example/truth.csv",
            "index.html",
            "pkg/index.js",
            "pkg/tracklens_bg.wasm",
            MARKER,
        ];
        assert_eq!(files(&out)?, expected);
        Ok(())
    }

    #[test]
    fn the_frames_of_the_example_are_one_file() -> Result<()> {
        let folder = TempDir::new()?;
        let out = folder.path().join("out");
        let workspace = workspace(folder.path())?;
        let frame = workspace
            .web()
            .join("example/frames/seq_0000/frame_000.png");
        put(&frame, b"an image")?;
        write(&workspace, &out, Build::Quick, false)?;
        let of_example = || -> Result<Vec<String>> {
            let mut files = files(&out)?;
            files.retain(|file| file.starts_with("example/"));
            Ok(files)
        };
        assert_eq!(of_example()?, ["example/frames.zip", "example/truth.csv"]);
        let bytes = fs::read(out.join("example/frames.zip"))?;
        // Names and content stand in it as they are, and the same frames make the same archive.
        let has = |part: &[u8]| bytes.windows(part.len()).any(|window| window == part);
        assert!(has(b"seq_0000/frame_000.png") && has(b"an image"));
        write(&workspace, &out, Build::Quick, false)?;
        assert_eq!(fs::read(out.join("example/frames.zip"))?, bytes);
        fs::remove_file(&frame)?;
        write(&workspace, &out, Build::Quick, false)?;
        assert_eq!(of_example()?, ["example/truth.csv"]);
        Ok(())
    }

    #[test]
    fn extraction_on_gpus_is_in_the_site_when_asked_for() -> Result<()> {
        let folder = TempDir::new()?;
        let out = folder.path().join("out");
        let workspace = workspace(folder.path())?;
        put(
            &folder.path().join("pkg/package.json"),
            br#"{ "files": ["index.js", "gpu.js", "tracklens_gpu_bg.wasm"] }"#,
        )?;
        for file in ["pkg/gpu.js", "pkg/tracklens_gpu_bg.wasm"] {
            put(&folder.path().join(file), b"")?;
        }
        let of_package = || -> Result<Vec<String>> {
            let mut files = files(&out)?;
            files.retain(|file| file.starts_with("pkg/"));
            Ok(files)
        };
        write(&workspace, &out, Build::Quick, true)?;
        assert_eq!(
            of_package()?,
            ["pkg/gpu.js", "pkg/index.js", "pkg/tracklens_gpu_bg.wasm"]
        );
        write(&workspace, &out, Build::Quick, false)?;
        assert_eq!(of_package()?, ["pkg/index.js"]);
        Ok(())
    }

    #[test]
    fn a_site_is_brought_up_to_date_and_foreign_files_in_it_stay() -> Result<()> {
        let folder = TempDir::new()?;
        let out = folder.path().join("out");
        let workspace = workspace(folder.path())?;
        write(&workspace, &out, Build::Quick, false)?;
        fs::write(out.join("CNAME"), "tracklens.example")?;
        fs::remove_file(workspace.web().join("example/truth.csv"))?;
        fs::write(workspace.web().join("index.html"), "new")?;
        write(&workspace, &out, Build::Quick, false)?;
        assert_eq!(
            files(&out)?,
            [
                "CNAME",
                "index.html",
                "pkg/index.js",
                "pkg/tracklens_bg.wasm",
                MARKER
            ]
        );
        assert_eq!(fs::read_to_string(out.join("index.html"))?, "new");
        Ok(())
    }

    #[test]
    fn the_service_worker_knows_the_files_and_changes_with_any_of_them() -> Result<()> {
        let folder = TempDir::new()?;
        let out = folder.path().join("out");
        let workspace = workspace(folder.path())?;
        let worker = workspace.web().join(WORKER);
        put(
            &worker,
            format!("// why\n{PLACEHOLDER}\nserve(SITE);").as_bytes(),
        )?;
        let site = || -> Result<(Value, String)> {
            write(&workspace, &out, Build::Quick, false)?;
            let text = fs::read_to_string(out.join(WORKER))?;
            let line = text.lines().nth(1).unwrap_or_default();
            let json = line
                .strip_prefix("const SITE = ")
                .and_then(|rest| rest.strip_suffix(';'));
            Ok((
                serde_json::from_str(json.context("no list of files")?)?,
                text,
            ))
        };
        let (first, text) = site()?;
        assert!(text.starts_with("// why\n") && text.ends_with("\nserve(SITE);"));
        let files = first["files"].as_object().context("no files")?;
        let names: Vec<&str> = files.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            [
                "example/truth.csv",
                "index.html",
                "pkg/index.js",
                "pkg/tracklens_bg.wasm"
            ]
        );
        assert_eq!(files["pkg/tracklens_bg.wasm"]["bytes"], 4);
        assert_eq!(files["index.html"]["hash"], sha256(b"<!doctype html>"));
        assert_eq!(site()?.0, first);
        fs::write(workspace.web().join("example/truth.csv"), "frame,x,y")?;
        assert_ne!(site()?.0["version"], first["version"]);
        fs::write(&worker, "no list")?;
        assert!(site().is_err());
        Ok(())
    }

    #[test]
    fn a_folder_with_other_files_is_refused_and_left_alone() -> Result<()> {
        let folder = TempDir::new()?;
        let out = folder.path().join("out");
        put(&out.join("thesis.tex"), b"")?;
        let error = write(&workspace(folder.path())?, &out, Build::Quick, false)
            .map_err(|error| error.to_string());
        assert!(error.is_err_and(|message| message.contains("did not put there")));
        assert_eq!(files(&out)?, ["thesis.tex"]);
        Ok(())
    }

    #[test]
    fn the_sources_are_refused_as_the_place_of_the_site() -> Result<()> {
        let folder = TempDir::new()?;
        let workspace = workspace(folder.path())?;
        let inside = workspace.web().join("site");
        assert!(write(&workspace, &inside, Build::Quick, false).is_err());
        assert!(!inside.exists());
        Ok(())
    }

    #[test]
    fn a_marker_cannot_name_files_elsewhere() {
        assert!(is_inside("pkg/index.js"));
        for name in ["../index.js", "/etc/passwd", "pkg//x", r"..\x", "c:x", ""] {
            assert!(!is_inside(name), "{name}");
        }
    }
}
