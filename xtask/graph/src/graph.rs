//! Files, and what they import from each other.

use std::collections::BTreeSet;
use std::fmt::Write;

use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;

/// The files below a folder and their imports of each other.
pub struct Graph {
    /// The folder, as it is shown before the name of a file.
    pub folder: String,
    /// Paths within the folder, with `/` between the parts.
    pub files: Vec<String>,
    pub imports: Vec<Import>,
}

/// A place where a file names something that another one defines.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Import {
    /// The importing file, an index into [`Graph::files`].
    pub from: usize,
    pub line: usize,
    /// The file that defines what is imported.
    pub to: usize,
    /// The import as the source has it.
    pub text: String,
    pub kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The file needs what it imports.
    Use,
    /// A parent passes on what its child defines, or a module is named whose contents are used
    /// elsewhere, if at all: this makes no circle.
    Name,
}

impl Graph {
    /// Where an import stands, as editors understand it.
    pub fn place(&self, import: &Import) -> String {
        format!(
            "{}/{}:{}",
            self.folder, self.files[import.from], import.line
        )
    }

    /// A description of each group of files that import each other in a circle, one import for each
    /// pair of files.
    pub fn circles(&self) -> Vec<String> {
        let uses = self
            .imports
            .iter()
            .filter(|import| import.kind == Kind::Use && import.from != import.to);
        let edges = uses.clone().map(|import| (import.from, import.to));
        let mut groups: Vec<Vec<usize>> = tarjan_scc(&DiGraphMap::<usize, ()>::from_edges(edges))
            .into_iter()
            .filter(|group| group.len() > 1)
            .collect();
        groups.iter_mut().for_each(|group| group.sort_unstable());
        groups.sort();
        let described = groups.iter().map(|group| {
            let mut text = format!("{} files import each other in a circle:", group.len());
            let mut pairs = BTreeSet::new();
            for import in uses.clone() {
                let inside = group.contains(&import.from) && group.contains(&import.to);
                if inside && pairs.insert((import.from, import.to)) {
                    let (place, to) = (self.place(import), &self.files[import.to]);
                    let _ = write!(text, "\n  {place}: `{}` from {to}", import.text);
                }
            }
            text
        });
        described.collect()
    }
}
