//! The 80-column cards and the five sections they form.

use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Columns of data on a card of the parameter section; the directory pointer follows.
pub(super) const PARAMETER_WIDTH: usize = 64;
/// Columns of data on any other card.
pub(super) const WIDTH: usize = 72;
/// Sequence numbers have seven columns.
pub(super) const MOST_CARDS: usize = 9_999_999;

/// One card of a file that is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Card<'a> {
    /// Columns 1 to 72 at most, the blanks at the end as the file has them.
    data: &'a [u8],
    /// Line of the file, from 1.
    pub(super) line: usize,
}

impl Card<'_> {
    /// The byte in this column, from 0; a blank beyond the end.
    pub(super) fn byte(&self, column: usize) -> u8 {
        self.data.get(column).copied().unwrap_or(b' ')
    }
    /// The text in these columns, from 0, without blanks around it.
    pub(super) fn text(&self, from: usize, to: usize) -> String {
        (from..to)
            .map(|column| char::from(self.byte(column)))
            .collect::<String>()
            .trim()
            .to_owned()
    }
}

/// The cards of a file, by section.
#[derive(Debug, Default)]
pub(super) struct Cards<'a> {
    pub(super) global: Vec<Card<'a>>,
    pub(super) directory: Vec<Card<'a>>,
    pub(super) parameter: Vec<Card<'a>>,
}

/// Splits a file into its cards and checks that all are there: sections in order, sequence numbers without a gap, and
/// the counts of the terminate card.
///
/// # Errors
/// [`Error::Read`] naming the line.
pub(super) fn split<'a>(bytes: &'a [u8], path: &Path) -> Result<Cards<'a>> {
    let refuse = |line: usize, what: String| Err(Error::read(path, format!("line {line}"), what));
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(Error::read(path, "", "the file is empty"));
    }
    let mut cards = Cards::default();
    // Cards seen in S, G, D and P.
    let mut seen = [0usize; 4];
    let mut current = 0usize;
    let mut line = 0usize;
    for text in Lines::new(bytes) {
        line += 1;
        if text.iter().all(|&b| b == b' ' || b == 0x1a) {
            continue; // a blank line or the end-of-file mark of old systems
        }
        if seen == [0; 4] {
            first_card(text, bytes, path, line)?;
        }
        if text.contains(&b'\t') {
            return refuse(
                line,
                "the line has a tab character where IGES demands blanks, so its columns are lost; export the file again".into(),
            );
        }
        let Some(&letter) = text.get(WIDTH) else {
            return refuse(
                line,
                format!(
                    "{} columns where a card has 80: its section letter is missing; the file is cut short or was changed by an editor",
                    text.len()
                ),
            );
        };
        let Some(section) = b"SGDPT".iter().position(|&s| s == letter) else {
            return refuse(
                line,
                format!(
                    "column 73 has `{}`, but IGES demands S, G, D, P or T; the file is damaged or not IGES",
                    letter.escape_ascii()
                ),
            );
        };
        if section < current {
            return refuse(
                line,
                format!(
                    "a card of section {} follows section {}; the file is damaged",
                    char::from(letter),
                    char::from(b"SGDPT"[current])
                ),
            );
        }
        current = section;
        let card = Card {
            data: &text[..WIDTH],
            line,
        };
        let number = std::str::from_utf8(&text[WIDTH + 1..text.len().min(80)])
            .ok()
            .and_then(|text| text.trim().parse::<usize>().ok());
        if section == 4 {
            terminate(&card, seen, path)?;
            return Ok(cards);
        }
        seen[section] += 1;
        // A gap would shift every pointer behind it.
        if section >= 2 && number != Some(seen[section]) {
            return refuse(
                line,
                format!(
                    "the card should be {}{} by its place; a line is missing, doubled or damaged",
                    char::from(letter),
                    seen[section]
                ),
            );
        }
        match section {
            1 => cards.global.push(card),
            2 => cards.directory.push(card),
            3 => cards.parameter.push(card),
            _ => {}
        }
    }
    Err(Error::read(
        path,
        format!("line {line}"),
        "the file ends without its terminate card (T): it is cut short; transfer or export it again",
    ))
}

/// Is this the first card of an IGES file in its fixed ASCII form?
fn first_card(text: &[u8], bytes: &[u8], path: &Path, line: usize) -> Result<()> {
    let unsupported = |form: &str| {
        Err(Error::read(
            path,
            format!("line {line}"),
            format!(
                "this is IGES in its {form} form, which is not read; export it as fixed-length ASCII"
            ),
        ))
    };
    match text.get(WIDTH) {
        Some(b'C') => unsupported("compressed ASCII"),
        Some(b'B') => unsupported("binary"),
        Some(b'S' | b'G') => Ok(()),
        _ if bytes.iter().take(4096).any(|&b| b == 0) => Err(Error::read(
            path,
            format!("line {line}"),
            "this is neither IGES nor STEP as text: binary data; export it as STEP, or IGES in fixed-length ASCII",
        )),
        _ => Err(Error::read(
            path,
            format!("line {line}"),
            "this is not an IGES file: column 73 of the first line should hold the section letter S",
        )),
    }
}

/// The terminate card says how many cards each section has.
fn terminate(card: &Card<'_>, seen: [usize; 4], path: &Path) -> Result<()> {
    for (i, letter) in ['S', 'G', 'D', 'P'].into_iter().enumerate() {
        let field = card.text(8 * i, 8 * i + 8);
        let told = field
            .strip_prefix(letter)
            .and_then(|count| count.trim().parse::<usize>().ok());
        if told != Some(seen[i]) {
            return Err(Error::read(
                path,
                format!("line {}", card.line),
                format!(
                    "the terminate card says `{field}` where {letter}{} cards of that section are in the file; \
                     it is cut short or damaged: transfer or export it again",
                    seen[i]
                ),
            ));
        }
    }
    Ok(())
}

/// The lines of a file: ended by LF, CR LF or CR, or, without any of them, every 80 bytes.
struct Lines<'a> {
    rest: &'a [u8],
    fixed: bool,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            fixed: bytes.len() >= 160 && !bytes.iter().any(|&b| is_line_end(b)),
        }
    }
}

fn is_line_end(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];
    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let length = self.rest.len();
        let (end, ending) = if self.fixed {
            (length.min(80), 0)
        } else {
            match self.rest.iter().position(|&b| is_line_end(b)) {
                Some(end) if self.rest[end..].starts_with(b"\r\n") => (end, 2),
                Some(end) => (end, 1),
                None => (length, 0),
            }
        };
        let line = &self.rest[..end];
        self.rest = &self.rest[end + ending..];
        Some(line)
    }
}

/// Collects the cards of one section while a file is written.
#[derive(Debug)]
pub(super) struct CardWriter {
    section: char,
    end_of_line: &'static str,
    text: String,
    cards: usize,
    /// What follows the data on a parameter card: the sequence number of its directory entry.
    pointer: Option<usize>,
    open: String,
    /// Room for one token, kept between tokens.
    scratch: String,
}

impl CardWriter {
    pub(super) fn new(section: char, end_of_line: &'static str) -> Self {
        Self {
            section,
            end_of_line,
            text: String::new(),
            cards: 0,
            pointer: None,
            open: String::with_capacity(80),
            scratch: String::new(),
        }
    }
    /// Cards so far.
    pub(super) fn cards(&self) -> usize {
        self.cards
    }
    /// All cards.
    pub(super) fn text(&self) -> &str {
        &self.text
    }
    /// The following parameter data belong to the directory entry with this sequence number.
    pub(super) fn point_to(&mut self, directory: usize) {
        self.pointer = Some(directory);
    }
    /// Puts a token, its delimiter included, on the open card, or on a new one where it does not fit: numbers are
    /// never broken. Only a token longer than a card, which must be a string, runs on.
    pub(super) fn token(&mut self, token: &str) {
        let width = if self.pointer.is_some() {
            PARAMETER_WIDTH
        } else {
            WIDTH
        };
        if self.open.len() + token.len() > width && !self.open.is_empty() {
            self.end_card();
        }
        let mut rest = token;
        while rest.len() > width {
            let (head, tail) = rest.split_at(width);
            self.open.push_str(head);
            self.end_card();
            rest = tail;
        }
        self.open.push_str(rest);
    }
    /// Puts the token that `spell` appends to an empty text.
    pub(super) fn spelled(&mut self, spell: impl FnOnce(&mut String)) {
        let mut token = std::mem::take(&mut self.scratch);
        token.clear();
        spell(&mut token);
        self.token(&token);
        self.scratch = token;
    }
    /// Closes the open card, if there is one.
    pub(super) fn end_card(&mut self) {
        use std::fmt::Write;
        if self.open.is_empty() {
            return;
        }
        self.cards += 1;
        let (open, section, number) = (&self.open, self.section, self.cards);
        // Writing to a String cannot fail.
        let _ = match self.pointer {
            Some(pointer) => write!(self.text, "{open:<64} {pointer:>7}{section}{number:>7}"),
            None => write!(self.text, "{open:<72}{section}{number:>7}"),
        };
        self.text.push_str(self.end_of_line);
        self.open.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_have_eighty_columns_and_unbroken_numbers() {
        let mut section = CardWriter::new('P', "\n");
        section.point_to(3);
        for _ in 0..20 {
            section.token("1.23456789,");
        }
        section.end_card();
        assert_eq!(section.cards(), 4);
        let lines: Vec<&str> = section.text().lines().collect();
        assert!(lines.iter().all(|line| line.len() == 80));
        assert_eq!(&lines[3][..33], "1.23456789,1.23456789,1.23456789,");
        assert_eq!(&lines[3][64..], "       3P      4");
        let mut section = CardWriter::new('G', "\n");
        section.token("1H,,");
        section.token(&format!("100H{},", "x".repeat(100)));
        section.end_card();
        assert_eq!(section.cards(), 3);
    }

    #[test]
    fn lines_end_in_many_ways() {
        let lines = |text: &'static str| {
            Lines::new(text.as_bytes())
                .map(<[u8]>::len)
                .collect::<Vec<_>>()
        };
        assert_eq!(lines("a\nbc\r\nd\re"), [1, 2, 1, 1]);
        assert_eq!(lines("\n\n"), [0, 0]);
        let fixed: &'static str = Box::leak("x".repeat(240).into_boxed_str());
        assert_eq!(lines(fixed), [80, 80, 80]);
    }
}
