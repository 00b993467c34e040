//! The directory section: two cards per entity.

use super::card::{Card, CardWriter, Cards};
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// A directory entry; what is not used here is not kept.
#[derive(Clone, Debug, Default)]
pub(super) struct DirectoryEntry {
    /// Sequence number of the first card: odd; other entities point to it.
    pub(super) sequence: usize,
    /// Line of the file.
    pub(super) line: usize,
    pub(super) entity: u32,
    pub(super) form: i64,
    /// First card of the parameter data, from 1.
    pub(super) parameter: usize,
    /// Cards of parameter data.
    pub(super) parameter_cards: usize,
    pub(super) level: i64,
    /// Directory entry of the transformation matrix, 0 for none.
    pub(super) transform: usize,
    /// Colour number, or minus the directory entry of a colour definition.
    pub(super) colour: i64,
    /// The eight digits of the status number.
    pub(super) status: String,
    pub(super) label: String,
    pub(super) subscript: i64,
}

impl DirectoryEntry {
    /// Physically dependent on another entity, which holds it (second pair of the status number).
    pub(super) fn is_subordinate(&self) -> bool {
        matches!(self.status.get(2..4), Some("01" | "03"))
    }
    /// Lives in the parameter plane of a surface (third pair of the status number).
    pub(super) fn is_parametric(&self) -> bool {
        self.status.get(4..6) == Some("05")
    }
    /// The error `what` about this entry.
    pub(super) fn refuse(&self, path: &Path, what: impl Into<String>) -> Error {
        Error::read(
            path,
            format!("line {} (D{})", self.line, self.sequence),
            what,
        )
    }

    /// Puts the two cards.
    pub(super) fn push(&self, section: &mut CardWriter) {
        let Self {
            entity,
            form,
            parameter,
            parameter_cards,
            level,
            transform,
            colour,
            status,
            label,
            subscript,
            ..
        } = self;
        section.token(&format!(
            "{entity:>8}{parameter:>8}{:>8}{:>8}{level:>8}{:>8}{transform:>8}{:>8}{status:>8}",
            0, 0, 0, 0
        ));
        section.end_card();
        section.token(&format!(
            "{entity:>8}{:>8}{colour:>8}{parameter_cards:>8}{form:>8}{:>8}{:>8}{label:>8}{subscript:>8}",
            0, "", ""
        ));
        section.end_card();
    }
}

/// All directory entries, in order; the one with sequence number d is at (d - 1) / 2.
pub(super) fn read(cards: &Cards<'_>, path: &Path) -> Result<Vec<DirectoryEntry>> {
    if let [.., last] = cards.directory[..]
        && cards.directory.len() % 2 == 1
    {
        return Err(Error::read(
            path,
            format!("line {}", last.line),
            "the directory section has an odd number of cards, and an entity takes two; the file is damaged",
        ));
    }
    cards
        .directory
        .chunks_exact(2)
        .enumerate()
        .map(|(k, pair)| entry(pair, 2 * k + 1, path))
        .collect()
}

fn entry(pair: &[Card<'_>], sequence: usize, path: &Path) -> Result<DirectoryEntry> {
    let number = |k: usize, field: usize| -> Result<i64> {
        let text = pair[k].text(8 * field, 8 * field + 8);
        if text.is_empty() {
            return Ok(0);
        }
        text.parse().map_err(|_| {
            Error::read(
                path,
                format!("line {} (D{})", pair[k].line, sequence + k),
                format!(
                    "`{}` in columns {} to {}, where an integer should be",
                    text.escape_debug(),
                    8 * field + 1,
                    8 * field + 8
                ),
            )
        })
    };
    let index = |k: usize, field: usize, what: &str| {
        usize::try_from(number(k, field)?).map_err(|_| {
            Error::read(
                path,
                format!("line {} (D{})", pair[k].line, sequence + k),
                format!("the {what} is negative"),
            )
        })
    };
    // Zero is the null entity: one that was taken out.
    let entity = u32::try_from(number(0, 0)?).ok();
    let Some(entity) = entity.filter(|_| !pair[0].text(0, 8).is_empty()) else {
        return Err(Error::read(
            path,
            format!("line {} (D{sequence})", pair[0].line),
            "the entity type in columns 1 to 8 should be a positive number",
        ));
    };
    Ok(DirectoryEntry {
        sequence,
        line: pair[0].line,
        entity,
        form: number(1, 4)?,
        parameter: index(0, 1, "pointer to the parameter data")?,
        parameter_cards: index(1, 3, "number of parameter cards")?,
        level: number(0, 4)?,
        transform: index(0, 6, "pointer to the transformation matrix")?,
        colour: number(1, 2)?,
        status: format!("{:0>8}", pair[0].text(64, 72)).replace(' ', "0"),
        label: pair[1].text(56, 64),
        subscript: number(1, 8).unwrap_or(0),
    })
}
