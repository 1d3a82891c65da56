//! The imports between the scripts of the page.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use walkdir::WalkDir;

use crate::graph::{Graph, Import, Kind};

/// Reads the scripts below a folder. Imports of files outside it are left out.
///
/// # Errors
/// A script cannot be read, or imports a file of the folder that does not exist.
pub fn graph(folder: &Path) -> Result<Graph> {
    let mut sources = BTreeMap::new();
    for entry in WalkDir::new(folder) {
        let entry = entry.context("cannot read the scripts")?;
        let is_script = entry.path().extension().is_some_and(|ext| ext == "js");
        if is_script && let Ok(name) = entry.path().strip_prefix(folder) {
            let text = fs::read_to_string(entry.path())
                .with_context(|| format!("cannot read {}", entry.path().display()))?;
            sources.insert(name.to_string_lossy().replace('\\', "/"), text);
        }
    }
    let shown = folder.file_name().unwrap_or_default().to_string_lossy();
    of_sources(&shown, &sources)
}

fn of_sources(folder: &str, sources: &BTreeMap<String, String>) -> Result<Graph> {
    let files: Vec<String> = sources.keys().cloned().collect();
    let mut imports = Vec::new();
    for (from, (name, text)) in sources.iter().enumerate() {
        for (line, specifier) in specifiers(text) {
            // The package and vendored libraries are put there when the site is built.
            let Some(target) = resolved(name, specifier).filter(|target| {
                !["pkg/", "vendor/"]
                    .iter()
                    .any(|dir| target.starts_with(dir))
            }) else {
                continue;
            };
            let Ok(to) = files.binary_search(&target) else {
                bail!("{folder}/{name}:{line} imports \"{specifier}\", which does not exist");
            };
            imports.push(Import {
                from,
                line,
                to,
                text: specifier.to_owned(),
                kind: Kind::Use,
            });
        }
    }
    Ok(Graph {
        folder: folder.to_owned(),
        files,
        imports,
    })
}

/// The relative paths after `from`, `import` and `import(`, with their lines. Comments, where types
/// are imported, do not count.
fn specifiers(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().flat_map(|(index, line)| {
        let code = match line.trim_start() {
            comment if comment.starts_with('*') => "",
            _ => {
                let end = [line.find("//"), line.find("/*")]
                    .into_iter()
                    .flatten()
                    .min();
                end.map_or(line, |end| &line[..end])
            }
        };
        let quoted = code.split('"').collect::<Vec<_>>();
        let pairs: Vec<_> = quoted.chunks(2).map(<[&str]>::to_vec).collect();
        pairs.into_iter().filter_map(move |pair| {
            let [before, specifier] = pair[..] else {
                return None;
            };
            let before = before.trim_end();
            let imports = ["from", "import", "import("]
                .iter()
                .any(|w| before.ends_with(w));
            (imports && specifier.starts_with('.')).then_some((index + 1, specifier))
        })
    })
}

/// The file that a path relative to another file names, if it lies in the folder.
fn resolved(importer: &str, specifier: &str) -> Option<String> {
    let mut parts: Vec<&str> = importer.split('/').collect();
    parts.pop();
    for part in specifier.split('/') {
        match part {
            "." => {}
            ".." => drop(parts.pop()?),
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph_of(sources: &[(&str, &str)]) -> Result<Graph> {
        let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
        of_sources("web", &sources.iter().map(owned).collect())
    }

    #[test]
    fn a_circle_through_folders_is_found() -> Result<()> {
        let graph = graph_of(&[
            ("app.js", "import { show } from \"./viewer/stage.js\";\n"),
            (
                "dom.js",
                "const late = await import(\"./viewer/stage.js\");\n",
            ),
            ("viewer/stage.js", "import {\n  h,\n} from \"../dom.js\";\n"),
        ])?;
        assert_eq!(
            graph.circles(),
            ["2 files import each other in a circle:\n  \
              web/dom.js:1: `./viewer/stage.js` from viewer/stage.js\n  \
              web/viewer/stage.js:3: `../dom.js` from dom.js"]
        );
        Ok(())
    }

    #[test]
    fn types_and_the_package_do_not_count() -> Result<()> {
        let graph = graph_of(&[
            (
                "a.js",
                "import \"./b.js\";\nimport init from \"./pkg/index.js\";\n",
            ),
            (
                "b.js",
                "/** @type {import(\"./a.js\").A} */\n * @typedef {import(\"./a.js\").B} B\n",
            ),
        ])?;
        assert_eq!(graph.imports.len(), 1);
        assert_eq!(graph.circles(), [""; 0]);
        Ok(())
    }

    #[test]
    fn an_import_of_a_missing_script_is_an_error() {
        let error = graph_of(&[("a.js", "\nimport { b } from \"./b.js\";\n")]).map(drop);
        assert_eq!(
            error.map_err(|error| error.to_string()),
            Err("web/a.js:2 imports \"./b.js\", which does not exist".to_owned())
        );
    }
}
