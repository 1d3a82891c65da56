//! `cargo xtask build`: the wasm package in pkg/.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::OnceLock;
use std::thread;

use anyhow::{Context, Result, bail};
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use wasm_bindgen_cli_support::Bindgen;

use crate::run;
use crate::setup::{NPM_LOCK, WasmOpt, WasmToolchain, page_libraries, wasm_opt, wasm_toolchain};
use crate::workspace::Workspace;

/// The parts of the package, each a WebAssembly module with its script, by the feature that makes
/// it.
pub const PARTS: [Part; 12] = [
    Part {
        name: "tracklens_scoring",
        feature: "web-scoring",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
    Part {
        name: "tracklens_space",
        feature: "web-space",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
    Part {
        name: "tracklens_doctor",
        feature: "web-doctor",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
    Part {
        name: "tracklens_extraction",
        feature: "web-extraction",
        profile: "wasm",
        aim: Aim::Speed,
    },
    Part {
        name: "tracklens_images",
        feature: "web-images",
        profile: "wasm",
        aim: Aim::Speed,
    },
    Part {
        name: "tracklens_formats",
        feature: "web-formats",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
    Part {
        name: "tracklens_parquet",
        feature: "web-parquet",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
    Part {
        name: "tracklens_zarr",
        feature: "web-zarr",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
    Part {
        name: "tracklens_onnx",
        feature: "web-onnx",
        profile: "wasm",
        aim: Aim::Size,
    },
    Part {
        name: "tracklens_temporal",
        feature: "web-temporal",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
    Part {
        name: "tracklens_figures",
        feature: "web-figures",
        profile: "wasm",
        aim: Aim::Size,
    },
    Part {
        name: "tracklens_comparison",
        feature: "web-comparison",
        profile: "wasm",
        aim: Aim::LeastSize,
    },
];

/// The part that extracts on WebGPU. With it comes burn, which takes minutes to compile, so it is
/// built when asked for.
pub const GPU: Part = Part {
    name: "tracklens_gpu",
    feature: "web-gpu",
    profile: "wasm-gpu",
    aim: Aim::Size,
};

/// What a build is for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Build {
    /// For a browser on this machine: every part is the same module, which holds all of them and is
    /// compiled once, not optimised as a whole. That takes a third of the time and is larger.
    Quick,
    /// For others: as small and fast as can be.
    Full,
}

/// A WebAssembly module of the package.
pub struct Part {
    /// The base name of its files.
    name: &'static str,
    feature: &'static str,
    /// Cargo's profile.
    profile: &'static str,
    aim: Aim,
}

/// What the crate's own code is optimised for.
enum Aim {
    /// What runs once a pixel.
    Speed,
    /// What runs once a point or a figure.
    Size,
    /// What every visit to the page waits for, or what has more to it than others.
    LeastSize,
}

impl Part {
    fn wasm(&self) -> String {
        format!("{}_bg.wasm", self.name)
    }

    fn script(&self) -> String {
        format!("{}.js", self.name)
    }

    /// The crate's own level of optimisation, for cargo; that of dependencies is in the profile.
    fn opt_level(&self) -> String {
        let level = match self.aim {
            Aim::Speed => "3",
            Aim::Size => "\"s\"",
            Aim::LeastSize => "\"z\"",
        };
        format!(
            "profile.{}.package.tracklens.opt-level={level}",
            self.profile
        )
    }

    fn generated(&self) -> [String; 3] {
        [self.script(), self.wasm(), format!("{}.d.ts", self.name)]
    }
}

/// The files that are built into pkg/.
pub fn generated() -> Vec<String> {
    PARTS
        .iter()
        .chain([&GPU])
        .flat_map(Part::generated)
        .collect()
}

/// What cargo builds for wasm, to be completed with features and a profile.
const LIBRARY: [&str; 3] = ["--package=tracklens", "--lib", "--no-default-features"];

/// The library with every part, as lints and docs look at it.
pub const WHOLE: [&str; 5] = [
    LIBRARY[0],
    LIBRARY[1],
    LIBRARY[2],
    "--profile=wasm",
    "--features=web",
];

/// The module of a quick build. Its profile is the one of xtask, whose procedural macros then serve
/// both.
const QUICK: Part = Part {
    name: "all of them in one",
    feature: "web",
    profile: "tool",
    aim: Aim::Speed,
};

/// How the profile of xtask is changed for a quick build: what goes over every pixel or number of a
/// file is optimised, all else is not. What procedural macros are made of has to be missing here, as
/// they would be compiled again.
const QUICK_PROFILE: &[(&str, &[&str])] = &[
    (
        "3",
        &[
            "rten-gemm",
            "rten-simd",
            "rten-tensor",
            "rten-vecmath",
            "simd-adler32",
        ],
    ),
    ("1", &["image", "rten"]),
    (
        "\"s\"",
        &[
            "blusc",
            "crc32fast",
            "csv",
            "csv-core",
            "fdeflate",
            "flate2",
            "half",
            "hdf5-reader",
            "image-webp",
            "nalgebra",
            "ndarray",
            "png",
            "zrip-core",
            "zrip-decode",
            "zune-core",
            "zune-jpeg",
        ],
    ),
];

/// What the compiler may use of wasm, should the file not say so itself.
const WASM_OPT: [&str; 8] = [
    "--enable-bulk-memory",
    "--enable-bulk-memory-opt",
    "--enable-multivalue",
    "--enable-mutable-globals",
    "--enable-nontrapping-float-to-int",
    "--enable-reference-types",
    "--enable-sign-ext",
    "--enable-simd",
];

/// Builds the parts of the package that are not up to date, with or without the one for GPUs, and
/// prints their sizes if they are made for others.
///
/// Cargo compiles the parts one by one. Meanwhile npm installs its tools, and the parts that are
/// compiled are finished.
///
/// # Errors
/// No toolchain for wasm, or the build fails. A missing wasm-opt is only reported.
pub fn build(workspace: &Workspace, build: Build, gpu: bool) -> Result<()> {
    let toolchain = wasm_toolchain(workspace)?;
    let parts = || PARTS.iter().chain(gpu.then_some(&GPU));
    let count = parts().count();
    eprintln!("Building the page's {count} modules: minutes the first time, seconds from then on.");
    let optimiser = OnceLock::new();
    let optimiser = || {
        optimiser
            .get_or_init(|| npm_tools(workspace, build))
            .as_ref()
    };
    thread::scope(|scope| {
        scope.spawn(optimiser);
        let mut under_way = Vec::new();
        let together = match build {
            Build::Quick => Some(compile(workspace, &toolchain, &QUICK, &quick_profile())?),
            Build::Full => None,
        };
        for (index, part) in parts().enumerate() {
            let compiled = match &together {
                Some(together) if index == 0 => together.clone(),
                Some(_) if part.name != GPU.name => continue,
                _ => {
                    eprintln!("Compiling part {} of {count}: {}", index + 1, part.name);
                    compile(workspace, &toolchain, part, &[])?
                }
            };
            under_way.push(scope.spawn(move || {
                // wasm-opt would take minutes for the large one.
                let optimiser = optimiser().filter(|_| part.profile != GPU.profile);
                finish(workspace, part, compiled, optimiser)
            }));
        }
        under_way.into_iter().try_for_each(|part| {
            part.join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    })?;
    let package = workspace.package();
    if build == Build::Quick {
        let [first, others @ ..] = &PARTS;
        return others
            .iter()
            .try_for_each(|part| alias(&package, first, part));
    }
    for part in parts() {
        let size = |file: String| -> Result<[usize; 2]> {
            let content = read(&package.join(file))?;
            Ok([content.len(), gzipped(&content)?])
        };
        let ([wasm, wasm_sent], [script, script_sent]) = (size(part.wasm())?, size(part.script())?);
        println!(
            "{}: {} gzipped (wasm {} of {}, script {} of {})",
            part.name,
            kib(wasm_sent + script_sent),
            kib(wasm_sent),
            kib(wasm),
            kib(script_sent),
            kib(script)
        );
    }
    Ok(())
}

/// The libraries of the page and, for a full build, wasm-opt, if npm can install them.
fn npm_tools(workspace: &Workspace, build: Build) -> Option<WasmOpt> {
    if let Err(error) = page_libraries(workspace) {
        eprintln!("warning: the page will not read videos: {error:#}");
    }
    if build == Build::Quick {
        return None;
    }
    wasm_opt(workspace)
        .inspect_err(|error| {
            eprintln!(
                "warning: without wasm-opt the wasm files are larger and slower than they could be: \
                 {error:#}"
            );
        })
        .ok()
}

fn quick_profile() -> Vec<String> {
    let profile = QUICK.profile;
    let levels = QUICK_PROFILE.iter().flat_map(|(level, crates)| {
        let option =
            move |name| format!("--config=profile.{profile}.package.{name}.opt-level={level}");
        crates.iter().map(option)
    });
    let units = format!("--config=profile.{profile}.codegen-units=16");
    levels.chain([units]).collect()
}

/// The wasm file of a part as cargo leaves it.
fn compile(
    workspace: &Workspace,
    toolchain: &WasmToolchain,
    part: &Part,
    options: &[String],
) -> Result<Vec<u8>> {
    let profile = part.profile;
    let mut cargo = toolchain.cargo("rustc");
    // As a library for Rust too it would not be optimised as a whole.
    cargo.arg("--crate-type=cdylib");
    run::run(
        cargo
            .args(LIBRARY)
            .arg(format!("--profile={profile}"))
            .arg(format!("--features={}", part.feature))
            .args(options)
            .args(["--config", &part.opt_level()])
            .current_dir(workspace.root()),
    )?;
    let folder = toolchain.folder(workspace).join(profile);
    read(&folder.join("tracklens.wasm"))
}

/// Makes the files of a part, unless they are up to date.
fn finish(
    workspace: &Workspace,
    part: &Part,
    compiled: Vec<u8>,
    optimiser: Option<&WasmOpt>,
) -> Result<()> {
    let package = workspace.package();
    let stamp = Stamp::new(part, &compiled, optimiser.is_some());
    let stamp_file = workspace.tools().join(format!("{}.stamp", part.name));
    let last = fs::read_to_string(&stamp_file).ok();
    if last.is_some() && last == stamp.complete(&package).ok() {
        eprintln!("{} is up to date", package.join(part.wasm()).display());
        return Ok(());
    }
    generate(part, compiled, optimiser, &package)?;
    let stamp = stamp.complete(&package)?;
    fs::create_dir_all(workspace.tools())
        .and_then(|()| fs::write(&stamp_file, stamp))
        .with_context(|| format!("cannot write {}", stamp_file.display()))
}

/// Makes a part the first one under another name. With bindings of its own for the same module it
/// would export the same names again, which no browser takes.
fn alias(package: &Path, first: &Part, part: &Part) -> Result<()> {
    let put = |file: String, of: String| {
        let content = format!("export {{ default }} from \"./{of}\";\n");
        let file = package.join(file);
        fs::write(&file, content).with_context(|| format!("cannot write {}", file.display()))
    };
    put(part.script(), first.script())?;
    put(format!("{}.d.ts", part.name), first.script())?;
    let wasm = package.join(part.wasm());
    fs::copy(package.join(first.wasm()), &wasm)
        .map(drop)
        .with_context(|| format!("cannot write {}", wasm.display()))
}

/// The files of the built package that a browser loads: scripts and wasm, without Node's entry
/// point, with or without extraction on GPUs.
///
/// # Errors
/// `package.json` cannot be read or lists no files.
pub fn for_browsers(package: &Path, gpu: bool) -> Result<Vec<String>> {
    let manifest = package.join("package.json");
    let content: Value = serde_json::from_slice(&read(&manifest)?)
        .with_context(|| format!("{} is not JSON", manifest.display()))?;
    let files = content["files"]
        .as_array()
        .with_context(|| format!("{} lists no `files`", manifest.display()))?;
    let files = files.iter().filter_map(Value::as_str);
    let of_gpu =
        |file: &str| file == "gpu.js" || GPU.generated().iter().any(|generated| generated == file);
    let loaded = files.filter(|file| {
        (file.ends_with(".js") || file.ends_with(".wasm"))
            && *file != "node.js"
            && (gpu || !of_gpu(file))
    });
    Ok(loaded.map(str::to_owned).collect())
}

/// Makes the bindings and the optimised file in a temporary folder, then puts them into place.
fn generate(
    part: &Part,
    compiled: Vec<u8>,
    optimiser: Option<&WasmOpt>,
    package: &Path,
) -> Result<()> {
    let temporary = TempDir::with_prefix_in(".build-", package)
        .with_context(|| format!("cannot make a folder in {}", package.display()))?;
    let folder = temporary.path();
    eprintln!("wasm-bindgen {}", part.name);
    Bindgen::new()
        .input_bytes(part.name, compiled)
        .out_name(part.name)
        .web(true)?
        .omit_default_module_path(false)
        .typescript(true)
        .remove_name_section(true)
        .remove_producers_section(true)
        .generate(folder)
        .with_context(|| format!("wasm-bindgen cannot make bindings for {}", part.name))?;
    let script = folder.join(part.script());
    let checked = with_checked_arguments(&without_docs(&String::from_utf8(read(&script)?)?));
    fs::write(&script, checked).with_context(|| format!("cannot write {}", script.display()))?;
    if folder.join("snippets").exists() {
        bail!(
            "the crate or a dependency brings JavaScript of its own (`inline_js` or `module`), \
             for which the package has no place"
        );
    }
    if let Some(optimiser) = optimiser {
        let wasm = folder.join(part.wasm());
        let mut command = optimiser.command();
        match part.aim {
            // What the engine keeps apart has to stay apart: browsers optimise large functions
            // badly.
            Aim::Speed => command.args(["-O3", "--one-caller-inline-max-function-size=100"]),
            Aim::Size | Aim::LeastSize => command.arg("-Oz"),
        };
        command.args(WASM_OPT);
        run::run(command.arg(&wasm).arg("-o").arg(&wasm))?;
    }
    for file in part.generated() {
        let place = package.join(&file);
        fs::rename(folder.join(&file), &place)
            .with_context(|| format!("cannot write {}", place.display()))?;
    }
    Ok(())
}

/// What decides whether a part is up to date: the compiled file, what is done to it, and the files
/// that came out.
struct Stamp<'a> {
    part: &'a Part,
    hash: Sha256,
}

impl<'a> Stamp<'a> {
    fn new(part: &'a Part, compiled: &[u8], optimised: bool) -> Self {
        let mut hash = Sha256::new();
        hash.update(compiled);
        hash.update(include_bytes!("package.rs"));
        if optimised {
            hash.update(NPM_LOCK);
        }
        Self { part, hash }
    }

    fn complete(&self, package: &Path) -> Result<String> {
        let mut hash = self.hash.clone();
        for file in self.part.generated() {
            hash.update(read(&package.join(file))?);
        }
        Ok(format!("{:x}", hash.finalize()))
    }
}

/// The bindings without the docs of their functions, which the file of types has as well.
fn without_docs(script: &str) -> String {
    let mut inside = false;
    let is_code = |line: &&str| {
        let text = line.trim();
        let is_doc = inside || text.starts_with("/**");
        inside = is_doc && !text.ends_with("*/");
        !is_doc
    };
    let lines = script.lines().filter(is_code);
    lines.map(|line| format!("{line}\n")).collect()
}

/// The bindings with a check in each function that puts a text or an array into memory: with
/// something else in its place it would write where it must not.
fn with_checked_arguments(script: &str) -> String {
    let check = |line: &str| {
        let rest = line.strip_prefix("function pass")?;
        let (what, rest) = rest.split_once("ToWasm0(")?;
        let (argument, _) = rest.split_once(',')?;
        let (is_wrong, expected) = match what {
            "String" => (format!("typeof {argument} !== \"string\""), "a text"),
            _ => (
                format!("!ArrayBuffer.isView({argument}) && !Array.isArray({argument})"),
                "an array",
            ),
        };
        Some(format!(
            "    if ({is_wrong}) throw new TypeError(`expected {expected}, found ${{typeof {argument}}}`);\n"
        ))
    };
    let lines = script.lines();
    lines
        .map(|line| format!("{line}\n{}", check(line).unwrap_or_default()))
        .collect()
}

fn read(file: &Path) -> Result<Vec<u8>> {
    fs::read(file).with_context(|| format!("cannot read {}", file.display()))
}

/// The size of a file as a server sends it, compressed.
///
/// # Errors
/// Never, since it is written to memory.
pub fn gzipped(content: &[u8]) -> Result<usize> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(content)?;
    Ok(encoder.finish()?.len())
}

fn kib(bytes: usize) -> String {
    format!("{:.1} KiB", bytes as f64 / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_and_arrays_are_checked_before_they_go_into_memory() {
        let script = "function passStringToWasm0(arg, malloc, realloc) {\n    x();\n}\n\
                      function passArray8ToWasm0(arg, malloc) {\n}\nfunction other(arg, b) {\n}\n";
        let checked = with_checked_arguments(script);
        let checks: Vec<&str> = checked
            .lines()
            .filter(|line| line.contains("throw"))
            .collect();
        assert_eq!(checks.len(), 2);
        assert!(checks[0].contains("typeof arg !== \"string\""));
        assert!(checks[1].contains("ArrayBuffer.isView(arg)"));
        let unchanged = |line: &&str| !line.contains("throw");
        assert!(checked.lines().filter(unchanged).eq(script.lines()));
    }

    #[test]
    fn docs_are_left_out_of_the_bindings() {
        let script = "/* @ts-self-types */\n/**\n * Docs.\n */\nexport class A {\n    /** One line. */\n    \
                      go() {} // on\n}\n";
        assert_eq!(
            without_docs(script),
            "/* @ts-self-types */\nexport class A {\n    go() {} // on\n}\n"
        );
    }

    #[test]
    fn the_npm_package_ships_what_is_built() -> Result<()> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pkg/package.json");
        let manifest: Value = serde_json::from_slice(&read(&manifest)?)?;
        let files = manifest["files"]
            .as_array()
            .context("pkg/package.json lists no files")?;
        for file in generated() {
            assert!(
                files.iter().any(|listed| *listed == *file),
                "{file} is not among `files`"
            );
        }
        assert_eq!(manifest["version"], env!("CARGO_PKG_VERSION"));
        Ok(())
    }
}
