//! What the machine must have, how to see that it is there, and the Debian package that brings it.

use std::path::Path;

use crate::child;

/// One thing that the machine must have.
pub(crate) struct Need {
    /// Debian package that brings it.
    pub(crate) package: &'static str,
    /// What it is for, in a few words.
    pub(crate) purpose: &'static str,
    /// Looks for the thing itself, so that one from elsewhere counts too.
    is_there: fn() -> bool,
}

/// Building and drawing.
const TO_SERVE: [Need; 4] = [
    Need {
        package: "g++",
        purpose: "compiles the C++ inside libtorch's binding and OpenH264",
        is_there: || child::is_on_path("c++") || child::is_on_path("g++"),
    },
    Need {
        package: "nasm",
        purpose: "assembles OpenH264's fast paths (2.4 times faster clips)",
        is_there: || child::is_on_path("nasm"),
    },
    Need {
        package: "libvulkan1",
        purpose: "loads Vulkan drivers",
        is_there: has_vulkan_loader,
    },
    Need {
        package: "mesa-vulkan-drivers",
        purpose: "draws clips, without a graphics card too",
        is_there: has_vulkan_driver,
    },
];

/// Driving a real browser.
const TO_TEST: [Need; 2] = [
    Need {
        package: "chromium",
        purpose: "shows the pages in the browser tests",
        is_there: || child::is_on_path("chromium"),
    },
    Need {
        package: "chromium-driver",
        purpose: "drives that browser",
        is_there: || child::is_on_path("chromedriver"),
    },
];

/// Fetching libtorch.
const TO_FETCH: [Need; 1] = [Need {
    package: "python3-pip",
    purpose: "downloads and unpacks libtorch",
    is_there: || child::succeeds("python3", &["-m", "pip", "--version"]),
}];

/// What is missing of all that the coming steps need.
pub(crate) fn missing(with_tests: bool, with_fetch: bool) -> Vec<&'static Need> {
    let to_test: &[Need] = if with_tests { &TO_TEST } else { &[] };
    let to_fetch: &[Need] = if with_fetch { &TO_FETCH } else { &[] };
    TO_SERVE
        .iter()
        .chain(to_test)
        .chain(to_fetch)
        .filter(|need| !(need.is_there)())
        .collect()
}

fn has_vulkan_loader() -> bool {
    let folders = [
        "/usr/lib/x86_64-linux-gnu",
        "/usr/lib/aarch64-linux-gnu",
        "/usr/lib64",
        "/usr/lib",
        "/usr/local/lib",
    ];
    folders
        .iter()
        .any(|folder| Path::new(folder).join("libvulkan.so.1").exists())
}

/// A software driver, or any driver where there is a graphics card for it.
fn has_vulkan_driver() -> bool {
    let names: Vec<String> = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"]
        .iter()
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flat_map(Iterator::flatten)
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    let has_software_driver = names.iter().any(|name| name.starts_with("lvp_icd"));
    let has_graphics_card = Path::new("/dev/dri").exists() || Path::new("/dev/nvidia0").exists();
    has_software_driver || (has_graphics_card && !names.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_need_names_one_package_and_why() {
        for need in TO_SERVE.iter().chain(&TO_TEST).chain(&TO_FETCH) {
            assert!(!need.package.contains(' '), "{}", need.package);
            assert!(!need.purpose.is_empty(), "{}", need.package);
        }
    }

    #[test]
    fn serving_asks_for_no_browser() {
        let packages: Vec<_> = missing(false, false).iter().map(|n| n.package).collect();
        assert!(!packages.contains(&"chromium"));
        assert!(!packages.contains(&"chromium-driver"));
    }
}
