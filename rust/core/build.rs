//! Lists `src/model/steppers/*.rs` and `src/model/systems/*.rs`, so that a new file in either folder is its whole registration.
//!
//! A file in `steppers/` holds a `RECORD`, one in `systems/` a `KIND` and a `make`.

use std::{env, fs, io, path::Path};

fn names(folder: &Path) -> io::Result<Vec<String>> {
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "rs")
            && let Some(stem) = path.file_stem().and_then(|s| s.to_str())
            && stem != "mod"
        {
            names.push(stem.to_owned());
        }
    }
    names.sort();
    Ok(names)
}

const MAKE: &str = "
/// Constructor of the system of this name; generic, so that those which only tests ask for are not in the library.
pub fn make<N: equations::Operand>(name: &str) -> Option<crate::model::system::Make<N>> {
    Some(match name {
";

fn main() -> io::Result<()> {
    let root = env::current_dir()?;
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    for (folder, list, kind, constant) in [
        ("steppers", "RECORDS", "crate::model::method::Record", "RECORD"),
        ("systems", "KINDS", "crate::model::system::Kind", "KIND"),
    ] {
        let from = Path::new("src/model").join(folder);
        let names = names(&from)?;
        let mut text = String::new();
        for name in &names {
            text += &format!("#[path = {:?}]\npub mod {name};\n", root.join(&from).join(format!("{name}.rs")));
        }
        text += &format!("\n/// All of them, by name.\npub static {list}: &[&{kind}] = &[\n");
        for name in &names {
            text += &format!("    &{name}::{constant},\n");
        }
        text += "];\n";
        if folder == "systems" {
            text += MAKE;
            for name in &names {
                text += &format!("        {name:?} => {name}::make,\n");
            }
            text += "        _ => return None,\n    })\n}\n";
        }
        fs::write(Path::new(&out).join(format!("{folder}.rs")), text)?;
    }
    Ok(())
}
