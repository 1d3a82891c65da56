//! The imports between the files of a Rust crate.
//!
//! Modules are followed from `lib.rs` and `main.rs`. A path is resolved through `use`, re-exports
//! and globs to the file that defines its item, so that a child may import from a sibling what their
//! parent re-exports. Paths in the arguments of macros and attributes count as well. Code for
//! `cfg(test)` is left out.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemUse, UseTree, Visibility};

use crate::graph::{Graph, Import, Kind};

/// How the binary names the library.
const LIBRARY: &str = "tracklens";

/// Reads the crate whose sources are in `folder`.
///
/// # Errors
/// A file is missing, cannot be read or is not Rust.
pub fn graph(folder: &Path) -> Result<Graph> {
    let shown = folder.components().rev().take(2).collect::<Vec<_>>();
    let shown: Vec<_> = shown
        .iter()
        .rev()
        .map(|part| part.as_os_str().to_string_lossy())
        .collect();
    of_sources(&shown.join("/"), |file| {
        let path = folder.join(file);
        if !path.is_file() {
            return Ok(None);
        }
        let text = fs::read_to_string(&path);
        text.map(Some)
            .with_context(|| format!("cannot read {}", path.display()))
    })
}

/// As [`graph`], with a function that reads a file by its path in the folder.
fn of_sources(folder: &str, read: impl Fn(&str) -> Result<Option<String>>) -> Result<Graph> {
    let mut sources = Sources {
        read,
        files: Vec::new(),
        syntax: Vec::new(),
        modules: Vec::new(),
    };
    for root in ["lib.rs", "main.rs"] {
        if let Some(text) = (sources.read)(root)? {
            let module = sources.new_module(None, sources.files.len());
            sources.add_file(root.to_owned(), &text, module)?;
        }
    }
    let Sources {
        files,
        syntax,
        modules,
        ..
    } = sources;
    let tree = Tree { modules };
    let mut imports = BTreeSet::new();
    for (module, items) in &syntax {
        let mut references = References {
            tree: &tree,
            module: *module,
            imports: &mut imports,
        };
        items.iter().for_each(|item| references.visit_item(item));
    }
    Ok(Graph {
        folder: folder.to_owned(),
        files,
        imports: imports.into_iter().collect(),
    })
}

/// What is read so far.
struct Sources<F> {
    read: F,
    files: Vec<String>,
    /// The items of every module, those of inline modules apart.
    syntax: Vec<(usize, Vec<Item>)>,
    modules: Vec<Module>,
}

impl<F: Fn(&str) -> Result<Option<String>>> Sources<F> {
    fn new_module(&mut self, parent: Option<usize>, file: usize) -> usize {
        self.modules.push(Module {
            parent,
            file,
            names: BTreeMap::new(),
            globs: Vec::new(),
        });
        self.modules.len() - 1
    }

    fn add_file(&mut self, name: String, text: &str, module: usize) -> Result<()> {
        let parsed = syn::parse_file(text).map_err(|error| {
            let line = error.span().start().line;
            anyhow!("{name}:{line}: cannot parse: {error}")
        })?;
        let root = ["lib.rs", "main.rs", "mod.rs"].contains(&name.rsplit('/').next().unwrap_or(""));
        let folder = match (name.rsplit_once('/'), root) {
            (Some((folder, _)), true) => format!("{folder}/"),
            (None, true) => String::new(),
            (_, false) => format!("{}/", name.trim_end_matches(".rs")),
        };
        self.files.push(name);
        self.add_items(parsed.items, module, &folder)
    }

    /// Adds the items of a module whose children are files in `folder`.
    fn add_items(&mut self, items: Vec<Item>, module: usize, folder: &str) -> Result<()> {
        let mut kept = Vec::new();
        for item in items {
            if is_for_tests(attributes(&item)) {
                continue;
            }
            match item {
                Item::Mod(child) => self.add_child(child, module, folder)?,
                item => {
                    let mut names = Names {
                        module: &mut self.modules[module],
                    };
                    names.declare(&item);
                    names.visit_item(&item);
                    kept.push(item);
                }
            }
        }
        self.syntax.push((module, kept));
        Ok(())
    }

    fn add_child(&mut self, child: syn::ItemMod, module: usize, folder: &str) -> Result<()> {
        let name = child.ident.to_string();
        let declared = |modules: &mut Vec<Module>, target| {
            modules[module].declare(&name, Definition::Module(target));
        };
        if let Some((_, items)) = child.content {
            let inline = self.new_module(Some(module), self.modules[module].file);
            declared(&mut self.modules, inline);
            return self.add_items(items, inline, &format!("{folder}{name}/"));
        }
        let parent = self.files[self.modules[module].file].clone();
        let candidates = match path_attribute(&child.attrs) {
            Some(path) => {
                let own = parent.rsplit_once('/').map_or("", |(folder, _)| folder);
                let path = PathBuf::from(own).join(path);
                vec![path.to_string_lossy().replace('\\', "/")]
            }
            None => vec![
                format!("{folder}{name}.rs"),
                format!("{folder}{name}/mod.rs"),
            ],
        };
        for candidate in &candidates {
            if let Some(text) = (self.read)(candidate)? {
                let target = self.new_module(Some(module), self.files.len());
                declared(&mut self.modules, target);
                return self.add_file(candidate.clone(), &text, target);
            }
        }
        bail!(
            "{parent} declares `mod {name}`, but there is no {}",
            candidates.join(" or ")
        )
    }
}

fn path_attribute(attributes: &[Attribute]) -> Option<String> {
    attributes.iter().find_map(|attribute| {
        let pair = attribute.meta.require_name_value().ok()?;
        match &pair.value {
            syn::Expr::Lit(syn::ExprLit {
                lit: syn::Lit::Str(path),
                ..
            }) if pair.path.is_ident("path") => Some(path.value()),
            _ => None,
        }
    })
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::ForeignMod(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::TraitAlias(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

/// Whether an item is compiled for tests only.
fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let Ok(list) = attribute.meta.require_list() else {
            return false;
        };
        let words = words(list.tokens.clone());
        let has = |word: &str| words.iter().any(|w| w == word);
        list.path.is_ident("cfg") && has("test") && !has("not")
    })
}

fn words(tokens: TokenStream) -> Vec<String> {
    let words = tokens.into_iter().flat_map(|token| match token {
        TokenTree::Group(group) => words(group.stream()),
        TokenTree::Ident(ident) => vec![ident.to_string()],
        _ => Vec::new(),
    });
    words.collect()
}

struct Module {
    parent: Option<usize>,
    file: usize,
    /// A name may stand for a module and for an item, and for several under different `cfg`s.
    names: BTreeMap<String, Vec<Definition>>,
    /// Paths before `::*`.
    globs: Vec<Vec<String>>,
}

enum Definition {
    Module(usize),
    /// Defined in the file of the module.
    Item,
    /// Bound by `use` to a path.
    Use(Vec<String>),
}

impl Module {
    fn declare(&mut self, name: &str, definition: Definition) {
        self.names
            .entry(name.to_owned())
            .or_default()
            .push(definition);
    }
}

/// Notes what the items of a module bind, `use` within functions included.
struct Names<'a> {
    module: &'a mut Module,
}

impl Names<'_> {
    fn declare(&mut self, item: &Item) {
        let name = match item {
            Item::Const(item) => &item.ident,
            Item::Enum(item) => &item.ident,
            Item::Fn(item) => &item.sig.ident,
            Item::Macro(item) => match &item.ident {
                Some(ident) => ident,
                None => return,
            },
            Item::Static(item) => &item.ident,
            Item::Struct(item) => &item.ident,
            Item::Trait(item) => &item.ident,
            Item::TraitAlias(item) => &item.ident,
            Item::Type(item) => &item.ident,
            Item::Union(item) => &item.ident,
            _ => return,
        };
        self.module.declare(&name.to_string(), Definition::Item);
    }
}

impl Visit<'_> for Names<'_> {
    fn visit_item_use(&mut self, item: &ItemUse) {
        for leaf in leaves(item) {
            match leaf.name {
                Some(name) => self.module.declare(&name, Definition::Use(leaf.path)),
                None => self.module.globs.push(leaf.path),
            }
        }
    }
}

/// One path of a `use`.
struct Leaf {
    path: Vec<String>,
    /// What it binds; none for a glob.
    name: Option<String>,
    line: usize,
}

fn leaves(item: &ItemUse) -> Vec<Leaf> {
    let mut found = Vec::new();
    // A path that starts with `::` is another crate's.
    if item.leading_colon.is_none() {
        collect(&item.tree, &mut Vec::new(), &mut found);
    }
    found
}

fn collect(tree: &UseTree, path: &mut Vec<String>, found: &mut Vec<Leaf>) {
    let mut leaf = |ident: &proc_macro2::Ident, name: Option<String>, part: Option<String>| {
        let mut path = path.clone();
        path.extend(part);
        found.push(Leaf {
            path,
            name,
            line: ident.span().start().line,
        });
    };
    match tree {
        UseTree::Path(inner) => {
            path.push(inner.ident.to_string());
            collect(&inner.tree, path, found);
            path.pop();
        }
        UseTree::Name(name) if name.ident == "self" => {
            let bound = path.last().cloned();
            leaf(&name.ident, bound, None);
        }
        UseTree::Name(name) => {
            let word = name.ident.to_string();
            leaf(&name.ident, Some(word.clone()), Some(word));
        }
        UseTree::Rename(rename) => {
            let part = (rename.ident != "self").then(|| rename.ident.to_string());
            leaf(&rename.ident, Some(rename.rename.to_string()), part);
        }
        UseTree::Glob(glob) => found.push(Leaf {
            path: path.clone(),
            name: None,
            line: glob.star_token.spans[0].start().line,
        }),
        UseTree::Group(group) => {
            group
                .items
                .iter()
                .for_each(|tree| collect(tree, path, found));
        }
    }
}

struct Tree {
    modules: Vec<Module>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Target {
    Module(usize),
    /// An item that the file of the module defines.
    Item(usize),
}

impl Tree {
    /// What a path stands for in a module; nothing if it is another crate's.
    fn resolve(&self, module: usize, path: &[String]) -> BTreeSet<Target> {
        self.resolve_past(module, path, &mut HashSet::new())
    }

    fn resolve_past(
        &self,
        module: usize,
        path: &[String],
        under_way: &mut HashSet<(usize, String)>,
    ) -> BTreeSet<Target> {
        let Some((first, rest)) = path.split_first() else {
            return BTreeSet::new();
        };
        let mut targets = match first.as_str() {
            "crate" => BTreeSet::from([Target::Module(self.root(module))]),
            "self" => BTreeSet::from([Target::Module(module)]),
            "super" => self.modules[module]
                .parent
                .map(Target::Module)
                .into_iter()
                .collect(),
            // The library is the first root.
            LIBRARY if self.root(module) != 0 => BTreeSet::from([Target::Module(0)]),
            name => self.lookup(module, name, under_way),
        };
        for name in rest {
            let modules = targets.iter().filter_map(|target| match target {
                Target::Module(module) => Some(*module),
                Target::Item(_) => None,
            });
            let modules: Vec<_> = modules.collect();
            if modules.is_empty() {
                break;
            }
            let parent = |module: usize| self.modules[module].parent.map(Target::Module);
            targets = match name.as_str() {
                "super" => modules.into_iter().filter_map(parent).collect(),
                name => {
                    let found = modules.iter().flat_map(|module| {
                        let found = self.lookup(*module, name, under_way);
                        // What is not seen here was made by a macro.
                        match found.is_empty() {
                            true => BTreeSet::from([Target::Item(*module)]),
                            false => found,
                        }
                    });
                    found.collect()
                }
            };
        }
        targets
    }

    /// What a name stands for in a module; `under_way` are the names that led here.
    fn lookup(
        &self,
        module: usize,
        name: &str,
        under_way: &mut HashSet<(usize, String)>,
    ) -> BTreeSet<Target> {
        if !under_way.insert((module, name.to_owned())) {
            return BTreeSet::new();
        }
        let of = &self.modules[module];
        let mut found = BTreeSet::new();
        for definition in of.names.get(name).into_iter().flatten() {
            match definition {
                Definition::Module(target) => drop(found.insert(Target::Module(*target))),
                Definition::Item => drop(found.insert(Target::Item(module))),
                Definition::Use(path) => found.extend(self.resolve_past(module, path, under_way)),
            }
        }
        if found.is_empty() {
            for glob in &of.globs {
                for target in self.resolve_past(module, glob, under_way) {
                    if let Target::Module(target) = target {
                        found.extend(self.lookup(target, name, under_way));
                    }
                }
            }
        }
        under_way.remove(&(module, name.to_owned()));
        found
    }

    fn root(&self, module: usize) -> usize {
        std::iter::successors(Some(module), |module| self.modules[*module].parent)
            .last()
            .unwrap_or(module)
    }

    fn is_within(&self, module: usize, ancestor: usize) -> bool {
        std::iter::successors(Some(module), |module| self.modules[*module].parent)
            .any(|module| module == ancestor)
    }
}

/// Notes the imports of a module.
struct References<'a> {
    tree: &'a Tree,
    module: usize,
    imports: &'a mut BTreeSet<Import>,
}

impl References<'_> {
    fn add(&mut self, path: &[String], target: usize, line: usize, kind: Kind) {
        let (from, to) = (
            self.tree.modules[self.module].file,
            self.tree.modules[target].file,
        );
        if from != to {
            self.imports.insert(Import {
                from,
                line,
                to,
                text: path.join("::"),
                kind,
            });
        }
    }

    /// A path in code.
    fn path(&mut self, path: &[String], line: usize) {
        for target in self.tree.resolve(self.module, path) {
            match target {
                Target::Item(target) => self.add(path, target, line, Kind::Use),
                Target::Module(_) => {}
            }
        }
    }

    /// Finds paths among the tokens of a macro's arguments.
    fn tokens(&mut self, tokens: TokenStream) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let is_colon = |token: Option<&TokenTree>| matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == ':');
        let mut at = 0;
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(first) => {
                    let line = first.span().start().line;
                    let field = at > 0
                        && matches!(&tokens[at - 1], TokenTree::Punct(p) if p.as_char() == '.');
                    let mut path = vec![first.to_string()];
                    while is_colon(tokens.get(at + 1))
                        && is_colon(tokens.get(at + 2))
                        && let Some(TokenTree::Ident(next)) = tokens.get(at + 3)
                    {
                        path.push(next.to_string());
                        at += 3;
                    }
                    if !field {
                        self.path(&path, line);
                    }
                }
                _ => {}
            }
            at += 1;
        }
    }
}

impl<'ast> Visit<'ast> for References<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if !is_for_tests(attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &ItemUse) {
        let public = !matches!(item.vis, Visibility::Inherited);
        for leaf in leaves(item) {
            for target in self.tree.resolve(self.module, &leaf.path) {
                match target {
                    Target::Item(target) => {
                        let own = public && self.tree.is_within(target, self.module);
                        let kind = if own { Kind::Name } else { Kind::Use };
                        self.add(&leaf.path, target, leaf.line, kind);
                    }
                    Target::Module(target) => {
                        self.add(&leaf.path, target, leaf.line, Kind::Name);
                    }
                }
            }
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let words: Vec<_> = path
                .segments
                .iter()
                .map(|part| part.ident.to_string())
                .collect();
            let line = path
                .segments
                .first()
                .map_or(0, |part| part.ident.span().start().line);
            self.path(&words, line);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        visit::visit_macro(self, call);
        self.tokens(call.tokens.clone());
    }

    // Where something may be seen is not an import.
    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    // Options of the command line name their parsers there.
    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        if let Ok(list) = attribute.meta.require_list() {
            self.tokens(list.tokens.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph_of(sources: &[(&str, &str)]) -> Result<Graph> {
        of_sources("src", |file| {
            let source = sources.iter().find(|(name, _)| *name == file);
            Ok(source.map(|(_, text)| (*text).to_owned()))
        })
    }

    fn shown(sources: &[(&str, &str)]) -> Result<Vec<String>> {
        let graph = graph_of(sources)?;
        let uses = graph
            .imports
            .iter()
            .filter(|import| import.kind == Kind::Use);
        let shown = uses.map(|i| format!("{} `{}` {}", graph.place(i), i.text, graph.files[i.to]));
        Ok(shown.collect())
    }

    #[test]
    fn paths_lead_to_the_file_that_defines_the_item() -> Result<()> {
        let imports = shown(&[
            ("lib.rs", "mod a;\nmod b;\npub use b::Thing;"),
            (
                "a.rs",
                "use crate::Thing;\nfn f() { crate::b::inner::g(); }",
            ),
            ("b/mod.rs", "mod inner;\npub use inner::*;"),
            ("b/inner.rs", "pub struct Thing;\npub fn g() {}"),
        ])?;
        assert_eq!(
            imports,
            [
                "src/a.rs:1 `crate::Thing` b/inner.rs",
                "src/a.rs:2 `crate::b::inner::g` b/inner.rs",
            ]
        );
        Ok(())
    }

    #[test]
    fn other_crates_tests_and_visibilities_are_no_imports() -> Result<()> {
        let imports = shown(&[
            ("lib.rs", "mod image;\nmod b;"),
            ("image.rs", "pub struct Image;"),
            (
                "b.rs",
                "use ::image::Png;\nuse std::fmt;\npub(in crate::b) fn f() {}\n\
                 #[cfg(test)]\nmod tests { use crate::image::Image; }\n\
                 #[cfg(all(test, unix))]\nuse crate::image::Image;",
            ),
        ])?;
        assert_eq!(imports, [""; 0]);
        Ok(())
    }

    #[test]
    fn arguments_of_macros_and_attributes_count() -> Result<()> {
        let imports = shown(&[
            ("lib.rs", "mod a;\nmod b;"),
            (
                "a.rs",
                "fn f() {\n    assert!(g(vec![crate::b::LIMIT]));\n}\n\
                 struct O {\n    #[arg(value_parser = crate::b::parse)]\n    n: u8,\n}",
            ),
            ("b.rs", "pub const LIMIT: usize = 1;\npub fn parse() {}"),
        ])?;
        assert_eq!(
            imports,
            [
                "src/a.rs:2 `crate::b::LIMIT` b.rs",
                "src/a.rs:5 `crate::b::parse` b.rs",
            ]
        );
        Ok(())
    }

    #[test]
    fn a_child_that_uses_its_user_makes_a_circle() -> Result<()> {
        let parent = "mod child;\npub struct Limit;\nfn f() { child::g(); }";
        let child = "use super::Limit;\npub fn g() {}";
        let graph = graph_of(&[
            ("lib.rs", "mod a;"),
            ("a/mod.rs", parent),
            ("a/child.rs", child),
        ])?;
        assert_eq!(
            graph.circles(),
            ["2 files import each other in a circle:\n  \
              src/a/mod.rs:3: `child::g` from a/child.rs\n  \
              src/a/child.rs:1: `super::Limit` from a/mod.rs"]
        );
        Ok(())
    }

    #[test]
    fn a_parent_may_pass_on_what_its_children_define() -> Result<()> {
        let graph = graph_of(&[
            ("lib.rs", "mod a;"),
            (
                "a/mod.rs",
                "mod one;\nmod two;\npub use one::One;\npub use two::Two;\npub struct Up;",
            ),
            ("a/one.rs", "use super::{Two, Up};\npub struct One;"),
            ("a/two.rs", "pub struct Two;"),
        ])?;
        assert_eq!(graph.circles(), [""; 0]);
        Ok(())
    }

    #[test]
    fn a_parent_that_uses_what_it_passes_on_counts() -> Result<()> {
        let graph = graph_of(&[
            ("lib.rs", "mod a;"),
            (
                "a.rs",
                "mod one;\npub use one::One;\npub struct Up;\nfn f(_: One) {}",
            ),
            ("a/one.rs", "use super::Up;\npub struct One;"),
        ])?;
        assert_eq!(graph.circles().len(), 1);
        Ok(())
    }

    #[test]
    fn modules_may_lie_elsewhere_and_the_binary_uses_the_library() -> Result<()> {
        let imports = shown(&[
            (
                "lib.rs",
                "#[cfg(unix)]\npub mod k;\n#[cfg(not(unix))]\n#[path = \"k/plain.rs\"]\nmod k;",
            ),
            ("k/mod.rs", "pub fn f() {}"),
            ("k/plain.rs", "pub fn f() {}"),
            ("main.rs", "fn main() { tracklens::k::f(); }"),
        ])?;
        assert_eq!(
            imports,
            [
                "src/main.rs:1 `tracklens::k::f` k/mod.rs",
                "src/main.rs:1 `tracklens::k::f` k/plain.rs",
            ]
        );
        let missing = graph_of(&[("lib.rs", "mod a;")]).map(drop);
        assert_eq!(
            missing.map_err(|error| error.to_string()),
            Err("lib.rs declares `mod a`, but there is no a.rs or a/mod.rs".to_owned())
        );
        Ok(())
    }
}
