//! Random names and secrets from the system's generator.

use sha2::{Digest, Sha256};

use crate::error::StoreError;

/// A secret that is shown once; only its hash is stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// 256 random bits as hexadecimal digits.
    ///
    /// # Errors
    /// When the system gives no random numbers.
    pub fn random() -> Result<Self, StoreError> {
        Ok(Self(hex(&random::<32>()?)))
    }

    /// Twelve random letters and digits (59 bits) that are read and typed without mistakes: a
    /// code for people.
    ///
    /// # Errors
    /// When the system gives no random numbers.
    pub fn for_people() -> Result<Self, StoreError> {
        // No i, l, o, 0, 1; 31 characters, and ~ for the rest, which is drawn again.
        const LETTERS: &[u8; 32] = b"abcdefghjkmnpqrstuvwxyz23456789~";
        let mut code = String::new();
        while code.len() < 12 {
            let letter = char::from(LETTERS[usize::from(random::<1>()?[0] & 31)]);
            code.extend(Some(letter).filter(|letter| *letter != '~'));
        }
        Ok(Self(code))
    }

    /// A code that a person typed, whatever its capitals and gaps.
    pub fn typed(text: &str) -> Self {
        let kept = text.chars().filter(char::is_ascii_alphanumeric);
        Self(kept.map(|letter| letter.to_ascii_lowercase()).collect())
    }

    /// A secret that somebody brought.
    pub fn brought(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    /// The secret itself, to be shown or sent.
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// What is stored of it.
    pub(crate) fn hash(&self) -> Vec<u8> {
        Sha256::digest(self.0.as_bytes()).to_vec()
    }
}

/// 128 random bits as hexadecimal digits: a name that tells nothing and cannot be guessed.
pub(crate) fn random_name() -> Result<String, StoreError> {
    Ok(hex(&random::<16>()?))
}

/// An unforeseeable truth.
pub(crate) fn coin() -> Result<bool, StoreError> {
    Ok(random::<1>()?[0] & 1 == 1)
}

fn random<const N: usize>() -> Result<[u8; N], StoreError> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|error| StoreError::Random(error.to_string()))?;
    Ok(bytes)
}

fn hex(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 0xf]);
    digits
        .map(|digit| char::from(DIGITS[usize::from(digit)]))
        .collect()
}
