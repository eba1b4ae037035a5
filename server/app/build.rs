//! Link arguments for libtorch, the revision for `stair --version`, and the files of `web/static`
//! and `assets/guidance` and the results of experiments inside the program.

use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::hash::{Hash as _, Hasher as _};
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

/// What a program is made of, from the top of the repository. Results of experiments are in it too,
/// to be looked at; they change nothing that it does.
const SOURCES: &[&str] = &[
    ".cargo/config.toml",
    "Cargo.lock",
    "Cargo.toml",
    "assets/experiments",
    "assets/fonts",
    "assets/guidance",
    "assets/presets",
    "assets/shaders",
    "assets/studies",
    "migrations",
    "server",
    "web",
];

/// What lies among them and is no part of it.
const OTHERS: &[&str] = &[
    ":(top,exclude)server/lab/tests",
    ":(top,exclude)server/xtask",
    ":(top,exclude,glob)server/**/*.md",
];

/// `STAIR_REVISION`: the short commit, with `+` and a hash of the changes where the sources differ
/// from it, so that other sources never have the same revision; `unknown` outside git.
fn emit_revision() {
    if let Some(folder) = git(&["rev-parse", "--git-dir"]) {
        println!("cargo:rerun-if-changed={folder}/logs/HEAD");
    }
    for source in SOURCES {
        println!("cargo:rerun-if-changed=../../{source}");
    }
    let revision = git(&["rev-parse", "--short=10", "HEAD"])
        .map_or_else(|| "unknown".into(), |commit| commit + &changes());
    println!("cargo:rustc-env=STAIR_REVISION={revision}");
}

/// `+` and a hash of every file of the sources that differs from the commit or that it lacks, by name
/// and content; nothing where none does.
fn changes() -> String {
    let listed = |arguments: &[&str]| -> Option<Vec<String>> {
        let sources: Vec<String> = SOURCES.iter().map(|s| format!(":/{s}")).collect();
        let mut arguments = [arguments, &["-z", "--"]].concat();
        arguments.extend(
            sources
                .iter()
                .map(String::as_str)
                .chain(OTHERS.iter().copied()),
        );
        let names = git(&arguments)?;
        let names = names.split('\0').filter(|name| !name.is_empty());
        Some(names.map(str::to_owned).collect())
    };
    let changed = listed(&["diff", "--name-only", "--no-relative", "HEAD"]);
    let new = listed(&["ls-files", "--others", "--exclude-standard", "--full-name"]);
    let (Some(changed), Some(new)) = (changed, new) else {
        return "+unknown".into();
    };
    let mut files = [changed, new].concat();
    if files.is_empty() {
        return String::new();
    }
    files.sort();
    let mut hasher = DefaultHasher::new();
    for file in files {
        let content = std::fs::read(Path::new("../..").join(&file)).ok(); // none: it was removed
        (file, content).hash(&mut hasher);
    }
    format!("+{:08x}", hasher.finish() as u32)
}

/// What git says; `None` where it fails or is not there.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
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
    let mut experiments: BTreeMap<String, &Path> = BTreeMap::new();
    for rows in &files {
        let name = result_name(&root, rows);
        if let Some(other) = experiments.insert(name.clone(), rows) {
            panic!(
                "{} and {} would both be called {name}",
                other.display(),
                rows.display()
            );
        }
    }
    let mut table = String::from("&[\n");
    for (name, rows) in &experiments {
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

/// `a-b` of `assets/results/a/b/results.jsonl`: one part of an address, and `b` below another folder
/// is another name.
fn result_name(root: &Path, rows: &Path) -> String {
    let folder = rows.parent().expect("a file lies in a folder");
    let below = folder.strip_prefix(root).expect("found below the root");
    let parts: Vec<_> = below.iter().map(OsStr::to_string_lossy).collect();
    parts.join("-")
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
