//! Reals and integers as IGES spells them.

use crate::io::text as cad_text;

/// Appends `x` with the fewest digits that read back to the same f64.
///
/// IGES wants a decimal point in every real, and `D` before the exponent of a double precision one (5.3, section
/// 2.2.2.2: `E` would promise single precision only).
pub(super) fn push_real(text: &mut String, x: f64) {
    cad_text::push_real(text, x, "D");
}

/// The real that `text` spells: Fortran style, with an optional decimal point and an optional exponent after `E` or
/// `D`. `None` for anything else, and for numbers beyond the range of f64.
pub(super) fn parse_real(text: &str) -> Option<f64> {
    let text = text.trim_matches(' ');
    let plain = text
        .bytes()
        .all(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E' | b'd' | b'D'));
    if !plain {
        return None;
    }
    let value = if text.contains(['d', 'D']) {
        text.replace(['d', 'D'], "e").parse::<f64>()
    } else {
        text.parse::<f64>()
    };
    value.ok().filter(|x| x.is_finite())
}

/// The integer that `text` spells; a real without a fraction passes too, as some writers put one.
pub(super) fn parse_integer(text: &str) -> Option<i64> {
    let text = text.trim_matches(' ');
    text.parse::<i64>().ok().or_else(|| {
        let (whole, fraction) = text.split_once('.')?;
        fraction
            .bytes()
            .all(|b| b == b'0')
            .then(|| whole.parse::<i64>().ok())?
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spelled(x: f64) -> String {
        let mut text = String::new();
        push_real(&mut text, x);
        text
    }

    #[test]
    fn spelling() {
        assert_eq!(spelled(0.0), "0.");
        assert_eq!(spelled(-0.0), "-0.");
        assert_eq!(spelled(1.0), "1.");
        assert_eq!(spelled(-2.5), "-2.5");
        assert_eq!(spelled(0.1), "0.1");
        assert_eq!(spelled(1e300), "1.D300");
        assert_eq!(spelled(-1.5e-300), "-1.5D-300");
        assert_eq!(spelled(5e-324), "5.D-324");
        assert_eq!(spelled(123_456_789.0), "123456789.");
    }

    #[test]
    fn parsing() {
        for (text, value) in [
            ("1", 1.0),
            (" 1. ", 1.0),
            ("+.5", 0.5),
            ("-1.5D+03", -1500.0),
            ("1.E-2", 0.01),
            ("2d0", 2.0),
            ("3e1", 30.0),
        ] {
            assert_eq!(parse_real(text), Some(value), "{text}");
        }
        for text in ["", "nan", "inf", "1 2", "1e999", "0x1", "1.2.3", "D", "--1"] {
            assert_eq!(parse_real(text), None, "{text}");
        }
        assert_eq!(parse_integer("12"), Some(12));
        assert_eq!(parse_integer("+3."), Some(3));
        assert_eq!(parse_integer("3.5"), None);
        assert_eq!(parse_integer("."), None);
    }

    proptest! {
        #[test]
        fn every_finite_number_returns(bits in any::<u64>()) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_finite());
            let text = spelled(x);
            prop_assert!(text.contains('.') && text.len() <= 26, "{}", text);
            prop_assert_eq!(parse_real(&text).map(f64::to_bits), Some(bits));
        }
    }
}
