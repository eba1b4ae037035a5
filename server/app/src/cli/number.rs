//! Whole numbers on the command line: what is none is told in plain words, not in Rust's.

use std::num::NonZeroUsize;
use std::str::FromStr;

/// A whole number from 0 on.
pub(super) fn whole<N: FromStr>(text: &str) -> Result<N, String> {
    let parsed = text.parse::<N>();
    parsed.map_err(|_| "it must be a whole number, 0 or more".to_owned())
}

/// A whole number from 1 on.
pub(super) fn at_least_one(text: &str) -> Result<NonZeroUsize, String> {
    let parsed = text.parse::<NonZeroUsize>();
    parsed.map_err(|_| "it must be a whole number, 1 or more".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_of_things_is_told_what_is() {
        assert_eq!(whole::<u64>("7"), Ok(7));
        assert!(whole::<u64>("-1").is_err_and(|told| told.ends_with("0 or more")));
        assert_eq!(at_least_one("2").map(NonZeroUsize::get), Ok(2));
        assert!(at_least_one("0").is_err_and(|told| told.ends_with("1 or more")));
    }
}
