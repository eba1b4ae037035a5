//! Files and folders that the README and `server/ARCHITECTURE.md` name exist.

use std::path::{Path, PathBuf};

/// Folders at the top of the tree: a code span that begins with one is a path from there.
const TOP_LEVEL: [&str; 7] = [
    "assets",
    "migrations",
    "server",
    "tests",
    "web",
    ".cargo",
    ".ci",
];

/// Supplied by hand from a real session, after the program is built.
const PICTURES: &str = "assets/readme/";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Targets of Markdown links that lie in this tree.
fn links(text: &str) -> Vec<&str> {
    text.match_indices("](")
        .filter_map(|(at, opening)| text[at + opening.len()..].split(')').next())
        .filter(|target| !target.contains("://") && !target.starts_with('#'))
        .collect()
}

/// Code spans on one line that are paths from the top of the tree.
fn paths_in_code(text: &str) -> Vec<&str> {
    text.lines()
        .filter(|line| !line.starts_with("```"))
        .flat_map(|line| line.split('`').skip(1).step_by(2))
        .filter(|span| {
            let first = span.split('/').next().unwrap_or_default();
            TOP_LEVEL.contains(&first) && !span.contains(' ')
        })
        .collect()
}

/// The name under which a heading is linked to: lower case, spaces as hyphens, no other signs.
fn anchor(heading: &str) -> String {
    heading
        .trim_start_matches('#')
        .trim()
        .to_lowercase()
        .chars()
        .filter(|sign| sign.is_alphanumeric() || " -_".contains(*sign))
        .map(|sign| if sign == ' ' { '-' } else { sign })
        .collect()
}

/// Whether the file is there and, behind a `#`, one of its headings.
fn leads_somewhere(folder: &Path, target: &str) -> bool {
    let (file, heading) = target.split_once('#').unwrap_or((target, ""));
    let path = folder.join(file);
    if heading.is_empty() {
        return path.exists();
    }
    std::fs::read_to_string(path).is_ok_and(|text| {
        text.lines()
            .filter(|line| line.starts_with('#'))
            .any(|line| anchor(line) == heading)
    })
}

fn missing(document: &str) -> Vec<String> {
    let root = root();
    let path = root.join(document);
    let text = std::fs::read_to_string(&path).expect("the document is there");
    let folder = path.parent().expect("a file lies in a folder");
    let linked = links(&text)
        .into_iter()
        .filter(|target| !target.starts_with(PICTURES))
        .filter(|target| !leads_somewhere(folder, target));
    let named = paths_in_code(&text)
        .into_iter()
        .filter(|target| !root.join(target).exists());
    linked.chain(named).map(str::to_owned).collect()
}

#[test]
fn the_readme_names_only_what_exists() {
    assert_eq!(missing("README.md"), Vec::<String>::new());
}

#[test]
fn the_architecture_names_only_what_exists() {
    assert_eq!(missing("server/ARCHITECTURE.md"), Vec::<String>::new());
}

#[test]
fn every_crate_is_in_the_readme_and_in_the_architecture() {
    let read = |name| std::fs::read_to_string(root().join(name)).expect("the document is there");
    let (readme, architecture) = (read("README.md"), read("server/ARCHITECTURE.md"));
    for entry in std::fs::read_dir(root().join("server")).expect("a folder of crates") {
        let entry = entry.expect("an entry");
        if !entry.path().is_dir() {
            continue;
        }
        let name = entry.file_name().to_string_lossy().into_owned();
        assert!(readme.contains(&format!("`server/{name}`")), "{name}");
        assert!(architecture.contains(&format!("### [`{name}`]")), "{name}");
    }
}

#[test]
fn a_link_into_a_document_leads_to_one_of_its_headings() {
    let leads = |target| leads_somewhere(&root(), target);
    assert!(leads("README.md") && leads("CHANGELOG.md#unreleased"));
    assert!(!leads("CHANGELOG.md#released") && !leads("NOTHING.md#unreleased"));
    assert_eq!(
        anchor("## abstract-mdp, query-counts"),
        "abstract-mdp-query-counts"
    );
}

#[test]
fn links_and_paths_are_told_from_other_text() {
    let text = "[a](b/c.md) `web` `server/x y` [d](https://example.org) `stair` `assets/presets`";
    assert_eq!(links(text), ["b/c.md"]);
    assert_eq!(paths_in_code(text), ["web", "assets/presets"]);
}
