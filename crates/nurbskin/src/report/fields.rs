//! What people say about a report: its title, and notes such as part, operator and drawing revision.

use nurbskin_geometry::{Error, Result};
use serde::Serialize;

/// Longest note, name and text together, in characters. Guard: the heading of a page stays a heading.
const LONGEST: usize = 500;

/// A field of a report: a name and a text.
///
/// ```
/// use nurbskin::report::Note;
/// let note: Note = "operator=A. Lovelace".parse()?;
/// assert_eq!((note.key.as_str(), note.text.as_str()), ("operator", "A. Lovelace"));
/// assert!("operator".parse::<Note>().is_err());
/// # Ok::<(), nurbskin::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// Its name, such as `part`, `operator`, `drawing`, `revision` or `alignment`.
    pub key: String,
    /// Its text.
    pub text: String,
}

impl std::str::FromStr for Note {
    type Err = Error;

    /// `KEY=VALUE`; the value may contain further equals signs.
    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::invalid("write KEY=VALUE, as in operator=\"A. Lovelace\"");
        let (key, value) = text.split_once('=').ok_or_else(wrong)?;
        let (key, value) = (key.trim(), value.trim());
        if key.is_empty() || value.is_empty() {
            return Err(wrong());
        }
        if text.chars().count() > LONGEST {
            return Err(Error::invalid(format!(
                "a note has at most {LONGEST} characters"
            )));
        }
        Ok(Self {
            key: key.to_owned(),
            text: value.to_owned(),
        })
    }
}

/// The heading of a report, as people give it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Heading {
    /// The title; the name of the scan if absent.
    pub title: Option<String>,
    /// Fields in their order. One that is given twice has its last text.
    pub notes: Vec<Note>,
}

impl Heading {
    /// The notes, each key once, in the order of their first mention; keys are compared without regard to case.
    pub(super) fn distinct(&self) -> Vec<Note> {
        let mut found: Vec<Note> = Vec::new();
        for note in &self.notes {
            let same = |known: &&mut Note| known.key.to_lowercase() == note.key.to_lowercase();
            match found.iter_mut().find(same) {
                Some(known) => known.text.clone_from(&note.text),
                None => found.push(note.clone()),
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(text: &str) -> Note {
        text.parse().unwrap()
    }

    #[test]
    fn notes_are_a_key_and_a_text() {
        assert_eq!(note(" part = a=b ").text, "a=b");
        for wrong in ["", "=", "part", "part=", "=x", " = "] {
            let said = wrong.parse::<Note>().unwrap_err().to_string();
            assert!(said.contains("KEY=VALUE"), "{wrong}: {said}");
        }
        let long = format!("part={}", "x".repeat(LONGEST));
        assert!(long.parse::<Note>().is_err());
    }

    #[test]
    fn the_last_of_a_key_counts() {
        let notes = ["part=a", "operator=b", "Part=c"].map(note).to_vec();
        let heading = Heading { title: None, notes };
        let found = heading.distinct();
        let pairs: Vec<[&str; 2]> = found.iter().map(|n| [n.key.as_str(), &n.text]).collect();
        assert_eq!(pairs, [["part", "c"], ["operator", "b"]]);
    }
}
