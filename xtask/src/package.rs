//! `cargo xtask build`: the wasm package in pkg/.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result, bail};
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use wasm_bindgen_cli_support::Bindgen;

use crate::run;
use crate::setup::{NPM_LOCK, WasmOpt, wasm_opt, wasm_toolchain};
use crate::workspace::Workspace;

/// The files that are built into pkg/.
pub const GENERATED: [&str; 3] = ["tracklens.js", WASM, "tracklens.d.ts"];

const WASM: &str = "tracklens_bg.wasm";

/// What cargo builds for wasm.
pub const LIBRARY: [&str; 5] = [
    "--package=tracklens",
    "--lib",
    "--no-default-features",
    "--features=web",
    "--profile=wasm",
];

/// Optimisation, and what the compiler may use of wasm, should the file not say so itself.
const WASM_OPT: [&str; 9] = [
    "-O3",
    "--enable-bulk-memory",
    "--enable-bulk-memory-opt",
    "--enable-multivalue",
    "--enable-mutable-globals",
    "--enable-nontrapping-float-to-int",
    "--enable-reference-types",
    "--enable-sign-ext",
    "--enable-simd",
];

/// Builds the package unless it is up to date, and prints the size of its wasm file.
///
/// # Errors
/// No toolchain for wasm, or the build fails. A missing wasm-opt is only reported.
pub fn build(workspace: &Workspace) -> Result<()> {
    let toolchain = wasm_toolchain(workspace)?;
    let optimiser = match wasm_opt(workspace) {
        Ok(optimiser) => Some(optimiser),
        Err(error) => {
            eprintln!(
                "warning: the wasm file stays larger and slower than need be, without wasm-opt: {error:#}"
            );
            None
        }
    };
    run::run(
        toolchain
            .cargo("build")
            .args(LIBRARY)
            .current_dir(workspace.root()),
    )?;
    let compiled = toolchain.folder(workspace).join("wasm/tracklens.wasm");

    let package = workspace.package();
    let stamp = Stamp::new(&compiled, optimiser.is_some())?;
    let stamp_file = workspace.tools().join("package.stamp");
    let last = fs::read_to_string(&stamp_file).ok();
    if last.is_some() && last == stamp.complete(&package).ok() {
        eprintln!("{} is up to date", package.display());
    } else {
        generate(&compiled, optimiser.as_ref(), &package)?;
        let stamp = stamp.complete(&package)?;
        fs::create_dir_all(workspace.tools())
            .and_then(|()| fs::write(&stamp_file, stamp))
            .with_context(|| format!("cannot write {}", stamp_file.display()))?;
    }
    let wasm = read(&package.join(WASM))?;
    println!("{}", sizes(WASM, &wasm)?);
    Ok(())
}

/// The files of the built package that a browser loads: scripts and wasm, without node's entry point.
///
/// # Errors
/// `package.json` cannot be read or lists no files.
pub fn for_browsers(package: &Path) -> Result<Vec<String>> {
    let manifest = package.join("package.json");
    let content: Value = serde_json::from_slice(&read(&manifest)?)
        .with_context(|| format!("{} is not JSON", manifest.display()))?;
    let files = content["files"]
        .as_array()
        .with_context(|| format!("{} lists no `files`", manifest.display()))?;
    let files = files.iter().filter_map(Value::as_str);
    let loaded =
        files.filter(|file| (file.ends_with(".js") || file.ends_with(".wasm")) && *file != "node.js");
    Ok(loaded.map(str::to_owned).collect())
}

/// Makes the bindings and the optimised file in a temporary folder, then puts them into place.
fn generate(compiled: &Path, optimiser: Option<&WasmOpt>, package: &Path) -> Result<()> {
    let temporary = TempDir::with_prefix_in(".build-", package)
        .with_context(|| format!("cannot make a folder in {}", package.display()))?;
    let folder = temporary.path();
    eprintln!("wasm-bindgen {}", compiled.display());
    Bindgen::new()
        .input_path(compiled)
        .out_name("tracklens")
        .web(true)?
        .omit_default_module_path(false)
        .typescript(true)
        .remove_name_section(true)
        .remove_producers_section(true)
        .generate(folder)
        .with_context(|| format!("wasm-bindgen cannot make bindings for {}", compiled.display()))?;
    if folder.join("snippets").exists() {
        bail!(
            "the crate or a dependency brings JavaScript of its own (`inline_js` or `module`), \
             for which the package has no place"
        );
    }
    if let Some(optimiser) = optimiser {
        let wasm = folder.join(WASM);
        let mut command = optimiser.command();
        run::run(command.args(WASM_OPT).arg(&wasm).arg("-o").arg(&wasm))?;
    }
    for file in GENERATED {
        let place = package.join(file);
        fs::rename(folder.join(file), &place).with_context(|| format!("cannot write {}", place.display()))?;
    }
    Ok(())
}

/// What decides whether the package is up to date: the compiled file, what is done to it, and the files that
/// came out.
struct Stamp(Sha256);

impl Stamp {
    fn new(compiled: &Path, optimised: bool) -> Result<Self> {
        let mut hash = Sha256::new();
        hash.update(read(compiled)?);
        hash.update(include_bytes!("package.rs"));
        if optimised {
            hash.update(NPM_LOCK);
        }
        Ok(Self(hash))
    }

    fn complete(&self, package: &Path) -> Result<String> {
        let mut hash = self.0.clone();
        for file in GENERATED {
            hash.update(read(&package.join(file))?);
        }
        Ok(format!("{:x}", hash.finalize()))
    }
}

fn read(file: &Path) -> Result<Vec<u8>> {
    fs::read(file).with_context(|| format!("cannot read {}", file.display()))
}

/// One line: the size of a file as it is and as a server sends it, compressed.
fn sizes(name: &str, content: &[u8]) -> Result<String> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(content)?;
    let compressed = encoder.finish()?;
    Ok(format!(
        "{name}: {} ({} gzipped)",
        kib(content.len()),
        kib(compressed.len())
    ))
}

fn kib(bytes: usize) -> String {
    format!("{:.1} KiB", bytes as f64 / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_given_raw_and_gzipped() -> Result<()> {
        let line = sizes("a.wasm", &[7; 64 * 1024])?;
        assert!(line.starts_with("a.wasm: 64.0 KiB (0."), "{line}");
        assert!(line.ends_with(" KiB gzipped)"), "{line}");
        Ok(())
    }

    #[test]
    fn the_npm_package_ships_what_is_built() -> Result<()> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pkg/package.json");
        let manifest: Value = serde_json::from_slice(&read(&manifest)?)?;
        let files = manifest["files"]
            .as_array()
            .context("pkg/package.json lists no files")?;
        for file in GENERATED {
            assert!(
                files.iter().any(|listed| listed == file),
                "{file} is not among `files`"
            );
        }
        assert_eq!(manifest["version"], env!("CARGO_PKG_VERSION"));
        Ok(())
    }
}
