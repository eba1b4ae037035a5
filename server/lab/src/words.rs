//! Numbers as people read them.

/// 12345 → `12,345`.
pub fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number with what it counts: `1 run`, `2 runs`.
pub fn counted(n: u64, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_numbers_are_told_by_thousands() {
        let words = [0, 999, 1_000, 123_456, 2_010_000].map(thousands).join(" ");
        assert_eq!(words, "0 999 1,000 123,456 2,010,000");
    }

    #[test]
    fn one_of_a_kind_is_told_as_one() {
        let words = [0, 1, 2].map(|n| counted(n, "query", "queries")).join(", ");
        assert_eq!(words, "0 queries, 1 query, 2 queries");
    }
}
