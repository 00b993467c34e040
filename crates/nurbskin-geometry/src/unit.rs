//! Units of length.

use crate::math;
use serde::{Deserialize, Serialize};

/// The unit of a scan's or a CAD file's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Millimetre.
    #[default]
    #[serde(rename = "mm")]
    Millimetre,
    /// Centimetre.
    #[serde(rename = "cm")]
    Centimetre,
    /// Metre.
    #[serde(rename = "m")]
    Metre,
    /// Micrometre.
    #[serde(rename = "um")]
    Micrometre,
    /// Inch, 25.4 mm.
    #[serde(rename = "in")]
    Inch,
    /// Foot, 304.8 mm.
    #[serde(rename = "ft")]
    Foot,
}

/// Where the unit was learnt from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UnitSource {
    /// The file says so.
    File,
    /// The caller said so.
    Option,
    /// Nobody said: millimetres are assumed.
    #[default]
    Assumed,
}

impl Unit {
    /// All units, in the order of the documentation.
    pub const ALL: [Unit; 6] = [
        Unit::Millimetre,
        Unit::Centimetre,
        Unit::Metre,
        Unit::Micrometre,
        Unit::Inch,
        Unit::Foot,
    ];

    /// Length of one unit in millimetres.
    #[must_use]
    pub fn millimetres(self) -> f64 {
        match self {
            Unit::Millimetre => 1.0,
            Unit::Centimetre => 10.0,
            Unit::Metre => 1000.0,
            Unit::Micrometre => 1e-3,
            Unit::Inch => 25.4,
            Unit::Foot => 304.8,
        }
    }

    /// The unit's symbol: `mm`, `cm`, `m`, `um`, `in`, `ft`.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Unit::Millimetre => "mm",
            Unit::Centimetre => "cm",
            Unit::Metre => "m",
            Unit::Micrometre => "um",
            Unit::Inch => "in",
            Unit::Foot => "ft",
        }
    }

    /// The unit with this symbol, upper or lower case.
    #[must_use]
    pub fn from_symbol(symbol: &str) -> Option<Unit> {
        Unit::ALL
            .into_iter()
            .find(|unit| unit.symbol().eq_ignore_ascii_case(symbol))
    }
}

impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.symbol())
    }
}

/// A number with three significant digits, whole from a thousand on: `0.107`, `12.6`, `1250`.
///
/// ```
/// use nurbskin_geometry::unit::three_digits;
/// assert_eq!([0.10749, 12.649, 1250.4, -0.5, 0.0].map(three_digits), ["0.107", "12.6", "1250", "-0.5", "0"]);
/// ```
#[must_use]
pub fn three_digits(x: f64) -> String {
    significant(x, 3)
}

/// A count with a blank between thousands from five digits on, and what is counted, in the singular for one.
///
/// ```
/// use nurbskin_geometry::unit::counted;
/// assert_eq!(counted(1, "face", "faces"), "1 face");
/// assert_eq!(counted(60_000, "point", "points"), "60 000 points");
/// ```
#[must_use]
pub fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{} {}", grouped(n), if n == 1 { one } else { many })
}

/// A count with a blank between thousands from five digits on: `1234`, `60 000`.
#[must_use]
pub fn grouped(n: usize) -> String {
    let digits = n.to_string();
    if digits.len() < 5 {
        return digits;
    }
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// A share (0..=1) in per cent: three digits; near 100 % as many as keep it apart from that, and never rounded up to it.
///
/// ```
/// use nurbskin_geometry::unit::percent;
/// assert_eq!([0.010_717, 0.5, 0.9, 0.995, 0.999_99, 1.0].map(percent), ["1.07 %", "50 %", "90 %", "99.5 %", "99.999 %", "100 %"]);
/// ```
#[must_use]
pub fn percent(share: f64) -> String {
    let value = 100.0 * share;
    // Rounded down at the second digit of what is missing to 100.
    let missing = 100.0 - value;
    if !(90.0..100.0).contains(&value) || missing < 1e-10 {
        return format!("{} %", three_digits(value));
    }
    let step = math::powf(10_f64, math::log10(missing).floor() - 1.0).min(0.1);
    let down = 100.0 - (missing / step - 1e-6).ceil() * step;
    format!("{} %", significant(down, 12))
}

/// A number with this many significant digits at most, without zeros at its end; powers of ten only below 1e-6 and from
/// 1e12 on.
fn significant(x: f64, digits: i32) -> String {
    if x == 0.0 || !x.is_finite() {
        return if x == 0.0 { "0".into() } else { x.to_string() };
    }
    // Rounding may carry: 9.996 has one digit more than it seems.
    #[expect(clippy::cast_possible_truncation, reason = "the exponent of an f64")]
    let exponent = {
        let first = math::log10(x.abs()).floor() as i32;
        let unit = 10_f64.powi(first - digits + 1);
        let rounded = (x.abs() / unit).round() * unit;
        math::log10(rounded).floor().max(f64::from(first)) as i32
    };
    if !(-6..12).contains(&exponent) {
        let places = usize::try_from(digits - 1).unwrap_or(0);
        return format!("{x:.places$e}");
    }
    let Ok(places @ 1..) = usize::try_from(digits - 1 - exponent) else {
        return format!("{x:.0}");
    };
    let text = format!("{x:.places$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl Unit {
    /// A length in this unit as a person writes it: three significant digits and the unit of a fitting size.
    ///
    /// Metric lengths are in nm, um, mm, m or km, whichever keeps the number from 0.1 up to 1000 (mm down to 0.1, um
    /// below); inches below a hundredth are in thou, feet below one in inches.
    ///
    /// ```
    /// use nurbskin_geometry::Unit;
    /// assert_eq!(Unit::Millimetre.length(0.01263), "12.6 um");
    /// assert_eq!(Unit::Metre.length(1.07e-4), "0.107 mm");
    /// assert_eq!(Unit::Millimetre.length(1250.0), "1.25 m");
    /// assert_eq!(Unit::Inch.length(0.0005), "0.5 thou");
    /// ```
    #[must_use]
    pub fn length(self, x: f64) -> String {
        let (scale, symbol) = self.scale_for(x.abs());
        format!("{} {symbol}", three_digits(x * scale))
    }

    /// A length as [`length`](Self::length), with its sign.
    ///
    /// ```
    /// use nurbskin_geometry::Unit;
    /// assert_eq!(Unit::Millimetre.signed_length(6.182), "+6.18 mm");
    /// assert_eq!(Unit::Millimetre.signed_length(-0.02), "-20 um");
    /// ```
    #[must_use]
    pub fn signed_length(self, x: f64) -> String {
        let sign = if x > 0.0 { "+" } else { "" };
        format!("{sign}{}", self.length(x))
    }

    /// The extents of a part along x, y and z, in one unit: `196 x 79 x 38.1 mm`.
    ///
    /// ```
    /// use nurbskin_geometry::Unit;
    /// assert_eq!(Unit::Metre.size([0.1958, 0.0791, 0.0381]), "196 x 79.1 x 38.1 mm");
    /// ```
    #[must_use]
    pub fn size(self, extents: [f64; 3]) -> String {
        let largest = extents.into_iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let (scale, symbol) = self.scale_for(largest);
        let [x, y, z] = extents.map(|x| three_digits(x * scale));
        format!("{x} x {y} x {z} {symbol}")
    }

    /// A place in the numbers of the file, to six significant digits of its largest coordinate: `(35.7, 36.8124, 23.2)`.
    ///
    /// ```
    /// use nurbskin_geometry::Unit;
    /// assert_eq!(Unit::Millimetre.place([16123.4567, -1008.1, 1e-9]), "(16123.5, -1008.1, 0) mm");
    /// ```
    #[must_use]
    pub fn place(self, [x, y, z]: [f64; 3]) -> String {
        let largest = x.abs().max(y.abs()).max(z.abs());
        let step = if largest > 0.0 && largest.is_finite() {
            math::powf(10_f64, math::log10(largest).floor() - 5.0)
        } else {
            1.0
        };
        let [x, y, z] = [x, y, z].map(|c| significant((c / step).round() * step, 6));
        format!("({x}, {y}, {z}) {self}")
    }

    /// The units in which lengths are shown, each from the smallest length on for which it is used; ascending.
    ///
    /// The first is of zero. [`length`](Self::length) takes the last that is not above the length.
    ///
    /// ```
    /// use nurbskin_geometry::Unit;
    /// let symbols: Vec<_> = Unit::Metre.shown_in().iter().map(|shown| shown.symbol).collect();
    /// assert_eq!(symbols, ["mm", "nm", "um", "mm", "m", "km"]);
    /// ```
    #[must_use]
    pub fn shown_in(self) -> Vec<ShownUnit> {
        // In inches for both feet and inches, in millimetres for all others.
        let steps: &[(f64, f64, &'static str)] = match self {
            Unit::Foot => &[
                (0.0, 1.0 / 12.0, "ft"),
                (f64::MIN_POSITIVE, 1e3, "thou"),
                (0.01, 1.0, "in"),
                (12.0, 1.0 / 12.0, "ft"),
            ],
            Unit::Inch => &[
                (0.0, 1.0, "in"),
                (f64::MIN_POSITIVE, 1e3, "thou"),
                (0.01, 1.0, "in"),
            ],
            _ => &[
                (0.0, 1.0, "mm"),
                (f64::MIN_POSITIVE, 1e6, "nm"),
                (1e-4, 1e3, "um"),
                (0.1, 1.0, "mm"),
                (1e3, 1e-3, "m"),
                (1e6, 1e-6, "km"),
            ],
        };
        let own = match self {
            Unit::Foot => 12.0,
            Unit::Inch => 1.0,
            _ => self.millimetres(),
        };
        let shown = |&(from, factor, symbol): &(f64, f64, &'static str)| ShownUnit {
            from: from / own,
            factor: factor * own,
            symbol,
        };
        steps.iter().map(shown).collect()
    }

    /// The factor and the symbol with which a length of this size in this unit is shown.
    fn scale_for(self, x: f64) -> (f64, &'static str) {
        // What rounds up to the next unit is shown in it.
        let reached = x * (1.0 + 5e-4);
        let all = self.shown_in();
        let fitting = all
            .iter()
            .rfind(|shown| shown.from <= reached && x.is_finite());
        fitting
            .or(all.first())
            .map_or((1.0, self.symbol()), |shown| (shown.factor, shown.symbol))
    }
}

/// A unit in which lengths are shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ShownUnit {
    /// The smallest length that is shown in it, in the unit of the file.
    pub from: f64,
    /// How many of it are one unit of the file.
    pub factor: f64,
    /// Its symbol.
    pub symbol: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_three_digits_and_a_fitting_unit() {
        let mm = Unit::Millimetre;
        let shown = [0.0, 99.96e-3, 0.09, 999.6, 999.4, 1e6, 8e-5, 1.5e-9].map(|x| mm.length(x));
        let wanted = [
            "0 mm",
            "0.1 mm",
            "90 um",
            "1 m",
            "999 mm",
            "1 km",
            "80 nm",
            "0.0015 nm",
        ];
        assert_eq!(shown, wanted);
        assert_eq!(Unit::Micrometre.length(3.2), "3.2 um");
        assert_eq!(Unit::Centimetre.length(3.2), "32 mm");
        assert_eq!(Unit::Foot.length(0.5), "6 in");
        assert_eq!(Unit::Foot.length(2.5), "2.5 ft");
        assert_eq!(Unit::Inch.length(1.25), "1.25 in");
        assert_eq!(mm.length(f64::NAN), "NaN mm");
        assert_eq!(mm.size([0.0; 3]), "0 x 0 x 0 mm");
        assert_eq!(mm.place([0.0; 3]), "(0, 0, 0) mm");
    }

    #[test]
    fn digits_carry() {
        let shown = [9.996, 0.099_96, 999.96, 1234.56, 1e-7, 1e15].map(three_digits);
        assert_eq!(shown, ["10", "0.1", "1000", "1235", "1.00e-7", "1.00e15"]);
    }
}
