//! A stamp in the unpacked folder: which wheels it came from, and how large each library is.
//!
//! It is written before the folder gets its final name, so a folder with a fitting stamp is whole.

use std::fmt::Write as _;
use std::path::Path;

use super::wheel::WHEELS;

/// Name of the stamp in the folder.
pub(super) const FILE_NAME: &str = "stamp";

/// The first line; a change of what is unpacked changes it, and every folder is made anew.
const LAYOUT: &str = "slim libtorch, layout 1";

/// The stamp's text. `libraries` holds a line `<bytes> <path>` for each.
pub(super) fn text(libraries: &str) -> String {
    let mut text = format!("{LAYOUT}\n");
    for wheel in &WHEELS {
        writeln!(text, "wheel {}", wheel.requirement()).expect("writing to a string cannot fail");
    }
    for line in libraries.lines() {
        writeln!(text, "library {line}").expect("writing to a string cannot fail");
    }
    text
}

/// Whether a folder has the stamp of this program's wheels, and its libraries their sizes.
pub(super) fn fits(folder: &Path) -> bool {
    let Ok(stamp) = std::fs::read_to_string(folder.join(FILE_NAME)) else {
        return false;
    };
    let libraries: Vec<&str> = stamp
        .lines()
        .filter_map(|line| line.strip_prefix("library "))
        .collect();
    !libraries.is_empty()
        && stamp == text(&libraries.join("\n"))
        && libraries.iter().all(|line| has_its_size(folder, line))
}

fn has_its_size(folder: &Path, line: &str) -> bool {
    let Some((size, path)) = line.split_once(' ') else {
        return false;
    };
    let Ok(metadata) = std::fs::metadata(folder.join(path)) else {
        return false;
    };
    size.parse() == Ok(metadata.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder of its own for one test, gone afterwards.
    struct Scratch(std::path::PathBuf);

    impl Scratch {
        fn new(name: &str) -> Self {
            let folder =
                std::env::temp_dir().join(format!("xtask-stamp-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&folder).expect("a temporary folder can be made");
            Self(folder)
        }

        fn write(&self, name: &str, text: &str) {
            std::fs::write(self.0.join(name), text).expect("a temporary file can be written");
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_folder_with_its_stamp_and_libraries_is_left_alone() {
        let folder = Scratch::new("whole");
        folder.write("lib.so", "12345");
        folder.write(FILE_NAME, &text("5 lib.so"));
        assert!(fits(&folder.0));
    }

    #[test]
    fn a_folder_without_a_stamp_is_made_anew() {
        assert!(!fits(&Scratch::new("bare").0));
    }

    #[test]
    fn a_library_cut_short_is_noticed() {
        let folder = Scratch::new("short");
        folder.write("lib.so", "123");
        folder.write(FILE_NAME, &text("5 lib.so"));
        assert!(!fits(&folder.0));
    }

    #[test]
    fn a_stamp_of_other_wheels_is_out_of_date() {
        let folder = Scratch::new("other");
        folder.write("lib.so", "12345");
        folder.write(FILE_NAME, &text("5 lib.so").replace("2.11.0", "2.10.0"));
        assert!(!fits(&folder.0));
    }
}
