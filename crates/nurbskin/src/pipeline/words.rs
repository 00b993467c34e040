//! Values as they are typed, on a command line or in another language.

use super::{Length, Rarefaction};
use crate::{Error, Result, Unit};
use std::str::FromStr;

/// `0.05mm`, `2e-3in`, or `0.05` in the scan's unit.
///
/// ```
/// use nurbskin::{Unit, pipeline::Length};
/// let length: Length = "0.05mm".parse()?;
/// assert_eq!(length.in_unit(Unit::Micrometre), 50.0);
/// assert!("-1".parse::<Length>().is_err());
/// # Ok::<(), nurbskin::Error>(())
/// ```
impl FromStr for Length {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        let unit = Unit::ALL
            .into_iter()
            .filter(|u| text.ends_with(u.symbol()))
            .max_by_key(|u| u.symbol().len());
        let number = unit.map_or(text, |u| &text[..text.len() - u.symbol().len()]);
        match number.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value > 0.0 => Ok(Self { value, unit }),
            Ok(_) => Err(Error::invalid("a length must be a positive number")),
            Err(_) => Err(Error::invalid(
                "write a length as 0.05 or 0.05mm (units: mm, cm, m, um, in, ft)",
            )),
        }
    }
}

/// Two counts: `29x13`.
///
/// # Errors
/// [`Error::Invalid`] for anything else.
pub fn counts(text: &str) -> Result<[usize; 2]> {
    let parse = |s: &str| s.trim().parse::<usize>().ok().filter(|&n| n > 0);
    match text
        .split_once(['x', 'X'])
        .map(|(m, n)| (parse(m), parse(n)))
    {
        Some((Some(m), Some(n))) => Ok([m, n]),
        _ => Err(Error::invalid("write MxN, as in 29x13")),
    }
}

/// `auto`, `off`, degrees for u and v (`20`, or `12,18`), or `18x18` lines.
impl FromStr for Rarefaction {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let angle = |s: &str| {
            s.trim()
                .parse::<f64>()
                .ok()
                .filter(|a| *a >= 0.0 && *a <= 180.0)
        };
        match text {
            "auto" => Ok(Self::Auto),
            "off" => Ok(Self::Off),
            _ if text.contains(['x', 'X']) => counts(text).map(Self::Counts),
            _ => {
                let (u, v) = text.split_once(',').unwrap_or((text, text));
                match (angle(u), angle(v)) {
                    (Some(u), Some(v)) => Ok(Self::Threshold([u, v])),
                    _ => Err(Error::invalid(
                        "write degrees from 0 to 180 (as 20, or 12,18 for u and v), MxN, auto or off",
                    )),
                }
            }
        }
    }
}
