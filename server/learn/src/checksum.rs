//! A 64-bit sum over bytes that shows damage; not meant against malice.

/// A sum that can be taken over a stream in pieces; the pieces' borders do not matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Checksum {
    state: u64,
    tail: u64,
    n_bytes: u64,
}

impl Default for Checksum {
    fn default() -> Self {
        Self::new()
    }
}

impl Checksum {
    /// Of no bytes yet.
    pub fn new() -> Self {
        Self {
            state: 0x9E37_79B9_7F4A_7C15,
            tail: 0,
            n_bytes: 0,
        }
    }

    /// Of all bytes at once.
    pub fn of(bytes: &[u8]) -> u64 {
        let mut sum = Self::new();
        sum.update(bytes);
        sum.value()
    }

    /// Takes the next piece in.
    pub fn update(&mut self, mut bytes: &[u8]) {
        while !self.n_bytes.is_multiple_of(8) && !bytes.is_empty() {
            self.push(bytes[0]);
            bytes = &bytes[1..];
        }
        let (words, rest) = bytes.as_chunks();
        for word in words {
            self.absorb(u64::from_le_bytes(*word));
            self.n_bytes += 8;
        }
        for &byte in rest {
            self.push(byte);
        }
    }

    /// The sum so far. Any change within one aligned word of eight bytes changes it.
    pub fn value(&self) -> u64 {
        let mut end = *self;
        end.absorb(self.tail);
        end.absorb(self.n_bytes);
        end.state ^ (end.state >> 32)
    }

    fn push(&mut self, byte: u8) {
        self.tail |= u64::from(byte) << (8 * (self.n_bytes % 8));
        self.n_bytes += 1;
        if self.n_bytes.is_multiple_of(8) {
            let word = std::mem::take(&mut self.tail);
            self.absorb(word);
        }
    }

    fn absorb(&mut self, word: u64) {
        self.state = (self.state ^ word)
            .wrapping_mul(0xD6E8_FEB8_6659_FD93)
            .rotate_left(29);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_sum_up_like_the_whole_and_one_bit_shows() {
        let bytes: Vec<u8> = (0..=100).collect();
        let mut pieces = Checksum::new();
        for piece in bytes.chunks(7) {
            pieces.update(piece);
        }
        assert_eq!(pieces.value(), Checksum::of(&bytes));
        let mut other = bytes.clone();
        other[50] ^= 1;
        assert_ne!(Checksum::of(&other), Checksum::of(&bytes));
        assert_ne!(Checksum::of(&bytes[..100]), Checksum::of(&bytes));
    }
}
