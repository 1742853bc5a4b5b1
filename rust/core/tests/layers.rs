//! The folders of the core are layers: a module imports from its own layer or from those below, and no modules import each other
//! in a circle. What a module imports is read from its source: its `use` lines, and every other path that names a module.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

/// The layers, bottom up. docs/developing/design.md tells what is in each.
const LAYERS: [&str; 10] = ["error", "tape", "kernel", "model", "stage", "step", "group", "large", "events", "run"];

/// The names of a module and those around it, from the root of the crate.
type Module = Vec<String>;
/// The source of every module.
type Sources = BTreeMap<Module, String>;
/// The imports of each module.
type Imports = BTreeMap<Module, BTreeSet<Module>>;

/// Reads the modules of a folder.
fn read(folder: &Path, module: &[String], sources: &mut Sources) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            read(&path, &[module, &[name]].concat(), sources);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let module = if name == "mod" || name == "lib" { module.to_vec() } else { [module, &[name]].concat() };
            sources.insert(module, fs::read_to_string(&path).unwrap());
        }
    }
}

fn core() -> Sources {
    let mut sources = Sources::new();
    read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &[], &mut sources);
    sources
}

/// The words and signs of a source, without comments, strings and characters. `::` is one sign.
fn tokens(source: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut rest = source;
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if let Some(raw) = rest.strip_prefix("r#\"") {
            raw.find("\"#").map_or(rest.len(), |end| end + 5)
        } else if first == '"' {
            string_length(rest)
        } else if let Some(length) = character_length(rest) {
            length
        } else if rest.starts_with("::") {
            tokens.push("::".to_owned());
            2
        } else if first.is_alphanumeric() || first == '_' {
            let length = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            tokens.push(rest[..length].to_owned());
            length
        } else {
            if !first.is_whitespace() {
                tokens.push(first.to_string());
            }
            first.len_utf8()
        };
        rest = &rest[length..];
    }
    tokens
}

fn string_length(text: &str) -> usize {
    let mut is_escaped = true; // the quotation mark that begins it does not end it
    for (at, c) in text.char_indices() {
        match c {
            '"' if !is_escaped => return at + 1,
            '\\' if !is_escaped => is_escaped = true,
            _ => is_escaped = false,
        }
    }
    text.len()
}

/// The length of a character such as `'{'`; None of a lifetime.
fn character_length(text: &str) -> Option<usize> {
    let rest = text.strip_prefix('\'')?;
    let (backslash, unescaped) = rest.strip_prefix('\\').map_or((0, rest), |unescaped| (1, unescaped));
    let within = backslash + unescaped.chars().next()?.len_utf8();
    rest[within..].starts_with('\'').then_some(within + 2)
}

/// Adds the paths of the tree that follows a `use`, behind those names.
fn tree(tokens: &mut impl Iterator<Item = String>, before: &[String], paths: &mut Vec<Module>) {
    let mut path = before.to_vec();
    while let Some(token) = tokens.next() {
        match token.as_str() {
            "::" | "as" => {}
            "{" => {
                tree(tokens, &path, paths);
                path.truncate(before.len());
            }
            "," | "}" | ";" => {
                if path.len() > before.len() {
                    paths.push(std::mem::replace(&mut path, before.to_vec()));
                }
                if token != "," {
                    return;
                }
            }
            name => path.push(name.to_owned()),
        }
    }
}

/// All paths of a source.
fn paths(source: &str) -> Vec<Module> {
    let mut paths = Vec::new();
    let mut tokens = tokens(source).into_iter().peekable();
    while let Some(token) = tokens.next() {
        if token == "use" {
            tree(&mut tokens, &[], &mut paths);
            continue;
        }
        let mut path = vec![token];
        while tokens.next_if(|next| next == "::").is_some() {
            path.extend(tokens.next());
        }
        if path.len() > 1 {
            paths.push(path);
        }
    }
    paths
}

/// The module that a path leads to, if it is one of the crate.
fn target(from: &Module, path: &Module, sources: &Sources) -> Option<Module> {
    let mut names = path.iter().peekable();
    let mut at = match names.peek()?.as_str() {
        "crate" => {
            names.next();
            Module::new()
        }
        "self" | "super" => from.clone(),
        child if sources.contains_key(&[&from[..], &[child.to_owned()]].concat()) => from.clone(),
        _ => return None,
    };
    names.next_if(|name| *name == "self");
    while names.next_if(|name| *name == "super").is_some() {
        at.pop();
    }
    for name in names {
        let next = [&at[..], std::slice::from_ref(name)].concat();
        if !sources.contains_key(&next) {
            break;
        }
        at = next;
    }
    Some(at)
}

fn imports(sources: &Sources) -> Imports {
    let of = |(module, source): (&Module, &String)| {
        let mut all: BTreeSet<Module> = paths(source).iter().filter_map(|path| target(module, path, sources)).collect();
        // What `build.rs` writes for such a folder uses every file of it.
        if source.contains("include!(") {
            all.extend(sources.keys().filter(|other| other.len() == module.len() + 1 && other.starts_with(module)).cloned());
        }
        all.retain(|other| other != module && !other.is_empty());
        (module.clone(), all)
    };
    sources.iter().map(of).collect()
}

/// A line for each import from a layer above, and for each module that is in no layer.
fn upward(sources: &Sources) -> Vec<String> {
    let layer = |module: &Module| LAYERS.iter().position(|layer| Some(*layer) == module.first().map(String::as_str));
    let mut lines = Vec::new();
    for (module, imports) in imports(sources) {
        let Some(own) = layer(&module) else {
            // The root of the crate declares the layers and uses none.
            let stray = if module.is_empty() { imports.into_iter().next() } else { Some(module) };
            lines.extend(stray.map(|stray| format!("{} is in no layer, or used by the root", stray.join("::"))));
            continue;
        };
        for import in imports.iter().filter(|import| layer(import).is_some_and(|other| other > own)) {
            lines.push(format!("{} imports {}, which is above it", module.join("::"), import.join("::")));
        }
    }
    lines
}

/// The modules of a circle, where each imports the next; none if there is no circle.
fn circle(imports: &Imports) -> Vec<Module> {
    fn follow(module: &Module, imports: &Imports, way: &mut Vec<Module>, done: &mut BTreeSet<Module>) -> bool {
        if let Some(start) = way.iter().position(|passed| passed == module) {
            way.drain(..start);
            return true;
        }
        if done.contains(module) {
            return false;
        }
        way.push(module.clone());
        if imports[module].iter().any(|next| follow(next, imports, way, done)) {
            return true;
        }
        way.pop();
        done.insert(module.clone());
        false
    }
    let (mut way, mut done) = (Vec::new(), BTreeSet::new());
    imports.keys().any(|module| follow(module, imports, &mut way, &mut done));
    way
}

#[test]
fn a_layer_imports_from_layers_below_it() {
    let sources = core();
    assert!(sources.len() > 100, "the sources are found");
    assert_eq!(upward(&sources), [""; 0]);
}

#[test]
fn no_modules_import_each_other_in_a_circle() {
    assert_eq!(circle(&imports(&core())), Vec::<Module>::new());
}

/// Modules by name and source.
fn made_up(modules: &[(&str, &str)]) -> Sources {
    let module = |name: &str| name.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect();
    modules.iter().map(|(name, source)| (module(name), (*source).to_owned())).collect()
}

#[test]
fn an_import_from_above_is_noticed() {
    for source in [
        "use crate::{tape::Op, run::fixed};",
        "use super::super::run::fixed::Plan;",
        "fn f() -> usize { let quote = '\"'; crate::run::fixed::steps() }",
        "pub use crate::run;",
    ] {
        let sources =
            made_up(&[("", ""), ("tape", ""), ("tape::split", source), ("run", ""), ("run::fixed", "use crate::tape::split;")]);
        let lines = upward(&sources);
        assert_eq!(lines.len(), 1, "{source}: {lines:?}");
        assert!(lines[0].starts_with("tape::split imports run"), "{source}: {lines:?}");
    }
    let harmless = "// crate::run\n/// [`crate::run`]\nfn f() { g(\"crate::run \\\" crate::run\"); run::fixed() }";
    assert_eq!(upward(&made_up(&[("tape", harmless), ("run", "")])), [""; 0]);
    assert_eq!(upward(&made_up(&[("charts", "")])).len(), 1, "a folder that is no layer");
}

#[test]
fn a_circle_is_noticed() {
    let modules = |source| {
        let others = [("tape", "mod a;\nmod b;\nuse self::a::A;"), ("tape::a", "use super::b::{self as other, B};")];
        made_up(&[others[0], others[1], ("tape::b", source)])
    };
    assert_eq!(circle(&imports(&modules("fn f() { super::tape() }"))).len(), 3);
    assert_eq!(circle(&imports(&modules("fn f() { tape() }"))).len(), 0);
    let listed = [("model", "include!(\"systems.rs\");"), ("model::chain", "use crate::model::kind;")];
    assert_eq!(circle(&imports(&made_up(&listed))).len(), 2);
}
