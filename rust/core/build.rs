//! Lists `src/steppers/*.rs` and `src/systems/*.rs`, so that a new file in either folder is its whole registration.
//!
//! A file `false_euler.rs` in `steppers/` holds a type `FalseEuler` that implements `Stepper`; a file `oscillator.rs` in
//! `systems/` holds a function `group`; a large system may be a folder with a `mod.rs`. From the two lists this script writes the
//! modules, the catalogue of records and the function that turns the names of a system and a method into a kernel.

use std::{env, fs, io, path::Path};

fn names(folder: &Path) -> io::Result<Vec<String>> {
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if (path.extension().is_some_and(|e| e == "rs") || path.join("mod.rs").is_file())
            && let Some(stem) = path.file_stem().and_then(|s| s.to_str())
        {
            names.push(stem.to_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// `false_euler` to `FalseEuler`.
fn camel(name: &str) -> String {
    let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
    name.split('_').map(capital).collect()
}

fn modules(root: &Path, folder: &str, names: &[String]) -> String {
    let file = |n: &String| {
        [format!("{n}.rs"), format!("{n}/mod.rs")].map(|f| root.join(folder).join(f)).into_iter().find(|f| f.is_file())
    };
    let module = |n: &String| format!("#[path = {:?}]\npub mod {n};\n", file(n).unwrap_or_default());
    names.iter().map(module).collect()
}

fn main() -> io::Result<()> {
    let root = env::current_dir()?;
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    let steppers = names(Path::new("src/steppers"))?;
    let systems = names(Path::new("src/systems"))?;

    fs::write(Path::new(&out).join("steppers.rs"), modules(&root, "src/steppers", &steppers))?;
    fs::write(Path::new(&out).join("systems.rs"), modules(&root, "src/systems", &systems))?;

    let mut table = String::from("/// Every method's record, by name.\npub static RECORDS: &[&Record] = &[\n");
    for n in &steppers {
        table += &format!("    &<crate::steppers::{n}::{} as Stepper>::RECORD,\n", camel(n));
    }
    table += "];\n\n/// Every system's name.\npub static SYSTEMS: &[&str] = &[\n";
    for n in &systems {
        table += &format!("    {n:?},\n");
    }
    table += "];\n\nfn lookup(spec: &Spec, method: &str, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {\n";
    table += "    match (spec.system, method) {\n";
    for s in &systems {
        for n in &steppers {
            table += &format!(
                "        ({s:?}, {n:?}) => crate::systems::{s}::group::<crate::steppers::{n}::{}>(spec, clock, width),\n",
                camel(n)
            );
        }
    }
    table += "        _ => Err(unknown(spec.system, method)),\n    }\n}\n";
    fs::write(Path::new(&out).join("table.rs"), table)
}
