//! Formatting of numbers for the page.
//!
//! Thousands are grouped, fractions have three significant digits, and figures other than lengths have their unit here.

/// Separator of thousands: a narrow no-break space.
const THIN: char = '\u{202f}';

/// `13 159`: numbers of five digits and more in groups of three.
pub(super) fn count(n: u64) -> String {
    grouped(&n.to_string())
}

fn grouped(digits: &str) -> String {
    if digits.len() < 5 {
        return digits.to_owned();
    }
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(THIN);
        }
        text.push(digit);
    }
    text
}

/// Three significant digits, with a typographic minus and without trailing zeros of a fraction.
fn number(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    if !x.is_finite() {
        return "\u{2013}".to_owned();
    }
    let sign = if x < 0.0 { "\u{2212}" } else { "" };
    let size = x.abs();
    let scientific = format!("{size:.2e}");
    let exponent = scientific.split_once('e').and_then(|(_, e)| e.parse().ok());
    let exponent: i32 = exponent.unwrap_or(0);
    if !(-5..9).contains(&exponent) {
        return format!("{sign}{}", scientific.replace("e-", "e\u{2212}"));
    }
    let decimals = usize::try_from(2 - exponent).unwrap_or(0);
    let plain = format!("{size:.decimals$}");
    let (whole, fraction) = plain.split_once('.').unwrap_or((&plain, ""));
    let fraction = fraction.trim_end_matches('0');
    let point = if fraction.is_empty() { "" } else { "." };
    format!("{sign}{}{point}{fraction}", grouped(whole))
}

/// An area, an angle or another figure than a length, with its unit.
pub(super) fn with_unit(x: f64, unit: &str) -> String {
    let separator = if matches!(unit, "" | "°") {
        ""
    } else {
        "\u{a0}"
    };
    format!("{}{separator}{unit}", number(x))
}

/// Seconds.
pub(super) fn seconds(t: f64) -> String {
    if t < 0.001 {
        "< 1\u{a0}ms".to_owned()
    } else if t < 1.0 {
        format!("{:.0}\u{a0}ms", 1000.0 * t)
    } else {
        format!("{t:.2}\u{a0}s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(
            [0, 9999, 13_159, 1_234_567].map(count),
            ["0", "9999", "13\u{202f}159", "1\u{202f}234\u{202f}567"]
        );
        let numbers = [
            0.0,
            0.1,
            -0.031_234_9,
            12.345_678,
            123_456.7,
            99_999.6,
            1.5e-9,
            2e12,
            f64::NAN,
        ];
        assert_eq!(
            numbers.map(number),
            [
                "0",
                "0.1",
                "\u{2212}0.0312",
                "12.3",
                "123\u{202f}457",
                "100\u{202f}000",
                "1.50e\u{2212}9",
                "2.00e12",
                "\u{2013}"
            ]
        );
        assert_eq!(with_unit(0.25, "mm²"), "0.25\u{a0}mm²");
        assert_eq!(with_unit(90.0, "°"), "90°");
    }
}
