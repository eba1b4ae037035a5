//! Link arguments for this crate's tests and examples; presets and ready experiments inside the
//! program.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

include!("../learn/rpath.rs");

fn main() {
    println!("cargo:rerun-if-changed=../learn/rpath.rs");
    emit_link_arguments();
    embed_presets();
    embed_experiments();
    embed_query_sets();
}

/// Writes `query_sets.rs`: `(path as study files have it, bytes)` of every file in
/// `assets/studies/sets`.
fn embed_query_sets() {
    let mut paths = entries(&assets("studies/sets"));
    paths.sort();
    let entry = |path: PathBuf| {
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        format!(
            "({:?}, include_bytes!({:?}))",
            format!("sets/{name}"),
            path.display().to_string()
        )
    };
    write_table("query_sets.rs", paths.into_iter().map(entry));
}

/// Writes `presets.rs`: `(name, task or "", text)` of every file below `assets/presets`. There
/// `NAME.toml` and `method/NAME.toml` hold for any task, `NAME/TASK.toml` for one.
fn embed_presets() {
    let root = assets("presets");
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
    let entry = |(name, task, path): (String, String, PathBuf)| {
        format!("({name:?}, {task:?}, {})", included(&path))
    };
    write_table("presets.rs", presets.into_iter().map(entry));
}

/// Writes `experiments.rs`: a `ShippedGrid` of every file in `assets/experiments`.
fn embed_experiments() {
    let mut paths = entries(&assets("experiments"));
    paths.sort();
    let entry = |path: PathBuf| {
        let (name, text) = (stem(&path), included(&path));
        format!("ShippedGrid {{ name: {name:?}, text: {text} }}")
    };
    write_table("experiments.rs", paths.into_iter().map(entry));
}

fn assets(folder: &str) -> PathBuf {
    let root = variable("CARGO_MANIFEST_DIR")
        .join("../../assets")
        .join(folder);
    println!("cargo:rerun-if-changed={}", root.display());
    root
}

fn included(path: &Path) -> String {
    println!("cargo:rerun-if-changed={}", path.display());
    format!("include_str!({:?})", path.display().to_string())
}

fn write_table(name: &str, entries: impl Iterator<Item = String>) {
    let mut table = String::from("&[\n");
    for entry in entries {
        writeln!(table, "    {entry},").expect("writing to a string cannot fail");
    }
    table.push_str("]\n");
    std::fs::write(variable("OUT_DIR").join(name), table)
        .expect("cargo's output folder can be written");
}

fn variable(name: &str) -> PathBuf {
    PathBuf::from(std::env::var(name).expect("cargo sets it"))
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
