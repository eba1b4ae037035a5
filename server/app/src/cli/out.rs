//! `--out`: where results go. Looked at before the work, made when the first of them is written.

use std::fs::{self, OpenOptions};
use std::path::Path;

use anyhow::Context as _;

use super::BadInput;

/// Sees to it that files can be put into a folder, which need not be there yet.
///
/// # Errors
/// [`BadInput`] says what is in the way.
pub(super) fn folder(path: &Path) -> Result<(), BadInput> {
    room(path).map_err(|why| refused("make the folder", path, &why))
}

/// Sees to it that a file can be written, in a folder that need not be there yet.
///
/// # Errors
/// [`BadInput`] says what is in the way.
pub(super) fn file(path: &Path) -> Result<(), BadInput> {
    let refused = |why: String| refused("write", path, &why);
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(refused("it is a folder".into())),
        Ok(there) if there.is_file() => {
            let opened = OpenOptions::new().write(true).open(path);
            opened.map(drop).map_err(|error| refused(error.to_string()))
        }
        Ok(_) => Ok(()), // a terminal or a pipe
        Err(_) => room(parent(path)).map_err(refused),
    }
}

/// Writes a file, and makes its folder where there is none.
pub(super) fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    fs::create_dir_all(parent(path))
        .and_then(|()| fs::write(path, bytes))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// The folder of a file; empty for the one that we are in.
pub(super) fn parent(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

fn refused(doing: &str, path: &Path, why: &str) -> BadInput {
    let path = path.display();
    BadInput(format!(
        "cannot {doing} {path}: {why}; choose another --out"
    ))
}

/// Whether something can be put into a folder, or into the nearest one above it that is there; else
/// what is in the way. Leaves nothing behind.
fn room(folder: &Path) -> Result<(), String> {
    let is_there = |path: &&Path| path.symlink_metadata().is_ok();
    let nearest = folder.ancestors().find(is_there).unwrap_or(Path::new("."));
    if !nearest.is_dir() {
        return Err(format!("{} is no folder", nearest.display()));
    }
    let trial = nearest.join(format!(".stair-{}", std::process::id()));
    let made = fs::File::create(&trial);
    let _ = fs::remove_file(&trial); // where it could not be made, none is there
    made.map(drop)
        .map_err(|error| format!("nothing can be put into {}: {error}", nearest.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_written_into_folders_that_were_not_there_and_looking_makes_none() {
        let here = tempfile::tempdir().unwrap();
        let path = here.path().join("a/b/figure.svg");
        file(&path).unwrap();
        folder(&here.path().join("a")).unwrap();
        assert_eq!(fs::read_dir(here.path()).unwrap().count(), 0);
        write(&path, b"<svg/>").unwrap();
        file(&path).unwrap();
        assert_eq!(
            fs::read(&path).unwrap(),
            b"<svg/>",
            "looked at, not emptied"
        );
    }

    #[test]
    fn what_is_in_the_way_is_named_with_what_to_do() {
        let here = tempfile::tempdir().unwrap();
        let note = here.path().join("README.md");
        fs::write(&note, "a file").unwrap();
        let told = file(&note.join("x.svg")).unwrap_err().to_string();
        assert!(told.contains("README.md is no folder"), "{told}");
        assert!(told.ends_with("; choose another --out"), "{told}");
        let told = folder(&note).unwrap_err().to_string();
        assert!(told.starts_with("cannot make the folder "), "{told}");
        let told = file(here.path()).unwrap_err().to_string();
        assert!(told.contains("it is a folder"), "{told}");
    }
}
