//! Values as they are typed, and the command as it was.

use nurbskin::Unit;
use nurbskin::pipeline::{Length, Rarefaction};

/// The command as it was typed, in the words of a POSIX shell.
pub(crate) fn command_line() -> String {
    let quoted = |word: std::ffi::OsString| {
        let word = word.to_string_lossy();
        let plain = |c: char| c.is_alphanumeric() || "-_./,=:+@%".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            word.into_owned()
        } else {
            format!("'{}'", word.replace('\'', "'\\''"))
        }
    };
    let words = std::env::args_os().skip(1).map(quoted);
    std::iter::once("nurbskin".to_owned())
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}

/// `0.05mm`, `2e-3in` or `0.05`.
pub(super) fn length(text: &str) -> Result<Length, String> {
    let text = text.trim();
    let unit = Unit::ALL
        .into_iter()
        .filter(|u| text.ends_with(u.symbol()))
        .max_by_key(|u| u.symbol().len());
    let number = unit.map_or(text, |u| &text[..text.len() - u.symbol().len()]);
    match number.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(Length { value, unit }),
        Ok(_) => Err("a length must be a positive number".into()),
        Err(_) => Err("write a length as 0.05 or 0.05mm (units: mm, cm, m, um, in, ft)".into()),
    }
}

/// `29x13`.
pub(super) fn counts(text: &str) -> Result<[usize; 2], String> {
    let parse = |s: &str| s.trim().parse::<usize>().ok().filter(|&n| n > 0);
    match text
        .split_once(['x', 'X'])
        .map(|(m, n)| (parse(m), parse(n)))
    {
        Some((Some(m), Some(n))) => Ok([m, n]),
        _ => Err("write MxN, as in 29x13".into()),
    }
}

/// `3` or `3,2`.
pub(super) fn degree(text: &str) -> Result<[usize; 2], String> {
    let parse = |s: &str| {
        let p = s
            .trim()
            .parse::<usize>()
            .ok()
            .filter(|p| (1..=nurbskin::nurbs::MAX_DEGREE).contains(p));
        p.ok_or(format!(
            "a degree is a whole number from 1 to {}",
            nurbskin::nurbs::MAX_DEGREE
        ))
    };
    match text.split_once(',') {
        Some((p, q)) => Ok([parse(p)?, parse(q)?]),
        None => parse(text).map(|p| [p, p]),
    }
}

/// `auto`, `off`, `20`, `12,18` or `18x18`.
pub(super) fn rarefaction(text: &str) -> Result<Rarefaction, String> {
    let angle = |s: &str| {
        s.trim()
            .parse::<f64>()
            .ok()
            .filter(|a| *a >= 0.0 && *a <= 180.0)
    };
    match text {
        "auto" => Ok(Rarefaction::Auto),
        "off" => Ok(Rarefaction::Off),
        _ if text.contains(['x', 'X']) => counts(text).map(Rarefaction::Counts),
        _ => {
            let (u, v) = text.split_once(',').unwrap_or((text, text));
            match (angle(u), angle(v)) {
                (Some(u), Some(v)) => Ok(Rarefaction::Threshold([u, v])),
                _ => Err(
                    "write degrees from 0 to 180 (as 20, or 12,18 for u and v), MxN, auto or off"
                        .into(),
                ),
            }
        }
    }
}

pub(super) fn fraction(text: &str) -> Result<f64, String> {
    text.parse::<f64>()
        .ok()
        .filter(|x| (0.0..=0.5).contains(x))
        .ok_or("a fraction is a number from 0 to 0.5".into())
}

pub(super) fn non_negative(text: &str) -> Result<f64, String> {
    text.parse::<f64>()
        .ok()
        .filter(|x| x.is_finite() && *x >= 0.0)
        .ok_or("a number, 0 or more, is needed".into())
}
