//! The layers that ARCHITECTURE.md lists.

use std::collections::BTreeSet;

use anyhow::{Result, bail};

use crate::graph::Graph;

/// What the fenced block of the layers starts with.
const FENCE: &str = "```layers";

/// Modules from top to bottom: one line a layer, modules separated by spaces, a comment after `#`.
/// A module is named by its path in `src`, as in `report/figures`; a file belongs to the longest name
/// that fits. The modules of a line do not import each other.
pub struct Layers {
    layers: Vec<Vec<String>>,
}

impl Layers {
    /// Reads the block from a Markdown document.
    ///
    /// # Errors
    /// The document has no such block, or a module stands in it twice.
    pub fn parse(document: &str) -> Result<Self> {
        let mut lines = document.lines().skip_while(|line| line.trim() != FENCE);
        if lines.next().is_none() {
            bail!("no block that starts with {FENCE}");
        }
        let layers: Vec<Vec<String>> = lines
            .take_while(|line| line.trim() != "```")
            .map(|line| line.split('#').next().unwrap_or_default())
            .map(|line| line.split_whitespace().map(str::to_owned).collect())
            .filter(|layer: &Vec<String>| !layer.is_empty())
            .collect();
        let mut modules: Vec<&String> = layers.iter().flatten().collect();
        modules.sort();
        if let Some(twice) = modules.windows(2).find(|pair| pair[0] == pair[1]) {
            bail!("the layers list `{}` twice", twice[0]);
        }
        Ok(Self { layers })
    }

    /// Descriptions of the imports that do not point down (one for each pair of files), of files that
    /// lie in no layer, and of modules without a file. `lib.rs` and `main.rs` lie above all.
    pub fn violations(&self, graph: &Graph) -> Vec<String> {
        let mut violations = Vec::new();
        for file in &graph.files {
            if !is_root(file) && self.place(file).is_none() {
                violations.push(format!(
                    "{}/{file} lies in no layer: add its module to the layers in ARCHITECTURE.md",
                    graph.folder
                ));
            }
        }
        for module in self.layers.iter().flatten() {
            let place = |file: &String| self.place(file).is_some_and(|(_, name)| name == module);
            if !graph.files.iter().any(place) {
                violations.push(format!(
                    "ARCHITECTURE.md lists the module `{module}`, which has no file in {}",
                    graph.folder
                ));
            }
        }
        let mut pairs = BTreeSet::new();
        for import in &graph.imports {
            let (from, to) = (&graph.files[import.from], &graph.files[import.to]);
            if is_root(from) {
                continue;
            }
            let Some((from_layer, from_module)) = self.place(from) else {
                continue;
            };
            let reason = match self.place(to) {
                _ if is_root(to) => format!("{to}, which lies above everything"),
                Some((_, to_module)) if to_module == from_module => continue,
                Some((to_layer, to_module)) if to_layer < from_layer => {
                    format!("`{to_module}`, which lies above `{from_module}`")
                }
                Some((to_layer, to_module)) if to_layer == from_layer => {
                    format!("`{to_module}`, which lies in the same layer as `{from_module}`")
                }
                _ => continue,
            };
            if pairs.insert((import.from, import.to)) {
                let place = graph.place(import);
                violations.push(format!("{place}: `{}` imports from {reason}", import.text));
            }
        }
        violations
    }

    /// The layer of a file, counted from the top, and the module it belongs to.
    fn place(&self, file: &str) -> Option<(usize, &str)> {
        let path = file.strip_suffix(".rs").unwrap_or(file);
        let path = path.strip_suffix("/mod").unwrap_or(path);
        let layers = self.layers.iter().enumerate();
        layers
            .flat_map(|(layer, modules)| modules.iter().map(move |module| (layer, module.as_str())))
            .filter(|(_, module)| {
                let rest = path.strip_prefix(module);
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            })
            .max_by_key(|(_, module)| module.len())
    }
}

fn is_root(file: &str) -> bool {
    ["lib.rs", "main.rs"].contains(&file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{Import, Kind};

    const DOCUMENT: &str = "# Architecture\n\n```layers\ncli web   # two faces\nreport\n\
         report/draw\nmetric\n```\n";

    fn graph(files: &[&str], imports: &[(usize, usize)]) -> Graph {
        let import = |&(from, to): &(usize, usize)| Import {
            from,
            line: 7,
            to,
            text: "crate::x".to_owned(),
            kind: Kind::Use,
        };
        Graph {
            folder: "src".to_owned(),
            files: files.iter().map(|file| (*file).to_owned()).collect(),
            imports: imports.iter().map(import).collect(),
        }
    }

    const FILES: [&str; 6] = [
        "lib.rs",
        "cli/mod.rs",
        "web.rs",
        "report/mod.rs",
        "report/draw/lines.rs",
        "metric.rs",
    ];

    #[test]
    fn imports_from_lower_layers_pass() -> Result<()> {
        let graph = graph(&FILES, &[(0, 1), (1, 5), (2, 3), (3, 4), (4, 5)]);
        assert_eq!(Layers::parse(DOCUMENT)?.violations(&graph), [""; 0]);
        Ok(())
    }

    #[test]
    fn an_upward_import_is_named_with_its_line() -> Result<()> {
        let graph = graph(&FILES, &[(4, 3), (1, 2), (5, 0)]);
        assert_eq!(
            Layers::parse(DOCUMENT)?.violations(&graph),
            [
                "src/report/draw/lines.rs:7: `crate::x` imports from `report`, which lies above \
                 `report/draw`",
                "src/cli/mod.rs:7: `crate::x` imports from `web`, which lies in the same layer as \
                 `cli`",
                "src/metric.rs:7: `crate::x` imports from lib.rs, which lies above everything",
            ]
        );
        Ok(())
    }

    #[test]
    fn every_file_has_a_layer_and_every_module_a_file() -> Result<()> {
        let mut files = FILES;
        files[5] = "metrics.rs";
        assert_eq!(
            Layers::parse(DOCUMENT)?.violations(&graph(&files, &[])),
            [
                "src/metrics.rs lies in no layer: add its module to the layers in ARCHITECTURE.md",
                "ARCHITECTURE.md lists the module `metric`, which has no file in src",
            ]
        );
        assert!(Layers::parse("# Architecture\n").is_err());
        assert!(Layers::parse("```layers\na\nb a\n```").is_err());
        Ok(())
    }
}
