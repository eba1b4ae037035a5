//! Link arguments for libtorch, the revision for `stair --version`, and the files of `web/static`
//! and `assets/guidance` and the results of experiments inside the program.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

include!("../learn/rpath.rs");

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../learn/rpath.rs");
    emit_link_arguments();
    emit_revision();
    embed_static_files();
    embed_guidance();
    embed_results();
}

/// `STAIR_REVISION`: the short commit, `+` where the tree differs from it, `unknown` outside git.
fn emit_revision() {
    let git = |arguments: &[&str]| -> Option<String> {
        let output = Command::new("git").args(arguments).output().ok()?;
        output
            .status
            .success()
            .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    if let Some(folder) = git(&["rev-parse", "--git-dir"]) {
        println!("cargo:rerun-if-changed={folder}/logs/HEAD");
    }
    let revision = git(&["rev-parse", "--short=10", "HEAD"]).unwrap_or_else(|| "unknown".into());
    let is_clean = git(&["status", "--porcelain", "--untracked-files=no"])
        .is_none_or(|changes| changes.is_empty());
    println!(
        "cargo:rustc-env=STAIR_REVISION={revision}{}",
        if is_clean { "" } else { "+" }
    );
}

/// Writes `static_files.rs`: `(path below web/static, bytes)` of every file, sorted by path.
fn embed_static_files() {
    embed("../../web/static", "static_files.rs", |name, file| {
        let name = name.display().to_string();
        format!("({name:?}, include_bytes!({file:?}) as &[u8])")
    });
}

/// Writes `guidance.rs`: `(task, text)` of every file in `assets/guidance`.
fn embed_guidance() {
    embed("../../assets/guidance", "guidance.rs", |name, file| {
        let task = name.with_extension("").display().to_string();
        format!("({task:?}, include_str!({file:?}))")
    });
}

/// Writes a table with an entry for every file below a folder, sorted by path.
fn embed(folder: &str, table_name: &str, entry: impl Fn(&Path, &str) -> String) {
    let root = PathBuf::from(variable("CARGO_MANIFEST_DIR")).join(folder);
    println!("cargo:rerun-if-changed={}", root.display());
    let mut files = Vec::new();
    collect(&root, &mut files);
    files.sort();
    let mut table = String::from("&[\n");
    for file in &files {
        println!("cargo:rerun-if-changed={}", file.display());
        let name = file.strip_prefix(&root).expect("found below the root");
        writeln!(table, "    {},", entry(name, &file.display().to_string()))
            .expect("writing to a string cannot fail");
    }
    table.push_str("]\n");
    let out = PathBuf::from(variable("OUT_DIR")).join(table_name);
    std::fs::write(&out, table).expect("cargo's output folder can be written");
}

/// Writes `results.rs`: `(name, experiment.toml, results.jsonl)` of every experiment below
/// `assets/results`, sorted by name.
fn embed_results() {
    let root = PathBuf::from(variable("CARGO_MANIFEST_DIR")).join("../../assets/results");
    println!("cargo:rerun-if-changed={}", root.display());
    let mut files = Vec::new();
    collect(&root, &mut files);
    files.retain(|file| file.ends_with("results.jsonl"));
    files.sort();
    let mut table = String::from("&[\n");
    for rows in &files {
        let name = rows.parent().and_then(Path::file_name);
        let name = name.expect("a file lies in a folder").to_string_lossy();
        let grid = rows.with_file_name("experiment.toml");
        writeln!(
            table,
            "    ({name:?}, include_str!({:?}), include_str!({:?})),",
            grid.display().to_string(),
            rows.display().to_string()
        )
        .expect("writing to a string cannot fail");
    }
    table.push_str("]\n");
    let out = PathBuf::from(variable("OUT_DIR")).join("results.rs");
    std::fs::write(&out, table).expect("cargo's output folder can be written");
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
}

fn variable(name: &str) -> String {
    std::env::var(name).expect("cargo sets it for build scripts")
}
