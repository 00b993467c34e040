//! Lines and numbers of text files in any encoding that extends ASCII.

/// The lines of a text with their numbers from 1, without white space around them. They end with LF, CR LF or, where
/// there is no LF at all, CR; a mark of the byte order at the start is no part of them.
pub(crate) fn lines(text: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let end = if text.contains(&b'\n') { b'\n' } else { b'\r' };
    text.split(move |&b| b == end)
        .enumerate()
        .map(|(k, line)| (k + 1, line.trim_ascii()))
}

/// A number, or `None` for anything else. NaN and infinities in the spellings of the usual programs are numbers.
#[inline]
pub(crate) fn number(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    text.parse().ok().or_else(|| odd_number(text))
}

/// Fortran's exponents, and the names that C libraries and tables give to what is no number.
#[cold]
fn odd_number(text: &str) -> Option<f64> {
    let lower = text.to_ascii_lowercase();
    let name = lower.trim_start_matches(['+', '-']);
    if matches!(
        name,
        "na" | "n/a" | "null" | "none" | "nil" | "nan(ind)" | "nan(snan)"
    ) || ["#qnan", "#snan", "#ind", "#inf"].iter().any(|code| {
        name.split_once('.')
            .is_some_and(|(one, rest)| one == "1" && rest.starts_with(code))
    }) {
        return Some(f64::NAN);
    }
    let (mantissa, exponent) = lower.split_once('d')?;
    let digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit() || b"+-.".contains(&b));
    if digits(mantissa) && digits(exponent) {
        format!("{mantissa}e{exponent}").parse().ok()
    } else {
        None
    }
}

/// A field as it may stand in a message: short and printable.
pub(crate) fn shown(field: &[u8]) -> String {
    let mut text: String = String::from_utf8_lossy(&field[..field.len().min(128)])
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(32)
        .collect();
    if field.len() > text.len() {
        text.push_str("...");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_line_ends_are_lines() {
        for text in ["a\n b \n\nc", "a\r\nb\r\n\r\nc", "\u{feff}a\rb\r\rc"] {
            let found: Vec<_> = lines(text.as_bytes()).collect();
            assert_eq!(
                found,
                [(1, b"a".as_slice()), (2, b"b"), (3, b""), (4, b"c")],
                "{text:?}"
            );
        }
    }

    #[test]
    fn numbers_in_all_spellings() {
        for (text, value) in [
            ("1.5", 1.5),
            ("+.5e1", 5.0),
            ("-2.D-1", -0.2),
            ("1.0d+02", 100.0),
            ("inf", f64::INFINITY),
        ] {
            assert_eq!(number(text.as_bytes()), Some(value), "{text}");
        }
        for text in [
            "nan",
            "-NaN",
            "1.#QNAN",
            "-1.#IND00",
            "NULL",
            "n/a",
            "-nan(ind)",
        ] {
            assert!(number(text.as_bytes()).unwrap().is_nan(), "{text}");
        }
        for text in [
            "", "d", "abcd", "1,5", "0x10", "1 2", "1.5mm", "--1", "1d", "#ind",
        ] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }
}
