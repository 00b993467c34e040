//! Units of length.

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
