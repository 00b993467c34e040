//! Values as they are typed, and the command as it was.

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
