//! Sentences of the library that name options of the command, with the arguments of Python instead.

use nurbskin::deviation::verdict::Reason;
use nurbskin::pipeline::{Compared, Outcome};

/// Options that sentences name together with a value.
const VALUED: [&str; 8] = [
    "unit", "trim", "method", "layout", "topology", "grid", "rarefy", "sharp",
];

/// The sentence with `--max-control-points` as `max_control_points`, `--unit m` as `unit="m"`, `--sharp DEGREES` as
/// `sharp=DEGREES`, `-t` as `tolerance`, and `--report part.html` as the call that writes it.
pub(crate) fn in_python(sentence: &str) -> String {
    let sentence = sentence.replace("--report part.html", "result.report(\"part.html\")");
    let mut out = String::with_capacity(sentence.len());
    let mut rest = sentence.as_str();
    while let Some(at) = rest.find('-') {
        let (before, from) = rest.split_at(at);
        out.push_str(before);
        rest = from;
        let begins_word = out
            .chars()
            .next_back()
            .is_none_or(|c| c.is_whitespace() || "(`".contains(c));
        if begins_word && let Some((said, length)) = argument(rest) {
            out.push_str(&said);
            rest = rest.get(length..).unwrap_or_default();
        } else {
            out.push('-');
            rest = rest.get(1..).unwrap_or_default();
        }
    }
    out.push_str(rest);
    out
}

/// The argument that stands for the option at the beginning of the text, and the length of what it stands for.
fn argument(text: &str) -> Option<(String, usize)> {
    if let Some(after) = text.strip_prefix("-t") {
        let ends = !after.starts_with(|c: char| c.is_alphanumeric());
        return ends.then(|| ("tolerance".to_owned(), 2));
    }
    let name = text.strip_prefix("--")?;
    let length = name
        .find(|c: char| !(c.is_ascii_lowercase() || c == '-'))
        .unwrap_or(name.len());
    let name = name.get(..length).filter(|name| !name.is_empty())?;
    let python = name.replace('-', "_");
    let length = length + 2;
    let after = text.get(length..)?.strip_prefix(' ').unwrap_or_default();
    let end = after
        .find(|c: char| c.is_whitespace() || ",;:)`".contains(c))
        .unwrap_or(after.len());
    let value = after.get(..end).unwrap_or_default();
    if value.is_empty() {
        return Some((python, length));
    }
    let length_with_value = length + 1 + value.len();
    if let (true, Some(number)) = (python == "min_coverage", value.strip_suffix('%'))
        && let Ok(share) = number.parse::<f64>()
    {
        return Some((format!("{python}={}", share / 100.0), length_with_value));
    }
    if let (true, Some((m, n))) = (python == "grid", value.split_once('x')) {
        return Some((format!("{python}=({m}, {n})"), length_with_value));
    }
    // What goes on as a sentence is no value.
    let is_value = VALUED.contains(&&*python) && !matches!(value, "is" | "if" | "and" | "applies");
    // A number needs no quotes, nor does the word that stands for one.
    let is_number = value.parse::<f64>().is_ok() || value == "DEGREES";
    Some(match (is_value, is_number) {
        (true, true) => (format!("{python}={value}"), length_with_value),
        (true, false) => (format!("{python}=\"{value}\""), length_with_value),
        (false, _) => (python, length),
    })
}

fn reasons(reasons: &mut [Reason]) {
    for reason in reasons {
        reason.what = in_python(&reason.what);
        reason.next = reason.next.as_deref().map(in_python);
    }
}

/// All sentences of a comparison in the words of Python.
pub(crate) fn translate_comparison(compared: &mut Compared) {
    compared.reason = in_python(&compared.reason);
    reasons(&mut compared.reasons);
    for sentence in compared.warnings.iter_mut().chain(&mut compared.details) {
        *sentence = in_python(sentence);
    }
}

/// All sentences of a result in the words of Python.
pub(crate) fn translate(outcome: &mut Outcome) {
    outcome.reason = in_python(&outcome.reason);
    reasons(&mut outcome.reasons);
    for part in &mut outcome.parts {
        part.reason = in_python(&part.reason);
        reasons(&mut part.reasons);
    }
    for sentence in outcome.warnings.iter_mut().chain(&mut outcome.details) {
        *sentence = in_python(sentence);
    }
}
