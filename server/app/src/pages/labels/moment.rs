//! Times as people and forms write them, UTC.

use store::rfc3339;

/// Milliseconds since 1970 of `2026-05-02`, `2026-05-02T14:02`, `2026-05-02T14:02:11` or
/// `2026-05-02T14:02:11.250`, with or without `Z` at the end and also with a gap for the `T`;
/// `None` for anything else, days that no calendar has among it.
pub(super) fn parse(text: &str) -> Option<i64> {
    let text = text.strip_suffix(['Z', 'z']).unwrap_or(text);
    let (date, clock) = match text.split_once(['T', 't', ' ']) {
        Some((date, clock)) => (date, Some(clock)),
        None => (text, None),
    };
    let of_day = clock.map_or(Some(0), since_midnight)?;
    Some(day(date)? + of_day)
}

/// As a field of the kind `datetime-local` holds it, no longer than it has to be.
pub(super) fn field(ms: i64) -> String {
    let told = rfc3339(ms);
    let len = match (ms % 60_000, ms % 1_000) {
        (0, _) => "2026-05-02T14:02".len(),
        (_, 0) => "2026-05-02T14:02:11".len(),
        _ => "2026-05-02T14:02:11.250".len(),
    };
    told.get(..len).unwrap_or_default().to_owned()
}

/// The first millisecond of a day.
///
/// A date to days after Howard Hinnant's `days_from_civil`.
fn day(date: &str) -> Option<i64> {
    let [year, month, day] = numbers(date, '-', [4, 2, 2])?;
    let shifted_year = if month > 2 { year } else { year - 1 };
    let era = shifted_year.div_euclid(400);
    let year_of_era = shifted_year.rem_euclid(400);
    let shifted_month = if month > 2 { month - 3 } else { month + 9 };
    let day_of_year = (153 * shifted_month + 2) / 5 + day - 1;
    let day_of_era = 365 * year_of_era + year_of_era / 4 - year_of_era / 100 + day_of_year;
    let ms = (146_097 * era + day_of_era - 719_468) * 86_400_000;
    let is_in_the_calendar = rfc3339(ms).strip_suffix("T00:00:00.000Z") == Some(date);
    is_in_the_calendar.then_some(ms)
}

/// Milliseconds of `14:02`, `14:02:11` or `14:02:11.250`.
fn since_midnight(clock: &str) -> Option<i64> {
    let (clock, milli) = match clock.split_once('.') {
        Some((clock, fraction)) => (clock, thousandths(fraction)?),
        None => (clock, 0),
    };
    let without_seconds = || {
        let [hour, minute] = numbers(clock, ':', [2, 2])?;
        Some([hour, minute, 0])
    };
    let [hour, minute, second] = numbers(clock, ':', [2, 2, 2]).or_else(without_seconds)?;
    let is_on_the_clock = hour < 24 && minute < 60 && second < 60;
    is_on_the_clock.then_some(((hour * 60 + minute) * 60 + second) * 1_000 + milli)
}

/// Of a second; digits behind the third are left off.
fn thousandths(fraction: &str) -> Option<i64> {
    let is_number = !fraction.is_empty() && fraction.bytes().all(|byte| byte.is_ascii_digit());
    let padded = format!("{fraction:0<3}");
    padded.get(..3)?.parse().ok().filter(|_| is_number)
}

/// Numbers of so many digits each with a sign between them, and nothing else.
fn numbers<const N: usize>(text: &str, sign: char, digits: [usize; N]) -> Option<[i64; N]> {
    let mut parts = text.split(sign);
    let mut numbers = [0; N];
    for (number, n_digits) in numbers.iter_mut().zip(digits) {
        let part = parts.next()?;
        let is_number = part.len() == n_digits && part.bytes().all(|byte| byte.is_ascii_digit());
        *number = part.parse().ok().filter(|_| is_number)?;
    }
    parts.next().is_none().then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_read_however_much_of_it_is_written() {
        for (text, told) in [
            ("1970-01-01", "1970-01-01T00:00:00.000Z"),
            ("2024-02-29T23:59", "2024-02-29T23:59:00.000Z"),
            ("2026-05-02 14:02:11", "2026-05-02T14:02:11.000Z"),
            ("2026-05-02T14:02:11.25Z", "2026-05-02T14:02:11.250Z"),
            ("2000-03-01T00:00:00.0009", "2000-03-01T00:00:00.000Z"),
        ] {
            assert_eq!(parse(text).map(rfc3339).as_deref(), Some(told), "{text}");
        }
    }

    #[test]
    fn what_is_no_time_is_refused() {
        for text in [
            "yesterday",
            "2026-02-29",
            "2026-13-01",
            "2026-00-10",
            "2026-5-2",
            "2026-05-02T",
            "2026-05-02T24:00",
            "2026-05-02T14",
            "2026-05-02T14:02:11.",
            "2026-05-02T14:02+02:00",
            "+026-05-02",
            "2026-05-02-01",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_field_holds_what_was_read() {
        for text in [
            "2026-05-02T14:02",
            "2026-05-02T14:02:11",
            "2026-05-02T14:02:11.250",
        ] {
            assert_eq!(parse(text).map(field).as_deref(), Some(text));
        }
    }
}
