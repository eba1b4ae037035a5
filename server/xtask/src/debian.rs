//! Installs Debian packages when that needs no question, else says which line to type.

use std::process::Command;

use crate::child;
use crate::failure::Failure;
use crate::needs::Need;

/// How this process may install packages.
enum Rights {
    Root,
    SudoWithoutPassword,
    None,
}

/// Installs the packages that bring what is missing.
///
/// # Errors
/// Exit code 2 with the exact line where nobody may install without a question or there is no
/// apt-get; apt-get's own exit code where it fails.
pub(crate) fn install(missing: &[&Need]) -> Result<(), Failure> {
    if missing.is_empty() {
        return Ok(());
    }
    println!("missing on this machine:");
    for need in missing {
        println!("  {:<20} {}", need.package, need.purpose);
    }
    let packages: Vec<&str> = missing.iter().map(|need| need.package).collect();
    if !child::is_on_path("apt-get") {
        return Err(Failure::needs_a_person(format!(
            "this machine has no apt-get. Install what Debian calls: {}; then start again",
            packages.join(" ")
        )));
    }
    let rights = rights();
    if matches!(rights, Rights::None) {
        return Err(Failure::needs_a_person(format!(
            "installing needs your password. Type this line, then start again:\n\n  {}\n",
            line_to_type(&packages)
        )));
    }
    apt_get(&rights, &["update"], &[])?;
    apt_get(
        &rights,
        &["install", "-y", "--no-install-recommends"],
        &packages,
    )
    .map_err(|failure| Failure {
        message: format!(
            "{}\nBy hand it would be:\n\n  {}\n",
            failure.message,
            line_to_type(&packages)
        ),
        ..failure
    })
}

fn apt_get(rights: &Rights, action: &[&str], packages: &[&str]) -> Result<(), Failure> {
    let mut command = match rights {
        Rights::SudoWithoutPassword => {
            let mut sudo = Command::new("sudo");
            sudo.args(["-n", "env", "DEBIAN_FRONTEND=noninteractive", "apt-get"]);
            sudo
        }
        Rights::Root | Rights::None => {
            let mut apt_get = Command::new("apt-get");
            apt_get.env("DEBIAN_FRONTEND", "noninteractive");
            apt_get
        }
    };
    // Another apt-get may be at work: wait for it rather than fail.
    command.args(["-q", "-o", "DPkg::Lock::Timeout=300"]);
    command.args(action).args(packages);
    command.stdin(std::process::Stdio::null());
    let title = format!("apt-get {} {}", action[0], packages.join(" "));
    child::run(title.trim_end(), &mut command)
}

fn rights() -> Rights {
    let is_root = Command::new("id")
        .arg("-u")
        .output()
        .is_ok_and(|output| output.stdout.trim_ascii() == b"0");
    if is_root {
        Rights::Root
    } else if child::succeeds("sudo", &["-n", "true"]) {
        Rights::SudoWithoutPassword
    } else {
        Rights::None
    }
}

/// What a person types to get the same.
fn line_to_type(packages: &[&str]) -> String {
    format!(
        "sudo apt-get update && sudo apt-get install -y --no-install-recommends {}",
        packages.join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_to_type_can_be_pasted() {
        assert_eq!(
            line_to_type(&["g++", "nasm"]),
            "sudo apt-get update && sudo apt-get install -y --no-install-recommends g++ nasm"
        );
    }
}
