//! Which wheels a slim libtorch comes from, and how pip is asked for exactly those bytes.

/// The release that tch 0.24 is bound to.
pub(super) const VERSION: &str = "2.11.0";

/// One file of the Python package index, pinned by its hash.
pub(super) struct Wheel {
    /// Name in the index.
    pub(super) name: &'static str,
    version: &'static str,
    sha256: &'static str,
    /// Bytes to download.
    pub(super) size: u64,
}

/// libtorch itself, and two small libraries that it loads even without a graphics card.
pub(super) const WHEELS: [Wheel; 3] = [
    Wheel {
        name: "torch",
        version: VERSION,
        sha256: "7aa2f9bbc6d4595ba72138026b2074be1233186150e9292865e04b7a63b8c67a",
        size: 530_604_548,
    },
    Wheel {
        name: "nvidia-cuda-runtime",
        version: "13.0.96",
        sha256: "7f82250d7782aa23b6cfe765ecc7db554bd3c2870c43f3d1821f1d18aebf0548",
        size: 2_243_632,
    },
    Wheel {
        name: "nvidia-cuda-cupti",
        version: "13.0.85",
        sha256: "4eb01c08e859bf924d222250d2e8f8b8ff6d3db4721288cf35d14252a4d933c8",
        size: 10_715_597,
    },
];

/// Wheels for this interpreter and these platforms are asked for whatever python3 runs here:
/// nothing of Python is kept.
const TAGS: [&str; 15] = [
    "--only-binary=:all:",
    "--implementation=cp",
    "--abi=cp311",
    "--abi=none",
    "--python-version=3.11",
    "--platform=manylinux_2_28_x86_64",
    "--platform=manylinux_2_25_x86_64",
    "--platform=manylinux_2_17_x86_64",
    "--platform=manylinux2014_x86_64",
    "--no-deps",
    "--require-hashes",
    "--no-input",
    "--disable-pip-version-check",
    "--no-cache-dir",
    "--progress-bar=off",
];

impl Wheel {
    /// A line of a requirements file: `name==version --hash=sha256:…`.
    pub(super) fn requirement(&self) -> String {
        format!(
            "{}=={} --hash=sha256:{}",
            self.name, self.version, self.sha256
        )
    }

    /// How the file's name begins: `nvidia_cuda_cupti-13.0.85-`.
    pub(super) fn file_prefix(&self) -> String {
        format!("{}-{}-", self.name.replace('-', "_"), self.version)
    }
}

/// Arguments of `python3` that download what a requirements file names into a folder. A file
/// that is there already is checked, and fetched anew only where its hash is wrong.
pub(super) fn pip_arguments(requirements: &str, folder: &str) -> Vec<String> {
    ["-m", "pip", "--quiet", "download"]
        .into_iter()
        .chain(TAGS)
        .chain(["--requirement", requirements, "--dest", folder])
        .map(str::to_owned)
        .collect()
}

/// All the bytes to download.
pub(super) fn total_size() -> u64 {
    WHEELS.iter().map(|wheel| wheel.size).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wheel_is_pinned_by_a_whole_hash() {
        for wheel in &WHEELS {
            assert_eq!(wheel.sha256.len(), 64, "{}", wheel.name);
            assert!(wheel.sha256.bytes().all(|b| b.is_ascii_hexdigit()));
        }
    }

    #[test]
    fn requirements_and_file_names_are_spelled_as_pip_spells_them() {
        let cupti = &WHEELS[2];
        assert!(
            cupti
                .requirement()
                .starts_with("nvidia-cuda-cupti==13.0.85 --hash=sha256:4eb0")
        );
        assert_eq!(cupti.file_prefix(), "nvidia_cuda_cupti-13.0.85-");
    }
}
