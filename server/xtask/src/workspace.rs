//! Where this workspace lies, and how its cargo is called.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder that holds `Cargo.toml`.
pub(crate) struct Workspace {
    root: PathBuf,
}

impl Workspace {
    /// Cargo tells a program that it runs where its crate lies; two folders up is the workspace.
    pub(crate) fn of_this_program() -> Self {
        let manifest = std::env::var_os("CARGO_MANIFEST_DIR")
            .unwrap_or_else(|| OsString::from(env!("CARGO_MANIFEST_DIR")));
        let root = Path::new(&manifest)
            .ancestors()
            .nth(2)
            .expect("server/xtask lies two folders below the workspace")
            .to_path_buf();
        Self { root }
    }

    /// The folder itself.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// Where `cargo xtask setup` puts libtorch.
    pub(crate) fn libtorch_folder(&self) -> PathBuf {
        self.root.join(".libtorch")
    }

    /// The user's own libtorch, where there is one.
    ///
    /// `.cargo/config.toml` sets `LIBTORCH` for every program that cargo runs, this one too, so
    /// the folder that it names does not count as the user's.
    pub(crate) fn own_libtorch(&self) -> Option<PathBuf> {
        let ours = self.libtorch_folder().join("torch");
        std::env::var_os("LIBTORCH")
            .map(PathBuf::from)
            .filter(|path| *path != ours)
    }

    /// A cargo command in this workspace, in the same surroundings as one typed by hand: what
    /// `cargo xtask` itself added is taken away again, or build scripts would run twice.
    pub(crate) fn cargo(&self) -> Command {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
        let mut command = Command::new(cargo);
        command.current_dir(&self.root);
        for (name, _) in std::env::vars_os() {
            let added_by_cargo = name
                .to_str()
                .is_some_and(|n| n.starts_with("CARGO_PKG_") || n.starts_with("CARGO_MANIFEST_"));
            if added_by_cargo {
                command.env_remove(&name);
            }
        }
        if self.own_libtorch().is_none() {
            command.env_remove("LIBTORCH");
        }
        command
    }

    /// A program of the release profile. It lies beside the folder of the profile that this very
    /// program was built with, wherever the target directory is.
    pub(crate) fn release_program(&self, name: &str) -> PathBuf {
        let target = std::env::current_exe()
            .ok()
            .and_then(|path| path.ancestors().nth(2).map(Path::to_path_buf))
            .unwrap_or_else(|| self.root.join("target"));
        target.join("release").join(name)
    }
}
