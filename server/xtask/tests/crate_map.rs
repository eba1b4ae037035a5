//! Who may know whom: the picture at the top of `server/ARCHITECTURE.md`, as a test.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// A crate and the crates of this workspace that it may depend on.
const MAY_KNOW: [(&str, &[&str]); 8] = [
    ("domain", &[]),
    ("sim", &["domain"]),
    ("learn", &["domain"]),
    ("render", &["domain"]),
    ("store", &["domain"]),
    ("lab", &["domain", "sim", "learn"]),
    ("app", &["domain", "sim", "learn", "render", "store", "lab"]),
    ("xtask", &[]),
];

/// A heavy library and the only crates that may depend on it.
const TAMED_BY: [(&str, &[&str]); 14] = [
    ("rapier3d", &["sim"]),
    ("rayon", &["lab", "learn"]),
    ("tch", &["learn"]),
    ("torch-sys", &["learn"]),
    ("wgpu", &["render"]),
    ("openh264", &["render"]),
    ("muxide", &["render"]),
    ("sqlx", &["store"]),
    ("resvg", &["app"]),
    ("axum", &["app"]),
    ("askama", &["app"]),
    ("tower-http", &["app"]),
    ("clap", &["app"]),
    ("tokio", &["app", "store"]),
];

/// Each crate of the workspace with all that its manifest names, whatever for.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo can be started");
    assert!(output.status.success(), "cargo metadata failed");
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo prints JSON");
    let packages = metadata["packages"].as_array().expect("a list of packages");
    packages
        .iter()
        .map(|package| {
            let named = package["dependencies"].as_array().expect("a list");
            (name(package), named.iter().map(name).collect())
        })
        .collect()
}

fn name(package: &Value) -> String {
    package["name"].as_str().expect("a name").to_owned()
}

#[test]
fn every_crate_is_on_the_map() {
    let on_the_map: BTreeSet<String> = MAY_KNOW.iter().map(|(n, _)| (*n).to_owned()).collect();
    let in_the_workspace: BTreeSet<String> = dependencies().into_keys().collect();
    assert_eq!(in_the_workspace, on_the_map);
}

#[test]
fn crates_know_only_whom_the_map_allows() {
    let dependencies = dependencies();
    for (name, allowed) in MAY_KNOW {
        let others = MAY_KNOW.iter().map(|(other, _)| *other);
        let known: Vec<&str> = others
            .filter(|other| dependencies[name].contains(*other))
            .collect();
        for other in known {
            assert!(
                allowed.contains(&other),
                "{name} depends on {other}, which server/ARCHITECTURE.md does not allow"
            );
        }
    }
}

#[test]
fn each_heavy_library_lives_in_one_place() {
    for (name, named) in dependencies() {
        for (library, homes) in TAMED_BY {
            assert!(
                homes.contains(&name.as_str()) || !named.contains(library),
                "{name} depends on {library}, which lives in {}",
                homes.join(" and ")
            );
        }
    }
}

#[test]
fn the_vocabulary_needs_next_to_nothing() {
    let named = &dependencies()["domain"];
    // cpu-time is its benchmark's alone.
    let allowed = ["cpu-time", "rand", "serde", "serde_json", "thiserror"];
    for library in named {
        assert!(
            allowed.contains(&library.as_str()),
            "domain needs {library}"
        );
    }
}

#[test]
fn the_task_runner_needs_the_standard_library_alone() {
    let manifest = include_str!("../Cargo.toml");
    let (_, after) = manifest
        .split_once("[dependencies]")
        .expect("a section of dependencies");
    let section = after.split("\n[").next().unwrap_or_default();
    assert_eq!(section.trim(), "", "xtask must build in seconds");
}
