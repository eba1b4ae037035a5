//! Link arguments for this crate's tests and examples, and the presets inside the program.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

include!("../learn/rpath.rs");

fn main() {
    println!("cargo:rerun-if-changed=../learn/rpath.rs");
    emit_link_arguments();
    embed_presets();
}

/// Writes `presets.rs`: `(name, task or "", text)` of every file below `assets/presets`. There
/// `NAME.toml` and `method/NAME.toml` hold for any task, `NAME/TASK.toml` for one.
fn embed_presets() {
    let variable = |name: &str| PathBuf::from(std::env::var(name).expect("cargo sets it"));
    let root = variable("CARGO_MANIFEST_DIR").join("../../assets/presets");
    println!("cargo:rerun-if-changed={}", root.display());
    let mut presets = Vec::new();
    for path in entries(&root) {
        if !path.is_dir() {
            presets.push((stem(&path), String::new(), path));
            continue;
        }
        for file in entries(&path) {
            let (folder, name) = (stem(&path), stem(&file));
            presets.push(match folder.as_str() {
                "method" => (name, String::new(), file),
                _ => (folder, name, file),
            });
        }
    }
    presets.sort();
    let mut table = String::from("&[\n");
    for (name, task, path) in presets {
        println!("cargo:rerun-if-changed={}", path.display());
        let path = path.display().to_string();
        writeln!(table, "    ({name:?}, {task:?}, include_str!({path:?})),")
            .expect("writing to a string cannot fail");
    }
    table.push_str("]\n");
    std::fs::write(variable("OUT_DIR").join("presets.rs"), table)
        .expect("cargo's output folder can be written");
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("the repository has its presets");
    entries
        .map(|entry| entry.expect("a readable folder").path())
        .collect()
}

fn stem(path: &Path) -> String {
    let stem = path.file_stem().expect("a file has a name");
    stem.to_string_lossy().into_owned()
}
