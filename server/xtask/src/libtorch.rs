//! A slim libtorch in `.libtorch/`: the processor's libraries and headers of the PyTorch wheel,
//! without its gigabytes of CUDA. A `LIBTORCH` of the user's own is respected.

mod stamp;
mod wheel;

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::child;
use crate::failure::Failure;
use crate::progress::{self, Progress};
use crate::workspace::Workspace;

/// Bytes of all the unpacked files, for the progress line.
const UNPACKED_SIZE: u64 = 492_000_000;

/// The wheel's own `libtorch.so` holds no code but asks for the CUDA part; a linker script of the
/// same name leads to the processor's part alone.
const LINKER_SCRIPT: &str = "INPUT(AS_NEEDED(-ltorch_cpu))\n";

const UNPACK: &str = include_str!("libtorch/unpack.py");

/// Whether libtorch has still to be fetched.
///
/// # Errors
/// Exit code 2 where the user's own `LIBTORCH` cannot be used, or where none is fetched for this
/// kind of machine.
pub(crate) fn is_missing(workspace: &Workspace) -> Result<bool, Failure> {
    if let Some(own) = workspace.own_libtorch() {
        return check_own(&own).map(|()| false);
    }
    if stamp::fits(&workspace.libtorch_folder()) {
        return Ok(false);
    }
    if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Ok(true);
    }
    Err(Failure::needs_a_person(format!(
        "libtorch is fetched for Linux on x86-64 only, this is {os} on {arch}. Get PyTorch {version} \
         for it, say which folder holds its include/ and lib/, and start again:\n\n  \
         python3 -m pip install torch=={version}\n  \
         export LIBTORCH=\"$(python3 -c 'import os, torch; print(os.path.dirname(torch.__file__))')\"\n",
        os = std::env::consts::OS,
        arch = std::env::consts::ARCH,
        version = wheel::VERSION,
    )))
}

/// Looks whether a folder of the user's own can be one, so that no compiler has to complain.
fn check_own(folder: &Path) -> Result<(), Failure> {
    let lacks: Vec<&str> = ["include/torch/csrc", "lib"]
        .into_iter()
        .filter(|part| !folder.join(part).exists())
        .collect();
    if !lacks.is_empty() {
        return Err(Failure::needs_a_person(format!(
            "LIBTORCH={} holds no {}. Let it name the folder of a libtorch {}, or unset it and one \
             is fetched",
            folder.display(),
            lacks.join(" and no "),
            wheel::VERSION,
        )));
    }
    let version = fs::read_to_string(folder.join("build-version")).unwrap_or_default();
    let release = version.trim().split('+').next().unwrap_or_default();
    if release.is_empty() || release == wheel::VERSION {
        return Ok(());
    }
    Err(Failure::needs_a_person(format!(
        "LIBTORCH={} is libtorch {release}, this program is bound to {}. Unset LIBTORCH and that \
         one is fetched",
        folder.display(),
        wheel::VERSION,
    )))
}

/// Downloads and unpacks libtorch. What an interrupted call downloaded is used again; the folder
/// gets its name only when it is whole.
///
/// # Errors
/// The download or the unpacking failed, or the disk is full.
pub(crate) fn fetch(workspace: &Workspace) -> Result<(), Failure> {
    let folder = workspace.libtorch_folder();
    let partial = workspace.root().join(".libtorch.partial");
    let _lock = wait_for_others(workspace.root())?;
    if stamp::fits(&folder) {
        return Ok(());
    }
    let wheels = partial.join("wheels");
    create(&wheels)?;
    println!(
        "libtorch {}: {} to download, {} kept in {}",
        wheel::VERSION,
        progress::megabytes(wheel::total_size()),
        progress::megabytes(UNPACKED_SIZE),
        folder.display()
    );
    let files = wheel::WHEELS
        .iter()
        .map(|wheel| download(wheel, &partial, &wheels))
        .collect::<Result<Vec<_>, _>>()?;
    let tree = partial.join("tree");
    remove(&tree)?;
    unpack(&tree, &files)?;
    remove(&folder)?;
    fs::rename(&tree, &folder).map_err(|error| Failure::io("rename to", &folder, &error))?;
    remove(&partial)
}

/// Two set-ups in two terminals: the second one waits. The lock goes with the returned file.
fn wait_for_others(root: &Path) -> Result<File, Failure> {
    let path = root.join(".libtorch.lock");
    let file = File::create(&path).map_err(|error| Failure::io("create", &path, &error))?;
    let locked = match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => {
            println!("another set-up fetches libtorch already; waiting for it");
            file.lock()
        }
        Err(TryLockError::Error(error)) => Err(error),
    };
    locked.map_err(|error| Failure::io("lock", &path, &error))?;
    Ok(file)
}

/// Fetches one wheel and returns its file.
fn download(wheel: &wheel::Wheel, partial: &Path, wheels: &Path) -> Result<PathBuf, Failure> {
    let requirements = partial.join(format!("{}.txt", wheel.name));
    fs::write(&requirements, wheel.requirement())
        .map_err(|error| Failure::io("write", &requirements, &error))?;
    let scratch = partial.join("scratch");
    remove(&scratch)?;
    create(&scratch)?;
    let arguments = wheel::pip_arguments(
        &requirements.display().to_string(),
        &wheels.display().to_string(),
    );
    let mut command = Command::new("python3");
    // pip downloads to a temporary folder: ours, which has room for it and shows how far it is.
    command.args(arguments).env("TMPDIR", &scratch);
    let label = format!(
        "downloading {} ({})",
        wheel.name,
        progress::megabytes(wheel.size)
    );
    watch(&label, &mut command, &scratch, wheel.size)?;
    remove(&scratch)?;
    find_wheel(wheels, &wheel.file_prefix())
}

fn find_wheel(wheels: &Path, prefix: &str) -> Result<PathBuf, Failure> {
    let entries = fs::read_dir(wheels).map_err(|error| Failure::io("list", wheels, &error))?;
    entries
        .flatten()
        .map(|entry| entry.path())
        .find(|path| {
            path.file_name()
                .is_some_and(|name| name.to_string_lossy().starts_with(prefix))
        })
        .ok_or_else(|| {
            Failure::failed(format!("pip left no {prefix}….whl in {}", wheels.display()))
        })
}

/// Fills a folder from the wheels and stamps it.
fn unpack(tree: &Path, files: &[PathBuf]) -> Result<(), Failure> {
    create(tree)?;
    let mut command = Command::new("python3");
    command.args(["-c", UNPACK]).arg(tree).args(files);
    let libraries = watch("unpacking libtorch", &mut command, tree, UNPACKED_SIZE)?;
    let written = [
        ("torch/lib/libtorch.so", LINKER_SCRIPT.to_owned()),
        ("torch/build-version", format!("{}\n", wheel::VERSION)),
        (stamp::FILE_NAME, stamp::text(&libraries)),
    ];
    for (name, text) in written {
        let path = tree.join(name);
        fs::write(&path, text).map_err(|error| Failure::io("write", &path, &error))?;
    }
    Ok(())
}

/// Runs a command and tells meanwhile how much of `expected` bytes lies in `folder`. Returns what
/// it printed; what it complained about goes to the terminal.
fn watch(
    label: &str,
    command: &mut Command,
    folder: &Path,
    expected: u64,
) -> Result<String, Failure> {
    let mut progress = Progress::start(label);
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|error| child::not_started(label, &error))?;
    // The few lines that are printed fit into the pipe, so that nobody waits for anybody.
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) => progress.bytes(progress::folder_size(folder), expected),
            Err(error) => return Err(Failure::failed(format!("lost sight of {label}: {error}"))),
        }
        std::thread::sleep(Duration::from_millis(200));
    };
    if !status.success() {
        return Err(Failure {
            message: format!(
                "failed while {label}; the lines above say why. Start again and it goes on with \
                 what is there"
            ),
            exit_code: child::exit_code(status),
        });
    }
    progress.finish();
    let mut printed = String::new();
    if let Some(mut stdout) = child.stdout.take() {
        std::io::Read::read_to_string(&mut stdout, &mut printed)
            .map_err(|error| Failure::failed(format!("could not read from {label}: {error}")))?;
    }
    Ok(printed)
}

fn create(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| Failure::io("create", folder, &error))
}

fn remove(folder: &Path) -> Result<(), Failure> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(Failure::io("remove", folder, &error))
        }
        _ => Ok(()),
    }
}
