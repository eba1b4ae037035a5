//! Named sections in one file: written whole or not at all, and refused when damaged.

use std::collections::BTreeMap;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::checksum::Checksum;
use crate::durable;
use crate::error::LearnError;

const MAGIC: &[u8; 8] = b"STAIRckp";
const FORMAT: u32 = 1;
/// Magic, format, length of the table of contents.
const HEAD_LEN: usize = 8 + 4 + 8;
/// The checksum over everything before it.
const TAIL_LEN: usize = 8;

/// Sections by name: tensors as raw little-endian f32 with their shape, f64 numbers likewise,
/// everything else as JSON.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Archive {
    sections: BTreeMap<String, Section>,
}

#[derive(Debug, Clone, PartialEq)]
enum Section {
    F32 { shape: Vec<i64>, values: Vec<f32> },
    F64(Vec<f64>),
    Json(String),
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Entry {
    F32 { shape: Vec<i64>, n_bytes: usize },
    F64 { n_bytes: usize },
    Json { n_bytes: usize },
}

impl Archive {
    /// Without sections.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a section of f32 numbers, `values.len()` = product of `shape`; replaces one of the
    /// same name.
    pub fn put_f32(&mut self, name: &str, values: Vec<f32>, shape: &[i64]) {
        let shape = shape.to_vec();
        self.sections
            .insert(name.to_owned(), Section::F32 { shape, values });
    }

    /// Adds a section of f64 numbers, kept bit for bit.
    pub fn put_f64(&mut self, name: &str, values: &[f64]) {
        self.sections
            .insert(name.to_owned(), Section::F64(values.to_vec()));
    }

    /// Adds a section as JSON.
    ///
    /// # Panics
    /// When the value's own serialisation fails (a map whose keys are no strings): a bug.
    pub fn put_json<T: Serialize + ?Sized>(&mut self, name: &str, value: &T) {
        let json = serde_json::to_string(value).expect("checkpoint values serialise to JSON");
        self.sections.insert(name.to_owned(), Section::Json(json));
    }

    /// The f32 numbers of a section whose shape must be `shape`.
    ///
    /// # Errors
    /// When the section is missing, of another kind, or of another shape.
    pub fn f32(&self, name: &str, shape: &[i64]) -> Result<&[f32], LearnError> {
        match self.section(name)? {
            Section::F32 {
                shape: found,
                values,
            } if found == shape => Ok(values),
            Section::F32 { shape: found, .. } => Err(LearnError::section(
                name,
                format!(
                    "it holds {found:?} numbers where {shape:?} are needed: another network, another task, or a task whose states have changed since"
                ),
            )),
            _ => Err(LearnError::section(name, "it holds no f32 numbers")),
        }
    }

    /// The `N` f64 numbers of a section.
    ///
    /// # Errors
    /// When the section is missing, of another kind, or of another length.
    pub fn f64<const N: usize>(&self, name: &str) -> Result<[f64; N], LearnError> {
        let Section::F64(values) = self.section(name)? else {
            return Err(LearnError::section(name, "it holds no f64 numbers"));
        };
        values[..].try_into().map_err(|_| {
            LearnError::section(name, format!("it holds {} numbers, not {N}", values.len()))
        })
    }

    /// The value of a JSON section.
    ///
    /// # Errors
    /// When the section is missing, of another kind, or not a `T`.
    pub fn json<T: DeserializeOwned>(&self, name: &str) -> Result<T, LearnError> {
        let Section::Json(json) = self.section(name)? else {
            return Err(LearnError::section(name, "it holds no JSON"));
        };
        serde_json::from_str(json).map_err(|e| LearnError::section(name, e.to_string()))
    }

    /// The value of a JSON section; the default one where there is none, for what earlier revisions
    /// of the program did not write.
    ///
    /// # Errors
    /// When the section is of another kind, or not a `T`.
    pub fn json_or_default<T: DeserializeOwned + Default>(
        &self,
        name: &str,
    ) -> Result<T, LearnError> {
        if self.has(name) {
            self.json(name)
        } else {
            Ok(T::default())
        }
    }

    /// Whether there is a section of that name.
    pub fn has(&self, name: &str) -> bool {
        self.sections.contains_key(name)
    }

    /// Equal for archives whose sections are equal bit for bit: 16 hexadecimal digits.
    pub fn fingerprint(&self) -> String {
        format!("{:016x}", Checksum::of(&self.to_bytes()))
    }

    /// Writes the file beside its place, makes it durable, then puts it there in one step: a
    /// reader sees the old file or the new one, whenever the process dies.
    ///
    /// # Errors
    /// When the folder cannot be written (full, read-only).
    pub fn write(&self, path: &Path) -> Result<(), LearnError> {
        durable::replace(path, &self.to_bytes()).map_err(|e| LearnError::file("write", path, e))
    }

    /// Reads a file that [`Archive::write`] wrote.
    ///
    /// # Errors
    /// When it cannot be read, is damaged, or is of another version.
    pub fn read(path: &Path) -> Result<Self, LearnError> {
        let bytes = std::fs::read(path).map_err(|e| LearnError::file("read", path, e))?;
        Self::parse(&bytes, path)
    }

    fn section(&self, name: &str) -> Result<&Section, LearnError> {
        let missing = || LearnError::section(name, "it is missing");
        self.sections.get(name).ok_or_else(missing)
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut contents = BTreeMap::new();
        let mut data = Vec::new();
        for (name, section) in &self.sections {
            let start = data.len();
            section.append_to(&mut data);
            contents.insert(name, section.entry(data.len() - start));
        }
        let contents = serde_json::to_vec(&contents).expect("a table of contents is plain JSON");
        let mut bytes = Vec::with_capacity(HEAD_LEN + contents.len() + data.len() + TAIL_LEN);
        bytes.extend(MAGIC);
        bytes.extend(FORMAT.to_le_bytes());
        bytes.extend((contents.len() as u64).to_le_bytes());
        bytes.extend(contents);
        bytes.extend(data);
        bytes.extend(Checksum::of(&bytes).to_le_bytes());
        bytes
    }

    fn parse(bytes: &[u8], path: &Path) -> Result<Self, LearnError> {
        let damaged = |reason: &str| LearnError::damaged(path, reason);
        if bytes.len() < HEAD_LEN + TAIL_LEN {
            return Err(damaged("it is cut short"));
        }
        if &bytes[..8] != MAGIC {
            return Err(damaged("it is no checkpoint of this program"));
        }
        let found = u32::from_le_bytes(bytes[8..12].try_into().expect("four bytes"));
        if found != FORMAT {
            let path = path.to_owned();
            return Err(LearnError::Version {
                path,
                found,
                expected: FORMAT,
            });
        }
        let (body, sum) = bytes.split_at(bytes.len() - TAIL_LEN);
        if Checksum::of(body).to_le_bytes() != sum {
            return Err(damaged("its checksum does not match its content"));
        }
        let contents_len = u64::from_le_bytes(body[12..20].try_into().expect("eight bytes"));
        let contents_end = usize::try_from(contents_len)
            .ok()
            .and_then(|n| n.checked_add(HEAD_LEN));
        let contents = contents_end.and_then(|end| body.get(HEAD_LEN..end));
        let contents = contents.ok_or_else(|| damaged("its table of contents is cut short"))?;
        let mut data = &body[HEAD_LEN + contents.len()..];
        let contents: BTreeMap<String, Entry> =
            serde_json::from_slice(contents).map_err(|e| damaged(&e.to_string()))?;
        let mut sections = BTreeMap::new();
        for (name, entry) in contents {
            let n_bytes = match &entry {
                Entry::F32 { n_bytes, .. } | Entry::F64 { n_bytes } | Entry::Json { n_bytes } => {
                    *n_bytes
                }
            };
            let Some((own, rest)) = data.split_at_checked(n_bytes) else {
                return Err(damaged("a section is cut short"));
            };
            data = rest;
            sections.insert(name, Section::parse(entry, own).map_err(|e| damaged(&e))?);
        }
        Ok(Self { sections })
    }
}

impl Section {
    fn append_to(&self, data: &mut Vec<u8>) {
        match self {
            Self::F32 { values, .. } => data.extend(values.iter().flat_map(|v| v.to_le_bytes())),
            Self::F64(values) => data.extend(values.iter().flat_map(|v| v.to_le_bytes())),
            Self::Json(json) => data.extend(json.as_bytes()),
        }
    }

    fn entry(&self, n_bytes: usize) -> Entry {
        match self {
            Self::F32 { shape, .. } => Entry::F32 {
                shape: shape.clone(),
                n_bytes,
            },
            Self::F64(_) => Entry::F64 { n_bytes },
            Self::Json(_) => Entry::Json { n_bytes },
        }
    }

    fn parse(entry: Entry, bytes: &[u8]) -> Result<Self, String> {
        Ok(match entry {
            Entry::F32 { shape, .. } => Self::F32 {
                shape,
                values: numbers(bytes, f32::from_le_bytes),
            },
            Entry::F64 { .. } => Self::F64(numbers(bytes, f64::from_le_bytes)),
            Entry::Json { .. } => {
                Self::Json(String::from_utf8(bytes.to_vec()).map_err(|e| e.to_string())?)
            }
        })
    }
}

/// Little-endian numbers of `N` bytes each.
pub(crate) fn numbers<T, const N: usize>(bytes: &[u8], number: fn([u8; N]) -> T) -> Vec<T> {
    let parse = |chunk: &[u8]| number(chunk.try_into().expect("chunks of a number's size"));
    bytes.chunks_exact(N).map(parse).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Archive {
        let mut archive = Archive::new();
        archive.put_f32("weights", vec![1.5, -0.0, f32::MIN_POSITIVE, 3.0], &[2, 2]);
        archive.put_f64("moments", &[0.1 + 0.2, f64::NAN]);
        archive.put_json("step", &(7_u64, "seven", 0.1_f64 + 0.2));
        archive
    }

    fn folder(name: &str) -> std::path::PathBuf {
        let folder =
            std::env::temp_dir().join(format!("stair-learn-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the test");
        folder
    }

    #[test]
    fn what_is_read_is_what_was_written_bit_for_bit() {
        let folder = folder("archive");
        let path = folder.join("a.ckpt");
        let archive = example();
        archive.write(&path).expect("written");
        let read = Archive::read(&path).expect("read");
        assert_eq!(read.fingerprint(), archive.fingerprint());
        let weights = read.f32("weights", &[2, 2]).expect("there");
        assert_eq!(weights[2].to_bits(), f32::MIN_POSITIVE.to_bits());
        assert_eq!(
            read.f64::<2>("moments").expect("there")[0].to_bits(),
            (0.1_f64 + 0.2).to_bits()
        );
        let step: (u64, String, f64) = read.json("step").expect("there");
        assert_eq!(step, (7, "seven".into(), 0.1 + 0.2));
        std::fs::remove_dir_all(folder).expect("removed");
    }

    #[test]
    fn any_damage_is_noticed_and_named() {
        let bytes = example().to_bytes();
        let path = Path::new("run/step-5.ckpt");
        for place in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[place] ^= 4;
            let error = Archive::parse(&damaged, path).expect_err("damage goes unnoticed");
            assert!(error.to_string().contains("step-5.ckpt"), "{error}");
        }
        for len in 0..bytes.len() {
            assert!(Archive::parse(&bytes[..len], path).is_err());
        }
    }

    #[test]
    fn a_section_of_another_network_says_so() {
        let error = example()
            .f32("weights", &[4, 4])
            .expect_err("another shape");
        assert!(error.to_string().contains("[4, 4]"), "{error}");
        assert!(example().json::<u32>("nothing").is_err());
    }
}
